"""The trajectory of a flight: what truly happened, at the simulation's rate, in field axes."""

from collections.abc import Collection
from dataclasses import dataclass, fields, replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from helisim.base.errors import DivergedError
from helisim.physics.layout import INJECTION, PARAM, SENSOR
from helisim.physics.motion import flip
from helisim.sim.ground import Ground
from helisim.vehicle import Vehicle
from helisim.vehicle.motion import addresses
from helisim.vehicle.swashplate import Swashplate

_INJECTED = {
    "commands_added": ("servos", INJECTION.command_front, 4),
    "actuators_added": ("actuators", INJECTION.actuator_front, 4),
    "rates_added": ("sensors", INJECTION.rate_p, 3),
    "angles_added": ("sensors", INJECTION.angle_phi, 3),
}
"""What the recorder doesn't see of a manoeuvre otherwise: its place, where it begins, how much."""


@dataclass(frozen=True, eq=False)
class End:
    """Why a flight was terminated early.

    Attributes:
        at: s.
        why: in words.
        state: MuJoCo's full physics state at the last sample that was kept.
        traceback: of a controller that failed, "" if it didn't raise. None: it didn't fail.
    """

    at: float
    why: str
    state: NDArray[np.float64]
    traceback: str | None = None

    def __str__(self) -> str:
        return f"{self.why} at {self.at:.2f} s"

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain data, for provenance."""
        failed = {} if self.traceback is None else {"traceback": self.traceback}
        return {"at": self.at, "why": self.why, "state": self.state.tolist(), **failed}

    def error(self, *, scripted: bool = False) -> DivergedError:
        """Return the error of a flight that ended so, a controller's traceback as its note.

        Args:
            scripted: whether a mission was flown, whose settings are to be changed then.
        """
        swept = "fly a smaller amplitude or a narrower band"
        change = "give the mission other settings" if scripted else swept
        advice = f"; {change}, or check the gyro's gains" if self.traceback is None else ""
        error = DivergedError(f"{self}{advice}")
        if self.traceback:
            error.add_note(self.traceback)
        return error


@dataclass(frozen=True, eq=False)
class Script:
    """What a mission's script did in a flight.

    Attributes:
        phases: times, s, and what began then.
        wanted: (n_tick, 5) time, north, east, down and heading that were to be reached, s, m and
            rad; not a number where they were not held.
        finished: whether the script came to its end.
    """

    phases: tuple[tuple[float, str], ...]
    wanted: NDArray[np.float64]
    finished: bool


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Time histories of what truly happened in one flight, all of the same instants.

    Attributes:
        time: (n_time,) s.
        timestep: s, of the simulation.
        sticks: (n_time, 4) COL, LON, LAT, PED.
        servo_commands: (n_time, 4) front, left, right, tail.
        servo_positions: (n_time, 4).
        flapping: (n, 2) a, b in rad.
        rotor: (n_time, 5) thrust N, torque N m, inflow ratio, tail thrust N, speed ratio.
        power: (n_time, 4) W: of the drive, of main and tail shaft, lost to the air.
        air: (n, 6) velocity in m/s and rotation in rad/s of the air itself, body axes.
        contact: (n_time, 3) force of all that is touched, north, east, down, N.
        rates: (n_time, 3) p, q, r in rad/s.
        attitudes: (n_time, 3) phi, theta, psi in rad, psi unwrapped.
        velocities: (n_time, 3) u, v, w in m/s at the IMU.
        specific_forces: (n_time, 3) ax, ay, az in m/s^2 at the IMU.
        positions: (n_time, 3) north, east, down in m of the IMU.
        imu_offset: (3,) from the centre of gravity to the IMU, m, body axes (FRD).
        swashplate: of the vehicle, by which servo commands are col, lon and lat.
        gyro_rates: (n_time, 3) p, q, r in rad/s as the gyro senses them, at its ticks and late.
        rotor_speed: (n_time, 1) rad/s, where a motor turns the rotor; None under an ideal governor.
        commands_added: (n_time, 4) what a manoeuvre adds to the commands, servo by servo; None
            where it adds nothing there.
        actuators_added: (n_time, 4) likewise to what reaches the servos.
        rates_added: (n_time, 3) likewise to the rates that the gyro reads, rad/s.
        angles_added: (n_time, 3) likewise to the attitude that a controller sees, rad; None too
            where only rates are disturbed.
        hold: s, for which sticks and servo commands are held; 0 if they are not.
        ground: that was below; None in a flight in the air alone.
        end: why the flight was terminated early; None if it wasn't.
        script: what a mission's script did; None where none was flown.
    """

    time: NDArray[np.float64]
    timestep: float
    sticks: NDArray[np.float64]
    servo_commands: NDArray[np.float64]
    servo_positions: NDArray[np.float64]
    flapping: NDArray[np.float64]
    rotor: NDArray[np.float64]
    power: NDArray[np.float64]
    air: NDArray[np.float64]
    contact: NDArray[np.float64]
    rates: NDArray[np.float64]
    attitudes: NDArray[np.float64]
    velocities: NDArray[np.float64]
    specific_forces: NDArray[np.float64]
    positions: NDArray[np.float64]
    imu_offset: NDArray[np.float64]
    swashplate: Swashplate
    gyro_rates: NDArray[np.float64]
    rotor_speed: NDArray[np.float64] | None = None
    commands_added: NDArray[np.float64] | None = None
    actuators_added: NDArray[np.float64] | None = None
    rates_added: NDArray[np.float64] | None = None
    angles_added: NDArray[np.float64] | None = None
    hold: float = 0.0
    ground: Ground | None = None
    end: End | None = None
    script: Script | None = None

    @property
    def touching(self) -> NDArray[np.bool_]:
        """At which samples the helicopter touches something, (n_time,)."""
        return np.any(self.contact != 0.0, axis=1)

    @property
    def earth(self) -> Rotation:
        """The rotations from body (FRD) to earth (NED) axes, (n_time,)."""
        return Rotation.from_euler("ZYX", self.attitudes[:, ::-1])

    def injected(self, added: NDArray[np.float64] | None, places: Collection[str]) -> "Trajectory":
        """Return it with what a manoeuvre added at places in it, (n_step, n_injection) or None."""
        shown = {
            name: added[: self.time.size, first : first + count]
            for name, (place, first, count) in _INJECTED.items()
            if added is not None and place in places
        }
        if "angles_added" in shown and not shown["angles_added"].any():
            del shown["angles_added"]
        return replace(self, **shown)

    def at_ticks(self) -> "Trajectory":
        """Return only the instants at which the held signals change."""
        each = round(self.hold / self.timestep)
        if each <= 1:
            return self
        return replace(self.rows(slice(None, None, each)), timestep=each * self.timestep)

    def until(self, count: int, end: End) -> "Trajectory":
        """Return only so many samples, of a flight that is terminated then."""
        return replace(self.rows(slice(count)), end=end)

    def since(self, time: float) -> "Trajectory":
        """Return only the samples from a time on, s."""
        return self.rows(slice(int(np.searchsorted(self.time, time)), None))

    def rows(self, rows: slice | NDArray[np.bool_]) -> "Trajectory":
        """Return only some of the samples, by a slice or flags (n_time,)."""
        histories = {
            field.name: getattr(self, field.name)[rows]
            for field in fields(self)
            if np.ndim(getattr(self, field.name)) > 0 and field.name != "imu_offset"
        }
        return replace(self, **histories)


