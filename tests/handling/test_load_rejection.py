import numpy as np
import pytest
from attitude_loop import AttitudeLoop

from helisim.base.errors import InputError
from helisim.handling.criteria import Limit, LoadRejection
from helisim.handling.loop import NoResponse

LIMIT = Limit(0.0, 6.0)


def test_a_slow_load_turns_the_vehicle_as_a_spring_does():
    """Far below the bandwidth the angle is the load over the angle's gain: a servo's stiffness."""
    loop = AttitudeLoop(k=0.4)
    rating = LoadRejection(axis="lat", low=0.21, high=0.23, turned=LIMIT).rate(loop)
    # next is w k_rate / k of it in quadrature, 0.2 % at 0.21 rad/s: 0.02 dB
    assert rating.figures["turned"] == pytest.approx(20.0 * np.log10(1.0 / 0.4), abs=0.02)


def test_a_loop_that_is_left_open_gives_way_as_the_vehicle_alone():
    """Angle over command is b / w^2 below the lag: the most at the slowest load."""
    loop = AttitudeLoop(k=0.0, k_rate=0.0, lag=0.0)
    rating = LoadRejection(axis="lat", low=2.0, high=10.0, turned=LIMIT).rate(loop)
    slowest = rating.figures["frequency"]
    assert 2.0 <= slowest < 2.05  # 400 points over two and a half decades are 1.7 % apart
    assert rating.figures["turned"] == pytest.approx(20.0 * np.log10(40.0 / slowest**2), rel=1e-12)
    assert rating.level == 3


def test_borders_of_a_smaller_vehicle_are_of_faster_loads():
    asked = LoadRejection(axis="roll", high=2.0, turned=LIMIT, by="pitch", scale=4.0)
    assert (asked.axis, asked.by, asked.band) == ("lat", "lon", (0.6, 4.0))


def test_what_can_not_be_asked_is_said():
    with pytest.raises(InputError, match="0 < low < high"):
        LoadRejection(axis="lat", low=3.0, high=2.0, turned=LIMIT)
    with pytest.raises(NoResponse, match=r"known from 0\.2 to 150 rad/s"):
        LoadRejection(axis="lat", low=0.1, high=1.0, turned=LIMIT).rate(AttitudeLoop())
