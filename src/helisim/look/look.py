"""A first look at logs: what they hold, what was flown, what is usable, and what to run next."""

import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from helisim.base.errors import InputError
from helisim.logs.mapping import Clock, Column, Map
from helisim.logs.report import LogFinding
from helisim.look.answers import FoundAnswer, answers, loops
from helisim.look.command import Looked, by_axis, command, main_excitations
from helisim.look.excitation import FoundExcitation, excitation
from helisim.look.guess import CONTROLS, SeenChannel
from helisim.look.opened import AS_RECORDED, Asked, Opened, SeenClock, opened
from helisim.look.systemid.autopilots import own_sweeps
from helisim.look.systemid.sweeps import FlownSweep
from helisim.records.channels import CHANNELS

_SHOWN = 8
"""Unused columns that are printed."""
_BEST = 4
"""Answers to a control that are printed."""


@dataclass(frozen=True)
class LogLook:
    """What a first look at one log found.

    Attributes:
        path: the file.
        format: such as "ULog".
        clocks: of its channels.
        channels: that it seems to have, with the reasons.
        unused: its other columns.
        duration: of what can be used, s.
        parts: uninterrupted ones of it.
        sweeps: that it says itself were injected, where it is of ArduPilot's mode SystemID.
        excitations: what its controls did; those that only react are left out. Not looked for
            where there are sweeps.
        answers: channels that answer coherently, and in which band, best first.
        findings: what is wrong, suspicious or to be noted, with the option to try.
    """

    path: str
    format: str
    clocks: tuple[SeenClock, ...]
    channels: tuple[SeenChannel, ...]
    unused: tuple[str, ...]
    duration: float
    parts: int
    excitations: tuple[FoundExcitation, ...]
    answers: tuple[FoundAnswer, ...]
    findings: tuple[LogFinding, ...]
    sweeps: tuple[FlownSweep, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {
            "path": self.path,
            "format": self.format,
            "clocks": [one.to_dict() for one in self.clocks],
            "channels": [one.to_dict() for one in self.channels],
            "unused_columns": list(self.unused),
            "duration_s": self.duration,
            "parts": self.parts,
            "sweeps": [one.to_dict() for one in self.sweeps],
            "excitations": [one.to_dict() for one in self.excitations],
            "answers": [one.to_dict() for one in self.answers],
            "findings": [one.to_dict() for one in self.findings],
        }

    def __str__(self) -> str:
        parts = f" in {self.parts} parts" if self.parts > 1 else ""
        lines = [f"{self.path}: {self.format}, {self.duration:.4g} s{parts} can be used"]
        for clock in self.clocks:
            gaps = f", {clock.gaps} gap{'s' * (clock.gaps > 1)}" if clock.gaps else ""
            even = (
                f"jitter {1e3 * clock.jitter:.2g} ms rms, at most {1e3 * clock.largest:.2g} ms"
                if clock.even != "uniform"
                else "uniform"
            )
            even = f"irregular: {even}" if clock.even == "irregular" else even
            lines.append(
                f"  clock {clock.name}: {clock.rate:.4g} Hz, {clock.samples} samples, "
                f"{clock.duration:.4g} s, {even}{gaps}"
            )
        lines += _channel_lines(self.channels)
        if self.unused:
            more = f", and {len(self.unused) - _SHOWN} more" if len(self.unused) > _SHOWN else ""
            lines.append(f"  not used: {', '.join(self.unused[:_SHOWN])}{more}")
        lines += [f"  {one}" for one in self.sweeps]
        lines += [_excitation_line(one) for one in self.excitations]
        if self.parts and not self.excitations and not self.sweeps:
            lines.append(f"  {_without_control(self.channels)}")
        lines += _answer_lines(self.answers)
        if self.excitations and not self.answers:
            lines.append("  nothing answers coherently: sweep longer, larger, or in calmer air")
        lines += [
            f"  {'!' if one.option and not one.repaired else 'note'}: {one.text}"
            for one in self.findings
        ]
        return "\n".join(lines)


@dataclass(frozen=True)
class Look:
    """What a first look at logs found.

    Attributes:
        logs: one each.
        command: to run next; empty if nothing can be identified from them.
    """

    logs: tuple[LogLook, ...]
    command: str

    def __repr__(self) -> str:
        kinds = ", ".join(
            f"{Path(one.path).name}: {' '.join(e.kind + ' ' + e.channel for e in one.excitations)}"
            for one in self.logs
        )
        return f"Look({kinds or 'no logs'})"

    def __str__(self) -> str:
        lines = [*map(str, self.logs), ""]
        lines.append(f"run next:\n  {self.command}" if self.command else "nothing to run next")
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {"logs": [one.to_dict() for one in self.logs], "command": self.command}


def look(
    logs: str | Path | Iterable[str | Path],
    *,
    channels: Map | Mapping[str, Column | str] | None = None,
    time: Clock | str | None = None,
    resample_hz: float | None = None,
    repair: Iterable[str] = (),
    max_gap: float | None = None,
    start: float | None = None,
    stop: float | None = None,
) -> Look:
    """Look at flight logs of which nothing need be known.

    Finds channels and guesses units, with reasons; rates, gaps and jitter; which control was swept,
    from when to when; which channels answer and in which band; closed loops; what can't be as it
    is declared; and the `helisim identify` to run next. Nothing is written.

    Args:
        logs: one file or several, of any format that `read_log` reads.
        channels: channel -> column, as far as they are known; the others are guessed.
        time: as for `read_log`, and so are all others.
        resample_hz: Hz.
        repair: see `REPAIRS`; what else is needed is done, and said.
        max_gap: s.
        start: s.
        stop: s.

    Raises:
        StorageError: a file can't be read, or is of no known format.
        InputError: an option doesn't exist.
    """
    paths = [logs] if isinstance(logs, str | Path) else list(logs)
    if not paths:
        raise InputError("no logs were given; expected at least one file")
    map_ = _map(channels, time)
    repairs = (repair,) if isinstance(repair, str) else tuple(repair)
    asked = Asked(map_, resample_hz, repairs, max_gap, start, stop)
    looked = [_looked(Path(path), asked) for path in paths]
    return Look(tuple(map(_log_look, looked)), _next(looked))


def _next(looked: Sequence[Looked]) -> str:
    """Return the command to run next: logs that say themselves what was swept need no option."""
    if all(any(not sweep.unused for sweep in one.sweeps) for one in looked):
        return shlex.join(["helisim", "identify", *(str(one.path) for one in looked)])
    return command(looked)


def _map(channels: Map | Mapping[str, Column | str] | None, time: Clock | str | None) -> Map:
    if not isinstance(channels, Map):
        given = {
            name: Column(column) if isinstance(column, str) else column
            for name, column in (channels or {}).items()
        }
        channels = Map(given)
    if time is None:
        return channels
    return Map(channels.channels, Clock(time) if isinstance(time, str) else time, channels.layout)


def _looked(path: Path, asked: Asked) -> Looked:
    log = opened(path, asked)
    if not log.records:
        return Looked(path, log, (), (), ())
    swept = own_sweeps(path)
    if swept:
        return Looked(path, log, (), (), (), swept)
    record = max(log.records, key=lambda one: one.duration)
    rates = {one.name: one.rate for one in log.seen}
    moved = [
        found
        for name in CONTROLS
        if name in record
        for found in [excitation(name, record.time, record[name])]
        if found is not None
    ]
    excited = main_excitations(moved)
    answering = answers(record, by_axis(excited), rates)
    return Looked(path, log, excited, answering, tuple(loops(record, answering, rates)))


def _log_look(looked: Looked) -> LogLook:
    log: Opened = looked.log
    return LogLook(
        path=str(looked.path),
        format=log.format,
        clocks=log.clocks,
        channels=log.seen,
        unused=log.unused,
        duration=sum(record.duration for record in log.records),
        parts=len(log.records),
        excitations=looked.excited,
        answers=looked.answers,
        findings=(*log.findings, *looked.loops),
        sweeps=looked.sweeps,
    )


def _channel_lines(channels: Sequence[SeenChannel]) -> list[str]:
    """Return a line a channel; one for all that are as recorded."""
    ours = [one.name for one in channels if one.why == AS_RECORDED]
    lines = [f"  channels, as recorded: {', '.join(ours)}"] if ours else []
    return lines + [_channel_line(one) for one in channels if one.why != AS_RECORDED]


def _channel_line(one: SeenChannel) -> str:
    unit = one.column.unit or "?"
    sign = "-" if one.column.sign < 0 else ""
    still = "" if one.moves else ", constant"
    return (
        f"  {one.name} = {sign}{one.column.column!r} [{unit}], {one.rate:.4g} Hz, {one.low:.4g} to "
        f"{one.high:.4g}{still}: {one.why}"
    )


def _without_control(channels: Sequence[SeenChannel]) -> str:
    """Return why there is nothing to identify from, and what to do."""
    if any(one.name in CONTROLS for one in channels):
        return "no control moves: there is nothing to identify from"
    return (
        "no column looks like a control: say which of those not used is one, such as "
        "--channel lat=COLUMN:percent"
    )


def _answer_lines(answers: Sequence[FoundAnswer]) -> list[str]:
    """Return a line a control: what answers it, in which band."""
    lines = []
    for control in dict.fromkeys(one.input for one in answers):
        mine = [one for one in answers if one.input == control]
        shown = [
            f"{one.output} from {one.low:.3g} to {one.high:.3g} ({one.coherence:.2f})"
            for one in mine[:_BEST]
        ]
        more = f", and {len(mine) - _BEST} more" if len(mine) > _BEST else ""
        lines.append(f"  coherent with {control}, rad/s (mean coherence): {', '.join(shown)}{more}")
    return lines


def _excitation_line(one: FoundExcitation) -> str:
    unit = CHANNELS[one.channel].unit
    size = f"{one.amplitude:.3g}" + ("" if unit == "1" else f" {unit}")
    return (
        f"  {one.kind} on {one.channel} from {one.start:.4g} to {one.stop:.4g} s, {one.low:.3g} to "
        f"{one.high:.3g} rad/s, amplitude {size}"
    )
