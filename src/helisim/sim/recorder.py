"""The trajectory of a flight, step by step, and the recorder that makes a record of it."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfilt, sosfilt_zi
from scipy.spatial.transform import Rotation

from helisim.base.arrays import Real
from helisim.base.errors import DivergedError, InputError
from helisim.base.settings import Brief, check, setting, to_plain
from helisim.physics.layout import INJECTION, PARAM, SENSOR
from helisim.physics.motion import flip
from helisim.records.record import (
    ACCELERATIONS,
    AIR,
    ATTITUDE_DISTURBANCE,
    ATTITUDE_SUM,
    ATTITUDES,
    BATTERY,
    CHANNELS,
    CONTACT,
    IN1,
    IN1_ADDED,
    IN1_DISTURBANCE,
    IN1_GYRO,
    IN1_SUM,
    IN2,
    LOAD,
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
from helisim.vehicle.addresses import LOAD as SLUNG_LOAD
from helisim.vehicle.addresses import addresses
from helisim.vehicle.swashplate import Swashplate

_INJECTED = {
    "servos": slice(INJECTION.command_front, INJECTION.command_front + 4),
    "actuators": slice(INJECTION.actuator_front, INJECTION.actuator_front + 4),
    "sensors": slice(INJECTION.rate_p, INJECTION.rate_p + 6),
}  # places that the recorder doesn't see otherwise: columns of an injection


@dataclass(frozen=True)
class End:
    """The early end of a flight at a time, s; a failed controller's traceback, or None."""

    at: float
    why: str
    traceback: str | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain data, for provenance."""
        return {name: one for name, one in vars(self).items() if one is not None}

    def error(self) -> DivergedError:
        """Return the error of a flight that ended so."""
        change = (
            "fly for a shorter time, or give battery.capacity or battery.charge more"
            if "emptied its battery" in self.why
            else "fly a smaller amplitude, a narrower band or a mission with other settings, or "
            "check the gyro's gains"
        )
        advice = f"; {change}" if self.traceback is None else ""
        error = DivergedError(f"{self.why} at {self.at:.2f} s{advice}")
        if self.traceback:
            error.add_note(self.traceback)
        return error


@dataclass(frozen=True, eq=False)
class Script:
    """The phases of a mission's script, their times in s, and whether it came to its end."""

    phases: tuple[tuple[float, str], ...]
    finished: bool


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Time histories of what truly happened in one flight, (n_time, n_column) each, SI.

    Columns: sticks COL, LON, LAT, PED; servos front, left, right, tail; flapping a, b; rotor
    thrust, torque, inflow ratio, tail thrust, speed ratio; power of the drive, of main and tail
    shaft, lost to the air; air: velocity and rotation of the air itself, body axes; contact: force
    of all that is touched, NED; rates p, q, r; attitudes phi, theta, psi (unwrapped); velocities u,
    v, w and specific forces, body axes, and positions, NED, all of the IMU; gyro_rates as sensed,
    at ticks and late; rotor_speed where a motor turns the rotor, None under an ideal governor;
    battery: voltage, current, share left, temperature, None without one; load from its hook, body
    axes, None without one.
    `time` is (n_time,) s, `timestep` the simulation's, s, `imu_offset` (3,) from the centre of
    gravity, FRD. `added` by a manoeuvre is by place but the sticks: (n_time, 4) servo by servo, or
    "sensors", (n_time, 6) rates and attitude. `hold`, s, is how long sticks and servo commands are
    held; 0 if they are not.
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
    battery: NDArray[np.float64] | None = None
    load: NDArray[np.float64] | None = None
    added: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    hold: float = 0.0
    ground: Ground | None = None
    end: End | None = None
    script: Script | None = None

    @property
    def touching(self) -> NDArray[np.bool_]:
        """The samples at which the helicopter touches something, (n_time,)."""
        return np.any(self.contact != 0.0, axis=1)

    @property
    def earth(self) -> Rotation:
        """The rotations from body (FRD) to earth (NED) axes, (n_time,)."""
        return Rotation.from_euler("ZYX", self.attitudes[:, ::-1])

    def injected(self, added: NDArray[np.float64] | None, places: Collection[str]) -> "Trajectory":
        """Return it with what a manoeuvre added at places in it, (n_step, n_injection) or None."""
        if added is None:
            return self
        rows = added[: self.time.size]
        shown = {place: rows[:, one] for place, one in _INJECTED.items() if place in places}
        return replace(self, added=shown)

    def at_ticks(self) -> "Trajectory":
        """Return only the instants at which the held signals change."""
        each = round(self.hold / self.timestep)
        return (
            self
            if each <= 1
            else replace(self.rows(slice(None, None, each)), timestep=each * self.timestep)
        )

    def rows(self, rows: slice | NDArray[np.bool_]) -> "Trajectory":
        """Return only some of the samples, by a slice or flags (n_time,)."""
        histories = {
            name: one[rows]
            for name, one in vars(self).items()
            if isinstance(one, np.ndarray) and name != "imu_offset"
        }
        added = {place: one[rows] for place, one in self.added.items()}
        return replace(self, **histories, added=added)


