"""CIFER's estimator: conditioned cross spectra of Hann windows, composite of five lengths.

With y = H u + e and a reference r, u^ = G_ur G_rr^-1 r and H = G_yu^ G_u^u^^-1 (MISO: r = u). The
composite minimises at each frequency (Tischler and Remple, chapter 11)

    sum_i W_i { [(Gxx - Gxx_i)/Gxx]^2 + the same for Gyy, Re Gxy, Im Gxy
                + 5 [(g2 - g2_i)/g2]^2 } ,   W_i = (eps_i / eps_min)^-4 .
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.arrays import Complex, Real
from helisim.base.errors import IdentificationError
from helisim.base.units import without_trend
from helisim.ident.local import Local, between, smoothed
from helisim.ident.scatter import Estimate, Scatter, WindowWeights
from helisim.records.record import FlightRecord

HANN_POWER = 0.375  # Mean square of the Hann window (CIFER's 1.63^2 is its inverse)
# OVERLAP: Least overlap of windows
# WINDOWS: Number of window lengths in a composite
OVERLAP, WINDOWS = 0.75, 5
_AS_PRINTED = 5e-4  # of a frequency, by which four digits may be off: what is advised is taken
WINDOW_SPREAD = 5.0  # Largest ratio of window lengths (CIFER's usual 50 s to 10 s)
PERIODS = 6.0
"""Least periods in a window of the composite, except the longest: fewer smear the response."""
_QUADRATURE = 512  # instants in a record where products of windows are summed
# in the composite's cost (Tischler and Remple); least denominator of a real or imaginary part
_COHERENCE_WEIGHT, _PART_GUARD = 5.0, 0.1
# _STEPS: Gauss-Newton steps; the problem is quadratic but for one term
# _NEIGHBOURS: over which share of the frequency the windows' systematic error is averaged
_STEPS, _NEIGHBOURS = 8, 0.15
_FLOOR = 0.005**2  # squared relative differences with a smaller variance are equally well known


@dataclass(frozen=True, eq=False)
class Spectra:
    """Averaged cross spectra of all signals for one window length, s.

    `matrix` is (n_freq, n_signal, n_signal), one-sided G_ab = (2/T) mean(A B*), `averages` n_d /
    C_eps^2, `transforms` (n_freq, n_signal, n_segment), `start`, `flight` and `energy`
    (n_segment,).
    """

    frequency: Real
    matrix: Complex
    names: tuple[str, ...]
    window: float
    averages: float
    transforms: Complex
    scale: float
    start: Real
    flight: NDArray[np.intp]
    energy: Real

    def block(self, rows: Sequence[str], columns: Sequence[str]) -> Complex:
        """Return G between named signals, (n_freq, n_row, n_column)."""
        i, j = ([self.names.index(name) for name in names] for names in (rows, columns))
        return self.matrix[:, i, :][:, :, j]

    def windowed(self, names: Sequence[str]) -> Complex:
        """Return the transforms of named signals, (n_freq, n_name, n_segment)."""
        return self.transforms[:, [self.names.index(name) for name in names], :]

    def cross_control(self, names: Sequence[str]) -> Real:
        """Return the coherence between signals, (n_name, n_name, n_freq)."""
        return between(self.block(names, names))


def cross_spectra(
    records: Sequence[FlightRecord], names: Sequence[str], frequency: Real, window: float
) -> Spectra:
    """Return the averaged cross spectra of records at (n_freq,) rad/s, for a window length in s.

    Beyond its ends a record is taken as in trim, faded over one period of the lowest frequency.
    """
    kernel = cache(lambda step: _kernel(round(window / step), step, frequency))
    pieces, begins, shared = [], [], []
    for record in records:
        step, samples = record.sample_time, len(record)
        length = round(window / step)
        fade = _fade(samples, 2.0 * np.pi / (frequency[0] * step))
        columns = without_trend(record.select(names)) * fade[:, None]
        starts = segment_starts(samples, length)
        rows = np.pad(columns.T, ((0, 0), (length, length)))
        segments = np.concatenate([rows[:, start : start + length] for start in starts + length])
        late, early = segments[:, : -(length // 2) - 1 : -1], segments[:, 1 : length // 2 + 1]
        turn, cosine, sine = kernel(step)
        flat = ((late + early) @ cosine - 1j * ((late - early) @ sine)) * turn
        pieces.append(flat.reshape(starts.size, -1, frequency.size).transpose(2, 1, 0))
        begins.append(np.asarray(starts * step, dtype=np.float64))
        shared.append(_shared_power(starts, length, fade))
    energy = np.concatenate([np.diagonal(one) for one in shared])
    power, transforms = float(np.sum(energy)), np.concatenate(pieces, axis=2)
    scale = 2.0 / (window * HANN_POWER * power)
    return Spectra(
        frequency=frequency,
        matrix=scale * np.matmul(transforms, transforms.conj().transpose(0, 2, 1)),
        names=tuple(names),
        window=window,
        averages=power**2 / sum(float(np.sum(one**2)) for one in shared),
        transforms=transforms,
        scale=scale,
        start=np.concatenate(begins),
        flight=np.repeat(np.arange(len(begins)), [one.size for one in begins]),
        energy=energy,
    )


def _kernel(length: int, step: float, frequency: Real) -> tuple[Complex, Real, Real]:
    """Return exp(-j w T/2), and Hann window dt times cos and sin of w t after its middle.

    They are (n_freq,) and (length // 2, n_freq), the last instant first; the middle counts half.
    """
    number = np.arange(1, length // 2 + 1)
    hann = step * (0.5 - 0.5 * np.cos(2.0 * np.pi * number / length))
    hann[2 * number == length] *= 0.5
    angle = np.outer((0.5 * length - number) * step, frequency)
    middle = np.exp(-0.5j * length * step * frequency)
    return middle, np.cos(angle) * hann[:, None], np.sin(angle) * hann[:, None]


def segment_starts(samples: int, length: int) -> NDArray[np.intp]:
    """Return the windows' first samples, (n_segment,), even over both ends of a record."""
    hop = length * (1.0 - OVERLAP)
    count = int(np.ceil((samples + length - 2.0 * hop) / hop)) + 1
    return np.rint(np.linspace(hop - length, samples - hop, count)).astype(np.intp)


def _fade(samples: int, period: float) -> Real:
    """Return a half-cosine taper of both ends, (n_time,)."""
    distance = np.arange(samples) + 0.5
    distance = np.minimum(distance, distance[::-1])
    return 0.5 - 0.5 * np.cos(np.pi * np.clip(distance / min(period, 0.05 * samples), 0.0, 1.0))


def _shared_power(starts: NDArray[np.intp], length: int, fade: Real) -> Real:
    """Return white noise's power that two windows share, c_mn; n = (sum c_mm)^2 / sum c_mn^2."""
    instant = np.linspace(0.0, fade.size, _QUADRATURE, endpoint=False)
    inside = (instant[None, :] - starts[:, None]) / length
    hann = np.where((inside > 0.0) & (inside < 1.0), np.sin(np.pi * inside) ** 2, 0.0)
    rows = hann * np.interp(instant, np.arange(fade.size), fade)
    return rows @ rows.T * (fade.size / (length * _QUADRATURE * HANN_POWER))


@dataclass(frozen=True, eq=False)
class Conditioned:
    """Spectra of each input-output pair with the other inputs' effect removed.

    `gxx`, `gyy`, `gxy` are (n_out, n_in, n_freq), `multiple` (n_out, n_freq), `periods` (n_freq,)
    of the frequency in the window, `noise` (n_freq, n_out, n_out) residual spectra, `weight`
    (n_freq, n_in, n_segment) of each window's transform in the response.
    """

    gxx: Real
    gyy: Real
    gxy: Complex
    multiple: Real
    averages: float
    periods: Real
    noise: Complex
    weight: Complex

    @property
    def coherence(self) -> Real:
        """Partial coherence, (n_out, n_in, n_freq)."""
        return coherence(self.gxx, self.gyy, self.gxy)


def coherence(gxx: Real, gyy: Real, gxy: Complex) -> Real:
    """Return |Gxy|^2 / (Gxx Gyy), of (n_out, n_in, n_freq) each, within [0, 1]."""
    return np.clip(np.abs(gxy) ** 2 / (gxx * gyy), 0.0, 1.0)


def random_error(coherence: Real, averages: float | Real) -> Real:
    """Return sqrt(1 - g2) / (|g| sqrt(2 n_e)), of any shape; `averages` are n_e = n_d / C_eps^2."""
    bounded = np.clip(coherence, 1e-12, 1.0)
    return np.sqrt((1.0 - bounded) / (bounded * 2.0 * averages))


def condition(
    spectra: Spectra,
    inputs: Sequence[str],
    outputs: Sequence[str],
    others: Sequence[str] = (),
    reference: Sequence[str] = (),
) -> Conditioned:
    """Return outputs' spectra over inputs without `others`. Raises IdentificationError."""
    active = [*inputs, *others]
    driving = list(reference) or active
    guu, gyu, gyy = (
        spectra.block(*names) for names in ((active, active), (outputs, active), (outputs, outputs))
    )
    explained, projection = guu, None
    if reference:
        projection = _right_divide(*(spectra.block(one, driving) for one in (active, driving)))
        explained = projection @ spectra.block(driving, active)
    one = np.broadcast_to(np.eye(len(active), dtype=np.complex128), explained.shape)
    weight = _right_divide(one, explained)
    if projection is not None:
        weight = _adjoint(projection) @ weight
    response = spectra.block(outputs, driving) @ weight
    by_window = spectra.scale * np.matmul(
        weight.transpose(0, 2, 1), spectra.windowed(driving).conj()
    )
    predicted = response @ _adjoint(gyu)
    residual = gyy - predicted - _adjoint(predicted) + response @ guu @ _adjoint(response)
    noise = np.clip(_power(residual), 1e-14 * _power(gyy), None)
    # the power of each input that no other input explains, 1 / (G^-1)_ii
    scale = np.sqrt(_power(explained))
    inverse = np.linalg.inv(explained / (scale[:, :, None] * scale[:, None, :]))
    own = (scale**2 / _power(inverse))[:, None, : len(inputs)]
    wanted = response[:, :, : len(inputs)]
    signal = np.real(np.sum((response @ explained) * response.conj(), axis=2))
    return Conditioned(
        gxx=_frequency_last(np.broadcast_to(own, wanted.shape)),
        gyy=_frequency_last(np.abs(wanted) ** 2 * own + noise[:, :, None]),
        gxy=_frequency_last(wanted * own),
        multiple=(signal / (signal + noise)).T,
        averages=spectra.averages,
        periods=spectra.frequency * (spectra.window / (2.0 * np.pi)),
        noise=_disturbance(spectra, outputs, active, response, by_window),
        weight=by_window[:, : len(inputs)],
    )


def _disturbance(
    spectra: Spectra,
    outputs: Sequence[str],
    active: Sequence[str],
    response: Complex,
    weight: Complex,
) -> Complex:
    """Return spectra of the outputs' disturbance, (n_freq, n_out, n_out)."""
    given = spectra.windowed(active)
    residual = spectra.windowed(outputs) - response @ given
    power = np.sum(np.abs(given) ** 2 / np.mean(np.abs(given) ** 2, axis=2, keepdims=True), axis=1)
    faint = 1.0 / (1.0 + power)
    leverage = np.real(np.sum(weight * given, axis=1))
    overlap = np.sum(spectra.energy) / spectra.averages
    free = spectra.energy * np.clip(1.0 - overlap * leverage, 0.2, 1.0)
    faint *= spectra.scale * np.sum(spectra.energy) / np.sum(faint * free, axis=1, keepdims=True)
    return np.matmul(residual * faint[:, None, :], _adjoint(residual))


def _frequency_last(array: NDArray) -> NDArray:
    return np.ascontiguousarray(np.moveaxis(array, 0, -1))


def _adjoint(matrix: NDArray) -> Complex:
    return matrix.conj().transpose(0, 2, 1)


def _power(matrix: NDArray) -> Real:
    """Return the diagonals of spectral matrices, (n_freq, n)."""
    return np.real(np.diagonal(matrix, axis1=1, axis2=2))


def _right_divide(left: Complex, hermitian: Complex) -> Complex:
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


class Windows:
    """Spectra of records over windows of several lengths, for responses at (n_freq,) rad/s."""

    def __init__(
        self,
        records: Sequence[FlightRecord],
        names: Sequence[str],
        frequency: Real,
        windows: tuple[float, ...],
    ) -> None:
        self.windows, self._durations = windows, tuple(one.duration for one in records)
        self._frequency = frequency
        self._local = Local(records, names, frequency)
        self._spectra = [cross_spectra(records, names, frequency, one) for one in windows]

    def cross_control(self, names: Sequence[str]) -> Real:
        """Return the coherence between signals, (n_name, n_name, n_freq), mean over lengths."""
        return np.mean([one.cross_control(names) for one in self._spectra], axis=0)

    def estimate(
        self,
        inputs: Sequence[str],
        outputs: Sequence[str],
        reference: Sequence[str] = (),
    ) -> Estimate:
        """Return the composite; its bias is the gap to the local estimate beyond chance."""
        each = [condition(one, inputs, outputs, reference=reference) for one in self._spectra]
        found, local = compose(each), self._local.estimate(inputs, outputs, reference)
        size = np.maximum(np.abs(found.response), 1e-300)
        apart = found.response - local.response
        gap = (np.abs(apart) / size) ** 2
        chance = 2.0 * np.maximum(found.random_error, local.random_error) ** 2
        counted = 1.0 / (chance + _FLOOR) ** 2
        excess = smoothed(gap - chance, self._frequency, counted, _NEIGHBOURS)
        bias = np.sqrt(np.maximum(excess, 0.0)) * size
        averages = np.array([one.averages for one in each])[:, None]
        weight = np.where(_usable(each), averages, 0.0)[:, :, None, None]
        windows = tuple(
            WindowWeights(one.window, one.start, one.flight, conditioned.weight, share)
            for one, conditioned, share in zip(self._spectra, each, found.share)
        )
        noise = _mean(np.stack([one.noise for one in each]), weight)
        return Estimate(
            response=found.response,
            coherence=found.coherence,
            multiple=found.multiple,
            random_error=np.sqrt(found.random_error**2 + 0.5 * (bias / size) ** 2),
            scatter=Scatter(self._frequency, windows, self._durations, noise, bias, apart),
        )


def lowest_line(durations: Sequence[float]) -> float:
    """Return the lowest frequency, rad/s, of the longest window that records, s, allow."""
    return 2.0 * np.pi / min(min(durations) / 2.0, sum(durations) / 5.0)


def window_lengths(durations: Sequence[float], band: tuple[float, float]) -> tuple[float, ...]:
    """Return the window lengths, s, longest first; raises IdentificationError for short records.

    Rules: T_win <= T_rec / 2, T_win <= T_F / 5, T_win >= 20 periods of the highest frequency
    and one period of the lowest within the longest window.
    """
    (low, high), shortest = band, min(durations)
    lowest = lowest_line(durations)
    longest = 2.0 * np.pi / lowest
    if lowest > low * (1.0 + _AS_PRINTED):
        raise IdentificationError(
            f"records too short for the band: the shortest lasts {shortest:.4g} s and all "
            f"together {sum(durations):.4g} s, which allows windows of {longest:.4g} s "
            f"and so frequencies from {lowest:.4g} rad/s, but the band starts at {low:.4g} "
            "rad/s; raise the band's lower edge, leave short records out, add longer ones, or fit "
            "records this short themselves, with identify_records",
            remedy="band,min_duration=S",
        )
    floor = max(20.0 * 2.0 * np.pi / high, longest / WINDOW_SPREAD)
    if floor >= longest:
        return (longest,)
    return tuple(float(length) for length in np.linspace(longest, floor, WINDOWS))


class Composite(NamedTuple):
    """Composite response of every pair, (n_out, n_in, n_freq); `multiple` is (n_out, n_freq).

    `share` is each length's part, (n_window, n_out, n_in, n_freq).
    """

    response: Complex
    coherence: Real
    multiple: Real
    random_error: Real
    share: Real


def compose(windows: Sequence[Conditioned]) -> Composite:
    """Return the composite of several window lengths."""
    error = np.stack([random_error(one.coherence, one.averages) for one in windows])
    error, usable = np.maximum(error, 1e-9), _usable(windows)[:, None, None, :]
    best = np.min(np.where(usable, error, np.inf), axis=0)
    weight = np.where(usable, (best / error) ** 4, 0.0)
    gxx, gyy, gxy, g2, multiple = (
        np.stack([getattr(one, name) for one in windows])
        for name in ("gxx", "gyy", "gxy", "coherence", "multiple")
    )
    start, mean = ([_mean(one, w) for one in (gxx, gyy, gxy)] for w in (weight**2, weight))
    gxx_c, gyy_c, gxy_c = _minimise(start, mean, _mean(g2, weight))
    averages = np.array([one.averages for one in windows])[:, None, None, None]
    own = coherence(gxx_c, gyy_c, gxy_c)
    return Composite(
        response=gxy_c / gxx_c,
        coherence=own,
        multiple=np.clip(_mean(multiple, weight.mean(axis=2)), 0.0, 1.0),
        random_error=random_error(own, _mean(averages, weight)),
        share=weight * gxx / np.sum(weight * gxx, axis=0),
    )


def _usable(windows: Sequence[Conditioned]) -> NDArray[np.bool_]:
    """Return where windows have enough periods, (n_window, n_freq); the longest has everywhere."""
    usable = np.stack([one.periods >= PERIODS for one in windows])
    usable[int(np.argmax([one.periods[0] for one in windows]))] = True
    return usable


def _mean(values: NDArray, weight: Real) -> NDArray:
    return np.sum(weight * values, axis=0) / np.sum(weight, axis=0)


def _minimise(
    start: Sequence[NDArray], mean: Sequence[NDArray], g2: Real
) -> tuple[Real, Real, Complex]:
    """Minimise the composite cost over (Gxx, Gyy, Re Gxy, Im Gxy) by Gauss-Newton."""
    modulus = np.abs(start[2])
    parts = [np.maximum(np.abs(one), _PART_GUARD * modulus) for one in _parts(start[2])]
    unit = np.stack([start[0], start[1], *parts])
    g2_unit = np.maximum(coherence(start[0], start[1], start[2]), 1e-6)
    target, z = (np.stack([gxx, gyy, *_parts(gxy)]) / unit for gxx, gyy, gxy in (mean, start))

    def coherence_of(z: Real) -> Real:
        gxx, gyy, real, imaginary = z * unit
        return (real**2 + imaginary**2) / (gxx * gyy)

    def cost_of(z: Real) -> Real:
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


def _parts(numbers: Complex) -> tuple[Real, Real]:
    return numbers.real, numbers.imag
