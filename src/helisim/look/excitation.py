"""Finds what excited a control, which channels respond and in which band, and closed loops."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from helisim.base.arrays import Complex, Real
from helisim.base.note import Option
from helisim.base.settings import grouped
from helisim.base.units import window_transforms
from helisim.ident.local import between
from helisim.ident.rational import order
from helisim.ident.response import USABLE_COHERENCE, opposes
from helisim.logs.report import LogFinding
from helisim.records.quality import stretches
from helisim.records.record import (
    ACCELERATIONS,
    ATTITUDES,
    CHANNELS,
    IN1,
    RATES,
    STICKS,
    VELOCITIES,
    FlightRecord,
)

Kind = Literal["sweep", "3-2-1-1", "doublet", "pulse", "motion"]

# _LEAST_SAMPLES: of a record that is looked at
# _LONGEST_BLOCK: s, block to count as active; 1/20 of short logs, and of those of slow vehicles,
# as ships: _SLOW: s, from one sample to the next at least
_LEAST_SAMPLES, _LONGEST_BLOCK, _SLOW = 50, 5.0, 0.2
# _ACTIVE: of what it moves in its liveliest blocks, from which a control is active
# _QUIET: of its liveliest blocks, that its quietest move at most where they are noise
_ACTIVE, _QUIET = 0.3, 0.6
_BEGUN, _CLEAR = 0.1, 4.5  # share of its span, multiple of the noise at rest
# _REST: s, for which an excitation may rest in between, as a slow sweep does
# _REST_SHARE: of the log, that a control must rest for its resting place to be known
_REST, _REST_SHARE = 6.0, 0.1
# _HYSTERESIS: of the amplitude, beyond which a half-wave begins
# _RISING: rank correlation of frequency and time from which a signal is a sweep
_HYSTERESIS, _RISING = 0.3, 0.75
_SPAN, _FEWEST_WAVES = 2.5, 8  # of highest to lowest frequency, from which a signal is a sweep
_FAST_ENDING = 20.0  # s: an excitation of few half-waves lasts no longer
_SHAPES: dict[int, Kind] = {1: "pulse", 2: "doublet", 3: "doublet", 4: "3-2-1-1"}  # by half-waves
_DOUBLET_BAND = (1.0, 3.3)  # of the half-wave's inverse, rad: where a doublet has most of its power
_POWER = (0.03, 0.97)  # shares of a motion's power between which its band is
# Of an excitation's length, windows that don't overlap, nine that do; of a doublet's or 3-2-1-1's,
# whose power is below what a fifth resolves
WINDOWS, _OF_SHAPES = 5.0, 3.0
SAMPLES_A_PERIOD = 10.0
# _SMOOTHED: frequencies of the coherence's running median
# _NARROWEST: of highest to lowest frequency, from which a band is worth a line
_SMOOTHED, _NARROWEST = 5, 2.0
# LEAST_EVENTS: windows that a motion is spread among, at least: in one event all is coherent
# _LEAST_SHARE: of a control's power: what is coherent with less doesn't answer what moved it
LEAST_EVENTS, _LEAST_SHARE = 1.5, 0.1
_BESIDE = 1.3  # by which a band may go beyond what was excited
# partial coherence of control and motion in a closed loop; share of what inputs leave of outputs
# power, by chance a sixth (one over the windows), from which another control's part is taken out,
# and its motion, of the inputs', from which it can have one
_FEEDBACK, _EXPLAINS, _FAINT = 0.5, 0.3, 0.01
_OWN = 0.05  # share of a control's power not explained by its stick
_OF_OTHERS = {**dict.fromkeys(ATTITUDES, (0, 2)), **dict.fromkeys(ACCELERATIONS, (1, 1))}
ANSWERS = (*RATES, *ATTITUDES, *VELOCITIES, *ACCELERATIONS)


@dataclass(frozen=True)
class FoundExcitation:
    """The motion of a control: times in s, band in rad/s, amplitude from rest in SI units."""

    channel: str
    kind: Kind
    start: float
    stop: float
    low: float
    high: float
    amplitude: float

    def __str__(self) -> str:
        return (
            f"{self.kind} on {self.channel} from {self.start:.4g} to {self.stop:.4g} s, "
            f"{self.low:.3g} to {self.high:.3g} rad/s, amplitude {self.amplitude:.3g} "
            f"{CHANNELS[self.channel].unit}"
        ).removesuffix(" 1")


@dataclass(frozen=True)
class FoundAnswer:
    """A channel that responds coherently in a band, rad/s, with a `structure` such as "tf:0/2".

    It `opposes` its input if it is rather a controller's inverse, as a rate or as an attitude.
    """

    input: str
    output: str
    low: float
    high: float
    coherence: float
    structure: str
    opposes: bool = False

    def __str__(self) -> str:
        return f"{self.output} from {self.low:.3g} to {self.high:.3g} ({self.coherence:.2f})"


def excitation(channel: str, time: Real, values: Real) -> FoundExcitation | None:
    """Return a control's main excitation from times and values, (n_time,) each; None at rest."""
    if _rests(values):
        return None
    inside = _active(time, values)
    x, t, rest = values[inside], time[inside], np.delete(values, inside)
    x = x - (np.median(rest) if rest.size > _REST_SHARE * values.size else np.mean(x))
    amplitude = float(np.quantile(np.abs(x), 0.98))
    if x.size < 10 or amplitude <= 0.0:
        return None
    kind, low, high = _kind(t, x, amplitude)
    return FoundExcitation(channel, kind, float(t[0]), float(t[-1]), low, high, amplitude)


