"""Flight records as a Rerun recording.

Each flight has its own root and its own time from its first sample::

<flight>/world               axes north, east, down; ground, deck and trail
<flight>/world/helicopter    pose of the body (forward, right, down)
<flight>/world/helicopter/rotor   turns and tilts as recorded
<flight>/world/helicopter/load    what hangs on it, and straight to it its cable
<flight>/rates ...           one entity a kind of signal, one series a channel
<flight>/log                 the mission's events
"""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from helisim.base.arrays import Real
from helisim.base.errors import InputError
from helisim.base.files import atomic_write
from helisim.physics.motion import flip
from helisim.records.record import ATTITUDES, POSITIONS, FlightRecord
from helisim.records.record import LOAD as LOAD_CHANNELS
from helisim.show.plots import families, values_for_people
from helisim.show.viewer import SLOWED, drawn_tilt
from helisim.sim.ground import Ground
from helisim.vehicle.addresses import HOOK, LOAD, own_centre, own_parts

Archetypes = Mapping[str, rr.AsComponents]
View = rrb.Container | rrb.View
Parts = Mapping[str, tuple[Archetypes, Real]]
"""Archetypes of body, rotor and tail rotor by name, forward-right-down from the place, (3,) m."""

TIMELINE = "time"  # the timeline of a flight, from its first sample
_MOTION = ("sticks", "controls", "rates", "attitude", "velocity")  # kinds beside the helicopter
_HZ = 50.0  # most samples a second
_INKS = ((72, 166, 255), (255, 152, 56), (94, 210, 160), (190, 140, 230), (150, 158, 170))
_EYE = (-1.9, -1.35, -0.75)  # m from the helicopter to the eye; north, east, down
# _VISUAL_GROUPS: geom groups from this on hold collision geometry
# _TRAIL: most points of a path
_VISUAL_GROUPS, _TRAIL = 3, 500
_GROUND, _MESH = 150.0, 5.0  # m, half the side of the ground, and spacing of its lines
_CLEARANCE = 0.25  # m from the centre of gravity to the ground at a flight's lowest point


def write_recording(
    path: str | Path,
    flights: Mapping[str, FlightRecord],
    *,
    model: mujoco.MjModel,
    on_progress: Callable[[str], None] = lambda _: None,
) -> Path:
    """Write flights by name as a Rerun recording (.rrd) and return its path.

    At most 50 samples a second are kept. Flights without attitude or position have signals only;
    without the rotor's true tilt, the rotor doesn't tilt. `model` is the vehicle's, with
    every visible part. Raises InputError for no flights or another suffix, or StorageError.
    """
    path = Path(path)
    if path.suffix.lower() != ".rrd":
        raise InputError(f"{path}: a Rerun recording needs the suffix .rrd, got {path.suffix!r}")
    if not flights:
        raise InputError("a recording needs at least one flight, got none")
    parts = model_shapes(model)
    recording = rr.RecordingStream("helisim")
    try:
        # in memory: when a disk is full, Rerun's own writer only logs it
        memory = recording.memory_recording()
        layout = rrb.Blueprint(
            rrb.Tabs(*(_tab(name, record) for name, record in flights.items()), active_tab=0),
            rrb.TimePanel(state="collapsed", timeline=TIMELINE),
            collapse_panels=True,
        )
        recording.send_blueprint(layout, make_active=True, make_default=True)
        for name, record in flights.items():
            _log_flight(recording, name, record, parts)
            on_progress(name)
        with atomic_write(path) as temporary:
            temporary.write_bytes(memory.drain_as_bytes())
    finally:
        recording.disconnect()
    return path


