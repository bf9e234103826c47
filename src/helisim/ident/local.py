"""Local polynomial method: frequency responses from whole records, without windows.

Around each frequency Y = G(w) U + T(w) + E is solved by least squares over the lines of all
flights (R. Pintelon and J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed.,
2012, ch. 7), with a common pole where needed (T. McKelvey and G. Guerin, SYSID 2012).
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.arrays import Complex, Real
from helisim.ident.local_fit import ORDER, TRANSIENT, BandFit, Lines, fit_band, flight_lines
from helisim.ident.scatter import AVERAGES, Estimate, LineWeights, LocalScatter
from helisim.records.record import FlightRecord

WIDTHS: Real = 0.06 * 2.0 ** np.arange(7, dtype=np.float64)
"""Half widths of the band over its middle: 0.06 to 3.84."""
WIDEST = 1.0  # Widest band without a narrower one to compare: beyond it the bias is unknown
_MOST = 4  # widths that are compared at a frequency
# _PLENTY: lines for each parameter in a band beyond which no wider one is asked
# _SPARE: lines that a band needs for each parameter: the kernel lets two of three count
_PLENTY, _SPARE = 100.0, 1.5
_FREE = 4.0  # lines beyond the parameters, to see what is left
# _TRANSIENT_RATIO: transients are estimated above this power over the disturbance's
# _TRANSIENT_STEP: at every so many frequencies it is looked for transients
_TRANSIENT_RATIO, _TRANSIENT_STEP = 1.5, 4
_CHUNK = 100_000  # Numbers of a design that are worked on at once
# _SHARPNESS: power by which smaller mean-square errors count more in the average of widths
# _LEAST: a width with a smaller share is left out
_SHARPNESS, _LEAST = 2.0, 0.05
# _ASYMPTOTIC: bands wider than this have no law of bias: the next wider one's counts fully
# _DOUBT: Excess of a squared difference, in its variances, to be stated as a bias
_ASYMPTOTIC, _DOUBT = 0.5, 0.5
_FLOOR = 0.005**2  # squared relative differences with a smaller variance are equally well known
# _NOISE_FREEDOM: spare lines of the narrowest band that gives the disturbance's spectrum
# _NOISE_WIDTH: over which share of the frequency that spectrum is averaged further
_NOISE_FREEDOM, _NOISE_WIDTH = 5.0, 0.15
# A spectrum that averages n lines is stated larger by this over n: then three standard deviations
# hold 98.9 % of the errors (Student's distribution, complex, n of 8 to 30)
_STUDENT = 2.5
# _POWER_WIDTH: over which share of the frequency the inputs' spectra are averaged
# _POWER_LINES: least lines in averages of the inputs' spectra
_POWER_WIDTH, _POWER_LINES = 0.2, 12
_APART_WIDTH = 0.15  # of ln w, over which squares of estimates' differences are averaged
# Pulses that repeat a whole number of times leave most lines empty. Share of records that is cut
# off to fill them, where no band can be solved at some frequency
_CUTS = (0.02, 0.04, 0.08)


class Local:
    """Lines of records, for responses between their signals at (n_freq,) rad/s."""

    windows: tuple[float, ...] = ()

    def __init__(
        self, records: Sequence[FlightRecord], names: Sequence[str], frequency: Real
    ) -> None:
        self._frequency = frequency
        self._records, self._highest = records, float(frequency[-1] * (1.0 + WIDTHS[-1]))
        self._lines = flight_lines(records, names, self._highest)

    def cross_control(self, names: Sequence[str]) -> Real:
        """Return the coherence between signals, (n_name, n_name, n_freq)."""
        return between(self.spectra(names))

    def spectra(self, names: Sequence[str]) -> Complex:
        """Return the spectra between signals, (n_freq, n_name, n_name)."""
        return _power(self._lines, self._lines.places(names), self._frequency)

    def estimate(
        self,
        inputs: Sequence[str],
        outputs: Sequence[str],
        reference: Sequence[str] = (),
    ) -> Estimate:
        """Return the responses, averaged over bandwidths, with their errors."""
        frequency = self._frequency
        if tuple(reference) == tuple(inputs):
            reference = ()
        task = Task(
            lines=self._lines,
            drive=self._lines.places(reference or inputs),
            output=self._lines.places(outputs),
            active=self._lines.places(inputs) if reference else [],
            n_in=len(inputs),
            frequency=frequency,
        )
        tries = [(task, estimate_bands(task))]
        if np.any(tries[0][1].lost):
            for cut in _CUTS:
                parts = [
                    one.slice(-np.inf, one.time[-1] - cut * one.duration) for one in self._records
                ]
                other = task._replace(lines=flight_lines(parts, self._lines.names, self._highest))
                tries.append((other, estimate_bands(other)))
        task, bands = min(tries, key=lambda one: np.count_nonzero(one[1].lost))
        noise = _noise(bands, frequency)
        level = np.real(np.diagonal(noise, axis1=1, axis2=2)).T
        share, bias, spread = choose(
            bands.gain, bands.shared(), level, bands.valid, WIDTHS, frequency, widest=WIDEST
        )
        response = np.sum(share * bands.gain, axis=0)
        # where no band can be solved its least solution is a third of the response
        bias = np.maximum(bias, 2.0 * np.abs(response) * bands.lost)
        scatter = LocalScatter(frequency, bands.packed(share), share, noise, bias, spread)
        return Estimate.stated(response, *_coherence(task, bands, response, level), scatter)


def between(spectra: Complex) -> Real:
    """Return the coherence between signals, (n, n, n_freq), by their spectra, (n_freq, n, n)."""
    power = np.real(np.diagonal(spectra, axis1=1, axis2=2))
    product = np.maximum(power[:, :, None] * power[:, None, :], 1e-300)
    return np.moveaxis(np.abs(spectra) ** 2 / product, 0, 2)


def with_gap(found: Estimate, frequency: Real, other: Complex) -> Estimate:
    """Return an estimate whose errors hold its distance to another, (n_out, n_in, n_freq)."""
    size = np.maximum(np.abs(found.response), 1e-150)
    square = np.square(np.abs(other - found.response) / size)
    apart = np.sqrt(smoothed(square, frequency, np.ones_like(square), _APART_WIDTH))
    random = np.hypot(found.random_error, math.sqrt(0.5) * apart)
    return found._replace(
        coherence=np.minimum(found.coherence, 1.0 / (1.0 + 2.0 * AVERAGES * random**2)),
        random_error=random,
        scatter=replace(found.scatter, bias=np.hypot(found.scatter.bias, apart * size)),
    )


def _noise(bands: "Bands", frequency: Real) -> Complex:
    """Return spectra of the outputs' disturbances, (n_freq, n_out, n_out)."""
    enough = bands.valid & (bands.freedom >= _NOISE_FREEDOM)
    last = bands.valid.shape[0] - 1 - np.argmax(bands.valid[::-1], axis=0)
    taken = np.where(np.any(enough, axis=0), np.argmax(enough, axis=0), last)
    at = np.arange(frequency.size)
    freedom = bands.freedom[taken, at]
    raw = np.moveaxis(bands.residual[taken, at], 0, 2)
    mean = smoothed(raw, frequency, freedom, _NOISE_WIDTH)
    # a Gaussian averages like a flat band of 3.5 standard deviations, the kernel of 1.6 halves
    pooled = freedom * np.maximum(1.0, 3.5 * _NOISE_WIDTH / (1.6 * WIDTHS[taken]))
    return np.moveaxis(mean * (1.0 + _STUDENT / np.maximum(pooled, 1.0)), 2, 0)


