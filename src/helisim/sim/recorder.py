"""The flight computer: from what truly happened to what is recorded.

Each channel passes the same anti-alias filter, is sampled late by its own latency, and gains
noise and quantisation. Velocity and specific force are measured at the IMU and corrected to
the centre of gravity with the measured rates (Wu and Chen, section 2).
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfilt, sosfilt_zi
from scipy.spatial.transform import Rotation

from helisim.base.errors import InputError
from helisim.base.value import FrozenMap
from helisim.records.channels import (
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
    Channel,
    channel,
)
from helisim.records.record import FlightRecord
from helisim.sim.plain import UNSAID, in_brief, to_plain
from helisim.sim.trajectory import Trajectory
from helisim.vehicle import Vehicle

_Columns = Mapping[tuple[str, ...], Callable[[Trajectory], NDArray[np.float64]]]

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

_LAST = 1.0
"""s, before the end of a flight, that are kept as they truly were."""
_AT_IMU = (*VELOCITIES, *ACCELERATIONS, *POSITIONS)


@dataclass(frozen=True, kw_only=True)
class Recorder:
    """A flight computer's rates, latencies, noise and resolution.

    Attributes:
        rate_hz: samples a second.
        antialias_hz: corner of the fourth-order Butterworth filter before sampling.
        lever_arm_corrected: False leaves velocity and force as they are at the IMU.
        lever_arm: (x, y, z) m, from the centre of gravity to the IMU (FRD), that they are corrected
            by, such as a suspension found; None takes the vehicle's true one.
        rotor: True adds the rotor's true tilt, thrusts and torque, the air's own motion, the
            servos' true positions and, over a ground, its force, to look at; no flight computer
            measures them.
        latency: s, by channel name; 0 where none is given. Positive is late. None: the vehicle's
            own, which `on` fills in.
        noise: standard deviation by channel name, in the channel's unit.
        resolution: step by channel name; 0 where none is given.
    """

    rate_hz: float = 100.0
    antialias_hz: float = 40.0
    lever_arm_corrected: bool = True
    rotor: bool = False
    latency: Mapping[str, float] | None = field(default_factory=dict)
    noise: Mapping[str, float] = field(default_factory=lambda: dict(_NOISE))
    resolution: Mapping[str, float] = field(default_factory=lambda: dict(_RESOLUTION))
    lever_arm: tuple[float, float, float] | None = field(default=None, metadata=UNSAID)

    def __post_init__(self) -> None:
        if self.lever_arm is not None:
            arm = tuple(float(x) for x in self.lever_arm)
            if len(arm) != 3 or not np.all(np.isfinite(arm)):
                raise InputError(f"lever_arm must be three finite numbers, got {self.lever_arm}")
            object.__setattr__(self, "lever_arm", arm)
        if not 0.0 < self.antialias_hz < 0.5 * self.rate_hz < np.inf:
            raise InputError(
                f"the anti-alias corner must be below half the sample rate, got "
                f"{self.antialias_hz} Hz for {self.rate_hz} Hz"
            )
        for name in ("latency", "noise", "resolution"):
            if getattr(self, name) is None:
                continue
            values = dict(getattr(self, name))
            for key, value in values.items():
                channel(key)
                if not (np.isfinite(value) and value >= 0.0):
                    raise InputError(f"{name} of {key!r} must be 0 or more, got {value}")
            object.__setattr__(self, name, FrozenMap(values))

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
        """Return what this computer writes of a flight.

        Args:
            trajectory: the flight at the simulation's own rate.
            rng: of the sensor noise.
            provenance: kept with the record.
        """
        sampling = _Sampling(self, trajectory, rng)
        columns = {name: sampling.inputs(name) for name in (*IN1, *IN2, *SERVOS)}
        columns |= sampling.motion()
        motor = set() if trajectory.rotor_speed is None else {ROTOR_SPEED}
        own = set(_MEASURED) - {IN2, SERVOS, ROTOR_SPEED, *_MOTION}
        columns |= sampling.plain(motor | own)
        if self.rotor:
            columns |= sampling.plain(
                set(_TRUE) - ({CONTACT} if trajectory.ground is None else set())
            )
        columns |= sampling.injected(columns)
        names = [name for name in CHANNELS if name in columns]
        values = np.column_stack([columns[name] for name in names])
        kept = tuple(CHANNELS[name] for name in names)
        return FlightRecord(sampling.time, values, kept, provenance)


class _Sampling:
    """One flight seen by one recorder."""

    def __init__(
        self, recorder: Recorder, trajectory: Trajectory, rng: np.random.Generator
    ) -> None:
        trajectory = trajectory.at_ticks()  # so that a record doesn't depend on the time step
        self.recorder = recorder
        self.trajectory = trajectory
        self.rng = rng
        count = (
            int(np.floor((trajectory.time[-1] - trajectory.time[0]) * recorder.rate_hz + 1e-6)) + 1
        )
        self.time = trajectory.time[0] + np.arange(count) / recorder.rate_hz
        rate_hz = 1.0 / trajectory.timestep
        self._sos = None
        if recorder.antialias_hz < 0.5 * rate_hz:
            self._sos = butter(4, recorder.antialias_hz, fs=rate_hz, output="sos")
        self.sticks, self.commands = map(
            self._filtered, (_MEASURED[names](trajectory) for names in (IN2, SERVOS))
        )
        self._input_noise = {name: self._noise(name) for name in (*IN2, *SERVOS)}

    def inputs(self, name: str) -> NDArray[np.float64]:
        """Return a stick, a servo command, or an input recomputed from the servo commands."""
        if name in IN2:
            return self._digitised(name, self.sticks[:, IN2.index(name)])
        if name in SERVOS:
            return self._digitised(name, self.commands[:, SERVOS.index(name)])
        commands = [
            self._digitised(servo_name, self.commands[:, k], late_as=name)
            for k, servo_name in enumerate(SERVOS)
        ]
        plate = self.trajectory.swashplate
        mixed = (*plate.unmix(*commands[:3]), commands[3])[IN1.index(name)]
        return self._rounded(name, mixed + self._noise(name))

    def motion(self) -> dict[str, NDArray[np.float64]]:
        """Return rates, attitudes, velocities, specific forces and positions by name."""
        noise = {name: self._noise(name) for names in _MOTION for name in names}
        filtered = {names: self._filtered(_MEASURED[names](self.trajectory)) for names in _MOTION}
        late = {names: self._seen(filtered[names], names, noise, late=True) for names in _MOTION}
        if self.recorder.lever_arm_corrected:
            shift = self._lever_arm(
                *(self._seen(filtered[names], names, noise) for names in (RATES, ATTITUDES))
            )
            late |= {names: late[names] - added for names, added in shift.items()}
        return {
            name: self._rounded(name, late[names][:, k])
            for names in _MOTION
            for k, name in enumerate(names)
        }

    def plain(self, groups: Iterable[tuple[str, ...]]) -> dict[str, NDArray[np.float64]]:
        """Return channels that need no correction by name, filtered, late, noisy and rounded."""
        return {
            name: self._recorded(name, signal)
            for names, columns in {**_MEASURED, **_TRUE}.items()
            if names in groups
            for name, signal in zip(names, self._filtered(columns(self.trajectory)).T)
        }

    def injected(
        self, columns: Mapping[str, NDArray[np.float64]]
    ) -> dict[str, NDArray[np.float64]]:
        """Return what a manoeuvre adds where no other channel shows it, and what comes of it.

        Args:
            columns: of the other channels; what is added to one is as late as that one.
        """
        flight, found = self.trajectory, {}
        for servos, added, total, sign in (
            (flight.commands_added, IN1_ADDED, IN1_GYRO, -1.0),
            (flight.actuators_added, IN1_DISTURBANCE, IN1_SUM, 1.0),
        ):
            if servos is None:
                continue
            mixed = (*flight.swashplate.unmix(*servos.T[:3]), servos.T[3])
            for name, own, both, signal in zip(IN1, added, total, mixed):
                found[own] = self._recorded(
                    own, self._filtered(signal[:, None])[:, 0], late_as=name
                )
                found[both] = columns[name] + sign * found[own]
        for names, sums, own, added in (
            (RATE_DISTURBANCE, RATE_SUM, flight.gyro_rates, flight.rates_added),
            (ATTITUDE_DISTURBANCE, ATTITUDE_SUM, flight.attitudes, flight.angles_added),
        ):
            if added is None:
                continue
            for each, signals in ((names, added), (sums, own + added)):
                for name, signal in zip(each, self._filtered(signals).T):
                    found[name] = self._recorded(name, signal)
        return found

    def _lever_arm(
        self, rates: NDArray[np.float64], attitudes: NDArray[np.float64]
    ) -> dict[tuple[str, ...], NDArray[np.float64]]:
        """Return what the IMU's offset adds to velocity, specific force and position."""
        own = self.recorder.lever_arm
        arm = self.trajectory.imu_offset if own is None else np.array(own)
        spin = np.gradient(rates, self.time, axis=0)
        turning = np.cross(rates, arm)
        earth = Rotation.from_euler("ZYX", attitudes[:, ::-1])
        return {
            VELOCITIES: turning,
            ACCELERATIONS: np.cross(spin, arm) + np.cross(rates, turning),
            POSITIONS: earth.apply(arm),
        }

    def _seen(
        self,
        signals: NDArray[np.float64],
        names: tuple[str, ...],
        noise: Mapping[str, NDArray[np.float64]],
        *,
        late: bool = False,
    ) -> NDArray[np.float64]:
        columns = [
            self._sampled(signals[:, k], name if late else None) + noise[name]
            for k, name in enumerate(names)
        ]
        return np.column_stack(columns)

    def _digitised(
        self, name: str, signal: NDArray[np.float64], *, late_as: str | None = None
    ) -> NDArray[np.float64]:
        sampled = self._sampled(signal, late_as or name)
        return self._rounded(name, sampled + self._input_noise[name])

    def _recorded(
        self, name: str, signal: NDArray[np.float64], *, late_as: str | None = None
    ) -> NDArray[np.float64]:
        """Return a filtered signal as a channel of it: late, noisy and rounded."""
        sampled = self._sampled(signal, late_as or name)
        return self._rounded(name, sampled + self._noise(name))

    def _filtered(self, signals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return columns behind the anti-alias filter, which begins at rest."""
        if self._sos is None:
            return signals
        start = sosfilt_zi(self._sos)[:, :, None] * signals[0]
        return sosfilt(self._sos, signals, axis=0, zi=start)[0]

    def _sampled(self, signal: NDArray[np.float64], name: str | None) -> NDArray[np.float64]:
        """Return a filtered signal at the samples, late by the latency of a named channel."""
        latency = 0.0 if name is None else self.recorder.late(name)
        return np.interp(self.time - latency, self.trajectory.time, signal)

    def _rounded(self, name: str, signal: NDArray[np.float64]) -> NDArray[np.float64]:
        step = self.recorder.resolution.get(name, 0.0)
        return signal if step == 0.0 else np.round(signal / step) * step

    def _noise(self, name: str) -> NDArray[np.float64]:
        level = self.recorder.noise.get(name, 0.0)
        if level == 0.0:
            return np.zeros(self.time.size)
        return level * self.rng.standard_normal(self.time.size)


def last_second(trajectory: Trajectory, provenance: Mapping[str, Any]) -> FlightRecord:
    """Return the last second of a flight at the simulation's rate, true to the last digit.

    It has the channels of a recorder with `rotor=True`, without IN1. Velocities, forces and
    positions are the IMU's.

    Args:
        trajectory: of a flight that has at least two samples.
        provenance: kept with the record.
    """
    trajectory = trajectory.since(trajectory.time[-1] - _LAST)
    groups = {**_MEASURED, **_TRUE}
    if trajectory.rotor_speed is None:
        del groups[ROTOR_SPEED]
    values = np.column_stack([columns(trajectory) for columns in groups.values()])
    channels = tuple(_channel(name) for names in groups for name in names)
    return FlightRecord(trajectory.time, values, channels, provenance)


def _channel(name: str) -> Channel:
    one = CHANNELS[name]
    if name not in _AT_IMU:
        return one
    return replace(one, meaning=one.meaning.replace("the centre of gravity", "the IMU"))
