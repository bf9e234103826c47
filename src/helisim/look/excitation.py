"""Finds what was flown on a control: a sweep, a doublet, a multisine; from when to when."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Kind = Literal["sweep", "multisine", "sine", "3-2-1-1", "doublet", "pulse", "motion"]
"""What a control did. "motion" is whatever has no such shape: a pilot, a controller, noise."""

_LONGEST_BLOCK = 5.0
"""s, in which a control must move to count as active; a twentieth of shorter logs."""
_ACTIVE = 0.3
"""Of what it moves in its liveliest blocks, from which a control is active."""
_QUIET = 0.6
"""Of its liveliest blocks, that its quietest move at most where they are noise."""
_BEGUN, _CLEAR = 0.1, 4.5
"""Of what it spans, and of the noise at rest, from which an excitation has begun."""
_REST = 6.0
"""s, for which an excitation may rest in between, as a slow sweep does."""
_REST_SHARE = 0.1
"""Of the log, that a control must rest for its resting place to be known."""
_HYSTERESIS = 0.3
"""Of the amplitude, beyond which a half-wave begins."""
_RISING = 0.75
"""Rank correlation of frequency and time from which a signal is a sweep."""
_SPAN = 2.5
"""Of highest to lowest frequency, from which a signal is a sweep."""
_FEWEST_WAVES = 8
_RIDGE_WINDOWS = 24
_FAST_ENDING = 20.0
"""s: an excitation of few half-waves lasts no longer."""
_LINES = 0.9
"""Share of power that counts as a multisine's lines."""
_FEWEST_LINES = 3
_LOBE = 3
"""Frequencies to either side of a line that it lights up."""
_DARK = 1e-3
"""Of a line's power, that is between a multisine's lines at most; noise has a tenth."""
_STRONG = 0.25
"""Of a strong window's power, from which a window's frequency counts."""
_STEADY = 0.35
"""By which the thirds of a multisine differ in size, relative."""
_DOUBLET_BAND = (1.0, 3.3)
"""Of the half-wave's inverse, rad: where a doublet has most of its power."""


@dataclass(frozen=True)
class FoundExcitation:
    """What a control did in a log.

    Attributes:
        channel: the control.
        kind: such as "sweep".
        start: s.
        stop: s.
        low: lowest frequency, rad/s.
        high: highest frequency, rad/s.
        amplitude: from where it rests, in the channel's SI unit.
    """

    channel: str
    kind: Kind
    start: float
    stop: float
    low: float
    high: float
    amplitude: float

    @property
    def duration(self) -> float:
        """How long it lasts, s."""
        return self.stop - self.start

    def to_dict(self) -> dict[str, object]:
        """Return plain data for JSON."""
        return {
            "channel": self.channel,
            "kind": self.kind,
            "start_s": self.start,
            "stop_s": self.stop,
            "low_rad_s": self.low,
            "high_rad_s": self.high,
            "amplitude": self.amplitude,
        }


def excitation(
    channel: str, time: NDArray[np.float64], values: NDArray[np.float64]
) -> FoundExcitation | None:
    """Return what a control did where it moved most; None where it rests.

    Args:
        channel: its name.
        time: (n_time,) s, uniform.
        values: (n_time,).
    """
    if time.size < 50 or np.ptp(values) <= 1e-9 * np.max(np.abs(values)):
        return None
    first, last = _active(time, values)
    inside = slice(first, last + 1)
    x, t = values[inside], time[inside]
    if x.size < 10:
        return None
    rest = np.concatenate([values[:first], values[last + 1 :]])
    x = x - (np.median(rest) if rest.size > _REST_SHARE * values.size else np.mean(x))
    amplitude = float(np.quantile(np.abs(x), 0.98))
    if amplitude <= 0.0:
        return None
    kind, low, high = _kind(t, x, amplitude)
    return FoundExcitation(channel, kind, float(t[0]), float(t[-1]), low, high, amplitude)


def _active(time: NDArray[np.float64], values: NDArray[np.float64]) -> tuple[int, int]:
    """Return the first and last sample of the longest time in which a control is active."""
    step = (time[-1] - time[0]) / (time.size - 1)
    width = min(max((time[-1] - time[0]) / 20.0, 5.0 * step), _LONGEST_BLOCK)
    size = max(round(width / step), 2)
    count = time.size // size
    blocks = values[: count * size].reshape(count, size)
    low, high = blocks.min(axis=1), blocks.max(axis=1)
    spans = np.maximum(high[:-1], high[1:]) - np.minimum(low[:-1], low[1:])
    if not spans.size:
        return 0, time.size - 1
    quiet, most = np.quantile(spans, (0.1, 0.9))
    floor = quiet if quiet < _QUIET * most else 0.0
    lively = spans > floor + _ACTIVE * (most - floor)
    runs: list[list[int]] = []
    for k in np.flatnonzero(lively):
        if runs and (k - runs[-1][1]) * size * step <= max(_REST, 2.0 * width):
            runs[-1][1] = int(k)
        else:
            runs.append([int(k), int(k)])
    if not runs:
        return 0, time.size - 1
    begin, end = max(runs, key=lambda run: run[1] - run[0])
    stop = time.size - 1 if end + 2 >= count else (end + 2) * size - 1
    within = slice(begin * size, stop + 1)
    rest = np.delete(values, within)
    middle = np.median(rest) if rest.size > _REST_SHARE * values.size else np.median(values)
    noise = 1.5 * np.median(np.abs(rest - middle)) if rest.size else 0.0
    least = max(_BEGUN * np.ptp(values[within]), _CLEAR * noise)
    inside = np.flatnonzero(np.abs(values[within] - middle) > least) + begin * size
    return (int(inside[0]), int(inside[-1])) if inside.size else (within.start, stop)


