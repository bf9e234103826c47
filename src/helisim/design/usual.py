"""The specifications that a design has where none are given."""

from dataclasses import replace

from helisim.base.linear import Linear
from helisim.design.laws.law import Law
from helisim.design.problem import closed
from helisim.handling.criteria import (
    ActuatorOnset,
    ActuatorUse,
    Crossover,
    DisturbanceRejection,
    Limit,
    LoadRejection,
    PoleLimits,
)
from helisim.handling.criterion import Froude
from helisim.handling.figures import rejection
from helisim.handling.loop import GRID, Loop
from helisim.handling.spec import ATTITUDES, Spec, standard

BETTER = {"lat": 1.3, "lon": 1.3, "ped": 1.0}
"""Disturbance rejection bandwidth over that of the law before."""
TASK = "ads33e_other_divided"
"""Of ADS-33E-PRF: all tasks but target acquisition, with divided attention."""
_LOADS = 1.5
"""Times slower than the rejection bandwidth of the law before are the fastest loads."""
_STIFFER = {True: 3.0, False: 0.0}
"""dB by which loads on its own command turn an axis less, and those on another's."""
_CYCLIC = ("lat", "lon")
"""A rotor turns what is done to one of them into the other."""
_SLOWEST = 0.3
"""rad/s, of loads: slower ones are the pilot's."""
_SPAN = 3.0
"""dB from Level 1 to the end of Level 2: 1.4 times as far."""
_GROWTH = Limit(1e-3, 0.05)
"""1/s: integrals of what is commanded stand at 0, but for rounding."""
_FAST = Limit(30.0, 60.0)
"""rad/s, of an objective: only how crossovers weigh against actuator use depends on it."""


def usual_specs(
    plant: Linear, before: Law, *, period: float, diameter: float, rate_limit: float
) -> tuple[Spec, ...]:
    """Return what is asked of a law that replaces another one on a small helicopter.

    Hard: stability, and margins of 45 deg and 6 dB at the actuators. Soft: bandwidth, phase delay
    and damping of ADS-33E-PRF, and rejection of disturbances, scaled by Froude's law; in
    roll and pitch 1.3 times the rejection bandwidth of the law before, in yaw as much as that,
    where this is more; and slow loads, as of gusts, turn the vehicle less far than with the law
    before.
    Objective: crossovers, and what the actuators do. The rest of the standards is
    checked.

    Args:
        plant: nominal.
        before: the law that is replaced.
        period: s, between ticks.
        diameter: of the rotor, m.
        rate_limit: of the servos' commands, unitised, a second.
    """
    scale = Froude.of(diameter).ratio
    loop = closed(plant, before.linear(period), GRID)
    found = [Spec(PoleLimits(growth=_GROWTH), "hard")]
    found += [one for one in standard("margins") if not isinstance(one.criterion, PoleLimits)]
    for spec in standard("disturbance_rejection", scale=scale):
        axis = spec.criterion.axis
        seen = loop.disturbance(axis)
        own = rejection(seen).bandwidth
        usual = spec.criterion.limits["drb"]
        wanted = Limit(BETTER[axis] * own, own if BETTER[axis] > 1.0 else 0.75 * own)
        more = isinstance(usual, Limit) and wanted.level1 > usual.level1
        found.append(
            replace(spec, criterion=DisturbanceRejection(axis=axis, bandwidth=wanted))
            if more
            else spec
        )
        loads = _CYCLIC if axis in _CYCLIC else (axis,)
        found += [Spec(_stiffer(loop, axis, by, own / _LOADS)) for by in loads]
    found += standard(TASK, scale=scale)
    for axis in ATTITUDES:
        found += [
            Spec(Crossover(axis=axis, frequency=_FAST), "objective"),
            Spec(ActuatorUse(axis=axis, rate_limit=rate_limit, scale=scale), "objective"),
            Spec(ActuatorOnset(axis=axis, rate_limit=rate_limit), "check"),
        ]
    return tuple(found)


def _stiffer(loop: Loop, axis: str, by: str, high: float) -> LoadRejection:
    """Return that loads turn an axis less far than with the law before."""
    high = max(high, 2.0 * _SLOWEST)
    asked = LoadRejection(axis=axis, by=by, low=_SLOWEST, high=high, turned=Limit(0.0, _SPAN))
    most = asked.rate(loop).figures["turned"] - _STIFFER[by == axis]
    return replace(asked, turned=Limit(most, most + _SPAN))
