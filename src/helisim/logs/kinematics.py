"""Finds clocks that go wrong, by whether angles are the integrals of the rates.

Both sides are integrated, windowed and filtered alike, so that the ratio of their transforms is
that of the clocks. It takes a helicopter that turns much.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.trend import without_trend
from helisim.logs.report import LogFinding

_NEEDED = ("p", "q", "r", "phi", "theta", "psi")
_WINDOWS = 16
"""Half-overlapping windows of a record, at least; their scatter gives the error."""
_BAND_HZ = (0.2, 4.0)
"""Where a helicopter turns, and neither drift nor vibration."""
_GREATEST = 1e6
"""rad and rad/s: nothing turns further or faster."""
_COHERENT = 0.998
"""Share of an angle's power that the rates explain, at least: noise would bias the ratio."""
_SURE = 5.0
"""Standard errors by which a clock must be wrong to be reported."""
_LEAST_SLIP = 3e-3
"""s, over a record: a third of a sample at 100 Hz, below any delay's error."""


class ClockErrors(NamedTuple):
    """The errors of the clocks by one angle, each with its standard error.

    Attributes:
        angle: "phi", "theta" or "psi".
        coherence: share of its power that the rates explain.
        fast: by which part the clock of all channels is fast.
        fast_error: of that.
        slip: s a second, by which the rates fall behind the angle more and more.
        slip_error: of that.
    """

    angle: str
    coherence: float
    fast: float
    fast_error: float
    slip: float
    slip_error: float


def clock_errors(
    time: NDArray[np.float64], channels: Mapping[str, NDArray[np.float64]]
) -> list[ClockErrors]:
    """Compare the three angles of a uniform record with the integrals of its rates.

    Args:
        time: (n_time,) s.
        channels: p, q, r in rad/s and phi, theta, psi in rad, (n_time,) each.
    """
    from scipy.interpolate import CubicSpline  # slow to import, and most commands read no log

    p, q, r, phi, theta, psi = (channels[name] for name in _NEEDED)
    turning = q * np.sin(phi) + r * np.cos(phi)
    rates = {
        "phi": (phi, p + np.tan(theta) * turning),
        "theta": (theta, q * np.cos(phi) - r * np.sin(phi)),
        "psi": (psi, turning / np.cos(theta)),
    }
    step = (time[-1] - time[0]) / (time.size - 1)
    length = 2 * (time.size // (_WINDOWS + 1))
    frequency = np.fft.rfftfreq(length, step)
    inside = (frequency >= _BAND_HZ[0]) & (frequency <= _BAND_HZ[1])
    if np.count_nonzero(inside) < 3:
        return []
    found = []
    for name, (angle, rate) in rates.items():
        sane = np.all(np.abs(angle) < _GREATEST) and np.all(np.abs(rate) < _GREATEST)
        if not sane or np.ptp(angle) == 0.0:
            continue
        integral = CubicSpline(time, rate).antiderivative()(time)
        starts = np.arange(_WINDOWS) * (length // 2)
        one, other = (_transforms(x, starts, length)[:, inside] for x in (angle, integral))
        if not np.any(other):
            continue
        middle = (starts + 0.5 * length) * step
        found.append(_errors_by(name, one, other, 2.0 * np.pi * frequency[inside], middle))
    return found


def _transforms(
    signal: NDArray[np.float64], starts: NDArray[np.intp], length: int
) -> NDArray[np.complex128]:
    segments = np.stack([signal[start : start + length] for start in starts])
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(length) / length)
    return np.fft.rfft(without_trend(segments.T).T * window, axis=1)


def _errors_by(
    name: str,
    angle: NDArray[np.complex128],
    integral: NDArray[np.complex128],
    omega: NDArray[np.float64],
    middle: NDArray[np.float64],
) -> ClockErrors:
    """Return scale and delay between transforms, (n_window, n_freq) each."""
    cross = np.sum(angle * integral.conj(), axis=0)
    slope = np.abs(cross) * omega
    delay = -np.sum(slope * np.unwrap(np.angle(cross))) / np.sum(slope * omega)
    aligned = angle * np.exp(1j * omega * delay) * integral.conj()
    shared = np.sum(aligned.real, axis=1)
    power = np.sum(np.abs(integral) ** 2, axis=1)
    coherence = np.sum(shared) ** 2 / (np.sum(power) * np.sum(np.abs(angle) ** 2))
    scale = np.sum(shared) / np.sum(power)
    without = (np.sum(shared) - shared) / (np.sum(power) - power)
    count = power.size
    scale_error = np.sqrt((count - 1.0) * np.mean((without - scale) ** 2))
    # rates that are late against the angle: its phase is ahead, by more and more
    weight = np.sum(np.abs(integral) ** 2 * omega**2, axis=1)
    late = np.sum(aligned.imag * omega, axis=1) / weight
    since = middle - np.average(middle, weights=weight)
    spread = np.sum(weight * since**2)
    slip = np.sum(weight * since * late) / spread
    left = late - np.average(late, weights=weight) - slip * since
    slip_error = np.sqrt(np.sum(weight * left**2) / (count - 2.0) / spread)
    return ClockErrors(
        name,
        float(coherence),
        float(1.0 / scale - 1.0),
        float(scale_error / scale**2),
        float(slip),
        float(slip_error),
    )


def clock_findings(
    parts: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]], names: Sequence[str]
) -> list[LogFinding]:
    """Return the errors of a log's clocks that its angles show surely, part by part.

    Args:
        parts: time and values, (n_time,) and (n_time, n_channel), uniform.
        names: of the channels.
    """
    findings: list[LogFinding] = []
    if not set(_NEEDED) <= set(names):
        return findings
    for time, values in parts:
        channels = {name: values[:, names.index(name)] for name in _NEEDED}
        with np.errstate(all="ignore"):
            coherent = [one for one in clock_errors(time, channels) if one.coherence > _COHERENT]
        findings += _findings(coherent, float(time[-1] - time[0]))
    return findings


def _findings(coherent: Sequence[ClockErrors], duration: float) -> list[LogFinding]:
    findings = []
    if not coherent:
        return findings
    best = min(coherent, key=lambda one: one.fast_error)
    if abs(best.fast) > _SURE * best.fast_error:
        text = (
            f"the rates' integral is {100.0 * best.fast:+.2f} +- {100.0 * best.fast_error:.2f} % "
            f"off {best.angle}: the clock is {'fast' if best.fast > 0.0 else 'slow'} by as much, "
            "or a sensor's scale is wrong; not corrected: 1/s are off by as much, 1/s^2 by twice"
        )
        findings.append(LogFinding("clock", text))
    best = min(coherent, key=lambda one: one.slip_error)
    if abs(best.slip) > max(_SURE * best.slip_error, _LEAST_SLIP / duration):
        text = (
            f"the rates slip against {best.angle} by {1e6 * best.slip:+.0f} +- "
            f"{1e6 * best.slip_error:.0f} us a second, {1e3 * abs(best.slip) * duration:.2g} ms in "
            "all: they were stamped by two clocks; not corrected: delays are off by up to as much"
        )
        findings.append(LogFinding("clock", text))
    return findings
