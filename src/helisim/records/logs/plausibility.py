"""Says whether a log's channels can be what they are declared to be: units, signs, axes.

Rates are compared with attitudes, velocities with positions, accelerations with velocities and
with gravity; angles, rates and controls with what they can be at all. Each finding says what the
data show, how sure it is, and the option to try. Nothing is said where too little moves.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import permutations
from shlex import quote
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.records.channels import IN1, IN2
from helisim.records.logs import attitude
from helisim.records.logs.comparison import Likeness, Transforms, likeness, transforms
from helisim.records.logs.report import LogFinding
from helisim.records.logs.units import PULSE, TIME_UNITS, UNITS
from helisim.units import RAD_PER_DEG, STANDARD_GRAVITY

_SAME = 0.1
"""By which a ratio may be off a unit's, in its logarithm."""
_SCALE = 0.25
"""By which a rate may be off its angle's without a word, in the logarithm."""
_FASTEST = 40.0
"""rad/s: no gyro that flies measures more (2000 deg/s are 35)."""
_SLOWEST, _WIDE = 1.0, 2.0
"""rad/s and rad rms: what swings faster by more turns over and back each time, and is in deg/s."""
_LONG = 256
"""Samples that show a swing."""
_PITCH_MOST = 1.02 * math.pi / 2.0
_ROLL_MOST = 1.02 * math.pi
"""rad: Euler's angles, with some rounding."""
_LEAST_ANGLE = 0.01
"""rad, rms: an attitude that moves less is no excited flight's; it is in another unit."""
_WIDEST = 4.0 * math.pi
"""rad, from end to end: an attitude that moves more is in another unit."""
_PULSES = (700.0, 2300.0)
"""us, between which a radio's pulses are."""
_UNITISED = 1.5
"""Above, a control without dimension is a percentage or a pulse."""

_SOURCES = {
    "p": "d(phi)/dt",
    "q": "d(theta)/dt",
    "r": "d(psi)/dt",
    "u": "the positions' derivative",
    "v": "the positions' derivative",
    "w": "d(down)/dt",
    "ax": "d(u)/dt and attitude",
    "ay": "d(v)/dt and attitude",
    "az": "d(w)/dt and attitude",
}
_ANGLES = {"p": "phi", "q": "theta", "r": "psi"}


class Declared(NamedTuple):
    """What a channel is declared to be.

    Attributes:
        column: of the log.
        unit: of that column.
        factor: SI per unit, without the sign.
        sign: 1 or -1.
        further: what else is declared, such as ":trim=20".
    """

    column: str
    unit: str
    factor: float
    sign: int
    further: str = ""

    def option(self, channel: str, *, unit: str | None = None, flip: bool = False) -> str:
        """Return the option that declares the channel with another unit or sign."""
        sign = ":sign=-1" if (self.sign < 0) != flip else ""
        further = self.further if unit is None else ""
        return "--channel " + quote(f"{channel}={self.column}:{unit or self.unit}{sign}{further}")


class Channels(NamedTuple):
    """The channels of a uniform record, as declared.

    Attributes:
        step: s.
        columns: name -> (n_time,) SI.
        declared: name -> what it is declared to be.
        clock: the column of times.
    """

    step: float
    columns: Mapping[str, NDArray[np.float64]]
    declared: Mapping[str, Declared]
    clock: str


def implausible(channels: Channels) -> list[LogFinding]:
    """Return what can't be as it is declared."""
    with np.errstate(all="ignore"):
        found = [*_controls(channels), *_limits(channels), *_gravity(channels)]
        beyond = {finding.option for finding in found}
        found += [finding for finding in _swings(channels) if finding.option not in beyond]
        known = {finding.option for finding in found}
        rates = _rates(channels)
        if any(finding.kind == "unit of time" for finding in rates):
            return [*found, *rates]
        for more in (rates, *_motion(channels)):
            found += [finding for finding in more if finding.option not in known]
    return found


def _finding(kind: str, text: str, option: str) -> LogFinding:
    return LogFinding(kind, f"{text}; try {option}" if option else text, option=option)


