"""From keys that are held and axes that are moved to the deflection of four sticks.

Nothing here knows a window: what a device reports is a value, and time is an argument.
"""

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

from helisim.base.errors import InputError
from helisim.hand.joystick import JoystickMap
from helisim.hand.sticks import Deflection, Gimbals, StickFeel, check_mode, sticks_of

STICK_KEYS = {
    "left_x": ("a", "d"),
    "left_y": ("s", "w"),
    "right_x": ("left", "right"),
    "right_y": ("down", "up"),
}
"""Keys that move each thumb of a keyboard's pilot, towards -1 and towards 1."""

KEY_FEEL = StickFeel(rate=0.35, expo=0.0, deadband=0.0)
"""Of keys: each gives a full deflection, so the rate is low."""
FINE_KEY = "shift"
_FINE = 0.35
"""Share of the travel to which a key deflects while `FINE_KEY` is held."""
_COLLECTIVE_TIME = 2.5
"""s, in which a held key, or a stick that centres, moves the collective from stop to stop."""


class Inputs(NamedTuple):
    """What the devices report at an instant.

    Attributes:
        held: names of the keys that are down.
        pressed: of those that went down since the last time, in order.
        axes: readings of a joystick, -1 to 1 each; None if it is gone, or there is none.
    """

    held: Collection[str] = frozenset()
    pressed: tuple[str, ...] = ()
    axes: tuple[float, ...] | None = None


class StickDevice(Protocol):
    """What a flight by hand asks of whatever the sticks are."""

    @property
    def name(self) -> str:
        """What it is, for screen and provenance."""
        ...

    @property
    def feel(self) -> StickFeel:
        """Rates, expo and deadband that suit it."""
        ...

    @property
    def mode(self) -> int:
        """The transmitter's mode, by which the sticks are drawn too."""
        ...

    @property
    def uses_keys(self) -> bool:
        """Whether keys are its sticks."""
        ...

    def deflection(self, inputs: Inputs, seconds: float, *, climbs: bool) -> Deflection | None:
        """Return where the sticks are, None if the device is gone.

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
class KeyboardSticks:
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
    press_time: float = 0.3
    release_time: float = 0.12
    name: str = field(default="keyboard", init=False)
    uses_keys: bool = field(default=True, init=False)
    _thumbs: Gimbals = field(default_factory=Gimbals, init=False, repr=False)
    _collective: float = field(default=0.0, init=False, repr=False)

    def __post_init__(self) -> None:
        check_mode(self.mode)
        if not (self.press_time > 0.0 and self.release_time > 0.0):
            raise InputError(
                f"press_time and release_time must be above 0 s, got {self.press_time} and "
                f"{self.release_time}"
            )

    def deflection(self, inputs: Inputs, seconds: float, *, climbs: bool) -> Deflection:
        """Return where the sticks are; see `StickDevice`."""
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
        self._collective = moved_on(self._collective, pushed, seconds)
        return found._replace(col=self._collective)

    def take_up(self, collective: float) -> None:
        """Go on from a collective, -1 to 1."""
        self._collective = collective

    def _moved(self, now: float, wanted: float, seconds: float) -> float:
        goes_back = abs(wanted) < abs(now) or wanted * now < 0.0
        step = seconds / (self.release_time if goes_back else self.press_time)
        return min(max(wanted, now - step), now + step)


@dataclass
class JoystickSticks:
    """A gamepad, or a transmitter on USB.

    Attributes:
        map: which axis is which stick, and its readings at the stops.
        mode: of the transmitter, by which its sticks are drawn.
        feel: of the sticks.
        name: of the joystick.
    """

    map: JoystickMap
    mode: int = 2
    feel: StickFeel = field(default_factory=StickFeel)
    name: str = "joystick"
    uses_keys: bool = field(default=False, init=False)
    _collective: float = field(default=0.0, init=False, repr=False)

    def __post_init__(self) -> None:
        check_mode(self.mode)

    def deflection(self, inputs: Inputs, seconds: float, *, climbs: bool) -> Deflection | None:
        """Return where the sticks are; see `StickDevice`. Raises InputError."""
        if inputs.axes is None:
            return None
        found = self.map.deflection(inputs.axes)
        if climbs or not self.map.centring:
            return found
        pushed = self.feel.felt(Deflection(lat=found.col)).lat
        self._collective = moved_on(self._collective, pushed, seconds)
        return found._replace(col=self._collective)

    def take_up(self, collective: float) -> None:
        """Go on from a collective, -1 to 1; a stick that stays where it is keeps its own."""
        self._collective = collective


def moved_on(collective: float, pushed: float, seconds: float) -> float:
    """Return a collective, -1 to 1, that has been pushed for some seconds."""
    return min(1.0, max(-1.0, collective + pushed * seconds * 2.0 / _COLLECTIVE_TIME))
