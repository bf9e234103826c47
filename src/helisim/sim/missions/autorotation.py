"""Autorotation: the engine fails, and the helicopter comes down on the wind in its rotor."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

from helisim.sim.ground import Ground
from helisim.sim.missions.autopilot import Autopilot
from helisim.sim.missions.mission import Mission, Start, check_above, check_from_zero
from helisim.sim.missions.outer_loop import Sight, Wanted

_LOWEST = -0.44
"""Collective stick, unitised, that a pilot who governs the rotor's speed doesn't go below."""
_WINDMILL = -0.42
"""Collective stick, unitised, about which the rotor's speed is kept."""
_SPEED_GAIN = 1.6
"""Collective stick, unitised, for a rotor that turns faster by the whole of its speed."""
_SLOWING = 5.5
"""m/s^2, at which collective takes the descent away at the end."""
_BRAKING = 7.0
"""m/s^2, at which speed is taken away at most."""
_RUN = 0.5
"""m/s, over the ground, with which it is to touch down."""
_SINK = 0.4
"""m/s, at which it is to touch down."""
_LAST = 0.1
"""m, of clearance below which no height is left to slow down in."""
_SHORTEST = 0.6
"""s, in which speed is taken away at least."""
_LEVEL, _LEVELLED, _LEVELLING = 1.0, 0.03, 0.35
"""m, of clearance below which the helicopter is level within so many rad, so that its tail doesn't
strike; rad of tilt for each metre above."""
_TILT = 0.55
"""rad, that is asked for at most."""


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

    duration: float = 30.0
    height: float = 30.0
    speed: float = 0.0
    reaction: float = 0.4
    glide: float = 8.0
    rotor_speed: float = 0.95

    ground: ClassVar[Ground | None] = Ground()
    engine: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_above(self, "height", "glide", "rotor_speed")
        check_from_zero(self, "speed", "reaction")

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
        while self._needed(pilot.seen) < _SLOWING and not pilot.seen.touches:
            self._glide(pilot)
            yield
        pilot.say("flare")
        while not pilot.seen.touches:
            self._flare(pilot)
            yield
        yield from pilot.settle()

    def _glide(self, pilot: Autopilot) -> None:
        """Ask for the glide's speed and the rotor's."""
        self._fly_ahead(pilot.wanted, self.glide, 0.0)
        pilot.wanted.tilt = _TILT
        pilot.wanted.collective = self._governed(pilot)

    def _flare(self, pilot: Autopilot) -> None:
        """Ask for what takes both speeds away until the ground is met."""
        seen, wanted = pilot.seen, pilot.wanted
        speed = math.cos(wanted.heading) * seen.north_rate
        speed += math.sin(wanted.heading) * seen.east_rate
        needed, sink = self._needed(seen), max(seen.down_rate, _SINK)
        seconds = max(_SHORTEST, 2.0 * seen.clearance / (sink + _SINK))
        braking = min(_BRAKING, max(0.0, speed - _RUN) / seconds)
        tilted = pilot.loop.gravity / (pilot.loop.gravity + needed)
        self._fly_ahead(wanted, speed, -tilted * braking)
        wanted.tilt = min(_TILT, _LEVELLED + _LEVELLING * max(0.0, seen.clearance - _LEVEL))
        carrying = pilot.carrying_collective(needed)
        wanted.collective = max(self._governed(pilot), carrying)

    def _governed(self, pilot: Autopilot) -> float:
        """Return the collective stick that keeps the rotor's speed, unitised."""
        off = pilot.seen.rotor_speed - self.rotor_speed
        return max(_LOWEST, _WINDMILL + _SPEED_GAIN * off)

    def _needed(self, seen: Sight) -> float:
        """Return the deceleration that ends the descent at the ground, m/s^2."""
        left, sink = max(_LAST, seen.clearance), max(seen.down_rate, _SINK)
        return min(2.0 * _SLOWING, (sink**2 - _SINK**2) / (2.0 * left))

    def _fly_ahead(self, wanted: Wanted, speed: float, acceleration: float) -> None:
        """Want a speed, m/s, and an acceleration, m/s^2, in the direction of the heading."""
        ahead, right = math.cos(wanted.heading), math.sin(wanted.heading)
        wanted.north_rate, wanted.east_rate = ahead * speed, right * speed
        wanted.north_acceleration = ahead * acceleration
        wanted.east_acceleration = right * acceleration