def model_shapes(model: mujoco.MjModel) -> Parts:
    """Return the visual geoms of a vehicle's body, rotors and load, from the centre of gravity.

    The load's place is its hook, and from its own centre it is turned as below the hook.
    """
    rotor, tail = (model.body(name).id for name in ("rotor", "tail_rotor"))
    root = int(model.body_rootid[rotor])
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    to_body = np.diag(flip(1.0, 1.0, 1.0)) @ data.xmat[root].reshape(3, 3).T
    centre, steady = own_centre(model, data), own_parts(model)[model.geom_bodyid]
    hub, tail_hub = (
        to_body @ (place - centre) for place in (data.xpos[rotor], data.site("tail_hub").xpos)
    )
    own = (model.body_rootid[model.geom_bodyid] == root) & (model.geom_group < _VISUAL_GROUPS)

    def draw(
        which: NDArray[np.bool], origin: Real, turned: Rotation | None = None
    ) -> tuple[Archetypes, Real]:
        ids, upright = np.flatnonzero(which & own), (turned or Rotation.identity()).as_matrix()
        places = ((data.geom_xpos[ids] - centre) @ to_body.T - origin) @ upright.T
        turns = upright @ to_body @ data.geom_xmat[ids].reshape(-1, 3, 3)
        return _archetypes(model, ids, places, turns), origin

    parts = {
        "body": draw(steady & ~np.isin(model.geom_bodyid, (rotor, tail)), np.zeros(3)),
        "rotor": draw(model.geom_bodyid == rotor, hub),
        "tail_rotor": draw(model.geom_bodyid == tail, tail_hub),
    }
    if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, LOAD) >= 0:
        places = (data.site(HOOK).xpos, data.body(LOAD).xipos)
        hook, load = (to_body @ (place - centre) for place in places)
        upright = _turn_down((load - hook)[None]).inv()[0]
        parts["load"] = draw(~steady, load, upright)[0], hook
    return parts


def _turn_down(directions: Real) -> Rotation:
    """Return the shortest turns of what points down to the directions, (n, 3), FRD."""
    x, y, z = directions.T
    across = np.maximum(np.hypot(x, y), 1e-12)
    return Rotation.from_rotvec(
        np.array([-y, x, 0.0 * z]).T * (np.arctan2(across, z) / across)[:, None]
    )


def _archetypes(
    model: mujoco.MjModel, ids: NDArray[np.intp], places: Real, turns: Real
) -> Archetypes:
    colours, materials = model.geom_rgba[ids].copy(), model.geom_matid[ids]
    colours[materials >= 0] = model.mat_rgba[materials[materials >= 0]]
    shapes: dict[str, rr.AsComponents] = {}
    for kind in np.unique(model.geom_type[ids]):
        keep = model.geom_type[ids] == kind
        some, size, turn, ink = ids[keep], model.geom_size[ids[keep]], turns[keep], colours[keep]
        look: dict[str, Any] = {"colors": ink, "fill_mode": "solid"}
        look["quaternions"] = Rotation.from_matrix(turn).as_quat()
        name = mujoco.mjtGeom(kind).name.removeprefix("mjGEOM_").lower()
        shapes[name] = (
            _SHAPES[name](places[keep], size, turn[:, :, 2], look)
            if name in _SHAPES
            else _meshes(model, some, places[keep], turn, ink)
        )
    return shapes


_SHAPES: Mapping[str, Callable[[Real, Real, Real, dict[str, Any]], rr.AsComponents]] = {
    "box": lambda at, size, _, look: rr.Boxes3D(centers=at, half_sizes=size, **look),
    "ellipsoid": lambda at, size, _, look: rr.Ellipsoids3D(centers=at, half_sizes=size, **look),
    "sphere": lambda at, size, _, look: rr.Ellipsoids3D(centers=at, radii=size[:, 0], **look),
    "cylinder": lambda at, size, _, look: rr.Cylinders3D(
        centers=at, radii=size[:, 0], lengths=2.0 * size[:, 1], **look
    ),
    # Rerun's start at their origin and rise along z, MuJoCo's are centred on it
    "capsule": lambda at, size, along, look: rr.Capsules3D(
        translations=at - size[:, 1:2] * along,
        radii=size[:, 0],
        lengths=2.0 * size[:, 1],
        **look,
    ),
}
"""Shapes by MuJoCo's names, of places and sizes, (n, 3), and their axes along z, (n, 3)."""


