"""Criteria of handling qualities and of stability, with their sources."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from helisim.base.errors import InputError
from helisim.base.files import read_toml
from helisim.base.settings import convert, setting
from helisim.base.units import DB_PER_NEPER, RAD_PER_DEG
from helisim.handling import figures
from helisim.handling.criterion import WHOLE, Criterion, Rating
from helisim.handling.limit import Limit
from helisim.handling.loop import PLACES, Curve, Loop, NoResponse, axis_of

__all__ = [
    "ActuatorUse",
    "AttitudeBandwidth",
    "AttitudeQuickness",
    "Coupling",
    "Criterion",
    "Crossover",
    "Damping",
    "DisturbanceRejection",
    "Limit",
    "LoadRejection",
    "PoleLimits",
    "Rating",
    "StabilityMargins",
]


Kind = TypeVar("Kind", bound=type[Criterion])

_FACTS = read_toml(Path(__file__).with_suffix(".toml"))  # class variables by class
_FACT = str | tuple[str, ...] | Mapping[str, str | tuple[str, int]]


def _with_facts(kind: Kind) -> Kind:
    """Give a criterion its name, source, units and borders, which are data."""
    for name, fact in _FACTS[kind.__name__].items():
        setattr(kind, name, convert(_FACT, fact, name))
    return kind


_NO_CROSSOVER = "the gain does not fall through one in its band"


@_with_facts
@dataclass(frozen=True, kw_only=True)
class StabilityMargins(Criterion):
    """Gain margin, dB, and phase margin, rad, to either side of a loop broken `at`."""

    at: str = setting("actuators", choices=PLACES)
    gain: Limit = Limit(6.0, 3.0)
    phase: Limit = Limit(45.0 * RAD_PER_DEG, 22.5 * RAD_PER_DEG)

    def rate(self, loop: Loop) -> Rating:
        """Return margins and crossover; see `figures.margins`."""
        found = figures.margins(loop.broken(self.axis, self.at))
        gain, phase = found.least_gain, found.least_phase
        values = {"gain_margin": gain, "phase_margin": phase, "crossover": found.crossover}
        remarks = {
            f"{_NO_CROSSOVER}: crossover is extended": not found.crosses,
            "-180 deg lies outside of the band: the gain margin is extended": (
                abs(gain) == found.open_gain
            ),
        }
        return self.rated(values, remarks=remarks)


@_with_facts
@dataclass(frozen=True, kw_only=True)
class Crossover(Criterion):
    """Highest frequency, rad/s, at which the gain of a loop, broken `at`, falls through one."""

    at: str = setting("actuators", choices=PLACES)
    frequency: Limit

    def rate(self, loop: Loop) -> Rating:
        """Return the crossover, continued beyond the band."""
        found = figures.margins(loop.broken(self.axis, self.at))
        remarks = {f"{_NO_CROSSOVER}: extended": not found.crosses}
        return self.rated({"crossover": found.crossover}, remarks=remarks)


_REJECTION = {"lat": 0.9, "lon": 0.5, "ped": 0.7, "col": 1.0}
"""rad/s, Level 1's disturbance rejection bandwidth at full scale."""


@_with_facts
@dataclass(frozen=True, kw_only=True)
class DisturbanceRejection(Criterion):
    """Disturbance rejection bandwidth (DRB), rad/s, by default the source's, and peak (DRP), dB."""

    bandwidth: Limit | None = None
    peak: Limit = Limit(5.0, 8.0)

    def _border(self, name: str) -> Limit | None:
        usual = _REJECTION[self.axis]
        return getattr(self, name) or Limit(usual, 0.5 * usual)

    def rate(self, loop: Loop) -> Rating:
        """Return DRB and DRP; see `figures.rejection`."""
        found = figures.rejection(loop.disturbance(self.axis))
        remarks = {"|S| rises through -3 dB outside of its band: DRB is extended": not found.seen}
        values = (found.bandwidth, found.peak, found.peak_frequency)
        return self.rated(dict(zip(self.units, values)), remarks=remarks)


