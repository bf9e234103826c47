"""Poles and zeros of an identified model, with the errors that its parameters' errors give them.

Both are where a pencil P(s) is singular: s M - F for the poles, and for the zeros of y/u

    [ F - s M     G      ]
    [ H0 + s H1   D + s D1 ] .

With null vectors l P(s_i) = 0, P(s_i) r = 0, scaled to l dP/ds r = -1, a change dP of the matrices
moves the root by l dP r. That and the parameters' covariance are its covariance (the delta method),
as long as roots move little against what separates them: the next term of the series is a product
of two such changes over that distance. Where it isn't small, as of a real pair that is about to
become a complex one, errors are marked: they are not those of a root but of one that could merge.

A model can be larger than one of its responses needs. Such a part has its poles among the zeros of
the response too, which cancel; these are left out of the zeros.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from helisim.base.display import Displayed
from helisim.base.errors import IdentificationError, UnknownNameError
from helisim.base.settings import FrozenMap, Value
from helisim.ident.evaluate import SINGULAR
from helisim.ident.expression import value_at
from helisim.ident.structure import Structure

_CURVED, _ROUNDING = 0.25, 1e-13
"""Second-order part of a root's change over its standard error, from which the error is marked; and
the part of the fastest root that is nothing in an error."""
_ORIGIN = 1e-9
"""Rad/s: a root nearer to zero than that is an integrator, or a zero at the origin."""
_NOTHING = 1e-10
"""Part of its terms below which a sum of products is zero but for rounding."""
_CANCELS = 1e-6
"""Part of its size by which a zero may be off the pole that it cancels: nearly equal roots are
known to the root of the rounding."""

Real = NDArray[np.float64]
Roots = NDArray[np.complex128]


@dataclass(frozen=True)
class Mode:
    """One pole or zero, real or of a complex pair.

    Attributes:
        real: real part, 1/s.
        imag: imaginary part, rad/s, never negative: a pair is one mode.
        real_error: standard error of `real`; nan where the fit doesn't state its covariance.
        imag_error: standard error of `imag`.
        correlation: between the errors of `real` and `imag`.
        separate: False where another one is so near that the two could merge within the errors,
            so that the errors are no more than an order of magnitude.
    """

    real: float
    imag: float
    real_error: float = math.nan
    imag_error: float = math.nan
    correlation: float = 0.0
    separate: bool = True

    @property
    def value(self) -> complex:
        """The root, 1/s."""
        return complex(self.real, self.imag)

    @property
    def oscillates(self) -> bool:
        """Whether it is a complex pair."""
        return self.imag > 0.0

    @property
    def frequency(self) -> float:
        """Natural frequency, rad/s; of a real one its distance from zero."""
        return abs(self.value)

    @property
    def frequency_error(self) -> float:
        """Standard error of `frequency`, rad/s."""
        if self.frequency == 0.0:
            return math.hypot(self.real_error, self.imag_error)
        return self._error(self.real / self.frequency, self.imag / self.frequency)

    @property
    def damping(self) -> float:
        """Damping ratio: negative where it grows, and 1 or -1 of a real one; nan at zero."""
        return -self.real / self.frequency if self.frequency else math.nan

    @property
    def damping_error(self) -> float:
        """Standard error of `damping`; 0 of a real one."""
        if not self.oscillates:
            return 0.0
        cube = self.frequency**3
        return self._error(-(self.imag**2) / cube, self.real * self.imag / cube)

    @property
    def time(self) -> float:
        """Time constant, s: what decays or grows does so by e in it; infinite on the axis."""
        return 1.0 / abs(self.real) if self.real else math.inf

    @property
    def time_error(self) -> float:
        """Standard error of `time`, s."""
        return self.real_error / self.real**2 if self.real else math.inf

    @property
    def doubling(self) -> float | None:
        """Time to double, s, of what grows; None of what decays."""
        return math.log(2.0) / self.real if self.real > _ORIGIN else None

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; what isn't finite becomes None."""
        units = {"frequency": "frequency_rad_s", "time": "time_s", "doubling": "doubling_s"}
        names = ("real", "imag", "real_error", "imag_error", "frequency", "frequency_error")
        names += ("damping", "damping_error", "time", "time_error", "doubling")
        numbers = {units.get(name, name): getattr(self, name) for name in names}
        return {
            **{k: None if x is None or not math.isfinite(x) else x for k, x in numbers.items()},
            "separate": self.separate,
        }

    def notes(self, name: str) -> list[str]:
        """Return what a reader should know of it beside its numbers.

        Args:
            name: "pole", or "zero" with its response.
        """
        grows = f"doubles in {self.doubling:.3g} s" if self.doubling is not None else ""
        found = ["non-minimum phase" if grows and not name.startswith("pole") else grows]
        found.append("" if self.separate else "could merge with another: errors are rough")
        return [one for one in found if one]

    def _error(self, by_real: float, by_imag: float) -> float:
        """Return the standard error of what changes so by the real and the imaginary part."""
        one = by_real * self.real_error if by_real else 0.0
        other = by_imag * self.imag_error if by_imag else 0.0
        if math.isinf(one) or math.isinf(other):
            return math.inf
        return math.sqrt(max(one**2 + other**2 + 2.0 * self.correlation * one * other, 0.0))


