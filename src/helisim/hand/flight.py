"""A flight whose sticks are moved while it goes on: its assistance, its recordings."""

import math
import weakref
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal, get_args

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.settings import to_plain
from helisim.hand.sticks import Deflection, StickFeel
from helisim.physics.laws import Failure
from helisim.physics.layout import CONTROL, PARAM, STATE
from helisim.physics.motion import flip
from helisim.physics.native import installed
from helisim.records.record import FlightRecord, made_by
from helisim.sim.flight import begin, generator, steps
from helisim.sim.ground import FLIPS, Ground
from helisim.sim.limits import Contact, FlightEnvelope, broken
from helisim.sim.plan import Pilot, hover_height
from helisim.sim.recorder import Recorder, Trajectory, read_trajectory, sound_samples
from helisim.sim.weather import Weather
from helisim.vehicle import Vehicle
from helisim.vehicle.swashplate import Swashplate
from helisim.vehicle.trim import Motion, Trim, addresses, collective_stick, read_motion, root_body

AssistName = Literal["hover", "level", "none"]
ASSISTS: tuple[AssistName, ...] = get_args(AssistName)

_TILT = 0.45
"""rad, that a full deflection commands where attitude is commanded."""
_SPEED, _CLIMB = 6.0, 2.0
"""m/s, that a full deflection commands where velocity is commanded; a climb of 2 m/s is below
what the landing gear stands."""
_HURRY = 3.0
"""m/s^2, at which the commanded velocity changes: a tilt of 0.3 rad."""
_STILL, _STILL_CLIMB, _STILL_TURN = 0.4, 0.2, 0.15
"""m/s and rad/s, below which a helicopter whose stick is in the middle is held where it is."""
_MIDDLE = 0.05
"""Deflection of a collective that is in the middle: a throttle stick has no spring."""
_ATTITUDE, _VELOCITY, _POSITION = 3.0, 1.0, 0.35
"""rad/s, at which the loops of attitude, velocity and position cross over, each well inside the
next."""
_HEAVE, _HEIGHT, _HEADING = 4.0, 1.0, 1.5
"""rad/s, of the loops of vertical speed, height and heading."""


def check_assist(name: str) -> AssistName:
    """Return the name of an assistance. Raises UnknownNameError."""
    for known in ASSISTS:
        if name == known:
            return known
    raise UnknownNameError("assist", name, ASSISTS)


@dataclass(frozen=True)
class _Gains:
    """What the compiled pilot flies with: sticks per rad or per m/s, and 1/s."""

    attitude: float
    velocity: float
    position: float
    heave: float
    height: float
    heading: float

    @classmethod
    def of(cls, vehicle: Vehicle, par: NDArray[np.float64]) -> "_Gains":
        gravity = float(np.linalg.norm(vehicle.model.opt.gravity))
        roll_rate, yaw_rate = (
            abs(float(par[PARAM.gyro_p_per_lat])),
            abs(float(par[PARAM.gyro_k_delta] / par[PARAM.gyro_k_a])),
        )
        return cls(
            attitude=_ATTITUDE / roll_rate,
            velocity=_VELOCITY / gravity,
            position=_POSITION,
            heave=_HEAVE / abs(vehicle.derivatives["Z_col"]),
            height=_HEIGHT,
            heading=_HEADING / yaw_rate,
        )