def read_trajectory(vehicle: Vehicle, sensordata: NDArray[np.float64]) -> Trajectory:
    """Sort a flight's sensor data, (n_step, nsensordata). Raises DivergedError: not finite."""
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
    load = flipped(SLUNG_LOAD) if vehicle.slung else None
    if model.opt.integrator != mujoco.mjtIntegrator.mjINT_RK4:
        turning = 0.5 * model.opt.timestep * rates  # rad, of the attitude since the velocity
        velocities = velocities + np.cross(turning, velocities)
        attitudes, forces, positions = map(_halfway, (attitudes, forces, positions))
        load = None if load is None else _halfway(load)
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
        battery=seen("battery") if par[PARAM.drive_governor] * par[PARAM.drive_supply] else None,
        load=load,
        hold=vehicle.parameters["gyro.period"],
    )


def _halfway(columns: NDArray[np.float64]) -> NDArray[np.float64]:
    found = columns.copy()
    found[1:] = 0.5 * (columns[:-1] + columns[1:])
    found[2:-1] += (columns[1:-2] + columns[2:-1] - columns[:-3] - columns[3:]) / 16.0
    return found


def sound_samples(model: mujoco.MjModel, sensordata: NDArray[np.float64]) -> tuple[int, str]:
    """Return how many sound samples, (n_step, nsensordata), there are, and how they end."""
    time = sensordata[:, model.sensor("clock").adr[0]]
    finite = np.isfinite(sensordata @ np.ones(model.nsensordata))
    if not finite.all():
        first = int(np.argmin(finite))
        return first, f"the flight has no finite state from {first * model.opt.timestep:.2f} s"
    stopped = np.diff(time) <= 0.0
    if stopped.any():
        last = int(np.argmax(stopped))
        return last + 1, f"the simulation stopped at {time[last]:.2f} s"
    return len(time), ""


_Columns = Mapping[tuple[str, ...], Callable[[Trajectory], Real]]

_MOTION: _Columns = {
    RATES: lambda flight: flight.rates,
    ATTITUDES: lambda flight: flight.attitudes,
    VELOCITIES: lambda flight: flight.velocities,
    ACCELERATIONS: lambda flight: flight.specific_forces,
    POSITIONS: lambda flight: flight.positions,
}

_TRUE: _Columns = {
    ROTOR: lambda flight: np.column_stack([flight.flapping, flight.rotor[:, [0, 1, 3]]]),
    AIR: lambda flight: flight.air,
    SERVO_POSITIONS: lambda flight: flight.servo_positions,
    CONTACT: lambda flight: -flight.contact[:, 2:],
}

_NOISE = {
    **dict.fromkeys(RATES, 0.005),
    **dict.fromkeys(ATTITUDES, 0.002),
    **dict.fromkeys(VELOCITIES, 0.02),
    **dict.fromkeys(ACCELERATIONS, 0.05),
    **dict.fromkeys(POSITIONS, 0.02),
}  # standard deviations: a MEMS IMU with satellite-aided velocity

_RESOLUTION = {**dict.fromkeys(SERVOS, 0.0005), **dict.fromkeys(IN2, 0.0005)}


@dataclass(frozen=True, kw_only=True, repr=False)
class Recorder(Brief):
    """A flight computer's rates, latencies, noise and resolution.

    `antialias_hz` is the corner of a fourth-order Butterworth filter. By channel name: `latency`,
    s, positive if late, the vehicle's if None; `noise`, standard deviation in the channel's unit;
    `resolution`, 0 if not given. `lever_arm`, (x, y, z) m, FRD, is from the centre of gravity to
    the IMU, the vehicle's if None; `lever_arm_corrected` False leaves velocity and force at the
    IMU. `rotor` adds true quantities that no flight computer measures.
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

    @classmethod
    def of(cls, vehicle: Vehicle, *, rotor: bool = False) -> "Recorder":
        """Return the vehicle's own flight computer, with the latencies of its channels."""
        return cls(latency=None, rotor=rotor).on(vehicle)

    def on(self, vehicle: Vehicle) -> "Recorder":
        """Return the recorder with the vehicle's latencies where they are open."""
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
        """Return what this computer writes of a flight, with noise of `rng`."""
        flight = trajectory.at_ticks()  # so that a record doesn't depend on the time step
        sampling = _Sampling(self, flight, rng)
        columns = sampling.inputs() | sampling.motion()
        own = {ROTOR_SPEED: flight.rotor_speed, BATTERY: flight.battery, LOAD: flight.load}
        true = {
            names: source(flight)
            for names, source in _TRUE.items()
            if self.rotor and (names != CONTACT or flight.ground is not None)
        }
        for names, signals in (own | true).items():
            if signals is not None:
                columns |= sampling.recorded(names, signals)
        columns |= sampling.injected(columns)
        kept = tuple(one for name, one in CHANNELS.items() if name in columns)
        return FlightRecord(
            sampling.time, np.column_stack([columns[one.name] for one in kept]), kept, provenance
        )


