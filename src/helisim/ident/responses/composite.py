"""Composite windows: the best of five window lengths at every frequency.

A long window reaches low frequencies, a short one averages more at high ones. The composite
spectra minimise at each frequency

    sum_i W_i { [(Gxx - Gxx_i)/Gxx]^2 + the same for Gyy, Re Gxy, Im Gxy
                + 5 [(g2 - g2_i)/g2]^2 } ,   W_i = (eps_i / eps_min)^-4

(Tischler and Remple, chapter 11), from the W_i^2-weighted mean as the start.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import IdentificationError
from helisim.ident.responses.conditioning import Conditioned, coherence, random_error

WINDOWS = 5
"""Window lengths in a composite."""

WINDOW_SPREAD = 5.0
"""Ratio of the longest window to the shortest one at most (CIFER's usual 50 s to 10 s)."""

PERIODS = 6.0
"""A window joins the composite from so many periods in it upwards: below, the Hann window's
main lobe (two bins either way) smears the response, which coherence hardly shows. The longest
window serves all frequencies."""

_COHERENCE_WEIGHT = 5.0
_PART_GUARD = 0.1
"""A real or imaginary part counts as at least this fraction of |Gxy| when it is a
denominator: it passes through zero where the phase crosses an axis."""
_SWEEPS = 8
"""Gauss-Newton steps; the problem is quadratic but for one term, so it needs three or four."""


@dataclass(frozen=True, eq=False)
class Composite:
    """Composite response of every pair; the arrays are (n_out, n_in, n_freq).

    `share`, (n_window, n_out, n_in, n_freq), is each length's part in the response.
    """

    response: NDArray[np.complex128]
    coherence: NDArray[np.float64]
    random_error: NDArray[np.float64]
    multiple: NDArray[np.float64]
    share: NDArray[np.float64]


def window_lengths(durations: Sequence[float], band: tuple[float, float]) -> tuple[float, ...]:
    """Choose the window lengths, longest first, s.

    Rules: T_win <= T_rec / 2, T_win <= T_F / 5, T_win >= 20 periods of the highest frequency
    and one period of the lowest within the longest window.

    Raises:
        IdentificationError: the records are too short for the band.
    """
    low, high = band
    shortest = min(durations)
    longest_window = min(shortest / 2.0, sum(durations) / 5.0)
    lowest = 2.0 * np.pi / longest_window
    if lowest > low * (1.0 + 1e-9):
        raise IdentificationError(
            f"records too short for the band: the shortest lasts {shortest:.4g} s and all "
            f"together {sum(durations):.4g} s, which allows windows of {longest_window:.4g} s "
            f"and so frequencies from {lowest:.4g} rad/s, but the band starts at {low:.4g} "
            "rad/s; raise the band's lower edge (--band LO HI), leave short records out "
            "(--min-duration S) or add longer ones"
        )
    floor = max(20.0 * 2.0 * np.pi / high, longest_window / WINDOW_SPREAD)
    if floor >= longest_window:
        return (longest_window,)
    return tuple(float(length) for length in np.linspace(longest_window, floor, WINDOWS))


def compose(windows: Sequence[Conditioned]) -> Composite:
    """Combine the conditioned spectra of several window lengths."""
    weight = _weights(windows)
    gxx = np.stack([window.gxx for window in windows])
    gyy = np.stack([window.gyy for window in windows])
    gxy = np.stack([window.gxy for window in windows])
    start = (_mean(gxx, weight**2), _mean(gyy, weight**2), _mean(gxy, weight**2))
    g2 = _mean(np.stack([window.coherence for window in windows]), weight)
    gxx_c, gyy_c, gxy_c = _minimise(
        start, (_mean(gxx, weight), _mean(gyy, weight), _mean(gxy, weight)), g2
    )
    coherence_c = coherence(gxx_c, gyy_c, gxy_c)
    averages = np.array([window.averages for window in windows])[:, None, None, None]
    multiple = np.stack([window.multiple for window in windows])
    return Composite(
        response=gxy_c / gxx_c,
        coherence=coherence_c,
        random_error=random_error(coherence_c, _mean(averages, weight)),
        multiple=np.clip(_mean(multiple, weight.mean(axis=2)), 0.0, 1.0),
        share=weight * gxx / np.sum(weight * gxx, axis=0),
    )


def composite_noise(windows: Sequence[Conditioned]) -> NDArray[np.complex128]:
    """Return the outputs' disturbance spectra, (n_freq, n_out, n_out), averaged over lengths.

    Each length counts by its number of averages from PERIODS periods upwards.
    """
    usable = np.stack([one.periods >= PERIODS for one in windows])
    usable[int(np.argmax([one.periods[0] for one in windows]))] = True
    averages = np.array([one.averages for one in windows])[:, None]
    weight = np.where(usable, averages, 0.0)[:, :, None, None]
    return _mean(np.stack([one.noise for one in windows]), weight)


def _weights(windows: Sequence[Conditioned]) -> NDArray[np.float64]:
    """Return W_i, (n_window, n_out, n_in, n_freq): 1 for the best, 0 below a window's reach."""
    error = np.stack([random_error(window.coherence, window.averages) for window in windows])
    error = np.maximum(error, 1e-9)
    usable = np.stack([window.periods >= PERIODS for window in windows])
    usable[int(np.argmax([window.periods[0] for window in windows]))] = True
    usable = usable[:, None, None, :]
    best = np.min(np.where(usable, error, np.inf), axis=0)
    return np.where(usable, (best / error) ** 4, 0.0)


def _mean(values: NDArray, weight: NDArray[np.float64]) -> NDArray:
    return np.sum(weight * values, axis=0) / np.sum(weight, axis=0)


Spectrum = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.complex128]]


