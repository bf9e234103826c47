"""Missions: scripts that a pilot flies, shipped or your own; and what a flight reached.

One of your own is a frozen dataclass with a method `fly`, a generator:

    @dataclass(frozen=True, kw_only=True)
    class Square(Mission):
        duration: float = 60.0
        side: float = 10.0

        def fly(self, pilot):
            for north, east in ((1, 0), (1, 1), (0, 1), (0, 0)):
                yield from pilot.go(self.side * north, self.side * east)
                yield from pilot.hold(1.0)
"""

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.base.settings import Checked, Value, setting
from helisim.physics.laws import Failure, raised
from helisim.physics.layout import (
    HANDS_OFF_ROTOR,
    PARAM,
    ROLL_ATTITUDE,
    ROLL_VELOCITY,
    ROTOR,
    STATE,
)
from helisim.physics.motion import flip
from helisim.sim.excitation import check_plain, register
from helisim.sim.ground import Ground, outline
from helisim.sim.limits import point_heights
from helisim.sim.missions.autopilot import Autopilot, OuterLoop, Sight
from helisim.sim.recorder import Script, Trajectory
from helisim.vehicle import Vehicle
from helisim.vehicle.addresses import addresses
from helisim.vehicle.trim import FLIPS, Motion, Trim

MISSIONS: dict[str, type["Mission"]] = {}
"""Every mission by the name of its class; subclasses join on their definition."""
TICK = 0.02  # s between two looks of the pilot, as of a radio link: 50 Hz
_LOST = 1.4  # rad, of roll or pitch, beyond which a script is not asked any more
_AIRBORNE = 0.05  # m, of clearance from which on a helicopter has been in the air


class Start(NamedTuple):
    """A mission's first height, m above the ground (None: the weather's), and speed north, m/s."""

    height: float | None = None
    speed: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Mission(Checked):
    """A flight by a script, ended after `duration`, s; subclass it to fly your own."""

    duration: float = setting(unit="s", low=1.0, high=1e6)

    kinds: ClassVar[Mapping[str, type["Mission"]]] = MISSIONS
    start: ClassVar[Start] = Start()
    """How it begins; a property where this depends on the settings."""
    ground: ClassVar[Ground | None] = None
    """The ground where a plan doesn't say it; None flies in the air alone."""
    engine: ClassVar[bool] = False
    """Whether a motor turns the rotor, whatever the vehicle's own `drive.governor`."""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        register(cls, MISSIONS, "a mission")

    @property
    def name(self) -> str:
        """Its name in words, such as "take_off_hover_land"; records and files have it."""
        return mission_name(type(self))

    def fly(self, pilot: Autopilot) -> Iterator[None]:
        """Fly: ask the pilot for something, and yield for each tick, or `yield from` methods."""
        raise NotImplementedError  # a plan refuses a mission without it


