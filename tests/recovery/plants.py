"""Known linear plants, flown exactly: sweeps in, flight records out.

The plants are simulated at 2 kHz by exact discretisation (inputs linear between samples) and
recorded at 100 Hz, so what is recorded belongs to a continuous plant with true delays.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from helisim.ident import Structure
from helisim.ident.evaluate import linear, simulate

RATE = 2000  # of the simulation, Hz
KEEP = 20  # one recorded sample in so many simulated ones: 100 Hz


def respond(
    structure: Structure, values: Mapping[str, float], inputs: NDArray[np.float64]
) -> NDArray[np.float64]:
    model = linear(structure, values)
    time = np.arange(inputs.shape[0]) / RATE
    outputs = []
    for k in range(len(structure.outputs)):
        lag = model.lags[k]
        shifted = np.stack(
            [np.interp(time - lag[j], time, inputs[:, j]) for j in range(lag.size)], axis=1
        )
        outputs.append(simulate(model, shifted, 1.0 / RATE)[:, k])
    return np.stack(outputs, axis=1)
