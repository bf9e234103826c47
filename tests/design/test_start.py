"""What a design starts from: the inverse of the model, and the usual specifications."""

from types import SimpleNamespace

import numpy as np
import pytest
from small_design import SmallPlant

from helisim.base.errors import InputError
from helisim.base.linear import LinearSystem
from helisim.design.start import attitude_start, usual_specs
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.criteria import DisturbanceRejection
from helisim.handling.figures import rejection


class Helicopter:
    """Roll and pitch of a rotor that is turned, and yaw: rates over commands, first order."""

    inputs = ("lon", "lat", "ped")
    outputs = ("p", "q", "r", "phi", "theta", "psi")

    def __init__(self, angle: float):
        self.angle = angle

    def response(self, frequency):
        s = 1j * np.asarray(frequency)
        roll, pitch, yaw = 90.0 / (s + 10.0), 40.0 / (s + 5.0), 80.0 / (s + 0.5)
        cosine, sine, none = np.cos(self.angle), np.sin(self.angle), np.zeros_like(s)
        # the rotor turns lat and lon back by the angle before it answers
        rates = np.array(
            [
                [sine * roll, cosine * roll, none],
                [cosine * pitch, -sine * pitch, none],
                [none, none, yaw],
            ]
        )
        return np.concatenate([rates, rates / s])


@pytest.mark.parametrize("angle", [0.0, 0.2, -0.35])
def test_the_mix_undoes_what_the_rotor_turns_and_the_feed_forward_is_the_inverse(angle):
    """Of p over lat = 90 / (s + 10) the inverse is (s + 10) / 90, and so on."""
    law, _ = attitude_start(Helicopter(angle), period=0.002)
    assert law.phase == pytest.approx(-angle, abs=np.radians(0.5))  # its grid
    for axis, inverse in (("lat", (10 / 90, 1 / 90)), ("lon", (5 / 40, 1 / 40))):
        own = getattr(law, axis)
        # 1 %: the grid of angles leaves a sine of a quarter degree
        assert (own.ff_rate, own.ff_acceleration) == pytest.approx(inverse, rel=0.01)
    assert (law.ped.ff_rate, law.ped.ff_acceleration) == pytest.approx((0.5 / 80, 1 / 80))


def test_every_range_holds_its_start():
    law, bounds = attitude_start(Helicopter(0.2), period=0.002)
    own = law.parameters()
    assert {"lat.k_rate", "lon.k_angle", "ped.k_rate", "phase"} <= set(bounds)
    assert all(low <= own[name] <= high for name, (low, high) in bounds.items())


def test_a_model_without_yaw_is_said_so():
    with pytest.raises(InputError, match="the model lacks ped, r"):
        attitude_start(SmallPlant(), period=0.002)


def gains(gain):
    """Return a law from rates and angles of roll, pitch and yaw to their commands."""
    none = np.zeros((0, 0)), np.zeros((0, 6)), np.zeros((3, 0))
    fed = -gain * np.hstack([0.02 * np.eye(3), np.eye(3)])
    linear = LinearSystem(*none, fed, 0.002, Helicopter.outputs, ("lat", "lon", "ped"))
    return SimpleNamespace(linear=lambda period: linear)


@pytest.mark.parametrize("gain", [0.05, 1.0])
def test_rejection_is_asked_for_beyond_that_of_the_law_before(gain):
    """1.3 times in roll and pitch, but Froude's 0.9, 0.5 and 0.7 rad/s where these are more."""
    plant, law = Helicopter(0.0), gains(gain)
    asked = usual_specs(plant, law, period=0.002, diameter=1.534, rate_limit=10.0)
    faster = np.sqrt(16.36 / 1.534)
    for axis, times, least in (("lat", 1.3, 0.9), ("lon", 1.3, 0.5), ("ped", 1.0, 0.7)):
        own = rejection(ClosedLoop(plant, law.linear(0.002)).disturbance(axis)).bandwidth
        spec = next(
            one
            for one in asked
            if isinstance(one.criterion, DisturbanceRejection) and one.criterion.axis == axis
        )
        assert spec.kind == "soft"
        drb = spec.criterion.limits["drb"]
        assert drb.level1 == pytest.approx(max(times * own, faster * least))
        assert drb.level2 < drb.level1
    assert {one.kind for one in asked} == {"hard", "soft", "objective", "check"}
