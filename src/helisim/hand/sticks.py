"""Four sticks in two hands: transmitter modes, rates and expo, keys, joysticks and their maps.

Nothing here knows a window: the report of a device is a value, and time is an argument.
"""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from os import PathLike
from typing import Any, NamedTuple, Protocol

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.files import atomic_write, read_toml
from helisim.base.settings import check, from_plain, placed, setting, to_plain, toml_text
from helisim.records.record import IN2


class Deflection(NamedTuple):
    """Positions of the four sticks in their whole travel: 0 in the middle, -1 and 1 at the stops.

    Attributes:
        col: collective, up to climb.
        lon: longitudinal, back to pitch the nose up.
        lat: lateral, to the right.
        ped: pedals, nose to the right.
    """

    col: float = 0.0
    lon: float = 0.0
    lat: float = 0.0
    ped: float = 0.0


class Gimbals(NamedTuple):
    """Positions of both thumbs, -1 to 1: to the right and up, which is away from the pilot."""

    left_x: float = 0.0
    left_y: float = 0.0
    right_x: float = 0.0
    right_y: float = 0.0


MODES = {
    1: ("ped", "lon", "lat", "col"),
    2: ("ped", "col", "lat", "lon"),
    3: ("lat", "lon", "ped", "col"),
    4: ("lat", "col", "ped", "lon"),
}
"""Sticks of a transmitter's modes, in the order of `Gimbals`."""
STICKS = Deflection._fields
ORDERS = ("AETR", "TAER", "RETA", "TREA", "ETAR", "EATR")
"""Usual orders of a transmitter's channels; any other order of the four letters will do."""
_LETTERS = {"A": "lat", "E": "lon", "T": "col", "R": "ped"}

STICK_KEYS = {
    "left_x": ("a", "d"),
    "left_y": ("s", "w"),
    "right_x": ("left", "right"),
    "right_y": ("down", "up"),
}
"""Keys that move each thumb of a keyboard's pilot, towards -1 and towards 1."""
FINE_KEY = "shift"
_FINE = 0.35
"""Share of the travel to which a key deflects while `FINE_KEY` is held."""
_COLLECTIVE_TIME = 2.5
"""s, in which a held key, or a stick that centres, moves the collective from stop to stop."""
_STICK_AXES = 4
"""Axes of a gamepad's sticks: left x, y, right x, y; then come its triggers."""

assert tuple(name.lower() for name in IN2) == STICKS


def check_mode(mode: int) -> int:
    """Return a transmitter's mode. Raises UnknownNameError."""
    if mode not in MODES:
        raise UnknownNameError("transmitter mode", mode, map(str, MODES))
    return mode


def sticks_of(gimbals: Gimbals, mode: int) -> Deflection:
    """Return the sticks that both gimbals deflect in a mode. Raises UnknownNameError."""
    thumbs = dict(zip(MODES[check_mode(mode)], gimbals))
    return Deflection(**{**thumbs, "lon": -thumbs["lon"]})  # away from the pilot is nose down


@dataclass(frozen=True, kw_only=True)
class StickFeel:
    """How much a deflection is, as set on a transmitter for the sticks that centre.

    The collective is as it is: -1 to 1 is its whole travel.

    Attributes:
        rate: share of the travel that a full deflection of LON, LAT and PED gives, above 0, to 1.
        expo: 0 is linear; 1 leaves only the cube of the deflection, soft about the middle.
        deadband: deflection about the middle that is none, below 1; from there on it rises from 0.
    """

    rate: float = setting(1.0, above=0.0, high=1.0)
    expo: float = setting(0.3, low=0.0, high=1.0)
    deadband: float = setting(0.02, low=0.0, below=1.0)

    def __post_init__(self) -> None:
        check(self)

    def felt(self, deflection: Deflection) -> Deflection:
        """Return a deflection behind deadband, expo and rate; within the stops in any case."""
        col, *others = (min(1.0, max(-1.0, one)) for one in deflection)
        return Deflection(col, *map(self._curved, others))

    def _curved(self, one: float) -> float:
        beyond = max(0.0, abs(one) - self.deadband) / (1.0 - self.deadband)
        return math.copysign(self.rate * ((1.0 - self.expo) * beyond + self.expo * beyond**3), one)


KEY_FEEL = StickFeel(rate=0.35, expo=0.0, deadband=0.0)
"""The feel of keys: each gives a full deflection, so the rate is low."""


