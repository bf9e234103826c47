"""Manoeuvres that are a time history: recorded, computed, or a function of time."""

import base64
import hashlib
import math
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from helisim.base.errors import InputError
from helisim.records.channels import AXES
from helisim.sim.excitation import (
    Excitation,
    check_axis,
    check_settings,
    check_times,
    split_axes,
)
from helisim.sim.manoeuvres.table import read_columns
from helisim.sim.places import PLACES
from helisim.sim.plain import in_brief

Method = Literal["linear", "hold", "cubic"]

_MOST = 1 << 28
"""Bytes of samples that are unpacked: three days at 500 Hz on one axis."""
_ROUNDING = 1e-9
"""s: by which a held sample comes early, for the times of the steps are added up."""


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

    axis: str
    duration: float = 0.0
    samples: str = field(repr=False)
    method: Method = "linear"
    digest: str = ""
    source: str = ""

    def __post_init__(self) -> None:
        check_settings(self)
        content = _unpacked(self.samples, len(self.axes))
        digest = hashlib.blake2b(content, digest_size=16).hexdigest()
        if self.digest not in ("", digest):
            raise InputError(
                f"the samples of the history are not those of its digest {self.digest}: they "
                "were changed"
            )
        object.__setattr__(self, "digest", digest)
        time, _ = self.table
        if self.duration == 0.0:
            object.__setattr__(self, "duration", float(time[-1]))
        check_times(self.duration, 0.0)
        if self.duration > time[-1] + 1e-6:
            raise InputError(
                f"the history lasts {time[-1]:g} s, shorter than the flight of {self.duration:g} "
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
        method: Method = "linear",
        duration: float = 0.0,
        source: str = "",
    ) -> Self:
        """Return the history of an array.

        Args:
            time: (n_time,) s from the start of the flight, rising from 0.
            values: (n_time,), or (n_time, n_axis) with a column for each of `axis`; unitised, of
                sensors rad/s.
            axis: one, or several joined as "lat+ped".
            at: "sticks", "servos", "actuators" or "sensors".
            method: "linear", "hold" or "cubic".
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
        columns = columns[:, None] if columns.ndim == 1 else columns
        count = len(split_axes(axis))
        if instants.ndim != 1 or columns.shape != (instants.size, count):
            raise InputError(
                f"a history needs times (n_time,) and values (n_time, {count}) for {axis}, got "
                f"{instants.shape} and {np.shape(values)}"
            )
        _check_samples(instants, columns, split_axes(axis))
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
        method: Method = "linear",
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
        time, columns = read_columns(Path(path), axis, at)
        names, source = "+".join(columns), Path(path).name
        values = np.column_stack(list(columns.values()))
        try:
            return cls.of(
                time, values, axis=names, at=at, method=method, duration=duration, source=source
            )
        except InputError as error:
            raise InputError(f"{path}: {error}") from None

    @property
    def table(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The samples: times, (n_time,) s, and values, (n_time, n_axis). Raises InputError."""
        content = _unpacked(self.samples, len(self.axes))
        rows = np.frombuffer(content, dtype="<f8").reshape(-1, 1 + len(self.axes))
        time, values = rows[:, 0], rows[:, 1:]
        _check_samples(time, values, self.axes)
        return time, values

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
        check_axis(self)
        check_times(self.duration, 0.0)
        if not callable(self.function):
            raise InputError(f"a Manoeuvre needs a function of time, got {self.function!r:.60}")

    def on(self, own: Mapping[str, float]) -> Any:
        """Return the `History` of the function at the gyro's ticks.

        Raises:
            InputError: the function raises something, or gives something else than such numbers.
        """
        period, name = own["gyro.period"], function_name(self.function)
        time = period * np.arange(math.floor(self.duration / period + 1e-6) + 1)
        count = len(self.axes)
        values = np.empty((time.size, count))
        for row, instant in enumerate(time.tolist()):
            given = _called(self.function, instant)
            if given.size != count or given.dtype.kind not in "fiub":
                raise InputError(
                    f"{name}({instant:g}) gave {given.tolist()!r:.60}, expected "
                    + (f"one number, for {self.axis}" if count == 1 else _wanted(self))
                )
            values[row] = given.reshape(-1)
        try:
            return History.of(
                time,
                values,
                axis=self.axis,
                at=self.at,
                method="hold",
                duration=min(self.duration, float(time[-1])),
                source=name,
            )
        except InputError as error:
            raise InputError(f"{name}: {error}") from None

    def sticks(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Raise InputError for any times, (n_time,): what `on` returns has (n_time, n_axis)."""
        raise InputError("an open Manoeuvre can't fly; complete it with on(vehicle.parameters)")


def function_name(function: Callable[..., Any]) -> str:
    """Return what a function is called, for messages and records."""
    return str(getattr(function, "__name__", None) or type(function).__name__)


def _called(function: Callable[[float], Any], instant: float) -> NDArray[Any]:
    """Return what a function gives at a time, s. Raises InputError from what it raises."""
    try:
        return np.asarray(function(instant))
    except Exception as error:
        name, why = function_name(function), " ".join(str(error).split())
        raise InputError(f"{name}({instant:g}) raised {type(error).__name__}: {why}") from error


def _wanted(manoeuvre: Manoeuvre) -> str:
    return (
        f"{len(manoeuvre.axes)} numbers, for {manoeuvre.axis}; for one axis alone say which: "
        "Manoeuvre(function, axis='lat')"
    )


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


def _unpacked(samples: str, axes: int) -> bytes:
    """Return the bytes of packed samples. Raises InputError."""
    try:
        unpacking = zlib.decompressobj()
        content = unpacking.decompress(base64.b64decode(samples, validate=True), _MOST)
    except (ValueError, TypeError, zlib.error) as error:
        raise InputError(
            f"the samples of a history are no packed numbers ({error}): make it with "
            "History.of or History.read"
        ) from None
    if unpacking.unconsumed_tail or not unpacking.eof or len(content) % (8 * (1 + axes)):
        raise InputError(f"the samples of a history are no rows of time and {axes} numbers")
    return content
