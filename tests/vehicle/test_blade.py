"""From a blade to eq. (8): against the flapping of one blade, and back."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helisim.base.errors import InputError, ModelError
from helisim.vehicle.swashplate import Flapping, TipPathPlane, flapping_from_blade, lock_reduction
from one_blade import OneBlade

TABLE_3 = Flapping(
    tau_f=0.04456,
    a_b=-0.3514,
    b_a=0.5340,
    a_lat=0.06571,
    a_lon=0.3697,
    b_lat=0.3778,
    b_lon=-0.0607,
)
"""Wu and Chen, Table 3, IN1."""


def steady(found: Flapping, lat=0.0, lon=0.0, p=0.0, q=0.0):
    """Return the tilts at which eq. (8) rests."""
    asked = [
        found.a_lat * lat + found.a_lon * lon - found.tau_f * q,
        found.b_lat * lat + found.b_lon * lon - found.tau_f * p,
    ]
    return np.linalg.solve([[1.0, -found.a_b], [-found.b_a, 1.0]], asked)


@pytest.mark.parametrize("direction", [1.0, pytest.param(-1.0, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("lock", "frequency"), [(2.0, 1.0), (2.0, 1.07), (5.0, 1.0), (8.0, 1.03), (10.0, 1.12)]
)
@pytest.mark.parametrize(
    "flown",
    [{"p": 0.5}, {"q": 0.5}, {"lat": 0.1}, {"lon": 0.1}],
    ids=lambda flown: next(iter(flown)),
)
def test_a_steady_disc_is_that_of_one_blade(direction, lock, frequency, flown):
    """A blade integrated in the rotating frame, in a steady turn and with cyclic."""
    found = flapping_from_blade(
        lock_number=lock,
        speed=100.0,
        direction=direction,
        flap_frequency=frequency,
        lon_range=0.3,
        lat_range=0.25,
    )
    blade = OneBlade(
        lock=lock,
        spring=frequency**2 - 1.0,
        direction=direction,
        rates=(flown.get("p", 0.0), flown.get("q", 0.0)),
        cyclic=(0.3 * flown.get("lon", 0.0), 0.25 * flown.get("lat", 0.0)),
    )
    _, a, b = blade.steady()
    size = np.hypot(a, b)
    # nothing is neglected in a steady state: 60 strips miss the moment by 1 / (2 x 60^2), and 1e-6
    # of the beginning is left
    assert steady(found, **flown) == pytest.approx([a, b], abs=3e-4 * size)


def test_the_swashplates_phase_turns_the_tilt_with_the_blades():
    """A quarter turn of a clockwise disc takes a tilt back to the left, one to the right back."""
    turned = flapping_from_blade(
        lock_number=1e-6,  # no air: no coupling of its own
        speed=100.0,
        direction=1.0,
        lon_range=0.3,
        lat_range=0.2,
        phase=0.5 * np.pi,
    )
    assert turned.b_lon == pytest.approx(-0.3)
    assert turned.a_lat == pytest.approx(0.2)
    assert [turned.a_lon, turned.b_lat] == pytest.approx([0.0, 0.0], abs=1e-6)


sizes = st.floats(0.01, 0.5)


@given(
    tau=st.floats(0.005, 0.3),
    couplings=st.tuples(sizes, sizes),
    cyclic=st.tuples(*[st.floats(-0.5, 0.5)] * 4),
    speed=st.floats(20.0, 300.0),
    direction=st.sampled_from([1.0, -1.0]),
)
def test_there_and_back(tau, couplings, cyclic, speed, direction):
    """Eq. (8) has one disc behind it, which has that eq. (8)."""
    given = Flapping(
        tau_f=tau,
        a_b=-direction * couplings[0],
        b_a=direction * couplings[1],
        a_lat=cyclic[0],
        a_lon=cyclic[1],
        b_lat=cyclic[2],
        b_lon=cyclic[3],
    )
    disc = TipPathPlane.behind(given, speed=speed, direction=direction)
    again = disc.flapping(speed=speed, direction=direction)
    # rounding, where a short time constant makes the air strong: share up to 10
    assert again.to_parameters() == pytest.approx(given.to_parameters(), rel=1e-11, abs=1e-11)
    assert np.trace(disc.springs) == pytest.approx(0.0, abs=1e-11)


def test_thin_air_couples_as_the_blades_own_equation_says():
    """At nine tenths of the density the same blade with the same spring is another eq. (8)."""
    blade = {"speed": 100.0, "direction": -1.0, "lon_range": 0.3, "lat_range": 0.3}
    here = flapping_from_blade(lock_number=6.0, flap_frequency=1.05, **blade)
    there = flapping_from_blade(lock_number=5.4, flap_frequency=1.05, **blade)
    disc = TipPathPlane.behind(here, speed=100.0, direction=-1.0)
    scaled = disc.scaled(air=0.9).flapping(speed=100.0, direction=-1.0)
    assert scaled.to_parameters() == pytest.approx(there.to_parameters(), rel=1e-12)


def test_the_papers_disc():
    """Lock number of Table 3, and a swashplate turned by 16 degrees, the same for both axes."""
    disc = TipPathPlane.behind(TABLE_3, speed=178.0235837, direction=1.0)
    assert 16.0 * disc.share == pytest.approx(1.91, abs=0.005)
    a_lat, a_lon, b_lat, b_lon = disc.cyclic.ravel()
    assert np.degrees(np.arctan2(a_lat, b_lat)) == pytest.approx(16.7, abs=0.05)
    assert np.degrees(np.arctan2(-b_lon, a_lon)) == pytest.approx(16.1, abs=0.05)


def test_inflow_reduces_locks_number_as_printed():
    """Padfield, Helicopter Flight Dynamics, ch. 3: 1 + a s / (16 lambda)."""
    assert lock_reduction(6.0, 0.08, 0.05) == pytest.approx(1.6)


def test_couplings_of_the_other_sense_of_rotation_are_refused():
    with pytest.raises(ModelError, match="turns the other way"):
        TipPathPlane.behind(
            Flapping(tau_f=0.01, a_b=2.0, b_a=-2.0, a_lat=0.0, a_lon=0.3, b_lat=0.3, b_lon=0.0),
            speed=100.0,
            direction=1.0,
        )


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"lock_number": 0.0}, "lock_number must be a positive number, got 0"),
        ({"speed": -1.0}, "speed must be a positive number, got -1"),
        ({"direction": 0.5}, "direction must be 1 or -1, got 0.5"),
        ({"flap_frequency": 0.9}, "flap_frequency must be 1, of a teetering rotor, or more"),
    ],
)
def test_what_no_rotor_has_is_refused(wrong, said):
    usual = {
        "lock_number": 8.0,
        "speed": 27.0,
        "direction": -1.0,
        "lon_range": 0.3,
        "lat_range": 0.3,
    }
    with pytest.raises(InputError, match=said):
        flapping_from_blade(**{**usual, **wrong})
