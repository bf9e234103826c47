"""Finds which channels answer which controls, in which band, and whether a loop is closed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from helisim.base.trend import without_trend
from helisim.ident.response import USABLE_COHERENCE
from helisim.logs.report import LogFinding
from helisim.look.excitation import FoundExcitation
from helisim.look.order import simplest
from helisim.records.channels import ACCELERATIONS, ATTITUDES, IN1, IN2, RATES, VELOCITIES
from helisim.records.record import FlightRecord

_WINDOWS = 5.0
"""Of an excitation's length, windows that don't overlap; nine that do."""
_SAMPLES_A_PERIOD = 10.0
_LOWEST = 1.0
"""Periods in a window, at least."""
_SMOOTHED = 5
"""Frequencies over which the median of the coherence counts."""
_NARROWEST = 2.0
"""Of highest to lowest frequency, from which a band is worth a line."""
_BESIDE = 1.3
"""By which a band may go beyond what was excited."""
_FEEDBACK = 0.5
"""Partial coherence of control and motion, sticks apart, from which a loop is closed."""
_OWN = 0.05
"""Share of a control's power that its stick doesn't explain, from which something else drives."""
_OF_OTHERS = {**dict.fromkeys(ATTITUDES, "tf:0/2"), **dict.fromkeys(ACCELERATIONS, "tf:1/1")}
"""A lag with one more integral for an angle, one less for an acceleration."""
_ANSWERS = (*RATES, *ATTITUDES, *VELOCITIES, *ACCELERATIONS)


@dataclass(frozen=True)
class FoundAnswer:
    """A channel that answers a control coherently.

    Attributes:
        input: the control.
        output: the channel.
        low: of the usable band, rad/s.
        high: of the usable band, rad/s.
        coherence: mean in the band.
        structure: of a transfer function that follows it, to begin with.
    """

    input: str
    output: str
    low: float
    high: float
    coherence: float
    structure: str

    def to_dict(self) -> dict[str, object]:
        """Return plain data for JSON."""
        return {
            "input": self.input,
            "output": self.output,
            "low_rad_s": self.low,
            "high_rad_s": self.high,
            "coherence": self.coherence,
            "structure": self.structure,
        }


def answers(
    record: FlightRecord, excited: Sequence[FoundExcitation], rates: Mapping[str, float]
) -> tuple[FoundAnswer, ...]:
    """Return the coherent answers to what was excited, best first.

    Args:
        record: uniform.
        excited: what was found in it.
        rates: samples a second of each channel, before it was resampled, Hz.
    """
    found = []
    for one in excited:
        part = record.slice(one.start, one.stop)
        for output in (name for name in _ANSWERS if name in record):
            rate = min(rates.get(one.channel, np.inf), rates.get(output, np.inf))
            band = _band(part, one, output, rate)
            if band is not None:
                found.append(band)
    return tuple(sorted(found, key=lambda one: -one.coherence * np.log(one.high / one.low)))


def _band(
    part: FlightRecord, excited: FoundExcitation, output: str, rate: float
) -> FoundAnswer | None:
    columns = part.select((excited.channel, output))
    step = part.duration / (len(part) - 1)
    made = cross_spectra(columns, step)
    if made is None:
        return None
    omega, cross = made
    power = (cross[:, 0, 0] * cross[:, 1, 1]).real
    coherence = np.abs(cross[:, 0, 1]) ** 2 / np.where(power > 0.0, power, np.inf)
    half = _SMOOTHED // 2
    padded = np.pad(coherence, half, mode="edge")
    smooth = np.median([padded[k : k + omega.size] for k in range(_SMOOTHED)], axis=0)
    most = 2.0 * np.pi * min(rate, 1.0 / step) / _SAMPLES_A_PERIOD
    high = min(most, _BESIDE * excited.high)
    usable = (smooth >= USABLE_COHERENCE) & (omega <= high) & (omega >= excited.low / _BESIDE)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], usable.astype(int), [0]])))
    runs = [(omega[a], omega[b - 1], a, b) for a, b in zip(edges[::2], edges[1::2])]
    if not runs:
        return None
    low, high, a, b = max(runs, key=lambda run: np.log(run[1] / run[0]))
    if high < _NARROWEST * low:
        return None
    mean = float(np.mean(coherence[a:b]))
    response = cross[a:b, 1, 0] / cross[a:b, 0, 0]
    order = _OF_OTHERS.get(output) or simplest(omega[a:b], response)
    return FoundAnswer(excited.channel, output, float(low), float(high), mean, order)


def cross_spectra(
    columns: NDArray[np.float64], step: float
) -> tuple[NDArray[np.float64], NDArray[np.complex128]] | None:
    """Return frequencies, rad/s, and cross-spectra (n_freq, n_channel, n_channel) by windows.

    Args:
        columns: (n_time, n_channel), uniform.
        step: s.
    """
    length = 2 * int(columns.shape[0] / (2.0 * _WINDOWS))
    if length < 32:
        return None
    window = (0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(length) / length))[:, None]
    starts = range(0, columns.shape[0] - length + 1, length // 2)
    parts = [np.fft.rfft(without_trend(columns[k : k + length]) * window, axis=0) for k in starts]
    omega = 2.0 * np.pi * np.fft.rfftfreq(length, step)
    keep = omega >= _LOWEST * 2.0 * np.pi / (length * step)
    cross = sum(part[keep, :, None] * part[keep, None, :].conj() for part in parts)
    return omega[keep].astype(np.float64), np.asarray(cross, dtype=np.complex128)


def loops(
    record: FlightRecord, found: Sequence[FoundAnswer], rates: Mapping[str, float]
) -> list[LogFinding]:
    """Return the controls that follow the motion besides their stick: a loop is closed there.

    Args:
        record: uniform.
        found: which channels answer which controls.
        rates: samples a second of each channel, before it was resampled, Hz.
    """
    findings = []
    for actuator, stick in zip(IN1, IN2):
        mine = [one for one in found if one.input == actuator]
        if not mine or actuator not in record or stick not in record:
            continue
        best = mine[0]
        columns = record.select((stick, actuator, best.output))
        made = cross_spectra(columns, record.duration / (len(record) - 1))
        if made is None:
            continue
        omega, cross = made
        resolved = 2.0 * np.pi * rates.get(stick, np.inf) / _SAMPLES_A_PERIOD
        inside = (omega >= best.low) & (omega <= min(best.high, resolved))
        power = (cross[inside, 0, 0] * cross[inside, 1, 1]).real
        own = 1.0 - np.abs(cross[inside, 0, 1]) ** 2 / np.where(power > 0.0, power, np.inf)
        partial = _partial(cross[inside])
        if not partial.size or float(np.median(own)) < _OWN:
            continue  # it follows its stick, as far as that was recorded
        if float(np.median(partial)) > _FEEDBACK:
            text = (
                f"{actuator} follows {best.output} besides {stick} (partial coherence "
                f"{float(np.median(partial)):.2f}): a loop is closed, which biases responses to "
                f"{actuator}; name what is outside of it, --reference {stick}"
            )
            findings.append(LogFinding("loop", text, option=f"--reference {stick}"))
    return findings


def _partial(cross: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the coherence of the second and third channel less the first one, (n_freq,)."""
    first = cross[:, 0, 0]
    left = (
        cross[:, 1:, 1:]
        - cross[:, 1:, :1]
        * cross[:, :1, 1:]
        / np.where(first.real > 0.0, first, np.inf)[:, None, None]
    )
    power = (left[:, 0, 0] * left[:, 1, 1]).real
    return np.abs(left[:, 0, 1]) ** 2 / np.where(power > 0.0, power, np.inf)
