"""The flight record, and the one list of channels that it can carry, with units and meaning.

Body axes are forward-right-down and the earth frame is north-east-down.
"""

import json
import platform
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from helisim.base.display import Displayed, shower
from helisim.base.errors import InputError, RecordError, UnknownNameError
from helisim.base.settings import FrozenMap, Value
from helisim.base.units import CONTROL, Powers, UserUnits, check_same, parts
from helisim.base.units import unit as unit_of

if TYPE_CHECKING:
    import pandas
    import xarray

    from helisim.base.display import Axes, Figure


Kind = Literal["IN1", "IN2", "OUT", "SERVO", "OTHER"]


@dataclass(frozen=True)
class Channel:
    """One column of a record: its name, its unit (SI), its kind and its meaning."""

    name: str
    unit: str
    kind: Kind
    meaning: str = ""


IN1 = ("col", "lon", "lat", "ped")
IN2 = ("COL", "LON", "LAT", "PED")
SERVOS = ("servo_front", "servo_left", "servo_right", "servo_tail")
RATES = ("p", "q", "r")
ATTITUDES = ("phi", "theta", "psi")
VELOCITIES = ("u", "v", "w")
ACCELERATIONS = ("ax", "ay", "az")
POSITIONS = ("north", "east", "down")
ROTOR_SPEED = ("rotor_speed",)
"""Measured where a motor turns the rotor; there is none under an ideal governor, which keeps it."""
CONTACT = ("contact",)
ROTOR = ("a", "b", "thrust", "torque", "tail_thrust")
AIR = ("air_u", "air_v", "air_w", "air_p", "air_q", "air_r")
SERVO_POSITIONS = tuple(f"{servo}_position" for servo in SERVOS)
"""What only a simulation knows; a recorder writes it on request, and no fit may use it."""
IN1_ADDED = tuple(f"{name}_added" for name in IN1)
IN1_GYRO = tuple(f"{name}_gyro" for name in IN1)
"""At the servo commands: what a manoeuvre adds, and the gyro's own. The command is their sum."""
IN1_DISTURBANCE = tuple(f"{name}_disturbance" for name in IN1)
IN1_SUM = tuple(f"{name}_sum" for name in IN1)
"""At the actuators: what a manoeuvre adds to the command, and what reaches the servos."""
RATE_DISTURBANCE = tuple(f"{name}_disturbance" for name in RATES)
RATE_SUM = tuple(f"{name}_sum" for name in RATES)
"""At the gyro's sensors: what a manoeuvre adds to the rate, and what the gyro reads."""
ATTITUDE_DISTURBANCE = tuple(f"{name}_disturbance" for name in ATTITUDES)
ATTITUDE_SUM = tuple(f"{name}_sum" for name in ATTITUDES)
"""Likewise of the attitude that a controller sees; a manoeuvre that turns it turns the rate too."""
OUT = RATES + ATTITUDES + VELOCITIES + ACCELERATIONS + POSITIONS

