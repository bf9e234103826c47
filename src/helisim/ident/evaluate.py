"""A structure with numbers: matrices, frequency response with exact derivatives, time responses.

With R = (s M - F)^-1, a point of output o and input i has the response

    H = [e_o (H0 + s H1) R G e_i + D_oi + s D1_oi] e^(-s tau_oi) ,

and its derivative by any matrix entry is a product of what stands to the left and to the right of
that entry, from dR = -R d(s M - F) R: by F_rc it is (e_o (H0 + s H1) R)_r (R G e_i)_c.

R is taken at all frequencies from the eigenvectors of M^-1 F at once. Where that is not accurate,
as of two equal lags, whose eigenvectors are one, of a nearly singular M, or of a pole very much
faster than the others, or where the model is small, it is inverted frequency by frequency.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from helisim.base.errors import IdentificationError
from helisim.ident.expression import Dependence, Program, value_at
from helisim.ident.structure import Structure

if TYPE_CHECKING:
    import control

SINGULAR = 1e12
"""Condition of M from which it has no inverse."""
_ACCURATE, _ROUNDING = 1e-12, 1e-15
"""Part of their terms by which the states' equations may be missed; and the part of the largest
terms that is nothing in any equation, which rounding leaves."""
_INDEPENDENT = 1e5
"""Condition of the eigenvectors, whatever the states' units, up to which they are used. Those of
the structures here have 1 to 30, and 1e8 where speeds and attitudes are nearly integrators."""
_FEW = 2500
"""Frequencies times states squared, up to which inverses take no longer than eigenvectors."""
_BLOCK = 64
"""Samples in a block of a simulation: only speed depends on it."""

Real = NDArray[np.float64]
Complex = NDArray[np.complexfloating]
Sides = Callable[[], tuple[Complex, Complex]]
"""Gives e_o (H0 + s H1) R and R G e_i of each point, (n_state, n_point) both."""


@dataclass(frozen=True, eq=False)
class Matrices:
    """The numbers of a structure; delays in s."""

    M: Real
    F: Real
    G: Real
    H0: Real
    H1: Real
    D: Real
    D1: Real
    input_delays: Real
    output_delays: Real
    delays: Real

    @property
    def lags(self) -> Real:
        """The delay of every response: its input's, its output's and its own, (n_out, n_in) s."""
        return self.output_delays[:, None] + self.input_delays[None, :] + self.delays


def matrices(structure: Structure, values: Mapping[str, float]) -> Matrices:
    """Return the matrices for the given parameters."""
    filled = structure.program.fill(structure.program.ordered(values))
    for delays in ("input_delays", "output_delays"):
        filled[delays] = filled[delays].ravel()
    return Matrices(**filled)


def response(
    structure: Structure, values: Mapping[str, float], frequency: Real
) -> NDArray[np.complex128]:
    """Return the frequency response, (n_out, n_in, n_freq); not finite where it is undefined.

    Args:
        structure: the model's.
        values: every parameter by name.
        frequency: (n_freq,) rad/s.
    """
    everywhere, shape = _everywhere(structure, frequency)
    return everywhere.at(structure.program.ordered(values)).response.reshape(shape)


def response_and_slope(
    structure: Structure,
    values: Mapping[str, float],
    frequency: Real,
    by: Sequence[str] | None = None,
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return the response and its derivative by each free parameter.

    A fit asks for them at its points alone, by `Sensitivity`.

    Args:
        structure: the model's.
        values: every parameter by name.
        frequency: (n_freq,) rad/s.
        by: names of other parameters to take the derivatives by; the free ones by default.

    Returns:
        (n_out, n_in, n_freq) and (n_free, n_out, n_in, n_freq).
    """
    everywhere, shape = _everywhere(structure, frequency, by)
    there = everywhere.at(structure.program.ordered(values))
    return there.response.reshape(shape), there.slope().reshape(-1, *shape)


