"""Screens a log: spikes, frozen sensors, lost samples, wrong clocks, units, signs and axes.

What its recorder did is noted, and left out where that was asked for. What can't be as it is
declared is noted, too: rates are compared with attitudes, velocities with positions, accelerations
with velocities and gravity; angles, rates and controls with what they can be at all. Nothing is
said where too little moves. Body axes are forward, right, down; the world's north, east, down.
"""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import permutations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.note import Option
from helisim.base.units import (
    PULSE,
    RAD_PER_DEG,
    STANDARD_GRAVITY,
    TIME_UNITS,
    UNITS,
    without_trend,
)
from helisim.logs.mapping import Column
from helisim.logs.report import Findings, LogFinding
from helisim.logs.timing import GAP, Options, Samples
from helisim.records.quality import frozen_runs, spikes
from helisim.records.record import ACCELERATIONS, ATTITUDES, IN1, IN2, RATES

Array = NDArray[np.float64]
_REGULAR = 0.01  # share of the median step by which a step of a steady recorder is off at most
_SAME = 0.1  # by which a ratio may be off a unit's, in its logarithm
_SCALE = 0.25  # by which a rate may be off its angle's without a word, in the logarithm
_CLEARLY = 0.3
"""Of coherence, summed, by which angles in another unit must explain the rates better."""
_LEAST_ANGLE = 0.01
"""rad, rms: an attitude that moves less is no excited flight's; it is in another unit."""
_WIDEST = 4.0 * math.pi  # rad, from end to end: an attitude that moves more is in another unit
_FASTEST = 40.0  # rad/s: no gyro that flies measures more (2000 deg/s are 35)
_MOST = {"theta": 1.02 * math.pi / 2.0, "phi": 1.02 * math.pi} | dict.fromkeys(RATES, _FASTEST)
"""What angles, with some rounding, and rates can reach, in rad and rad/s."""
_SLOWEST, _WIDE = 1.0, 2.0
"""rad/s and rad rms: what swings faster by more turns over and back each time, and is in deg/s."""
_LONG = 256  # samples that show a swing, or how channels go together
_PULSES = (700.0, 2300.0)  # us, between which a radio's pulses are
_UNITISED = 1.5  # above, a control without dimension is a percentage or a pulse
_COHERENT = 0.8
"""Coherence of a frequency that is compared: noise moves a ratio by a tenth at most there."""
_WINDOWS = 16
"""Half-overlapping windows of a record; the median of what they say counts, so that a bump or a
lost second doesn't, and their scatter gives errors."""
_LOWEST = 3
"""Periods in a window, at least: below, drift and trends count."""
_HIGHEST = 0.08  # of the sampling rate: up to here central differences are derivatives within 5 %
_FEWEST = 5
"""Coherent frequencies from which something is claimed."""
_EXPLAINED = 0.05
"""Of a channel's power in the band, that the coherent frequencies must hold at least."""
_STRONG = 0.1  # of the median window's power, from which a window counts
_BAND_HZ = (0.2, 4.0)  # where a helicopter turns, and neither drift nor vibration
_GREATEST = 1e6  # rad and rad/s: nothing turns further or faster
_INTEGRAL = 0.998
"""Share of an angle's power that the rates explain, at least: noise biases the clocks' ratio."""
_SURE = 5.0  # standard errors by which a clock must be wrong to be reported
_ANGLES: dict[str, str] = dict(zip(RATES, ATTITUDES))
_SOURCES = (
    {rate: f"d({angle})/dt" for rate, angle in _ANGLES.items()}
    | dict.fromkeys("uv", "the positions' derivative")
    | {"w": "d(down)/dt"}
    | {name: f"d({of})/dt and attitude" for name, of in zip(ACCELERATIONS, "uvw")}
)
"""Channel -> what else says what it must be."""


