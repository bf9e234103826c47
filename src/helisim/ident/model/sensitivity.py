"""A structure's response at chosen points and its slopes: the inner loop of every fit.

With R = (s M - F)^-1, a point of output o and input i has the response

    H = [e_o (H0 + s H1) R G e_i + D_oi + s D1_oi] e^(-s tau_oi) ,

and its derivative by any matrix entry is a product of what stands to the left and to the right of
that entry, from dR = -R d(s M - F) R: by F_rc it is (e_o (H0 + s H1) R)_r (R G e_i)_c.

R is taken at all frequencies from the eigenvectors of M^-1 F at once. Where that is not accurate,
as of two equal lags, whose eigenvectors are one, of a nearly singular M, or of a pole very much
faster than the others, or where the model is small, it is inverted frequency by frequency.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from helisim.ident.model.forms import value_at
from helisim.ident.model.program import Dependence, Program

_ACCURATE = 1e-12
"""Part of their terms by which the states' equations may be missed: rounding leaves 1e-15."""

_INDEPENDENT = 1e5
"""Condition of the eigenvectors, whatever the states' units, up to which they are used. Those of
the structures here have 1 to 30, and 1e8 where speeds and attitudes are nearly integrators."""

_FEW = 2500
"""Frequencies times states squared, up to which inverses take no longer than eigenvectors."""

_ROUNDING = 1e-15
"""Part of the largest terms that is nothing in any equation."""

Complex = NDArray[np.complexfloating]
Sides = Callable[[], tuple[Complex, Complex]]
"""Gives e_o (H0 + s H1) R and R G e_i of each point, (n_state, n_point) both."""


class Sensitivity:
    """Where a structure's response is wanted: at points, each of one output and one input."""

    def __init__(
        self,
        program: Program,
        frequency: NDArray[np.float64],
        output: NDArray[np.intp],
        input: NDArray[np.intp],
        *,
        by: Sequence[str] | None = None,
    ) -> None:
        """Prepare for points.

        Args:
            program: the structure's.
            frequency: (n_point,) rad/s.
            output: (n_point,) number of the output.
            input: (n_point,) number of the input.
            by: names of the parameters whose slopes are wanted; the free ones by default.
        """
        self.program = program
        self.s = 1j * frequency
        self.output = output
        self.input = input
        self.grid, self.position = np.unique(frequency, return_inverse=True)
        filled = program.fill(np.zeros(len(program.names)))
        n_out, n_in = filled["D"].shape
        self.is_output = (output == np.arange(n_out)[:, None]).astype(np.float64)
        self.is_input = (input == np.arange(n_in)[:, None]).astype(np.float64)
        wanted = program.free if by is None else [program.names.index(name) for name in by]
        self.dependences = [
            [one for one in program.dependences if one.place == place] for place in wanted
        ]
        self.held = np.empty((len(self.dependences), frequency.size), dtype=np.complex128)
        self.spare = np.empty(frequency.size, dtype=np.complex128)

    def at(self, parameters: NDArray[np.float64]) -> "Sample":
        """Return the response for (n_parameter,), and the way to its slopes."""
        return Sample(self, parameters)


class Sample:
    """The response at the points for some parameters.

    Attributes:
        response: (n_point,); not finite where the model is undefined.
    """

    def __init__(self, where: Sensitivity, parameters: NDArray[np.float64]) -> None:
        self._where = where
        self._parameters = parameters
        filled = where.program.fill(parameters)
        with np.errstate(all="ignore"):
            plain, self._sides = _solved(where, filled)
            lags = filled["input_delays"] + filled["output_delays"] + filled["delays"]
            at = (where.output, where.input)
            self._delay = np.exp(-where.s * lags[at]) if np.any(lags) else np.ones_like(where.s)
            self.response = (plain + filled["D"][at] + where.s * filled["D1"][at]) * self._delay

    def slope(self, scale: Complex | None = None) -> NDArray[np.complex128]:
        """Return the derivatives by the wanted parameters, (n_wanted, n_point).

        Args:
            scale: (n_point,) by which each point's are multiplied.

        The array is overwritten by the next call for the same points.
        """
        where, total = self._where, self._where.held
        with np.errstate(all="ignore"):
            self._add_up(total, np.ones_like(where.s) if scale is None else scale)
        return total

    def _add_up(self, total: Complex, scale: Complex) -> None:
        where = self._where
        left, right = self._sides()
        waits = self._delay * scale
        left *= waits
        late = -where.s * self.response * scale
        parameters = self._parameters.tolist()
        for row, dependences in zip(total, where.dependences):
            if not dependences:
                row[:] = 0.0
            for number, one in enumerate(dependences):
                part = where.spare if number else row
                _by_entry(part, one, where, left, right, waits, late)
                slope = value_at(one.slope, parameters)
                if slope != 1.0:
                    part *= slope
                if number:
                    row += part


