"""First look at logs: channels, excitation, quality, and the command to run next."""

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from helisim.base.errors import HelisimError, InputError
from helisim.base.note import Option
from helisim.base.settings import to_plain
from helisim.ident import identify, identify_records
from helisim.ident.frf import resolved_band
from helisim.ident.likelihood import falls_short
from helisim.ident.rational import OF_FORCES, ORDERS, order
from helisim.ident.structures import named
from helisim.ident.windows import lowest_line
from helisim.logs.mapping import Clock, Column, Map
from helisim.logs.report import OURS, LogFinding
from helisim.logs.timing import Options
from helisim.look.channels import AS_RECORDED, CONTROLS, EXACT, GIVEN, SeenChannel
from helisim.look.excitation import (
    ANSWERS,
    LEAST_EVENTS,
    SAMPLES_A_PERIOD,
    WINDOWS,
    FoundExcitation,
    answers,
    beside,
    events,
    excitation,
    joined,
    loops,
    whole,
)
from helisim.look.opened import SHORT, LogLook, alone, opened
from helisim.look.sweeps import own_sweeps
from helisim.look.systemid import InferredFit, estimate_fits
from helisim.records.quality import ANGLES
from helisim.records.record import ACCELERATIONS, IN1, IN2, RATES, STICKS, FlightRecord

_STRUCTURES = (
    ("rollpitch_speeds", ("lat", "lon"), ("p", "q")),
    ("heave", ("col",), ("w",)),
    ("yaw_base", ("ped",), ("r",)),
)  # Structures of helicopters with inputs and outputs, largest first
_WORD = re.compile("[a-z]+")
_HELICOPTER = {
    *("swash", "cyclic", "collective", "coll", "col", "pedal", "pedals", "ped", "lateral"),
    *("longitudinal", "lat", "lon", "dlat", "dlon", "dped", "dcol", "mixer"),
}  # words of controls that others than helicopters don't have
_MAIN = 0.35  # of the largest excitation among controls of a kind, from which another counts
_FLOWN, _FLOWN_TO = 90.0, 30.0  # s and rad/s of the sweep to fly where a log shows nothing
_BEFORE, _AFTER = 2.0, 8.0  # s around one event, in which it is at rest and answered
_OWN = {"lat": ("p", "phi"), "lon": ("q", "theta"), "ped": ("r", "psi"), "col": ("w", "az")}
_AXIS = {one: name for name, stick in STICKS.items() for one in (name, stick)}


@dataclass(frozen=True)
class Proposal:
    """A command to run next; options by their names in Python, with their values."""

    command: str
    logs: tuple[str, ...]
    options: tuple[tuple[str, tuple[str, ...]], ...] = ()

    def __str__(self) -> str:
        return "; ".join(
            f"{name} {' '.join(values)}"
            for name, values in ((self.command, self.logs), *self.options)
        )


