"""Closed-loop flights of known plants with delayed inputs: unstable ones stay in the air.

The plant is discretised exactly for inputs that are linear between samples of the simulation;
a delay is a whole number of them, so the record belongs to a continuous plant with that delay.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, solve_continuous_are
from scipy.signal import butter, sosfiltfilt

from helisim.ident import Structure
from helisim.ident.evaluate import _propagate, linear, response
from helisim.records.record import FlightRecord, channel


@dataclass(frozen=True, eq=False)
class Rig:
    """A plant with its true values under state feedback, u = stick - gain x(t)."""

    structure: Structure  # may delay its inputs, not its outputs
    values: Mapping[str, float]
    gain: NDArray[np.float64]  # (n_in, n_state)
    rate: int  # samples a second of the simulation; delays are whole numbers of them
    keep: int  # one recorded sample in so many
    noise: Mapping[str, float]  # rms of white sensor noise by channel
    gust: Mapping[str, float]  # rms of the acceleration that a gust adds, by state
    gust_cutoff: float = 6.0  # rad/s

    @property
    def sticks(self) -> tuple[str, ...]:
        return tuple(name.upper() for name in self.structure.inputs)

    def loop(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.intp]]:
        """Return the loop's transition and input matrices, and the delays in samples.

        The state is x, then the inputs now, one sample ago and so on. The disturbance is
        the gust now, its change to the next sample, and the sticks of the next sample.
        """
        model = linear(self.structure, self.values)
        lag = model.lags[0] * self.rate
        samples = np.rint(lag).astype(np.intp)
        assert np.allclose(lag, samples, atol=1e-9)
        assert np.all(samples >= 1)
        n, n_in = len(model.a), len(self.structure.inputs)
        pushed = np.hstack([model.b, np.eye(n)])
        transition, now, change = _discretise(model.a, pushed, 1.0 / self.rate)
        size = n + n_in * (int(samples.max()) + 1)
        loop = np.zeros((size, size))
        loop[:n, :n] = transition
        for j, old in enumerate(samples):  # v = u(k - old), v' = u(k + 1 - old)
            loop[:n, n + n_in * old + j] += now[:, j] - change[:, j]
            loop[:n, n + n_in * (old - 1) + j] += change[:, j]
        loop[n + n_in :, n:-n_in] = np.eye(size - n - n_in)
        loop[n : n + n_in] = -self.gain @ loop[:n]
        drive = np.zeros((size, 2 * n + n_in))
        drive[:n, :n], drive[:n, n : 2 * n] = now[:, n_in:], change[:, n_in:]
        drive[n : n + n_in] = -self.gain @ drive[:n]
        drive[n : n + n_in, 2 * n :] = np.eye(n_in)
        return loop, drive, samples

    def fly(
        self,
        axis: str,
        *,
        seed: int,
        band: tuple[float, float],
        amplitude: float,
        duration: float,
        off_axis: float,
    ) -> FlightRecord:
        """Sweep one stick; the others carry a remnant of rms `off_axis` below the band's top."""
        random = np.random.default_rng(seed)
        names = self.structure.inputs
        samples = round(duration * self.rate)
        stick = np.zeros((samples, len(names)))
        for k, name in enumerate(names):
            if name == axis:
                ends = 0.05 * duration, 0.02 * duration
                stick[:, k] = sweep(duration, band, amplitude, self.rate, *ends)
            elif off_axis:
                stick[:, k] = coloured(random, samples, off_axis, band[1], self.rate)
        states = self.structure.states
        gust = np.zeros((samples, len(states)))
        for name, rms in self.gust.items():
            gust[:, states.index(name)] = coloured(
                random, samples, rms, self.gust_cutoff, self.rate
            )
        loop, drive, lags = self.loop()
        ahead = np.append(stick[1:], stick[-1:], axis=0)
        rise = np.diff(gust, axis=0, append=gust[-1:])
        motion = _propagate(loop, np.hstack([gust, rise, ahead]) @ drive.T, np.zeros(len(loop)))
        x, u = motion[:, : len(states)], motion[:, len(states) : len(states) + len(names)]
        model = linear(self.structure, self.values)
        acting = np.stack([delayed(u[:, j], lag) for j, lag in enumerate(lags)], axis=1)
        outputs = x @ model.c.T + acting @ model.d.T
        outputs += gust @ self.structure.matrices(self.values)["H1"].T
        columns = np.hstack([stick, u, outputs])[:: self.keep].copy()
        channels = (*self.sticks, *names, *self.structure.outputs)
        for k, name in enumerate(channels):
            columns[:, k] += self.noise.get(name, 0.0) * random.standard_normal(len(columns))
        time = np.arange(len(columns)) * (self.keep / self.rate)
        return FlightRecord(time, columns, tuple(channel(name) for name in channels))


