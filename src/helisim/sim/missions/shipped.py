"""The shipped missions: out and back, take-off and landing, an autorotation."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

from helisim.base.settings import setting
from helisim.sim.ground import Ground
from helisim.sim.missions.autopilot import Autopilot, Sight
from helisim.sim.missions.mission import Mission, Start

_LOWEST, _WINDMILL, _SPEED_GAIN = -0.49, -0.46, 1.6
"""Collective stick, unitised: its floor and middle in a descent, and its gain on rotor speed."""
_SLOWING, _BRAKING = 6.8, 8.5
"""m/s^2, at most, of the descent's end and of the speed's."""
_RUN, _SINK = 0.5, 0.4  # m/s, over the ground and downwards, with which it is to touch down
_LAST = 0.1  # m, of clearance below which no height is left to slow down in
_SHORTEST = 0.5  # s, in which speed is taken away at least
_LEVEL, _LEVELLED, _LEVELLING = 1.4, 0.03, 0.55
"""m, of clearance below which it is level, against a strike of the tail; rad; rad a metre above."""
_TILT = 0.68  # rad, that is asked for at most


@dataclass(frozen=True, kw_only=True)
class Forward(Mission):
    """Fly straight ahead at a speed, stop, turn round and fly back in the same way."""

    duration: float = setting(90.0, unit="s", low=1.0)
    speed: float = setting(15.0, unit="m/s", above=0.0)
    cruise: float = setting(4.0, unit="s", above=0.0)
    acceleration: float = setting(2.0, unit="m/s^2", above=0.0)

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
class TakeOffHoverLand(Mission):
    """Climb from the pad, hover, and land where it took off."""

    duration: float = setting(60.0, unit="s", low=1.0)
    height: float = setting(4.0, unit="m", above=0.0)
    hover: float = setting(5.0, unit="s", above=0.0)
    rate: float = setting(1.0, unit="m/s", above=0.0)

    ground: ClassVar[Ground | None] = Ground(parked=True)

    def fly(self, pilot: Autopilot) -> Iterator[None]:
        """Go up, stay and come down."""
        yield from pilot.take_off(self.height, rate=self.rate)
        pilot.say("hover")
        yield from pilot.hold(self.hover)
        yield from pilot.land(rate=self.rate)


@dataclass(frozen=True, kw_only=True)
class Autorotation(Mission):
    """Lose the engine in the air, and land without it.

    Attributes:
        height: m above the ground, of the origin, where the engine fails.
        speed: m/s, of level flight then.
        reaction: s until the pilot moves a stick.
        glide: m/s, of the descent over the ground.
        rotor_speed: that is kept in it, over the nominal one.
    """

    duration: float = setting(30.0, unit="s", low=1.0)
    height: float = setting(30.0, unit="m", above=0.0)
    speed: float = setting(0.0, unit="m/s", low=0.0)
    reaction: float = setting(0.4, unit="s", low=0.0)
    glide: float = setting(9.0, unit="m/s", above=0.0)
    rotor_speed: float = setting(0.95, above=0.0)

    ground: ClassVar[Ground | None] = Ground()
    engine: ClassVar[bool] = True

    @property
    def start(self) -> Start:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The height and speed at which the engine fails, a second before."""
        return Start(self.height, self.speed)

    def fly(self, pilot: Autopilot) -> Iterator[None]:
        """Fly on, lose the engine, glide, flare and touch down."""
        wanted = pilot.wanted
        pilot.say("a motor turns the rotor")
        yield from pilot.hold(1.0)
        pilot.say("engine fails")
        wanted.rotor, wanted.collective = 0.0, pilot.moved[0]
        yield from pilot.hold(self.reaction)
        pilot.say("collective down")
        wanted.holds_place = False
        pilot.say("glide")
        while _needed(pilot.seen) < _SLOWING and not pilot.seen.touches:
            wanted.go(wanted.ahead, self.glide, 0.0)
            wanted.tilt, wanted.collective = _TILT, self._governed(pilot)
            yield
        pilot.say("flare")
        while not pilot.seen.touches:
            self._flare(pilot)
            yield
        yield from pilot.settle()

    def _flare(self, pilot: Autopilot) -> None:
        seen, wanted = pilot.seen, pilot.wanted
        speed = math.cos(wanted.heading) * seen.north_rate
        speed += math.sin(wanted.heading) * seen.east_rate
        needed, sink = _needed(seen), max(seen.down_rate, _SINK)
        seconds = max(_SHORTEST, 2.0 * seen.clearance / (sink + _SINK))
        braking = min(_BRAKING, max(0.0, speed - _RUN) / seconds)
        tilted = pilot.loop.gravity / (pilot.loop.gravity + needed)
        wanted.go(wanted.ahead, speed, -tilted * braking)
        wanted.tilt = min(_TILT, _LEVELLED + _LEVELLING * max(0.0, seen.clearance - _LEVEL))
        wanted.collective = max(self._governed(pilot), pilot.carrying_collective(needed))

    def _governed(self, pilot: Autopilot) -> float:
        return max(_LOWEST, _WINDMILL + _SPEED_GAIN * (pilot.seen.rotor_speed - self.rotor_speed))


def _needed(seen: Sight) -> float:
    height, sink = max(_LAST, seen.clearance), max(seen.down_rate, _SINK)
    return min(2.0 * _SLOWING, (sink**2 - _SINK**2) / (2.0 * height))
