"""A design's start: an attitude command law of weak feedback, and the usual specifications."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.base.linear import Linear, Response, delay_fit, responses
from helisim.design.laws.attitude_command import AttitudeAxis, AttitudeCommand, YawAxis
from helisim.design.laws.law import Law, Lead
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.criteria import (
    ActuatorUse,
    AttitudeQuickness,
    Crossover,
    DisturbanceRejection,
    LoadRejection,
    PoleLimits,
)
from helisim.handling.criterion import froude_scale
from helisim.handling.figures import margins, rejection
from helisim.handling.limit import Limit
from helisim.handling.loop import GRID, NoResponse
from helisim.handling.spec import ATTITUDES, Spec, standard

_INVERTED = np.geomspace(1.0, 8.0, 20)  # rad/s, of the model's inverse
_LOOKS = np.geomspace(3.0, 15.0, 20)  # rad/s, where the swashplate's angle is found
_STICK = {"cyclic": 1.0, "pedals": 4.0}
"""rad and rad/s of a whole stick; the stick ends at one half."""
_MODEL = 5.0  # rad/s, of the command models at first
_WEAK = 0.2  # gain of the rate's loop at first, at low frequency
_HOLD = {"cyclic": 15.0, "pedals": 2.0}  # rad/s: ratio of attitude to rate in the feedback at first
# _YAW: rad/s, crossover of the yaw rate's loop at first
# _SLOW: rad/s: ratio of integral to attitude at first
_YAW, _SLOW = 5.0, 2.0
_LEAD = (40.0, 200.0)  # rad/s, zero and pole of the lead at first
_MOVED = {  # least and largest multiple of each moved parameter's start
    "k_angle": (0.05, 60.0),
    "k_rate": (0.2, 60.0),
    "k_integral": (0.3, 300.0),
    "filter_1.zero": (0.2, 4.0),
    "filter_1.pole": (0.3, 3.0),
    "frequency": (0.4, 4.0),
}
BETTER = {"lat": 1.3, "lon": 1.3, "ped": 1.0}
"""Disturbance rejection bandwidth over that of the law before."""
TASK = "ads33e_other_divided"
"""All tasks of ADS-33E-PRF but target acquisition, with divided attention."""
_LOADS = 1.5  # rejection bandwidth of the law before over the fastest load's frequency
_STIFFER = {True: 3.0, False: 0.0}
"""dB by which loads on its own command turn an axis less, and those on another's."""
_SLOWEST, _SPAN = 0.3, 3.0  # dB from Level 1 to the end of Level 2
_GROWTH = Limit(1e-3, 0.05)
_FAST = 30.0  # rad/s, limit of crossovers, or 3 dB more than that of the law before


def attitude_start(
    plant: Linear, *, period: float
) -> tuple[AttitudeCommand, dict[str, tuple[float, float]]]:
    """Return an attitude command law for a model, at a period (s), and bounds for its design.

    Raises InputError if the model lacks lat, lon, ped, p, q or r.
    """
    lacks = [name for name in ATTITUDES if name not in plant.inputs]
    lacks += [name for name in ("p", "q", "r") if name not in plant.outputs]
    if lacks:
        raise InputError(
            f"an attitude command law is of roll, pitch and yaw, and the model lacks "
            f"{', '.join(lacks)}: identify those axes too, or give a law of the others"
        )
    phase = _phase(plant)
    turned = _rates(plant, _INVERTED, ["p", "q"], ["lat", "lon"]) @ _turned(phase)
    (roll, pitch, ahead) = (
        _inverse(one[:, k, k], period)
        for one, k in ((turned, 0), (turned, 1), (_rates(plant, _INVERTED, ["r"], ["ped"]), 0))
    )
    law = AttitudeCommand(
        lat=AttitudeAxis(**_axis("cyclic", _WEAK * roll[0], *roll)),
        lon=AttitudeAxis(**_axis("cyclic", _WEAK * pitch[0], *pitch)),
        ped=YawAxis(**_axis("pedals", _YAW * ahead[1], *ahead)),
        phase=phase,
    )
    bounds = {"phase": (phase - 0.7, phase + 0.7)}
    started = law.parameters()
    for name, value in started.items():
        axis, _, key = name.partition(".")
        if key in _MOVED and value:
            low, high = sorted(times * value for times in _MOVED[key])
            bounds[name] = (low, high)
        elif key in ("k_angle_cross", "k_rate_cross"):  # to either side, as far as the axis's own
            most = 10.0 * abs(started[f"{axis}.{key.removesuffix('_cross')}"])
            bounds[name] = (-most, most)
    return law, bounds


