"""Known linear plants, flown exactly: sweeps in, flight records out.

The plants are simulated at 2 kHz by exact discretisation (inputs linear between samples) and
recorded at 100 Hz, so what is recorded belongs to a continuous plant with true delays.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from closed_loop import coloured, sweep
from numpy.typing import NDArray

from helisim.ident import Structure
from helisim.ident.evaluate import linear, simulate
from helisim.records.record import FlightRecord, channel

RATE = 2000  # of the simulation, Hz
KEEP = 20  # one recorded sample in so many simulated ones: 100 Hz


ROLLPITCH_IN1 = {
    "tau_f": 0.04456, "L_b": 539.5, "M_a": 315.1, "A_b": -0.3514, "B_a": 0.5340, "A_lat": 0.06571,
    "A_lon": 0.3697, "B_lat": 0.3778, "B_lon": -0.06070, "tau_lat": 0.0115, "tau_lon": -0.0083,
}  # fmt: skip
"""Wu and Chen, Table 3, [IN1 OUT]."""


def respond(
    structure: Structure, values: Mapping[str, float], inputs: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the plant's outputs at the simulation rate, delays of either sign included."""
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


def record(
    names: Sequence[str],
    columns: NDArray[np.float64],
    random: np.random.Generator,
    noise: Mapping[str, float],
) -> FlightRecord:
    """Return what the recorder keeps of simulated columns, with white noise by channel."""
    kept = columns[::KEEP].copy()
    for k, name in enumerate(names):
        kept[:, k] += noise.get(name, 0.0) * random.standard_normal(kept.shape[0])
    time = np.arange(kept.shape[0]) * (KEEP / RATE)
    return FlightRecord(time, kept, tuple(channel(name) for name in names))


def fly(
    structure: Structure,
    values: Mapping[str, float],
    *,
    axis: str,
    seed: int,
    duration: float = 90.0,
    band: tuple[float, float] = (1.0, 40.0),
    amplitude: float = 0.1,
    off_axis: float = 0.0,
    correlated: float = 0.0,
    noise: Mapping[str, float] | None = None,
) -> FlightRecord:
    """Sweep one input of a plant. Off-axis inputs carry remnant and a share of the sweep."""
    random = np.random.default_rng(seed)
    main = sweep(duration, band, amplitude, RATE)
    inputs = np.zeros((main.size, len(structure.inputs)))
    for k, name in enumerate(structure.inputs):
        if name == axis:
            inputs[:, k] = main
        elif off_axis or correlated:
            inputs[:, k] = correlated * main + coloured(random, main.size, off_axis, 20.0, RATE)
    outputs = respond(structure, values, inputs)
    names = (*structure.inputs, *structure.outputs)
    return record(names, np.hstack([inputs, outputs]), random, noise or {})
