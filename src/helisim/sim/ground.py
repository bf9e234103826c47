"""The ground of a flight: level, a slope, or a moving deck; and the parts that can touch it."""

import copy
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from helisim.base.errors import InputError
from helisim.base.settings import Brief, Checked, check, from_plain, setting
from helisim.physics.layout import CONTROL, PARAM, STATE
from helisim.physics.motion import flip
from helisim.physics.native import installed
from helisim.records.record import FlightRecord
from helisim.vehicle import Vehicle
from helisim.vehicle.addresses import addresses, own_parts
from helisim.vehicle.trim import place

_HEAVIER = 1e6  # mass of a deck over that of who lands on it: what the landing does to its motion
_SETTLING = 2.0  # s, in which a vehicle comes to rest on its landing gear
_AXES = {"heave": (0.0, 0.0, 1.0), "pitch": (0.0, -1.0, 0.0), "roll": (1.0, 0.0, 0.0)}
"""A deck's freedoms, the outermost first, and each one's axis, north-west-up."""
_COLOURS = {"deck": (0.33, 0.34, 0.35, 1.0), "ground": (0.37, 0.46, 0.32, 1.0)}


@dataclass(frozen=True, kw_only=True)
class Swing(Checked):
    """A harmonic motion, amplitude x sin(2 pi t / period + phase); the amplitude in m or rad."""

    amplitude: float
    period: float = setting(8.0, unit="s", above=0.0)
    phase: float = setting(0.0, unit="rad")

    @property
    def frequency(self) -> float:
        """The motion's frequency, rad/s."""
        return 2.0 * math.pi / self.period

    def at(self, time: NDArray[np.float64] | float) -> NDArray[np.float64]:
        """Return where it is at times (n_time,), s, of the same shape."""
        return self.amplitude * np.sin(self.frequency * np.asarray(time) + self.phase)


