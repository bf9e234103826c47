"""A first look at logs: what they hold, what was flown, what is usable, and what to run next."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

from helisim.base.errors import InputError
from helisim.base.note import Option
from helisim.logs.mapping import Clock, Column, Map
from helisim.logs.read import reading_options
from helisim.logs.report import OURS, LogFinding
from helisim.look.channels import AS_RECORDED, CONTROLS, SeenChannel
from helisim.look.excitation import FoundAnswer, FoundExcitation, answers, excitation, loops
from helisim.look.opened import Opened, SeenClock, opened
from helisim.look.sweeps import FlownSweep, own_sweeps
from helisim.records.record import CHANNELS, IN1, IN2, RATES

_SHOWN = 8
"""Unused columns that are printed."""
_BEST = 4
"""Answers to a control that are printed."""
_QUIET = ("spikes", "frozen", "lost samples")
"""Findings that are but noted, though there is something that mends them."""
_STRUCTURES = (
    ("rollpitch", ("lat", "lon"), ("p", "q")),
    ("heave", ("col",), ("w",)),
    ("yaw_base", ("ped",), ("r",)),
)
"""Built-in structures of helicopters by inputs and outputs, the largest first."""
_HELICOPTER = ("swash", "cyclic", "collective", "pedal")
_MAIN = 0.35  # of the largest excitation among controls of a kind, from which another counts
_MARGIN = 2.0  # s, before and after what is used of a log
_SHORT = 0.3
"""Of the longest part of a log: shorter ones, which would raise the lowest frequency, stay out."""
_WORTH_CUTTING = 0.5  # of a log, that an excitation fills at most where the rest is left out
_STICK: dict[str, str] = dict(zip(IN1, IN2))
_AXIS = {name: name for name in IN1} | {stick: name for name, stick in _STICK.items()}


@dataclass(frozen=True)
class Proposal:
    """A command to run next, as data.

    Attributes:
        command: such as "identify".
        logs: the files.
        options: name, as Python has it, and values, such as ("band", ("1.7", "31")); in order.
    """

    command: str
    logs: tuple[str, ...]
    options: tuple[tuple[str, tuple[str, ...]], ...] = ()

    def __str__(self) -> str:
        said = [f"{name} {' '.join(values)}" for name, values in self.options]
        return "; ".join([f"{self.command} {' '.join(self.logs)}", *said])

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        options = [[name, *values] for name, values in self.options]
        return {"command": self.command, "logs": list(self.logs), "options": options}


@dataclass(frozen=True)
class LogLook:
    """Findings of a first look at one log.

    Attributes:
        path: the file.
        format: such as "ULog".
        clocks: of its channels.
        channels: that it seems to have, with the reasons.
        unused: its other columns.
        duration: of what can be used, s.
        parts: uninterrupted ones of it.
        excitations: what its controls did; those that only react are left out. Not looked for
            where there are sweeps.
        answers: channels that answer coherently, and in which band, best first.
        findings: what is wrong, suspicious or to be noted, with the option to try.
        sweeps: that it says itself were injected, where it is of ArduPilot's mode SystemID.
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
        listed = ("sweeps", "excitations", "answers", "findings")
        return {
            "path": self.path,
            "format": self.format,
            "clocks": [one.to_dict() for one in self.clocks],
            "channels": [one.to_dict() for one in self.channels],
            "unused_columns": list(self.unused),
            "duration_s": self.duration,
            "parts": self.parts,
            **{name: [one.to_dict() for one in getattr(self, name)] for name in listed},
        }

    def __str__(self) -> str:
        return self.worded(lambda finding: finding.text)

    def worded(self, word: Callable[[LogFinding], str]) -> str:
        """Return what was found for people, each finding as `word` has it."""
        parts = f" in {self.parts} parts" if self.parts > 1 else ""
        lines = [f"{self.path}: {self.format}, {self.duration:.4g} s{parts} can be used"]
        lines += [f"  {clock}" for clock in self.clocks]
        ours = [one.name for one in self.channels if one.why == AS_RECORDED]
        lines += [f"  channels, as recorded: {', '.join(ours)}"] if ours else []
        lines += [f"  {one}" for one in self.channels if one.why != AS_RECORDED]
        if self.unused:
            more = f", and {len(self.unused) - _SHOWN} more" if len(self.unused) > _SHOWN else ""
            lines.append(f"  not used: {', '.join(self.unused[:_SHOWN])}{more}")
        lines += [f"  {one}" for one in self.sweeps]
        for one in self.excitations:
            unit = CHANNELS[one.channel].unit
            size = f"{one.amplitude:.3g}" + ("" if unit == "1" else f" {unit}")
            lines.append(
                f"  {one.kind} on {one.channel} from {one.start:.4g} to {one.stop:.4g} s, "
                f"{one.low:.3g} to {one.high:.3g} rad/s, amplitude {size}"
            )
        for control in dict.fromkeys(one.input for one in self.answers):
            mine = [one for one in self.answers if one.input == control]
            shown = [
                f"{one.output} from {one.low:.3g} to {one.high:.3g} ({one.coherence:.2f})"
                for one in mine[:_BEST]
            ]
            shown += [f"and {len(mine) - _BEST} more"] if len(mine) > _BEST else []
            lines.append(f"  coherent with {control}, rad/s (mean coherence): {', '.join(shown)}")
        for one in (*self._missing(), *self.findings):
            urgent = one.remedy and not one.repaired and one.kind not in _QUIET
            mark = "" if one.kind == "missing" else "!: " if urgent else "note: "
            lines.append(f"  {mark}{word(one)}")
        return "\n".join(lines)

    def _missing(self) -> list[LogFinding]:
        """Return why there is nothing to identify from, and what to do."""
        if self.excitations and not self.answers:
            text = "nothing answers coherently: sweep longer, larger, or in calmer air"
            return [LogFinding("missing", text)]
        if self.excitations or self.sweeps or not self.parts:
            return []
        if any(one.name in CONTROLS for one in self.channels):
            text = "no control moves: there is nothing to identify from"
            return [LogFinding("missing", text)]
        text = "no column looks like a control: say which of those not used is one"
        return [LogFinding("missing", text, (Option("channel", "lat=COLUMN:percent"),))]


