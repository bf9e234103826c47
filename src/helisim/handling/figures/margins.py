"""Stability margins of a broken loop: gain, phase, the disk, and how far it stays from -1.

A broken loop is L of negative feedback. Which of its crossings counts is not decided by where it
lies: the least margin counts, whether gain or phase is to rise or to fall. A margin is negative
where the curve says that the loop is unstable: it passes the real axis beyond -1 clockwise, as
frequency rises, more often than back. Nyquist's criterion needs the open loop's unstable poles
too, which a response over a band doesn't tell: an instability slower than the band, or one that
the loop fails to stabilise, is seen only by `poles`.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from helisim.handling.curve import Curve
from helisim.handling.figures.crossings import Crossings, crossings, peak

Real = NDArray[np.float64]

MOST_GAIN = 60.0
"""dB: more gain margin than that is said to be that."""
_END = 8
"""Points at an end of the band over which it is extended."""


@dataclass(frozen=True)
class Margins:
    """How far a loop is from instability, at all its crossings.

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
        """Whether the curve shows no instability; see the module for what it can't show."""
        return self.beyond <= 0

    @property
    def least_gain(self) -> float:
        """The gain margin, dB, to either side; negative of an unstable loop."""
        seen = (abs(value) for _, value in self.gain)
        return self._signed(min(*seen, self.open_gain, MOST_GAIN))

    @property
    def least_phase(self) -> float:
        """The phase margin, rad, to either side; negative of an unstable loop."""
        seen = (abs(value) for _, value in self.phase)
        return self._signed(min(*seen, self.open_phase, np.pi))

    def _signed(self, size: float) -> float:
        return size if self.stable else -size


@dataclass(frozen=True)
class DiskMargin:
    """What gain and phase together may change before a loop is unstable.

    Attributes:
        alpha: size of the largest disk of changes, 0 to 2 for a loop that is none at all.
        frequency: rad/s, where it is met.
    """

    alpha: float
    frequency: float

    @cached_property
    def gain(self) -> float:
        """By how much the gain may rise or fall, dB, at once with any phase up to none."""
        size = min(abs(self.alpha), 1.998)  # beyond, 60 dB
        return float(np.copysign(20.0 * np.log10((2.0 + size) / (2.0 - size)), self.alpha))

    @cached_property
    def phase(self) -> float:
        """By how much the phase may turn, rad."""
        return float(2.0 * np.arctan(0.5 * self.alpha))


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
    return Margins(
        gain=tuple(zip(turns.frequency.tolist(), (-sizes).tolist())),
        phase=tuple(zip(ones.frequency.tolist(), _between(ones, behind).tolist())),
        open_gain=_open_gain(frequency, decibel, behind),
        open_phase=np.pi if ones.index.size else _open_phase(decibel, behind),
        beyond=_beyond(turns, sizes),
        crossover=_crossover(frequency, decibel, ones),
        crosses=bool((~ones.rising).any()),
    )


def is_stable(loop: Curve) -> bool:
    """Return whether a broken loop shows no instability, as `Margins.stable`."""
    turns = crossings(loop.frequency, np.angle(-loop.response), most=np.pi)
    return not turns.index.size or _beyond(turns, turns.of(loop.decibel)) <= 0


def _beyond(turns: Crossings, sizes: Real) -> int:
    """Return how often more the phase of -180 deg is passed falling than rising, left of -1."""
    left = sizes > 0.0
    return int(np.count_nonzero(left & ~turns.rising) - np.count_nonzero(left & turns.rising))


def _between(where: Crossings, angle: Real) -> Real:
    """Return an angle at crossings, the short way between neighbours, in [-pi, pi)."""
    low = angle[where.index]
    step = angle[where.index + 1] - low
    step -= 2.0 * np.pi * np.round(step / (2.0 * np.pi))
    return (low + where.share * step + np.pi) % (2.0 * np.pi) - np.pi


def _open_gain(frequency: Real, decibel: Real, behind: Real) -> float:
    """Return the gain margin at -180 deg beyond the ends of the band."""
    inner = min(_END, frequency.size - 1)
    ends = (np.array([inner, 0]), False), (np.array([-1 - inner, -1]), True)
    return min(
        _extended(np.log(frequency[two]), decibel[two], behind[two], delay=delay)
        for two, delay in ends
    )


def _extended(where: Real, decibel: Real, behind: Real, *, delay: bool) -> float:
    """Return the size of the gain where the phase is -180 deg, beyond the second of two points.

    Args:
        where: (2,) log frequency, over which the gain is straight, or stays if it would rise.
        decibel: (2,) of gain.
        behind: (2,) phase from -180 deg, rad.
        delay: the phase is straight over frequency, not over its logarithm.
    """
    turn, missing = float(behind[1] - behind[0]), float(behind[1])
    turn -= 2.0 * np.pi * round(turn / (2.0 * np.pi))
    if turn * missing > 0.0 or turn == 0.0:
        return MOST_GAIN  # it leads away
    along = np.exp(where) if delay else where
    there = along[1] - missing / turn * (along[1] - along[0])
    further = (np.log(there) if delay else there) - where[1]
    slope = min((decibel[1] - decibel[0]) / (where[1] - where[0]), 0.0)
    return abs(float(decibel[1] + slope * further))


def _open_phase(decibel: Real, behind: Real) -> float:
    if decibel[-1] > 0.0:
        return abs(float(behind[-1]))
    top = int(np.argmax(decibel))
    there = abs(float(behind[top]))
    return float(np.pi - (np.pi - there) * 10.0 ** (decibel[top] / 20.0))


def _crossover(frequency: Real, decibel: Real, ones: Crossings) -> float:
    falling = ones.frequency[~ones.rising]
    if falling.size:
        return float(falling[-1])
    nearest = -1 if decibel[-1] > 0.0 else int(np.argmax(decibel))
    return float(frequency[nearest] * 10.0 ** (decibel[nearest] / 20.0))


def disk_margin(loop: Curve, *, skew: float = 0.0) -> DiskMargin:
    """Return the disk margin of a broken loop: gain and phase changing at once.

    alpha = 1 / max|S + (skew - 1) / 2| with S = 1 / (1 + L). Seiler, Packard and Gahinet, "An
    Introduction to Disk Margins", IEEE Control Systems Magazine 40 (5), 2020, theorem 1.

    Args:
        loop: broken.
        skew: 0: gain and phase to either side alike. 1: of S. -1: of T.

    Returns:
        It, negative where the curve shows that the loop is unstable.
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
