"""The figures by which a loop is judged, each computed from one response or one history.

Whether a figure is good enough is said by `criteria`. One that a response doesn't have within its
band (no crossover, no phase of -180 deg) is continued beyond it so that it stays finite and
continuous, as a search needs it.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import sici

from helisim.handling.loop import Curve

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
Gauge = Callable[[Real, Real], Real]

MOST_GAIN = 60.0
"""dB: more gain margin than that is said to be that."""
HALF_POWER = -10.0 * np.log10(2.0)
"""dB, of 1 / sqrt 2."""
_END = 8
"""Points at an end of the band over which it is extended."""
_SHORT = 1.5
"""Least ratio of the frequencies between which a slope of phase is taken."""
_RUNNING = 0.1
"""Share of the peak rate with which an attitude runs on rather than settles."""
_BISECTIONS = 24
_FADE = np.log(2.0)
"""Over an octave outside of the band a mode ceases to count."""
_TRIANGLE = 1.862
"""Rate asked for over its limit, from which on what is reached is a triangle."""


@dataclass(frozen=True, eq=False)
class Crossings:
    """Where a function of frequency passes zero, between the points k and k + 1.

    Attributes:
        index: (n_crossing,) k.
        share: (n_crossing,) of the way in the logarithm of frequency, 0 to 1.
        frequency: (n_crossing,) rad/s.
        rising: (n_crossing,) whether it rises there with frequency.
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
    """Return where values pass zero, by straight lines over the logarithm of frequency.

    Args:
        frequency: (n_freq,) rad/s.
        values: (n_freq,).
        most: a step between neighbours beyond it is no crossing but a turn of an angle.
    """
    positive = values > 0.0
    index = np.flatnonzero(positive[1:] != positive[:-1])
    step = values[index + 1] - values[index]
    kept = np.abs(step) < most
    index, step = index[kept], step[kept]
    share, low = -values[index] / step, frequency[index]
    where = low * (frequency[index + 1] / low) ** share
    return Crossings(index, share, where, positive[index + 1])


def peak(frequency: Real, values: Real) -> tuple[float, float]:
    """Return the highest of values, (n_freq,), between the points, and its frequency in rad/s.

    A parabola over the logarithm of `frequency`, (n_freq,), through the highest point and its
    neighbours; at an end the point itself.
    """
    top = int(np.argmax(values))
    if top in (0, values.size - 1):
        return float(values[top]), float(frequency[top])
    x0, x1, x2 = np.log(frequency[top - 1 : top + 2]).tolist()
    y0, y1, y2 = values[top - 1 : top + 2].tolist()
    left, right = (y1 - y0) / (x1 - x0), (y2 - y1) / (x2 - x1)
    bend = (right - left) / (x2 - x0)
    if bend >= 0.0:
        return y1, float(frequency[top])
    here = 0.5 * (x0 + x1) - 0.5 * left / bend
    return y0 + (here - x0) * (left + bend * (here - x1)), float(np.exp(here))


def _wrapped(angle: Real) -> Real:
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def _shortest(turn: Real) -> Real:
    """Return turns, rad, the short way about."""
    return turn - 2.0 * np.pi * np.round(turn / (2.0 * np.pi))


