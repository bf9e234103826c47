"""Least squares in a band of a record's lines: response, transients, and common pole.

Y = G(j w) U + T(w) + E at lines 2 pi / T apart: around w0 G is a polynomial of ln(w / w0), T is
w0/w times one of w - w0 for each flight; where chi^2 falls by enough both are divided by 1 - (w -
w0)/p. Lines are weighted by Epanechnikov's kernel.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.polynomial.polynomial import polyvander
from numpy.typing import NDArray
from scipy import fft

from helisim.base.arrays import Complex, Real
from helisim.records.record import FlightRecord

ORDER = 2  # Order of the response's polynomial (Pintelon and Schoukens take 2, too)
TRANSIENT = 3  # Terms of a transient: 1/w, 1 and w
_SINGULAR = 3e-5  # least eigenvalue of the scaled normal matrix; sweeps have 1e-4 and more
_WORTH = 5.0  # a pole is estimated where it takes so much off chi^2; chance takes 1 at most
_NEAREST = 0.5  # lines between a pole and the frequency axis at least
_FURTHEST = 10.0  # half widths between a pole and the middle at most: beyond, it is none


@dataclass(frozen=True, eq=False)
class Lines:
    """Lines of all flights, from line 0 (the mean) up to a highest frequency.

    `spacing` is (n_flight,) rad/s, `count` (n_flight,); `values` (n_flight, n_line, n_signal),
    |Z|^2 a one-sided spectrum.
    """

    names: tuple[str, ...]
    spacing: Real
    count: NDArray[np.intp]
    values: Complex

    def places(self, names: Sequence[str]) -> list[int]:
        """Return indices of signals in `values`."""
        return [self.names.index(name) for name in names]

    def within(self, low: Real, high: Real) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return the first line and number of lines from `low` to `high`, (n_freq,) rad/s each."""
        first = np.ceil(low[:, None] / self.spacing - 1e-9).astype(np.intp)
        last = np.floor(high[:, None] / self.spacing + 1e-9).astype(np.intp)
        first = np.maximum(first, 1)
        return first, np.maximum(np.minimum(last, self.count - 1) - first + 1, 0)

    def summed(
        self, values: NDArray, low: Real, high: Real
    ) -> tuple[NDArray[Any], NDArray[np.intp]]:
        """Return sums of values, (n_flight, n_line, ...), over the lines from `low` to `high`.

        They are (n_freq, n_flight, ...), with their lines' numbers, (n_freq, n_flight).
        """
        first, count = self.within(low, high)
        total = np.concatenate([np.zeros_like(values[:, :1]), np.cumsum(values, axis=1)], axis=1)
        flight = np.arange(self.spacing.size)
        return total[flight, first + count] - total[flight, first], count


def transform(columns: Real) -> Complex:
    """Return the transform of a record, (n_time, n_signal), over its step, (n_line, n_signal).

    It is by the trapezoidal rule: lines are 2 pi / T apart, T from the first sample to the last.
    """
    return np.asarray(fft.rfft(columns[:-1], axis=0)) + 0.5 * (columns[-1] - columns[0])


