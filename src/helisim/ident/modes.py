"""Poles and zeros of an identified model, with errors from its parameters' errors.

Both are where a pencil P(s) is singular: s M - F for the poles, and for the zeros of y/u
[[F - s M, G], [H0 + s H1, D]]. With null vectors scaled to l dP/ds r = -1, a change dP moves the
root by l dP r (delta method).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from helisim.base.arrays import Complex, Real
from helisim.base.display import Displayed
from helisim.base.errors import IdentificationError
from helisim.base.settings import Checked, Value
from helisim.ident.evaluate import SINGULAR
from helisim.ident.expression import value_at
from helisim.ident.structure import MATRICES, Structure

# Second-order part of a root's change over its standard error, from which the error is rough; and
# the fraction of the fastest root that is rounding in an error
_CURVED, _ROUNDING = 0.25, 1e-13
# _ORIGIN: rad/s: a root nearer to zero is an integrator, or a zero at the origin
# _NOTHING: fraction of its terms below which a sum of products is rounding
_ORIGIN, _NOTHING = 1e-9, 1e-10
_CANCELS = 1e-6  # relative distance of a zero from the pole that it cancels


@dataclass(frozen=True)
class Mode:
    """One pole or zero, `real` in 1/s; `imag` in rad/s, never negative: a pair is one mode.

    Errors are standard errors, nan without the fit's covariance. Where `separate` is False it could
    merge with another: errors are then orders of magnitude.
    """

    real: float
    imag: float
    real_error: float = math.nan
    imag_error: float = math.nan
    correlation: float = 0.0
    separate: bool = True

    @property
    def value(self) -> complex:
        """Root, 1/s."""
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
        return (
            math.hypot(self.real_error, self.imag_error)
            if self.frequency == 0.0
            else self._error(self.real / self.frequency, self.imag / self.frequency)
        )

    @property
    def damping(self) -> float:
        """Damping ratio, negative if unstable; 1 or -1 of a real one, nan at zero."""
        return -self.real / self.frequency if self.frequency else math.nan

    @property
    def damping_error(self) -> float:
        """Standard error of `damping`; 0 of a real one."""
        cube = self.frequency**3 or math.inf
        return self._error(-(self.imag**2) / cube, self.real * self.imag / cube)

    @property
    def time(self) -> float:
        """Time constant, s, of growth or decay by e; infinite on the axis."""
        return 1.0 / abs(self.real) if self.real else math.inf

    @property
    def time_error(self) -> float:
        """Standard error of `time`, s."""
        return self.real_error / self.real**2 if self.real else math.inf

    @property
    def doubling(self) -> float | None:
        """Time to double, s; None if it decays."""
        return math.log(2.0) / self.real if self.real > _ORIGIN else None

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; None for what isn't finite."""
        units = {"frequency": "frequency_rad_s", "time": "time_s", "doubling": "doubling_s"}
        names = ("real", "imag", "real_error", "imag_error", "frequency", "frequency_error")
        names += ("damping", "damping_error", "time", "time_error", "doubling")
        numbers = {units.get(name, name): getattr(self, name) for name in names}
        return {
            **{k: None if x is None or not math.isfinite(x) else x for k, x in numbers.items()},
            "separate": self.separate,
        }

    def notes(self, name: str) -> list[str]:
        """Return remarks; `name` is "pole", or "zero" with its response."""
        grows = "" if self.doubling is None else f"doubles in {self.doubling:.3g} s"
        kind = "non-minimum phase" if grows and not name.startswith("pole") else grows
        merges = "" if self.separate else "could merge with another: errors are rough"
        return [one for one in (kind, merges) if one]

    def _error(self, by_real: float, by_imag: float) -> float:
        one = by_real * self.real_error if by_real else 0.0
        other = by_imag * self.imag_error if by_imag else 0.0
        both = 2.0 * self.correlation * one * other if self.correlation else 0.0
        return math.sqrt(max(one**2 + other**2 + both, 0.0))


