"""The ground of a flight: level, a slope, or a moving deck; and what of a vehicle can meet it."""

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
from helisim.base.settings import check, from_plain, in_brief, setting
from helisim.physics.layout import CONTROL, PARAM, STATE
from helisim.physics.motion import flip
from helisim.physics.native import installed
from helisim.records.record import FlightRecord
from helisim.vehicle import Vehicle
from helisim.vehicle.trim import addresses, place

_HEAVIER = 1e6  # Mass of a deck over that of who lands on it: what the landing does to its motion
_SETTLING = 2.0  # s, in which a vehicle comes to rest on its landing gear
_AXES = {
    "surge": (1.0, 0.0, 0.0),
    "sway": (0.0, -1.0, 0.0),
    "heave": (0.0, 0.0, 1.0),
    "pitch": (0.0, -1.0, 0.0),
    "roll": (1.0, 0.0, 0.0),
}
"""A deck's freedoms, the outermost first, and each one's axis, north-west-up."""
_TURNS = ("pitch", "roll")
FLIPS = np.outer(flip(1.0, 1.0, 1.0), flip(1.0, 1.0, 1.0))
"""Times a rotation (3, 3) in MuJoCo's axes: from body (FRD) to earth (NED) axes."""
_COLOURS = {"deck": (0.33, 0.34, 0.35, 1.0), "ground": (0.37, 0.46, 0.32, 1.0)}


@dataclass(frozen=True, kw_only=True)
class Swing:
    """A harmonic motion, amplitude x sin(2 pi t / period + phase).

    Attributes:
        amplitude: m or rad.
        period: s.
        phase: rad, at the start of a flight.
    """

    amplitude: float
    period: float = setting(8.0, unit="s", above=0.0)
    phase: float = setting(0.0, unit="rad")

    def __post_init__(self) -> None:
        check(self)

    @property
    def frequency(self) -> float:
        """Of the motion, rad/s."""
        return 2.0 * math.pi / self.period

    def at(self, time: NDArray[np.float64] | float) -> NDArray[np.float64]:
        """Return where it is at times (n_time,), s, of the same shape."""
        return self.amplitude * np.sin(self.frequency * np.asarray(time) + self.phase)

    def rate(self, time: NDArray[np.float64] | float) -> NDArray[np.float64]:
        """Return how fast it moves at times (n_time,), s, of the same shape."""
        phase = self.frequency * np.asarray(time) + self.phase
        return self.amplitude * self.frequency * np.cos(phase)


