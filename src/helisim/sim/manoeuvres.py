"""The shipped manoeuvres: steps, sweeps, time histories, and what joins several."""

import math
from abc import ABC
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from helisim.base.errors import InputError
from helisim.base.settings import Value, check, setting
from helisim.physics.layout import DOUBLET, SWEEP
from helisim.records.record import AXES
from helisim.sim.excitation import (
    PLACES,
    Excitation,
    check_axis,
    check_excitation,
    check_times,
    complete,
    is_compiled,
    limit,
    unit,
)
from helisim.vehicle.addresses import write_named

_ROUNDING = 1e-9  # s: an edge comes so much early, for the times of the steps are added up
_FADE = 1.0  # s, over which a pilot's sweep grows and dies
_DIGITS = 9  # of a part's own time, s: its edges come at the step at which they would alone


@dataclass(frozen=True, kw_only=True)
class Timed(Excitation, ABC, listed=False):
    """Base of shipped manoeuvres behind a trimmed stretch: checks times, amplitude and band."""

    amplitude: Any = None
    trim_time: float = 3.0

    left_open: ClassVar[tuple[str, ...]] = ("amplitude",)
    several: ClassVar[bool] = False
    after: ClassVar[bool] = True  # a trimmed stretch as long comes behind it too

    def __post_init__(self) -> None:
        check(self)
        check_axis(self)
        check_times(self.duration, self.trim_time, after=self.after)
        band, axes, given = getattr(self, "band", None), self.axes, self.amplitude
        pairs = [] if band is None else list(zip(band[::2], band[1::2]))
        fine = all(0.0 < low < high for low, high in pairs)
        if band is not None and not (pairs and len(band) % 2 == 0 and fine):
            raise InputError(
                f"band of {type(self).__name__} must be 0 < w_min < w_max in rad/s, got {band}"
            )
        each = given if isinstance(given, tuple) else () if given is None else (given,) * len(axes)
        for one, axis in zip(each, axes if len(each) == len(axes) else axes * len(each)):
            if not 0.0 < (one if self.after else abs(one)) <= limit(axis):
                words = unit(axis).replace("1", "unitised")
                raise InputError(f"amplitude must be in (0, {limit(axis):g}] {words}, got {one}")


