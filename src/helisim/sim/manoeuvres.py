"""The shipped manoeuvres: steps, sweeps, time histories, and what joins several."""

import base64
import hashlib
import math
import zlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.settings import check, in_brief, setting
from helisim.logs.mapping import TIME_NAMES, Clock, Column, split_heading
from helisim.logs.read import open_source
from helisim.physics.layout import DOUBLET, PARAM, SWEEP
from helisim.physics.pilot import sweep_phase
from helisim.records.record import AXES, IN1, IN2, SERVOS
from helisim.sim.excitation import (
    PLACES,
    Excitation,
    check_axis,
    check_excitation,
    check_times,
    complete,
    is_foreknown,
    limit,
    split_axes,
    unit,
)

_ROUNDING = 1e-9  # s: an edge comes so much early, for the times of the steps are added up
_FADE = 1.0  # s, over which a pilot's sweep grows and dies
_DIGITS = 9  # Of a part's own time, s: its edges come at the step at which they would alone
_MOST = 1 << 28  # Bytes of samples that are unpacked: three days at 500 Hz on one axis
_CHANNELS = {
    "sticks": dict(zip(PLACES["sticks"], IN2)),
    "servos": dict(zip(PLACES["servos"], (*IN1, *SERVOS))),
    "actuators": dict(zip(PLACES["actuators"], (*IN1, *SERVOS))),
    "sensors": {name: name for name in PLACES["sensors"]},
}
"""Place -> axis -> the channel whose name and unit a file's column has."""


@dataclass(frozen=True, kw_only=True)
class Timed(Excitation, ABC, listed=False):
    """Base of shipped manoeuvres behind a trimmed stretch: checks times, amplitude and band."""

    amplitude: Any = None
    if TYPE_CHECKING:
        trim_time: float

    left_open: ClassVar[tuple[str, ...]] = ("amplitude",)
    several: ClassVar[bool] = False
    after: ClassVar[bool] = True
    """Whether as long a trimmed stretch comes behind it too."""

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
            most = limit(self.at, axis)
            if not 0.0 < (one if self.after else abs(one)) <= most:
                of = {"1": "of unitised " + ("stick" if self.at == "sticks" else "servo command")}
                words = of.get(unit(self.at, axis), unit(self.at, axis))
                raise InputError(f"amplitude must be in (0, {most:g}] {words}, got {one}")