AXES = IN1
"""Control axes, in the order of IN1: collective, longitudinal, lateral, pedal."""
_STANDARD = (
    Channel("col", "1", "IN1", "collective at the swashplate"),
    Channel("lon", "1", "IN1", "longitudinal cyclic at the swashplate, positive nose up"),
    Channel("lat", "1", "IN1", "lateral cyclic at the swashplate, positive right"),
    Channel("ped", "1", "IN1", "tail rotor collective, positive nose right"),
    Channel("COL", "1", "IN2", "collective stick"),
    Channel("LON", "1", "IN2", "longitudinal stick, positive nose up"),
    Channel("LAT", "1", "IN2", "lateral stick, positive right"),
    Channel("PED", "1", "IN2", "pedal stick, positive nose right"),
    Channel("servo_front", "1", "SERVO", "command to the front swashplate servo"),
    Channel("servo_left", "1", "SERVO", "command to the left swashplate servo"),
    Channel("servo_right", "1", "SERVO", "command to the right swashplate servo"),
    Channel("servo_tail", "1", "SERVO", "command to the tail servo"),
    Channel("p", "rad/s", "OUT", "roll rate"),
    Channel("q", "rad/s", "OUT", "pitch rate"),
    Channel("r", "rad/s", "OUT", "yaw rate"),
    Channel("phi", "rad", "OUT", "roll angle"),
    Channel("theta", "rad", "OUT", "pitch angle"),
    Channel("psi", "rad", "OUT", "yaw angle, unwrapped"),
    Channel("u", "m/s", "OUT", "forward velocity at the centre of gravity"),
    Channel("v", "m/s", "OUT", "right velocity at the centre of gravity"),
    Channel("w", "m/s", "OUT", "down velocity at the centre of gravity"),
    Channel("ax", "m/s^2", "OUT", "forward specific force at the centre of gravity"),
    Channel("ay", "m/s^2", "OUT", "right specific force at the centre of gravity"),
    Channel("az", "m/s^2", "OUT", "down specific force at the centre of gravity"),
    Channel("north", "m", "OUT", "position north of the start"),
    Channel("east", "m", "OUT", "position east of the start"),
    Channel("down", "m", "OUT", "position below the start"),
    Channel("rotor_speed", "rad/s", "OTHER", "speed of the main rotor, where a motor turns it"),
    Channel("a", "rad", "OTHER", "true rearward tilt of the tip-path plane"),
    Channel("b", "rad", "OTHER", "true rightward tilt of the tip-path plane"),
    Channel("thrust", "N", "OTHER", "true main rotor thrust"),
    Channel("torque", "N m", "OTHER", "true main rotor torque"),
    Channel("tail_thrust", "N", "OTHER", "true tail rotor thrust, against the main torque"),
    Channel("air_u", "m/s", "OTHER", "true forward velocity of the air itself, wind and gusts"),
    Channel("air_v", "m/s", "OTHER", "true right velocity of the air itself"),
    Channel("air_w", "m/s", "OTHER", "true down velocity of the air itself"),
    Channel("air_p", "rad/s", "OTHER", "true roll rate of the air itself, from its gradients"),
    Channel("air_q", "rad/s", "OTHER", "true pitch rate of the air itself"),
    Channel("air_r", "rad/s", "OTHER", "true yaw rate of the air itself"),
    Channel("contact", "N", "OTHER", "true force upwards of the ground on the landing gear"),
    *(
        Channel(f"{name}_{suffix}", unit, "OTHER", meaning.format(name))
        for names, suffix, unit, meaning in (
            (SERVOS, "position", "1", "true position of {}"),
            (IN1, "added", "1", "what a manoeuvre adds to {}"),
            (IN1, "gyro", "1", "{} as the gyro gives it, before what is added"),
            (IN1, "disturbance", "1", "what is added to {} at the actuators"),
            (IN1, "sum", "1", "{} as it reaches the actuators, disturbed"),
            (RATES, "disturbance", "rad/s", "what is added to {} at the gyro"),
            (RATES, "sum", "rad/s", "{} as the gyro reads it, disturbed"),
            (ATTITUDES, "disturbance", "rad", "what is added to the {} that is sensed"),
            (ATTITUDES, "sum", "rad", "{} as a controller sees it, disturbed"),
        )
        for name in names
    ),
)

CHANNELS: dict[str, Channel] = {channel.name: channel for channel in _STANDARD}
"""Every standard channel by name. IN1 (col) and IN2 (COL) differ by case."""
_NAMED = 30  # channels that a `repr` names, at most


def channel(name: str) -> Channel:
    """Return the standard channel of that name. Raises UnknownNameError."""
    if name not in CHANNELS:
        raise UnknownNameError("channel", name, CHANNELS)
    return CHANNELS[name]


def some_names(names: Iterable[str]) -> str:
    """Return names in one line, of many only the first."""
    known = list(names)
    return ", ".join(known if len(known) <= _NAMED else [*known[:_NAMED], "..."])