@dataclass(frozen=True, kw_only=True)
class _Steps(Timed, listed=False):
    """Inputs of steps; edges: times, in the setting `lasts`, and levels in amplitudes."""

    duration: float = 8.0
    amplitude: float | None = None
    trim_time: float = 2.0

    lasts: ClassVar[str] = "trim_time"
    edges: ClassVar[tuple[tuple[float, float], ...]]
    early: ClassVar[float] = _ROUNDING

    def __post_init__(self) -> None:
        super().__post_init__()
        share = self.edges[-1][0]
        longest = (self.duration - self.trim_time) / share if share else math.inf
        if not 0.0 < getattr(self, self.lasts) <= longest and share:
            raise InputError(
                f"{self.lasts} of {type(self).__name__} must be above 0 and at most {longest:g} s, "
                f"for it has to fit behind the trimmed stretch, got {getattr(self, self.lasts)}"
            )

    def wave(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        unit, begin = getattr(self, self.lasts), self.trim_time
        edges = begin + np.array([unit * share - self.early for share, _ in self.edges])
        levels = np.array([0.0, *(level for _, level in self.edges)])
        levels = levels * complete(self, self.amplitude) + 0.0
        return levels[np.searchsorted(edges, time, side="right")]


@dataclass(frozen=True, kw_only=True)
class Step(_Steps):
    """A step that begins after `trim_time`, s, and stays to the end of the flight.

    The amplitude may be negative. It is unitised; of sensors, a rate's is in rad/s and an
    attitude's in rad. None is the vehicle's own, which it has for the sticks alone.
    """

    after: ClassVar[bool] = False
    edges: ClassVar[tuple[tuple[float, float], ...]] = ((0.0, 1.0),)


@dataclass(frozen=True, kw_only=True)
class Pulse(_Steps):
    """A pulse: a step that goes back after its width, s; the rest is as for a `Step`."""

    width: float = 0.5

    after: ClassVar[bool] = False
    lasts: ClassVar[str] = "width"
    edges: ClassVar[tuple[tuple[float, float], ...]] = ((0.0, 1.0), (1.0, 0.0))


@dataclass(frozen=True, kw_only=True)
class Doublet(_Steps):
    """A doublet: a pulse to one side and one to the other, `width`, s, together.

    The amplitude is positive; the rest is as for a `Step`.
    """

    width: float = 1.0

    lasts: ClassVar[str] = "width"
    edges: ClassVar[tuple[tuple[float, float], ...]] = ((0.0, 1.0), (0.5, -1.0), (1.0, 0.0))

    def _write_closed_form(self, par: NDArray[np.float64]) -> None:
        _write(par, self, DOUBLET, self.width)


@dataclass(frozen=True, kw_only=True)
class ThreeTwoOneOne(_Steps):
    """A 3-2-1-1 multistep: there and back in steps of 3, 2, 1 and 1 units of time.

    It excites three times a doublet's band (Plaetschke and Schulz, AGARD LS-104, 1979;
    Jategaonkar, Flight Vehicle System Identification, ch. 2). `unit`, s, is the shortest step's.
    """

    duration: float = 10.0
    unit: float = 0.3

    lasts: ClassVar[str] = "unit"
    edges: ClassVar[tuple[tuple[float, float], ...]] = tuple(
        zip((0.0, 3.0, 5.0, 6.0, 7.0), (1.0, -1.0, 1.0, -1.0, 0.0))
    )
    early: ClassVar[float] = 0.0


@dataclass(frozen=True, kw_only=True)
class Sweep(Timed):
    """An exponential frequency sweep by a pilot, between two stretches of trimmed flight.

    Amplitude, unitised, and band, (w_min, w_max) rad/s, are the vehicle's own for that axis if
    None. `trim_time`, s, is before and after, a quarter of the duration at most; `leakage` the part
    that slips into each other stick; `unsteadiness` of the amplitude, and of the phase in rad.
    """

    duration: float = 90.0
    amplitude: float | None = None
    band: tuple[float, float] | None = None
    leakage: float = setting(0.04, low=0.0, high=1.0)
    unsteadiness: float = setting(0.1, low=0.0, high=1.0)

    left_open: ClassVar[tuple[str, ...]] = ("amplitude", "band")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.at != "sticks":
            raise InputError(f"a Sweep is a pilot's, of the sticks: fly a Chirp at {self.at}")

    def _write_closed_form(self, par: NDArray[np.float64]) -> None:
        leaked = self.leakage * complete(self, self.amplitude)
        _write(par, self, SWEEP, self.duration - 2.0 * self.trim_time, leaked)
        write_named(
            par,
            sweep_w_min=complete(self, self.band),
            sweep_fade=_FADE,
            sweep_unsteadiness=self.unsteadiness,
        )


def _write(
    par: NDArray[np.float64], one: Doublet | Sweep, kind: float, lasts: float, others: float = 0.0
) -> None:
    moved = [complete(one, one.amplitude) if axis == one.axis else others for axis in AXES]
    write_named(par, excitation=(kind, one.trim_time, lasts), excitation_col=moved)


@dataclass(frozen=True, kw_only=True)
class Chirp(Timed):
    """A machine's sine of rising frequency, each octave as long, between two trimmed stretches.

    The amplitude is unitised; of sensors, a rate's is in rad/s and an attitude's in rad. The band
    is (w_min, w_max) in rad/s. If None both are the vehicle's own, the amplitude for the sticks
    alone. `fade` is the time, s, over which it grows and dies, by half a cosine.
    """

    duration: float = 60.0
    amplitude: float | None = None
    band: tuple[float, float] | None = None
    fade: float = 1.0

    left_open: ClassVar[tuple[str, ...]] = ("amplitude", "band")

    def __post_init__(self) -> None:
        super().__post_init__()
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
        rate = math.log(w_max / w_min) / length
        return amplitude * swept * grown * np.sin(w_min / rate * np.expm1(rate * since))


@dataclass(frozen=True, kw_only=True)
class _Composite(Excitation, ABC, listed=False):
    parts: tuple[Excitation, ...]
    axis: str = ""
    duration: float = setting(0.0, unit="s")

    def __post_init__(self) -> None:
        kind = type(self).__name__
        if not isinstance(self.parts, list | tuple) or not self.parts:
            raise InputError(f"{kind} needs parts, a tuple of manoeuvres, got {self.parts!r:.60}")
        for part in self.parts:
            check_excitation(part)
            if is_compiled(part) and type(part).wave is Excitation.wave:
                raise InputError(
                    f"a {type(part).__name__} is no part of a {kind}: its wobble belongs to the "
                    "pilot of a flight; take a Chirp"
                )
        axes = "+".join(dict.fromkeys(one for part in self.parts for one in part.axes))
        if self.axis not in ("", axes) or self.at != "sticks":
            raise InputError(f"axis and place of {kind} are those of its parts, {axes}: leave both")
        object.__setattr__(self, "axis", axes)
        check(self)
        last = max(start + part.duration for start, part in zip(self._starts(), self.parts))
        if self.duration == 0.0:
            object.__setattr__(self, "duration", last)
        if not self.duration >= last - 1e-9:
            raise InputError(
                f"{kind} lasts {self.duration:g} s, shorter than its parts: {last:g} s"
            )

    def _starts(self) -> list[float]:
        return [0.0] * len(self.parts)

    @property
    def places(self) -> tuple[str, ...]:
        found = {place for part in self.parts for place in part.places}
        return tuple(place for place in PLACES if place in found)

    @property
    def highest(self) -> float:
        return max(part.highest for part in self.parts)

    def on(self, own: Mapping[str, float]) -> Self:
        return replace(self, parts=tuple(part.on(own) for part in self.parts))

    def check(self) -> None:
        """Do nothing: parts and duration were checked when it was made."""

    def added(self, time: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        total: dict[str, NDArray[np.float64]] = {}
        for start, part in zip(self._starts(), self.parts):
            own = np.round(time - start, _DIGITS)
            last = start + part.duration >= self.duration - 1e-9
            inside = (own >= 0.0) & (own < (np.inf if last else part.duration))
            for place, columns in part.added(own[inside]).items():
                total.setdefault(place, np.zeros((time.size, len(PLACES[place]))))
                total[place][inside] += columns
        return total


@dataclass(frozen=True, kw_only=True)
class Sequence(_Composite):
    """Manoeuvres one after the other, `pause`, s, apart; the duration, s, is that of all if 0."""

    pause: float = setting(0.0, unit="s", low=0.0)

    def _starts(self) -> list[float]:
        lengths = [part.duration + self.pause for part in self.parts]
        return np.concatenate([[0.0], np.cumsum(lengths)[:-1]]).tolist()


@dataclass(frozen=True, kw_only=True)
class Together(_Composite):
    """Manoeuvres all at once; the duration, s, is that of the longest part if 0."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class History(Value, Excitation):
    """A time history of one's own, added as it is; `History.of` makes it from arrays.

    Between its samples, times, (n_time,) s, and values, (n_time, n_axis), `method` is "linear", or
    "hold", which keeps each until the next. A duration, s, of 0 is that of the samples. Raises
    InputError if samples don't rise in time, or end before the flight does.
    """

    duration: float = 0.0
    times: NDArray[np.float64] = field(repr=False)
    values: NDArray[np.float64] = field(repr=False)
    method: Literal["linear", "hold"] = "linear"
    source: str = ""

    def __post_init__(self) -> None:
        check(self)
        check_axis(self)
        if self.values.ndim == 1:
            object.__setattr__(self, "values", self.values[:, None])
        times, shape = self.times, self.values.shape
        if times.ndim != 1 or times.size < 2 or shape != (times.size, len(self.axes)):
            raise InputError(
                f"a history needs two times or more (n_time,) and values (n_time, "
                f"{len(self.axes)}) for {self.axis}, got {times.shape} and {shape}"
            )
        if abs(times[0]) > _ROUNDING or not (np.diff(times) > 0.0).all():
            raise InputError(f"the times of a history must rise from 0 s, got {times[0]:g}")
        last = float(times[-1])
        if self.duration == 0.0:
            object.__setattr__(self, "duration", last)
        check_times(self.duration, 0.0)
        if self.duration > last + 1e-6:
            raise InputError(
                f"the history lasts {last:g} s, shorter than the flight of {self.duration:g} "
                "s: leave out the duration, or add samples"
            )

    @classmethod
    def of(cls, time: ArrayLike, values: ArrayLike, *, axis: str, **settings: Any) -> Self:
        """Return the history of values, (n_time,) or (n_time, n_axis), at (n_time,) s from 0 on.

        Each of the axes that `axis` joins has a column: unitised; of sensors, rates in rad/s and
        attitudes in rad. `source` says in messages where they are from. Raises InputError.
        """
        given: dict[str, Any] = {"times": time, "values": values, **settings}
        return cls(axis=axis, **given)

    def sticks(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what is added to each axis, (n_time, n_axis), at the times in s, (n_time,)."""
        if self.method == "hold":
            row = np.searchsorted(self.times, time + _ROUNDING, side="right") - 1
            found = self.values[np.clip(row, 0, None)]
        else:
            found = np.column_stack([np.interp(time, self.times, one) for one in self.values.T])
        columns = np.zeros((time.size, len(PLACES[self.at])))
        columns[:, [PLACES[self.at].index(axis) for axis in self.axes]] = found
        return columns