def _everywhere(
    structure: Structure, frequency: Real, by: Sequence[str] | None = None
) -> "tuple[Sensitivity, tuple[int, int, int]]":
    """Return the points of every response at every frequency, and the shape that they have."""
    shape = (len(structure.outputs), len(structure.inputs), frequency.size)
    output, input_, position = np.indices(shape).reshape(3, -1)
    return Sensitivity(structure.program, frequency[position], output, input_, by=by), shape


def state_space(structure: Structure, values: Mapping[str, float]) -> "control.StateSpace":
    """Return the model without its delays, signals and states named.

    Raises:
        IdentificationError: M is singular, or an output follows an input's rate (D1), so the model
            has no state space.
    """
    if structure.improper:
        raise IdentificationError(
            f"the model {structure.name!r} is improper: D1 makes an output follow an input's rate, "
            "which no state space does; `proper_part` is the model without D1, and `response`, "
            "`verify` and `to_matlab` have it all"
        )
    return proper_part(structure, values)


def proper_part(structure: Structure, values: Mapping[str, float]) -> "control.StateSpace":
    """Return the model without its delays and D1, signals and states named.

    Raises:
        IdentificationError: M is singular, so the model has no state space.
    """
    numbers = matrices(structure, values)
    if structure.states and np.linalg.cond(numbers.M) > SINGULAR:
        raise IdentificationError(
            f"the matrix M of {structure.name!r} is singular for these parameters, "
            "so the model has no state-space form"
        )
    a = np.linalg.solve(numbers.M, numbers.F)
    b = np.linalg.solve(numbers.M, numbers.G)
    import control  # slow to import: it brings matplotlib

    return control.StateSpace(
        a,
        b,
        numbers.H0 + numbers.H1 @ a,
        numbers.D + numbers.H1 @ b,
        states=list(structure.states),
        inputs=list(structure.inputs),
        outputs=list(structure.outputs),
        name=structure.name,
        remove_useless_states=False,
    )


class Sensitivity:
    """A structure's response and its slopes at points, (n_point,) each: the inner loop of a fit."""

    def __init__(
        self,
        program: Program,
        frequency: Real,
        output: NDArray[np.intp],
        input: NDArray[np.intp],
        *,
        by: Sequence[str] | None = None,
    ) -> None:
        """Prepare for points, each of one output and one input.

        Args:
            program: the structure's.
            frequency: (n_point,) rad/s.
            output: (n_point,) number of the output.
            input: (n_point,) number of the input.
            by: names of the parameters whose slopes are wanted; the free ones by default.
        """
        self.program = program
        self.s = 1j * frequency
        self.output, self.input = output, input
        self.grid, self.position = np.unique(frequency, return_inverse=True)
        n_out, n_in = program.fill(np.zeros(len(program.names)))["D"].shape
        self.is_output = (output == np.arange(n_out)[:, None]).astype(np.float64)
        self.is_input = (input == np.arange(n_in)[:, None]).astype(np.float64)
        wanted = program.free if by is None else [program.names.index(name) for name in by]
        self.dependences = [
            [one for one in program.dependences if one.place == place] for place in wanted
        ]
        self.total = np.empty((len(self.dependences), frequency.size), dtype=np.complex128)
        self.spare = np.empty(frequency.size, dtype=np.complex128)

    def at(self, parameters: Real) -> "Sample":
        """Return the response for (n_parameter,), and the way to its slopes."""
        return Sample(self, parameters)


class Sample:
    """The response at the points for some parameters.

    Attributes:
        response: (n_point,); not finite where the model is undefined.
    """

    def __init__(self, where: Sensitivity, parameters: Real) -> None:
        self._where = where
        self._parameters = parameters
        filled = where.program.fill(parameters)
        at = (where.output, where.input)
        with np.errstate(all="ignore"):
            plain, self._sides = _solved(where, filled)
            lags = filled["input_delays"] + filled["output_delays"] + filled["delays"]
            self._delay = np.exp(-where.s * lags[at]) if np.any(lags) else np.ones_like(where.s)
            self.response = (plain + filled["D"][at] + where.s * filled["D1"][at]) * self._delay

    def slope(self, scale: Complex | None = None) -> NDArray[np.complex128]:
        """Return the derivatives by the wanted parameters, (n_wanted, n_point).

        Args:
            scale: (n_point,) by which each point's are multiplied.

        The array is overwritten by the next call for the same points.
        """
        where, parameters = self._where, self._parameters.tolist()
        scale = np.ones_like(where.s) if scale is None else scale
        with np.errstate(all="ignore"):
            left, right = self._sides()
            delayed = self._delay * scale
            left *= delayed
            late = -where.s * self.response * scale
            for row, dependences in zip(where.total, where.dependences):
                if not dependences:
                    row[:] = 0.0
                for number, one in enumerate(dependences):
                    part = where.spare if number else row
                    _by_entry(part, one, where, left, right, delayed, late)
                    slope = value_at(one.slope, parameters)
                    if slope != 1.0:
                        part *= slope
                    if number:
                        row += part
        return where.total


