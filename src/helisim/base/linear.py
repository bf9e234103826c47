"""Linear systems with named signals: matrices, delays, responses, poles, feedback and sampling."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag, expm

from helisim.base.arrays import Complex as Response
from helisim.base.arrays import Real
from helisim.base.errors import InputError
from helisim.base.settings import FrozenMap, Limits, Value, convert

if TYPE_CHECKING:
    import control


_ROUNDING = 1e-9  # s: tolerance of delays as whole periods, and of equal periods
_GONE = 1e-4  # size of a pole in the z-plane that counts as a delay's
_SMALL = 2.0**-20  # of a state or input, by which steps are probed


class Linear(Protocol):
    """A linear system with named signals and a frequency response; `sampled` if known at ticks."""

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        ...

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        ...

    def response(self, frequency: Real, /) -> Response:
        """Return the response, (n_out, n_in, n_freq), at frequencies, (n_freq,) rad/s."""
        ...


@dataclass(frozen=True, eq=False, repr=False)
class LinearSystem(Value):
    """A linear system: x' or x+ = A x + B u, y = C x + D u; read-only. Raises InputError.

    `period`, s, is None if continuous; states default to x[0], x[1], ... `delays` and
    `output_delays`, s by name of input and output, are not in the matrices.
    """

    a: Real
    b: Real
    c: Real
    d: Real
    period: float | None
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    states: tuple[str, ...] = ()
    delays: Mapping[str, float] = field(default_factory=dict)
    output_delays: Mapping[str, float] = field(default_factory=dict)
    name: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        for name in "abcd":
            array = np.array(getattr(self, name), dtype=np.float64)
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        for name in ("delays", "output_delays"):
            object.__setattr__(self, name, FrozenMap(getattr(self, name)))
        states = tuple(self.states) or tuple(f"x[{k}]" for k in range(len(self.a)))
        for name, names in (("inputs", self.inputs), ("outputs", self.outputs), ("states", states)):
            object.__setattr__(self, name, tuple(names))
        n, n_in, n_out = len(states), len(self.inputs), len(self.outputs)
        shapes = [getattr(self, name).shape for name in "abcd"]
        if shapes != [(n, n), (n, n_in), (n_out, n), (n_out, n_in)]:
            raise InputError(
                f"a linear system of {n} states, {n_in} inputs and {n_out} outputs has matrices "
                f"of other shapes; got {', '.join(map(str, shapes))}"
            )

    def __repr__(self) -> str:
        kind = f"sampled at {1.0 / self.period:.4g} Hz" if self.period else "continuous"
        return (
            f"{type(self).__name__}({kind}: {len(self.a)} states, {', '.join(self.inputs)} to "
            f"{', '.join(self.outputs)})"
        )

    @classmethod
    def of_steps(
        cls,
        step: Callable[[Real, Real], Real],
        count: int,
        period: float,
        inputs: Sequence[str],
        outputs: Sequence[str],
    ) -> "LinearSystem":
        """Return what a linear function steps each period, s: its `count` states, by its inputs.

        It is of states, (n_state,), and inputs, (n_in,), and returns the next states and outputs.
        """
        points = _SMALL * np.eye(count + len(inputs))
        whole = np.column_stack([step(one[:count], one[count:]) / _SMALL for one in points])
        (a, b), (c, d) = (np.hsplit(rows, [count]) for rows in np.vsplit(whole, [count]))
        return LinearSystem(a, b, c, d, period, tuple(inputs), tuple(outputs))

    @cached_property
    def system(self) -> "control.StateSpace":
        """Python-control's StateSpace, without delays."""
        from control import StateSpace  # slow to import: it brings pyplot

        return StateSpace(
            self.a,
            self.b,
            self.c,
            self.d,
            self.period or 0.0,
            states=list(self.states),
            inputs=list(self.inputs),
            outputs=list(self.outputs),
            remove_useless_states=False,
            **({"name": self.name} if self.name else {}),
        )

    @property
    def sampled(self) -> "LinearSystem":
        """Itself. Raises InputError if continuous."""
        if self.period is None:
            raise InputError("a continuous system isn't known at ticks: see `discretise`")
        return self

    @property
    def lags(self) -> Real:
        """Delay of each response, its output's plus its input's, (n_out, n_in) s."""
        late = _in_order(self.output_delays, self.outputs)
        return late[:, None] + _in_order(self.delays, self.inputs)

    @cached_property
    def poles(self) -> Response:
        """Poles in the s-plane, (n_pole,) rad/s, slowest first, without those of delays."""
        found = np.linalg.eigvals(self.a).astype(np.complex128)
        if self.period is not None:
            found = np.log(found[np.abs(found) > _GONE]) / self.period
        return np.asarray(found[np.argsort(np.abs(found))], dtype=np.complex128)

    def response(self, omega: ArrayLike) -> Response:
        """Return the response, (n_out, n_in, n_freq), delays included, at (n_freq,) rad/s or one.

        Raises InputError at a pole.
        """
        omega = np.atleast_1d(np.asarray(omega, dtype=np.float64))
        point = 1j * omega if self.period is None else np.exp(1j * omega * self.period)
        try:
            states = np.linalg.solve(
                point[:, None, None] * np.eye(len(self.a)) - self.a, self.b[None]
            )
        except np.linalg.LinAlgError:
            raise InputError(
                f"a pole lies among {omega.min():g} to {omega.max():g} rad/s"
            ) from None
        found = np.moveaxis(np.asarray(self.c @ states + self.d, dtype=np.complex128), 0, -1)
        for late in (
            _in_order(self.delays, self.inputs)[None, :, None],
            _in_order(self.output_delays, self.outputs)[:, None, None],
        ):
            if np.any(late):
                found = found * np.exp(-1j * late * omega)
        return found

    def select(
        self, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None
    ) -> Self:
        """Return it with the given inputs and outputs only, in that order."""
        inputs, outputs = inputs or self.inputs, outputs or self.outputs
        columns = [self.inputs.index(name) for name in inputs]
        rows = [self.outputs.index(name) for name in outputs]
        return replace(
            self,
            b=self.b[:, columns],
            c=self.c[rows],
            d=self.d[np.ix_(rows, columns)],
            inputs=tuple(inputs),
            outputs=tuple(outputs),
        )

    def reordered(self, states: Sequence[str]) -> Self:
        """Return it with its states in another order."""
        order = [self.states.index(name) for name in states]
        a, b, c = self.a[np.ix_(order, order)], self.b[order], self.c[:, order]
        return replace(self, a=a, b=b, c=c, states=tuple(states))

    def residualised(self, keep: Sequence[str], *, without: Sequence[str] = ()) -> Self:
        """Return it with the states `keep` only, the others at their steady values.

        x' = (A11 - A12 inv(A22) A21) x + (B1 - A12 inv(A22) B2) u; `without` states are held
        constant. Raises InputError for sampled systems, unknown states, or if the others don't
        settle.
        """
        missing = [name for name in keep if name not in self.states]
        if missing or self.period is not None:
            kind = f"no state {missing[0]!r}" if missing else f"a period of {self.period:g} s"
            raise InputError(
                f"reducing takes a continuous model with the states {', '.join(keep)}; this has "
                f"{kind}"
            )
        a, b, c = self.a, self.b, self.c
        slow = [self.states.index(name) for name in keep]
        fast = [k for k, name in enumerate(self.states) if name not in (*keep, *without)]
        settled = a[np.ix_(fast, fast)]
        if fast and np.linalg.matrix_rank(settled) < len(fast):
            names = ", ".join(self.states[k] for k in fast)
            raise InputError(f"a state that is to be left out never settles, among {names}")
        by_state = -np.linalg.solve(settled, a[np.ix_(fast, slow)])
        by_input = -np.linalg.solve(settled, b[fast])
        return replace(
            self,
            a=a[np.ix_(slow, slow)] + a[np.ix_(slow, fast)] @ by_state,
            b=b[slow] + a[np.ix_(slow, fast)] @ by_input,
            c=c[:, slow] + c[:, fast] @ by_state,
            d=self.d + c[:, fast] @ by_input,
            states=tuple(keep),
        )

    def feedback(self, law: "LinearSystem", cut: str | None = None) -> "LinearSystem":
        """Return the loop of this plant and a law at the same ticks; feedback is positive.

        Signals are connected by name. States and outputs are the plant's, then the law's; inputs
        are the law's others and the `cut` command, where the loop is open: L is minus that output
        over that input. Raises InputError.
        """
        if abs((self.period or 0.0) - (law.period or 0.0)) > _ROUNDING:
            raise InputError(
                f"the plant is sampled each {self.period or 0.0:g} s, the law each "
                f"{law.period or 0.0:g} s: give both the same period"
            )
        inputs = [name for name in law.inputs if name not in self.outputs]
        sensed = [name for name in law.inputs if name in self.outputs]
        driving = (*inputs, *([cut] if cut else []))
        outside = [name if name == cut else "" for name in driving]
        reached = ["" if name == cut else name for name in law.outputs]
        n, rows = len(self.a), [self.outputs.index(name) for name in sensed]
        moves, direct = (_columns(one, self.inputs, reached) for one in (self.b, self.d))
        by, through = (_columns(one, self.inputs, outside) for one in (self.b, self.d))
        fed, back = (_columns(one, law.inputs, sensed) for one in (law.b, law.d))
        pushed, given = (_columns(one, law.inputs, driving) for one in (law.b, law.d))
        at_once = np.eye(len(law.outputs)) - back @ direct[rows]
        if np.linalg.cond(at_once) > 1e12:
            raise InputError("what the law commands and senses at the same tick has no solution")
        solved = np.linalg.inv(at_once)
        commands = solved @ np.hstack([back @ self.c[rows], law.c])
        shown = np.hstack([self.c, np.zeros((len(self.c), len(law.a)))]) + direct @ commands
        a = block_diag(self.a, law.a)
        a[:n] += moves @ commands
        a[n:] += fed @ shown[rows]
        driven = solved @ (given + back @ through[rows])
        seen = through + direct @ driven
        return LinearSystem(
            a,
            np.vstack([by + moves @ driven, pushed + fed @ seen[rows]]),
            np.vstack([shown, commands]),
            np.vstack([seen, driven]),
            self.period,
            driving,
            (*self.outputs, *law.outputs),
            (*self.states, *law.states),
            {name: law.delays[name] for name in inputs if name in law.delays},
            name=f"loop_at_{cut}" if cut else "closed_loop",
        )

    def simulate(self, inputs: ArrayLike) -> Real:
        """Return a sampled system's outputs (n_tick, n_out) from rest for inputs (n_tick, n_in)."""
        inputs = np.asarray(inputs, dtype=np.float64)
        driven, states = inputs @ self.b.T, np.zeros((len(inputs) + 1, len(self.a)))
        for k, given in enumerate(driven):
            states[k + 1] = self.a @ states[k] + given
        return states[:-1] @ self.c.T + inputs @ self.d.T

    def with_delays_as_states(self) -> "LinearSystem":
        """Return a sampled system with input delays as states, linear between samples."""
        system, period = replace(self, delays={}), self.sampled.period or 0.0
        for name, late in zip(self.inputs, _in_order(self.delays, self.inputs).tolist()):
            whole = math.floor(late / period + _ROUNDING)
            part = max(late / period - whole, 0.0)
            count = whole + (part > _ROUNDING)
            weight = np.zeros(count + 1)  # of the sample now, and of those before
            weight[[whole, count]] = 1.0 - part, part if count > whole else 1.0
            pick = np.eye(len(system.inputs))[system.inputs.index(name)]
            kept = np.diag(1.0 + (weight[0] - 1.0) * pick)
            old = np.outer(pick, weight[1:])
            system = replace(
                system,
                a=np.block(
                    [
                        [system.a, system.b @ old],
                        [np.zeros((count, len(system.a))), np.eye(count, k=-1)],
                    ]
                ),
                b=np.vstack([system.b @ kept, np.outer(np.eye(count, 1), pick)]),
                c=np.hstack([system.c, system.d @ old]),
                d=system.d @ kept,
                states=(*system.states, *(f"{name}_{k + 1}_ago" for k in range(count))),
            )
        return system

    def discretise(self, period: float) -> "LinearSystem":
        """Return a continuous system with inputs held over `period`, s, delays exact.

        Source: Astrom and Wittenmark, Computer-Controlled Systems, 3rd ed., section 2.3. States are
        its own, inputs at earlier ticks, then future late outputs. A system may lead by up to a
        period, and is read that much later. Raises InputError if an output leads an input by more.
        """
        convert(float, period, "period", Limits(unit="s", above=0.0))
        late = _in_order(self.output_delays, self.outputs)
        waits = _in_order(self.delays, self.inputs) + min(late, default=0.0)
        lead = max(0.0, -float(np.min(waits, initial=0.0)))
        if lead > period:
            raise InputError(
                f"what {self.inputs[int(np.argmin(waits))]!r} moves leads it by {1e3 * lead:.3g} "
                f"ms, more than the period of {1e3 * period:.3g} ms: no law at ticks can have "
                "that; see what is said to be late"
            )
        waits = waits + lead
        whole = [int((wait + _ROUNDING) // period) for wait in waits]
        rest = [max(0.0, wait - k * period) for wait, k in zip(waits, whole)]
        rest = np.array([one if one > _ROUNDING else 0.0 for one in rest])
        lines = [k + (one > 0.0) for k, one in zip(whole, rest)]
        reads = lead - (late - min(late, default=0.0))
        ticks = [max(0, math.ceil(-one / period - 1e-6)) for one in reads]
        n, m = self.b.shape
        total = n + sum(lines) + sum(ticks)

        def placed(still: Real, old: Real, new: Real) -> tuple[Real, Real]:
            """Return rows over the states, and over the two values of inputs, over a tick's."""
            over, at_once, start = np.zeros((len(still), total)), np.zeros((len(still), m)), n
            over[:, :n] = still
            for k, length in enumerate(lines):
                for ago, value in ((whole[k] + 1, old[:, k]), (whole[k], new[:, k])):
                    if ago == 0:
                        at_once[:, k] += value
                    elif ago <= length:
                        over[:, start + ago - 1] += value
                start += length
            return over, at_once

        def moved(after: float) -> tuple[Real, Real, Real]:
            """Return the states at a time after a tick, over states, older and newer inputs."""
            still, by = zero_order_hold(self.a, self.b, after)
            old, new = by.copy(), np.zeros((n, m))
            for one in np.unique(rest[rest < after]):
                k = rest == one
                onward, then = zero_order_hold(self.a, self.b, after - one)
                old[:, k] = onward @ zero_order_hold(self.a, self.b, one)[1][:, k]
                new[:, k] = then[:, k]
            return still, old, new

        a, b = np.zeros((total, total)), np.zeros((total, m))
        c, d = np.zeros((len(self.c), total)), np.zeros((len(self.c), m))
        a[:n], b[:n] = placed(*moved(period))
        after = reads + np.array(ticks, dtype=np.float64) * period
        after[np.abs(after) < _ROUNDING] = 0.0
        for one in np.unique(after):
            rows = after == one
            still, old, new = (self.c[rows] @ part for part in moved(one))
            older = one < rest
            now = self.d[rows]
            c[rows], d[rows] = placed(still, old + now * older, new + now * ~older)
        start, names = n, list(self.states)
        for k, length in enumerate(lines):
            if length:
                b[start, k] = 1.0
                a[start + 1 : start + length, start : start + length - 1] = np.eye(length - 1)
            names += [f"{self.inputs[k]}_{ago + 1}_ago" for ago in range(length)]
            start += length
        for row, length in enumerate(ticks):
            if not length:
                continue
            last = start + length - 1
            a[start:last, start + 1 : last + 1] = np.eye(length - 1)
            a[last], b[last] = c[row], d[row]
            c[row], d[row] = np.eye(1, total, start), 0.0
            names += [f"{self.outputs[row]}_{ahead}" for ahead in range(length)]
            start += length
        return LinearSystem(
            a, b, c, d, period, self.inputs, self.outputs, tuple(names), name=self.name
        )


def responses(
    system: Linear, frequency: Real, outputs: Sequence[str], inputs: Sequence[str]
) -> Response:
    """Return a system's responses by name, (n_out, n_in, n_freq), at (n_freq,) rad/s."""
    rows = [system.outputs.index(name) for name in outputs]
    return system.response(frequency)[rows][:, [system.inputs.index(name) for name in inputs]]


def beside(parts: Sequence[LinearSystem], inputs: Sequence[str]) -> LinearSystem:
    """Return systems, sampled alike, side by side with the given inputs."""
    a, c = (block_diag(*(getattr(one, name) for one in parts)) for name in "ac")
    b, d = (
        np.vstack([_columns(getattr(one, name), one.inputs, inputs) for one in parts])
        for name in "bd"
    )
    outputs = tuple(name for one in parts for name in one.outputs)
    states: list[str] = []
    for k, name in ((k, name) for k, one in enumerate(parts, start=1) for name in one.states):
        states.append(f"{name} of part {k}" if name in states else name)
    return LinearSystem(a, b, c, d, parts[0].period, tuple(inputs), outputs, tuple(states))


def zero_order_hold(a: Real, b: Real, period: float) -> tuple[Real, Real]:
    """Return exp(A t) and its integral times B: A and B of held inputs over a period."""
    n, m = b.shape
    both = np.zeros((n + m, n + m))
    both[:n] = np.hstack([a, b])
    whole = np.asarray(expm(both * period), dtype=np.float64)
    return whole[:n, :n], whole[:n, n:]


def delay_fit(
    response: Response,
    target: Response | Real,
    frequency: Real,
    delays: Iterable[float],
    columns: Callable[[Response], Sequence[Response]],
) -> tuple[float, ...]:
    """Return real gains, and the delay (s) of those given, by least squares.

    `columns` makes the signals, (n_freq,) each, that the gains weigh of the response, (n_freq,) at
    rad/s, delayed; their sum is to be the target, (n_freq,).
    """
    wanted = np.concatenate([np.real(target), np.imag(target)])

    def fitted(delay: float) -> tuple[float, ...]:
        signals = np.column_stack(columns(response * np.exp(-1j * frequency * delay)))
        both = np.concatenate([np.real(signals), np.imag(signals)])
        gains, *_ = np.linalg.lstsq(both, wanted)
        return float(np.sum((both @ gains - wanted) ** 2)), *gains.tolist(), delay

    return min(map(fitted, delays))[1:]


def _in_order(delays: Mapping[str, float], names: Sequence[str]) -> Real:
    return np.array([delays.get(name, 0.0) for name in names], dtype=np.float64)


def _columns(matrix: Real, has: Sequence[str], wanted: Sequence[str]) -> Real:
    found = np.zeros((len(matrix), len(wanted)))
    for to, by in ((k, has.index(name)) for k, name in enumerate(wanted) if name in has):
        found[:, to] = matrix[:, by]
    return found
