"""The law that a design starts from: attitude command, its feed-forward the inverse of a model.

Its feedback is weak, so that loops are as stable as the aircraft alone; the design finds the rest.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.base.linear import Linear
from helisim.base.value import FrozenMap
from helisim.design.laws.attitude_command import AttitudeAxis, AttitudeCommand, HeaveAxis, YawAxis
from helisim.design.laws.filters import Lead

Response = NDArray[np.complex128]

_INVERTED = np.geomspace(1.0, 8.0, 20)
"""rad/s, where sticks work: the inverse of the model is taken there."""
_LOOKS = np.geomspace(3.0, 15.0, 20)
"""rad/s, around the crossover, where the swashplate's angle is found."""
_STICK = {"cyclic": 1.0, "pedals": 4.0}
"""rad and rad/s of a whole stick: 28 degrees of bank and 115 deg/s where it ends, at one half."""
_MODEL = {"cyclic": 5.0, "pedals": 5.0}
"""rad/s, of the command models at first."""
_WEAK = 0.2
"""Gain of the rate's loop at first, at low frequency."""
_HOLD = {"cyclic": 15.0, "pedals": 2.0}
"""rad/s: ratio of attitude to rate in the feedback at first. A rotor damps roll and pitch by
itself, so its attitude can be fed back with little rate; yaw needs its rate."""
_YAW = 5.0
"""rad/s, crossover of the yaw rate's loop at first."""
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
_CROSSED = ("k_angle_cross", "k_rate_cross")
"""Moved too, to either side, as far as a multiple of the axis's own gain."""


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
    lacks = [name for name in ("lat", "lon", "ped") if name not in plant.inputs]
    lacks += [name for name in ("p", "q", "r") if name not in plant.outputs]
    if lacks:
        raise InputError(
            f"an attitude command law is of roll, pitch and yaw, and the model lacks "
            f"{', '.join(lacks)}: identify those axes too, or give a law of the others"
        )
    phase = _phase(plant)
    axes = ("lat", "lon", "ped")
    roll, pitch, yaw = (_inverse(_own(plant, name, phase), period) for name in axes)
    law = AttitudeCommand(
        lat=_cyclic(roll),
        lon=_cyclic(pitch),
        ped=_yaw(yaw),
        col=HeaveAxis(),
        phase=phase,
    )
    return Start(law, _bounds(law))


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
    """Return p and q over lat and lon, (n_freq, 2, 2)."""
    rows = [plant.outputs.index(name) for name in ("p", "q")]
    columns = [plant.inputs.index(name) for name in ("lat", "lon")]
    return np.moveaxis(plant.response(frequency)[np.ix_(rows, columns)], -1, 0)


def _own(plant: Linear, name: str, phase: float) -> Response:
    """Return an axis's rate over the law's own command of it, turned, (n_freq,)."""
    if name == "ped":
        response = plant.response(_INVERTED)
        return response[plant.outputs.index("r"), plant.inputs.index("ped")]
    place = ("lat", "lon").index(name)
    return (_cyclic_rates(plant, _INVERTED) @ _turned(phase))[:, place, place]


@dataclass(frozen=True)
class _Inverse:
    """Of a rate over its command: command over the rate and over its derivative, SI, late by s."""

    rate: float
    acceleration: float
    late: float


def _inverse(response: Response, period: float) -> _Inverse:
    """Return the inverse c0 + c1 s of a response, (n_freq,), and how late the product is.

    Least squares of the relative error, the delay found with it.
    """
    delays = period * np.arange(31)
    best = (np.inf, 0.0, 0.0, 0.0)
    for late in delays.tolist():
        without = response * np.exp(1j * _INVERTED * late)
        columns = np.stack([without, 1j * _INVERTED * without], axis=1)
        both = np.concatenate([np.real(columns), np.imag(columns)])
        wanted = np.concatenate([np.ones(response.size), np.zeros(response.size)])
        found, *_ = np.linalg.lstsq(both, wanted)
        left = float(np.sum((both @ found - wanted) ** 2))
        best = min(best, (left, late, float(found[0]), float(found[1])))
    return _Inverse(best[2], best[3], best[1])


def _cyclic(inverse: _Inverse) -> AttitudeAxis:
    rate = _WEAK * abs(inverse.rate)
    return AttitudeAxis(
        stick=_STICK["cyclic"],
        frequency=_MODEL["cyclic"],
        k_angle=math.copysign(_HOLD["cyclic"] * rate, inverse.rate),
        k_rate=math.copysign(rate, inverse.rate),
        k_integral=math.copysign(_SLOW * _HOLD["cyclic"] * rate, inverse.rate),
        ff_rate=inverse.rate,
        ff_acceleration=inverse.acceleration,
        ff_delay=inverse.late,
        filters=(Lead(*_LEAD),),
    )


def _yaw(inverse: _Inverse) -> YawAxis:
    # yaw hardly damps itself: its acceleration tells what a rate loop needs
    rate = _YAW * inverse.acceleration
    return YawAxis(
        stick=_STICK["pedals"],
        frequency=_MODEL["pedals"],
        k_angle=_HOLD["pedals"] * rate,
        k_rate=rate,
        k_integral=_SLOW * _HOLD["pedals"] * rate,
        ff_rate=inverse.rate,
        ff_acceleration=inverse.acceleration,
        ff_delay=inverse.late,
        filters=(Lead(*_LEAD),),
    )


def _bounds(law: AttitudeCommand) -> dict[str, tuple[float, float]]:
    """Return ranges of what is moved: gains to a multiple of their start, of one sign."""
    found = {"phase": (law.phase - 0.7, law.phase + 0.7)}
    started = law.parameters()
    for name, value in started.items():
        axis, _, key = name.partition(".")
        if key in _MOVED and value:
            low, high = sorted(times * value for times in _MOVED[key])
            found[name] = (low, high)
        elif key in _CROSSED:
            most = 10.0 * abs(started[f"{axis}.{key.removesuffix('_cross')}"])
            found[name] = (-most, most)
    return found