def screened(
    samples: Samples, options: Options, findings: Findings, wanted: Collection[str] | None = None
) -> Samples:
    """Look for spikes and frozen runs; return the samples without those that were to be repaired.

    Args:
        samples: in order, without duplicates.
        options: of the reading: the repairs "spikes" and "frozen" take those samples out.
        findings: what is found is added.
        wanted: names of the channels to look at; all if None.
    """
    values = samples.values.copy()
    for k, (channel, heading, *_) in enumerate(samples.taken):
        if wanted is not None and channel.name not in wanted:
            continue
        for kind in ("frozen", "spikes") if channel.kind == "OUT" else ("spikes",):
            known = np.flatnonzero(np.isfinite(values[:, k]))
            runs = frozen_runs(values[known, k]) if kind == "frozen" else ()
            first = known[[run.first for run in runs] if runs else []]
            faulty = [known[run.first : run.last + 1] for run in runs]
            faulty += [known[spikes(values[known, k])]] if kind == "spikes" else []
            bad = np.concatenate([*faulty, known[:0]])
            if not bad.size:
                continue
            first = first if runs else bad
            rows = tuple(samples.rows[first].tolist())
            place = f"{samples.counts} {rows[0]}, {samples.time[first[0]]:.6g} s after the start"
            if runs:
                lost = float(sum(samples.time[one[-1]] - samples.time[one[0]] for one in faulty))
                many = "in one run" if len(runs) == 1 else f"in {len(runs)} runs, the first"
                text = f"is frozen for {lost:.4g} s, {many} from {place}"
                said = ("left out, and split there", "leave it out with the repair 'frozen'")
            else:
                text = f"{bad.size} of {known.size} samples are spikes, the first in {place}"
                said = ("interpolated", "interpolate them with the repair 'spikes'")
            asked = kind in options.repairs
            text = f"column {heading!r}: {text}; {said[0] if asked else said[1]}"
            remedy = "" if asked else f"repair={kind}"
            findings.note(kind, text, len(rows), rows, repaired=asked, remedy=remedy)
            values[bad, k] = np.nan if asked else values[bad, k]
    return replace(samples, values=values)


def note_lost_samples(samples: Samples, options: Options, findings: Findings) -> None:
    """Note how many samples a steady recorder lost between those that it wrote, gaps apart.

    Args:
        samples: in order, without duplicates.
        options: of the reading, whose rate interpolates them.
        findings: what is found is added.
    """
    steps = np.diff(samples.time)
    median = float(np.median(steps)) if steps.size else 0.0
    steady = np.abs(steps - median) <= _REGULAR * median
    if median <= 0.0 or np.count_nonzero(steady) < 0.5 * steps.size:
        return
    missing = np.rint(steps / median).astype(np.int64) - 1
    short = (missing > 0) & (steps <= GAP * median)
    short &= np.abs(steps - (missing + 1) * median) <= _REGULAR * median
    if short.any():
        rows, count = tuple(samples.rows[1:][short].tolist()), int(np.sum(missing[short]))
        filled = options.rate is not None
        text = (
            f"{samples.counts} {rows[0]}: {count} samples were lost in {len(rows)} places, besides "
            f"{samples.time.size} that are there; the longest step is {steps[short].max():.4g} s; "
            f"{'interpolated' if filled else 'resample the log'}"
        )
        remedy = "" if filled else f"resample={float(f'{1.0 / median:.3g}'):g}"
        findings.note("lost samples", text, count, rows, repaired=filled, remedy=remedy)


class Channels(NamedTuple):
    """The channels of a uniform record, as declared.

    Attributes:
        step: s.
        columns: name -> (n_time,) SI.
        declared: name -> its column of the log, with the unit and sign that it is taken in.
        clock: the column of times.
    """

    step: float
    columns: Mapping[str, Array]
    declared: Mapping[str, Column]
    clock: str

    def factor(self, name: str) -> float:
        """Return what a channel's column is multiplied by, without the sign."""
        return abs(self.declared[name].converts(name, None)[1])

    def unit_of(self, name: str, factor: float) -> str | None:
        """Return the unit like a column's that has a factor, SI per unit; None if none does."""
        column = self.declared[name]
        if not 0.0 < factor < math.inf:
            return None
        mine = "1" if column.range is not None else column.unit
        si = UNITS[mine].si if mine in UNITS else None
        near = [
            (abs(math.log(one.factor / factor)), unit)
            for unit, one in UNITS.items()
            if one.si == si and unit != mine and one.factor > 0.0
        ]
        off, unit = min(near, default=(math.inf, ""))
        return unit if off <= _SAME else None

    def to_try(
        self, name: str, *, to: str | None = None, unit: str | None = None, flip: bool = False
    ) -> Option:
        """Return the option that declares a column as another channel, in another unit or sign."""
        column = self.declared[name]
        if unit is not None:
            column = replace(column, unit=unit, trim=None, range=None)
        return (replace(column, sign=-column.sign) if flip else column).option(to or name)


