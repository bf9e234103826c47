"""What is flown on purpose: the base of every manoeuvre, shipped or your own.

A manoeuvre of your own is a frozen dataclass with a method `wave`:

    @dataclass(frozen=True, kw_only=True)
    class Bump(Excitation):
        duration: float = 10.0
        amplitude: float = 0.05

        def wave(self, time):
            return self.amplitude * np.exp(-((time - 3.0) ** 2))

or `sticks`, which moves several axes. Its fields are its settings: in provenance, plan files and
on the command line. It is asked once, for the times of all steps of a flight; no Python runs in
the steps.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from helisim.base.errors import InputError, UnknownNameError
from helisim.physics.layout import HISTORY, PARAM
from helisim.records.channels import AXES
from helisim.sim.places import ENOUGH, PLACES, limit, reach, unit
from helisim.sim.plain import UNSAID, is_number, settle, to_plain

Setting = TypeVar("Setting")

_OWN_AXIS = {"p": "lat", "q": "lon", "r": "ped", "tail": "ped"}
_OWN_AXIS |= {"phi": "lat", "theta": "lon", "psi": "ped"}
"""Whose own band a vehicle has for what is no axis of a stick."""

EXCITATIONS: dict[str, type["Excitation"]] = {}
"""Every kind of manoeuvre by its name; a subclass of `Excitation` joins on its definition."""


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
    duration: float
    at: str = field(default="sticks", metadata=UNSAID)

    left_open: ClassVar[tuple[str, ...]] = ()
    """Settings that may be None: the vehicle's own `sweep.<axis>_<setting>`."""
    kinds: ClassVar[Mapping[str, type["Excitation"]]] = EXCITATIONS
    several: ClassVar[bool] = True
    """Whether more than one axis can move."""
    written: ClassVar[bool] = True
    """Whether its settings are plain data, which a file can hold."""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if cls.__name__.startswith("_") or not cls.written:
            return
        other = EXCITATIONS.get(cls.__name__, cls)
        if other.__module__ != cls.__module__:
            raise InputError(
                f"there is an excitation {cls.__name__!r} in {other.__module__} already: give "
                "yours another name, by which records and plans know it"
            )
        EXCITATIONS[cls.__name__] = cls

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
        band = getattr(self, "band", None)
        return float(max(band)) if band else 0.0

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

        Args:
            time: (n_time,) s from the start of the flight, one for each step of the simulation.
        """
        raise NotImplementedError

    def sticks(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what is added to each axis of its place, (n_time, n_axis); by default `wave`.

        At the sticks these are COL, LON, LAT, PED, unitised, each between -0.5 and 0.5, the
        whole travel. Elsewhere they are those of `PLACES`; of servos and actuators the first
        four are enough, of sensors the three rates.

        Args:
            time: (n_time,) s from the start of the flight, one for each step of the simulation.
        """
        return self.on_axis(self.wave(time))

    def added(self, time: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Return what is added at the times in s, (n_time,), by place: (n_time, n_axis).

        The columns are the axes of `PLACES`.
        """
        return {self.at: checked(self, self.sticks(time.copy()), time)}

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

    def _own(self, own: Mapping[str, float], setting: str) -> Any:
        """Return what a vehicle's own sweep has for a setting that is left open."""
        (axis,) = self.axes
        return own_setting(self, own, axis, setting)


def split_axes(axis: str) -> tuple[str, ...]:
    """Return the axes of a text such as "lat+ped"."""
    return tuple(one.strip() for one in axis.split("+"))


def own_setting(
    excitation: Excitation, own: Mapping[str, float], axis: str, setting: str
) -> float | tuple[float, float]:
    """Return what a vehicle's own sweep of an axis has for a setting that is left open.

    Raises:
        InputError: it has none there.
    """
    kind, axis = type(excitation).__name__, _OWN_AXIS.get(axis, axis)
    if axis not in AXES or (setting == "amplitude" and excitation.at != "sticks"):
        raise InputError(
            f"{kind} needs its {setting} at {excitation.at}: a vehicle's own is of its sticks"
        )
    if setting == "band":
        return own[f"sweep.{axis}_w_min"], own[f"sweep.{axis}_w_max"]
    return own[f"sweep.{axis}_{setting}"]


_WAYS = ("wave", "sticks", "added", "_write_closed_form")


def _way(excitation: Excitation) -> frozenset[str]:
    """Return how the most derived class that says it says how it moves."""
    for cls in type(excitation).__mro__:
        found = frozenset(name for name in _WAYS if name in vars(cls))
        if cls is Excitation or found:
            return frozenset() if cls is Excitation else found
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
            f"a flight plan needs an excitation such as Sweep(axis='lat'), got {excitation!r}"
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
    if not excitation.written:
        return
    try:
        hash(excitation)
        json.dumps(to_plain(excitation), allow_nan=False)
    except (TypeError, ValueError):
        raise InputError(
            f"the settings of {kind} must be finite numbers, texts, or tuples of them, so that a "
            f"record can say what was flown; got {to_plain(excitation)}"
        ) from None


def check_settings(excitation: Excitation) -> None:
    """Raise InputError unless each setting is of its type, and the axes are those of the place.

    Numbers and arrays of NumPy become Python's own, which a record can hold.
    """
    settle(excitation)
    check_axis(excitation)


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
    """Raise InputError unless a duration and the trimmed stretch in it can be.

    Args:
        duration: s.
        trim_time: s, before the manoeuvre.
        after: whether as long a stretch has to be trimmed behind it too.
    """
    numbers = is_number(duration) and is_number(trim_time)
    if not (numbers and math.isfinite(duration + trim_time) and trim_time >= 0.0):
        raise InputError(
            "duration and trimmed stretch must be finite numbers of seconds, 0 or more, got "
            f"{duration!r}, {trim_time!r}"
        )
    least = max(4.0 * trim_time, 1.0)
    if after and duration < least:
        why = " (four times the trimmed stretch)" if trim_time > 0.0 else ""
        raise InputError(f"duration must be at least {least:g} s{why}, got {duration:g}")
    if not after and not trim_time < duration:
        raise InputError(
            f"duration must be longer than the trimmed stretch of {trim_time:g} s, got {duration:g}"
        )


def check_amplitude(excitation: Excitation, *, signed: bool = False) -> None:
    """Raise InputError unless an excitation's amplitude, or each of several, can be."""
    amplitude, at = getattr(excitation, "amplitude", None), excitation.at
    if amplitude is None:
        return
    axes = excitation.axes
    given = amplitude if isinstance(amplitude, tuple) else (amplitude,) * len(axes)
    for one, axis in zip(given, axes if len(given) == len(axes) else axes * len(given)):
        size, most = abs(one) if signed and isinstance(one, int | float) else one, limit(at, axis)
        if not (isinstance(size, int | float) and 0.0 < size <= most):
            of = "of unitised stick" if at == "sticks" else "of unitised servo command"
            of = unit(at, axis) if at == "sensors" else of
            raise InputError(f"amplitude must be in (0, {most:g}] {of}, got {one}")


def check_band(band: tuple[float, ...] | None, name: str = "band") -> None:
    """Raise InputError unless a band, or each of several one after the other, can be."""
    if band is None:
        return
    pairs = list(zip(band[::2], band[1::2]))
    fine = all(math.isfinite(high) and 0.0 < low < high for low, high in pairs)
    if not (pairs and len(band) % 2 == 0 and fine):
        raise InputError(f"{name} must be 0 < w_min < w_max in rad/s, got {band}")


def complete(excitation: Excitation, setting: Setting | None) -> Setting:
    """Return a setting that must not be left open any more. Raises InputError."""
    if setting is None:
        raise InputError(
            f"an open {type(excitation).__name__} can't fly; complete it with "
            "on(vehicle.parameters)"
        )
    return setting


def checked(excitation: Excitation, given: Any, time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what an excitation's `sticks` gave for the times, (n_time,), as (n_time, n_axis).

    Raises:
        InputError: it has another shape, or a value that is not finite or beyond the range.
    """
    kind, at = type(excitation).__name__, excitation.at
    axes, enough = PLACES[at], ENOUGH[at]
    given = np.asarray(given)
    wanted = (time.size, len(axes))
    names = [one.upper() for one in axes] if at == "sticks" else axes
    short = given.shape == (time.size, enough)
    if (given.shape != wanted and not short) or given.dtype.kind not in "fiub":
        raise InputError(
            f"{kind}.sticks must return an array of numbers of shape {wanted}, one row a time, "
            f"columns {', '.join(names)}; got shape {given.shape} of {given.dtype}"
        )
    columns = np.zeros(wanted)
    columns[:, : given.shape[1]] = given
    most = np.array([limit(at, axis) for axis in axes])
    bad = ~(np.abs(columns) <= most)
    if bad.any():
        row, column = np.argwhere(bad)[0]
        what = getattr(excitation, "source", "") or f"{kind}.sticks"
        raise InputError(
            f"{what} must stay between {-most[column]:g} and {most[column]:g}, "
            f"{reach(at, axes[column])}; {names[column]} is {columns[row, column]:g} at "
            f"{time[row]:g} s"
        )
    return columns
