"""Writes the command to run next, so that it works when it is pasted."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from shlex import join, quote
from typing import NamedTuple

from helisim.logs.mapping import Column
from helisim.logs.report import OURS, LogFinding
from helisim.look.answers import FoundAnswer
from helisim.look.excitation import FoundExcitation
from helisim.look.opened import Opened
from helisim.look.systemid.sweeps import FlownSweep
from helisim.records.channels import IN1, IN2

_STRUCTURES = (
    ("rollpitch", ("lat", "lon"), ("p", "q")),
    ("heave", ("col",), ("w",)),
    ("yaw_base", ("ped",), ("r",)),
)
"""Built-in structures of helicopters by inputs and outputs, the largest first."""
_MAIN = 0.35
"""Of the largest excitation among controls of a kind, from which another counts."""
_MARGIN = 2.0
"""s, before and after what is used of a log."""
_SHORT = 0.3
"""Of the longest part of a log: shorter ones, which would raise the lowest frequency, stay out."""
_WORTH_CUTTING = 0.5
"""Of a log, that an excitation fills at most where the rest is left out."""


class Looked(NamedTuple):
    """What a look at one log found.

    Attributes:
        path: the file.
        log: what was read of it.
        excited: what its controls did.
        answers: what answered them, best first.
        loops: where a loop is closed.
        sweeps: that it says itself were injected.
    """

    path: Path
    log: Opened
    excited: tuple[FoundExcitation, ...]
    answers: tuple[FoundAnswer, ...]
    loops: tuple[LogFinding, ...]
    sweeps: tuple[FlownSweep, ...] = ()


def main_excitations(found: Sequence[FoundExcitation]) -> tuple[FoundExcitation, ...]:
    """Return those that aren't just a control's reaction to another one's excitation."""
    shaped = [one for one in found if one.kind != "motion"] or list(found)
    kept = []
    for group in (IN1, IN2):
        mine = [one for one in shaped if one.channel in group]
        most = max((one.amplitude for one in mine), default=0.0)
        kept += [one for one in mine if one.amplitude > _MAIN * most]
    sticks = {one.channel for one in kept if one.channel in IN2}
    if not sticks:
        return tuple(kept)
    # what moves at the actuators of other axes is a controller's doing
    driven = sticks | {actuator for actuator, stick in zip(IN1, IN2) if stick in sticks}
    return tuple(one for one in kept if one.channel in driven)


def by_axis(found: Sequence[FoundExcitation]) -> tuple[FoundExcitation, ...]:
    """Return excitations with the times and the range that stick and actuator have together."""
    axis = {**{name: name for name in IN1}, **dict(zip(IN2, IN1))}
    wide = []
    for one in found:
        mine = [other for other in found if axis[other.channel] == axis[one.channel]]
        wide.append(
            replace(
                one,
                start=min(other.start for other in mine),
                stop=max(other.stop for other in mine),
                low=min(other.low for other in mine),
                high=max(other.high for other in mine),
            )
        )
    return tuple(wide)


def command(looked: Sequence[Looked]) -> str:
    """Return a `helisim identify` that uses the logs, empty if nothing in them can be."""
    usable = [one for one in looked if one.answers]
    if not usable:
        return ""
    structure, inputs, outputs = _choice(usable)
    used = [one for one in usable if any(a.input in inputs for a in one.answers)]
    if structure.startswith("tf:"):
        used = used[:1] if len({one.log.format for one in used}) > 1 else used
    words = ["helisim", "identify", *(str(one.path) for one in used), "--structure", structure]
    if structure.startswith("tf:"):
        words += ["--inputs", ",".join(inputs), "--outputs", ",".join(outputs)]
    reference = _reference(used, inputs)
    sticks = reference[0].split(" ")[1].split(",") if reference else []
    parts = [join(words), *_channels(used, (*inputs, *outputs, *sticks)), *reference]
    said = dict.fromkeys(option for one in used for option in _reading(one))
    parts += said
    parts += _cut(used, inputs)
    if not any(option.startswith("--resample") for option in said):
        parts += _resampling(used, (*inputs, *outputs, *sticks))
    low, high = _band(used, inputs, outputs)
    parts.append(f"--band {low:.2g} {high:.2g}")
    return " ".join(parts)


