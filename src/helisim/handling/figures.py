"""Figures of a loop; those that a response lacks in its band are continued beyond it."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.arrays import Complex, Real
from helisim.handling.loop import Curve

MOST_GAIN = 60.0  # dB, the largest gain margin that is told
HALF_POWER = -10.0 * np.log10(2.0)  # dB, of 1 / sqrt 2
_END = 8  # points at an end of the band over which it is extended
_SHORT = 1.5  # least ratio of the frequencies between which a slope of phase is taken
_RUNNING = 0.1  # share of the peak rate above which an attitude runs on rather than settles
_BISECTIONS = 24
_FADE = np.log(2.0)  # an octave: a mode farther outside of the band doesn't count


@dataclass(frozen=True, eq=False)
class Crossings:
    """Crossings of zero, (n_crossing,) each, a `share` in log frequency after points `index`.

    `frequency` is in rad/s; `rising` is with frequency.
    """

    index: NDArray[np.intp]
    share: Real
    frequency: Real
    rising: NDArray[np.bool_]

    def of(self, values: Real) -> Real:
        """Return another function, (n_freq,), at the crossings, (n_crossing,)."""
        low = values[self.index]
        return low + self.share * (values[self.index + 1] - low)


def crossings(frequency: Real, values: Real, *, most: float = np.inf) -> Crossings:
    """Return where values, (n_freq,), cross zero, by lines over log frequency, (n_freq,) rad/s.

    A step between neighbours beyond `most` is no crossing but a turn of an angle.
    """
    positive = values > 0.0
    index = np.flatnonzero(positive[1:] != positive[:-1])
    step = values[index + 1] - values[index]
    kept = np.abs(step) < most
    index, step = index[kept], step[kept]
    share, low = -values[index] / step, frequency[index]
    return Crossings(index, share, low * (frequency[index + 1] / low) ** share, positive[index + 1])


def peak(frequency: Real, values: Real) -> tuple[float, float]:
    """Return the highest of values, (n_freq,), by a parabola; also where, of (n_freq,) rad/s."""
    top = int(np.argmax(values))
    if top in (0, values.size - 1):
        return float(values[top]), float(frequency[top])
    x0, x1, x2 = np.log(frequency[top - 1 : top + 2]).tolist()
    y0, y1, y2 = values[top - 1 : top + 2].tolist()
    left, right = (y1 - y0) / (x1 - x0), (y2 - y1) / (x2 - x1)
    bend = (right - left) / (x2 - x0)
    here = 0.5 * (x0 + x1) - 0.5 * left / bend
    return y0 + (here - x0) * (left + bend * (here - x1)), float(np.exp(here))


@dataclass(frozen=True)
class Margins:
    """Margins of a loop at all its crossings, gain rising or falling; negative if unstable.

    `gain` has (rad/s, dB) at each phase of -180 deg: rise of gain (negative: fall) to -1; `phase`
    (rad/s, rad) at each gain of one: lag (negative: lead) to -1, in [-pi, pi). `open_gain`, dB, is
    that where -180 deg lies outside of the band, extended from its ends; `open_phase`, rad, the
    phase where the gain is nearest to one (pi if there is a crossing); `encircled` is how often the
    phase falls through -180 deg less how often it rises, |L| above one; `crossover`, rad/s, the
    highest fall of the gain through one, else extended from the nearest point by 20 dB a decade. An
    instability slower than the band, or an unstable open loop that isn't stabilised, isn't seen by
    a response: ask poles.
    """

    gain: tuple[tuple[float, float], ...]
    phase: tuple[tuple[float, float], ...]
    open_gain: float
    open_phase: float
    encircled: int
    crossover: float
    crosses: bool

    @property
    def stable(self) -> bool:
        """Whether the loop encircles -1 by no lag."""
        return self.encircled <= 0

    @property
    def least_gain(self) -> float:
        """The gain margin, dB, to either side; negative of an unstable loop."""
        size = min(*(abs(value) for _, value in self.gain), self.open_gain, MOST_GAIN)
        return size if self.stable else -size

    @property
    def least_phase(self) -> float:
        """The phase margin, rad, to either side; negative of an unstable loop."""
        size = min(*(abs(value) for _, value in self.phase), self.open_phase, np.pi)
        return size if self.stable else -size


def margins(loop: Curve) -> Margins:
    """Return gain and phase margins of a broken loop at every crossing, and its crossover.

    Definitions: MIL-DTL-9490E, 3.1.3.6.1, and its successor SAE AS94900.
    """
    frequency, decibel = loop.frequency, loop.decibel
    behind = np.angle(-loop.response)
    ones = crossings(frequency, decibel)
    turns = crossings(frequency, behind, most=np.pi)
    sizes = turns.of(decibel)
    low = behind[ones.index]
    angles = low + ones.share * np.angle(np.exp(1j * (behind[ones.index + 1] - low)))
    angles = (angles + np.pi) % (2.0 * np.pi) - np.pi
    top = -1 if decibel[-1] > 0.0 else int(np.argmax(decibel))
    there = abs(float(behind[top]))
    wide = there if top == -1 else float(np.pi - (np.pi - there) * 10.0 ** (decibel[top] / 20.0))
    falling = ones.frequency[~ones.rising]
    return Margins(
        gain=tuple(zip(turns.frequency.tolist(), (-sizes).tolist())),
        phase=tuple(zip(ones.frequency.tolist(), angles.tolist())),
        open_gain=_open_gain(frequency, decibel, behind),
        open_phase=np.pi if ones.index.size else wide,
        encircled=int(np.sum(np.where(turns.rising, -1, 1)[sizes > 0.0])),
        crossover=float(
            falling[-1] if falling.size else frequency[top] * 10.0 ** (decibel[top] / 20.0)
        ),
        crosses=bool(falling.size),
    )


def _open_gain(frequency: Real, decibel: Real, behind: Real) -> float:
    inner, found = min(_END, frequency.size - 1), MOST_GAIN
    for ends, delay in (([inner, 0], False), ([-1 - inner, -1], True)):
        where, size, angle = np.log(frequency[ends]), decibel[ends], behind[ends]
        turn, missing = float(np.angle(np.exp(1j * (angle[1] - angle[0])))), float(angle[1])
        if turn * missing > 0.0 or turn == 0.0:
            continue  # it leads away
        along = np.exp(where) if delay else where
        there = along[1] - missing / turn * (along[1] - along[0])
        further = (np.log(there) if delay else there) - where[1]
        slope = min((size[1] - size[0]) / (where[1] - where[0]), 0.0)
        found = min(found, abs(float(size[1] + slope * further)))
    return found


@dataclass(frozen=True)
class Rejection:
    """Disturbance rejection bandwidth (DRB), rad/s, and peak (DRP), dB, of |S|.

    DRB is the lowest frequency at which |S| rises through 1 / sqrt 2; if it isn't `seen` in the
    band it is extended from the nearest point by 20 dB a decade.
    """

    bandwidth: float
    peak: float
    peak_frequency: float
    seen: bool


def rejection(disturbance: Curve) -> Rejection:
    """Return DRB and DRP of a sensitivity S: the sensed angle over a disturbance of it.

    Definitions: Berger, Ivler, Berrios, Tischler and Miller, "Disturbance Rejection Handling-
    Qualities Criteria for Rotorcraft", 72nd Annual Forum of the AHS, 2016; Blanken, Tischler,
    Lusardi and Ivler, "Aeronautical Design Standard - 33 (ADS-33) ... Past, Present, and Future",
    AHS Rotorcraft Handling Qualities Technical Meeting, 2014.
    """
    size, own = disturbance.decibel, disturbance.frequency
    highest, where = peak(own, size)
    found = crossings(own, size - HALF_POWER)
    rises = found.frequency[found.rising]
    nearest = -1 if size[-1] <= HALF_POWER else int(np.argmin(size))
    extended = own[nearest] * 10.0 ** ((HALF_POWER - size[nearest]) / 20.0)
    return Rejection(float(rises[0] if rises.size else extended), highest, where, bool(rises.size))


@dataclass(frozen=True)
class Bandwidth:
    """Bandwidth and phase delay of attitude over stick; `complete` if nothing was continued.

    `falls` is whether the gain's was seen, and not continued.

    `phase` is the frequency, rad/s, of -135 deg: the bandwidth of an attitude response; `neutral`
    of -180 deg; `gain`, that below `neutral` where the gain is twice that there; `delay`, s, is
    (-180 deg - phase at 2 neutral) / (2 neutral).
    """

    phase: float
    gain: float
    neutral: float
    delay: float
    falls: bool
    complete: bool

    @property
    def rate(self) -> float:
        """Bandwidth of a rate response, rad/s: the lesser of both."""
        return min(self.phase, self.gain)


def bandwidth(command: Curve) -> Bandwidth:
    """Return bandwidths and phase delay of attitude over stick: ADS-33E-PRF, 3.3.2.1.

    Phase counts modulo a turn: -180 deg is where the curve first passes it downwards.
    """
    own, size = command.frequency, command.decibel
    turned = np.angle(-command.response)  # from -180 deg
    found = crossings(own, turned, most=np.pi)
    down = np.flatnonzero(~found.rising)
    if down.size:
        neutral, index = float(found.frequency[down[0]]), int(found.index[down[0]])
    else:
        neutral, index = float(own[-1] * np.exp(max(float(turned[-1]), 0.0))), own.size - 1
    unrolled = np.unwrap(turned)
    unrolled -= 2.0 * np.pi * np.round((unrolled[index] - turned[index]) / (2.0 * np.pi))
    near = slice(0, index + 2)
    lag, has_lag = _last_fall(own[near], (unrolled - np.pi / 4.0)[near], neutral, 1.0)
    least = float(np.interp(np.log(neutral), np.log(own), size)) + 20.0 * np.log10(2.0)
    decade = 20.0 / np.log(10.0)  # dB a unit of log frequency
    gain, has_gain = _last_fall(own[near], (size - least)[near], neutral, decade)
    high = min(2.0 * neutral, float(own[-1]))
    low = min(neutral, high / _SHORT)
    ends = np.interp(np.log([low, high]), np.log(own), unrolled)
    delay = 0.5 * float((ends[0] - ends[1]) / (high - low))
    complete = bool(down.size) and has_lag and has_gain and high >= 2.0 * neutral
    return Bandwidth(lag, gain, neutral, delay, has_gain, complete)


def _last_fall(own: Real, values: Real, below: float, slope: float) -> tuple[float, bool]:
    found = crossings(own, values)
    falls = found.frequency[~found.rising & (found.frequency <= below)]
    if falls.size:
        return float(falls[-1]), True
    nearest = values.size - 1 if values[-1] > 0.0 else int(np.argmax(values))
    return float(own[nearest] * np.exp(values[nearest] / slope)), False


class Quickness(NamedTuple):
    """Peak rate over peak change of attitude, 1/s; the peak, and the least after it, rad."""

    ratio: float
    peak: float
    least: float


def quickness(angle: Real, rate: Real) -> Quickness:
    """Return the quickness of a change between steady attitudes, rad, by rate; (n_time,) each.

    ADS-33E-PRF, 3.3.3 and 3.3.6.
    """
    change = angle - angle[0]
    if -change.min() > change.max():
        change, rate = -change, -rate
    top = int(np.argmax(change))
    highest = float(change[top])
    return (
        Quickness(0.0, 0.0, 0.0)
        if highest <= 0.0
        else Quickness(float(rate.max()) / highest, highest, float(change[top:].min()))
    )


def changed(time: Real, angle: Real, rate: Real, *, change: float) -> Quickness:
    """Return the quickness of a `change`, rad, from the answer to a step of a stick; linear.

    Time from the step on, s, angle, rad, and rate, rad/s, from the trim's, are (n_time,) each. An
    attitude that settles is scaled down to the change; one that runs on is answered by a pulse of
    that peak.
    """

    def pulse(step: Real, width: float) -> Real:
        return step - np.interp(time - width, time, step, left=0.0)

    half = time.size // 2
    drift = abs(angle[-1] - angle[half]) / (time[-1] - time[half])
    if drift > _RUNNING * np.abs(rate).max():
        low, high = 0.0, float(time[-1])
        for _ in range(_BISECTIONS if np.abs(angle).max() > change else 0):
            middle = 0.5 * (low + high)
            enough = np.abs(pulse(angle, middle)).max() >= change
            low, high = (low, middle) if enough else (middle, high)
        angle, rate = pulse(angle, high), pulse(rate, high)
    found = quickness(angle, rate)
    less = min(change / found.peak, 1.0) if found.peak > 0.0 else 1.0
    return Quickness(found.ratio, less * found.peak, less * found.least)


def coupling(time: Real, on_axis: Real, off_axis: Real, *, after: float) -> float:
    """Return the peak off-axis change within `after`, s, over the on-axis change then.

    ADS-33E-PRF, 3.3.9.2. Time from the step on, s, and attitudes, rad, are (n_time,) each.
    """
    wanted = float(np.interp(after, time, on_axis))
    highest = float(np.abs(off_axis[time <= after] - off_axis[0]).max())
    return highest / max(abs(wanted - float(on_axis[0])), 1e-12)


class Mode(NamedTuple):
    """Damping ratio, -1 to 1, and natural frequency, rad/s, of a loop's least damped mode."""

    damping: float
    frequency: float


