"""What the IMU's lever arm does when it is left uncorrected."""

import pytest

from helisim.errors import InputError
from helisim.sim.trajectory import imu_offset
from helisim.study.lever_arm import lever_arm_study


@pytest.mark.slow
def test_an_uncorrected_lever_arm_moves_the_yaw_damping(jr700):
    """N_r by what the geometry says, heave by less than a percent, roll and pitch not at all."""
    found = {(one.model, one.name): one for one in lever_arm_study(jr700, flights=2, seed=1)}
    # an IMU ahead by x takes x r for side velocity, and conditioning on it gives N_r - N_v x
    ahead, base = imu_offset(jr700)[0], jr700.derivatives
    expected = -100.0 * base["N_v"] * ahead / abs(base["N_r"])
    assert expected == pytest.approx(-8.9, abs=0.1)
    # two sweeps: -7.4 to -9.1 % over seeds 1 and 2
    assert found["yaw_base", "N_r"].percent == pytest.approx(expected, abs=2.0)
    for name in ("Z_w", "Z_col"):
        assert 0.05 < abs(found["heave", name].percent) < 1.0  # 0.2 to 0.4 % measured
    # rates need no correction, so not a bit changes
    assert {one.percent for (model, _), one in found.items() if model == "rollpitch_in1"} == {0.0}


def test_a_study_without_flights_is_refused(jr700):
    """The message names the argument and what was received."""
    with pytest.raises(InputError, match="flights must be 1 or more, got 0"):
        lever_arm_study(jr700, flights=0)
