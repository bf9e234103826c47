"""The servos' own bench: what a sweep of their commands tells, with honest errors."""

import numpy as np
import pytest

from helisim.base.errors import InputError
from helisim.sim.rigs import StickSweep
from helisim.study.experiment import servo_test
from helisim.vehicle import load


@pytest.mark.slow
def test_the_servos_are_found_within_their_errors():
    """Of another vehicle's servos than the shipped one's, four numbers within 3.5 errors each."""
    changed = {
        "servo.swash_frequency": 170.0,
        "servo.swash_damping": 0.6,
        "servo.tail_frequency": 190.0,
        "servo.tail_damping": 0.9,
    }
    found = servo_test(load("jr700", parameters=changed), seed=3)
    assert [one.name for one in found.findings] == [
        "swash_omega",
        "swash_zeta",
        "tail_omega",
        "tail_zeta",
    ]
    assert [one.truth for one in found.findings] == list(changed.values())
    for one in found.findings:
        assert abs(one.error) < 3.5 * one.standard_error
        # so that the bench says something at all
        assert one.standard_error < 0.05 * one.value


def test_a_sweep_of_a_stick_rests_before_and_after():
    """Nothing in the first and the last second; it stays within its amplitude."""
    sweep = StickSweep(amplitude=0.01, duration=12.0)
    time = np.linspace(0.0, 12.0, 2401)
    stick = sweep.control(time)
    assert np.max(np.abs(stick)) == pytest.approx(0.01, rel=0.02)  # it may miss the very crest
    assert not np.any(stick[(time <= 1.0) | (time >= 11.0)])
    with pytest.raises(InputError, match="duration must leave time"):
        StickSweep(duration=1.5)
    with pytest.raises(InputError, match="w_min < w_max"):
        StickSweep(band=(3.0, 2.0))
