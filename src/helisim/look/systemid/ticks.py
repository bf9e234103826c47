"""Rows of a log that belong together, and those that it lost."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_NEAR = 8
"""Rows on either side of a gap that fill it."""
_DEGREE = 4
"""Of the polynomial that does: gaps of half a period at the least."""
_TICKS = 1.5
"""Longer steps than so many are gaps."""


def partners(
    time: Array, others: Array, within: float
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return which rows of two types of messages were logged at the same tick.

    Args:
        time: (n_time,) s, increasing, of the type that a tick logs first.
        others: (n_other,) s, increasing, of one that it logs later.
        within: s, by how much.

    Returns:
        Rows of either, (n_both,) each.
    """
    if not time.size or not others.size:
        none = np.zeros(0, dtype=np.intp)
        return none, none
    later = np.searchsorted(others, time - 1e-6)
    there = later < others.size
    there[there] = others[later[there]] - time[there] < within
    rows = np.flatnonzero(there)
    return rows, later[rows]


def filled(time: Array, values: Array, wanted: Array, period: float) -> Array:
    """Return a signal at the times that are wanted, also where its log lost rows.

    A logger that is pressed drops a third of its rows, in gaps of 10 to 50 ms: straight lines
    through them cost 20 deg of phase at 70 rad/s, a polynomial through the rows about them 2.

    Args:
        time: (n_time,) s, increasing.
        values: (n_time,).
        wanted: (n_wanted,) s, increasing.
        period: s, between rows where none is lost.

    Returns:
        (n_wanted,), straight between rows that no gap separates.
    """
    found = np.interp(wanted, time, values)
    for before in np.flatnonzero(np.diff(time) > _TICKS * period):
        first, last = np.searchsorted(wanted, time[before : before + 2], side="right")
        near = slice(max(0, before + 1 - _NEAR), before + 1 + _NEAR)
        if first == last or near.stop - near.start < 2 * _NEAR or near.stop > time.size:
            continue
        middle = 0.5 * (time[before] + time[before + 1])
        off = time[near] - middle
        size, half = np.abs(off).max(), 0.5 * (time[before + 1] - time[before])
        weight = np.exp(-0.5 * (2.0 * (np.abs(off) - half) / (_NEAR * period)) ** 2)
        line = np.polyfit(off / size, values[near], _DEGREE, w=weight)
        found[first:last] = np.polyval(line, (wanted[first:last] - middle) / size)
    return found
