"""Cross-spectral matrices of flight records: detrended, Hann windows, averaged.

The transform is the discrete Fourier sum at exactly the wanted frequencies: no interpolation.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from helisim.base.units import without_trend
from helisim.records.record import FlightRecord

HANN_POWER = 0.375
"""Mean square of the Hann window; dividing by it restores the power (CIFER's 1.63^2)."""
_BLOCK = 64  # samples in a block of the kernel's phase table: only speed depends on it
_QUADRATURE = 512
"""Instants in a record where products of windows are summed: 5 a window at the least."""


@dataclass(frozen=True, eq=False)
class Spectra:
    """Averaged cross spectra of all signals for one window length.

    Attributes:
        frequency: (n_freq,) rad/s.
        matrix: (n_freq, n_signal, n_signal), one-sided G_ab = (2/T) mean(A B*).
        names: the signals, in the order of the matrix.
        window: window length, s.
        averages: equivalent number of independent windows, n_d / C_eps^2.
        transforms: (n_freq, n_signal, n_segment) of every window; `scale` gives the matrix.
        start, flight: (n_segment,) when each window starts, s, within which flight.
        energy: (n_segment,) what white noise gives to it, relative to a whole window: less at the
            ends of a record.
    """

    frequency: NDArray[np.float64]
    matrix: NDArray[np.complex128]
    names: tuple[str, ...]
    window: float
    averages: float
    transforms: NDArray[np.complex128] = field(repr=False)
    scale: float = field(repr=False)
    start: NDArray[np.float64] = field(repr=False)
    flight: NDArray[np.intp] = field(repr=False)
    energy: NDArray[np.float64] = field(repr=False)

    def block(self, rows: Sequence[str], columns: Sequence[str]) -> NDArray[np.complex128]:
        """Return G between named signals, (n_freq, n_row, n_column)."""
        i, j = ([self.names.index(name) for name in names] for names in (rows, columns))
        return self.matrix[:, i, :][:, :, j]

    def windowed(self, names: Sequence[str]) -> NDArray[np.complex128]:
        """Return the transforms of named signals, (n_freq, n_name, n_segment)."""
        return self.transforms[:, [self.names.index(name) for name in names], :]


def cross_spectra(
    records: Sequence[FlightRecord],
    names: Sequence[str],
    frequency: NDArray[np.float64],
    *,
    windows: Sequence[float],
    overlap: float,
) -> list[Spectra]:
    """Return the averaged cross spectra of records, one for each window length.

    Windows hang over both ends of a record, so that each sample counts the same: sweeps end at
    their highest frequency, and a window that fades out there biases the response by its slope
    times the vehicle's group delay. Beyond its ends a record is taken to be in trim, and it is
    faded into that over one period of the lowest frequency (5 % of the record at most).

    Args:
        records: of the flights, each with all signals.
        names: of the signals.
        frequency: (n_freq,) rad/s.
        windows: lengths, s.
        overlap: share of a window that the next one covers at least.
    """
    levelled = []
    for record in records:
        step = record.sample_time
        fade = _fade(len(record), 2.0 * np.pi / (frequency[0] * step))
        levelled.append((without_trend(record.select(names)) * fade[:, None], fade, step))
    return [_averaged(levelled, names, frequency, window, overlap) for window in windows]


def _averaged(
    records: Sequence[tuple[NDArray[np.float64], NDArray[np.float64], float]],
    names: Sequence[str],
    frequency: NDArray[np.float64],
    window: float,
    overlap: float,
) -> Spectra:
    """Return the spectra of one window length, of columns with their fade and sample time."""
    pieces, begins, shared = [], [], []
    kernels: dict[float, NDArray[np.complex128]] = {}
    powers: dict[tuple[int, float], NDArray[np.float64]] = {}
    for columns, fade, step in records:
        length = round(window / step)
        if step not in kernels:
            kernels[step] = _kernel(length, step, frequency)
        starts = segment_starts(fade.size, length, overlap)
        if (fade.size, step) not in powers:
            powers[fade.size, step] = _shared_power(starts, length, fade)
        pieces.append(_transform(columns, starts, kernels[step]))
        begins.append(np.asarray(starts * step, dtype=np.float64))
        shared.append(powers[fade.size, step])
    energy = np.concatenate([np.diagonal(one) for one in shared])
    correlated = sum(float(np.sum(one**2)) for one in shared)
    power = float(np.sum(energy))
    transforms = np.concatenate(pieces, axis=2)
    scale = 2.0 / (window * HANN_POWER * power)
    return Spectra(
        frequency=frequency,
        matrix=scale * np.matmul(transforms, transforms.conj().transpose(0, 2, 1)),
        names=tuple(names),
        window=window,
        averages=power**2 / correlated,
        transforms=transforms,
        scale=scale,
        start=np.concatenate(begins),
        flight=np.repeat(np.arange(len(begins)), [one.size for one in begins]),
        energy=energy,
    )


def segment_starts(samples: int, length: int, overlap: float) -> NDArray[np.intp]:
    """Return at which samples windows start, (n_segment,): evenly, over both ends of a record."""
    hop = length * (1.0 - overlap)
    count = int(np.ceil((samples + length - 2.0 * hop) / hop)) + 1
    return np.rint(np.linspace(hop - length, samples - hop, count)).astype(np.intp)


def _fade(samples: int, period: float) -> NDArray[np.float64]:
    """Return a taper of both ends by half a cosine, (n_time,)."""
    distance = np.arange(samples) + 0.5
    distance = np.minimum(distance, distance[::-1])
    share = np.clip(distance / min(period, 0.05 * samples), 0.0, 1.0)
    return 0.5 - 0.5 * np.cos(np.pi * share)


def _kernel(length: int, step: float, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return Hann window times exp(-j w t) dt, (length, n_freq), the phases from two tables."""
    blocks = -(-length // _BLOCK)
    coarse = np.exp(-1j * np.outer(np.arange(blocks) * (_BLOCK * step), frequency))
    fine = np.exp(-1j * np.outer(np.arange(_BLOCK) * step, frequency))
    phases = (coarse[:, None, :] * fine[None, :, :]).reshape(-1, frequency.size)[:length]
    hann = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(length) / length)
    phases *= (step * hann)[:, None]
    return phases


def _transform(
    columns: NDArray[np.float64], starts: NDArray[np.intp], kernel: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    """Return the windowed transforms, (n_freq, n_signal, n_segment), by one real product."""
    length, count = kernel.shape
    rows = np.pad(columns.T, ((0, 0), (length, length)))
    segments = np.stack([rows[:, start : start + length] for start in starts + length])
    flat = segments.reshape(-1, length) @ kernel.view(np.float64)
    return flat.view(np.complex128).reshape(starts.size, -1, count).transpose(2, 1, 0)


def _shared_power(
    starts: NDArray[np.intp], length: int, fade: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the power c_mn of white noise that two windows share, relative to a whole window.

    They average as (sum c_mm)^2 / sum c_mn^2 independent ones: n_d / C_eps^2, ends included.
    """
    instant = np.linspace(0.0, fade.size, _QUADRATURE, endpoint=False)
    inside = (instant[None, :] - starts[:, None]) / length
    hann = np.where((inside > 0.0) & (inside < 1.0), np.sin(np.pi * inside) ** 2, 0.0)
    rows = hann * np.interp(instant, np.arange(fade.size), fade)
    return rows @ rows.T * (fade.size / (length * _QUADRATURE * HANN_POWER))