@dataclass(frozen=True, eq=False)
class Modes(Value, Displayed):
    """Poles of a fitted model and zeros of each of its responses, slowest first.

    Attributes:
        poles: of the model.
        zeros: of each fitted response by name, such as "p/lat"; without those that cancel poles.
        gains: of each fitted response, what s^(poles - zeros) leaves of it at high frequency.
    """

    poles: tuple[Mode, ...]
    zeros: Mapping[str, tuple[Mode, ...]]
    gains: Mapping[str, float]

    def __post_init__(self) -> None:
        object.__setattr__(self, "zeros", FrozenMap(self.zeros))
        object.__setattr__(self, "gains", FrozenMap(self.gains))

    def __getitem__(self, response: str) -> tuple[Mode, ...]:
        """Return the zeros of a response. Raises UnknownNameError."""
        if response not in self.zeros:
            raise UnknownNameError("response", response, self.zeros)
        return self.zeros[response]

    def __repr__(self) -> str:
        return f"Modes({len(self.poles)} poles; zeros of {', '.join(self.zeros)})"

    def __str__(self) -> str:
        rows = [
            (name, f"{one.real:.4g}" + (f" +- {one.imag:.4g}j" if one.oscillates else ""), one)
            for name, one in self.named
        ]
        width = max((len(name) for name, *_ in rows), default=4)
        roots = max((len(root) for _, root, _ in rows), default=0)
        roots = max(roots, len("root, 1/s"))
        lines = [
            f"{'mode':<{width}}  {'root, 1/s':>{roots}}  {'rad/s':>8} {'error':>7}  "
            f"{'damping':>7} {'error':>7}  {'time, s':>8} {'error':>7}"
        ]
        for name, root, one in rows:
            damping = f"{'-':>7} {'-':>7}"
            if one.oscillates:
                damping = f"{one.damping:7.3f} {_text(one.damping_error, 7, 2)}"
            lines.append(
                f"{name:<{width}}  {root:>{roots}}  {_text(one.frequency, 8)} "
                f"{_text(one.frequency_error, 7, 2)}  "
                f"{damping}  {_text(one.time, 8)} {_text(one.time_error, 7, 2)}  "
                f"{'; '.join(one.notes(name))}".rstrip()
            )
        return "\n".join(lines)

    @property
    def named(self) -> list[tuple[str, Mode]]:
        """Every mode behind "pole", or "zero" with its response."""
        zeros = [(f"zero {name}", one) for name, some in self.zeros.items() for one in some]
        return [*(("pole", one) for one in self.poles), *zeros]

    @cached_property
    def stable(self) -> bool:
        """Whether every pole decays."""
        return all(one.real < 0.0 for one in self.poles)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {
            "poles": [one.to_dict() for one in self.poles],
            "zeros": {name: [one.to_dict() for one in some] for name, some in self.zeros.items()},
            "gains": dict(self.gains),
        }


def _text(x: float, width: int, digits: int = 4) -> str:
    return f"{x:{width}.{digits}g}" if math.isfinite(x) else f"{'-':>{width}}"


def modes(
    structure: Structure,
    values: Mapping[str, float],
    responses: Sequence[str],
    *,
    names: Sequence[str] = (),
    covariance: Real | None = None,
) -> Modes:
    """Return poles and zeros of a structure with numbers.

    Args:
        structure: the model's.
        values: every parameter by name.
        responses: whose zeros are wanted, such as "p/lat".
        names: of the parameters that are uncertain.
        covariance: (n_name, n_name) of their errors, infinite on the diagonal where unknown; None
            states no errors.

    Raises:
        IdentificationError: M is singular.
    """
    poles = _pole_pencil(structure, values)
    zeros, gains = {}, {}
    for name in responses:
        pencil, gains[name] = _zero_pencil(structure, values, name, poles)
        zeros[name] = _found(pencil, names, covariance)
    return Modes(_found(poles, names, covariance), zeros, gains)


