"""The flight computer: from what truly happened to what is recorded.

Each channel passes the same anti-alias filter, is sampled with its own latency, and gains noise and
quantisation. Velocity and specific force are measured at the IMU and corrected to the centre of
gravity with the measured rates (Wu and Chen, section 2).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfilt, sosfilt_zi
from scipy.spatial.transform import Rotation

from helisim.base.errors import InputError
from helisim.base.settings import check, in_brief, setting, to_plain
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
    channel,
)
from helisim.records.record import FlightRecord
from helisim.sim.trajectory import Trajectory
from helisim.vehicle import Vehicle

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
