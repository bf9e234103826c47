"""The loop that a linear vehicle and a linear law close, frequency by frequency.

Commands are u = K y + F s (positive feedback) of y = P u, what is sensed, and of the sticks s.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import UnknownNameError, check_known
from helisim.base.linear import Linear, LinearSystem, Response
from helisim.handling.loop import GRID, PLACES, Curve, History, NoResponse, axis_of
from helisim.records.record import IN2

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """A `Loop` of a linear plant and law, at (n_freq,) rad/s.

    The plant is from commands ("lat", ...) to what is sensed ("p", "phi", ...), hold and delays
    included, with an optional `stick_latency`, s; the law also sees the sticks ("LAT", ...).
    """

    plant: Linear
    law: Linear
    frequency: NDArray[np.float64] = field(default_factory=lambda: GRID)

    @property
    def axes(self) -> tuple[str, ...]:
        """Commands that the law gives and the plant takes."""
        return tuple(name for name in self.law.outputs if name in self.plant.inputs)

    @cached_property
    def _plant(self) -> Response:
        columns = [self.plant.inputs.index(name) for name in self.axes]
        return np.moveaxis(self.plant.response(self.frequency)[:, columns], -1, 0)

    @cached_property
    def _law(self) -> Response:
        rows = [self.law.outputs.index(name) for name in self.axes]
        return np.moveaxis(self.law.response(self.frequency)[rows], -1, 0)

    @cached_property
    def _feedback(self) -> Response:
        known, there = self.law.inputs, (*self.plant.outputs, *IN2)
        used = np.any(self._law, axis=(0, 1))
        lacks = [name for name, needed in zip(known, used) if needed and name not in there]
        if lacks:
            raise NoResponse(
                f"the law senses {', '.join(lacks)}, of which nothing is known: the vehicle's "
                f"model has {', '.join(self.plant.outputs)}; identify the axis that is missing, or "
                "give a law without it"
            )
        by_none = np.zeros((*self._law.shape[:2], 1), dtype=np.complex128)
        columns = [known.index(name) if name in known else -1 for name in self.plant.outputs]
        return np.concatenate([self._law, by_none], axis=2)[:, :, columns]

    @cached_property
    def _follows(self) -> Response:
        """(I - K P)^-1: commands at the actuators over what is added there."""
        return np.asarray(
            np.linalg.inv(np.eye(len(self.axes)) - self._feedback @ self._plant),
            dtype=np.complex128,
        )

    def broken(self, axis: str, at: str = "actuators") -> Curve:
        """Return the loop L of one axis, all others closed."""
        check_known("place of a cut", [at], PLACES)
        sensitivity = (
            self.disturbance(axis).response
            if at == "sensors"
            else self._commanded(at, axis)[:, self._place(axis)]
        )
        return Curve(self.frequency, 1.0 / sensitivity - 1.0)

    def disturbance(self, axis: str, place: str = "sensors") -> Curve:
        """Return the sensed angle over a disturbance of it, at "attitude" of that without rate."""
        return Curve(
            self.frequency,
            1.0 + self._moved(self._commanded(place, axis), axis_of(axis).angle),
        )

    def command(self, axis: str, output: str | None = None) -> Curve:
        """Return an output over the axis's stick."""
        return Curve(
            self.frequency,
            self._moved(self._commanded("sticks", axis), output or axis_of(axis).angle),
        )

    def turned(self, axis: str, by: str) -> Curve:
        """Return the axis's angle over what is added to a servo command."""
        return Curve(
            self.frequency, self._moved(self._commanded("actuators", by), axis_of(axis).angle)
        )

    def actuator(self, axis: str, by: str = "stick") -> Curve:
        """Return the axis's servo command over its stick or its disturbance."""
        return self.reached("sticks" if by == "stick" else "sensors", axis)[axis_of(axis).name]

    def reached(self, place: str, axis: str) -> dict[str, Curve]:
        """Return responses to what is added at a place, by channel.

        "actuators", "sensors" (angle and its rate), "attitude" or "rate" alone, or "sticks".
        """
        given = self._commanded(place, axis)
        found = dict(zip(self.axes, given.T))
        found |= {name: self._moved(given, name) for name in self.plant.outputs}
        return {name: Curve(self.frequency, one) for name, one in found.items()}

    def _commanded(self, place: str, axis: str) -> Response:
        """Return commands over what is added to an axis at a place, (n_freq, n_axis)."""
        one = axis_of(axis)
        match place:
            case "actuators":
                return self._follows[:, :, self._place(axis)]
            case "sensors" | "attitude" | "rate":
                angle = self._feedback[:, :, self._sensor(one.angle)]
                added = angle if place != "rate" else np.zeros_like(angle)
                if one.rate is not None and place != "attitude":
                    turning = 1j * self.frequency[:, None] if place == "sensors" else 1.0
                    added = added + self._feedback[:, :, self._sensor(one.rate)] * turning
            case "sticks":
                stick = _index(self.law.inputs, one.stick, "the law has no stick")
                late = np.exp(-1j * self.frequency * self._late(one.stick))
                added = self._law[:, :, stick] * late[:, None]
            case _:
                raise UnknownNameError("place of a signal", place, (*PLACES, "sticks"))
        return (self._follows @ added[:, :, None])[:, :, 0]

    def _moved(self, given: Response, name: str) -> Response:
        """Return a channel that is sensed over what gives commands, (n_freq, n_axis)."""
        return (self._plant[:, [self._sensor(name)], :] @ given[:, :, None])[:, 0, 0]

    @property
    def poles(self) -> Response:
        """Poles, (n_pole,) rad/s. Raises NoResponse without signals or a `sampled` LinearSystem."""
        return self._whole.poles

    def step(self, axis: str, *, size: float, duration: float) -> History:
        """Return stick, commands and what is sensed after a step of a stick. Raises as `poles`."""
        whole, stick = self._whole, axis_of(axis).stick
        _index(self.law.inputs, stick, "the law has no stick")
        period = whole.period or 0.0
        ticks = np.arange(round(duration / period) + 1)
        first = math.ceil(self._late(stick) / period - 1e-6)
        moved = whole.select((stick,)).simulate(size * (ticks >= first)[:, None])
        signals = {stick: np.full(ticks.size, size), **dict(zip(whole.outputs, moved.T))}
        return History(np.asarray(ticks * period, dtype=np.float64), signals)

    def system(self, cut: str | None = None) -> "control.StateSpace":
        """Return python-control's discrete StateSpace, sticks to what is sensed. Raises as `poles`.

        The command of an axis to `cut` is an input too: minus its answer is the broken loop L.
        """
        whole = self._whole if cut is None else self._ticked(self.axes[self._place(cut)])
        return whole.system

    @cached_property
    def _whole(self) -> LinearSystem:
        if not self._feedback.size:
            raise NoResponse(
                f"the law commands {', '.join(self.law.outputs)}, and the vehicle's model has none "
                f"of them: it has {', '.join(self.plant.inputs)}"
            )
        return self._ticked(None)

    def _ticked(self, cut: str | None) -> LinearSystem:
        return _sampled(self.plant, "plant").feedback(_sampled(self.law, "law"), cut)

    def _place(self, axis: str) -> int:
        return _index(self.axes, axis_of(axis).name, "the loop has no command")

    def _sensor(self, name: str) -> int:
        return _index(self.plant.outputs, name, "the vehicle's model has no")

    def _late(self, stick: str) -> float:
        return getattr(self.plant, "stick_latency", {}).get(stick, 0.0)


def _index(names: Sequence[str], name: str, lacking: str) -> int:
    if name not in names:
        raise NoResponse(f"{lacking} {name!r}: it has {', '.join(names)}")
    return names.index(name)


def _sampled(system: Linear, what: str) -> LinearSystem:
    found = getattr(system, "sampled", None)
    if not isinstance(found, LinearSystem):
        raise NoResponse(f"the {what} is known by its responses alone: no poles, no steps")
    return found
