"""The flight record: what a flight computer writes and the identification reads."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from helisim.base.display import Displayed, shower
from helisim.base.errors import InputError, RecordError, UnknownNameError
from helisim.base.units import check_same
from helisim.base.units import unit as unit_of
from helisim.base.value import Value
from helisim.records.channels import CHANNELS, Channel, some_names
from helisim.records.provenance import plain

if TYPE_CHECKING:
    import pandas
    import xarray

    from helisim.base.display import Axes, Figure

UNIFORM = 1e-6
"""A time step may differ from the mean by this fraction and still count as uniform:
far above the rounding of a double, far below any sample of interest."""


@dataclass(frozen=True, eq=False)
class FlightRecord(Value, Displayed):
    """Time histories of named channels, with units and provenance. Read-only.

    Attributes:
        time: (n_time,) s, finite and strictly increasing.
        values: (n_time, n_channel) in the units of `channels`, finite.
        channels: one `Channel` a column, names unique.
        provenance: JSON-like mapping: who flew what, with which seed and versions.
    """

    time: NDArray[np.float64]
    values: NDArray[np.float64]
    channels: tuple[Channel, ...]
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("time", "values"):
            array = np.array(getattr(self, name), dtype=np.float64, order="C")
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        object.__setattr__(self, "channels", tuple(self.channels))
        _check(self.time, self.values, self.names)
        object.__setattr__(self, "provenance", plain(self.provenance))

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """Return one channel, (n_time,). Raises UnknownNameError."""
        return self.values[:, self._index(name)]

    __iter__: ClassVar[None] = None
    """Over names or samples? `names`, `time` and `values` say which."""

    def __contains__(self, name: str) -> bool:
        return name in self.names

    def __len__(self) -> int:
        return self.time.size

    def __repr__(self) -> str:
        return (
            f"FlightRecord({len(self)} samples, {self.duration:.2f} s, "
            f"{len(self.names)} channels: {some_names(self.names)})"
        )

    @property
    def names(self) -> tuple[str, ...]:
        """The channel names, in column order."""
        return tuple(channel.name for channel in self.channels)

    @property
    def duration(self) -> float:
        """Time from the first to the last sample, s."""
        return float(self.time[-1] - self.time[0])

    @property
    def sample_time(self) -> float:
        """Sample interval, s. Raises RecordError unless the record is uniformly sampled."""
        steps = np.diff(self.time)
        mean = self.duration / steps.size
        worst = int(np.argmax(np.abs(steps - mean)))
        if abs(steps[worst] - mean) > UNIFORM * mean:
            raise RecordError(
                f"samples are not uniform: the step after row {worst} is {steps[worst]:.6g} s, "
                f"the mean is {mean:.6g} s; resample the record first, with "
                "helisim.screen(record, resample_hz=...)"
            )
        return mean

    @property
    def ended(self) -> str:
        """Why and when the flight was terminated early, "" if it wasn't.

        A simulation says so in the provenance's `ended`, with `at` (s), `why` and `state`.
        """
        end = self.provenance.get("ended")
        if not isinstance(end, Mapping):
            return ""
        at = end.get("at")
        return f"{end.get('why')} at {f'{at:.2f}' if isinstance(at, int | float) else at} s"

    def unit(self, name: str) -> str:
        """Return the unit of a channel. Raises UnknownNameError."""
        return self.channels[self._index(name)].unit

    def select(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Return the named channels as columns, (n_time, n_name). Raises UnknownNameError."""
        return self.values[:, [self._index(name) for name in names]]

    def slice(self, start: float, stop: float) -> "FlightRecord":
        """Return the samples with start <= time <= stop, in s."""
        keep = (self.time >= start) & (self.time <= stop)
        return FlightRecord(self.time[keep], self.values[keep], self.channels, self.provenance)

    def to_pandas(self) -> "pandas.DataFrame":
        """Return a DataFrame: the index is `time` in s, a column each channel.

        Its `attrs` hold `units`, `kinds` and `meanings` by channel, and the `provenance`.

        Raises:
            InputError: pandas isn't installed.
        """
        pandas = _package("pandas")
        time = pandas.Index(np.array(self.time), name="time")
        frame = pandas.DataFrame(np.array(self.values), index=time, columns=list(self.names))
        for key, attribute in _KEYS.items():
            frame.attrs[key] = {one.name: getattr(one, attribute) for one in self.channels}
        frame.attrs["provenance"] = dict(self.provenance)
        return frame

    def to_xarray(self) -> "xarray.Dataset":
        """Return a Dataset: a variable each channel over `time`, with `units` and `long_name`.

        Its `attrs` hold the `provenance` as JSON, so that it can be written as netCDF.

        Raises:
            InputError: xarray isn't installed.
        """
        xarray = _package("xarray")
        variables = {
            one.name: (
                "time",
                np.array(values),
                {"units": one.unit, "long_name": one.meaning, "kind": one.kind},
            )
            for one, values in zip(self.channels, self.values.T)
        }
        time = ("time", np.array(self.time), {"units": "s", "long_name": "time"})
        about = {"provenance": json.dumps(dict(self.provenance), allow_nan=False)}
        return xarray.Dataset(variables, coords={"time": time}, attrs=about)

    @classmethod
    def from_pandas(
        cls,
        frame: "pandas.DataFrame",
        *,
        units: Mapping[str, str] | None = None,
        provenance: Mapping[str, Any] | None = None,
    ) -> "FlightRecord":
        """Return the record that a DataFrame holds, such as that of `to_pandas`.

        Args:
            frame: times in s as its index or as column `time`; a column each channel.
            units: of columns, such as {"p": "deg/s"}: converted to SI. By default as `to_pandas`
                says in `attrs`, or SI where the name is a standard channel's.
            provenance: who flew what; by default that in `attrs`.

        Raises:
            UnknownNameError: no such column or unit.
            InputError: the unit of a column isn't known, or not of the channel's kind.
            RecordError: what isn't finite or no number, or times that don't increase; to repair
                it, write it to a file for `helisim.read_log`.
        """
        if not hasattr(frame, "attrs") or not hasattr(frame, "columns"):
            raise InputError(f"from_pandas takes a DataFrame, got {type(frame).__name__}")
        stated = {str(key): dict(x) for key, x in frame.attrs.items() if isinstance(x, Mapping)}
        if "time" in frame.columns:
            frame = frame.set_index("time")
        elif frame.index.name != "time" and type(frame.index).__name__ == "RangeIndex":
            raise RecordError(
                "the DataFrame has no times: its index numbers the rows; give it a column 'time', "
                "in s, or such an index"
            )
        names, units = [str(name) for name in frame.columns], units or {}
        for name in units:
            if name not in names:
                raise UnknownNameError("column with a unit", name, names)
        found = [_column_channel(name, units.get(name), stated) for name in names]
        values = np.zeros((len(frame), len(names)))
        for k, (name, (_, factor)) in enumerate(zip(names, found)):
            values[:, k] = factor * _numbers(frame.iloc[:, k], name)
        time = _numbers(frame.index, "time")
        origin = stated.get("provenance", {}) if provenance is None else provenance
        return cls(time, values, tuple(one for one, _ in found), origin)

    def plot(
        self,
        channels: "Sequence[str] | str | None" = None,
        *,
        axes: "Sequence[Axes] | None" = None,
    ) -> "Figure":
        """Draw time histories; angles and their rates in degrees.

        Args:
            channels: a panel each; by default inputs and motion, those of a kind together.
            axes: to draw on, one a panel from top to bottom; by default those of a new figure.

        Raises:
            UnknownNameError: no such channel.
            InputError: there are more or fewer axes than panels.
        """
        return shower().plot_record(self, channels, axes)

    def _index(self, name: str) -> int:
        if name not in self.names:
            raise UnknownNameError("channel", name, self.names)
        return self.names.index(name)