def _meshes(
    model: mujoco.MjModel, ids: NDArray[np.intp], places: Real, turns: Real, inks: Real
) -> rr.Mesh3D:
    corners, normals, colours = [], [], []
    for geom, place, turn, ink in zip(ids, places, turns, inks):
        mesh = model.mesh(model.geom_dataid[geom])
        vertices = model.mesh_vert[mesh.vertadr[0] :][: mesh.vertnum[0]]
        faces = model.mesh_face[mesh.faceadr[0] :][: mesh.facenum[0]]
        triangles = vertices[faces] @ turn.T + place
        across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        corners.append(triangles.reshape(-1, 3))
        normals.append(np.repeat(across, 3, axis=0))
        colours.append(np.tile(np.rint(255.0 * ink).astype(np.uint8), (3 * len(faces), 1)))
    normal = np.concatenate(normals)
    return rr.Mesh3D(
        vertex_positions=np.concatenate(corners),
        vertex_normals=normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12),
        vertex_colors=np.concatenate(colours),
    )


def _send(recording: rr.RecordingStream, entity: str, time: Real, columns: Any) -> None:
    stamps = rr.TimeColumn(TIMELINE, duration=np.rint(time * 1e9).astype("timedelta64[ns]"))
    recording.send_columns(entity, indexes=[stamps], columns=columns)


def _log_flight(
    recording: rr.RecordingStream, name: str, record: FlightRecord, parts: Parts
) -> None:
    root, provenance = rr.escape_entity_path_part(name), dict(record.provenance)
    recording.send_property(name, rr.AnyValues(provenance=json.dumps(provenance, sort_keys=True)))
    step = float(np.median(np.diff(record.time))) if len(record) > 1 else 1.0
    every = slice(None, None, max(1, int(1.0 / (_HZ * step) + 1e-6)))
    seen = FlightRecord(record.time[every], record.values[every], record.channels, provenance)
    for (family, _), names in families(record, record.names).items():
        entity = f"{root}/{rr.escape_entity_path_part(family)}"
        shown = [values_for_people(one, seen[one], record.unit(one)) for one in names]
        labels = [f"{channel} [{unit}]" for channel, (_, unit) in zip(names, shown)]
        inks = [_INKS[k % len(_INKS)] for k in range(len(names))]
        recording.log(entity, rr.SeriesLines(names=labels, colors=inks), static=True)
        scalars = np.column_stack([values for values, _ in shown])
        _send(recording, entity, seen.time, rr.Scalars.columns(scalars=scalars))
    reached = provenance.get("reached")
    if isinstance(reached, Mapping) and reached.get("phases"):
        times, texts = zip(*sorted(reached["phases"]))
        columns = rr.TextLog.columns(text=texts, level=["INFO"] * len(texts))
        _send(recording, f"{root}/log", np.array(times), columns)
    if {*ATTITUDES, *POSITIONS} <= {*record.names}:
        _log_space(recording, f"{root}/world", seen, parts)


def _log_space(
    recording: rr.RecordingStream, world: str, record: FlightRecord, parts: Parts
) -> None:
    recording.log(world, rr.ViewCoordinates.FRD, static=True)  # north, east, down
    _log_ground(recording, world, record)
    places = np.array_split(record.select(POSITIONS), min(len(record), _TRAIL))
    line = rr.LineStrips3D(  # means leave out most of the sensor's noise
        [np.array([each.mean(axis=0) for each in places])], colors=[(240, 200, 60)], radii=[-1.5]
    )
    recording.log(f"{world}/trail", line, static=True)
    entity, parameters = f"{world}/helicopter", record.provenance.get("parameters", {})
    main, tail = (
        record.time[:, None] * float(parameters.get(f"{name}.speed", 0.0)) / SLOWED
        for name in ("main_rotor", "tail_rotor")
    )
    direction = float(parameters.get("main_rotor.direction", 1.0))
    spun = Rotation.from_rotvec(main * np.array([0.0, 0.0, direction]))
    tilts = "a" in record and "b" in record
    rotor = drawn_tilt(record["a"], record["b"]) * spun if tilts else spun
    turns = {"rotor": rotor, "tail_rotor": Rotation.from_rotvec(tail * [0.0, 1.0, 0.0])}
    body = Rotation.from_euler("ZYX", record.select(ATTITUDES)[:, ::-1])
    _log_part(recording, entity, parts["body"][0], record, record.select(POSITIONS), body)
    for name, turn in turns.items():
        shapes, place = parts[name]
        _log_part(recording, f"{entity}/{name}", shapes, record, place, turn)
    if "load" in parts and LOAD_CHANNELS[0] in record:
        (shapes, hook), cable = parts["load"], record.select(LOAD_CHANNELS)
        _log_part(recording, f"{entity}/load", shapes, record, hook + cable, _turn_down(cable))
        strips = [[hook, hook + one] for one in cable]
        _send(recording, f"{entity}/cable", record.time, rr.LineStrips3D.columns(strips=strips))
    # the camera follows an entity only if it has a shape of its own
    recording.log(entity, rr.Points3D([[0.0, 0.0, 0.0]], radii=[0.001]), static=True)


