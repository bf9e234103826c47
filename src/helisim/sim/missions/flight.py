"""A mission in flight: its script at the pilot's ticks, the rest in MuJoCo's steps."""

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.physics.laws import Failure, raised
from helisim.physics.layout import HANDS_OFF_ROTOR, PARAM, ROTOR, STATE
from helisim.physics.motion import flip
from helisim.physics.native import installed
from helisim.sim.clearance import outline
from helisim.sim.ending import Again, until_end, warned
from helisim.sim.envelope import FlightEnvelope
from helisim.sim.ground import Ground
from helisim.sim.missions.autopilot import Autopilot
from helisim.sim.missions.mission import Mission
from helisim.sim.missions.outer_loop import OuterLoop, Sight, Wanted
from helisim.sim.trajectory import Script, Trajectory
from helisim.vehicle import Vehicle
from helisim.vehicle.motion import Motion, addresses
from helisim.vehicle.trim import Trim

_TICK = 0.02
"""s between two looks of the pilot, as of a radio link: 50 Hz."""
_FLIPS = np.outer(flip(1.0, 1.0, 1.0), flip(1.0, 1.0, 1.0))
"""Of a rotation, from MuJoCo's axes to FRD and NED."""
_LOST = 1.4
"""rad, of roll or pitch, beyond which a script is not asked any more."""


