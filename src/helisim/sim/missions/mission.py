"""A mission is a script that a pilot flies, shipped or your own; and what it reached.

A mission of your own is a frozen dataclass with a method `fly`, a generator:

    @dataclass(frozen=True, kw_only=True)
    class Square(Mission):
        duration: float = 60.0
        side: float = 10.0

        def fly(self, pilot):
            for north, east in ((1, 0), (1, 1), (0, 1), (0, 0)):
                yield from pilot.go(self.side * north, self.side * east)
                yield from pilot.hold(1.0)

Its fields are its settings: in provenance, plan files and on the command line. The script is asked
at each tick of the pilot, 50 times a second; the rest of the flight is native.
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
from helisim.base.settings import Value, check, setting
from helisim.physics.laws import Failure, raised
from helisim.physics.layout import HANDS_OFF_ROTOR, PARAM, ROTOR, STATE
from helisim.physics.motion import flip
from helisim.sim.excitation import check_plain, register
from helisim.sim.ground import FLIPS, Ground, outline
from helisim.sim.limits import point_heights
from helisim.sim.missions.autopilot import Autopilot, OuterLoop, Sight
from helisim.sim.recorder import Script, Trajectory
from helisim.vehicle import Vehicle
from helisim.vehicle.trim import Motion, Trim, addresses

MISSIONS: dict[str, type["Mission"]] = {}
"""Every mission by the name of its class; a subclass of `Mission` joins on its definition."""
_TICK = 0.02  # s between two looks of the pilot, as of a radio link: 50 Hz
_LOST = 1.4  # rad, of roll or pitch, beyond which a script is not asked any more
_AIRBORNE = 0.05  # m, of clearance from which on a helicopter has been in the air


class Start(NamedTuple):
    """How a mission begins.

    Attributes:
        height: m above the ground, of the origin; None: the weather's.
        speed: m/s, of level flight north.
    """

    height: float | None = None
    speed: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Mission:
    """A flight by a script; subclass it to fly your own.

    Attributes:
        duration: s, after which the flight ends if the script has not.

    Raises:
        InputError: on its definition, a class has the name of a mission from elsewhere.
    """

    duration: float = setting(unit="s", low=1.0, high=1e6)

    kinds: ClassVar[Mapping[str, type["Mission"]]] = MISSIONS
    start: ClassVar[Start] = Start()
    """How it begins; a property where this depends on the settings."""
    ground: ClassVar[Ground | None] = None
    """What is below where a plan doesn't say it; None flies in the air alone."""
    engine: ClassVar[bool] = False
    """Whether a motor turns the rotor, whatever the vehicle's own `drive.governor`."""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        register(cls, MISSIONS, "a mission")

    def __post_init__(self) -> None:
        check(self)

    @property
    def name(self) -> str:
        """Its name in words, such as "take_off_hover_land"; records and files have it."""
        return mission_name(type(self))

    def fly(self, pilot: Autopilot) -> Iterator[None]:
        """Fly: ask the pilot for something, and yield for each tick, or `yield from` its methods.

        Args:
            pilot: that flies it, with what it sees.
        """
        raise NotImplementedError


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
    start = mission.start
    if start.height is not None and not 0.0 <= start.height < math.inf:
        raise InputError(f"{kind} must start 0 m or more above the ground, got {start.height:g} m")
    if not 0.0 <= start.speed < math.inf:
        raise InputError(f"{kind} must start at 0 m/s or more, got {start.speed:g}")