@dataclass(frozen=True, eq=False)
class Modes(Checked, Value, Displayed):
    """Poles of a fitted model and zeros of each fitted response ("p/lat"), slowest first.

    Zeros that cancel poles are left out; `gains` are high-frequency limits of H s^(poles - zeros).
    """

    poles: tuple[Mode, ...]
    zeros: Mapping[str, tuple[Mode, ...]]
    gains: Mapping[str, float]

    def __repr__(self) -> str:
        return f"Modes({len(self.poles)} poles; zeros of {', '.join(self.zeros)})"

    def __str__(self) -> str:
        shown = ["root, 1/s"] + [
            f"{one.real:.4g}" + f" +- {one.imag:.4g}j" * one.oscillates for _, one in self.named
        ]
        wide, long = (
            max(map(len, some)) for some in (["mode", *(n for n, _ in self.named)], shown)
        )
        lines = [
            f"{'mode':<{wide}}  {shown[0]:>{long}}  {'rad/s':>8} {'error':>7}  "
            f"{'damping':>7} {'error':>7}  {'time, s':>8} {'error':>7}"
        ]
        for (name, one), root in zip(self.named, shown[1:]):
            damping = f"{'-':>7} {'-':>7}"
            if one.oscillates:
                damping = f"{one.damping:7.3f} {_text(one.damping_error, 7, 2)}"
            lines.append(
                f"{name:<{wide}}  {root:>{long}}  {_text(one.frequency, 8)} "
                f"{_text(one.frequency_error, 7, 2)}  {damping}  {_text(one.time, 8)} "
                f"{_text(one.time_error, 7, 2)}  {'; '.join(one.notes(name))}".rstrip()
            )
        return "\n".join(lines)

    @property
    def named(self) -> list[tuple[str, Mode]]:
        """Every mode with "pole", or "zero" with its response."""
        zeros = [(f"zero {name}", one) for name, some in self.zeros.items() for one in some]
        return [*(("pole", one) for one in self.poles), *zeros]

    @property
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
    """Return poles and zeros (of `responses`) of a structure with values.

    `covariance` is of the errors of `names`, (n_name, n_name), infinite on the diagonal if unknown.
    Raises IdentificationError if M is singular or an entry undefined.
    """
    filled = structure.matrices(values)
    if not all(np.all(np.isfinite(matrix)) for matrix in filled.values()):
        raise IdentificationError(
            f"a matrix entry of {structure.name!r} is undefined for these parameters, so the model "
            "has no modes"
        )
    m, f, g, h0, h1, d = (filled[name] for name in MATRICES)
    n = len(f)
    if n and np.linalg.cond(m) > SINGULAR:
        raise IdentificationError(
            f"the matrix M of {structure.name!r} is singular for these parameters, so not every "
            "state has a mode"
        )
    a, b = (np.linalg.solve(m, x).astype(np.float64) if n else x for x in (f, g))
    poles, right = np.linalg.eig(a) if n else (np.empty(0), np.empty((0, 0)))
    poles = poles.astype(np.complex128)

    def found(
        roots: Complex, left: Complex, right: Complex, place: tuple[int, int]
    ) -> tuple[Mode, ...]:
        some = [Mode(float(z.real) + 0.0, float(z.imag)) for z in roots]
        if covariance is not None:
            # coupling of two roots by a change of each parameter, (n_name, n_root, n_root)
            joins = _changes(structure, values, names, roots, left, right, place)
            sizes = np.abs([values[name] for name in names])
            some = [
                _with_errors(mode, k, roots, joins, covariance, sizes)
                for k, mode in enumerate(some)
            ]
        kept = [mode for mode in some if not mode.imag < 0.0]
        return tuple(sorted(kept, key=lambda one: (one.frequency, one.real)))

    zeros, gains = {}, {}
    for name in responses:
        if name not in structure.pairs:
            raise IdentificationError(f"{structure.name!r} has no response {name!r}")
        o, i = structure.pairs[name]
        ahead = float(d[o, i] + (h1 @ b)[o, i])
        roots, gains[name] = _zeros(a, b[:, [i]], h0[[o]] + h1[[o]] @ a, ahead)
        roots = uncancelled(roots, poles, np.max(np.abs(poles), initial=0.0))
        pencil = np.block([[f, g[:, [i]]], [h0[[o]], d[[o]][:, [i]]]])
        rate = np.block([[m, np.zeros((n, 1))], [-h1[[o]], np.zeros((1, 1))]])
        zeros[name] = found(roots, *_null_vectors(roots, pencil, rate), (o, i))
    left, right = _null_vectors(poles, f, m, right)
    return Modes(found(poles, left, right, (-1, -1)), zeros, gains)


