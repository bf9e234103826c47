"""The loops of an ArduCopter-heli as flown, from logs of its mode SystemID: see `flown_loops`.

Whatever the mode sweeps moves an axis's command in the end, and the law from there to the command
is known from the log's own parameters: so each sweep of an axis is one that was added at its
command, where the loop is cut. RATE's outputs are what goes on behind the cut.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, LogError
from helisim.base.settings import Value
from helisim.handling.arducopter import ADDED, COMMANDS, ArduCopterLaw
from helisim.handling.loop import axis_of
from helisim.handling.measured.margins import Cut, MeasuredMargins, margins
from helisim.logs.dataflash import DataFlash, Table, open_dataflash
from helisim.logs.source import file_digest
from helisim.look.sweeps import FlownSweep, sweeps
from helisim.records.record import RATES, Channel, FlightRecord

Array = NDArray[np.float64]
_WIDE = 3.0  # ratio of a band's ends that is worth a band
_FURTHER = "to see gain margins let the sweeps go on to a higher frequency: SID_F_STOP_HZ"
_OUTPUTS = {"lat": "ROut", "lon": "POut", "ped": "YOut"}
"""Axis -> field of RATE: what goes to the mixer."""
_PIDS = {"lat": "PIDR", "lon": "PIDP", "ped": "PIDY"}  # axis -> message of its rate's PID
_TERMS = ("P", "I", "D", "FF", "DFF")
_AIMS = ("DesRoll", "DesPitch", "DesYaw")
_ATTITUDES = ("Roll", "Pitch")
_GYRO = ("Gx", "Gy", "Gz")
_STICKS = {"lat": "C1", "lon": "C2", "ped": "C4"}
"""Fields of RCIN, as RCMAP has them unless it is told otherwise."""
_STILL = 10.0  # us, by which a stick that is left alone may move
_STEADY = 1.0  # s, from which the steady flight before a sweep is taken
_LOST = 0.02  # share of rows that may be lost without a word
_SLOWEST = 0.02  # s: a log with longer steps shows no loop
_SET = "set LOG_BITMASK's bits 0 and 1"
_NEAR = 8
"""Rows on either side of a gap that fill it."""
_DEGREE = 4
"""Of the polynomial that does: gaps of half a period at the least."""
_TICKS = 1.5  # longer steps than so many are gaps
_UNITS = {"p": "rad/s", "q": "rad/s", "r": "rad/s", "LAT": "rad", "LON": "rad", "PED": "rad/s"}


@dataclass(frozen=True)
class FlownLog:
    """One log of which loops are measured.

    Attributes:
        path: the file.
        version: what wrote it.
        sweeps: that cut a loop, in their order; times after the log's first stamp.
    """

    path: str
    version: str
    sweeps: tuple[FlownSweep, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {**vars(self), "sweeps": [one.to_dict() for one in self.sweeps]}

    def __str__(self) -> str:
        lines = [f"{self.path}: {self.version or 'ArduPilot'}"]
        return "\n".join([*lines, *(f"  {one}" for one in self.sweeps)])


@dataclass(frozen=True, eq=False)
class FlownLoops(Value):
    """Loops of an autopilot, as logs show them.

    Attributes:
        law: that flew the first sweep; None where the parameters are no helicopter's.
        logs: one each.
        records: one of each sweep, and of sweeps of the pilot's command one more, with the stick.
        cuts: of the records.
        remarks: of sweeps that cut no loop, of rows that a log lost, and of the law.
    """

    law: ArduCopterLaw | None
    logs: tuple[FlownLog, ...]
    records: tuple[FlightRecord, ...]
    cuts: tuple[Cut, ...]
    remarks: tuple[str, ...]

    def __repr__(self) -> str:
        axes = ", ".join(cut.axis for cut in self.cuts) or "no axis"
        return f"FlownLoops({len(self.sweeps)} sweeps of {axes})"

    def __str__(self) -> str:
        lines = [str(one) for one in self.logs]
        lines.append("cut at the actuators, where 1 is full command of the mixer:")
        for axis in (cut.axis for cut in self.cuts):
            axes = [one.sid_axis for one in self.sweeps]
            places = {one.place for one in axes if one.control == axis}
            added, back = f"what {', '.join(sorted(places))} sweeps make of it", "the rest"
            if places == {"mixer"}:
                added, back = "SIDD.Targ, a tick later", f"{_PIDS[axis]}'s P, I, D, FF, DFF"
            said = f"injected = {added}, comes back = {back}"
            lines.append(f"  {axis}: goes on = RATE.{_OUTPUTS[axis]}, {said}")
        if self.law is not None:
            lines.append(
                f"law: its parameters in the log, {1.0 / self.law.period:.4g} ticks a second; "
                "what it answers to the pilot's own commands (Des of ANG or ATT) is taken out"
            )
        return "\n".join(lines)

    @property
    def sweeps(self) -> tuple[FlownSweep, ...]:
        """The sweeps of all logs."""
        return tuple(one for log in self.logs for one in log.sweeps)

    @property
    def bands(self) -> dict[str, tuple[float, float]]:
        """What was injected -> the band that all its sweeps have in common, rad/s."""
        found = {}
        for one in self.sweeps:
            axis = axis_of(one.sid_axis.control)
            for name in (f"{axis.name}_disturbance", axis.stick):
                low, high = found.get(name, (0.0, np.inf))
                found[name] = max(low, one.low), min(high, one.high)
        return {name: (low, high) for name, (low, high) in found.items() if high > _WIDE * low}

    def margins(self, **options: Any) -> MeasuredMargins:
        """Return crossover, margins and disturbance rejection with their intervals.

        Args:
            **options: of `helisim.margins`, such as axes, band or draws; by default each loop is
                measured in the band that its sweeps have in common.

        Raises:
            LogError: no sweep cut a loop.
        """
        if not self.records:
            raise LogError("; ".join(self.remarks) or "no sweep of the logs cuts a loop")
        options["band"] = options.get("band") or self.bands
        found = margins(self.records, cuts=self.cuts, **options)
        unseen = any(one.startswith("gain margin") for one in found.remarks)
        return replace(found, remarks=(*found.remarks, _FURTHER)) if unseen else found


def flown_loops(
    logs: str | PathLike[str] | Iterable[str | PathLike[str]],
    *,
    start: float | None = None,
    stop: float | None = None,
) -> FlownLoops:
    """Return the loops that logs with SystemID's sweeps show.

    Args:
        logs: of an ArduCopter-heli, one file or several.
        start: sweeps that begin before are left out, s after a log's first stamp.
        stop: sweeps that end after are left out, s after a log's first stamp.

    Raises:
        LogError: one has no sweeps, or says too seldom what the mixer was commanded.
    """
    paths = [logs] if isinstance(logs, str | PathLike) else list(logs)
    limits = (-np.inf if start is None else start, np.inf if stop is None else stop)
    laws: list[ArduCopterLaw | None] = []
    records: list[FlightRecord] = []
    remarks: list[str] = []
    flown = []
    for path in map(Path, paths):
        log = open_dataflash(path, file_digest(path))
        first = min(log.first_stamps.values())
        every = sweeps(log, "axis,injected,total,channel")
        mine = [one for one in every if limits[0] <= one.start and one.stop <= limits[1]]
        unused = [_cuts_none(sweep) for sweep in mine]
        remarks += filter(None, unused)
        used = tuple(sweep for sweep, why in zip(mine, unused) if not why)
        flown.append(FlownLog(str(path), log.version, used))
        rows = None
        for sweep in (replace(o, start=o.start + first, stop=o.stop + first) for o in used):
            rows = rows or _Rows(log, used, first, remarks)
            law, why = rows.law(sweep)
            laws.append(law)
            if law is None and sweep.sid_axis.place != "mixer":
                remarks.append(f"{sweep}: not measured, as {why}")
            else:
                records += rows.records(sweep, law)
            if sweep.sid_axis.place == "input" and rows.moved(sweep):
                remarks.append(
                    f"{sweep.sid_axis}: the pilot moved that stick too: his answer is part of "
                    "bandwidth and phase delay"
                )
    law = laws[0] if laws else None
    if law is not None:
        remarks += law.remarks
        if any(one is not None and one.rates != law.rates for one in laws):
            remarks.append("gains were changed between sweeps: the loop is a mean of both")
    cuts = tuple(
        Cut(one, "actuators", f"{one}_disturbance", f"{one}_sum", one, alone=True)
        for one in COMMANDS
        if any(f"{one}_sum" in record for record in records)
    )
    return FlownLoops(law, tuple(flown), tuple(records), cuts, tuple(dict.fromkeys(remarks)))


def _cuts_none(sweep: FlownSweep) -> str:
    """Return why a sweep cuts no loop, empty if it does."""
    one = sweep.sid_axis
    if one.control == "col":
        return f"{one}: the collective is the pilot's there, no loop is closed through it"
    if not one.identifies:
        return f"{one}: loops of position and velocity are not measured"
    return f"{sweep}: {sweep.unused}" if sweep.unused else ""


class _Rows:
    """Rows of a log, by its ticks, about the loops that sweeps cut.

    Args:
        log: itself.
        used: the sweeps.
        first: the log's first stamp, s.
        remarks: of rows that were lost, one is added.

    Raises:
        LogError: messages are missing, or too seldom.
    """

    def __init__(
        self, log: DataFlash, used: Sequence[FlownSweep], first: float, remarks: list[str]
    ) -> None:
        angles = "ANG" if "ANG" in log else "ATT"
        for name in ("RATE", angles):
            if name not in log:
                raise LogError(f"{log.path}: no {name} messages beside the sweeps: {_SET}")
        self.log, self.rate = log, log.table("RATE", fields=tuple(_OUTPUTS.values()))
        self.aims = log.table(angles, fields=(*_AIMS, *_ATTITUDES))
        self.injected = log.table("SIDD", fields=("Targ", *_GYRO))
        time, spans = self.rate.time, [(one.start + first, one.stop + first) for one in used]
        each = [np.diff(time[_within(time, *span)]) for span in spans]
        steps, tick = np.concatenate(each), 1.0 / log.parameters().get("SCHED_LOOP_RATE", np.inf)
        usual = float(np.median(steps)) if steps.size else np.inf
        if tick and steps.size:  # of a loop whose ticks needn't be even
            self.period = tick * max(1, round(usual / tick))
        else:
            self.period = float(np.mean(steps[steps < 1.75 * usual])) if steps.size else np.inf
        if not self.period < _SLOWEST:
            raise LogError(
                f"{log.path}: RATE is logged each {self.period:.3g} s while sweeping, which shows "
                f"no loop; expected {_SLOWEST:g} s or less: {_SET}"
            )
        self.tick = min(tick or self.period, self.period)
        lost = 1.0 - (steps.size + 1) * self.period / sum(stop - start for start, stop in spans)
        if lost > _LOST:
            remarks.append(
                f"{lost:.0%} of RATE's rows are missing while sweeping, at most {steps.max():.2g} "
                "s at once: they are interpolated"
            )

    def law(self, sweep: FlownSweep) -> tuple[ArduCopterLaw | None, str]:
        """Return the law that flew a sweep about its steady flight, or why it isn't known."""
        roll, pitch = (float(np.radians(_steady(self.aims, k, sweep))) for k in _ATTITUDES)
        pids = {axis: self.log.table(name) for axis, name in _PIDS.items() if name in self.log}
        held = {axis: _steady(table, "I", sweep) for axis, table in pids.items()}
        try:
            parameters = self.log.parameters(at=sweep.start)
            law = ArduCopterLaw.of(parameters, lean=(roll, pitch), steady=held)
        except InputError as error:
            return None, str(error)
        return replace(law, period=self.tick), ""

    def records(self, sweep: FlownSweep, law: ArduCopterLaw | None) -> list[FlightRecord]:
        """Return the records of a sweep: of the cut, and of the stick if that is what was swept.

        Args:
            sweep: whose times are by the autopilot's clock.
            law: that flew it; needed unless it was added to the mixer.
        """
        name, place = sweep.sid_axis.control, sweep.sid_axis.place
        time = np.arange(sweep.start + self.period, sweep.stop, self.period)
        total = self._at(self.rate, _OUTPUTS[name], time)
        asked = np.zeros_like(time) if law is None else self._asked(sweep, law, time)
        back = None
        if place == "mixer":
            added, both = self._added(time), self._returned(name, time)
            if both is not None:
                total, back = both[0], both[1] - asked
        elif place == "rate" and law is not None:
            added = self._added_to_rate(sweep, law, time)
        else:  # what the pilot asks is the sweep
            added, asked = asked, np.zeros_like(time)
        back = total - added - asked if back is None else back
        named = {f"{name}_disturbance": added, f"{name}_sum": total, name: back}
        found = [_record(time, named, sweep)]
        if place == "input":
            stick = {axis_of(name).stick: np.radians(self._at(self.injected, "Targ", time))}
            gyro = {rate: self._at(self.injected, field, time) for rate, field in zip(RATES, _GYRO)}
            stick |= {rate: np.radians(values) for rate, values in gyro.items()}
            # SIDD's rates are means over the loop before
            found.append(_record(time, stick, sweep, dict.fromkeys(RATES, 0.5 * self.tick)))
        return found

    def moved(self, sweep: FlownSweep) -> bool:
        """Return whether the pilot moved the stick that a sweep was added to."""
        field = _STICKS[sweep.sid_axis.control]
        if "RCIN" not in self.log:
            return False
        stick = self.log.table("RCIN", fields=(field,))
        here = _numbers(stick, field)[_within(stick.time, sweep.start, sweep.stop)]
        return bool(here.size and np.ptp(here) > _STILL)

    def _at(self, table: Table, field: str, time: Array, around: float | None = None) -> Array:
        """Return a field at times, (n_time,), by a table's stamps; unwrapped around a period."""
        stamps, first = np.unique(table.time, return_index=True)
        values = _numbers(table, field)[first]
        values = values if around is None else np.unwrap(values, period=around)
        return filled(stamps, values, time, self.period)

    def _added(self, time: Array) -> Array:
        """Return what the mode added to the mixer's command, (n_time,): each at the next tick."""
        stamps, first = np.unique(self.injected.time, return_index=True)
        ticks = self.rate.time
        after = np.searchsorted(ticks, stamps + 0.25 * self.tick)
        there = np.flatnonzero(after < ticks.size)
        near = there[ticks[after[there]] - stamps[there] < 1.6 * self.tick]
        acts = stamps + self.tick
        acts[near] = ticks[after[near]]
        acts, once = np.unique(acts, return_index=True)
        return filled(acts, _numbers(self.injected, "Targ")[first][once], time, self.period)

    def _returned(self, axis: str, time: Array) -> tuple[Array, Array] | None:
        """Return the mixer's command and the sum of its PID, (n_time,) each, of ticks with both."""
        if _PIDS[axis] not in self.log:
            return None
        pid = self.log.table(_PIDS[axis])
        later = np.searchsorted(pid.time, self.rate.time - 1e-6)
        there = np.flatnonzero(later < pid.time.size)
        mine = there[pid.time[later[there]] - self.rate.time[there] < 0.6 * self.tick]
        mine = mine[_within(self.rate.time[mine], time[0] - 1.0, time[-1] + 1.0)]
        if mine.size * self.period < 0.5 * (time[-1] - time[0]):
            return None
        stamps, total = self.rate.time[mine], _numbers(self.rate, _OUTPUTS[axis])[mine]
        terms = [_numbers(pid, one)[later[mine]] for one in _TERMS if one in pid.columns]
        back = np.sum(terms, axis=0)
        total, back = (filled(stamps, one, time, self.period) for one in (total, back))
        return total, back

    def _asked(self, sweep: FlownSweep, law: ArduCopterLaw, time: Array) -> Array:
        """Return the command that the law makes of what attitude is aimed at, (n_time,)."""
        ticks = self._ticks(time)
        aims = np.radians([self._at(self.aims, name, ticks, 360.0) for name in _AIMS])
        fed_forward = law.input_time is not None and sweep.sid_axis.place != "recovery"
        # what is aimed at goes on by its rate from tick to tick
        moves = np.diff(aims, axis=1, append=aims[:, -1:]) / self.tick * fed_forward
        wanted = law.wanted(aims - aims[:, :1], moves)
        return _response(law, sweep.sid_axis.control, ticks, wanted, time)

    def _added_to_rate(self, sweep: FlownSweep, law: ArduCopterLaw, time: Array) -> Array:
        """Return the command that the law makes of what was added to a wanted rate, (n_time,)."""
        axis, ticks = sweep.sid_axis.control, self._ticks(time)
        wanted = np.zeros((3, ticks.size))
        wanted[COMMANDS.index(axis)] = np.radians(self._at(self.injected, "Targ", ticks))
        return _response(law, axis, ticks, wanted, time)

    def _ticks(self, time: Array) -> Array:
        return np.arange(time[0] - self.tick, time[-1] + self.tick, self.tick)