@dataclass(frozen=True)
class Look:
    """Findings of a first look at logs; `proposal` is None if nothing can be identified."""

    logs: tuple[LogLook, ...]
    proposal: Proposal | None

    def __str__(self) -> str:
        said = f"run next:\n  {self.proposal}" if self.proposal else "nothing to run next"
        return "\n".join([*map(str, self.logs), "", said])

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON: times in s, frequencies in rad/s."""
        return {"logs": [one.to_dict() for one in self.logs], "proposal": to_plain(self.proposal)}


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
    """Look at unknown flight logs: channels, units, excitation, coherent bands, loops, faults.

    Args:
        logs: files of any format that `read_log` reads.
        channels: known channel -> column; the others are guessed.
        time: as in `read_log`.
        resample_hz: rate to resample to, Hz; default as recorded.
        repair: see `REPAIRS`; what else is needed is done, and reported.
        max_gap: longest gap that is bridged, its samples missing, s.
        start: what is earlier is left out, s after the log's first stamp.
        stop: what is later is left out, s after the log's first stamp.

    Raises StorageError for unreadable or unknown files, InputError for unknown options.
    """
    paths = [logs] if isinstance(logs, str | Path) else list(logs)
    if not paths:
        raise InputError("no logs were given; expected at least one file")
    options = Options(resample_hz, repair, max_gap, 0.0, start, stop)
    map_ = Map.of(channels, time)
    found = _agreed([opened(Path(path), map_, options) for path in paths], map_, options)
    return _concluded([*map(_looked, found)], map_, options)


def _agreed(logs: Sequence[LogLook], map_: Map, options: Options) -> Iterator[LogLook]:
    """Yield logs whose columns of one name have one unit: that of the largest numbers."""
    largest: dict[tuple[str, str], SeenChannel] = {}
    for one in (seen for log in logs for seen in log.channels):
        key = one.name, one.column.column
        largest[key] = max(one, largest.get(key, one), key=lambda seen: seen.size)
    for log in logs:
        best = {one.name: largest[one.name, one.column.column] for one in log.channels}
        other = {
            one.name: best[one.name].column
            for one in log.channels
            if one.column.unit != best[one.name].column.unit and one.why not in (GIVEN, AS_RECORDED)
        }
        if other:
            log = opened(Path(log.path), map_.with_channels(other), options)
            why = {name: f"{best[name].why}, in another of the logs" for name in other}
            seen = (replace(one, why=why.get(one.name, one.why)) for one in log.channels)
            log = replace(log, channels=tuple(seen))
        yield log


def _looked(log: LogLook) -> LogLook:
    swept = own_sweeps(Path(log.path)) if log.records else ()
    if swept or not log.records:
        of_use = any(not one.unused for one in swept) or not (
            swept or (log.channels and not any(one.moves for one in log.channels))
        )  # nor is what moves and can't be read to be flown anew
        return replace(
            log, sweeps=swept, findings=(*log.findings, *(() if of_use else (_instead(log, ()),)))
        )
    record, *shorter = sorted(log.records, key=lambda one: -one.duration)
    rates, known = {one.name: one.rate for one in log.channels}, log.format in (OURS, *EXACT)
    there = [name for name in CONTROLS if name in record]
    parts = [record, *(one for one in shorter if one.duration > SHORT * record.duration)]
    moved = [_main(excitation(name, one.time, one[name]) for name in there) for one in parts]
    excited, said = moved[0], list(log.findings)
    found = joined(one for pair in zip(parts, moved) for one in answers(*pair, rates))
    if not found:  # what moved for a short while may have moved all along
        shaped = {one.channel: one for one in excited if one.kind != "motion"}
        every = [
            one
            for name in there
            if (one := whole(record, name, shaped[name].kind if name in shaped else "motion"))
        ]
        main = _main(every)
        # a lesser motion can be a controller's, which shows where signs are known
        found = answers(record, main, rates) or answers(record, every if known else (), rates)
        excited = tuple(
            one for one in every if one in main or one.channel in {a.input for a in found}
        )
        if found and found[0].input in {one.channel for one in excited if one.kind != "motion"}:
            found = tuple(one for one in found if one.input == found[0].input)
            excited = tuple(shaped.values())
            said.append(_event(shaped.pop(found[0].input), tuple(shaped.values())))
    own = {
        *((a.input, a.opposes) for a in found if a.output in _OWN.get(a.input, ())),
        *((one.channel, one.kind) for one in excited),
    }
    closed = sorted(
        control
        for control in {one.input for one in found if known} & {*_OWN}
        if (control, False) not in own and {(control, True), (control, "motion")} & own
    )
    found = tuple(one for one in found if one.input not in closed)
    said += loops(record, found, rates)
    if not found:
        mute = excited and not {*ANSWERS} & {*record.names}
        causes = (
            (
                closed,
                f"{' and '.join(closed)} moved as a controller's command does, and no vehicle "
                "answers it: sweep, or fly by the sticks",
                "",
            ),
            (
                mute,
                "no column looks like a rate, an attitude, a velocity or an acceleration: say "
                "which of those not used is",
                "p=COLUMN:rad/s",
            ),
            (
                excited
                and all(
                    one.kind == "motion" and events(record[one.channel]) < LEAST_EVENTS
                    for one in excited
                ),
                "controls moved in one event, with which all is coherent: sweep, or repeat it",
                "",
            ),
            (
                excited,
                f"nothing answers {' or '.join(one.channel for one in excited)} coherently: sweep "
                "longer, larger, or in calmer air",
                "",
            ),
            (
                True,
                "no control moves, or no column looks like one: say which of those not used is",
                "lat=COLUMN:percent",
            ),
        )
        why, remedy = next((why, remedy) for is_so, why, remedy in causes if is_so)
        said = [
            LogFinding("missing", why, (Option("channel", remedy),) * bool(remedy)),
            *said,
            *(
                [_instead(log, excited)]
                if not mute and {one.name for one in log.channels} & {*CONTROLS}
                else []
            ),
        ]
    return replace(log, excitations=excited, answers=found, findings=tuple(said))


def _event(one: FoundExcitation, others: Sequence[FoundExcitation]) -> LogFinding:
    """Return how to take a control's single event by itself, where others moved, too."""
    before = [each.stop for each in others if each.stop < one.start]
    after = [each.start for each in others if each.start > one.stop]
    limits = {
        "from": max(one.start - _BEFORE, 0.0, *before),
        "to": min([one.stop + _AFTER, *after]),
    }
    then = [each.channel for each in others if each.start <= one.stop and each.stop >= one.start]
    return LogFinding(
        "event",
        f"{one.channel} moved in one {one.kind} alone: what answers is taken by itself"
        + f"; {', '.join(then)} moved then, too, whose part can't be told from it" * bool(then),
        tuple(Option(name, f"{at:.4g}") for name, at in limits.items()),
    )