class Likeness(NamedTuple):
    """How a measured channel goes with a predicted one.

    Attributes:
        coherence: mean over the compared frequencies, weighted by power; 0 without any.
        ratio: measured over predicted, with its sign.
        phase: of that, rad, in the middle of the compared frequencies.
    """

    coherence: float
    ratio: float
    phase: float

    @property
    def sure(self) -> bool:
        """Whether the two go together at all, in phase or against each other."""
        return self.coherence >= _COHERENT and abs(math.sin(self.phase)) < 0.5

    @property
    def off(self) -> bool:
        """Whether the ratio isn't 1."""
        return abs(math.log(abs(self.ratio))) > _SAME


_Pairs = Mapping[tuple[str, str], Likeness]
"""(Measured, predicted) -> how they go together."""


def implausible(channels: Channels) -> list[LogFinding]:
    """Return what can't be as it is declared."""
    with np.errstate(all="ignore"):
        found = [*_sizes(channels), *_gravity(channels)]
        for rule in (_rates, _motion):
            known = {one.remedy for one in found}
            found += [one for one in rule(channels) if one.remedy not in known]
            if any(one.kind == "unit of time" for one in found):
                break
    return found


def _sizes(channels: Channels) -> Iterator[LogFinding]:
    """Yield controls, angles and rates beyond what they can be in the unit that is declared."""
    for name, column in channels.declared.items():
        rule = _SIZES.get(name)
        if rule is None or channels.factor(name) != 1.0:
            continue
        text, unit = rule(name, channels.columns[name], channels.step)
        if unit == PULSE:
            trim = float(f"{np.median(np.abs(channels.columns[name])):.0f}")
            pulse = replace(column, unit=PULSE, trim=trim, range=800.0)
            yield LogFinding("unit", text, (pulse.option(name),))
        elif unit:
            said = f": column {column.column!r} is in {unit}" if unit != "percent" else ""
            yield LogFinding("unit", text + said, (channels.to_try(name, unit=unit),))


def _control_size(name: str, values: Array, step: float) -> tuple[str, str]:
    """Return what a control without dimension is rather, if its numbers say so, and the unit."""
    low, high = np.quantile(np.abs(values), (0.05, 0.95))
    says = f"{name} goes from {np.min(values):.4g} to {np.max(values):.4g} without dimension"
    if _PULSES[0] <= low and high <= _PULSES[1]:
        return f"{says}: a radio's pulses, us, whose trim and range are yours", PULSE
    return (
        f"{says}: a percentage, or its range is another one",
        "percent" if high > _UNITISED else "",
    )


def _motion_size(name: str, values: Array, step: float) -> tuple[str, str]:
    """Return what an angle or rate in rad can't be, if it can't, and the unit that it is in."""
    si, unit = ("rad/s", "deg/s") if name in RATES else ("rad", "deg")
    largest = float(np.quantile(np.abs(values), 0.999))
    if _MOST[name] < largest and RAD_PER_DEG * largest <= _MOST[name]:
        return f"{name} reaches {largest:.4g} {si}, and can reach {_MOST[name]:.3g}", unit
    omega = 2.0 * math.pi * np.fft.rfftfreq(values.size, step)
    angle = np.fft.rfft(values - np.mean(values))[omega > _SLOWEST] / omega[omega > _SLOWEST]
    swing = float(np.sqrt(2.0 * np.sum(np.abs(angle) ** 2)) / values.size)
    wide = name in RATES and values.size >= _LONG and _WIDE < swing <= _WIDE / RAD_PER_DEG
    return (
        f"{name} in {si} would swing the vehicle to and fro by {swing:.3g} rad rms, faster than "
        f"{_SLOWEST:g} rad/s"
    ), unit if wide else ""


_SIZES = dict.fromkeys((*IN1, *IN2), _control_size) | dict.fromkeys(_MOST, _motion_size)