@_with_facts
@dataclass(frozen=True, kw_only=True)
class LoadRejection(Criterion):
    """How far a slow load on the servo command of axis `by` (by default its own) turns the vehicle.

    `turned` limits the most from `low` to `high`, rad/s: dB of rad (heave: m/s) a unit of command.
    Raises InputError unless 0 < low < high and less is better, UnknownNameError of an axis.
    """

    low: float = 0.3
    high: float
    turned: Limit
    by: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "by", axis_of(self.by or self.axis).name)
        if not 0.0 < self.low < self.high:
            raise InputError(f"loads go from low to high, 0 < low < high; got {self.band} rad/s")

    @property
    def band(self) -> tuple[float, float]:
        """Band of the loads, scaled, rad/s."""
        return self.low * self.faster, self.high * self.faster

    def rate(self, loop: Loop) -> Rating:
        """Return the most that loads turn the vehicle, and the frequency."""
        seen, (low, high) = loop.turned(self.axis, self.by), self.band
        there = (seen.frequency >= low) & (seen.frequency <= high)
        if not (seen.frequency[0] <= low and high <= seen.frequency[-1] and there.any()):
            raise NoResponse(
                f"what a load on {self.by} does to {self.word} is known from "
                f"{seen.frequency[0]:g} to {seen.frequency[-1]:g} rad/s, not from {low:g} to "
                f"{high:g}"
            )
        size = np.abs(seen.response[there])
        most = int(np.argmax(size))
        turned = DB_PER_NEPER * math.log(max(float(size[most]), 1e-12))  # less turns nothing
        return self.rated({"turned": turned, "frequency": float(seen.frequency[there][most])})


TASKS = {  # task -> axis -> bandwidth, rad/s, at full scale: ADS-33E-PRF, hover and low speed
    "target_acquisition": {"lon": Limit(2.0, 1.0), "lat": Limit(2.5, 1.0), "ped": Limit(3.5, 2.0)},
    "other": {"lon": Limit(1.0, 0.5), "lat": Limit(1.0, 0.5), "ped": Limit(2.0, 0.5)},
    "other_divided": {"lon": Limit(2.0, 0.5), "lat": Limit(2.0, 0.5), "ped": Limit(2.0, 0.5)},
}


@_with_facts
@dataclass(frozen=True, kw_only=True)
class AttitudeBandwidth(Criterion):
    """Bandwidth, rad/s, and phase delay, s, of an attitude's answer to small inputs of the stick.

    `task` "other_divided" is divided attention or worse cues, as in ADS-33. `command` "attitude"
    counts the phase bandwidth, "rate" the lesser of phase and gain; None: attitude in roll and
    pitch, rate in yaw. `bandwidth` None is that of the task and axis.
    """

    task: str = setting("other", choices=TASKS)
    command: str | None = setting(None, choices=("attitude", "rate"))
    bandwidth: Limit | None = None
    delay: Limit = Limit(0.2, 0.3)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self._border("bandwidth") is None:
            raise InputError(
                f"ADS-33 has no bandwidth of {self.word}: give one as `bandwidth`, or rate "
                "roll, pitch or yaw"
            )

    def _border(self, name: str) -> Limit | None:
        return getattr(self, name) or TASKS[self.task].get(self.axis)

    def rate(self, loop: Loop) -> Rating:
        """Return bandwidths, phase delay and the frequency of -180 deg; NaN without the gain's."""
        found = figures.bandwidth(loop.command(self.axis))
        attitude = (self.command or ("rate" if self.axis == "ped" else "attitude")) == "attitude"
        counted = found.phase if attitude else found.rate
        gain = found.gain if found.falls else math.nan
        values = (counted, found.delay, found.phase, gain, found.neutral)
        remarks = {
            "the response ends before all is seen: what is missing was continued": (
                not found.complete
            ),
            "the gain's bandwidth is below the phase's: look for oscillations": (
                attitude and gain < found.phase
            ),
        }
        return self.rated(dict(zip(self.units, values)), remarks=remarks)


_QUICKNESS = {
    "lon": (
        (5.0, 10.0, 15.0, 20.0, 25.0, 30.0),
        (1.60, 1.41, 1.24, 1.12, 1.02, 0.95),
        (0.42, 0.40, 0.386, 0.376, 0.357, 0.344),
    ),
    "lat": (
        (10.0, 15.0, 20.0, 30.0, 38.0, 50.0),
        (2.41, 2.17, 1.95, 1.50, 1.30, 1.01),
        (1.61, 1.54, 1.48, 1.36, 1.265, 1.00),
    ),
    "ped": (
        (10.0, 20.0, 30.0, 40.0, 50.0, 60.0),
        (1.76, 1.51, 1.25, 1.17, 1.095, 1.02),
        (0.595, 0.564, 0.533, 0.497, 0.466, 0.425),
    ),
}
"""Axis -> least change of attitude, deg, and borders of quickness there, 1/s, at full scale."""