def _unit_of(declared: Declared, factor: float) -> str | None:
    """Return the unit of the same kind with a factor, SI per unit; None if there is none."""
    if not 0.0 < factor < math.inf:
        return None
    si = UNITS[declared.unit].si if declared.unit in UNITS else None
    near = [
        (abs(math.log(one.factor / factor)), name)
        for name, one in UNITS.items()
        if one.si == si and name != declared.unit and one.factor > 0.0
    ]
    off, name = min(near, default=(math.inf, ""))
    return name if off <= _SAME else None


def _controls(channels: Channels) -> list[LogFinding]:
    """Return controls without dimension whose numbers are pulses or percentages."""
    found = []
    for name in (*IN1, *IN2):
        declared = channels.declared.get(name)
        if declared is None or declared.factor != 1.0:
            continue
        values = channels.columns[name]
        low, high = np.quantile(np.abs(values), (0.05, 0.95))
        middle = float(np.median(np.abs(values)))
        says = f"{name} goes from {np.min(values):.4g} to {np.max(values):.4g} without dimension"
        if _PULSES[0] <= low and high <= _PULSES[1]:
            option = declared.option(name, unit=f"{PULSE}:trim={middle:.0f}:range=800")
            text = f"{says}: a radio's pulses, us, whose trim and range are yours"
            found.append(_finding("unit", text, option))
        elif high > _UNITISED:
            text = f"{says}: a percentage, or its range is another one"
            found.append(_finding("unit", text, declared.option(name, unit="percent")))
    return found


def _limits(channels: Channels) -> list[LogFinding]:
    """Return angles and rates beyond what they can be in the unit that they are declared in."""
    found = []
    for name, most in (("theta", _PITCH_MOST), ("phi", _ROLL_MOST), *_FAST):
        declared = channels.declared.get(name)
        if declared is None:
            continue
        largest = float(np.quantile(np.abs(channels.columns[name]), 0.999))
        smaller = RAD_PER_DEG * largest
        if largest <= most or smaller > most or declared.factor != 1.0:
            continue
        unit = "deg" if name in ("theta", "phi") else "deg/s"
        text = (
            f"{name} reaches {largest:.4g} {declared.unit}, and can reach {most:.3g}: "
            f"column {declared.column!r} is in {unit}"
        )
        found.append(_finding("unit", text, declared.option(name, unit=unit)))
    return found


_FAST = tuple((name, _FASTEST) for name in "pqr")


def _swings(channels: Channels) -> list[LogFinding]:
    """Return rates that would swing the vehicle through whole turns, to and fro."""
    found = []
    for name in "pqr":
        declared = channels.declared.get(name)
        if declared is None or declared.factor != 1.0 or channels.columns[name].size < _LONG:
            continue
        rate = channels.columns[name]
        omega = 2.0 * math.pi * np.fft.rfftfreq(rate.size, channels.step)
        angle = np.fft.rfft(rate - np.mean(rate))[omega > _SLOWEST] / omega[omega > _SLOWEST]
        swing = float(np.sqrt(2.0 * np.sum(np.abs(angle) ** 2)) / rate.size)
        if not math.isfinite(swing) or swing <= _WIDE or RAD_PER_DEG * swing > _WIDE:
            continue
        text = (
            f"{name} in {declared.unit} would swing the vehicle to and fro by {swing:.3g} rad rms, "
            f"faster than {_SLOWEST:g} rad/s: column {declared.column!r} is in deg/s"
        )
        found.append(_finding("unit", text, declared.option(name, unit="deg/s")))
    return found


def _gravity(channels: Channels) -> list[LogFinding]:
    """Return what gravity says of the accelerometers: at rest and on average az is -9.81 m/s^2."""
    have = [name for name in ("ax", "ay", "az") if name in channels.declared]
    if "az" not in have:
        return []
    middle = {name: float(np.median(channels.columns[name])) for name in have}
    az, declared = middle["az"], channels.declared["az"]
    size = math.sqrt(sum(value**2 for value in middle.values()))
    other = max((name for name in have if name != "az"), key=lambda n: abs(middle[n]), default="")
    if other and abs(middle[other]) > 0.9 * size and _near(size, STANDARD_GRAVITY):
        text = (
            f"gravity, {middle[other]:.3g} m/s^2 on average, is on {other} and not on az "
            f"({az:.3g}): the accelerometers' axes are swapped"
        )
        swapped = channels.declared[other]
        flip = middle[other] > 0.0
        return [_finding("axes", text, swapped.option("az", flip=flip))]
    if abs(az) < 0.5 * size or not 0.0 < abs(az) < math.inf:
        return []
    unit = (
        None
        if _near(abs(az), STANDARD_GRAVITY)
        else _unit_of(declared, declared.factor * STANDARD_GRAVITY / abs(az))
    )
    flip = az > 0.0 and (unit is not None or _near(az, STANDARD_GRAVITY))
    if unit is None and not flip:
        return []
    text = (
        f"az is {az:.4g} m/s^2 on average, and gravity makes it -9.81 in axes that point down: "
        f"{'its sign is wrong' if flip else ''}{' and ' if flip and unit else ''}"
        f"{f'column {declared.column!r} is in {unit}' if unit else ''}"
    )
    return [_finding("unit" if unit else "sign", text, declared.option("az", unit=unit, flip=flip))]


