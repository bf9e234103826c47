"""What shakes the sensors: tones of the rotors at their speeds, the same with the same seed."""

import numpy as np
import pytest

from helisim.base.errors import ModelError
from helisim.sitl.link import Sensed
from helisim.sitl.vibration import Vibration
from helisim.vehicle.vehicle import standard_parameters

STILL = Sensed(0.0, np.zeros(3), np.array([0.0, 0.0, -9.81]), *np.zeros((2, 3)), np.eye(4)[0])


def felt(seed=1, speed=1.0, count=8192):
    shakes = Vibration(standard_parameters(), 1e-3, seed)
    return np.array([shakes.shaken(STILL, speed).gyro for _ in range(count)])


def test_tones_are_at_the_rotors_speeds_and_seeded():
    own = standard_parameters()
    sizes = np.abs(np.fft.rfft(felt() * np.hanning(8192)[:, None], axis=0)) / 2048.0
    for axis, turns, name in ((0, 1.0, "main"), (0, 2.0, "blade"), (2, 4.72, "tail")):
        k = round(turns * 28.333 * 8.192)  # beside which drift spreads it
        assert 0.4 < sizes[k - 25 : k + 26, axis].max() / own[f"vibration.{name}_rate"] < 1.1
    assert np.array_equal(felt(count=50), felt(count=50))
    assert not felt(speed=0.0, count=50).any()
    with pytest.raises(ModelError, match=r"vibration.main_rate.*JR700"):
        Vibration(standard_parameters("blade360"), 1e-3)
