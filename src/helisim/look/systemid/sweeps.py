"""Finds the sweeps that an ArduPilot log holds: what was injected, from when to when."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import LogError
from helisim.logs.dataflash import DataFlash
from helisim.look.systemid.axes import SID_AXES, SidAxis

_WAIT = 1.0
"""s that the mode waits before it injects anything."""
_AFTER = 3.0
"""s after a sweep, in which the vehicle still answers it."""
_FIELDS = ("Time", "F", "Targ")
"""Of SIDD: the mode's own clock, s, the frequency, Hz, and what is injected."""
_RANGE = (0.005, 200.0)
"""Hz, in which sweeps are: the parameters' own range, and room."""
_SETUP = ("Ax", "Mag", "FSt", "TR", "TFout")
"""Of SIDS: axis, magnitude, lowest frequency, Hz, length and fade, s."""
_AXIS = re.compile(r"SystemID Starting: axis=(\d+)")
_USUAL_FADE = 2.0
"""s in which a sweep fades out, unless SID_T_FADE_OUT says another."""
_OCTAVE = 1.5
"""Of its lowest frequency to its highest: what spans less shows no dynamics."""
_PERIODS = 3.0
"""Periods of its lowest frequency that a sweep must last at least to be of use."""


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
        if not self.sid_axis.identifies:
            return "it moves a loop of position or velocity, which is too slow for the vehicle"
        least = _WAIT + _PERIODS * 2.0 * math.pi / self.low
        if self.stop - self.start < least:
            lasts = self.stop - self.start
            return f"it lasts {lasts:.3g} s, {_PERIODS:g} periods take {least:.3g} s"
        if self.high < _OCTAVE * self.low:
            return "it stays at one frequency"
        return ""

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
        size = f"{self.magnitude:.3g}" + ("" if self.sid_axis.unit == "1" else f" {self._unit}")
        return (
            f"SID_AXIS {self.axis}, {self.sid_axis}: {self.start:.1f} to {self.stop:.1f} s, "
            f"{self.low:.3g} to {self.high:.3g} rad/s, amplitude {size}, {self.end}"
        )

    @property
    def _unit(self) -> str:
        return self.sid_axis.unit


_BY_HAND = "or say it by --structure, --inputs, --outputs and --channel (helisim look LOG guesses)"


def sweeps(log: DataFlash, first: float, *, by_hand: str = _BY_HAND) -> tuple[FlownSweep, ...]:
    """Return the sweeps of a log, in their order.

    Args:
        log: by ArduPilot.
        first: its first stamp, s since the autopilot was switched on.
        by_hand: what else a user can do with a log that has none.

    Raises:
        LogError: it has none; the message says what to set.
    """
    if "SIDD" not in log or not set(_FIELDS) <= set(log.table("SIDD").columns):
        raise LogError(_without(log, by_hand))
    data = log.table("SIDD", fields=_FIELDS)
    columns = np.column_stack([np.asarray(data[name], np.float64) for name in _FIELDS])
    edges = [0, *(np.flatnonzero(np.diff(columns[:, 0]) < 0.0) + 1).tolist(), len(data)]
    ended = _ends(log)
    found = []
    for low, high in pairwise(edges):
        time, rows = data.time[low:high], columns[low:high]
        start = float(np.median(time - rows[:, 0])) if time.size else 0.0
        setup = _setup(log, start, rows)
        if time.size > 1 and setup["FSt"] >= _RANGE[0] and int(setup["Ax"]) in SID_AXES:
            found.append(_sweep(start, setup, time, rows[:, 1], ended))
    if not found:
        raise LogError(
            f"{log.path}: it has SIDD messages, and neither SIDS nor another says which axis they "
            "are of; log from before the mode SystemID is chosen"
        )
    return tuple(
        FlownSweep(one.axis, one.start - first, one.stop - first, *_rest(one)) for one in found
    )


