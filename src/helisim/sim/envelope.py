"""The flight envelope: where a flight leaves what the model is valid for, it is terminated.

Limits are held against the trajectory that was flown, so a flight within them is the same to the
bit with any others.
"""

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import DivergedError, InputError
from helisim.records.channels import IN2, SERVOS
from helisim.sim.clearance import Outline, outline
from helisim.sim.ground import Ground
from helisim.sim.landing import (
    HARDEST_LANDING,
    ditchings,
    hard_landings,
    strikes,
    touched_before,
    touching,
)
from helisim.sim.plain import UNSAID
from helisim.sim.trajectory import Trajectory
from helisim.vehicle import Vehicle
from helisim.vehicle.motion import root_body

_STOP = 0.5
"""Of a stick, and of what the gyro commands: unitised."""
_ROUNDING = 1e-9
"""By which the mixing may leave a command short of its stop."""
_FULL_RATE = 0.999
"""Share of a servo's rate limit that counts as all of it: over a step it is a mean."""


@dataclass(frozen=True, kw_only=True)
class FlightEnvelope:
    """Limits beyond which a flight is terminated early. None, for any of them, lets it go on.

    A flight without finite state, or of whose state MuJoCo warns, is terminated in any case.

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

    tilt: float | None = 1.2
    rate: float | None = 20.0
    clearance: float | None = 0.0
    touchdown: float | None = field(default=HARDEST_LANDING, metadata=UNSAID)
    flapping: float | None = 1.0
    descent: float | None = 2.0
    advance: float | None = 0.3
    saturation: float | None = 1.0
    saturation_window: float = 10.0

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if value is None and name != "saturation_window":
                continue
            if value is None or not (math.isfinite(value) and value >= 0.0):
                raise InputError(f"envelope: {name} must be a number, 0 or more, got {value}")
            if value == 0.0 and name != "clearance":
                raise InputError(f"envelope: {name} must be above 0, got {value}")
        if self.saturation is not None and self.saturation > self.saturation_window:
            raise InputError(
                f"envelope: saturation of {self.saturation:g} s doesn't fit into a window of "
                f"{self.saturation_window:g} s"
            )

    @classmethod
    def off(cls) -> "FlightEnvelope":
        """Return an envelope without limits; a flight still needs finite states."""
        return cls(
            tilt=None,
            rate=None,
            clearance=None,
            touchdown=None,
            flapping=None,
            descent=None,
            advance=None,
            saturation=None,
        )

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
            raise terminated_early(trajectory.time[found[0]], found[1])

    def _beyond(
        self, vehicle: Vehicle, trajectory: Trajectory
    ) -> Iterator[tuple[str, NDArray[np.bool_]]]:
        """Yield what each limit says where it is exceeded, and at which samples, (n_time,)."""
        ground, shape = trajectory.ground, outline(vehicle)
        if self.tilt is not None:
            tilt = np.abs(trajectory.attitudes[:, :2]).max(axis=1) > self.tilt
            tipped = ground is not None and touched_before(trajectory, tilt)
            yield (
                f"{'tipped over' if tipped else 'rolled or pitched'} beyond {self.tilt:g} rad",
                tilt,
            )
        if self.rate is not None:
            rate = np.abs(trajectory.rates).max(axis=1)
            yield f"turned faster than {self.rate:g} rad/s", rate > self.rate
        if ground is not None:
            yield from self._beyond_ground(shape, ground, trajectory)
        elif self.clearance is not None:
            positions, attitudes = trajectory.positions, trajectory.attitudes
            near = shape.closer_than(self.clearance, positions, attitudes)
            low = f"came within {self.clearance:g} m of the ground"
            yield low if self.clearance else "touched the ground", near
        if self.flapping is not None:
            limit = self.flapping * vehicle.parameters["main_rotor.flap_stop"]
            yield f"flapped beyond {limit:.3g} rad", np.abs(trajectory.flapping).max(axis=1) > limit
        yield from self._beyond_momentum_theory(vehicle, trajectory)
        if self.saturation is not None:
            window = f"{self.saturation:g} s of {self.saturation_window:g} s"
            aloft = ~touching(trajectory)  # on the ground a stick may lie at its stop
            for name, at_limit in at_limits(vehicle, trajectory):
                at_limit = at_limit & aloft
                if np.count_nonzero(at_limit) * trajectory.timestep > self.saturation:
                    times = _time_in_window(at_limit, self.saturation_window, trajectory.timestep)
                    yield f"had {name} at its limit for {window}", times > self.saturation

    def _beyond_ground(
        self, shape: Outline, ground: Ground, trajectory: Trajectory
    ) -> Iterator[tuple[str, NDArray[np.bool_]]]:
        if self.clearance is not None:
            yield from strikes(shape, ground, trajectory, self.clearance)
            yield from ditchings(shape, ground, trajectory)
        if self.touchdown is not None:
            yield from hard_landings(shape, ground, trajectory, self.touchdown)

    def _beyond_momentum_theory(
        self, vehicle: Vehicle, trajectory: Trajectory
    ) -> Iterator[tuple[str, NDArray[np.bool_]]]:
        motion = trajectory.velocities - trajectory.air[:, :3]
        across = np.hypot(motion[:, 0], motion[:, 1])
        induced = hover_induced_velocity(vehicle)
        if self.descent is not None:
            sinking = (motion[:, 2] > self.descent * induced) & (across < induced)
            yield (
                f"sank at more than {self.descent:g} times the hover's induced velocity, "
                f"{self.descent * induced:.3g} m/s",
                sinking,
            )
        if self.advance is not None:
            own = vehicle.parameters
            tip = own["main_rotor.speed"] * own["main_rotor.radius"]
            yield f"flew beyond an advance ratio of {self.advance:g}", across > self.advance * tip


def terminated_early(
    time: float, why: str, traceback: str | None = None, *, scripted: bool = False
) -> DivergedError:
    """Return the error of a flight that is terminated early.

    Args:
        time: of the end, s.
        why: in words.
        traceback: of a controller that failed, "" if it didn't raise; it is the error's note.
            None for an end of any other kind.
        scripted: whether a mission was flown, whose settings are to be changed then.
    """
    swept = "fly a smaller amplitude or a narrower band"
    change = "give the mission other settings" if scripted else swept
    advice = f"; {change}, or check the gyro's gains" if traceback is None else ""
    error = DivergedError(f"{why} at {time:.2f} s{advice}")
    if traceback:
        error.add_note(traceback)
    return error


def hover_induced_velocity(vehicle: Vehicle) -> float:
    """Return the induced velocity that carries the weight out of the ground's effect, m/s."""
    own, model = vehicle.parameters, vehicle.model
    weight = model.body_subtreemass[root_body(model)] * np.linalg.norm(model.opt.gravity)
    disc = math.pi * own["main_rotor.radius"] ** 2
    return float(math.sqrt(weight / (2.0 * own["air.density"] * disc)))