class _Aim(NamedTuple):
    """What the composite spectra shall meet: the mean spectra and coherence, and their units."""

    target: NDArray[np.float64]
    unit: NDArray[np.float64]
    g2: NDArray[np.float64]
    g2_unit: NDArray[np.float64]


def _minimise(start: Spectrum, mean: Spectrum, g2: NDArray[np.float64]) -> Spectrum:
    """Minimise the composite cost over (Gxx, Gyy, Re Gxy, Im Gxy) at all frequencies at once.

    Summed over windows, each quadratic term depends on the data through its W-weighted mean
    only. In units of the start value that leaves |z - z_mean|^2 + 5 (g2(z)/g2_0 - g2_mean)^2,
    whose Gauss-Newton matrix is the identity plus one outer product.
    """
    modulus = np.abs(start[2])
    unit = np.stack(
        [
            start[0],
            start[1],
            np.maximum(np.abs(start[2].real), _PART_GUARD * modulus),
            np.maximum(np.abs(start[2].imag), _PART_GUARD * modulus),
        ]
    )
    g2_unit = np.maximum(coherence(*start), 1e-6)
    aim = _Aim(_pack(mean) / unit, unit, g2, g2_unit)
    z = _pack(start) / unit
    best, best_cost = z, _cost(z, aim)
    for _ in range(_SWEEPS):
        z = z + _step(z, aim)
        cost = _cost(z, aim)
        better = (cost < best_cost) & np.all(z[:2] > 0.0, axis=0)
        best = np.where(better, z, best)
        best_cost = np.where(better, cost, best_cost)
    gxx, gyy, real, imaginary = best * unit
    return gxx, gyy, real + 1j * imaginary


def _pack(spectrum: Spectrum) -> NDArray[np.float64]:
    return np.stack([spectrum[0], spectrum[1], spectrum[2].real, spectrum[2].imag])


def _raw_coherence(z: NDArray[np.float64], unit: NDArray[np.float64]) -> NDArray[np.float64]:
    gxx, gyy, real, imaginary = z * unit
    return (real**2 + imaginary**2) / (gxx * gyy)


def _cost(z: NDArray[np.float64], aim: _Aim) -> NDArray[np.float64]:
    target, unit, g2, g2_unit = aim
    misfit = (_raw_coherence(z, unit) - g2) / g2_unit
    return np.sum((z - target) ** 2, axis=0) + _COHERENCE_WEIGHT * misfit**2


def _step(z: NDArray[np.float64], aim: _Aim) -> NDArray[np.float64]:
    """Return the Gauss-Newton step, by the Sherman-Morrison formula."""
    target, unit, g2, g2_unit = aim
    now = _raw_coherence(z, unit)
    power = (z[2] * unit[2]) ** 2 + (z[3] * unit[3]) ** 2
    slope = np.stack(
        [
            -now / z[0],
            -now / z[1],
            2.0 * now * z[2] * unit[2] ** 2 / power,
            2.0 * now * z[3] * unit[3] ** 2 / power,
        ]
    )
    slope = np.sqrt(_COHERENCE_WEIGHT) * slope / g2_unit
    misfit = np.sqrt(_COHERENCE_WEIGHT) * (now - g2) / g2_unit
    gradient = (z - target) + slope * misfit
    along = np.sum(slope * gradient, axis=0) / (1.0 + np.sum(slope**2, axis=0))
    return slope * along - gradient
