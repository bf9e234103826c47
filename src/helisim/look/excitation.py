"""Finds what was flown on a control, and what answers it: shapes, bands, closed loops."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from helisim.base.note import Option
from helisim.base.units import without_trend
from helisim.ident.rational import order
from helisim.ident.response import USABLE_COHERENCE
from helisim.logs.report import LogFinding
from helisim.records.record import (
    ACCELERATIONS,
    ATTITUDES,
    IN1,
    IN2,
    RATES,
    VELOCITIES,
    FlightRecord,
)

Array = NDArray[np.float64]
Kind = Literal["sweep", "multisine", "sine", "3-2-1-1", "doublet", "pulse", "motion"]
"""Of a control's motion; "motion" is without such a shape: a pilot, a controller, noise."""

_LONGEST_BLOCK = 5.0
"""s, in which a control must move to count as active; a twentieth of shorter logs."""
_ACTIVE = 0.3  # of what it moves in its liveliest blocks, from which a control is active
_QUIET = 0.6  # of its liveliest blocks, that its quietest move at most where they are noise
_BEGUN, _CLEAR = 0.1, 4.5
"""Of what it spans, and of the noise at rest, from which an excitation has begun."""
_REST = 6.0  # s, for which an excitation may rest in between, as a slow sweep does
_REST_SHARE = 0.1  # of the log, that a control must rest for its resting place to be known
_HYSTERESIS = 0.3  # of the amplitude, beyond which a half-wave begins
_RISING = 0.75  # rank correlation of frequency and time from which a signal is a sweep
_SPAN = 2.5  # of highest to lowest frequency, from which a signal is a sweep
_FEWEST_WAVES = 8
_RIDGE_WINDOWS = 24
_FAST_ENDING = 20.0  # s: an excitation of few half-waves lasts no longer
_LINES = 0.9  # share of power that counts as a multisine's lines
_FEWEST_LINES = 3
_LOBE = 3
"""Frequencies to either side of a line that it lights up."""
_DARK = 1e-3  # of a line's power, that is between a multisine's lines at most; noise has a tenth
_STRONG = 0.25  # of a strong window's power, from which a window's frequency counts
_STEADY = 0.35  # by which the thirds of a multisine differ in size, relative
_DOUBLET_BAND = (1.0, 3.3)  # of the half-wave's inverse, rad: where a doublet has most of its power
_WINDOWS = 5.0  # of an excitation's length, windows that don't overlap; nine that do
_SAMPLES_A_PERIOD = 10.0
_SMOOTHED = 5
"""Frequencies over which the median of the coherence counts."""
_NARROWEST = 2.0  # of highest to lowest frequency, from which a band is worth a line
_BESIDE = 1.3  # by which a band may go beyond what was excited
_FEEDBACK = 0.5
"""Partial coherence of control and motion, sticks apart, from which a loop is closed."""
_OWN = 0.05
"""Share of a control's power that its stick doesn't explain, from which something else drives."""
_OF_OTHERS = {**dict.fromkeys(ATTITUDES, "tf:0/2"), **dict.fromkeys(ACCELERATIONS, "tf:1/1")}
"""A lag with one more integral for an angle, one less for an acceleration."""
_ANSWERS = (*RATES, *ATTITUDES, *VELOCITIES, *ACCELERATIONS)
_UNITS = {"start": "start_s", "stop": "stop_s", "low": "low_rad_s", "high": "high_rad_s"}


