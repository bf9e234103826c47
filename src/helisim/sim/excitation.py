"""What a pilot flies on purpose: frequency sweeps and doublets on one axis."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from helisim.channels import AXES
from helisim.errors import InputError, UnknownNameError
from helisim.physics.layout import DOUBLET, PARAM, SWEEP

_AMPLITUDE = {"col": 0.03, "lon": 0.07, "lat": 0.07, "ped": 0.01}
"""Unitised stick. The pedals' is small because the gyro makes a tail servo command of four to
ten times it near 20 rad/s, where twice this already changes the tail's inflow noticeably."""
_SWEEP_BAND = {"col": (0.25, 15.0), "lon": (0.8, 45.0), "lat": (0.8, 45.0), "ped": (0.3, 30.0)}
"""rad/s. Roll and pitch bracket the rotor's modes at 15 and 27 rad/s; yaw and heave reach
below their poles near 0.8 and 0.9 rad/s."""


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """An exponential frequency sweep between two stretches of trimmed flight.

    Attributes:
        axis: "col", "lon", "lat" or "ped".
        duration: s, of the whole flight, at least four times `trim_time`.
        amplitude: unitised stick; the axis's own default if None.
        band: (w_min, w_max) rad/s; the axis's own default if None.
        trim_time: s of trimmed flight before, and again after.
        leakage: part of the sweep that slips into each of the other sticks.
        unsteadiness: wobble of the amplitude, and of the phase in rad.
    """

    axis: str
    duration: float = 90.0
    amplitude: float | None = None
    band: tuple[float, float] | None = None
    trim_time: float = 3.0
    leakage: float = 0.04
    unsteadiness: float = 0.1

    def __post_init__(self) -> None:
        _check(self.axis, self.duration, self.trim_time)
        w_min, w_max = self.omega
        if not (math.isfinite(w_max) and 0.0 < w_min < w_max):
            raise InputError(f"sweep band must be 0 < w_min < w_max in rad/s, got {self.band}")
        _check_amplitude(self.stick)
        if not (0.0 <= self.leakage <= 1.0 and 0.0 <= self.unsteadiness <= 1.0):
            raise InputError(
                f"leakage and unsteadiness must be in [0, 1], got {self.leakage}, "
                f"{self.unsteadiness}"
            )

    @property
    def stick(self) -> float:
        """Amplitude at the stick, unitised."""
        return _AMPLITUDE[self.axis] if self.amplitude is None else self.amplitude

    @property
    def omega(self) -> tuple[float, float]:
        """Lowest and highest frequency, rad/s."""
        return _SWEEP_BAND[self.axis] if self.band is None else self.band

    def write(self, par: NDArray[np.float64]) -> None:
        """Put the sweep into a vehicle's numbers for the force laws."""
        par[PARAM.excitation] = SWEEP
        par[PARAM.excitation_start] = self.trim_time
        par[PARAM.excitation_duration] = self.duration - 2.0 * self.trim_time
        par[PARAM.sweep_w_min], par[PARAM.sweep_w_max] = self.omega
        par[PARAM.sweep_fade] = 1.0
        par[PARAM.sweep_unsteadiness] = self.unsteadiness
        first = PARAM.excitation_col
        par[first : first + 4] = self.leakage * self.stick
        par[first + AXES.index(self.axis)] = self.stick


@dataclass(frozen=True, kw_only=True)
class Doublet:
    """A doublet: the stick one way, then the other, then centred.

    Attributes:
        axis: "col", "lon", "lat" or "ped".
        duration: s, of the whole flight.
        amplitude: unitised stick; the axis's own default if None.
        width: s, of both halves together.
        trim_time: s of trimmed flight before.
    """

    axis: str
    duration: float = 8.0
    amplitude: float | None = None
    width: float = 1.0
    trim_time: float = 2.0

    def __post_init__(self) -> None:
        _check(self.axis, self.duration, self.trim_time)
        if not 0.0 < self.width <= self.duration - self.trim_time:
            raise InputError(
                f"doublet width must be above 0 and at most {self.duration - self.trim_time:g} s "
                f"(what the trimmed stretch leaves), got {self.width}"
            )
        _check_amplitude(self.stick)

    @property
    def stick(self) -> float:
        """Amplitude at the stick, unitised."""
        return _AMPLITUDE[self.axis] if self.amplitude is None else self.amplitude

    def write(self, par: NDArray[np.float64]) -> None:
        """Put the doublet into a vehicle's numbers for the force laws."""
        par[PARAM.excitation] = DOUBLET
        par[PARAM.excitation_start] = self.trim_time
        par[PARAM.excitation_duration] = self.width
        first = PARAM.excitation_col
        par[first : first + 4] = 0.0
        par[first + AXES.index(self.axis)] = self.stick


Excitation = Sweep | Doublet


def _check(axis: str, duration: float, trim_time: float) -> None:
    if axis not in AXES:
        raise UnknownNameError("axis", axis, AXES)
    if not (math.isfinite(duration) and math.isfinite(trim_time) and trim_time >= 0.0):
        raise InputError(f"times must be finite numbers of seconds, got {duration}, {trim_time}")
    if duration < max(4.0 * trim_time, 1.0):
        raise InputError(
            f"duration must be at least {max(4.0 * trim_time, 1.0):g} s "
            f"(four times the trimmed stretch), got {duration:g}"
        )


def _check_amplitude(amplitude: float) -> None:
    if not 0.0 < amplitude <= 0.5:
        raise InputError(f"amplitude must be in (0, 0.5] of unitised stick, got {amplitude}")
