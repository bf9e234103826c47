"""A flight in space for Rerun: ground, trail, and the helicopter with its rotors and loads.

The helicopter's shapes are MuJoCo's geoms, forward-right-down. All flights share the shape of one
fuselage, which would be most of a recording otherwise. A frame of Rerun's has one parent, so the
fuselage's is the root, and each flight's world hangs on it by the flight's own pose, read from
child to parent.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import mujoco
import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from helisim.base.errors import InputError
from helisim.base.settings import FrozenMap
from helisim.physics.motion import flip
from helisim.records.record import ATTITUDES, POSITIONS, ROTOR, FlightRecord
from helisim.show.viewer import SLOWED, TILT_GAIN, drawn_tilt, drawn_turn
from helisim.sim.ground import Ground
from helisim.vehicle.folder import Roles

Array = NDArray[np.float64]
Colour = tuple[int, int, int]
Archetypes = Mapping[str, rr.AsComponents]

TIMELINE = "time"
"""The timeline of a flight, from its first sample."""
SHAPES = "shapes"
"""The entity of shapes that flights share."""

_INKS = ((72, 166, 255), (255, 152, 56), (94, 210, 160), (190, 140, 230), (150, 158, 170))
_ENVELOPE = rr.components.AggregationPolicy.MinMax
"""A pixel shows least and most of many samples; their mean would make a fast sweep seem to fade."""
_SCALARS = rr.ComponentDescriptor("Scalars:scalars", archetype="rerun.archetypes.Scalars")
"""Rerun's own scalars are in double precision, twice as large; its plots take these as well."""

_FUSELAGE = "fuselage"
"""The frame of the shared fuselage."""
_VISUAL_GROUPS = 3
"""MuJoCo's viewer shows geom groups 0 to 2; 3 and above hold collision geometry."""
_BOXES = (
    # centre and half size in m, forward-right-down from the centre of gravity
    ("fuselage", (0.05, 0.0, 0.0), (0.25, 0.07, 0.10), (0.85, 0.35, 0.10, 1.0)),
    ("boom", (-0.50, 0.0, -0.05), (0.40, 0.015, 0.015), (0.20, 0.20, 0.20, 1.0)),
    ("fin", (-0.88, 0.0, -0.10), (0.05, 0.005, 0.12), (0.20, 0.20, 0.20, 1.0)),
    ("mast", (0.0, 0.0, -0.19), (0.01, 0.01, 0.09), (0.50, 0.50, 0.50, 1.0)),
    ("rotor", (0.0, 0.0, -0.28), (0.767, 0.03, 0.005), (0.10, 0.10, 0.10, 1.0)),
)
"""A helicopter to look at when no model is given; nothing is computed from it."""

_THRUST_COLOUR, _MOMENT_COLOUR, _TAIL_COLOUR = (230, 70, 30), (40, 120, 220), (230, 160, 30)
_LEGEND = f"""\
white ring: tip path, tilted {TILT_GAIN:g} times as far as flown\\
green ring: hub plane\\
red and yellow arrows: main and tail rotor's thrust\\
blue arrow: moment of the hub's spring\\
blades turn {SLOWED:g} times slower than flown
"""
# the JR700's hover thrust, 79 N, is an arrow of 0.63 m
_METRES_PER_NEWTON, _METRES_PER_TAIL_NEWTON, _METRES_PER_NEWTON_METRE = 0.008, 0.06, 0.3
_USUAL_RADIUS = 0.767
"""m, of the rotor that these are for; weights go with the third power of a vehicle's size."""
_TRAIL_HZ = 4.0
"""Points of the trail a second, each the mean of the samples around it."""
_GROUND, _MESH = 150.0, 5.0
"""m, half the side of the ground that is drawn, and between its lines."""
_CLEARANCE = 0.25
"""m from the centre of gravity to the ground at the lowest point of a flight."""


