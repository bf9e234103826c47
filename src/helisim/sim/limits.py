"""The limits of every flight: the envelope that a model is valid in, the ground, a finite state.

`FlightEnvelope.end` holds them against a whole trajectory, `Limits` against many helicopters at an
instant, `Contact` against one flight as it goes on.
"""

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.base.settings import check, setting
from helisim.records.record import IN2, SERVOS
from helisim.sim.ground import Ground, Outline, outline
from helisim.sim.recorder import End, Trajectory
from helisim.vehicle import Vehicle
from helisim.vehicle.trim import root_body

HARDEST_LANDING = 2.5
"""m/s, of sinking, that landing gear stands: a drop from 13 inches (14 CFR 27.725)."""
_JUST = 0.2  # s after which a helicopter that has left the ground is in the air
_STOP = 0.5 - 1e-9
"""Of a stick, and of what the gyro commands, unitised; the mixing may leave it a rounding short."""
_FULL_RATE = 0.999
"""Share of a servo's rate limit that counts as all of it: over a step it is a mean."""
_FASTEST = 10.0  # m/s, at which a rim nears the ground: until then it isn't looked for again

Flags = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class FlightEnvelope:
    """Limits beyond which a flight is terminated early. None, for any of them, lets it go on.

    A flight without finite state, or of whose state MuJoCo warns, is terminated in any case. Limits
    are held against what was flown, so a flight within them is the same to the bit with any others.

    Attributes:
        tilt: rad, of roll or pitch; beyond it the hover's small angles, and the pilot, are lost.
        rate: rad/s, of any axis.
        clearance: m, between the ground and the lowest point of landing gear and rotor discs;
            where the plan has a ground, of the discs alone: landing gear is to touch it.
        touchdown: m/s, at which landing gear meets a plan's ground. It stands a drop from 13
            inches (14 CFR 27.725).
        flapping: of the tip-path plane, in tilts at which the head's dampers bottom.
        descent: through the air along the shaft, in induced velocities of the hover, slower than
            one of which the flight is across it. A vortex ring forms from 0.7 on and is unsteady
            (Leishman, Principles of Helicopter Aerodynamics, chapter 2), of which the force laws
            know the mean; at 2 the windmill state begins, which they know again: an autorotation
            is flown without this limit, a flight that means to hover has lost it.
        advance: ratio of the airspeed across the shaft to that of the blades' tips. Up to 0.3 the
            reverse flow, which the force laws don't know, is small (Leishman, chapter 2).
        saturation: s out of `saturation_window` that a stick or a command is at its stop, or
            a servo at its rate limit. ArduPilot takes a second of full throttle for lost thrust
            (`crash_check.cpp`).
        saturation_window: s. A limit cycle is at its limits a quarter of the time, so a window of
            ten seconds shows it too.
    """

    tilt: float | None = setting(1.2, unit="rad", above=0.0)
    rate: float | None = setting(20.0, unit="rad/s", above=0.0)
    clearance: float | None = setting(0.0, unit="m", low=0.0)
    touchdown: float | None = setting(HARDEST_LANDING, unit="m/s", above=0.0, unsaid=True)
    flapping: float | None = setting(1.0, above=0.0)
    descent: float | None = setting(2.0, above=0.0)
    advance: float | None = setting(0.3, above=0.0)
    saturation: float | None = setting(1.0, unit="s", above=0.0)
    saturation_window: float = setting(10.0, unit="s", above=0.0)

    def __post_init__(self) -> None:
        check(self)
        if self.saturation is not None and self.saturation > self.saturation_window:
            raise InputError(
                f"envelope: saturation of {self.saturation:g} s doesn't fit into a window of "
                f"{self.saturation_window:g} s"
            )

    @classmethod
    def off(cls) -> "FlightEnvelope":
        """Return an envelope without limits; a flight still needs finite states."""
        unlimited: dict[str, Any] = dict.fromkeys(asdict(cls()))
        del unlimited["saturation_window"]
        return cls(**unlimited)

    def end(self, vehicle: Vehicle, trajectory: Trajectory) -> tuple[int, str] | None:
        """Return the first sample beyond a limit and what happened there, None if there is none."""
        found = [
            (int(np.argmax(beyond)), f"the helicopter {what}")
            for what, beyond in self._beyond(vehicle, trajectory)
            if beyond.any()
        ]
        return min(found, default=None)

    def check(self, vehicle: Vehicle, trajectory: Trajectory) -> None:
        """Raise DivergedError if a limit is exceeded."""
        found = self.end(vehicle, trajectory)
        if found is not None:
            raise End(float(trajectory.time[found[0]]), found[1], np.empty(0)).error()

    def _beyond(self, vehicle: Vehicle, flight: Trajectory) -> Iterator[tuple[str, Flags]]:
        """Yield what each limit says where it is exceeded, and at which samples, (n_time,)."""
        limits, ground, touching = Limits(self, vehicle), flight.ground, flight.touching
        just = round(_JUST / flight.timestep)

        def rolled(there: Flags) -> bool:
            """Return whether something was touched just before a flag goes up."""
            first = int(np.argmax(there))
            return bool(touching[max(0, first - just) : first + 1].any())

        for name, what, beyond in limits.beyond(
            flight.attitudes,
            flight.rates,
            flight.positions if ground is None else None,
            flight.flapping,
            flight.velocities - flight.air[:, :3],
        ):
            tipped = name == "tilt" and ground is not None and rolled(beyond)
            yield what.replace("rolled or pitched", "tipped over") if tipped else what, beyond
        if ground is not None and self.clearance is not None:
            for name, struck in _strikes(limits.shape, ground, flight, self.clearance):
                over = "tipped over and " if struck.any() and rolled(struck) else ""
                yield f"{over}struck the ground with its {name} rotor", struck
            if ground.deck is not None:
                water = flight.positions - [0.0, 0.0, ground.deck.above]
                beside = limits.shape.closer_than(0.0, water, flight.attitudes)
                yield "came down beside the deck", beside
        if ground is not None and self.touchdown is not None:
            yield from _hard_landings(limits.shape, ground, flight, self.touchdown)
        if self.saturation is not None:
            window = f"{self.saturation:g} s of {self.saturation_window:g} s"
            count = max(1, round(self.saturation_window / flight.timestep))
            for name, at_limit in at_limits(vehicle, flight):
                up = np.concatenate([[0], np.cumsum(at_limit & ~touching)])  # aloft
                if up[-1] * flight.timestep > self.saturation:
                    before = np.maximum(np.arange(1, up.size) - count, 0)
                    lasts = flight.timestep * (up[1:] - up[before])
                    yield f"had {name} at its limit for {window}", lasts > self.saturation


