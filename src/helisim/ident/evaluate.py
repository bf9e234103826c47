"""Evaluates a structure: matrices, frequency response with exact derivatives, time responses.

With R = (s M - F)^-1, H = [e_o (H0 + s H1) R G e_i + D_oi] e^(-s tau_oi), dR = -R d(s M - F) R.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from helisim.base.arrays import Complex, Real
from helisim.base.errors import IdentificationError
from helisim.base.linear import LinearSystem, zero_order_hold
from helisim.ident.expression import Dependence, Program, value_at
from helisim.ident.structure import DELAYS, Structure

SINGULAR = 1e12  # condition of M that counts as singular
_BLOCK = 64  # samples a block in simulations


def response(structure: Structure, values: Mapping[str, float], frequency: Real) -> Complex:
    """Return the response, (n_out, n_in, n_freq), at (n_freq,) rad/s; not finite if undefined."""
    shape = (len(structure.outputs), len(structure.inputs), frequency.size)
    output, input_, position = np.indices(shape).reshape(3, -1)
    points = Sensitivity(structure.program, frequency[position], output, input_)
    return points.at(structure.program.ordered(values)).response.reshape(shape)


def linear(structure: Structure, values: Mapping[str, float]) -> LinearSystem:
    """Return the model with its delays.

    Raises IdentificationError if M is singular.
    """
    numbers = structure.matrices(values)
    m = numbers["M"]
    if structure.states and np.linalg.cond(m) > SINGULAR:
        raise IdentificationError(
            f"the matrix M of {structure.name!r} is singular for these parameters, "
            "so the model has no state-space form"
        )
    a = np.linalg.solve(m, numbers["F"]).astype(np.float64)
    b = np.linalg.solve(m, numbers["G"]).astype(np.float64)
    c, d = numbers["H0"] + numbers["H1"] @ a, numbers["D"] + numbers["H1"] @ b
    return LinearSystem(
        a,
        b,
        c,
        d,
        None,
        structure.inputs,
        structure.outputs,
        structure.states,
        dict(zip(structure.inputs, numbers["input_delays"].ravel().tolist())),
        dict(zip(structure.outputs, numbers["output_delays"].ravel().tolist())),
        name=structure.name,
    )


class Sensitivity:
    """A structure's response and slopes at points, (n_point,) each; default by the free ones."""

    def __init__(
        self,
        program: Program,
        frequency: Real,
        output: NDArray[np.intp],
        input: NDArray[np.intp],
        *,
        by: Sequence[str] | None = None,
    ) -> None:
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

    def at(self, parameters: Real) -> "Sample":
        """Return the response for parameters (n_parameter,)."""
        return Sample(self, parameters)


class Sample:
    """The response at the points, (n_point,), for some parameters; not finite if undefined."""

    def __init__(self, where: Sensitivity, parameters: Real) -> None:
        self._where, self._parameters = where, parameters
        filled, at = where.program.fill(parameters), (where.output, where.input)
        s = 1j * where.grid[:, None, None]
        with np.errstate(all="ignore"):
            pencil = s * filled["M"] - filled["F"]
            try:
                self._resolvent = np.linalg.inv(pencil)
            except np.linalg.LinAlgError:
                self._resolvent = np.full_like(pencil, np.nan)
            self._observed = filled["H0"] + s * filled["H1"]
            self._right = (self._resolvent @ filled["G"])[where.position, :, where.input].T
            plain = np.sum(self._observed[where.position, where.output].T * self._right, axis=0)
            self._delay = np.exp(-where.s * (filled["input_delays"] + filled["output_delays"])[at])
            self.response = (plain + filled["D"][at]) * self._delay

    def slope(self, scale: Complex | float = 1.0) -> Complex:
        """Return wanted derivatives, (n_wanted, n_point), times `scale`, (n_point,)."""
        where, parameters = self._where, self._parameters.tolist()
        total = np.zeros((len(where.dependences), where.s.size), dtype=np.complex128)
        with np.errstate(all="ignore"):
            seen = (self._observed @ self._resolvent)[where.position, where.output].T
            delayed: Complex = np.asarray(self._delay * scale, dtype=np.complex128)
            left, late = seen * delayed, -where.s * self.response * scale
            for row, dependences in zip(total, where.dependences):
                for one in dependences:
                    by_entry = self._by_entry(one, left, delayed, late)
                    row += by_entry * value_at(one.slope, parameters)
        return total

    def _by_entry(
        self, entry: Dependence, left: Complex, delayed: Complex, late: Complex
    ) -> Complex:
        """Return the derivative by a matrix entry, (n_point,), including delay and scale."""
        where, (_, matrix, row, column, _) = self._where, entry
        if matrix in DELAYS:
            of_input = matrix == "input_delays"
            return late * (where.is_input[column] if of_input else where.is_output[row])
        cause = self._right[column] if matrix in ("M", "F", "H0", "H1") else where.is_input[column]
        of_state = matrix in ("M", "F", "G")
        change = left[row] * cause if of_state else cause * where.is_output[row] * delayed
        return change * {"M": -where.s, "H1": where.s}.get(matrix, 1.0)


