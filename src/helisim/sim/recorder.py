"""The trajectory of a flight, step by step, and the recorder that makes a record of it."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfilt, sosfilt_zi
from scipy.spatial.transform import Rotation

from helisim.base.errors import DivergedError, InputError
from helisim.base.settings import check, in_brief, setting, to_plain
from helisim.physics.layout import INJECTION, PARAM, SENSOR
from helisim.physics.motion import flip
from helisim.records.record import (
    ACCELERATIONS,
    AIR,
    ATTITUDE_DISTURBANCE,
    ATTITUDE_SUM,
    ATTITUDES,
    CHANNELS,
    CONTACT,
    IN1,
    IN1_ADDED,
    IN1_DISTURBANCE,
    IN1_GYRO,
    IN1_SUM,
    IN2,
    POSITIONS,
    RATE_DISTURBANCE,
    RATE_SUM,
    RATES,
    ROTOR,
    ROTOR_SPEED,
    SERVO_POSITIONS,
    SERVOS,
    VELOCITIES,
    FlightRecord,
    channel,
)
from helisim.sim.ground import Ground
from helisim.vehicle import Vehicle
from helisim.vehicle.swashplate import Swashplate
from helisim.vehicle.trim import addresses

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


_Array = NDArray[np.float64]
_Columns = Mapping[tuple[str, ...], Callable[[Trajectory], _Array]]

_MEASURED: _Columns = {
    IN2: lambda flight: flight.sticks,
    SERVOS: lambda flight: flight.servo_commands,
    RATES: lambda flight: flight.rates,
    ATTITUDES: lambda flight: flight.attitudes,
    VELOCITIES: lambda flight: flight.velocities,
    ACCELERATIONS: lambda flight: flight.specific_forces,
    POSITIONS: lambda flight: flight.positions,
    ROTOR_SPEED: lambda flight: np.asarray(flight.rotor_speed),
}
"""What a flight computer measures: channels, and the columns (n, channels) that they are of."""

_TRUE: _Columns = {
    ROTOR: lambda flight: np.column_stack([flight.flapping, flight.rotor[:, [0, 1, 3]]]),
    AIR: lambda flight: flight.air,
    SERVO_POSITIONS: lambda flight: flight.servo_positions,
    CONTACT: lambda flight: -flight.contact[:, 2:],
}
"""What none measures, and a recorder with `rotor=True` adds."""

_MOTION: tuple[tuple[str, ...], ...] = (RATES, ATTITUDES, VELOCITIES, ACCELERATIONS, POSITIONS)
"""Of an IMU that may stand away from the centre of gravity."""

_NOISE = {
    **dict.fromkeys(RATES, 0.005),
    **dict.fromkeys(ATTITUDES, 0.002),
    **dict.fromkeys(VELOCITIES, 0.02),
    **dict.fromkeys(ACCELERATIONS, 0.05),
    **dict.fromkeys(POSITIONS, 0.02),
}
"""Standard deviations in the channels' units: a MEMS IMU with satellite-aided velocity."""

_RESOLUTION = {**dict.fromkeys(SERVOS, 0.0005), **dict.fromkeys(IN2, 0.0005)}
"""Half a microsecond of a pulse whose travel is a millisecond."""

_LAST = 1.0  # s, before the end of a flight, that are kept as they truly were


