"""What a design starts from: the inverse of the model, and the usual specifications."""

from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from small_design import SmallPlant

from helisim.base.errors import InputError
from helisim.base.linear import LinearSystem
from helisim.design.start import attitude_start, usual_specs
from helisim.handling.closed_loop import ClosedLoop


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
    of_axes = [name for name in bounds if name != "phase" and not name.endswith("_cross")]
    assert all(0.0 < bounds[name][0] < own[name] for name in of_axes)  # moved by their logarithms


def test_a_start_is_weak_and_has_the_ratios_that_are_said():
    """Gain 0.2 of the rates' loops at rest, yaw's 1 at 5 rad/s; attitude 15 or 2, integral 2."""
    law, _ = attitude_start(Helicopter(0.0), period=0.002)
    low = (90.0 / 10.0, 40.0 / 5.0, 80.0 / 5.0)  # of yaw b / s
    for axis, plant, gain, hold in zip(
        (law.lat, law.lon, law.ped), low, (0.2, 0.2, 1.0), (15, 15, 2)
    ):
        own = (axis.k_rate * plant, axis.k_angle / axis.k_rate, axis.k_integral / axis.k_angle)
        assert own == pytest.approx((gain, hold, 2.0), rel=1e-6)
        assert (axis.frequency, axis.filters[0].zero, axis.filters[0].pole) == (5.0, 40.0, 200.0)
    assert (law.lat.stick, law.lon.stick, law.ped.stick) == (1.0, 1.0, 4.0)


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
def test_the_law_before_falls_short_by_as_much_as_more_is_asked_for(gain):
    """1.3 times the rejection in roll and pitch, but Froude's 0.9, 0.5 and 0.7 rad/s at least.

    To Level 2's end where a load is stiffened by 3 dB; else what it gives way is kept.
    """
    plant, law, faster = Helicopter(0.2), gains(gain), np.sqrt(16.36 / 1.534)
    loop = ClosedLoop(plant, law.linear(0.002))
    found = usual_specs(plant, law, period=0.002, diameter=1.534, rate_limit=10.0)
    assert {one.kind for one in found} == {"hard", "soft", "objective", "check"}
    hard = [(one.criterion.name, one.criterion.axis) for one in found if one.kind == "hard"]
    assert hard == [
        ("pole_limits", "all"),
        *(("stability_margins", one) for one in ("lat", "lon", "ped")),
    ]
    loads = {}
    for one in (one.criterion for one in found):
        known = one.name in ("disturbance_rejection", "load_rejection", "crossover")
        rated = one.rate(loop) if known else None
        if one.name == "disturbance_rejection":
            drb, limit = rated.figures["drb"], one.limits["drb"]
            times, ends, least = (1.0, 0.75, 0.7) if one.axis == "ped" else (1.3, 1.0, 0.9)
            least *= faster * (5.0 / 9.0 if one.axis == "lon" else 1.0)
            wanted = (times * drb, ends * drb) if times * drb > least else (least, 0.5 * least)
            assert (limit.level1, limit.level2) == pytest.approx(wanted)
            fastest = max(drb / 1.5, 0.6)
        elif one.name == "load_rejection":
            loads[one.axis, one.by] = round(one.turned.level2 - one.turned.level1, 9)
            assert rated.distance == pytest.approx(-float(one.by == one.axis), abs=1e-9)
            assert (one.low, one.high) == (0.3, pytest.approx(fastest))
        elif one.name == "crossover":  # which costs: less is better
            assert rated.distance == pytest.approx(1.0 - rated.figures["crossover"] / 30.0)
        elif one.name == "actuator_use":
            assert (one.rate_limit, one.scale) == (10.0, pytest.approx(faster**2))
    assert loads == dict.fromkeys([*product(("lat", "lon"), repeat=2), ("ped", "ped")], 3.0)
