"""The loops of an ArduCopter-heli as flown, from a log of its mode SystemID.

Whatever the mode sweeps moves an axis's command in the end, and the law from there to the command
is known from the log's own parameters: so each sweep of an axis is one that was added at its
command, where the loop is cut. RATE's outputs are what goes on behind the cut.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from os import PathLike
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.errors import InputError, LogError
from helisim.handling.axis import axis_of
from helisim.handling.measured.cut import Cut
from helisim.handling.measured.margins import MeasuredMargins, margins
from helisim.look.systemid.sweeps import FlownSweep, sweeps
from helisim.records.channels import RATES, Channel
from helisim.records.logs.dataflash import DataFlash, Table
from helisim.records.record import FlightRecord
from helisim.records.value import Value
from helisim.sitl.control import ADDED, COMMANDS, ArduCopterLaw
from helisim.sitl.ticks import filled, partners

Array = NDArray[np.float64]

_OUTPUTS = {"lat": "ROut", "lon": "POut", "ped": "YOut"}
_PIDS = {"lat": "PIDR", "lon": "PIDP", "ped": "PIDY"}
_TERMS = ("P", "I", "D", "FF", "DFF")
_AIMS = ("DesRoll", "DesPitch", "DesYaw")
_ATTITUDES = ("Roll", "Pitch", "Yaw")
_GYRO = ("Gx", "Gy", "Gz")
_STEADY = 1.0
"""s, from which the steady flight before a sweep is taken."""
_LOST = 0.02
"""Share of rows that may be lost without a word."""
_SLOWEST = 0.02
"""s: a log with longer steps shows no loop."""


@dataclass(frozen=True, eq=False)
class FlownLoops(Value):
    """What a log says of its autopilot's loops.

    Attributes:
        law: that flew the first sweep; None where the parameters are no helicopter's.
        sweeps: that cut a loop, in their order.
        records: one of each, and of sweeps of the pilot's command one more, with the stick.
        cuts: of the records.
        remarks: of sweeps that cut no loop, of rows that the log lost, and of the law.
    """

    law: ArduCopterLaw | None
    sweeps: tuple[FlownSweep, ...]
    records: tuple[FlightRecord, ...]
    cuts: tuple[Cut, ...]
    remarks: tuple[str, ...]

    def __repr__(self) -> str:
        axes = ", ".join(dict.fromkeys(cut.axis for cut in self.cuts)) or "no axis"
        return f"FlownLoops({len(self.sweeps)} sweeps of {axes})"

    def margins(self, **options: Any) -> MeasuredMargins:
        """Return crossover, margins and disturbance rejection with their intervals.

        Args:
            **options: of `helisim.margins`, such as axes, band or draws.

        Raises:
            LogError: no sweep cut a loop.
        """
        if not self.records:
            raise LogError("; ".join(self.remarks) or "no sweep of the log cuts a loop")
        return margins(self.records, cuts=self.cuts, **options)


def flown_loops(log: str | PathLike[str] | DataFlash) -> FlownLoops:
    """Return the loops that a log with SystemID's sweeps shows.

    Args:
        log: of an ArduCopter-heli, or its file.

    Raises:
        LogError: it has no sweeps, or says too seldom what the mixer was commanded.
    """
    log = log if isinstance(log, DataFlash) else DataFlash(log)
    found = sweeps(log, 0.0)
    remarks = [one for sweep in found if (one := _cuts_none(sweep))]
    used = tuple(sweep for sweep in found if not _cuts_none(sweep))
    if not used:
        return FlownLoops(None, (), (), (), tuple(dict.fromkeys(remarks)))
    rows = _Rows.of(log, used)
    records: list[FlightRecord] = []
    laws = []
    for sweep in used:
        law, why = _law(log, rows, sweep)
        laws.append(law)
        if law is None and sweep.sid_axis.place != "mixer":
            remarks.append(f"{sweep}: not measured, as {why}")
            continue
        records += _records(rows, sweep, law)
    remarks += rows.remarks
    if laws[0] is not None:
        remarks += laws[0].remarks
        if any(one is not None and one.rates != laws[0].rates for one in laws):
            remarks.append("gains were changed between sweeps: the loop is a mean of both")
    cuts = tuple(
        Cut(one, "actuators", f"{one}_disturbance", f"{one}_sum", one, alone=True)
        for one in COMMANDS
        if any(f"{one}_sum" in record for record in records)
    )
    return FlownLoops(laws[0], used, tuple(records), cuts, tuple(dict.fromkeys(remarks)))


def _cuts_none(sweep: FlownSweep) -> str:
    """Return why a sweep cuts no loop, empty if it does."""
    one = sweep.sid_axis
    if one.control == "col":
        return f"{one}: the collective is the pilot's there, no loop is closed through it"
    if one.place in ("disturbance", "velocity"):
        return f"{one}: loops of position and velocity are not measured"
    return f"{sweep}: {sweep.unused}" if sweep.unused else ""


class _Rows(NamedTuple):
    """What a log says at its ticks.

    Attributes:
        log: itself.
        rate: RATE.
        aims: ANG, or ATT where that isn't logged.
        swept: SIDD.
        period: s, between rows of RATE.
        tick: s, of the autopilot's loop.
        remarks: of rows that were lost.
    """

    log: DataFlash
    rate: Table
    aims: Table
    swept: Table
    period: float
    tick: float
    remarks: list[str]

    @classmethod
    def of(cls, log: DataFlash, used: Sequence[FlownSweep]) -> "_Rows":
        """Return them. Raises LogError."""
        angles = "ANG" if "ANG" in log else "ATT"
        for name in ("RATE", angles):
            if name not in log:
                raise LogError(f"{log.path}: no {name} messages beside the sweeps: {_SET}")
        rate = log.table("RATE", fields=tuple(_OUTPUTS.values()))
        steps = [np.diff(rate.time[_within(rate.time, one.start, one.stop)]) for one in used]
        period = float(np.median(np.concatenate(steps))) if any(map(len, steps)) else np.inf
        if not period < _SLOWEST:
            raise LogError(
                f"{log.path}: RATE is logged each {period:.3g} s while sweeping, which shows no "
                f"loop; expected {_SLOWEST:g} s or less: {_SET}"
            )
        asked = sum(one.stop - one.start for one in used)
        lost = 1.0 - (sum(map(len, steps)) + 1) * period / asked
        gap = max(float(one.max()) for one in steps if len(one))
        remarks = []
        if lost > _LOST:
            remarks.append(
                f"{lost:.0%} of RATE's rows are missing while sweeping, at most {gap:.2g} s at "
                "once: they are interpolated"
            )
        tick = 1.0 / log.parameters().get("SCHED_LOOP_RATE", 1.0 / period)
        aims = log.table(angles, fields=(*_AIMS, *_ATTITUDES))
        swept = log.table("SIDD", fields=("Targ", *_GYRO))
        return cls(log, rate, aims, swept, period, min(tick, period), remarks)

    def at(self, table: Table, field: str, time: Array) -> Array:
        """Return a field at times, (n_time,), of a table's own stamps."""
        stamps, first = np.unique(table.time, return_index=True)
        return filled(stamps, table[field][first], time, self.period)