@dataclass(frozen=True, kw_only=True)
class Recorder:
    """A flight computer's rates, latencies, noise and resolution.

    Attributes:
        rate_hz: samples a second.
        antialias_hz: corner of the fourth-order Butterworth filter before sampling.
        lever_arm_corrected: False leaves velocity and force as they are at the IMU.
        rotor: True adds the rotor's true tilt, thrusts and torque, the air's own motion, the
            servos' true positions and, over a ground, its force, to look at; no flight computer
            measures them.
        latency: s, by channel name; 0 where none is given. Positive is late. None: the vehicle's
            own, which `on` fills in.
        noise: standard deviation by channel name, in the channel's unit.
        resolution: step by channel name; 0 where none is given.
        lever_arm: (x, y, z) m, from the centre of gravity to the IMU (FRD), that they are corrected
            by, such as a suspension found; None takes the vehicle's true one.
    """

    rate_hz: float = setting(100.0, unit="Hz", above=0.0)
    antialias_hz: float = setting(40.0, unit="Hz", above=0.0)
    lever_arm_corrected: bool = True
    rotor: bool = False
    latency: Mapping[str, float] | None = setting(factory=dict, unit="s", low=0.0, high=1e3)
    noise: Mapping[str, float] = setting(factory=lambda: dict(_NOISE), low=0.0, high=1e6)
    resolution: Mapping[str, float] = setting(factory=lambda: dict(_RESOLUTION), low=0.0, high=1e6)
    lever_arm: tuple[float, float, float] | None = setting(None, unit="m", unsaid=True)

    def __post_init__(self) -> None:
        check(self)
        if not self.antialias_hz < 0.5 * self.rate_hz:
            raise InputError(
                f"the anti-alias corner must be below half the sample rate, got "
                f"{self.antialias_hz} Hz for {self.rate_hz} Hz"
            )
        for name in (*(self.latency or ()), *self.noise, *self.resolution):
            channel(name)

    def __repr__(self) -> str:
        return in_brief(self)

    @classmethod
    def of(cls, vehicle: Vehicle, *, rotor: bool = False) -> "Recorder":
        """Return the vehicle's own flight computer, with the latencies of its channels."""
        return cls(latency=None, rotor=rotor).on(vehicle)

    def on(self, vehicle: Vehicle) -> "Recorder":
        """Return the recorder with latencies that are left open filled in by the vehicle's."""
        if self.latency is not None:
            return self
        section = "recorder_latency."
        own = [name for name in vehicle.parameters if name.startswith(section)]
        latency = {name.removeprefix(section): vehicle.parameters[name] for name in own}
        return replace(self, latency=latency)

    def late(self, name: str) -> float:
        """Return a channel's latency, s. Raises InputError while latencies are left open."""
        if self.latency is None:
            raise InputError("the recorder's latencies are open; complete it with on(vehicle)")
        return self.latency.get(name, 0.0)

    def to_dict(self) -> dict[str, Any]:
        """Return the settings as plain data."""
        return to_plain(self)

    def record(
        self, trajectory: Trajectory, rng: np.random.Generator, provenance: Mapping[str, Any]
    ) -> FlightRecord:
        """Return what this computer writes of a flight, with noise of `rng`; provenance is kept."""
        flight = trajectory.at_ticks()  # so that a record doesn't depend on the time step
        sampling = _Sampling(self, flight, rng)
        columns = sampling.inputs() | sampling.motion()
        plain = set(_MEASURED) - {IN2, SERVOS, *_MOTION}
        plain |= set(_TRUE) if self.rotor else set()
        plain -= {ROTOR_SPEED} if flight.rotor_speed is None else set()
        plain -= {CONTACT} if flight.ground is None else set()
        for names, source in {**_MEASURED, **_TRUE}.items():
            if names in plain:
                columns |= sampling.recorded(names, source(flight))
        columns |= sampling.injected(columns)
        kept = tuple(one for name, one in CHANNELS.items() if name in columns)
        values = np.column_stack([columns[one.name] for one in kept])
        return FlightRecord(sampling.time, values, kept, provenance)