def _check(time: NDArray[np.float64], values: NDArray[np.float64], names: tuple[str, ...]) -> None:
    if time.ndim != 1 or time.size < 2:
        raise RecordError(f"time needs at least two samples in one dimension, got {time.shape}")
    expected = (time.size, len(names))
    if values.shape != expected:
        raise RecordError(f"values have shape {values.shape}, expected {expected}")
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise RecordError(f"channel names must be unique, repeated: {', '.join(repeated)}")
    bad = np.flatnonzero(~np.isfinite(time))
    if bad.size:
        raise RecordError(f"time is not finite at row {bad[0]}")
    falls = np.flatnonzero(np.diff(time) <= 0.0)
    if falls.size:
        before, row = time[falls[0]], falls[0] + 1
        raise RecordError(
            f"time must increase: row {row} has {time[row]:.6g} s after {before:.6g} s"
        )
    if not np.all(np.isfinite(values)):
        row, column = np.argwhere(~np.isfinite(values))[0]
        raise RecordError(f"channel {names[column]!r} is not finite at row {row}")


_KEYS = {"units": "unit", "kinds": "kind", "meanings": "meaning"}
"""Key of a DataFrame's `attrs` -> attribute of a channel."""


def _column_channel(
    name: str, given: str | None, stated: Mapping[str, Mapping[str, Any]]
) -> tuple[Channel, float]:
    """Return the channel of a column, and SI per unit of the column."""
    known = CHANNELS.get(name)
    if given is not None:
        unit = unit_of(given)
        if known is None:
            return Channel(name, unit.si, "OTHER"), unit.factor
        check_same(name, known.unit, given, unit.si)
        return known, unit.factor
    if all(name in stated.get(key, {}) for key in _KEYS):
        return Channel(name, *(stated[key][name] for key in _KEYS)), 1.0
    if known is None:
        raise InputError(
            f"column {name!r} has no unit, and no standard channel has its name: give it, such "
            f"as units={{{name!r}: 'rad/s'}}"
        )
    return known, 1.0


def _numbers(column: Any, name: str) -> NDArray[np.float64]:
    """Return a column or an index as numbers, (n_time,)."""
    kind = getattr(column, "dtype", np.dtype(object))
    if getattr(kind, "kind", "O") in "mM":
        raise RecordError(
            f"column {name!r} holds {kind}; a record's time is seconds: "
            "(index - index[0]).total_seconds()"
        )
    try:
        return np.asarray(column, dtype=np.float64)
    except (TypeError, ValueError):
        raise RecordError(f"column {name!r} holds {kind}, expected numbers") from None


def _package(name: str) -> Any:
    try:
        return import_module(name)
    except ImportError:
        raise InputError(
            f"to_{name} needs {name}, which isn't installed: pip install {name}"
        ) from None