def _by_entry(
    part: Complex,
    entry: Dependence,
    where: Sensitivity,
    left: Complex,
    right: Complex,
    delayed: Complex,
    late: Complex,
) -> None:
    """Write the derivative by one entry of a matrix, (n_point,), into `part`.

    Args:
        part: to write to.
        entry: which one.
        where: the points.
        left: what stands to the left of F, delay and scale included.
        right: what stands to its right.
        delayed: delay and scale.
        late: derivative by the delay, scale included.
    """
    _, matrix, row, column, _ = entry
    match matrix:
        case "F" | "M":
            np.multiply(left[row], right[column], out=part)
        case "G":
            np.multiply(left[row], where.is_input[column], out=part)
        case "H0" | "H1":
            np.multiply(right[column], where.is_output[row], out=part)
            part *= delayed
        case "input_delays":
            np.multiply(late, where.is_input[column], out=part)
        case "output_delays":
            np.multiply(late, where.is_output[row], out=part)
        case _:
            both = where.is_input[column] * where.is_output[row]
            np.multiply(late if matrix == "delays" else delayed, both, out=part)
    if matrix == "M":
        part *= -where.s
    elif matrix in ("H1", "D1"):
        part *= where.s


def _solved(where: Sensitivity, filled: dict[str, Real]) -> tuple[Complex, Sides]:
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
    s: complex, filled: dict[str, Real], value: NDArray, vector: NDArray, dual: NDArray
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
    where: Sensitivity, filled: dict[str, Real], value: NDArray, vector: NDArray, dual: NDArray
) -> tuple[Complex, Sides]:
    """With R = V (s - Lambda)^-1 W, where M^-1 F V = V Lambda and W M V = 1."""
    observed = (filled["H0"] @ vector).T.take(where.output, axis=1)
    rates = filled["H1"] @ vector
    if np.any(rates):
        observed = observed + where.s * rates.T.take(where.output, axis=1)
    resolved = (1.0 / (1j * where.grid - value[:, None])).take(where.position, axis=1)
    seen = observed * resolved
    driven = (dual @ filled["G"]).take(where.input, axis=1)
    sides: Sides = lambda: (dual.T @ seen, vector @ (driven * resolved))  # noqa: E731
    return np.einsum("ij,ij->j", seen, driven), sides


def _by_inverse(where: Sensitivity, filled: dict[str, Real]) -> tuple[Complex, Sides]:
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


def simulate(
    model: "control.StateSpace", inputs: Real, step: float, start: Real | None = None
) -> Real:
    """Return the outputs, (n_time, n_out), exact for inputs linear between samples.

    Args:
        model: a continuous model.
        inputs: (n_time, n_in).
        step: sample time, s.
        start: (n_state,) initial state; at rest by default.
    """
    a, b, c, d = (np.asarray(x, dtype=np.float64) for x in (model.A, model.B, model.C, model.D))
    transition, now, change = _discretise(a, b, step)
    rise = np.diff(inputs, axis=0, append=inputs[-1:])
    driven = inputs @ now.T + rise @ change.T
    states = _propagate(transition, driven, np.zeros(a.shape[0]) if start is None else start)
    return states @ c.T + inputs @ d.T


