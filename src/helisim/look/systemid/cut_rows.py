"""The rows of a log about a loop that a sweep cut, as flight records."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import LogError
from helisim.handling.arducopter import ADDED, COMMANDS, ArduCopterLaw
from helisim.handling.loop import axis_of
from helisim.logs.dataflash import DataFlash, Table
from helisim.look.systemid.sweeps import FlownSweep
from helisim.look.systemid.ticks import filled, partners
from helisim.records.channels import RATES, Channel
from helisim.records.record import FlightRecord

Array = NDArray[np.float64]

OUTPUTS = {"lat": "ROut", "lon": "POut", "ped": "YOut"}
"""Axis -> field of RATE: what goes to the mixer."""
PIDS = {"lat": "PIDR", "lon": "PIDP", "ped": "PIDY"}
"""Axis -> message of its rate's PID."""
_TERMS = ("P", "I", "D", "FF", "DFF")
_AIMS = ("DesRoll", "DesPitch", "DesYaw")
_ATTITUDES = ("Roll", "Pitch")
_GYRO = ("Gx", "Gy", "Gz")
_STICKS = {"lat": "C1", "lon": "C2", "ped": "C4"}
"""Fields of RCIN, as RCMAP has them unless it is told otherwise."""
_STILL = 10.0
"""us, by which a stick that is left alone may move."""
_STEADY = 1.0
"""s, from which the steady flight before a sweep is taken."""
_LOST = 0.02
"""Share of rows that may be lost without a word."""
_SLOWEST = 0.02
"""s: a log with longer steps shows no loop."""
_SET = "set LOG_BITMASK's bits 0 and 1"


