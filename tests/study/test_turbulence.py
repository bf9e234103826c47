"""The base helicopter identified from flights in turbulence."""

import pytest

from helisim.errors import InputError
from helisim.sim import Weather
from helisim.study.turbulence import MAIN, mean_derivatives, turbulence_study

LIGHT = Weather(turbulence="light")


@pytest.fixture(scope="module")
def found(jr700):
    return {one.name: one for one in turbulence_study(jr700, weather=LIGHT, flights=10, seed=1)}


@pytest.mark.slow
@pytest.mark.parametrize("name", MAIN)
def test_the_joint_estimate_is_within_ten_percent_of_truth_in_light_turbulence(found, name):
    """Ten percent is what is asked for; no estimate is further off than its error explains."""
    one = found[name]
    assert abs(one.joint_percent) < 10.0
    # 3 standard errors and the 2 % by which motion within the sweep bends heave's Z_col
    assert abs(one.joint - one.truth) < 3.0 * one.joint_error + 0.02 * abs(one.truth)


@pytest.mark.slow
def test_the_direct_estimate_of_the_yaw_damping_is_biased(found):
    """The gyro answers each gust with the pedal, which adds its inverse to r/ped."""
    one = found["N_r"]
    assert one.direct_percent > abs(one.joint_percent)
    # more than scatter: the joint estimate's error is the larger of the two
    assert one.truth - one.direct > 2.0 * one.joint_error


def test_heave_is_damped_more_in_gusts_from_the_side(jr700):
    """Z_w grows with the square of the wind through the disc's plane, whatever its heading."""
    mean = mean_derivatives(jr700, LIGHT)
    level = LIGHT.dryden.rms[0]
    still, ahead = (jr700.trimmed(wind=(speed, 0.0, 0.0)).derivatives for speed in (0.0, level))
    # two axes of level wind, each adding its mean square; the rest is of fourth order
    expected = 2.0 * (ahead["Z_w"] - still["Z_w"])
    assert mean["Z_w"] - still["Z_w"] == pytest.approx(expected, rel=0.2)
    assert mean_derivatives(jr700, Weather())["Z_w"] == still["Z_w"]


def test_a_study_without_flights_is_refused(jr700):
    """The message names the argument and what was received."""
    with pytest.raises(InputError, match="flights must be 1 or more, got 0"):
        turbulence_study(jr700, weather=LIGHT, flights=0)