@dataclass(frozen=True)
class Margins:
    """How far a loop is from instability, at all its crossings.

    Of several crossings the least margin counts, whether gain or phase is to rise or to fall. A
    margin is negative where the curve says that the loop is unstable: it passes the real axis
    beyond -1 clockwise, as frequency rises, more often than back. Nyquist's criterion needs the
    open loop's unstable poles too, which a response over a band doesn't tell: an instability slower
    than the band, or one that the loop fails to stabilise, is seen only by poles.

    Attributes:
        gain: ((rad/s, dB), ...) at each phase of -180 deg: by how much the gain can rise, and
            where negative, by how much it can fall, before -1 is met.
        phase: ((rad/s, rad), ...) at each gain of one: the lag that meets -1, and where negative,
            the lead, in [-pi, pi).
        open_gain: dB, the gain margin where -180 deg lies outside of the band: gain and phase
            extended from its ends, the phase beyond the top along a delay.
        open_phase: rad, likewise of a crossing of gain that isn't in the band: the phase where
            the gain is nearest to one, wider the lower the gain; pi if there is a crossing.
        beyond: how often more the curve passes the real axis left of -1 clockwise than back.
        crossover: rad/s, the highest frequency at which the gain falls through one. Without one,
            where it would by a slope of 20 dB a decade from its nearest point.
        crosses: whether there is one.
    """

    gain: tuple[tuple[float, float], ...]
    phase: tuple[tuple[float, float], ...]
    open_gain: float
    open_phase: float
    beyond: int
    crossover: float
    crosses: bool

    @property
    def stable(self) -> bool:
        """Whether the curve shows no instability; see the class for what it can't show."""
        return self.beyond <= 0

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

    Definitions: MIL-DTL-9490E, 3.1.3.6.1, and its successor SAE AS94900: the least change
    of gain, up or down, and of phase, lag or lead, that makes the loop unstable.
    """
    frequency, decibel = loop.frequency, loop.decibel
    behind = np.angle(-loop.response)
    ones = crossings(frequency, decibel)
    turns = crossings(frequency, behind, most=np.pi)
    sizes = turns.of(decibel)
    low = behind[ones.index]
    angles = _wrapped(low + ones.share * _shortest(behind[ones.index + 1] - low))
    top = -1 if decibel[-1] > 0.0 else int(np.argmax(decibel))
    there = abs(float(behind[top]))
    wide = there if top == -1 else float(np.pi - (np.pi - there) * 10.0 ** (decibel[top] / 20.0))
    falling = ones.frequency[~ones.rising]
    nearest = frequency[top] * 10.0 ** (decibel[top] / 20.0)
    return Margins(
        gain=tuple(zip(turns.frequency.tolist(), (-sizes).tolist())),
        phase=tuple(zip(ones.frequency.tolist(), angles.tolist())),
        open_gain=_open_gain(frequency, decibel, behind),
        open_phase=np.pi if ones.index.size else wide,
        beyond=_beyond(turns, sizes),
        crossover=float(falling[-1] if falling.size else nearest),
        crosses=bool(falling.size),
    )


def is_stable(loop: Curve) -> bool:
    """Return whether a broken loop shows no instability, as `Margins.stable`."""
    turns = crossings(loop.frequency, np.angle(-loop.response), most=np.pi)
    return not turns.index.size or _beyond(turns, turns.of(loop.decibel)) <= 0


def _beyond(turns: Crossings, sizes: Real) -> int:
    """Return how often more the phase of -180 deg is passed falling than rising, left of -1."""
    left = sizes > 0.0
    return int(np.count_nonzero(left & ~turns.rising) - np.count_nonzero(left & turns.rising))


def _open_gain(frequency: Real, decibel: Real, behind: Real) -> float:
    """Return the gain margin at -180 deg beyond the ends of the band.

    From an end's second point on, the gain is straight over log frequency, or stays if it would
    rise; the phase is so too, beyond the top over frequency, as that of a delay.
    """
    inner, found = min(_END, frequency.size - 1), MOST_GAIN
    for ends, delay in (([inner, 0], False), ([-1 - inner, -1], True)):
        where, size, angle = np.log(frequency[ends]), decibel[ends], behind[ends]
        turn, missing = float(_shortest(angle[1] - angle[0])), float(angle[1])
        if turn * missing > 0.0 or turn == 0.0:
            continue  # it leads away
        along = np.exp(where) if delay else where
        there = along[1] - missing / turn * (along[1] - along[0])
        further = (np.log(there) if delay else there) - where[1]
        slope = min((size[1] - size[0]) / (where[1] - where[0]), 0.0)
        found = min(found, abs(float(size[1] + slope * further)))
    return found


@dataclass(frozen=True)
class DiskMargin:
    """What gain and phase together may change before a loop is unstable.

    Attributes:
        alpha: size of the largest disk of changes, 0 to 2 for a loop that is none at all.
        frequency: rad/s, where it is met.
    """

    alpha: float
    frequency: float

    @property
    def gain(self) -> float:
        """By how much the gain may rise or fall, dB, at once with any phase up to none."""
        size = min(abs(self.alpha), 1.998)  # beyond, 60 dB
        return float(np.copysign(20.0 * np.log10((2.0 + size) / (2.0 - size)), self.alpha))

    @property
    def phase(self) -> float:
        """By how much the phase may turn, rad."""
        return float(2.0 * np.arctan(0.5 * self.alpha))


def disk_margin(loop: Curve, *, skew: float = 0.0) -> DiskMargin:
    """Return the disk margin of a broken loop, negative where the curve shows it is unstable.

    alpha = 1 / max|S + (skew - 1) / 2| with S = 1 / (1 + L). Seiler, Packard and Gahinet, "An
    Introduction to Disk Margins", IEEE Control Systems Magazine 40 (5), 2020, theorem 1.

    Args:
        loop: broken.
        skew: 0: gain and phase to either side alike. 1: of S. -1: of T.
    """
    size = np.abs(1.0 / (1.0 + loop.response) + 0.5 * (skew - 1.0))
    highest, where = peak(loop.frequency, size)
    return DiskMargin(1.0 / highest if is_stable(loop) else -1.0 / highest, where)


def slope_order(loop: Curve, crossover: float, *, span: float = 2.0) -> float:
    """Return the order of a broken loop around its crossover: near 1 where it is as K/s.

    The slope of a straight line fitted to its magnitude, dB over log10 of frequency, by least
    squares, over -20 dB a decade.

    Args:
        loop: broken.
        crossover: rad/s.
        span: from crossover / span to crossover * span, as far as the curve goes.
    """
    own = loop.frequency
    middle = min(max(crossover, own[0]), own[-1])
    inside = (own >= middle / span) & (own <= middle * span)
    if np.count_nonzero(inside) < 2:
        near = int(np.clip(np.searchsorted(own, middle), 1, own.size - 1))
        inside = slice(near - 1, near + 1)
    x, y = np.log10(own[inside]), loop.decibel[inside]
    x = x - x.mean()
    return float(-(x @ y) / (x @ x) / 20.0)


class Approach(NamedTuple):
    """Where a loop comes nearest to the critical point.

    Attributes:
        size: 1 on the border of the zone, 0 at the critical point, negative of an unstable loop.
        frequency: rad/s.
        phase: rad from -180 deg, in [-pi, pi).
        gain: dB.
    """

    size: float
    frequency: float
    phase: float
    gain: float


def hexagon(gain: float, phase: float, *, corner: float = 0.5) -> Gauge:
    """Return a zone about the critical point: tips at +-gain, upright sides at +-phase.

    Args:
        gain: dB, of its tips at -180 deg.
        phase: rad from -180 deg, of its upright sides.
        corner: height of those sides over that of the tips, 0 (a rhomb) to 1 (a rectangle).

    Returns:
        A function of phase from -180 deg, rad, and gain, dB, each of any shape: 1 on the border.
    """

    def gauge(x: Real, y: Real) -> Real:
        side = np.abs(x) / phase
        return np.maximum(side, np.abs(y) / gain + (1.0 - corner) * side)

    return gauge


def ellipse(gain: float, phase: float) -> Gauge:
    """Return an ellipse with half axes of gain, dB, and phase, rad; see `hexagon`."""
    return lambda x, y: np.hypot(x / phase, y / gain)


def approach(loop: Curve, gauge: Gauge) -> Approach:
    """Return where a broken loop comes nearest to -1, in the measure of a zone about it."""
    gain, phase, between = loop.decibel, np.angle(-loop.response), np.linspace(0.0, 1.0, 17)
    size = gauge(phase, gain)
    nearest = int(np.argmin(size))
    low, high = max(nearest - 1, 0), min(nearest + 1, size.size - 1)
    place = np.unique(np.concatenate([low + between, high - 1.0 + between]))
    index = np.minimum(place.astype(np.intp), size.size - 2)
    share = place - index
    x = _wrapped(phase[index] + share * _shortest(phase[index + 1] - phase[index]))
    y = gain[index] + share * (gain[index + 1] - gain[index])
    fine = gauge(x, y)
    best = int(np.argmin(fine))
    own, k = loop.frequency, index[best]
    where = own[k] * (own[k + 1] / own[k]) ** share[best]
    sign = 1.0 if is_stable(loop) else -1.0
    return Approach(sign * float(fine[best]), float(where), float(x[best]), float(y[best]))


@dataclass(frozen=True)
class Rejection:
    """Rejection of a disturbance of attitude.

    Attributes:
        bandwidth: DRB, rad/s: the lowest frequency at which |S| rises through 1 / sqrt 2. Without
            one, where it would by a slope of 20 dB a decade from its nearest point.
        peak: DRP, dB: the highest |S|.
        peak_frequency: rad/s.
        seen: whether |S| rises through 1 / sqrt 2 within the band.
    """

    bandwidth: float
    peak: float
    peak_frequency: float
    seen: bool


def rejection(disturbance: Curve) -> Rejection:
    """Return disturbance rejection bandwidth and peak of a sensitivity S.

    Definitions: Berger, Ivler, Berrios, Tischler and Miller, "Disturbance Rejection Handling-
    Qualities Criteria for Rotorcraft", 72nd Annual Forum of the AHS, 2016; Blanken, Tischler,
    Lusardi and Ivler, "Aeronautical Design Standard - 33 (ADS-33) ... Past, Present, and Future",
    AHS Rotorcraft Handling Qualities Technical Meeting, 2014.

    Args:
        disturbance: the sensed angle over a disturbance of it.
    """
    size, own = disturbance.decibel, disturbance.frequency
    highest, where = peak(own, size)
    found = crossings(own, size - HALF_POWER)
    rises = found.frequency[found.rising]
    nearest = -1 if size[-1] <= HALF_POWER else int(np.argmin(size))
    extended = own[nearest] * 10.0 ** ((HALF_POWER - size[nearest]) / 20.0)
    bandwidth = float(rises[0] if rises.size else extended)
    return Rejection(bandwidth, highest, where, bool(rises.size))


@dataclass(frozen=True)
class Bandwidth:
    """How quickly an attitude follows the stick.

    Attributes:
        phase: rad/s, where the phase is -135 deg: the bandwidth of an attitude response.
        gain: rad/s, below `neutral`, where the gain is twice that at `neutral`.
        neutral: rad/s, where the phase is -180 deg.
        delay: s, phase delay: how fast the phase goes on falling from there to twice that
            frequency, (-180 deg - phase) over twice the frequency there.
        complete: whether the curve reaches from `phase` and `gain` to twice `neutral`; otherwise
            what is missing was continued.
    """

    phase: float
    gain: float
    neutral: float
    delay: float
    complete: bool

    @property
    def rate(self) -> float:
        """Bandwidth of a rate response, rad/s: the lesser of both."""
        return min(self.phase, self.gain)


def bandwidth(command: Curve, *, fit: bool = False, sign: int = 1) -> Bandwidth:
    """Return bandwidths and phase delay of attitude over stick.

    ADS-33E-PRF, 3.3.2.1. Phase counts modulo a turn: -180 deg is met where the curve
    first passes it downwards, whatever slow modes did to the phase below.

    Args:
        command: angle over stick.
        fit: take the slope of phase beyond -180 deg from a straight line over frequency, by least
            squares, as the standard asks if phase is not straight; otherwise from its two ends.
        sign: -1 if the angle answers a positive stick by falling.
    """
    own, size = command.frequency, command.decibel
    turned = np.angle(-sign * command.response)  # from -180 deg
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
    delay, has_delay = _delay(own, unrolled, neutral, fit=fit)
    complete = bool(down.size) and has_lag and has_gain and has_delay
    return Bandwidth(lag, gain, neutral, delay, complete)


def _last_fall(own: Real, values: Real, below: float, slope: float) -> tuple[float, bool]:
    """Return where values last fall through zero before a frequency, and whether they do.

    Where they don't, the nearest to zero is continued by a slope per unit of log frequency.
    """
    found = crossings(own, values)
    falls = found.frequency[~found.rising & (found.frequency <= below)]
    if falls.size:
        return float(falls[-1]), True
    nearest = values.size - 1 if values[-1] > 0.0 else int(np.argmax(values))
    return float(own[nearest] * np.exp(values[nearest] / slope)), False


def _delay(own: Real, phase: Real, neutral: float, *, fit: bool) -> tuple[float, bool]:
    """Return the phase delay, and whether the curve reaches twice the neutral frequency."""
    high = min(2.0 * neutral, float(own[-1]))
    low = min(neutral, high / _SHORT)
    if fit:
        x = np.concatenate([[low], own[(own > low) & (own < high)], [high]])
        y = np.interp(np.log(x), np.log(own), phase)
        x = x - x.mean()
        fall = float(-(x @ y) / (x @ x))
    else:
        ends = np.interp(np.log([low, high]), np.log(own), phase)
        fall = float((ends[0] - ends[1]) / (high - low))
    return 0.5 * fall, high >= 2.0 * neutral


class Quickness(NamedTuple):
    """How quickly an attitude changes.

    Attributes:
        ratio: 1/s, the peak rate over the peak change of attitude.
        peak: rad, the peak change.
        least: rad, the least change after the peak.
    """

    ratio: float
    peak: float
    least: float


def quickness(angle: Real, rate: Real) -> Quickness:
    """Return the quickness of a change from one steady attitude to another.

    ADS-33E-PRF, 3.3.3 and 3.3.6: q_pk / Delta theta_pk against Delta theta_min.

    Args:
        angle: (n_time,) rad, the first the attitude before.
        rate: (n_time,) rad/s.
    """
    change = angle - angle[0]
    if -change.min() > change.max():
        change, rate = -change, -rate
    top = int(np.argmax(change))
    highest = float(change[top])
    if highest <= 0.0:
        return Quickness(0.0, 0.0, 0.0)
    return Quickness(float(rate.max()) / highest, highest, float(change[top:].min()))


def changed(time: Real, angle: Real, rate: Real, *, change: float) -> Quickness:
    """Return the quickness of a change of some size, from the answer to a step of a stick.

    An attitude that settles is changed by such a step, of less stick if that is enough. One that
    runs on, as by rate command, is changed by a pulse, the step less a later one, so wide that
    the peak change is `change`, or as long as the step was seen. The loop is linear.

    Args:
        time: (n_time,) s, from the step on.
        angle: (n_time,) rad.
        rate: (n_time,) rad/s.
        change: rad, the peak that is wanted.
    """
    angle, rate = angle - angle[0], rate - rate[0]
    if np.abs(angle).max() <= 0.0:
        return Quickness(0.0, 0.0, 0.0)

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
    """Return the peak off-axis change within a time over the on-axis change at that time.

    ADS-33E-PRF, 3.3.9.2: Delta theta_pk / Delta phi_4, 4 s after an abrupt step of the stick.

    Args:
        time: (n_time,) s, from the step on.
        on_axis: (n_time,) change of the attitude that is commanded, rad.
        off_axis: (n_time,) of the other.
        after: s.
    """
    wanted = float(np.interp(after, time, on_axis))
    highest = float(np.abs(off_axis[time <= after] - off_axis[0]).max())
    return highest / max(abs(wanted - float(on_axis[0])), 1e-12)


def held(disturbance: Curve, *, share: float, longest: float, points: int = 48) -> float:
    """Return how long an attitude needs to come back for good after a step of its disturbance, s.

    Up to `longest`, and beyond it by how much more than the share is left there.

    Args:
        disturbance: S, the sensed angle over its disturbance.
        share: of the step within which the attitude is to stay, such as 0.1.
        longest: s, where the search ends.
        points: number of times that are looked at.
    """
    time = longest * np.linspace(0.0, 1.0, points + 1)[1:]
    size = np.abs(stepped(disturbance, time))
    outside = np.flatnonzero(size > share)
    if outside.size == 0:
        return float(time[0])
    last = int(outside[-1])
    if last == points - 1:
        return float(longest * (1.0 + (size[-1] - share)))
    part = (size[last] - share) / (size[last] - size[last + 1])
    return float(time[last] + part * (time[last + 1] - time[last]))


def stepped(response: Curve, time: Real) -> Real:
    """Return the answer to a unit step at times above 0, (n_time,) each, by the real part.

    x(t) = 2 / pi int Re S(w) sin(w t) / w dw (Papoulis, The Fourier Integral and its Applications,
    1962, chapter 2), Re S straight between the points, constant below the first and beyond the
    last.
    """
    own, real = response.frequency, response.response.real
    angle = own[:, None] * time
    integral, _ = sici(angle)
    slope = np.diff(real) / np.diff(own)
    start = real[:-1] - slope * own[:-1]
    inside = start @ np.diff(integral, axis=0) - slope @ np.diff(np.cos(angle), axis=0) / time
    ends = real[0] * integral[0] + real[-1] * (0.5 * np.pi - integral[-1])
    return (inside + ends) * 2.0 / np.pi


class Mode(NamedTuple):
    """The least damped mode of a loop.

    Attributes:
        damping: ratio, -1 to 1; 1 if no mode oscillates. Of a mode up to an octave outside of
            the band it is drawn towards 1, so that no mode enters it at once.
        frequency: rad/s, its natural frequency.
    """

    damping: float
    frequency: float


def least_damped(poles: Complex, *, low: float = 0.0, high: float = np.inf) -> Mode:
    """Return the least damped of the poles with natural frequencies in a band, rad/s.

    Args:
        poles: (n_pole,) rad/s; one on the real axis counts as damped by 1 or -1.
        low: rad/s.
        high: rad/s.
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