def _kind(
    time: NDArray[np.float64], values: NDArray[np.float64], amplitude: float
) -> tuple[Kind, float, float]:
    """Return what a signal is, and its lowest and highest frequency, rad/s."""
    waves = _half_waves(time, values, _HYSTERESIS * amplitude)
    if waves.size < _FEWEST_WAVES:
        duration = float(time[-1] - time[0])
        width = duration / max(waves.size, 1)
        band = _DOUBLET_BAND[0] / width, _DOUBLET_BAND[1] / width
        if duration > _FAST_ENDING:
            return "motion", *band
        shapes: dict[int, Kind] = {1: "pulse", 2: "doublet", 4: "3-2-1-1"}
        return shapes.get(int(waves.size), "motion"), *band
    frequency = np.pi / waves
    smooth = np.median(np.stack([frequency[:-2], frequency[1:-1], frequency[2:]]), axis=0)
    for found in (smooth, _ridge(time, values)):
        edge = max(found.size // 10, 1)
        begin, end = float(np.median(found[:edge])), float(np.median(found[-edge:]))
        if _ranks_agree(found) > _RISING and max(begin, end) > _SPAN * min(begin, end):
            low = found[:2] if begin < end else found[-2:]  # few waves are slow
            return "sweep", float(np.min(low)), max(begin, end)
    return _lines(time, values)


def _ridge(time: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the strongest frequency of each strong window, rad/s: under noise, too."""
    length = 2 * max(values.size // (_RIDGE_WINDOWS + 1), 4)
    step = (time[-1] - time[0]) / (time.size - 1)
    starts = range(0, values.size - length + 1, length // 2)
    window = np.hanning(length)
    parts = np.stack([values[k : k + length] - values[k : k + length].mean() for k in starts])
    power = np.abs(np.fft.rfft(parts * window, axis=1)) ** 2
    omega = 2.0 * np.pi * np.fft.rfftfreq(length, step)
    peak = np.max(power[:, 1:], axis=1)
    strong = peak > _STRONG * np.quantile(peak, 0.75)
    return omega[1 + np.argmax(power[strong, 1:], axis=1)]


def _half_waves(
    time: NDArray[np.float64], values: NDArray[np.float64], least: float
) -> NDArray[np.float64]:
    """Return how long each half-wave lasts, s: from one change of sign to the next."""
    side = np.where(values > least, 1, np.where(values < -least, -1, 0))
    known = np.flatnonzero(side)
    if not known.size:
        return np.empty(0)
    turns = known[1:][np.diff(side[known]) != 0]
    edges = np.concatenate([[time[known[0]]], time[turns], [time[known[-1]]]])
    return np.maximum(np.diff(edges), time[1] - time[0])


def _ranks_agree(values: NDArray[np.float64]) -> float:
    """Return the size of the rank correlation of values with their order."""
    ranks = np.argsort(np.argsort(values))
    order = np.arange(values.size)
    return abs(float(np.corrcoef(ranks, order)[0, 1]))


def _lines(time: NDArray[np.float64], values: NDArray[np.float64]) -> tuple[Kind, float, float]:
    """Return whether a signal is of few steady lines, and the band that has its power."""
    step = (time[-1] - time[0]) / (time.size - 1)
    window = np.hanning(values.size)
    power = np.abs(np.fft.rfft((values - values.mean()) * window)) ** 2
    omega = 2.0 * np.pi * np.fft.rfftfreq(values.size, step)
    order = np.argsort(power)[::-1]
    held = np.cumsum(power[order]) / np.sum(power)
    strong = np.sort(order[: int(np.searchsorted(held, _LINES)) + 1])
    low, high = float(max(omega[strong[0]], omega[1])), float(omega[strong[-1]])
    thirds = [float(np.std(part)) for part in np.array_split(values, 3)]
    if np.ptp(thirds) > _STEADY * np.mean(thirds):
        return "motion", low, high
    padded = np.pad(power, 2)
    around = np.max([padded[k : k + power.size] for k in (0, 1, 3, 4)], axis=0)
    peaks = strong[power[strong] > around[strong]]
    near = np.zeros(power.size, dtype=bool)
    for k in range(-_LOBE, _LOBE + 1):
        near[np.clip(peaks + k, 0, power.size - 1)] = True
    between = power[strong[0] : strong[-1] + 1][~near[strong[0] : strong[-1] + 1]]
    if peaks.size == 1 and strong.size <= 2 * _LOBE + 1:
        return "sine", low, high
    sharp = between.size >= peaks.size and np.median(between) < _DARK * np.median(power[peaks])
    return ("multisine" if peaks.size >= _FEWEST_LINES and sharp else "motion"), low, high
