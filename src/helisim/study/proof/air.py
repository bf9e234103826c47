"""The exact loop over the air that a flight meets: what its records tend to in turbulence.

Slow gusts move the point that is linearised about. An estimate of a response is then the mean of
the responses there, and a broken loop follows from the mean of its sensitivity.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from helisim.handling.loop import Curve, History, Loop, NoResponse
from helisim.sim import Weather
from helisim.study.proof.exact import ExactLoop, exact_loop
from helisim.study.truth import air_met
from helisim.vehicle import Vehicle


@dataclass(frozen=True, eq=False)
class MeanLoop:
    """A `Loop` whose responses are the mean over several.

    Attributes:
        parts: share and loop of each; the shares sum to 1.
    """

    parts: tuple[tuple[float, ExactLoop], ...]

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes that are closed."""
        return self.parts[0][1].axes

    def broken(self, axis: str, at: str = "actuators") -> Curve:
        """Return the loop that follows from the mean sensitivity; see `Loop`."""
        mean = self._mean(lambda one: _sensitivity(one.broken(axis, at)))
        return Curve(mean.frequency, 1.0 / mean.response - 1.0)

    def disturbance(self, axis: str) -> Curve:
        """Return the mean of the angle over its disturbance; see `Loop`."""
        return self._mean(lambda one: one.disturbance(axis))

    def command(self, axis: str, output: str | None = None) -> Curve:
        """Return the mean of an output over the axis's stick; see `Loop`."""
        return self._mean(lambda one: one.command(axis, output))

    def turned(self, axis: str, by: str) -> Curve:
        """Return the mean of the angle over what is added to a command; see `Loop`."""
        return self._mean(lambda one: one.turned(axis, by))

    def actuator(self, axis: str, by: str = "stick") -> Curve:
        """Return the mean of the axis's command over its stick; see `Loop`."""
        return self._mean(lambda one: one.actuator(axis, by))

    @property
    def poles(self) -> NDArray[np.complex128]:
        """The poles, (n_pole,) rad/s: a mean has none."""
        raise NoResponse("a mean over the air has no poles")

    def step(self, axis: str, *, size: float, duration: float) -> History:
        """Return nothing: a mean has no step."""
        raise NoResponse("a mean over the air has no step")

    def _mean(self, response: Callable[[ExactLoop], Curve]) -> Curve:
        curves = [(share, response(one)) for share, one in self.parts]
        mean = np.sum([share * one.response for share, one in curves], axis=0)
        return Curve(curves[0][1].frequency, mean)


def exact_over(
    vehicle: Vehicle, weather: Weather, frequency: NDArray[np.float64] | None = None
) -> Loop:
    """Return the exact loop over the air that a vehicle meets: in calm air, that of its trim.

    Args:
        vehicle: with its controller.
        weather: whose steady wind and turbulence.
        frequency: (n_freq,) rad/s; `helisim.handling.loop.GRID` if None.

    Raises:
        TrimError: the vehicle can't hover in one of the winds.
        ModelError: the law can't hold it there.
    """
    met = air_met(vehicle, weather)
    parts = tuple((share, exact_loop(there, frequency)) for share, there in met)
    return parts[0][1] if len(parts) == 1 else MeanLoop(parts)


def _sensitivity(loop: Curve) -> Curve:
    return Curve(loop.frequency, 1.0 / (1.0 + loop.response))
