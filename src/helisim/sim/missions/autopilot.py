"""The pilot that a mission's script flies with: its outer loops, and what it can be asked.

Position asks for velocity, velocity for attitude, attitude for the rate sticks, height for the
collective. The gyro makes the cyclic sticks and the pedals command rates, so each loop is near an
integrator, and its gain is the frequency at which it crosses over. They are nested well apart, so
that a vehicle whose force laws are other by a third is still flown.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np

from helisim.base.errors import InputError
from helisim.physics.layout import PARAM
from helisim.vehicle import Vehicle
from helisim.vehicle.trim import Motion, Trim, collective_stick, root_body

_ATTITUDE, _VELOCITY, _POSITION = 3.0, 1.0, 0.35
"""rad/s, at which the loops of attitude, velocity and position cross over."""
_HEAVE, _HEIGHT, _HEADING = 4.0, 1.0, 1.5
"""rad/s, of the loops of vertical speed, height and heading."""
_TRIMMING, _LIFTING = 0.2, 0.5
"""rad/s, below which the integrals take out what drag and wind leave, and what climb does."""
_CATCH_UP, _CATCH_UP_VERTICALLY = 4.0, 2.0
"""m/s, of the most with which a lost position is made up for."""
_TILT, _TURN = 0.5, 1.5
"""rad, that is asked for at most; rad/s, that is asked for at most in roll and pitch."""
_YAW_SHARE = 0.8  # Of the yaw rate of a full pedal, that is asked for at most
_END = 0.5  # Where a stick stops, unitised
_SETTLES, _MIXING = 8, 0.5
"""Rounds in which the induced velocity is found; share of the hover's induced velocity below which
no flow through the disc falls: a vortex ring."""
_TOUCH_DOWN, _LAST_METRE = 0.5, 1.0  # m/s, of sinking through the last metre of a landing
_FLYING_SPEED = 0.98  # Of the nominal rotor speed, from which on collective is raised
_RAISE_COLLECTIVE, _NEARLY, _LIFT_OFF = 0.5, 0.1, 0.15
"""1/s, unitised, at which collective goes up on the ground; how near to the hover's, slower."""
_CLEAR = 0.03  # m, of clearance, at which the ground is left
_LOWER_COLLECTIVE = 1.0  # 1/s, unitised, at which collective goes down on the ground


class Sight(NamedTuple):
    """What a script's pilot sees, SI.

    Attributes:
        time: s from the flight's start.
        motion: of the helicopter, with position, attitude and rates.
        north_rate: velocity over the ground, m/s.
        east_rate: likewise.
        down_rate: likewise; positive sinks.
        clearance: m, of the landing gear above what is below; without a ground above height 0.
        touches: whether the helicopter touched anything since the last tick.
        rotor_speed: of the main rotor, over its nominal one.
    """

    time: float
    motion: Motion
    north_rate: float
    east_rate: float
    down_rate: float
    clearance: float
    touches: bool
    rotor_speed: float


@dataclass
class Wanted:
    """What a pilot's outer loops are to reach now. A script changes it as the flight goes on.

    Attributes:
        north: m; of the origin.
        east: m.
        down: m.
        north_rate: m/s, over the ground.
        east_rate: m/s.
        down_rate: m/s.
        north_acceleration: m/s^2, that is known beforehand.
        east_acceleration: m/s^2.
        heading: rad.
        turning: rad/s.
        holds_place: whether north and east count, else their rates alone.
        holds_height: whether down counts, else its rate alone.
        collective: stick, unitised, in place of what height and climb ask for; None: as they do.
        tilt: rad, of roll and pitch at most.
        cyclic: whether attitude and heading are held: not on the ground, where the gyro's integrals
            would wind up.
        rotor: commanded rotor speed over the nominal one; 0 cuts a motor's throttle. An ideal
            governor's rotor has this speed at once.
    """

    north: float = 0.0
    east: float = 0.0
    down: float = 0.0
    north_rate: float = 0.0
    east_rate: float = 0.0
    down_rate: float = 0.0
    north_acceleration: float = 0.0
    east_acceleration: float = 0.0
    heading: float = 0.0
    turning: float = 0.0
    holds_place: bool = True
    holds_height: bool = True
    collective: float | None = None
    tilt: float = _TILT
    cyclic: bool = True
    rotor: float = 1.0

    @property
    def unsound(self) -> str:
        """What is no finite number, such as "north = nan"; "" if all is."""
        said = ((name, value) for name, value in vars(self).items() if value is not None)
        return ", ".join(f"{name} = {value}" for name, value in said if not math.isfinite(value))

    def go_ahead(self, speed: float, acceleration: float) -> None:
        """Want a speed, m/s, and an acceleration, m/s^2, along the heading."""
        ahead, right = math.cos(self.heading), math.sin(self.heading)
        self.north_rate, self.east_rate = ahead * speed, right * speed
        self.north_acceleration = ahead * acceleration
        self.east_acceleration = right * acceleration


