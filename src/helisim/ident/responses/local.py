"""The local polynomial method: frequency responses from whole records, without windows.

A window smears a response over its main lobe, two lines either way of a transform as long as the
window, which near a lightly damped mode or at the lowest frequencies is more than the random
error. Here each flight is transformed whole, and around each frequency

    Y = G(w) U + T(w) + E

is solved by least squares over the lines of all flights: G a polynomial, common to all; T the
transient, a polynomial for each flight (R. Pintelon and J. Schoukens, System Identification: A
Frequency Domain Approach, 2nd ed., 2012, ch. 7). Where the lines ask for it, both have a pole in
common, found from all signals together: the local rational method (T. McKelvey and G. Guerin,
"Non-parametric frequency response estimation using a local rational model", SYSID 2012). With a
reference, outputs and inputs are estimated as responses to it, by the same weights, and divided:
under feedback those responses are damped, and so smooth, even where the vehicle is unstable.

How wide the band is, the data choose. From the narrowest that the lines allow upwards, widths
grow by a factor; each has its random error, known from its weights, and a bias, seen as what its
difference from the next narrower one has in excess of that difference's own random error. The
widths are averaged by their mean-square errors; the bias that is left is stated with the errors.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from helisim.ident.responses.estimate import Estimate
from helisim.ident.responses.local_bands import WIDEST, WIDTHS, Bands, Task, estimate_bands
from helisim.ident.responses.local_choice import choose, smoothed
from helisim.ident.responses.local_lines import Lines, flight_lines
from helisim.ident.responses.local_scatter import LocalScatter
from helisim.records.record import FlightRecord

_NOISE_FREEDOM = 5.0
"""The disturbance's spectrum is taken from the narrowest band with so many spare lines."""

_NOISE_WIDTH = 0.15
"""Over which share of the frequency that spectrum is averaged further."""

_STUDENT = 2.5
"""A spectrum that averages n lines is stated larger by this over n: then three standard deviations
hold 98.9 % of the errors, as if it were known (Student's distribution, complex, n of 8 to 30)."""

_POWER_WIDTH = 0.2
_POWER_LINES = 12
"""Inputs' spectra are averaged over this share of the frequency, and so many lines at least."""

_AVERAGES = 8.0
"""No coherence is larger than what so many averages would need for the random error."""


