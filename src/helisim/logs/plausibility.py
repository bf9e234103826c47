"""Says whether a log's channels can be what they are declared to be: units, signs, axes.

Rates are compared with attitudes, velocities with positions, accelerations with velocities and
with gravity; angles, rates and controls with what they can be at all. Each finding says what the
data show, how sure it is, and the option to try. Nothing is said where too little moves.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import permutations
from shlex import quote

import numpy as np
from numpy.typing import NDArray

from helisim.base.unit_names import TIME_UNITS
from helisim.base.units import RAD_PER_DEG
from helisim.logs import attitude
from helisim.logs.comparison import Likeness, Transforms, likeness, transforms
from helisim.logs.declared import SAME, Channels, finding, unit_of
from helisim.logs.report import LogFinding
from helisim.logs.sizes import FASTEST, out_of_size

_SCALE = 0.25
"""By which a rate may be off its angle's without a word, in the logarithm."""
_LEAST_ANGLE = 0.01
"""rad, rms: an attitude that moves less is no excited flight's; it is in another unit."""
_WIDEST = 4.0 * math.pi
"""rad, from end to end: an attitude that moves more is in another unit."""

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


def implausible(channels: Channels) -> list[LogFinding]:
    """Return what can't be as it is declared."""
    with np.errstate(all="ignore"):
        found = out_of_size(channels)
        known = {one.option for one in found}
        rates = _rates(channels)
        if any(one.kind == "unit of time" for one in rates):
            return [*found, *rates]
        for more in (rates, *_motion(channels)):
            found += [one for one in more if one.option not in known]
    return found


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
    swapped = _swapped(channels, alike) or _exchanged(channels, alike)
    if swapped:
        return swapped
    return [
        found
        for (one, other), like in alike.items()
        if one == other and like.sure
        for found in [_own(channels, one, like, scale, angles)]
        if found is not None
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
    if abs(math.log(size)) > SAME:
        unit = unit_of(declared, declared.factor / size)
        angle = _angle_unit(channels, name, size) if angles else None
    if unit is None and angle is None and not flip and abs(math.log(size)) <= scale:
        return None
    said = _said(name, name, like)
    option = declared.option(name, unit=unit, flip=flip)
    if angle is not None:
        other = channels.declared[_ANGLES[name]]
        option = other.option(_ANGLES[name], unit=angle)
        return finding("unit", f"{said}: column {other.column!r} is in {angle}", option)
    if unit is not None:
        also = ", and the sign is wrong" if flip else ""
        return finding("unit", f"{said}: column {declared.column!r} is in {unit}{also}", option)
    if flip:
        also = f" or {_ANGLES[name]}" if name in _ANGLES else ""
        return finding("sign", f"{said}: the sign of {name}{also} is wrong", option)
    return finding("scale", f"{said}: its scale, or that of its angle, is wrong", "")


def _angle_unit(channels: Channels, name: str, size: float) -> str | None:
    """Return the unit of a rate's angle, if another one makes the ratio 1."""
    declared = channels.declared.get(_ANGLES.get(name, ""))
    return None if declared is None else unit_of(declared, declared.factor * size)


def _angle_is_wrong(channels: Channels, name: str, size: float) -> bool:
    """Return whether an angle can't be what it is declared to be, as its rate can."""
    if _angle_unit(channels, name, size) is None:
        return False
    angle = channels.columns[_ANGLES[name]]
    if size > 1.0:  # a large rate, or an angle that is too small
        fast = float(np.quantile(np.abs(channels.columns[name]), 0.999))
        return bool(np.std(angle) < _LEAST_ANGLE) and fast <= FASTEST
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
            return [finding("axes", f"columns are swapped: {text}; by their own, {own}", options)]
    return []


def _exchanged(channels: Channels, alike: Mapping[tuple[str, str], Likeness]) -> list[LogFinding]:
    """Return two columns of which one goes with what the other should be, as far as is known.

    The other one's own is not there, such as a heading, or it hardly moves.
    """
    measured = list(dict.fromkeys(one for one, _ in alike))
    for one, other in alike:
        if one == other or other not in measured or not alike[one, other].sure:
            continue
        rivals = [alike[name, other] for name in measured if name != one]
        if any(rival.sure for rival in rivals) or ((one, one) in alike and alike[one, one].sure):
            continue
        like, declared = alike[one, other], channels.declared[one]
        off = abs(math.log(abs(like.ratio))) > SAME
        if off and unit_of(declared, declared.factor / abs(like.ratio)) is None:
            continue  # coupled motion, not the other rate
        own = alike[other, other].coherence
        options = f"{_as(channels, one, other, like)} {channels.declared[other].option(one)}"
        text = f"{_said(one, other, like)}; {other} is not (coherence {own:.2f})"
        return [finding("axes", f"columns are swapped: {text}", options)]
    return []


def _as(channels: Channels, one: str, other: str, like: Likeness) -> str:
    """Return the option that declares a channel's column to be another channel."""
    declared = channels.declared[one]
    off = abs(math.log(abs(like.ratio))) > SAME
    unit = unit_of(declared, declared.factor / abs(like.ratio)) if off else None
    return declared.option(other, unit=unit, flip=like.ratio < 0.0)


def _time_unit(channels: Channels, alike: Mapping[tuple[str, str], Likeness]) -> list[LogFinding]:
    """Return a wrong unit of time, where all rates are off their angles by the same thousand."""
    own = [like for (one, other), like in alike.items() if one == other and like.sure]
    for thousand in (1e3, 1e6, 1e-3, 1e-6):
        if own and all(abs(math.log(abs(one.ratio) / thousand)) <= SAME for one in own):
            unit = next((u for u, s in TIME_UNITS.items() if math.isclose(s * thousand, 1.0)), "s")
            text = (
                f"rates are {own[0].ratio:.3g} times their angles' derivatives (coherence "
                f"{own[0].coherence:.2f}): the unit of time is wrong by that"
            )
            return [finding("unit of time", text, "--time " + quote(f"{channels.clock}:{unit}"))]
    return []