def flight_lines(records: Sequence[FlightRecord], names: Sequence[str], highest: float) -> Lines:
    """Return the lines of records' signals less their means, up to `highest`, rad/s."""
    spacing = np.array([2.0 * np.pi / one.duration for one in records])
    each = []
    for record, step in zip(records, spacing):
        columns = record.select(names)
        # the line at half the sampling rate is not one-sided
        most = min(len(record) // 2 - 1, int(highest / step) + 1) + 1
        lines = transform(columns - columns.mean(axis=0))[:most]
        each.append(lines * (record.sample_time * np.sqrt(step / np.pi)))
    count = np.array([one.shape[0] for one in each], dtype=np.intp)
    values = np.zeros((len(each), int(count.max()), len(names)), dtype=np.complex128)
    for flight, one in enumerate(each):
        values[flight, : one.shape[0]] = one
    return Lines(tuple(names), spacing, count, values)


@dataclass(frozen=True, eq=False)
class BandFit:
    """Result of one half width of the band at some frequencies.

    `first` is (n_freq, n_flight) first lines of `weight`, (n_freq, n_drive, n_flight, n_line);
    `gain` (n_freq, n_response, n_drive); `residual` (n_freq, n_response, n_response) spectra;
    `freedom` (n_freq,) averaged lines; `fits` (n_freq,) False where driving signals can't be
    separated.
    """

    first: NDArray[np.intp]
    gain: Complex
    weight: Complex
    residual: Complex
    freedom: Real
    fits: NDArray[np.bool_]


def fit_band(
    lines: Lines,
    drive: list[int],
    response: list[int],
    frequency: Real,
    half: Real,
    *,
    transient: bool,
    poles: bool = True,
    leading: int | None = None,
) -> BandFit:
    """Fit the lines within `half` of each frequency, (n_freq,) rad/s each.

    `transient` estimates one for each flight, `poles` a common pole where needed: that of the
    `leading` responses, or of all.
    """
    band = _gather(lines, drive, response, frequency, half)
    solved = _solve(band, None, transient=transient)
    fit = _band_fit(band, solved)
    if not poles:
        return fit
    pole, worth = _linear_pole(band, solved, leading)
    at = np.flatnonzero((worth > _WORTH) & fit.fits)
    if not at.size:
        return fit
    least = (_NEAREST * lines.spacing.min() / half)[at]
    part = _Band(**{one.name: getattr(band, one.name)[at] for one in fields(band)})
    pole = _kept_off(pole[at], least)
    solved = _solve(part, pole, transient=transient)
    step = _pole_step(part, solved, pole, leading)  # of Gauss and Newton's, once
    pole = _kept_off(pole + step, least)
    solved = _solve(part, pole, transient=transient)
    found = _band_fit(part, solved)
    before, after = (
        np.real(np.diagonal(residual, axis1=1, axis2=2)) * freedom[:, None]
        for residual, freedom in (
            (fit.residual[at], fit.freedom[at]),
            (found.residual, found.freedom),
        )
    )
    fallen = np.mean((before / np.maximum(after, 1e-300) - 1.0)[:, :leading], axis=1)
    better = (fallen * found.freedom > _WORTH) & found.fits
    for one in fields(fit):
        getattr(fit, one.name)[at[better]] = getattr(found, one.name)[better]
    return fit


@dataclass(frozen=True, eq=False)
class _Band:
    """Lines around each frequency, (n_freq, n_flight, n_line, ...), times the kernel's root."""

    first: NDArray[np.intp]
    root: Real
    ratio: Real
    offset: Real
    terms: Real
    left: Complex
    right: Complex


@dataclass(frozen=True, eq=False)
class _Solved:
    """Least squares at each frequency for a given pole of each.

    `over` is (n_freq, n_row) 1 / (1 - d/p), `basis` (n_freq, n_flight, n_line, TRANSIENT), `design`
    (n_freq, n_row, n_column), `solution` (n_freq, n_column, n_response).
    """

    over: NDArray
    basis: NDArray | None
    design: Complex
    every: Complex
    solution: Complex
    remainder: Complex
    loose: Real
    freedom: Real
    fits: NDArray[np.bool_]

    def cleared(self, values: Complex) -> Complex:
        """Return values, (n_freq, n_row, n), without the part that the fit explains."""
        values = _without(self.basis, values)
        return values - self.design @ (self.every @ values)


def _gather(
    lines: Lines, drive: list[int], response: list[int], frequency: Real, half: Real
) -> _Band:
    first, count = lines.within(frequency - half, frequency + half)
    index = first[:, :, None] + np.arange(max(int(count.max()), 1))
    inside = np.arange(index.shape[2]) < count[:, :, None]
    omega = index * lines.spacing[:, None]
    offset = (omega - frequency[:, None, None]) / half[:, None, None]
    root = np.where(inside, np.sqrt(np.clip(1.0 - offset**2, 0.0, 1.0)), 0.0)
    flight = np.arange(lines.spacing.size)[None, :, None]
    values = lines.values[flight, np.minimum(index, lines.values.shape[1] - 1)] * root[..., None]
    ratio = np.where(inside, omega / frequency[:, None, None], 1.0)
    octaves = np.log(ratio) / np.log1p(np.minimum(half / frequency, 1.0))[:, None, None]
    terms = np.asarray(polyvander(octaves, ORDER), np.float64)
    return _Band(first, root, ratio, offset, terms, values[..., drive], values[..., response])


def _solve(band: _Band, pole: Complex | None, *, transient: bool) -> _Solved:
    n_freq = band.root.shape[0]
    over: NDArray = np.ones(band.root.shape)  # real where it can be: half of the work
    if pole is not None:
        over = 1.0 / (1.0 - band.offset / pole[:, None, None])
    design = (band.terms * over[..., None])[..., :, None] * band.left[..., None, :]
    design = design.reshape(n_freq, over[0].size, -1)
    right = band.right.reshape(n_freq, over[0].size, -1)
    kernel = band.root.reshape(n_freq, -1) ** 2
    taken = np.zeros(kernel.shape)
    basis = None
    if transient:
        basis = _orthonormal(band.offset, band.root / band.ratio * over)
        design, right = _without(basis, design), _without(basis, right)
        taken = np.einsum("...k,...k", basis, basis.conj()).real.reshape(n_freq, -1)
    adjoint = np.ascontiguousarray(design.conj().swapaxes(1, 2))
    normal = adjoint @ design
    power = np.real(np.diagonal(normal, axis1=1, axis2=2))
    scale = 1.0 / np.sqrt(np.where(power > 0.0, power, 1.0))
    normal *= scale[:, :, None] * scale[:, None, :]
    eigenvalue, vector = np.linalg.eigh(normal)
    fits = (eigenvalue[:, 0] > _SINGULAR * eigenvalue[:, -1]) & np.all(power > 0.0, axis=1)
    safe = np.maximum(eigenvalue, _SINGULAR * np.maximum(eigenvalue[:, -1:], 1e-300))
    inverse = (vector / safe[:, None, :]) @ vector.conj().swapaxes(1, 2)
    inverse *= scale[:, :, None] * scale[:, None, :]
    every = inverse @ adjoint
    solution = every @ right
    taken = taken + np.einsum("frc,fcr->fr", design, every).real
    loose = kernel * np.clip(1.0 - taken, 0.0, 1.0)
    return _Solved(
        over=over.reshape(n_freq, -1),
        basis=basis,
        design=design,
        every=every,
        solution=solution,
        remainder=right - design @ solution,
        loose=loose,
        freedom=np.sum(loose, axis=1),
        fits=fits,
    )


def _without(basis: NDArray | None, values: Complex) -> Complex:
    """Return values, (n_freq, n_row, n), less their part in each flight's basis."""
    if basis is None:
        return values
    apart = values.reshape(*basis.shape[:3], -1)
    return (apart - basis @ (basis.conj().swapaxes(2, 3) @ apart)).reshape(values.shape)


def _orthonormal(offset: Real, root: NDArray) -> NDArray:
    """Return orthonormal terms of a transient, (n_freq, n_flight, n_line, TRANSIENT); or zeros."""
    terms: list[NDArray] = []
    for power in range(TRANSIENT):
        term = root * offset**power
        size = np.linalg.norm(term, axis=2, keepdims=True)
        for _ in range(2):
            for done in terms:
                term = term - done * np.sum(done.conj() * term, axis=2, keepdims=True)
        rest = np.linalg.norm(term, axis=2, keepdims=True)
        terms.append(np.where(rest > 1e-6 * size, term / np.maximum(rest, 1e-300), 0.0))
    return np.stack(terms, axis=-1)


def _linear_pole(band: _Band, solved: _Solved, leading: int | None = None) -> tuple[Complex, Real]:
    """Return the pole of A Y = B U + T + E, (n_freq,) in half widths, and its fall of chi^2."""
    fitted, rest, size = _fitted(band, solved, leading)
    offset = band.offset.reshape(*solved.over.shape, 1)
    one = rest / size
    two = solved.cleared((fitted + rest) * offset) / size
    pair = np.stack([one, two], axis=1).reshape(one.shape[0], 2, -1)
    power = pair.conj() @ pair.swapaxes(1, 2)
    chance = np.stack([np.sum(solved.loose * offset[..., 0] ** k, axis=1) for k in range(3)])
    chance /= np.maximum(chance[0], 1e-300)
    root = np.sqrt(np.maximum(chance[2] - chance[1] ** 2, 1e-6))
    # L with L L^T the noise's matrix; the smallest vector in its metric
    inverse = np.zeros(power.shape)
    inverse[:, 0, 0], inverse[:, 1, 0], inverse[:, 1, 1] = 1.0, -chance[1] / root, 1.0 / root
    power = inverse @ power @ inverse.swapaxes(1, 2)
    _, vector = np.linalg.eigh(power)
    a, b = np.moveaxis(np.einsum("fji,fj->fi", inverse, vector[:, :, 0]), 1, 0)
    before, second = np.real(power[:, 0, 0]), np.real(power[:, 1, 1])
    gain = np.abs(power[:, 0, 1]) ** 2 / np.maximum(second, 1e-300)
    after = np.maximum(before - gain, 1e-9 * before + 1e-300)
    return -a / np.where(np.abs(b) < 1e-9, 1e-9, b), gain / after * solved.freedom


def _pole_step(band: _Band, solved: _Solved, pole: Complex, leading: int | None) -> Complex:
    """Return Gauss and Newton's step of the common pole, (n_freq,)."""
    fitted, rest, size = _fitted(band, solved, leading)
    slope = solved.cleared(fitted * (solved.over / -pole[:, None])[:, :, None]) / size
    pull = np.sum(slope.conj() * rest / size, axis=(1, 2))
    return pull / np.maximum(np.sum(np.abs(slope) ** 2, axis=(1, 2)), 1e-300)


def _fitted(
    band: _Band, solved: _Solved, leading: int | None = None
) -> tuple[Complex, Complex, Real]:
    """Return what is explained of the leading responses, the rest, and its size.

    All are (n_freq, n_row, n_response).
    """
    rest = solved.remainder[:, :, :leading]
    fitted = band.right.reshape(solved.remainder.shape)[:, :, :leading] - rest
    size = np.linalg.norm(rest, axis=1) / np.sqrt(np.maximum(solved.freedom, 1.0))[:, None]
    least = 1e-12 * np.linalg.norm(fitted, axis=1) + 1e-300
    return fitted, rest, np.maximum(size, least)[:, None, :]


def _kept_off(place: Complex, least: Real) -> Complex:
    sign = np.where(place.imag < 0.0, -1.0, 1.0)
    place = place.real + 1j * sign * np.maximum(np.abs(place.imag), least)
    return place * np.minimum(1.0, _FURTHEST / np.abs(place))


def _band_fit(band: _Band, solved: _Solved) -> BandFit:
    n_drive = band.left.shape[3]
    weight = solved.every[:, :n_drive] * band.root.reshape(band.root.shape[0], 1, -1)
    residual = solved.remainder.swapaxes(1, 2) @ solved.remainder.conj()
    return BandFit(
        first=band.first,
        gain=solved.solution[:, :n_drive].swapaxes(1, 2),
        weight=weight.reshape(weight.shape[0], n_drive, *band.root.shape[1:]),
        residual=residual / np.maximum(solved.freedom, 1e-9)[:, None, None],
        freedom=solved.freedom,
        fits=solved.fits & (solved.freedom > 0.0),
    )