def mission_name(kind: type[Mission]) -> str:
    """Return the name of a kind of mission, words joined by underlines."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", kind.__name__).lower()


def missions_by_name() -> dict[str, type[Mission]]:
    """Return every mission by its name in words."""
    return {mission_name(kind): kind for kind in MISSIONS.values()}


def check_mission(mission: Any) -> None:
    """Raise InputError unless something can be flown as a mission."""
    kind = type(mission).__name__
    if not isinstance(mission, Mission):
        raise InputError(f"a mission such as missions.Forward() is needed, got {mission!r:.80}")
    if type(mission).fly is Mission.fly:
        raise InputError(
            f"{kind} doesn't say what it flies: give it a method fly(self, pilot) that yields"
        )
    check_plain(mission)
    if not mission.duration >= 1.0:
        raise InputError(f"duration of {kind} must be at least 1 s, got {mission.duration:g}")
    height, speed = mission.start
    if not (0.0 <= (height or 0.0) < math.inf and 0.0 <= speed < math.inf):
        raise InputError(
            f"{kind} must start at 0 m or more above the ground and 0 m/s or more, got {height} "
            f"and {speed}"
        )


class ScriptedPilot:
    """Commands a flight by a mission's script; `failure` says how that failed, or is None."""

    def __init__(
        self,
        mission: Mission,
        vehicle: Vehicle,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        trim: Trim,
        ground: Ground | None = None,
    ) -> None:
        """Take the sticks of a model with pilot and weather; data are as the flight begins."""
        self.failure: Failure | None = None
        self._touched, self._contact = False, data.sensor("contact").data
        every = max(1, round(TICK / model.opt.timestep))
        felt = () if ground is None else ((1, self._feel),)
        self.commands = (*felt, (every, self._tick))
        level = ground is None or (ground.deck is None and ground.slope == 0.0)
        self._mission, self._where = mission, addresses(model)
        self._uneven, shape = None if level else ground, outline(vehicle)
        self._points, self._radii = shape.points + vehicle.imu_offset, shape.radii
        self._par = model.actuator_user[self._where.rotor]
        self._par[PARAM.pilot_on] = HANDS_OFF_ROTOR
        self._par[
            [
                *range(PARAM.pilot_k_attitude, PARAM.pilot_k_heading + 1),
                ROLL_ATTITUDE,
                ROLL_VELOCITY,
            ]
        ] = 0.0
        data.ctrl[self._where.control + ROTOR] = 1.0
        loop = OuterLoop(vehicle, model, trim, self._where.rotor)
        seed = int(self._par[PARAM.pilot_seed])
        self._pilot = Autopilot(loop, self._seen(data), every * model.opt.timestep, seed)
        self._finished, self._ticks = False, self._asked()

    @property
    def script(self) -> Script:
        """The script's phases and whether it finished."""
        return Script(tuple(self._pilot.phases), self._finished and self.failure is None)

    def _feel(self, _: mujoco.MjData) -> None:
        self._touched = self._touched or bool(self._contact.any())

    def _tick(self, data: mujoco.MjData) -> bool:
        """Ask the script, and move sticks and rotor; return whether the flight ends."""
        seen, pilot = self._seen(data), self._pilot
        self._touched = False
        tilt = max(abs(seen.motion.phi), abs(seen.motion.theta))
        if not (math.isfinite(seen.motion.down) and tilt < _LOST):
            return True  # the envelope says why
        pilot.seen = seen
        self._finished = next(self._ticks, True)
        if self._finished:
            return True
        self._par[PARAM.pilot_col : PARAM.pilot_ped + 1] = pilot.sticks(seen)
        data.ctrl[self._where.control + ROTOR] = pilot.wanted.rotor
        return False

    def _asked(self) -> Iterator[bool]:
        yield False  # it begins as it is
        try:
            script = self._mission.fly(self._pilot)
            if not isinstance(script, Iterator):
                raise InputError(
                    f"{type(self._mission).__name__}.fly must yield for each tick of the pilot"
                )
            for _ in script:
                for name, value in vars(self._pilot.wanted).items():
                    if value is not None and not np.all(np.isfinite(value)):
                        self.failure = Failure(f"wants {name} = {value}", "")
                        return
                yield False
        except InputError:
            raise
        except Exception as error:  # whatever the user's script raises
            self.failure = raised(error)

    def _seen(self, data: mujoco.MjData) -> Sight:
        """Return what the pilot sees; the motion equals that of `read_motion`."""
        matrix = np.empty(9)
        mujoco.mju_quat2Mat(matrix, data.qpos[3:7])
        turn = FLIPS * matrix.reshape(3, 3)
        (xx, _, _), (yx, _, _), (zx, zy, zz) = turn.tolist()
        angles = math.atan2(zy, zz), -math.asin(min(1.0, max(-1.0, zx))), math.atan2(yx, xx)
        v_north, v_east, v_down = flip(*data.qvel[:3].tolist())
        through, place = np.array((v_north, v_east, v_down)) @ turn, flip(*data.qpos[:3].tolist())
        motion = Motion(*map(float, (*through, *flip(*data.qvel[3:6].tolist()), *angles, *place)))
        points = self._points @ turn.T
        if self._uneven is None:
            clearance = -motion.down - float((points[:, 2] + self._radii).max(initial=-math.inf))
        else:
            points += place
            above = self._uneven.heights(np.array([data.time]), points[None])[0]
            clearance = float((above - self._radii).min(initial=math.inf))
        where, speed = self._where, data.ctrl[self._where.control + ROTOR]
        if self._par[PARAM.drive_governor]:
            speed = data.act[where.state + STATE.speed]
        return Sight(
            float(data.time),
            motion,
            v_north,
            v_east,
            v_down,
            clearance,
            self._touched,
            float(speed),
        )


@dataclass(frozen=True)
class TouchDown:
    """A touch-down at a time, s; sink of the gear's lowest point and speed over the ground, m/s."""

    at: float
    sink: float
    ground_speed: float


@dataclass(frozen=True, eq=False)
class Reached(Value):
    """A mission's results, of the true trajectory.

    Attributes:
        phases: times, s, and what the script said then.
        top_speed: m/s, over the ground.
        rotor_speed: the lowest and the highest, over the nominal one.
        touch_down: None if it never touched the ground.
    """

    finished: bool
    phases: tuple[tuple[float, str], ...]
    top_speed: float
    rotor_speed: tuple[float, float]
    touch_down: TouchDown | None

    @classmethod
    def of(cls, vehicle: Vehicle, flight: Trajectory) -> "Reached":
        """Return what a flight of a mission reached."""
        assert flight.script is not None
        last = float(flight.time[-1])  # a script goes on behind a flight's early end
        own = flight.velocities - np.cross(flight.rates, flight.imu_offset)
        velocities, speeds = flight.earth.apply(own), flight.rotor[:, 4]
        return cls(
            finished=flight.script.finished and flight.end is None,
            phases=tuple(one for one in flight.script.phases if one[0] <= last),
            top_speed=float(np.hypot(velocities[:, 0], velocities[:, 1]).max()),
            rotor_speed=(float(speeds.min()), float(speeds.max())),
            touch_down=_touch_down(vehicle, flight, velocities),
        )

    def __str__(self) -> str:
        low, high = (round(100.0 * one) for one in self.rotor_speed)
        landed = self.touch_down
        parts = {
            "the script did not end": not self.finished,
            f"up to {self.top_speed:.1f} m/s": True,
            f"rotor at {low} to {high} %": (low, high) != (100, 100),
        }
        said = [text for text, holds in parts.items() if holds]
        if landed is not None:
            said.append(
                f"touch-down at {landed.at:.2f} s, sinking at {landed.sink:.2f} m/s, "
                f"{landed.ground_speed:.2f} m/s over the ground"
            )
        return ", ".join(said)


def _touch_down(
    vehicle: Vehicle, flight: Trajectory, velocities: NDArray[np.float64]
) -> TouchDown | None:
    shape = outline(vehicle)
    above = point_heights(flight.ground or Ground(), flight, shape.points) - shape.radii
    lowest = above.min(axis=1)
    airborne, down = lowest > _AIRBORNE, lowest <= 0.0
    down[: int(np.argmax(airborne))] = False
    if not (airborne.any() and down.any()):
        return None
    k = max(int(np.argmax(down)), 1)
    sink = float(lowest[k - 1] - lowest[k]) / flight.timestep
    return TouchDown(float(flight.time[k]), sink, float(np.hypot(*velocities[k - 1, :2])))