def _axis(kind: str, k_rate: float, rate: float, acceleration: float) -> dict[str, Any]:
    return {
        "stick": _STICK[kind],
        "frequency": _MODEL,
        "k_angle": _HOLD[kind] * k_rate,
        "k_rate": k_rate,
        "k_integral": _SLOW * _HOLD[kind] * k_rate,
        "ff_rate": rate,
        "ff_acceleration": acceleration,
        "filters": (Lead(*_LEAD),),
    }


def _phase(plant: Linear) -> float:
    cyclic = _rates(plant, _LOOKS, ["p", "q"], ["lat", "lon"])
    angles = np.radians(np.arange(-90.0, 90.0, 0.5))

    def off(angle: float) -> float:
        size = np.sum(np.abs(cyclic @ _turned(angle)) ** 2, axis=0)
        return float((size[0, 1] + size[1, 0]) / (size[0, 0] + size[1, 1]))

    return float(angles[int(np.argmin([off(one) for one in angles]))])


def _turned(angle: float) -> NDArray[np.float64]:
    cosine, sine = math.cos(angle), math.sin(angle)
    return np.array([[cosine, sine], [-sine, cosine]])


def _rates(
    plant: Linear, frequency: NDArray[np.float64], outputs: list[str], inputs: list[str]
) -> Response:
    return np.moveaxis(responses(plant, frequency, outputs, inputs), -1, 0)


def _inverse(response: Response, period: float) -> tuple[float, float]:
    """Return the inverse c0 + c1 s of a rate over its command, (n_freq,), delayed by some ticks."""
    early = (-period * np.arange(31)).tolist()
    one = np.ones(response.size)
    c0, c1, _ = delay_fit(response, one, _INVERTED, early, lambda h: (h, 1j * _INVERTED * h))
    return c0, c1


def usual_specs(
    plant: Linear, before: Law, *, period: float, diameter: float, rate_limit: float
) -> tuple[Spec, ...]:
    """Return the specifications of a law that replaces another one on a small helicopter.

    Hard: stability, margins of 45 deg and 6 dB at the actuators. Soft, by Froude's law: bandwidth,
    phase delay and damping of ADS-33E-PRF, and its quickness where the law before has Level 1;
    disturbance rejection, with 1.3 times (yaw: 1 time) the bandwidth of the law before; loads that
    turn it less; crossover below 30 rad/s, or 1.4 times that of the law before. Objective: actuator
    use. `period` in s, `diameter` in m, `rate_limit` unitised, a second.
    """
    scale = froude_scale(diameter)
    loop = ClosedLoop(plant, before.linear(period), GRID)
    found = [Spec(PoleLimits(growth=_GROWTH), "hard")]
    found += [one for one in standard("margins") if not isinstance(one.criterion, PoleLimits)]
    for spec in standard("disturbance_rejection", scale=scale):
        axis = spec.criterion.axis
        own = rejection(loop.disturbance(axis)).bandwidth
        usual = spec.criterion.limits["drb"]
        wanted = Limit(BETTER[axis] * own, own if BETTER[axis] > 1.0 else 0.75 * own)
        if wanted.level1 > usual.level1:
            spec = replace(spec, criterion=DisturbanceRejection(axis=axis, bandwidth=wanted))
        found.append(spec)
        high = max(own / _LOADS, 2.0 * _SLOWEST)
        # a rotor turns what is done to one of its axes into the other
        for by in ("lat", "lon") if axis in ("lat", "lon") else (axis,):
            load = LoadRejection(axis=axis, by=by, low=_SLOWEST, high=high, turned=Limit(0, _SPAN))
            most = load.rate(loop).figures["turned"] - _STIFFER[by == axis]
            found.append(Spec(replace(load, turned=Limit(most, most + _SPAN))))
    for spec in standard(TASK, scale=scale):
        slow = isinstance(spec.criterion, AttitudeQuickness) and not _quick(spec.criterion, loop)
        found.append(replace(spec, kind="check") if slow else spec)
    for axis in ATTITUDES:
        # 3 dB, by which its own loads turn it less
        fast = max(_FAST, 10.0**0.15 * margins(loop.broken(axis, "actuators")).crossover)
        found += [
            Spec(Crossover(axis=axis, frequency=Limit(fast, 2.0 * fast))),
            Spec(ActuatorUse(axis=axis, rate_limit=rate_limit, scale=scale), "objective"),
        ]
    return tuple(found)


def _quick(criterion: AttitudeQuickness, loop: ClosedLoop) -> bool:
    try:
        return criterion.rate(loop).level == 1
    except NoResponse:  # a law without sticks
        return False