def _response(law: ArduCopterLaw, axis: str, ticks: Array, wanted: Array, time: Array) -> Array:
    """Return an axis's command, (n_time,), to rates that are wanted at ticks, (3, n_tick) rad/s.

    What is sensed stands still: the loop is open.
    """
    found = law.ticked.select(ADDED, (axis,)).simulate(wanted.T)
    return np.interp(time, ticks, found[:, 0])


def filled(time: Array, values: Array, wanted: Array, period: float) -> Array:
    """Return a signal at the times that are wanted, also where its log lost rows.

    A logger that is pressed drops a third of its rows, in gaps of 10 to 50 ms: straight lines
    through them cost 20 deg of phase at 70 rad/s, a polynomial through the rows about them 2.

    Args:
        time: (n_time,) s, increasing.
        values: (n_time,).
        wanted: (n_wanted,) s, increasing.
        period: s, between rows where none is lost.

    Returns:
        (n_wanted,), straight between rows that no gap separates.
    """
    found = np.interp(wanted, time, values)
    for before in np.flatnonzero(np.diff(time) > _TICKS * period):
        first, last = np.searchsorted(wanted, time[before : before + 2], side="right")
        near = slice(max(0, before + 1 - _NEAR), before + 1 + _NEAR)
        if first == last or near.stop - near.start < 2 * _NEAR or near.stop > time.size:
            continue
        middle = 0.5 * (time[before] + time[before + 1])
        off = time[near] - middle
        size, half = np.abs(off).max(), 0.5 * (time[before + 1] - time[before])
        weight = np.exp(-0.5 * (2.0 * (np.abs(off) - half) / (_NEAR * period)) ** 2)
        line = np.polyfit(off / size, values[near], _DEGREE, w=weight)
        found[first:last] = np.polyval(line, (wanted[first:last] - middle) / size)
    return found


def _numbers(table: Table, field: str) -> Array:
    return np.asarray(table[field], dtype=np.float64)


def _steady(table: Table, field: str, sweep: FlownSweep) -> float:
    before = _within(table.time, sweep.start - _STEADY, sweep.start + _STEADY)
    return float(np.median(_numbers(table, field)[before])) if np.any(before) else 0.0


def _within(time: Array, start: float, stop: float) -> NDArray[np.bool_]:
    return (time >= start) & (time <= stop)


def _record(
    time: Array,
    named: dict[str, Array],
    sweep: FlownSweep,
    latency: dict[str, float] | None = None,
) -> FlightRecord:
    channels = tuple(Channel(name, _UNITS.get(name, "1"), "OTHER") for name in named)
    made = {"made_by": "ArduCopter", "sweep": sweep.to_dict()}
    made |= {"recorder": {"latency": latency}} if latency else {}
    steps = (time[1] - time[0]) * np.arange(time.size)
    return FlightRecord(steps, np.column_stack([*named.values()]), channels, made)
