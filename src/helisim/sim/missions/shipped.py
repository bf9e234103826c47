"""The shipped missions: out and back, turns on the spot, take-off and landing, an autorotation."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

from helisim.base.settings import setting
from helisim.sim.ground import Ground
from helisim.sim.missions.autopilot import Autopilot, Sight
from helisim.sim.missions.mission import Mission, Start

_LOWEST = -0.44
"""Collective stick, unitised, that a pilot who governs the rotor's speed doesn't go below."""
_WINDMILL = -0.42  # Collective stick, unitised, about which the rotor's speed is kept
_SPEED_GAIN = 1.6
"""Collective stick, unitised, for a rotor that turns faster by the whole of its speed."""
_SLOWING, _BRAKING = 5.5, 7.0
"""m/s^2, at which collective takes the descent away at the end, and speed is, at most."""
_RUN, _SINK = 0.5, 0.4  # m/s, over the ground and downwards, with which it is to touch down
_LAST = 0.1  # m, of clearance below which no height is left to slow down in
_SHORTEST = 0.6  # s, in which speed is taken away at least
_LEVEL, _LEVELLED, _LEVELLING = 1.0, 0.03, 0.35
"""m, of clearance below which the helicopter is level within so many rad, so that its tail doesn't
strike; rad of tilt for each metre above."""
_TILT = 0.55  # rad, that is asked for at most


@dataclass(frozen=True, kw_only=True)
class Forward(Mission):
    """Fly straight ahead at a speed, stop, turn round and fly back in the same way.

    Attributes:
        duration: s, at most.
        speed: m/s over the ground.
        cruise: s at that speed.
        acceleration: m/s^2 at most.
    """

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
class Pirouette(Mission):
    """Turn on the spot, holding place and height.

    Attributes:
        duration: s, at most.
        turns: how many times, to the right; negative to the left.
        rate: rad/s.
    """

    duration: float = setting(40.0, unit="s", low=1.0)
    turns: float = 2.0
    rate: float = setting(1.0, unit="rad/s", above=0.0)

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

    A motor turns the rotor (`drive.governor = "motor"`), whatever the vehicle has, until its
    throttle is cut. The pilot lowers collective after his time of reaction, keeps the rotor's speed
    with it and the airspeed with the cyclic, gives both speeds back in the flare, and cushions the
    touch-down with what the rotor still has.

    Attributes:
        duration: s, at most.
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
    glide: float = setting(8.0, unit="m/s", above=0.0)
    rotor_speed: float = setting(0.95, above=0.0)

    ground: ClassVar[Ground | None] = Ground()
    engine: ClassVar[bool] = True

    @property
    def start(self) -> Start:  # pyright: ignore[reportIncompatibleVariableOverride]
        """At the height and speed at which the engine fails, a second before."""
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
            wanted.go_ahead(self.glide, 0.0)
            wanted.tilt, wanted.collective = _TILT, self._governed(pilot)
            yield
        pilot.say("flare")
        while not pilot.seen.touches:
            self._flare(pilot)
            yield
        yield from pilot.settle()

    def _flare(self, pilot: Autopilot) -> None:
        """Ask for what takes both speeds away until the ground is met."""
        seen, wanted = pilot.seen, pilot.wanted
        speed = math.cos(wanted.heading) * seen.north_rate
        speed += math.sin(wanted.heading) * seen.east_rate
        needed, sink = _needed(seen), max(seen.down_rate, _SINK)
        seconds = max(_SHORTEST, 2.0 * seen.clearance / (sink + _SINK))
        braking = min(_BRAKING, max(0.0, speed - _RUN) / seconds)
        tilted = pilot.loop.gravity / (pilot.loop.gravity + needed)
        wanted.go_ahead(speed, -tilted * braking)
        wanted.tilt = min(_TILT, _LEVELLED + _LEVELLING * max(0.0, seen.clearance - _LEVEL))
        wanted.collective = max(self._governed(pilot), pilot.carrying_collective(needed))

    def _governed(self, pilot: Autopilot) -> float:
        """Return the collective stick that keeps the rotor's speed, unitised."""
        off = pilot.seen.rotor_speed - self.rotor_speed
        return max(_LOWEST, _WINDMILL + _SPEED_GAIN * off)


def _needed(seen: Sight) -> float:
    """Return the deceleration that ends the descent at the ground, m/s^2."""
    height, sink = max(_LAST, seen.clearance), max(seen.down_rate, _SINK)
    return min(2.0 * _SLOWING, (sink**2 - _SINK**2) / (2.0 * height))