@dataclass(frozen=True, eq=False)
class _Pencil:
    """A pencil P(s) with its roots and null vectors, l (dP/ds) r = -1.

    Attributes:
        structure: whose.
        values: every parameter by name.
        roots: (n_root,) where P is singular.
        left: (n_root, n_row) null vectors.
        right: (n_row, n_root) null vectors.
        output, input: of the response whose zeros the roots are, in the last row and column; -1
            where they are poles.
    """

    structure: Structure
    values: Mapping[str, float]
    roots: Roots
    left: Roots
    right: Roots
    output: int = -1
    input: int = -1

    def changes(self, names: Sequence[str]) -> Roots:
        """Return l_i (dP/dp)(s_i) r_j for each parameter p named, (n_name, n_root, n_root).

        On the diagonal it is how fast the root moves.
        """
        program, count = self.structure.program, self.roots.size
        ordered = program.ordered(self.values).tolist()
        wanted = {program.names.index(name): k for k, name in enumerate(names)}
        total = np.zeros((len(names), count, count), dtype=np.complex128)
        last = len(self.structure.states)
        for place, matrix, row, column, slope in program.dependences:
            of_state, by_state = matrix in ("M", "F", "G"), matrix in ("M", "F", "H0", "H1")
            here = (of_state or row == self.output) and (by_state or column == self.input)
            if place not in wanted or not here or matrix.endswith("delays"):
                continue
            factor = np.full(count, value_at(slope, ordered), dtype=np.complex128)
            if matrix == "M":
                factor *= -self.roots
            elif matrix in ("H1", "D1"):
                factor *= self.roots
            at, across = row if of_state else last, column if by_state else last
            total[wanted[place]] += np.outer(factor * self.left[:, at], self.right[across])
        return total


def _pole_pencil(structure: Structure, values: Mapping[str, float]) -> _Pencil:
    """Return the pencil F - s M, whose roots are the model's poles."""
    filled = structure.program.fill(structure.program.ordered(values))
    m, f = filled["M"], filled["F"]
    n = f.shape[0]
    if not all(np.all(np.isfinite(matrix)) for matrix in filled.values()):
        raise IdentificationError(
            f"a matrix entry of {structure.name!r} is undefined for these parameters, so the model "
            "has no modes"
        )
    if n and np.linalg.cond(m) > SINGULAR:
        raise IdentificationError(
            f"the matrix M of {structure.name!r} is singular for these parameters, so not every "
            "state has a mode"
        )
    roots, right = np.linalg.eig(np.linalg.solve(m, f)) if n else (np.empty(0), np.empty((0, 0)))
    left, _ = _null_vectors(roots, f, m, right)
    return _Pencil(structure, values, roots.astype(np.complex128), left, right.astype(complex))


def _zero_pencil(
    structure: Structure, values: Mapping[str, float], response: str, poles: _Pencil
) -> tuple[_Pencil, float]:
    """Return the pencil whose roots are a response's zeros, and the response's gain.

    The gain is what the response tends to at high frequency, over the power of s there.
    """
    place = structure.delay_places("delays").get(response)
    if place is None:
        raise IdentificationError(f"{structure.name!r} has no response {response!r}")
    o, i = place
    filled = structure.program.fill(structure.program.ordered(values))
    m, f, g = filled["M"], filled["F"], filled["G"][:, [i]]
    h0, h1 = filled["H0"][[o]], filled["H1"][[o]]
    d, d1 = filled["D"][o, i], filled["D1"][o, i]
    n = f.shape[0]
    a, b = (np.linalg.solve(m, x).astype(np.float64) if n else x for x in (f, g))
    roots, gain = _zeros(a, b, h0 + h1 @ a, float(d + (h1 @ b)[0, 0]), d1)
    size = np.max(np.abs(poles.roots), initial=0.0)
    roots = uncancelled(roots, poles.roots, size)
    zero = np.block([[f, g], [h0, np.array([[d]])]])
    rate = np.block([[m, np.zeros((n, 1))], [-h1, np.array([[-d1]])]])
    left, right = _null_vectors(roots, zero, rate)
    return _Pencil(structure, values, roots, left, right, o, i), gain


