"""What an ArduPilot helicopter's tail servo was really sent, from what its mixer was commanded.

Pulses are whole microseconds and cut toward the servo's trim, so that commands of less than a
microsecond to either side move nothing: of a pedal near its trim that is a good part of what a
yaw loop leaves of a slow sweep. Source: ArduPilot's documentation of SERVOn_TRIM, SERVOn_MIN,
SERVOn_MAX; AP_MotorsHeli_Single commands the tail in whole hundredths of a degree, of 45.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from helisim.logs.mapping import Clock
from helisim.logs.source import Source

YAW = "RATE.YOut"
SENT = "RATE.YOut as sent"
"""Column of the mixer's yaw command, and of what the tail's servo was sent of it, 1 at its end."""

_TAIL = 36
"""SERVOn_FUNCTION of a helicopter's tail."""
_OUTPUTS = 32
_FULL = 4500.0
"""Hundredths of a degree at the end of the tail servo's travel."""


def tail_servo(parameters: Mapping[str, float]) -> tuple[float, float] | None:
    """Return the tail servo's travel to the right and to the left, us; None if it isn't one.

    Args:
        parameters: the autopilot's, by name.
    """
    if parameters.get("H_TAIL_TYPE", 0.0) != 0.0 or parameters.get("H_COL2YAW", 0.0) != 0.0:
        return None
    for k in range(1, _OUTPUTS + 1):
        if parameters.get(f"SERVO{k}_FUNCTION") == _TAIL:
            low, trim, high = (
                parameters.get(f"SERVO{k}_{name}", 0.0) for name in ("MIN", "TRIM", "MAX")
            )
            right, left = high - trim, trim - low
            if parameters.get(f"SERVO{k}_REVERSED", 0.0):
                right, left = left, right
            return (right, left) if min(right, left) > 0.0 else None
    return None


def sent_yaw(command: NDArray[np.float64], travel: tuple[float, float]) -> NDArray[np.float64]:
    """Return the yaw command that a tail servo was sent, (n_time,), 1 at its end.

    Args:
        command: the mixer's, (n_time,).
        travel: to the right and to the left, us.
    """
    angle = np.trunc(command * _FULL)
    side = np.where(angle > 0.0, *travel)
    return np.sign(angle) * np.floor(np.abs(angle) * side / _FULL) / side


class SentSource:
    """A log's columns, and that of what its tail servo was sent.

    Args:
        source: the log.
        travel: of the tail servo, us.
    """

    def __init__(self, source: Source, travel: tuple[float, float]) -> None:
        self._source, self._travel = source, travel
        self.path, self.format, self.counts = source.path, source.format, source.counts
        self.findings = source.findings
        self.names = (*source.names, SENT)

    def stated_unit(self, name: str) -> str | None:
        """Return the unit that the log states for a column, if it is one."""
        return "1" if name == SENT else self._source.stated_unit(name)

    def numbers(self, name: str) -> NDArray[np.float64]:
        """Return a column, (n_time,), NaN where it has no number."""
        if name != SENT:
            return self._source.numbers(name)
        return sent_yaw(self._source.numbers(YAW), self._travel)

    def clock(self, name: str) -> str:
        """Return the name of a column's clock."""
        return self._source.clock(YAW if name == SENT else name)

    def rows(self, clock: str) -> NDArray[np.int64]:
        """Return the row number of each sample of a clock, (n_time,)."""
        return self._source.rows(clock)

    def stamps(self, clock: str, time: Clock | None) -> tuple[NDArray[np.float64], str, str]:
        """Return seconds since the log's first stamp (n_time,), that stamp, and the column."""
        return self._source.stamps(clock, time)