def whole(record: FlightRecord, channel: str, kind: Kind = "motion") -> FoundExcitation | None:
    """Return all of a control's motion as one excitation, None if it rests.

    It is of the kind of its event where it is one; what moves as much elsewhere is a "motion".
    """
    time, values = record.time, record[channel] - np.mean(record[channel])
    if _rests(record[channel]):
        return None
    one = kind if events(values) < LEAST_EVENTS else "motion"
    sizes = *_occupied(record.sample_time, values), float(np.quantile(np.abs(values), 0.98))
    return FoundExcitation(channel, one, float(time[0]), float(time[-1]), *sizes)


def _rests(values: Real) -> bool:
    return values.size < _LEAST_SAMPLES or bool(np.ptp(values) <= 1e-9 * np.max(np.abs(values)))


def _occupied(step: float, values: Real) -> tuple[float, float]:
    """Return the band that holds most of a signal's power, rad/s, sampled each `step`, s."""
    omega = 2.0 * np.pi * np.fft.rfftfreq(values.size, step)
    held = np.cumsum(_power(values)) / np.sum(_power(values))
    low, high = omega[np.searchsorted(held, _POWER)]
    return float(max(low, omega[1])), float(high)


def _power(values: Real) -> Real:
    """Return a signal's power at each line, (n_freq,)."""
    return np.abs(np.fft.rfft((values - values.mean()) * np.hanning(values.size))) ** 2


def events(values: Real) -> float:
    """Return among how many windows a signal's motion is spread: of one, all is coherent."""
    half = np.array([np.var(one) for one in np.array_split(values, 2 * round(WINDOWS))])
    aligned, shifted = half[::2] + half[1::2], half[1:-1:2] + half[2::2]
    return min(float(np.sum(one) ** 2 / max(one @ one, 1e-300)) for one in (aligned, shifted))


def _active(time: Real, values: Real) -> slice:
    step = (time[-1] - time[0]) / (time.size - 1)
    longest = _LONGEST_BLOCK if step < _SLOW else np.inf
    width = min(max((time[-1] - time[0]) / 20.0, 5.0 * step), longest)
    size = max(round(width / step), 2)
    count = time.size // size
    blocks = values[: count * size].reshape(count, size)
    spans = np.ptp(np.concatenate([blocks[:-1], blocks[1:]], axis=1), axis=1)
    quiet, most = np.quantile(spans, (0.1, 0.9)) if spans.size else (0.0, 0.0)
    floor = quiet if quiet < _QUIET * most else 0.0
    lively = np.flatnonzero(spans > floor + _ACTIVE * (most - floor))
    if not lively.size:
        return slice(0, time.size)
    rests = np.flatnonzero(np.diff(lively) * size * step > max(_REST, 2.0 * width)) + 1
    begin, end = max((run[[0, -1]] for run in np.split(lively, rests)), key=np.ptp).tolist()
    within = slice(begin * size, time.size if end + 2 >= count else (end + 2) * size)
    rest = np.delete(values, within)
    middle = np.median(rest) if rest.size > _REST_SHARE * values.size else np.median(values)
    noise = 1.5 * np.median(np.abs(rest - middle)) if rest.size else 0.0
    span = np.ptp(values[within])
    least = max(_BEGUN * span, min(_CLEAR * noise, _ACTIVE * span))  # more is no rest
    inside = np.flatnonzero(np.abs(values[within] - middle) > least) + begin * size
    return slice(int(inside[0]), int(inside[-1]) + 1) if inside.size else within


