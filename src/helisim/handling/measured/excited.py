"""Where what was injected has power."""

from collections.abc import Sequence

import numpy as np

from helisim.errors import IdentificationError
from helisim.ident.responses.local_lines import flight_lines
from helisim.records.record import FlightRecord

_FAINT = 0.02
"""Power per octave, over the largest there is, from which on a frequency counts as excited."""

_WIDTH = 0.12
"""Half width over which power is averaged, as a share of the frequency."""

_PERIODS = 1.5
"""Of the lowest frequency, that the longest record holds at least."""

_NYQUIST = 0.8
"""Of the highest frequency that samples resolve."""


def excited_band(records: Sequence[FlightRecord], drives: Sequence[str]) -> tuple[float, float]:
    """Return the band in which all driving signals have power in some record, rad/s.

    Raises:
        IdentificationError: there is none.
    """
    low = _PERIODS * 2.0 * np.pi / max(one.duration for one in records)
    high = _NYQUIST * np.pi / max(one.sample_time for one in records)
    if not high > 2.0 * low:
        raise IdentificationError(
            f"the records are too short: {max(one.duration for one in records):.4g} s at "
            f"{records[0].sample_time:.4g} s a sample"
        )
    frequency = np.geomspace(low, high, 200)
    lines = flight_lines(records, drives, high * (1.0 + _WIDTH))
    first, count = lines.within((1.0 - _WIDTH) * frequency, (1.0 + _WIDTH) * frequency)
    total = np.zeros((frequency.size, len(drives)))
    for flight in range(len(records)):
        summed = np.concatenate(
            [
                np.zeros((1, len(drives))),
                np.cumsum(np.abs(lines.values[flight]) ** 2, axis=0),
            ]
        )
        total += (summed[first[:, flight] + count[:, flight]] - summed[first[:, flight]]) * (
            lines.spacing[flight]
        )
    there = np.all(total > _FAINT * total.max(axis=0), axis=1)
    inside = np.flatnonzero(there)
    if inside.size < 2:
        raise IdentificationError(
            f"{', '.join(drives)} have no band of power in common; excite them over one band"
        )
    return float(frequency[inside[0]]), float(frequency[inside[-1]])