@dataclass(frozen=True, eq=False)
class Shapes:
    """The look of a helicopter.

    Attributes:
        body: archetype by name, from the centre of gravity.
        rotor: archetype by name, from the hub.
        tail_rotor: archetype by name, from the tail hub; empty where there is no tail hub.
        hub: (3,) m from the centre of gravity.
        tail_hub: (3,) m from the centre of gravity; None where the model names none.
        radius: m, of the main rotor's disc; None where there is none.
    """

    body: Archetypes
    rotor: Archetypes = field(default_factory=dict)
    tail_rotor: Archetypes = field(default_factory=dict)
    hub: Array = field(default_factory=lambda: np.array([0.0, 0.0, -0.28]))
    tail_hub: Array | None = None
    radius: float | None = None

    def __post_init__(self) -> None:
        for name in ("body", "rotor", "tail_rotor"):
            object.__setattr__(self, name, FrozenMap(getattr(self, name)))


def box_shapes() -> Shapes:
    """Return a few boxes that look like a helicopter."""
    return Shapes(
        {
            name: rr.Boxes3D(
                centers=[centre], half_sizes=[half], colors=[colour], fill_mode="solid"
            )
            for name, centre, half, colour in _BOXES
        }
    )


def model_shapes(model: mujoco.MjModel, roles: Roles | None = None) -> Shapes:
    """Return the visual geoms of the model's first free body and of all that it carries.

    The geoms of a body called `rotor` and of those below it stand apart and relative to their hub:
    they turn, and tilt with the tip-path plane. So do those of `tail_rotor`, which turn alone.

    Args:
        model: of a vehicle.
        roles: names of its rotors in the model, where they aren't the usual ones.

    Raises:
        InputError: the model has no free body.
    """
    roles = roles or Roles()
    free = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
    if free.size == 0:
        raise InputError("the model has no free body: there is no helicopter to draw")
    root = int(model.jnt_bodyid[free[0]])
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    to_body = np.diag(flip(1.0, 1.0, 1.0)) @ data.xmat[root].reshape(3, 3).T
    ids = np.flatnonzero(
        (model.body_rootid[model.geom_bodyid] == root) & (model.geom_group < _VISUAL_GROUPS)
    )
    rotor, tail_rotor = (
        mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, roles.body(role))
        for role in ("rotor", "tail_rotor")
    )
    tail = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, roles.site("tail_hub"))
    disc = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, roles.geom("rotor_disc"))
    centre = data.subtree_com[root]
    hub = np.zeros(3) if rotor < 0 else to_body @ (data.xpos[rotor] - centre)
    tail_hub = to_body @ (data.site_xpos[tail] - centre) if tail >= 0 else None
    main = _carried(model, rotor, ids)
    aft = _carried(model, tail_rotor, ids) & (tail_hub is not None)

    def draw(which: NDArray[np.bool], origin: Array) -> dict[str, rr.AsComponents]:
        some = ids[which]
        colours, materials = model.geom_rgba[some].copy(), model.geom_matid[some]
        colours[materials >= 0] = model.mat_rgba[materials[materials >= 0]]
        geoms = _Geoms(
            some,
            (data.geom_xpos[some] - centre) @ to_body.T - origin,
            to_body @ data.geom_xmat[some].reshape(-1, 3, 3),
            model.geom_size[some],
            colours,
        )
        return _archetypes(model, geoms)

    return Shapes(
        body=draw(~(main | aft), np.zeros(3)),
        rotor=draw(main, hub),
        tail_rotor={} if tail_hub is None else draw(aft, tail_hub),
        hub=hub,
        tail_hub=tail_hub,
        radius=float(model.geom_size[disc, 0]) if disc >= 0 else None,
    )


def log_series(
    recording: rr.RecordingStream,
    entity: str,
    time: Array,
    values: Array,
    labels: Sequence[str],
    colours: Sequence[Colour] = _INKS,
) -> None:
    """Log signals over time in single precision: one entity a group, one series a signal.

    Args:
        recording: that is logged to.
        entity: of the group.
        time: (n_time,) s.
        values: (n_time, n_signal).
        labels: one a signal.
        colours: of the series, repeated when there are more.
    """
    inks = [colours[k % len(colours)] for k in range(len(labels))]
    lines = rr.SeriesLines(names=list(labels), colors=inks, aggregation_policy=_ENVELOPE)
    recording.log(entity, lines, static=True)
    count, width = values.shape
    column = rr.ComponentColumn(_SCALARS, _Singles(values), lengths=np.full(count, width))
    recording.send_columns(entity, indexes=[time_column(time)], columns=[column])