class MissionFlight:
    """Steps one flight of a mission.

    Attributes:
        sensordata: (n_step, nsensordata) of the time before each step, once it has flown.
        script: what the script did.
        failure: how the script failed, None if it didn't.
    """

    def __init__(
        self,
        mission: Mission,
        vehicle: Vehicle,
        model: mujoco.MjModel,
        trim: Trim,
        ground: Ground | None = None,
        added: NDArray[np.float64] | None = None,
    ) -> None:
        """Take what flies.

        Args:
            mission: to be flown.
            vehicle: that flies.
            model: of the flight, with pilot and weather; its sticks are written.
            trim: in which it begins.
            ground: below; None for the plane at height 0, at which the flight ends.
            added: (n_step, n_injection) what a manoeuvre adds meanwhile, or None.
        """
        self.mission, self.vehicle, self.model, self.added = mission, vehicle, model, added
        self.trim, self.ground = trim, ground
        self.failure: Failure | None = None
        self._touched = False
        self._where = addresses(model)
        self._shape = outline(vehicle)
        self._points = self._shape.points + vehicle.imu_offset
        self._par = model.actuator_user[self._where.rotor]
        self._par[PARAM.pilot_on] = HANDS_OFF_ROTOR
        self._par[PARAM.pilot_k_attitude : PARAM.pilot_k_heading + 1] = 0.0

    def fly(self, start: NDArray[np.float64], *, steps: int | None = None) -> mujoco.MjData:
        """Fly from a full physics state, (n_state,); return the data behind the last step.

        Args:
            start: state.
            steps: how many at most; the mission's duration if None.
        """
        model, data = self.model, mujoco.MjData(self.model)
        mujoco.mj_setState(model, data, start, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        data.ctrl[self._where.control + ROTOR] = 1.0
        each = max(1, round(_TICK / model.opt.timestep))
        whole = round(self.mission.duration / model.opt.timestep) + 1
        count = whole if steps is None else steps
        loop = OuterLoop.of(self.vehicle, model, self.trim, self._where.rotor)
        pilot = Autopilot(loop, self._seen(data), each * model.opt.timestep)
        ticks, wanted = self._ticks(pilot), []
        rows = np.empty((count, model.nsensordata))
        finished, flown, self._touched = False, 0, False
        grounded, contact = self.ground is not None, data.sensor("contact").data
        with installed():
            for flown in range(count):
                if flown % each == 0:
                    seen = self._seen(data)
                    self._touched = False
                    if not self._can_fly(seen):
                        break
                    pilot.seen = seen
                    finished = flown > 0 and next(ticks, True)  # first, as it begins
                    if finished:
                        break
                    wanted.append(_row(pilot.time, pilot.wanted))
                    self._move(data, pilot)
                if self.added is not None:
                    row = self.added[min(flown, len(self.added) - 1)]
                    data.userdata[: row.size] = row
                mujoco.mj_step(model, data)
                rows[flown] = data.sensordata
                self._touched = self._touched or (grounded and bool(contact.any()))
            else:
                flown = count
        self.sensordata = rows[:flown]
        self.script = Script(
            tuple(pilot.phases),
            np.array(wanted).reshape(-1, len(_row(0.0, Wanted()))),
            bool(finished) and self.failure is None,
        )
        return data

    def trajectory(self, envelope: FlightEnvelope, start: NDArray[np.float64]) -> Trajectory:
        """Fly from a full physics state, (n_state,); return what happened, until it ended.

        Raises:
            DivergedError: not one sample is within the envelope.
        """
        with self.vehicle.controller.flying(self.model) as flying:
            self.fly(start)
            failure = flying.failure()
        who = ""
        if failure is None and self.failure is not None:
            failure, who = self.failure, f"mission {self.mission.name!r}"
        script = self.script
        flown = until_end(
            self.vehicle,
            envelope,
            self.model,
            start,
            self.sensordata,
            failure=failure,
            ground=self.ground,
            who=who,
            again=partial(self._again, start),
        )
        return replace(flown, script=script)

    def _again(self, start: NDArray[np.float64], samples: int) -> Again:
        """Fly again; return the state of the last sample, and what MuJoCo warns of after it."""
        with self.vehicle.controller.flying(self.model):
            data = self.fly(start, steps=samples - 1)
            state = np.empty(start.size)
            mujoco.mj_getState(self.model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
            return state, warned(self.fly(start, steps=samples))

    def _ticks(self, pilot: Autopilot) -> Iterator[bool]:
        """Yield False for each tick of the script; end with it, or where it raises."""
        try:
            script = self.mission.fly(pilot)
            if not isinstance(script, Iterator):
                kind = type(self.mission).__name__
                raise InputError(f"{kind}.fly must yield for each tick of the pilot")
            for _ in script:
                if unsound := pilot.wanted.unsound:
                    self.failure = Failure(f"wants {unsound}", "")
                    return
                yield False
        except InputError:
            raise
        except Exception as error:  # whatever the user's script raises
            self.failure = raised(error)

    def _seen(self, data: mujoco.MjData) -> Sight:
        turn = self._turn(data)
        now = self._motion(data, turn)
        north, east, down = flip(*data.qvel[:3].tolist())
        return Sight(
            time=float(data.time),
            motion=now,
            north_rate=north,
            east_rate=east,
            down_rate=down,
            clearance=self._clearance(float(data.time), now, turn),
            touches=self._touched,
            rotor_speed=self._rotor_speed(data),
        )

    def _can_fly(self, seen: Sight) -> bool:
        """Return whether it is still for a pilot to fly; the envelope says why not."""
        tilt = max(abs(seen.motion.phi), abs(seen.motion.theta))
        return math.isfinite(seen.motion.down) and tilt < _LOST

    def _turn(self, data: mujoco.MjData) -> NDArray[np.float64]:
        """Return the rotation from body (FRD) to earth (NED) axes, (3, 3)."""
        matrix = np.empty(9)
        mujoco.mju_quat2Mat(matrix, data.qpos[3:7])
        return _FLIPS * matrix.reshape(3, 3)

    def _motion(self, data: mujoco.MjData, turn: NDArray[np.float64]) -> Motion:
        """Return what `read_motion` does, in a tenth of its time."""
        u, v, w = (np.array(flip(*data.qvel[:3].tolist())) @ turn).tolist()
        p, q, r = flip(*data.qvel[3:6].tolist())
        north, east, down = flip(*data.qpos[:3].tolist())
        (xx, _, _), (yx, _, _), (zx, zy, zz) = turn.tolist()
        phi, psi = math.atan2(zy, zz), math.atan2(yx, xx)
        theta = -math.asin(min(1.0, max(-1.0, zx)))
        return Motion(u, v, w, p, q, r, phi, theta, psi, north, east, down)

    def _clearance(self, time: float, now: Motion, turn: NDArray[np.float64]) -> float:
        """Return how high the lowest point of the landing gear is above what is below, m."""
        points = self._points @ turn.T
        if self.ground is None or (self.ground.deck is None and self.ground.slope == 0.0):
            lowest = float((points[:, 2] + self._shape.radii).max(initial=-math.inf))
            return -now.down - lowest
        points += (now.north, now.east, now.down)
        above = self.ground.heights(np.array([time]), points[None])[0]
        return float((above - self._shape.radii).min(initial=math.inf))

    def _rotor_speed(self, data: mujoco.MjData) -> float:
        if self._par[PARAM.drive_governor]:
            return float(data.act[self._where.state + STATE.speed])
        return float(data.ctrl[self._where.control + ROTOR])

    def _move(self, data: mujoco.MjData, pilot: Autopilot) -> None:
        self._par[PARAM.pilot_col : PARAM.pilot_ped + 1] = pilot.sticks(pilot.seen)
        data.ctrl[self._where.control + ROTOR] = pilot.wanted.rotor


def _row(time: float, wanted: Wanted) -> tuple[float, ...]:
    """Return a row of `Script.wanted`."""
    place = (wanted.north, wanted.east) if wanted.holds_place else (math.nan, math.nan)
    held = wanted.holds_height and wanted.collective is None
    return (time, *place, wanted.down if held else math.nan, wanted.heading)