def slowest(poles: Complex, *, low: float = 0.0) -> float:
    """Return the greatest real part of poles, (n_pole,) rad/s, of natural frequencies from `low`.

    Without any it is minus the highest natural frequency.
    """
    frequency = np.abs(poles)
    inside = frequency >= low
    return float(poles[inside].real.max() if inside.any() else -frequency.max(initial=0.0))


class Onset(NamedTuple):
    """The open loop onset point, OLOP: the broken loop where the rate limit sets in.

    Attributes:
        frequency: rad/s, the lowest at which the actuator is asked for its rate limit. Where the
            curve's whole band lies on one side, the end nearest to it.
        phase: rad from -180 deg, in [-pi, pi).
        gain: dB.
        reached: whether the limit is met within the band.
    """

    frequency: float
    phase: float
    gain: float
    reached: bool


def onset(loop: Curve, actuator: Curve, *, amplitude: float, rate_limit: float) -> Onset:
    """Return the open loop onset point of a rate limit.

    Duda, "Prediction of Pilot-in-the-Loop Oscillations Due to Rate Saturation", Journal of
    Guidance, Control, and Dynamics 20 (3), 1997: an input of the greatest amplitude, at rising
    frequency, until the actuator is asked for its greatest rate; there, the loop broken at the
    actuator.

    Args:
        loop: broken at the actuator.
        actuator: its command over the input, the rate limit left out, at the same frequencies.
        amplitude: of the input.
        rate_limit: of the actuator, in units of its command a second.
    """
    own = actuator.frequency
    excess = actuator.decibel + 20.0 * np.log10(own * amplitude / rate_limit)
    found = crossings(own, excess)
    rises = own[:1] if excess[0] > 0.0 else found.frequency[found.rising]
    where = float(rises[0] if rises.size else own[int(np.argmax(excess))])
    there = loop.at(min(max(where, loop.frequency[0]), loop.frequency[-1]))[0]
    gain = float(20.0 * np.log10(abs(there)))
    return Onset(where, float(np.angle(-there)), gain, bool(rises.size))


