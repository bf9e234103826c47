"""The pilot of a mission's script: its outer loops, and what it can be asked.

Position asks for velocity, velocity for attitude, attitude for the rate sticks, height for the
collective; each loop's gain is its crossover frequency.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np

from helisim.base.errors import InputError
from helisim.physics.layout import PARAM
from helisim.records.record import AXES
from helisim.vehicle import Vehicle
from helisim.vehicle.addresses import root_body
from helisim.vehicle.law import on_law, trimmed_sticks
from helisim.vehicle.trim import Motion, Trim

ATTITUDE, VELOCITY, POSITION = 3.0, 1.0, 0.35
"""rad/s, at which the loops of attitude, velocity and position cross over."""
HEAVE, HEIGHT, HEADING = 4.0, 1.0, 1.5
"""rad/s, of the loops of vertical speed, height and heading."""
_TRIMMING, _LIFTING = 0.2, 0.5
"""rad/s, of the integrals of drag and wind, and of climb."""
_CATCH_UP, _CATCH_UP_VERTICALLY = 4.0, 2.0
"""m/s, with which a lost position is made up for at most."""
_TILT, _TURN = 0.5, 1.5
"""rad, of roll and pitch at most; rad/s, of their rates."""
_YAW_SHARE = 0.8  # of the yaw rate of a full pedal, that is asked for at most
_END = 0.5  # where a stick stops, unitised
_THUMB = 0.08  # s, in which a thumb moves a stick
_SETTLES, _MIXING = 8, 0.5
"""Rounds of the induced velocity; least flow through the disc, over the hover's induced one."""
_TOUCH_DOWN, _LAST_METRE = 0.5, 1.0  # m/s, of sinking through the last metre of a landing
_FLYING_SPEED = 0.98  # of the nominal rotor speed, from which on collective is raised
_RAISE_COLLECTIVE, _NEARLY, _LIFT_OFF = 0.5, 0.1, 0.15
"""1/s at which collective goes up on the ground; distance to the hover's, unitised; slower 1/s."""
_CLEAR = 0.03  # m, of clearance, at which the ground is left
_LOWER_COLLECTIVE = 1.0  # 1/s, unitised, at which collective goes down on the ground


class Sight(NamedTuple):
    """The pilot's view at a tick, SI; velocities are over the ground, down positive.

    Attributes:
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
    """The aims of a pilot's outer loops, SI. A script changes them as the flight goes on.

    Attributes:
        holds_place: whether north and east count, else their rates alone.
        holds_height: whether down counts, else its rate alone.
        collective: stick, unitised, in place of what height and climb ask for, unless None.
        tilt: rad, of roll and pitch at most.
        cyclic: whether attitude and heading are held, as they must not be on the ground.
        rotor: commanded rotor speed over the nominal one; 0 cuts a motor's throttle.
        pushed: what is added to the sticks COL, LON, LAT, PED, unitised.
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
    pushed: tuple[float, ...] = (0.0,) * len(AXES)

    def go(self, course: tuple[float, float], speed: float, acceleration: float) -> None:
        """Want a speed, m/s, and an acceleration, m/s^2, north and east along a unit course."""
        self.north_rate, self.east_rate = course[0] * speed, course[1] * speed
        self.north_acceleration = course[0] * acceleration
        self.east_acceleration = course[1] * acceleration

    @property
    def ahead(self) -> tuple[float, float]:
        """North and east components of the heading's unit vector."""
        return math.cos(self.heading), math.sin(self.heading)


Way = tuple[float, Callable[[float], tuple[float, float, float]]]
"""The time it takes, s; distance, speed and acceleration at a time since its beginning, s."""


def _ramp(start: float, end: float, acceleration: float) -> Way:
    if not (math.isfinite(end) and acceleration > 0.0):
        raise InputError(
            "a change of speed needs a finite speed and an acceleration above 0, got "
            f"{end:g} and {acceleration:g}"
        )
    change, lasts = end - start, 0.5 * math.pi * abs(end - start) / acceleration

    def at(time: float) -> tuple[float, float, float]:
        if time >= lasts:
            return 0.5 * (start + end) * lasts + end * (time - lasts), end, 0.0
        half = math.pi * time / lasts
        return (
            start * time + 0.5 * change * (time - lasts / math.pi * math.sin(half)),
            start + 0.5 * change * (1.0 - math.cos(half)),
            0.5 * math.pi / lasts * change * math.sin(half),
        )

    return lasts, at


