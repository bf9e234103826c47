"""Flight records and their channels, with units; body axes FRD, earth axes NED."""

import hashlib
import json
import platform
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache, cached_property
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from helisim.base.display import Displayed, shower
from helisim.base.errors import InputError, RecordError, check_known, item_of
from helisim.base.settings import FrozenMap, Value

if TYPE_CHECKING:
    import pandas

    from helisim.base.display import Figure


Kind = Literal["IN1", "IN2", "OUT", "SERVO", "OTHER"]


@dataclass(frozen=True)
class Channel:
    """One column of a record, its unit SI."""

    name: str
    unit: str
    kind: Kind
    meaning: str = ""


IN1 = ("col", "lon", "lat", "ped")
IN2 = ("COL", "LON", "LAT", "PED")
STICKS: dict[str, str] = dict(zip(IN1, IN2))
SERVOS = ("servo_front", "servo_left", "servo_right", "servo_tail")
RATES = ("p", "q", "r")
ATTITUDES = ("phi", "theta", "psi")
VELOCITIES = ("u", "v", "w")
ACCELERATIONS = ("ax", "ay", "az")
POSITIONS = ("north", "east", "down")
ROTOR_SPEED = ("rotor_speed",)
"""Measured where a motor turns the rotor; there is none under an ideal governor, which keeps it."""
BATTERY = ("voltage", "current", "charge", "temperature")
"""Measured where a battery feeds the motor."""
LOAD = ("load_x", "load_y", "load_z")
"""Measured where a load hangs on the vehicle."""
CONTACT = ("contact",)
ROTOR = ("a", "b", "thrust", "torque", "tail_thrust")
AIR = ("air_u", "air_v", "air_w", "air_p", "air_q", "air_r")
SERVO_POSITIONS = tuple(f"{servo}_position" for servo in SERVOS)
"""What only a simulation knows; a recorder writes it on request, and no fit may use it."""
IN1_ADDED, IN1_GYRO, IN1_DISTURBANCE, IN1_SUM = (
    tuple(f"{name}_{what}" for name in IN1) for what in ("added", "gyro", "disturbance", "sum")
)
"""At the servo commands: what a manoeuvre adds, and the gyro's own; the command is their sum. At
the actuators: what a manoeuvre adds to the command, and what reaches the servos."""
RATE_DISTURBANCE, RATE_SUM, ATTITUDE_DISTURBANCE, ATTITUDE_SUM = (
    tuple(f"{name}_{what}" for name in names)
    for names in (RATES, ATTITUDES)
    for what in ("disturbance", "sum")
)
"""At the gyro's sensors: what a manoeuvre adds to the rate, and what the gyro reads. Likewise of
the attitude that a controller sees; a manoeuvre that turns it turns the rate too."""
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
    Channel("voltage", "V", "OTHER", "voltage at the battery's poles"),
    Channel("current", "A", "OTHER", "current of the battery"),
    Channel("charge", "1", "OTHER", "share of the battery's capacity that is left"),
    Channel("temperature", "K", "OTHER", "temperature of the battery"),
    Channel("load_x", "m", "OTHER", "place of a slung load ahead of its hook, body axes"),
    Channel("load_y", "m", "OTHER", "place of a slung load right of its hook, body axes"),
    Channel("load_z", "m", "OTHER", "place of a slung load below its hook, body axes"),
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
    return item_of(CHANNELS, name, "channel")


def some_names(names: Iterable[str]) -> str:
    """Return names in one line, of many only the first."""
    known = list(names)
    return ", ".join(known if len(known) <= _NAMED else [*known[:_NAMED], "..."])


_PROGRAMS = ("helisim", "mujoco", "numpy", "scipy", "numba", "control", "pyarrow")


def made_by(what: str, **facts: Any) -> dict[str, Any]:
    """Return the provenance of what a part of helisim, such as "simulation", made of the facts."""
    known = versions()
    return {"made_by": f"helisim {known['helisim']}, {what}", "versions": known, **facts}


def versions() -> dict[str, str]:
    """Return the versions of all that numbers depend on, Python and the machine's kind too."""
    return dict(_versions())


@cache
def _versions() -> Mapping[str, str]:
    found = {
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}".strip(),
    }
    for program in _PROGRAMS:
        try:
            found[program] = version(program)
        except PackageNotFoundError:  # identification alone needs no simulator
            found[program] = "none"
    return found


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Limit linear algebra to one thread: the same bits on any processor count.

    The limit is the process's: with several Python threads at once last digits may still move.
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
    """Return provenance as JSON would give it back: tuples become lists. Raises RecordError."""
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
"""Relative difference of a time step from the mean that still counts as uniform."""


@dataclass(frozen=True, eq=False)
class FlightRecord(Value, Displayed):
    """Time histories of named channels, with units and provenance. Read-only.

    Attributes:
        time: (n_time,) s, finite and strictly increasing.
        values: (n_time, n_channel) in the units of `channels`, finite.
        provenance: who flew what, with which seed and versions; JSON-like.
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

    def __contains__(self, name: str) -> bool:
        return name in self.names

    def __len__(self) -> int:
        return self.time.size

    def __repr__(self) -> str:
        return (
            f"FlightRecord({len(self)} samples, {self.duration:.2f} s, "
            f"{len(self.names)} channels: {some_names(self.names)})"
        )

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The channel names, in column order."""
        return tuple(channel.name for channel in self.channels)

    @cached_property
    def digest(self) -> str:
        """A short digest of time and values."""
        digest = hashlib.blake2b(self.time.tobytes(), digest_size=12)
        digest.update(self.values.tobytes())
        return digest.hexdigest()

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
        """Why and when the flight was terminated early, "" if it wasn't."""
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
        """Return a DataFrame indexed by time, s; its `attrs` hold `units` and `provenance`.

        Raises InputError unless pandas is installed.
        """
        try:
            pandas = import_module("pandas")
        except ImportError:
            raise InputError("to_pandas needs pandas: pip install pandas") from None
        time = pandas.Index(np.array(self.time), name="time")
        frame = pandas.DataFrame(np.array(self.values), index=time, columns=list(self.names))
        frame.attrs["units"] = {one.name: one.unit for one in self.channels}
        frame.attrs["provenance"] = dict(self.provenance)
        return frame

    def plot(self, channels: "Sequence[str] | str | None" = None) -> "Figure":
        """Draw inputs and motion, or the channels named; degrees. Raises UnknownNameError."""
        return shower().plot_record(self, channels)

    def _index(self, name: str) -> int:
        check_known("channel", [name], self.names)
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
    rises = np.isfinite(time) & (np.diff(time, prepend=-np.inf) > 0.0)
    if not rises.all():
        row = int(np.argmin(rises))
        before = f" after {time[row - 1]:.6g} s" if row else ""
        raise RecordError(
            f"time must be finite and increase: row {row} has {time[row]:.6g} s{before}"
        )
    if not np.all(np.isfinite(values)):
        row, column = np.argwhere(~np.isfinite(values))[0]
        raise RecordError(f"channel {names[column]!r} is not finite at row {row}")