_SET = "set LOG_BITMASK's bits 0 and 1"


def _within(time: Array, start: float, stop: float) -> NDArray[np.bool_]:
    return (time >= start) & (time <= stop)


def _law(log: DataFlash, rows: _Rows, sweep: FlownSweep) -> tuple[ArduCopterLaw | None, str]:
    """Return the law that flew a sweep about its steady flight, or why it isn't known."""

    def steady(table: Table, field: str) -> float:
        before = _within(table.time, sweep.start - _STEADY, sweep.start + _STEADY)
        return float(np.median(table[field][before])) if np.any(before) else 0.0

    lean = tuple(np.radians(steady(rows.aims, name)) for name in _ATTITUDES[:2])
    held = {
        axis: steady(log.table(name, fields=("I",)), "I")
        for axis, name in _PIDS.items()
        if name in log
    }
    try:
        parameters = log.parameters(at=sweep.start)
        law = ArduCopterLaw.of(parameters, lean=(lean[0], lean[1]), steady=held)
        return replace(law, period=rows.tick), ""
    except InputError as error:
        return None, str(error)


def _records(rows: _Rows, sweep: FlownSweep, law: ArduCopterLaw | None) -> list[FlightRecord]:
    """Return the records of a sweep: of the cut, and of the stick if that is what was swept."""
    axis = sweep.sid_axis.control
    time = np.arange(sweep.start + rows.period, sweep.stop, rows.period)
    total = rows.at(rows.rate, _OUTPUTS[axis], time)
    back = None
    if sweep.sid_axis.place == "mixer":
        added = rows.at(rows.swept, "Targ", time - rows.tick)  # each acts at the tick that follows
        both = _returned(rows, axis, time)
        if both is not None:
            total, back = both
    else:
        assert law is not None
        added = _as_if_added(rows, sweep, law, time)
    back = total - added if back is None else back
    named = {f"{axis}_disturbance": added, f"{axis}_sum": total, axis: back}
    found = [_record(time, named, sweep)]
    if sweep.sid_axis.place == "input":
        found.append(_by_stick(rows, sweep, time, total))
    return found


