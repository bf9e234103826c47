"""The loop that a linear vehicle and a linear law close, frequency by frequency.

With the commands u = K y + F s of what is sensed, y = P u, and of the sticks s (positive feedback,
as laws are written), every response follows from P and K at one frequency: no model order, no
approximation of delays.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.base.linear import Linear, LinearSystem, Response
from helisim.handling.loop import GRID, Axis, Curve, History, NoResponse, axis_of
from helisim.records.record import IN2

if TYPE_CHECKING:
    import control

Added = Mapping[int, Response]


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """A `Loop` of a linear plant and law.

    Attributes:
        plant: from commands ("lat", ...) to what is sensed ("p", "phi", ...), whatever holds
            the commands between ticks, and delays, included. It may have `stick_latency`, by how
            much the law sees a stick late: s, by name.
        law: from what is sensed and the sticks ("LAT", ...) to the commands.
        frequency: (n_freq,) rad/s.
    """

    plant: Linear
    law: Linear
    frequency: NDArray[np.float64] = field(default_factory=lambda: GRID)

    @property
    def axes(self) -> tuple[str, ...]:
        """The commands that the law gives and the plant takes."""
        return tuple(name for name in self.law.outputs if name in self.plant.inputs)

    @cached_property
    def _plant(self) -> Response:
        """P, (n_freq, n_sensed, n_command)."""
        columns = [self.plant.inputs.index(name) for name in self.axes]
        return np.moveaxis(self.plant.response(self.frequency)[:, columns], -1, 0)

    @cached_property
    def _law(self) -> Response:
        """K and F together, (n_freq, n_command, n_law_input)."""
        rows = [self.law.outputs.index(name) for name in self.axes]
        return np.moveaxis(self.law.response(self.frequency)[rows], -1, 0)

    @cached_property
    def _feedback(self) -> Response:
        """K, by the plant's outputs, (n_freq, n_command, n_sensed); 0 of what the law ignores."""
        known = self.law.inputs
        sensed = {name: k for k, name in enumerate(known) if name not in IN2}
        unknown = [name for name in sensed if name not in self.plant.outputs]
        lacks = [name for name in unknown if np.any(self._law[:, :, sensed[name]])]
        if lacks:
            raise NoResponse(
                f"the law senses {_listed(lacks)}, of which nothing is known: the vehicle's model "
                f"has {_listed(self.plant.outputs)}"
            )
        columns = [
            self._law[:, :, known.index(name)]
            if name in known
            else np.zeros(self._law.shape[:2], dtype=np.complex128)
            for name in self.plant.outputs
        ]
        return np.stack(columns, axis=-1)

    @cached_property
    def _follows(self) -> Response:
        """(I - K P)^-1: what reaches the actuators over what is added there."""
        both = self._feedback @ self._plant
        return np.asarray(np.linalg.inv(np.eye(len(self.axes)) - both), dtype=np.complex128)

    def broken(self, axis: str, at: str = "actuators") -> Curve:
        """Return the loop L of one axis, all others closed; see `Loop`."""
        if at == "actuators":
            place = self._place(axis)
            sensitivity = self._follows[:, place, place]
        elif at == "sensors":
            sensitivity = self._sensed_over(self._turned(axis), axis_of(axis).angle)
        else:
            sensitivity = self._sensed_over({self._sensor(at): self._unit}, at)
        return self._curve(1.0 / sensitivity - 1.0)

    def disturbance(self, axis: str) -> Curve:
        """Return the sensed angle over a disturbance of it; see `Loop`."""
        return self._curve(self._sensed_over(self._turned(axis), axis_of(axis).angle))

    def command(self, axis: str, output: str | None = None) -> Curve:
        """Return an output over the axis's stick; see `Loop`."""
        row = self._sensor(output or axis_of(axis).angle)
        return self._curve((self._plant @ self._by_stick(axis))[:, row, 0])

    def turned(self, axis: str, by: str) -> Curve:
        """Return the axis's angle over what is added to a servo command; see `Loop`."""
        row, place = self._sensor(axis_of(axis).angle), self._place(by)
        moved = self._plant[:, [row], :] @ self._follows[:, :, [place]]
        return self._curve(moved[:, 0, 0])

    def actuator(self, axis: str, by: str = "stick") -> Curve:
        """Return the axis's servo command over its stick or its disturbance; see `Loop`."""
        place = self._place(axis)
        if by == "stick":
            return self._curve(self._by_stick(axis)[:, place, 0])
        return self._curve(self._by_sensors(self._turned(axis))[:, place])

    def reached(self, place: str, axis: str) -> dict[str, Curve]:
        """Return what an oscillation that is added somewhere moves, by channel.

        Commands as they reach the actuators, and all that the plant shows.

        Args:
            place: "actuators", "sensors" (the attitude is turned) or "sticks".
            axis: of control.

        Raises:
            InputError: there is no such place.
        """
        match place:
            case "actuators":
                given = self._follows[:, :, self._place(axis)]
            case "sensors":
                given = self._by_sensors(self._turned(axis))
            case "sticks":
                given = self._by_stick(axis)[:, :, 0]
            case _:
                raise InputError(f"add at actuators, sensors or sticks, not at {place!r}")
        moved = (self._plant @ given[:, :, None])[:, :, 0]
        found = {name: self._curve(given[:, k]) for k, name in enumerate(self.axes)}
        return found | {name: self._curve(moved[:, k]) for k, name in enumerate(self.plant.outputs)}

    @property
    def poles(self) -> Response:
        """The poles of the whole, (n_pole,) rad/s, where plant and law are known at their ticks.

        Raises NoResponse where one has no `LinearSystem` as its `sampled`.
        """
        return self._whole().poles

    def step(self, axis: str, *, size: float, duration: float) -> History:
        """Return stick, commands and what is sensed after a step of a stick; see `Loop`.

        Known where the poles are.
        """
        whole, stick = self._whole(), axis_of(axis).stick
        if stick not in self.law.inputs:
            raise NoResponse(f"the law has no stick {stick!r}: it has {_listed(self.law.inputs)}")
        period = whole.period or 0.0
        ticks = np.arange(round(duration / period) + 1)
        first = math.ceil(self._stick_latency.get(stick, 0.0) / period - 1e-6)
        moved = whole.select((stick,)).simulate(size * (ticks >= first)[:, None])
        signals = {stick: np.full(ticks.size, size), **dict(zip(whole.outputs, moved.T))}
        return History(np.asarray(ticks * period, dtype=np.float64), signals)

    def system(self, cut: str | None = None) -> "control.StateSpace":
        """Return it as python-control's discrete StateSpace, from sticks to what is sensed.

        Args:
            cut: axis at whose servo command the loop is cut; that command is then an input too,
                and minus its answer is the broken loop L.

        Raises:
            NoResponse: plant or law is known by its responses alone, or there is no such command.
        """
        return self._whole(None if cut is None else self.axes[self._place(cut)]).system

    @cached_property
    def _closed(self) -> dict[str | None, LinearSystem]:
        return {}

    def _whole(self, cut: str | None = None) -> LinearSystem:
        """Return the loop at its ticks."""
        if cut not in self._closed:
            plant, law = _sampled(self.plant, "plant"), _sampled(self.law, "law")
            self._closed[cut] = plant.feedback(law, cut)
        return self._closed[cut]

    def _curve(self, values: Response) -> Curve:
        return Curve(self.frequency, values)

    def _place(self, axis: str) -> int:
        name = axis_of(axis).name
        if name not in self.axes:
            raise NoResponse(f"the loop has no command {name!r}: it has {_listed(self.axes)}")
        return self.axes.index(name)

    def _sensor(self, name: str) -> int:
        if name not in self.plant.outputs:
            raise NoResponse(f"nothing says {name!r}: there are {_listed(self.plant.outputs)}")
        return self.plant.outputs.index(name)

    def _turned(self, axis: str) -> Added:
        """Return what a disturbance of the axis's attitude adds to each sensor."""
        one: Axis = axis_of(axis)
        added = {self._sensor(one.angle): self._unit}
        if one.rate is not None:
            added[self._sensor(one.rate)] = self._unit * (1j * self.frequency)
        return added

    @property
    def _unit(self) -> Response:
        return np.ones(self.frequency.size, dtype=np.complex128)

    def _by_sensors(self, added: Added) -> Response:
        """Return the commands over a disturbance of what is sensed, (n_freq, n_command)."""
        given = np.sum([self._feedback[:, :, k] * one[:, None] for k, one in added.items()], axis=0)
        return (self._follows @ given[:, :, None])[:, :, 0]

    def _sensed_over(self, added: Added, name: str) -> Response:
        """Return what is sensed over a disturbance that adds 1 to it, (n_freq,)."""
        row = self._sensor(name)
        moved = (self._plant[:, [row], :] @ self._by_sensors(added)[:, :, None])[:, 0, 0]
        return 1.0 + moved

    def _by_stick(self, axis: str) -> Response:
        """Return the commands over the axis's stick, (n_freq, n_command, 1)."""
        stick = axis_of(axis).stick
        if stick not in self.law.inputs:
            raise NoResponse(f"the law has no stick {stick!r}: it has {_listed(self.law.inputs)}")
        late = np.exp(-1j * self.frequency * self._stick_latency.get(stick, 0.0))
        column = self._law[:, :, [self.law.inputs.index(stick)]] * late[:, None, None]
        return np.asarray(self._follows @ column, dtype=np.complex128)

    @property
    def _stick_latency(self) -> Mapping[str, float]:
        return getattr(self.plant, "stick_latency", {})


def _sampled(system: Linear, what: str) -> LinearSystem:
    found = getattr(system, "sampled", None)
    if not isinstance(found, LinearSystem):
        raise NoResponse(f"the {what} is known by its responses alone: no poles, no steps")
    return found


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names)
