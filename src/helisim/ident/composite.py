"""CIFER's estimator: at every frequency the best of windows of five lengths.

The composite spectra minimise at each frequency (Tischler and Remple, chapter 11)

    sum_i W_i { [(Gxx - Gxx_i)/Gxx]^2 + the same for Gyy, Re Gxy, Im Gxy
                + 5 [(g2 - g2_i)/g2]^2 } ,   W_i = (eps_i / eps_min)^-4 .
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import IdentificationError, InputError
from helisim.ident.conditioning import (
    Conditioned,
    coherence,
    condition,
    cross_control,
    random_error,
)
from helisim.ident.local import Local, smoothed
from helisim.ident.scatter import Estimate, Scatter, WindowWeights
from helisim.ident.spectra import cross_spectra
from helisim.records.record import FlightRecord

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
_STEPS = 8
"""Gauss-Newton steps; the problem is quadratic but for one term, so it needs three or four."""
_NEIGHBOURS = 0.15  # over which share of the frequency the windows' systematic error is averaged
_FLOOR = 0.005**2  # squared relative differences with a smaller variance are equally well known


class Windows:
    """Spectra of records over windows of several lengths, for any responses at (n_freq,) rad/s."""

    def __init__(
        self,
        records: Sequence[FlightRecord],
        names: Sequence[str],
        frequency: NDArray[np.float64],
        *,
        windows: tuple[float, ...],
        overlap: float,
    ) -> None:
        self.windows = windows
        self._durations = tuple(record.duration for record in records)
        self._frequency = frequency
        self._local = Local(records, names, frequency)
        self._spectra = cross_spectra(records, names, frequency, windows=windows, overlap=overlap)

    def cross_control(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Return the coherence between signals, (n_name, n_name, n_freq), mean over lengths."""
        return np.mean([cross_control(one, names) for one in self._spectra], axis=0)

    def estimate(
        self,
        inputs: Sequence[str],
        outputs: Sequence[str],
        others: Sequence[str],
        reference: Sequence[str],
    ) -> Estimate:
        """Return the composite response, with its error model.

        What windows smear is what the composite differs from the local estimate by, beyond chance.
        """
        each = [condition(one, inputs, outputs, others, reference or None) for one in self._spectra]
        found = compose(each)
        local = self._local.estimate(inputs, outputs, others, reference)
        size = np.maximum(np.abs(found.response), 1e-300)
        gap = (np.abs(found.response - local.response) / size) ** 2
        chance = 2.0 * np.maximum(found.random_error, local.random_error) ** 2
        counted = 1.0 / (chance + _FLOOR) ** 2
        excess = smoothed(gap - chance, self._frequency, counted, _NEIGHBOURS)
        bias = np.sqrt(np.maximum(excess, 0.0)) * size
        return Estimate(
            response=found.response,
            coherence=found.coherence,
            multiple=found.multiple,
            random_error=np.sqrt(found.random_error**2 + 0.5 * (bias / size) ** 2),
            scatter=Scatter(
                frequency=self._frequency,
                windows=tuple(
                    WindowWeights(one.window, one.start, one.flight, conditioned.weight, share)
                    for one, conditioned, share in zip(self._spectra, each, found.share)
                ),
                durations=self._durations,
                noise=_noise(each),
                bias=bias,
            ),
        )


def window_lengths(
    durations: Sequence[float],
    band: tuple[float, float],
    windows: float | Sequence[float] | None = None,
) -> tuple[float, ...]:
    """Return the window lengths asked for, or those of the published rules, longest first, s.

    Rules: T_win <= T_rec / 2, T_win <= T_F / 5, T_win >= 20 periods of the highest frequency
    and one period of the lowest within the longest window.

    Args:
        durations: of the records, s.
        band: lowest and highest frequency, rad/s.
        windows: lengths to take instead, s.

    Raises:
        InputError: a length isn't positive, or doesn't resolve the band's lower edge.
        IdentificationError: a window doesn't fit into a record, or the records are too short.
    """
    low, high = band
    shortest = min(durations)
    if windows is not None:
        lengths = (windows,) if isinstance(windows, int | float) else tuple(windows)
        longest = max(lengths, default=0.0)
        if not lengths or not all(math.isfinite(length) and length > 0.0 for length in lengths):
            raise InputError(f"windows are {lengths}, expected positive lengths in s")
        if longest > shortest:
            raise IdentificationError(
                f"a window of {longest:.4g} s does not fit into a record of {shortest:.4g} s; "
                "shorten the window or leave the record out",
                remedy="windows=S,min_duration=S",
            )
        if 2.0 * np.pi / longest > low * (1.0 + 1e-9):
            raise InputError(
                f"the longest window, {longest:.4g} s, resolves frequencies from "
                f"{2.0 * np.pi / longest:.4g} rad/s, but the band starts at {low:.4g} rad/s; "
                "lengthen the window or raise the band's lower edge",
                remedy="windows=S,band",
            )
        return tuple(float(length) for length in lengths)
    longest = min(shortest / 2.0, sum(durations) / 5.0)
    lowest = 2.0 * np.pi / longest
    if lowest > low * (1.0 + 1e-9):
        raise IdentificationError(
            f"records too short for the band: the shortest lasts {shortest:.4g} s and all "
            f"together {sum(durations):.4g} s, which allows windows of {longest:.4g} s "
            f"and so frequencies from {lowest:.4g} rad/s, but the band starts at {low:.4g} "
            "rad/s; raise the band's lower edge, leave short records out or add longer ones",
            remedy="band,min_duration=S",
        )
    floor = max(20.0 * 2.0 * np.pi / high, longest / WINDOW_SPREAD)
    if floor >= longest:
        return (longest,)
    return tuple(float(length) for length in np.linspace(longest, floor, WINDOWS))


