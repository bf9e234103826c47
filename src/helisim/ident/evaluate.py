"""A structure with numbers: matrices, frequency response, exact derivatives, state space."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from helisim.errors import IdentificationError
from helisim.ident.structure import Structure

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


Slopes = list[tuple[str, int, int, Mapping[str, float]]]
"""Matrix, row, column and derivatives by parameter of every entry that has any."""


def matrices(structure: Structure, values: Mapping[str, float]) -> Matrices:
    """Return the matrices for the given parameters."""
    return _evaluate(structure, values)[0]


def response(
    structure: Structure, values: Mapping[str, float], frequency: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """Return the frequency response, (n_out, n_in, n_freq); nan where it is undefined.

    Args:
        structure: the model's.
        values: every parameter by name.
        frequency: (n_freq,) rad/s.
    """
    return _transfer(_evaluate(structure, values)[0], frequency)[0].transpose(1, 2, 0)


def response_and_slope(
    structure: Structure,
    values: Mapping[str, float],
    frequency: NDArray[np.float64],
    by: Sequence[str] | None = None,
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return the response and its derivative by each free parameter.

    Args:
        structure: the model's.
        values: every parameter by name.
        frequency: (n_freq,) rad/s.
        by: names of other parameters to take the derivatives by; the free ones by default.

    Returns:
        (n_out, n_in, n_freq) and (n_free, n_out, n_in, n_freq).
    """
    numbers, slopes = _evaluate(structure, values)
    total, left, right, delay = _transfer(numbers, frequency)
    names = [parameter.name for parameter in structure.free] if by is None else list(by)
    slope = np.zeros((len(names), *total.shape), dtype=np.complex128)
    s = 1j * frequency[:, None, None]
    for matrix, row, column, gradient in slopes:
        part = _entry_slope(matrix, row, column, s, total, left, right, delay)
        for name, derivative in gradient.items():
            if name in names:
                slope[names.index(name)] += derivative * part
    return total.transpose(1, 2, 0), slope.transpose(0, 2, 3, 1)


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


def _evaluate(structure: Structure, values: Mapping[str, float]) -> tuple[Matrices, Slopes]:
    n, n_in, n_out = len(structure.states), len(structure.inputs), len(structure.outputs)
    arrays = {
        "M": np.zeros((n, n)),
        "F": np.zeros((n, n)),
        "G": np.zeros((n, n_in)),
        "H0": np.zeros((n_out, n)),
        "H1": np.zeros((n_out, n)),
        "D": np.zeros((n_out, n_in)),
        "D1": np.zeros((n_out, n_in)),
        "input_delays": np.zeros((1, n_in)),
        "output_delays": np.zeros((n_out, 1)),
        "delays": np.zeros((n_out, n_in)),
    }
    known = {**structure.constants, **values}
    slopes: Slopes = []
    for matrix, row, column, expression in structure.entries:
        value, gradient = expression.evaluate(known)
        arrays[matrix][row, column] = value
        if gradient:
            slopes.append((matrix, row, column, gradient))
    for delays in ("input_delays", "output_delays"):
        arrays[delays] = arrays[delays].ravel()
    return Matrices(**arrays), slopes


def _transfer(
    numbers: Matrices, frequency: NDArray[np.float64]
) -> tuple[
    NDArray[np.complex128],
    NDArray[np.complex128],
    NDArray[np.complex128],
    NDArray[np.complex128],
]:
    """Return H, (H0 + s H1)(s M - F)^-1, (s M - F)^-1 G and the delays' phases, frequency first."""
    s = 1j * frequency[:, None, None]
    pencil = s * numbers.M - numbers.F
    observed = numbers.H0 + s * numbers.H1
    try:
        resolvent = np.linalg.inv(pencil)
    except np.linalg.LinAlgError:
        resolvent = np.full_like(pencil, np.nan)
    left = observed @ resolvent
    right = resolvent @ numbers.G
    delay = np.exp(-s * numbers.lags)
    return (observed @ right + numbers.D + s * numbers.D1) * delay, left, right, delay


def _entry_slope(
    matrix: str,
    row: int,
    column: int,
    s: NDArray,
    total: NDArray[np.complex128],
    left: NDArray[np.complex128],
    right: NDArray[np.complex128],
    delay: NDArray[np.complex128],
) -> NDArray[np.complex128]:
    """Return the derivative of H by one matrix entry, (n_freq, n_out, n_in).

    From dR = -R d(sM - F) R with R = (sM - F)^-1.
    """
    slope = np.zeros_like(total)
    match matrix:
        case "F":
            slope = left[:, :, row, None] * right[:, None, column, :] * delay
        case "M":
            slope = -s * left[:, :, row, None] * right[:, None, column, :] * delay
        case "G":
            slope[:, :, column] = left[:, :, row] * delay[:, :, column]
        case "H0":
            slope[:, row, :] = right[:, column, :] * delay[:, row, :]
        case "H1":
            slope[:, row, :] = s[:, :, 0] * right[:, column, :] * delay[:, row, :]
        case "D":
            slope[:, row, column] = delay[:, row, column]
        case "D1":
            slope[:, row, column] = s[:, 0, 0] * delay[:, row, column]
        case "input_delays":
            slope[:, :, column] = -s[:, :, 0] * total[:, :, column]
        case "output_delays":
            slope[:, row, :] = -s[:, :, 0] * total[:, row, :]
        case "delays":
            slope[:, row, column] = -s[:, 0, 0] * total[:, row, column]
    return slope