def simulate(model: LinearSystem, inputs: Real, step: float, start: Real | None = None) -> Real:
    """Return the outputs, (n_time, n_out), for inputs, (n_time, n_in), linear between samples.

    The state begins at `start`, (n_state,); default 0. Delays are left out.
    """
    transition, now, change = _discretise(model, step)
    driven = inputs @ now.T + np.diff(inputs, axis=0, append=inputs[-1:]) @ change.T
    states = _propagate(transition, driven, np.zeros(len(model.a)) if start is None else start)
    return states @ model.c.T + inputs @ model.d.T


def delayed(model: LinearSystem, inputs: Real, step: float, lags: Real) -> Real:
    """Return the outputs, (n_time, n_out), of a continuous model at rest, a delay for each pair.

    Exact for inputs, (n_time, n_in) deviations from trim, linear between samples at `step`, s, and
    constant before and after. `lags` are (n_out, n_in) s, negative where an output leads.
    """
    samples, n_in = inputs.shape
    outputs = np.zeros((samples, len(model.c)))
    # reach of the delays beyond the record, on both sides
    margin = int(np.ceil(np.max(np.abs(lags), initial=0.0) / step)) + 2
    transition, now, change = _discretise(model, step)
    for j in range(n_in):
        wide = np.pad(inputs[:, j], margin, mode="edge")
        rise = np.diff(wide, append=wide[-1])
        driven = np.outer(wide, now[:, j]) + np.outer(rise, change[:, j])
        states = _propagate(transition, driven, np.zeros(len(model.a)))
        for lag in np.unique(lags[:, j]):
            whole = int(np.floor(-lag / step))
            part = -lag - whole * step
            at = slice(margin + whole, margin + whole + samples)
            ahead, held, risen = _discretise(model, part)
            slope = rise[at] * (part / step)
            moved = (
                states[at] @ ahead.T + np.outer(wide[at], held[:, j]) + np.outer(slope, risen[:, j])
            )
            for k in np.flatnonzero(lags[:, j] == lag):
                outputs[:, k] += moved @ model.c[k] + (wide[at] + slope) * model.d[k, j]
    return outputs


def _discretise(model: LinearSystem, step: float) -> tuple[Real, Real, Real]:
    n, n_in = model.b.shape
    driven = np.block([[model.a * step, model.b * step], [np.zeros((n_in, n + n_in))]])
    power, rise = zero_order_hold(driven, np.eye(n + n_in, n_in, -n), 1.0)
    return power[:n, :n], power[:n, n:], rise[:n]


def _propagate(transition: Real, driven: Real, start: Real) -> Real:
    """Return x_0 .. x_(N-1) of x_(k+1) = A x_k + driven_k, (n_time, n_state)."""
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
