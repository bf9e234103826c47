"""Closed loops of known margins, simulated by scipy: records for tests of what is measured."""

import control
import numpy as np
from scipy.signal import lfilter

from helisim.records.record import Channel, FlightRecord

PERIOD = 0.01


def known_loop() -> control.TransferFunction:
    """Return L of a sampled loop: an integrator, a lag and three samples of delay."""
    lagged = control.c2d(control.tf([1.0], [0.1, 1.0, 0.0]), PERIOD)
    return 6.0 * lagged * control.tf([1.0], [1.0, 0.0, 0.0, 0.0], PERIOD)


def chirp(duration: float, band: tuple[float, float], amplitude: float) -> np.ndarray:
    time = np.arange(0.0, duration, PERIOD)
    rate = np.log(band[1] / band[0]) / duration
    wave = amplitude * np.sin(band[0] / rate * np.expm1(rate * time))
    return np.where((time < 1.0) | (time > duration - 1.0), 0.0, wave)


def flown(
    loop: control.TransferFunction, *, seed: int, noise: float, name: str = "lat"
) -> FlightRecord:
    """Return a record: what was injected, what comes back with a gust's noise, and their sum."""
    rng = np.random.default_rng(seed)
    added = chirp(60.0, (1.5, 80.0), 1.0)
    gust = noise * lfilter([1.0], [1.0, -0.9], rng.standard_normal(added.size))
    top, bottom = np.ravel(loop.num[0][0]), np.ravel(loop.den[0][0])
    top = np.concatenate([np.zeros(bottom.size - top.size), top])
    total = lfilter(bottom, bottom + top, added + gust)  # S of the disturbance and of the gust
    values = np.column_stack([added, total, total - added])
    names = (f"{name}_disturbance", f"{name}_sum", name)
    channels = tuple(Channel(one, "1", "OTHER", "") for one in names)
    return FlightRecord(np.arange(added.size) * PERIOD, values, channels, {"made_by": "a test"})