class _Steps(Timed, listed=False):
    """Base of inputs of steps.

    Each names the setting that says how long a step lasts, and its edges: when they come behind the
    trimmed stretch, in that setting, and the level from there on, in amplitudes.
    """

    lasts: ClassVar[str] = "trim_time"
    edges: ClassVar[tuple[tuple[float, float], ...]]
    early: ClassVar[float] = _ROUNDING

    def __post_init__(self) -> None:
        super().__post_init__()
        longest = self.duration - self.trim_time
        longest /= max(share for share, _ in self.edges) or np.inf
        if not 0.0 < getattr(self, self.lasts) <= longest and self.lasts != "trim_time":
            raise InputError(
                f"{self.lasts} of {type(self).__name__} must be above 0 and at most {longest:g} s, "
                f"for it has to fit behind the trimmed stretch, got {getattr(self, self.lasts)}"
            )

    def wave(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what is added, (n_time,), at the times in s, (n_time,)."""
        unit, begin = getattr(self, self.lasts), self.trim_time
        edges = begin + np.array([unit * share - self.early for share, _ in self.edges])
        levels = np.array([0.0, *(level for _, level in self.edges)])
        levels = levels * complete(self, self.amplitude) + 0.0
        return levels[np.searchsorted(edges, time, side="right")]


@dataclass(frozen=True, kw_only=True)
class Step(_Steps):
    """A step that stays to the end of the flight.

    Attributes:
        axis: one, as for every `Excitation`.
        duration: s, of the whole flight.
        amplitude: unitised, of sensors rad/s, negative the other way; of sticks the vehicle's
            own for that axis if None.
        trim_time: s of trimmed flight before.
        at: "sticks", "servos", "actuators" or "sensors".
    """

    duration: float = 8.0
    amplitude: float | None = None
    trim_time: float = 2.0

    after: ClassVar[bool] = False
    edges: ClassVar[tuple[tuple[float, float], ...]] = ((0.0, 1.0),)


@dataclass(frozen=True, kw_only=True)
class Pulse(_Steps):
    """A pulse: there, and after its width back.

    Attributes:
        axis: one, as for every `Excitation`.
        duration: s, of the whole flight.
        amplitude: as for a `Step`.
        width: s.
        trim_time: s of trimmed flight before.
        at: "sticks", "servos", "actuators" or "sensors".
    """

    duration: float = 8.0
    amplitude: float | None = None
    width: float = 0.5
    trim_time: float = 2.0

    after: ClassVar[bool] = False
    lasts: ClassVar[str] = "width"
    edges: ClassVar[tuple[tuple[float, float], ...]] = ((0.0, 1.0), (1.0, 0.0))


@dataclass(frozen=True, kw_only=True)
class Doublet(_Steps):
    """A doublet: the stick one way, then the other, then centred.

    Attributes:
        axis: one, as for every `Excitation`.
        duration: s, of the whole flight.
        amplitude: unitised, of sensors rad/s; of sticks the vehicle's own for that axis if None.
        width: s, of both halves together.
        trim_time: s of trimmed flight before.
        at: "sticks", "servos", "actuators" or "sensors".
    """

    duration: float = 8.0
    amplitude: float | None = None
    width: float = 1.0
    trim_time: float = 2.0

    lasts: ClassVar[str] = "width"
    edges: ClassVar[tuple[tuple[float, float], ...]] = ((0.0, 1.0), (0.5, -1.0), (1.0, 0.0))

    def _write_closed_form(self, par: NDArray[np.float64]) -> None:
        _write(par, self, DOUBLET, self.width)


@dataclass(frozen=True, kw_only=True)
class ThreeTwoOneOne(_Steps):
    """A 3-2-1-1 multistep: the stick there and back in steps of 3, 2, 1 and 1 units of time.

    With as much effort as a doublet it excites a band about three times as wide (Plaetschke and
    Schulz, AGARD LS-104, 1979; Jategaonkar, Flight Vehicle System Identification, ch. 2).

    Attributes:
        axis: one, as for every `Excitation`.
        duration: s, of the whole flight.
        amplitude: unitised, of sensors rad/s; of sticks the vehicle's own for that axis if None.
        unit: s, of the shortest step; all seven units must fit behind the trimmed stretch.
        trim_time: s of trimmed flight before.
        at: "sticks", "servos", "actuators" or "sensors".
    """

    duration: float = 10.0
    amplitude: float | None = None
    unit: float = 0.3
    trim_time: float = 2.0

    lasts: ClassVar[str] = "unit"
    edges: ClassVar[tuple[tuple[float, float], ...]] = tuple(
        zip((0.0, 3.0, 5.0, 6.0, 7.0), (1.0, -1.0, 1.0, -1.0, 0.0))
    )
    early: ClassVar[float] = 0.0


@dataclass(frozen=True, kw_only=True)
class Sweep(Timed):
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

    duration: float = 90.0
    amplitude: float | None = None
    band: tuple[float, float] | None = None
    trim_time: float = 3.0
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
        par[PARAM.sweep_w_min], par[PARAM.sweep_w_max] = complete(self, self.band)
        par[PARAM.sweep_fade], par[PARAM.sweep_unsteadiness] = _FADE, self.unsteadiness


def _write(
    par: NDArray[np.float64], one: Doublet | Sweep, kind: float, lasts: float, others: float = 0.0
) -> None:
    """Write a compiled formula's times, s, and amplitudes into a vehicle's parameters."""
    par[PARAM.excitation], par[PARAM.excitation_start] = kind, one.trim_time
    par[PARAM.excitation_duration] = lasts
    par[PARAM.excitation_col : PARAM.excitation_ped + 1] = others
    par[PARAM.excitation_col + AXES.index(one.axis)] = complete(one, one.amplitude)


@dataclass(frozen=True, kw_only=True)
class Chirp(Timed):
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

    duration: float = 60.0
    amplitude: float | None = None
    band: tuple[float, float] | None = None
    spacing: Literal["linear", "logarithmic", "exponential"] = "logarithmic"
    trim_time: float = 3.0
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
        amplitude, band = complete(self, self.amplitude), complete(self, self.band)
        length = self.duration - 2.0 * self.trim_time
        since = np.clip(time - self.trim_time, 0.0, length)
        grown = np.ones(since.size)
        if self.fade > 0.0:
            inside = np.minimum(since, length - since) / self.fade
            grown = 0.5 - 0.5 * np.cos(np.pi * np.minimum(inside, 1.0))
        swept = (time >= self.trim_time) & (time <= self.trim_time + length)
        return amplitude * swept * grown * np.sin(self._phase(since, length, *band))

    def _phase(
        self, time: NDArray[np.float64], length: float, w_min: float, w_max: float
    ) -> NDArray[np.float64]:
        """Return the phase, rad, at times of a chirp, s, of a length, s, and a band, rad/s."""
        if self.spacing == "linear":
            return w_min * time + 0.5 * (w_max - w_min) / length * time**2
        if self.spacing == "logarithmic":
            rate = math.log(w_max / w_min) / length
            return w_min / rate * np.expm1(rate * time)
        return np.array([sweep_phase(float(one), length, w_min, w_max) for one in time])


@dataclass(frozen=True, kw_only=True)
class _Composite(Excitation, ABC, listed=False):
    """Base of manoeuvres that are made of others."""

    parts: tuple[Excitation, ...]
    axis: str = ""
    duration: float = setting(0.0, unit="s")

    def __post_init__(self) -> None:
        kind = type(self).__name__
        if not isinstance(self.parts, list | tuple) or not self.parts:
            raise InputError(f"{kind} needs parts, a tuple of manoeuvres, got {self.parts!r:.60}")
        for part in self.parts:
            check_excitation(part)
            if not is_foreknown(part):
                raise InputError(
                    f"a {type(part).__name__} is no part of a {kind}: its wobble belongs to the "
                    'pilot of a flight; take a Chirp(spacing="exponential")'
                )
        axes = "+".join(dict.fromkeys(one for part in self.parts for one in part.axes))
        if self.axis not in ("", axes):
            raise InputError(f"the axes of {kind} are those of its parts, {axes}; got {self.axis}")
        if self.at != "sticks":
            raise InputError(f"give {kind}'s parts their place: at={self.at!r} belongs to them")
        object.__setattr__(self, "axis", axes)
        check(self)
        if self.duration == 0.0:
            object.__setattr__(self, "duration", self._length())
        if not self.duration >= self._length() - 1e-9:
            raise InputError(
                f"{kind} lasts {self.duration:g} s, shorter than its parts: {self._length():g} s"
            )

    @abstractmethod
    def _starts(self) -> list[float]:
        """Return when each part begins, s."""

    @abstractmethod
    def _length(self) -> float:
        """Return how long the parts last together, s."""

    @property
    def places(self) -> tuple[str, ...]:
        """Where its parts add something, in the order of `PLACES`."""
        found = {place for part in self.parts for place in part.places}
        return tuple(place for place in PLACES if place in found)

    @property
    def written(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Whether all its parts are plain data."""
        return all(part.written for part in self.parts)

    @property
    def highest(self) -> float:
        """The highest frequency of its parts, rad/s."""
        return max(part.highest for part in self.parts)

    def on(self, own: Mapping[str, float]) -> Self:
        """Return it with its parts complete. Raises InputError."""
        return replace(self, parts=tuple(part.on(own) for part in self.parts))

    def check(self) -> None:
        """Do nothing: parts and duration were checked when it was made."""

    def added(self, time: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Return what is added at the times in s, (n_time,), by place: (n_time, n_axis)."""
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
    """Manoeuvres one after the other.

    Attributes:
        parts: each lasts its own `duration`, with its own trimmed stretches.
        pause: s of trimmed flight between two parts.
        axis: that of its parts; leave it out.
        duration: s, of the whole flight; as long as all parts and pauses if 0.
    """

    pause: float = setting(0.0, unit="s", low=0.0)

    def _starts(self) -> list[float]:
        lengths = [part.duration + self.pause for part in self.parts]
        return np.concatenate([[0.0], np.cumsum(lengths)[:-1]]).tolist()

    def _length(self) -> float:
        return sum(part.duration for part in self.parts) + self.pause * (len(self.parts) - 1)


@dataclass(frozen=True, kw_only=True)
class Together(_Composite):
    """Manoeuvres all at once, on several inputs or at several places.

    Attributes:
        parts: each begins with the flight.
        axis: that of its parts; leave it out.
        duration: s, of the whole flight; that of the longest part if 0.
    """

    def _starts(self) -> list[float]:
        return [0.0] * len(self.parts)

    def _length(self) -> float:
        return max(part.duration for part in self.parts)


@dataclass(frozen=True, kw_only=True)
class History(Excitation):
    """Samples, added as they are: from a file (`read`) or an array (`of`).

    Attributes:
        axis: one, or several joined as "lat+ped", in the order of the samples' columns.
        duration: s, of the whole flight; that of the samples if 0.
        samples: time and a column an axis, packed as text, so that a record can be flown again.
        method: how they are resampled: "linear", "hold" (each until the next) or "cubic".
        digest: of the samples; leave it out.
        source: where they come from, for people.
        at: "sticks", "servos", "actuators" or "sensors".

    Raises:
        InputError: the samples are not finite, not in the order of time, or shorter than the
            flight.
    """

    duration: float = 0.0
    samples: str = field(repr=False)
    method: Literal["linear", "hold", "cubic"] = "linear"
    digest: str = ""
    source: str = ""

    def __post_init__(self) -> None:
        check(self)
        check_axis(self)
        digest = hashlib.blake2b(self._unpacked(), digest_size=16).hexdigest()
        if self.digest not in ("", digest):
            raise InputError(
                f"the samples of the history are not those of its digest {self.digest}: they "
                "were changed"
            )
        object.__setattr__(self, "digest", digest)
        last = float(self.table[0][-1])
        if self.duration == 0.0:
            object.__setattr__(self, "duration", last)
        check_times(self.duration, 0.0)
        if self.duration > last + 1e-6:
            raise InputError(
                f"the history lasts {last:g} s, shorter than the flight of {self.duration:g} "
                "s: leave out the duration, or add samples"
            )

    @classmethod
    def of(
        cls,
        time: ArrayLike,
        values: ArrayLike,
        *,
        axis: str,
        at: str = "sticks",
        method: Literal["linear", "hold", "cubic"] = "linear",
        duration: float = 0.0,
        source: str = "",
    ) -> Self:
        """Return the history of an array.

        Args:
            time: (n_time,) s from the start of the flight, rising from 0.
            values: (n_time,), or (n_time, n_axis) with a column for each of `axis`; unitised, of
                sensors rad/s.
            axis: one, or several joined as "lat+ped"; the rest is as for the class.
            at: where it is added.
            method: of resampling.
            duration: s, of the flight; that of the array if 0.
            source: where it comes from, for people.

        Raises:
            InputError: the array is of another shape, or as for the class.
        """
        if not isinstance(axis, str):
            raise InputError(f"the axis of a history must be text such as 'lat', got {axis!r}")
        try:
            columns, instants = (np.array(one, dtype=np.float64) for one in (values, time))
        except (TypeError, ValueError) as error:
            raise InputError(f"a history needs numbers: {error}") from None
        columns, axes = columns[:, None] if columns.ndim == 1 else columns, split_axes(axis)
        if instants.ndim != 1 or columns.shape != (instants.size, len(axes)):
            raise InputError(
                f"a history needs times (n_time,) and values (n_time, {len(axes)}) for {axis}, got "
                f"{instants.shape} and {np.shape(values)}"
            )
        _check_samples(instants, columns, axes)
        content = np.column_stack([instants, columns]).astype("<f8").tobytes()
        samples = base64.b64encode(zlib.compress(content, 9)).decode("ascii")
        return cls(
            axis=axis, duration=duration, samples=samples, method=method, source=source, at=at
        )

    @classmethod
    def read(
        cls,
        path: str | PathLike[str],
        *,
        axis: str | None = None,
        at: str = "sticks",
        method: Literal["linear", "hold", "cubic"] = "linear",
        duration: float = 0.0,
    ) -> Self:
        """Return the history that a CSV or Parquet file holds.

        Its columns are `time` and one an axis, called as the channel: COL, LON, LAT, PED of the
        sticks (or in small letters), col, lon, lat, ped or front, left, right, tail of servos and
        actuators, p, q, r, phi, theta, psi of sensors. A heading may state a unit, as "p [deg/s]".

        Args:
            path: of the file; a flight record too.
            axis: those wanted; all of the file's if None, which then may have no others.
            at: "sticks", "servos", "actuators" or "sensors".
            method: "linear", "hold" or "cubic".
            duration: s, of the flight; that of the file if 0.

        Raises:
            StorageError: the file can't be read.
            RecordError: a time is missing.
            InputError: a column is missing or isn't known, or as for the class.
        """
        time, columns = _read_columns(Path(path), axis, at)
        given = {"at": at, "method": method, "duration": duration, "source": Path(path).name}
        try:
            values = np.column_stack(list(columns.values()))
            return cls.of(time, values, axis="+".join(columns), **given)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None

    @property
    def table(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The samples: times, (n_time,) s, and values, (n_time, n_axis). Raises InputError."""
        rows = np.frombuffer(self._unpacked(), dtype="<f8").reshape(-1, 1 + len(self.axes))
        _check_samples(rows[:, 0], rows[:, 1:], self.axes)
        return rows[:, 0], rows[:, 1:]

    def sticks(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what is added to each axis, (n_time, n_axis), at the times in s, (n_time,)."""
        instants, values = self.table
        if self.method == "hold":
            row = np.searchsorted(instants, time + _ROUNDING, side="right") - 1
            found = values[np.clip(row, 0, None)]
        elif self.method == "cubic":
            found = CubicSpline(instants, values)(np.minimum(time, instants[-1]))
        else:
            found = np.column_stack([np.interp(time, instants, one) for one in values.T])
        columns = np.zeros((time.size, len(PLACES[self.at])))
        columns[:, [PLACES[self.at].index(axis) for axis in self.axes]] = found
        return columns

    def _unpacked(self) -> bytes:
        """Return the bytes of the packed samples. Raises InputError."""
        axes, unpacking = len(self.axes), zlib.decompressobj()
        try:
            content = unpacking.decompress(base64.b64decode(self.samples, validate=True), _MOST)
        except (ValueError, TypeError, zlib.error) as error:
            raise InputError(
                f"the samples of a history are no packed numbers ({error}): make it with "
                "History.of or History.read"
            ) from None
        if unpacking.unconsumed_tail or not unpacking.eof or len(content) % (8 * (1 + axes)):
            raise InputError(f"the samples of a history are no rows of time and {axes} numbers")
        return content


@dataclass(frozen=True)
class Manoeuvre(Excitation):
    """A function of time. A vehicle's gyro samples it: `on` returns a `History`.

    Records keep the samples, so they can be flown again without the function.

    Attributes:
        function: of the time in s, one number, called once for each of the gyro's periods;
            returns what is added then, unitised, of sensors in rad/s: a number, or one for each
            axis.
        axis: one, or several joined as "lat+ped".
        duration: s, of the whole flight.
        at: "sticks", "servos", "actuators" or "sensors".
    """

    function: Callable[[float], Any] = field(kw_only=False)
    axis: str = field(default="+".join(AXES), kw_only=True)
    duration: float = field(default=10.0, kw_only=True)

    written: ClassVar[bool] = False

    def __repr__(self) -> str:
        return in_brief(self)

    def __post_init__(self) -> None:
        self.check()
        if not callable(self.function):
            raise InputError(f"a Manoeuvre needs a function of time, got {self.function!r:.60}")

    def on(self, own: Mapping[str, float]) -> Any:
        """Return the `History` of the function at the gyro's ticks.

        Raises:
            InputError: the function raises something, or gives something else than such numbers.
        """
        period, count = own["gyro.period"], len(self.axes)
        name = str(getattr(self.function, "__name__", None) or type(self.function).__name__)
        time = period * np.arange(math.floor(self.duration / period + 1e-6) + 1)
        values = np.empty((time.size, count))
        for row, instant in enumerate(time.tolist()):
            try:
                given = np.asarray(self.function(instant))
            except Exception as error:
                why = f"{type(error).__name__}: {' '.join(str(error).split())}"
                raise InputError(f"{name}({instant:g}) raised {why}") from error
            if given.size != count or given.dtype.kind not in "fiub":
                wanted = "one number" if count == 1 else f"{count} numbers"
                alone = "; for one axis alone say which: Manoeuvre(function, axis='lat')"
                raise InputError(
                    f"{name}({instant:g}) gave {given.tolist()!r:.60}, expected {wanted}, for "
                    f"{self.axis}{alone if count > 1 else ''}"
                )
            values[row] = given.reshape(-1)
        lasts = min(self.duration, float(time[-1]))
        given = {"method": "hold", "duration": lasts, "source": name}
        try:
            return History.of(time, values, axis=self.axis, at=self.at, **given)
        except InputError as error:
            raise InputError(f"{name}: {error}") from None

    def sticks(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Raise InputError for any times, (n_time,): what `on` returns has (n_time, n_axis)."""
        raise InputError("an open Manoeuvre can't fly; complete it with on(vehicle.parameters)")


def _check_samples(
    time: NDArray[np.float64], values: NDArray[np.float64], axes: tuple[str, ...]
) -> None:
    if time.size < 2:
        raise InputError(f"a history needs at least two samples, got {time.size}")
    if not np.isfinite(time).all() or not (np.diff(time) > 0.0).all():
        row = int(np.argmin(np.isfinite(time) & (np.diff(time, prepend=-np.inf) > 0.0)))
        raise InputError(
            f"the times of a history must rise: sample {row} is at {time[row]:g} s"
            + (f", the one before at {time[row - 1]:g} s" if row else "")
        )
    if abs(time[0]) > _ROUNDING:
        raise InputError(f"the times of a history must begin at 0 s, got {time[0]:g}")
    if not np.isfinite(values).all():
        row, column = np.argwhere(~np.isfinite(values))[0]
        raise InputError(f"{axes[column]} is {values[row, column]} at {time[row]:g} s")


def _read_columns(
    path: Path, axis: str | None, at: str
) -> tuple[NDArray[np.float64], dict[str, NDArray[np.float64]]]:
    """Return a file's times, (n_time,) s from the first, and the columns of axes, (n_time,) SI."""
    if at not in PLACES:
        raise UnknownNameError("place for a manoeuvre", at, PLACES)
    source, known = open_source(path), _CHANNELS[at]
    has, headings = ", ".join(source.names), {split_heading(name)[0]: name for name in source.names}
    times = [name for name in headings if name.lower() in TIME_NAMES]
    if not times:
        raise InputError(
            f"{path}: no column is the time: call one time, in s, or state its unit, as in 'time "
            f"[ms]'; it has {has}"
        )
    named = {one: headings.get(channel, headings.get(one)) for one, channel in known.items()}
    found = {one: heading for one, heading in named.items() if heading is not None}
    wanted = list(found) if axis is None else list(split_axes(axis))
    for one in wanted:
        if one not in known:
            raise UnknownNameError("axis" if at == "sticks" else f"axis at {at}", one, known)
        if one not in found:
            raise InputError(f"{path}: no column {known[one]}; it has {has}")
    others = set(headings) - set(times) - {split_heading(name)[0] for name in found.values()}
    if axis is None and (others or not found):
        raise InputError(
            f"{path}: of its columns {', '.join(sorted(others))} none is added at {at}, where "
            f"they are {', '.join(known.values())}; say which are wanted with an axis, such as "
            "lat+ped"
        )
    bare = [name for name in source.names if name.lower() in ("time", "t")]
    clock = Clock(bare[0], "s") if bare else None  # else the heading has to state its unit
    stamps, _, _ = source.stamps(source.clock(source.names[0]), clock)
    columns = {}
    for one in wanted:
        stated = source.stated_unit(found[one])
        try:
            _, factor = Column(found[one], stated or unit(at, one)).converts(known[one], stated)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
        columns[one] = factor * source.numbers(found[one])
    return stamps, columns