class ScriptedPilot:
    """Commands a flight by a mission's script.

    Attributes:
        commands: for `flight.steps`: every so many steps the script is asked.
        failure: how the script failed, None if it didn't.
    """

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
        every = max(1, round(_TICK / model.opt.timestep))
        felt = () if ground is None else ((1, self._feel),)
        self.commands = (*felt, (every, self._tick))
        self._mission, self._ground, self._where = mission, ground, addresses(model)
        shape = outline(vehicle)
        self._points, self._radii = shape.points + vehicle.imu_offset, shape.radii
        self._par = model.actuator_user[self._where.rotor]
        self._par[PARAM.pilot_on] = HANDS_OFF_ROTOR
        self._par[PARAM.pilot_k_attitude : PARAM.pilot_k_heading + 1] = 0.0
        data.ctrl[self._where.control + ROTOR] = 1.0
        loop = OuterLoop(vehicle, model, trim, self._where.rotor)
        self._pilot = Autopilot(loop, self._seen(data), every * model.opt.timestep)
        self._finished, self._ticks = False, self._asked()
        self._wanted: list[tuple[float, ...]] = []

    @property
    def script(self) -> Script:
        """What the script did."""
        wanted = np.array(self._wanted).reshape(-1, 5)
        finished = self._finished and self.failure is None
        return Script(tuple(self._pilot.phases), wanted, finished)

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
        wanted = pilot.wanted
        where = (wanted.north, wanted.east) if wanted.holds_place else (math.nan, math.nan)
        held = wanted.holds_height and wanted.collective is None
        down = wanted.down if held else math.nan
        self._wanted.append((pilot.time, *where, down, wanted.heading))
        self._par[PARAM.pilot_col : PARAM.pilot_ped + 1] = pilot.sticks(seen)
        data.ctrl[self._where.control + ROTOR] = wanted.rotor
        return False

    def _asked(self) -> Iterator[bool]:
        """Yield False for each tick of the script; end with it, or where it raises."""
        yield False  # it begins as it is
        try:
            script = self._mission.fly(self._pilot)
            if not isinstance(script, Iterator):
                kind = type(self._mission).__name__
                raise InputError(f"{kind}.fly must yield for each tick of the pilot")
            for _ in script:
                if unsound := self._pilot.wanted.unsound:
                    self.failure = Failure(f"wants {unsound}", "")
                    return
                yield False
        except InputError:
            raise
        except Exception as error:  # whatever the user's script raises
            self.failure = raised(error)

    def _seen(self, data: mujoco.MjData) -> Sight:
        """Return what the pilot sees: the motion as `read_motion`'s, in a tenth of its time."""
        matrix = np.empty(9)
        mujoco.mju_quat2Mat(matrix, data.qpos[3:7])
        turn = FLIPS * matrix.reshape(3, 3)
        north_rate, east_rate, down_rate = flip(*data.qvel[:3].tolist())
        u, v, w = (np.array((north_rate, east_rate, down_rate)) @ turn).tolist()
        p, q, r = flip(*data.qvel[3:6].tolist())
        (xx, _, _), (yx, _, _), (zx, zy, zz) = turn.tolist()
        phi, psi = math.atan2(zy, zz), math.atan2(yx, xx)
        theta = -math.asin(min(1.0, max(-1.0, zx)))
        north, east, down = flip(*data.qpos[:3].tolist())
        motion = Motion(u, v, w, p, q, r, phi, theta, psi, north, east, down)
        points = self._points @ turn.T
        if self._ground is None or self._ground.is_level:
            lowest = float((points[:, 2] + self._radii).max(initial=-math.inf))
            clearance = -down - lowest
        else:
            points += (north, east, down)
            above = self._ground.heights(np.array([data.time]), points[None])[0]
            clearance = float((above - self._radii).min(initial=math.inf))
        if self._par[PARAM.drive_governor]:
            rotor = float(data.act[self._where.state + STATE.speed])
        else:
            rotor = float(data.ctrl[self._where.control + ROTOR])
        return Sight(
            time=float(data.time),
            motion=motion,
            north_rate=north_rate,
            east_rate=east_rate,
            down_rate=down_rate,
            clearance=clearance,
            touches=self._touched,
            rotor_speed=rotor,
        )


@dataclass(frozen=True)
class TouchDown:
    """How the landing gear met the ground.

    Attributes:
        at: s.
        sink: m/s, at which the lowest point of the gear came down on it.
        ground_speed: m/s.
        phi: roll angle, rad.
        theta: pitch angle, rad.
    """

    at: float
    sink: float
    ground_speed: float
    phi: float
    theta: float