def read_trajectory(vehicle: Vehicle, sensordata: NDArray[np.float64]) -> Trajectory:
    """Sort the sensor data of one flight, (n_step, nsensordata), into a `Trajectory`.

    They are as mj_step leaves them: of the time before the step.

    Raises:
        DivergedError: a number is not finite, or the simulation stopped.
    """
    model = vehicle.model
    count, why = sound_samples(model, sensordata)
    if count < len(sensordata):
        raise DivergedError(why)

    def seen(name: str) -> NDArray[np.float64]:
        sensor = model.sensor(name)
        return sensordata[:, sensor.adr[0] : sensor.adr[0] + sensor.dim[0]]

    def flipped(name: str) -> NDArray[np.float64]:
        return np.column_stack(flip(*seen(name).T))

    quaternions = seen("imu_attitude")
    x, y, z = flip(*quaternions[:, 1:].T)
    turned = Rotation.from_quat(np.column_stack([quaternions[:, 0], x, y, z]), scalar_first=True)
    attitudes = turned.as_euler("ZYX")[:, ::-1]
    attitudes[:, 2] = np.unwrap(attitudes[:, 2])
    rates, velocities = flipped("imu_gyro"), flipped("imu_velocity")
    forces, positions = flipped("imu_accelerometer"), flipped("imu_position")
    if model.opt.integrator != mujoco.mjtIntegrator.mjINT_RK4:
        turning = 0.5 * model.opt.timestep * rates  # rad, of the attitude since the velocity
        velocities = velocities + np.cross(turning, velocities)
        attitudes, forces, positions = map(_halfway, (attitudes, forces, positions))
    par = model.actuator_user[addresses(model).rotor]
    ratio = seen("rotor")[:, SENSOR.speed - SENSOR.thrust :]
    return Trajectory(
        time=seen("clock")[:, 0],
        timestep=float(model.opt.timestep),
        sticks=seen("stick"),
        servo_commands=seen("servo_command"),
        servo_positions=seen("servo_position"),
        flapping=seen("flapping"),
        rotor=seen("rotor"),
        power=seen("power"),
        air=seen("air"),
        contact=seen("contact"),
        rates=rates,
        attitudes=attitudes,
        velocities=velocities,
        specific_forces=forces,
        positions=positions,
        imu_offset=np.array(vehicle.imu_offset),
        swashplate=vehicle.swashplate,
        gyro_rates=flipped("gyro_rate"),
        rotor_speed=par[PARAM.main_speed] * ratio if par[PARAM.drive_governor] != 0.0 else None,
        hold=vehicle.parameters["gyro.period"],
    )


def _halfway(columns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what is kept half a step ahead of its row at the row's own time (cubic)."""
    found = columns.copy()
    found[1:] = 0.5 * (columns[:-1] + columns[1:])
    found[2:-1] += (columns[1:-2] + columns[2:-1] - columns[:-3] - columns[3:]) / 16.0
    return found


def sound_samples(model: mujoco.MjModel, sensordata: NDArray[np.float64]) -> tuple[int, str]:
    """Return how many sound samples, (n_step, nsensordata), there are, and how they end."""
    time = sensordata[:, model.sensor("clock").adr[0]]
    finite = np.isfinite(sensordata).all(axis=1)
    if not finite.all():
        first = int(np.argmin(finite))
        return first, f"the flight has no finite state from {first * model.opt.timestep:.2f} s"
    stopped = np.diff(time) <= 0.0
    if stopped.any():
        last = int(np.argmax(stopped))
        return last + 1, f"the simulation stopped at {time[last]:.2f} s"
    return len(time), ""