def least_damped(poles: Complex, *, low: float = 0.0, high: float = np.inf) -> Mode:
    """Return the least damped mode of poles, (n_pole,) rad/s, from `low` to `high`, rad/s.

    Damping of modes up to an octave outside of the band is drawn towards 1.
    """
    frequency = np.abs(poles)
    kept = frequency > 1e-9
    if not kept.any():
        return Mode(1.0, 0.0)
    frequency = frequency[kept]
    damping = -poles[kept].real / frequency
    size = np.log(frequency)
    outside = np.maximum(math.log(max(low, 1e-12)) - size, size - math.log(high))
    damping = damping + np.clip(outside / _FADE, 0.0, 1.0) * (1.0 - damping)
    least = int(np.argmin(damping))
    return Mode(float(damping[least]), float(frequency[least]))


def motion(actuator: Curve, *, rms: float, corner: float) -> tuple[float, float]:
    """Return the rms of an actuator's position, and of its rate a second, in a disturbance.

    That is white noise behind two equal lags at `corner`, rad/s; `actuator` is the command over it.
    """
    own = actuator.frequency
    spectrum = 4.0 * rms**2 / (np.pi * corner) / (1.0 + (own / corner) ** 2) ** 2
    power = np.abs(actuator.response) ** 2 * spectrum
    return float(np.sqrt(np.trapezoid(power, own))), float(
        np.sqrt(np.trapezoid(power * own**2, own))
    )
