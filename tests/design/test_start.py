"""What a design starts from: the inverse of the model, and the usual specifications."""

import numpy as np
import pytest
from small_design import SmallPlant

from helisim.base.errors import InputError
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
    law = attitude_start(Helicopter(angle), period=0.002).law
    assert law.phase == pytest.approx(-angle, abs=np.radians(0.5))  # its grid
    for axis, inverse in (("lat", (10 / 90, 1 / 90)), ("lon", (5 / 40, 1 / 40))):
        own = getattr(law, axis)
        # 1 %: the grid of angles leaves a sine of a quarter degree
        assert (own.ff_rate, own.ff_acceleration) == pytest.approx(inverse, rel=0.01)
        assert own.ff_delay == 0.0
    assert (law.ped.ff_rate, law.ped.ff_acceleration) == pytest.approx((0.5 / 80, 1 / 80))


def test_every_range_holds_its_start():
    start = attitude_start(Helicopter(0.2), period=0.002)
    own = start.law.parameters()
    assert {"lat.k_rate", "lon.k_angle", "ped.k_rate", "phase"} <= set(start.bounds)
    assert all(low <= own[name] <= high for name, (low, high) in start.bounds.items())


def test_a_model_without_yaw_is_said_so():
    with pytest.raises(InputError, match="the model lacks ped, r"):
        attitude_start(SmallPlant(), period=0.002)


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