def _setup(log: DataFlash, start: float, rows: NDArray[np.float64]) -> Mapping[str, float]:
    """Return what SIDS says of the sweep that began, or what follows where the logger dropped it.

    Args:
        log: by ArduPilot.
        start: of the sweep, s since the autopilot was switched on.
        rows: its SIDD, (n_time, 3) of `_FIELDS`.
    """
    if "SIDS" in log and set(_SETUP) <= set((table := log.table("SIDS")).columns):
        for k in np.flatnonzero(np.abs(table.time - start) < _WAIT).tolist():
            row = {name: float(table[name][k]) for name in _SETUP}
            if _RANGE[0] <= row["FSt"] <= _RANGE[1] and all(map(math.isfinite, row.values())):
                return row
    said = [_AXIS.search(one.text) for one in log.messages() if abs(one.time - start) < _WAIT]
    axis = next((float(word[1]) for word in said if word), None)
    if axis is None:
        axis = log.parameters(at=start + 0.5 * _WAIT).get("SID_AXIS", 0.0)
    clock, frequency, injected = rows.T
    moving = clock[injected != 0.0]
    length = float(moving[-1]) - _WAIT if moving.size else 0.0
    low, size = float(frequency[0]), float(np.abs(injected).max())
    return {"Ax": axis, "Mag": size, "FSt": low, "TR": length, "TFout": _USUAL_FADE}


def _rest(one: FlownSweep) -> tuple[float, float, float, bool, str]:
    return one.magnitude, one.low, one.high, one.complete, one.end


def _sweep(
    start: float,
    row: Mapping[str, float],
    time: NDArray[np.float64],
    frequency: NDArray[np.float64],
    ended: Sequence[tuple[float, str]],
) -> FlownSweep:
    """Return a sweep in the autopilot's time.

    Args:
        start: s.
        row: of SIDS, by field.
        time: (n_time,) of its SIDD, s.
        frequency: (n_time,) Hz.
        ended: when the autopilot said or did what ends a sweep, s, and what.
    """
    logged = float(time[-1])
    length, fade = row["TR"], row["TFout"]
    planned = start + _WAIT + length
    stop, why = next(((at, why) for at, why in ended if at > start), (math.inf, ""))
    complete = min(stop, logged) >= planned - 0.5 * fade
    if complete:
        end, why = max(min(planned + _AFTER, stop, logged), planned - 0.5 * fade), "complete"
    else:
        end = min(stop, logged)
        said = why if stop <= logged + _WAIT and why else "the log of it ends"
        why = f"ended after {end - start:.3g} of {length + _WAIT:.3g} s: {said}"
    used = (time <= min(end, planned - fade)) & (frequency >= _RANGE[0]) & (frequency <= _RANGE[1])
    flown = 2.0 * math.pi * np.append(frequency[used], row["FSt"])
    low, high = float(flown.min()), float(flown.max())
    return FlownSweep(int(row["Ax"]), start, end, abs(row["Mag"]), low, high, complete, why)


def _ends(log: DataFlash) -> list[tuple[float, str]]:
    """Return when the autopilot stopped a sweep or left a mode, s, and in which words, sorted."""
    said = [
        (one.time, one.text)
        for one in log.messages()
        if one.text.startswith("SystemID") and "Starting" not in one.text
    ]
    if "MODE" in log:
        modes = log.table("MODE", fields=("Mode",))
        left = [
            (float(time), "another mode was chosen")
            for time, mode in zip(modes.time, modes["Mode"])
            if int(mode) != _MODE
        ]
        said += left
    return sorted(said)


_MODE = 25
"""Number of the mode SystemID among Copter's."""


def _without(log: DataFlash, by_hand: str) -> str:
    """Return what is wrong with a log without SystemID's messages, and what to set."""
    mode = "MODE" in log and bool(np.any(log.table("MODE", fields=("Mode",))["Mode"] == _MODE))
    if mode:
        return (
            f"{log.path}: the mode SystemID was flown, but no SIDS and SIDD messages are in the "
            "log; set LOG_BITMASK so that it logs attitude fast (bits 0 and 1), and SID_AXIS to "
            "an axis before the mode is chosen"
        )
    return (
        f"{log.path}: no SystemID messages (SIDS, SIDD) in the log, so nothing says what was "
        "swept; fly the mode SystemID with SID_AXIS 10 to 13 and LOG_BITMASK's bits 0 and 1 set, "
        f"{by_hand}"
    )