class Moved(NamedTuple):
    """How far along one is, how fast, and how hard it is pushed: m, m/s, m/s^2, or in rad."""

    distance: float
    speed: float
    acceleration: float


@dataclass(frozen=True)
class Ramp:
    """A change of speed along half a cosine, so that neither attitude nor collective has to jump.

    From `start` to `end`, m/s or rad/s, with at most an acceleration, above 0.
    """

    start: float
    end: float
    acceleration: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.end) and self.acceleration > 0.0):
            raise InputError(
                "a change of speed needs a finite speed and an acceleration above 0, got "
                f"{self.end:g} and {self.acceleration:g}"
            )

    @property
    def lasts(self) -> float:
        """How long it takes, s."""
        return 0.5 * math.pi * abs(self.end - self.start) / self.acceleration

    def at(self, time: float) -> Moved:
        """Return the motion at a time since its beginning, s."""
        if time >= self.lasts:
            mean = 0.5 * (self.start + self.end)
            return Moved(mean * self.lasts + self.end * (time - self.lasts), self.end, 0.0)
        half, change = math.pi * time / self.lasts, self.end - self.start
        return Moved(
            self.start * time + 0.5 * change * (time - self.lasts / math.pi * math.sin(half)),
            self.start + 0.5 * change * (1.0 - math.cos(half)),
            0.5 * math.pi / self.lasts * change * math.sin(half),
        )


@dataclass(frozen=True)
class Glide:
    """A way from rest to rest: faster, on, slower.

    A distance, m or rad, with at most a speed and an acceleration, above 0; a short way is flown
    slower.
    """

    distance: float
    speed: float
    acceleration: float

    def __post_init__(self) -> None:
        if not (0.0 <= self.distance < math.inf and self.speed > 0.0 and self.acceleration > 0.0):
            raise InputError(
                "a way needs a finite distance, and a speed and an acceleration above 0, got "
                f"{self.distance:g}, {self.speed:g} and {self.acceleration:g}"
            )

    @property
    def top(self) -> float:
        """The highest speed that is reached."""
        return min(self.speed, math.sqrt(2.0 / math.pi * self.acceleration * self.distance))

    @property
    def lasts(self) -> float:
        """How long it takes, s."""
        if self.distance == 0.0:
            return 0.0
        return self.distance / self.top + Ramp(0.0, self.top, self.acceleration).lasts

    def at(self, time: float) -> Moved:
        """Return the motion at a time since its beginning, s."""
        left = self.lasts - time
        if left <= 0.0:
            return Moved(self.distance, 0.0, 0.0)
        up = Ramp(0.0, self.top, self.acceleration)
        if left >= 0.5 * self.lasts:
            return up.at(time)
        distance, speed, acceleration = up.at(left)
        return Moved(self.distance - distance, speed, -acceleration)


class Lift:
    """The main rotor as its pilot knows it, by blade element and momentum.

    It needs no precision, as he sees what comes of it; but between a hover and a descent on the
    wind the same thrust takes a whole travel of the stick less.
    """

    def __init__(self, vehicle: Vehicle, model: mujoco.MjModel, rotor: int) -> None:
        """Take a vehicle's rotor, an actuator in the model of a flight; right in a hover."""
        par = model.actuator_user[rotor]
        self.mass = float(model.body_subtreemass[root_body(model)])
        radius = float(par[PARAM.main_radius])
        self.weight = self.mass * float(np.linalg.norm(model.opt.gravity))
        self.tip_speed = float(par[PARAM.main_speed]) * radius
        self.area = float(par[PARAM.air_density]) * math.pi * radius**2
        self.blades = 0.5 * float(par[PARAM.main_lift_slope] * par[PARAM.main_solidity])
        self.travel = float(par[PARAM.main_pitch_range] * par[PARAM.gyro_collective])
        self.induced = math.sqrt(self.weight / (2.0 * self.area))
        self.offset = 0.0
        hover = collective_stick(model, vehicle.trim)
        self.offset = hover - self.collective(0.0, 1.0, 0.0, 0.0)

    def collective(self, push: float, speed: float, through: float, across: float) -> float:
        """Return where the collective stick makes a thrust, unitised.

        The thrust pushes, m/s^2, beside the weight; the rotor's speed is over the nominal one; the
        air's velocity is up through the disc and across in its plane, m/s.
        """
        thrust = self.weight + self.mass * push
        tip, least, induced = speed * self.tip_speed, _MIXING * self.induced, self.induced
        for _ in range(_SETTLES):
            flow = math.hypot(across, max(least, abs(induced - through)))
            induced = 0.5 * (induced + thrust / (2.0 * self.area * flow))
        coefficient = thrust / (self.area * tip**2)
        pitch = 3.0 * (coefficient / self.blades + 0.5 * (induced - through) / tip)
        return self.offset + pitch / self.travel


