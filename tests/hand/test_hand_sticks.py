"""From keys and axes to the deflection of four sticks, without window or helicopter."""

from types import SimpleNamespace

import pytest

from helisim.base.errors import InputError
from helisim.hand.sticks import Deflection, Joystick, Sticks, choose, read_axes

RADIO, PAD = Joystick(0, "OpenTX Radio"), Joystick(1, "Pad", is_gamepad=True)


def held(sticks, keys, seconds, *, climbs=False, frame=0.02):
    for _ in range(round(seconds / frame)):
        found = sticks.deflection(keys, None, frame, climbs=climbs)
    return found


def test_keys_move_the_cyclic_and_let_it_centre():
    """0.3 s from the middle to the stop, which is 0.35 of the travel; 0.12 s back."""
    keys = Sticks()
    assert held(keys, {"right"}, 0.16, frame=0.01).lat == pytest.approx(0.35 * 0.16 / 0.3)
    assert held(keys, {"right"}, 1.0).lat == 0.35
    assert held(keys, set(), 0.06).lat == pytest.approx(0.175)
    assert held(keys, set(), 0.12).lat == 0.0
    assert held(keys, {"up"}, 1.0).lon == -0.35
    assert held(keys, {"up", "down"}, 1.0).lon == 0.0
    assert held(keys, {"d", "left"}, 1.0)[2:] == (-0.35, 0.35)


def test_the_collective_of_keys_stays():
    """It goes on from where it was taken up; where it commands a climb it centres instead."""
    keys = Sticks()
    keys.collective = 0.2
    assert held(keys, {"w"}, 0.5).col == pytest.approx(0.2 + 0.35 * 2.0 / 2.5, abs=0.02)
    stays = held(keys, set(), 0.5).col
    assert held(keys, set(), 5.0).col == stays
    assert held(keys, {"s"}, 5.0).col == -1.0
    assert held(keys, {"w"}, 1.0, climbs=True).col == 1.0
    assert held(keys, set(), 1.0, climbs=True).col == 0.0


@pytest.mark.parametrize(
    ("mode", "left", "right"), [(1, "lon", "col"), (2, "col", "lon"), (3, "lon", "col")]
)
def test_modes_are_those_of_transmitters(mode, left, right):
    """Modes 1 and 3 have the collective on the right; 1 and 2 roll with the right thumb."""
    pad = Sticks(PAD, mode=mode)
    up = pad.deflection((), (0.0, 1.0, 1.0, 0.0), 0.1, climbs=True)
    assert getattr(up, left) == (-1.0 if left == "lon" else 1.0)  # away from the pilot: nose down
    assert (up.lat, up.ped) == ((1.0, 0.0) if mode in (1, 2) else (0.0, 1.0))
    assert getattr(pad.deflection((), (0.0, 0.0, 0.0, 1.0), 0.1, climbs=True), right) != 0.0


def test_channels_of_a_transmitter_and_how_they_feel():
    """TAER: throttle first, and it stays. Beyond 0.02 of rest the others are softer: expo 0.3."""
    radio = Sticks(RADIO, order="taer")
    found = radio.deflection((), (0.7, 0.51, 0.01, -1.0), 1.0, climbs=False)
    assert found == pytest.approx(Deflection(col=0.7, lat=0.7 * 0.5 + 0.3 / 8.0, lon=0.0, ped=-1.0))
    assert radio.deflection((), None, 0.1, climbs=True) is None
    with pytest.raises(InputError, match="needs 4 axes, one each stick; OpenTX Radio has 3"):
        radio.deflection((), (0.0,) * 3, 0.1, climbs=True)


def test_a_gamepads_thumb_moves_the_collective_on():
    """Half a second at the stop of 2.5 s from stop to stop; let go, it stays."""
    pad = Sticks(PAD)
    pad.collective = -0.2
    for axes in ((0.0, 1.0, 0.0, 0.0), (0.0,) * 4):
        assert pad.deflection((), axes, 0.5, climbs=False).col == pytest.approx(0.2)


def glfw(*there):
    """Return GLFW with joysticks."""
    names = {one.number: one.name for one in there}
    pads = [one.number for one in there if one.is_gamepad]
    state = SimpleNamespace(axes=(0.1, 0.2, 0.3, 0.4, -1.0, -1.0))
    return SimpleNamespace(
        JOYSTICK_1=0,
        JOYSTICK_LAST=15,
        joystick_present=names.__contains__,
        get_joystick_name=lambda n: names[n].encode(),
        joystick_is_gamepad=pads.__contains__,
        get_gamepad_state=lambda n: state if n in pads else None,
        get_joystick_axes=lambda n: ([0.5, -0.5, 9.0], 2) if n in names else ([], 0),
    )


def test_joysticks_are_found_by_number_or_name():
    """The only one, one of several; what there is if none fits. A gamepad's triggers are none."""
    assert choose(glfw(PAD), "") == PAD
    both = glfw(RADIO, PAD)
    assert choose(both, "1") == PAD
    assert choose(both, "Radio") == RADIO
    for there, wanted, said in (
        (glfw(), "", "no joystick '': there are none; .*plug one in"),
        (both, "2", "no joystick '2': there are 0 'OpenTX Radio', 1 'Pad'"),
        (both, "", "several joysticks fit"),
    ):
        with pytest.raises(InputError, match=said):
            choose(there, wanted)
    assert read_axes(both, RADIO) == (0.5, -0.5)
    assert read_axes(both, PAD) == (0.1, -0.2, 0.3, -0.4)  # up is 1
    assert read_axes(glfw(), RADIO) is None
    assert read_axes(glfw(), PAD) is None