class Limits:
    """A `FlightEnvelope` for one vehicle, held against any number of samples or helicopters.

    Attributes:
        shape: what of the vehicle can touch the ground, from where positions are of.
    """

    def __init__(
        self, envelope: FlightEnvelope, vehicle: Vehicle, *, of_origin: bool = False
    ) -> None:
        """Take the limits of a vehicle, of positions of its IMU or, `of_origin`, of its origin."""
        own, shape = vehicle.parameters, outline(vehicle)
        self.shape = shape.moved(np.array(vehicle.imu_offset)) if of_origin else shape
        self._envelope, self._induced = envelope, hover_induced_velocity(vehicle)
        self._tip = own["main_rotor.speed"] * own["main_rotor.radius"]
        self._flap_stop = own["main_rotor.flap_stop"]

    def beyond(
        self,
        attitudes: NDArray[np.float64],
        rates: NDArray[np.float64],
        positions: NDArray[np.float64] | None,
        flapping: NDArray[np.float64],
        through: NDArray[np.float64],
    ) -> Iterator[tuple[str, str, Flags]]:
        """Yield each limit's name, what it says where it is exceeded, and where that is, (n,).

        Args:
            attitudes: (n, 3) phi, theta, psi, rad.
            rates: (n, 3) p, q, r, rad/s.
            positions: (n, 3) north, east, down, m, above height 0; None where no clearance counts.
            flapping: (n, 2) rad.
            through: (n, 3) velocity through the air, body axes, m/s.
        """
        limit = self._envelope
        if limit.tilt is not None:
            tilt = np.abs(attitudes[:, :2]).max(axis=1) > limit.tilt
            yield "tilt", f"rolled or pitched beyond {limit.tilt:g} rad", tilt
        if limit.rate is not None:
            rate = np.abs(rates).max(axis=1) > limit.rate
            yield "rate", f"turned faster than {limit.rate:g} rad/s", rate
        if limit.clearance is not None and positions is not None:
            near = self.shape.closer_than(limit.clearance, positions, attitudes)
            low = f"came within {limit.clearance:g} m of the ground"
            yield "clearance", low if limit.clearance else "touched the ground", near
        if limit.flapping is not None:
            most = limit.flapping * self._flap_stop
            flapped = np.abs(flapping).max(axis=1) > most
            yield "flapping", f"flapped beyond {most:.3g} rad", flapped
        across = np.hypot(through[:, 0], through[:, 1])
        if limit.descent is not None:
            fastest = limit.descent * self._induced
            sinking = (through[:, 2] > fastest) & (across < self._induced)
            yield (
                "descent",
                f"sank at more than {limit.descent:g} times the hover's induced velocity, "
                f"{fastest:.3g} m/s",
                sinking,
            )
        if limit.advance is not None:
            fast = across > limit.advance * self._tip
            yield "advance", f"flew beyond an advance ratio of {limit.advance:g}", fast