def _power(lines: Lines, places: list[int], frequency: Real) -> Complex:
    """Return the spectra between signals around each frequency, (n_freq, n_signal, n_signal)."""
    spread = 0.5 * _POWER_LINES / np.sum(1.0 / lines.spacing)
    low = np.maximum(frequency - np.maximum(_POWER_WIDTH * frequency, spread), 0.0)
    high = frequency + np.maximum(_POWER_WIDTH * frequency, 2.0 * spread - (frequency - low))
    values = lines.values[:, :, places]
    summed, count = lines.summed(np.einsum("ela,elb->elab", values, values.conj()), low, high)
    return np.sum(summed, axis=1) / np.maximum(np.sum(count, axis=1), 1)[:, None, None]


def _coherence(task: "Task", bands: "Bands", response: Complex, noise: Real) -> tuple[Real, Real]:
    """Return partial and multiple coherence from the outputs' noise, (n_out, n_freq)."""
    power = _power(task.lines, task.drive, task.frequency)
    into = bands.active_gain
    explained = into @ power @ into.conj().swapaxes(1, 2)
    # the power of each input that no other input explains
    scale = np.sqrt(np.maximum(np.real(np.diagonal(explained, axis1=1, axis2=2)), 1e-300))
    inverse = np.linalg.pinv(explained / (scale[:, :, None] * scale[:, None, :]), hermitian=True)
    own = scale**2 / np.maximum(np.real(np.diagonal(inverse, axis1=1, axis2=2)), 1.0)
    level = np.maximum(noise, 1e-300)
    signal = np.abs(response) ** 2 * own[:, : task.n_in].T[None, :, :]
    full = bands.full_gain
    all_signal = np.real(np.einsum("foi,fij,foj->of", full, explained, full.conj()))
    return (
        np.clip(signal / (signal + level[:, None, :]), 0.0, 1.0),
        np.clip(all_signal / (all_signal + level), 0.0, 1.0),
    )


