"""Places of a vehicle's three servos under its swashplate, and how they share its motion (CCPM).

A servo whose ball link stands at an angle from the nose, towards the left, and at an arm of the
unit in which cyclic is counted, moves by col + arm (cos(angle) lon + sin(angle) lat), or by as
much the other way where it is reversed.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import ModelError
from helisim.physics import servo
from helisim.physics.layout import PARAM

SERVOS = ("front", "left", "right")
"""The three in the order of the actuators. "front" is the elevator's servo, wherever it stands."""

_PLATE = slice(PARAM.mix_front_col, PARAM.unmix_lat_over + 1)
_EXACT = np.array([0.0, 0.5, np.sqrt(0.5), 0.5 * np.sqrt(3.0), 1.0])
"""Sines and cosines of whole multiples of 30 and 45 degrees, which rounding would miss."""
_ROUNDING = 1e-12
_FLATTEST = 1e-3
"""Area that the three span, of arms of 1, below which a degree of tilt asks for all travel."""


@dataclass(frozen=True, eq=False)
class Swashplate:
    """The mixing of three servos under one swashplate.

    Attributes:
        numbers: (21,) as the compiled force laws read them, from `PARAM.mix_front_col` on.
    """

    numbers: NDArray[np.float64]

    def __post_init__(self) -> None:
        numbers = np.array(self.numbers, dtype=np.float64)
        numbers.setflags(write=False)
        object.__setattr__(self, "numbers", numbers)

    @classmethod
    def of(cls, parameters: Mapping[str, float]) -> "Swashplate":
        """Return a vehicle's, by its parameters `swashplate.front_angle` and so on.

        Raises:
            ModelError: an arm or a sign is none, or the servos can't tilt the swashplate.
        """
        rows = np.array([_row(parameters, name) for name in SERVOS])
        signs = np.array([parameters[f"swashplate.{name}_sign"] for name in SERVOS])
        back = _adjugate(rows)
        area = float(back[0].sum())
        if not abs(area) > _FLATTEST:
            degrees = [np.degrees(parameters[f"swashplate.{name}_angle"]) for name in SERVOS]
            raise ModelError(
                "the servos of the swashplate stand too nearly in one line to tilt it both ways: "
                f"{', '.join(f'{angle:g}' for angle in degrees)} degrees; change "
                "swashplate.front_angle, left_angle or right_angle"
            )
        numbers = [*(signs[:, None] * rows).ravel()]
        for row, moved in zip(back, rows.T):
            whole = row / np.min(np.abs(row[np.abs(row) > _ROUNDING]))
            numbers += [*(signs * whole), whole @ moved]
        return cls(np.array(numbers))

    @classmethod
    def in_block(cls, par: NDArray[np.float64]) -> "Swashplate":
        """Return that of a vehicle's numbers, (n_param,), as in its model."""
        return cls(par[_PLATE])

    def write(self, par: NDArray[np.float64]) -> None:
        """Put it into a vehicle's numbers, (n_param,)."""
        par[_PLATE] = self.numbers

    def mix(self, col: Any, lon: Any, lat: Any) -> tuple[Any, Any, Any]:
        """Return the front, left and right servo's position; numbers or arrays of one shape."""
        return servo.mix(self.numbers, col, lon, lat)

    def unmix(self, front: Any, left: Any, right: Any) -> tuple[Any, Any, Any]:
        """Return col, lon and lat of three servo positions; numbers or arrays of one shape."""
        return servo.unmix(self.numbers, front, left, right)

    def least_travel(self, cyclic: float) -> float:
        """Return the least that some servo is away from its middle at this much lon or lat."""
        columns = np.array(self.unmix(*np.eye(3)))[1:]
        return cyclic / float(np.abs(columns).sum(axis=1).max())


def as_it_is() -> Swashplate:
    """Return one whose front, left and right servo are col, lon and lat themselves."""
    back = np.hstack([np.eye(3), np.ones((3, 1))])
    return Swashplate(np.concatenate([np.eye(3).ravel(), back.ravel()]))


def _row(parameters: Mapping[str, float], name: str) -> list[float]:
    arm = parameters[f"swashplate.{name}_arm"]
    if not arm > 0.0:
        raise ModelError(f"swashplate.{name}_arm must be positive, got {arm:g}")
    sign = parameters[f"swashplate.{name}_sign"]
    if sign not in (-1.0, 1.0):
        raise ModelError(
            f"swashplate.{name}_sign must be 1, or -1 for a reversed servo, got {sign:g}"
        )
    angle = parameters[f"swashplate.{name}_angle"]
    return [1.0, arm * _exact(np.cos(angle)), arm * _exact(np.sin(angle))]


def _exact(value: float) -> float:
    near = _EXACT[int(np.argmin(np.abs(_EXACT - abs(value))))]
    return float(np.copysign(near, value)) if abs(near - abs(value)) < _ROUNDING else float(value)


def _adjugate(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the inverse of rows (1, x, y), (3, 3), times its determinant."""
    _, x, y = rows.T
    after, last = np.array([1, 2, 0]), np.array([2, 0, 1])
    return np.array(
        [x[after] * y[last] - x[last] * y[after], y[after] - y[last], x[last] - x[after]]
    )
