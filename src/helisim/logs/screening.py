"""Screens a log for spikes, frozen sensors, losses, wrong units, signs and body axes."""

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from itertools import permutations
from typing import NamedTuple

import numpy as np

from helisim.base.arrays import Real
from helisim.base.note import Option
from helisim.base.units import PULSE, RAD_PER_DEG, STANDARD_GRAVITY, UNITS
from helisim.logs.mapping import Column
from helisim.logs.report import Findings, LogFinding
from helisim.logs.timing import GAP, Options, Samples
from helisim.records.quality import ANGLES, frozen_runs, slope_matrix, spikes
from helisim.records.record import IN1, IN2, RATES

# _REGULAR: largest error of a steady recorder's step, of the median step
# _SAME: largest error of a ratio that is a unit's, in its logarithm
_REGULAR, _SAME = 0.01, 0.1
# _SCALE: of a rate over its angle's slope, in the logarithm: less is not reported
# _LEAST_ANGLE: rad, rms, of any excited flight's attitude in radians
_SCALE, _LEAST_ANGLE = 0.25, 0.01
_FASTEST = 40.0  # rad/s: more than gyros measure (2000 deg/s are 35)
# Most of angles, with some rounding, and rates, rad and rad/s.
LARGEST = {"theta": 1.02 * math.pi / 2.0, "phi": 1.02 * math.pi} | dict.fromkeys(RATES, _FASTEST)
_SLOWEST, _WIDE = 1.0, 2.0  # rad/s and rad rms: faster swings that are wider are in deg/s
_LONG = 256  # least samples of a swing
# PULSES: us, of a radio
# PULSE_RANGE: us, from one end of a stick to the other: 1100 to 1900
PULSES, PULSE_RANGE = (700.0, 2300.0), 800.0
UNITISED = 1.5  # above, a control without dimension is a percentage or a pulse
# Error of a rate's slope, of the slope, and the share of the rate that it makes, where it is sure.
_UNSURE, _MAINLY = 0.15, 0.7
# _LOWEST: periods in a log, at least
# _HIGHEST: of the sampling rate: up to here central differences are right within 5 %
_LOWEST, _HIGHEST = 25.0, 0.08


def screened(
    samples: Samples, options: Options, findings: Findings, wanted: Collection[str] | None = None
) -> Samples:
    """Find spikes and frozen runs; return the samples without those that are to be repaired."""
    values = samples.values.copy() if options.repair else samples.values
    for k, (channel, heading, *_) in enumerate(samples.taken):
        kinds = ("frozen", "spikes") if channel.kind == "OUT" else ("spikes",)
        measured = not channel.name.endswith(("_disturbance", "_sum"))  # but injected: known
        for kind in kinds if measured and (wanted is None or channel.name in wanted) else ():
            known = np.flatnonzero(np.isfinite(values[:, k]))
            one = values[known, k]
            runs = (
                [*frozen_runs(one)]
                if kind == "frozen"
                else [(n, n) for n in np.flatnonzero(spikes(one)).tolist()]
            )
            if not runs:
                continue
            bad = known[np.concatenate([np.arange(a, b + 1) for a, b in runs])]
            rows = tuple(samples.rows[known[[a for a, _ in runs]]].tolist())
            asked = kind in options.repair
            done = "interpolated" if kind == "spikes" else "left out, and split there"
            text = (
                f"column {heading!r}: {bad.size} of {known.size} samples are {kind}, the first in "
                f"{samples.counts} {rows[0]}, {samples.time[bad[0]]:.6g} s after the start; "
                f"{done if asked else f'the repair {kind!r} takes them out'}"
            )
            remedy = "" if asked else f"repair={kind}"
            findings.note(kind, text, len(rows), rows, repaired=asked, remedy=remedy)
            if asked:
                values[bad, k] = np.nan
    return replace(samples, values=values)


def note_lost_samples(samples: Samples, options: Options, findings: Findings) -> None:
    """Note how many samples a steady recorder lost, gaps apart; `samples` are in order."""
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
        filled = options.resample_hz is not None
        text = (
            f"{samples.counts} {rows[0]}: {count} samples were lost in {len(rows)} places; "
            f"{'they count as missing' if filled else 'resample the log'}"
        )
        remedy = "" if filled else f"resample={float(f'{1.0 / median:.3g}'):g}"
        findings.note("lost samples", text, count, rows, repaired=filled, remedy=remedy)