def _choice(usable: Sequence[Looked]) -> tuple[str, tuple[str, ...], tuple[str, ...]]:
    """Return the structure, and its inputs and outputs: a helicopter's where it is one."""
    have = {(a.input, a.output) for one in usable for a in one.answers}
    heli = all(one.log.format == OURS or _rotors(one.log) for one in usable)
    for name, inputs, outputs in _STRUCTURES:
        if (
            heli
            and all(any((i, o) in have for i in inputs) for o in outputs)
            and all(any((i, o) in have for o in outputs) for i in inputs)
        ):
            return name, inputs, outputs
    rank = {name: k for k, name in enumerate((*IN1, *IN2))}
    best = max(
        (a for one in usable for a in one.answers),
        key=lambda a: (a.output in ("p", "q", "r"), rank[a.input] < len(IN1), a.coherence),
    )
    return best.structure, (best.input,), (best.output,)


def _rotors(log: Opened) -> bool:
    """Return whether columns have a helicopter's words."""
    words = " ".join(one.column.column.lower() for one in log.seen)
    return any(word in words for word in ("swash", "cyclic", "collective", "pedal"))


def _channels(used: Sequence[Looked], names: Sequence[str]) -> list[str]:
    """Return the options that say which column is which channel; none for helisim records."""
    if all(one.log.format == OURS for one in used):
        return []
    columns = {one.name: one.column for one in used[0].log.seen}
    return ["--channel " + quote(f"{name}={_column(columns[name])}") for name in names]


def _reference(used: Sequence[Looked], inputs: Sequence[str]) -> list[str]:
    """Return the option that names the sticks, where a loop is closed and all were excited."""
    sticks = [dict[str, str](zip(IN1, IN2)).get(name, "") for name in inputs]
    closed = any(loop.option.endswith(s) for one in used for loop in one.loops for s in sticks if s)
    excited = {e.channel for one in used for e in one.excited}
    return [f"--reference {','.join(sticks)}"] if closed and set(sticks) <= excited else []


def _column(column: Column) -> str:
    sign = ":sign=-1" if column.sign < 0 else ""
    trim = f":trim={column.trim:g}" if column.trim is not None else ""
    span = f":range={column.range:g}" if column.range is not None else ""
    return f"{column.column}:{column.unit or ''}{sign}{trim}{span}"


def _reading(one: Looked) -> list[str]:
    """Return the options that a log is read with: repairs, clock, and the parts that are used."""
    options = list(one.log.options)
    durations = _durations(one)
    if len(durations) < len(one.log.records):
        options.append(f"--min-duration {_SHORT * max(durations):.2g}")
    return options


def _cut(used: Sequence[Looked], inputs: Sequence[str]) -> list[str]:
    """Return the options that leave out what is before and after the excitation.

    They hold for all logs, so that they span what any of them needs.
    """
    if any(len(one.log.records) != 1 for one in used):
        return []
    edges, spans = [], []
    for one in used:
        (record,) = one.log.records
        mine = [e for e in by_axis(one.excited) if e.channel in inputs]
        edges += [(e.start, e.stop) for e in mine]
        spans.append(record.time[-1] - record.time[0])
    start, stop = min(low for low, _ in edges), max(high for _, high in edges)
    if stop - start >= _WORTH_CUTTING * min(spans):
        return []
    return [f"--from {max(start - _MARGIN, 0.0):.4g} --to {stop + _MARGIN:.4g}"]


def _resampling(used: Sequence[Looked], names: Sequence[str]) -> list[str]:
    """Return the option that an irregular clock of the channels needs."""
    clocks = [
        clock
        for one in used
        for mine in [{seen.clock for seen in one.log.seen if seen.name in names}]
        for clock in one.log.clocks
        if clock.name in mine
    ]
    if all(clock.even != "irregular" for clock in clocks):
        return []
    return [f"--resample {min(clock.rate for clock in clocks):.3g}"]


def _durations(one: Looked) -> list[float]:
    """Return how long the parts last that are long enough for low frequencies, s."""
    durations = [record.duration for record in one.log.records]
    return [duration for duration in durations if duration > _SHORT * max(durations)]


def _band(
    used: Sequence[Looked], inputs: Sequence[str], outputs: Sequence[str]
) -> tuple[float, float]:
    """Return the band that is coherent in any response, as far as the records resolve it."""
    mine = [a for one in used for a in one.answers if a.input in inputs and a.output in outputs]
    durations = [duration for one in used for duration in _durations(one)]
    window = min(min(durations) / 2.0, sum(durations) / 5.0)
    low = max(min(a.low for a in mine), 1.02 * 2.0 * math.pi / window)
    return _up(low), max(a.high for a in mine)


def _up(value: float) -> float:
    """Return a number of two digits that isn't smaller."""
    digits = 1 - math.floor(math.log10(value))
    return math.ceil(value * 10.0**digits) / 10.0**digits
