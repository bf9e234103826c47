"""The exact loop of a vehicle with its law: the sampled linearisation, as criteria ask of it."""

import copy
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial.hermite_e import hermegauss
from numpy.typing import NDArray

from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.loop import GRID, Curve, History, Loop, NoResponse
from helisim.physics.layout import PARAM
from helisim.sim import Weather
from helisim.vehicle import Vehicle
from helisim.vehicle.sampled import sensed_base
from helisim.vehicle.trim import addresses

Array = NDArray[np.float64]
Air = tuple[tuple[float, Vehicle], ...]
"""Shares of the time, which sum to 1, and a vehicle trimmed in each wind that it meets."""


def exact_loop(vehicle: Vehicle, frequency: Sequence[float] | Array | None = None) -> ClosedLoop:
    """Return the exact linear loop of a vehicle with its controller, sampled at the gyro's ticks.

    Nothing is approximated but the linearisation about the trim itself: the airframe with its
    servos is sampled exactly between ticks, the law is differentiated, the latencies of the gyro
    and of the pedal are theirs. The pilot is not part of it.

    Args:
        vehicle: with its controller.
        frequency: (n_freq,) rad/s; `helisim.handling.loop.GRID` if None.

    Raises:
        InputError: no law moves any servo.
        ModelError: the law can't hold the trim, or the gyro's latency is no whole number of ticks.
    """
    gyro = vehicle.gyro
    sensed = sensed_base(vehicle.linearize("IN1"), gyro, imu=vehicle.imu_offset)
    airframe = sensed.select(outputs=[name for name in sensed.outputs if " " not in name])
    airframe = replace(airframe, d=0.0 * airframe.d)
    pedal = {name: late for name, late in gyro.delays.items() if name == "PED"}
    law = replace(gyro, delays=pedal).with_delays_as_states()
    return ClosedLoop(airframe, law, np.asarray(GRID if frequency is None else frequency, float))


def hands_off(vehicle: Vehicle) -> Vehicle:
    """Return the vehicle with a pilot who moves only the collective, to keep the height.

    Cyclic stick and pedals stay where they are trimmed: what he answers there would be part of
    the loops that are measured.

    Args:
        vehicle: with its controller.
    """
    model, gains = copy.copy(vehicle.model), ("k_attitude", "k_heading")
    block = model.actuator_user[addresses(model).rotor].copy()
    block[[getattr(PARAM, f"pilot_{name}") for name in gains]] = 0.0
    model.actuator_user[addresses(model).rotor] = block
    still = {f"pilot.{name}": 0.0 for name in gains}
    parameters = vehicle.parameters.replace(still, "hands off")
    return Vehicle(vehicle.folder, parameters, model, vehicle.trim, vehicle.controller)


def air_met(vehicle: Vehicle, weather: Weather, points: tuple[int, int, int] = (3, 7, 3)) -> Air:
    """Return a vehicle trimmed in the winds that it meets: one if there is no turbulence.

    Gauss-Hermite quadrature over steady winds of the turbulence's rms. Derivatives bend where a
    gust brings a rotor near its vortex ring. The tail's is met by winds across: of the JR700's mean
    N_r in light turbulence 3 points there miss 6 %, 7 of them 1 %. The main rotor's is met by
    updraughts: of Z_w 3 points miss 3 %.

    Args:
        vehicle: to trim.
        weather: whose steady wind and turbulence.
        points: along the path through the air, across and down.

    Raises:
        TrimError: the vehicle can't hover in one of the winds.
    """
    dryden = weather.dryden
    if dryden is None:
        return ((1.0, weather.trimmed(vehicle)),)
    rules = [hermegauss(count) for count in points]
    cosine, sine = np.cos(dryden.heading), np.sin(dryden.heading)
    path_to_earth = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    air = []
    for at in itertools.product(*map(range, points)):
        picked = [(nodes[k], weights[k] / weights.sum()) for (nodes, weights), k in zip(rules, at)]
        gust = path_to_earth @ (np.array(dryden.rms) * [node for node, _ in picked])
        wind = tuple(np.array(weather.wind_to) + gust)
        share = float(np.prod([weight for _, weight in picked]))
        air.append((share, vehicle.trimmed(height=weather.height, wind=wind)))
    return tuple(air)


def exact_over(vehicle: Vehicle, weather: Weather, frequency: Array | None = None) -> Loop:
    """Return the exact loop over the air that a vehicle meets: in calm air, that of its trim.

    It is what records tend to in turbulence: slow gusts move the point that is linearised about.

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


@dataclass(frozen=True, eq=False)
class MeanLoop:
    """A `Loop` whose responses are the mean over several.

    An estimate of a response is the mean of the responses there, and a broken loop follows from
    the mean of its sensitivity.

    Attributes:
        parts: share and loop of each; the shares sum to 1.
    """

    parts: tuple[tuple[float, Loop], ...]

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes that are closed."""
        return self.parts[0][1].axes

    def broken(self, axis: str, at: str = "actuators") -> Curve:
        """Return the loop that follows from the mean sensitivity; see `Loop`."""

        def sensitivity(loop: Loop) -> Curve:
            cut = loop.broken(axis, at)
            return Curve(cut.frequency, 1.0 / (1.0 + cut.response))

        mean = self._mean(sensitivity)
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

    def _mean(self, response: Callable[[Loop], Curve]) -> Curve:
        curves = [(share, response(one)) for share, one in self.parts]
        mean = np.sum([share * one.response for share, one in curves], axis=0)
        return Curve(curves[0][1].frequency, mean)