def _near(one: float, other: float) -> bool:
    return one > 0.0 and abs(math.log(one / other)) < 2.0 * _SAME


def _rates(channels: Channels) -> list[LogFinding]:
    """Return what attitudes say of the rates, in three dimensions, whatever the angles' unit."""
    measured = [name for name in "pqr" if name in channels.declared]
    best: tuple[float, float, dict[tuple[str, str], Likeness]] | None = None
    for factor in (1.0, RAD_PER_DEG, 1.0 / RAD_PER_DEG):
        predicted = attitude.rates(channels.columns, channels.step, factor=factor)
        alike = _alike(channels, measured, predicted)
        score = sum(one.coherence for one in alike.values())
        if best is None or score > best[0] + _CLEARLY:
            best = score, factor, alike
    if best is None or not best[2]:
        return []
    _, factor, alike = best
    alike = {key: one._replace(ratio=one.ratio * factor) for key, one in alike.items()}
    own = {one: like for (one, other), like in alike.items() if one == other and like.sure}
    votes = [_angle_is_wrong(channels, one, abs(like.ratio)) for one, like in own.items()]
    angles = factor != 1.0 or 2 * sum(votes) > len(votes)
    return _time_unit(channels, alike) or _judged(channels, alike, _SCALE, angles=angles)


_CLEARLY = 0.3
"""Of coherence, summed, by which angles in another unit must explain the rates better."""


def _motion(channels: Channels) -> list[list[LogFinding]]:
    """Return what positions say of velocities, and velocities of accelerations."""
    found = []
    for names, predict in (("uvw", attitude.velocities), (_ACCELEROMETERS, attitude.accelerations)):
        measured = [name for name in names if name in channels.declared]
        predicted = predict(channels.columns, channels.step) if measured else {}
        found.append(_judged(channels, _alike(channels, measured, predicted), math.inf))
    if found[0]:  # accelerations are compared with velocities, which are wrong themselves
        return found[:1]
    return found


_ACCELEROMETERS = ("ax", "ay", "az")


def _alike(
    channels: Channels, measured: Sequence[str], predicted: Mapping[str, NDArray[np.float64]]
) -> dict[tuple[str, str], Likeness]:
    """Return how every measured channel goes with every predicted one."""
    names = [name for name in predicted if name in _SOURCES]
    if not measured or not names:
        return {}
    columns = [channels.columns[name] for name in measured] + [predicted[name] for name in names]
    made: Transforms | None = transforms(np.column_stack(columns), channels.step)
    if made is None:
        return {}
    return {
        (one, other): likeness(made.values[..., i], made.values[..., len(measured) + j])
        for i, one in enumerate(measured)
        for j, other in enumerate(names)
    }


def _judged(
    channels: Channels,
    alike: Mapping[tuple[str, str], Likeness],
    scale: float,
    *,
    angles: bool = False,
) -> list[LogFinding]:
    """Return wrong axes, else wrong units and signs, of channels that go with what is predicted.

    Args:
        channels: as declared.
        alike: (measured, predicted) -> how they go together.
        scale: by which a ratio may be off without a word, in its logarithm.
        angles: whether the angles' units are to blame, not the rates'.
    """
    swapped = _swapped(channels, alike)
    if swapped:
        return swapped
    return [
        finding
        for (one, other), like in alike.items()
        if one == other and like.sure
        for finding in [_own(channels, one, like, scale, angles)]
        if finding is not None
    ]


def _said(name: str, source: str, like: Likeness) -> str:
    return f"{name} is {like.ratio:.3g} times {_SOURCES[source]} (coherence {like.coherence:.2f})"


