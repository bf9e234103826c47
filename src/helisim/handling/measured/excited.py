"""Where what was injected has power."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import IdentificationError
from helisim.ident.local_fit import flight_lines
from helisim.records.record import FlightRecord

_EDGE = 0.05
"""Of the largest power per octave near a frequency: where power is less, the band has ended."""

_NEAR = 1.4
"""How far away, as a ratio of frequencies, is near: a spectrum of any usual slope passes."""

_WIDTH = 0.1
"""Half width over which power is averaged, as a share of the frequency."""

_NYQUIST = 0.8
"""Of the highest frequency that samples resolve."""


def excited_band(records: Sequence[FlightRecord], drives: Sequence[str]) -> tuple[float, float]:
    """Return the band in which all driving signals have power in some record, rad/s.

    Raises:
        IdentificationError: there is none.
    """
    durations = [one.duration for one in records]
    window = min(min(durations) / 2.0, sum(durations) / 5.0)  # the longest that the rules allow
    low = 1.0001 * 2.0 * np.pi / window
    high = _NYQUIST * np.pi / max(one.sample_time for one in records)
    if not high > 2.0 * low:
        raise IdentificationError(
            f"the records are too short: {min(durations):.4g} s at "
            f"{records[0].sample_time:.4g} s a sample"
        )
    frequency = np.geomspace(low, high, 200)
    reach = int(np.ceil(np.log(_NEAR) / np.log(frequency[1] / frequency[0])))
    octaves = frequency[:, None] * _power(records, drives, frequency)
    edges = [_band(one, reach) for one in octaves.T]
    first, last = max(edge[0] for edge in edges), min(edge[1] for edge in edges)
    if last - first < 1:
        raise IdentificationError(
            f"{', '.join(drives)} have no band of power in common; excite them over one band"
        )
    return float(frequency[first]), float(frequency[last])


def _power(
    records: Sequence[FlightRecord], drives: Sequence[str], frequency: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the mean power of signals around frequencies, all records, (n_freq, n_drive)."""
    lines = flight_lines(records, drives, float(frequency[-1]) * (1.0 + _WIDTH))
    first, count = lines.within((1.0 - _WIDTH) * frequency, (1.0 + _WIDTH) * frequency)
    power = np.abs(lines.values) ** 2
    total = np.concatenate([np.zeros_like(power[:, :1]), np.cumsum(power, axis=1)], axis=1)
    flight = np.arange(len(records))
    summed = total[flight, first + count] - total[flight, first]
    return np.sum(summed / np.maximum(count, 1)[..., None], axis=1)


def _band(power: NDArray[np.float64], reach: int) -> tuple[int, int]:
    """Return the first and last index of the band around the most power, (n_freq,) per octave."""
    near = np.array([power[max(k - reach, 0) : k + reach + 1].max() for k in range(power.size)])
    weak = np.flatnonzero(power < _EDGE * near)
    top = int(np.argmax(power))
    before, after = weak[weak < top], weak[weak > top]
    return (
        int(before[-1]) + 1 if before.size else 0,
        int(after[0]) - 1 if after.size else power.size - 1,
    )