class _Singles:
    """Numbers of a component, in single precision."""

    def __init__(self, values: Array) -> None:
        self._values = np.ascontiguousarray(values, dtype=np.float32).ravel()

    def component_descriptor(self) -> rr.ComponentDescriptor:
        return _SCALARS

    def as_arrow_array(self) -> pa.Array:
        return pa.array(self._values)


def time_column(time: Array) -> rr.TimeColumn:
    """Return times in s, (n_time,), as a column in whole nanoseconds.

    Rerun cuts the digits below them off durations that are given as floats.
    """
    return rr.TimeColumn(TIMELINE, duration=np.rint(time * 1e9).astype("timedelta64[ns]"))


def log_fuselage(recording: rr.RecordingStream, shapes: Shapes) -> None:
    """Log the shape that all flights share: a helicopter without its rotors."""
    for name, archetype in shapes.body.items():
        entity = f"{SHAPES}/visual_geometries/{name}"
        recording.log(entity, archetype, rr.CoordinateFrame(_FUSELAGE), static=True)


def world_frame(world: str) -> str:
    """Return the frame of an entity."""
    return f"tf#/{world}"


def is_posed(record: FlightRecord) -> bool:
    """Return whether a record has the position and attitude of the helicopter."""
    return all(name in record for name in (*ATTITUDES, *POSITIONS))


def knows_rotor(record: FlightRecord) -> bool:
    """Return whether a record has the tilt of the tip-path plane, as a simulation's may."""
    return all(name in record for name in ROTOR[:2])


def log_space(
    recording: rr.RecordingStream,
    world: str,
    record: FlightRecord,
    shapes: Shapes,
    loads: FlightRecord,
) -> None:
    """Log a record that `is_posed` below the entity `world`; its arrows at the samples of loads."""
    if knows_rotor(record):
        text = rr.TextDocument(_LEGEND, media_type="text/markdown")
        recording.log(f"{world}/legend", text, static=True)
    recording.log(world, rr.ViewCoordinates.FRD, static=True)  # north, east, down
    _log_ground(recording, world, record)
    _log_trail(recording, f"{world}/trail", record)
    _log_helicopter(recording, world, record, shapes)
    _log_loads(recording, f"{world}/helicopter", loads, shapes)


class _Geoms(NamedTuple):
    """Geoms of one helicopter: (n,) ids, poses in its axes, sizes, colours."""

    ids: NDArray[np.intp]
    centres: Array
    matrices: Array
    sizes: Array
    colours: NDArray[np.float32]


def _carried(model: mujoco.MjModel, ancestor: int, ids: NDArray[np.intp]) -> NDArray[np.bool]:
    """Return which geoms a body and its descendants carry; none for the body -1."""
    below = {ancestor} if ancestor > 0 else set()
    for body in range(1, model.nbody):  # a parent comes before its children
        if int(model.body_parentid[body]) in below:
            below.add(body)
    return np.isin(model.geom_bodyid[ids], list(below))


def _archetypes(model: mujoco.MjModel, geoms: _Geoms) -> dict[str, rr.AsComponents]:
    """Return one batch for each type of shape, with sizes as MuJoCo's and Rerun's conventions."""
    kinds, shapes = mujoco.mjtGeom, {}
    for name, kind in (
        ("boxes", kinds.mjGEOM_BOX),
        ("spheres", kinds.mjGEOM_SPHERE),
        ("ellipsoids", kinds.mjGEOM_ELLIPSOID),
        ("cylinders", kinds.mjGEOM_CYLINDER),
        ("capsules", kinds.mjGEOM_CAPSULE),
        ("meshes", kinds.mjGEOM_MESH),
    ):
        keep = model.geom_type[geoms.ids] == int(kind)
        if keep.any():
            shapes[name] = _batch(model, name, _kept(geoms, keep))
    return shapes


