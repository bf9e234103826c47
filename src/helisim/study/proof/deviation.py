"""How far an event turned a vehicle."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from helisim.base.errors import InputError
from helisim.records.channels import ATTITUDES
from helisim.records.record import FlightRecord


@dataclass(frozen=True)
class Deviation:
    """By how much an angle left where it was.

    Attributes:
        peak: rad.
        rms: rad, from the event on.
    """

    peak: float
    rms: float


def deviations(record: FlightRecord, start: float) -> Mapping[str, Deviation]:
    """Return the deviations of phi, theta and psi from their means before an event.

    Args:
        record: of the flight.
        start: s, of the event, from the flight's beginning.

    Raises:
        InputError: the record doesn't hold the time before and behind it.
    """
    time = record.time - record.time[0]
    before, behind = time < start, time >= start
    if not (before.any() and behind.any()):
        raise InputError(
            f"an event at {start:g} s needs a record of before and after it; this one lasts "
            f"{time[-1]:g} s"
        )
    found = {}
    for name in ATTITUDES:
        off = record[name][behind] - np.mean(record[name][before])
        found[name] = Deviation(float(np.abs(off).max()), float(np.sqrt(np.mean(off**2))))
    return found
