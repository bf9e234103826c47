"""The lines of flight records: their discrete Fourier transforms, whole and without a window.

A record of T seconds has a line every 2 pi / T rad/s. At a line an output is

    Y = G(j w) U + T(w) + E ,

exactly: G is the vehicle, T a smooth function of frequency that the state at the record's start
and end gives (the transient), E the disturbance, which is nearly independent from line to line.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from helisim.records.record import FlightRecord


@dataclass(frozen=True, eq=False)
class Lines:
    """The lines of all flights, from the level (line 0) up to a highest frequency.

    Attributes:
        names: the signals.
        spacing: (n_flight,) rad/s between lines.
        count: (n_flight,) how many lines a flight has.
        values: (n_flight, n_line, n_signal), scaled so that |Z|^2 is a one-sided spectrum; zero
            where a flight has fewer lines than another.
    """

    names: tuple[str, ...]
    spacing: NDArray[np.float64]
    count: NDArray[np.intp]
    values: NDArray[np.complex128]

    def places(self, names: Sequence[str]) -> list[int]:
        """Return where signals are in `values`."""
        return [self.names.index(name) for name in names]

    def within(
        self, low: NDArray[np.float64], high: NDArray[np.float64]
    ) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return the first line at or above `low` and how many reach to `high`, each flight.

        Line 0, the level, is never among them.

        Args:
            low: (n_freq,) rad/s.
            high: (n_freq,) rad/s.

        Returns:
            (n_freq, n_flight) each.
        """
        first = np.ceil(low[:, None] / self.spacing - 1e-9).astype(np.intp)
        last = np.floor(high[:, None] / self.spacing + 1e-9).astype(np.intp)
        first = np.maximum(first, 1)
        last = np.minimum(last, self.count - 1)
        return first, np.maximum(last - first + 1, 0)


def flight_lines(records: Sequence[FlightRecord], names: Sequence[str], highest: float) -> Lines:
    """Return the lines of records, each less its mean level.

    Args:
        records: of the flights, each with all signals.
        names: of the signals.
        highest: lines up to it are kept, rad/s.
    """
    spacing = np.array([2.0 * np.pi / (len(one) * one.sample_time) for one in records])
    kept = []
    for record, step in zip(records, spacing):
        columns = record.select(names)
        lines = fft.rfft(columns - columns.mean(axis=0), axis=0)
        # the line at half the sampling rate is not one-sided
        most = min((len(record) - 1) // 2, int(highest / step) + 1) + 1
        scale = record.sample_time * np.sqrt(step / np.pi)
        kept.append(np.asarray(lines[:most]) * scale)
    count = np.array([one.shape[0] for one in kept], dtype=np.intp)
    values = np.zeros((len(kept), int(count.max()), len(names)), dtype=np.complex128)
    for flight, one in enumerate(kept):
        values[flight, : one.shape[0]] = one
    return Lines(tuple(names), spacing, count, values)
