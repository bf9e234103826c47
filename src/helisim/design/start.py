"""What a design starts from: an attitude command law, and the specifications that are usual.

The law's feed-forward is the inverse of the model; its feedback is weak, so that loops are as
stable as the aircraft alone; the design finds the rest.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.base.linear import Linear, Response
from helisim.base.settings import FrozenMap
from helisim.design.laws.attitude_command import AttitudeAxis, AttitudeCommand, YawAxis
from helisim.design.laws.law import Law, Lead
from helisim.handling.chart import Limit
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.criteria import (
    ActuatorOnset,
    ActuatorUse,
    Crossover,
    DisturbanceRejection,
    LoadRejection,
    PoleLimits,
)
from helisim.handling.criterion import Froude
from helisim.handling.figures import rejection
from helisim.handling.loop import GRID
from helisim.handling.spec import ATTITUDES, Spec, standard

_INVERTED = np.geomspace(1.0, 8.0, 20)
"""rad/s, where sticks work: the inverse of the model is taken there."""
_LOOKS = np.geomspace(3.0, 15.0, 20)
"""rad/s, around the crossover, where the swashplate's angle is found."""
_STICK = {"cyclic": 1.0, "pedals": 4.0}
"""rad and rad/s of a whole stick: 28 degrees of bank and 115 deg/s where it ends, at one half."""
_MODEL = 5.0
"""rad/s, of the command models at first."""
_WEAK = 0.2
"""Gain of the rate's loop at first, at low frequency."""
_HOLD = {"cyclic": 15.0, "pedals": 2.0}
"""rad/s: ratio of attitude to rate in the feedback at first. A rotor damps roll and pitch by
itself, so its attitude can be fed back with little rate; yaw needs its rate."""
_YAW = 5.0
"""rad/s, crossover of the yaw rate's loop at first. Yaw hardly damps itself: its acceleration tells
what a rate loop needs."""
_SLOW = 2.0
"""rad/s: ratio of integral to attitude at first."""
_LEAD = (40.0, 200.0)
"""rad/s, zero and pole of the lead at first."""
_MOVED = {
    "k_angle": (0.05, 60.0),
    "k_rate": (0.2, 60.0),
    "k_integral": (0.3, 300.0),
    "filter_1.zero": (0.2, 4.0),
    "filter_1.pole": (0.3, 3.0),
    "frequency": (0.4, 4.0),
}
"""Least and largest multiple of its start of each parameter that is moved, of one sign."""
BETTER = {"lat": 1.3, "lon": 1.3, "ped": 1.0}
"""Disturbance rejection bandwidth over that of the law before."""
TASK = "ads33e_other_divided"
"""Of ADS-33E-PRF: all tasks but target acquisition, with divided attention."""
_LOADS = 1.5
"""Times slower than the rejection bandwidth of the law before are the fastest loads."""
_STIFFER = {True: 3.0, False: 0.0}
"""dB by which loads on its own command turn an axis less, and those on another's."""
_SLOWEST = 0.3
"""rad/s, of loads: slower ones are the pilot's."""
_SPAN = 3.0
"""dB from Level 1 to the end of Level 2: 1.4 times as far."""
_GROWTH = Limit(1e-3, 0.05)
"""1/s: integrals of what is commanded stand at 0, but for rounding."""
_FAST = Limit(30.0, 60.0)
"""rad/s, of an objective: only how crossovers weigh against actuator use depends on it."""


@dataclass(frozen=True)
class Start:
    """A law and how far a design may move it.

    Attributes:
        law: where the search starts.
        bounds: least and largest value of each parameter that is moved, by name.
    """

    law: AttitudeCommand
    bounds: Mapping[str, tuple[float, float]]

    def __post_init__(self) -> None:
        object.__setattr__(self, "bounds", FrozenMap(self.bounds))


def attitude_start(plant: Linear, *, period: float) -> Start:
    """Return an attitude command law for a model of roll, pitch and yaw.

    Args:
        plant: from lat, lon, ped to p, q, r and their angles.
        period: s, between the law's ticks.

    Raises:
        InputError: the model lacks an axis.
    """
    lacks = [name for name in ATTITUDES if name not in plant.inputs]
    lacks += [name for name in ("p", "q", "r") if name not in plant.outputs]
    if lacks:
        raise InputError(
            f"an attitude command law is of roll, pitch and yaw, and the model lacks "
            f"{', '.join(lacks)}: identify those axes too, or give a law of the others"
        )
    phase = _phase(plant)
    turned = _cyclic_rates(plant, _INVERTED) @ _turned(phase)
    responses = [
        turned[:, 0, 0],
        turned[:, 1, 1],
        _rates(plant, _INVERTED, ["r"], ["ped"])[:, 0, 0],
    ]
    inverses = [_inverse(one, period) for one in responses]
    roll, pitch = (
        AttitudeAxis(
            **_axis("cyclic", math.copysign(_WEAK * abs(rate), rate), rate, acceleration, late)
        )
        for rate, acceleration, late in inverses[:2]
    )
    rate, acceleration, late = inverses[2]
    yaw = YawAxis(**_axis("pedals", _YAW * acceleration, rate, acceleration, late))
    law = AttitudeCommand(lat=roll, lon=pitch, ped=yaw, phase=phase)
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
    return Start(law, bounds)