@dataclass(frozen=True)
class Look:
    """Findings of a first look at logs.

    Attributes:
        logs: one each.
        proposal: to run next; None if nothing can be identified from them.
    """

    logs: tuple[LogLook, ...]
    proposal: Proposal | None

    def __repr__(self) -> str:
        kinds = ", ".join(
            f"{Path(one.path).name}: {' '.join(e.kind + ' ' + e.channel for e in one.excitations)}"
            for one in self.logs
        )
        return f"Look({kinds or 'no logs'})"

    def __str__(self) -> str:
        said = "nothing to run next" if self.proposal is None else f"run next:\n  {self.proposal}"
        return "\n".join([*map(str, self.logs), "", said])

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        proposal = None if self.proposal is None else self.proposal.to_dict()
        return {"logs": [one.to_dict() for one in self.logs], "proposal": proposal}


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
    is declared; and the identification to run next. Nothing is written.

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
    options = reading_options(resample_hz, repair, max_gap, 0.0, start, stop)
    looked = [_looked(opened(Path(path), Map.of(channels, time), options), path) for path in paths]
    return Look(tuple(one.found for one in looked), _proposal(looked))


class _Looked(NamedTuple):
    """The findings of a look at one log, and what was read of it."""

    found: LogLook
    log: Opened

    @property
    def durations(self) -> list[float]:
        """How long the parts last that are long enough for low frequencies, s."""
        durations = [record.duration for record in self.log.records]
        return [duration for duration in durations if duration > _SHORT * max(durations)]


def _looked(log: Opened, path: str | Path) -> _Looked:
    duration = sum(record.duration for record in log.records)
    head = (str(path), log.format, log.clocks, log.seen, log.unused, duration, len(log.records))
    swept = own_sweeps(Path(path)) if log.records else ()
    if swept or not log.records:
        return _Looked(LogLook(*head, (), (), log.findings, swept), log)
    record = max(log.records, key=lambda one: one.duration)
    rates = {one.name: one.rate for one in log.seen}
    controls = [name for name in CONTROLS if name in record]
    moved = [excitation(name, record.time, record[name]) for name in controls]
    excited = _main(tuple(one for one in moved if one is not None))
    found = answers(record, _by_axis(excited), rates)
    said = (*log.findings, *loops(record, found, rates))
    return _Looked(LogLook(*head, excited, found, said), log)


def _main(found: tuple[FoundExcitation, ...]) -> tuple[FoundExcitation, ...]:
    """Return those that aren't just a control's reaction to another one's excitation."""
    shaped = [one for one in found if one.kind != "motion"] or found
    kept = []
    for group in (IN1, IN2):
        mine = [one for one in shaped if one.channel in group]
        most = max((one.amplitude for one in mine), default=0.0)
        kept += [one for one in mine if one.amplitude > _MAIN * most]
    # what moves at the actuators of other axes than a stick's is a controller's doing
    driven = {_AXIS[one.channel] for one in kept if one.channel in IN2} or set(IN1)
    return tuple(one for one in kept if _AXIS[one.channel] in driven)


def _by_axis(found: Sequence[FoundExcitation]) -> list[FoundExcitation]:
    """Return excitations with the times and the range that stick and actuator have together."""
    wide = []
    for one in found:
        mine = [other for other in found if _AXIS[other.channel] == _AXIS[one.channel]]
        low, start = min(other.low for other in mine), min(other.start for other in mine)
        high, stop = max(other.high for other in mine), max(other.stop for other in mine)
        wide.append(replace(one, start=start, stop=stop, low=low, high=high))
    return wide


