"""Loops of an ArduCopter-heli as flown, from SystemID's sweeps of the mixer (SID_AXIS 10 to 12)."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import Akima1DInterpolator

from helisim.base.arrays import Real
from helisim.base.errors import InputError, LogError
from helisim.handling.arducopter import ADDED, COMMANDS, ArduCopterLaw
from helisim.handling.measured.margins import Cut, MeasuredMargins, margins
from helisim.logs.dataflash import DataFlash, Table, open_dataflash
from helisim.logs.source import file_digest
from helisim.look.sweeps import DAMAGE, FlownSweep, sweeps, usual_step, within
from helisim.records.missing import completed, in_gaps, told
from helisim.records.record import Channel, FlightRecord

Line = tuple[Real, Real]  # increasing times, s, and a signal at them, (n_time,) each
_FURTHER = "to see gain margins let the sweeps go on to a higher frequency: SID_F_STOP_HZ"
LOGGED = {
    "lat": ("ROut", "PIDR", "DesRoll"),
    "lon": ("POut", "PIDP", "DesPitch"),
    "ped": ("YOut", "PIDY", "DesYaw"),
}
"""Axis -> field of RATE to the mixer, message of its PID, attitude target."""
_GAINS = ("ATC_RAT_", "ATC_ANG_")  # parameters of the rate and attitude loops begin so
_TERMS = ("P", "I", "D", "FF", "DFF")
# _LOST: share of rows that may be lost without a word
# _SLOWEST: s: a log with longer steps shows no loop
# _SETTLES: s before a sweep, from which the law's answer to the sticks is followed
_LOST, _SLOWEST, _SETTLES = 0.02, 0.02, 1.0
_SET = "set LOG_BITMASK's bits 0 and 1"


@dataclass(frozen=True, eq=False)
class FlownLoops:
    """Loops of an autopilot: sweeps of each log that cut one, their records, cuts and remarks."""

    logs: dict[str, tuple[FlownSweep, ...]]
    records: tuple[FlightRecord, ...]
    cuts: tuple[Cut, ...]
    remarks: tuple[str, ...]

    def __str__(self) -> str:
        fields = {cut.axis: LOGGED[cut.axis] for cut in self.cuts}
        lines = [
            *(one for path, found in self.logs.items() for one in (f"{path}:", *map(str, found))),
            "cut at the actuators, where 1 is full command of the mixer, less what the pilot's "
            "sticks command by the law's parameters:",
            *(
                f"  {axis}: goes on = RATE.{output}, injected = SIDD.Targ, a tick later, comes "
                f"back = {pid}'s {', '.join(_TERMS)}"
                for axis, (output, pid, _) in fields.items()
            ),
        ]
        return "\n".join(lines)

    def margins(self, **options: Any) -> MeasuredMargins:
        """Return margins and disturbance rejection. Raises LogError if no sweep cut a loop."""
        if not self.records:
            raise LogError("; ".join(self.remarks) or "no sweep of the logs cuts a loop")
        found = margins(self.records, cuts=self.cuts, **options)
        unseen = any(one.startswith("gain margin") for one in found.remarks)
        return replace(found, remarks=(*found.remarks, _FURTHER)) if unseen else found


def flown_loops(
    logs: str | PathLike[str] | Iterable[str | PathLike[str]],
    *,
    start: float | None = None,
    stop: float | None = None,
) -> FlownLoops:
    """Return the loops that SystemID's sweeps of the mixer show in logs of an ArduCopter-heli.

    Sweeps are from `start` to `stop`, s after a log's first stamp. Raises LogError.
    """
    paths = [logs] if isinstance(logs, str | PathLike) else list(logs)
    flown: dict[str, tuple[FlownSweep, ...]] = {}
    records: list[FlightRecord] = []
    remarks: list[str] = []
    gains: set[frozenset[tuple[str, float]]] = set()
    for path in map(Path, paths):
        log = open_dataflash(path, file_digest(path))
        mine = within(sweeps(log, "axis,injected,total,channel"), start, stop)
        remarks += [one.text for one in log.source.findings if one.kind in DAMAGE]
        remarks += filter(None, map(_cuts_none, mine))
        used = flown[str(path)] = tuple(one for one in mine if not _cuts_none(one))
        records += _records(log, used, remarks) if used else ()
        gains |= {
            frozenset(
                (name, value)
                for name, value in log.parameters(at=one.start + log.begins).items()
                if name.startswith(_GAINS)
            )
            for one in used
        }
    if len(gains - {frozenset()}) > 1:  # empty of a log without parameters
        remarks.append("gains were changed between sweeps: the loop is a mean of both")
    cuts = tuple(
        Cut(one, "actuators", f"{one}_disturbance", f"{one}_sum", one, alone=True)
        for one in LOGGED
        if any(one in record for record in records)
    )
    return FlownLoops(flown, tuple(records), cuts, tuple(dict.fromkeys(remarks)))


def flown_law(log: DataFlash, start: float) -> ArduCopterLaw:
    """Return the law that flew in the second about a time of a log, s, with its steady flight.

    Raises InputError if the log lacks its parameters, LogError if its messages.
    """

    def steady(message: str, field: str) -> float:
        table = log.table(message)
        near = np.abs(table.time - start) < 1.0
        return float(np.nanmedian(np.asarray(table[field], np.float64)[near]))

    angles = "ANG" if "ANG" in log else "ATT"
    return ArduCopterLaw.of(
        log.parameters(at=start),
        source=log.named,
        lean=(np.radians(steady(angles, "Roll")), np.radians(steady(angles, "Pitch"))),
        steady={axis: steady(pid, "I") for axis, (_, pid, _) in LOGGED.items() if pid in log},
    )


def _cuts_none(sweep: FlownSweep) -> str:
    one = sweep.sid_axis
    if one.control == "col":
        return f"{one}: the collective is the pilot's there, no loop is closed through it"
    if one.place != "mixer":
        return f"{one}: loops are measured by sweeps of the mixer, SID_AXIS 10 to 12"
    return str(sweep) if sweep.unused else ""


def _records(log: DataFlash, used: Sequence[FlownSweep], remarks: list[str]) -> list[FlightRecord]:
    """Return a record of each sweep, and extend the remarks. Raises LogError."""
    if "RATE" not in log:
        raise LogError(f"{log.path}: no RATE messages beside the sweeps: {log.damage or _SET}")
    rate = log.table("RATE")
    spans = [(one.start + log.begins, one.stop + log.begins) for one in used]
    period, lost = usual_step(rate.time, spans)
    tick = 1.0 / log.parameters().get("SCHED_LOOP_RATE", np.inf) or period
    if not 0.0 < period < _SLOWEST:
        raise LogError(
            f"{log.path}: RATE is logged each {period:.3g} s while sweeping, which shows no loop; "
            f"expected {_SLOWEST:g} s or less: {_SET}"
        )
    period = tick * max(1, round(period / tick))  # of a loop whose ticks needn't be even
    if lost > _LOST:
        remarks.append(f"{lost:.0%} of RATE's rows are missing while sweeping")
    found = []
    for sweep, (start, stop) in zip(used, spans):
        axis, time = sweep.sid_axis.control, np.arange(start + period, stop, period)
        output, pid, _ = LOGGED[axis]
        both = _returned(log.table(pid), rate, output, time, tick) if pid in log else None
        lines = [_added(log, rate, tick), *(both or [line(rate.time, rate[output])])]
        gone = np.column_stack([in_gaps(stamps, time, period) for stamps, _ in lines])
        values = completed(
            np.column_stack([_between(*line, time) for line in lines]), gone, 1.0 / period
        )
        if both is None:
            values = np.column_stack([values, values[:, 1] - values[:, 0]])
            gone = np.column_stack([gone, gone.any(axis=1)])
        try:
            values[:, 2] -= _asked(log, time)[:, COMMANDS.index(axis)]
        except (InputError, LogError) as error:
            remarks.append(f"{sweep.sid_axis}: what the pilot's sticks command stays in: {error}")
        names = (f"{axis}_disturbance", f"{axis}_sum", axis)
        steps = np.arange(time.size, dtype=np.float64) * period
        made = {"made_by": "ArduCopter", "sweep": sweep.to_dict()}
        made |= {"missing": told(steps, names, gone)} if gone.any() else {}
        channels = tuple(Channel(name, "1", "OTHER") for name in names)
        found.append(FlightRecord(steps, values, channels, made))
    return found


def _asked(log: DataFlash, time: Real) -> Real:
    """Return what the pilot's sticks add to the commands at times, (n_time, 3), of full command.

    It is the law's response to the attitude that is aimed at. Raises InputError, LogError.
    """
    law, angles = flown_law(log, time[0]), log.table("ANG" if "ANG" in log else "ATT")
    ticks = np.arange(time[0] - _SETTLES, time[-1] + law.period, law.period)
    aims = (line(angles.time, np.radians(angles[name])) for *_, name in LOGGED.values())
    aim = np.array([_between(stamps, np.unwrap(one), ticks) for stamps, one in aims])
    moves = np.gradient(aim, law.period, axis=1) * (law.input_time is not None)
    added = law.ticked.select(ADDED, COMMANDS).simulate(
        law.wanted(aim - aim.mean(axis=1, keepdims=True), moves).T
    )
    return np.column_stack([np.interp(time, ticks, one) for one in added.T])


def _added(log: DataFlash, rate: Table, tick: float) -> Line:
    """Return what the mode added to the mixer's command, and when: each at the next tick."""
    injected = log.table("SIDD")
    after = np.searchsorted(rate.time, injected.time + 0.25 * tick).clip(max=rate.time.size - 1)
    ahead = rate.time[after] - injected.time
    late = np.where((ahead > 0.0) & (ahead < 1.6 * tick), ahead, tick)
    return line(injected.time + late, injected["Targ"])


