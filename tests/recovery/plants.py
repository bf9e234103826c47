"""Known linear plants, flown exactly: sweeps in, flight records out.

The plants are simulated at 2 kHz by exact discretisation (inputs linear between samples) and
recorded at 100 Hz, so what is recorded belongs to a continuous plant with true delays.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from control import StateSpace
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from helisim.ident import Structure
from helisim.ident.evaluate import matrices, simulate, state_space
from helisim.records.record import FlightRecord, channel

RATE = 2000
"""Simulation rate, Hz."""

KEEP = 20
"""One recorded sample in so many simulated ones: 100 Hz."""

ROLLPITCH_IN1 = {
    "tau_f": 0.04456,
    "L_b": 539.5,
    "M_a": 315.1,
    "A_b": -0.3514,
    "B_a": 0.5340,
    "A_lat": 0.06571,
    "A_lon": 0.3697,
    "B_lat": 0.3778,
    "B_lon": -0.06070,
    "tau_lat": 0.0115,
    "tau_lon": -0.0083,
}
"""Wu and Chen, Table 3, [IN1 OUT]."""


def sweep(
    duration: float, low: float, high: float, amplitude: float, trim: float = 3.0
) -> NDArray[np.float64]:
    """Return the sweep of design section 6 at the simulation rate, trim before and after."""
    span = duration - 2.0 * trim
    t = np.arange(round(duration * RATE)) / RATE - trim
    inside = (t >= 0.0) & (t <= span)
    c2 = 1.0 / (np.exp(4.0) - 1.0)
    omega = low + c2 * (np.exp(4.0 * np.clip(t, 0.0, span) / span) - 1.0) * (high - low)
    fade = np.clip(np.minimum(t, span - t) / 2.0, 0.0, 1.0)
    return np.where(inside, amplitude * fade * np.sin(np.cumsum(omega) / RATE), 0.0)


def coloured(
    random: np.random.Generator, samples: int, rms: float, cutoff: float
) -> NDArray[np.float64]:
    """Return noise below `cutoff` rad/s with the given rms."""
    sections = butter(2, cutoff / (np.pi * RATE), output="sos")
    noise = sosfiltfilt(sections, random.standard_normal(samples))
    return noise * (rms / np.std(noise))


def respond(
    structure: Structure, values: Mapping[str, float], inputs: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the plant's outputs at the simulation rate, delays of either sign included."""
    numbers = matrices(structure, values)
    model = state_space(structure, values)
    time = np.arange(inputs.shape[0]) / RATE
    outputs = []
    for k in range(len(structure.outputs)):
        lag = numbers.output_delays[k] + numbers.input_delays
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
    gust: float = 0.0,
) -> FlightRecord:
    """Sweep one input of a plant. Off-axis inputs carry remnant and a share of the sweep."""
    random = np.random.default_rng(seed)
    main = sweep(duration, *band, amplitude)
    inputs = np.zeros((main.size, len(structure.inputs)))
    for k, name in enumerate(structure.inputs):
        if name == axis:
            inputs[:, k] = main
        elif off_axis or correlated:
            inputs[:, k] = correlated * main + coloured(random, main.size, off_axis, 20.0)
    outputs = respond(structure, values, inputs)
    if gust:
        outputs += _gust(structure, values, random, main.size, gust)
    names = (*structure.inputs, *structure.outputs)
    return record(names, np.hstack([inputs, outputs]), random, noise or {})


def _gust(
    structure: Structure,
    values: Mapping[str, float],
    random: np.random.Generator,
    samples: int,
    rms: float,
) -> NDArray[np.float64]:
    """Return the outputs' motion from accelerations of the first states in a gust."""
    model = state_space(structure, values)
    n_out = len(structure.outputs)
    push = np.stack([coloured(random, samples, rms, 6.0) for _ in range(n_out)], axis=1)
    into = np.eye(model.nstates)[:, :n_out]
    pushed = StateSpace(model.A, into, model.C, 0, remove_useless_states=False)
    return simulate(pushed, push, 1.0 / RATE)


def fly_closed_loop(
    structure: Structure,
    values: Mapping[str, float],
    *,
    axis: str,
    sticks: Sequence[str],
    gain: float,
    gust: float,
    seed: int,
    noise: Mapping[str, float],
    duration: float = 90.0,
    band: tuple[float, float] = (1.5, 45.0),
    amplitude: float = 0.1,
) -> FlightRecord:
    """Sweep one stick of a plant under rate feedback, in a gust.

    input_k = stick_k - gain output_k, and the gust accelerates the first states. Delays are the
    recorder's: the loop closes without them, and an input channel's record is shifted by its
    delay, so that either sign can be flown.
    """
    random = np.random.default_rng(seed)
    model = state_space(structure, values)
    n_out, n_in = len(structure.outputs), len(structure.inputs)
    into = np.eye(model.nstates)[:, :n_out]
    closed = StateSpace(
        model.A - gain * model.B @ model.C,
        np.hstack([model.B, into]),
        np.vstack([-gain * model.C, model.C]),
        np.vstack(
            [np.hstack([np.eye(n_in), np.zeros((n_in, n_out))]), np.zeros((n_out, n_in + n_out))]
        ),
        remove_useless_states=False,
    )
    samples = round(duration * RATE)
    stick = np.stack([coloured(random, samples, 0.01, 20.0) for _ in sticks], axis=1)
    stick[:, list(structure.inputs).index(axis)] += sweep(duration, *band, amplitude)
    push = np.stack([coloured(random, samples, gust, 6.0) for _ in range(n_out)], axis=1)
    motion = simulate(closed, np.hstack([stick, push]), 1.0 / RATE)
    time = np.arange(samples) / RATE
    for k, delay in enumerate(matrices(structure, values).input_delays):
        if delay:
            motion[:, k] = np.interp(time + delay, time, motion[:, k])
    names = (*sticks, *structure.inputs, *structure.outputs)
    return record(names, np.hstack([stick, motion]), random, noise)