def _kept(geoms: _Geoms, keep: NDArray[np.bool]) -> _Geoms:
    return _Geoms(**{name: one[keep] for name, one in geoms._asdict().items()})


def _batch(model: mujoco.MjModel, name: str, some: _Geoms) -> rr.AsComponents:
    if name == "meshes":
        return _meshes(model, some)
    look: dict[str, Any] = {
        "quaternions": Rotation.from_matrix(some.matrices).as_quat(),
        "colors": some.colours,
        "fill_mode": "solid",
    }
    rod = {"radii": some.sizes[:, 0], "lengths": 2.0 * some.sizes[:, 1]}
    match name:
        case "boxes":
            return rr.Boxes3D(centers=some.centres, half_sizes=some.sizes, **look)
        case "ellipsoids":
            return rr.Ellipsoids3D(centers=some.centres, half_sizes=some.sizes, **look)
        case "spheres":
            return rr.Ellipsoids3D(centers=some.centres, radii=some.sizes[:, 0], **look)
        case "cylinders":
            return rr.Cylinders3D(centers=some.centres, **rod, **look)
    # Rerun's capsules start at their origin and rise along z, MuJoCo's are centred on it
    starts = some.centres - some.sizes[:, 1:2] * some.matrices[:, :, 2]
    return rr.Capsules3D(translations=starts, **rod, **look)


def _meshes(model: mujoco.MjModel, geoms: _Geoms) -> rr.Mesh3D:
    """Return all meshes as one, coloured by vertex: Rerun spends 3 kB on each entity."""
    places, normals, faces, colours, count = [], [], [], [], 0
    for i, geom in enumerate(geoms.ids):
        mesh = model.geom_dataid[geom]
        vertex, face = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
        corners = model.mesh_vert[vertex : vertex + model.mesh_vertnum[mesh]]
        triangles = model.mesh_face[face : face + model.mesh_facenum[mesh]]
        places.append(corners @ geoms.matrices[i].T + geoms.centres[i])
        normals.append(_normals(corners, triangles) @ geoms.matrices[i].T)
        faces.append(triangles + count)
        ink = np.rint(255.0 * geoms.colours[i]).astype(np.uint8)
        colours.append(np.tile(ink, (len(corners), 1)))
        count += len(corners)
    return rr.Mesh3D(
        vertex_positions=np.concatenate(places),
        triangle_indices=np.concatenate(faces),
        vertex_normals=np.concatenate(normals),
        vertex_colors=np.concatenate(colours),
    )


def _normals(vertices: NDArray[np.float32], faces: NDArray[np.int32]) -> Array:
    """Return a unit normal for each vertex, the mean of its faces': without, light is flat."""
    corners = vertices[faces].astype(np.float64)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros(vertices.shape)
    for k in range(3):
        np.add.at(normals, faces[:, k], across)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return normals / np.where(length > 0.0, length, 1.0)


def _parameter(record: FlightRecord, name: str) -> float | None:
    value = record.provenance.get("parameters", {}).get(name)
    return None if value is None else float(value)