@dataclass(frozen=True, eq=False)
class Reached(Value):
    """What a flight of a mission reached, of the true trajectory.

    Attributes:
        finished: whether the script came to its end.
        phases: times, s, and what the script said then.
        place_error: m, the most that the helicopter was away from where it was to be, level; None
            where it was to be nowhere.
        height_error: m, likewise upwards or downwards.
        heading_error: rad.
        top_speed: m/s, over the ground.
        rotor_speed: the lowest and the highest, over the nominal one.
        touch_down: how it landed; None if it never touched the ground.
    """

    finished: bool
    phases: tuple[tuple[float, str], ...]
    place_error: float | None
    height_error: float | None
    heading_error: float
    top_speed: float
    rotor_speed: tuple[float, float]
    touch_down: TouchDown | None

    @classmethod
    def of(cls, vehicle: Vehicle, flight: Trajectory) -> "Reached":
        """Return what a flight of a mission reached."""
        assert flight.script is not None
        last = float(flight.time[-1])  # a script goes on behind a flight's early end
        wanted = flight.script.wanted[flight.script.wanted[:, 0] <= last]
        earth, arm = flight.earth, flight.imu_offset
        positions = flight.positions - earth.apply(arm)  # of the centre of gravity
        velocities = earth.apply(flight.velocities - np.cross(flight.rates, arm))
        place = np.column_stack(
            [np.interp(wanted[:, 0], flight.time, positions[:, k]) for k in range(3)]
        )
        psi = np.interp(wanted[:, 0], flight.time, flight.attitudes[:, 2])
        off = np.abs(place - wanted[:, 1:4])
        turned = np.abs(np.mod(psi - wanted[:, 4] + np.pi, 2.0 * np.pi) - np.pi)
        speeds = flight.rotor[:, 4]
        return cls(
            finished=flight.script.finished and flight.end is None,
            phases=tuple(one for one in flight.script.phases if one[0] <= last),
            place_error=_most(np.hypot(off[:, 0], off[:, 1])),
            height_error=_most(off[:, 2]),
            heading_error=float(turned.max()),
            top_speed=float(np.hypot(velocities[:, 0], velocities[:, 1]).max()),
            rotor_speed=(float(speeds.min()), float(speeds.max())),
            touch_down=_touch_down(vehicle, flight, velocities),
        )

    def __str__(self) -> str:
        """Return it in a line."""
        parts = ["" if self.finished else "the script did not end"]
        if self.place_error is not None:
            parts.append(f"place within {self.place_error:.2f} m")
        if self.height_error is not None:
            parts.append(f"height within {self.height_error:.2f} m")
        parts.append(f"heading within {math.degrees(self.heading_error):.1f} deg")
        parts.append(f"up to {self.top_speed:.1f} m/s")
        low, high = (round(100.0 * one) for one in self.rotor_speed)
        if (low, high) != (100, 100):
            parts.append(f"rotor at {low} to {high} %")
        if (landed := self.touch_down) is not None:
            parts.append(
                f"touch-down at {landed.at:.2f} s, sinking at {landed.sink:.2f} m/s, "
                f"{landed.ground_speed:.2f} m/s over the ground"
            )
        return ", ".join(filter(None, parts))


def _most(values: NDArray[np.float64]) -> float | None:
    """Return the greatest number of those that are numbers; None if none is."""
    held = values[np.isfinite(values)]
    return float(held.max()) if held.size else None


def _touch_down(
    vehicle: Vehicle, flight: Trajectory, velocities: NDArray[np.float64]
) -> TouchDown | None:
    """Return how the gear first met the ground after it was in the air."""
    shape = outline(vehicle)
    above = point_heights(flight.ground or Ground(), flight, shape.points) - shape.radii
    lowest = above.min(axis=1)
    airborne, down = lowest > _AIRBORNE, lowest <= 0.0
    down[: int(np.argmax(airborne))] = False
    if not (airborne.any() and down.any()):
        return None
    k = max(int(np.argmax(down)), 1)
    sink = float(lowest[k - 1] - lowest[k]) / flight.timestep
    north, east, _ = (float(one) for one in velocities[k - 1])
    phi, theta, _ = (float(one) for one in flight.attitudes[k])
    return TouchDown(float(flight.time[k]), sink, math.hypot(north, east), phi, theta)
