"""A flight whose sticks are moved while it goes on: its assistance, its recordings."""

import math
import weakref
from contextlib import ExitStack
from dataclasses import replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, check_known
from helisim.base.settings import to_plain
from helisim.hand.sticks import Deflection
from helisim.physics.layout import CONTROL, PARAM, ROLL_ATTITUDE, ROLL_VELOCITY
from helisim.physics.native import installed
from helisim.records.record import FlightRecord, made_by
from helisim.sim.flight import at_least, generator, steps
from helisim.sim.ground import Ground
from helisim.sim.limits import FlightEnvelope, broken
from helisim.sim.live import Live, hovering
from helisim.sim.missions.autopilot import (
    ATTITUDE,
    HEADING,
    HEAVE,
    HEIGHT,
    POSITION,
    VELOCITY,
)
from helisim.sim.missions.mission import TICK
from helisim.sim.plan import Pilot
from helisim.sim.recorder import End, Recorder, read_trajectory, sound_samples
from helisim.sim.weather import Weather
from helisim.vehicle import Vehicle
from helisim.vehicle.addresses import write_named
from helisim.vehicle.trim import Motion, read_motion

ASSISTS = {
    "hover": "the sticks command velocities; let go, and it stays",
    "level": "the cyclic stick commands tilt; let go, and it levels",
    "none": "all sticks go to the gyro as they are",
}  # What the sticks mean
_TILT = 0.45  # rad, that a full deflection commands where attitude is commanded
# m/s, that a full deflection commands; the landing gear stands a descent of 2 m/s.
_SPEED, _CLIMB = 6.0, 2.0
_HURRY = 3.0  # m/s^2, at which the commanded velocity changes: a tilt of 0.3 rad
_MIDDLE = 0.05  # Deflection of a collective that is in the middle: a throttle stick has no spring
# m/s and rad/s, below which a helicopter whose stick is in the middle is held in place.
_STILL, _STILL_CLIMB, _STILL_TURN = 0.4, 0.2, 0.15
_SHORTEST = 0.1  # s, of a recording that makes a record: ten samples
_ENVELOPE = FlightEnvelope(saturation=None)


class _Assistance:
    def __init__(self, vehicle: Vehicle, par: NDArray[np.float64]) -> None:
        gravity = float(np.linalg.norm(vehicle.model.opt.gravity))
        yaw_rate = abs(float(par[PARAM.gyro_k_delta] / par[PARAM.gyro_k_a]))
        level = {
            "pilot_k_attitude": ATTITUDE / abs(float(par[PARAM.gyro_p_per_lat])),
            "pilot_lon": 0.0,
            "pilot_lat": 0.0,
        }
        hover = {
            "pilot_k_velocity": VELOCITY / gravity,
            "pilot_k_position": POSITION,
            "pilot_k_heave": HEAVE / abs(vehicle.derivatives["Z_col"]),
            "pilot_k_height": HEIGHT,
            "pilot_k_heading": HEADING / yaw_rate,
            "pilot_col": float(par[PARAM.pilot_col]),
        }
        self.own = {"none": {}, "level": level, "hover": {**level, **hover}}
        self.lean = np.array((vehicle.trim.phi, vehicle.trim.theta))

    def begin(self) -> None:
        self.velocity = np.zeros(2)  # that is commanded: ahead, right
        self.held: set[str] = set()

    def ask(
        self, par: NDArray[np.float64], name: str, felt: Deflection, now: Motion, seconds: float
    ) -> None:
        par[PARAM.pilot_k_attitude : PARAM.pilot_k_heading + 1] = 0.0
        tilt = _TILT * np.array((felt.lat, felt.lon)) if name == "level" else 0.0
        write_named(par, pilot_col=0.5 * np.array(felt), pilot_phi=self.lean + tilt)
        write_named(par, **self.own[name])
        if name != "hover":
            return
        most = _HURRY * seconds
        wanted = _SPEED * np.array([-felt.lon, felt.lat])
        self.velocity += np.clip(wanted - self.velocity, -most, most)
        if not self._stays("place", not self.velocity.any(), math.hypot(now.u, now.v) < _STILL):
            # so far away that it flies there as fast; here, where the velocity is 0
            ahead, right = self.velocity / POSITION
            cosine, sine = math.cos(now.psi), math.sin(now.psi)
            write_named(
                par,
                pilot_north=now.north + cosine * ahead - sine * right,
                pilot_east=now.east + sine * ahead + cosine * right,
            )
        climb = 0.0 if abs(felt.col) < _MIDDLE else _CLIMB * felt.col
        if not self._stays("height", climb == 0.0, abs(now.w) < _STILL_CLIMB):
            par[PARAM.pilot_down] = now.down - climb / HEIGHT
        if not self._stays("heading", felt.ped == 0.0, abs(now.r) < _STILL_TURN):
            par[PARAM.pilot_psi] = now.psi
        if "heading" not in self.held:
            par[PARAM.pilot_k_heading] = 0.0

    def _stays(self, what: str, centred: bool, still: bool) -> bool:
        """Return whether it is held where it was; it is from when it is still, stick centred."""
        before = what in self.held
        holds = centred and (before or still)
        self.held = self.held | {what} if holds else self.held - {what}
        return before and holds