def _log_ground(recording: rr.RecordingStream, world: str, record: FlightRecord) -> None:
    """Log the ground that it was flown over, or at height 0 or below the flight's lowest point."""
    entity, flown = f"{world}/ground", Ground.of_record(record)
    if flown is None:
        ground = max(0.0, float(np.max(record["down"])) + _CLEARANCE)
        north, east = record.select(POSITIONS)[0, :2]
    else:
        deck = flown.deck
        ground, north, east = deck.above if deck is not None else 0.0, 0.0, 0.0
        axis = [-math.sin(flown.uphill), math.cos(flown.uphill), 0.0]
        lean = rr.RotationAxisAngle(axis=axis, radians=flown.slope)
        recording.log(entity, rr.Transform3D(rotation=lean), static=True)
        if deck is not None:
            size = (0.5 * deck.length, 0.5 * deck.width, 0.5 * deck.thickness)
            _log_slab(recording, f"{world}/deck/surface", (0.0, 0.0, size[2]), size, (84, 87, 89))
            place, turn = deck.pose(record.time)
            pose = rr.Transform3D.columns(
                translation=place, quaternion=Rotation.from_matrix(turn).as_quat()
            )
            recording.send_columns(
                f"{world}/deck", indexes=[time_column(record.time)], columns=pose
            )
    lines = np.arange(-_GROUND, _GROUND + 1e-9, _MESH)
    strips = [
        [[north + x, east - _GROUND, ground], [north + x, east + _GROUND, ground]] for x in lines
    ] + [[[north - _GROUND, east + y, ground], [north + _GROUND, east + y, ground]] for y in lines]
    mesh = rr.LineStrips3D(strips, colors=[(120, 135, 105)], radii=[0.02])
    recording.log(f"{entity}/lines", mesh, static=True)
    centre, size = (north, east, ground + 0.04), (_GROUND, _GROUND, 0.02)
    _log_slab(recording, f"{entity}/surface", centre, size, (74, 88, 66))


def _log_slab(
    recording: rr.RecordingStream,
    entity: str,
    centre: Sequence[float],
    half: Sequence[float],
    colour: Colour,
) -> None:
    slab = rr.Boxes3D(centers=[centre], half_sizes=[half], colors=[colour], fill_mode="solid")
    recording.log(entity, slab, static=True)


def _log_trail(recording: rr.RecordingStream, entity: str, record: FlightRecord) -> None:
    every = max(1, round(1.0 / (_TRAIL_HZ * float(np.median(np.diff(record.time))))))
    count = len(record) // every
    if count < 2:
        return
    points = record.select(POSITIONS)[: count * every].reshape(count, every, 3).mean(axis=1)
    times = record.time[: count * every].reshape(count, every).mean(axis=1)
    look = rr.LineStrips3D.from_fields(colors=[(240, 200, 60)], radii=[-1.5])
    recording.log(entity, look, static=True)
    pieces = np.stack([points[:-1], points[1:]], axis=1).astype(np.float32)
    columns = rr.LineStrips3D.columns(strips=list(pieces))
    recording.send_columns(entity, indexes=[time_column(times[1:])], columns=columns)


def _log_helicopter(
    recording: rr.RecordingStream, world: str, record: FlightRecord, shapes: Shapes
) -> None:
    entity, count = f"{world}/helicopter", len(record)
    # the camera follows an entity only if it has a shape of its own
    recording.log(entity, rr.Points3D([[0.0, 0.0, 0.0]], radii=[0.001]), static=True)
    hung = rr.Transform3D.from_fields(parent_frame=_FUSELAGE, child_frame=world_frame(entity))
    recording.log(f"{entity}/fuselage", hung, static=True)
    recording.send_columns(
        entity,
        indexes=[time_column(record.time)],
        # a transform's fields that are not in its row count as not given: frames in every row
        columns=rr.Transform3D.columns(
            translation=record.select(POSITIONS),
            quaternion=Rotation.from_euler("ZYX", record.select(ATTITUDES)[:, ::-1]).as_quat(),
            relation=[rr.TransformRelation.ChildFromParent] * count,
            parent_frame=[_FUSELAGE] * count,
            child_frame=[world_frame(world)] * count,
        ),
    )
    _log_main_rotor(recording, entity, record, shapes)
    if shapes.tail_rotor and shapes.tail_hub is not None:
        turn = _turn(record, "tail_rotor.speed", (0.0, 1.0, 0.0))
        tail, hub = f"{entity}/tail_rotor", shapes.tail_hub
        _log_rotor(recording, tail, shapes.tail_rotor, record, hub, turn)