@dataclass(frozen=True)
class Axis:
    """One axis of a joystick as a stick.

    Attributes:
        number: of the axis, from 0.
        low: reading where the stick's deflection is -1.
        centre: reading in the middle.
        high: reading where it is 1; below `low`, the axis is reversed.
    """

    number: int = setting(low=0)
    low: float = -1.0
    centre: float = 0.0
    high: float = 1.0

    def __post_init__(self) -> None:
        check(self)
        if not (self.low < self.centre < self.high or self.low > self.centre > self.high):
            raise InputError(
                f"the centre of axis {self.number} must lie between low and high, got "
                f"{self.low:g}, {self.centre:g}, {self.high:g}"
            )

    def deflection(self, axes: Sequence[float]) -> float:
        """Return the stick's deflection, -1 to 1. Raises InputError: there is no such axis."""
        if self.number >= len(axes):
            raise InputError(
                f"the joystick has {len(axes)} axes, 0 to {len(axes) - 1}, and no axis "
                f"{self.number}; say which is which with a map",
                remedy="map",
            )
        off = axes[self.number] - self.centre
        span = self.high if off * (self.high - self.centre) >= 0.0 else self.low
        return min(1.0, abs(off / (span - self.centre))) * (1.0 if span == self.high else -1.0)


@dataclass(frozen=True, kw_only=True)
class JoystickMap:
    """The axes of all four sticks.

    Attributes:
        col: collective.
        lon: longitudinal.
        lat: lateral.
        ped: pedals.
        centring: whether the collective's stick goes back to the middle, as a gamepad's does;
            then it moves the collective on instead of being it.
    """

    centring: bool = False
    col: Axis
    lon: Axis
    lat: Axis
    ped: Axis

    def __post_init__(self) -> None:
        check(self)

    @classmethod
    def transmitter(cls, order: str = "AETR") -> "JoystickMap":
        """Return the map of a radio transmitter on USB, by the order of its channels.

        Each axis reads 1 with its stick up, away from the pilot, or to the right.

        Args:
            order: A, E, T and R for aileron, elevator, throttle and rudder.

        Raises:
            InputError: not each of the four letters once.
        """
        if sorted(order.upper()) != sorted(_LETTERS):
            raise InputError(
                f"the order of channels must be each of A, E, T and R once, such as "
                f"{', '.join(ORDERS[:2])}, got {order!r}"
            )
        names = [_LETTERS[letter] for letter in order.upper()]
        axes = {name: _axis(n, turned=name == "lon") for n, name in enumerate(names)}
        return cls(centring=False, **axes)

    @classmethod
    def gamepad(cls, mode: int = 2) -> "JoystickMap":
        """Return the map of a gamepad whose axes are left x, y, right x, y, y down.

        Raises:
            UnknownNameError: no such mode.
        """
        axes = {}
        for number, name in enumerate(MODES[check_mode(mode)]):
            turned = (number % 2 == 1) != (name == "lon")  # a stick back is a nose up
            axes[name] = _axis(number, turned=turned)
        return cls(centring=True, **axes)

    def deflection(self, axes: Sequence[float]) -> Deflection:
        """Return the positions of the sticks. Raises InputError: there is no such axis."""
        return Deflection(*(getattr(self, name).deflection(axes) for name in STICKS))

    def write(self, path: str | PathLike[str]) -> None:
        """Write the map as TOML, which `read` reads. Raises StorageError."""
        with atomic_write(path) as temporary:
            temporary.write_text(toml_text(to_plain(self, toml=True)), encoding="utf-8")

    @classmethod
    def read(cls, path: str | PathLike[str]) -> "JoystickMap":
        """Read a map from TOML.

        Raises:
            StorageError: the file can't be read.
            InputError: a stick is missing, or its readings can't be.
        """
        data = read_toml(path)
        with placed(path):
            return from_plain(cls, data, "map")


def _axis(number: int, *, turned: bool) -> Axis:
    return Axis(number, 1.0, 0.0, -1.0) if turned else Axis(number)


class Inputs(NamedTuple):
    """The report of the devices at an instant.

    Attributes:
        held: names of the keys that are down.
        pressed: of those that went down since the last time, in order.
        axes: readings of a joystick, -1 to 1 each; None if it is gone, or there is none.
    """

    held: Collection[str] = frozenset()
    pressed: tuple[str, ...] = ()
    axes: tuple[float, ...] | None = None


class StickDevice(Protocol):
    """The sticks of a flight by hand, whatever they are."""

    @property
    def name(self) -> str:
        """The device's name, for screen and provenance."""
        ...

    @property
    def feel(self) -> StickFeel:
        """Rates, expo and deadband that suit it."""
        ...

    @property
    def mode(self) -> int:
        """The transmitter's mode."""
        ...

    def deflection(self, inputs: Inputs, seconds: float, *, climbs: bool) -> Deflection | None:
        """Return the positions of the sticks, None if the device is gone.

        Args:
            inputs: at this instant.
            seconds: since the last call.
            climbs: whether the collective commands a climb, so that its middle is level flight;
                else it is the blades' pitch, and a stick that centres moves it on.
        """
        ...

    def take_up(self, collective: float) -> None:
        """Go on from a collective, -1 to 1, that somebody else has set."""
        ...


@dataclass
class _Collective:
    """A collective that keys, or a stick that centres, move on."""

    _collective: float = field(default=0.0, init=False, repr=False)

    def take_up(self, collective: float) -> None:
        """Go on from a collective, -1 to 1; a stick that stays where it is keeps its own."""
        self._collective = collective

    def _moved_on(self, pushed: float, seconds: float) -> float:
        moved = self._collective + pushed * seconds * 2.0 / _COLLECTIVE_TIME
        self._collective = min(1.0, max(-1.0, moved))
        return self._collective


