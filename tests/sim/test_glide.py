"""Ways from rest to rest and from speed to speed: what a mission's pilot follows."""

import math

import numpy as np
import pytest

from helisim.base.errors import InputError
from helisim.sim.missions.autopilot import Glide, Ramp


@pytest.mark.parametrize("way", [Ramp(2.0, 7.0, 1.5), Glide(30.0, 4.0, 1.5), Glide(1.0, 4.0, 1.5)])
def test_references_are_smooth(way):
    """Distance is the integral of speed, this of the acceleration, which keeps its limit."""
    time = np.linspace(0.0, way.lasts, 20_001)
    distance, speed, acceleration = np.array([way.at(one) for one in time]).T
    step = time[1]
    summed = step * np.cumsum(0.5 * (speed[1:] + speed[:-1]))
    assert np.allclose(distance[1:], summed, atol=1e-6)
    assert np.allclose(
        np.diff(speed), 0.5 * step * (acceleration[1:] + acceleration[:-1]), atol=1e-6
    )
    assert np.abs(acceleration).max() <= way.acceleration * (1.0 + 1e-9)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Glide(3.0, -1.0, 1.0), "a speed and an acceleration above 0, got 3, -1 and 1"),
        (lambda: Glide(math.nan, 1.0, 1.0), "a finite distance"),
        (lambda: Ramp(0.0, 5.0, 0.0), "acceleration above 0, got 5 and 0"),
    ],
)
def test_a_way_that_can_not_be_flown_is_refused(make, says):
    """In a line, where a script asks for it."""
    with pytest.raises(InputError, match=says):
        make()


def test_a_glide_ends_at_rest_where_it_was_to_end():
    """Neither a long way nor a short one is overshot."""
    for way in (Glide(30.0, 4.0, 1.5), Glide(0.3, 4.0, 1.5), Glide(0.0, 4.0, 1.5)):
        assert way.at(way.lasts) == pytest.approx((way.distance, 0.0, 0.0), abs=1e-9)
        assert way.top <= 4.0
