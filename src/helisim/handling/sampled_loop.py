"""A sampled loop closed: the poles of the whole, and its answer to a stick, tick by tick."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Protocol, TypeGuard

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from helisim.base.errors import InputError
from helisim.handling.axis import axis_of
from helisim.handling.loop import History, NoResponse

if TYPE_CHECKING:
    import control

Array = NDArray[np.float64]

_MATRICES = ("a", "b", "c", "d", "period")
_GONE = 1e-4
"""Size of a pole in the z-plane: 9 time constants a tick, or what rounding makes of a delay line,
which is no motion of the loop."""
_SAME = 1e-9
"""s, by which periods may differ."""


class Sampled(Protocol):
    """A linear system at its ticks: x+ = a x + b u, y = c x + d u."""

    @property
    def a(self) -> Array:
        """(n_state, n_state)."""
        ...

    @property
    def b(self) -> Array:
        """(n_state, n_in)."""
        ...

    @property
    def c(self) -> Array:
        """(n_out, n_state)."""
        ...

    @property
    def d(self) -> Array:
        """(n_out, n_in)."""
        ...

    @property
    def period(self) -> float:
        """Time between ticks, s."""
        ...

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        ...

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        ...


def sampled_form(system: object, what: str) -> Sampled:
    """Return a system's matrices at its ticks: its `sampled`, or itself if it has them.

    Raises:
        NoResponse: it is known by its responses alone.
    """
    found = getattr(system, "sampled", system)
    if not _has_matrices(found):
        raise NoResponse(f"the {what} is known by its responses alone: no poles, no steps")
    return found


def _has_matrices(system: object) -> TypeGuard[Sampled]:
    return all(hasattr(system, name) for name in _MATRICES)


@dataclass(frozen=True, eq=False)
class SampledLoop:
    """What a plant and a law make together, both at the law's ticks.

    Attributes:
        plant: from the commands to what is sensed, which the commands held between ticks move.
        law: from what is sensed and the sticks to the commands, positive feedback.
        cut: command at which the loop is cut: what the law says there moves nothing, and something
            else goes to the plant instead.

    Raises:
        InputError: they have different ticks.
        NoResponse: commands and what they move at once make a loop that has no solution.
    """

    plant: Sampled
    law: Sampled
    cut: str | None = None

    def __post_init__(self) -> None:
        if abs(self.plant.period - self.law.period) > _SAME:
            raise InputError(
                f"the plant is sampled each {self.plant.period:g} s, the law each "
                f"{self.law.period:g} s: give both the same period"
            )

    @cached_property
    def a(self) -> Array:
        """Of the whole, (n_state, n_state): the plant's states first."""
        moved, given = self._plant_by, self._law_by
        whole = block_diag(self.plant.a, self.law.a)
        n = len(self.plant.a)
        whole[:n] += moved @ self.commands
        whole[n:] += given @ self.sensed
        return np.asarray(whole, dtype=np.float64)

    @cached_property
    def poles(self) -> NDArray[np.complex128]:
        """In the s-plane, (n_pole,) rad/s, the slowest first."""
        found = np.linalg.eigvals(self.a).astype(np.complex128)
        kept = np.log(found[np.abs(found) > _GONE]) / self.law.period
        return np.asarray(kept[np.argsort(np.abs(kept))], dtype=np.complex128)

    @cached_property
    def commands(self) -> Array:
        """The law's commands over the states, (n_command, n_state)."""
        law, sensed = self.law, self._feedback
        own = np.hstack([sensed @ self.plant.c, law.c])
        return np.asarray(self._solved @ own)

    @cached_property
    def sensed(self) -> Array:
        """What is sensed over the states, (n_out, n_state)."""
        plant = self.plant
        still = np.hstack([plant.c, np.zeros((len(plant.outputs), len(self.law.a)))])
        return still + self._direct @ self.commands

    def step(self, axis: str, *, size: float, duration: float, late: float = 0.0) -> History:
        """Return stick, commands and what is sensed after a step of a stick; see `Loop`.

        Args:
            axis: whose stick.
            size: unitised stick.
            duration: s.
            late: s, by which the law sees the stick late; it does so at a tick.
        """
        stick = axis_of(axis).stick
        if stick not in self.law.inputs:
            names = ", ".join(self.law.inputs)
            raise NoResponse(f"the law has no stick {stick!r}: it has {names}")
        column = self.inputs.index(stick)
        shown = np.vstack([self.commands, self.sensed])
        push, through = (one[:, column] * size for one in self.driven)
        ticks = np.arange(round(duration / self.law.period) + 1)
        state = np.zeros(len(self.a))
        rows = np.empty((ticks.size, len(shown)))
        first = math.ceil(late / self.law.period - 1e-6)
        for k in ticks:
            seen = float(k >= first)
            rows[k] = shown @ state + seen * through
            state = self.a @ state + seen * push
        names = (*self.law.outputs, *self.plant.outputs)
        signals = {name: rows[:, k] for k, name in enumerate(names)}
        time = np.asarray(ticks * self.law.period, dtype=np.float64)
        return History(time, {stick: np.full(ticks.size, size), **signals})

    @property
    def inputs(self) -> tuple[str, ...]:
        """What moves the loop: what the law sees and the plant doesn't say, and the cut command."""
        sticks = tuple(name for name in self.law.inputs if name not in self.plant.outputs)
        return sticks if self.cut is None else (*sticks, self.cut)

    @cached_property
    def driven(self) -> tuple[Array, Array]:
        """How inputs move the states, (n_state, n_in), and at once what the loop shows.

        It shows commands, then what is sensed, (n_command + n_out, n_in).
        """
        fed = _columns(self.law.d, self.law.inputs, self.inputs)
        moved = _columns(self.law.b, self.law.inputs, self.inputs)
        cut = (self.cut,) if self.cut else ()
        outside = [name if name in cut else "" for name in self.inputs]
        by = _columns(self.plant.b, self.plant.inputs, outside)
        through = _columns(self.plant.d, self.plant.inputs, outside)
        commands = self._solved @ (fed + self._feedback @ through)
        sensed = through + self._direct @ commands
        states = np.vstack([by + self._plant_by @ commands, moved + self._law_by @ sensed])
        return states, np.vstack([commands, sensed])

    @property
    def system(self) -> "control.StateSpace":
        """It as python-control's discrete StateSpace, from `inputs` to what is sensed and commands.

        Positive feedback: cut at a command, the loop's L is minus that command over itself.
        """
        import control  # which brings pyplot

        states, shown = self.driven
        n = len(self.law.outputs)
        return control.StateSpace(
            self.a,
            states,
            np.vstack([self.sensed, self.commands]),
            np.vstack([shown[n:], shown[:n]]),
            self.law.period,
            inputs=list(self.inputs),
            outputs=[*self.plant.outputs, *self.law.outputs],
            name="closed_loop" if self.cut is None else f"loop_at_{self.cut}",
            remove_useless_states=False,
        )

    @property
    def _reached(self) -> tuple[str, ...]:
        """The law's commands, nameless where they are cut."""
        return tuple("" if name == self.cut else name for name in self.law.outputs)

    @cached_property
    def _plant_by(self) -> Array:
        """How the law's commands move the plant's states, (n_state, n_command)."""
        return _columns(self.plant.b, self.plant.inputs, self._reached)

    @cached_property
    def _direct(self) -> Array:
        """What is sensed at once of the law's commands, (n_out, n_command)."""
        return _columns(self.plant.d, self.plant.inputs, self._reached)

    @cached_property
    def _law_by(self) -> Array:
        """How what is sensed moves the law's states, (n_state, n_out)."""
        return _columns(self.law.b, self.law.inputs, self.plant.outputs)

    @cached_property
    def _feedback(self) -> Array:
        """What the law commands at once of what is sensed, (n_command, n_out)."""
        return _columns(self.law.d, self.law.inputs, self.plant.outputs)

    @cached_property
    def _solved(self) -> Array:
        """(I - D_law D_plant)^-1, (n_command, n_command)."""
        both = np.eye(len(self.law.outputs)) - self._feedback @ self._direct
        if np.linalg.cond(both) > 1e12:
            raise NoResponse("what the law commands and senses at the same tick has no solution")
        return np.asarray(np.linalg.inv(both), dtype=np.float64)


def _columns(matrix: Array, has: Sequence[str], wanted: Sequence[str]) -> Array:
    """Return the columns of named inputs, zero for those that it doesn't have."""
    found = np.zeros((len(matrix), len(wanted)))
    for k, name in enumerate(wanted):
        if name in has:
            found[:, k] = matrix[:, has.index(name)]
    return found