class OuterLoop:
    """Turns what is wanted into sticks; keeps the integrals of one flight.

    Attributes:
        collective: the trim's collective stick, unitised.
        gravity: m/s^2.
        rotor: by which the collective of a thrust is found far from the trim.
    """

    def __init__(self, vehicle: Vehicle, model: mujoco.MjModel, trim: Trim, rotor: int) -> None:
        """Take what a vehicle's gyro and its collective command, about a trim."""
        par = model.actuator_user[rotor]
        rates = [
            [par[PARAM.gyro_p_per_lat], par[PARAM.gyro_p_per_lon]],
            [par[PARAM.gyro_q_per_lat], par[PARAM.gyro_q_per_lon]],
        ]
        self._theta, self._phi = trim.theta, trim.phi
        self.collective = collective_stick(model, trim)
        self.gravity = float(np.linalg.norm(model.opt.gravity))
        self.rotor = Lift(vehicle, model, rotor)
        self._lift = abs(vehicle.derivatives["Z_col"] * float(par[PARAM.gyro_collective]))
        self._to_cyclic = np.linalg.inv(rates)
        self._yaw_rate = float(par[PARAM.gyro_k_delta] / par[PARAM.gyro_k_a])
        self._north = self._east = self._down = 0.0

    def sticks(self, seen: Sight, wanted: Wanted, seconds: float) -> tuple[float, ...]:
        """Return COL, LON, LAT, PED, unitised, that are held for some seconds."""
        col = self._col(seen, wanted, seconds) if wanted.collective is None else wanted.collective
        if not wanted.cyclic:
            return _limited(col, _END), 0.0, 0.0, 0.0
        phi, theta = self._attitude(seen, wanted, seconds)
        return _limited(col, _END), *self._cyclic_and_pedal(seen.motion, wanted, phi, theta)

    def _col(self, seen: Sight, wanted: Wanted, seconds: float) -> float:
        catch_up = _HEIGHT * (wanted.down - seen.motion.down) if wanted.holds_height else 0.0
        off = wanted.down_rate + _limited(catch_up, _CATCH_UP_VERTICALLY) - seen.down_rate
        upright = max(0.5, math.cos(seen.motion.phi) * math.cos(seen.motion.theta))
        lift = self.gravity * (1.0 / upright - 1.0) - (_HEAVE * off + self._down) / upright
        col = self.collective + lift / self._lift
        if abs(col) < _END or off * (col - self.collective) > 0.0:  # it doesn't wind up
            self._down += seconds * _HEAVE * _LIFTING * off
        return col

    def _attitude(self, seen: Sight, wanted: Wanted, seconds: float) -> tuple[float, float]:
        """Return the roll and pitch angle that velocity and position ask for, rad."""
        north_off, east_off = wanted.north_rate - seen.north_rate, wanted.east_rate - seen.east_rate
        if wanted.holds_place:
            far = (wanted.north - seen.motion.north, wanted.east - seen.motion.east)
            share = min(1.0, _CATCH_UP / max(1e-9, _POSITION * math.hypot(*far)))
            north_off += share * _POSITION * far[0]
            east_off += share * _POSITION * far[1]
        north = wanted.north_acceleration + _VELOCITY * north_off + self._north
        east = wanted.east_acceleration + _VELOCITY * east_off + self._east
        cosine, sine = math.cos(seen.motion.psi), math.sin(seen.motion.psi)
        ahead, right = cosine * north + sine * east, cosine * east - sine * north
        most = self.gravity * math.tan(wanted.tilt)
        share = min(1.0, most / max(1e-9, math.hypot(ahead, right)))
        if share == 1.0:
            self._north += seconds * _VELOCITY * _TRIMMING * north_off
            self._east += seconds * _VELOCITY * _TRIMMING * east_off
        theta = self._theta - math.atan(share * ahead / self.gravity)
        return self._phi + math.atan(share * right / self.gravity * math.cos(theta)), theta

    def _cyclic_and_pedal(
        self, now: Motion, wanted: Wanted, phi: float, theta: float
    ) -> tuple[float, float, float]:
        """Return LON, LAT and PED that turn to a roll and pitch angle, rad, and to the heading."""
        psi_off = math.remainder(wanted.heading - now.psi, 2.0 * math.pi)
        fastest = _YAW_SHARE * _END * abs(self._yaw_rate)
        psi_rate = _limited(wanted.turning + _HEADING * psi_off, fastest)
        phi_rate = _limited(_ATTITUDE * (phi - now.phi), _TURN)
        theta_rate = _limited(_ATTITUDE * (theta - now.theta), _TURN)
        level, sine, cosine = math.cos(now.theta), math.sin(now.phi), math.cos(now.phi)
        p = phi_rate - psi_rate * math.sin(now.theta)
        q = theta_rate * cosine + psi_rate * level * sine
        r = psi_rate * level * cosine - theta_rate * sine
        lat, lon = (float(one) for one in self._to_cyclic @ (p, q))
        return _limited(lon, _END), _limited(lat, _END), _limited(r / self._yaw_rate, _END)


