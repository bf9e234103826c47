"""Infers from logs of SystemID all that an identification has to be told."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from helisim.base.errors import InputError, LogError
from helisim.base.value import FrozenMap
from helisim.logs.log import Log
from helisim.logs.mapping import Column, Map
from helisim.logs.resample import PASSBAND
from helisim.look.systemid.axes import SidAxis
from helisim.look.systemid.channels import TakenChannel, chosen_channels, usual_step
from helisim.look.systemid.fits import Band, InferredFit, Swept, chosen_fits, fit_of
from helisim.look.systemid.reading import Sampling, opened_log, read_sweeps
from helisim.look.systemid.remarks import remarks
from helisim.look.systemid.sweeps import FlownSweep, sweeps
from helisim.records.channels import some_names

_SAMPLES_A_PERIOD = 8.0
"""Of the highest frequency that was swept, in the records."""
_MAX_GAP = 0.25
"""s without a message that is interpolated: loggers that are pressed drop some now and then."""
_SHORTEST = 0.25
"""Of the longest sweep: parts of one that gaps cut off are left out if they are shorter, for the
shortest says what low frequencies are resolved."""
_HELICOPTER = 6
"""FRAME_CLASS of a helicopter with one main rotor."""


@dataclass(frozen=True)
class InferredLog:
    """A log with SystemID's messages, and what they say.

    Attributes:
        path: the file.
        version: what wrote it.
        helicopter: whether its frame is a helicopter's with one main rotor.
        sweeps: that it holds, those of no use too.
        channels: where each comes from.
        parameters: the autopilot's, by name, at last.
        dropped: share of the messages that the logger dropped while sweeps were flown.
    """

    path: str
    version: str
    helicopter: bool
    sweeps: tuple[FlownSweep, ...]
    channels: tuple[TakenChannel, ...]
    parameters: Mapping[str, float]
    dropped: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "parameters", FrozenMap(self.parameters))

    def __repr__(self) -> str:
        return f"InferredLog({Path(self.path).name!r}: {len(self.sweeps)} sweeps)"

    @property
    def used(self) -> tuple[FlownSweep, ...]:
        """The sweeps that can identify the vehicle."""
        return tuple(one for one in self.sweeps if not one.unused)

    def __str__(self) -> str:
        lines = [f"{self.path}: {self.version or 'ArduPilot'}, {len(self.sweeps)} sweep(s)"]
        for one in self.sweeps:
            lines.append(f"  {one}" + (f"; not used: {one.unused}" if one.unused else ""))
        return "\n".join(lines)


@dataclass(frozen=True)
class Inferred:
    """What logs say of an identification: sweeps, channels, references, structures and bands.

    Attributes:
        logs: one each.
        fits: that the sweeps allow.
        sampling: of the records.
        remarks: what to know of it, and what to set for the next flight.
    """

    logs: tuple[InferredLog, ...]
    fits: tuple[InferredFit, ...]
    sampling: Sampling
    remarks: tuple[str, ...]

    def __repr__(self) -> str:
        swept = some_names(map(str, self.injected))
        fits = some_names(fit.structure for fit in self.fits)
        return f"Inferred({len(self.logs)} log(s); swept: {swept}; fits: {fits})"

    @property
    def injected(self) -> tuple[SidAxis, ...]:
        """The axes of all sweeps that are used."""
        axes = {one.axis: one.sid_axis for log in self.logs for one in log.used}
        return tuple(axes[number] for number in sorted(axes))

    @property
    def swept(self) -> Swept:
        """What the sweeps of all logs are good for."""
        return _swept(self.logs, self.sampling.rate)

    def fit(self, structure: str, inputs: Sequence[str], outputs: Sequence[str]) -> InferredFit:
        """Return a fit of another structure, its band and references as the sweeps say.

        Args:
            structure: its name.
            inputs: of the vehicle, which must have been swept.
            outputs: of the vehicle.

        Raises:
            InputError: an input wasn't swept, or an output isn't in the logs.
        """
        swept = self.swept
        for name in outputs:
            if name not in swept.channels:
                raise InputError(
                    f"the output {name!r} of {structure} isn't in the logs, as far as their "
                    f"messages say; there are {', '.join(sorted(swept.channels))}; say which "
                    f"column it is by --channel {name}=COLUMN:UNIT"
                )
        return fit_of(swept, structure, inputs, outputs, "as asked for")

    def read(
        self,
        names: Iterable[str] | None = None,
        *,
        on_progress: Callable[[str], None] | None = None,
    ) -> tuple[Log, ...]:
        """Read the sweeps: a log each, whose records have the channels and what was injected.

        Args:
            names: of channels; all by default.
            on_progress: called with each file's name.

        Raises:
            LogError: what is wrong with a log.
        """
        wanted = None if names is None else set(names)
        found = []
        for log in self.logs:
            channels = [one for one in log.channels if wanted is None or one.name in wanted]
            path = Path(log.path)
            found += read_sweeps(path, channels, log.used, self.injected, self.sampling)
            if on_progress is not None:
                on_progress(path.name)
        return tuple(found)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {
            "logs": [
                {
                    "path": one.path,
                    "version": one.version,
                    "sweeps": [sweep.to_dict() for sweep in one.sweeps],
                    "channels": [channel.to_dict() for channel in one.channels],
                    "dropped": one.dropped,
                }
                for one in self.logs
            ],
            "fits": [one.to_dict() for one in self.fits],
            "resampled_hz": self.sampling.rate,
            "max_gap_s": self.sampling.max_gap,
            "remarks": list(self.remarks),
        }

    def __str__(self) -> str:
        lines = [str(log) for log in self.logs]
        lines += ["channels:", *_channel_lines(self.logs, self.fits)]
        lines += [f"  {line}" for line in _injected_lines(self.injected)]
        lines += ["fits:", *(f"  {one}" for one in self.fits)]
        lines += [f"note: {one}" for one in self.remarks]
        return "\n".join(lines)


def infer(
    logs: str | Path | Iterable[str | Path],
    *,
    channels: Map | Mapping[str, Column] | None = None,
    resample_hz: float | None = None,
    repair: Iterable[str] = (),
    max_gap: float | None = None,
    min_duration: float = 0.0,
    start: float | None = None,
    stop: float | None = None,
) -> Inferred:
    """Infer from logs of ArduPilot's mode SystemID all that an identification has to be told.

    Each sweep becomes a record. What the mixer was commanded drives the vehicle, gyro and
    accelerometer before their filters answer, and what was injected is the reference of the joint
    input-output method: outside the loop, whichever axis it was injected at.

    Args:
        logs: one file or several, of one vehicle.
        channels: channel -> column, where others are wanted than would be chosen.
        resample_hz: of the records, Hz; by default as fast as the sweeps need.
        repair: see `REPAIRS`, besides "gaps" and "duplicates".
        max_gap: the longest time without a message that is interpolated, s; by default 0.25.
        min_duration: parts of a sweep, cut at gaps, that are shorter are left out, s; by default a
            quarter of the longest sweep.
        start: sweeps that begin before are left out, s after the log's first stamp.
        stop: sweeps that end after are left out, s after the log's first stamp.

    Raises:
        StorageError: a file can't be read.
        LogError: a log has no SystemID messages, or lacks others; the message says what to set.
    """
    paths = [logs] if isinstance(logs, str | Path) else list(logs)
    if not paths:
        raise InputError("no logs were given; expected at least one file")
    given = dict(channels.channels if isinstance(channels, Map) else channels or {})
    limits = (-math.inf if start is None else start, math.inf if stop is None else stop)
    found = tuple(_inferred(Path(path), given, limits) for path in paths)
    used = [one for log in found for one in log.used]
    if not used:
        why: dict[str, list[str]] = {}
        for one in (sweep for log in found for sweep in log.sweeps):
            why.setdefault(one.unused, []).append(f"{one.axis} at {one.start:.1f} s")
        reasons = "; ".join(f"SID_AXIS {', '.join(at)}: {text}" for text, at in why.items())
        raise LogError(f"{paths[0]}: no sweep in it identifies the vehicle: {reasons}")
    rate = resample_hz or _rate(found, max(one.high for one in used))
    gap = _MAX_GAP if max_gap is None else max_gap
    shortest = min_duration or _SHORTEST * max(one.stop - one.start for one in used)
    sampling = Sampling(rate, gap, frozenset(repair), shortest)
    fits = chosen_fits(_swept(found, rate), helicopter=all(log.helicopter for log in found))
    return Inferred(found, fits, sampling, remarks(found, fits, rate))


def _inferred(path: Path, given: Mapping[str, Column], limits: Band) -> InferredLog:
    log = opened_log(path)[0].log
    first = min(log.first_stamps.values())
    every = sweeps(log, first)
    mine = tuple(one for one in every if limits[0] <= one.start and one.stop <= limits[1])
    if not mine:
        spans = ", ".join(f"{one.start:.1f} to {one.stop:.1f}" for one in every)
        raise LogError(
            f"{path}: no sweep lies between --from and --to; they are from {spans} s after the "
            "log's first sample"
        )
    spans = [(one.start + first, one.stop + first) for one in mine]
    parameters = log.parameters()
    return InferredLog(
        path=str(path),
        version=log.version,
        helicopter=parameters.get("FRAME_CLASS", float("H_SW_TYPE" in parameters) * _HELICOPTER)
        == _HELICOPTER,
        sweeps=mine,
        channels=chosen_channels(log, given, spans),
        parameters=parameters,
        dropped=usual_step(log.table("SIDD").time, spans)[1],
    )


def _rate(logs: Sequence[InferredLog], high: float) -> float:
    """Return the rate of the records, Hz: that of the slowest log, or a whole part of it."""
    needed = _SAMPLES_A_PERIOD * high / (2.0 * math.pi)
    slowest = min(one.rate for log in logs for one in log.channels if one.rate > 0.0)
    return float(f"{slowest / max(1, math.floor(slowest / needed)):.6g}")


def _swept(logs: Sequence[InferredLog], rate: float) -> Swept:
    """Return what the sweeps of logs are good for, in records of a rate, Hz."""
    used = tuple(one for log in logs for one in log.used)
    durations = [one.stop - one.start for one in used]
    window = min(min(durations) / 2.0, sum(durations) / 5.0)
    resolved = 1.001 * 2.0 * math.pi / window, PASSBAND * math.pi * rate
    common = frozenset.intersection(*(frozenset(c.name for c in log.channels) for log in logs))
    return Swept(used, common, resolved)


def _channel_lines(logs: Sequence[InferredLog], fits: Sequence[InferredFit]) -> list[str]:
    """Return a line for channels that come from one message for one reason, and the others."""
    used = {name for fit in fits for name in (*fit.inputs, *fit.outputs, *fit.conditioning)}
    lines = []
    for log in logs:
        groups: dict[tuple[str, str | None, float, str, int], list[TakenChannel]] = {}
        for one in log.channels:
            column = one.column
            message = column.column.partition(".")[0]
            key = (message, column.unit, one.rate, one.why, column.sign)
            if one.name in used:
                groups.setdefault(key, []).append(one)
        lines += [f"  {_together(ones)}" for ones in groups.values()]
    unused = [one.name for one in logs[0].channels if one.name not in used]
    if unused:
        lines.append(f"  there are also {', '.join(unused)}")
    return list(dict.fromkeys(lines))


def _together(ones: Sequence[TakenChannel]) -> str:
    """Return channels of one message in a line."""
    fields = [one.column.column.partition(".")[2] for one in ones]
    first = ones[0]
    message = first.column.column.partition(".")[0]
    sign = "-" if first.column.sign < 0 else ""
    names = ", ".join(one.name for one in ones)
    return (
        f"{names} = {sign}{message}.{', '.join(fields)} [{first.column.unit or 'as stated'}], "
        f"{first.rate:.4g} Hz: {first.why}"
    )


def _injected_lines(axes: Sequence[SidAxis]) -> list[str]:
    """Return a line for the axes that are injected at one place in one unit."""
    groups: dict[tuple[str, str], list[SidAxis]] = {}
    for axis in axes:
        groups.setdefault((axis.place, axis.unit), []).append(axis)
    return [
        f"{', '.join(axis.name for axis in mine)} = SIDD.Targ [{unit}] of SID_AXIS "
        f"{', '.join(str(axis.number) for axis in mine)}: {mine[0].meaning}"
        for (_, unit), mine in groups.items()
    ]