def _instead(log: LogLook, excited: Sequence[FoundExcitation]) -> LogFinding:
    """Return what to fly in place of a log that shows nothing."""
    there = [one.name for one in log.channels if one.name in CONTROLS]
    axes = dict.fromkeys(_AXIS[one] for one in [one.channel for one in excited] or there or IN1)
    least = math.ceil(_FLOWN_TO * SAMPLES_A_PERIOD / (2.0 * math.pi))
    slow = ", ".join(
        f"{one.name} {one.rate:.3g}"
        for one in log.channels
        if one.name in (*CONTROLS, *RATES) and one.rate < least
    )
    return LogFinding(
        "fly",
        f"fly instead a sweep of {' and one of '.join(axes)}, thrice, of {_FLOWN:g} s from "
        f"{math.ceil(20.0 * math.pi * WINDOWS / _FLOWN) / 10.0:g} to {_FLOWN_TO:g} rad/s, other "
        f"controls at rest; log controls and rates at {least} Hz or more"
        + f", not as here: {slow} Hz"
        * bool(slow),
    )


def _main(moved: Iterable[FoundExcitation | None]) -> tuple[FoundExcitation, ...]:
    """Return the excitations that are as large as the others of their kind, in their place."""
    found = [one for one in moved if one is not None]
    axes = {_AXIS[one.channel] for one in found if one.kind != "motion"}
    shaped = [one for one in found if _AXIS[one.channel] in axes] or found
    kept = []
    for group in (IN1, IN2):
        mine = [one for one in shaped if one.channel in group]
        most = max((one.amplitude for one in mine), default=0.0)
        kept += [one for one in mine if one.amplitude > _MAIN * most]
    # actuators moving on an axis without a stick's excitation: a controller's action
    driven = {_AXIS[one.channel] for one in kept if one.channel in IN2} or set(IN1)
    return tuple(one for one in kept if _AXIS[one.channel] in driven)


