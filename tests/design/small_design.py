"""A small aircraft and a small law: roll and pitch of a rotor that couples them, as matrices."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from helisim.handling.closed_loop import ClosedLoop

Matrix = NDArray[np.float64]
OUTPUTS = ("p", "q", "phi", "theta")
_SERVO, _DAMPED, _DELAY = 60.0, 0.7, 0.012


@dataclass(frozen=True, eq=False)
class SmallPlant:
    """Servos, a first-order delay, a disc that follows, rates and angles.

    Attributes:
        damping: 1/s of roll and pitch.
        power: rad/s2 per unit of lat and of lon.
        coupling: 1/s of each by the other's rate.
    """

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

    def response(self, frequency: Matrix) -> NDArray[np.complex128]:
        """Return C (jw - A)^-1 B."""
        a, b, c = self.matrices
        point = 1j * frequency[:, None, None] * np.eye(10)
        return np.moveaxis(c @ np.linalg.solve(point - a, b), 0, -1)

    def draws(self, count: int, *, seed: int) -> "tuple[SmallPlant, ...]":
        """Return plants whose numbers err by 3 %."""
        rng = np.random.default_rng(seed)
        off = 1.0 + 0.03 * rng.standard_normal((count, 5))
        return tuple(
            SmallPlant(
                (self.damping[0] * one[0], self.damping[1] * one[1]),
                (self.power[0] * one[2], self.power[1] * one[3]),
                self.coupling * one[4],
            )
            for one in off
        )


@dataclass(frozen=True)
class SmallLaw:
    """Angle and rate to lat and lon, each by a gain."""

    gains: Mapping[str, float] = field(
        default_factory=lambda: {
            "lat.k_angle": 0.1,
            "lat.k_rate": 0.02,
            "lon.k_angle": 0.1,
            "lon.k_rate": 0.02,
        }
    )

    def parameters(self) -> dict[str, float]:
        """Return the gains."""
        return dict(self.gains)

    def replace(self, changes: Mapping[str, float]) -> "SmallLaw":
        """Return it with other gains."""
        return replace(self, gains={**self.gains, **changes})

    def linear(self, period: float) -> "SmallLinear":
        """Return what it does, at any period."""
        return SmallLinear(self.gains)


@dataclass(frozen=True)
class SmallLinear:
    """Gains as responses."""

    gains: Mapping[str, float]
    inputs = (*OUTPUTS, "LAT", "LON")
    outputs = ("lat", "lon")

    @property
    def matrix(self) -> Matrix:
        """(2, 6)."""
        g = self.gains
        return np.array(
            [
                [-g["lat.k_rate"], 0.0, -g["lat.k_angle"], 0.0, g["lat.k_angle"], 0.0],
                [0.0, -g["lon.k_rate"], 0.0, -g["lon.k_angle"], 0.0, g["lon.k_angle"]],
            ]
        )

    def response(self, frequency: Matrix) -> NDArray[np.complex128]:
        """Return the gains, (2, 6, n_freq)."""
        return np.repeat(self.matrix[:, :, None], frequency.size, axis=2).astype(np.complex128)


class SmallLoop(ClosedLoop):
    """With the poles of A + B K C."""

    @cached_property
    def poles(self) -> NDArray[np.complex128]:
        """(10,) rad/s."""
        a, b, c = self.plant.matrices
        return np.linalg.eigvals(a + b @ self.law.matrix[:, :4] @ c).astype(np.complex128)