def quadratic_gain(
    structure: Structure, values: Mapping[str, float], states: Mapping[str, float], inputs: float
) -> NDArray[np.float64]:
    model = linear(structure, values)
    a, b = model.a, model.b
    weight = np.diag([states.get(name, 0.0) for name in structure.states])
    riccati = solve_continuous_are(a, b, weight, inputs * np.eye(b.shape[1]))
    return b.T @ riccati / inputs


def sweep(
    duration: float,
    band: tuple[float, float],
    amplitude: float,
    rate: int,
    trim: float = 3.0,
    fade: float = 2.0,
) -> NDArray[np.float64]:
    low, high = band
    span = duration - 2.0 * trim
    t = np.arange(round(duration * rate)) / rate - trim
    c2 = 1.0 / (np.exp(4.0) - 1.0)
    omega = low + c2 * (np.exp(4.0 * np.clip(t, 0.0, span) / span) - 1.0) * (high - low)
    faded = np.clip(np.minimum(t, span - t) / fade, 0.0, 1.0)
    inside = (t >= 0.0) & (t <= span)
    return np.where(inside, amplitude * faded * np.sin(np.cumsum(omega) / rate), 0.0)


def coloured(
    random: np.random.Generator, samples: int, rms: float, cutoff: float, rate: int
) -> NDArray[np.float64]:
    sections = butter(2, cutoff / (np.pi * rate), output="sos")
    noise = sosfiltfilt(sections, random.standard_normal(samples))
    return noise * (rms / np.std(noise))


def delayed(column: NDArray[np.float64], samples: int) -> NDArray[np.float64]:
    return np.concatenate([np.zeros(samples), column[: column.size - samples]])


def _discretise(a: NDArray, b: NDArray, step: float) -> tuple[NDArray, NDArray, NDArray]:
    n, n_in = b.shape
    block = np.zeros((n + 2 * n_in, n + 2 * n_in))
    block[:n, :n], block[:n, n : n + n_in] = a * step, b * step
    block[n : n + n_in, n + n_in :] = np.eye(n_in)
    power = np.asarray(expm(block))
    return power[:n, :n], power[:n, n : n + n_in], power[:n, n + n_in :]


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """One flight: the swept stick, in rad/s and s, and the rms of the others' remnant."""

    axis: str
    band: tuple[float, float]
    amplitude: float
    duration: float
    off_axis: float


@dataclass(frozen=True, eq=False)
class Aircraft:
    """A plant in its rig, and the sweeps that are flown with it in a replicate."""

    name: str
    rig: Rig
    sweeps: tuple[Sweep, ...]

    @property
    def structure(self) -> Structure:
        return self.rig.structure

    @property
    def truth(self) -> Mapping[str, float]:
        return self.rig.values

    @property
    def closed(self) -> bool:
        """Whether there is any feedback: then the sticks are references."""
        return bool(np.any(self.rig.gain))

    def fly(self, seed: int) -> list[FlightRecord]:
        return [
            self.rig.fly(seed=100 * seed + number, **asdict(one))
            for number, one in enumerate(self.sweeps)
        ]

    def response(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        return response(self.structure, self.truth, frequency)


def swept(
    name: str,
    rig: Rig,
    amplitudes: Mapping[str, float],
    band: tuple[float, float],
    duration: float,
    off_axis: float,
) -> Aircraft:
    common: dict[str, Any] = {"band": band, "duration": duration, "off_axis": off_axis}
    sweeps = [Sweep(axis=axis, amplitude=size, **common) for axis, size in amplitudes.items()]
    return Aircraft(name, rig, tuple(one for one in sweeps for _ in range(2)))