class _Sampling:
    """One flight seen by one recorder."""

    def __init__(self, recorder: Recorder, flight: Trajectory, rng: np.random.Generator) -> None:
        self.recorder, self.flight, self.rng = recorder, flight, rng
        lasts = flight.time[-1] - flight.time[0]
        count = int(np.floor(lasts * recorder.rate_hz + 1e-6)) + 1
        self.time = flight.time[0] + np.arange(count) / recorder.rate_hz
        rate_hz, self._sos = 1.0 / flight.timestep, None
        if recorder.antialias_hz < 0.5 * rate_hz:
            self._sos = butter(4, recorder.antialias_hz, fs=rate_hz, output="sos")

    def inputs(self) -> dict[str, _Array]:
        """Return the sticks, the servo commands, and the inputs recomputed from these."""
        signals = {
            name: signal
            for names in (IN2, SERVOS)
            for name, signal in zip(names, self.filtered(_MEASURED[names](self.flight)).T)
        }
        noise, found = {name: self.noise(name) for name in signals}, {}
        for name in IN1:
            commands = [
                self.rounded(servo, self.sampled(signals[servo], name) + noise[servo])
                for servo in SERVOS
            ]
            mixed = (*self.flight.swashplate.unmix(*commands[:3]), commands[3])[IN1.index(name)]
            found[name] = self.rounded(name, mixed + self.noise(name))
        for name, signal in signals.items():
            found[name] = self.rounded(name, self.sampled(signal, name) + noise[name])
        return found

    def motion(self) -> dict[str, _Array]:
        """Return rates, attitudes, velocities, specific forces and positions by name."""
        noise = {names: np.column_stack(list(map(self.noise, names))) for names in _MOTION}
        filtered = {names: self.filtered(_MEASURED[names](self.flight)) for names in _MOTION}

        def seen(names: tuple[str, ...], *, late: bool) -> _Array:
            each = zip(names, filtered[names].T)
            columns = [self.sampled(signal, name if late else None) for name, signal in each]
            return np.column_stack(columns) + noise[names]

        found = {names: seen(names, late=True) for names in _MOTION}
        if self.recorder.lever_arm_corrected:
            rates, attitudes = seen(RATES, late=False), seen(ATTITUDES, late=False)
            own = self.recorder.lever_arm
            arm = self.flight.imu_offset if own is None else np.array(own)
            spin, turning = np.gradient(rates, self.time, axis=0), np.cross(rates, arm)
            found[VELOCITIES] = found[VELOCITIES] - turning
            found[ACCELERATIONS] = found[ACCELERATIONS] - (
                np.cross(spin, arm) + np.cross(rates, turning)
            )
            earth = Rotation.from_euler("ZYX", attitudes[:, ::-1])
            found[POSITIONS] = found[POSITIONS] - earth.apply(arm)
        return {
            name: self.rounded(name, signal)
            for names in _MOTION
            for name, signal in zip(names, found[names].T)
        }

    def injected(self, columns: Mapping[str, _Array]) -> dict[str, _Array]:
        """Return what a manoeuvre adds where no other channel shows it, and what comes of it.

        Args:
            columns: of the other channels; what is added to one is as late as that one.
        """
        flight, found = self.flight, {}
        for servos, added, total, sign in (
            (flight.commands_added, IN1_ADDED, IN1_GYRO, -1.0),
            (flight.actuators_added, IN1_DISTURBANCE, IN1_SUM, 1.0),
        ):
            if servos is None:
                continue
            mixed = np.column_stack([*flight.swashplate.unmix(*servos.T[:3]), servos.T[3]])
            found |= self.recorded(added, mixed, late_as=IN1)
            for name, own, both in zip(IN1, added, total):
                found[both] = columns[name] + sign * found[own]
        for names, sums, own, added in (
            (RATE_DISTURBANCE, RATE_SUM, flight.gyro_rates, flight.rates_added),
            (ATTITUDE_DISTURBANCE, ATTITUDE_SUM, flight.attitudes, flight.angles_added),
        ):
            if added is not None:
                found |= self.recorded(names, added)
                found |= self.recorded(sums, own + added)
        return found

    def recorded(
        self, names: tuple[str, ...], signals: _Array, *, late_as: tuple[str, ...] | None = None
    ) -> dict[str, _Array]:
        """Return signals, (n, channels), by name: filtered, late, noisy and rounded."""
        return {
            name: self.rounded(name, self.sampled(signal, late) + self.noise(name))
            for name, late, signal in zip(names, late_as or names, self.filtered(signals).T)
        }

    def filtered(self, signals: _Array) -> _Array:
        """Return columns behind the anti-alias filter, which begins at rest."""
        if self._sos is None:
            return signals
        start = sosfilt_zi(self._sos)[:, :, None] * signals[0]
        return sosfilt(self._sos, signals, axis=0, zi=start)[0]

    def sampled(self, signal: _Array, late_as: str | None) -> _Array:
        """Return a filtered signal at the samples, delayed by the latency of a named channel."""
        latency = 0.0 if late_as is None else self.recorder.late(late_as)
        return np.interp(self.time - latency, self.flight.time, signal)

    def rounded(self, name: str, signal: _Array) -> _Array:
        """Return a channel's signal in its resolution."""
        step = self.recorder.resolution.get(name, 0.0)
        return signal if step == 0.0 else np.round(signal / step) * step

    def noise(self, name: str) -> _Array:
        """Return new noise of a channel, (n_sample,)."""
        level = self.recorder.noise.get(name, 0.0)
        if level == 0.0:
            return np.zeros(self.time.size)
        return level * self.rng.standard_normal(self.time.size)


def last_second(trajectory: Trajectory, provenance: Mapping[str, Any]) -> FlightRecord:
    """Return the last second of a flight at the simulation's rate, true to the last digit.

    It has the channels of a recorder with `rotor=True`, without IN1. Velocities, forces and
    positions are the IMU's. The flight has at least two samples.
    """
    trajectory = trajectory.since(trajectory.time[-1] - _LAST)
    groups = {**_MEASURED, **_TRUE}
    if trajectory.rotor_speed is None:
        del groups[ROTOR_SPEED]
    values = np.column_stack([columns(trajectory) for columns in groups.values()])
    channels = [CHANNELS[name] for names in groups for name in names]
    at_imu = (*VELOCITIES, *ACCELERATIONS, *POSITIONS)
    for k, one in enumerate(channels):
        if one.name in at_imu:
            meaning = one.meaning.replace("the centre of gravity", "the IMU")
            channels[k] = replace(one, meaning=meaning)
    return FlightRecord(trajectory.time, values, tuple(channels), provenance)