class Contact:
    """Finds the end of a flight over a ground as it goes on: a rotor's strike or a hard landing.

    For flights that a hand or an autopilot's frames command: ask `found` after each step or frame.
    It looks where the rotors are as seldom as their clearance allows.
    """

    def __init__(self, vehicle: Vehicle, ground: Ground) -> None:
        """Take the shape of a vehicle and the ground below it."""
        shape = outline(vehicle)
        self._ground, self._gear, self._radii = ground, shape.points, shape.radii
        self._rims = dict(shape.rims())
        self.begin()

    def begin(self) -> None:
        """Forget what was: a new flight begins."""
        self._next, self._touched = 0.0, False
        self._seen: list[tuple[float, NDArray[np.float64], NDArray[np.float64]]] = []

    def clearance(
        self, time: float, position: NDArray[np.float64], turn: NDArray[np.float64]
    ) -> float:
        """Return how high the landing gear is, m; position (3,), turn (3, 3): see `found`."""
        gear = self._heights(time, position, turn, self._gear) - self._radii
        return float(gear.min(initial=np.inf))

    def found(
        self,
        time: float,
        position: NDArray[np.float64],
        turn: NDArray[np.float64],
        touches: bool,
    ) -> str:
        """Return why the flight ends now, "" if it goes on.

        Args:
            time: s.
            position: (3,) of the IMU, north, east, down, m.
            turn: (3, 3) rotation from body (FRD) to earth (NED) axes.
            touches: whether anything touches the ground.
        """
        before, self._seen = self._seen, [*self._seen[-1:], (time, position, turn)]
        first, self._touched = touches and not self._touched, touches
        if first and len(before) == 2:
            high, low = (self.clearance(*one) for one in before)
            sinking = (high - low) / (before[1][0] - before[0][0])
            if sinking > HARDEST_LANDING:
                return f"the helicopter hit the ground at {sinking:.1f} m/s"
        if time < self._next:
            return ""
        clear = {
            name: float(self._heights(time, position, turn, rim).min())
            for name, rim in self._rims.items()
        }
        self._next = time + min(clear.values()) / _FASTEST
        return next(
            (f"the {name} rotor struck the ground" for name in clear if clear[name] < 0), ""
        )

    def _heights(
        self,
        time: float,
        position: NDArray[np.float64],
        turn: NDArray[np.float64],
        points: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Return how high points (n, 3) from the IMU, body axes, are above the ground, (n,)."""
        return self._ground.heights(np.array([time]), (position + points @ turn.T)[None])[0]


def broken(data: mujoco.MjData) -> bool:
    """Return whether a flight has no finite state, or MuJoCo warns of it."""
    return not np.isfinite(data.qpos).all() or any(one.number for one in data.warning)


def point_heights(
    ground: Ground, trajectory: Trajectory, points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return how high points of the vehicle are above what is below, (n_time, n_point), m.

    Points are (n_point, 3) from the vehicle's IMU, m, body axes.
    """
    turned = np.einsum("tij,nj->tni", trajectory.earth.as_matrix(), points)
    return ground.heights(trajectory.time, trajectory.positions[:, None] + turned)


def _strikes(
    shape: Outline, ground: Ground, trajectory: Trajectory, least: float
) -> Iterator[tuple[str, Flags]]:
    """Yield each rotor's name and where its disc is nearer than `least`, m, (n_time,)."""
    imu = ground.heights(trajectory.time, trajectory.positions[:, None])[:, 0]
    low = imu < least + shape.reach
    for name, rim in shape.rims() if low.any() else ():
        near = np.zeros_like(low)
        near[low] = point_heights(ground, trajectory.rows(low), rim).min(axis=1) < least
        yield name, near


def _hard_landings(
    shape: Outline, ground: Ground, trajectory: Trajectory, limit: float
) -> Iterator[tuple[str, Flags]]:
    """Yield what the first touch-down is that is faster than a limit, m/s, and from where on.

    The speed is that at which the lowest point of the landing gear came down on the ground, a
    deck's own motion counted.
    """
    touches = trajectory.touching
    starts = np.flatnonzero(touches[1:] & ~touches[:-1]) + 1
    for start in starts[starts >= 2]:
        near = trajectory.rows(slice(start - 2, start))
        gear = (point_heights(ground, near, shape.points) - shape.radii).min(axis=1)
        speed = float(gear[0] - gear[1]) / trajectory.timestep
        if speed > limit:
            yield f"hit the ground at {speed:.1f} m/s", np.arange(touches.size) >= start
            return


def hover_induced_velocity(vehicle: Vehicle) -> float:
    """Return the induced velocity that carries the weight out of the ground's effect, m/s."""
    own, model = vehicle.parameters, vehicle.model
    weight = model.body_subtreemass[root_body(model)] * np.linalg.norm(model.opt.gravity)
    disc = math.pi * own["main_rotor.radius"] ** 2
    return float(math.sqrt(weight / (2.0 * own["air.density"] * disc)))


def at_limits(vehicle: Vehicle, trajectory: Trajectory) -> Iterator[tuple[str, Flags]]:
    """Yield the name of each stick, command and servo that may be at its limit, and where, (n,)."""
    commands = dict(zip(IN2, trajectory.sticks.T)) | {"ped": trajectory.servo_commands[:, 3]}
    plate, swash = trajectory.swashplate, trajectory.servo_commands[:, :3]
    if np.abs(swash).max() >= plate.least_travel(_STOP):
        _, commands["lon"], commands["lat"] = plate.unmix(*swash.T)
    for name, command in commands.items():
        yield name, np.abs(command) >= _STOP
    limit = _FULL_RATE * vehicle.parameters["servo.rate_limit"] * trajectory.timestep
    positions = trajectory.servo_positions
    moved = np.abs(np.diff(positions, axis=0, prepend=positions[:1]))
    for name, steps in zip(SERVOS, moved.T):
        yield name, steps >= limit
