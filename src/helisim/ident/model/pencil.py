"""Where a model's matrix pencil is singular: its poles, and the zeros of one response.

A model can be larger than one of its responses needs. Such a part has its poles among the zeros of
the response too, which cancel; these are left out of the zeros.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from helisim.base.errors import IdentificationError
from helisim.ident.model.forms import value_at
from helisim.ident.model.structure import Structure

_SINGULAR = 1e12
"""Condition of M from which it has no inverse."""

_NOTHING = 1e-10
"""Part of its terms below which a sum of products is zero but for rounding."""

_CANCELS = 1e-6
"""Part of its size by which a zero may be off the pole that it cancels: nearly equal roots are
known to the root of the rounding."""


@dataclass(frozen=True, eq=False)
class Pencil:
    """A pencil P(s) with its roots and null vectors, l (dP/ds) r = -1.

    Attributes:
        structure: whose.
        values: every parameter by name.
        roots: (n_root,) where P is singular.
        left: (n_root, n_row) null vectors.
        right: (n_row, n_root) null vectors.
        states: number of rows that are states'; the last row and column, if more, are those of an
            output and an input.
        output: number of the output; -1 for none.
        input: number of the input; -1 for none.
    """

    structure: Structure
    values: Mapping[str, float]
    roots: NDArray[np.complex128]
    left: NDArray[np.complex128]
    right: NDArray[np.complex128]
    states: int
    output: int = -1
    input: int = -1

    def changes(self, names: Sequence[str]) -> NDArray[np.complex128]:
        """Return l_i (dP/dp)(s_i) r_j for each parameter p named, (n_name, n_root, n_root).

        On the diagonal it is how fast the root moves.
        """
        program, count = self.structure.program, self.roots.size
        ordered = program.ordered(self.values).tolist()
        wanted = {program.names.index(name): k for k, name in enumerate(names)}
        total = np.zeros((len(names), count, count), dtype=np.complex128)
        for place, matrix, row, column, slope in program.dependences:
            if place not in wanted or not self._has(matrix, row, column):
                continue
            at = row if matrix in ("M", "F", "G") else self.states
            across = column if matrix in ("M", "F", "H0", "H1") else self.states
            factor = np.full(count, value_at(slope, ordered), dtype=np.complex128)
            if matrix == "M":
                factor *= -self.roots
            elif matrix in ("H1", "D1"):
                factor *= self.roots
            total[wanted[place]] += np.outer(factor * self.left[:, at], self.right[across])
        return total

    def _has(self, matrix: str, row: int, column: int) -> bool:
        """Return whether a matrix entry stands in the pencil."""
        match matrix:
            case "M" | "F":
                return True
            case "G":
                return column == self.input
            case "H0" | "H1":
                return row == self.output
            case "D" | "D1":
                return row == self.output and column == self.input
        return False


def pole_pencil(structure: Structure, values: Mapping[str, float]) -> Pencil:
    """Return the pencil F - s M, whose roots are the model's poles.

    Raises:
        IdentificationError: M is singular, or an entry undefined.
    """
    filled = structure.program.fill(structure.program.ordered(values))
    m, f = filled["M"], filled["F"]
    n = f.shape[0]
    if not all(np.all(np.isfinite(matrix)) for matrix in filled.values()):
        raise IdentificationError(
            f"a matrix entry of {structure.name!r} is undefined for these parameters, so the model "
            "has no modes"
        )
    if n and np.linalg.cond(m) > _SINGULAR:
        raise IdentificationError(
            f"the matrix M of {structure.name!r} is singular for these parameters, so not every "
            "state has a mode"
        )
    roots, right = np.linalg.eig(np.linalg.solve(m, f)) if n else (np.empty(0), np.empty((0, 0)))
    return _scaled(structure, values, roots.astype(np.complex128), right, f, m, n)


def zero_pencil(
    structure: Structure, values: Mapping[str, float], response: str, poles: Pencil
) -> tuple[Pencil, float]:
    """Return the pencil whose roots are a response's zeros, and the response's gain.

    The gain is what the response tends to at high frequency, over the power of s there.

    Args:
        structure: the model's.
        values: every parameter by name.
        response: such as "p/lat".
        poles: the model's; what they cancel is left out.

    Raises:
        IdentificationError: M is singular.
    """
    o, i = _place(structure, response)
    filled = structure.program.fill(structure.program.ordered(values))
    m, f, g = filled["M"], filled["F"], filled["G"][:, [i]]
    h0, h1 = filled["H0"][[o]], filled["H1"][[o]]
    d, d1 = filled["D"][o, i], filled["D1"][o, i]
    n = f.shape[0]
    a, b = (np.linalg.solve(m, x).astype(np.float64) if n else x for x in (f, g))
    roots, gain = _zeros(a, b, h0 + h1 @ a, float(d + (h1 @ b)[0, 0]), d1)
    size = np.max(np.abs(poles.roots), initial=0.0)
    roots = _uncancelled(roots, poles.roots, size)
    zero = np.block([[f, g], [h0, np.array([[d]])]])
    rate = np.block([[m, np.zeros((n, 1))], [-h1, np.array([[-d1]])]])
    return _scaled(structure, values, roots, None, zero, rate, n, o, i), gain


def _place(structure: Structure, response: str) -> tuple[int, int]:
    for o, output in enumerate(structure.outputs):
        for i, input_ in enumerate(structure.inputs):
            if response == f"{output}/{input_}":
                return o, i
    raise IdentificationError(f"{structure.name!r} has no response {response!r}")


def _zeros(
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    c: NDArray[np.float64],
    d: float,
    d1: float,
) -> tuple[NDArray[np.complex128], float]:
    """Return the zeros of c (s - A)^-1 b + d + d1 s, and its gain.

    An output held at zero by its input leaves the states of its own motion: those that neither
    the output nor its rates up to the order that the input enters see.
    """
    n = a.shape[0]
    if d1:
        held = np.block([[a, b], [-c / d1, np.array([[-d / d1]])]])
        return np.linalg.eigvals(held).astype(np.complex128), d1
    if d:
        return np.linalg.eigvals(a - b @ c / d).astype(np.complex128), d
    row, seen, reach = c, [], np.abs(c)
    for _ in range(n):
        gain, terms = float((row @ b)[0, 0]), float((reach @ np.abs(b))[0, 0])
        seen.append(row / max(float(np.max(np.abs(row), initial=0.0)), 1e-300))
        if abs(gain) > _NOTHING * terms:
            free = null_space(np.vstack(seen))
            held = a - b @ (row @ a) / gain
            return np.linalg.eigvals(free.T @ held @ free).astype(np.complex128), gain
        row, reach = row @ a, reach @ np.abs(a)
    return np.empty(0, dtype=np.complex128), 0.0


def _uncancelled(
    zeros: NDArray[np.complex128], poles: NDArray[np.complex128], size: float
) -> NDArray[np.complex128]:
    """Return the zeros without those that poles cancel, each pole at most one."""
    left, kept = list(poles), []
    for zero in zeros:
        near = [abs(zero - pole) for pole in left]
        k = int(np.argmin(near)) if near else -1
        if near and near[k] <= _CANCELS * max(abs(zero), 1e-3 * size):
            left.pop(k)
        else:
            kept.append(zero)
    return np.array(kept, dtype=np.complex128)


def _scaled(
    structure: Structure,
    values: Mapping[str, float],
    roots: NDArray[np.complex128],
    right: NDArray | None,
    zero: NDArray[np.float64],
    rate: NDArray[np.float64],
    states: int,
    output: int = -1,
    input: int = -1,
) -> Pencil:
    """Return the pencil zero - s rate with null vectors scaled to l rate r = 1.

    All vectors come from the matrices at the roots, each scaled by its size in the states' units.
    """
    count, size = roots.size, zero.shape[0]
    lefts = np.zeros((count, size), dtype=np.complex128)
    rights = np.zeros((size, count), dtype=np.complex128)
    for k, root in enumerate(roots):
        u, _, vh = np.linalg.svd(zero - root * rate)
        lefts[k], rights[:, k] = u[:, -1].conj(), vh[-1].conj()
    if right is not None:
        rights = right.astype(np.complex128)
    with np.errstate(all="ignore"):
        lefts /= np.einsum("ij,jk,ki->i", lefts, rate, rights)[:, None]
    return Pencil(structure, values, roots, lefts, rights, states, output, input)