def _axis(
    kind: str, k_rate: float, rate: float, acceleration: float, late: float
) -> dict[str, Any]:
    """Return an axis's numbers: the inverse of its model ahead of a feedback of some rate gain."""
    return {
        "stick": _STICK[kind],
        "frequency": _MODEL,
        "k_angle": _HOLD[kind] * k_rate,
        "k_rate": k_rate,
        "k_integral": _SLOW * _HOLD[kind] * k_rate,
        "ff_rate": rate,
        "ff_acceleration": acceleration,
        "ff_delay": late,
        "filters": (Lead(*_LEAD),),
    }


def _phase(plant: Linear) -> float:
    """Return the angle by which lat and lon are turned so that rates off their axes are least."""
    cyclic = _cyclic_rates(plant, _LOOKS)
    angles = np.radians(np.arange(-90.0, 90.0, 0.5))

    def off(angle: float) -> float:
        size = np.sum(np.abs(cyclic @ _turned(angle)) ** 2, axis=0)
        return float((size[0, 1] + size[1, 0]) / (size[0, 0] + size[1, 1]))

    return float(angles[int(np.argmin([off(one) for one in angles]))])


def _turned(angle: float) -> NDArray[np.float64]:
    """Return what lat and lon get of the law's pair, (2, 2)."""
    cosine, sine = math.cos(angle), math.sin(angle)
    return np.array([[cosine, sine], [-sine, cosine]])


def _cyclic_rates(plant: Linear, frequency: NDArray[np.float64]) -> Response:
    return _rates(plant, frequency, ["p", "q"], ["lat", "lon"])


def _rates(
    plant: Linear, frequency: NDArray[np.float64], outputs: list[str], inputs: list[str]
) -> Response:
    """Return some responses, (n_freq, n_out, n_in)."""
    rows = [plant.outputs.index(name) for name in outputs]
    columns = [plant.inputs.index(name) for name in inputs]
    return np.moveaxis(plant.response(frequency)[np.ix_(rows, columns)], -1, 0)


def _inverse(response: Response, period: float) -> tuple[float, float, float]:
    """Return the inverse c0 + c1 s of a rate over its command, (n_freq,), and how late it is, s.

    Command over the rate and over its derivative, SI. Least squares of the relative error, the
    delay found with it.
    """
    best = (np.inf, 0.0, 0.0, 0.0)
    for late in (period * np.arange(31)).tolist():
        without = response * np.exp(1j * _INVERTED * late)
        columns = np.stack([without, 1j * _INVERTED * without], axis=1)
        both = np.concatenate([np.real(columns), np.imag(columns)])
        wanted = np.concatenate([np.ones(response.size), np.zeros(response.size)])
        found, *_ = np.linalg.lstsq(both, wanted)
        residual = float(np.sum((both @ found - wanted) ** 2))
        best = min(best, (residual, late, float(found[0]), float(found[1])))
    return best[2], best[3], best[1]


def usual_specs(
    plant: Linear, before: Law, *, period: float, diameter: float, rate_limit: float
) -> tuple[Spec, ...]:
    """Return what is asked of a law that replaces another one on a small helicopter.

    Hard: stability, and margins of 45 deg and 6 dB at the actuators. Soft: bandwidth, phase delay
    and damping of ADS-33E-PRF, and rejection of disturbances, scaled by Froude's law; in
    roll and pitch 1.3 times the rejection bandwidth of the law before, in yaw as much as that,
    where this is more; and slow loads, as of gusts, turn the vehicle less far than with the law
    before. Objective: crossovers, and what the actuators do. The rest of the standards is checked.

    Args:
        plant: nominal.
        before: the law that is replaced.
        period: s, between ticks.
        diameter: of the rotor, m.
        rate_limit: of the servos' commands, unitised, a second.
    """
    scale = Froude.of(diameter).ratio
    loop = ClosedLoop(plant, before.linear(period), GRID)
    found = [Spec(PoleLimits(growth=_GROWTH), "hard")]
    found += [one for one in standard("margins") if not isinstance(one.criterion, PoleLimits)]
    for spec in standard("disturbance_rejection", scale=scale):
        axis = spec.criterion.axis
        own = rejection(loop.disturbance(axis)).bandwidth
        usual = spec.criterion.limits["drb"]
        wanted = Limit(BETTER[axis] * own, own if BETTER[axis] > 1.0 else 0.75 * own)
        if isinstance(usual, Limit) and wanted.level1 > usual.level1:
            spec = replace(spec, criterion=DisturbanceRejection(axis=axis, bandwidth=wanted))
        found.append(spec)
        high = max(own / _LOADS, 2.0 * _SLOWEST)
        # a rotor turns what is done to one of its axes into the other
        for by in ("lat", "lon") if axis in ("lat", "lon") else (axis,):
            load = LoadRejection(axis=axis, by=by, low=_SLOWEST, high=high, turned=Limit(0, _SPAN))
            most = load.rate(loop).figures["turned"] - _STIFFER[by == axis]
            found.append(Spec(replace(load, turned=Limit(most, most + _SPAN))))
    found += standard(TASK, scale=scale)
    for axis in ATTITUDES:
        found += [
            Spec(Crossover(axis=axis, frequency=_FAST), "objective"),
            Spec(ActuatorUse(axis=axis, rate_limit=rate_limit, scale=scale), "objective"),
            Spec(ActuatorOnset(axis=axis, rate_limit=rate_limit), "check"),
        ]
    return tuple(found)
