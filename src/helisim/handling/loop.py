"""A vehicle with its control law, seen as responses: what every criterion is asked of.

Signs are the field's: a broken loop is L of negative feedback, and -1 is the critical point.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import HelisimError
from helisim.handling.curve import Curve

GRID = np.geomspace(0.2, 150.0, 400)
"""rad/s, where responses are computed unless others are asked for."""


class NoResponse(HelisimError):
    """A loop does not know a response that a criterion asks for."""


@dataclass(frozen=True, eq=False)
class History:
    """Signals over time.

    Attributes:
        time: (n_time,) s.
        signals: name -> (n_time,), SI.
    """

    time: NDArray[np.float64]
    signals: Mapping[str, NDArray[np.float64]]


class Loop(Protocol):
    """What criteria ask of a closed loop; each may raise `NoResponse`. Axes as in `axis`."""

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes that are closed, by the names of their commands."""
        ...

    def broken(self, axis: str, at: str = "actuators") -> Curve:
        """Return the loop L of one axis, all others closed.

        Args:
            axis: of control.
            at: "actuators": cut at the axis's servo command. "sensors": cut where its attitude is
                sensed, angle and rate together. Or one sensor, such as "p".
        """
        ...

    def disturbance(self, axis: str) -> Curve:
        """Return the sensed angle over a disturbance of it, S = 1 / (1 + L) at the sensors.

        The disturbance turns what is sensed: d is added to the angle, its derivative to the rate.
        """
        ...

    def command(self, axis: str, output: str | None = None) -> Curve:
        """Return an output over the axis's stick: by default its own angle, of heave w."""
        ...

    def turned(self, axis: str, by: str) -> Curve:
        """Return the axis's angle, of heave w, over what is added to a servo command.

        Args:
            axis: whose angle.
            by: axis of the command, its own or another; all loops stay closed.
        """
        ...

    def actuator(self, axis: str, by: str = "stick") -> Curve:
        """Return the axis's servo command over its stick, or over its "disturbance"."""
        ...

    @property
    def poles(self) -> NDArray[np.complex128]:
        """The poles of the whole closed loop in the s-plane, (n_pole,) rad/s."""
        ...

    def step(self, axis: str, *, size: float, duration: float) -> History:
        """Return stick, commands, angles and rates after a step of a stick.

        Args:
            axis: whose stick.
            size: unitised stick.
            duration: s; the step is at 0.
        """
        ...