@dataclass(frozen=True, kw_only=True)
class Deck:
    """A rectangular landing deck, its middle below the start of the flight, its bow north.

    Attributes:
        length: m, from stern to bow.
        width: m.
        above: m from the water (or whatever is around and level) up to the deck at rest.
        surge: motion to the bow; None for none, as for those that follow.
        sway: to starboard.
        heave: upwards.
        roll: starboard side down.
        pitch: bow up.
    """

    length: float = setting(6.0, unit="m", above=0.0)
    width: float = setting(6.0, unit="m", above=0.0)
    above: float = setting(3.0, unit="m", above=0.0)
    surge: Swing | None = None
    sway: Swing | None = None
    heave: Swing | None = None
    roll: Swing | None = None
    pitch: Swing | None = None

    motions: ClassVar[tuple[str, ...]] = tuple(_AXES)
    thickness: ClassVar[float] = 0.5
    """m, of every deck, downwards from where one lands."""

    def __post_init__(self) -> None:
        check(self)
        for name, swing in self.swings.items():
            if name in _TURNS and abs(swing.amplitude) >= 0.5:
                raise InputError(
                    f"a deck's {name} must stay below 0.5 rad, got {swing.amplitude:g}"
                )
        if self.heave is not None and abs(self.heave.amplitude) >= self.above:
            raise InputError(
                f"a deck {self.above:g} m above what is around it can't heave by "
                f"{abs(self.heave.amplitude):g} m"
            )

    def __repr__(self) -> str:
        return in_brief(self)

    @property
    def swings(self) -> dict[str, Swing]:
        """The motions that it has by name, the outermost first."""
        return {name: one for name in _AXES if (one := getattr(self, name)) is not None}

    def pose(self, time: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return where the middle of the deck is and how it is turned, north-east-down.

        At times (n_time,), s: (n_time, 3) m, and (n_time, 3, 3) from the deck's axes.
        """
        at = dict.fromkeys(_AXES, np.zeros_like(time))
        at |= {name: swing.at(time) for name, swing in self.swings.items()}
        where = np.column_stack([at["surge"], at["sway"], -at["heave"]])
        turn = Rotation.from_euler("YX", np.column_stack([at["pitch"], at["roll"]]))
        return where, turn.as_matrix()

    def add_to(self, spec: mujoco.MjSpec, mass: float) -> None:
        """Add the deck on springs whose own motion is its own, so heavy, kg, that it keeps it.

        A body that MuJoCo is told the place of (mocap) has no velocity, and what stands on it is
        not carried along.
        """
        body = spec.worldbody.add_body(
            name="deck", mass=mass, inertia=[mass] * 3, explicitinertial=True, gravcomp=1.0
        )
        hinge, slide = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE
        for name, swing in self.swings.items():
            body.add_joint(
                name=f"deck_{name}",
                type=hinge if name in _TURNS else slide,
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
        kind = mujoco.mjtObj.mjOBJ_BODY
        mujoco.mj_objectVelocity(model, data, kind, model.body("deck").id, moving, 0)
        arm, turned, own = np.zeros(3), np.zeros(4), np.zeros(4)
        mujoco.mju_rotVecQuat(arm, data.qpos[:3], deck.xquat)
        mujoco.mju_mulQuat(turned, deck.xquat, data.qpos[3:7])
        data.qpos[:3], data.qpos[3:7] = deck.xpos + arm, turned
        data.qvel[:3] = moving[3:] + np.cross(moving[:3], arm)
        mujoco.mju_negQuat(own, turned)
        mujoco.mju_rotVecQuat(data.qvel[3:6], moving[:3], own)


@dataclass(frozen=True, kw_only=True)
class Ground:
    """What is below a flight, to take off from and to land on: level, sloping, or a deck.

    A flight without a ground is flown in the air alone, in half of the time, and ends where it
    touches the plane at height 0. Over a ground its landing gear may touch: a rotor may not, and
    no landing may be harder than the envelope says.

    Attributes:
        slope: rad, by which it rises.
        uphill: rad, the heading towards which it rises; flights head north.
        friction: of the landing gear on it; None: as the vehicle's MJCF has it.
        effect: share of Cheeseman and Bennett's ground effect that is felt, 0 to 1.
        deck: that is landed on instead, at height 0 where it is at rest.
        parked: whether the flight starts there, standing on its landing gear at flat pitch,
            instead of in the hover above.
        rotor: speed of the rotor then, 1 at flying speed, 0 stopped: to be spun up by a motor
            (`drive.governor`); an ideal governor has no speed of its own.
    """

    slope: float = setting(0.0, unit="rad", low=0.0, below=0.5 * math.pi)
    uphill: float = setting(0.0, unit="rad")
    friction: float | None = setting(None, above=0.0)
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

    def __repr__(self) -> str:
        return in_brief(self)

    @classmethod
    def of_record(cls, record: FlightRecord) -> "Ground | None":
        """Return the ground that a record was flown over, None for none. Raises InputError."""
        kept = record.provenance
        said = kept.get("ground", dict(kept.get("by_hand", {})).get("ground"))
        return None if said is None else from_plain(cls, said, "ground")

    @property
    def is_level(self) -> bool:
        """Whether it is the plane at height 0."""
        return self.deck is None and self.slope == 0.0

    def put_into(self, spec: mujoco.MjSpec, vehicle: mujoco.MjModel) -> None:
        """Add the ground to a specification: what `assemble` takes as `around`.

        The scene's own ground, if there is one, is laid so; the model is compiled of the vehicle.
        """
        drawn = list(spec.worldbody.geoms)
        for geom in spec.geoms if self.friction is not None else ():
            if geom.parent.name != "world" and (geom.contype or geom.conaffinity):
                geom.friction = [self.friction, *geom.friction[1:]]
        below = 0.0 if self.deck is None else self.deck.above
        turn = self._quaternion()
        for geom in drawn:  # turned with the slope, or put below the deck
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
        return Vehicle(vehicle.folder, vehicle.parameters, model, vehicle.trim, vehicle.controller)

    def begin(self, vehicle: Vehicle, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Set a deck where it is, and as fast as it is, when a flight begins in the hover.

        And where the flight starts parked, the vehicle on its landing gear at flat pitch.

        Raises:
            InputError: the rotor is to start slow, and no motor turns it.
        """
        par = model.actuator_user[addresses(model).rotor]
        if self.rotor < 1.0 and not par[PARAM.drive_governor]:
            raise InputError(
                f"a rotor at {self.rotor:g} of its speed needs a motor that spins it up: "
                "drive.governor = motor, not ideal"
            )
        standing = self._standing(vehicle, model) if self.parked else None
        for name, swing in self.deck.swings.items() if self.deck is not None else ():
            joint = data.joint(f"deck_{name}")
            joint.qpos[0], joint.qvel[0] = swing.at(0.0), swing.rate(0.0)
        if standing is None:
            return
        flat = -par[PARAM.main_pitch_trim] / par[PARAM.main_pitch_range]
        trim = replace(vehicle.trim, col=max(-0.5, flat), lon=0.0, lat=0.0, a=0.0, b=0.0)
        deck = data.qpos[7:].copy(), data.qvel[6:].copy()
        place(model, data, trim)
        data.qpos[:7], data.qpos[7:], data.qvel[6:] = standing, *deck
        if self.rotor < 1.0:  # the engine idles
            act = data.act[addresses(model).state :]
            act[STATE.speed], act[STATE.engine], act[STATE.governor] = self.rotor, 0.0, 0.0
        if self.deck is not None:
            self.deck.carry(model, data)

    def _standing(self, vehicle: Vehicle, model: mujoco.MjModel) -> NDArray[np.float64]:
        """Return position and orientation in which a vehicle stands, a deck at rest, (7,)."""
        model, where = copy.copy(model), addresses(model)
        off = [PARAM.gyro_on, PARAM.pilot_on, PARAM.turbulence_on]
        model.actuator_user[where.rotor, off] = 0.0
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
        """Return how high points are above what is below them, along its normal, m, (n_time, n).

        At times (n_time,), s, of points (n_time, n, 3), north, east, down, m. Beside a deck that is
        what is around it.
        """
        if self.deck is None:
            leaning = math.sin(self.slope)
            normal = np.array([leaning * math.cos(self.uphill), leaning * math.sin(self.uphill)])
            return -points[..., 2] * math.cos(self.slope) - points[..., :2] @ normal
        where, turn = self.deck.pose(time)
        own = np.einsum("tji,tnj->tni", turn, points - where[:, None])
        over = np.abs(own[..., 0]) < 0.5 * self.deck.length
        over &= np.abs(own[..., 1]) < 0.5 * self.deck.width
        over &= own[..., 2] < self.deck.thickness
        return np.where(over, -own[..., 2], self.deck.above - points[..., 2])

    def _quaternion(self) -> NDArray[np.float64]:
        """Return the slope's rotation, north-west-up, w first, (4,)."""
        half = 0.5 * self.slope
        along, across = math.cos(self.uphill), math.sin(self.uphill)
        return np.array([math.cos(half), -math.sin(half) * across, -math.sin(half) * along, 0.0])


class Outline(NamedTuple):
    """What of a vehicle can touch the ground, from its IMU, body axes, m.

    Attributes:
        points: (n, 3): ends of capsules; of another shape the centre.
        radii: (n,): of the spheres around the points.
        discs: centre, axis and radius of each rotor's disc.
    """

    points: NDArray[np.float64]
    radii: NDArray[np.float64]
    discs: tuple[tuple[NDArray[np.float64], NDArray[np.float64], float], ...]

    @property
    def reach(self) -> float:
        """How far any of it is from the IMU, m: higher above the ground no attitude matters."""
        reach = float(np.max(np.linalg.norm(self.points, axis=1) + self.radii, initial=0.0))
        discs = (float(np.linalg.norm(centre)) + radius for centre, _, radius in self.discs)
        return max(reach, *discs)

    def moved(self, offset: NDArray[np.float64]) -> "Outline":
        """Return it from another point than the IMU, which is by an offset, (3,) m, from there."""
        discs = tuple((centre + offset, axis, radius) for centre, axis, radius in self.discs)
        return Outline(self.points + offset, self.radii, discs)

    def rims(self) -> Iterator[tuple[str, NDArray[np.float64]]]:
        """Yield each rotor's name and sixteen points on its disc's rim from the IMU, (16, 3), m."""
        angles = np.arange(16) * np.pi / 8.0
        for name, (centre, axis, radius) in zip(("main", "tail"), self.discs):
            aside = np.cross(axis, [1.0, 0.0, 0.0])
            rim = np.outer(np.cos(angles), np.cross(aside, axis)) + np.outer(np.sin(angles), aside)
            yield name, centre + radius * rim

    def clearance(
        self, positions: NDArray[np.float64], attitudes: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return how high the lowest point of gear and discs is above height 0, m, (n_time,).

        Positions of the IMU are (n_time, 3), north, east, down, m; attitudes (n_time, 3), rad.
        """
        phi, theta = attitudes[:, 0], attitudes[:, 1]
        level = np.cos(theta)
        down = np.column_stack([-np.sin(theta), level * np.sin(phi), level * np.cos(phi)])
        lowest = (down @ self.points.T + self.radii).max(axis=1)
        for centre, axis, radius in self.discs:
            rim = radius * np.sqrt(np.maximum(0.0, 1.0 - (down @ axis) ** 2))
            lowest = np.maximum(lowest, down @ centre + rim)
        return -positions[:, 2] - lowest

    def closer_than(
        self, least: float, positions: NDArray[np.float64], attitudes: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Return where the `clearance` is less than some metres, (n_time,), of (n_time, 3) each.

        High above the ground no attitude is looked at.
        """
        low = -positions[:, 2] < least + self.reach
        if low.any():
            low[low] = self.clearance(positions[low], attitudes[low]) < least
        return low


def outline(vehicle: Vehicle) -> Outline:
    """Return what can touch the ground: what collides in MuJoCo, and both rotors' discs."""
    model, own = vehicle.model, vehicle.parameters
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)  # level and heading north, as the model is drawn
    imu = data.site(vehicle.roles.site("imu")).xpos

    def placed(where: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.array(flip(*(where - imu)))

    points, radii = [], []
    for geom in np.flatnonzero(model.geom_conaffinity | model.geom_contype):
        centre = data.geom_xpos[geom]
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CAPSULE:
            half = data.geom_xmat[geom].reshape(3, 3)[:, 2] * model.geom_size[geom, 1]
            points += [placed(centre + half), placed(centre - half)]
            radii += [model.geom_size[geom, 0]] * 2
        else:
            points.append(placed(centre))
            radii.append(model.geom_rbound[geom])
    hub, tail = (placed(data.site(vehicle.roles.site(role)).xpos) for role in ("hub", "tail_hub"))
    discs = (
        (hub, np.array([0.0, 0.0, 1.0]), own["main_rotor.radius"]),
        (tail, np.array([0.0, 1.0, 0.0]), own["tail_rotor.radius"]),
    )
    return Outline(np.array(points).reshape(-1, 3), np.array(radii), discs)