class Channels(NamedTuple):
    """The channels of a uniform record, as declared; `step` is in s.

    `columns` is name -> (n_time,) SI, `declared` name -> column of the log.
    """

    step: float
    columns: Mapping[str, Real]
    declared: Mapping[str, Column]

    def factor(self, name: str) -> float:
        """Return SI per unit of a channel's column, without the sign."""
        return abs(self.declared[name].converts(name, None)[1])

    def unit_of(self, name: str, factor: float) -> str | None:
        """Return the unit of the column's kind near a factor, SI per unit; None if none is."""
        column = self.declared[name]
        mine = "1" if column.range is not None else column.unit
        if not 0.0 < factor < math.inf or mine not in UNITS:
            return None
        near = [
            (abs(math.log(one.factor / factor)), unit)
            for unit, one in UNITS.items()
            if one.si == UNITS[mine].si and unit != mine and one.factor > 0.0
        ]
        off, unit = min(near, default=(math.inf, ""))
        return unit if off <= _SAME else None

    def to_try(
        self, name: str, *, to: str | None = None, unit: str | None = None, flip: bool = False
    ) -> Option:
        """Return the option that declares a column as another channel, in another unit or sign."""
        given = self.declared[name]
        column = given if unit is None else replace(given, unit=unit, trim=None, range=None)
        return (replace(column, sign=-column.sign) if flip else column).option(to or name)


def implausible(channels: Channels) -> list[LogFinding]:
    """Return findings on channels whose unit, sign or axis can't be as declared."""
    with np.errstate(all="ignore"):
        pairs = _likenesses(channels)
        found = [*_sizes(channels, pairs), *_gravity(channels)]
        known = {one.remedy for one in found}
        return found + [one for one in _rates(channels, pairs) if one.remedy not in known]


def _sizes(channels: Channels, pairs: Mapping[tuple[str, str], "Likeness"]) -> Iterator[LogFinding]:
    for name, column in channels.declared.items():
        values = channels.columns[name]
        if name not in (*IN1, *IN2, *LARGEST) or channels.factor(name) != 1.0:
            continue
        low, high = np.quantile(np.abs(values), (0.05, 0.95))
        largest = float(np.quantile(np.abs(values), 0.999))
        says = f"{name} reaches {largest:.4g} {'rad' if name in LARGEST else 'without dimension'}"
        if name not in LARGEST and PULSES[0] <= low and high <= PULSES[1]:
            trim = float(f"{np.median(np.abs(values)):.0f}")
            pulse = replace(column, unit=PULSE, trim=trim, range=PULSE_RANGE)
            yield LogFinding(
                "unit",
                f"{says}: a radio's pulses, us, whose trim and range are yours",
                (pulse.option(name),),
            )
        elif name not in LARGEST and high > UNITISED:
            yield LogFinding(
                "unit",
                f"{says}: a percentage, or its range is another one",
                (channels.to_try(name, unit="percent"),),
            )
        elif (
            name in LARGEST
            and _in_degrees(name, values, channels.step, largest)
            # beyond half a turn as the angle's rate, which isn't in deg/s, says
            and not any(
                (one, ANGLES[one]) == (other, name)
                and like.sure
                and not like.off
                and not _in_degrees(one, rate, channels.step, float(np.max(np.abs(rate))))
                for (one, other), like in pairs.items()
                for rate in [channels.columns[one]]
            )
        ):
            unit = "deg/s" if name in RATES else "deg"
            yield LogFinding(
                "unit",
                f"{says}, more than it can: column {column.column!r} is in {unit}",
                (channels.to_try(name, unit=unit),),
            )


def _in_degrees(name: str, values: Real, step: float, largest: float) -> bool:
    if LARGEST[name] < largest:
        return RAD_PER_DEG * largest <= LARGEST[name]
    omega = 2.0 * math.pi * np.fft.rfftfreq(values.size, step)
    angle = np.fft.rfft(values - np.mean(values))[omega > _SLOWEST] / omega[omega > _SLOWEST]
    swing = float(np.sqrt(2.0 * np.sum(np.abs(angle) ** 2)) / values.size)
    return name in RATES and values.size >= _LONG and _WIDE < swing <= _WIDE / RAD_PER_DEG


