"""A vehicle on its ground, flown by frames of pulses, and the record of its flight.

Timing, which a model of the loop needs: an answer tells the state at its own time t. The pulses of
the frame that follows act from t on, held until the next answer's time, t + 1 / rate_hz; there is
no other delay on this side than the servos'. Rates and specific force are those at t too, not of
the time step's start. Positions are those of the IMU from where it stood at the start.
"""

import copy
import math
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from fractions import Fraction
from types import TracebackType
from typing import Any, Literal, Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import DivergedError, InputError, ModelError, UnknownNameError
from helisim.base.settings import to_plain
from helisim.physics.drive import IDEAL, MOTOR
from helisim.physics.layout import CONTROL, PARAM, SENSOR, STATE
from helisim.physics.native import installed
from helisim.records.record import FlightRecord, made_by
from helisim.sim.flight import begin, generator, steps
from helisim.sim.ground import Ground
from helisim.sim.limits import Contact
from helisim.sim.recorder import Recorder, read_trajectory
from helisim.sim.weather import Weather
from helisim.sitl.link import Sensed
from helisim.sitl.mixing import Outputs
from helisim.vehicle import Vehicle, load
from helisim.vehicle.assembly import check_motor, with_room
from helisim.vehicle.controller import DIRECT, SHIPPED, Controller, law_room
from helisim.vehicle.trim import addresses, find_trim

_SPOOL_UP = 12.0
"""s, to the nominal speed where no motor's numbers say it: usual for speed controllers."""


def powered(vehicle: Vehicle, timestep: float, *, motor: bool = True) -> Vehicle:
    """Return a vehicle whose rotor a motor turns, in time steps of so many seconds.

    Args:
        vehicle: one that has no motor's numbers gets an ideal governor.
        timestep: s.
        motor: False for an ideal governor in any case.
    """
    try:
        check_motor(vehicle.parameters, "a motor turns the rotor")
    except ModelError:
        motor = False
    governor = "motor" if motor else "ideal"
    parameters = vehicle.parameters.replace(
        {"drive.governor": governor}, "an autopilot spools it up"
    )
    model = copy.copy(vehicle.model)
    model.opt.timestep = timestep
    model.actuator_user[addresses(model).rotor, PARAM.drive_governor] = MOTOR if motor else IDEAL
    model = with_room(model, vehicle.folder, parameters, law_room(model))
    trim = find_trim(model, height=vehicle.trim.height, near=vehicle.trim)
    return Vehicle(vehicle.folder, parameters, model, trim, vehicle.controller)


class SlowRotor:
    """A rotor that follows the speed asked for as slowly as one that is spooled up.

    For a vehicle that has no motor's numbers: its ideal governor keeps any speed at once.

    Attributes:
        speed: over the nominal one.
    """

    def __init__(self, period: float) -> None:
        """Stand still; `towards` is called once in each period, s."""
        self.speed = 0.0
        self._most = period / _SPOOL_UP

    def towards(self, wanted: float) -> float:
        """Return the speed a period later, nearer to the one that is asked for."""
        self.speed += min(self._most, max(-self._most, wanted - self.speed))
        return self.speed


RECORDER = Recorder(noise={}, resolution={}, rotor=True)
"""Of what truly happened: without noise, latency and rounding, the rotor's and the air's too."""
_INTERVAL = 0.004
"""s between two samples that are kept, at most: more than twice the recorder's rate."""
_ROOM = 4096
_FEWEST = 30


class Recording:
    """Sensor data at equal times, in blocks that are never moved: 120 kB a second of flight."""

    def __init__(self, period: float, columns: int) -> None:
        """Begin with nothing.

        Args:
            period: s, between two frames.
            columns: of the sensor data.
        """
        self._each = max(1, int(_INTERVAL / period))
        self.interval = self._each * period
        self._columns = columns
        self.begin()

    def begin(self) -> None:
        """Forget what was kept."""
        self._blocks: list[NDArray[np.float64]] = []
        self._count = 0

    def add(self, frame: int, sensordata: NDArray[np.float64]) -> None:
        """Keep a frame's sensor data where it is its turn.

        Args:
            frame: its number, from 0 on.
            sensordata: (n_sensordata,) of its end.
        """
        if frame % self._each:
            return
        row = self._count % _ROOM
        if row == 0:
            self._blocks.append(np.empty((_ROOM, self._columns)))
        self._blocks[-1][row] = sensordata
        self._count += 1

    def record(
        self,
        vehicle: Vehicle,
        ground: Ground,
        crashed: tuple[float, str] | None,
        flown: Mapping[str, Any],
    ) -> FlightRecord:
        """Return the flight so far.

        Args:
            vehicle: that flew.
            ground: below it.
            crashed: when (s) and why it flies no longer; None if it does.
            flown: for the provenance.

        Raises:
            InputError: it is too short for a record.
        """
        if self._count < _FEWEST:
            raise InputError(
                f"a flight of {self._count * self.interval:g} s is no record: fly "
                f"{_FEWEST * self.interval:g} s"
            )
        rows = np.concatenate(self._blocks)[: self._count]
        rows[:, vehicle.model.sensor("clock").adr[0]] = np.arange(self._count) * self.interval
        trajectory = replace(
            read_trajectory(vehicle, rows), timestep=self.interval, hold=0.0, ground=ground
        )
        provenance = _provenance(vehicle, ground, crashed, flown)
        return RECORDER.record(trajectory, np.random.default_rng(0), provenance)