def _zeros(a: Real, b: Real, c: Real, d: float, d1: float) -> tuple[Roots, float]:
    """Return the zeros of c (s - A)^-1 b + d + d1 s, and its gain.

    An output held at zero by its input leaves the states of its own motion: those that neither
    the output nor its rates up to the order that the input enters see.
    """
    if d1:
        held = np.block([[a, b], [-c / d1, np.array([[-d / d1]])]])
        return np.linalg.eigvals(held).astype(np.complex128), d1
    if d:
        return np.linalg.eigvals(a - b @ c / d).astype(np.complex128), d
    row, seen, reach = c, [], np.abs(c)
    for _ in a:
        gain, terms = float((row @ b)[0, 0]), float((reach @ np.abs(b))[0, 0])
        seen.append(row / max(float(np.max(np.abs(row), initial=0.0)), 1e-300))
        if abs(gain) > _NOTHING * terms:
            free = null_space(np.vstack(seen))
            held = a - b @ (row @ a) / gain
            return np.linalg.eigvals(free.T @ held @ free).astype(np.complex128), gain
        row, reach = row @ a, reach @ np.abs(a)
    return np.empty(0, dtype=np.complex128), 0.0


def uncancelled(zeros: Roots, poles: Roots, size: float) -> Roots:
    """Return the zeros without those that poles cancel, each pole at most one.

    Args:
        zeros: (n_zero,).
        poles: (n_pole,).
        size: of the fastest pole: roots below a thousandth of it are compared by that.
    """
    left, kept = list(poles), []
    for zero in zeros:
        near = [abs(zero - pole) for pole in left]
        if near and min(near) <= _CANCELS * max(abs(zero), 1e-3 * size):
            left.pop(int(np.argmin(near)))
        else:
            kept.append(zero)
    return np.array(kept, dtype=np.complex128)


def _null_vectors(
    roots: NDArray, zero: Real, rate: Real, right: NDArray | None = None
) -> tuple[Roots, Roots]:
    """Return the pencil's null vectors at its roots, scaled to l rate r = 1.

    Each is scaled by its size in the states' units.
    """
    count, size = roots.size, zero.shape[0]
    lefts = np.zeros((count, size), dtype=np.complex128)
    rights = np.zeros((size, count), dtype=np.complex128)
    for k, root in enumerate(roots):
        u, _, vh = np.linalg.svd(zero - root * rate)
        lefts[k], rights[:, k] = u[:, -1].conj(), vh[-1].conj()
    rights = rights if right is None else right.astype(np.complex128)
    with np.errstate(all="ignore"):
        lefts /= np.einsum("ij,jk,ki->i", lefts, rate, rights)[:, None]
    return lefts, rights


def _found(pencil: _Pencil, names: Sequence[str], covariance: Real | None) -> tuple[Mode, ...]:
    """Return the pencil's roots with their errors."""
    found = [Mode(float(z.real) + 0.0, float(z.imag)) for z in pencil.roots]
    if covariance is not None:
        # (n_name, n_root, n_root) by which a change of each parameter joins two roots
        joins = pencil.changes(names)
        values = np.abs([pencil.values[name] for name in names])
        found = [
            _with_errors(mode, k, pencil.roots, joins, covariance, values)
            for k, mode in enumerate(found)
        ]
    found = [mode for mode in found if not mode.imag < 0.0]
    return tuple(sorted(found, key=lambda one: (one.frequency, one.real)))


def _with_errors(
    mode: Mode, k: int, roots: Roots, joins: Roots, covariance: Real, values: Real
) -> Mode:
    slope = joins[:, k, k]
    unknown = ~np.isfinite(np.diagonal(covariance))
    known = np.where(unknown[:, None] | unknown[None, :], 0.0, covariance)
    parts = np.array([slope.real, slope.imag])
    inside = parts @ known @ parts.T
    # A parameter that the data do not see leaves a root unknown, unless it does not move it.
    reach = np.abs(slope) * values > 1e-9 * max(mode.frequency, 1e-9)
    if bool(np.any(unknown & reach)) or not np.all(np.isfinite(slope)):
        return Mode(mode.real, mode.imag, math.inf, math.inf if mode.imag else 0.0, 0.0, False)
    real, imag = np.sqrt(np.maximum(np.diagonal(inside), 0.0)).tolist()
    if math.hypot(real, imag) < _ROUNDING * np.max(np.abs(roots)):
        return Mode(mode.real, mode.imag, 0.0, 0.0)
    imag = imag if mode.imag else 0.0
    correlation = float(inside[0, 1]) / (real * imag) if real * imag > 0.0 else 0.0
    size = math.hypot(real, imag)
    # mean square by which the errors join two roots, there and back
    power = np.maximum(np.einsum("pij,pq,qij->ij", joins, known, joins.conj()).real, 0.0)
    bend = np.sqrt(power[k] * power[:, k])
    near = (bend > 0.0) & (bend > _CURVED * size * np.abs(roots[k] - roots))
    separate = not np.any(np.delete(near, k))
    return Mode(mode.real, mode.imag, real, imag, float(np.clip(correlation, -1.0, 1.0)), separate)
