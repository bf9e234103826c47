"""Chooses the columns of an ArduPilot log that the channels of an identification come from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import LogError
from helisim.logs.dataflash import DataFlash
from helisim.logs.mapping import Column
from helisim.look.systemid.sent import SENT, YAW, tail_servo

_FAST = 0.5
"""Of SIDD's rate: a message that is slower than that is no good beside it."""


@dataclass(frozen=True)
class TakenChannel:
    """A channel, where it comes from, and why from there.

    Attributes:
        name: of the channel, such as "lat".
        column: of the log, such as RATE.ROut, with its unit.
        rate: samples a second while sweeps were flown, Hz.
        why: it is taken for that.
    """

    name: str
    column: Column
    rate: float
    why: str

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {
            "name": self.name,
            "column": self.column.column,
            "unit": self.column.unit,
            "rate_hz": self.rate,
            "why": self.why,
        }


INJECTED = "SIDD.Targ"
"""Column of what a sweep injects, in its axis's unit."""

_OUTPUT = "the mixer's command on this axis, the sweep in it; 1 is its full travel"
_THROTTLE = "throttle that the mixer is given, the sweep in it, 0 to 1, about its middle"
_SENT = (
    "the mixer's command as the tail's servo was sent it, in whole us, {:g} to the right and {:g} "
    "to the left of its trim"
)
_UNFILTERED = "gyro before its filter, of which nothing has to be known then"
_FILTERED = "gyro behind its filter"
_FELT = "accelerometer before its filter"
_MIDDLE = 0.5
"""Throttle in the middle of its range, which is no collective."""
_ONE_MORE = 1.6
"""Of the median step: a longer one has a message missing."""
_CANDIDATES: tuple[tuple[str, str, str, str], ...] = (
    ("lat", "RATE.ROut", "1", _OUTPUT),
    ("lon", "RATE.POut", "1", _OUTPUT),
    ("ped", "RATE.YOut", "1", _OUTPUT),
    (
        "col",
        "RATE.AOut",
        "1",
        _THROTTLE,
    ),
    *(
        (name, column, unit, why)
        for k, name in enumerate("pqr")
        for column, unit, why in (
            (f"SIDD.G{'xyz'[k]}", "deg/s", _UNFILTERED),
            (f"RATE.{'RPY'[k]}", "deg/s", _FILTERED),
            (f"IMU.Gyr{'XYZ'[k]}", "rad/s", _FILTERED),
        )
    ),
    *(
        (f"a{axis}", column, "m/s^2", why)
        for axis in "xyz"
        for column, why in (
            (f"SIDD.A{axis}", _FELT),
            (f"IMU.Acc{axis.upper()}", "accelerometer behind its filter"),
        )
    ),
    *(
        (name, column, "deg", why)
        for name, word in (("phi", "Roll"), ("theta", "Pitch"), ("psi", "Yaw"))
        for column, why in (
            (f"ANG.{word}", "attitude as the controller has it"),
            (f"ATT.{word}", "attitude"),
        )
    ),
)
"""Channel, column, unit, why: of a channel the best first. Signs are the same: forward-right-down,
and the mixer's commands are positive to the right, nose up, nose right, and up."""

REQUIRED = ("lat", "lon", "ped", "col")


def chosen_channels(
    log: DataFlash, given: Mapping[str, Column], spans: Sequence[tuple[float, float]]
) -> tuple[TakenChannel, ...]:
    """Return all channels that a log can give, beside those that its sweeps are.

    Args:
        log: by ArduPilot, with SystemID's messages.
        given: channel -> column, as far as the user says it.
        spans: of its sweeps, s since the autopilot was switched on.

    Raises:
        LogError: it lacks what the mixer was commanded.
    """
    rates = {name: _rate(log, name, spans) for name in _types(given)}
    least = _FAST * rates["SIDD"]
    sent = tail_servo(log.parameters())
    taken: dict[str, TakenChannel] = {}
    for name, column in given.items():
        rate = rates.get(column.column.partition(".")[0], 0.0)
        taken[name] = TakenChannel(name, column, rate, "given")
    for name, wanted, unit, meant in _CANDIDATES:
        column, why = wanted, meant
        if column == YAW and sent is not None:
            column, why = SENT, _SENT.format(*sent)
        message, _, field = column.partition(".")
        there = message in rates and rates[message] >= least
        field = field.partition(" ")[0]
        if name not in taken and there and field in log.table(message).columns:
            trim = _MIDDLE if name == "col" else None
            taken[name] = TakenChannel(name, Column(column, unit, trim=trim), rates[message], why)
    if not any(name in taken for name in REQUIRED):
        raise LogError(
            f"{log.path}: no RATE messages beside the sweeps, which say what the mixer was "
            "commanded; set LOG_BITMASK's bits 0 and 1, or say the commands by --channel "
            "lat=COLUMN:UNIT"
        )
    return tuple(taken.values())


def _types(given: Mapping[str, Column]) -> tuple[str, ...]:
    columns = [column for _, column, *_ in _CANDIDATES]
    columns += [one.column for one in given.values()]
    return tuple(dict.fromkeys(["SIDD", *(column.partition(".")[0] for column in columns)]))


def _rate(log: DataFlash, name: str, spans: Sequence[tuple[float, float]]) -> float:
    """Return the median rate of a type of message within spans, Hz; 0 if it has too few."""
    if name not in log:
        return 0.0
    step, _ = usual_step(log.table(name).time, spans)
    return float(f"{1.0 / step:.3g}") if step > 0.0 else 0.0


def usual_step(
    time: NDArray[np.float64], spans: Sequence[tuple[float, float]]
) -> tuple[float, float]:
    """Return the step between messages that none is missing in, s, and the share that is missing.

    Steps of a loop alternate where its period is no whole number of the clock's. Zeros if there
    are no steps.

    Args:
        time: (n_time,) of messages, s.
        spans: that are looked at, s.
    """
    each = [np.diff(time[(time >= start) & (time <= stop)]) for start, stop in spans]
    steps = np.concatenate(each)
    steps = steps[steps > 0.0]
    if not steps.size:
        return 0.0, 0.0
    usual = float(np.mean(steps[steps < _ONE_MORE * np.median(steps)]))
    missing = float(np.sum(np.rint(steps / usual).clip(1.0) - 1.0))
    return usual, missing / (missing + steps.size)