def _provenance(
    vehicle: Vehicle,
    ground: Ground,
    crashed: tuple[float, str] | None,
    flown: Mapping[str, Any],
) -> dict[str, Any]:
    provenance = made_by(
        "flown by an outside autopilot",
        **vehicle.provenance,
        **flown,
        ground=to_plain(ground),
        recorder=RECORDER.to_dict(),
    )
    if crashed is not None:
        provenance["ended"] = {"at": crashed[0], "why": crashed[1]}
    return provenance


Tail = Literal["direct", "gyro"]
TAILS: tuple[Tail, ...] = ("direct", "gyro")
RATE_HZ = 1000.0
"""Frames a second: the rate of ArduPilot's simulated gyro, which has one sample a frame at most.

With less than 1.8 samples a loop (720 a second at its usual 400 Hz) it does not arm."""
_SHORTEST = Fraction(1, 10_000)
"""s, of a time step."""


class Aircraft:
    """A vehicle that stands on the ground, its rotor stopped, until an autopilot flies it.

    It takes off, flies, lands and stands again. After a rotor's strike or a hard landing the rotor
    is gone: what is left falls, and lies there, until `reset`.

        with Aircraft("jr700") as aircraft:       # MuJoCo has the force laws meanwhile
            while aircraft.time < 60.0:
                sensed = aircraft.step(pulses)    # outside `with` too, by 13 us slower

    Attributes:
        vehicle: that flies, with a motor where it has the numbers of one.
        outputs: which of them moves what.
        model: MuJoCo's, with the ground.
        data: MuJoCo's, evaluated at its time.
        crashed: why it flies no longer, "" if it does.
    """

    def __init__(
        self,
        vehicle: Vehicle | str = "jr700",
        *,
        tail: str = "direct",
        rate_hz: float = RATE_HZ,
        ground: Ground | None = None,
        weather: Weather | None = None,
        motor: bool = True,
        seed: int = 1,
        recorded: bool = False,
    ) -> None:
        """Place a vehicle on the ground.

        Args:
            vehicle: a vehicle, or its name or folder.
            tail: "direct" where the tail's output moves the servo, "gyro" where the vehicle's own
                yaw gyro stays between, whose pedals it then is.
            rate_hz: frames a second of simulated time.
            ground: that it stands on; level, with its effect, if None.
            weather: that is flown through; calm if None.
            motor: whether a motor turns the rotor, if the vehicle has the numbers of one; else an
                ideal governor follows the speed asked for within a spool-up of 12 s, and keeps it
                whatever torque that takes.
            seed: of turbulence, 0 or more.
            recorded: whether what happens is kept for `record`, 120 kB a second.

        Raises:
            UnknownNameError: no such vehicle or tail.
            InputError: the rate or the seed is out of range, or the gyro's ticks don't fit.
            ModelError: the vehicle's outputs are none.
        """
        if tail not in TAILS:
            raise UnknownNameError("tail", tail, TAILS)
        if seed < 0:
            raise InputError(f"seed must be 0 or more, got {seed}")
        self.weather, self.seed, self.tail = weather or Weather(), seed, tail
        gyro = tail == "gyro"
        loaded = load(vehicle) if isinstance(vehicle, str) else vehicle
        self.period = _period(rate_hz)
        self._microseconds = round(1e6 * self.period)
        self._each = _steps(self.period, loaded)
        flown = powered(loaded, float(self.period / self._each), motor=motor)
        motor = flown.parameters.word("drive.governor") == "motor"
        self.ground = replace(ground or Ground(), parked=True, rotor=0.0 if motor else 1.0)
        flown = flown.with_controller(Controller(swash=None, tail=SHIPPED) if gyro else DIRECT)
        self.vehicle = self.weather.trimmed(self.ground.felt_by(flown))
        self.outputs = Outputs.of(self.vehicle.parameters)
        self.model = self.vehicle.grounded_model(self.ground.put_into)
        self._where = addresses(self.model)
        par = self.model.actuator_user[self._where.rotor]
        par[PARAM.gyro_on], par[PARAM.pilot_on] = float(gyro), 0.0
        par[PARAM.ground_effect] = self.ground.effect
        air_seed = int(generator(seed, 0, "air").integers(2**31))
        self.weather.write(par, self.vehicle, seed=air_seed)
        self._rotor = None if motor else SlowRotor(float(self.period))
        self._imu = int(self.model.sensor("imu_gyro").adr[0])
        self._contact = Contact(self.vehicle, self.ground)
        self.data = mujoco.MjData(self.model)
        self._recording = (
            Recording(float(self.period), self.model.nsensordata) if recorded else None
        )
        self._lent, self._holds = ExitStack(), False
        self.reset()

    def __enter__(self) -> Self:
        self._lent.enter_context(installed())
        self._holds = True
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._holds = False
        self._lent.__exit__(kind, error, trace)

    def __repr__(self) -> str:
        state = self.crashed or ("on the ground" if self.stands else "in the air")
        return f"Aircraft({self.vehicle.name!r}, {self.time:.2f} s, {state})"

    def reset(self) -> None:
        """Stand on the ground again at time 0, the rotor stopped."""
        begin(self.vehicle, self.model, self.data, self.weather, self.ground, seed=self.seed)
        act = self.data.act[self._where.state :]
        act[STATE.inflow_0 : STATE.inflow_c + 1] = 0.0
        self.data.ctrl[self._where.control + CONTROL.rotor] = 0.0
        self.crashed, self._frames, self._crash = "", 0, None
        self._start = np.zeros(3)
        self._contact.begin()
        if self._rotor is not None:
            self._rotor.speed = 0.0
        with installed():
            mujoco.mj_forward(self.model, self.data)
        self._start = self._read().position
        self._sensed = self._read()
        if self._recording is not None:
            self._recording.begin()
            self._recording.add(0, self.data.sensordata)

    @property
    def time(self) -> float:
        """Simulated time since the last `reset`, s."""
        return self._frames * self._microseconds * 1e-6

    @property
    def sensed(self) -> Sensed:
        """What the sensors say now."""
        return self._sensed

    @property
    def rotor_speed(self) -> float:
        """Of the main rotor, over its nominal speed."""
        return float(self.data.sensordata[self._imu + SENSOR.speed])

    @property
    def stands(self) -> bool:
        """Whether anything touches the ground."""
        return bool(self.data.ncon)

    def step(self, pulses: Sequence[int]) -> Sensed:
        """Fly on by one frame with the outputs at these pulses, and return what is sensed then.

        Args:
            pulses: of the autopilot's outputs, us; 0 where one is off: a servo stays where it is
                asked to be, and the motor stops.

        Raises:
            DivergedError: the flight has no finite state.
        """
        self._command(pulses)
        if self._holds:
            self._fly_on()
        else:
            with installed():
                self._fly_on()
        self._frames += 1
        self._sensed = sensed = self._read()
        if self._recording is not None:
            self._recording.add(self._frames, self.data.sensordata)
        if not self.crashed:
            turn = np.empty(9)
            mujoco.mju_quat2Mat(turn, sensed.quaternion)
            self.crashed = self._contact.found(
                sensed.time, self._start + sensed.position, turn.reshape(3, 3), self.stands
            )
            if self.crashed:
                self._crash = self.time, self.crashed
                self._lose_rotor()
        return sensed

    def record(self) -> FlightRecord:
        """Return what truly happened since the last `reset`, 100 samples a second, no noise.

        One with a crash in it is whole, and marked: its `ended` says why and when.

        Raises:
            InputError: nothing was kept (`recorded=True` does), or too little.
        """
        if self._recording is None:
            raise InputError("nothing of this flight was kept: make it with recorded=True")
        flown = {
            "weather": to_plain(self.weather),
            "autopilot": {"tail": self.tail, "rate_hz": float(1 / self.period)},
            "outputs": to_plain(self.outputs),
            "seed": self.seed,
        }
        return self._recording.record(self.vehicle, self.ground, self._crash, flown)

    def _fly_on(self) -> None:
        next(steps(self.model, self.data, each=self._each))
        mujoco.mj_forward(self.model, self.data)

    def _command(self, pulses: Sequence[int]) -> None:
        first = self._where.control
        held = self.data.ctrl[first : first + CONTROL.rotor + 1].tolist()
        servos = self.outputs.servos(pulses, held[CONTROL.servo_front : CONTROL.rotor])
        speed = 0.0 if self.crashed else self.outputs.speed(pulses)
        if self._rotor is not None:
            speed = self._rotor.towards(speed)
        if self.tail == "gyro":
            held[CONTROL.ped] = self.outputs.pedals(pulses, held[CONTROL.ped])
            servos[-1] = held[CONTROL.servo_tail]
        held[CONTROL.servo_front :] = [*servos, speed]
        self.data.ctrl[first : first + CONTROL.rotor + 1] = held

    def _lose_rotor(self) -> None:
        act = self.data.act[self._where.state :]
        act[STATE.speed] = act[STATE.engine] = act[STATE.governor] = 0.0
        if self._rotor is not None:
            self._rotor.speed = 0.0

    def _read(self) -> Sensed:
        """Return what the IMU senses in the state that was evaluated last."""
        data = self.data.sensordata[self._imu : self._imu + len(SENSOR)].tolist()
        p, q, r, ax, ay, az, u, v, w, qw, qx, qy, qz, x, y, z = data[: SENSOR.imu_z + 1]
        if not math.isfinite(p + q + r + x + y + z + qw + u):
            self.crashed = "the flight has no finite state"
            self._crash = self.time, self.crashed
            raise DivergedError(f"{self.crashed} from {self.time:.2f} s")
        turn = qw, qx, -qy, -qz
        position = np.array((x, -y, -z))
        return Sensed(
            time=self.time,
            gyro=np.array((p, -q, -r)),
            force=np.array((ax, -ay, -az)),
            position=position - self._start,
            velocity=_turned(turn, u, -v, -w),
            quaternion=np.array(turn),
            wind=_turned(turn, *data[SENSOR.air_u : SENSOR.air_w + 1]),
            clearance=self._clearance(position),
        )

    def _clearance(self, position: NDArray[np.float64]) -> float:
        """Return how far the ground is below a place (3,), straight down, m."""
        if self.ground.deck is None and self.ground.slope == 0.0:
            return -float(position[2])
        height = self.ground.heights(np.array([self.time]), position[None, None])[0, 0]
        return float(height) / math.cos(self.ground.slope)


