"""The limits of every flight: the model's envelope, the ground, a finite state."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.settings import Checked, setting, setting_names
from helisim.records.record import IN2, SERVOS
from helisim.sim.ground import Ground, Outline, outline
from helisim.sim.recorder import End, Trajectory
from helisim.vehicle import Vehicle
from helisim.vehicle.addresses import root_body

HARDEST_LANDING = 2.5
"""m/s, of sinking, that landing gear stands: a drop from 13 inches (14 CFR 27.725)."""
# _STOP: of a stick or a command, unitised; the mixing may leave it a rounding short
# _WINDOW: s, in which what is at its limit is added up
_STOP, _WINDOW = 0.5 - 1e-9, 10.0
# _FULL_RATE: share of a servo's rate limit that counts as all: over a step it is a mean
# _FASTEST: m/s, at which a rim nears the ground: until then it isn't looked for again
_FULL_RATE, _FASTEST = 0.999, 10.0

Flags = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class FlightEnvelope(Checked):
    """Limits beyond which a flight is terminated early; None for any lets it go on.

    Attributes:
        tilt: greatest roll or pitch angle, rad.
        rate: greatest rate about a body axis, rad/s.
        clearance: least height of landing gear and rotor discs, m; where a plan has a ground, of
            the discs alone.
        touchdown: greatest speed of the gear towards the ground as it touches, m/s.
        flapping: greatest tilt of the disc, over that at which the head's dampers bottom.
        descent: greatest speed down along the shaft, over the hover's induced velocity; it counts
            while the airspeed across the shaft is below that velocity. A vortex ring is unsteady
            from 0.7 to 2 (Leishman, chapter 2). Autorotations need None.
        advance: greatest airspeed across the shaft, over the speed of the blades' tips. Reverse
            flow, which the force laws don't know, is small up to 0.3 (Leishman, chapter 2).
        charge: least share of the battery's capacity that is left, where a battery feeds the motor.
        saturation: longest time of any 10 s, s, that a stick or a command may be at its stop, or a
            servo at its rate limit.
    """

    tilt: float | None = setting(1.2, unit="rad", above=0.0)
    rate: float | None = setting(20.0, unit="rad/s", above=0.0)
    clearance: float | None = setting(0.0, unit="m", low=0.0)
    touchdown: float | None = setting(HARDEST_LANDING, unit="m/s", above=0.0, unsaid=True)
    flapping: float | None = setting(1.0, above=0.0)
    descent: float | None = setting(2.0, above=0.0)
    advance: float | None = setting(0.3, above=0.0)
    charge: float | None = setting(0.0, low=0.0, high=1.0, unsaid=True)
    saturation: float | None = setting(1.0, unit="s", above=0.0, high=_WINDOW)

    @classmethod
    def off(cls) -> "FlightEnvelope":
        """Return an envelope without limits; a flight still needs finite states."""
        return cls(**dict.fromkeys(setting_names(cls)))

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
            raise End(float(trajectory.time[found[0]]), found[1]).error()

    def _beyond(self, vehicle: Vehicle, flight: Trajectory) -> Iterator[tuple[str, Flags]]:
        limits, ground, touching = Limits(self, vehicle), flight.ground, flight.touching
        positions = flight.positions if ground is None else None
        through = flight.velocities - flight.air[:, :3]
        motion = (flight.attitudes, flight.rates, positions, flight.flapping, through)
        yield from ((what, beyond) for _, what, beyond in limits.beyond(*motion))
        if ground is not None and self.clearance is not None:
            for name, rim in limits.shape.rims():
                heights = point_heights(ground, flight, rim)
                yield (
                    f"struck the ground with its {name} rotor",
                    heights.min(axis=1) < self.clearance,
                )
            if ground.deck is not None:
                water = flight.positions - [0.0, 0.0, ground.deck.above]
                beside = limits.shape.closer_than(0.0, water, flight.attitudes)
                yield "came down beside the deck", beside
        if ground is not None and self.touchdown is not None:
            yield from _hard_landings(limits.shape, ground, flight, self.touchdown)
        if self.charge is not None and flight.battery is not None:
            least = f" to {self.charge:.0%}" if self.charge else ""
            yield f"emptied its battery{least}", flight.battery[:, 2] <= self.charge
        if self.saturation is not None:
            window = f"{self.saturation:g} s of {_WINDOW:g} s"
            count = max(1, round(_WINDOW / flight.timestep))
            for name, at_limit in at_limits(vehicle, flight):
                up = np.concatenate([[0], np.cumsum(at_limit & ~touching)])  # aloft
                if up[-1] * flight.timestep > self.saturation:
                    before = np.maximum(np.arange(1, up.size) - count, 0)
                    lasts = flight.timestep * (up[1:] - up[before])
                    yield f"had {name} at its limit for {window}", lasts > self.saturation


class Limits:
    """A `FlightEnvelope` for one vehicle; positions are of its IMU or, `of_origin`, its origin."""

    def __init__(
        self, envelope: FlightEnvelope, vehicle: Vehicle, *, of_origin: bool = False
    ) -> None:
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
        """Yield each limit's name, text where it is exceeded, and where that is, (n_time,).

        Attitudes, rad, rates, rad/s, positions, m NED (None: no clearance counts), and `through`,
        body velocity through the air, m/s, are (n_time, 3) each; flapping is (n_time, 2), rad.
        """
        limit = self._envelope
        across = np.hypot(through[:, 0], through[:, 1])
        if limit.clearance is not None and positions is not None:
            near = self.shape.closer_than(limit.clearance, positions, attitudes)
            low = f"came within {limit.clearance:g} m of the ground"
            yield "clearance", low if limit.clearance else "touched the ground", near
        for name, how, most, size, counts in (
            ("tilt", "rolled or pitched beyond {} rad", 1.0, attitudes[:, :2], True),
            ("rate", "turned faster than {} rad/s", 1.0, rates, True),
            ("flapping", "flapped beyond {} rad", self._flap_stop, flapping, True),
            (
                "descent",
                "sank at more than {0} m/s, {1:g} times the hover's induced velocity",
                self._induced,
                np.maximum(through[:, 2:], 0.0),
                across < self._induced,
            ),
            ("advance", "flew beyond an advance ratio of {}", self._tip, across[:, None], True),
        ):
            if (own := getattr(limit, name)) is not None:
                shown = own if name == "advance" else own * most
                beyond = (np.abs(size.T, order="C").max(axis=0) > own * most) & counts
                yield name, how.format(f"{shown:.3g}", own), beyond


class Contact:
    """Finds the end of a flight over a ground as it goes on: a rotor's strike or a hard landing."""

    def __init__(self, vehicle: Vehicle, ground: Ground) -> None:
        shape = outline(vehicle)
        self._ground, self._gear, self._radii = ground, shape.points, shape.radii
        self._rims = dict(shape.rims())
        self.begin()

    def begin(self) -> None:
        """Begin a new flight."""
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
        """Return why the flight ends now, "" if it goes on; the time is in s.

        The position of the IMU, (3,) m, is north, east, down; `turn`, (3, 3), from FRD to NED axes.
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
        struck = [name for name, above in clear.items() if above < 0]
        return f"the {struck[0]} rotor struck the ground" if struck else ""

    def _heights(
        self,
        time: float,
        position: NDArray[np.float64],
        turn: NDArray[np.float64],
        points: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        return self._ground.heights(np.array([time]), (position + points @ turn.T)[None])[0]


def broken(data: mujoco.MjData) -> bool:
    """Return whether a flight has no finite state, or MuJoCo warns of it."""
    return not np.isfinite(data.qpos).all() or any(one.number for one in data.warning)


def point_heights(
    ground: Ground, trajectory: Trajectory, points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return how high points (n_point, 3) from the IMU, m, are above the ground, (n, n_point)."""
    turned = np.einsum("tij,nj->tni", trajectory.earth.as_matrix(), points)
    return ground.heights(trajectory.time, trajectory.positions[:, None] + turned)


def _hard_landings(
    shape: Outline, ground: Ground, trajectory: Trajectory, limit: float
) -> Iterator[tuple[str, Flags]]:
    touches = trajectory.touching
    starts = np.flatnonzero(touches[1:] & ~touches[:-1]) + 1
    gear = (point_heights(ground, trajectory, shape.points) - shape.radii).min(axis=1)
    for start in starts[starts >= 2]:
        speed = float(gear[start - 2] - gear[start - 1]) / trajectory.timestep
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
    swash = trajectory.servo_commands[:, :3]
    _, commands["lon"], commands["lat"] = trajectory.swashplate.unmix(*swash.T)
    for name, command in commands.items():
        yield name, np.abs(command) >= _STOP
    limit = _FULL_RATE * vehicle.parameters["servo.rate_limit"] * trajectory.timestep
    positions = trajectory.servo_positions
    for name, steps in zip(SERVOS, np.abs(np.diff(positions, axis=0, prepend=positions[:1])).T):
        yield name, steps >= limit