def _limited(value: float, most: float) -> float:
    return min(most, max(-most, value))


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
        now, self.seen = seen.motion, seen
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

        It pushes, m/s^2, beside the weight; for a rotor below the slowest speed pitch isn't raised.
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
        way = -height - self.wanted.down
        yield from self._move("down", "down_rate", way, Glide(abs(way), rate, rate))

    def go(
        self, north: float, east: float, *, speed: float = 4.0, acceleration: float = 1.5
    ) -> Iterator[None]:
        """Fly from rest straight to a place, m, and stop there; speed, m/s, and m/s^2 at most."""
        start = (self.wanted.north, self.wanted.east)
        far = (north - start[0], east - start[1])
        distance = math.hypot(*far)
        course = (far[0] / max(distance, 1e-9), far[1] / max(distance, 1e-9))
        yield from self._follow(start, course, Glide(distance, speed, acceleration))

    def accelerate(self, speed: float, *, acceleration: float = 2.0) -> Iterator[None]:
        """Reach a speed over the ground, m/s, in the direction of the heading wanted now."""
        wanted = self.wanted
        course = (math.cos(wanted.heading), math.sin(wanted.heading))
        before = course[0] * wanted.north_rate + course[1] * wanted.east_rate
        start = (wanted.north, wanted.east)
        yield from self._follow(start, course, Ramp(before, speed, acceleration))

    def _follow(
        self, start: tuple[float, float], course: tuple[float, float], way: Ramp | Glide
    ) -> Iterator[None]:
        """Want to be along a way from a start, m, on a course, north and east of a unit."""
        wanted = self.wanted
        for moved in self._along(way):
            wanted.north = start[0] + course[0] * moved.distance
            wanted.east = start[1] + course[1] * moved.distance
            wanted.north_rate, wanted.east_rate = course[0] * moved.speed, course[1] * moved.speed
            wanted.north_acceleration = course[0] * moved.acceleration
            wanted.east_acceleration = course[1] * moved.acceleration
            yield

    def turn(self, angle: float, *, rate: float = 1.0) -> Iterator[None]:
        """Turn on the spot by an angle, rad, to the right if positive, at a rate, rad/s."""
        way = Glide(abs(angle), rate, 2.0 * rate)
        yield from self._move("heading", "turning", angle, way)

    def _move(self, name: str, rate: str, towards: float, way: Glide) -> Iterator[None]:
        """Want a setting, and the rate of it, to be along a way up or down."""
        start = getattr(self.wanted, name)
        for moved in self._along(way):
            setattr(self.wanted, name, start + math.copysign(moved.distance, towards))
            setattr(self.wanted, rate, math.copysign(moved.speed, towards))
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
        wanted, slow = self.wanted, min(rate, _TOUCH_DOWN)
        self.say("landing")
        while self.seen.clearance > 0.0 and not self.seen.touches:
            share = min(1.0, max(0.0, (self.seen.clearance - _LAST_METRE) / _LAST_METRE))
            wanted.down_rate = slow + share * (rate - slow)
            wanted.down = self.seen.motion.down
            yield
        yield from self.settle()

    def settle(self) -> Iterator[None]:
        """Lower collective on the ground, the other sticks in the middle, for two seconds."""
        wanted = self.wanted
        last = self.loop.collective if wanted.collective is None else wanted.collective
        self.say("on the ground")
        wanted.cyclic = False
        for k in range(round(2.0 / self.seconds)):
            wanted.collective = max(-0.5, last - k * self.seconds * _LOWER_COLLECTIVE)
            yield

    def _along(self, way: Ramp | Glide) -> Iterator[Moved]:
        """Yield the motion along a way at each tick, the last one at its end."""
        for k in range(1, math.ceil(way.lasts / self.seconds - 1e-9) + 1):
            yield way.at(min(k * self.seconds, way.lasts))