def _concluded(looked: Sequence[LogLook], map_: Map, reading: Options) -> Look:
    """Return a look with the first command that `identify` accepts, and why not those before it."""
    if all(any(not sweep.unused for sweep in one.sweeps) for one in looked):  # they say themselves
        return Look(tuple(looked), Proposal("identify", tuple(one.path for one in looked)))
    usable, proposal, said = [one for one in looked if one.answers], None, list[LogFinding]()
    for choice in _choices(usable):
        try:
            proposal = _proposal(usable, *choice, map_, reading)
            break
        except HelisimError as error:
            inputs, outputs = (", ".join(names) for names in choice[1:])
            said.append(LogFinding("refused", f"{outputs} over {inputs} gives no model: {error}"))
    return Look(
        tuple(
            replace(
                one,
                findings=(
                    *one.findings,
                    *said,
                    *([] if proposal else [_instead(one, one.excitations)]),
                ),
            )
            if one.answers
            else one
            for one in looked
        ),
        proposal,
    )


def _proposal(
    usable: Sequence[LogLook],
    structure: str,
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    map_: Map,
    reading: Options,
) -> Proposal:
    """Return the command for a choice. Raises HelisimError if `identify` refuses it."""
    used = [one for one in usable if any(a.input in inputs for a in one.answers)]
    written = [  # alike in all logs of a command
        (one.format, {c.column.column for c in one.channels if c.name in (*inputs, *outputs)})
        for one in used
    ]
    used = [one for one, own in zip(used, written) if own == written[0]]
    # The sticks, where all were excited: in a closed loop, or where no other control has a part and
    # they are logged as fast. Records' sticks are references by themselves.
    sticks = tuple(STICKS.get(name, "") for name in inputs)
    closed = {
        option.value
        for log in used
        for one in log.findings
        if one.kind == "loop" and (option := one.option)
    } & {*sticks}
    seen = {one.name: one for one in used[0].channels}
    moved = {one.channel for log in used for one in log.excitations if one.channel in seen}
    if not {*sticks} <= moved or not (
        closed
        or (
            any(one.format != OURS for one in used)
            and all(seen[a].rate >= seen[b].rate for a, b in zip(sticks, inputs))
        )
    ):
        sticks = ()
    known = [
        one.name
        for one, rate in ((seen.get(ANGLES.get(name, "")), seen[name]) for name in outputs)
        if one and not one.sized and one.clock == rate.clock
    ]
    # The part of other controls is not the inputs'. Records have them all, and their references; of
    # one event the estimate is by likelihood, which takes none out.
    held = (
        beside([part for one in used for part in one.records], inputs, outputs)
        if {*inputs} <= {*IN1}
        and any(one.format != OURS for one in used)
        and not closed
        and all(said.kind != "event" for one in used for said in one.findings)
        else []
    )
    # angles tell a wrong clock or unit of rates
    sticks = () if held else sticks
    names = (*inputs, *held, *outputs, *sticks, *known)
    used = [alone(log, names, map_, reading) for log in used]
    columns = names if any(one.format != OURS for one in used) else ()
    event = {
        cut.name: cut.value
        for one in used
        for said in one.findings
        if said.kind == "event" and len(used) == 1
        for cut in said.remedy
        if isinstance(cut, Option)
    }
    band = _band(used, inputs, outputs, joint=not columns or bool(sticks))
    wanted = InferredFit(structure, inputs, outputs, tuple(held), sticks, band, "")
    if structure.startswith("tf:") and outputs[0] in (*RATES, *ACCELERATIONS):
        wanted = _followed([part for one in used for part in one.records], wanted)
    longest = (max(one.durations) for one in used if len(one.durations) < len(one.records))
    cut = replace(
        reading,
        min_duration=float(f"{SHORT * min(longest, default=0.0):.2g}"),
        start=float(event["from"]) if event else reading.start,
        stop=float(event["to"]) if event else reading.stop,
    )
    used = used if cut == reading else [alone(log, names, map_, cut) for log in used]
    structure = _accepted([part for one in used for part in one.records], wanted, bool(event))
    options: list[tuple[str, tuple[str, ...]]] = [
        ("structure", (structure,)),
        *(
            [("inputs", (",".join(inputs),)), ("outputs", (",".join(outputs),))]
            if structure.startswith("tf:")
            else ()
        ),
        *(("channel", (seen[name].column.option(name).value,)) for name in columns),
        *([("reference", (",".join(sticks),))] if sticks else ()),
        *([("conditioning", (",".join(held),))] if held else ()),
        *dict.fromkeys((o.name, (o.value,)) for one in used for o in one.options),
        *([("min_duration", (f"{cut.min_duration:g}",))] if cut.min_duration else ()),
        *(
            (name, (f"{at:.6g}",))
            for name, at in (("from", cut.start), ("to", cut.stop))
            if at is not None
        ),
        *([] if event else [("band", tuple(f"{edge:.2g}" for edge in band))]),
    ]
    return Proposal("identify", tuple(one.path for one in used), tuple(options))