@_with_facts
@dataclass(frozen=True, kw_only=True)
class AttitudeQuickness(Criterion):
    """Peak rate over peak change of an attitude, by a step of the stick or a pulse.

    `change`, rad, is less if the whole stick, `size`, unitised (0.5: all to one side), doesn't
    reach it; of a rating's criterion the least change after the peak, where levels are read.
    `duration`, s at full scale, is looked at.
    """

    change: float = setting(20.0 * RAD_PER_DEG, above=0.0)
    size: float = setting(0.5, above=0.0)
    duration: float = setting(5.0, above=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.axis not in _QUICKNESS:
            raise InputError(f"ADS-33 has no quickness of {self.word}: rate roll, pitch or yaw")

    def _border(self, name: str) -> Limit:
        along, *levels = _QUICKNESS[self.axis]
        return Limit(*(float(np.interp(self.change / RAD_PER_DEG, along, one)) for one in levels))

    def rate(self, loop: Loop) -> Rating:
        """Return the quickness, with the least and peak change of attitude."""
        seen = loop.step(self.axis, size=self.size, duration=self.duration / self.faster)
        one = axis_of(self.axis)
        angle, rate = (seen.signals.get(name or "") for name in (one.angle, one.rate))
        if angle is None or rate is None:
            raise NoResponse(f"a step of {self.axis} shows no {one.angle} and {one.rate}")
        found = figures.changed(seen.time, angle, rate, change=self.change)
        values = {"quickness": found.ratio, "least": found.least, "peak": found.peak}
        return replace(self, change=max(found.least, 1e-6)).rated(values)


@_with_facts
@dataclass(frozen=True, kw_only=True)
class Coupling(Criterion):
    """Peak of attitude `onto` within `after`, s at full scale, over the commanded attitude then.

    By a step of the stick of `axis`, of `size`, unitised.
    """

    onto: str = ""
    size: float = setting(0.1, above=0.0)
    after: float = setting(4.0, above=0.0)
    ratio: Limit = Limit(0.25, 0.60)

    def __post_init__(self) -> None:
        super().__post_init__()
        usual = {"lat": "lon", "lon": "lat"}.get(self.axis)
        other = axis_of(self.onto).name if self.onto else usual
        if other is None or other == self.axis:
            raise InputError(f"coupling of {self.word} onto what? give another axis as `onto`")
        object.__setattr__(self, "onto", other)

    def rate(self, loop: Loop) -> Rating:
        """Return the ratio."""
        after = self.after / self.faster
        seen = loop.step(self.axis, size=self.size, duration=after)
        own, other = axis_of(self.axis).angle, axis_of(self.onto).angle
        if own not in seen.signals or other not in seen.signals:
            raise NoResponse(f"a step of {self.axis} shows no {own} and {other}")
        found = figures.coupling(seen.time, seen.signals[own], seen.signals[other], after=after)
        return self.rated({"ratio": found})


@_with_facts
@dataclass(frozen=True, kw_only=True)
class Damping(Criterion):
    """Damping ratio of the loop's least damped pole from `low` to `high`, rad/s at full scale."""

    axis: str = WHOLE
    low: float = setting(0.5, low=0.0)
    high: float = setting(50.0, above=0.0)
    ratio: Limit = Limit(0.35, 0.19)

    def rate(self, loop: Loop) -> Rating:
        """Return the pole's damping ratio and natural frequency."""
        return self.rated(
            figures.least_damped(
                loop.poles, low=self.low * self.faster, high=self.high * self.faster
            )._asdict()
        )


@_with_facts
@dataclass(frozen=True, kw_only=True)
class PoleLimits(Criterion):
    """The greatest real part of the whole loop's poles, `growth`, 1/s; 0.05: doubled in 14 s."""

    axis: str = WHOLE
    growth: Limit = Limit(1e-3, 0.05)

    def rate(self, loop: Loop) -> Rating:
        """Return the greatest real part."""
        return self.rated({"growth": float(loop.poles.real.max(initial=-1e9))})


@_with_facts
@dataclass(frozen=True, kw_only=True)
class ActuatorUse(Criterion):
    """Rms of an actuator's position over its travel, of its rate over its limit, in a disturbance.

    That of attitude is white noise of `rms`, rad, behind two equal lags at `corner`, rad/s at full
    scale. What of it lies from there to `high`, rad/s at any scale, counts: about where servos end,
    as the rate's rms grows with a law's band without end. `travel` to either side and `rate_limit`,
    a second, are unitised.
    """

    rms: float = setting(1.0 * RAD_PER_DEG, above=0.0)
    corner: float = setting(1.0, above=0.0)
    high: float = setting(100.0, above=0.0)
    travel: float = setting(0.5, above=0.0)
    rate_limit: float = setting(above=0.0)
    position: Limit = Limit(1.0 / 3.0, 1.0)
    rate_share: Limit = Limit(1.0 / 3.0, 1.0)

    def rate(self, loop: Loop) -> Rating:
        """Return rms of position and rate, over their limits."""
        low = self.corner * self.faster
        band = np.geomspace(low, max(self.high, 2.0 * low), 400)
        moved = Curve(band, loop.actuator(self.axis, by="disturbance").at(band))
        position, rate = figures.motion(moved, rms=self.rms, corner=low)
        return self.rated({"position": position / self.travel, "rate": rate / self.rate_limit})