class Assistance:
    """Tells the compiled pilot, through a vehicle's parameters (n_param,), what the sticks ask for.

    hover: the sticks command velocities, a climb and a turn; let go, it stays where it is.
    level: the cyclic stick commands roll and pitch angle; collective and pedals are direct.
    none: all four sticks go to the gyro as they are.
    """

    def __init__(self, vehicle: Vehicle, par: NDArray[np.float64]) -> None:
        """Take gains and trim from a vehicle whose pilot is in its parameters."""
        self.trim: Trim = vehicle.trim
        self.gains = _Gains.of(vehicle, par)
        self.collective = float(par[PARAM.pilot_col])
        self.begin()

    def begin(self) -> None:
        """Start anew, from however the helicopter moves."""
        self.velocity = np.zeros(2)
        self.holds_place = self.holds_height = self.holds_heading = False

    def ask(
        self,
        par: NDArray[np.float64],
        name: AssistName,
        felt: Deflection,
        now: Motion,
        seconds: float,
    ) -> None:
        """Write what the pilot is to do until it is asked again.

        Args:
            par: parameters of the vehicle, (n_param,), written.
            name: of the assistance.
            felt: where the sticks are, behind rates and expo.
            now: how the helicopter moves.
            seconds: since the last time.
        """
        sticks = 0.5 * np.array(felt)
        par[PARAM.pilot_col : PARAM.pilot_ped + 1] = sticks
        par[PARAM.pilot_k_attitude : PARAM.pilot_k_heading + 1] = 0.0
        if name == "none":
            return
        par[PARAM.pilot_k_attitude] = self.gains.attitude
        par[PARAM.pilot_lon] = par[PARAM.pilot_lat] = 0.0
        par[PARAM.pilot_theta], par[PARAM.pilot_phi] = self.trim.theta, self.trim.phi
        if name == "level":
            par[PARAM.pilot_theta] += _TILT * felt.lon
            par[PARAM.pilot_phi] += _TILT * felt.lat
            return
        self._hold_place(par, felt, now, seconds)
        self._hold_height(par, felt, now)
        self._hold_heading(par, felt, now)

    def _hold_place(
        self, par: NDArray[np.float64], felt: Deflection, now: Motion, seconds: float
    ) -> None:
        gains = self.gains
        par[PARAM.pilot_k_velocity], par[PARAM.pilot_k_position] = gains.velocity, gains.position
        wanted = _SPEED * np.array([-felt.lon, felt.lat])
        most = _HURRY * seconds
        self.velocity = self.velocity + np.clip(wanted - self.velocity, -most, most)
        moves = self.velocity.any()
        if not moves and (self.holds_place or math.hypot(now.u, now.v) < _STILL):
            if not self.holds_place:
                par[PARAM.pilot_north], par[PARAM.pilot_east] = now.north, now.east
            self.holds_place = True
            return
        self.holds_place = False
        ahead, right = self.velocity / gains.position  # so far away that it flies there as fast
        cosine, sine = math.cos(now.psi), math.sin(now.psi)
        par[PARAM.pilot_north] = now.north + cosine * ahead - sine * right
        par[PARAM.pilot_east] = now.east + sine * ahead + cosine * right

    def _hold_height(self, par: NDArray[np.float64], felt: Deflection, now: Motion) -> None:
        gains = self.gains
        par[PARAM.pilot_col] = self.collective
        par[PARAM.pilot_k_heave], par[PARAM.pilot_k_height] = gains.heave, gains.height
        climb = 0.0 if abs(felt.col) < _MIDDLE else _CLIMB * felt.col
        if climb == 0.0 and (self.holds_height or abs(now.w) < _STILL_CLIMB):
            if not self.holds_height:
                par[PARAM.pilot_down] = now.down
            self.holds_height = True
            return
        self.holds_height = False
        par[PARAM.pilot_down] = now.down - climb / gains.height

    def _hold_heading(self, par: NDArray[np.float64], felt: Deflection, now: Motion) -> None:
        if felt.ped == 0.0 and (self.holds_heading or abs(now.r) < _STILL_TURN):
            if not self.holds_heading:
                par[PARAM.pilot_psi] = now.psi
            self.holds_heading = True
            par[PARAM.pilot_k_heading] = self.gains.heading
            return
        self.holds_heading = False


_SHORTEST = 0.1
"""s, of a recording that makes a record: ten samples."""
_ENVELOPE = FlightEnvelope(saturation=None)
"""A hand may be at a stop for as long as it likes: sticks and servos are in the record."""


