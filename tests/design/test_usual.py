"""The usual specifications of a small helicopter."""

import numpy as np
import pytest
from test_start import Helicopter

from helisim.design.start import usual_specs
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.criteria import DisturbanceRejection
from helisim.handling.figures import rejection


class Gains:
    """Rates and angles of roll, pitch and yaw to their commands."""

    inputs = ("p", "q", "r", "phi", "theta", "psi")
    outputs = ("lat", "lon", "ped")

    def __init__(self, gain: float):
        self.gain = gain

    def linear(self, period):
        return self

    def response(self, frequency):
        one = -self.gain * np.hstack([0.02 * np.eye(3), np.eye(3)])
        return np.repeat(one[:, :, None], frequency.size, axis=2).astype(complex)


@pytest.mark.parametrize("gain", [0.05, 1.0])
def test_rejection_is_asked_for_beyond_that_of_the_law_before(gain):
    """1.3 times in roll and pitch, but Froude's 0.9, 0.5 and 0.7 rad/s where these are more."""
    plant, law = Helicopter(0.0), Gains(gain)
    asked = usual_specs(plant, law, period=0.002, diameter=1.534, rate_limit=10.0)
    faster = np.sqrt(16.36 / 1.534)
    for axis, times, least in (("lat", 1.3, 0.9), ("lon", 1.3, 0.5), ("ped", 1.0, 0.7)):
        own = rejection(ClosedLoop(plant, law).disturbance(axis)).bandwidth
        spec = next(
            one
            for one in asked
            if isinstance(one.criterion, DisturbanceRejection) and one.criterion.axis == axis
        )
        assert spec.kind == "soft"
        assert spec.criterion.limits["drb"].level1 == pytest.approx(
            max(times * own, faster * least)
        )
        assert spec.criterion.limits["drb"].level2 < spec.criterion.limits["drb"].level1


def test_all_kinds_are_there():
    specs = usual_specs(Helicopter(0.0), Gains(1.0), period=0.002, diameter=1.534, rate_limit=10.0)
    assert {one.kind for one in specs} == {"hard", "soft", "objective", "check"}