def _proposal(looked: Sequence[_Looked]) -> Proposal | None:
    """Return the identification that uses the logs, None if nothing in them can be."""
    if all(any(not sweep.unused for sweep in one.found.sweeps) for one in looked):
        return Proposal("identify", tuple(one.found.path for one in looked))  # they say themselves
    usable = [one for one in looked if one.found.answers]
    if not usable:
        return None
    structure, inputs, outputs = _choice(usable)
    used = [one for one in usable if any(a.input in inputs for a in one.found.answers)]
    options: list[tuple[str, tuple[str, ...]]] = [("structure", (structure,))]
    if structure.startswith("tf:"):
        used = used[:1] if len({one.log.format for one in used}) > 1 else used
        options += [("inputs", (",".join(inputs),)), ("outputs", (",".join(outputs),))]
    sticks = _reference(used, inputs)
    names = (*inputs, *outputs, *sticks)
    if any(one.log.format != OURS for one in used):
        columns = {one.name: one.column for one in used[0].log.seen}
        options += [("channel", (columns[name].option(name).value,)) for name in names]
    options += [("reference", (",".join(sticks),))] if sticks else []
    said: dict[tuple[str, tuple[str, ...]], None] = {}
    for one in used:
        said |= dict.fromkeys((option.name, (option.value,)) for option in one.log.options)
        if len(one.durations) < len(one.log.records):
            said["min_duration", (f"{_SHORT * max(one.durations):.2g}",)] = None
    options += [*said, *_cut(used, inputs)]
    clocks = [
        clock
        for one in used
        for mine in [{seen.clock for seen in one.log.seen if seen.name in names}]
        for clock in one.log.clocks
        if clock.name in mine
    ]
    if any(one.even == "irregular" for one in clocks) and "resample" not in dict(options):
        options.append(("resample", (f"{min(clock.rate for clock in clocks):.3g}",)))
    low, high = _band(used, inputs, outputs)
    options.append(("band", (f"{low:.2g}", f"{high:.2g}")))
    return Proposal("identify", tuple(one.found.path for one in used), tuple(options))


def _choice(usable: Sequence[_Looked]) -> tuple[str, tuple[str, ...], tuple[str, ...]]:
    """Return the structure, and its inputs and outputs: a helicopter's where it is one."""
    known = [answer for one in usable for answer in one.found.answers]
    have = {(one.input, one.output) for one in known}
    words = [" ".join(seen.column.column.lower() for seen in one.log.seen) for one in usable]
    heli = all(
        one.log.format == OURS or any(word in said for word in _HELICOPTER)
        for one, said in zip(usable, words)
    )
    for name, inputs, outputs in _STRUCTURES:
        driven = all(any((i, o) in have for i in inputs) for o in outputs)
        if heli and driven and all(any((i, o) in have for o in outputs) for i in inputs):
            return name, inputs, outputs
    best = max(known, key=lambda a: (a.output in RATES, a.input in IN1, a.coherence))
    return best.structure, (best.input,), (best.output,)


def _reference(used: Sequence[_Looked], inputs: Sequence[str]) -> tuple[str, ...]:
    """Return the sticks, where a loop is closed and all were excited."""
    sticks = tuple(_STICK.get(name, "") for name in inputs)
    found = [finding for one in used for finding in one.found.findings if finding.kind == "loop"]
    closed = {o.value for one in found for o in one.remedy if isinstance(o, Option)}
    excited = {e.channel for one in used for e in one.found.excitations}
    return sticks if closed & set(sticks) and set(sticks) <= excited else ()


def _cut(used: Sequence[_Looked], inputs: Sequence[str]) -> list[tuple[str, tuple[str, ...]]]:
    """Return the options that leave out what is before and after the excitation.

    They hold for all logs, so that they span what any of them needs.
    """
    mine = [e for one in used for e in _by_axis(one.found.excitations) if e.channel in inputs]
    start, stop = min(one.start for one in mine), max(one.stop for one in mine)
    spans = [float(one.log.records[0].time[-1] - one.log.records[0].time[0]) for one in used]
    several = any(len(one.log.records) != 1 for one in used)
    if several or stop - start >= _WORTH_CUTTING * min(spans):
        return []
    first, last = f"{max(start - _MARGIN, 0.0):.4g}", f"{stop + _MARGIN:.4g}"
    return [("from", (first,)), ("to", (last,))]


def _band(
    used: Sequence[_Looked], inputs: Sequence[str], outputs: Sequence[str]
) -> tuple[float, float]:
    """Return the band that is coherent in any response, as far as the records resolve it."""
    every = [answer for one in used for answer in one.found.answers]
    mine = [one for one in every if one.input in inputs and one.output in outputs]
    durations = [duration for one in used for duration in one.durations]
    window = min(min(durations) / 2.0, sum(durations) / 5.0)
    low = max(min(a.low for a in mine), 1.02 * 2.0 * math.pi / window)
    digits = 1 - math.floor(math.log10(low))
    return math.ceil(low * 10.0**digits) / 10.0**digits, max(a.high for a in mine)
