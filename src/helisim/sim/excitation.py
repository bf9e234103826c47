"""Manoeuvres: their base class, and the places where they are added.

One of your own is a frozen dataclass with a method `wave`, or `sticks` for several axes:

    @dataclass(frozen=True, kw_only=True)
    class Bump(Excitation):
        duration: float = 10.0
        amplitude: float = 0.05

        def wave(self, time):
            return self.amplitude * np.exp(-((time - 3.0) ** 2))
"""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from helisim.base.errors import InputError, check_known
from helisim.base.settings import check, setting, to_plain
from helisim.physics.layout import HISTORY, INJECTION
from helisim.records.record import ATTITUDES, AXES, RATES
from helisim.vehicle import Vehicle
from helisim.vehicle.addresses import write_named

T = TypeVar("T")

PLACES: dict[str, tuple[str, ...]] = {
    "sticks": AXES,
    "servos": AXES,
    "actuators": AXES,
    "sensors": (*RATES, *ATTITUDES),
}
_REACH = {
    **dict.fromkeys(AXES, (0.5, "1", "the travel of a stick or a servo")),
    **dict.fromkeys(RATES, (35.0, "rad/s", "rad/s, the range of the gyro's sensors")),
    **dict.fromkeys(ATTITUDES, (math.pi, "rad", "rad, half a turn")),
}  # axis -> the greatest |value| that is added, its unit, what ends there
_OWN_AXIS = {"p": "lat", "q": "lon", "r": "ped", "phi": "lat", "theta": "lon", "psi": "ped"}
_FIRST = {
    "sticks": INJECTION.stick_col,
    "servos": INJECTION.command_front,
    "actuators": INJECTION.actuator_front,
    "sensors": INJECTION.rate_p,
}

_LONGEST = 1e6  # s, of a flight: a longer one fits into no memory

EXCITATIONS: dict[str, type["Excitation"]] = {}


def limit(axis: str) -> float:
    """Return the greatest |value| that is added to an axis: unitised, rad/s or rad."""
    return _REACH[axis][0]


def unit(axis: str) -> str:
    """Return the unit of what is added to an axis; "1" is of what is unitised."""
    return _REACH[axis][1]