def _changes(
    structure: Structure,
    values: Mapping[str, float],
    names: Sequence[str],
    roots: Complex,
    left: Complex,
    right: Complex,
    place: tuple[int, int],
) -> Complex:
    """Return l_i (dP/dp)(s_i) r_j for each named parameter p, (n_name, n_root, n_root)."""
    program, count, last = structure.program, roots.size, len(structure.states)
    ordered = program.ordered(values).tolist()
    wanted = {program.names.index(name): k for k, name in enumerate(names)}
    total = np.zeros((len(names), count, count), dtype=np.complex128)
    for parameter, matrix, row, column, slope in program.dependences:
        of_state, by_state = matrix in ("M", "F", "G"), matrix in ("M", "F", "H0", "H1")
        here = (of_state or row == place[0]) and (by_state or column == place[1])
        if parameter not in wanted or not here or matrix.endswith("delays"):
            continue
        factor = np.full(count, value_at(slope, ordered), dtype=np.complex128)
        factor *= {"M": -roots, "H1": roots}.get(matrix, 1.0)
        at, across = row if of_state else last, column if by_state else last
        total[wanted[parameter]] += np.outer(factor * left[:, at], right[across])
    # a root that no parameter moves, as a rate's zero at the origin, merges with none; vectors of a
    # double one are large, and rounding with them
    moved = np.any(
        np.abs(np.diagonal(total, axis1=1, axis2=2))
        > _NOTHING
        * np.max(np.abs(left), axis=1, initial=0.0)
        * np.max(np.abs(right), axis=0, initial=0.0),
        axis=0,
    )
    return np.where(moved[:, None] & moved, total, 0.0)


def _zeros(a: Real, b: Real, c: Real, d: float) -> tuple[Complex, float]:
    if d:
        return np.linalg.eigvals(a - b @ c / d).astype(np.complex128), d
    row, seen, reach = c, [], np.abs(c)
    for _ in a:
        gain, terms = (row @ b).item(), (reach @ np.abs(b)).item()
        seen.append(row / max(float(np.max(np.abs(row), initial=0.0)), 1e-300))
        if abs(gain) > _NOTHING * terms:
            free = null_space(np.vstack(seen))
            held = a - b @ (row @ a) / gain
            return np.linalg.eigvals(free.T @ held @ free).astype(np.complex128), gain
        row, reach = row @ a, reach @ np.abs(a)
    return np.empty(0, dtype=np.complex128), 0.0


def uncancelled(zeros: Complex, poles: Complex, size: float) -> Complex:
    """Return zeros without those that poles cancel, relative to `size`, the fastest pole's."""
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
) -> tuple[Complex, Complex]:
    count, size = roots.size, zero.shape[0]
    lefts, rights = (np.zeros(one, np.complex128) for one in ((count, size), (size, count)))
    for k, root in enumerate(roots):
        u, _, vh = np.linalg.svd(zero - root * rate)
        # rounding in a repeated root's vectors would be divided by a product of nearly zero
        lefts[k], rights[:, k] = (
            np.where(np.abs(one) > _ROUNDING, one.conj(), 0.0) for one in (u[:, -1], vh[-1])
        )
    rights = rights if right is None else right.astype(np.complex128)
    with np.errstate(all="ignore"):
        product = np.einsum("ij,jk,ki->i", lefts, rate, rights)
        return lefts / np.where(product == 0.0, 1e-300, product)[:, None], rights


@np.errstate(over="ignore", invalid="ignore")  # of a repeated root
def _with_errors(
    mode: Mode, k: int, roots: Complex, joins: Complex, covariance: Real, values: Real
) -> Mode:
    slope = joins[:, k, k]
    unknown = ~np.isfinite(np.diagonal(covariance))
    known = np.where(unknown[:, None] | unknown[None, :], 0.0, covariance)
    parts = np.array([slope.real, slope.imag])
    inside = parts @ known @ parts.T
    # an unseen parameter leaves a root unknown, unless it does not move it
    reach = np.abs(slope) * values > 1e-9 * max(mode.frequency, 1e-9)
    if bool(np.any(unknown & reach)) or not np.all(np.isfinite(np.hstack([inside, parts]))):
        return Mode(mode.real, mode.imag, math.inf, math.inf if mode.imag else 0.0, 0.0, False)
    real, imag = np.sqrt(np.maximum(np.diagonal(inside), 0.0)).tolist()
    if math.hypot(real, imag) < _ROUNDING * np.max(np.abs(roots)):
        return Mode(mode.real, mode.imag, 0.0, 0.0)
    imag = imag if mode.imag else 0.0
    correlation = float(inside[0, 1]) / (real * imag) if real * imag > 0.0 else 0.0
    size = math.hypot(real, imag)
    # mean square by which the errors couple two roots, both ways
    power = np.maximum(np.einsum("pij,pq,qij->ij", joins, known, joins.conj()).real, 0.0)
    bend = np.sqrt(power[k] * power[:, k])
    near = (bend > 0.0) & (bend > _CURVED * size * np.abs(roots[k] - roots))
    separate = not np.any(np.delete(near, k))
    return Mode(mode.real, mode.imag, real, imag, float(np.clip(correlation, -1.0, 1.0)), separate)