def _gravity(channels: Channels) -> Iterator[LogFinding]:
    """Yield what gravity says of the accelerometers: at rest and on average az is -9.81 m/s^2."""
    have = [name for name in ACCELERATIONS if name in channels.declared]
    if "az" not in have:
        return
    middle = {name: float(np.median(channels.columns[name])) for name in have}
    az, size = middle["az"], math.hypot(*middle.values())
    other = max(middle, key=lambda name: abs(middle[name]))
    if other != "az" and abs(middle[other]) > 0.9 * size and _near(size, STANDARD_GRAVITY):
        text = (
            f"gravity, {middle[other]:.3g} m/s^2 on average, is on {other} and not on az "
            f"({az:.3g}): the accelerometers' axes are swapped"
        )
        remedy = (channels.to_try(other, to="az", flip=middle[other] > 0.0),)
        yield LogFinding("axes", text, remedy)
    elif abs(az) >= 0.5 * size and 0.0 < abs(az) < math.inf:
        factor, unit = channels.factor("az") * STANDARD_GRAVITY / abs(az), None
        if not _near(abs(az), STANDARD_GRAVITY):
            unit = channels.unit_of("az", factor)
        wrong = ["its sign is wrong"] if az > 0.0 and (unit or _near(az, STANDARD_GRAVITY)) else []
        remedy = (channels.to_try("az", unit=unit, flip=bool(wrong)),)
        wrong += [f"column {channels.declared['az'].column!r} is in {unit}"] if unit else []
        text = (
            f"az is {az:.4g} m/s^2 on average, and gravity makes it -9.81 in axes that point down"
        )
        if wrong:
            yield LogFinding("unit" if unit else "sign", f"{text}: {' and '.join(wrong)}", remedy)


def _near(one: float, other: float) -> bool:
    return one > 0.0 and abs(math.log(one / other)) < 2.0 * _SAME


def _rates(channels: Channels) -> list[LogFinding]:
    """Return what attitudes say of the rates, in three dimensions, whatever the angles' unit."""
    best, factor, pairs = -math.inf, 1.0, {}
    for trial in (1.0, RAD_PER_DEG, 1.0 / RAD_PER_DEG):
        found = _compared(channels, RATES, _turning(channels, trial))
        score = sum(like.coherence for like in found.values())
        if score > best + _CLEARLY:
            best, factor, pairs = score, trial, found
    pairs = {pair: like._replace(ratio=like.ratio * factor) for pair, like in pairs.items()}
    own = {one: like for (one, other), like in pairs.items() if one == other and like.sure}
    for thousand in (1e3, 1e6, 1e-3, 1e-6):
        if own and all(abs(math.log(abs(one.ratio) / thousand)) <= _SAME for one in own.values()):
            like = next(iter(own.values()))
            unit = next((u for u, s in TIME_UNITS.items() if math.isclose(s * thousand, 1.0)), "s")
            text = (
                f"rates are {like.ratio:.3g} times their angles' derivatives (coherence "
                f"{like.coherence:.2f}): the unit of time is wrong by that"
            )
            return [LogFinding("unit of time", text, (Option("time", f"{channels.clock}:{unit}"),))]
    votes = [_angle_is_wrong(channels, one, abs(like.ratio)) for one, like in own.items()]
    return _judged(channels, pairs, _SCALE, factor != 1.0 or 2 * sum(votes) > len(votes))


def _motion(channels: Channels) -> list[LogFinding]:
    """Return what positions say of velocities, else what velocities say of accelerations."""
    found = _judged(channels, _compared(channels, tuple("uvw"), _moving(channels)), math.inf)
    # accelerations are compared with velocities, unless these are wrong themselves
    pairs = _compared(channels, ACCELERATIONS, {} if found else _accelerating(channels))
    return found or _judged(channels, pairs, math.inf)


def _turning(channels: Channels, factor: float) -> dict[str, Array]:
    """Return the rates that attitudes imply, as far as there are any, times a factor."""
    columns = channels.columns
    angles = {name: factor * columns[name] for name in ATTITUDES if name in columns}
    slope = {name: np.gradient(angle, channels.step) for name, angle in angles.items()}
    if len(angles) < 3:
        return {rate: slope[angle] for rate, angle in _ANGLES.items() if angle in slope}
    phi, theta = angles["phi"], angles["theta"]
    return {
        "p": slope["phi"] - slope["psi"] * np.sin(theta),
        "q": slope["theta"] * np.cos(phi) + slope["psi"] * np.sin(phi) * np.cos(theta),
        "r": slope["psi"] * np.cos(phi) * np.cos(theta) - slope["theta"] * np.sin(phi),
    }