def _log_main_rotor(
    recording: rr.RecordingStream, entity: str, record: FlightRecord, shapes: Shapes
) -> None:
    rotor, tilted = f"{entity}/rotor", knows_rotor(record)
    turn = _turn(record, "main_rotor.speed", (0.0, 0.0, _direction(record)))
    if tilted:  # ring and arrow are the same however far the blades have turned
        tilt = drawn_tilt(record["a"], record["b"])
        turn = tilt if turn is None else tilt * turn
    _log_rotor(recording, rotor, shapes.rotor, record, shapes.hub, turn)
    if shapes.radius is not None:
        angle = np.linspace(0.0, 2.0 * np.pi, 73)
        ring = shapes.radius * np.column_stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)])
        path = rr.LineStrips3D([ring], colors=[(250, 250, 250)], radii=[0.006])
        recording.log(f"{rotor}/tip_path", path, static=True)
        if tilted:  # square to the mast: the disc's angle from it is the tilt
            plane = rr.LineStrips3D([ring + shapes.hub], colors=[(90, 220, 130)], radii=[0.004])
            recording.log(f"{entity}/hub_plane", plane, static=True)


def _log_rotor(
    recording: rr.RecordingStream,
    entity: str,
    shapes: Archetypes,
    record: FlightRecord,
    hub: Array,
    turn: Rotation | None,
) -> None:
    """Log a rotor's shapes, where it is and how it is turned; without a turn it stands."""
    for name, archetype in shapes.items():
        recording.log(f"{entity}/visual_geometries/{name}", archetype, static=True)
    if turn is None:
        recording.log(entity, rr.Transform3D(translation=hub), static=True)
        return
    columns = rr.Transform3D.columns(
        translation=np.tile(hub, (len(record), 1)), quaternion=turn.as_quat()
    )
    recording.send_columns(entity, indexes=[time_column(record.time)], columns=columns)


def _turn(record: FlightRecord, speed: str, axis: tuple[float, float, float]) -> Rotation | None:
    """Return how far a rotor has turned at each sample; None if the record tells no speed."""
    turning = _parameter(record, speed)
    if turning is None:
        return None
    return Rotation.from_rotvec(drawn_turn(record.time, turning)[:, None] * np.array(axis))


def _direction(record: FlightRecord) -> float:
    """Return 1 where the main rotor turns clockwise seen from above, the default, else -1."""
    direction = _parameter(record, "main_rotor.direction")
    return 1.0 if direction is None else direction


def _log_loads(
    recording: rr.RecordingStream, entity: str, record: FlightRecord, shapes: Shapes
) -> None:
    zero = np.zeros(len(record))
    size = (shapes.radius or _USUAL_RADIUS) / _USUAL_RADIUS
    if "thrust" in record:
        lift = np.column_stack([zero, zero, -_METRES_PER_NEWTON / size**2 * record["thrust"]])
        _log_arrow(recording, f"{entity}/rotor/thrust", _THRUST_COLOUR, lift, record)
    if "tail_thrust" in record and shapes.tail_hub is not None:
        left = _METRES_PER_TAIL_NEWTON / size**2 * _direction(record) * record["tail_thrust"]
        side, hub = np.column_stack([zero, -left, zero]), shapes.tail_hub
        _log_arrow(recording, f"{entity}/tail_thrust", _TAIL_COLOUR, side, record, hub)
    stiffness = _parameter(record, "main_rotor.hub_stiffness")
    if stiffness is not None and knows_rotor(record):
        scale = _METRES_PER_NEWTON_METRE / size**3 * stiffness
        turn = np.column_stack([scale * record["b"], scale * record["a"], zero])
        _log_arrow(recording, f"{entity}/hub_moment", _MOMENT_COLOUR, turn, record, shapes.hub)


def _log_arrow(
    recording: rr.RecordingStream,
    entity: str,
    colour: Colour,
    vectors: Array,
    record: FlightRecord,
    origin: Array | None = None,
) -> None:
    look = rr.Arrows3D.from_fields(
        origins=[np.zeros(3) if origin is None else origin],
        colors=[colour],
        radii=[0.012],
        labels=[entity.rpartition("/")[2]],
        show_labels=False,  # they would hide the arrow's end; the view's title tells
    )
    recording.log(entity, look, static=True)
    columns = rr.Arrows3D.columns(vectors=vectors)
    recording.send_columns(entity, indexes=[time_column(record.time)], columns=columns)