class Composite(NamedTuple):
    """Composite response of every pair; `share` is each length's part in it.

    (n_out, n_in, n_freq) each; `multiple` (n_out, n_freq), `share` (n_window, n_out, n_in, n_freq).
    """

    response: NDArray[np.complex128]
    coherence: NDArray[np.float64]
    random_error: NDArray[np.float64]
    multiple: NDArray[np.float64]
    share: NDArray[np.float64]


def compose(windows: Sequence[Conditioned]) -> Composite:
    """Return the composite of the conditioned spectra of several window lengths."""
    error = np.stack([random_error(window.coherence, window.averages) for window in windows])
    error = np.maximum(error, 1e-9)
    usable = _usable(windows)[:, None, None, :]
    best = np.min(np.where(usable, error, np.inf), axis=0)
    weight = np.where(usable, (best / error) ** 4, 0.0)
    gxx, gyy, gxy, g2, multiple = (
        np.stack([getattr(window, name) for window in windows])
        for name in ("gxx", "gyy", "gxy", "coherence", "multiple")
    )
    start, mean = ([_mean(one, w) for one in (gxx, gyy, gxy)] for w in (weight**2, weight))
    gxx_c, gyy_c, gxy_c = _minimise(start, mean, _mean(g2, weight))
    averages = np.array([window.averages for window in windows])[:, None, None, None]
    own = coherence(gxx_c, gyy_c, gxy_c)
    return Composite(
        response=gxy_c / gxx_c,
        coherence=own,
        random_error=random_error(own, _mean(averages, weight)),
        multiple=np.clip(_mean(multiple, weight.mean(axis=2)), 0.0, 1.0),
        share=weight * gxx / np.sum(weight * gxx, axis=0),
    )


def _usable(windows: Sequence[Conditioned]) -> NDArray[np.bool_]:
    """Return from where windows have periods enough, (n_window, n_freq); the longest everywhere."""
    usable = np.stack([one.periods >= PERIODS for one in windows])
    usable[int(np.argmax([one.periods[0] for one in windows]))] = True
    return usable


def _noise(windows: Sequence[Conditioned]) -> NDArray[np.complex128]:
    """Return the outputs' disturbance spectra, (n_freq, n_out, n_out), mean over averages."""
    averages = np.array([one.averages for one in windows])[:, None]
    weight = np.where(_usable(windows), averages, 0.0)[:, :, None, None]
    return _mean(np.stack([one.noise for one in windows]), weight)


def _mean(values: NDArray, weight: NDArray[np.float64]) -> NDArray:
    return np.sum(weight * values, axis=0) / np.sum(weight, axis=0)


def _minimise(
    start: Sequence[NDArray], mean: Sequence[NDArray], g2: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.complex128]]:
    """Minimise the composite cost over (Gxx, Gyy, Re Gxy, Im Gxy) at all frequencies at once.

    Each quadratic term depends on the data through its W-weighted mean only. In units of the
    start that leaves |z - z_mean|^2 + 5 (g2(z)/g2_0 - g2_mean)^2, whose Gauss-Newton matrix is
    the identity plus one outer product: the step follows by the Sherman-Morrison formula.
    """
    modulus = np.abs(start[2])
    parts = [np.maximum(np.abs(one), _PART_GUARD * modulus) for one in _parts(start[2])]
    unit = np.stack([start[0], start[1], *parts])
    g2_unit = np.maximum(coherence(start[0], start[1], start[2]), 1e-6)
    target, z = (np.stack([gxx, gyy, *_parts(gxy)]) / unit for gxx, gyy, gxy in (mean, start))

    def coherence_of(z: NDArray[np.float64]) -> NDArray[np.float64]:
        gxx, gyy, real, imaginary = z * unit
        return (real**2 + imaginary**2) / (gxx * gyy)

    def cost_of(z: NDArray[np.float64]) -> NDArray[np.float64]:
        residual = (coherence_of(z) - g2) / g2_unit
        return np.sum((z - target) ** 2, axis=0) + _COHERENCE_WEIGHT * residual**2

    best, best_cost = z, cost_of(z)
    for _ in range(_STEPS):
        now = coherence_of(z)
        power = (z[2] * unit[2]) ** 2 + (z[3] * unit[3]) ** 2
        real, imaginary = (2.0 * now * z[k] * unit[k] ** 2 / power for k in (2, 3))
        slope = np.sqrt(_COHERENCE_WEIGHT) * np.stack([-now / z[0], -now / z[1], real, imaginary])
        slope /= g2_unit
        residual = np.sqrt(_COHERENCE_WEIGHT) * (now - g2) / g2_unit
        gradient = (z - target) + slope * residual
        along = np.sum(slope * gradient, axis=0) / (1.0 + np.sum(slope**2, axis=0))
        z = z + (slope * along - gradient)
        cost = cost_of(z)
        better = (cost < best_cost) & np.all(z[:2] > 0.0, axis=0)
        best = np.where(better, z, best)
        best_cost = np.where(better, cost, best_cost)
    gxx, gyy, real, imaginary = best * unit
    return gxx, gyy, real + 1j * imaginary


def _parts(numbers: NDArray[np.complex128]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return numbers.real, numbers.imag
