"""From a blade to eq. (8): against the flapping of one blade, and back."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helisim.base.errors import InputError, ModelError
from helisim.vehicle.swashplate import Flapping, TipPathPlane, flapping_from_blade
from one_blade import OneBlade

TABLE_3 = Flapping(
    tau_f=0.04456, a_b=-0.3514, b_a=0.5340, a_lat=0.06571, a_lon=0.3697, b_lat=0.3778, b_lon=-0.0607
)
"""Wu and Chen, Table 3, IN1."""


def steady(found: Flapping, lat=0.0, lon=0.0, p=0.0, q=0.0):
    """Return the tilts at which eq. (8) rests."""
    asked = [
        found.a_lat * lat + found.a_lon * lon - found.tau_f * q,
        found.b_lat * lat + found.b_lon * lon - found.tau_f * p,
    ]
    return np.linalg.solve([[1.0, -found.a_b], [-found.b_a, 1.0]], asked)


@pytest.mark.parametrize(
    ("direction", "lock", "frequency", "flown"),
    [
        pytest.param(1.0, 2.0, 1.07, {"p": 0.5}, marks=pytest.mark.slow),
        (-1.0, 5.0, 1.0, {"q": 0.5}),
        pytest.param(1.0, 8.0, 1.03, {"lat": 0.1}, marks=pytest.mark.slow),
        (-1.0, 10.0, 1.12, {"lon": 0.1}),
        pytest.param(1.0, 2.0, 1.0, {"lon": 0.1}, marks=pytest.mark.slow),
    ],
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


def test_the_papers_disc():
    """Lock number of Table 3, and a swashplate turned by 16 degrees, the same for both axes."""
    disc = TipPathPlane.behind(TABLE_3, speed=178.0235837, direction=1.0)
    assert 16.0 * disc.share == pytest.approx(1.91, abs=0.005)
    a_lat, a_lon, b_lat, b_lon = disc.cyclic.ravel()
    assert np.degrees(np.arctan2(a_lat, b_lat)) == pytest.approx(16.7, abs=0.05)
    assert np.degrees(np.arctan2(-b_lon, a_lon)) == pytest.approx(16.1, abs=0.05)


def test_couplings_of_the_other_sense_of_rotation_are_refused():
    with pytest.raises(ModelError, match="turns the other way"):
        TipPathPlane.behind(
            Flapping(tau_f=0.01, a_b=2.0, b_a=-2.0, a_lat=0.0, a_lon=0.3, b_lat=0.3, b_lon=0.0),
            speed=100.0,
            direction=1.0,
        )


def test_what_no_rotor_has_is_refused():
    usual = {"speed": 27.0, "direction": -1.0, "lon_range": 0.3, "lat_range": 0.3}
    for wrong in ({"lock_number": 0.0}, {"lock_number": 8.0, "flap_frequency": 0.9}):
        with pytest.raises(InputError, match="a positive lock_number and speed"):
            flapping_from_blade(**usual, **wrong)