def at_limits(vehicle: Vehicle, trajectory: Trajectory) -> Iterator[tuple[str, NDArray[np.bool_]]]:
    """Yield the name of each stick, command and servo that may be at its limit, and where, (n,)."""
    commands = dict(zip(IN2, trajectory.sticks.T)) | {"ped": trajectory.servo_commands[:, 3]}
    plate, swash = trajectory.swashplate, trajectory.servo_commands[:, :3]
    if np.abs(swash).max() >= plate.least_travel(_STOP - _ROUNDING):
        _, commands["lon"], commands["lat"] = plate.unmix(*swash.T)
    for name, command in commands.items():
        yield name, np.abs(command) >= _STOP - _ROUNDING
    limit = _FULL_RATE * vehicle.parameters["servo.rate_limit"] * trajectory.timestep
    moved = np.abs(
        np.diff(trajectory.servo_positions, axis=0, prepend=trajectory.servo_positions[:1])
    )
    for name, steps in zip(SERVOS, moved.T):
        yield name, steps >= limit


def _time_in_window(flags: NDArray[np.bool_], window: float, step: float) -> NDArray[np.float64]:
    """Return how long a flag (n,) is true in the window that ends at each sample, s, (n,)."""
    count = max(1, round(window / step))
    up = np.concatenate([[0], np.cumsum(flags)])
    before = np.maximum(np.arange(1, up.size) - count, 0)
    return step * (up[1:] - up[before])