class CutRows(NamedTuple):
    """What a log says at its ticks.

    Attributes:
        log: itself.
        rate: RATE.
        aims: ANG, or ATT where that isn't logged.
        swept: SIDD.
        period: s, between rows of RATE on the average.
        tick: s, of the autopilot's loop on the average.
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
    def of(cls, log: DataFlash, used: Sequence[FlownSweep]) -> "CutRows":
        """Return them of the sweeps that are used, times by the autopilot's clock.

        Raises:
            LogError: messages are missing, or too seldom.
        """
        angles = "ANG" if "ANG" in log else "ATT"
        for name in ("RATE", angles):
            if name not in log:
                raise LogError(f"{log.path}: no {name} messages beside the sweeps: {_SET}")
        rate = log.table("RATE", fields=tuple(OUTPUTS.values()))
        steps = [np.diff(rate.time[_within(rate.time, one.start, one.stop)]) for one in used]
        tick = 1.0 / log.parameters().get("SCHED_LOOP_RATE", np.inf)
        period = _usual(np.concatenate(steps), tick)
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
        aims = log.table(angles, fields=(*_AIMS, *_ATTITUDES))
        swept = log.table("SIDD", fields=("Targ", *_GYRO))
        return cls(log, rate, aims, swept, period, min(tick or period, period), remarks)

    def lean(self, sweep: FlownSweep) -> tuple[float, float]:
        """Return roll and pitch of the steady flight before a sweep, rad."""
        roll, pitch = (_steady(self.aims, name, sweep) for name in _ATTITUDES)
        return float(np.radians(roll)), float(np.radians(pitch))

    def held(self, sweep: FlownSweep) -> dict[str, float]:
        """Return axis -> integral of the steady flight before a sweep."""
        tables = {axis: self.log.table(name) for axis, name in PIDS.items() if name in self.log}
        return {axis: _steady(table, "I", sweep) for axis, table in tables.items()}

    def records(self, sweep: FlownSweep, law: ArduCopterLaw | None) -> list[FlightRecord]:
        """Return the records of a sweep: of the cut, and of the stick if that is what was swept.

        Args:
            sweep: whose times are by the autopilot's clock.
            law: that flew it; needed unless it was added to the mixer.
        """
        one = sweep.sid_axis
        time = np.arange(sweep.start + self.period, sweep.stop, self.period)
        total = self._at(self.rate, OUTPUTS[one.control], time)
        asked = np.zeros_like(time) if law is None else self._asked(sweep, law, time)
        back = None
        if one.place == "mixer":
            added, both = self._added(time), self._returned(one.control, time)
            if both is not None:
                total, back = both[0], both[1] - asked
        elif one.place == "rate":
            assert law is not None
            added = self._added_to_rate(sweep, law, time)
        else:  # what the pilot asks is the sweep
            added, asked = asked, np.zeros_like(time)
        back = total - added - asked if back is None else back
        name = one.control
        named = {f"{name}_disturbance": added, f"{name}_sum": total, name: back}
        found = [_record(time, named, sweep)]
        if one.place == "input":
            found.append(self._by_stick(sweep, time))
        return found

    def moved(self, sweep: FlownSweep) -> bool:
        """Return whether the pilot moved the stick that a sweep was added to."""
        if "RCIN" not in self.log:
            return False
        stick = self.log.table("RCIN", fields=(_STICKS[sweep.sid_axis.control],))
        pulses = _numbers(stick, _STICKS[sweep.sid_axis.control])
        here = pulses[_within(stick.time, sweep.start, sweep.stop)]
        return bool(here.size and np.ptp(here) > _STILL)

    def _at(self, table: Table, field: str, time: Array) -> Array:
        """Return a field at times, (n_time,), of a table's own stamps."""
        stamps, first = np.unique(table.time, return_index=True)
        return filled(stamps, _numbers(table, field)[first], time, self.period)

    def _added(self, time: Array) -> Array:
        """Return what the mode added to the mixer's command, (n_time,): each at the next tick."""
        stamps, first = np.unique(self.swept.time, return_index=True)
        ticks = self.rate.time
        after = np.searchsorted(ticks, stamps + 0.25 * self.tick)
        there = after < ticks.size
        acts = stamps + self.tick
        near = ticks[after[there]] - stamps[there] < 1.6 * self.tick
        acts[np.flatnonzero(there)[near]] = ticks[after[there][near]]
        acts, once = np.unique(acts, return_index=True)
        return filled(acts, _numbers(self.swept, "Targ")[first][once], time, self.period)

    def _returned(self, axis: str, time: Array) -> tuple[Array, Array] | None:
        """Return the mixer's command and the sum of its PID, (n_time,) each, of ticks with both."""
        name = PIDS[axis]
        if name not in self.log:
            return None
        pid = self.log.table(name)
        terms = [one for one in _TERMS if one in pid.columns]
        mine, theirs = partners(self.rate.time, pid.time, 0.6 * self.tick)
        mine, first = np.unique(mine, return_index=True)
        near = _within(self.rate.time[mine], time[0] - 1.0, time[-1] + 1.0)
        mine, theirs = mine[near], theirs[first][near]
        if mine.size * self.period < 0.5 * (time[-1] - time[0]):
            return None
        stamps = self.rate.time[mine]
        total = _numbers(self.rate, OUTPUTS[axis])[mine]
        back = np.sum([_numbers(pid, one)[theirs] for one in terms], axis=0)
        total, back = (filled(stamps, one, time, self.period) for one in (total, back))
        return total, back

    def _asked(self, sweep: FlownSweep, law: ArduCopterLaw, time: Array) -> Array:
        """Return the command that the law makes of what attitude is aimed at, (n_time,)."""
        ticks = self._ticks(time)
        aims = np.radians([self._unwrapped(name, ticks) for name in _AIMS])
        fed_forward = law.input_time is not None and sweep.sid_axis.place != "recovery"
        # what is aimed at goes on by its rate from tick to tick
        moves = np.diff(aims, axis=1, append=aims[:, -1:]) / self.tick * fed_forward
        wanted = law.wanted(aims - aims[:, :1], moves)
        return _answered(law, sweep.sid_axis.control, ticks, wanted, time)

    def _added_to_rate(self, sweep: FlownSweep, law: ArduCopterLaw, time: Array) -> Array:
        """Return the command that the law makes of what was added to a wanted rate, (n_time,)."""
        axis, ticks = sweep.sid_axis.control, self._ticks(time)
        wanted = np.zeros((3, ticks.size))
        wanted[COMMANDS.index(axis)] = np.radians(self._at(self.swept, "Targ", ticks))
        return _answered(law, axis, ticks, wanted, time)

    def _ticks(self, time: Array) -> Array:
        return np.arange(time[0] - self.tick, time[-1] + self.tick, self.tick)

    def _unwrapped(self, name: str, time: Array) -> Array:
        """Return an angle at times, (n_time,) deg, that goes on over 180 and 360 deg."""
        stamps, first = np.unique(self.aims.time, return_index=True)
        whole = np.unwrap(_numbers(self.aims, name)[first], period=360.0)
        return filled(stamps, whole, time, self.period)

    def _by_stick(self, sweep: FlownSweep, time: Array) -> FlightRecord:
        """Return a record of a sweep of the pilot's command, and what answers to it."""
        axis = axis_of(sweep.sid_axis.control)
        named = {axis.stick: np.radians(self._at(self.swept, "Targ", time))}
        for name, field in zip(RATES, _GYRO):
            named[name] = np.radians(self._at(self.swept, field, time))
        # SIDD's rates are means over the loop before
        return _record(time, named, sweep, dict.fromkeys(RATES, 0.5 * self.tick))


