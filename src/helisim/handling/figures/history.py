"""Figures of a history: quickness of a change of attitude, coupling, and the return to rest."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import sici

from helisim.handling.curve import Curve

Real = NDArray[np.float64]


@dataclass(frozen=True)
class Quickness:
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
    peak = float(change[top])
    if peak <= 0.0:
        return Quickness(0.0, 0.0, 0.0)
    return Quickness(float(rate.max()) / peak, peak, float(change[top:].min()))


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
    half = time.size // 2
    drift = abs(angle[-1] - angle[half]) / (time[-1] - time[half])
    if drift > _RUNNING * np.abs(rate).max():
        width = _width(time, angle, change)
        angle, rate = _pulse(angle, time, width), _pulse(rate, time, width)
    found = quickness(angle, rate)
    less = min(change / found.peak, 1.0) if found.peak > 0.0 else 1.0
    return Quickness(found.ratio, less * found.peak, less * found.least)


_RUNNING = 0.1
"""Share of the peak rate with which an attitude runs on rather than settles."""
_BISECTIONS = 24


def _width(time: Real, step: Real, change: float) -> float:
    """Return how wide a pulse is by which the peak is as wanted, at most all of the time."""
    low, high = 0.0, float(time[-1])
    if np.abs(step).max() <= change:
        return high
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        enough = np.abs(_pulse(step, time, middle)).max() >= change
        low, high = (low, middle) if enough else (middle, high)
    return high


def _pulse(step: Real, time: Real, width: float) -> Real:
    return step - np.interp(time - width, time, step, left=0.0)


def coupling(time: Real, on_axis: Real, off_axis: Real, *, after: float) -> float:
    """Return the peak off-axis change within a time over the on-axis change at that time.

    ADS-33E-PRF, 3.3.9.2: Delta theta_pk / Delta phi_4, 4 s after an abrupt step of the stick.

    Args:
        time: (n_time,) s, from the step on.
        on_axis: (n_time,) change of the attitude that is commanded, rad.
        off_axis: (n_time,) of the other.
        after: s.
    """
    within = time <= after
    wanted = float(np.interp(after, time, on_axis))
    peak = float(np.abs(off_axis[within] - off_axis[0]).max())
    return peak / max(abs(wanted - float(on_axis[0])), 1e-12)


def held(disturbance: Curve, *, share: float, longest: float, points: int = 48) -> float:
    """Return how long an attitude needs to come back for good after a step of its disturbance.

    The step response of S from its real part: x(t) = 2 / pi int Re S(w) sin(w t) / w dw
    (Papoulis, The Fourier Integral and its Applications, 1962, chapter 2), Re S straight between
    the points, constant below the first and beyond the last.

    Args:
        disturbance: S, the sensed angle over its disturbance.
        share: of the step within which the attitude is to stay, such as 0.1.
        longest: s, where the search ends.
        points: number of times that are looked at.

    Returns:
        s, up to `longest`, and beyond it by how much more than the share is left there.
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
    """Return the answer to a unit step at times above 0, (n_time,) each; see `held`."""
    own, real = response.frequency, response.response.real
    angle = own[:, None] * time
    integral, _ = sici(angle)
    slope = np.diff(real) / np.diff(own)
    start = real[:-1] - slope * own[:-1]
    inside = start @ np.diff(integral, axis=0) - slope @ np.diff(np.cos(angle), axis=0) / time
    ends = real[0] * integral[0] + real[-1] * (0.5 * np.pi - integral[-1])
    return (inside + ends) * 2.0 / np.pi
