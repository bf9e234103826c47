"""Resamples to a uniform grid: interpolation between the samples, then a low-pass filter.

The interpolation is Akima's, modified: smoother than straight lines (a third of their error
at six samples a period), and without a spline's overshoot where two noisy samples are close
together. Every channel passes through the same filter, without phase, so frequency responses
between channels keep their values in its passband.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from helisim.errors import InputError

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


def check_rate(rate: float) -> float:
    """Return a rate in Hz as a float. Raises InputError unless it is positive and sane."""
    try:
        number = float(rate)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if isinstance(rate, bool) or not (1e-3 <= number <= 1e6):
        raise InputError(f"resample_hz is {rate!r}, expected 0.001 to 1e6 Hz")
    return number


def interpolant(time: NDArray[np.float64], values: NDArray[np.float64]) -> Interpolant:
    """Return a function of time through samples, (n_time,) each; constant beyond the ends."""
    if time.size < 3:
        return lambda at: np.interp(at, time, values)
    from scipy.interpolate import Akima1DInterpolator  # slow to import, like all of scipy here

    try:
        with np.errstate(all="ignore"):
            through = Akima1DInterpolator(time, values, method="makima")
    except ValueError:  # differences beyond any number: the reader refuses what isn't finite
        return lambda at: np.full(at.shape, np.nan)
    return lambda at: through(np.clip(at, time[0], time[-1]))


def oversampling(step: float, rate: float) -> int:
    """Return how many fine samples a grid sample needs: 1 where nothing can alias.

    Args:
        step: median time between a channel's samples, s.
        rate: of the grid, Hz.
    """
    ratio = 1.0 / (step * rate)
    return 1 if ratio <= _FASTER else 2 * math.ceil(ratio)


def resample(
    interpolants: Sequence[Interpolant],
    start: float,
    count: int,
    *,
    rate: float,
    factor: int,
    samples: int,
) -> NDArray[np.float64]:
    """Return channels on the grid start + k / rate, (count, n_channel).

    Args:
        interpolants: one a channel.
        start: s.
        count: samples of the grid.
        rate: Hz.
        factor: fine samples to one of the grid; 1 for no filter.
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
    fine = start + np.arange((count - 1) * factor + 1) / (rate * factor)
    columns = np.empty((count, len(interpolants)))
    with np.errstate(all="ignore"):
        taps = _low_pass(factor) if factor > 1 else np.ones(1)
        half = taps.size // 2
        for k, through in enumerate(interpolants):
            column = np.pad(through(fine), half, mode="reflect", reflect_type="odd")
            around = sliding_window_view(column, taps.size)[::factor]
            columns[:, k] = np.einsum("ij,j->i", around, taps)  # the taps are symmetric
    return columns


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