@cache
def _lowpass(corner_hz: float, rate_hz: float) -> tuple[Real, Real] | None:
    """Return a filter's sections and their rest at 1, None for a corner that no sample shows."""
    if corner_hz >= 0.5 * rate_hz:
        return None
    sections = butter(4, corner_hz, fs=rate_hz, output="sos")
    return sections, sosfilt_zi(sections)


class _Sampling:
    def __init__(self, recorder: Recorder, flight: Trajectory, rng: np.random.Generator) -> None:
        self.recorder, self.flight, self.rng = recorder, flight, rng
        count = int(np.floor((flight.time[-1] - flight.time[0]) * recorder.rate_hz + 1e-6)) + 1
        self.time = flight.time[0] + np.arange(count) / recorder.rate_hz
        self._antialias = _lowpass(recorder.antialias_hz, 1.0 / flight.timestep)

    def inputs(self) -> dict[str, Real]:
        flight = self.flight
        signals: dict[str, Real] = dict(zip(IN2, self.filtered(flight.sticks).T))
        signals |= dict(zip(SERVOS, self.filtered(flight.servo_commands).T))
        noise, found = {name: self.noise(name) for name in signals}, {}

        def seen(name: str, late_as: str) -> Real:
            return self.rounded(name, self.sampled(signals[name], late_as) + noise[name])

        for k, name in enumerate(IN1):
            commands = [seen(servo, name) for servo in SERVOS]
            mixed = (*flight.swashplate.unmix(*commands[:3]), commands[3])[k]
            found[name] = self.rounded(name, mixed + self.noise(name))
        return found | {name: seen(name, name) for name in signals}

    def motion(self) -> dict[str, Real]:
        noise = {names: np.column_stack(list(map(self.noise, names))) for names in _MOTION}
        filtered = {names: self.filtered(source(self.flight)) for names, source in _MOTION.items()}

        def seen(names: tuple[str, ...], *, late: bool) -> Real:
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
            for axis, angle in zip("XYZ", attitudes.T):  # ten times as fast as all at once
                arm = Rotation.from_euler(axis, angle[:, None]).apply(arm)
            found[POSITIONS] = found[POSITIONS] - arm
        return {
            name: self.rounded(name, signal)
            for names in _MOTION
            for name, signal in zip(names, found[names].T)
        }

    def injected(self, columns: Mapping[str, Real]) -> dict[str, Real]:
        flight, given, found = self.flight, self.flight.added, {}
        for place, added, total, sign in (
            ("servos", IN1_ADDED, IN1_GYRO, -1.0),
            ("actuators", IN1_DISTURBANCE, IN1_SUM, 1.0),
        ):
            if (servos := given.get(place)) is not None:
                mixed = np.column_stack([*flight.swashplate.unmix(*servos.T[:3]), servos.T[3]])
                found |= self.recorded(added, mixed, late_as=IN1)
                for name, own, both in zip(IN1, added, total):
                    found[both] = columns[name] + sign * found[own]
        if (sensed := given.get("sensors")) is not None:
            rates, angles = sensed[:, :3], sensed[:, 3:]
            found |= self.recorded(RATE_DISTURBANCE, rates)
            found |= self.recorded(RATE_SUM, flight.gyro_rates + rates)
            if angles.any():
                found |= self.recorded(ATTITUDE_DISTURBANCE, angles)
                found |= self.recorded(ATTITUDE_SUM, flight.attitudes + angles)
        return found

    def recorded(
        self, names: tuple[str, ...], signals: Real, *, late_as: tuple[str, ...] | None = None
    ) -> dict[str, Real]:
        return {
            name: self.rounded(name, self.sampled(signal, late) + self.noise(name))
            for name, late, signal in zip(names, late_as or names, self.filtered(signals).T)
        }

    def filtered(self, signals: Real) -> Real:
        if self._antialias is None:
            return signals
        sections, start = self._antialias
        return sosfilt(sections, signals, axis=0, zi=start[:, :, None] * signals[0])[0]

    def sampled(self, signal: Real, late_as: str | None) -> Real:
        latency = 0.0 if late_as is None else self.recorder.late(late_as)
        return np.interp(self.time - latency, self.flight.time, signal)

    def rounded(self, name: str, signal: Real) -> Real:
        step = self.recorder.resolution.get(name, 0.0)
        return signal if step == 0.0 else np.round(signal / step) * step

    def noise(self, name: str) -> Real:
        level, size = self.recorder.noise.get(name, 0.0), self.time.size
        return np.zeros(size) if level == 0.0 else level * self.rng.standard_normal(size)
