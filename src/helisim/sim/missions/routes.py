"""Missions that hold what they are to hold: a hover, a straight course, a place while turning."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

from helisim.sim.ground import Ground
from helisim.sim.missions.autopilot import Autopilot
from helisim.sim.missions.mission import Mission, check_above


@dataclass(frozen=True, kw_only=True)
class Forward(Mission):
    """Fly straight ahead at a speed, stop, turn round and fly back in the same way.

    Attributes:
        duration: s, at most.
        speed: m/s over the ground.
        cruise: s at that speed.
        acceleration: m/s^2 at most.
    """

    duration: float = 90.0
    speed: float = 15.0
    cruise: float = 4.0
    acceleration: float = 2.0

    def __post_init__(self) -> None:
        check_above(self, "speed", "cruise", "acceleration")

    def fly(self, pilot: Autopilot) -> Iterator[None]:
        """Fly out and back."""
        pilot.say("hover")
        yield from pilot.hold(1.0)
        for way in ("out", "back"):
            pilot.say(f"{way}: faster")
            yield from pilot.accelerate(self.speed, acceleration=self.acceleration)
            pilot.say(f"{way}: cruise")
            yield from pilot.hold(self.cruise)
            pilot.say(f"{way}: slower")
            yield from pilot.accelerate(0.0, acceleration=self.acceleration)
            yield from pilot.hold(3.0)
            if way == "out":
                pilot.say("turning round")
                yield from pilot.turn(math.pi)
                yield from pilot.hold(1.0)


@dataclass(frozen=True, kw_only=True)
class Pirouette(Mission):
    """Turn on the spot, holding place and height.

    Attributes:
        duration: s, at most.
        turns: how many times, to the right; negative to the left.
        rate: rad/s.
    """

    duration: float = 40.0
    turns: float = 2.0
    rate: float = 1.0

    def __post_init__(self) -> None:
        check_above(self, "rate")

    def fly(self, pilot: Autopilot) -> Iterator[None]:
        """Turn."""
        pilot.say("hover")
        yield from pilot.hold(1.0)
        pilot.say("turning")
        yield from pilot.turn(2.0 * math.pi * self.turns, rate=self.rate)
        pilot.say("hover")
        yield from pilot.hold(2.0)


@dataclass(frozen=True, kw_only=True)
class TakeOffHoverLand(Mission):
    """Climb from the pad, hover, and land where it took off.

    Attributes:
        duration: s, at most.
        height: m above the ground, of the hover.
        hover: s.
        rate: m/s, of climb and descent.
    """

    duration: float = 60.0
    height: float = 4.0
    hover: float = 5.0
    rate: float = 1.0

    ground: ClassVar[Ground | None] = Ground(parked=True)

    def __post_init__(self) -> None:
        check_above(self, "height", "hover", "rate")

    def fly(self, pilot: Autopilot) -> Iterator[None]:
        """Go up, stay and come down."""
        yield from pilot.take_off(self.height, rate=self.rate)
        pilot.say("hover")
        yield from pilot.hold(self.hover)
        yield from pilot.land(rate=self.rate)
