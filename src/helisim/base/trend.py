"""Takes straight lines out of signals."""

import numpy as np
from numpy.typing import NDArray


def without_trend(columns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return columns, (n_time, n_column), less the straight line that fits each best.

    scipy.signal has it, and takes half a second to import.
    """
    time = np.linspace(-1.0, 1.0, columns.shape[0])
    level = columns - np.mean(columns, axis=0)
    return level - np.outer(time, (time @ level) / (time @ time))