class HandFlight(Live):
    """Fly a vehicle by hand, from the hover above its pad; a crash ends it until `reset`.

        flight = HandFlight(vehicle)
        flight.start_recording()
        flight.fly(2.0, lon=-0.5)          # half a stick forward for two seconds
        record = flight.stop_recording()

    `data` is MuJoCo's.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        *,
        assist: str = "hover",
        weather: Weather | None = None,
        ground: Ground | None = None,
        height: float | None = None,
        seed: int = 1,
        flown_with: str = "a program",
    ) -> None:
        """Place a vehicle in the hover, its origin at a height above the ground, m.

        By default the air is calm, the ground level with its effect, the height just above the pad.
        Raises UnknownNameError, InputError, or TrimError: it can't hover in the wind.
        """
        if height is not None and not 0.0 < height < np.inf:
            raise InputError(f"height must be above 0 m, got {height}")
        weather, ground = weather or Weather(), ground or Ground()
        vehicle, model, height = hovering(vehicle, weather, ground, height)
        seed = at_least("seed", seed, 0)
        super().__init__(vehicle, model, weather, ground, height=height, seed=seed)
        Pilot(remnant=0.0).write(self.par, vehicle, seed=seed, height=height)
        self.par[[ROLL_ATTITUDE, ROLL_VELOCITY]] = 0.0
        self.flown_with, self._assistance = flown_with, _Assistance(vehicle, self.par)
        step = self.model.opt.timestep
        self._asks_each = max(1, round(TICK / step))
        self._ticks_each = max(1, round(vehicle.parameters["gyro.period"] / step))
        self._recordings, self._controller = 0, ExitStack()
        weakref.finalize(self, self._controller.close).atexit = False
        self._switched: list[tuple[float, str]] = []
        self.assist = assist
        self.reset()

    def reset(self) -> None:
        """Hover above the pad again, at time 0; a recording that runs is dropped."""
        self._controller.close()
        self._law_failure = self._controller.enter_context(
            self.vehicle.controller.flying(self.model)
        )
        self.deflection = Deflection()
        self._end: End | None = None
        self._rows: list[NDArray[np.float64]] | None = None
        self._steps = 0
        self._assistance.begin()
        super().reset()

    def _begins(self) -> None:
        self._ask(self.data)

    @property
    def motion(self) -> Motion:
        """How the helicopter moves now."""
        return read_motion(self.data)

    @property
    def time(self) -> float:
        """Time since the last reset, s."""
        return float(self.data.time)

    @property
    def crashed(self) -> str:
        """Why the flight has ended, "" if it goes on."""
        return "" if self._end is None else self._end.why

    @property
    def sticks(self) -> NDArray[np.float64]:
        """COL, LON, LAT, PED as they reach the gyro, unitised, (4,)."""
        sticks = self.data.ctrl[self._where.control + CONTROL.col :]
        return sticks[: CONTROL.ped - CONTROL.col + 1].copy()

    @property
    def assist(self) -> str:
        """What the sticks mean: "hover", "level" or "none"; may be set."""
        return self._assist

    @assist.setter
    def assist(self, name: str) -> None:
        check_known("assist", [name], ASSISTS)
        self._assist = name
        self._assistance.begin()
        self._switched.append((self.time, name))

    def fly(self, seconds: float, **deflection: float) -> None:
        """Fly for some seconds, or until a crash; deflections col, lon, lat, ped are -1 to 1.

        Sticks not given go to the middle, or stay if none is. Raises InputError for no time.
        """
        if not 0.0 < seconds < np.inf:
            raise InputError(f"the time to fly must be above 0 s, got {seconds}")
        if deflection:
            self.deflection = Deflection(**deflection)
        end = self._steps + round(seconds / self.model.opt.timestep)
        loop = steps(
            self.model, self.data, (self._asks_each, self._ask), first=self._steps, count=end
        )
        with installed():
            while self._end is None and (made := next(loop, None)) is not None:
                at_tick = self._steps % self._ticks_each == 0
                if self._rows is not None and (self._rows or at_tick):
                    self._rows.append(self.data.sensordata.copy())
                self._steps = made
                self._end = self._ended()

    def _ended(self) -> End | None:
        failure = self._law_failure()
        if failure is not None:
            why = f"controller {self.vehicle.controller.name!r} {failure.why}"
            return End(self.time, why, failure.traceback)
        if broken(self.data):
            return End(self.time, "the flight has no finite state")
        why = self.struck()
        return End(self.time, why) if why else None

    @property
    def recorded(self) -> float | None:
        """Seconds that the running recording has; None if none runs."""
        return None if self._rows is None else len(self._rows) * float(self.model.opt.timestep)

    def start_recording(self) -> None:
        """Record from the next tick of the gyro on. Raises InputError: one runs already."""
        if self._rows is not None:
            raise InputError("a recording runs already; stop it first")
        self._rows, self._switched = [], [(self.time, self.assist)]

    def stop_recording(self) -> FlightRecord:
        """Return the recording; one with a crash, ground contact or exceeded limit is `ended`.

        The identification refuses that by default. Raises InputError if none runs or it is short.
        """
        if self._rows is None:
            raise InputError("no recording runs; start one first")
        rows, self._rows = np.array(self._rows), None
        number, self._recordings = self._recordings, self._recordings + 1
        count = sound_samples(self.vehicle.model, rows)[0] if len(rows) else 0
        seconds = count * float(self.model.opt.timestep)
        if seconds < _SHORTEST:
            raise InputError(f"a recording of {seconds:g} s is no record: fly {_SHORTEST:g} s")
        flown = replace(read_trajectory(self.vehicle, rows[:count]), ground=self.ground)
        start, touches = float(flown.time[0]), flown.touching
        recorder = Recorder.of(self.vehicle)
        provenance = made_by(
            "flown by hand in the simulation",
            **self.vehicle.provenance,
            by_hand={
                "with": self.flown_with,
                "weather": to_plain(self.weather),
                "ground": to_plain(self.ground),
                "seed": self.seed,
                "recording": number,
                "assist": [[max(0.0, round(at - start, 6)), name] for at, name in self._switched],
                "from_s": start,
            },
            recorder=recorder.to_dict(),
        )
        left = _ENVELOPE.end(self.vehicle, flown)
        found = [] if left is None else [left]
        if touches.any():  # skids on the ground hold what no stick asks for
            found.append((int(np.argmax(touches)), "the helicopter touched the ground"))
        ends = [End(float(flown.time[row]), why) for row, why in found]
        if ends or self._end is not None:
            first = min((*ends, self._end or ends[0]), key=lambda end: end.at)
            provenance["ended"] = replace(first, at=first.at - start).to_dict()
        flown = replace(flown, time=flown.time - start, ground=None)
        return recorder.record(flown, generator(self.seed, number, "sensors"), provenance)

    def _ask(self, _: mujoco.MjData) -> None:
        felt = Deflection(*np.clip(self.deflection, -1.0, 1.0).tolist())
        seconds = self._asks_each * self.model.opt.timestep
        self._assistance.ask(self.par, self.assist, felt, self.motion, seconds)