def _glide(distance: float, speed: float, acceleration: float) -> Way:
    """Return a way from rest to rest: faster, on, slower; a short one has less than the speed."""
    if not (0.0 <= distance < math.inf and speed > 0.0 and acceleration > 0.0):
        raise InputError(
            "a way needs a finite distance, and a speed and an acceleration above 0, got "
            f"{distance:g}, {speed:g} and {acceleration:g}"
        )
    top = min(speed, math.sqrt(2.0 / math.pi * acceleration * distance))
    rising, up = _ramp(0.0, top, acceleration)
    lasts = 0.0 if distance == 0.0 else distance / top + rising

    def at(time: float) -> tuple[float, float, float]:
        left = lasts - time
        if left <= 0.0:
            return distance, 0.0, 0.0
        if left >= 0.5 * lasts:
            return up(time)
        gone, slower, braking = up(left)
        return distance - gone, slower, -braking

    return lasts, at


class OuterLoop:
    """Turns what is wanted into sticks; keeps the integrals of one flight."""

    def __init__(self, vehicle: Vehicle, model: mujoco.MjModel, trim: Trim, rotor: int) -> None:
        par = model.actuator_user[rotor]
        rates = np.array(
            [
                [par[PARAM.gyro_p_per_lat], par[PARAM.gyro_p_per_lon]],
                [par[PARAM.gyro_q_per_lat], par[PARAM.gyro_q_per_lon]],
            ]
        )
        self._theta, self._phi = trim.theta, trim.phi
        self.collective, *centre = trimmed_sticks(vehicle.controller, model, trim)
        self.gravity = float(np.linalg.norm(model.opt.gravity))
        lift = abs(vehicle.derivatives["Z_col"] * float(par[PARAM.gyro_collective]))
        yaw_rate = float(par[PARAM.gyro_k_delta] / par[PARAM.gyro_k_a])
        roll, pitch = (ATTITUDE / np.diagonal(rates)).tolist()
        given = (-HEAVE / lift, pitch, roll, HEADING / yaw_rate)
        ahead, back = on_law(vehicle, given, VELOCITY / self.gravity, POSITION, HEIGHT)
        heave, _, _, heading = (given / back).tolist()
        if (back[1], back[2]) != (pitch, roll):  # a law that hasn't the gyro's coupling
            rates = np.diag(ATTITUDE / back[2:0:-1])
        self._to_cyclic, self._ahead = np.linalg.inv(rates), (ahead - back)[2:0:-1]
        self._tilt, self._centre = _END / max(1e-9, *np.abs(self._ahead)), np.array(centre)
        self._lift, self._yaw_rate = lift * heave, yaw_rate * heading
        self._north = self._east = self._down = 0.0
        self._mass = float(model.body_subtreemass[root_body(model)])
        radius = float(par[PARAM.main_radius])
        self._weight = self._mass * self.gravity
        self._tip_speed = float(par[PARAM.main_speed]) * radius
        self._area = float(par[PARAM.air_density]) * math.pi * radius**2
        self._blades = 0.5 * float(par[PARAM.main_lift_slope] * par[PARAM.main_solidity])
        self._travel = float(par[PARAM.main_pitch_range] * par[PARAM.gyro_collective]) * heave
        self._induced, self._offset = math.sqrt(self._weight / (2.0 * self._area)), 0.0
        hover, *_ = trimmed_sticks(vehicle.controller, model, vehicle.trim)
        self._offset = hover - self.lifting(0.0, 1.0, 0.0, 0.0)

    def lifting(self, push: float, speed: float, through: float, across: float) -> float:
        """Return where the collective stick makes a thrust, unitised, by blade element.

        It pushes, m/s^2, beside the weight, at a relative rotor speed, in air that flows up through
        the disc and across, m/s.
        """
        thrust = self._weight + self._mass * push
        tip, least, induced = speed * self._tip_speed, _MIXING * self._induced, self._induced
        for _ in range(_SETTLES):
            flow = math.hypot(across, max(least, abs(induced - through)))
            induced = 0.5 * (induced + thrust / (2.0 * self._area * flow))
        coefficient = thrust / (self._area * tip**2)
        pitch = 3.0 * (coefficient / self._blades + 0.5 * (induced - through) / tip)
        return self._offset + pitch / self._travel

    def sticks(self, seen: Sight, wanted: Wanted, seconds: float) -> tuple[float, ...]:
        """Return COL, LON, LAT, PED, unitised, that are held for some seconds."""
        col = self._col(seen, wanted, seconds) if wanted.collective is None else wanted.collective
        if not wanted.cyclic:
            return _limited(col, _END), 0.0, 0.0, 0.0
        phi, theta = self._attitude(seen, wanted, seconds)
        return _limited(col, _END), *self._cyclic_and_pedal(seen.motion, wanted, phi, theta)

    def _col(self, seen: Sight, wanted: Wanted, seconds: float) -> float:
        catch_up = HEIGHT * (wanted.down - seen.motion.down) if wanted.holds_height else 0.0
        off = wanted.down_rate + _limited(catch_up, _CATCH_UP_VERTICALLY) - seen.down_rate
        upright = max(0.5, math.cos(seen.motion.phi) * math.cos(seen.motion.theta))
        lift = self.gravity * (1.0 / upright - 1.0) - (HEAVE * off + self._down) / upright
        col = self.collective + lift / self._lift
        if abs(col) < _END or off * (col - self.collective) > 0.0:  # it doesn't wind up
            self._down += seconds * HEAVE * _LIFTING * off
        return col

    def _attitude(self, seen: Sight, wanted: Wanted, seconds: float) -> tuple[float, float]:
        north_off, east_off = wanted.north_rate - seen.north_rate, wanted.east_rate - seen.east_rate
        if wanted.holds_place:
            far = (wanted.north - seen.motion.north, wanted.east - seen.motion.east)
            share = min(1.0, _CATCH_UP / max(1e-9, POSITION * math.hypot(*far)))
            north_off += share * POSITION * far[0]
            east_off += share * POSITION * far[1]
        north = wanted.north_acceleration + VELOCITY * north_off + self._north
        east = wanted.east_acceleration + VELOCITY * east_off + self._east
        cosine, sine = math.cos(seen.motion.psi), math.sin(seen.motion.psi)
        ahead, right = cosine * north + sine * east, cosine * east - sine * north
        most = self.gravity * math.tan(min(wanted.tilt, self._tilt))
        share = min(1.0, most / max(1e-9, math.hypot(ahead, right)))
        if share == 1.0:
            self._north += seconds * VELOCITY * _TRIMMING * north_off
            self._east += seconds * VELOCITY * _TRIMMING * east_off
        theta = self._theta - math.atan(share * ahead / self.gravity)
        return self._phi + math.atan(share * right / self.gravity * math.cos(theta)), theta

    def _cyclic_and_pedal(
        self, now: Motion, wanted: Wanted, phi: float, theta: float
    ) -> tuple[float, float, float]:
        psi_off = math.remainder(wanted.heading - now.psi, 2.0 * math.pi)
        fastest = _YAW_SHARE * _END * abs(self._yaw_rate)
        psi_rate = _limited(wanted.turning + HEADING * psi_off, fastest)
        phi_rate = _limited(ATTITUDE * (phi - now.phi), _TURN)
        theta_rate = _limited(ATTITUDE * (theta - now.theta), _TURN)
        level, sine, cosine = math.cos(now.theta), math.sin(now.phi), math.cos(now.phi)
        p = phi_rate - psi_rate * math.sin(now.theta)
        q = theta_rate * cosine + psi_rate * level * sine
        r = psi_rate * level * cosine - theta_rate * sine
        lean = self._ahead * (phi - self._phi, theta - self._theta) + self._centre[1::-1]
        lat, lon = (float(one) for one in self._to_cyclic @ (p, q) + lean)
        return (
            _limited(lon, _END),
            _limited(lat, _END),
            _limited(r / self._yaw_rate + float(self._centre[2]), _END),
        )