class Task(NamedTuple):
    """An estimation task; `drive`, `active` and outputs are indices of signals in the lines."""

    lines: Lines
    drive: list[int]
    output: list[int]
    active: list[int]
    n_in: int
    frequency: Real


class Bands(NamedTuple):
    """The responses by every bandwidth.

    `gain` is (n_width, n_out, n_in, n_freq), zero where not `valid` (n_width, n_freq); `residual`
    (n_width, n_freq, n_out, n_out) spectra of y - H u; `freedom` (n_width, n_freq) averaged lines;
    `full_gain` (n_freq, n_out, n_active) the narrowest width's; `active_gain` (n_freq, n_active,
    n_drive); `weights` of all valid widths, by frequency.
    """

    gain: Complex
    valid: NDArray[np.bool_]
    residual: Complex
    freedom: Real
    full_gain: Complex
    active_gain: Complex
    weights: tuple[LineWeights, ...]

    @property
    def lost(self) -> NDArray[np.bool_]:
        """Frequencies at which no width can be solved, (n_freq,)."""
        return ~np.any(self.freedom > 0.0, axis=0)

    def shared(self) -> Real:
        """Return the covariance for a unit disturbance, (n_width, n_width, n_in, n_freq)."""
        n_width, _, n_in, n_freq = self.gain.shape
        shared = np.zeros((n_width, n_width, n_in, n_freq))
        for f, one in enumerate(self.weights):
            flat = one.value.reshape(one.part.size, n_in, -1).swapaxes(0, 1)
            product = np.real(flat @ flat.conj().swapaxes(1, 2))
            shared[one.part[:, None], one.part, :, f] = product.transpose(1, 2, 0)
        return shared

    def packed(self, share: Real) -> tuple[LineWeights, ...]:
        """Return weights by frequency, of widths with a share, (n_width, n_out, n_in, n_freq)."""
        used = np.any(share, axis=(1, 2))
        return tuple(one.only(used[one.part, f]) for f, one in enumerate(self.weights))


def estimate_bands(task: Task) -> Bands:
    """Fit every width at every frequency with enough lines."""
    transient = transients(task)
    valid = _usable_widths(task, transient)
    n_width, n_freq = valid.shape
    n_out, n_drive = len(task.output), len(task.drive)
    n_active = len(task.active) or n_drive
    found = Bands(
        gain=np.zeros((n_width, n_out, task.n_in, n_freq), dtype=np.complex128),
        valid=valid,
        residual=np.zeros((n_width, n_freq, n_out, n_out), dtype=np.complex128),
        freedom=np.zeros((n_width, n_freq)),
        full_gain=np.zeros((n_freq, n_out, n_active), dtype=np.complex128),
        active_gain=np.zeros((n_freq, n_active, n_drive), dtype=np.complex128),
        weights=(),
    )
    weights: list[dict[int, Any]] = [{} for _ in range(n_freq)]
    for width in range(n_width)[::-1]:
        for chosen, with_transient in _chunks(task, valid[width], transient, WIDTHS[width]):
            fit = _fit(task, chosen, width, transient=with_transient)
            gain, into, weight, residual = _responses(task, fit)
            ok = fit.fits | (np.sum(valid[:, chosen], axis=0) == 1)
            valid[width, chosen] = ok
            k = chosen[ok]
            found.gain[width][:, :, k] = np.moveaxis(gain[ok, :, : task.n_in], 0, 2)
            found.residual[width, k] = residual[ok]
            found.freedom[width, k] = np.where(fit.fits, fit.freedom, 0.0)[ok]
            found.full_gain[k], found.active_gain[k] = gain[ok], into[ok]
            for f, at in zip(np.flatnonzero(ok), k):
                weights[at][width] = fit.first[f], weight[f, : task.n_in]
    joined = (LineWeights.side_by_side([*one], [*one.values()]) for one in weights)
    return found._replace(weights=tuple(joined))