def signal_powers(name: str, unit: str, *, is_input: bool) -> Powers | None:
    """Return the powers of a channel's unit; None where it isn't known.

    Args:
        name: of the channel; a standard one's unit is known.
        unit: as recorded, "" where it isn't known.
        is_input: a unit of "1" counts a control's range, as it does of standard controls.
    """
    standard = CHANNELS.get(name)
    powers = parts(unit or (standard.unit if standard else ""))
    control = is_input or (standard is not None and standard.kind in ("IN1", "IN2", "SERVO"))
    return {CONTROL: 1} if powers == {} and control else powers


def signal_in(units: UserUnits, name: str, unit: str, *, is_input: bool) -> tuple[str, float]:
    """Return how a channel's unit is written in the given units, and how many are one in SI.

    Args:
        units: to show it in.
        name: of the channel.
        unit: SI; it stays where its powers aren't known.
        is_input: as for `signal_powers`.
    """
    powers = signal_powers(name, unit, is_input=is_input)
    return units.shown(powers) if powers else (unit, 1.0)


_PROGRAMS = ("helisim", "mujoco", "numpy", "scipy", "numba", "control", "pyarrow")


def made_by(what: str, **facts: Any) -> dict[str, Any]:
    """Return the provenance of something that helisim made: by what, with which versions.

    Args:
        what: the part of helisim, such as "simulation".
        facts: plain data that the result depends on: configuration, seed, model.
    """
    known = versions()
    return {"made_by": f"helisim {known['helisim']}, {what}", "versions": known, **facts}


def versions() -> dict[str, str]:
    """Return the versions of all that numbers depend on, Python and the machine's kind too."""
    return dict(_versions())


@cache
def _versions() -> Mapping[str, str]:
    kind = f"{platform.system()} {platform.machine()}".strip()
    found = {"python": platform.python_version(), "machine": kind}
    for program in _PROGRAMS:
        try:
            found[program] = version(program)
        except PackageNotFoundError:  # identification alone needs no simulator
            found[program] = "none"
    return found


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Limit linear algebra to one thread within the block: the same bits on any processor count.

    BLAS adds up in another order when it works in several threads. Their number is the process's,
    and threadpoolctl leaves it to the first Python thread that sets it: where several Python
    threads identify at once, last digits may still move.
    """
    with _blas().limit(limits=1, user_api="blas"):
        yield


@cache
def _blas() -> Any:
    import scipy.linalg  # noqa: F401, which brings a BLAS of its own, to be limited too
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


class Plain(FrozenMap[str, Any]):
    """Provenance that is known to be plain data: records that have it in common share it."""

    __slots__ = ()

    def extended(self, **facts: Any) -> "Plain":
        """Return it with further facts, the known ones shared. Raises RecordError."""
        return Plain({**self, **plain(facts)})


def plain(provenance: Mapping[str, Any]) -> Plain:
    """Return provenance as JSON would give it back: tuples become lists.

    Raises:
        RecordError: it isn't plain JSON data.
    """
    if isinstance(provenance, Plain):
        return provenance
    try:
        return Plain(json.loads(json.dumps(dict(provenance), allow_nan=False)))
    except (TypeError, ValueError) as error:
        raise RecordError(f"provenance must be plain JSON data: {error}") from None


def one_line(data: Mapping[str, Any]) -> str:
    """Return JSON that is the same for equal data, whatever the order of the keys."""
    return json.dumps(data, sort_keys=True, ensure_ascii=False, allow_nan=False)


def difference(found: Any, expected: Any, name: str = "") -> str:
    """Return the first difference between two pieces of plain data in words, "" if none."""
    if isinstance(found, Mapping) and isinstance(expected, Mapping):
        for key in (*expected, *(key for key in found if key not in expected)):
            inner = f"{name}.{key}" if name else str(key)
            change = difference(found.get(key), expected.get(key), inner)
            if change:
                return change
        return ""
    return "" if found == expected else f"{name} is {found!r} there and {expected!r} here"


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