def _gravity(channels: Channels) -> Iterator[LogFinding]:
    if "az" not in channels.declared:
        return
    az = float(np.median(channels.columns["az"]))
    right, size = abs(abs(az) / STANDARD_GRAVITY - 1.0) < 0.2, max(abs(az), 1e-9)
    factor = channels.factor("az") * STANDARD_GRAVITY / size
    unit = None if right else channels.unit_of("az", factor)
    if unit or (right and az > 0.0):
        text = f"az is {az:.4g} m/s^2 on average, and gravity makes it -9.81: "
        text += f"its unit is {unit}" * bool(unit) + " its sign is wrong" * (az > 0.0)
        remedy = (channels.to_try("az", unit=unit, flip=az > 0.0),)
        yield LogFinding("unit" if unit else "sign", text, remedy)


def _likenesses(channels: Channels) -> dict[tuple[str, str], "Likeness"]:
    """Return how each rate is like its own angle's slope and others'; none in too short a log."""
    rates = [one for one in RATES if one in channels.declared and ANGLES[one] in channels.columns]
    columns = [channels.columns[one] for name in rates for one in (name, ANGLES[name])]
    if not rates or not np.all(np.abs(columns) < 1e100):  # squares have a sum
        return {}
    low, high = 2.0 * math.pi / channels.step * np.array([_LOWEST / columns[0].size, _HIGHEST])
    if low > 0.5 * high:
        return {}
    ratio, error, share = slope_matrix([(channels.columns, channels.step)], rates, (low, high))
    sure = (error < _UNSURE * np.abs(ratio)) & (share > _MAINLY)
    return {
        (one, other): Likeness(float(ratio[k, n]), float(error[k, n]), bool(sure[k, n]))
        for k, one in enumerate(rates)
        for n, other in enumerate(rates)
    }


def _rates(channels: Channels, pairs: Mapping[tuple[str, str], "Likeness"]) -> list[LogFinding]:
    rates = [one for one, other in pairs if one == other]
    for order in permutations(rates):
        moved = [(one, other) for one, other in zip(rates, order) if one != other]
        if moved and all(pairs[pair].sure and not pairs[pair[0], pair[0]].sure for pair in moved):
            text = ", ".join(_said(one, other, pairs[one, other]) for one, other in moved)
            remedy = tuple(_as(channels, one, other, pairs[one, other]) for one, other in moved)
            return [LogFinding("axes", f"columns are swapped: {text}", remedy)]
    found = [_own(channels, one, pairs[one, one]) for one in rates if pairs[one, one].sure]
    return [one for one in found if one is not None]


class Likeness(NamedTuple):
    """How often a rate is the one that an angle's slope makes, and whether it is that at all."""

    ratio: float
    error: float
    sure: bool

    @property
    def off(self) -> bool:
        """Whether the ratio isn't 1."""
        return abs(math.log(abs(self.ratio))) > _SAME


def _said(name: str, source: str, like: Likeness) -> str:
    return f"{name} is {like.ratio:.3g} +- {like.error:.2g} times d({ANGLES[source]})/dt"


def _as(channels: Channels, one: str, other: str, like: Likeness) -> Option:
    unit = channels.unit_of(one, channels.factor(one) / abs(like.ratio)) if like.off else None
    return channels.to_try(one, to=other, unit=unit, flip=like.ratio < 0.0)


def _own(channels: Channels, name: str, like: Likeness) -> LogFinding | None:
    angle, size, flip = ANGLES[name], abs(like.ratio), like.ratio < 0.0
    said, still = _said(name, name, like), np.std(channels.columns[angle]) < _LEAST_ANGLE
    wrong, factor = name, channels.factor(name) / size
    if still and angle in channels.declared:  # an angle declared in too small a unit
        wrong, factor = angle, channels.factor(angle) * size
    unit = channels.unit_of(wrong, factor) if like.off else None
    remedy = (channels.to_try(wrong, unit=unit, flip=flip),)
    column, also = channels.declared[wrong].column, ", and the sign is wrong" if flip else ""
    rules = (
        ("unit", unit is not None, f"column {column!r} is in {unit}{also}", remedy),
        ("sign", flip, f"the sign of {name} or {angle} is wrong", remedy),
        ("scale", abs(math.log(size)) > _SCALE, "the scale of either, or of time, is wrong", ()),
    )
    return next(
        (LogFinding(kind, f"{said}: {text}", helps) for kind, holds, text, helps in rules if holds),
        None,
    )