def _returned(rows: _Rows, axis: str, time: Array) -> tuple[Array, Array] | None:
    """Return the mixer's command and the sum of its PID, (n_time,) each, of ticks with both."""
    name = _PIDS[axis]
    if name not in rows.log:
        return None
    pid = rows.log.table(name)
    terms = [one for one in _TERMS if one in pid.columns]
    mine, theirs = partners(rows.rate.time, pid.time, 0.6 * rows.tick)
    mine, first = np.unique(mine, return_index=True)
    near = _within(rows.rate.time[mine], time[0] - 1.0, time[-1] + 1.0)
    mine, theirs = mine[near], theirs[first][near]
    if mine.size * rows.period < 0.5 * (time[-1] - time[0]):
        return None
    stamps = rows.rate.time[mine]
    total = rows.rate[_OUTPUTS[axis]][mine]
    back = np.sum([pid[one][theirs] for one in terms], axis=0)
    return tuple(filled(stamps, one, time, rows.period) for one in (total, back))


def _as_if_added(rows: _Rows, sweep: FlownSweep, law: ArduCopterLaw, time: Array) -> Array:
    """Return what would have to be added at the command to move it as a sweep did, (n_time,)."""
    place, axis = sweep.sid_axis.place, sweep.sid_axis.control
    ticks = np.arange(time[0] - rows.tick, time[-1] + rows.tick, rows.tick)
    wanted = np.zeros((3, ticks.size))
    if place == "rate":
        wanted[COMMANDS.index(axis)] = np.radians(rows.at(rows.swept, "Targ", ticks))
    else:
        aims = np.radians([_unwrapped(rows, name, ticks) for name in _AIMS])
        moves = np.gradient(aims, rows.tick, axis=1) if place == "input" else np.zeros_like(aims)
        wanted = law.wanted(aims - aims[:, :1], moves)
    matrices = law.ticked
    columns = [matrices.inputs.index(name) for name in ADDED]
    row = COMMANDS.index(axis)
    state, found = np.zeros(len(matrices.a)), np.empty(ticks.size)
    for k, one in enumerate(wanted.T):
        found[k] = matrices.c[row] @ state + matrices.d[row, columns] @ one
        state = matrices.a @ state + matrices.b[:, columns] @ one
    return np.interp(time, ticks, found)


def _unwrapped(rows: _Rows, name: str, time: Array) -> Array:
    """Return an angle at times, (n_time,) deg, that goes on over 180 and 360 deg."""
    stamps, first = np.unique(rows.aims.time, return_index=True)
    whole = np.unwrap(rows.aims[name][first], period=360.0)
    return filled(stamps, whole, time, rows.period)


def _by_stick(rows: _Rows, sweep: FlownSweep, time: Array, total: Array) -> FlightRecord:
    """Return a record of a sweep of the pilot's command, and what answers to it."""
    axis = axis_of(sweep.sid_axis.control)
    named = {axis.stick: np.radians(rows.at(rows.swept, "Targ", time)), axis.name: total}
    for name, field in zip(RATES, _GYRO):
        named[name] = np.radians(rows.at(rows.swept, field, time))
    # SIDD's rates are means over the loop before
    late = dict.fromkeys(RATES, 0.5 * rows.tick)
    return _record(time, named, sweep, late)


_UNITS = dict.fromkeys(("p", "q", "r", "PED"), "rad/s") | dict.fromkeys(("LAT", "LON"), "rad")


def _record(
    time: Array, named: dict[str, Array], sweep: FlownSweep, late: dict[str, float] | None = None
) -> FlightRecord:
    channels = tuple(Channel(name, _UNITS.get(name, "1"), "OTHER") for name in named)
    made = {"made_by": "ArduCopter", "sweep": sweep.to_dict()}
    if late:
        made["recorder"] = {"latency": late}
    steps = (time[1] - time[0]) * np.arange(time.size)
    return FlightRecord(steps, np.column_stack([*named.values()]), channels, made)