def _limited(value: float, most: float) -> float:
    return min(most, max(-most, value))


class Autopilot:
    """Flies what a script asks for, 50 times a second.

    A script says `yield from pilot.go(10.0, 0.0)`, or changes `wanted` itself and yields for each
    tick of 20 ms. Heights are those of the vehicle's origin.

    Attributes:
        wanted: what the outer loops are to reach.
        phases: times, s, and what the script said then.
        moved: the sticks COL, LON, LAT, PED at the last tick, unitised.
        rng: random numbers, of the flight's seed.
    """

    def __init__(self, loop: OuterLoop, seen: Sight, seconds: float, seed: int = 0) -> None:
        self.loop, self.seconds, self.seen, now = loop, seconds, seen, seen.motion
        self.rng = np.random.default_rng(seed)
        self.wanted = Wanted(now.north, now.east, now.down, seen.north_rate, seen.east_rate)
        self.wanted.heading = now.psi
        self.phases: list[tuple[float, str]] = []
        self.moved: tuple[float, ...] = (loop.collective, 0.0, 0.0, 0.0)

    def carrying_collective(self, push: float) -> float:
        """Return the collective stick, unitised, that carries weight and a push, m/s^2, now."""
        now, speed = self.seen.motion, max(0.5, self.seen.rotor_speed)
        return self.loop.lifting(push, speed, now.w, math.hypot(now.u, now.v))

    def say(self, phase: str) -> None:
        """Note a phase that begins now; records show it."""
        self.phases.append((round(self.seen.time, 6), phase))

    def sticks(self, seen: Sight) -> tuple[float, ...]:
        """Return COL, LON, LAT, PED for what is seen now, unitised."""
        added = zip(self.loop.sticks(seen, self.wanted, self.seconds), self.wanted.pushed)
        self.moved = tuple(_limited(stick + push, _END) for stick, push in added)
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

    def push(self, axis: str, by: float, seconds: float) -> Iterator[None]:
        """Push a stick, "col", "lon", "lat" or "ped", unitised, for some seconds, then let go.

        It moves as fast as a thumb does. After a push of the pedals it holds the heading that it
        then has.
        """
        for number, _ in enumerate(self.hold(seconds + _THUMB)):
            moves = min(number * self.seconds, seconds + _THUMB - number * self.seconds, _THUMB)
            self.wanted.pushed = tuple(by * moves / _THUMB if one == axis else 0.0 for one in AXES)
            if axis == "ped":
                self.wanted.heading = self.seen.motion.psi
            yield
        self.wanted.pushed = (0.0,) * len(AXES)

    def climb(self, height: float, *, rate: float = 1.5) -> Iterator[None]:
        """Climb or sink to a height, m above the ground, at a rate, m/s."""
        way = -height - self.wanted.down
        yield from self._move("down", "down_rate", way, _glide(abs(way), rate, rate))

    def go(
        self, north: float, east: float, *, speed: float = 4.0, acceleration: float = 1.5
    ) -> Iterator[None]:
        """Fly from rest straight to a place, m, and stop there; speed, m/s, and m/s^2 at most."""
        far = (north - self.wanted.north, east - self.wanted.east)
        distance = math.hypot(*far)
        course = (far[0] / max(distance, 1e-9), far[1] / max(distance, 1e-9))
        yield from self._follow(course, _glide(distance, speed, acceleration))

    def accelerate(self, speed: float, *, acceleration: float = 2.0) -> Iterator[None]:
        """Reach a speed over the ground, m/s, in the direction of the heading wanted now."""
        course = self.wanted.ahead
        before = course[0] * self.wanted.north_rate + course[1] * self.wanted.east_rate
        yield from self._follow(course, _ramp(before, speed, acceleration))

    def _follow(self, course: tuple[float, float], way: Way) -> Iterator[None]:
        wanted, north, east = self.wanted, self.wanted.north, self.wanted.east
        for distance, speed, acceleration in self._along(way):
            wanted.north, wanted.east = north + course[0] * distance, east + course[1] * distance
            wanted.go(course, speed, acceleration)
            yield

    def turn(self, angle: float, *, rate: float = 1.0) -> Iterator[None]:
        """Turn on the spot by an angle, rad, to the right if positive, at a rate, rad/s."""
        yield from self._move("heading", "turning", angle, _glide(abs(angle), rate, 2.0 * rate))

    def _move(self, name: str, rate: str, towards: float, way: Way) -> Iterator[None]:
        start = getattr(self.wanted, name)
        for distance, speed, _ in self._along(way):
            setattr(self.wanted, name, start + math.copysign(distance, towards))
            setattr(self.wanted, rate, math.copysign(speed, towards))
            yield

    def take_off(self, height: float, *, rate: float = 1.0) -> Iterator[None]:
        """Climb from the ground to a height, m, at a rate, m/s, once the rotor is at its speed."""
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

    def _along(self, way: Way) -> Iterator[tuple[float, float, float]]:
        lasts, at = way
        for k in range(1, math.ceil(lasts / self.seconds - 1e-9) + 1):
            yield at(min(k * self.seconds, lasts))