@dataclass
class KeyboardSticks(_Collective):
    """Keys as thumbs: they move while a key is held, and go back to the middle when it isn't.

    Attributes:
        mode: of the transmitter that the keys stand for: W, S, A and D are its left gimbal, the
            arrows its right one.
        feel: of the sticks.
        press_time: s, from the middle to the stop.
        release_time: s, from the stop to the middle.
    """

    mode: int = 2
    feel: StickFeel = KEY_FEEL
    press_time: float = setting(0.3, unit="s", above=0.0)
    release_time: float = setting(0.12, unit="s", above=0.0)
    name: str = field(default="keyboard", init=False)
    _thumbs: Gimbals = field(default_factory=Gimbals, init=False, repr=False)

    def __post_init__(self) -> None:
        check_mode(self.mode)
        check(self)

    def deflection(self, inputs: Inputs, seconds: float, *, climbs: bool) -> Deflection:
        """Return the positions of the sticks; see `StickDevice`."""
        reach = _FINE if FINE_KEY in inputs.held else 1.0
        wanted = [
            reach * ((high in inputs.held) - (low in inputs.held))
            for low, high in STICK_KEYS.values()
        ]
        self._thumbs = Gimbals(*map(self._moved, self._thumbs, wanted, [seconds] * 4))
        found = sticks_of(self._thumbs, self.mode)
        if climbs:
            return found
        pushed = sticks_of(Gimbals(*wanted), self.mode).col
        return found._replace(col=self._moved_on(pushed, seconds))

    def _moved(self, now: float, wanted: float, seconds: float) -> float:
        goes_back = abs(wanted) < abs(now) or wanted * now < 0.0
        step = seconds / (self.release_time if goes_back else self.press_time)
        return min(max(wanted, now - step), now + step)


@dataclass
class JoystickSticks(_Collective):
    """A gamepad, or a transmitter on USB.

    Attributes:
        map: which axis is which stick, and its readings at the stops.
        mode: of the transmitter.
        feel: of the sticks.
        name: of the joystick.
    """

    map: JoystickMap
    mode: int = 2
    feel: StickFeel = field(default_factory=StickFeel)
    name: str = "joystick"

    def __post_init__(self) -> None:
        check_mode(self.mode)

    def deflection(self, inputs: Inputs, seconds: float, *, climbs: bool) -> Deflection | None:
        """Return the positions of the sticks; see `StickDevice`. Raises InputError."""
        if inputs.axes is None:
            return None
        found = self.map.deflection(inputs.axes)
        if climbs or not self.map.centring:
            return found
        pushed = self.feel.felt(Deflection(lat=found.col)).lat
        return found._replace(col=self._moved_on(pushed, seconds))


@dataclass(frozen=True)
class Joystick:
    """A joystick that is plugged in.

    Attributes:
        number: by which GLFW knows it, from 0.
        name: as it calls itself.
        is_gamepad: whether GLFW knows which of its axes is which stick.
    """

    number: int
    name: str
    is_gamepad: bool = False


def joysticks(glfw: Any) -> list[Joystick]:
    """Return the joysticks that are plugged in."""
    found = []
    for number in range(glfw.JOYSTICK_1, glfw.JOYSTICK_LAST + 1):
        if glfw.joystick_present(number):
            name = glfw.get_joystick_name(number)
            text = name.decode(errors="replace") if isinstance(name, bytes) else str(name)
            found.append(Joystick(number, text, glfw.joystick_is_gamepad(number)))
    return found


def choose(wanted: str, there: list[Joystick]) -> Joystick:
    """Return the joystick of a number or of a part of its name; the only one if "" is wanted.

    Raises:
        InputError: there is none such, or there are several.
    """
    listed = ", ".join(f"{one.number} {one.name!r}" for one in there)
    if not there:
        raise InputError(
            "no joystick: looked for any that the system reports, found none; plug one in (a "
            "transmitter in its USB joystick mode) and see that you may read it, or fly with keys",
            remedy="keyboard",
        )
    if wanted.isdecimal():
        found = [one for one in there if one.number == int(wanted)]
    else:
        found = [one for one in there if wanted.casefold() in one.name.casefold()]
    if len(found) == 1:
        return found[0]
    said = f"no joystick {wanted!r}" if wanted and not found else "several joysticks"
    raise InputError(f"{said}: there are {listed}; say which by number or name")


def read_axes(glfw: Any, joystick: Joystick) -> tuple[float, ...] | None:
    """Return the readings of a joystick's axes, None if it is gone."""
    if joystick.is_gamepad:
        state = glfw.get_gamepad_state(joystick.number)
        return None if state is None else tuple(state.axes[:_STICK_AXES])
    pointer, count = glfw.get_joystick_axes(joystick.number)
    return tuple(pointer[:count]) if count else None
