"""Finds the sweeps that an ArduPilot log of its mode SystemID holds: what was injected, and when.

Source: ArduPilot's documentation of the parameter SID_AXIS, and of the mode ("System ID Mode").
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import LogError
from helisim.base.note import Remedy
from helisim.base.text import shown
from helisim.logs.dataflash import DataFlash, is_dataflash, open_dataflash
from helisim.logs.source import file_digest

Array = NDArray[np.float64]
Place = Literal["input", "recovery", "rate", "mixer", "disturbance", "velocity"]
PLACES: dict[Place, str] = {
    "input": "added to the pilot's command",
    "recovery": "added to the pilot's command, which isn't fed forward meanwhile",
    "rate": "added to the commanded rate",
    "mixer": "added to the command of the actuators",
    "disturbance": "added to the measured position or velocity",
    "velocity": "added to the commanded velocity",
}
"""Where a sweep is injected -> what that is."""


@dataclass(frozen=True)
class SidAxis:
    """One value of SID_AXIS.

    Attributes:
        number: the value.
        place: where the sweep is injected, of `PLACES`.
        word: what it moves, such as "roll".
        control: whose command it moves, as `handling.axis` calls it: "lat", "lon", "ped" or "col".
        unit: of the sweep in the log.
    """

    number: int
    place: Place
    word: str
    control: str
    unit: str

    @property
    def name(self) -> str:
        """The channel of what is injected, such as "mixer_roll"."""
        return f"{self.place}_{self.word}"

    @property
    def identifies(self) -> bool:
        """Whether the sweep is fast enough for the vehicle itself: not where positions are held."""
        return self.place not in ("disturbance", "velocity")

    def __str__(self) -> str:
        return f"{self.place} {self.word.replace('_', ' ')}"


_TURNS = (("roll", "lat"), ("pitch", "lon"), ("yaw", "ped"))
_PATHS = (("right", "lat"), ("forward", "lon"))
_ALL: tuple[tuple[Place, str, str, str], ...] = (
    # of yaw it is a rate that is commanded, though its name says angle
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

_DELAY = 1.0  # s before the mode injects anything
_AFTER = 3.0  # s after a sweep, in which the vehicle still answers it
_FIELDS = ("Time", "F", "Targ")
"""Of SIDD: the mode's own clock, s, the frequency, Hz, and what is injected."""
_RANGE = (0.005, 200.0)  # Hz, in which sweeps are: the parameters' own range, and room
_SETUP = ("Ax", "Mag", "FSt", "TR", "TFout")
"""Of SIDS: axis, magnitude, lowest frequency, Hz, length and fade, s."""
_AXIS = re.compile(r"SystemID Starting: axis=(\d+)")
_USUAL_FADE = 2.0  # s in which a sweep fades out, unless SID_T_FADE_OUT says another
_OCTAVE = 1.5  # of its lowest frequency to its highest: what spans less shows no dynamics
_PERIODS = 3.0  # periods of its lowest frequency that a sweep must last at least to be of use
_MODE = 25  # number of the mode SystemID among Copter's


@dataclass(frozen=True)
class FlownSweep:
    """A sweep that an autopilot injected.

    Attributes:
        axis: number of SID_AXIS.
        start: when the mode began, s after the log's first stamp.
        stop: when it, or the vehicle's answer, was over, s after the log's first stamp.
        magnitude: amplitude, in the axis's unit.
        low: lowest frequency that was injected, rad/s.
        high: highest frequency that was injected, before it faded out, rad/s.
        complete: whether it ran to its end.
        end: how it ended, in words.
    """

    axis: int
    start: float
    stop: float
    magnitude: float
    low: float
    high: float
    complete: bool
    end: str

    @property
    def sid_axis(self) -> SidAxis:
        """Where it was injected."""
        return SID_AXES[self.axis]

    @property
    def unused(self) -> str:
        """Why it can't identify the vehicle, empty if it can."""
        least, lasts = _DELAY + _PERIODS * 2.0 * math.pi / self.low, self.stop - self.start
        if not self.sid_axis.identifies:
            return "it moves a loop of position or velocity, which is too slow for the vehicle"
        if lasts < least:
            return f"it lasts {lasts:.3g} s, {_PERIODS:g} periods take {least:.3g} s"
        return "it stays at one frequency" if self.high < _OCTAVE * self.low else ""

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {
            "axis": self.axis,
            "name": str(self.sid_axis),
            "start_s": self.start,
            "stop_s": self.stop,
            "magnitude": self.magnitude,
            "unit": self.sid_axis.unit,
            "low_rad_s": self.low,
            "high_rad_s": self.high,
            "complete": self.complete,
            "end": self.end,
        }

    def __str__(self) -> str:
        unit = self.sid_axis.unit
        size = f"{self.magnitude:.3g}" + ("" if unit == "1" else f" {unit}")
        return (
            f"SID_AXIS {self.axis}, {self.sid_axis}: {self.start:.1f} to {self.stop:.1f} s, "
            f"{self.low:.3g} to {self.high:.3g} rad/s, amplitude {size}, {self.end}"
        )


def own_sweeps(path: Path) -> tuple[FlownSweep, ...]:
    """Return the sweeps that a log says itself were injected, none of any other log.

    Raises:
        StorageError: it can't be read.
    """
    try:
        return sweeps(open_dataflash(path, file_digest(path))) if is_dataflash(path) else ()
    except LogError:
        return ()