class Recording:
    """Sensor data of each step, and what was switched meanwhile."""

    def __init__(self, since: float) -> None:
        self._since = since
        self._rows: list[NDArray[np.float64]] = []
        self._switched: list[tuple[float, str, Any]] = []

    def __bool__(self) -> bool:
        return bool(self._rows)

    def add(self, data: mujoco.MjData) -> None:
        """Keep the sensor data of a step that was just made."""
        self._rows.append(data.sensordata.copy())

    def note(self, time: float, what: str, value: Any) -> None:
        """Keep that something was switched at a time of the flight, s."""
        self._switched.append((time, what, value))

    def seconds(self, model: mujoco.MjModel) -> float:
        """Return how long it is, s."""
        return len(self._rows) * float(model.opt.timestep)

    def record(
        self,
        vehicle: Vehicle,
        *,
        ground: Ground,
        crashed: str,
        failed: Failure | None = None,
        rng: np.random.Generator,
        flown: Mapping[str, Any],
    ) -> FlightRecord:
        """Return the record, its time from 0.

        Args:
            vehicle: that flew.
            ground: below the flight.
            crashed: why the flight ended; "" if it goes on.
            failed: how the controller failed that ended it; None if it didn't.
            rng: of the sensors' noise.
            flown: for the provenance: how it was flown.

        Raises:
            InputError: it is too short.
        """
        trajectory = self._trajectory(vehicle)
        start = float(trajectory.time[0])
        ended = _ended(vehicle, replace(trajectory, ground=ground), crashed, failed)
        if ended is not None:
            ended["at"] -= start
        trajectory = replace(trajectory, time=trajectory.time - start)
        recorder = Recorder.of(vehicle)
        switched = [
            [max(0.0, round(at - start, 6)), what, value] for at, what, value in self._switched
        ]
        provenance = made_by(
            "flown by hand in the simulation",
            **vehicle.provenance,
            by_hand={**flown, "switched": switched, "from_s": start},
            recorder=recorder.to_dict(),
        )
        if ended is not None:
            provenance["ended"] = ended
        return recorder.record(trajectory, rng, provenance)

    def _trajectory(self, vehicle: Vehicle) -> Trajectory:
        rows = np.array(self._rows)
        count = sound_samples(vehicle.model, rows)[0] if len(rows) else 0
        seconds = count * float(vehicle.model.opt.timestep)
        if seconds < _SHORTEST:
            raise InputError(f"a recording of {seconds:g} s is no record: fly {_SHORTEST:g} s")
        return read_trajectory(vehicle, rows[:count])


def _ended(
    vehicle: Vehicle, trajectory: Trajectory, crashed: str, failed: Failure | None
) -> dict[str, Any] | None:
    """Return when and why a trajectory is no longer what the model is valid for, None if it is.

    Skids on the ground hold what no stick asks for, so a landing is such an end too.
    """
    ends = [] if (left := _ENVELOPE.end(vehicle, trajectory)) is None else [left]
    touches = trajectory.touching
    if touches.any():
        ends.append((int(np.argmax(touches)), "the helicopter touched the ground"))
    if ends:
        first, why = min(ends)
        return {"at": float(trajectory.time[first]), "why": why}
    if not crashed:
        return None
    end = {"at": float(trajectory.time[-1]), "why": crashed}
    return end if failed is None else {**end, "traceback": failed.traceback}


_ASKS = 0.02
"""s between two looks of the pilot at the sticks, as of a radio link: 50 Hz."""
_NOT_THE_GYROS = ("front_", "left_", "right_", "tail_", "flap_", "air_")
"""Beginnings of the states of servos, rotor and air."""


