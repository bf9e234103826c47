"""Resamples to a uniform grid: interpolation between the samples, then a low-pass filter.

The interpolation is Akima's, modified: smoother than straight lines (a third of their error
at six samples a period), and without a spline's overshoot where two noisy samples are close
together. Every channel passes through the same filter, without phase, so frequency responses
between channels keep their values in its passband.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.logs.timing import Samples

PASSBAND = 0.8
"""The filter leaves frequencies unchanged up to this share of half the new rate."""

_STOP_DECIBEL = 80.0
_MAX_SAMPLES = 20_000_000
"""Numbers of a channel on the fine grid, at most."""

_MAX_EXPANSION = 1_000
"""Numbers of the fine grid for one of the log's, at most, above 100 000: more says that the rate
or the unit of time is wrong."""

_FASTER = 1.01
"""A log that is faster than the grid by no more than this needs no filter."""

Interpolant = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""Function of time (n_time,) whose values are (n_time, n_channel)."""


def check_rate(rate: float) -> float:
    """Return a rate in Hz as a float. Raises InputError unless it is positive and sane."""
    try:
        number = float(rate)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if isinstance(rate, bool) or not (1e-3 <= number <= 1e6):
        raise InputError(f"resample_hz is {rate!r}, expected 0.001 to 1e6 Hz")
    return number


@dataclass(frozen=True, eq=False)
class Line:
    """Channels that have their numbers at the same instants.

    Attributes:
        columns: which of all channels they are.
        time: (n_known,) s.
        values: (n_known, n_channel).
    """

    columns: tuple[int, ...]
    time: NDArray[np.float64]
    values: NDArray[np.float64]

    def between(self, start: float, stop: float) -> Interpolant:
        """Return a function of time between two instants.

        Samples beyond are used only where it has none at the instant itself.
        """
        low = max(int(np.searchsorted(self.time, start, side="right")) - 1, 0)
        high = min(int(np.searchsorted(self.time, stop, side="left")), self.time.size - 1)
        keep = slice(low, high + 1)
        return interpolant(self.time[keep], self.values[keep])


def lines_through(samples: Samples, first: int) -> list[Line]:
    """Return the lines through all columns, those without a hole together.

    Args:
        samples: in order.
        first: which of all channels the first column is.
    """
    holed = ~np.isfinite(samples.values).all(axis=0)
    full = np.flatnonzero(~holed)
    values = samples.values[:, full] if holed.any() else samples.values
    found = [Line(tuple((full + first).tolist()), samples.time, values)] if full.size else []
    for k in np.flatnonzero(holed).tolist():
        known = np.flatnonzero(np.isfinite(samples.values[:, k]))
        found.append(Line((k + first,), samples.time[known], samples.values[known, k : k + 1]))
    return found


def interpolant(time: NDArray[np.float64], values: NDArray[np.float64]) -> Interpolant:
    """Return a function of time through samples, constant beyond the ends.

    Args:
        time: (n_time,) s, increasing.
        values: (n_time, n_channel).
    """
    if time.size < 3:
        return lambda at: np.column_stack([np.interp(at, time, column) for column in values.T])
    from scipy.interpolate import Akima1DInterpolator  # slow to import, like all of scipy here

    try:
        with np.errstate(all="ignore"):
            through = Akima1DInterpolator(time, values, method="makima")
    except ValueError:  # differences beyond any number: the reader refuses what isn't finite
        return lambda at: np.full((at.size, values.shape[1]), np.nan)
    return lambda at: through(np.clip(at, time[0], time[-1]))


def oversampling(step: float, rate: float) -> int:
    """Return how many fine samples a grid sample needs: 1 where nothing can alias.

    Args:
        step: median time between a channel's samples, s.
        rate: of the grid, Hz.
    """
    ratio = 1.0 / (step * rate)
    return 1 if ratio <= _FASTER else 2 * math.ceil(ratio)


def grid(start: float, count: int, rate: float, factor: int, samples: int) -> NDArray[np.float64]:
    """Return the (n_time,) instants start + k / rate, s, of `count` samples.

    Args:
        start: s.
        count: of the instants.
        rate: Hz.
        factor: fine samples to one of the grid.
        samples: how many of the log's own samples there are.

    Raises:
        InputError: the grid is too large.
    """
    most = min(_MAX_SAMPLES, 100_000 + _MAX_EXPANSION * samples)
    if count * factor > most:
        raise InputError(
            f"resampling {samples} samples at {rate:g} Hz makes {count * factor} a channel, and at "
            f"most {most} are made; lower the rate, cut the log, or check the unit of time"
        )
    return start + np.arange(count) / rate


def resample(
    interpolants: Sequence[Interpolant], start: float, count: int, *, rate: float, factor: int
) -> NDArray[np.float64]:
    """Return channels on the grid start + k / rate, (count, n_channel).

    Args:
        interpolants: of all channels, one after the other.
        start: s.
        count: samples of the grid.
        rate: Hz.
        factor: fine samples to one of the grid; 1 for no filter.
    """
    fine = start + np.arange((count - 1) * factor + 1) / (rate * factor)
    with np.errstate(all="ignore"):
        columns = np.column_stack([through(fine) for through in interpolants])
        if factor == 1:
            return columns
        taps = _low_pass(factor)
        padded = _mirrored(columns, taps.size // 2)
        found = np.empty((count, columns.shape[1]))
        for k, column in enumerate(padded.T):
            around = sliding_window_view(np.ascontiguousarray(column), taps.size)[::factor]
            found[:, k] = np.einsum("ij,j->i", around, taps)  # the taps are symmetric
    return found


def _mirrored(columns: NDArray[np.float64], half: int) -> NDArray[np.float64]:
    """Return columns, (n_time, n_channel), with `half` more samples, mirrored, at each end."""
    if columns.shape[0] <= half:
        return np.pad(columns, ((half, half), (0, 0)), mode="reflect", reflect_type="odd")
    before = 2.0 * columns[0] - columns[half:0:-1]
    after = 2.0 * columns[-1] - columns[-2 : -half - 2 : -1]
    return np.concatenate([before, columns, after])


@cache
def _low_pass(factor: int) -> NDArray[np.float64]:
    """Return a symmetric filter: 1 to PASSBAND of the new half rate, 80 dB down above it.

    A sinc in Kaiser's window; its length is so that its middle falls on a sample of the grid.
    """
    width = (1.0 - PASSBAND) / factor
    length = (_STOP_DECIBEL - 7.95) / (2.285 * math.pi * width)
    half = math.ceil(length / (2.0 * factor)) * factor
    cutoff = 0.5 * (1.0 + PASSBAND) / factor
    beta = 0.1102 * (_STOP_DECIBEL - 8.7)  # Kaiser's, above 50 dB
    taps = np.sinc(cutoff * np.arange(-half, half + 1)) * np.kaiser(2 * half + 1, beta)
    return taps / np.sum(taps)
