"""The pilot that a mission's script flies with: what it sees, and what can be asked of it."""

import math
from collections.abc import Iterator

from helisim.base.errors import InputError
from helisim.sim.missions.glide import Glide, Ramp
from helisim.sim.missions.outer_loop import OuterLoop, Sight, Wanted

_TOUCH_DOWN = 0.5
"""m/s, of sinking through the last metre of a landing."""
_LAST_METRE = 1.0
_FLYING_SPEED = 0.98
"""Of the nominal rotor speed, from which on collective is raised."""
_RAISE_COLLECTIVE, _NEARLY, _LIFT_OFF = 0.5, 0.1, 0.15
"""1/s, unitised, at which collective goes up on the ground; how near to the hover's, slower."""
_CLEAR = 0.03
"""m, of clearance, at which the ground is left."""
_LOWER_COLLECTIVE = 1.0
"""1/s, unitised, at which collective goes down on the ground."""


class Autopilot:
    """Flies what a script asks for, 50 times a second.

    Its methods are generators: a script says `yield from pilot.go(10.0, 0.0)`, or changes `wanted`
    itself and yields for each tick of 20 ms. Heights are those of the vehicle's origin.

    Attributes:
        seen: how the helicopter moves, now.
        wanted: what the outer loops are to reach; may be changed at each tick.
        seconds: between two ticks.
        phases: times, s, and what the script said then.
        moved: where the sticks COL, LON, LAT, PED were moved at the last tick, unitised.
    """

    def __init__(self, loop: OuterLoop, seen: Sight, seconds: float) -> None:
        """Begin where the helicopter is, in the trim of the loops."""
        self.loop, self.seconds = loop, seconds
        self.begin(seen)
        self.phases: list[tuple[float, str]] = []
        self.moved = (loop.collective, 0.0, 0.0, 0.0)

    def begin(self, seen: Sight) -> None:
        """Want what is seen: the place, the velocity and the heading."""
        now = seen.motion
        self.seen = seen
        self.wanted = Wanted(
            north=now.north,
            east=now.east,
            down=now.down,
            north_rate=seen.north_rate,
            east_rate=seen.east_rate,
            heading=now.psi,
        )

    @property
    def time(self) -> float:
        """Time since the flight's start, s."""
        return self.seen.time

    @property
    def height(self) -> float:
        """Height of the vehicle's origin above the ground, m."""
        return -self.seen.motion.down

    @property
    def ground_speed(self) -> float:
        """Speed over the ground, m/s."""
        return math.hypot(self.seen.north_rate, self.seen.east_rate)

    def carrying_collective(self, push: float, *, slowest: float = 0.5) -> float:
        """Return where the collective stick makes the rotor carry the helicopter now, unitised.

        Args:
            push: m/s^2, along the rotor's shaft, beside its weight.
            slowest: rotor speed over the nominal one, below which pitch is not raised for it.
        """
        now = self.seen.motion
        return self.loop.rotor.collective(
            push, max(slowest, self.seen.rotor_speed), now.w, math.hypot(now.u, now.v)
        )

    def say(self, phase: str) -> None:
        """Note what begins now; records and recordings show it."""
        self.phases.append((round(self.time, 6), phase))

    def sticks(self, seen: Sight) -> tuple[float, ...]:
        """Return COL, LON, LAT, PED for what is seen now, unitised."""
        self.moved = self.loop.sticks(seen, self.wanted, self.seconds)
        return self.moved

    def hold(self, seconds: float) -> Iterator[None]:
        """Keep on as it is: in the hover, or at a steady velocity. Raises InputError."""
        if not 0.0 <= seconds < math.inf:
            raise InputError(f"a pilot holds for 0 s or more, got {seconds:g}")
        wanted = self.wanted
        for _ in range(round(seconds / self.seconds)):
            wanted.north += self.seconds * wanted.north_rate
            wanted.east += self.seconds * wanted.east_rate
            wanted.heading += self.seconds * wanted.turning
            yield

    def climb(self, height: float, *, rate: float = 1.5) -> Iterator[None]:
        """Climb or sink to a height, m above the ground, at a rate, m/s."""
        wanted, start = self.wanted, self.wanted.down
        way = -height - start
        for moved in self._along(Glide(abs(way), rate, rate)):
            wanted.down = start + math.copysign(moved.distance, way)
            wanted.down_rate = math.copysign(moved.speed, way)
            yield

    def go(
        self, north: float, east: float, *, speed: float = 4.0, acceleration: float = 1.5
    ) -> Iterator[None]:
        """Fly from rest straight to a place and stop there.

        Args:
            north: m.
            east: m.
            speed: m/s on the way.
            acceleration: m/s^2 at most.
        """
        wanted = self.wanted
        start, far = (wanted.north, wanted.east), (north - wanted.north, east - wanted.east)
        distance = math.hypot(*far)
        ahead, right = (one / max(distance, 1e-9) for one in far)
        for moved in self._along(Glide(distance, speed, acceleration)):
            wanted.north, wanted.east = (
                start[0] + ahead * moved.distance,
                start[1] + right * moved.distance,
            )
            wanted.north_rate, wanted.east_rate = ahead * moved.speed, right * moved.speed
            wanted.north_acceleration = ahead * moved.acceleration
            wanted.east_acceleration = right * moved.acceleration
            yield

    def accelerate(self, speed: float, *, acceleration: float = 2.0) -> Iterator[None]:
        """Reach a speed over the ground, m/s, in the direction of the heading wanted now."""
        wanted = self.wanted
        north, east = wanted.north, wanted.east
        ahead, right = math.cos(wanted.heading), math.sin(wanted.heading)
        before = ahead * wanted.north_rate + right * wanted.east_rate
        for moved in self._along(Ramp(before, speed, acceleration)):
            wanted.north, wanted.east = (
                north + ahead * moved.distance,
                east + right * moved.distance,
            )
            wanted.north_rate, wanted.east_rate = ahead * moved.speed, right * moved.speed
            wanted.north_acceleration = ahead * moved.acceleration
            wanted.east_acceleration = right * moved.acceleration
            yield

    def turn(self, angle: float, *, rate: float = 1.0) -> Iterator[None]:
        """Turn on the spot by an angle, rad, to the right if positive, at a rate, rad/s."""
        wanted, start = self.wanted, self.wanted.heading
        for moved in self._along(Glide(abs(angle), rate, 2.0 * rate)):
            wanted.heading = start + math.copysign(moved.distance, angle)
            wanted.turning = math.copysign(moved.speed, angle)
            yield

    def take_off(self, height: float, *, rate: float = 1.0) -> Iterator[None]:
        """Raise collective until the ground is left, and climb to a height, m, at a rate, m/s.

        A rotor that is slower than in flight is waited for.
        """
        wanted, last = self.wanted, -0.5
        wanted.cyclic, wanted.collective = False, last
        if self.seen.rotor_speed < _FLYING_SPEED:
            self.say("spool-up")
        while self.seen.rotor_speed < _FLYING_SPEED:
            yield
        self.say("take-off")
        while self.seen.clearance < _CLEAR:
            near = last > self.loop.collective - _NEARLY
            last += self.seconds * (_LIFT_OFF if near else _RAISE_COLLECTIVE)
            wanted.collective = last
            yield
        self.say("climb")
        wanted.cyclic, wanted.collective = True, None
        wanted.down = self.seen.motion.down
        yield from self.climb(height, rate=rate)

    def land(self, *, rate: float = 1.0) -> Iterator[None]:
        """Sink at a rate, m/s, slower through the last metre, to the ground; lower collective."""
        wanted = self.wanted
        self.say("landing")
        while self.seen.clearance > 0.0 and not self.seen.touches:
            slow = min(rate, _TOUCH_DOWN)
            share = min(1.0, max(0.0, (self.seen.clearance - _LAST_METRE) / _LAST_METRE))
            wanted.down_rate = slow + share * (rate - slow)
            wanted.down = self.seen.motion.down
            yield
        yield from self.settle()

    def settle(self) -> Iterator[None]:
        """Lower collective on the ground, the other sticks in the middle, for two seconds."""
        wanted, last = self.wanted, self.loop.collective
        self.say("on the ground")
        wanted.cyclic = False
        if wanted.collective is not None:
            last = wanted.collective
        for k in range(round(2.0 / self.seconds)):
            wanted.collective = max(-0.5, last - k * self.seconds * _LOWER_COLLECTIVE)
            yield

    def _along(self, way: Ramp | Glide) -> Iterator:
        """Yield the motion along a way at each tick, the last one at its end."""
        count = math.ceil(way.lasts / self.seconds - 1e-9)
        for k in range(1, count + 1):
            yield way.at(min(k * self.seconds, way.lasts))
