"""What phase margin costs in disturbance rejection: one axis, as a curve."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from helisim.base.units import RAD_PER_DEG
from helisim.base.value import Value
from helisim.design.descent import Goal, Point, Trial, Vector, descend
from helisim.design.guarded import distance
from helisim.design.problem import Problem, slowest
from helisim.handling.criteria import PEAK, DisturbanceRejection, StabilityMargins
from helisim.handling.figures import margins, rejection
from helisim.handling.loop import Loop, NoResponse, axis_of
from helisim.handling.spec import Spec

_POINTS = 6
_LOWEST, _BEYOND = 30.0, 25.0
"""degree: the least phase margin that is kept, and how far beyond the design's the most is."""
_LEAST_GAIN = 6.0
"""dB, kept at every point."""
_GAIN_UNIT, _PHASE_UNIT = 3.0, 22.5 * RAD_PER_DEG
"""dB and rad, that count as one unit of distance: those between Levels 1 and 2."""
_TOP = 100.0
"""rad/s: more is not looked for, near the end of what models are known for."""
_MISSED = 0.05
"""dB and degree, by which a point may miss what is kept."""
_STEPS = 25


@dataclass(frozen=True, eq=False)
class TradeOff(Value):
    """The most disturbance rejection that an axis has at each phase margin. Read-only.

    What the law does in other axes stays as designed. Kept are a gain margin of 6 dB and a peak
    of 5 dB in this axis, and all that was asked but its margins and rejection.

    Attributes:
        axis: of control, by its command.
        phase_margin: (n_point,) rad, at the actuator, least first.
        bandwidth: (n_point,) rad/s, of disturbance rejection.
        peak: (n_point,) dB, of disturbance rejection.
        design: phase margin, rad, and bandwidth, rad/s, of the designed law.
    """

    axis: str
    phase_margin: NDArray[np.float64]
    bandwidth: NDArray[np.float64]
    peak: NDArray[np.float64]
    design: tuple[float, float]

    def __post_init__(self) -> None:
        for name in ("phase_margin", "bandwidth", "peak"):
            array = np.array(getattr(self, name), dtype=np.float64)
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    def to_dict(self) -> dict[str, object]:
        """Return plain JSON data."""
        return {
            "axis": self.axis,
            "phase_margin_rad": self.phase_margin.tolist(),
            "bandwidth_rad_s": self.bandwidth.tolist(),
            "peak_db": self.peak.tolist(),
            "design": list(self.design),
        }


def trade_off(
    problem: Problem,
    at: Vector,
    axis: str,
    *,
    floors: Sequence[float] | None = None,
    on_point: Callable[[str], None] | None = None,
) -> TradeOff:
    """Return the curve of one axis, each point found by a constraint on the phase margin.

    Args:
        problem: of the design; its nominal model is used.
        at: coordinates of the designed law, (n_free,).
        axis: of control.
        floors: phase margins, degree; by default from 30 to beyond that of the design. One that
            can't be kept has no point.
        on_point: called with a word after each point.

    Raises:
        NoResponse: the loop has no such axis, or the law nothing that is free in it.
    """
    name = axis_of(axis).name
    own = tuple(one for one in problem.free if one.name.startswith(f"{name}."))
    if not own:
        raise NoResponse(f"the law has no free parameter of {name}: they begin with '{name}.'")
    specs = tuple(one for one in problem.specs if one.kind == "hard" and one.criterion.axis != name)
    alone = replace(problem, law=problem.law_at(at), specs=specs, free=own)
    seen = _figures(alone.loops(alone.start)[0], name)
    most = max(seen[1] / RAD_PER_DEG, _LOWEST) + _BEYOND
    wanted = sorted(np.linspace(_LOWEST, most, _POINTS) if floors is None else floors)
    falling, here = {}, alone.start
    for floor in reversed(wanted):
        falling[floor] = _most(alone, here, name, floor * RAD_PER_DEG)
        kept_here = _keeps(_figures(alone.loops(falling[floor])[0], name), floor)
        here = falling[floor] if kept_here else alone.start
        if on_point is not None:
            on_point(f"trade-off {name} {floor:.3g} deg")
    points = [seen]
    for floor in wanted:  # from the other side too: either may end in a lesser optimum
        rising = _most(alone, here, name, floor * RAD_PER_DEG)
        both = [(_figures(alone.loops(at)[0], name), at) for at in (falling[floor], rising)]
        kept = [one for one in both if _keeps(one[0], floor)]
        if kept:
            best, here = max(kept, key=lambda one: one[0][2])
            points.append(best)
    found = points[1:] or points
    phase, bandwidth, peak = np.array(found)[:, [1, 2, 3]].T
    return TradeOff(name, phase, bandwidth, peak, (seen[1], seen[2]))


def _keeps(figures: tuple[float, float, float, float], floor: float) -> bool:
    gain, phase, *_ = figures
    return gain >= _LEAST_GAIN - _MISSED and phase >= (floor - _MISSED) * RAD_PER_DEG


def _most(problem: Problem, start: Vector, axis: str, floor: float) -> Vector:
    """Return the law with the most bandwidth at a phase margin, rad."""

    def worth(at: Vector, near: bool = False) -> Trial | None:
        loop = problem.loops(at)[0]
        if not near and slowest(loop) > 0.0:
            return None
        gain, phase, bandwidth, peak = _figures(loop, axis)
        kept = [(gain - _LEAST_GAIN) / _GAIN_UNIT, (phase - floor) / _PHASE_UNIT]
        kept.append(PEAK.distance(peak))
        others = [distance(one.criterion, loop) for one in problem.specs]
        return Trial(np.array(kept + others), -float(np.log(min(bandwidth, _TOP))))

    trial = worth(start)
    if trial is None:
        return start
    count = trial.distances.size
    goal = Goal(np.zeros(count), np.ones(count), 1.0)
    return descend(worth, Point(start, trial), goal, problem.box, steps=_STEPS).at


def _own(spec: Spec, axis: str) -> bool:
    """Return whether a specification is what is traded: margins or rejection of the axis."""
    traded = isinstance(spec.criterion, StabilityMargins | DisturbanceRejection)
    return traded and spec.criterion.axis == axis


def _figures(loop: Loop, axis: str) -> tuple[float, float, float, float]:
    """Return gain margin, dB, phase margin, rad, bandwidth, rad/s, and peak, dB."""
    kept, rejected = margins(loop.broken(axis)), rejection(loop.disturbance(axis))
    return kept.least_gain, kept.least_phase, rejected.bandwidth, rejected.peak