def delayed(
    model: "control.StateSpace",
    inputs: Real,
    step: float,
    lags: Real,
    by_rate: Real | None = None,
) -> Real:
    """Return the outputs of a model at rest with a delay a pair, (n_time, n_out).

    Exact for inputs linear between samples, also where a delay isn't a whole number of them.
    Before the record inputs rest at their first value, after it at their last. An input's rate
    is the mean of the slopes on both sides of a sample, linear between samples.

    Args:
        model: a continuous model.
        inputs: (n_time, n_in), deviations from trim.
        step: sample time, s.
        lags: (n_out, n_in) s, negative where an output leads its input.
        by_rate: (n_out, n_in) D1, by how much an output follows an input's rate; none by default.
    """
    a, b, c, d = (np.asarray(x, dtype=np.float64) for x in (model.A, model.B, model.C, model.D))
    samples, n_in = inputs.shape
    outputs = np.zeros((samples, c.shape[0]))
    # What the delays reach beyond the record, on both sides.
    margin = int(np.ceil(np.max(np.abs(lags), initial=0.0) / step)) + 2
    transition, now, change = _discretise(a, b, step)
    for j in range(n_in):
        wide = np.pad(inputs[:, j], margin, mode="edge")
        rise, rate = np.diff(wide, append=wide[-1]), np.gradient(wide, step)
        driven = np.outer(wide, now[:, j]) + np.outer(rise, change[:, j])
        states = _propagate(transition, driven, np.zeros(a.shape[0]))
        for lag in np.unique(lags[:, j]):
            whole = int(np.floor(-lag / step))
            part = -lag - whole * step
            at = slice(margin + whole, margin + whole + samples)
            ahead, held, risen = _discretise(a, b, part)
            slope = rise[at] * (part / step)
            moved = (
                states[at] @ ahead.T + np.outer(wide[at], held[:, j]) + np.outer(slope, risen[:, j])
            )
            for k in np.flatnonzero(lags[:, j] == lag):
                outputs[:, k] += moved @ c[k] + (wide[at] + slope) * d[k, j]
                if by_rate is not None and by_rate[k, j]:
                    ahead_at = slice(at.start + 1, at.stop + 1)
                    between = rate[at] + (rate[ahead_at] - rate[at]) * (part / step)
                    outputs[:, k] += between * by_rate[k, j]
    return outputs


def _discretise(a: Real, b: Real, step: float) -> tuple[Real, Real, Real]:
    """Return the exact transition over one step of an input that changes linearly.

    Of the state, by the input's sample now, and by its change to the next sample.
    """
    n, n_in = b.shape
    block = np.zeros((n + 2 * n_in, n + 2 * n_in))
    block[:n, :n] = a * step
    block[:n, n : n + n_in] = b * step
    block[n : n + n_in, n + n_in :] = np.eye(n_in)
    power = np.asarray(expm(block), dtype=np.float64)
    return power[:n, :n], power[:n, n : n + n_in], power[:n, n + n_in :]


def _propagate(transition: Real, driven: Real, start: Real) -> Real:
    """Return x_0 .. x_(N-1) of x_(k+1) = A x_k + driven_k, (n_time, n_state).

    Blocks are started from zero all at once, then the states at their edges are chained.
    """
    samples, n = driven.shape
    if n == 0:
        return driven
    blocks = -(-samples // _BLOCK)
    padded = np.zeros((blocks * _BLOCK, n))
    padded[:samples] = driven
    padded = padded.reshape(blocks, _BLOCK, n)
    local = np.zeros((blocks, _BLOCK + 1, n))
    powers = np.zeros((_BLOCK + 1, n, n))
    powers[0] = np.eye(n)
    for k in range(_BLOCK):
        local[:, k + 1] = local[:, k] @ transition.T + padded[:, k]
        powers[k + 1] = transition @ powers[k]
    edge, state = np.zeros((blocks, n)), start
    for block in range(blocks):
        edge[block] = state
        state = powers[_BLOCK] @ state + local[block, _BLOCK]
    free = np.einsum("kij,bj->bki", powers[:_BLOCK], edge)
    return (local[:, :_BLOCK] + free).reshape(-1, n)[:samples]