def sweeps(
    log: DataFlash, remedy: Remedy = "structure,inputs,outputs,channel"
) -> tuple[FlownSweep, ...]:
    """Return the sweeps of a log, in their order, times after its first stamp.

    Args:
        log: by ArduPilot.
        remedy: options that serve where it has none.

    Raises:
        LogError: it has none; the message says what to set.
    """
    first = min(log.first_stamps.values())
    if "SIDD" not in log or not set(_FIELDS) <= set(log.table("SIDD").columns):
        raise LogError(_without(log), remedy=remedy)
    data = log.table("SIDD", fields=_FIELDS)
    columns = np.column_stack([np.asarray(data[name], np.float64) for name in _FIELDS])
    edges = [0, *(np.flatnonzero(np.diff(columns[:, 0]) < 0.0) + 1).tolist(), len(data)]
    ended, found = _ends(log), []
    for low, high in pairwise(edges):
        time, rows = data.time[low:high], columns[low:high]
        start = float(np.median(time - rows[:, 0])) if time.size else 0.0
        setup = _setup(log, start, rows)
        if time.size > 1 and setup["FSt"] >= _RANGE[0] and int(setup["Ax"]) in SID_AXES:
            found.append(_sweep(start, setup, time, rows[:, 1], ended, first))
    if not found:
        raise LogError(
            f"{log.path}: it has SIDD messages, and neither SIDS nor another says which axis they "
            "are of; log from before the mode SystemID is chosen"
        )
    return tuple(found)


def _setup(log: DataFlash, start: float, rows: Array) -> Mapping[str, float]:
    """Return what SIDS says of the sweep that began, or what follows where that is lost."""
    if "SIDS" in log and set(_SETUP) <= set((table := log.table("SIDS")).columns):
        for k in np.flatnonzero(np.abs(table.time - start) < _DELAY).tolist():
            row = {name: float(table[name][k]) for name in _SETUP}
            if _RANGE[0] <= row["FSt"] <= _RANGE[1] and all(map(math.isfinite, row.values())):
                return row
    said = [_AXIS.search(one.text) for one in log.messages() if abs(one.time - start) < _DELAY]
    axis = next((float(word[1]) for word in said if word), None)
    if axis is None:
        axis = log.parameters(at=start + 0.5 * _DELAY).get("SID_AXIS", 0.0)
    clock, frequency, injected = rows.T
    moving = clock[injected != 0.0]
    length = float(moving[-1]) - _DELAY if moving.size else 0.0
    low, size = float(frequency[0]), float(np.abs(injected).max())
    return {"Ax": axis, "Mag": size, "FSt": low, "TR": length, "TFout": _USUAL_FADE}


def _sweep(
    start: float,
    row: Mapping[str, float],
    time: Array,
    frequency: Array,
    ended: Sequence[tuple[float, str]],
    first: float,
) -> FlownSweep:
    """Return a sweep."""
    logged, length, fade = float(time[-1]), row["TR"], row["TFout"]
    planned = start + _DELAY + length
    stop, why = next(((at, why) for at, why in ended if at > start), (math.inf, ""))
    complete = min(stop, logged) >= planned - 0.5 * fade
    if complete:
        end, why = max(min(planned + _AFTER, stop, logged), planned - 0.5 * fade), "complete"
    else:
        end = min(stop, logged)
        said = shown(why) if stop <= logged + _DELAY and why else "the log of it ends"
        why = f"ended after {end - start:.3g} of {length + _DELAY:.3g} s: {said}"
    used = (time <= min(end, planned - fade)) & (frequency >= _RANGE[0]) & (frequency <= _RANGE[1])
    flown = 2.0 * math.pi * np.append(frequency[used], row["FSt"])
    band = float(flown.min()), float(flown.max())
    limits = start - first, end - first
    return FlownSweep(int(row["Ax"]), *limits, abs(row["Mag"]), *band, complete, why)


def _ends(log: DataFlash) -> list[tuple[float, str]]:
    """Return when the autopilot stopped a sweep or left a mode, s, and in which words, sorted."""
    said = [
        (one.time, one.text)
        for one in log.messages()
        if one.text.startswith("SystemID") and "Starting" not in one.text
    ]
    if "MODE" in log:
        modes = log.table("MODE", fields=("Mode",))
        left = modes.time[np.asarray(modes["Mode"], np.float64) != _MODE]
        said += [(time, "another mode was chosen") for time in left.tolist()]
    return sorted(said)


def _without(log: DataFlash) -> str:
    """Return what is wrong with a log without SystemID's messages, and what to set."""
    if "MODE" in log and np.any(log.table("MODE", fields=("Mode",))["Mode"] == _MODE):
        return (
            f"{log.path}: the mode SystemID was flown, but no SIDS and SIDD messages are in the "
            "log; set LOG_BITMASK so that it logs attitude fast (bits 0 and 1), and SID_AXIS to "
            "an axis before the mode is chosen"
        )
    return (
        f"{log.path}: no SystemID messages (SIDS, SIDD) in the log, so nothing says what was "
        "swept; fly the mode SystemID with SID_AXIS 10 to 13 and LOG_BITMASK's bits 0 and 1 set, "
        "or name the channels yourself"
    )