def _turned(turn: Sequence[float], x: float, y: float, z: float) -> NDArray[np.float64]:
    """Return a vector that a quaternion turns, (3,): v + 2 w (q x v) + 2 q x (q x v)."""
    w, a, b, c = turn
    tx, ty, tz = 2.0 * (b * z - c * y), 2.0 * (c * x - a * z), 2.0 * (a * y - b * x)
    return np.array(
        (
            x + w * tx + b * tz - c * ty,
            y + w * ty + c * tx - a * tz,
            z + w * tz + a * ty - b * tx,
        )
    )


def _period(rate_hz: float) -> Fraction:
    """Return the time between two frames, s, whole microseconds as the autopilot counts them."""
    microseconds = 1e6 / rate_hz if rate_hz > 0.0 else math.inf
    if not (100.0 <= microseconds <= 20_000.0 and abs(microseconds % 1.0) < 1e-9):
        raise InputError(
            "the frames a second must be from 50 to 10000 and whole microseconds apart, such as "
            f"400, 500, 800 or 1000, got {rate_hz:g}"
        )
    return Fraction(round(microseconds), 1_000_000)


def _steps(period: Fraction, vehicle: Vehicle) -> int:
    """Return how many time steps a frame has; a period of the vehicle's gyro has a whole number."""
    tick, longest = (
        Fraction(seconds).limit_denominator(1_000_000)
        for seconds in (vehicle.parameters["gyro.period"], float(vehicle.model.opt.timestep))
    )
    both = Fraction(
        math.gcd(period.numerator * tick.denominator, tick.numerator * period.denominator),
        period.denominator * tick.denominator,
    )
    if both < _SHORTEST:
        raise InputError(
            f"the gyro's ticks are {1e3 * float(tick):g} ms apart, and no time step fits them and "
            f"{float(1 / period):g} frames a second; try {RATE_HZ:g}"
        )
    return round(period / both) * math.ceil(both / longest)