def _followed(records: Sequence[FlightRecord], wanted: InferredFit) -> InferredFit:
    """Return the fit with the smallest transfer function that follows all records' estimate."""
    try:
        (found,) = estimate_fits(records, [wanted])
    except HelisimError:
        return wanted
    at = found.usable()[0, 0]
    if not at.any():
        return wanted
    structure = "tf:{}/{}".format(
        *order(
            found.frequency[at],
            found.response[0, 0, at],
            found.random_error[0, 0, at],
            ORDERS if wanted.outputs[0] in RATES else OF_FORCES,
        )
    )
    return replace(wanted, structure=structure)


def _accepted(records: Sequence[FlightRecord], wanted: InferredFit, event: bool) -> str:
    """Return a structure, or the lower order that `identify` advises in its place.

    The command for an `event` names no band. Raises HelisimError where `identify` refuses it.
    """
    own = named(wanted.structure, wanted.inputs, wanted.outputs)
    asked = replace(wanted, band=resolved_band(records) if event else wanted.band)
    fit = (
        identify_records(records, own)
        if event and not (wanted.conditioning or wanted.reference) and falls_short(records, None)
        else identify(estimate_fits(records, [asked])[0], own)
    )
    return (
        _accepted(records, replace(wanted, structure=fit.lower), event)
        if fit.lower
        else wanted.structure
    )


def _choices(
    usable: Sequence[LogLook],
) -> Iterator[tuple[str, tuple[str, ...], tuple[str, ...]]]:
    """Yield structures with inputs and outputs, the best first: of each input one of its own."""
    known = [answer for one in usable for answer in one.answers]
    have = {(one.input, one.output) for one in known}
    heli = all(
        one.format == OURS
        or any(_HELICOPTER & {*_WORD.findall(seen.column.column.lower())} for seen in one.channels)
        for one in usable
    )
    for name, inputs, outputs in _STRUCTURES:
        driven = all(any((i, o) in have for i in inputs) for o in outputs)
        if heli and driven and all(any((i, o) in have for o in outputs) for i in inputs):
            yield name, inputs, outputs
    best = sorted(
        known,
        key=lambda a: (
            a.output in RATES,
            a.input in IN1,
            a.output in _OWN.get(a.input, ()),
            a.coherence,
        ),
        reverse=True,
    )
    yield from (
        (one.structure, (one.input,), (one.output,))
        for k, one in enumerate(best)
        if one.input not in {better.input for better in best[:k]}
    )


def _band(
    used: Sequence[LogLook], inputs: Sequence[str], outputs: Sequence[str], *, joint: bool
) -> tuple[float, float]:
    """Return the band in which any response is coherent and the records resolve it, rad/s.

    A stick excites in a wider band than what a loop makes of it, and no lower than what it swept;
    where the estimate is `joint`, by the stick, its responses alone say where the band begins.
    """
    mine = [a for one in used for a in one.answers if a.output in outputs]
    spans = [
        [(a.low, a.high) for a in mine if a.input in group]
        for group in (inputs, [STICKS[name] for name in inputs if name in STICKS])
    ]
    low = max(
        1.02 * lowest_line([duration for one in used for duration in one.durations]),
        *(min(one)[0] for one in spans[joint and bool(spans[1]) :] if one),
    )
    digits = 1 - math.floor(math.log10(low))
    return math.ceil(low * 10.0**digits) / 10.0**digits, float(
        f"{max(high for one in spans for _, high in one):.2g}"
    )
