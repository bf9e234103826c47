"""Finds sweeps in ArduPilot logs of the mode SystemID, by its documentation of SID_AXIS."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from helisim.base.arrays import Real
from helisim.base.errors import LogError, shown
from helisim.base.note import Remedy
from helisim.base.units import unit
from helisim.logs.dataflash import DataFlash, is_dataflash, open_dataflash
from helisim.logs.source import file_digest
from helisim.records.record import Channel

Spans = Sequence[tuple[float, float]]
DAMAGE = ("corruption", "cut off", "joined")  # kinds of findings on the bytes of a log


@dataclass(frozen=True)
class SidAxis:
    """One value of SID_AXIS: a `place` such as "mixer", a `word` such as "roll", a `control`."""

    number: int
    place: str
    word: str
    control: str
    unit: str

    @property
    def name(self) -> str:
        """Channel of the injected signal, such as "mixer_roll"."""
        return f"{self.place}_{self.word}"

    @property
    def channel(self) -> Channel:
        """The injected signal."""
        return Channel(
            self.name, unit(self.unit).si, "OTHER", f"injected by SID_AXIS {self.number}"
        )

    @property
    def identifies(self) -> bool:
        """Whether the sweep is fast enough to identify the vehicle."""
        return self.place not in ("disturbance", "velocity")

    def __str__(self) -> str:
        return f"{self.place} {self.word.replace('_', ' ')}"


_TURNS = (("roll", "lat"), ("pitch", "lon"), ("yaw", "ped"))
_PATHS = (("right", "lat"), ("forward", "lon"))
_ALL = (
    # "angle" of yaw is a rate
    *(("input", *turn, unit) for turn, unit in zip(_TURNS, ("deg", "deg", "deg/s"))),
    *(("recovery", *turn, unit) for turn, unit in zip(_TURNS, ("deg", "deg", "deg/s"))),
    *(("rate", *turn, "deg/s") for turn in _TURNS),
    *(("mixer", *turn, "1") for turn in (*_TURNS, ("thrust", "col"))),
    *(("disturbance", f"{word}_position", control, "m") for word, control in _PATHS),
    *(("disturbance", f"{word}_velocity", control, "m/s") for word, control in _PATHS),
    *(("velocity", *path, "m/s") for path in _PATHS),
)
SID_AXES: dict[int, SidAxis] = {k: SidAxis(k, *one) for k, one in enumerate(_ALL, start=1)}
"""SID_AXIS -> what is swept."""

# _DELAY: s before the mode injects anything
# _AFTER: s after a sweep, in which the vehicle still answers it
_DELAY, _AFTER = 1.0, 3.0
_FIELDS = ("Time", "F", "Targ")  # SIDD: time, s; frequency, Hz; injected signal
_RANGE = (0.005, 200.0)  # Hz, in which sweeps are: the parameters' own range, and room
_SETUP = ("Ax", "Mag", "FSt", "TFin", "TR", "TFout")
_BEFORE = "; log from before the mode SystemID is chosen"
_AXIS = re.compile(r"SystemID Starting: axis=(\d+)")
_USUAL_FADE = 2.0  # s in which a sweep fades in and out, unless SIDS says another
_OCTAVE = 1.5  # of its lowest frequency to its highest: what spans less shows no dynamics
_PERIODS = 3.0  # periods of its lowest frequency that a sweep must last at least to be of use
_MODE = 25  # number of the mode SystemID among Copter's
_STATES: dict[tuple[str, str], dict[int, str]] = {
    ("EV", "Id"): {11: "was disarmed (EV 11)", 18: "landed (EV 18)", 28: ""},
    ("ERR", "Subsys"): {12: "crashed (ERR 12)"},
}  # Message and field -> number -> what it did, "" for a lift-off
_HEIGHTS = (("CTUN", "Alt"), ("POS", "RelHomeAlt"), ("BARO", "Alt"))  # m, best first
# _LOW: m above the ground, or below it as a barometer has it: nothing flies there
# _HIGH: m, more than a barometer drifts: what doesn't move there hovers
_LOW, _HIGH = 0.5, 5.0
# SIDD's fields, deg/s and m/s^2; the spreads that one of them exceeds over a window in flight.
_MOTION = {"Gx": 0.1, "Gy": 0.1, "Gz": 0.1, "Ax": 0.05, "Ay": 0.05, "Az": 0.05}
_WINDOW, _FEWEST = 2.0, 8  # s, and samples in it
_ONE_MORE = 1.6  # of the median step: a longer one has a message missing


@dataclass(frozen=True)
class FlownSweep:
    """A sweep by an autopilot: times in s after the log's first stamp, band in rad/s.

    `stop` includes the vehicle's response; `high` precedes the fade-out; `magnitude` in its unit.
    `grounded` says why it was no flight, empty if it was one.
    """

    axis: int
    start: float
    stop: float
    magnitude: float
    low: float
    high: float
    complete: bool
    end: str
    grounded: str = ""

    @property
    def sid_axis(self) -> SidAxis:
        """Where it was injected."""
        return SID_AXES[self.axis]

    @property
    def unused(self) -> str:
        """Why it can't identify the vehicle, empty if it can."""
        if self.grounded:
            return self.grounded
        least, lasts = _DELAY + _PERIODS * 2.0 * math.pi / self.low, self.stop - self.start
        if not self.sid_axis.identifies:
            return "it moves a loop of position or velocity, which is too slow for the vehicle"
        if lasts < least:
            return f"it lasts {lasts:.3g} s, {_PERIODS:g} periods take {least:.3g} s"
        return "it stays at one frequency" if self.high < _OCTAVE * self.low else ""

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON: times in s, frequencies in rad/s."""
        return {**vars(self), "name": str(self.sid_axis), "unit": self.sid_axis.unit}

    def __str__(self) -> str:
        size = f"{self.magnitude:.3g} {self.sid_axis.unit}".removesuffix(" 1")
        why = f"; not used: {self.unused}" if self.unused else ""
        return (
            f"SID_AXIS {self.axis}, {self.sid_axis}: {self.start:.1f} to {self.stop:.1f} s, "
            f"{self.low:.3g} to {self.high:.3g} rad/s, amplitude {size}, {self.end}{why}"
        )


def within(
    found: Sequence[FlownSweep], start: float | None, stop: float | None
) -> tuple[FlownSweep, ...]:
    """Return the sweeps from `start` to `stop`, s after the log's first stamp."""
    low, high = -math.inf if start is None else start, math.inf if stop is None else stop
    return tuple(one for one in found if low <= one.start and one.stop <= high)