def _moving(channels: Channels) -> dict[str, Array]:
    """Return the body velocities that positions imply: all with attitudes, else w by `down`."""
    columns, names = channels.columns, ("north", "east", "down")
    slope = {name: np.gradient(columns[name], channels.step) for name in names if name in columns}
    if not {*names, *ATTITUDES} <= set(columns):
        return {"w": slope["down"]} if "down" in slope else {}
    sf, st, sp = (np.sin(columns[name]) for name in ATTITUDES)
    cf, ct, cp = (np.cos(columns[name]) for name in ATTITUDES)
    north, east, down = (slope[name] for name in names)
    return {
        "u": ct * cp * north + ct * sp * east - st * down,
        "v": (sf * st * cp - cf * sp) * north + (sf * st * sp + cf * cp) * east + sf * ct * down,
        "w": (cf * st * cp + sf * sp) * north + (cf * st * sp - sf * cp) * east + cf * ct * down,
    }


def _accelerating(channels: Channels) -> dict[str, Array]:
    """Return the specific forces that velocities imply, less what attitudes add where known."""
    columns = channels.columns
    velocities = [(name, of) for name, of in zip(ACCELERATIONS, "uvw") if of in columns]
    found = {name: np.gradient(columns[of], channels.step) for name, of in velocities}
    if set("pqruvw") <= set(columns):
        p, q, r, u, v, w = (columns[name] for name in "pqruvw")
        turning = (q * w - r * v, r * u - p * w, p * v - q * u)
        found = {name: found[name] + more for name, more in zip(ACCELERATIONS, turning)}
    if {"phi", "theta"} <= set(columns):
        phi, theta = columns["phi"], columns["theta"]
        down = (-np.sin(theta), np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta))
        gravity: dict[str, Array] = dict(zip(ACCELERATIONS, down))
        found = {name: one - STANDARD_GRAVITY * gravity[name] for name, one in found.items()}
    return found


def _compared(
    channels: Channels, names: Sequence[str], predicted: Mapping[str, Array]
) -> dict[tuple[str, str], Likeness]:
    """Return how every measured channel of those names goes with every predicted one."""
    measured = [name for name in names if name in channels.declared]
    columns = [channels.columns[name] for name in measured] + list(predicted.values())
    if not measured or not predicted or columns[0].size < _LONG:
        return {}
    values, frequency = _windowed(np.column_stack(columns), channels.step)
    inside = (np.arange(frequency.size) >= _LOWEST) & (frequency * channels.step <= _HIGHEST)
    if not np.all(np.isfinite(columns)) or inside.sum() < _FEWEST:
        return {}
    each = np.moveaxis(values[:, inside], 2, 0)
    return {
        (one, other): likeness(mine, theirs)
        for one, mine in zip(measured, each)
        for other, theirs in zip(predicted, each[len(measured) :])
    }