def _by_entry(
    part: Complex,
    entry: Dependence,
    where: Sensitivity,
    left: Complex,
    right: Complex,
    waits: Complex,
    late: Complex,
) -> None:
    """Write the derivative by one entry of a matrix, (n_point,), into `part`.

    Args:
        part: to write to.
        entry: which one.
        where: the points.
        left: what stands to the left of F, delay and scale included.
        right: what stands to its right.
        waits: delay and scale.
        late: derivative by the delay, scale included.
    """
    _, matrix, row, column, _ = entry
    match matrix:
        case "F":
            np.multiply(left[row], right[column], out=part)
        case "M":
            np.multiply(left[row], right[column], out=part)
            part *= -where.s
        case "G":
            np.multiply(left[row], where.is_input[column], out=part)
        case "H0" | "H1":
            np.multiply(right[column], where.is_output[row], out=part)
            part *= waits
        case "D" | "D1":
            np.multiply(waits, where.is_input[column] * where.is_output[row], out=part)
        case "input_delays":
            np.multiply(late, where.is_input[column], out=part)
        case "output_delays":
            np.multiply(late, where.is_output[row], out=part)
        case _:
            np.multiply(late, where.is_input[column] * where.is_output[row], out=part)
    if matrix in ("H1", "D1"):
        part *= where.s


def _solved(where: Sensitivity, filled: dict[str, NDArray[np.float64]]) -> tuple[Complex, Sides]:
    """Return e_o (H0 + s H1) R G e_i of each point, and its sides."""
    m, f = filled["M"], filled["F"]
    if not np.all(np.isfinite(m)) or not np.all(np.isfinite(f)):
        undefined = np.full((f.shape[0], where.s.size), np.nan, dtype=np.complex128)
        return np.full_like(where.s, np.nan), lambda: (undefined.copy(), undefined.copy())
    if where.grid.size * f.shape[0] ** 2 > _FEW:
        try:
            value, vector = np.linalg.eig(np.linalg.solve(m, f))
            dual = np.linalg.inv(m @ vector)
        except np.linalg.LinAlgError:
            return _by_inverse(where, filled)
        if _accurate(complex(0.0, where.grid[0]), filled, value, vector, dual):
            return _by_modes(where, filled, value, vector, dual)
    return _by_inverse(where, filled)


def _accurate(
    s: complex,
    filled: dict[str, NDArray[np.float64]],
    value: NDArray,
    vector: NDArray,
    dual: NDArray,
) -> bool:
    """Return whether the modes solve the states' equations, and those of the adjoint.

    At the lowest frequency: what is wrong with the slowest mode counts most there.
    """
    if not np.max(np.abs(dual @ filled["M"]) @ np.abs(vector)) <= _INDEPENDENT:
        return False
    pencil = s * filled["M"] - filled["F"]
    resolved = 1.0 / (s - value)[:, None]
    driven, seen = filled["G"], (filled["H0"] + s * filled["H1"]).T
    return _solves(pencil, vector @ (resolved * (dual @ driven)), driven) and _solves(
        pencil.T, dual.T @ (resolved * (vector.T @ seen)), seen
    )


def _solves(pencil: Complex, found: Complex, known: NDArray) -> bool:
    """Return whether `pencil @ found` is `known`, each row by the size of its own terms."""
    missed = np.max(np.abs(pencil @ found - known), axis=1)
    terms = np.max(np.abs(pencil) @ np.abs(found) + np.abs(known), axis=1)
    # What nothing drives or nobody sees is all rounding, so it can't be judged by its own size.
    return bool(np.all(missed <= _ACCURATE * terms + _ROUNDING * np.max(terms)))


def _by_modes(
    where: Sensitivity,
    filled: dict[str, NDArray[np.float64]],
    value: NDArray,
    vector: NDArray,
    dual: NDArray,
) -> tuple[Complex, Sides]:
    """With R = V (s - Lambda)^-1 W, where M^-1 F V = V Lambda and W M V = 1."""
    observed = (filled["H0"] @ vector).T.take(where.output, axis=1)
    rates = filled["H1"] @ vector
    if np.any(rates):
        observed = observed + where.s * rates.T.take(where.output, axis=1)
    resolved = (1.0 / (1j * where.grid - value[:, None])).take(where.position, axis=1)
    seen = observed * resolved
    driven = (dual @ filled["G"]).take(where.input, axis=1)

    def sides() -> tuple[Complex, Complex]:
        return dual.T @ seen, vector @ (driven * resolved)

    return np.einsum("ij,ij->j", seen, driven), sides


def _by_inverse(
    where: Sensitivity, filled: dict[str, NDArray[np.float64]]
) -> tuple[Complex, Sides]:
    """With R of each frequency."""
    s = 1j * where.grid[:, None, None]
    pencil = s * filled["M"] - filled["F"]
    try:
        resolvent = np.linalg.inv(pencil)
    except np.linalg.LinAlgError:
        resolvent = np.full_like(pencil, np.nan)
    right = (resolvent @ filled["G"])[where.position, :, where.input].T
    observed = (filled["H0"] + s * filled["H1"])[where.position, where.output].T

    def sides() -> tuple[Complex, Complex]:
        left = (filled["H0"] + s * filled["H1"]) @ resolvent
        return np.ascontiguousarray(left[where.position, where.output].T), right.copy()

    return np.sum(observed * right, axis=0), sides