def own_sweeps(path: Path) -> tuple[FlownSweep, ...]:
    """Return the sweeps that a log states, none for other logs. Raises StorageError."""
    try:
        return sweeps(open_dataflash(path, file_digest(path))) if is_dataflash(path) else ()
    except LogError:
        return ()


def sweeps(
    log: DataFlash, remedy: Remedy = "structure,inputs,outputs,channel"
) -> tuple[FlownSweep, ...]:
    """Return the sweeps of an ArduPilot log in order. Raises LogError, with `remedy`, if none."""
    if not log.has("SIDD", *_FIELDS):
        flown = log.has("MODE", "Mode") and np.any(log.table("MODE")["Mode"] == _MODE)
        said = "the mode SystemID was flown, but no SIDS and SIDD messages are in the log"
        if log.damage or "SIDD" in log:
            raise LogError(
                f"{log.named}no SIDD messages with {', '.join(_FIELDS)} are in what can be read"
            )
        raise LogError(
            f"{log.path}: {said if flown else 'no SystemID messages (SIDS, SIDD) in the log'}; "
            "fly the mode SystemID with SID_AXIS 10 to 13 and LOG_BITMASK's bits 0 and 1 set, or "
            "name the channels yourself",
            remedy=remedy,
        )
    data = log.table("SIDD")
    columns = np.column_stack(
        [data.time, *(np.asarray(data[name], np.float64) for name in _FIELDS)]
    )
    ended, found = _ends(log), []
    columns = columns[np.all(np.isfinite(columns), axis=1)]
    begun = columns[:, 0] - columns[:, 1]
    if begun.size:  # medians of five: one wrong number begins no sweep
        begun = np.median(sliding_window_view(np.pad(begun, 2, "edge"), 5), axis=1)
    for part in np.split(columns, np.flatnonzero(np.abs(np.diff(begun)) > 0.5 * _DELAY) + 1):
        start = float(np.median(part[:, 0] - part[:, 1])) if part.size else 0.0
        part = part[np.abs(part[:, 0] - part[:, 1] - start) < 0.5 * _DELAY]
        time, rows = part[:, 0], part[:, 1:]
        setup = _setup(log, start, rows) if time.size > 1 else {"FSt": 0.0}
        if setup["FSt"] >= _RANGE[0] and int(setup["Ax"]) in SID_AXES:
            found.append(_sweep(log, start, setup, time, rows[:, 1], ended))
    if not found:
        raise LogError(
            f"{log.named}it has SIDD messages, and neither SIDS nor another that can be read says "
            f"which axis they are of{'' if log.damage else _BEFORE}"
        )
    return tuple(found)


def _setup(log: DataFlash, start: float, rows: Real) -> Mapping[str, float]:
    if log.has("SIDS", *_SETUP):
        for k in np.flatnonzero(np.abs((table := log.table("SIDS")).time - start) < _DELAY):
            row = {name: float(table[name][k]) for name in _SETUP}
            if _RANGE[0] <= row["FSt"] <= _RANGE[1] and all(map(math.isfinite, row.values())):
                return row
    said = [_AXIS.search(one.text) for one in log.messages() if abs(one.time - start) < _DELAY]
    axis = log.parameters(at=start + 0.5 * _DELAY).get("SID_AXIS", 0.0)
    axis = next((float(word[1]) for word in said if word), axis)
    clock, frequency, injected = rows.T
    length = float(max(clock[injected != 0.0], default=_DELAY)) - _DELAY
    # a few numbers may be wrong: of a sine 98 % are smaller than 0.9995 of its size
    size = float(np.quantile(np.abs(injected), 0.98, method="nearest"))
    fades = dict.fromkeys(("TFin", "TFout"), _USUAL_FADE)
    return {"Ax": axis, "Mag": size, "FSt": float(frequency[0]), "TR": length, **fades}