def _responses(task: Task, fit: BandFit) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Return H = H_yr R*(R R*)^-1, (n_freq, n_out, n_active), R, H's weights, residual spectra."""
    n_out, n_freq = len(task.output), fit.gain.shape[0]
    if not task.active:
        same = np.broadcast_to(np.eye(len(task.drive)), (n_freq,) + 2 * (len(task.drive),))
        weight = fit.weight.astype(np.complex64)
        return fit.gain, same.astype(np.complex128), weight, fit.residual
    into = fit.gain[:, n_out:]
    back = np.linalg.pinv(into, rcond=1e-10)
    gain = fit.gain[:, :n_out] @ back
    weight = np.einsum("fra,frel->fael", back, fit.weight).astype(np.complex64)
    rest = np.concatenate([np.broadcast_to(np.eye(n_out), (n_freq, n_out, n_out)), -gain], axis=2)
    return gain, into, weight, rest @ fit.residual @ rest.conj().swapaxes(1, 2)


def _fit(
    task: Task, chosen: NDArray[np.intp], width: int, *, transient: bool, poles: bool = True
) -> BandFit:
    frequency = task.frequency[chosen]
    responding, half = [*task.output, *task.active], WIDTHS[width] * frequency
    return fit_band(
        task.lines, task.drive, responding, frequency, half, transient=transient, poles=poles
    )