def _windowed(columns: Array, step: float) -> tuple[NDArray[np.complex128], Array]:
    """Return transforms of columns, (n_time, n_channel), in windows, and their frequencies, Hz.

    Detrended and tapered: (n_window, n_freq, n_channel) and (n_freq,).
    """
    length = 2 * (columns.shape[0] // (_WINDOWS + 1))
    starts = np.arange(_WINDOWS) * (length // 2)
    taper = (0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(length) / length))[:, None]
    parts = np.stack([without_trend(columns[s : s + length]) * taper for s in starts])
    found: NDArray[np.complex128] = np.fft.rfft(parts, axis=1)
    return found, np.fft.rfftfreq(length, step).astype(np.float64)


def likeness(measured: NDArray[np.complex128], predicted: NDArray[np.complex128]) -> Likeness:
    """Compare two channels' transforms, (n_window, n_freq) each."""
    own, other = np.abs(measured) ** 2, np.abs(predicted) ** 2
    cross = np.sum(measured * predicted.conj(), axis=0)
    powers = np.sum(own, axis=0) * np.sum(other, axis=0)
    coherence = np.abs(cross) ** 2 / np.where(powers > 0.0, powers, np.inf)
    keep = coherence >= _COHERENT
    share = np.sum(other[:, keep]) / np.sum(other)
    if not np.all(np.isfinite(powers)) or keep.sum() < _FEWEST or not share >= _EXPLAINED:
        return Likeness(0.0, 0.0, 0.0)
    weight = np.sqrt(powers[keep])
    each_own, each_other = np.sum(own[:, keep], axis=1), np.sum(other[:, keep], axis=1)
    strong = each_other > _STRONG * np.median(each_other)
    ratio = float(np.sqrt(np.median(each_own[strong] / each_other[strong])))
    if not 0.0 < ratio < np.inf:
        return Likeness(0.0, 0.0, 0.0)
    total = np.sum(cross[keep] / np.abs(cross[keep]) * weight)
    mean = float(np.sum(coherence[keep] * weight) / np.sum(weight))
    return Likeness(mean, ratio if total.real >= 0.0 else -ratio, float(np.angle(total)))


def _judged(
    channels: Channels, pairs: _Pairs, scale: float, angles: bool = False
) -> list[LogFinding]:
    """Return wrong axes, else wrong units and signs, of channels that go with what is predicted."""
    swapped = _swapped(channels, pairs) or _exchanged(channels, pairs)
    own = [(one, like) for (one, other), like in pairs.items() if one == other and like.sure]
    return swapped or [
        found
        for one, like in own
        for found in [_own(channels, one, like, scale, angles)]
        if found is not None
    ]


def _said(name: str, source: str, like: Likeness) -> str:
    return f"{name} is {like.ratio:.3g} times {_SOURCES[source]} (coherence {like.coherence:.2f})"


def _own(
    channels: Channels, name: str, like: Likeness, scale: float, angles: bool
) -> LogFinding | None:
    """Return what is wrong with the unit or sign of a channel, by its own prediction."""
    column, size, flip = channels.declared[name].column, abs(like.ratio), like.ratio < 0.0
    unit = channels.unit_of(name, channels.factor(name) / size) if like.off else None
    angle = _angle_unit(channels, name, size) if like.off and angles else None
    said, remedy = _said(name, name, like), (channels.to_try(name, unit=unit, flip=flip),)
    if angle is not None:
        other = _ANGLES[name]
        text = f"{said}: column {channels.declared[other].column!r} is in {angle}"
        return LogFinding("unit", text, (channels.to_try(other, unit=angle),))
    if unit is not None:
        also = ", and the sign is wrong" if flip else ""
        return LogFinding("unit", f"{said}: column {column!r} is in {unit}{also}", remedy)
    if flip:
        also = f" or {_ANGLES[name]}" if name in _ANGLES else ""
        return LogFinding("sign", f"{said}: the sign of {name}{also} is wrong", remedy)
    if abs(math.log(size)) > scale:
        return LogFinding("scale", f"{said}: its scale, or that of its angle, is wrong")
    return None


def _angle_unit(channels: Channels, name: str, size: float) -> str | None:
    """Return the unit of a rate's angle, if another one makes the ratio 1."""
    angle = _ANGLES.get(name, "")
    known = angle in channels.declared
    return channels.unit_of(angle, channels.factor(angle) * size) if known else None


def _angle_is_wrong(channels: Channels, name: str, size: float) -> bool:
    """Return whether an angle can't be what it is declared to be, as its rate can."""
    if _angle_unit(channels, name, size) is None:
        return False
    angle = channels.columns[_ANGLES[name]]
    if size > 1.0:  # a large rate, or an angle that is too small
        fast = float(np.quantile(np.abs(channels.columns[name]), 0.999))
        return bool(np.std(angle) < _LEAST_ANGLE) and fast <= _FASTEST
    return bool(np.ptp(angle - np.median(angle)) > _WIDEST)


def _swapped(channels: Channels, pairs: _Pairs) -> list[LogFinding]:
    """Return columns that go with what another one should be, and not with their own."""
    names = [one for one, other in pairs if one == other]
    for order in permutations(names):
        moved = [(one, other) for one, other in zip(names, order) if one != other]
        if moved and all(pairs[pair].sure and not pairs[pair[0], pair[0]].sure for pair in moved):
            text = ", ".join(_said(one, other, pairs[one, other]) for one, other in moved)
            own = ", ".join(f"{one}: {pairs[one, one].coherence:.2f}" for one, _ in moved)
            remedy = tuple(_as(channels, one, other, pairs[one, other]) for one, other in moved)
            return [LogFinding("axes", f"columns are swapped: {text}; by their own, {own}", remedy)]
    return []


def _exchanged(channels: Channels, pairs: _Pairs) -> list[LogFinding]:
    """Return two columns of which one goes with what the other should be, as far as is known.

    The other one's own is not there, such as a heading, or it hardly moves.
    """
    measured = list(dict.fromkeys(one for one, _ in pairs))
    for (one, other), like in pairs.items():
        rivals = [pairs[name, other] for name in measured if name != one] if one != other else []
        rivals += [pairs[one, one]] if (one, one) in pairs else []
        if one == other or other not in measured or not like.sure or any(r.sure for r in rivals):
            continue
        if like.off and channels.unit_of(one, channels.factor(one) / abs(like.ratio)) is None:
            continue  # coupled motion, not the other rate
        own = pairs[other, other].coherence
        remedy = (_as(channels, one, other, like), channels.to_try(other, to=one))
        text = f"{_said(one, other, like)}; {other} is not (coherence {own:.2f})"
        return [LogFinding("axes", f"columns are swapped: {text}", remedy)]
    return []


def _as(channels: Channels, one: str, other: str, like: Likeness) -> Option:
    """Return the option that declares a channel's column to be another channel."""
    factor = channels.factor(one) / abs(like.ratio)
    unit = channels.unit_of(one, factor) if like.off else None
    return channels.to_try(one, to=other, unit=unit, flip=like.ratio < 0.0)


class ClockError(NamedTuple):
    """By which part a clock is fast by one angle, its standard error, and the angle's coherence."""

    angle: str
    fast: float
    error: float
    coherence: float


def clock_errors(time: Array, channels: Mapping[str, Array]) -> list[ClockError]:
    """Compare the three angles of a uniform record with the integrals of its rates.

    Both are integrated, windowed and filtered alike, so that the ratio of their transforms is that
    of the clocks. It takes a helicopter that turns much.

    Args:
        time: (n_time,) s.
        channels: p, q, r in rad/s and phi, theta, psi in rad, (n_time,) each.
    """
    from scipy.interpolate import CubicSpline  # slow to import, and most commands read no log

    p, q, r, phi, theta, psi = (channels[name] for name in (*RATES, *ATTITUDES))
    turning = q * np.sin(phi) + r * np.cos(phi)
    rates = (
        p + np.tan(theta) * turning,
        q * np.cos(phi) - r * np.sin(phi),
        turning / np.cos(theta),
    )
    step, found = (time[-1] - time[0]) / (time.size - 1), []
    for name, angle, rate in zip(ATTITUDES, (phi, theta, psi), rates):
        sane = np.all(np.abs(angle) < _GREATEST) and np.all(np.abs(rate) < _GREATEST)
        if not sane or time.size < _LONG or np.ptp(angle) == 0.0:
            continue
        integral = CubicSpline(time, rate).antiderivative()(time)
        values, frequency = _windowed(np.column_stack([angle, integral]), step)
        inside = (frequency >= _BAND_HZ[0]) & (frequency <= _BAND_HZ[1])
        one, other = np.moveaxis(values[:, inside], 2, 0)
        if inside.sum() < 3 or not np.any(other):
            continue
        omega, cross = 2.0 * np.pi * frequency[inside], np.sum(one * other.conj(), axis=0)
        slope = np.abs(cross) * omega
        delay = -np.sum(slope * np.unwrap(np.angle(cross))) / np.sum(slope * omega)
        shared = np.sum((one * np.exp(1j * omega * delay) * other.conj()).real, axis=1)
        power = np.sum(np.abs(other) ** 2, axis=1)
        coherence = np.sum(shared) ** 2 / (np.sum(power) * np.sum(np.abs(one) ** 2))
        scale = np.sum(shared) / np.sum(power)
        without = (np.sum(shared) - shared) / (np.sum(power) - power)  # a window each
        error = np.sqrt((power.size - 1.0) * np.mean((without - scale) ** 2)) / scale**2
        found.append(ClockError(name, float(1.0 / scale - 1.0), float(error), float(coherence)))
    return found


def clock_findings(time: Array, channels: Mapping[str, Array]) -> list[LogFinding]:
    """Return the error of a uniform record's clock, if its angles show one surely.

    Args:
        time: (n_time,) s.
        channels: (n_time,) SI each; nothing is said without all rates and angles.
    """
    if not {*RATES, *ATTITUDES} <= set(channels):
        return []
    with np.errstate(all="ignore"):
        coherent = [one for one in clock_errors(time, channels) if one.coherence > _INTEGRAL]
    best = min(coherent, key=lambda one: one.error, default=None)
    if best is None or abs(best.fast) <= _SURE * best.error:
        return []
    text = (
        f"the rates' integral is {100.0 * best.fast:+.2f} +- {100.0 * best.error:.2f} % off "
        f"{best.angle}: the clock is {'fast' if best.fast > 0.0 else 'slow'} by as much, or a "
        "sensor's scale is wrong; not corrected: 1/s are off by as much, 1/s^2 by twice"
    )
    return [LogFinding("clock", text)]
