"""From thumbs, keys and axes to the deflection of four sticks, without window or helicopter."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helisim.base.errors import InputError, StorageError, UnknownNameError
from helisim.hand import (
    Axis,
    Deflection,
    Gimbals,
    Inputs,
    JoystickMap,
    JoystickSticks,
    KeyboardSticks,
    StickFeel,
)
from helisim.hand.sticks import sticks_of

UNIT = st.floats(-1.0, 1.0)


@pytest.mark.parametrize(
    ("mode", "left_up", "right_up"),
    [(1, "lon", "col"), (2, "col", "lon"), (3, "lon", "col"), (4, "col", "lon")],
)
def test_modes_are_those_of_transmitters(mode, left_up, right_up):
    """Modes 1 and 3 have the collective on the right; 1 and 2 roll with the right thumb."""
    up = sticks_of(Gimbals(left_y=1.0), mode)
    assert getattr(up, left_up) == (-1.0 if left_up == "lon" else 1.0)  # away: nose down
    assert getattr(sticks_of(Gimbals(right_y=1.0), mode), right_up) != 0.0
    rolls = sticks_of(Gimbals(right_x=1.0), mode)
    assert (rolls.lat, rolls.ped) == ((1.0, 0.0) if mode in (1, 2) else (0.0, 1.0))


def test_a_mode_that_is_none_is_refused():
    with pytest.raises(UnknownNameError, match=r"transmitter mode 5.*1, 2, 3, 4"):
        sticks_of(Gimbals(), 5)


def test_rate_expo_and_deadband():
    """By hand: beyond 0.2 of deadband, 0.6 is half; half is 0.5 (0.5 + 0.5 / 4) with expo 0.5."""
    feel = StickFeel(rate=0.8, expo=0.5, deadband=0.2)
    felt = feel.felt(Deflection(col=0.1, lon=-0.6, lat=0.2, ped=3.0))
    assert felt.col == 0.1
    assert felt.lon == pytest.approx(-0.8 * 0.5 * (0.5 + 0.5 / 4.0))
    assert felt.lat == 0.0
    assert felt.ped == pytest.approx(0.8)
    assert feel.felt(Deflection(col=-1.0)) == Deflection(col=-1.0)


@given(UNIT, UNIT)
def test_more_deflection_is_more_stick(one, other):
    """No kink turns back, and both sides are alike."""
    feel = StickFeel(rate=0.7, expo=0.9, deadband=0.1)
    low, high = sorted((one, other))
    assert feel.felt(Deflection(lat=low)).lat <= feel.felt(Deflection(lat=high)).lat
    assert feel.felt(Deflection(ped=-one)).ped == -feel.felt(Deflection(ped=one)).ped


@pytest.mark.parametrize("setting", [{"rate": 0.0}, {"expo": 1.1}, {"deadband": 1.0}])
def test_a_feel_that_can_not_be_is_refused(setting):
    with pytest.raises(InputError, match=next(iter(setting))):
        StickFeel(**setting)


def held(device, keys, seconds, *, climbs=False, frame=0.02):
    for _ in range(round(seconds / frame)):
        found = device.deflection(Inputs(frozenset(keys)), frame, climbs=climbs)
    return found


def test_keys_move_the_cyclic_and_let_it_centre():
    """Half the press time deflects by half; let go, it is back in the release time."""
    keys = KeyboardSticks(mode=2, press_time=0.4, release_time=0.2)
    assert held(keys, {"right"}, 0.2).lat == pytest.approx(0.5)
    assert held(keys, {"right"}, 1.0).lat == 1.0
    assert held(keys, set(), 0.1).lat == pytest.approx(0.5)
    assert held(keys, set(), 0.12).lat == 0.0
    assert held(keys, {"up"}, 1.0).lon == -1.0
    assert held(keys, {"up", "down"}, 1.0).lon == 0.0
    assert held(keys, {"down", "shift"}, 1.0).lon == pytest.approx(0.35)
    assert held(keys, {"d", "left"}, 1.0)[2:] == (-1.0, 1.0)


def test_the_collective_of_keys_stays():
    """It goes on from where it was taken up; where it commands a climb it centres instead."""
    keys = KeyboardSticks(mode=2)
    keys.take_up(0.2)
    assert held(keys, {"w"}, 0.5).col == pytest.approx(0.2 + 0.5 * 2.0 / 2.5)
    assert held(keys, set(), 5.0).col == pytest.approx(0.6)
    assert held(keys, {"s"}, 5.0).col == -1.0
    assert held(keys, {"w"}, 1.0, climbs=True).col == 1.0
    assert held(keys, set(), 1.0, climbs=True).col == 0.0
    assert held(keys, set(), 1.0).col == -1.0


def test_the_same_keys_are_another_stick_in_another_mode():
    assert held(KeyboardSticks(mode=1), {"w"}, 1.0).lon == -1.0
    assert held(KeyboardSticks(mode=4), {"a"}, 1.0).lat == -1.0


def test_an_axis_has_its_stops_and_its_middle():
    """A worn stick: -0.8 to 0.9 about 0.1; reversed, the same from the other side."""
    axis = Axis(1, -0.8, 0.1, 0.9)
    read = [axis.deflection((0.0, one)) for one in (-2.0, -0.8, -0.35, 0.1, 0.5, 0.9, 1.0)]
    assert read == pytest.approx([-1.0, -1.0, -0.5, 0.0, 0.5, 1.0, 1.0])
    reverse = Axis(1, 0.9, 0.1, -0.8)
    assert reverse.deflection((0.0, -0.35)) == pytest.approx(0.5)
    with pytest.raises(InputError, match=r"has 1 axes.*no axis 1.*map"):
        axis.deflection((0.0,))


@pytest.mark.parametrize("readings", [(-1.0, 1.0, 1.0), (0.0, -1.0, 1.0), (-1.0, 0.0, np.nan)])
def test_an_axis_without_order_is_refused(readings):
    with pytest.raises(InputError):
        Axis(0, *readings)


def test_channels_of_a_transmitter():
    """TAER: throttle first. Up and right read 1."""
    found = JoystickMap.transmitter("taer").deflection((0.1, 0.2, 0.3, 0.4))
    assert found == pytest.approx(Deflection(col=0.1, lat=0.2, lon=-0.3, ped=0.4))
    with pytest.raises(InputError, match=r"A, E, T and R once.*'AETT'"):
        JoystickMap.transmitter("AETT")


def test_thumbs_of_a_gamepad():
    """Its y axes point down. Mode 2: the left thumb lifts, the right one away is nose down."""
    found = JoystickMap.gamepad(2).deflection((0.1, -0.2, 0.3, -0.4))
    assert found == pytest.approx(Deflection(ped=0.1, col=0.2, lat=0.3, lon=-0.4))
    found = JoystickMap.gamepad(1).deflection((0.1, -0.2, 0.3, -0.4))
    assert found == pytest.approx(Deflection(ped=0.1, lon=-0.2, lat=0.3, col=0.4))


def test_a_throttle_stick_is_the_collective_and_a_gamepads_moves_it():
    """A transmitter's stays where it is put; a gamepad's thumb goes back to the middle."""
    radio = JoystickSticks(JoystickMap.transmitter())
    inputs = Inputs(axes=(0.0, 0.0, 0.7, 0.0))
    assert radio.deflection(inputs, 1.0, climbs=False).col == pytest.approx(0.7)
    pad = JoystickSticks(JoystickMap.gamepad(), feel=StickFeel(expo=0.0, deadband=0.0))
    pad.take_up(-0.2)
    up, middle = Inputs(axes=(0.0, -1.0, 0.0, 0.0)), Inputs(axes=(0.0,) * 4)
    assert pad.deflection(up, 0.5, climbs=False).col == pytest.approx(0.2)
    assert pad.deflection(middle, 0.5, climbs=False).col == pytest.approx(0.2)
    assert pad.deflection(up, 0.5, climbs=True).col == pytest.approx(1.0)


def test_a_joystick_that_is_gone_is_none():
    radio = JoystickSticks(JoystickMap.transmitter())
    assert radio.deflection(Inputs(), 0.1, climbs=True) is None


def test_a_map_comes_back_from_its_file(tmp_path):
    found = JoystickMap(
        col=Axis(2, 0.9, 0.05, -0.8), lon=Axis(1), lat=Axis(0), ped=Axis(5), centring=True
    )
    found.write(tmp_path / "radio.toml")
    assert JoystickMap.read(tmp_path / "radio.toml") == found


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[lat]\nnumber = 0\n", r"radio.toml: map.*col"),
        ("sticks = 4\n", "radio.toml: .*sticks.*centring"),
        ("[col]\nnumber = -1\n[lon]\n[lat]\n[ped]\n", r"radio.toml: map.col.number must be"),
        ("[col]\nnumber = 0\nmid = 3\n[lon]\n[lat]\n[ped]\n", r"map.col.*mid.*centre"),
        ("[col]\nnumber = 0\nlow = 'a'\n[lon]\n[lat]\n[ped]\n", r"map.col.low must be a number"),
        ("[col]\n[lon]\n[lat]\n[ped]\n", r"map.col.*number"),
        ("centring = 1\n[col]\n[lon]\n[lat]\n[ped]\n", "map.centring must be true or false"),
    ],
)
def test_a_map_that_is_none_says_where(tmp_path, text, said):
    (tmp_path / "radio.toml").write_text(text)
    with pytest.raises(InputError, match=said):
        JoystickMap.read(tmp_path / "radio.toml")


def test_a_map_that_is_not_there(tmp_path):
    with pytest.raises(StorageError, match="no such file"):
        JoystickMap.read(tmp_path / "none.toml")