def _answered(law: ArduCopterLaw, axis: str, ticks: Array, wanted: Array, time: Array) -> Array:
    """Return an axis's command, (n_time,), to rates that are wanted at ticks, (3, n_tick) rad/s.

    What is sensed stands still: the loop is open.
    """
    matrices = law.ticked
    columns = [matrices.inputs.index(name) for name in ADDED]
    row = COMMANDS.index(axis)
    state, found = np.zeros(len(matrices.a)), np.empty(ticks.size)
    through, driven = matrices.d[row, columns], matrices.b[:, columns] @ wanted
    for k, one in enumerate(wanted.T):
        found[k] = matrices.c[row] @ state + through @ one
        state = matrices.a @ state + driven[:, k]
    return np.interp(time, ticks, found)


def _usual(steps: Array, tick: float) -> float:
    """Return the mean time between rows, s, where none is lost; ticks needn't be even.

    Args:
        steps: (n_step,) s.
        tick: s, of the autopilot's loop by its parameters; 0: not known.
    """
    if not steps.size:
        return np.inf
    usual = float(np.median(steps))
    if tick:
        return tick * max(1, round(usual / tick))
    return float(np.mean(steps[steps < 1.75 * usual]))


def _numbers(table: Table, field: str) -> Array:
    return np.asarray(table[field], dtype=np.float64)


def _steady(table: Table, field: str, sweep: FlownSweep) -> float:
    before = _within(table.time, sweep.start - _STEADY, sweep.start + _STEADY)
    return float(np.median(_numbers(table, field)[before])) if np.any(before) else 0.0


def _within(time: Array, start: float, stop: float) -> NDArray[np.bool_]:
    return (time >= start) & (time <= stop)


_UNITS = {"p": "rad/s", "q": "rad/s", "r": "rad/s", "LAT": "rad", "LON": "rad", "PED": "rad/s"}


def _record(
    time: Array, named: dict[str, Array], sweep: FlownSweep, late: dict[str, float] | None = None
) -> FlightRecord:
    channels = tuple(Channel(name, _UNITS.get(name, "1"), "OTHER") for name in named)
    made = {"made_by": "ArduCopter", "sweep": sweep.to_dict()}
    if late:
        made["recorder"] = {"latency": late}
    steps = (time[1] - time[0]) * np.arange(time.size)
    return FlightRecord(steps, np.column_stack([*named.values()]), channels, made)