def _returned(
    pid: Table, rate: Table, output: str, time: Real, tick: float
) -> tuple[Line, Line] | None:
    """Return the mixer's command and the sum of its PID at ticks with both."""
    later = np.searchsorted(pid.time, rate.time - 1e-6).clip(max=pid.time.size - 1)
    mine = (
        (np.abs(pid.time[later] - rate.time) < 0.6 * tick)
        & (rate.time >= time[0] - 1.0)
        & (rate.time <= time[-1] + 1.0)
    )
    if np.count_nonzero(mine) < 0.5 * time.size:
        return None
    terms = [np.asarray(pid[one], np.float64)[later[mine]] for one in _TERMS if one in pid.columns]
    stamps = rate.time[mine]
    return line(stamps, np.asarray(rate[output])[mine]), line(stamps, sum(terms))


def line(stamps: Real, values: Any) -> Line:
    """Return stamps that increase, s, and a signal at them, (n_time,) each."""
    known = np.flatnonzero(np.isfinite(values))
    stamps, first = np.unique(stamps[known], return_index=True)
    return stamps, np.asarray(values, np.float64)[known[first]]


def _between(stamps: Real, values: Real, time: Real) -> Real:
    """Return a signal at times, (n_time,), interpolated smoothly: linear steps cost phase."""
    return Akima1DInterpolator(stamps, values)(np.clip(time, stamps[0], stamps[-1]))