def _usable_widths(task: Task, transient: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which widths have enough lines, (n_width, n_freq)."""
    needed = _SPARE * (len(task.drive) * (ORDER + 1) + _FREE)
    lines = np.zeros((WIDTHS.size, task.frequency.size), dtype=np.intp)
    for width, relative in enumerate(WIDTHS):
        half = relative * task.frequency
        _, count = task.lines.within(task.frequency - half, task.frequency + half)
        lost = np.where(transient, TRANSIENT, 0)[:, None]
        lines[width] = np.sum(np.maximum(count - lost, 0), axis=1)
    enough = lines >= needed
    enough[-1] |= ~np.any(enough, axis=0)
    narrowest = np.argmax(enough, axis=0)
    number = np.arange(WIDTHS.size)[:, None]
    within = (WIDTHS[:, None] <= WIDEST) | (number <= narrowest + 1)
    plenty = np.roll(lines >= _PLENTY * len(task.drive) * (ORDER + 1), 1, axis=0)
    plenty[0] = False
    return enough & within & (number < narrowest + _MOST) & (~plenty | (number == narrowest))


def _chunks(
    task: Task, valid: NDArray[np.bool_], transient: NDArray[np.bool_], relative: float
) -> list[tuple[NDArray[np.intp], bool]]:
    n_flight, columns = task.lines.spacing.size, len(task.drive) * (ORDER + 1)
    columns += len(task.output) + len(task.active)
    groups = []
    for with_transient in (False, True):
        rest = np.flatnonzero(valid & (transient == with_transient))
        while rest.size:
            widest = 2.0 * relative * task.frequency[rest] / np.min(task.lines.spacing) + 1.0
            size = (np.arange(rest.size) + 1) * widest * n_flight * columns
            small = (size <= _CHUNK) & (task.frequency[rest] <= 2.0 * task.frequency[rest[0]])
            count = max(int(np.count_nonzero(small)), 1)
            groups.append((rest[:count], with_transient))
            rest = rest[count:]
    return groups


def transients(task: Task) -> NDArray[np.bool_]:
    """Return where transients are to be estimated, (n_freq,)."""
    all_on = np.ones(task.frequency.size, dtype=np.bool_)
    valid = _usable_widths(task, all_on)
    ratio, counted = np.zeros(task.frequency.size), np.zeros(task.frequency.size)
    narrowest = np.argmax(valid, axis=0)
    for width in range(WIDTHS.size):
        looked = np.zeros(task.frequency.size, dtype=np.bool_)
        looked[::_TRANSIENT_STEP] = narrowest[::_TRANSIENT_STEP] == width
        for chosen, _ in _chunks(task, looked, all_on, WIDTHS[width]):
            whole = _fit(task, chosen, width, transient=False, poles=False)
            less = _fit(task, chosen, width, transient=True, poles=False)
            more, power = (
                np.real(np.diagonal(fit.residual, axis1=1, axis2=2)) * fit.freedom[:, None]
                for fit in (whole, less)
            )
            spent = (whole.freedom - less.freedom)[:, None]
            ok = whole.fits & less.fits & (less.freedom > 1.0) & (spent[:, 0] > 0.5)
            with np.errstate(all="ignore"):
                each = (more - power) / spent / (power / less.freedom[:, None])
            counted[chosen[ok]] = less.freedom[ok]
            ratio[chosen[ok]] = np.mean(each[ok], axis=1)
    if not np.any(counted):
        return ~all_on
    mean = smoothed(ratio, task.frequency, counted, 0.35)
    known = smoothed(np.ones_like(ratio), task.frequency, counted, 0.35) > 0.5
    return np.where(known, mean, np.sum(ratio * counted) / np.sum(counted)) > _TRANSIENT_RATIO


def choose(
    gain: Complex,
    shared: Real,
    power: Real,
    valid: NDArray[np.bool_],
    widths: Real,
    frequency: Real,
    *,
    widest: float = np.inf,
) -> tuple[Real, Real, Real]:
    """Weigh the bandwidths at every frequency by their mean-square errors.

    Return their shares in the estimate, (n_width, n_out, n_in, n_freq), the remaining systematic
    error and the widths' standard deviation, (n_out, n_in, n_freq) each.

    Args:
        gain: (n_width, n_out, n_in, n_freq) response by each width.
        shared: (n_width, n_width, n_in, n_freq) covariance between widths for a unit disturbance.
        power: (n_out, n_freq) spectra of the outputs' disturbances.
        valid: (n_width, n_freq) usable widths, at least one a frequency.
        widths: (n_width,) relative half widths, increasing.
        frequency: (n_freq,) rad/s.
        widest: a single band beyond it has a bias of the whole response.
    """
    n_width = widths.size
    narrowest = np.argmax(valid, axis=0)
    at = np.arange(frequency.size)
    size = np.abs(gain[narrowest, :, :, at].transpose(1, 2, 0))
    size = np.maximum(size, 1e-300)
    own = np.einsum("ccif->cif", shared)
    squared, sure = np.zeros(gain.shape), np.zeros(gain.shape)
    for width in range(n_width):
        # the next narrower valid width, itself if none
        before = np.max(np.where(valid[:width], np.arange(width)[:, None], -1), axis=0, initial=-1)
        before = np.where(before < 0, width, before)
        gap = np.abs(gain[width] - gain[before, :, :, at].transpose(1, 2, 0)) ** 2
        between = own[width] + own[before, :, at].T - 2.0 * shared[width, before, :, at].T
        chance = np.maximum(between, 0.0) * power[:, None, :] / size**2
        counted = valid[width] & (narrowest < width)
        known = np.where(counted, 1.0 / (chance + _FLOOR) ** 2, 0.0)
        mean = smoothed(gap / size**2 - chance, frequency, known, 0.5 * widths[width])
        law = np.where(counted, 1.0 - (widths[before] / widths[width]) ** (ORDER + 2), 1.0)
        doubt = _DOUBT * smoothed(chance, frequency, known, 0.5 * widths[width])
        for found, value in ((squared, mean), (sure, mean - doubt)):
            found[width] = np.where(counted, np.maximum(value, 0.0) / law**2, 0.0) * size**2
    following = np.minimum(narrowest + 1, n_width - 1)
    law = (widths[narrowest] / widths[following]) ** (2 * (ORDER + 2))
    law = np.where(widths[narrowest] > _ASYMPTOTIC, 1.0, law)
    for found in (squared, sure):
        np.maximum.accumulate(found, axis=0, out=found)
        found += law * found[following, :, :, at].transpose(1, 2, 0)
    error = own[:, None] * power[:, None, :] + squared
    offered = valid & ((widths[:, None] <= widest) | (np.arange(n_width)[:, None] == narrowest))
    error = np.where(offered[:, None, None, :], np.maximum(error, 1e-300), np.inf)
    share = (np.min(error, axis=0) / error) ** _SHARPNESS
    share /= np.sum(share, axis=0)
    share = np.where(share < _LEAST, 0.0, share)
    share /= np.sum(share, axis=0)
    mean = np.sum(share * gain, axis=0)
    spread = np.sum(share * np.abs(gain - mean) ** 2, axis=0)
    bias = np.sqrt(np.sum(share * sure, axis=0))
    alone = (np.sum(valid, axis=0) == 1) & (widths[narrowest] > widest)
    bias[..., alone] = np.maximum(bias, np.abs(mean))[..., alone]
    return share, bias, np.sqrt(spread)


def smoothed(values: NDArray, frequency: Real, weight: Real, width: float) -> NDArray:
    """Return a Gaussian mean over log frequency, with weights, (..., n_freq) each."""
    apart = np.subtract.outer(np.log(frequency), np.log(frequency)) / width
    kernel = np.exp(-0.5 * apart**2)
    total = np.maximum(weight @ kernel, 1e-300)
    return np.where(weight > 0.0, values * weight, 0.0) @ kernel / total
