"""The flight record: what a flight computer writes and the identification reads."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from helisim.base.display import Displayed, shower
from helisim.base.errors import RecordError, UnknownNameError
from helisim.base.value import Value
from helisim.records.channels import Channel, some_names
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
        time = _read_only(self.time)
        values = _read_only(self.values)
        channels = tuple(self.channels)
        _check_shapes(time, values, channels)
        _check_numbers(time, values, channels)
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "channels", channels)
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
        """Sample interval, s.

        Raises:
            RecordError: the record is not uniformly sampled.
        """
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
        from helisim.records import frames

        return frames.to_pandas(self)

    def to_xarray(self) -> "xarray.Dataset":
        """Return a Dataset: a variable each channel over `time`, with `units` and `long_name`.

        Its `attrs` hold the `provenance` as JSON, so that it can be written as netCDF.

        Raises:
            InputError: xarray isn't installed.
        """
        from helisim.records import frames

        return frames.to_xarray(self)

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
        from helisim.records import frames

        return frames.from_pandas(frame, units=units, provenance=provenance)

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

        Returns:
            A matplotlib figure, which a notebook shows; nothing is kept of it.

        Raises:
            UnknownNameError: no such channel.
            InputError: there are more or fewer axes than panels.
        """
        return shower().plot_record(self, channels, axes)

    def _index(self, name: str) -> int:
        try:
            return self.names.index(name)
        except ValueError:
            raise UnknownNameError("channel", name, self.names) from None


def _read_only(array: ArrayLike) -> NDArray[np.float64]:
    copy = np.array(array, dtype=np.float64, order="C")
    copy.flags.writeable = False
    return copy


def _check_shapes(
    time: NDArray[np.float64], values: NDArray[np.float64], channels: tuple[Channel, ...]
) -> None:
    if time.ndim != 1 or time.size < 2:
        raise RecordError(f"time needs at least two samples in one dimension, got {time.shape}")
    expected = (time.size, len(channels))
    if values.shape != expected:
        raise RecordError(f"values have shape {values.shape}, expected {expected}")
    names = [channel.name for channel in channels]
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise RecordError(f"channel names must be unique, repeated: {', '.join(repeated)}")


def _check_numbers(
    time: NDArray[np.float64], values: NDArray[np.float64], channels: tuple[Channel, ...]
) -> None:
    if not np.all(np.isfinite(time)):
        row = int(np.flatnonzero(~np.isfinite(time))[0])
        raise RecordError(f"time is not finite at row {row}")
    if np.any(np.diff(time) <= 0.0):
        row = int(np.flatnonzero(np.diff(time) <= 0.0)[0]) + 1
        raise RecordError(
            f"time must increase: row {row} has {time[row]:.6g} s after {time[row - 1]:.6g} s"
        )
    if not np.all(np.isfinite(values)):
        row, column = (int(i) for i in np.argwhere(~np.isfinite(values))[0])
        raise RecordError(f"channel {channels[column].name!r} is not finite at row {row}")
