"""What a log's channels are declared to be, and what can be said against it."""

import math
from collections.abc import Mapping
from shlex import quote
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.unit_names import UNITS
from helisim.logs.report import LogFinding

SAME = 0.1
"""By which a ratio may be off a unit's, in its logarithm."""


class Declared(NamedTuple):
    """What a channel is declared to be.

    Attributes:
        column: of the log.
        unit: of that column.
        factor: SI per unit, without the sign.
        sign: 1 or -1.
        further: what else is declared, such as ":trim=20".
    """

    column: str
    unit: str
    factor: float
    sign: int
    further: str = ""

    def option(self, channel: str, *, unit: str | None = None, flip: bool = False) -> str:
        """Return the option that declares the channel with another unit or sign."""
        sign = ":sign=-1" if (self.sign < 0) != flip else ""
        further = self.further if unit is None else ""
        return "--channel " + quote(f"{channel}={self.column}:{unit or self.unit}{sign}{further}")


class Channels(NamedTuple):
    """The channels of a uniform record, as declared.

    Attributes:
        step: s.
        columns: name -> (n_time,) SI.
        declared: name -> what it is declared to be.
        clock: the column of times.
    """

    step: float
    columns: Mapping[str, NDArray[np.float64]]
    declared: Mapping[str, Declared]
    clock: str


def finding(kind: str, text: str, option: str) -> LogFinding:
    """Return what is found, with the option to try as the text's last words."""
    return LogFinding(kind, f"{text}; try {option}" if option else text, option=option)


def unit_of(declared: Declared, factor: float) -> str | None:
    """Return the unit of the same kind with a factor, SI per unit; None if there is none."""
    if not 0.0 < factor < math.inf:
        return None
    si = UNITS[declared.unit].si if declared.unit in UNITS else None
    near = [
        (abs(math.log(one.factor / factor)), name)
        for name, one in UNITS.items()
        if one.si == si and name != declared.unit and one.factor > 0.0
    ]
    off, name = min(near, default=(math.inf, ""))
    return name if off <= SAME else None