def _kind(time: Real, values: Real, amplitude: float) -> tuple[Kind, float, float]:
    """Return a signal's shape, and its lowest and highest frequency, rad/s."""
    duration, step = float(time[-1] - time[0]), float(time[1] - time[0])
    # half-waves, from one change of sign to the next
    known = np.flatnonzero(np.abs(values) > _HYSTERESIS * amplitude)
    turns = known[1:][np.diff(np.sign(values[known])) != 0]
    edges = np.concatenate([time[known[:1]], time[turns], time[known[-1:]]])
    waves = np.maximum(np.diff(edges), step)
    if waves.size < _FEWEST_WAVES:
        width = duration / max(waves.size, 1)
        kind = _SHAPES.get(int(waves.size), "motion") if duration <= _FAST_ENDING else "motion"
        return kind, _DOUBLET_BAND[0] / width, _DOUBLET_BAND[1] / width
    frequency = np.pi / waves
    found = np.median(np.stack([frequency[:-2], frequency[1:-1], frequency[2:]]), axis=0)
    edge = max(found.size // 10, 1)
    begin, end = float(np.median(found[:edge])), float(np.median(found[-edge:]))
    ranks = np.argsort(np.argsort(found))
    rising = abs(float(np.corrcoef(ranks, np.arange(found.size))[0, 1])) > _RISING
    if rising and max(begin, end) > _SPAN * min(begin, end):
        # few waves are slow
        return "sweep", float(min(found[:2] if begin < end else found[-2:])), max(begin, end)
    return "motion", *_occupied(step, values)


def answers(
    record: FlightRecord, excited: Sequence[FoundExcitation], rates: Mapping[str, float]
) -> tuple[FoundAnswer, ...]:
    """Return the coherent responses, best first; `rates` are each channel's rate as logged, Hz."""
    return joined(
        answer
        for one in excited
        for output in ANSWERS
        if output in record
        for answer in _answer(record.slice(one.start, one.stop), one, output, rates)
    )


def joined(found: Iterable[FoundAnswer]) -> tuple[FoundAnswer, ...]:
    """Return answers, best first; those of several parts of a log over all that they span."""
    best = sorted(found, key=lambda one: -one.coherence * np.log(one.high / one.low))
    return tuple(
        replace(one[0], low=min(a.low for a in one), high=max(a.high for a in one))
        for one in grouped(best, lambda one: (one.input, one.output)).values()
    )


def _answer(
    part: FlightRecord, excited: FoundExcitation, output: str, rates: Mapping[str, float]
) -> list[FoundAnswer]:
    step = part.sample_time
    few = WINDOWS if excited.kind in ("motion", "sweep") else _OF_SHAPES
    omega, cross = _cross_spectra(part.select((excited.channel, output)), step, few)
    coherence = between(cross)[0, 1]
    padded = np.pad(coherence, _SMOOTHED // 2, mode="edge" if omega.size else "constant")
    smooth = np.median([padded[k : k + omega.size] for k in range(_SMOOTHED)], axis=0)
    rate = min(1.0 / step, *(rates.get(name, np.inf) for name in (excited.channel, output)))
    high = min(2.0 * np.pi * rate / SAMPLES_A_PERIOD, _BESIDE * excited.high)
    usable = (smooth >= USABLE_COHERENCE) & (omega <= high) & (omega >= excited.low / _BESIDE)
    usable[1:-1] |= usable[:-2] & usable[2:]  # one dip cuts no band
    runs = [(omega[a], omega[b - 1], slice(a, b)) for a, b in stretches(usable)]
    low, high, inside = max(runs, key=lambda run: run[1] / run[0], default=(1.0, 0.0, slice(0)))
    held = _power(part[excited.channel])
    lines = 2.0 * np.pi * np.fft.rfftfreq(len(part), step)
    moved = (lines >= excited.low / _BESIDE) & (lines <= _BESIDE * excited.high)
    mine = np.sum(held[(lines >= low) & (lines <= high)])
    if (
        high < _NARROWEST * low
        or mine < _LEAST_SHARE * np.sum(held[moved])
        or (excited.kind == "motion" and events(part[excited.channel]) < LEAST_EVENTS)
    ):
        return []
    mean, gain = float(np.mean(coherence[inside])), cross[inside, 1, 0] / cross[inside, 0, 0]
    zeros, poles = _OF_OTHERS.get(output) or order(omega[inside], gain)
    return [
        FoundAnswer(
            *(excited.channel, output, float(low), float(high), mean, f"tf:{zeros}/{poles}"),
            opposes=output in (*RATES, *ATTITUDES)
            and opposes(omega[inside], gain * (1j * omega[inside]) ** (output in ATTITUDES)),
        )
    ]


def _cross_spectra(columns: Real, step: float, windows: float) -> tuple[Real, Complex]:
    """Return frequencies, (n_freq,) rad/s, and cross-spectra (n_freq, n_channel, n_channel)."""
    length, width = 2 * int(columns.shape[0] / (2.0 * windows)), columns.shape[1]
    if length < 32:
        return np.empty(0), np.empty((0, width, width), np.complex128)
    parts = window_transforms(columns, length)[:, 1:]
    omega = 2.0 * np.pi * np.fft.rfftfreq(length, step)[1:]
    return np.asarray(omega, np.float64), np.einsum("kfa,kfb->fab", parts, parts.conj())


def beside(
    records: Sequence[FlightRecord], inputs: Sequence[str], outputs: Sequence[str]
) -> list[str]:
    """Return the other servo commands that explain outputs' power which the inputs leave."""
    return [
        name
        for name in IN1
        if name not in inputs
        and all(name in one for one in records)
        and max(np.ptp(one[name]) for one in records)
        > _FAINT * max(np.ptp(one[i]) for one in records for i in inputs)
        and np.mean([_share(one, (*inputs, name, *outputs), len(inputs)) for one in records])
        > _EXPLAINS
    ]


def _share(record: FlightRecord, names: Sequence[str], n: int) -> float:
    """Return the power's share of which signal n explains one behind it, beyond the first n."""
    _, cross = _cross_spectra(record.select(names), record.sample_time, WINDOWS)
    left = _left(cross, n)
    power = np.real(np.diagonal(left, axis1=1, axis2=2))[:, 1:]
    share = np.sum(between(left)[0, 1:].T * power, axis=0) / np.maximum(power.sum(axis=0), 1e-300)
    return 0.0 if _rests(record[names[n]]) else float(np.max(share, initial=0.0))


def _left(cross: Complex, n: int) -> Complex:
    """Return cross-spectra, (n_freq, m, m), without what the first n signals explain of others."""
    known = np.linalg.pinv(cross[:, :n, :n], hermitian=True)
    return cross[:, n:, n:] - cross[:, n:, :n] @ known @ cross[:, :n, n:]


def loops(
    record: FlightRecord, found: Sequence[FoundAnswer], rates: Mapping[str, float]
) -> list[LogFinding]:
    """Return findings of closed loops; `rates` are each channel's rate as logged, Hz."""
    findings = []
    best = {one.input: one for one in reversed(found)}
    for actuator, stick in STICKS.items():
        one = best.get(actuator)
        if one is None or stick not in record:
            continue
        omega, cross = _cross_spectra(
            record.select((stick, actuator, one.output)), record.sample_time, WINDOWS
        )
        resolved = 2.0 * np.pi * rates.get(stick, np.inf) / SAMPLES_A_PERIOD
        cross = cross[(omega >= one.low) & (omega <= min(one.high, resolved))]
        explained, partial = between(cross)[0, 1], between(_left(cross, 1))[0, 1]
        if partial.size and 1.0 - np.median(explained) >= _OWN and np.median(partial) > _FEEDBACK:
            text = (
                f"{actuator} follows {one.output} besides {stick} (partial coherence "
                f"{float(np.median(partial)):.2f}): a loop is closed, which biases responses to "
                f"{actuator}; name {stick}, which is outside of it, as the reference"
            )
            findings.append(LogFinding("loop", text, (Option("reference", stick),)))
    return findings
