"""Criteria of handling qualities and of stability: what is asked of a loop, by which source.

A criterion asks a `Loop` for the responses that it needs, computes its `figures` and says which
level they are and how far from the border of Level 1. An own one derives from `Criterion`.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from helisim.base.errors import InputError
from helisim.base.settings import FrozenMap, setting
from helisim.base.units import DB_PER_NEPER, RAD_PER_DEG
from helisim.handling import figures
from helisim.handling.chart import (
    Border,
    Chart,
    ChartAxis,
    ChartLine,
    Level,
    Limit,
    Region,
    beyond,
    box,
)
from helisim.handling.criterion import WHOLE, Criterion, Rating
from helisim.handling.loop import Loop, NoResponse, axis_of

__all__ = [
    "ActuatorOnset",
    "ActuatorUse",
    "AttitudeBandwidth",
    "AttitudeHold",
    "AttitudeQuickness",
    "Border",
    "Coupling",
    "Criterion",
    "Crossover",
    "CrossoverOrder",
    "Damping",
    "DiskMargin",
    "DisturbanceRejection",
    "Limit",
    "LoadRejection",
    "NicholsExclusion",
    "PoleLimits",
    "Rating",
    "StabilityMargins",
]

PEAK = Limit(5.0, 8.0)
"""dB, of disturbance rejection."""


@dataclass(frozen=True, kw_only=True)
class StabilityMargins(Criterion):
    """Gain and phase margin of a broken loop, all others closed.

    Attributes:
        at: where the loop is cut, as in `Loop.broken`.
        gain: dB, of the margin of gain to either side.
        phase: rad, of the margin of phase to either side.
    """

    at: str = "actuators"
    gain: Limit = Limit(6.0, 3.0)
    phase: Limit = Limit(45.0 * RAD_PER_DEG, 22.5 * RAD_PER_DEG)

    name = "stability_margins"
    source = (
        "MIL-DTL-9490E, 3.1.3.6.1, and SAE AS94900: 6 dB and 45 deg below the first "
        "aeroelastic mode; that half of it ends Level 2 is a choice of ours"
    )
    angles = ("phase",)
    units = FrozenMap({"gain_margin": "dB", "phase_margin": "rad", "crossover": "rad/s"})
    borders = FrozenMap({"gain_margin": ("gain", 0), "phase_margin": ("phase", 0)})

    def rate(self, loop: Loop) -> Rating:
        """Return margins and crossover; see `figures.margins`."""
        found = figures.margins(loop.broken(self.axis, self.at))
        gain, phase = found.least_gain, found.least_phase
        remarks = []
        if not found.crosses:
            remarks.append("the gain does not fall through one in its band: crossover is extended")
        if abs(gain) == found.open_gain:
            remarks.append("-180 deg lies outside of the band: the gain margin is extended")
        values = {"gain_margin": gain, "phase_margin": phase, "crossover": found.crossover}
        return self.rated(values, remark="; ".join(remarks))

    def _axes(self) -> tuple[Any, ...]:
        return (
            f"Stability margins, {self.word}, cut at {self.at}",
            ChartAxis("gain_margin", "gain margin", "dB", 0.0, 20.0),
            ChartAxis("phase_margin", "phase margin", "rad", 0.0, np.pi / 2.0),
        )


@dataclass(frozen=True, kw_only=True)
class NicholsExclusion(Criterion):
    """How far a broken loop stays from -1 in gain and phase at once.

    Attributes:
        at: where the loop is cut, as in `Loop.broken`.
        gain: dB, half the height of Level 1's zone.
        phase: rad, half its width.
        shape: "hexagon" (its upright sides half as high as its tips) or "ellipse".
        size: of the zone that the loop touches, over that of Level 1's.
    """

    at: str = "actuators"
    gain: float = setting(6.0, above=0.0)
    phase: float = setting(45.0 * RAD_PER_DEG, above=0.0)
    shape: str = setting("hexagon", choices=("hexagon", "ellipse"))
    size: Limit = Limit(1.0, 0.5)

    name = "nichols_exclusion"
    source = (
        "the zone is made of the margins of SAE AS94900, 6 dB and 45 deg; its shape after the "
        "exclusion zones of Fielding, Varga, Bennani and Selier (eds.), Advanced Techniques for "
        "Clearance of Flight Control Laws, Springer, 2002, and half of it ends Level 2, both a "
        "choice of ours"
    )
    angles = ("phase",)
    units = FrozenMap({"size": "", "frequency": "rad/s"})
    borders = FrozenMap({"size": ("size", 0)})

    @property
    def gauge(self) -> figures.Gauge:
        """The zone; see `figures.hexagon`."""
        made = figures.hexagon if self.shape == "hexagon" else figures.ellipse
        return made(self.gain, self.phase)

    def rate(self, loop: Loop) -> Rating:
        """Return the zone that the loop touches, and where it does."""
        found = figures.approach(loop.broken(self.axis, self.at), self.gauge)
        return self.rated({"size": found.size, "frequency": found.frequency})

    def chart(self) -> Chart:
        """Return the zones of Levels 1 and 2 on a Nichols chart."""
        across = ChartAxis("", "phase", "rad", -2.0 * np.pi, 0.0)
        up = ChartAxis("", "gain", "dB", -30.0, 30.0)
        turn = np.linspace(0.0, 2.0 * np.pi, 73)[:-1]
        x, y = np.sin(turn), np.cos(turn)
        if self.shape == "hexagon":
            x, y = np.array([[0.0, 1, 1, 0, -1, -1], [1.0, 0.5, -0.5, -1, -0.5, 0.5]])
        levels: tuple[tuple[Level, float], ...] = ((2, self.size.level1), (3, self.size.level2))
        zones = [
            Region(level, -np.pi + size * self.phase * x, size * self.gain * y)
            for level, size in levels
        ]
        title = f"Nichols exclusion zone, {self.word}, cut at {self.at}"
        return Chart(title, across, up, (_EVERYWHERE, *zones), source=self.source)


_EVERYWHERE = box(1, -np.inf, np.inf, -np.inf, np.inf)
"""The whole chart; another region on it holds where it is worse."""


@dataclass(frozen=True, kw_only=True)
class DiskMargin(Criterion):
    """Gain and phase changing at once: the disk margin of a broken loop.

    Attributes:
        at: where the loop is cut, as in `Loop.broken`.
        skew: 0: changes to either side alike; see `figures.disk_margin`.
        alpha: size of the disk; 0.5 allows 4.4 dB, or 28 deg.
    """

    at: str = "actuators"
    skew: float = 0.0
    alpha: Limit = Limit(0.5, 0.25)

    name = "disk_margin"
    source = (
        "Seiler, Packard and Gahinet, An Introduction to Disk Margins, IEEE Control Systems "
        "Magazine 40 (5), 2020; the borders are a choice of ours"
    )
    units = FrozenMap({"alpha": "", "gain": "dB", "phase": "rad", "frequency": "rad/s"})
    borders = FrozenMap({"alpha": ("alpha", 0)})

    def rate(self, loop: Loop) -> Rating:
        """Return the disk, what it allows of gain and of phase alone, and where it is met."""
        found = figures.disk_margin(loop.broken(self.axis, self.at), skew=self.skew)
        return self.rated({name: getattr(found, name) for name in self.units})

    def _axes(self) -> tuple[Any, ...]:
        axis = ChartAxis("alpha", "disk margin", "", 0.0, 2.0)
        return f"Disk margin, {self.word}, cut at {self.at}", axis


@dataclass(frozen=True, kw_only=True)
class Crossover(Criterion):
    """The highest frequency at which the gain of a broken loop falls through one.

    Attributes:
        at: where the loop is cut, as in `Loop.broken`.
        frequency: rad/s. Level 1 above Level 2 asks for a fast loop; below it, for one that
            doesn't pay for speed, as an objective does.
    """

    at: str = "actuators"
    frequency: Limit

    name = "crossover"
    source = (
        "Tischler, Berger, Ivler, Mansur, Cheung and Soong, Practical Methods for Aircraft and "
        "Rotorcraft Flight Control Design, AIAA, 2017; the borders are the user's"
    )
    units = FrozenMap({"crossover": "rad/s"})
    borders = FrozenMap({"crossover": ("frequency", 1)})

    def rate(self, loop: Loop) -> Rating:
        """Return the crossover, continued beyond the band."""
        found = figures.margins(loop.broken(self.axis, self.at))
        remark = "" if found.crosses else "the gain does not fall through one in its band: extended"
        return self.rated({"crossover": found.crossover}, remark=remark)

    def _axes(self) -> tuple[Any, ...]:
        limit = self.frequency.scaled(self.faster)
        top = 2.0 * max(limit.level1, limit.level2)
        axis = ChartAxis("crossover", "crossover frequency", "rad/s", 0.0, top)
        return f"Crossover, {self.word}, cut at {self.at}", axis


@dataclass(frozen=True, kw_only=True)
class CrossoverOrder(Criterion):
    """How near a broken loop is to K/s around its crossover.

    Attributes:
        at: where the loop is cut, as in `Loop.broken`.
        span: the line is fitted from crossover / span to crossover * span.
        departure: of the order from 1, to either side.
    """

    at: str = "actuators"
    span: float = setting(2.0, above=1.0)
    departure: Limit = Limit(0.5, 1.0)

    name = "crossover_order"
    source = (
        "McRuer and Jex, A Review of Quasi-Linear Pilot Models, IEEE Transactions on Human "
        "Factors in Electronics 8 (3), 1967: K/s about crossover; the borders are a choice of ours"
    )
    units = FrozenMap({"order": "", "departure": "", "crossover": "rad/s"})
    borders = FrozenMap({"departure": ("departure", 0)})

    def rate(self, loop: Loop) -> Rating:
        """Return the slope over -20 dB a decade, and how far it is from 1."""
        broken = loop.broken(self.axis, self.at)
        middle = figures.margins(broken).crossover
        order = figures.slope_order(broken, middle, span=self.span)
        return self.rated({"order": order, "departure": abs(order - 1.0), "crossover": middle})

    def _axes(self) -> tuple[Any, ...]:
        axis = ChartAxis("departure", "departure of the order from 1", "", 0.0, 2.0)
        return f"Slope at crossover, {self.word}, cut at {self.at}", axis


@dataclass(frozen=True, kw_only=True)
class DisturbanceRejection(Criterion):
    """How fast a disturbance of attitude is brought back, and how much is amplified.

    Attributes:
        bandwidth: rad/s, of DRB; None: of the axis, by the source.
        peak: dB, of DRP.
    """

    bandwidth: Limit | None = None
    peak: Limit = PEAK

    name = "disturbance_rejection"
    source = (
        "Berger, Ivler, Berrios, Tischler and Miller, Disturbance Rejection Handling-Qualities "
        "Criteria for Rotorcraft, 72nd Annual Forum of the AHS, 2016, and Blanken, Tischler, "
        "Lusardi and Ivler, AHS Rotorcraft Handling Qualities Technical Meeting, 2014: roll 0.9, "
        "pitch 0.5, yaw 0.7, heave 1.0 rad/s, 5 dB; where Level 2 ends is a choice of ours"
    )
    units = FrozenMap({"drb": "rad/s", "drp": "dB", "peak_frequency": "rad/s"})
    borders = FrozenMap({"drb": ("bandwidth", 1), "drp": ("peak", 0)})
    better = FrozenMap({"bandwidth": "more"})

    def _border(self, name: str) -> Limit | Border | None:
        usual = {"lat": 0.9, "lon": 0.5, "ped": 0.7, "col": 1.0}[self.axis]
        return getattr(self, name) or Limit(usual, 0.5 * usual)

    def rate(self, loop: Loop) -> Rating:
        """Return DRB and DRP; see `figures.rejection`."""
        found = figures.rejection(loop.disturbance(self.axis))
        remark = "|S| rises through -3 dB outside of its band: DRB is extended"
        values = (found.bandwidth, found.peak, found.peak_frequency)
        return self.rated(dict(zip(self.units, values)), remark="" if found.seen else remark)

    def _axes(self) -> tuple[Any, ...]:
        words, limit = "disturbance rejection", self.limits["drb"]
        assert isinstance(limit, Limit)
        return (
            f"Disturbance rejection, {self.word}",
            ChartAxis("drb", f"{words} bandwidth", "rad/s", 0.0, 4.0 * limit.level1),
            ChartAxis("drp", f"{words} peak", "dB", 0.0, 10.0),
        )


@dataclass(frozen=True, kw_only=True)
class LoadRejection(Criterion):
    """How far a slow load turns the vehicle: a disturbance that is added to a servo command.

    Disturbance rejection bandwidth says where the loop begins to reject, not how much it does: a
    loop whose gain stays near one for a decade has a high bandwidth, and gives way to gusts.

    Attributes:
        low: rad/s, of the slowest load.
        high: rad/s, of the fastest.
        turned: dB of rad, or in heave of m/s, a unit of command: the most that is turned.
        by: axis whose command is disturbed; its own where it is empty. A rotor turns what is done
            to one axis into another.

    Raises:
        InputError: not 0 < low < high, or Level 1 ends above Level 2.
        UnknownNameError: there is no such axis.
    """

    low: float = 0.3
    high: float
    turned: Limit
    by: str = ""

    name = "load_rejection"
    source = (
        "The closed loop's compliance, angle over load, as of any servomechanism; borders are the "
        "user's, such as what the law before gives way"
    )
    units = FrozenMap({"turned": "dB", "frequency": "rad/s"})
    borders = FrozenMap({"turned": ("turned", 0)})
    better = FrozenMap({"turned": "less"})

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "by", axis_of(self.by or self.axis).name)
        if not 0.0 < self.low < self.high:
            raise InputError(f"loads go from low to high, 0 < low < high; got {self.band} rad/s")

    @property
    def band(self) -> tuple[float, float]:
        """Of the loads, scaled, rad/s."""
        return self.low * self.faster, self.high * self.faster

    def rate(self, loop: Loop) -> Rating:
        """Return the most that loads turn the vehicle, and at which frequency."""
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

    def _axes(self) -> tuple[Any, ...]:
        label = f"angle a unit of command on {axis_of(self.by).word}"
        ends = self.turned.level1 - 20.0, self.turned.level2 + 10.0
        return f"Loads, {self.word}", ChartAxis("turned", label, "dB", *ends)


TASKS = {
    "target_acquisition": {"lon": Limit(2.0, 1.0), "lat": Limit(2.5, 1.0), "ped": Limit(3.5, 2.0)},
    "other": {"lon": Limit(1.0, 0.5), "lat": Limit(1.0, 0.5), "ped": Limit(2.0, 0.5)},
    "other_divided": {"lon": Limit(2.0, 0.5), "lat": Limit(2.0, 0.5), "ped": Limit(2.0, 0.5)},
}
"""Task -> axis -> bandwidth, rad/s, of a full-scale helicopter in hover and at low speed:
target acquisition and tracking; all others with full attention and a usable cue environment of 1;
all others with divided attention or worse cues."""


@dataclass(frozen=True, kw_only=True)
class AttitudeBandwidth(Criterion):
    """How quickly an attitude follows small inputs of the stick, and how its lag goes on growing.

    Attributes:
        task: "target_acquisition", "other" or "other_divided", as in ADS-33.
        command: what the stick commands: "attitude" counts the bandwidth of phase alone, "rate"
            the lesser of those of phase and gain. None: attitude in roll and pitch, rate in yaw.
        bandwidth: rad/s; None: of the task and axis.
        delay: s, of phase delay.
        fit: phase delay by least squares, as the standard asks if phase isn't straight.
        sign: -1 if the angle answers a positive stick by falling.
    """

    task: str = setting("other", choices=TASKS)
    command: str | None = setting(None, choices=("attitude", "rate"))
    bandwidth: Limit | None = None
    delay: Limit = Limit(0.2, 0.3)
    fit: bool = False
    sign: int = setting(1, choices=(1, -1))

    name = "attitude_bandwidth"
    source = (
        "ADS-33E-PRF, 3.3.2.1 and 3.3.5.1, hover and low speed: least bandwidth "
        "at small phase delay. The figures' borders lean to more bandwidth as phase delay grows; "
        "here a phase delay of its own ends the levels, a choice of ours"
    )
    units = FrozenMap(
        {
            "bandwidth": "rad/s",
            "phase_delay": "s",
            "phase_bandwidth": "rad/s",
            "gain_bandwidth": "rad/s",
            "neutral": "rad/s",
        }
    )
    borders = FrozenMap({"bandwidth": ("bandwidth", 1), "phase_delay": ("delay", -1)})
    better = FrozenMap({"bandwidth": "more"})

    def __post_init__(self) -> None:
        super().__post_init__()
        if self._border("bandwidth") is None:
            raise InputError(
                f"ADS-33 has no bandwidth of {self.word}: give one as `bandwidth`, or rate "
                "roll, pitch or yaw"
            )

    def _border(self, name: str) -> Limit | Border | None:
        return getattr(self, name) or TASKS[self.task].get(self.axis)

    def rate(self, loop: Loop) -> Rating:
        """Return bandwidths, phase delay and the frequency of -180 deg."""
        found = figures.bandwidth(loop.command(self.axis), fit=self.fit, sign=self.sign)
        attitude = (self.command or ("rate" if self.axis == "ped" else "attitude")) == "attitude"
        counted = found.phase if attitude else found.rate
        remarks = []
        if not found.complete:
            remarks.append("the response ends before all is seen: what is missing was continued")
        if attitude and found.gain < found.phase:
            remarks.append("the gain's bandwidth is below the phase's: look for oscillations")
        values = (counted, found.delay, found.phase, found.gain, found.neutral)
        return self.rated(dict(zip(self.units, values)), remark="; ".join(remarks))

    def _axes(self) -> tuple[Any, ...]:
        least, most = self.limits["bandwidth"], self.limits["phase_delay"]
        assert isinstance(least, Limit)
        assert isinstance(most, Limit)
        return (
            f"Bandwidth, {self.word}, {self.task.replace('_', ' ')}",
            ChartAxis("bandwidth", "bandwidth", "rad/s", 0.0, 3.0 * least.level1),
            ChartAxis("phase_delay", "phase delay", "s", 0.0, 1.5 * most.level2),
        )


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
"""Axis -> least change of attitude, degree, and the borders of quickness along it, 1/s, of a
full-scale helicopter."""


@dataclass(frozen=True, kw_only=True)
class AttitudeQuickness(Criterion):
    """The peak rate over the peak change of an attitude, by a step of the stick or a pulse.

    Attributes:
        change: rad, of attitude; less if all of the stick doesn't reach it.
        size: unitised stick: 0.5 is all of it to one side.
        duration: s, that is looked at, of a full-scale helicopter.
        border: quickness along the least change after the peak; None: of the axis.
    """

    change: float = setting(20.0 * RAD_PER_DEG, above=0.0)
    size: float = setting(0.5, above=0.0)
    duration: float = setting(5.0, above=0.0)
    border: Border | None = None

    name = "attitude_quickness"
    source = (
        "ADS-33E-PRF, 3.3.3 and 3.3.6, hover and low speed; the figures' borders as digitised by "
        "Prencipe, MSc thesis, Delft University of Technology (github.com/YPrencipe/CCHThesis: "
        "qpitchhq1, prollhq1, ryawhq1 and 2), to about 0.02 1/s"
    )
    angles = ("change",)
    units = FrozenMap({"quickness": "1/s", "least": "rad", "peak": "rad"})
    borders = FrozenMap({"quickness": ("border", 1)})

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.border is None and self.axis not in _QUICKNESS:
            raise InputError(
                f"ADS-33 has no quickness of {self.word}: give a border, or rate roll, pitch or yaw"
            )

    def _border(self, name: str) -> Limit | Border | None:
        if self.border is not None:
            return self.border
        along, one, two = _QUICKNESS[self.axis]
        return Border(tuple(angle * RAD_PER_DEG for angle in along), one, two)

    def rate(self, loop: Loop) -> Rating:
        """Return the quickness, and the changes of attitude that it is of."""
        seen = loop.step(self.axis, size=self.size, duration=self.duration / self.faster)
        one = axis_of(self.axis)
        angle, rate = (seen.signals.get(name or "") for name in (one.angle, one.rate))
        if angle is None or rate is None:
            raise NoResponse(f"a step of {self.axis} shows no {one.angle} and {one.rate}")
        found = figures.changed(seen.time, angle, rate, change=self.change)
        values = {"quickness": found.ratio, "least": found.least, "peak": found.peak}
        return self.rated(values, along=found.least)

    def _axes(self) -> tuple[Any, ...]:
        border = self.limits["quickness"]
        assert isinstance(border, Border)
        return (
            f"Attitude quickness, {self.word}",
            ChartAxis("least", "least change of attitude", "rad", 0.0, border.along[-1]),
            ChartAxis("quickness", "quickness", "1/s", 0.0, 2.0 * max(border.level1)),
        )


@dataclass(frozen=True, kw_only=True)
class AttitudeHold(Criterion):
    """The time after which a disturbed attitude stays within a share of the disturbance.

    Attributes:
        share: of the disturbance, such as 0.1.
        time: s.
    """

    share: float = setting(0.1, above=0.0, below=1.0)
    time: Limit = Limit(10.0, 20.0)

    name = "attitude_hold"
    source = (
        "ADS-33E-PRF, 3.2.7: back within 10 percent of the peak in 20 s, or in 10 s where cues "
        "are poor, after a pulse into the actuator. Here after a step of the attitude's "
        "disturbance, which has the same modes; that 20 s ends Level 2 is a choice of ours"
    )
    units = FrozenMap({"time": "s"})
    borders = FrozenMap({"time": ("time", -1)})

    @property
    def _longest(self) -> float:
        limit = self.time.scaled(1.0 / self.faster)
        return 1.5 * max(limit.level1, limit.level2)

    def rate(self, loop: Loop) -> Rating:
        """Return the time; see `figures.held`."""
        seen = loop.disturbance(self.axis)
        return self.rated({"time": figures.held(seen, share=self.share, longest=self._longest)})

    def _axes(self) -> tuple[Any, ...]:
        axis = ChartAxis("time", f"time to within {self.share:.0%}", "s", 0.0, self._longest)
        return f"Attitude hold, {self.word}", axis


@dataclass(frozen=True, kw_only=True)
class Coupling(Criterion):
    """What a step of one stick does to another attitude.

    Attributes:
        axis: whose stick.
        onto: the other axis.
        size: unitised stick.
        after: s, of a full-scale helicopter.
        ratio: peak of the other attitude within that time over the commanded one at its end.
    """

    onto: str = ""
    size: float = setting(0.1, above=0.0)
    after: float = setting(4.0, above=0.0)
    ratio: Limit = Limit(0.25, 0.60)

    name = "coupling"
    source = (
        "ADS-33E-PRF, 3.3.9.2: pitch due to roll and roll due to pitch, 0.25 and 0.60 within 4 s"
    )
    units = FrozenMap({"ratio": ""})
    borders = FrozenMap({"ratio": ("ratio", 0)})

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

    def _axes(self) -> tuple[Any, ...]:
        other = axis_of(self.onto).word
        axis = ChartAxis("ratio", f"{other} over {self.word}", "", 0.0, 1.0)
        return f"Coupling of {self.word} onto {other}", axis


@dataclass(frozen=True, kw_only=True)
class Damping(Criterion):
    """The damping ratio of the least damped pole within a band of natural frequencies.

    Attributes:
        axis: "all": it is of the whole loop, whatever stands here.
        low: rad/s, of the band, of a full-scale helicopter.
        high: rad/s, likewise.
        ratio: its borders.
    """

    axis: str = WHOLE
    low: float = setting(0.5, low=0.0)
    high: float = setting(50.0, above=0.0)
    ratio: Limit = Limit(0.35, 0.19)

    name = "damping"
    source = (
        "ADS-33E-PRF, 3.3.2.3 and 3.3.5.2, mid-term response: 0.35 of all oscillations above "
        "0.5 rad/s, 0.19 for Level 1 in yaw; that the latter ends Level 2 is a choice of ours"
    )
    units = FrozenMap({"damping": "", "frequency": "rad/s"})
    borders = FrozenMap({"damping": ("ratio", 0)})

    def rate(self, loop: Loop) -> Rating:
        """Return the damping ratio and the natural frequency of the pole."""
        band = {"low": self.low * self.faster, "high": self.high * self.faster}
        return self.rated(figures.least_damped(loop.poles, **band)._asdict())

    def _axes(self) -> tuple[Any, ...]:
        return f"Damping, {self.word}", ChartAxis("damping", "damping ratio", "", -0.2, 1.0)


@dataclass(frozen=True, kw_only=True)
class PoleLimits(Criterion):
    """How far right, and if asked how far out, the poles may lie.

    Attributes:
        axis: "all": it is of the whole loop, whatever stands here.
        low: rad/s, of natural frequencies that count, of a full-scale helicopter: what is slower
            is left to the pilot or to an outer loop.
        growth: 1/s, of the real part: integrals stand at 0, but for rounding; a double amplitude
            in 14 s ends Level 2.
        fastest: rad/s, of the natural frequency; None: no limit. Of the law's sampling, so not
            scaled.
    """

    axis: str = WHOLE
    low: float = setting(0.0, low=0.0)
    growth: Limit = Limit(1e-3, 0.05)
    fastest: Limit | None = None

    name = "pole_limits"
    source = (
        "a stable loop: ADS-33E-PRF, 3.3.2.3, and MIL-DTL-9490E; the borders are a choice of ours"
    )
    units = FrozenMap({"growth": "1/s", "fastest": "rad/s"})
    borders = FrozenMap({"growth": ("growth", 1), "fastest": ("fastest", 0)})

    def rate(self, loop: Loop) -> Rating:
        """Return the greatest real part and the highest natural frequency."""
        poles = loop.poles
        growth = figures.slowest(poles, low=self.low * self.faster)
        return self.rated({"growth": growth, "fastest": float(np.abs(poles).max(initial=0.0))})

    def _axes(self) -> tuple[Any, ...]:
        axis = ChartAxis("growth", "greatest real part of a pole", "1/s", -2.0, 1.0)
        return f"Poles, {self.word}", axis


_EXCESS = np.concatenate([[1.0], np.geomspace(1.05, 40.0, 60)])
_LIMITED = -1.0 / figures.limited(_EXCESS)
_PHASE = np.maximum.accumulate(np.angle(-_LIMITED))
_GAIN = np.maximum.accumulate(20.0 * np.log10(np.abs(_LIMITED)))


@dataclass(frozen=True, kw_only=True)
class ActuatorOnset(Criterion):
    """The open loop onset point: how the loop stands where a stick meets the actuator's rate limit.

    Attributes:
        amplitude: of the stick, unitised: 0.5 is all of it.
        rate_limit: of the servo's command, unitised, a second.
        margin: dB, by which the point is below the border.
    """

    amplitude: float = setting(0.5, above=0.0)
    rate_limit: float = setting(above=0.0)
    margin: Limit = Limit(0.0, -6.0)

    name = "actuator_onset"
    source = (
        "Duda, Prediction of Pilot-in-the-Loop Oscillations Due to Rate Saturation, Journal of "
        "Guidance, Control, and Dynamics 20 (3), 1997, of the point. The border is where the rate "
        "limit's describing function, -1/N, could hold an oscillation; the paper's own border "
        "could not be read. That 6 dB above ends Level 2 is a choice of ours"
    )
    units = FrozenMap({"margin": "dB", "frequency": "rad/s", "phase": "rad", "gain": "dB"})
    borders = FrozenMap({"margin": ("margin", 0)})

    def rate(self, loop: Loop) -> Rating:
        """Return the point, and how far it is below the border."""
        limits = {"amplitude": self.amplitude, "rate_limit": self.rate_limit}
        found = figures.onset(loop.broken(self.axis), loop.actuator(self.axis), **limits)
        below = float(np.interp(found.phase, _PHASE, _GAIN)) - found.gain
        remark = "" if found.reached else "the rate limit is not met: the worst frequency counts"
        values = (below, found.frequency, found.phase - np.pi, found.gain)
        return self.rated(dict(zip(self.units, values)), remark=remark)

    def chart(self) -> Chart:
        """Return the border on a Nichols chart."""
        across = ChartAxis("phase", "phase", "rad", -np.pi, -0.5 * np.pi)
        up = ChartAxis("gain", "gain", "dB", -20.0, 20.0)
        x = np.concatenate([[-2.0 * np.pi], _PHASE - np.pi, [0.0]])
        ends = [_GAIN - limit for limit in (self.margin.level1, self.margin.level2)]
        lines = [ChartLine(x, np.concatenate([y[:1], y, y[-1:]])) for y in ends]
        levels = [beyond(level, x, one.up, np.inf) for level, one in zip((2, 3), lines)]
        title = f"Open loop onset point, {self.word}"
        return Chart(title, across, up, (_EVERYWHERE, *levels), tuple(lines), self.source)


@dataclass(frozen=True, kw_only=True)
class ActuatorUse(Criterion):
    """How much of its travel and of its rate an actuator uses while attitude is disturbed.

    Attributes:
        rms: rad, of the disturbance: white noise behind two equal lags.
        corner: rad/s, of the lags, of a full-scale helicopter.
        travel: of the servo's command to either side, unitised.
        rate_limit: of the servo's command, unitised, a second.
        position: rms of position over travel: at a third the limit is met at three deviations.
        rate_share: rms of rate over rate limit, likewise.
    """

    rms: float = setting(1.0 * RAD_PER_DEG, above=0.0)
    corner: float = setting(1.0, above=0.0)
    travel: float = setting(0.5, above=0.0)
    rate_limit: float = setting(above=0.0)
    position: Limit = Limit(1.0 / 3.0, 1.0)
    rate_share: Limit = Limit(1.0 / 3.0, 1.0)

    name = "actuator_use"
    source = (
        "rms of actuator position and rate in a disturbance, as CONDUIT's objectives; Tischler, "
        "Berger, Ivler, Mansur, Cheung and Soong, Practical Methods for Aircraft and Rotorcraft "
        "Flight Control Design, AIAA, 2017; disturbance and borders are a choice of ours"
    )
    angles = ("rms",)
    units = FrozenMap({"position": "", "rate": ""})
    borders = FrozenMap({"position": ("position", 0), "rate": ("rate_share", 0)})

    def rate(self, loop: Loop) -> Rating:
        """Return rms of position and rate, over their limits, within the response's band."""
        moved = loop.actuator(self.axis, by="disturbance")
        position, rate = figures.motion(moved, rms=self.rms, corner=self.corner * self.faster)
        return self.rated({"position": position / self.travel, "rate": rate / self.rate_limit})

    def _axes(self) -> tuple[Any, ...]:
        return (
            f"Actuator use, {self.word}",
            ChartAxis("position", "rms of position over travel", "", 0.0, 1.0),
            ChartAxis("rate", "rms of rate over its limit", "", 0.0, 1.0),
        )
