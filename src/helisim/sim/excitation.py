"""What is flown on purpose: the base of every manoeuvre, where it is added, and its numbers.

A manoeuvre of your own is a frozen dataclass with a method `wave`:

    @dataclass(frozen=True, kw_only=True)
    class Bump(Excitation):
        duration: float = 10.0
        amplitude: float = 0.05

        def wave(self, time):
            return self.amplitude * np.exp(-((time - 3.0) ** 2))

or `sticks`, which moves several axes. Its fields are its settings: in provenance, plan files and
on the command line. It is called once, with the times of all steps of a flight; no Python runs in
the steps.
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
from scipy.interpolate import CubicSpline

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.settings import check, is_number, setting, to_plain
from helisim.physics.layout import HISTORY, INJECTION, PARAM
from helisim.records.record import ATTITUDES, AXES, RATES
from helisim.vehicle import Vehicle

T = TypeVar("T")

_SERVOS = (*AXES, "front", "left", "right", "tail")
PLACES: dict[str, tuple[str, ...]] = {
    "sticks": AXES,
    "servos": _SERVOS,
    "actuators": _SERVOS,
    "sensors": (*RATES, *ATTITUDES),
}
"""Where a manoeuvre can be added, and the axes that there are."""
_ENOUGH = {"sticks": 4, "servos": 4, "actuators": 4, "sensors": 3}
"""How many columns are enough at each place, from its first: the others are then zero."""
_TRAVEL = (0.5, "1", "the travel of a servo")
_REACH = {
    **{(place, axis): _TRAVEL for place in ("servos", "actuators") for axis in _SERVOS},
    **{("sticks", axis): (0.5, "1", "the travel of a stick") for axis in AXES},
    **{("sensors", a): (35.0, "rad/s", "rad/s, the range of the gyro's sensors") for a in RATES},
    **{("sensors", axis): (math.pi, "rad", "rad, half a turn") for axis in ATTITUDES},
}
"""(place, axis) -> the greatest |value| that is added, its unit, and what ends there."""
_OWN_AXIS = {"p": "lat", "q": "lon", "r": "ped", "tail": "ped"}
_OWN_AXIS |= {"phi": "lat", "theta": "lon", "psi": "ped"}
"""Whose own band a vehicle has for what is no axis of a stick."""
_FIRST = {
    "sticks": INJECTION.stick_col,
    "servos": INJECTION.command_front,
    "actuators": INJECTION.actuator_front,
    "sensors": INJECTION.rate_p,
}
"""Where the numbers of a place begin."""

_LONGEST = 1e6  # s, of a flight: a longer one fits into no memory
_WAYS = ("wave", "sticks", "added", "_write_closed_form")

EXCITATIONS: dict[str, type["Excitation"]] = {}
"""Every kind of manoeuvre by its name; a subclass of `Excitation` joins on its definition."""


def limit(place: str, axis: str) -> float:
    """Return the greatest |value| that is added to an axis: unitised, rad/s or rad."""
    return _REACH[place, axis][0]


def unit(place: str, axis: str) -> str:
    """Return the unit of what is added to an axis; "1" is of what is unitised."""
    return _REACH[place, axis][1]


@dataclass(frozen=True, kw_only=True)
class Excitation:
    """What is flown on purpose, on top of holding the hover; subclass it to fly your own.

    Attributes:
        axis: what moves, and what records and responses are named after: of sticks "col", "lon",
            "lat" or "ped"; of servos and actuators these too, mixed, or one servo, "front",
            "left", "right" or "tail"; of sensors "p", "q", "r", "phi", "theta" or "psi". Kinds
            that move several take them joined, as "lat+ped".
        duration: s, of the whole flight.
        at: where it is added: to the pilot's "sticks"; to the commands that go to the "servos",
            behind the gyro; to what reaches the "actuators", behind what a recorder sees as
            command; or to what the controller's "sensors" read: rates, rad/s, or attitudes, rad.
            A disturbance of an attitude turns what is sensed: it is added to the angle, its
            derivative to the rate.

    Raises:
        InputError: on its definition, a class has the name of an excitation from elsewhere.
    """

    axis: str
    duration: float = setting(unit="s")
    at: str = setting("sticks", unsaid=True)

    left_open: ClassVar[tuple[str, ...]] = ()
    """Settings that may be None: the vehicle's own `sweep.<axis>_<setting>`."""
    kinds: ClassVar[Mapping[str, type["Excitation"]]] = EXCITATIONS
    several: ClassVar[bool] = True
    """Whether more than one axis can move."""
    written: ClassVar[bool] = True
    """Whether its settings are plain data, which a file can hold."""

    def __init_subclass__(cls, *, listed: bool = True) -> None:
        super().__init_subclass__()
        if cls.written and listed:
            register(cls, EXCITATIONS, "an excitation")

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes that `axis` joins, in its order."""
        return split_axes(self.axis)

    @property
    def places(self) -> tuple[str, ...]:
        """Where it adds something, of `PLACES`."""
        return (self.at,)

    @property
    def highest(self) -> float:
        """The highest frequency that it means to excite, rad/s; 0 where it doesn't say."""
        return float(max(getattr(self, "band", None) or (0.0,)))

    def on(self, own: Mapping[str, float]) -> Self:
        """Return it with what is left open filled in by a vehicle's own parameters.

        Raises:
            InputError: it is faster than the vehicle's gyro can tell.
        """
        open_ones = [name for name in self.left_open if getattr(self, name) is None]
        complete = replace(self, **{name: self._own(own, name) for name in open_ones})
        fastest = math.pi / own["gyro.period"]
        if complete.highest > fastest:
            raise InputError(
                f"{type(self).__name__} goes up to {complete.highest:g} rad/s, beyond half the "
                f"gyro's rate, {fastest:g} rad/s, which no tick can follow"
            )
        return complete

    def wave(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what is added to the one axis, (n_time,): unitised, of sensors rad/s or rad.

        The times, (n_time,) s from the start of the flight, are those of the simulation's steps.
        """
        raise NotImplementedError

    def sticks(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what is added to each axis of its place, (n_time, n_axis); by default `wave`.

        At the sticks these are COL, LON, LAT, PED, unitised, -0.5 to 0.5; elsewhere the axes of
        `PLACES`, of which of servos and actuators the first four are enough, of sensors the rates.
        The times, (n_time,) s from the start of the flight, are those of the simulation's steps.
        """
        return self.on_axis(self.wave(time))

    def added(self, time: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Return what is added at the times in s, (n_time,), by place: (n_time, n_axis).

        Raises InputError: `sticks` gives another shape, or a value that isn't finite or in range.
        """
        given, kind = np.asarray(self.sticks(time.copy())), type(self).__name__
        axes = PLACES[self.at]
        wanted, short = (time.size, len(axes)), (time.size, _ENOUGH[self.at])
        names = [one.upper() for one in axes] if self.at == "sticks" else axes
        if given.shape not in (wanted, short) or given.dtype.kind not in "fiub":
            raise InputError(
                f"{kind}.sticks must return an array of numbers of shape {wanted}, one row a time, "
                f"columns {', '.join(names)}; got shape {given.shape} of {given.dtype}"
            )
        columns = np.zeros(wanted)
        columns[:, : given.shape[1]] = given
        most = np.array([limit(self.at, axis) for axis in axes])
        bad = ~(np.abs(columns) <= most)
        if bad.any():
            row, column = np.argwhere(bad)[0]
            raise InputError(
                f"{getattr(self, 'source', '') or f'{kind}.sticks'} must stay between "
                f"{-most[column]:g} and {most[column]:g}, {_REACH[self.at, axes[column]][2]}; "
                f"{names[column]} is {columns[row, column]:g} at {time[row]:g} s"
            )
        return {self.at: columns}

    def on_axis(self, values: ArrayLike) -> NDArray[np.float64]:
        """Return columns, (n_time, n_axis), of which only `axis` moves, as values, (n_time,)."""
        wave = np.asarray(values, dtype=np.float64)
        columns = np.zeros((*wave.shape, len(PLACES[self.at])))
        columns[..., [PLACES[self.at].index(one) for one in self.axes]] = wave[..., None]
        return columns

    def check(self) -> None:
        """Raise InputError unless axis, place and duration can be."""
        check_axis(self)
        check_times(self.duration, 0.0)

    def write(self, par: NDArray[np.float64]) -> None:
        """Put it, complete, into a vehicle's parameters (n_param,) for the force laws."""
        if is_compiled(self):
            self._write_closed_form(par)
            return
        par[PARAM.excitation] = HISTORY
        par[PARAM.excitation_col : PARAM.excitation_ped + 1] = 0.0

    def _write_closed_form(self, par: NDArray[np.float64]) -> None:
        """Put a compiled formula in place of `wave` or `sticks`, at the sticks."""
        raise NotImplementedError

    def _own(self, own: Mapping[str, float], name: str) -> Any:
        """Return what a vehicle's own sweep has for a setting that is left open."""
        (axis,) = self.axes
        return own_setting(self, own, axis, name)


def register(cls: type, kinds: dict[str, Any], what: str) -> None:
    """Put a class among its kinds by its name, unless that begins with _.

    Raises InputError: another module has one of that name.
    """
    other = kinds.get(cls.__name__, cls)
    if other.__module__ != cls.__module__:
        raise InputError(
            f"there is {what} {cls.__name__!r} in {other.__module__} already: give yours another "
            "name, by which records and plans know it"
        )
    if not cls.__name__.startswith("_"):
        kinds[cls.__name__] = cls


def split_axes(axis: str) -> tuple[str, ...]:
    """Return the axes of a text such as "lat+ped"."""
    return tuple(one.strip() for one in axis.split("+"))


def own_setting(
    excitation: Excitation, own: Mapping[str, float], axis: str, name: str
) -> float | tuple[float, float]:
    """Return what a vehicle's own sweep of an axis has for an open setting. Raises InputError."""
    axis = _OWN_AXIS.get(axis, axis)
    if axis not in AXES or (name == "amplitude" and excitation.at != "sticks"):
        raise InputError(
            f"{type(excitation).__name__} needs its {name} at {excitation.at}: a vehicle's own is "
            "of its sticks"
        )
    if name == "band":
        return own[f"sweep.{axis}_w_min"], own[f"sweep.{axis}_w_max"]
    return own[f"sweep.{axis}_{name}"]


def _way(excitation: Excitation) -> frozenset[str]:
    """Return how the most derived class that says it says how it moves."""
    for cls in type(excitation).__mro__[: type(excitation).__mro__.index(Excitation)]:
        if found := frozenset(_WAYS) & vars(cls).keys():
            return found
    return frozenset()


def is_compiled(excitation: Excitation) -> bool:
    """Return whether an excitation is flown by a compiled formula, not by a history."""
    return excitation.at == "sticks" and "_write_closed_form" in _way(excitation)


def is_foreknown(excitation: Excitation) -> bool:
    """Return whether what it adds is known before a flight; a pilot's wobble is new in each."""
    return not is_compiled(excitation) or type(excitation).wave is not Excitation.wave


def check_excitation(excitation: Any) -> None:
    """Raise InputError unless something can be flown as an excitation."""
    kind = type(excitation).__name__
    if not isinstance(excitation, Excitation):
        raise InputError(
            f"a flight plan needs an excitation such as Sweep(axis='lat'), got {excitation!r:.80}"
        )
    for name in ("axis", "duration"):
        if not hasattr(excitation, name):
            raise InputError(f"{kind} has no {name}: an excitation needs an axis and a duration")
    excitation.check()
    if not _way(excitation):
        raise InputError(
            f"{kind} doesn't say how it moves: give it a method wave(self, time) that returns "
            "(n_time,) for the times, (n_time,), or sticks(self, time) that returns (n_time, 4)"
        )
    if excitation.written:
        check_plain(excitation)


def check_plain(value: Any) -> None:
    """Raise InputError unless a value object's settings can be written in a record."""
    check(value)
    try:
        hash(value)
        json.dumps(to_plain(value), allow_nan=False)
    except (TypeError, ValueError):
        raise InputError(
            f"the settings of {type(value).__name__} must be finite numbers, texts, or tuples of "
            f"them, so that a record can say what was flown; got {value!r:.200}"
        ) from None


def check_axis(excitation: Excitation) -> None:
    """Raise InputError unless an excitation's axes are those of a place."""
    kind, at, axis = type(excitation).__name__, excitation.at, excitation.axis
    if at not in PLACES:
        raise UnknownNameError("place for a manoeuvre", at, PLACES)
    if not isinstance(axis, str):
        raise InputError(f"the axis of {kind} must be text such as 'lat', got {axis!r}")
    axes = split_axes(axis)
    for one in axes:
        if one not in PLACES[at]:
            raise UnknownNameError("axis" if at == "sticks" else f"axis at {at}", one, PLACES[at])
    if len(set(axes)) < len(axes):
        raise InputError(f"{kind} has an axis twice: {axis}")
    if len(axes) > 1 and not excitation.several:
        raise InputError(f"a {kind} moves one axis, got {axis}: fly several together with Together")


def check_times(duration: Any, trim_time: Any, *, after: bool = True) -> None:
    """Raise InputError unless a duration, s, and the trimmed stretch before (and `after`) fit."""
    numbers = is_number(duration) and is_number(trim_time)
    if not (numbers and math.isfinite(duration + trim_time) and trim_time >= 0.0):
        raise InputError(
            "duration and trimmed stretch must be finite numbers of seconds, 0 or more, got "
            f"{duration!r}, {trim_time!r}"
        )
    if duration > _LONGEST:
        raise InputError(f"duration must be at most {_LONGEST:g} s, got {duration:g}")
    least = max(4.0 * trim_time, 1.0)
    if after and duration < least:
        why = " (four times the trimmed stretch)" if trim_time > 0.0 else ""
        raise InputError(f"duration must be at least {least:g} s{why}, got {duration:g}")
    if not after and not trim_time < duration:
        raise InputError(
            f"duration must be longer than the trimmed stretch of {trim_time:g} s, got {duration:g}"
        )


def complete(excitation: Excitation, value: T | None) -> T:
    """Return a setting that must not be left open any more. Raises InputError."""
    if value is None:
        raise InputError(
            f"an open {type(excitation).__name__} can't fly; complete it with "
            "on(vehicle.parameters)"
        )
    return value


def injection(excitation: Excitation, vehicle: Vehicle) -> NDArray[np.float64] | None:
    """Return what an excitation adds at each step of a flight, (n_step, n_injection), read-only.

    The columns are those of `INJECTION`. What servos, actuators and sensors get is held between
    the gyro's ticks, as the commands are. None: the force laws compute it themselves.

    Raises:
        InputError: the class returns something else than such values.
    """
    if is_compiled(excitation):
        return None
    mixing = tuple(tuple(map(float, vehicle.swashplate.mix(*unit))) for unit in np.eye(3))
    timestep = float(vehicle.model.opt.timestep)
    return _injection(excitation, timestep, vehicle.parameters["gyro.period"], mixing)


@lru_cache(maxsize=4)
def _injection(
    excitation: Excitation,
    timestep: float,
    period: float,
    mixing: tuple[tuple[float, ...], ...],
) -> NDArray[np.float64]:
    time = step_times(excitation.duration, timestep)
    each = max(1, round(period / timestep))
    ticks = np.arange(time.size) // each * each
    rows = np.zeros((time.size, len(INJECTION)))
    for place, columns in excitation.added(time).items():
        values = columns if place == "sticks" else columns[ticks]
        if place in ("servos", "actuators"):  # the four servos' own, and what is mixed for them
            mixed, values = values[:, : len(AXES)], values[:, len(AXES) :].copy()
            values[:, :3] += mixed[:, :3] @ np.array(mixing)
            values[:, 3] += mixed[:, 3]
        elif place == "sensors":
            values = _turned(values, time, each)
        rows[:, _FIRST[place] : _FIRST[place] + values.shape[1]] = values
        _check_total(excitation, place, values, time)
    rows.setflags(write=False)
    return rows


def _turned(
    columns: NDArray[np.float64], time: NDArray[np.float64], each: int
) -> NDArray[np.float64]:
    """Return what is added to rates and angles, (n_time, 6), an angle's own rate in the rates.

    That is the derivative of a cubic spline through the angle at the ticks: of an oscillation w
    sampled with period T it is off by (w T)^4 / 180, 1e-6 at 60 rad/s and 500 Hz.
    """
    angles = columns[::each, len(RATES) :]
    moved = angles.any(axis=0)
    if not moved.any() or len(angles) < 2:
        return columns
    rates, turned = np.zeros_like(angles), columns.copy()
    rates[:, moved] = CubicSpline(time[::each], angles[:, moved])(time[::each], 1)
    turned[:, : len(RATES)] += np.repeat(rates, each, axis=0)[: len(columns)]
    return turned


def _check_total(
    excitation: Excitation, place: str, values: NDArray[np.float64], time: NDArray[np.float64]
) -> None:
    """Refuse what several parts add up to beyond the range."""
    servos = place in ("servos", "actuators")
    axes = PLACES[place][len(AXES) :] if servos else PLACES[place]
    # of one servo twice its range: collective and cyclic both at their ends
    most = np.array([limit(place, axis) * (1.0 + servos) for axis in axes])
    bad = ~(np.abs(values) <= most)
    if bad.any():
        row, column = np.argwhere(bad)[0]
        turns = place == "sensors" and values[:, len(RATES) :].any()
        why = "; a disturbance of an attitude adds its own rate too" if turns else ""
        raise InputError(
            f"what {type(excitation).__name__} adds at {place} comes to "
            f"{values[row, column]:g} at {time[row]:g} s, beyond {most[column]:g}{why}"
        )


def step_times(duration: float, timestep: float) -> NDArray[np.float64]:
    """Return the times at which the steps of a flight begin, (n_step,) s.

    They are added up as MuJoCo does, so that they equal its own to the last bit.
    """
    steps = round(duration / timestep)
    return np.concatenate([[0.0], np.cumsum(np.full(steps, timestep))])


def injection_digest(excitation: Excitation, vehicle: Vehicle) -> str | None:
    """Return a digest of what an excitation adds; None where the force laws compute it.

    A record keeps a class's name and settings, not its code: this shows whether the code that
    is at hand still flies the same. Arguments and errors are those of `injection`.
    """
    rows = injection(excitation, vehicle)
    if rows is None:
        return None
    if excitation.places == ("sticks",):
        rows = rows[:, : len(PLACES["sticks"])]
    elif not rows[:, INJECTION.angle_phi :].any():
        rows = rows[:, : INJECTION.angle_phi]  # as it was before attitudes could be disturbed
    return hashlib.blake2b(rows.astype("<f8").tobytes(), digest_size=16).hexdigest()
