"""Multisines: sums of sines of low peak, orthogonal between axes over every whole period.

Each axis has every n-th harmonic of one period (Morelli, Journal of Aircraft 49, 2012), with phases
clipped to a low peak (Van der Ouderaa, Schoukens and Renneboog, IEEE TIM 37, 1988).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar

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

    The amplitude is the peak, unitised; of sensors, in rad/s of a rate and rad of an attitude. The
    band is w_min and w_max in rad/s. Each is given once for all axes, or for one axis after the
    other; None is the vehicle's own. `period`, s, is a whole number of the gyro's periods. The
    power falls with frequency to the power of `slope` (0: flat, 1: as much in each octave) above
    `corner`, rad/s.
    """

    axis: str = "+".join(AXES)
    duration: float = 66.0
    amplitude: float | tuple[float, ...] | None = None
    band: tuple[float, ...] | None = None
    period: float = 60.0
    slope: float = setting(0.0, low=-8.0, high=8.0)
    corner: float = setting(0.0, unit="rad/s", low=0.0, unsaid=True)
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
        """Return it complete by a vehicle's own. Raises InputError: too fast, or odd period."""
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
        """The number of whole periods that are flown."""
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
        return tuple(np.ravel([own_setting(self, own, axis, name) for axis in self.axes]).tolist())

    def _each(self, given: float | tuple[float, ...], count: int) -> list[tuple[float, ...]]:
        numbers = given if isinstance(given, tuple) else (given,)
        numbers = numbers * len(self.axes) if len(numbers) == count else numbers
        return [numbers[k : k + count] for k in range(0, len(numbers), count)]

    def _designs(self) -> dict[str, "Design"]:
        corner = self.corner * self.period / (2.0 * math.pi)
        return {
            axis: design(tuple(numbers.tolist()), self.slope, corner)
            for axis, numbers in self.harmonics.items()
        }


@dataclass(frozen=True, eq=False)
class Design:
    """A multisine of one axis, of peak 1, beginning and ending at zero.

    Its cosines have numbers of oscillations a period, heights, and phases at the beginning, rad,
    (n_harmonic,) each.
    """

    numbers: NDArray[np.int64]
    height: NDArray[np.float64]
    phase: NDArray[np.float64]
    relative_peak_factor: float


@lru_cache(maxsize=64)
def design(numbers: tuple[int, ...], slope: float, corner: float = 0.0) -> Design:
    """Return the multisine of harmonics; its power goes as 1/frequency^slope above the corner."""
    k = np.array(numbers)
    height = np.hypot(k, corner) ** (-0.5 * slope)
    height /= np.sqrt(0.5 * np.sum(height**2))
    phase = _clipped(k, height, np.random.default_rng(k).uniform(0.0, 2.0 * np.pi, k.size))
    phase = np.round(_from_zero(k, height, phase), _DIGITS)
    signal = _signal(k, height, phase)
    high, low = _summit(signal), -_summit(-signal)
    return Design(k, height / max(high, -low), phase, (high - low) / (2.0 * math.sqrt(2.0)))


def _signal(
    numbers: NDArray[np.int64], height: NDArray[np.float64], phase: NDArray[np.float64]
) -> NDArray[np.float64]:
    count = 1 << math.ceil(math.log2(_OVERSAMPLED * int(numbers[-1])))
    spectrum = np.zeros(count // 2 + 1, dtype=np.complex128)
    spectrum[numbers] = 0.5 * count * height * np.exp(1j * phase)
    return np.fft.irfft(spectrum, count)


def _clipped(
    numbers: NDArray[np.int64], height: NDArray[np.float64], phase: NDArray[np.float64]
) -> NDArray[np.float64]:
    best, least = phase, np.inf
    for level in np.linspace(*_LEVELS, _CLIPPINGS):
        signal = _signal(numbers, height, phase)
        peak = float(np.max(np.abs(signal)))
        if peak < least:
            best, least = phase, peak
        phase = np.angle(np.fft.rfft(np.clip(signal, -level * peak, level * peak))[numbers])
    return best


def _from_zero(
    numbers: NDArray[np.int64], height: NDArray[np.float64], phase: NDArray[np.float64]
) -> NDArray[np.float64]:
    signal = _signal(numbers, height, phase)
    after = np.roll(signal, -1)
    k = int(np.argmax((signal <= 0.0) & (after > 0.0)))
    turn = 2.0 * np.pi * (k - signal[k] / (after[k] - signal[k])) / signal.size
    for _ in range(_NEWTON_STEPS):
        angle = numbers * turn + phase
        turn += (height @ np.cos(angle)) / (height @ (numbers * np.sin(angle)))
    return np.mod(phase + turn * numbers, 2.0 * np.pi)


def _summit(signal: NDArray[np.float64]) -> float:
    left, right = np.roll(signal, 1), np.roll(signal, -1)
    top = (signal >= left) & (signal > right)
    rise, bend = (right - left)[top], (2.0 * signal - left - right)[top]
    return float(np.max(signal[top] + 0.125 * rise**2 / bend))
