"""What a pilot flies on purpose: frequency sweeps, multistep inputs, and whatever you write.

An excitation of your own is a frozen dataclass with a method `sticks`:

    @dataclass(frozen=True, kw_only=True)
    class Pulse(Excitation):
        duration: float = 10.0
        amplitude: float = 0.05

        def sticks(self, time):
            return self.on_axis(np.where((time >= 2.0) & (time < 3.0), self.amplitude, 0.0))

Its fields are its settings: in provenance, plan files and on the command line. `sticks` is asked
once, for the times of all steps of a flight; no Python runs in the steps.
"""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, ClassVar, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from helisim.errors import InputError, UnknownNameError
from helisim.physics.layout import DOUBLET, PARAM, STICK_HISTORY, SWEEP
from helisim.records.channels import AXES, IN2
from helisim.sim.plain import to_plain

Setting = TypeVar("Setting")

EXCITATIONS: dict[str, type["Excitation"]] = {}
"""Every kind of excitation by its name; a subclass of `Excitation` joins on its definition."""


@dataclass(frozen=True, kw_only=True)
class Excitation:
    """What a pilot flies on purpose, on top of holding the hover; subclass it to fly your own.

    Attributes:
        axis: "col", "lon", "lat" or "ped": the axis that records and responses are named after.
        duration: s, of the whole flight.

    Raises:
        InputError: on its definition, a class has the name of an excitation from elsewhere.
    """

    axis: str
    duration: float

    left_open: ClassVar[tuple[str, ...]] = ()
    """Settings that may be None: the vehicle's own `sweep.<axis>_<setting>`."""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        other = EXCITATIONS.get(cls.__name__, cls)
        if other.__module__ != cls.__module__:
            raise InputError(
                f"there is an excitation {cls.__name__!r} in {other.__module__} already: give "
                "yours another name, by which records and plans know it"
            )
        EXCITATIONS[cls.__name__] = cls

    def on(self, own: Mapping[str, float]) -> Self:
        """Return it with what is left open filled in by a vehicle's own parameters."""
        open_ones = [name for name in self.left_open if getattr(self, name) is None]
        return replace(self, **{name: _own(own, self.axis, name) for name in open_ones})

    def sticks(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what is added to the pilot's sticks, (n_time, 4), unitised: COL, LON, LAT, PED.

        Each value is between -0.5 and 0.5, the whole travel of a stick.

        Args:
            time: (n_time,) s from the start of the flight, one for each step of the simulation.
        """
        raise NotImplementedError

    def on_axis(self, stick: ArrayLike) -> NDArray[np.float64]:
        """Return sticks, (n_time, 4), of which only that of `axis` moves, as `stick`, (n_time,)."""
        values = np.asarray(stick, dtype=np.float64)
        sticks = np.zeros((*values.shape, len(AXES)))
        sticks[..., AXES.index(self.axis)] = values
        return sticks

    def write(self, par: NDArray[np.float64]) -> None:
        """Put it, complete, into a vehicle's parameters (n_param,) for the force laws."""
        if not has_sticks(self):
            self._write_closed_form(par)
            return
        par[PARAM.excitation] = STICK_HISTORY
        par[PARAM.excitation_col : PARAM.excitation_ped + 1] = 0.0

    def _write_closed_form(self, par: NDArray[np.float64]) -> None:
        """Put a compiled formula in place of `sticks`; a plan refuses a class that has neither."""
        raise NotImplementedError


def has_sticks(excitation: Excitation) -> bool:
    """Return whether an excitation is flown by its own `sticks`, not by a compiled formula."""
    return type(excitation).sticks is not Excitation.sticks


def check_excitation(excitation: Any) -> None:
    """Raise InputError unless something can be flown as an excitation."""
    kind = type(excitation).__name__
    if not isinstance(excitation, Excitation):
        raise InputError(
            f"a flight plan needs an excitation such as Sweep(axis='lat'), got {excitation!r}"
        )
    for name in ("axis", "duration"):
        if not hasattr(excitation, name):
            raise InputError(f"{kind} has no {name}: an excitation needs an axis and a duration")
    _check(excitation.axis, excitation.duration, 0.0)
    closed_form = type(excitation)._write_closed_form is not Excitation._write_closed_form
    if not (has_sticks(excitation) or closed_form):
        raise InputError(
            f"{kind} doesn't say how the sticks move: give it a method sticks(self, time) that "
            "returns (n_time, 4) for the times, (n_time,)"
        )
    try:
        hash(excitation)
        json.dumps(to_plain(excitation), allow_nan=False)
    except (TypeError, ValueError):
        raise InputError(
            f"the settings of {kind} must be finite numbers, texts, or tuples of them, so that a "
            f"record can say what was flown; got {to_plain(excitation)}"
        ) from None


@lru_cache(maxsize=4)
def stick_history(excitation: Excitation, timestep: float) -> NDArray[np.float64] | None:
    """Return what an excitation's `sticks` adds at each step of a flight, (n_step, 4).

    Args:
        excitation: with nothing left open.
        timestep: s, of the simulation.

    Returns:
        Read-only values; None for sweep and doublet, which the force laws compute themselves.

    Raises:
        InputError: the class returns something else than such values.
    """
    if not has_sticks(excitation):
        return None
    time = step_times(excitation.duration, timestep)
    kind, wanted = type(excitation).__name__, (time.size, len(AXES))
    given = np.asarray(excitation.sticks(time.copy()))
    if given.shape != wanted or given.dtype.kind not in "fiub":
        raise InputError(
            f"{kind}.sticks must return an array of numbers of shape {wanted}, one row a time, "
            f"columns {', '.join(IN2)}; got shape {given.shape} of {given.dtype}"
        )
    sticks = np.array(given, dtype=np.float64, order="C")
    bad = ~(np.abs(sticks) <= 0.5)
    if bad.any():
        row, column = np.argwhere(bad)[0]
        raise InputError(
            f"{kind}.sticks must stay between -0.5 and 0.5, the travel of a stick; "
            f"{IN2[column]} is {sticks[row, column]:g} at {time[row]:g} s"
        )
    sticks.setflags(write=False)
    return sticks


def step_times(duration: float, timestep: float) -> NDArray[np.float64]:
    """Return the times at which the steps of a flight begin, (n_step,) s.

    They are added up as MuJoCo does, so that they equal its own to the last bit.
    """
    steps = round(duration / timestep)
    return np.concatenate([[0.0], np.cumsum(np.full(steps, timestep))])


def sticks_digest(excitation: Excitation, timestep: float) -> str | None:
    """Return a digest of what an excitation's `sticks` adds; None where there is none.

    A record keeps a class's name and settings, not its code: this shows whether the code that
    is at hand still flies the same. Arguments and errors are those of `stick_history`.
    """
    sticks = stick_history(excitation, timestep)
    if sticks is None:
        return None
    return hashlib.blake2b(sticks.astype("<f8").tobytes(), digest_size=16).hexdigest()


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

    def _write_closed_form(self, par: NDArray[np.float64]) -> None:
        amplitude, (w_min, w_max) = _complete(self, self.amplitude), _complete(self, self.band)
        par[PARAM.excitation] = SWEEP
        par[PARAM.excitation_start] = self.trim_time
        par[PARAM.excitation_duration] = self.duration - 2.0 * self.trim_time
        par[PARAM.sweep_w_min], par[PARAM.sweep_w_max] = w_min, w_max
        par[PARAM.sweep_fade] = 1.0
        par[PARAM.sweep_unsteadiness] = self.unsteadiness
        first = PARAM.excitation_col
        par[first : first + 4] = self.leakage * amplitude
        par[first + AXES.index(self.axis)] = amplitude


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

    def _write_closed_form(self, par: NDArray[np.float64]) -> None:
        par[PARAM.excitation] = DOUBLET
        par[PARAM.excitation_start] = self.trim_time
        par[PARAM.excitation_duration] = self.width
        first = PARAM.excitation_col
        par[first : first + 4] = 0.0
        par[first + AXES.index(self.axis)] = _complete(self, self.amplitude)


@dataclass(frozen=True, kw_only=True)
class ThreeTwoOneOne(Excitation):
    """A 3-2-1-1 multistep: the stick there and back in steps of 3, 2, 1 and 1 units of time.

    With as much effort as a doublet it excites a band about three times as wide (Plaetschke and
    Schulz, AGARD LS-104, 1979; Jategaonkar, Flight Vehicle System Identification, ch. 2).

    Attributes:
        axis: "col", "lon", "lat" or "ped".
        duration: s, of the whole flight.
        amplitude: unitised stick; the vehicle's own for that axis if None.
        unit: s, of the shortest step; all seven units must fit behind the trimmed stretch.
        trim_time: s of trimmed flight before.
    """

    axis: str
    duration: float = 10.0
    amplitude: float | None = None
    unit: float = 0.3
    trim_time: float = 2.0

    left_open: ClassVar[tuple[str, ...]] = ("amplitude",)

    def __post_init__(self) -> None:
        _check(self.axis, self.duration, self.trim_time)
        longest = (self.duration - self.trim_time) / 7.0
        if not 0.0 < self.unit <= longest:
            raise InputError(
                f"unit must be above 0 and at most {longest:g} s (a seventh of what the trimmed "
                f"stretch leaves), got {self.unit}"
            )
        _check_amplitude(self.amplitude)

    def sticks(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what is added to the sticks, (n_time, 4), at the times in s, (n_time,)."""
        edges = self.trim_time + self.unit * np.array([0.0, 3.0, 5.0, 6.0, 7.0])
        step = np.searchsorted(edges, time, side="right")
        wave = np.array([0.0, 1.0, -1.0, 1.0, -1.0, 0.0])[step]
        return self.on_axis(wave * _complete(self, self.amplitude))


def _check(axis: str, duration: float, trim_time: float) -> None:
    if axis not in AXES:
        raise UnknownNameError("axis", axis, AXES)
    numbers = all(isinstance(one, int | float) for one in (duration, trim_time))
    if not (numbers and math.isfinite(duration + trim_time) and trim_time >= 0.0):
        raise InputError(f"times must be finite numbers of seconds, got {duration}, {trim_time}")
    if duration < max(4.0 * trim_time, 1.0):
        raise InputError(
            f"duration must be at least {max(4.0 * trim_time, 1.0):g} s "
            f"(four times the trimmed stretch), got {duration:g}"
        )


def _own(own: Mapping[str, float], axis: str, setting: str) -> float | tuple[float, float]:
    """Return what a vehicle's own sweep of an axis has for a setting that is left open."""
    if setting == "band":
        return own[f"sweep.{axis}_w_min"], own[f"sweep.{axis}_w_max"]
    return own[f"sweep.{axis}_{setting}"]


def _complete(excitation: Excitation, setting: Setting | None) -> Setting:
    """Return a setting that must not be left open any more."""
    if setting is None:
        raise InputError(
            f"an open {type(excitation).__name__} can't fly; complete it with "
            "on(vehicle.parameters)"
        )
    return setting


def _check_amplitude(amplitude: float | None) -> None:
    if amplitude is not None and not 0.0 < amplitude <= 0.5:
        raise InputError(f"amplitude must be in (0, 0.5] of unitised stick, got {amplitude}")
