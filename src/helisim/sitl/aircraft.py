"""A vehicle on its ground, flown by frames of pulses, and the record of its flight.

A frame's pulses act from the last answer's time t to the next, 1 ms later; servos delay more.
Positions are those of the IMU from its start.
"""

import copy
import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import DivergedError, InputError, ModelError
from helisim.base.settings import to_plain
from helisim.physics.drive import IDEAL, MOTOR
from helisim.physics.layout import CONTROL, PARAM, SENSOR, STATE
from helisim.physics.native import installed
from helisim.records.record import FlightRecord, made_by
from helisim.sim.flight import steps
from helisim.sim.ground import Ground
from helisim.sim.live import Live
from helisim.sim.recorder import Recorder, read_trajectory
from helisim.sim.weather import Weather
from helisim.sitl.link import Sensed
from helisim.sitl.mixing import Outputs
from helisim.sitl.vibration import Vibration
from helisim.vehicle import Vehicle, load
from helisim.vehicle.assembly import check_motor, with_room
from helisim.vehicle.controller import DIRECT, law_room
from helisim.vehicle.trim import find_trim, set_governor

FRAME = 1000  # us from a frame to the next: with less than 1.8 frames a loop ArduPilot does not arm
SPOOL_UP = 12.0  # s, to the nominal speed where no motor's numbers tell it
_SHORTEST = 100  # us, of a time step
# The true flight: without noise, latency and rounding; with rotor and air.
_RECORDER = Recorder(noise={}, resolution={}, rotor=True)
_EACH, _FEWEST = 4, 30  # frames from a sample that is kept to the next; samples of a record


def powered(vehicle: Vehicle, timestep: float, *, motor: bool = True) -> Vehicle:
    """Return a vehicle with a motor, else an ideal governor, in time steps of so many seconds."""
    parameters, governor = vehicle.parameters, "ideal"
    with suppress(ModelError):
        check_motor(parameters, "a motor turns the rotor")
        governor = "motor" if motor else "ideal"
    parameters = parameters.replace({"drive.governor": governor})
    model = copy.copy(vehicle.model)
    model.opt.timestep = timestep
    set_governor(model, MOTOR if governor == "motor" else IDEAL)
    model = with_room(model, vehicle.folder, parameters, law_room(model), slung=vehicle.slung)
    trim = find_trim(model, height=vehicle.trim.height, near=vehicle.trim)
    return replace(vehicle, parameters=parameters, model=model, trim=trim)