def _sweep(
    log: DataFlash,
    start: float,
    row: Mapping[str, float],
    time: Real,
    frequency: Real,
    ended: Sequence[tuple[float, str]],
) -> FlownSweep:
    """Return a sweep from SIDD's rows, (n_row,), and SIDS's fields."""
    logged, length, fade, first = float(time[-1]), row["TR"], row["TFout"], log.begins
    planned = start + _DELAY + length
    stop, why = next(((at, why) for at, why in ended if at > start), (math.inf, ""))
    end, complete = min(stop, logged), min(stop, logged) >= planned - 0.5 * fade
    said = shown(why) if stop <= logged + _DELAY and why else "the log of it ends"
    why = f"ended after {end - start:.3g} of {length + _DELAY:.3g} s: {said}"
    if complete:
        end, why = max(min(planned + _AFTER, end), planned - 0.5 * fade), "complete"
    used = (time <= min(end, planned - fade)) & (frequency >= _RANGE[0]) & (frequency <= _RANGE[1])
    flown = 2.0 * math.pi * np.append(frequency[used], row["FSt"])
    band = float(flown.min()), float(flown.max())
    told, swept = _grounded(log, start, end), (start + _DELAY + row["TFin"], planned - fade)
    lies = _still(log, swept[0], min(end, swept[1])) if told is None else told
    if lies:
        complete, why = False, "not flown to its end"
    return FlownSweep(
        int(row["Ax"]), start - first, end - first, abs(row["Mag"]), *band, complete, why, lies
    )


def told_states(log: DataFlash) -> list[tuple[float, str]]:
    """Return when the autopilot said that it lies, s since power-on, and how; "" of a lift-off."""
    states: list[tuple[float, str]] = []
    for (name, field), words in _STATES.items():
        if log.has(name, field):
            numbers = np.asarray((table := log.table(name))[field], np.float64).tolist()
            states += [(at, words[k]) for at, k in zip(table.time.tolist(), numbers) if k in words]
    return sorted(states, key=lambda one: one[0])


def _grounded(log: DataFlash, start: float, stop: float) -> str | None:
    """Return why a vehicle was on the ground from `start` to `stop`, s since power-on.

    "" if it was high above it all the time, None if nothing tells.
    """
    states = told_states(log)
    last = [one for one in states if one[0] <= start][-1:]
    for at, word in (*last, *(one for one in states if start < one[0] <= stop)):
        if word:
            return f"the autopilot says that it {word} at {at - log.begins:.1f} s"
    for name, field in _HEIGHTS:
        if log.has(name, field):
            here = ((table := log.table(name)).time >= start) & (table.time <= stop)
            height = np.asarray(table[field], np.float64)
            before = height[table.time <= next((at for at, word in states if not word), -math.inf)]
            above = np.abs(height[here] - (np.median(before) if before.size else 0.0))
            if np.any(above < _LOW):
                return (
                    f"it was on the ground, or within {_LOW:g} m of it, at "
                    f"{table.time[here][above < _LOW][0] - log.begins:.1f} s ({name}.{field})"
                )
            return "" if above.size and np.all(above > _HIGH) else None
    return None


def _still(log: DataFlash, start: float, stop: float) -> str:
    """Return when nothing moved between `start` and `stop`, s since power-on, or ""."""
    data = log.table("SIDD")
    if not log.has("SIDD", *_MOTION):
        return ""
    moved = np.column_stack([np.asarray(data[one], np.float64) / _MOTION[one] for one in _MOTION])
    window = np.floor((data.time - start) / _WINDOW)
    for k in range(int((stop - start) / _WINDOW)):
        rows = moved[window == k]
        if len(rows) > _FEWEST and np.std(rows, axis=0).max() < 1.0:
            at = start + k * _WINDOW - log.begins
            return f"nothing moved from {at:.1f} to {at + _WINDOW:.1f} s, as on the ground"
    return ""


def _ends(log: DataFlash) -> list[tuple[float, str]]:
    said = [
        (one.time, one.text)
        for one in log.messages()
        if one.text.startswith("SystemID") and "Starting" not in one.text
    ]
    if log.has("MODE", "Mode"):
        modes = log.table("MODE")
        left = modes.time[np.asarray(modes["Mode"], np.float64) != _MODE]
        said += [(time, "another mode was chosen") for time in left.tolist()]
    return sorted(said)


def usual_step(time: Real, spans: Spans) -> tuple[float, float]:
    """Return the step between messages at (n_time,) s without gaps, and the share missing."""
    steps = np.concatenate(
        [np.diff(time[(time >= start) & (time <= stop)]) for start, stop in spans]
    )
    steps = steps[steps > 0.0]
    if not steps.size:
        return 0.0, 0.0
    usual = float(np.mean(steps[steps < _ONE_MORE * np.median(steps)]))
    missing = float(np.sum(np.rint(steps / usual).clip(1.0) - 1.0))
    return usual, missing / (missing + steps.size)
