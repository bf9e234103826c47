"""Multisines: sums of sines of low peak, on several axes at once and yet told apart.

Each axis has every n-th harmonic of one period, so the inputs are orthogonal over every whole
period (Morelli, Flight Test Maneuvers for Efficient Aerodynamic Modeling, Journal of Aircraft 49,
2012). The phases are Schroeder's (IEEE Transactions on Information Theory 16, 1970), which make
something like a linear sweep; or scattered ones, clipped again and again until the peak is low (Van
der Ouderaa, Schoukens and Renneboog, IEEE Transactions on Instrumentation and Measurement 37,
1988), which excite all frequencies all the time, so that every window of an estimate sees the axes
move independently.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.base.settings import setting
from helisim.physics.memory import TICK_TOLERANCE
from helisim.records.record import AXES
from helisim.sim.excitation import PLACES, complete, own_setting
from helisim.sim.manoeuvres import Timed

_CLIPPINGS = 600  # Turns of clipping: twice as many lower the peak by less than a percent more
_LEVELS = (0.8, 0.98)  # Where each turn clips, of the peak, from the first to the last
_OVERSAMPLED = 16  # Samples a period of the highest harmonic, where peaks are looked for
_NEWTON_STEPS = 3  # From between two samples to where a signal crosses zero: each squares the error
_DIGITS = 6  # Of phases, rad, so that another FFT's rounding leaves the same signal


@dataclass(frozen=True, kw_only=True)
class Multisine(Timed):
    """Sines at harmonics of one period, all axes at once, orthogonal over each whole period.

    Attributes:
        axis: one or several, joined as "lat+ped".
        duration: s, of the whole flight: trimmed stretches and as many whole periods as fit.
        amplitude: the peak, unitised, of sensors rad/s; one for all axes or one each; of sticks
            the vehicle's own if None.
        band: w_min, w_max in rad/s for all axes, or a pair for each, one after the other; the
            vehicle's own if None.
        period: s; a whole number of the gyro's periods. An axis has every n-th harmonic of it,
            n the number of axes.
        slope: of the power over frequency: 0 is flat, 1 the same in each octave.
        corner: rad/s, below which the power is flat whatever the slope; 0 for none.
        phases: "low_peak", or "schroeder".
        trim_time: s of trimmed flight before, and again after.
        at: "sticks", "servos", "actuators" or "sensors".
    """

    axis: str = "+".join(AXES)
    duration: float = 66.0
    amplitude: float | tuple[float, ...] | None = None
    band: tuple[float, ...] | None = None
    period: float = 60.0
    slope: float = setting(0.0, low=-8.0, high=8.0)
    corner: float = setting(0.0, unit="rad/s", low=0.0, unsaid=True)
    phases: Literal["low_peak", "schroeder"] = "low_peak"
    trim_time: float = 3.0

    left_open: ClassVar[tuple[str, ...]] = ("amplitude", "band")
    several: ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, each in (("amplitude", 1), ("band", 2)):
            given = getattr(self, name)
            if isinstance(given, tuple) and len(given) not in (each, each * len(self.axes)):
                raise InputError(
                    f"{name} needs {each} number{'s' * (each > 1)} or {each * len(self.axes)} for "
                    f"the axes {self.axis}, got {len(given)}"
                )
        longest = self.duration - 2.0 * self.trim_time
        if not 0.0 < self.period <= longest + 1e-9:
            raise InputError(
                f"period must be above 0 and at most {longest:g} s (what the trimmed stretches "
                f"leave), got {self.period}"
            )
        for axis, numbers in self.harmonics.items() if self.band is not None else ():
            if not numbers.size:
                raise InputError(
                    f"no harmonic of {axis} is in its band: with {len(self.axes)} axes they "
                    f"are {2.0 * math.pi * len(self.axes) / self.period:.3g} rad/s apart; "
                    "take a longer period or a wider band"
                )

    def on(self, own: Mapping[str, float]) -> "Multisine":
        """Return it with what is left open filled in by a vehicle's own parameters.

        Raises InputError: it is faster than the gyro, or its period isn't a whole number of ticks.
        """
        ticks = self.period / own["gyro.period"]
        if abs(ticks - round(ticks)) > TICK_TOLERANCE * ticks:
            nearest = round(ticks) * own["gyro.period"]
            raise InputError(
                f"period must be a whole number of the gyro's periods of {own['gyro.period']:g} "
                f"s, got {self.period:g}; {nearest:g} is near"
            )
        return super().on(own)

    @property
    def periods(self) -> int:
        """How many whole periods are flown."""
        return math.floor((self.duration - 2.0 * self.trim_time) / self.period + 1e-9)

    @property
    def harmonics(self) -> dict[str, NDArray[np.int64]]:
        """The harmonics of each axis, in numbers of oscillations a period. Raises InputError."""
        bands, count = self._each(complete(self, self.band), 2), len(self.axes)
        per_rad = self.period / (2.0 * math.pi)
        found = {}
        for k, (axis, (low, high)) in enumerate(zip(self.axes, bands)):
            first, last = math.ceil(low * per_rad - 1e-9), math.floor(high * per_rad + 1e-9)
            numbers = np.arange(max(first, 1), last + 1)
            found[axis] = numbers[numbers % count == (k + 1) % count]
        return found

    @property
    def frequencies(self) -> dict[str, NDArray[np.float64]]:
        """The frequencies of each axis, rad/s. Raises InputError."""
        per_number = 2.0 * math.pi / self.period
        return {axis: per_number * k.astype(np.float64) for axis, k in self.harmonics.items()}

    @property
    def relative_peak_factor(self) -> dict[str, float]:
        """(max - min) / (2 sqrt(2) rms) of each axis: 1 is a sine's. Raises InputError."""
        return {axis: one.relative_peak_factor for axis, one in self._designs().items()}

    def sticks(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what is added to each axis, (n_time, n_axis), at the times in s, (n_time,)."""
        columns = np.zeros((time.size, len(PLACES[self.at])))
        amplitudes = self._each(complete(self, self.amplitude), 1)
        since = time - self.trim_time
        flown = (since >= -1e-9) & (since < self.periods * self.period - 1e-9)
        turn = 2.0 * math.pi / self.period * since[flown]
        for (axis, one), (amplitude,) in zip(self._designs().items(), amplitudes):
            angle = np.outer(turn, one.numbers) + one.phase
            columns[flown, PLACES[self.at].index(axis)] = amplitude * (np.cos(angle) @ one.height)
        return columns

    def _own(self, own: Mapping[str, float], name: str) -> Any:
        each = [own_setting(self, own, axis, name) for axis in self.axes]
        return tuple(np.ravel(each).tolist())

    def _each(self, given: float | tuple[float, ...], count: int) -> list[tuple[float, ...]]:
        """Return so many numbers for each axis."""
        numbers = given if isinstance(given, tuple) else (given,)
        numbers = numbers * len(self.axes) if len(numbers) == count else numbers
        return [numbers[k : k + count] for k in range(0, len(numbers), count)]

    def _designs(self) -> dict[str, "Design"]:
        corner = self.corner * self.period / (2.0 * math.pi)
        return {
            axis: design(tuple(numbers.tolist()), self.slope, self.phases, corner)
            for axis, numbers in self.harmonics.items()
        }


@dataclass(frozen=True, eq=False)
class Design:
    """A multisine of one axis, of peak 1, beginning and ending at zero.

    Attributes:
        numbers: (n_harmonic,) oscillations a period.
        height: (n_harmonic,) of each cosine.
        phase: (n_harmonic,) rad, of each cosine at the beginning.
        relative_peak_factor: (max - min) / (2 sqrt(2) rms).
        crest_factor: largest |value| over rms.
    """

    numbers: NDArray[np.int64]
    height: NDArray[np.float64]
    phase: NDArray[np.float64]
    relative_peak_factor: float
    crest_factor: float


@lru_cache(maxsize=64)
def design(numbers: tuple[int, ...], slope: float, phases: str, corner: float = 0.0) -> Design:
    """Return the multisine of these harmonics, rising: oscillations a period.

    Power goes as frequency to the minus `slope`; it is flat below the corner, in the same unit.
    """
    k = np.array(numbers)
    height = np.hypot(k, corner) ** (-0.5 * slope)
    height /= np.sqrt(0.5 * np.sum(height**2))
    phase = schroeder_phases(height**2)
    if phases == "low_peak" and k.size > 2:
        scattered = np.random.default_rng(k).uniform(0.0, 2.0 * np.pi, k.size)
        phase = _clipped(k, height, scattered)
    phase = np.round(_from_zero(k, height, phase), _DIGITS)
    signal = _signal(k, height, phase)
    high, low = _summit(signal), -_summit(-signal)
    peak = max(high, -low)
    return Design(k, height / peak, phase, (high - low) / (2.0 * math.sqrt(2.0)), peak)


def schroeder_phases(power: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return Schroeder's phases, rad, for the power of each harmonic, (n_harmonic,).

    phase_k = -2 pi sum over l < k of (k - l) p_l, with the powers p summing to 1.
    """
    before = np.concatenate([[0.0], np.cumsum(power / np.sum(power))[:-1]])
    return -2.0 * np.pi * np.cumsum(before)


def _signal(
    numbers: NDArray[np.int64], height: NDArray[np.float64], phase: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return one period of a sum of cosines, (n_sample,)."""
    count = 1 << math.ceil(math.log2(_OVERSAMPLED * int(numbers[-1])))
    spectrum = np.zeros(count // 2 + 1, dtype=np.complex128)
    spectrum[numbers] = 0.5 * count * height * np.exp(1j * phase)
    return np.fft.irfft(spectrum, count)


def _clipped(
    numbers: NDArray[np.int64], height: NDArray[np.float64], phase: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return phases of a lower peak: clip, keep the phases that come of it, and again."""
    best, least = phase, np.inf
    for level in np.linspace(*_LEVELS, _CLIPPINGS):
        signal = _signal(numbers, height, phase)
        peak = float(np.max(np.abs(signal)))
        if peak < least:
            best, least = phase, peak
        clipped = np.clip(signal, -level * peak, level * peak)
        phase = np.angle(np.fft.rfft(clipped)[numbers])
    return best


def _from_zero(
    numbers: NDArray[np.int64], height: NDArray[np.float64], phase: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the phases of the same signal when it begins as it rises through zero."""
    signal = _signal(numbers, height, phase)
    after = np.roll(signal, -1)
    k = int(np.argmax((signal <= 0.0) & (after > 0.0)))
    turn = 2.0 * np.pi * (k - signal[k] / (after[k] - signal[k])) / signal.size
    for _ in range(_NEWTON_STEPS):
        angle = numbers * turn + phase
        turn += (height @ np.cos(angle)) / (height @ (numbers * np.sin(angle)))
    return np.mod(phase + turn * numbers, 2.0 * np.pi)


def _summit(signal: NDArray[np.float64]) -> float:
    """Return the greatest value of a periodic signal, between its samples too (parabolas)."""
    left, right = np.roll(signal, 1), np.roll(signal, -1)
    top = (signal >= left) & (signal > right)
    rise, bend = (right - left)[top], (2.0 * signal - left - right)[top]
    return float(np.max(signal[top] + 0.125 * rise**2 / bend))
