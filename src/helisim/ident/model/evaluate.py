"""A structure with numbers: matrices, frequency response, exact derivatives, state space."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import IdentificationError
from helisim.ident.model.sensitivity import Sensitivity
from helisim.ident.model.structure import Structure

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, eq=False)
class Matrices:
    """The numbers of a structure; delays in s."""

    M: NDArray[np.float64]
    F: NDArray[np.float64]
    G: NDArray[np.float64]
    H0: NDArray[np.float64]
    H1: NDArray[np.float64]
    D: NDArray[np.float64]
    D1: NDArray[np.float64]
    input_delays: NDArray[np.float64]
    output_delays: NDArray[np.float64]
    delays: NDArray[np.float64]

    @property
    def lags(self) -> NDArray[np.float64]:
        """The delay of every response: its input's, its output's and its own, (n_out, n_in) s."""
        return self.output_delays[:, None] + self.input_delays[None, :] + self.delays


def matrices(structure: Structure, values: Mapping[str, float]) -> Matrices:
    """Return the matrices for the given parameters."""
    filled = structure.program.fill(structure.program.ordered(values))
    for delays in ("input_delays", "output_delays"):
        filled[delays] = filled[delays].ravel()
    return Matrices(**filled)


def response(
    structure: Structure, values: Mapping[str, float], frequency: NDArray[np.float64]
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
    frequency: NDArray[np.float64],
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
    if structure.states and np.linalg.cond(numbers.M) > 1e12:
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


def _everywhere(
    structure: Structure, frequency: NDArray[np.float64], by: Sequence[str] | None = None
) -> tuple[Sensitivity, tuple[int, int, int]]:
    """Return the points of every response at every frequency, and the shape that they have."""
    shape = (len(structure.outputs), len(structure.inputs), frequency.size)
    output, input_, position = np.indices(shape).reshape(3, -1)
    program = structure.program
    return Sensitivity(program, frequency[position], output, input_, by=by), shape