class Aircraft(Live):
    """A vehicle that stands on the ground, its rotor stopped, until an autopilot flies it.

    After a strike or hard landing it has no rotor until `reset`; `crashed` is why. `data` is
    MuJoCo's.
    """

    def __init__(
        self,
        vehicle: Vehicle | str = "jr700",
        *,
        ground: Ground | None = None,
        weather: Weather | None = None,
        motor: bool = True,
        seed: int = 1,
        recorded: bool = False,
        vibration: bool = False,
    ) -> None:
        """Place a vehicle on level ground with its effect, in calm air by default.

        Without `motor`, or its numbers, an ideal governor spools up within 12 s. `seed` is of
        turbulence and of `vibration`, which shakes what is sensed, not what is recorded. Raises
        UnknownNameError, ModelError, and InputError for a seed or gyro that doesn't fit.
        """
        if seed < 0:
            raise InputError(f"seed must be 0 or more, got {seed}")
        weather = weather or Weather()
        loaded = load(vehicle) if isinstance(vehicle, str) else vehicle
        self._each = _steps(loaded)
        flown = powered(loaded, FRAME / self._each / 1e6, motor=motor)
        self._motor = flown.parameters.word("drive.governor") == "motor"
        ground = replace(ground or Ground(), parked=True, rotor=0.0 if self._motor else 1.0)
        flown = weather.trimmed(ground.felt_by(flown.with_controller(DIRECT)))
        super().__init__(flown, flown.grounded_model(ground.put_into), weather, ground, seed=seed)
        self.outputs = Outputs.of(flown.parameters)
        self.par[PARAM.gyro_on] = self.par[PARAM.pilot_on] = 0.0
        self._first, self._recorded = int(self.model.sensor("imu_gyro").adr[0]), recorded
        self._vibrates = vibration
        self.reset()

    def reset(self) -> None:
        """Stand on the ground at time 0, the rotor stopped."""
        self.crashed, self._frames, self._crash_time = "", 0, 0.0
        self._slow_rotor = 0.0  # over the nominal one, without a motor
        self._shakes = (
            Vibration(self.vehicle.parameters, FRAME / 1e6, self.seed) if self._vibrates else None
        )
        super().reset()
        self._start = np.zeros(3)
        self._start = self._read().position
        self.sensed = self._read()
        self._rows = [self.data.sensordata.copy()]

    def _begins(self) -> None:
        self.data.act[self._where.state :][STATE.inflow_0 : STATE.inflow_c + 1] = 0.0
        self.data.ctrl[self._where.control + CONTROL.rotor] = 0.0

    @property
    def time(self) -> float:
        """Simulated time since the last `reset`, s."""
        return self._frames * FRAME * 1e-6

    @property
    def rotor_speed(self) -> float:
        """Speed of the main rotor, over its nominal speed."""
        return float(self.data.sensordata[self._first + SENSOR.speed])

    @property
    def stands(self) -> bool:
        """Whether anything touches the ground."""
        return bool(self.data.ncon)

    def step(self, pulses: Sequence[int]) -> Sensed:
        """Fly on by one frame of pulses, us, 0 for an output that is off. Raises DivergedError."""
        self._command(pulses)
        with installed():
            next(steps(self.model, self.data, each=self._each))
            mujoco.mj_forward(self.model, self.data)
        self._frames += 1
        self.sensed = sensed = self._read()
        if self._recorded and self._frames % _EACH == 0:
            self._rows.append(self.data.sensordata.copy())
        if not self.crashed:
            self.crashed = self.struck()
            if self.crashed:
                blown = f", in a wind of {self.weather.wind:g} m/s" if self.weather.wind else ""
                self.crashed += blown
                self._crash_time, self._slow_rotor = self.time, 0.0
                self.data.act[self._where.state :][STATE.speed : STATE.fuel + 1] = 0.0
        if self._shakes is not None:
            self.sensed = sensed = self._shakes.shaken(sensed, self.rotor_speed)
        return sensed

    def record(self) -> FlightRecord:
        """Return the true flight, 100 samples a second. Raises InputError unless `recorded`."""
        if not self._recorded:
            raise InputError("nothing of this flight was kept: make it with recorded=True")
        interval = _EACH * (FRAME / 1e6)
        if len(self._rows) < _FEWEST:
            raise InputError(
                f"a flight of {len(self._rows) * interval:g} s is no record: fly "
                f"{_FEWEST * interval:g} s"
            )
        rows = np.array(self._rows)
        rows[:, self.vehicle.model.sensor("clock").adr[0]] = np.arange(len(rows)) * interval
        trajectory = read_trajectory(self.vehicle, rows)
        trajectory = replace(trajectory, timestep=interval, hold=0.0, ground=self.ground)
        provenance = made_by(
            "flown by an outside autopilot",
            **self.vehicle.provenance,
            weather=to_plain(self.weather),
            autopilot={"rate_hz": 1e6 / FRAME},
            outputs=to_plain(self.outputs),
            seed=self.seed,
            ground=to_plain(self.ground),
            recorder=_RECORDER.to_dict(),
        )
        if self.crashed:
            provenance["ended"] = {"at": self._crash_time, "why": self.crashed}
        return _RECORDER.record(trajectory, np.random.default_rng(0), provenance)

    def _command(self, pulses: Sequence[int]) -> None:
        first = self._where.control
        held = self.data.ctrl[first : first + CONTROL.rotor + 1].tolist()
        servos = self.outputs.servos(pulses, held[CONTROL.servo_front : CONTROL.rotor])
        speed = 0.0 if self.crashed else self.outputs.speed(pulses)
        if not self._motor:  # an ideal governor keeps any speed
            most = FRAME / 1e6 / SPOOL_UP
            self._slow_rotor += min(most, max(-most, speed - self._slow_rotor))
            speed = self._slow_rotor
        held[CONTROL.servo_front :] = [*servos, speed]
        self.data.ctrl[first : first + CONTROL.rotor + 1] = held

    def _read(self) -> Sensed:
        data = self.data.sensordata[self._first : self._first + len(SENSOR)].tolist()
        p, q, r, ax, ay, az, u, v, w, qw, qx, qy, qz, x, y, z = data[: SENSOR.imu_z + 1]
        if not math.isfinite(p + q + r + x + y + z + qw + u):
            self.crashed, self._crash_time = "the flight has no finite state", self.time
            raise DivergedError(f"{self.crashed} from {self.time:.2f} s")
        turn = qw, qx, -qy, -qz
        return Sensed(
            time=self.time,
            gyro=np.array((p, -q, -r)),
            force=np.array((ax, -ay, -az)),
            position=np.array((x, -y, -z)) - self._start,
            velocity=_turned(turn, u, -v, -w),
            quaternion=np.array(turn),
        )


def _steps(vehicle: Vehicle) -> int:
    tick = round(1e6 * vehicle.parameters["gyro.period"])
    both = math.gcd(FRAME, tick)
    if both < _SHORTEST:
        raise InputError(
            f"the gyro's ticks are {1e-3 * tick:g} ms apart, and no time step fits them and a "
            f"frame of {1e-3 * FRAME:g} ms"
        )
    return FRAME // both * math.ceil(both / round(1e6 * vehicle.model.opt.timestep))


def _turned(turn: Sequence[float], x: float, y: float, z: float) -> NDArray[np.float64]:
    """Return a vector that a quaternion turns, (3,); numpy's cross takes ten times as long."""
    w, a, b, c = turn
    tx, ty, tz = 2.0 * (b * z - c * y), 2.0 * (c * x - a * z), 2.0 * (a * y - b * x)
    more = b * tz - c * ty, c * tx - a * tz, a * ty - b * tx
    return np.array((x + w * tx + more[0], y + w * ty + more[1], z + w * tz + more[2]))
