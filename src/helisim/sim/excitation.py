"""What a pilot flies on purpose: frequency sweeps and doublets on one axis."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from helisim.errors import InputError, UnknownNameError
from helisim.physics.layout import DOUBLET, PARAM, SWEEP
from helisim.records.channels import AXES

EXCITATIONS: dict[str, type["Excitation"]] = {}
"""Every kind of excitation by its name; a subclass of `Excitation` joins on its definition."""


@dataclass(frozen=True, kw_only=True)
class Excitation:
    """What a pilot flies on purpose, on top of holding the hover.

    Attributes:
        axis: "col", "lon", "lat" or "ped".
        duration: s, of the whole flight.
    """

    axis: str
    duration: float

    left_open: ClassVar[tuple[str, ...]] = ()
    """Settings that may be None: the vehicle's own for the axis."""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        EXCITATIONS[cls.__name__] = cls

    def on(self, own: Mapping[str, float]) -> Self:
        """Return it with what is left open filled in by a vehicle's own parameters."""
        del own
        return self

    def write(self, par: NDArray[np.float64]) -> None:
        """Put it, complete, into a vehicle's numbers for the force laws."""
        raise NotImplementedError


@dataclass(frozen=True, kw_only=True)
class Sweep(Excitation):
    """An exponential frequency sweep between two stretches of trimmed flight.

    Attributes:
        axis: "col", "lon", "lat" or "ped".
        duration: s, of the whole flight, at least four times `trim_time`.
        amplitude: unitised stick; the vehicle's own for that axis if None.
        band: (w_min, w_max) rad/s; the vehicle's own for that axis if None.
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

    left_open: ClassVar[tuple[str, ...]] = ("amplitude", "band")

    def __post_init__(self) -> None:
        _check(self.axis, self.duration, self.trim_time)
        if self.band is not None:
            object.__setattr__(self, "band", tuple(self.band))
            w_min, w_max = self.band
            if not (math.isfinite(w_max) and 0.0 < w_min < w_max):
                raise InputError(f"sweep band must be 0 < w_min < w_max in rad/s, got {self.band}")
        _check_amplitude(self.amplitude)
        if not (0.0 <= self.leakage <= 1.0 and 0.0 <= self.unsteadiness <= 1.0):
            raise InputError(
                f"leakage and unsteadiness must be in [0, 1], got {self.leakage}, "
                f"{self.unsteadiness}"
            )

    def on(self, own: Mapping[str, float]) -> Self:
        """Return the sweep with what is left open filled in by a vehicle's own parameters."""
        band = self.band
        if band is None:
            band = own[f"sweep.{self.axis}_w_min"], own[f"sweep.{self.axis}_w_max"]
        return replace(self, amplitude=_stick(self, own), band=band)

    def write(self, par: NDArray[np.float64]) -> None:
        """Put the sweep, complete, into a vehicle's numbers for the force laws."""
        if self.amplitude is None or self.band is None:
            raise InputError("an open sweep can't fly; complete it with on(vehicle.parameters)")
        par[PARAM.excitation] = SWEEP
        par[PARAM.excitation_start] = self.trim_time
        par[PARAM.excitation_duration] = self.duration - 2.0 * self.trim_time
        par[PARAM.sweep_w_min], par[PARAM.sweep_w_max] = self.band
        par[PARAM.sweep_fade] = 1.0
        par[PARAM.sweep_unsteadiness] = self.unsteadiness
        first = PARAM.excitation_col
        par[first : first + 4] = self.leakage * self.amplitude
        par[first + AXES.index(self.axis)] = self.amplitude


@dataclass(frozen=True, kw_only=True)
class Doublet(Excitation):
    """A doublet: the stick one way, then the other, then centred.

    Attributes:
        axis: "col", "lon", "lat" or "ped".
        duration: s, of the whole flight.
        amplitude: unitised stick; the vehicle's own for that axis if None.
        width: s, of both halves together.
        trim_time: s of trimmed flight before.
    """

    axis: str
    duration: float = 8.0
    amplitude: float | None = None
    width: float = 1.0
    trim_time: float = 2.0

    left_open: ClassVar[tuple[str, ...]] = ("amplitude",)

    def __post_init__(self) -> None:
        _check(self.axis, self.duration, self.trim_time)
        if not 0.0 < self.width <= self.duration - self.trim_time:
            raise InputError(
                f"doublet width must be above 0 and at most {self.duration - self.trim_time:g} s "
                f"(what the trimmed stretch leaves), got {self.width}"
            )
        _check_amplitude(self.amplitude)

    def on(self, own: Mapping[str, float]) -> Self:
        """Return the doublet with what is left open filled in by a vehicle's own parameters."""
        return replace(self, amplitude=_stick(self, own))

    def write(self, par: NDArray[np.float64]) -> None:
        """Put the doublet, complete, into a vehicle's numbers for the force laws."""
        if self.amplitude is None:
            raise InputError("an open doublet can't fly; complete it with on(vehicle.parameters)")
        par[PARAM.excitation] = DOUBLET
        par[PARAM.excitation_start] = self.trim_time
        par[PARAM.excitation_duration] = self.width
        first = PARAM.excitation_col
        par[first : first + 4] = 0.0
        par[first + AXES.index(self.axis)] = self.amplitude


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


def _stick(excitation: Sweep | Doublet, own: Mapping[str, float]) -> float:
    if excitation.amplitude is not None:
        return excitation.amplitude
    return own[f"sweep.{excitation.axis}_amplitude"]


def _check_amplitude(amplitude: float | None) -> None:
    if amplitude is not None and not 0.0 < amplitude <= 0.5:
        raise InputError(f"amplitude must be in (0, 0.5] of unitised stick, got {amplitude}")