@dataclass(frozen=True)
class FoundExcitation:
    """The motion of a control in a log.

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

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {_UNITS.get(name, name): value for name, value in vars(self).items()}


@dataclass(frozen=True)
class FoundAnswer:
    """A channel that answers a control coherently.

    Attributes:
        input: the control.
        output: the channel.
        low: of the usable band, rad/s.
        high: of the usable band, rad/s.
        coherence: mean in the band.
        structure: of a transfer function that follows it, to begin with.
    """

    input: str
    output: str
    low: float
    high: float
    coherence: float
    structure: str

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {_UNITS.get(name, name): value for name, value in vars(self).items()}


def excitation(channel: str, time: Array, values: Array) -> FoundExcitation | None:
    """Return what a control did where it moved most; None where it rests.

    Args:
        channel: its name.
        time: (n_time,) s, uniform.
        values: (n_time,).
    """
    if time.size < 50 or np.ptp(values) <= 1e-9 * np.max(np.abs(values)):
        return None
    inside = _active(time, values)
    x, t, rest = values[inside], time[inside], np.delete(values, inside)
    x = x - (np.median(rest) if rest.size > _REST_SHARE * values.size else np.mean(x))
    amplitude = float(np.quantile(np.abs(x), 0.98))
    if x.size < 10 or amplitude <= 0.0:
        return None
    kind, low, high = _kind(t, x, amplitude)
    return FoundExcitation(channel, kind, float(t[0]), float(t[-1]), low, high, amplitude)


def _active(time: Array, values: Array) -> slice:
    """Return the samples of the longest time in which a control is active."""
    step = (time[-1] - time[0]) / (time.size - 1)
    width = min(max((time[-1] - time[0]) / 20.0, 5.0 * step), _LONGEST_BLOCK)
    size = max(round(width / step), 2)
    count = time.size // size
    blocks = values[: count * size].reshape(count, size)
    low, high = blocks.min(axis=1), blocks.max(axis=1)
    spans = np.maximum(high[:-1], high[1:]) - np.minimum(low[:-1], low[1:])
    quiet, most = np.quantile(spans, (0.1, 0.9)) if spans.size else (0.0, 0.0)
    floor = quiet if quiet < _QUIET * most else 0.0
    lively = np.flatnonzero(spans > floor + _ACTIVE * (most - floor))
    if not lively.size:
        return slice(0, time.size)
    rests = np.flatnonzero(np.diff(lively) * size * step > max(_REST, 2.0 * width)) + 1
    run = max(np.split(lively, rests), key=lambda run: run[-1] - run[0])
    begin, end = int(run[0]), int(run[-1])
    within = slice(begin * size, time.size if end + 2 >= count else (end + 2) * size)
    rest = np.delete(values, within)
    middle = np.median(rest) if rest.size > _REST_SHARE * values.size else np.median(values)
    noise = 1.5 * np.median(np.abs(rest - middle)) if rest.size else 0.0
    least = max(_BEGUN * np.ptp(values[within]), _CLEAR * noise)
    inside = np.flatnonzero(np.abs(values[within] - middle) > least) + begin * size
    return slice(int(inside[0]), int(inside[-1]) + 1) if inside.size else within


def _kind(time: Array, values: Array, amplitude: float) -> tuple[Kind, float, float]:
    """Return what a signal is, and its lowest and highest frequency, rad/s."""
    waves = _half_waves(time, values, _HYSTERESIS * amplitude)
    if waves.size < _FEWEST_WAVES:
        duration = float(time[-1] - time[0])
        width = duration / max(waves.size, 1)
        shapes: dict[int, Kind] = {1: "pulse", 2: "doublet", 4: "3-2-1-1"}
        kind = shapes.get(int(waves.size), "motion") if duration <= _FAST_ENDING else "motion"
        return kind, _DOUBLET_BAND[0] / width, _DOUBLET_BAND[1] / width
    frequency = np.pi / waves
    smooth = np.median(np.stack([frequency[:-2], frequency[1:-1], frequency[2:]]), axis=0)
    for found in (smooth, _ridge(time, values)):
        edge = max(found.size // 10, 1)
        begin, end = float(np.median(found[:edge])), float(np.median(found[-edge:]))
        ranks = np.argsort(np.argsort(found))
        rising = abs(float(np.corrcoef(ranks, np.arange(found.size))[0, 1])) > _RISING
        if rising and max(begin, end) > _SPAN * min(begin, end):
            low = found[:2] if begin < end else found[-2:]  # few waves are slow
            return "sweep", float(np.min(low)), max(begin, end)
    return _lines(time, values)


def _ridge(time: Array, values: Array) -> Array:
    """Return the strongest frequency of each strong window, rad/s: under noise, too."""
    length = 2 * max(values.size // (_RIDGE_WINDOWS + 1), 4)
    step = (time[-1] - time[0]) / (time.size - 1)
    starts = range(0, values.size - length + 1, length // 2)
    parts = np.stack([values[k : k + length] - values[k : k + length].mean() for k in starts])
    power = np.abs(np.fft.rfft(parts * np.hanning(length), axis=1)) ** 2
    omega = 2.0 * np.pi * np.fft.rfftfreq(length, step)
    peak = np.max(power[:, 1:], axis=1)
    strong = peak > _STRONG * np.quantile(peak, 0.75)
    return omega[1 + np.argmax(power[strong, 1:], axis=1)]


def _half_waves(time: Array, values: Array, least: float) -> Array:
    """Return how long each half-wave lasts, s: from one change of sign to the next."""
    side = np.where(values > least, 1, np.where(values < -least, -1, 0))
    known = np.flatnonzero(side)
    if not known.size:
        return np.empty(0)
    turns = known[1:][np.diff(side[known]) != 0]
    edges = np.concatenate([[time[known[0]]], time[turns], [time[known[-1]]]])
    return np.maximum(np.diff(edges), time[1] - time[0])


def _lines(time: Array, values: Array) -> tuple[Kind, float, float]:
    """Return whether a signal is of few steady lines, and the band that has its power."""
    step = (time[-1] - time[0]) / (time.size - 1)
    power = np.abs(np.fft.rfft((values - values.mean()) * np.hanning(values.size))) ** 2
    omega = 2.0 * np.pi * np.fft.rfftfreq(values.size, step)
    ranked = np.argsort(power)[::-1]
    held = np.cumsum(power[ranked]) / np.sum(power)
    strong = np.sort(ranked[: int(np.searchsorted(held, _LINES)) + 1])
    low, high = float(max(omega[strong[0]], omega[1])), float(omega[strong[-1]])
    thirds = [float(np.std(part)) for part in np.array_split(values, 3)]
    padded = np.pad(power, 2)
    around = np.max([padded[k : k + power.size] for k in (0, 1, 3, 4)], axis=0)
    peaks = strong[power[strong] > around[strong]]
    near = np.zeros(power.size, dtype=bool)
    near[np.clip(peaks[:, None] + np.arange(-_LOBE, _LOBE + 1), 0, power.size - 1)] = True
    band = slice(strong[0], strong[-1] + 1)
    between = power[band][~near[band]]
    if np.ptp(thirds) > _STEADY * np.mean(thirds):
        return "motion", low, high
    if peaks.size == 1 and strong.size <= 2 * _LOBE + 1:
        return "sine", low, high
    sharp = between.size >= peaks.size and np.median(between) < _DARK * np.median(power[peaks])
    return ("multisine" if peaks.size >= _FEWEST_LINES and sharp else "motion"), low, high


def answers(
    record: FlightRecord, excited: Sequence[FoundExcitation], rates: Mapping[str, float]
) -> tuple[FoundAnswer, ...]:
    """Return the coherent answers to what was excited, best first.

    Args:
        record: uniform.
        excited: what was found in it.
        rates: samples a second of each channel, before it was resampled, Hz.
    """
    pairs = [
        (one, output, record.slice(one.start, one.stop))
        for one in excited
        for output in _ANSWERS
        if output in record
    ]
    found = [_answer(part, one, output, rates) for one, output, part in pairs]
    known = [one for one in found if one is not None]
    return tuple(sorted(known, key=lambda one: -one.coherence * np.log(one.high / one.low)))


def _answer(
    part: FlightRecord, excited: FoundExcitation, output: str, rates: Mapping[str, float]
) -> FoundAnswer | None:
    """Return the widest coherent band of an output, None if there is none."""
    step = part.duration / (len(part) - 1)
    omega, cross = _cross_spectra(part.select((excited.channel, output)), step)
    power = (cross[:, 0, 0] * cross[:, 1, 1]).real
    coherence = np.abs(cross[:, 0, 1]) ** 2 / np.where(power > 0.0, power, np.inf)
    padded = np.pad(coherence, _SMOOTHED // 2, mode="edge" if omega.size else "constant")
    smooth = np.median([padded[k : k + omega.size] for k in range(_SMOOTHED)], axis=0)
    rate = min(rates.get(name, np.inf) for name in (excited.channel, output))
    high = min(2.0 * np.pi * min(rate, 1.0 / step) / _SAMPLES_A_PERIOD, _BESIDE * excited.high)
    usable = (smooth >= USABLE_COHERENCE) & (omega <= high) & (omega >= excited.low / _BESIDE)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], usable.astype(int), [0]])))
    runs = [(omega[a], omega[b - 1], slice(a, b)) for a, b in zip(edges[::2], edges[1::2])]
    low, high, inside = max(runs, key=lambda run: run[1] / run[0], default=(1.0, 0.0, slice(0)))
    if high < _NARROWEST * low:
        return None
    structure = _OF_OTHERS.get(output)
    if structure is None:
        zeros, poles = order(omega[inside], cross[inside, 1, 0] / cross[inside, 0, 0])
        structure = f"tf:{zeros}/{poles}"
    mean = float(np.mean(coherence[inside]))
    return FoundAnswer(excited.channel, output, float(low), float(high), mean, structure)


def _cross_spectra(columns: Array, step: float) -> tuple[Array, NDArray[np.complex128]]:
    """Return frequencies, (n_freq,) rad/s, and cross-spectra (n_freq, n_channel, n_channel)."""
    length, width = 2 * int(columns.shape[0] / (2.0 * _WINDOWS)), columns.shape[1]
    if length < 32:
        return np.empty(0), np.empty((0, width, width), np.complex128)
    window = (0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(length) / length))[:, None]
    starts = range(0, columns.shape[0] - length + 1, length // 2)
    parts = [np.fft.rfft(without_trend(columns[k : k + length]) * window, axis=0) for k in starts]
    omega = 2.0 * np.pi * np.fft.rfftfreq(length, step)
    keep = omega >= 2.0 * np.pi / (length * step)
    cross = sum(part[keep, :, None] * part[keep, None, :].conj() for part in parts)
    return omega[keep].astype(np.float64), np.asarray(cross, dtype=np.complex128)


def loops(
    record: FlightRecord, found: Sequence[FoundAnswer], rates: Mapping[str, float]
) -> list[LogFinding]:
    """Return the controls that follow the motion besides their stick: a loop is closed there.

    Args:
        record: uniform.
        found: which channels answer which controls.
        rates: samples a second of each channel, before it was resampled, Hz.
    """
    findings = []
    for actuator, stick in zip(IN1, IN2):
        best = next((one for one in found if one.input == actuator), None)
        if best is None or stick not in record:
            continue
        columns = record.select((stick, actuator, best.output))
        omega, cross = _cross_spectra(columns, record.duration / (len(record) - 1))
        resolved = 2.0 * np.pi * rates.get(stick, np.inf) / _SAMPLES_A_PERIOD
        cross = cross[(omega >= best.low) & (omega <= min(best.high, resolved))]
        power = (cross[:, 0, 0] * cross[:, 1, 1]).real
        own = 1.0 - np.abs(cross[:, 0, 1]) ** 2 / np.where(power > 0.0, power, np.inf)
        # without what the stick explains
        scale = np.where(cross[:, 0, 0].real > 0.0, cross[:, 0, 0], np.inf)[:, None, None]
        left = cross[:, 1:, 1:] - cross[:, 1:, :1] * cross[:, :1, 1:] / scale
        power = (left[:, 0, 0] * left[:, 1, 1]).real
        partial = np.abs(left[:, 0, 1]) ** 2 / np.where(power > 0.0, power, np.inf)
        if partial.size and np.median(own) >= _OWN and np.median(partial) > _FEEDBACK:
            text = (
                f"{actuator} follows {best.output} besides {stick} (partial coherence "
                f"{float(np.median(partial)):.2f}): a loop is closed, which biases responses to "
                f"{actuator}; name {stick}, which is outside of it, as the reference"
            )
            findings.append(LogFinding("loop", text, (Option("reference", stick),)))
    return findings
