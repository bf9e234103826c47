import numpy as np
import pytest
from attitude_loop import AttitudeLoop

from helisim.errors import InputError
from helisim.handling.criteria import Limit, LoadRejection
from helisim.handling.loop import NoResponse

LIMIT = Limit(0.0, 6.0)


def test_a_slow_load_turns_the_vehicle_as_a_spring_does():
    """Far below the bandwidth the angle is the load over the angle's gain: a servo's stiffness."""
    loop = AttitudeLoop(k=0.4)
    rating = LoadRejection(axis="lat", frequency=0.21, turned=LIMIT).rate(loop)
    # next is w k_rate / k of it in quadrature, 0.2 % at 0.21 rad/s: 0.02 dB
    assert rating.figures["turned"] == pytest.approx(20.0 * np.log10(1.0 / 0.4), abs=0.02)


def test_a_loop_that_is_left_open_gives_way_as_the_vehicle_alone():
    """Angle over command is b / w^2 below the lag: its closed form."""
    loop = AttitudeLoop(k=0.0, k_rate=0.0, lag=0.0)
    rating = LoadRejection(axis="lat", frequency=2.0, turned=LIMIT).rate(loop)
    # straight lines between 400 points of two and a half decades err by less than 0.01 dB
    assert rating.figures["turned"] == pytest.approx(20.0 * np.log10(40.0 / 4.0), abs=0.01)
    assert rating.level == 3


def test_two_loads_add_as_squares():
    """Both alike: 3 dB more than one."""
    loop = AttitudeLoop()
    one = LoadRejection(axis="lat", frequency=2.0, turned=LIMIT).rate(loop).figures["turned"]
    asked = LoadRejection(axis="lat", frequency=2.0, turned=LIMIT, by="lat+pitch")
    assert asked.by == "lat+lon"
    two = asked.rate(loop).figures["turned"]
    assert two - one == pytest.approx(10.0 * np.log10(2.0), rel=1e-12)


def test_what_can_not_be_asked_is_said():
    with pytest.raises(InputError, match="above 0 rad/s"):
        LoadRejection(axis="lat", frequency=0.0, turned=LIMIT)
    with pytest.raises(NoResponse, match=r"known from 0\.2 to 150 rad/s"):
        LoadRejection(axis="lat", frequency=0.1, turned=LIMIT).rate(AttitudeLoop())
