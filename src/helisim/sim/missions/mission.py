"""What a mission is: a script that a pilot flies, shipped or your own.

A mission of your own is a frozen dataclass with a method `fly`, a generator:

    @dataclass(frozen=True, kw_only=True)
    class Square(Mission):
        duration: float = 60.0
        side: float = 10.0

        def fly(self, pilot):
            for north, east in ((1, 0), (1, 1), (0, 1), (0, 0)):
                yield from pilot.go(self.side * north, self.side * east)
                yield from pilot.hold(1.0)

Its fields are its settings: in provenance, plan files and on the command line. The script is asked
at each tick of the pilot, 50 times a second; the rest of the flight is native.
"""

import json
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

from helisim.base.errors import InputError
from helisim.sim.ground import Ground
from helisim.sim.missions.autopilot import Autopilot
from helisim.sim.plain import settle, to_plain

MISSIONS: dict[str, type["Mission"]] = {}
"""Every mission by the name of its class; a subclass of `Mission` joins on its definition."""


class Start(NamedTuple):
    """How a mission begins.

    Attributes:
        height: m above the ground, of the origin; None: the weather's.
        speed: m/s, of level flight north.
    """

    height: float | None = None
    speed: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Mission:
    """A flight by a script; subclass it to fly your own.

    Attributes:
        duration: s, after which the flight ends if the script has not.

    Raises:
        InputError: on its definition, a class has the name of a mission from elsewhere.
    """

    duration: float

    start: ClassVar[Start] = Start()
    """How it begins; a property where this depends on the settings."""
    ground: ClassVar[Ground | None] = None
    """What is below where a plan doesn't say it; None flies in the air alone."""
    engine: ClassVar[bool] = False
    """Whether a motor turns the rotor, whatever the vehicle's own `drive.governor`."""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if cls.__name__.startswith("_"):
            return
        other = MISSIONS.get(cls.__name__, cls)
        if other.__module__ != cls.__module__:
            raise InputError(
                f"there is a mission {cls.__name__!r} in {other.__module__} already: give yours "
                "another name, by which records and plans know it"
            )
        MISSIONS[cls.__name__] = cls

    @property
    def name(self) -> str:
        """Its name in words, such as "take_off_hover_land"; records and files have it."""
        return mission_name(type(self))

    def fly(self, pilot: Autopilot) -> Iterator[None]:
        """Fly: ask the pilot for something, and yield for each tick, or `yield from` its methods.

        Args:
            pilot: that flies it, with what it sees.
        """
        raise NotImplementedError


def mission_name(kind: type[Mission]) -> str:
    """Return the name of a kind of mission, words joined by underlines."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", kind.__name__).lower()


def missions_by_name() -> dict[str, type[Mission]]:
    """Return every mission by its name in words."""
    return {mission_name(kind): kind for kind in MISSIONS.values()}


def check_mission(mission: Any) -> None:
    """Raise InputError unless something can be flown as a mission."""
    kind = type(mission).__name__
    if not isinstance(mission, Mission):
        raise InputError(f"a mission such as missions.Forward() is needed, got {mission!r:.80}")
    if type(mission).fly is Mission.fly:
        raise InputError(
            f"{kind} doesn't say what it flies: give it a method fly(self, pilot) that yields"
        )
    settle(mission)
    if not (math.isfinite(mission.duration) and mission.duration >= 1.0):
        raise InputError(f"duration of {kind} must be at least 1 s, got {mission.duration:g}")
    start = mission.start
    if start.height is not None and not 0.0 <= start.height < math.inf:
        raise InputError(f"{kind} must start 0 m or more above the ground, got {start.height:g} m")
    if not 0.0 <= start.speed < math.inf:
        raise InputError(f"{kind} must start at 0 m/s or more, got {start.speed:g}")
    try:
        hash(mission)
        json.dumps(to_plain(mission), allow_nan=False)
    except (TypeError, ValueError):
        raise InputError(
            f"the settings of {kind} must be finite numbers, texts, or tuples of them, so that a "
            f"record can say what was flown; got {to_plain(mission)}"
        ) from None


def check_above(mission: Mission, *names: str) -> None:
    """Raise InputError unless settings of a mission are finite numbers above 0."""
    settle(mission)
    for name in names:
        value = getattr(mission, name)
        if not 0.0 < value < math.inf:
            said = "finite" if value > 0.0 else "above 0"
            raise InputError(f"{name} of {type(mission).__name__} must be {said}, got {value:g}")


def check_from_zero(mission: Mission, *names: str) -> None:
    """Raise InputError unless settings of a mission are finite numbers, 0 or more."""
    settle(mission)
    for name in names:
        value = getattr(mission, name)
        if not 0.0 <= value < math.inf:
            said = "finite" if value > 0.0 else "0 or more"
            raise InputError(f"{name} of {type(mission).__name__} must be {said}, got {value:g}")