def _log_part(
    recording: rr.RecordingStream,
    entity: str,
    shapes: Archetypes,
    record: FlightRecord,
    place: Real,
    turn: Rotation,
) -> None:
    for name, archetype in shapes.items():
        recording.log(f"{entity}/shapes/{name}", archetype, static=True)
    columns = rr.Transform3D.columns(
        translation=np.broadcast_to(place, (len(record), 3)), quaternion=turn.as_quat()
    )
    _send(recording, entity, record.time, columns)


def _log_ground(recording: rr.RecordingStream, world: str, record: FlightRecord) -> None:
    entity, flown = f"{world}/ground", Ground.of_record(record)
    level = max(0.0, float(np.max(record["down"])) + _CLEARANCE)
    north, east = record.select(POSITIONS)[0, :2]
    if flown is not None:
        level, north, east, deck = 0.0, 0.0, 0.0, flown.deck
        axis = [-math.sin(flown.uphill), math.cos(flown.uphill), 0.0]
        lean = rr.RotationAxisAngle(axis=axis, radians=flown.slope)
        recording.log(entity, rr.Transform3D(rotation=lean), static=True)
        if deck is not None:
            level = deck.above
            half = (0.5 * deck.length, 0.5 * deck.width, 0.5 * deck.thickness)
            shape = {"deck": _slab((0.0, 0.0, half[2]), half, (84, 87, 89))}
            place, matrices = deck.pose(record.time)
            turn = Rotation.from_matrix(matrices)
            _log_part(recording, f"{world}/deck", shape, record, place, turn)
    lines = np.arange(-_GROUND, _GROUND + 1e-9, _MESH)
    strips = [[[x, -_GROUND, 0.0], [x, _GROUND, 0.0]] for x in lines]
    strips += [[[-_GROUND, y, 0.0], [_GROUND, y, 0.0]] for y in lines]
    mesh = np.array(strips) + np.array([north, east, level])
    shapes = {
        "lines": rr.LineStrips3D(mesh, colors=[(120, 135, 105)], radii=[0.02]),
        "surface": _slab((north, east, level + 0.04), (_GROUND, _GROUND, 0.02), (74, 88, 66)),
    }
    for name, shape in shapes.items():
        recording.log(f"{entity}/{name}", shape, static=True)


def _slab(centre: Sequence[float], half: Sequence[float], colour: Sequence[int]) -> rr.Boxes3D:
    return rr.Boxes3D(centers=[centre], half_sizes=[half], colors=[colour], fill_mode="solid")


def _tab(name: str, record: FlightRecord) -> View:
    root = rr.escape_entity_path_part(name)
    views = {
        family: rrb.TimeSeriesView(
            origin=f"{root}/{rr.escape_entity_path_part(family)}", name=family
        )
        for family, _ in families(record, record.names)
    }
    motion = [view for family, view in views.items() if family in _MOTION]
    more = [view for family, view in views.items() if family not in _MOTION]
    signals = rrb.Tabs(
        rrb.Vertical(*motion, name="motion"),
        rrb.Vertical(*more, name="more"),
        active_tab=0 if motion else 1,
    )
    if not {*ATTITUDES, *POSITIONS} <= {*record.names}:
        return rrb.Horizontal(signals, name=name)
    place = record.select(POSITIONS)[0].tolist()
    space = rrb.Spatial3DView(
        origin=f"{root}/world",
        name="space",
        background=rrb.Background(color=(150, 178, 205)),
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=[start + step for start, step in zip(place, _EYE)],
            look_target=place,
            eye_up=(0.0, 0.0, -1.0),
            tracking_entity=f"{root}/world/helicopter",
        ),
    )
    left = rrb.Vertical(space, rrb.TextLogView(origin=f"{root}/log", name="log"), row_shares=[9, 2])
    return rrb.Horizontal(left, signals, column_shares=[1, 1], name=name)
