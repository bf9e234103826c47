"""Multi-input conditioning: one estimator for the direct and the joint input-output method.

With y = H u + e and a reference r, the part of u that r explains is u^ = G_ur G_rr^-1 r, and
H = G_yu^ G_u^u^^-1. With r = u this is MISO, H = G_yu G_uu^-1; with as many references as inputs
it is the joint input-output method, H = H_yr H_ur^-1, free of what feedback carries from e into u.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import IdentificationError
from helisim.ident.spectra import Spectra


@dataclass(frozen=True, eq=False)
class Conditioned:
    """Spectra of each input-output pair with the other inputs' effect removed.

    Attributes:
        gxx, gyy, gxy: (n_out, n_in, n_freq) power that is the input's own, output power from that
            input and from noise, cross spectrum; the response is gxy / gxx.
        multiple: (n_out, n_freq) coherence of the output with all inputs together.
        averages: equivalent number of independent windows.
        periods: (n_freq,) how many periods of the frequency the window holds.
        noise: (n_freq, n_out, n_out) spectra of what the response leaves of the outputs.
        weight: (n_freq, n_in, n_segment) by which the response takes each window's transform.
    """

    gxx: NDArray[np.float64]
    gyy: NDArray[np.float64]
    gxy: NDArray[np.complex128]
    multiple: NDArray[np.float64]
    averages: float
    periods: NDArray[np.float64]
    noise: NDArray[np.complex128]
    weight: NDArray[np.complex128]

    @property
    def coherence(self) -> NDArray[np.float64]:
        """Partial coherence, (n_out, n_in, n_freq)."""
        return coherence(self.gxx, self.gyy, self.gxy)


def coherence(
    gxx: NDArray[np.float64], gyy: NDArray[np.float64], gxy: NDArray[np.complex128]
) -> NDArray[np.float64]:
    """Return |Gxy|^2 / (Gxx Gyy), of (n_out, n_in, n_freq) each, within [0, 1]."""
    return np.clip(np.abs(gxy) ** 2 / (gxx * gyy), 0.0, 1.0)


def random_error(
    coherence: NDArray[np.float64], averages: float | NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the normalised random error of the response, sqrt(1 - g2) / (|g| sqrt(2 n_e)).

    Args:
        coherence: (n_out, n_in, n_freq).
        averages: n_e = n_d / C_eps^2, independent windows, one number or one for each.
    """
    bounded = np.clip(coherence, 1e-12, 1.0)
    return np.sqrt((1.0 - bounded) / (bounded * 2.0 * averages))


def condition(
    spectra: Spectra,
    inputs: Sequence[str],
    outputs: Sequence[str],
    others: Sequence[str],
    reference: Sequence[str] | None,
) -> Conditioned:
    """Return the conditioned spectra of outputs over inputs, with `others` removed.

    Raises:
        IdentificationError: the inputs are fully coherent.
    """
    active = [*inputs, *others]
    guu = spectra.block(active, active)
    gyu = spectra.block(outputs, active)
    gyy = spectra.block(outputs, outputs)
    explained, projection, driving = guu, None, active
    if reference is not None:
        projection = _right_divide(
            spectra.block(active, reference), spectra.block(reference, reference)
        )
        explained, driving = projection @ spectra.block(reference, active), list(reference)
    one = np.broadcast_to(np.eye(len(active), dtype=np.complex128), explained.shape)
    weight = _right_divide(one, explained)
    if projection is not None:
        weight = _adjoint(projection) @ weight
    response = spectra.block(outputs, driving) @ weight
    window_weight = spectra.scale * np.matmul(
        weight.transpose(0, 2, 1), spectra.windowed(driving).conj()
    )
    predicted = response @ _adjoint(gyu)
    residual = gyy - predicted - _adjoint(predicted) + response @ guu @ _adjoint(response)
    noise = np.clip(_power(residual), 1e-14 * _power(gyy), None)
    own = _own_power(explained)[:, None, : len(inputs)]
    wanted = response[:, :, : len(inputs)]
    signal = np.real(np.sum((response @ explained) * response.conj(), axis=2))
    return Conditioned(
        gxx=_frequency_last(np.broadcast_to(own, wanted.shape)),
        gyy=_frequency_last(np.abs(wanted) ** 2 * own + noise[:, :, None]),
        gxy=_frequency_last(wanted * own),
        multiple=(signal / (signal + noise)).T,
        averages=spectra.averages,
        periods=spectra.frequency * (spectra.window / (2.0 * np.pi)),
        noise=_disturbance(spectra, outputs, active, response, window_weight),
        weight=window_weight[:, : len(inputs)],
    )


def cross_control(spectra: Spectra, inputs: Sequence[str]) -> NDArray[np.float64]:
    """Return the coherence between inputs, (n_in, n_in, n_freq)."""
    matrix = spectra.block(inputs, inputs)
    power = _power(matrix)
    return _frequency_last(np.abs(matrix) ** 2 / (power[:, :, None] * power[:, None, :]))


def _adjoint(matrix: NDArray) -> NDArray[np.complex128]:
    return matrix.conj().transpose(0, 2, 1)


def _power(matrix: NDArray) -> NDArray[np.float64]:
    """Return the diagonals of spectral matrices, (n_freq, n)."""
    return np.real(np.diagonal(matrix, axis1=1, axis2=2))


def _frequency_last(array: NDArray) -> NDArray:
    return np.ascontiguousarray(np.moveaxis(array, 0, -1))


def _right_divide(
    left: NDArray[np.complex128], hermitian: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    """Return left @ hermitian^-1, with the signals scaled to unit power first."""
    scale = 1.0 / np.sqrt(_power(hermitian))
    scaled = hermitian * scale[:, :, None] * scale[:, None, :]
    try:
        solved = np.linalg.solve(scaled, _adjoint(left * scale[:, None, :]))
    except np.linalg.LinAlgError:
        raise IdentificationError(
            "the inputs are fully coherent, so their effects can't be told apart; "
            "leave one out, or add records where they move independently"
        ) from None
    return _adjoint(solved) * scale[:, None, :]


def _disturbance(
    spectra: Spectra,
    outputs: Sequence[str],
    active: Sequence[str],
    response: NDArray[np.complex128],
    weight: NDArray[np.complex128],
) -> NDArray[np.complex128]:
    """Return the spectra of the outputs' disturbance, (n_freq, n_out, n_out).

    Windows count less where the inputs are strong: what a window smears of their own effect looks
    like a disturbance. And the response has been fitted to some of the disturbance: in each window
    by its leverage, times how many windows overlap.
    """
    given = spectra.windowed(active)
    residual = spectra.windowed(outputs) - response @ given
    power = np.sum(np.abs(given) ** 2 / np.mean(np.abs(given) ** 2, axis=2, keepdims=True), axis=1)
    faint = 1.0 / (1.0 + power)
    leverage = np.real(np.sum(weight * given, axis=1))
    overlap = np.sum(spectra.energy) / spectra.averages
    free = spectra.energy * np.clip(1.0 - overlap * leverage, 0.2, 1.0)
    faint *= spectra.scale * np.sum(spectra.energy) / np.sum(faint * free, axis=1, keepdims=True)
    return np.matmul(residual * faint[:, None, :], _adjoint(residual))


def _own_power(matrix: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the power of each input that no other input explains, 1 / (G^-1)_ii."""
    scale = np.sqrt(_power(matrix))
    inverse = np.linalg.inv(matrix / (scale[:, :, None] * scale[:, None, :]))
    return scale**2 / _power(inverse)
