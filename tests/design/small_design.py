"""A small aircraft, law and specifications: roll and pitch of a rotor that couples them."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from helisim.base.linear import LinearSystem
from helisim.handling.criteria import Criterion, Crossover, Limit, Rating, StabilityMargins
from helisim.handling.figures import rejection
from helisim.handling.spec import Spec

Matrix = NDArray[np.float64]
OUTPUTS = ("p", "q", "phi", "theta")
_SERVO, _DAMPED, _DELAY = 60.0, 0.7, 0.012
PERIOD = 0.0002
"""s, of ticks at which it is nearly continuous."""


@dataclass(frozen=True, eq=False)
class SmallPlant:
    """Servos, a delay, a disc that follows, rates and angles; 1/s, rad/s^2 a unit, 1/s."""

    damping: tuple[float, float] = (14.0, 7.0)
    power: tuple[float, float] = (120.0, 70.0)
    coupling: float = 2.0

    inputs = ("lat", "lon")
    outputs = OUTPUTS

    @cached_property
    def matrices(self) -> tuple[Matrix, Matrix, Matrix]:
        """A, B, C, continuous."""
        servo = np.array([[0.0, 1.0], [-(_SERVO**2), -2.0 * _DAMPED * _SERVO]])
        late = 2.0 / _DELAY  # (late - s) / (late + s)
        a = block_diag(servo, servo, -late, -late, np.zeros((4, 4)))
        a[4, 0] = a[5, 2] = 1.0
        b = np.zeros((10, 2))
        b[1, 0] = b[3, 1] = _SERVO**2
        for k, (damping, power) in enumerate(zip(self.damping, self.power)):
            a[6 + k, 4 + k], a[6 + k, 2 * k] = 2.0 * late * power, -power
            a[6 + k, 6 + k] = -damping
            a[6 + k, 7 - k] = -self.coupling if k else self.coupling
            a[8 + k, 6 + k] = 1.0
        return a, b, np.eye(10)[6:]

    @cached_property
    def continuous(self) -> LinearSystem:
        return LinearSystem(*self.matrices, np.zeros((4, 2)), None, self.inputs, OUTPUTS)

    def response(self, frequency: Matrix) -> NDArray[np.complex128]:
        return self.continuous.response(frequency)

    @cached_property
    def sampled(self) -> LinearSystem:
        return self.continuous.discretise(PERIOD)

    def draws(self, count: int, *, seed: int) -> "tuple[SmallPlant, ...]":
        rng = np.random.default_rng(seed)
        off = 1.0 + 0.03 * rng.standard_normal((count, 5))
        return tuple(
            SmallPlant(self.damping * one[:2], self.power * one[2:4], self.coupling * one[4])
            for one in off
        )


START = {"lat.k_angle": 0.1, "lat.k_rate": 0.02, "lon.k_angle": 0.1, "lon.k_rate": 0.02}


@dataclass(frozen=True)
class SmallLaw:
    """Angle and rate to lat and lon, each by a gain."""

    gains: Mapping[str, float] = field(default_factory=lambda: START)

    def parameters(self) -> dict[str, float]:
        return dict(self.gains)

    def replace(self, changes: Mapping[str, float]) -> "SmallLaw":
        return replace(self, gains={**self.gains, **changes})

    def linear(self, period: float) -> LinearSystem:
        g, none = self.gains, (np.zeros((0, 0)), np.zeros((0, 6)), np.zeros((2, 0)))
        matrix = [
            [-g["lat.k_rate"], 0.0, -g["lat.k_angle"], 0.0, g["lat.k_angle"], 0.0],
            [0.0, -g["lon.k_rate"], 0.0, -g["lon.k_angle"], 0.0, g["lon.k_angle"]],
        ]
        return LinearSystem(*none, matrix, PERIOD, (*OUTPUTS, "LAT", "LON"), ("lat", "lon"))


@dataclass(frozen=True, kw_only=True)
class Rejects(Criterion):
    """Bandwidth of disturbance rejection alone."""

    bandwidth: Limit
    name: ClassVar[str] = "rejects"
    units: ClassVar[dict[str, str]] = {"bandwidth": "rad/s"}
    borders: ClassVar[dict[str, tuple[str, int]]] = {"bandwidth": ("bandwidth", 0)}

    def rate(self, loop) -> Rating:
        return self.rated({"bandwidth": rejection(loop.disturbance(self.axis)).bandwidth})


def small_specs(*, lat: float = 16.0, lon: float = 11.0) -> tuple[Spec, ...]:
    """Return margins, least bandwidths of rejection in roll and pitch, rad/s, least crossover."""
    wanted = {"lat": Limit(lat, 0.5 * lat), "lon": Limit(lon, 0.5 * lon)}
    least = Limit(20.0, 40.0)
    return (
        *(Spec(StabilityMargins(axis=axis), "hard") for axis in wanted),
        *(Spec(Rejects(axis=axis, bandwidth=limit), "soft") for axis, limit in wanted.items()),
        *(Spec(Crossover(axis=axis, frequency=least), "objective") for axis in wanted),
    )
