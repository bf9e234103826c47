"""Frequency sweeps: a pilot's, imperfect, and a machine's."""

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.physics.layout import PARAM, SWEEP
from helisim.physics.pilot import sweep_phase
from helisim.records.channels import AXES
from helisim.sim.excitation import (
    Excitation,
    check_amplitude,
    check_band,
    check_settings,
    check_times,
    complete,
)

_FADE = 1.0
"""s, over which a pilot's sweep grows and dies."""


@dataclass(frozen=True, kw_only=True)
class Sweep(Excitation):
    """An exponential frequency sweep by a pilot, between two stretches of trimmed flight.

    Attributes:
        axis: "col", "lon", "lat" or "ped".
        duration: s, of the whole flight, at least four times `trim_time`.
        amplitude: unitised stick; the vehicle's own for that axis if None.
        band: (w_min, w_max) rad/s; the vehicle's own for that axis if None.
        trim_time: s of trimmed flight before, and again after.
        leakage: part of the sweep that slips into each of the other sticks.
        unsteadiness: wobble of the amplitude, and of the phase in rad.
        at: "sticks"; elsewhere fly a `Chirp`.
    """

    axis: str
    duration: float = 90.0
    amplitude: float | None = None
    band: tuple[float, float] | None = None
    trim_time: float = 3.0
    leakage: float = 0.04
    unsteadiness: float = 0.1

    left_open: ClassVar[tuple[str, ...]] = ("amplitude", "band")
    several: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_settings(self)
        if self.at != "sticks":
            raise InputError(f"a Sweep is a pilot's, of the sticks: fly a Chirp at {self.at}")
        check_times(self.duration, self.trim_time)
        check_band(self.band, "sweep band")
        check_amplitude(self)
        if not (0.0 <= self.leakage <= 1.0 and 0.0 <= self.unsteadiness <= 1.0):
            raise InputError(
                f"leakage and unsteadiness must be in [0, 1], got {self.leakage}, "
                f"{self.unsteadiness}"
            )

    def _write_closed_form(self, par: NDArray[np.float64]) -> None:
        amplitude, (w_min, w_max) = complete(self, self.amplitude), complete(self, self.band)
        par[PARAM.excitation] = SWEEP
        par[PARAM.excitation_start] = self.trim_time
        par[PARAM.excitation_duration] = self.duration - 2.0 * self.trim_time
        par[PARAM.sweep_w_min], par[PARAM.sweep_w_max] = w_min, w_max
        par[PARAM.sweep_fade] = _FADE
        par[PARAM.sweep_unsteadiness] = self.unsteadiness
        first = PARAM.excitation_col
        par[first : first + 4] = self.leakage * amplitude
        par[first + AXES.index(self.axis)] = amplitude


@dataclass(frozen=True, kw_only=True)
class Chirp(Excitation):
    """A machine's sine of rising frequency, between two stretches of trimmed flight.

    Attributes:
        axis: one, as for every `Excitation`.
        duration: s, of the whole flight.
        amplitude: unitised, of sensors rad/s; of sticks the vehicle's own for that axis if None.
        band: (w_min, w_max) rad/s, at the beginning and the end; the vehicle's own if None.
        spacing: how the frequency rises with time: "linear"; "logarithmic", each octave as
            long; or "exponential", the law of a `Sweep` (Tischler and Remple, ch. 5).
        trim_time: s of trimmed flight before, and again after.
        fade: s, over which it grows and dies, by half a cosine.
        at: "sticks", "servos", "actuators" or "sensors".
    """

    axis: str
    duration: float = 60.0
    amplitude: float | None = None
    band: tuple[float, float] | None = None
    spacing: Literal["linear", "logarithmic", "exponential"] = "logarithmic"
    trim_time: float = 3.0
    fade: float = 1.0

    left_open: ClassVar[tuple[str, ...]] = ("amplitude", "band")
    several: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_settings(self)
        check_times(self.duration, self.trim_time)
        check_band(self.band)
        check_amplitude(self)
        longest = 0.5 * self.duration - self.trim_time
        if not 0.0 <= self.fade <= longest:
            raise InputError(
                f"fade must be 0 to {longest:g} s (half of what the trimmed stretches leave), "
                f"got {self.fade}"
            )

    def wave(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what is added, (n_time,), at the times in s, (n_time,)."""
        amplitude, (w_min, w_max) = complete(self, self.amplitude), complete(self, self.band)
        length = self.duration - 2.0 * self.trim_time
        since = np.clip(time - self.trim_time, 0.0, length)
        grown = np.ones(since.size)
        if self.fade > 0.0:
            inside = np.minimum(since, length - since) / self.fade
            grown = 0.5 - 0.5 * np.cos(np.pi * np.minimum(inside, 1.0))
        swept = (time >= self.trim_time) & (time <= self.trim_time + length)
        phase = _PHASES[self.spacing](since, length, w_min, w_max)
        return amplitude * swept * grown * np.sin(phase)


def _linear(time: NDArray, length: float, w_min: float, w_max: float) -> NDArray[np.float64]:
    return w_min * time + 0.5 * (w_max - w_min) / length * time**2


def _logarithmic(time: NDArray, length: float, w_min: float, w_max: float) -> NDArray[np.float64]:
    rate = math.log(w_max / w_min) / length
    return w_min / rate * np.expm1(rate * time)


def _exponential(time: NDArray, length: float, w_min: float, w_max: float) -> NDArray[np.float64]:
    return np.array([sweep_phase(float(one), length, w_min, w_max) for one in time])


_PHASES = {"linear": _linear, "logarithmic": _logarithmic, "exponential": _exponential}
"""Spacing -> phase, rad, at times, the length of the chirp (s) and its band (rad/s)."""