def limited(excess: Real) -> Complex:
    """Return the describing function of a rate limit met by a sine, for the first harmonic.

    Exact from x = 1.862 on, where the output is a triangle: 4 / (pi x), behind by
    acos(pi / (2 x)). Between 1 and 1.862 cubics fitted to it: Gilbreath, "Prediction of Pilot-
    Induced Oscillations (PIO) Due to Actuator Rate Limiting Using the Open-Loop Onset Point
    (OLOP) Criterion", AFIT/GAE/ENY/01M-02, 2001, after Duda.

    Args:
        excess: (n_freq,) x, the rate that is asked for over the limit, 0 and more.

    Returns:
        (n_freq,) output over input, 1 up to x = 1.
    """
    x = np.asarray(excess, dtype=np.float64)
    size = np.polyval((0.2908, -1.4396, 1.9232, 0.2230), x)
    phase = np.polyval((0.5280, -2.6213, 3.5056, -1.4171), x)
    far = np.maximum(x, _TRIANGLE)
    size = np.where(x < _TRIANGLE, size, 4.0 / (np.pi * far))
    phase = np.where(x < _TRIANGLE, phase, -np.arccos(np.pi / (2.0 * far)))
    return np.where(x < 1.0, 1.0, size * np.exp(1j * phase)).astype(np.complex128)


def motion(actuator: Curve, *, rms: float, corner: float) -> tuple[float, float]:
    """Return the rms of an actuator's position, and of its rate a second, in a disturbance.

    That is white noise behind two equal lags: an attitude with it has a rate of rms times corner.

    Args:
        actuator: its command over the disturbance.
        rms: of the disturbance, of all frequencies together.
        corner: of the lags, rad/s.
    """
    own = actuator.frequency
    spectrum = 4.0 * rms**2 / (np.pi * corner) / (1.0 + (own / corner) ** 2) ** 2
    power = np.abs(actuator.response) ** 2 * spectrum
    return float(np.sqrt(np.trapezoid(power, own))), float(
        np.sqrt(np.trapezoid(power * own**2, own))
    )