class Local:
    """The lines of records, for any responses between their signals.

    Args:
        records: of the flights, each with all signals.
        names: of the signals.
        frequency: (n_freq,) rad/s.
    """

    windows: tuple[float, ...] = ()

    def __init__(
        self,
        records: Sequence[FlightRecord],
        names: Sequence[str],
        frequency: NDArray[np.float64],
    ) -> None:
        self._frequency = frequency
        self._lines = flight_lines(records, names, float(frequency[-1] * (1.0 + WIDTHS[-1])))

    def cross_control(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Return the coherence between signals, (n_name, n_name, n_freq)."""
        matrix = _power(self._lines, self._lines.places(names), self._frequency)
        power = np.real(np.diagonal(matrix, axis1=1, axis2=2))
        product = np.maximum(power[:, :, None] * power[:, None, :], 1e-300)
        return np.moveaxis(np.abs(matrix) ** 2 / product, 0, 2)

    def estimate(
        self,
        inputs: Sequence[str],
        outputs: Sequence[str],
        others: Sequence[str],
        reference: Sequence[str],
    ) -> Estimate:
        """Return the responses, averaged over the widths of the band, with their errors."""
        active, frequency = (*inputs, *others), self._frequency
        if tuple(reference) == active:
            reference = ()
        task = Task(
            lines=self._lines,
            drive=self._lines.places(reference or active),
            output=self._lines.places(outputs),
            active=self._lines.places(active) if reference else [],
            n_in=len(inputs),
            frequency=frequency,
        )
        bands = estimate_bands(task)
        noise = _noise(bands, frequency)
        choice = choose(
            bands.gain,
            bands.shared(),
            np.real(np.diagonal(noise, axis1=1, axis2=2)).T,
            bands.valid,
            WIDTHS,
            frequency,
            widest=WIDEST,
        )
        response = np.sum(choice.share * bands.gain, axis=0)
        weights = bands.packed(choice.share)
        scatter = LocalScatter(frequency, weights, choice.share, noise, choice.bias, choice.spread)
        o, i, w = np.indices(response.shape).reshape(3, -1)
        variance = scatter.variance(o, i, w).reshape(response.shape)
        relative = variance / np.maximum(np.abs(response) ** 2, 1e-300)
        coherence, multiple = _coherence(task, bands, response, noise)
        return Estimate(
            response=response,
            coherence=np.minimum(coherence, 1.0 / (1.0 + _AVERAGES * relative)),
            multiple=multiple,
            random_error=np.sqrt(0.5 * relative),
            scatter=scatter,
        )


def _noise(bands: Bands, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the spectra of the outputs' disturbances, (n_freq, n_out, n_out)."""
    enough = bands.valid & (bands.freedom >= _NOISE_FREEDOM)
    last = bands.valid.shape[0] - 1 - np.argmax(bands.valid[::-1], axis=0)
    taken = np.where(np.any(enough, axis=0), np.argmax(enough, axis=0), last)
    at = np.arange(frequency.size)
    freedom = bands.freedom[taken, at]
    raw = np.moveaxis(bands.residual[taken, at], 0, 2)
    mean = smoothed(raw, frequency, freedom, _NOISE_WIDTH)
    # a Gaussian averages as a flat band of 3.5 standard deviations does; the kernel, of 1.6 halves
    pooled = freedom * np.maximum(1.0, 3.5 * _NOISE_WIDTH / (1.6 * WIDTHS[taken]))
    return np.moveaxis(mean * (1.0 + _STUDENT / np.maximum(pooled, 1.0)), 2, 0)


def _power(
    lines: Lines, places: list[int], frequency: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """Return the spectra between signals around each frequency, (n_freq, n_signal, n_signal)."""
    spread = 0.5 * _POWER_LINES / np.sum(1.0 / lines.spacing)
    low = np.maximum(frequency - np.maximum(_POWER_WIDTH * frequency, spread), 0.0)
    high = frequency + np.maximum(_POWER_WIDTH * frequency, 2.0 * spread - (frequency - low))
    first, count = lines.within(low, high)
    values = lines.values[:, :, places]
    product = np.einsum("ela,elb->elab", values, values.conj())
    total = np.concatenate([np.zeros_like(product[:, :1]), np.cumsum(product, axis=1)], axis=1)
    flight = np.arange(lines.spacing.size)
    summed = np.sum(total[flight, first + count] - total[flight, first], axis=1)
    return summed / np.maximum(np.sum(count, axis=1), 1)[:, None, None]


def _coherence(
    task: Task,
    bands: Bands,
    response: NDArray[np.complex128],
    noise: NDArray[np.complex128],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the partial and the multiple coherence.

    Signal and disturbance are spectra over whole records, as windows would average them.
    """
    power = _power(task.lines, task.drive, task.frequency)
    into = bands.active_gain
    explained = into @ power @ into.conj().swapaxes(1, 2)
    own = _own_power(explained)[:, : task.n_in]
    level = np.maximum(np.real(np.diagonal(noise, axis1=1, axis2=2)), 1e-300).T
    signal = np.abs(response) ** 2 * own.T[None, :, :]
    full = bands.full_gain
    all_signal = np.real(np.einsum("foi,fij,foj->of", full, explained, full.conj()))
    return (
        np.clip(signal / (signal + level[:, None, :]), 0.0, 1.0),
        np.clip(all_signal / (all_signal + level), 0.0, 1.0),
    )


def _own_power(matrix: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the power of each input that no other input explains, (n_freq, n_input)."""
    scale = np.sqrt(np.maximum(np.real(np.diagonal(matrix, axis1=1, axis2=2)), 1e-300))
    inverse = np.linalg.pinv(matrix / (scale[:, :, None] * scale[:, None, :]), hermitian=True)
    return scale**2 / np.maximum(np.real(np.diagonal(inverse, axis1=1, axis2=2)), 1.0)