def _own(
    channels: Channels, name: str, like: Likeness, scale: float, angles: bool
) -> LogFinding | None:
    """Return what is wrong with the unit or sign of a channel, by its own prediction."""
    declared, size = channels.declared[name], abs(like.ratio)
    flip = like.ratio < 0.0
    unit = angle = None
    if abs(math.log(size)) > _SAME:
        unit = _unit_of(declared, declared.factor / size)
        angle = _angle_unit(channels, name, size) if angles else None
    if unit is None and angle is None and not flip and abs(math.log(size)) <= scale:
        return None
    said = _said(name, name, like)
    option = declared.option(name, unit=unit, flip=flip)
    if angle is not None:
        other = channels.declared[_ANGLES[name]]
        option = other.option(_ANGLES[name], unit=angle)
        return _finding("unit", f"{said}: column {other.column!r} is in {angle}", option)
    if unit is not None:
        also = ", and the sign is wrong" if flip else ""
        return _finding("unit", f"{said}: column {declared.column!r} is in {unit}{also}", option)
    if flip:
        also = f" or {_ANGLES[name]}" if name in _ANGLES else ""
        return _finding("sign", f"{said}: the sign of {name}{also} is wrong", option)
    return _finding("scale", f"{said}: its scale, or that of its angle, is wrong", "")


def _angle_unit(channels: Channels, name: str, size: float) -> str | None:
    """Return the unit of a rate's angle, if another one makes the ratio 1."""
    declared = channels.declared.get(_ANGLES.get(name, ""))
    return None if declared is None else _unit_of(declared, declared.factor * size)


def _angle_is_wrong(channels: Channels, name: str, size: float) -> bool:
    """Return whether an angle can't be what it is declared to be, as its rate can."""
    if _angle_unit(channels, name, size) is None:
        return False
    angle = channels.columns[_ANGLES[name]]
    if size > 1.0:  # a large rate, or an angle that is too small
        fast = float(np.quantile(np.abs(channels.columns[name]), 0.999))
        return bool(np.std(angle) < _LEAST_ANGLE) and fast <= _FASTEST
    return bool(np.ptp(angle - np.median(angle)) > _WIDEST)


def _swapped(channels: Channels, alike: Mapping[tuple[str, str], Likeness]) -> list[LogFinding]:
    """Return columns that go with what another one should be, and not with their own."""
    names = [one for one, other in alike if one == other]
    for order in permutations(names):
        moved = [(one, other) for one, other in zip(names, order) if one != other]
        if not moved:
            continue
        if all(alike[pair].sure and not alike[pair[0], pair[0]].sure for pair in moved):
            text = ", ".join(_said(one, other, alike[one, other]) for one, other in moved)
            options = " ".join(_as(channels, one, other, alike[one, other]) for one, other in moved)
            own = ", ".join(f"{one}: {alike[one, one].coherence:.2f}" for one, _ in moved)
            return [_finding("axes", f"columns are swapped: {text}; by their own, {own}", options)]
    return []


def _as(channels: Channels, one: str, other: str, like: Likeness) -> str:
    """Return the option that declares a channel's column to be another channel."""
    declared = channels.declared[one]
    off = abs(math.log(abs(like.ratio))) > _SAME
    unit = _unit_of(declared, declared.factor / abs(like.ratio)) if off else None
    return declared.option(other, unit=unit, flip=like.ratio < 0.0)


def _time_unit(channels: Channels, alike: Mapping[tuple[str, str], Likeness]) -> list[LogFinding]:
    """Return a wrong unit of time, where all rates are off their angles by the same thousand."""
    own = [like for (one, other), like in alike.items() if one == other and like.sure]
    for thousand in (1e3, 1e6, 1e-3, 1e-6):
        if own and all(abs(math.log(abs(one.ratio) / thousand)) <= _SAME for one in own):
            unit = next((u for u, s in TIME_UNITS.items() if math.isclose(s * thousand, 1.0)), "s")
            text = (
                f"rates are {own[0].ratio:.3g} times their angles' derivatives (coherence "
                f"{own[0].coherence:.2f}): the unit of time is wrong by that"
            )
            return [_finding("unit of time", text, "--time " + quote(f"{channels.clock}:{unit}"))]
    return []