@dataclass(frozen=True, kw_only=True, repr=False)
class Deck(Brief):
    """A rectangular landing deck, its middle below the start of the flight, its bow north.

    `above` is its height at rest over its surroundings, m; heave is up, roll starboard down, pitch
    up.
    """

    length: float = setting(6.0, unit="m", above=0.0)
    width: float = setting(6.0, unit="m", above=0.0)
    above: float = setting(3.0, unit="m", above=0.0)
    heave: Swing | None = None
    roll: Swing | None = None
    pitch: Swing | None = None

    thickness: ClassVar[float] = 0.5  # m, downwards

    def __post_init__(self) -> None:
        check(self)
        for name, swing in self.swings.items():
            most, unit = (self.above, "m") if name == "heave" else (0.5, "rad")
            if abs(swing.amplitude) >= most:
                raise InputError(
                    f"a deck's {name} must stay below {most:g} {unit}, got {swing.amplitude:g}"
                )

    @property
    def swings(self) -> dict[str, Swing]:
        """The motions that it has by name, the outermost first."""
        return {name: one for name in _AXES if (one := getattr(self, name)) is not None}

    def pose(self, time: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return middle, (n_time, 3) m, and rotation to NED, (n_time, 3, 3), at (n_time,) s."""
        rest = np.zeros_like(time)
        at = dict.fromkeys(_AXES, rest) | {name: one.at(time) for name, one in self.swings.items()}
        turn = Rotation.from_euler("YX", np.column_stack([at["pitch"], at["roll"]]))
        return np.column_stack([rest, rest, -at["heave"]]), turn.as_matrix()

    def add_to(self, spec: mujoco.MjSpec, mass: float) -> None:
        """Add the deck on springs, too heavy for a vehicle of this mass, kg, to move."""
        body = spec.worldbody.add_body(
            name="deck", mass=mass, inertia=[mass] * 3, explicitinertial=True, gravcomp=1.0
        )
        hinge, slide = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE
        for name, swing in self.swings.items():
            body.add_joint(
                name=f"deck_{name}",
                type=slide if name == "heave" else hinge,
                axis=_AXES[name],
                stiffness=[mass * swing.frequency**2, 0.0, 0.0],
            )
        spec.add_exclude(bodyname1="world", bodyname2="deck")
        body.add_geom(
            name="deck",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[0.5 * self.length, 0.5 * self.width, 0.5 * self.thickness],
            pos=[0.0, 0.0, -0.5 * self.thickness],
            mass=0.0,
            rgba=_COLOURS["deck"],
        )

    def carry(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Move a vehicle that stands on the deck at rest to where the deck is, moving along."""
        mujoco.mj_forward(model, data)
        deck, moving = data.body("deck"), np.zeros(6)
        mujoco.mj_objectVelocity(
            model, data, mujoco.mjtObj.mjOBJ_BODY, model.body("deck").id, moving, 0
        )
        arm, turned, own = np.zeros(3), np.zeros(4), np.zeros(4)
        mujoco.mju_rotVecQuat(arm, data.qpos[:3], deck.xquat)
        mujoco.mju_mulQuat(turned, deck.xquat, data.qpos[3:7])
        data.qpos[:3], data.qpos[3:7] = deck.xpos + arm, turned
        data.qvel[:3] = moving[3:] + np.cross(moving[:3], arm)
        mujoco.mju_negQuat(own, turned)
        mujoco.mju_rotVecQuat(data.qvel[3:6], moving[:3], own)


@dataclass(frozen=True, kw_only=True, repr=False)
class Ground(Brief):
    """The ground below a flight, level, sloping, or a deck; without one, a flight ends at height 0.

    It rises by `slope`, rad, towards the heading `uphill`, rad; flights head north. `effect` is the
    share of Cheeseman and Bennett's ground effect, 0 to 1. A `parked` vehicle starts on its gear at
    flat pitch, its `rotor` at a share of flying speed; below 1 a motor must turn it
    (`drive.governor`).
    """

    slope: float = setting(0.0, unit="rad", low=0.0, below=0.5 * math.pi)
    uphill: float = setting(0.0, unit="rad")
    effect: float = setting(1.0, low=0.0, high=1.0)
    deck: Deck | None = None
    parked: bool = False
    rotor: float = setting(1.0, low=0.0, high=1.0)

    def __post_init__(self) -> None:
        check(self)
        if self.rotor < 1.0 and not self.parked:
            raise InputError(
                f"only a parked flight starts with a slow rotor: parked=True, got {self.rotor}"
            )
        if self.deck is not None and self.slope != 0.0:
            raise InputError("a deck is level at rest: a ground has a slope or a deck, not both")

    @classmethod
    def of_record(cls, record: FlightRecord) -> "Ground | None":
        """Return the ground that a record was flown over, None for none. Raises InputError."""
        kept = record.provenance
        said = kept.get("ground", dict(kept.get("by_hand", {})).get("ground"))
        return None if said is None else from_plain(cls, said, "ground", lenient=True)

    def put_into(self, spec: mujoco.MjSpec, vehicle: mujoco.MjModel) -> None:
        """Add the ground to a specification: what `assemble` takes as `around`."""
        drawn, turn = list(spec.worldbody.geoms), self._quaternion()
        below = 0.0 if self.deck is None else self.deck.above
        for geom in drawn:
            laid, quaternion = np.zeros(3), np.zeros(4)
            mujoco.mju_rotVecQuat(laid, geom.pos, turn)
            mujoco.mju_mulQuat(quaternion, turn, geom.quat)
            geom.pos, geom.quat = laid - [0.0, 0.0, below], quaternion
        if not any(geom.type == mujoco.mjtGeom.mjGEOM_PLANE for geom in drawn):
            spec.worldbody.add_geom(
                name="ground",
                type=mujoco.mjtGeom.mjGEOM_PLANE,
                size=[0.0, 0.0, 0.05],
                pos=[0.0, 0.0, -below],
                quat=turn,
                rgba=_COLOURS["ground"],
            )
        if self.deck is not None:
            self.deck.add_to(spec, _HEAVIER * float(np.sum(vehicle.body_mass)))

    def felt_by(self, vehicle: Vehicle) -> Vehicle:
        """Return a vehicle that feels the ground's effect, its trim as it was."""
        model = copy.copy(vehicle.model)
        model.actuator_user[addresses(model).rotor, PARAM.ground_effect] = self.effect
        return replace(vehicle, model=model)

    def begin(self, vehicle: Vehicle, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Set a deck and a parked vehicle in motion. Raises InputError: no motor, a slung load."""
        par = model.actuator_user[addresses(model).rotor]
        if self.rotor < 1.0 and not par[PARAM.drive_governor]:
            raise InputError(
                f"a rotor at {self.rotor:g} of its speed needs a motor that spins it up: "
                "drive.governor = motor, not ideal"
            )
        if self.parked and vehicle.slung:
            raise InputError("a vehicle with a slung load starts in the air: parked=False")
        standing = self._standing(vehicle, model) if self.parked else None
        for name, swing in self.deck.swings.items() if self.deck is not None else ():
            joint = data.joint(f"deck_{name}")
            joint.qpos[0] = swing.at(0.0)
            joint.qvel[0] = swing.amplitude * swing.frequency * np.cos(swing.phase)
        if standing is None:
            return
        flat = -par[PARAM.main_pitch_trim] / par[PARAM.main_pitch_range]
        trim = replace(vehicle.trim, col=max(-0.5, flat), lon=0.0, lat=0.0, a=0.0, b=0.0)
        deck = data.qpos[7:].copy(), data.qvel[6:].copy()
        place(model, data, trim)
        data.qpos[:7], data.qpos[7:], data.qvel[6:] = standing, *deck
        if self.rotor < 1.0:  # the engine idles
            act = data.act[addresses(model).state :]
            act[STATE.speed : STATE.fuel + 1] = self.rotor, 0.0, 0.0, 0.0
        if self.deck is not None:
            self.deck.carry(model, data)

    def _standing(self, vehicle: Vehicle, model: mujoco.MjModel) -> NDArray[np.float64]:
        model, where = copy.copy(model), addresses(model)
        model.actuator_user[where.rotor, [PARAM.gyro_on, PARAM.pilot_on, PARAM.turbulence_on]] = 0.0
        model.opt.wind[:] = 0.0
        data, turn = mujoco.MjData(model), self._quaternion()
        data.ctrl[where.control + CONTROL.rotor] = data.act[where.state + STATE.speed] = 0.0
        shape = outline(vehicle)
        lowest = float(np.max(shape.points[:, 2] + shape.radii)) + vehicle.imu_offset[2]
        mujoco.mju_rotVecQuat(data.qpos[:3], np.array([0.0, 0.0, lowest]), turn)
        data.qpos[3:7] = turn
        with installed():
            while data.time < _SETTLING:
                mujoco.mj_step(model, data)
        return data.qpos[:7].copy()

    def heights(
        self, time: NDArray[np.float64], points: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return heights above what is below, along its normal, (n_time, n_point) m.

        Points are (n_time, n_point, 3) m NED at (n_time,) s.
        """
        if self.deck is None:
            leaning = math.sin(self.slope)
            normal = np.array([leaning * math.cos(self.uphill), leaning * math.sin(self.uphill)])
            return -points[..., 2] * math.cos(self.slope) - points[..., :2] @ normal
        where, turn = self.deck.pose(time)
        own = np.einsum("tji,tnj->tni", turn, points - where[:, None])
        ends = (0.5 * self.deck.length, 0.5 * self.deck.width)
        over = (np.abs(own[..., :2]) < ends).all(axis=-1) & (own[..., 2] < self.deck.thickness)
        return np.where(over, -own[..., 2], self.deck.above - points[..., 2])

    def _quaternion(self) -> NDArray[np.float64]:
        half = 0.5 * self.slope
        along, across = math.cos(self.uphill), math.sin(self.uphill)
        return np.array([math.cos(half), -math.sin(half) * across, -math.sin(half) * along, 0.0])


class Outline(NamedTuple):
    """The parts of a vehicle that can touch the ground, from its IMU, body axes, m.

    Points (n, 3) are capsules' ends or centres, with radii (n,); discs have centre, axis, radius.
    """

    points: NDArray[np.float64]
    radii: NDArray[np.float64]
    discs: tuple[tuple[NDArray[np.float64], NDArray[np.float64], float], ...]

    def moved(self, offset: NDArray[np.float64]) -> "Outline":
        """Return it from a point that is offset from the IMU, (3,) m."""
        discs = tuple((centre + offset, axis, radius) for centre, axis, radius in self.discs)
        return Outline(self.points + offset, self.radii, discs)

    def rims(self) -> Iterator[tuple[str, NDArray[np.float64]]]:
        """Yield each rotor's name and sixteen points on its disc's rim from the IMU, (16, 3), m."""
        angles = np.arange(16) * np.pi / 8.0
        for name, (centre, axis, radius) in zip(("main", "tail"), self.discs):
            aside = np.cross(axis, [1.0, 0.0, 0.0])
            rim = np.outer(np.cos(angles), np.cross(aside, axis)) + np.outer(np.sin(angles), aside)
            yield name, centre + radius * rim

    def closer_than(
        self, least: float, positions: NDArray[np.float64], attitudes: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Return where gear or discs are nearer than `least`, m, to height 0, (n_time,).

        Positions of the IMU are (n_time, 3) m, NED; attitudes (n_time, 3), rad.
        """
        phi, theta = attitudes[:, 0], attitudes[:, 1]
        level = np.cos(theta)
        down = np.array([-np.sin(theta), level * np.sin(phi), level * np.cos(phi)])
        lowest = (self.points @ down + self.radii[:, None]).max(axis=0)
        for centre, axis, radius in self.discs:
            rim = radius * np.sqrt(np.maximum(0.0, 1.0 - (axis @ down) ** 2))
            lowest = np.maximum(lowest, centre @ down + rim)
        return -positions[:, 2] - lowest < least


def outline(vehicle: Vehicle) -> Outline:
    """Return what can touch the ground: what collides in MuJoCo, and both rotors' discs."""
    model, own = vehicle.model, vehicle.parameters
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)  # level and heading north, as the model is drawn
    imu = data.site("imu").xpos

    def placed(where: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.array(flip(*(where - imu)))

    points, radii = [], []
    touch = (model.geom_conaffinity | model.geom_contype) != 0
    for geom in np.flatnonzero(touch & own_parts(model)[model.geom_bodyid]):
        centre = data.geom_xpos[geom]
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CAPSULE:
            half = data.geom_xmat[geom].reshape(3, 3)[:, 2] * model.geom_size[geom, 1]
            points += [placed(centre + half), placed(centre - half)]
            radii += [model.geom_size[geom, 0]] * 2
        else:
            points.append(placed(centre))
            radii.append(model.geom_rbound[geom])
    hub, tail = (placed(data.site(role).xpos) for role in ("hub", "tail_hub"))
    discs = (
        (hub, np.array([0.0, 0.0, 1.0]), own["main_rotor.radius"]),
        (tail, np.array([0.0, 1.0, 0.0]), own["tail_rotor.radius"]),
    )
    return Outline(np.array(points).reshape(-1, 3), np.array(radii), discs)
