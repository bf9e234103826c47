"""The timelines of a recording."""

import numpy as np
import rerun as rr
from numpy.typing import NDArray

TIMELINE = "time"
"""Of a flight, from its first sample."""
STEP = "step"
"""Of the experiment's log: steps have an order, and no common clock."""


def time_column(time: NDArray[np.float64]) -> rr.TimeColumn:
    """Return times in s, (n_time,), as a column in whole nanoseconds.

    Rerun cuts what is below them off durations that are given as floats.
    """
    return rr.TimeColumn(TIMELINE, duration=np.rint(time * 1e9).astype("timedelta64[ns]"))