class HandFlight:
    """Fly a vehicle by hand: move `deflection` and let time pass.

    It starts in the hover above its pad. The ground is there: a helicopter lands on its skids, and
    crashes where a rotor or a fall hits the ground, after which only `reset` helps.

        flight = HandFlight(vehicle)
        flight.start_recording()
        flight.fly(2.0, lon=-0.5)          # half a stick forward for two seconds
        flight.fly(5.0)                    # let go
        record = flight.stop_recording()

    A copy flies on by itself, from the same state; an object that is a controller starts anew.

    Attributes:
        vehicle: that flies.
        model: with every part to be seen, and the ground.
        data: MuJoCo's; `installed()` must hold while something other than `fly` steps it.
        deflection: where the sticks are, read by the next steps.
        feel: rates, expo and deadband of the sticks.
        crashed: why the helicopter no longer flies, "" if it does.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        *,
        assist: str = "hover",
        feel: StickFeel | None = None,
        weather: Weather | None = None,
        ground: Ground | None = None,
        height: float | None = None,
        seed: int = 1,
        flown_with: str = "a program",
    ) -> None:
        """Place a vehicle in the hover.

        Args:
            vehicle: that flies.
            assist: "hover", "level" or "none", see `Assistance`.
            feel: of the sticks; linear over all their travel if None.
            weather: that is flown through; calm if None.
            ground: that is below, a slope or a deck too; level, with its effect, if None.
            height: m above the ground, of its origin; a little above its pad if None.
            seed: of turbulence and sensors, 0 or more.
            flown_with: what moves the sticks, for the records' provenance.

        Raises:
            UnknownNameError: no such assistance.
            InputError: height or seed is out of range.
            TrimError: the vehicle can't hover in the wind.
        """
        if seed < 0:
            raise InputError(f"seed must be 0 or more, got {seed}")
        self.weather, self.ground = weather or Weather(), ground or Ground()
        self.model = vehicle.visual_model(self.ground.put_into)
        self.height = hover_height(self.model) if height is None else height
        if not 0.0 < self.height < np.inf:
            raise InputError(f"height must be above 0 m, got {height}")
        self.vehicle = self.ground.felt_by(vehicle).trimmed(
            height=self.height, wind=self.weather.wind_to
        )
        self.feel = feel or StickFeel(expo=0.0, deadband=0.0)
        self.seed, self.flown_with = seed, flown_with
        self.model.opt.wind[:] = self.vehicle.model.opt.wind
        self._assist_name: AssistName = check_assist(assist)
        self._where = addresses(self.model)
        par = self._par
        par[PARAM.ground_effect] = self.ground.effect
        Pilot(remnant=0.0).write(par, self.vehicle, seed=seed, height=self.height)
        self.weather.write(par, self.vehicle, seed=int(generator(seed, 0, "air").integers(2**31)))
        self._assistance = Assistance(self.vehicle, par)
        self._contact = Contact(self.vehicle, self.ground)
        self._imu = self.model.site(self.vehicle.roles.site("imu")).id
        self._body = root_body(self.model)
        self._asks_each = max(1, round(_ASKS / self.model.opt.timestep))
        self._ticks_each = max(
            1, round(vehicle.parameters["gyro.period"] / self.model.opt.timestep)
        )
        self._recordings = 0
        self._knows = np.ones(self.model.na, dtype=bool)  # what is the gyro's of all states
        for name in STATE._fields:
            if name.startswith(_NOT_THE_GYROS):
                self._knows[self._where.state + getattr(STATE, name)] = False
        self.data = mujoco.MjData(self.model)
        self._fly_by_laws()
        self.reset()

    def _fly_by_laws(self) -> None:
        """Let the vehicle's controller fly, with copies of its laws that are this flight's own."""
        stack = ExitStack()
        self._laws = stack.enter_context(self.vehicle.controller.flying(self.model))
        weakref.finalize(self, stack.close).atexit = False
        self._failure: Failure | None = None

    def __getstate__(self) -> dict[str, Any]:
        return {name: one for name, one in self.__dict__.items() if name != "_laws"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        failure = self._failure
        self._fly_by_laws()
        self._failure = failure

    def __repr__(self) -> str:
        state = self.crashed or f"assist {self.assist!r}"
        return f"HandFlight({self.vehicle.name!r}, {self.time:.2f} s, {state})"

    def reset(self) -> None:
        """Hover above the pad again, at time 0, the gyro on; a recording that runs is dropped."""
        where = {"height": self.height, "seed": self.seed}
        begin(self.vehicle, self.model, self.data, self.weather, self.ground, **where)
        self._settled = self.data.act.copy()
        if self._failure is not None:
            self._fly_by_laws()
        self._par[PARAM.gyro_on] = 1.0
        self.deflection = Deflection()
        self.crashed = ""
        self._steps = 0
        self._recording: Recording | None = None
        self._contact.begin()
        self._assistance.begin()
        self._ask(self.data)
        with installed():
            mujoco.mj_forward(self.model, self.data)

    @property
    def motion(self) -> Motion:
        """How the helicopter moves now."""
        return read_motion(self.data)

    @property
    def clearance(self) -> float:
        """Height of the lowest point of the landing gear above the ground, m."""
        return self._contact.clearance(*self._pose)

    @property
    def time(self) -> float:
        """Time since the last reset, s."""
        return float(self.data.time)

    @property
    def sticks(self) -> NDArray[np.float64]:
        """COL, LON, LAT, PED as they reach the gyro, unitised, (4,)."""
        first = self._where.control
        return self.data.ctrl[first + CONTROL.col : first + CONTROL.ped + 1].copy()

    @property
    def hover_collective(self) -> float:
        """Where the collective stick stands in the hover, unitised."""
        return collective_stick(self.vehicle.model, self.vehicle.trim)

    @property
    def assist(self) -> AssistName:
        """What the sticks mean: "hover", "level" or "none"; may be set."""
        return self._assist_name

    @assist.setter
    def assist(self, name: str) -> None:
        self._assist_name = check_assist(name)
        self._assistance.begin()
        self._note("assist", self._assist_name)

    @property
    def gyro(self) -> bool:
        """Whether the gyro moves the servos, else the sticks do; may be set."""
        return bool(self._par[PARAM.gyro_on])

    @gyro.setter
    def gyro(self, on: bool) -> None:
        if on and not self.gyro:
            self.data.act[self._knows] = self._settled[self._knows]
        self._par[PARAM.gyro_on] = float(on)
        self._note("gyro", bool(on))

    def fly(self, seconds: float, **deflection: float) -> None:
        """Let time pass, with the sticks where they are or where they are moved to now.

        Args:
            seconds: of flight; it ends early in a crash.
            deflection: col, lon, lat, ped, -1 to 1; those that are not given go to the middle,
                unless none is given.

        Raises:
            InputError: the time is not a number above 0.
        """
        if not 0.0 < seconds < np.inf:
            raise InputError(f"the time to fly must be above 0 s, got {seconds}")
        if deflection:
            self.deflection = Deflection(**deflection)
        end = self._steps + round(seconds / self.model.opt.timestep)
        with installed():
            self._fly_on(end)

    def step(self) -> None:
        """Fly on by a time step, inside `installed()`; nothing moves after a crash."""
        self._fly_on(self._steps + 1)

    def _fly_on(self, end: int) -> None:
        """Fly until so many steps were made since the reset, or until the flight ends."""
        asked = (self._asks_each, self._ask), (self._ticks_each, self._move_servos)
        loop = steps(self.model, self.data, *asked, first=self._steps, count=end)
        while not self.crashed and (made := next(loop, None)) is not None:
            at_tick = self._steps % self._ticks_each == 0
            if self._recording is not None and (self._recording or at_tick):
                self._recording.add(self.data)
            self._steps = made
            self.crashed = self._failed() or self._ended()

    def _ended(self) -> str:
        """Return why the flight has ended with the step that was just made, "" if it goes on."""
        if broken(self.data):
            return "the flight has no finite state"
        return self._contact.found(*self._pose, self.data.ncon > 0)

    @property
    def _pose(self) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
        """Time, s, position of the IMU, (3,), and rotation from body to earth axes, (3, 3)."""
        turn = FLIPS * self.data.xmat[self._body].reshape(3, 3)
        return self.data.time, np.array(flip(*self.data.site_xpos[self._imu])), turn

    @property
    def recorded(self) -> float | None:
        """Seconds that the running recording has; None if none runs."""
        return None if self._recording is None else self._recording.seconds(self.model)

    def start_recording(self) -> None:
        """Record from the next tick of the gyro on. Raises InputError: one runs already."""
        if self._recording is not None:
            raise InputError("a recording runs already; stop it first")
        self._recording = Recording(self.time)
        self._note("assist", self.assist)
        self._note("gyro", self.gyro)

    def stop_recording(self) -> FlightRecord:
        """Return what the flight computer wrote since `start_recording`.

        A recording in which the helicopter crashed, touched the ground or left what the model is
        valid for is whole, and marked: its `ended` says why and when, and the identification
        refuses it unless it is told otherwise.

        Raises:
            InputError: no recording runs, or it is shorter than a record can be.
        """
        if self._recording is None:
            raise InputError("no recording runs; start one first")
        recording, self._recording = self._recording, None
        number, self._recordings = self._recordings, self._recordings + 1
        return recording.record(
            self.vehicle,
            ground=self.ground,
            crashed=self.crashed,
            failed=self._failure,
            rng=generator(self.seed, number, "sensors"),
            flown={
                "with": self.flown_with,
                "feel": asdict(self.feel),
                "weather": to_plain(self.weather),
                "ground": to_plain(self.ground),
                "seed": self.seed,
                "recording": number,
            },
        )

    @property
    def _par(self) -> NDArray[np.float64]:
        """The vehicle's parameters in the model, (n_param,), to be written."""
        return self.model.actuator_user[self._where.rotor]

    def _failed(self) -> str:
        """Return how the vehicle's controller failed, "" if it didn't; it tells it once."""
        self._failure = self._laws.failure()
        return (
            "" if self._failure is None else f"controller {self._laws.name!r} {self._failure.why}"
        )

    def _note(self, what: str, value: Any) -> None:
        if self._recording is not None:
            self._recording.note(self.time, what, value)

    def _ask(self, _: mujoco.MjData) -> None:
        felt = self.feel.felt(self.deflection)
        seconds = self._asks_each * self.model.opt.timestep
        self._assistance.ask(self._par, self._assist_name, felt, self.motion, seconds)

    def _move_servos(self, data: mujoco.MjData) -> None:
        """Move the servos by the sticks alone, about the trim, where the gyro is off."""
        if self.gyro:
            return
        col, lon, lat, ped = self.sticks
        trim = self.vehicle.trim
        plate = Swashplate.in_block(self._par)
        control = data.ctrl[self._where.control :]
        col *= self._par[PARAM.gyro_collective]
        control[CONTROL.servo_front : CONTROL.servo_tail] = plate.mix(
            col, lon + trim.lon, lat + trim.lat
        )
        control[CONTROL.servo_tail] = ped + trim.ped