@dataclass(frozen=True, kw_only=True)
class Excitation:
    """Movement flown on top of holding the hover; subclass it to fly your own.

    `axis` is "col", "lon", "lat" or "ped"; of sensors "p", "q", "r", "phi", "theta" or "psi";
    several are joined, as "lat+ped". `duration` is of the whole flight, s. `at` is "sticks";
    "servos", their commands behind the gyro; "actuators", behind the recorded commands; or
    "sensors", which the controller reads: rates, rad/s, or attitudes, rad.
    """

    axis: str
    duration: float = setting(unit="s")
    at: str = setting("sticks", unsaid=True)

    left_open: ClassVar[tuple[str, ...]] = ()  # may be None: own `sweep.<axis>_<setting>`
    kinds: ClassVar[Mapping[str, type["Excitation"]]] = EXCITATIONS
    several: ClassVar[bool] = True

    def __init_subclass__(cls, *, listed: bool = True) -> None:
        super().__init_subclass__()
        if listed:
            register(cls, EXCITATIONS, "an excitation")

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes that `axis` joins, in its order."""
        return tuple(one.strip() for one in self.axis.split("+"))

    @property
    def places(self) -> tuple[str, ...]:
        """Where it adds something, of `PLACES`."""
        return (self.at,)

    @property
    def highest(self) -> float:
        """The highest frequency that it means to excite, rad/s; 0 where it doesn't say."""
        return float(max(getattr(self, "band", None) or (0.0,)))

    def on(self, own: Mapping[str, float]) -> Self:
        """Return it with what is open filled in by a vehicle's own. Raises InputError: too fast."""
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
        """Return what is added to the axis at (n_time,) s, (n_time,): unitised, rad/s or rad.

        Overridden, unless `sticks` is; `check_excitation` says so.
        """
        raise NotImplementedError  # one of the two is enough, so neither is abstract

    def sticks(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what is added to each axis of its place, (n_time, n_axis), at (n_time,) s."""
        return self.on_axis(self.wave(time))

    def added(self, time: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Return what is added at (n_time,) s by place: (n_time, n_axis). Raises InputError."""
        given, kind = np.asarray(self.sticks(time.copy())), type(self).__name__
        axes = PLACES[self.at]
        names = [one.upper() for one in axes] if self.at == "sticks" else axes
        wanted = (time.size, len(axes))
        if given.shape != wanted or given.dtype.kind not in "fiub":
            raise InputError(
                f"{kind}.sticks must return an array of numbers of shape {wanted}, one row a time, "
                f"columns {', '.join(names)}; got shape {given.shape} of {given.dtype}"
            )
        columns, most = np.array(given, dtype=np.float64), np.array([*map(limit, axes)])
        for row, column in np.argwhere(~(np.abs(columns) <= most)):
            raise InputError(
                f"{getattr(self, 'source', '') or f'{kind}.sticks'} must stay between "
                f"{-most[column]:g} and {most[column]:g}, {_REACH[axes[column]][2]}; "
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
        check(self)
        check_axis(self)
        check_times(self.duration, 0.0)

    def write(self, par: NDArray[np.float64]) -> None:
        """Put it, complete, into a vehicle's parameters (n_param,) for the force laws."""
        if is_compiled(self):
            self._write_closed_form(par)
        else:
            write_named(par, excitation=HISTORY, excitation_col=np.zeros(len(AXES)))

    def _write_closed_form(self, par: NDArray[np.float64]) -> None:
        """Overridden where the force laws fly a formula, see `is_compiled`."""
        raise NotImplementedError  # histories have none

    def _own(self, own: Mapping[str, float], name: str) -> Any:
        (axis,) = self.axes
        return own_setting(self, own, axis, name)


def register(cls: type, kinds: dict[str, Any], what: str) -> None:
    """Put a class among its kinds by its name, unless that begins with _. Raises InputError."""
    other = kinds.get(cls.__name__, cls)
    if other.__module__ != cls.__module__:
        raise InputError(
            f"there is {what} {cls.__name__!r} in {other.__module__} already: give yours another "
            "name, by which records and plans know it"
        )
    if not cls.__name__.startswith("_"):
        kinds[cls.__name__] = cls


def own_setting(
    excitation: Excitation, own: Mapping[str, float], axis: str, name: str
) -> float | tuple[float, float]:
    """Return what a vehicle's own sweep of an axis has for an open setting. Raises InputError."""
    if name == "amplitude" and excitation.at != "sticks":
        raise InputError(
            f"{type(excitation).__name__} needs its {name} at {excitation.at}: a vehicle's own is "
            "of its sticks"
        )
    section = f"sweep.{_OWN_AXIS.get(axis, axis)}"
    low, high = f"{section}_w_min", f"{section}_w_max"
    return (own[low], own[high]) if name == "band" else own[f"{section}_{name}"]


def is_compiled(excitation: Excitation) -> bool:
    """Return whether a compiled formula flies an excitation, not a history."""
    return excitation.at == "sticks" and "_write_closed_form" in vars(type(excitation))


def check_excitation(excitation: Any) -> None:
    """Raise InputError unless something can be flown as an excitation."""
    kind = type(excitation)
    if not isinstance(excitation, Excitation):
        raise InputError(
            f"a flight plan needs an excitation such as Sweep(axis='lat'), got {excitation!r:.80}"
        )
    excitation.check()
    if not is_compiled(excitation) and all(
        getattr(kind, name) is getattr(Excitation, name) for name in ("wave", "sticks", "added")
    ):
        raise InputError(
            f"{kind.__name__} doesn't say how it moves: give it a method wave(self, time) that "
            "returns (n_time,) for the times, (n_time,), or sticks(self, time) that returns "
            "(n_time, 4)"
        )
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
    check_known("place for a manoeuvre", [at], PLACES)
    axes = tuple(one.strip() for one in axis.split("+"))
    check_known("axis" if at == "sticks" else f"axis at {at}", axes, PLACES[at])
    if len(set(axes)) < len(axes):
        raise InputError(f"{kind} has an axis twice: {axis}")
    if len(axes) > 1 and not excitation.several:
        raise InputError(f"a {kind} moves one axis, got {axis}: fly several together with Together")


def check_times(duration: float, trim_time: float, *, after: bool = True) -> None:
    """Raise InputError unless a duration, s, and the trimmed stretch before (and `after`) fit."""
    if not (trim_time >= 0.0 and duration + trim_time <= _LONGEST):
        raise InputError(
            f"duration and trimmed stretch must be 0 to {_LONGEST:g} s, got {duration:g}, "
            f"{trim_time:g}"
        )
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
    """Return the `INJECTION` at each step, (n_step, n_injection). Raises InputError.

    None: the force laws compute it. All but the sticks' is held between the gyro's ticks.
    """
    if is_compiled(excitation):
        return None
    timestep = float(vehicle.model.opt.timestep)
    time = step_times(excitation.duration, timestep)
    each = max(1, round(vehicle.parameters["gyro.period"] / timestep))
    ticks = np.arange(time.size) // each * each
    mixing = np.array([vehicle.swashplate.mix(*unit) for unit in np.eye(3)], dtype=np.float64)
    rows = np.zeros((time.size, len(INJECTION)))
    for place, columns in excitation.added(time).items():
        values, most = columns if place == "sticks" else columns[ticks], [*map(limit, AXES)]
        if place in ("servos", "actuators"):  # collective and cyclic both at their ends: twice
            values[:, :3] = values[:, :3] @ mixing
            values, most = values + 0.0, [2.0 * one for one in most]  # no -0.0
        elif place == "sensors":
            values, most = _turned(values, time, each), [*map(limit, PLACES[place])]
        rows[:, _FIRST[place] : _FIRST[place] + values.shape[1]] = values
        for row, column in np.argwhere(~(np.abs(values) <= most)):
            raise InputError(
                f"what {type(excitation).__name__} adds at {place} comes to "
                f"{values[row, column]:g} at {time[row]:g} s, beyond {most[column]:g}, the rate of "
                "an attitude's disturbance included"
            )
    return rows


def _turned(
    columns: NDArray[np.float64], time: NDArray[np.float64], each: int
) -> NDArray[np.float64]:
    angles = columns[::each, len(RATES) :]
    moved = angles.any(axis=0)
    if not moved.any() or len(angles) < 2:
        return columns
    rates, turned = np.zeros_like(angles), columns.copy()
    rates[:, moved] = CubicSpline(time[::each], angles[:, moved])(time[::each], 1)
    turned[:, : len(RATES)] += np.repeat(rates, each, axis=0)[: len(columns)]
    return turned


def step_times(duration: float, timestep: float) -> NDArray[np.float64]:
    """Return the times at which the steps of a flight begin, (n_step,) s, to MuJoCo's last bit."""
    return np.concatenate([[0.0], np.cumsum(np.full(round(duration / timestep), timestep))])


def injection_digest(excitation: Excitation, vehicle: Vehicle) -> str | None:
    """Return a digest of `injection`, to detect changed code; None if the force laws compute it."""
    rows = injection(excitation, vehicle)
    raw = b"" if rows is None else rows.astype("<f8").tobytes()
    return None if rows is None else hashlib.blake2b(raw, digest_size=16).hexdigest()
