"""What every estimator of frequency responses gives: the response, its quality, its errors."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

_REACH = 0.25
"""Two biases are related if their frequencies differ by less than about this, as a fraction."""


class ErrorModel(Protocol):
    """The errors of a response at all its points, and how they belong together.

    Points are given by three arrays, (n_point,): of which output, of which input, and the
    frequency's index.
    """

    def covariance(
        self,
        output: Sequence[int] | NDArray[np.intp],
        input_: Sequence[int] | NDArray[np.intp],
        position: Sequence[int] | NDArray[np.intp],
    ) -> NDArray[np.complex128]:
        """Return E[dH_k dH_l*], (n_point, n_point), of points given by (n_point,) each."""
        ...

    def variance(
        self,
        output: Sequence[int] | NDArray[np.intp],
        input_: Sequence[int] | NDArray[np.intp],
        position: Sequence[int] | NDArray[np.intp],
    ) -> NDArray[np.float64]:
        """Return E|dH_k|^2 of points, (n_point,), given by (n_point,) each."""
        ...

    def minus(self, other: Any) -> "ErrorModel":
        """Return the errors of the difference from another estimate by the same estimator."""
        ...


@dataclass(frozen=True, eq=False)
class Estimate:
    """A response as an estimator found it; arrays are (n_out, n_in, n_freq).

    `multiple` is (n_out, n_freq).
    """

    response: NDArray[np.complex128]
    coherence: NDArray[np.float64]
    multiple: NDArray[np.float64]
    random_error: NDArray[np.float64]
    scatter: ErrorModel


class Estimator(Protocol):
    """An estimator, given the records' signals and the frequencies.

    `windows` are the window lengths it uses, s.
    """

    windows: tuple[float, ...]

    def cross_control(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Return the coherence between signals, (n_name, n_name, n_freq)."""
        ...

    def estimate(
        self,
        inputs: Sequence[str],
        outputs: Sequence[str],
        others: Sequence[str],
        reference: Sequence[str],
    ) -> Estimate:
        """Return the responses of outputs to inputs; without a reference, the direct ones."""
        ...


def bias_covariance(
    bias: NDArray[np.float64],
    frequency: NDArray[np.float64],
    output: NDArray[np.intp],
    input_: NDArray[np.intp],
    position: NDArray[np.intp],
) -> NDArray[np.float64]:
    """Return what a bias adds to the covariance between points, (n_point, n_point).

    Its size is known, its sign isn't: neighbours of one response share it, others have their own.

    Args:
        bias: (n_out, n_in, n_freq) its size.
        frequency: (n_freq,) rad/s.
        output: (n_point,) which output the points are of.
        input_: (n_point,) which input.
        position: (n_point,) index of the frequency.
    """
    at = np.log(frequency[position])
    apart = np.subtract.outer(at, at) / _REACH
    same = (output[:, None] == output) & (input_[:, None] == input_)
    size = bias[output, input_, position]
    return np.where(same, np.outer(size, size) * np.exp(-0.5 * apart**2), 0.0)
