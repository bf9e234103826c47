"""A continuous system behind held inputs, at ticks, delays of any length exact.

Over a period every input has two values: the older one up to the remainder of its delay, then the
next (Astrom and Wittenmark, Computer-Controlled Systems, 3rd ed., section 2.3, systems with a time
delay). A system may lead by up to a period, as a model does whose delay was identified a little
too short: it is then read that much later.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, expm

from helisim.handling.loop import NoResponse

Array = NDArray[np.float64]
Matrices = tuple[Array, Array, Array, Array]
"""A, B, C and D."""

_ROUNDING = 1e-9
"""s: a delay so close to a whole number of periods is one."""


@dataclass(frozen=True, eq=False)
class Late:
    """A continuous system whose inputs are held, late each by its own, and read at ticks.

    Attributes:
        a: (n_state, n_state).
        b: (n_state, n_in).
        c: (n_out, n_state).
        d: (n_out, n_in).
        waits: by how much each input acts late, (n_in,) s, 0 or more.
        reads: when each output is read from a tick on, (n_out,) s; negative is late, positive up
            to a period early.
        period: s.
    """

    a: Array
    b: Array
    c: Array
    d: Array
    waits: Array
    reads: Array
    period: float

    def sampled(self) -> Matrices:
        """Return its matrices at the ticks.

        States are its own, then what each input was at the ticks before, the last one first, then
        what each late output is going to be, the next first.
        """
        n, n_in, lines = len(self.a), self.b.shape[1], self._lines
        total = n + sum(lines) + sum(self._ticks_late)
        a, b = np.zeros((total, total)), np.zeros((total, n_in))
        c, d = np.zeros((len(self.c), total)), np.zeros((len(self.c), n_in))
        a[:n], b[:n] = self._placed(self._moved(self.period), total)
        start = n
        for k, length in enumerate(lines):
            if length:
                b[start, k] = 1.0
                a[start + 1 : start + length, start : start + length - 1] = np.eye(length - 1)
            start += length
        for row, (late, read) in enumerate(zip(self._ticks_late, self.reads)):
            now, at_once = self._placed(self._read(row, read + late * self.period), total)
            if not late:
                c[row], d[row] = now, at_once
                continue
            c[row, start] = 1.0
            last = start + late - 1
            a[start:last, start + 1 : last + 1] = np.eye(late - 1)
            a[last], b[last] = now[0], at_once[0]
            start += late
        return a, b, c, d

    @cached_property
    def _ticks_late(self) -> list[int]:
        """How many whole ticks each output is read before."""
        return [max(0, int(np.ceil(-read / self.period - 1e-6))) for read in self.reads]

    @cached_property
    def _split(self) -> list[tuple[int, float]]:
        """Whole periods and remainder of each input's delay."""
        found = []
        for wait in self.waits:
            whole = int((wait + _ROUNDING) // self.period)
            rest = max(0.0, wait - whole * self.period)
            found.append((whole, rest if rest > _ROUNDING else 0.0))
        return found

    @property
    def _lines(self) -> list[int]:
        """How many ticks before each input is still at work."""
        return [whole + (rest > 0.0) for whole, rest in self._split]

    def _moved(self, after: float) -> tuple[Array, list[tuple[Array, Array]]]:
        """Return the states at a time after a tick: over the states, and over each input's values.

        The two of an input are the older value and the next.
        """
        still = self._flow(after)[0]
        by: list[tuple[Array, Array]] = []
        for k, (_, rest) in enumerate(self._split):
            if after <= rest:
                by.append((self._flow(after)[1][:, k], np.zeros(len(self.a))))
                continue
            onward, then = self._flow(after - rest)
            by.append((onward @ self._flow(rest)[1][:, k], then[:, k]))
        return still, by

    def _read(self, row: int, after: float) -> tuple[Array, list[tuple[Array, Array]]]:
        """Return an output at a time after a tick, as `_moved` returns the states."""
        still, by = self._moved(after)
        read: list[tuple[Array, Array]] = []
        for k, (old, new) in enumerate(by):
            at_once = self.d[row, k]
            older = after < self._split[k][1]
            read.append(
                (
                    np.atleast_1d(self.c[row] @ old + at_once * older),
                    np.atleast_1d(self.c[row] @ new + at_once * (not older)),
                )
            )
        return self.c[[row]] @ still, read

    def _placed(
        self, parts: tuple[Array, list[tuple[Array, Array]]], total: int
    ) -> tuple[Array, Array]:
        """Return what a tick's states, (., total), and inputs, (., n_in), are at work in."""
        still, by = parts
        n = len(self.a)
        over = np.zeros((len(still), total))
        at_once = np.zeros((len(still), len(by)))
        over[:, :n] = still
        start = n
        for k, ((whole, rest), (old, new)) in enumerate(zip(self._split, by)):
            for ago, value in ((whole + 1, old), (whole, new)):
                if ago == 0:
                    at_once[:, k] += value
                elif ago <= whole + (rest > 0.0):
                    over[:, start + ago - 1] += value
            start += whole + (rest > 0.0)
        return over, at_once

    def _flow(self, time: float) -> tuple[Array, Array]:
        """Return exp(A t) and its integral times B."""
        n, m = self.b.shape
        both = np.zeros((n + m, n + m))
        both[:n, :n], both[:n, n:] = self.a * time, self.b * time
        whole = np.asarray(expm(both))
        return whole[:n, :n], whole[:n, n:]


def late_system(
    matrices: Matrices,
    waits: Array,
    delays: Array,
    period: float,
    names: Sequence[str],
) -> Late:
    """Return a system whose inputs and outputs are late, or lead a little.

    Args:
        matrices: A, B, C and D.
        waits: of the inputs, (n_in,) s.
        delays: of the outputs, (n_out,) s.
        period: s.
        names: of the inputs, for messages.

    Raises:
        NoResponse: an output leads an input by more than a period.
    """
    first = float(np.min(delays, initial=np.inf))
    first = first if np.isfinite(first) else 0.0
    waits = waits + first
    lead = max(0.0, -float(np.min(waits)))
    if lead > period:
        worst = names[int(np.argmin(waits))]
        raise NoResponse(
            f"what {worst!r} moves leads it by {1e3 * lead:.3g} ms, more than the period of "
            f"{1e3 * period:.3g} ms: no law at ticks can have that; see what is said to be late"
        )
    return Late(*matrices, waits + lead, lead - (delays - first), period)


def joined(parts: Sequence[tuple[Matrices, Sequence[int]]], n_in: int) -> Matrices:
    """Return systems side by side as one, their outputs one after the other.

    Args:
        parts: matrices of each, and which of all inputs its own are.
        n_in: how many inputs there are.
    """
    systems = [one for one, _ in parts]
    a = block_diag(*(one[0] for one in systems))
    c = block_diag(*(one[2] for one in systems))
    b, d = np.zeros((len(a), n_in)), np.zeros((len(c), n_in))
    state = row = 0
    for (own_a, own_b, own_c, own_d), columns in parts:
        b[state : state + len(own_a), columns] = own_b
        d[row : row + len(own_c), columns] = own_d
        state, row = state + len(own_a), row + len(own_c)
    return np.asarray(a), b, np.asarray(c), d
