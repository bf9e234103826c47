"""Flight records as a Rerun recording: the helicopter in space, its signals over time.

Each flight has its own root, named after it, and its own time from its first sample::

    <flight>/world               axes north, east, down
    <flight>/world/helicopter    pose of the body (forward, right, down) over time
    <flight>/world/helicopter/visual_geometries/...
    <flight>/rates ...           one entity a group of signals, one series a channel
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path

import mujoco
import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from helisim.channels import (
    ACCELERATIONS,
    ATTITUDES,
    IN1,
    IN2,
    POSITIONS,
    RATES,
    SERVOS,
    VELOCITIES,
)
from helisim.errors import InputError
from helisim.physics.frames import flip
from helisim.record import FlightRecord
from helisim.storage import atomic_write

APPLICATION = "helisim"
TIMELINE = "time"

GROUPS: dict[str, tuple[str, ...]] = {
    "sticks": IN2,
    "swashplate": IN1,
    "servos": SERVOS,
    "rates": RATES,
    "attitudes": ATTITUDES,
    "velocities": VELOCITIES,
    "accelerations": ACCELERATIONS,
    "positions": POSITIONS,
}
"""Entity to channels. Channels in no group go to the entity `other`."""

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


def write_recording(
    path: str | Path,
    flights: Mapping[str, FlightRecord],
    *,
    model: mujoco.MjModel | None = None,
) -> Path:
    """Write flights to a Rerun recording (.rrd) and return its path.

    A flight without attitude or position has its signals only. The file appears complete
    or not at all.

    Args:
        path: file to write, with the suffix .rrd.
        flights: records by name.
        model: its first free body, with all that it carries, gives the helicopter's shape;
            None draws a few boxes.

    Raises:
        InputError: no flights, a suffix other than .rrd, or a model without a free body.
        StorageError: the file can't be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".rrd":
        raise InputError(f"{path}: a Rerun recording needs the suffix .rrd, got {path.suffix!r}")
    if not flights:
        raise InputError("a recording needs at least one flight, got none")
    shapes = _box_shapes() if model is None else _model_shapes(model)
    with atomic_write(path) as temporary:
        recording = rr.RecordingStream(APPLICATION, recording_id=_content_id(flights))
        # The blueprint and the file come first: what is logged before them is lost.
        recording.save(temporary, default_blueprint=_blueprint(flights))
        try:
            for name, record in flights.items():
                _log_flight(recording, name, record, shapes)
            recording.flush()
        finally:
            recording.disconnect()  # writes the footer
    return path


def _content_id(flights: Mapping[str, FlightRecord]) -> str:
    """Name the recording by its contents: the same flights open as the same recording."""
    digest = hashlib.sha256()
    for name, record in flights.items():
        digest.update(repr((name, record.names, dict(record.provenance))).encode())
        digest.update(record.time.tobytes())
        digest.update(record.values.tobytes())
    return digest.hexdigest()[:32]


def _root(name: str) -> str:
    return rr.escape_entity_path_part(name)


def _groups(record: FlightRecord) -> dict[str, tuple[str, ...]]:
    """Return the groups that the record has channels of, with those channels."""
    grouped = {group: tuple(n for n in names if n in record) for group, names in GROUPS.items()}
    known = {name for names in GROUPS.values() for name in names}
    grouped["other"] = tuple(name for name in record.names if name not in known)
    return {group: names for group, names in grouped.items() if names}


def _has_pose(record: FlightRecord) -> bool:
    return all(name in record for name in ATTITUDES + POSITIONS)


def _blueprint(flights: Mapping[str, FlightRecord]) -> rrb.Blueprint:
    """One tab a flight: space on the left, the signals on the right."""
    tabs = []
    for name, record in flights.items():
        signals = rrb.Vertical(
            *(
                rrb.TimeSeriesView(origin=f"{_root(name)}/{group}", name=group)
                for group in _groups(record)
            )
        )
        space = rrb.Spatial3DView(origin=f"{_root(name)}/world", name="space")
        views = [space, signals] if _has_pose(record) else [signals]
        tabs.append(rrb.Horizontal(*views, name=name))
    return rrb.Blueprint(rrb.Tabs(*tabs), collapse_panels=True)


def _log_flight(
    recording: rr.RecordingStream,
    name: str,
    record: FlightRecord,
    shapes: Mapping[str, rr.AsComponents],
) -> None:
    root = _root(name)
    recording.send_property(
        name, rr.AnyValues(provenance=json.dumps(dict(record.provenance), sort_keys=True))
    )
    # Whole nanoseconds: Rerun cuts float durations off below.
    nanoseconds = np.rint(record.time * 1e9).astype("timedelta64[ns]")
    index = rr.TimeColumn(TIMELINE, duration=nanoseconds)
    for group, names in _groups(record).items():
        labels = [f"{channel} [{record.unit(channel)}]" for channel in names]
        recording.log(f"{root}/{group}", rr.SeriesLines(names=labels), static=True)
        recording.send_columns(
            f"{root}/{group}",
            indexes=[index],
            columns=rr.Scalars.columns(scalars=record.select(names)),
        )
    if not _has_pose(record):
        return
    recording.log(f"{root}/world", rr.ViewCoordinates.FRD, static=True)  # north, east, down
    for shape, archetype in shapes.items():
        entity = f"{root}/world/helicopter/visual_geometries/{shape}"
        recording.log(entity, archetype, static=True)
    recording.send_columns(
        f"{root}/world/helicopter",
        indexes=[index],
        columns=rr.Transform3D.columns(
            translation=record.select(POSITIONS), quaternion=_quaternions(record)
        ),
    )


def _quaternions(record: FlightRecord) -> NDArray[np.float64]:
    """Return the rotation from body to earth axes, (n_time, 4), x y z w as Rerun has it."""
    return Rotation.from_euler("ZYX", record.select(ATTITUDES)[:, ::-1]).as_quat()


# Shapes, forward-right-down from the centre of gravity


def _box_shapes() -> dict[str, rr.AsComponents]:
    return {
        name: rr.Boxes3D(centers=[centre], half_sizes=[half], colors=[colour], fill_mode="solid")
        for name, centre, half, colour in _BOXES
    }


@dataclass(frozen=True, eq=False)
class _Geoms:
    """Geoms of one helicopter: (n,) ids and types, poses in its axes, sizes, colours."""

    ids: NDArray[np.intp]
    types: NDArray[np.int32]
    centres: NDArray[np.float64]
    matrices: NDArray[np.float64]
    sizes: NDArray[np.float64]
    colours: NDArray[np.float32]

    @property
    def quaternions(self) -> NDArray[np.float64]:
        """(n, 4), x y z w."""
        return Rotation.from_matrix(self.matrices).as_quat()

    def of(self, *types: mujoco.mjtGeom) -> "_Geoms":
        """Return those of the given types."""
        keep = np.isin(self.types, [int(item) for item in types])
        return _Geoms(*(getattr(self, item.name)[keep] for item in fields(self)))


def _visual_geoms(model: mujoco.MjModel) -> _Geoms:
    """Return the visual geoms of the model's first free body and all that it carries."""
    free = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
    if free.size == 0:
        raise InputError("the model has no free body: there is no helicopter to draw")
    root = int(model.jnt_bodyid[free[0]])
    ids = np.flatnonzero(
        (model.body_rootid[model.geom_bodyid] == root) & (model.geom_group < _VISUAL_GROUPS)
    )
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    right_down = np.diag(flip.py_func(1.0, 1.0, 1.0))
    to_body = right_down @ data.xmat[root].reshape(3, 3).T
    colours = model.geom_rgba[ids].copy()
    materials = model.geom_matid[ids]
    colours[materials >= 0] = model.mat_rgba[materials[materials >= 0]]
    return _Geoms(
        ids=ids,
        types=model.geom_type[ids],
        centres=(data.geom_xpos[ids] - data.subtree_com[root]) @ to_body.T,
        matrices=to_body @ data.geom_xmat[ids].reshape(-1, 3, 3),
        sizes=model.geom_size[ids],
        colours=colours,
    )


def _model_shapes(model: mujoco.MjModel) -> dict[str, rr.AsComponents]:
    """Return one batch for each type of shape, and one entity for each mesh."""
    geoms = _visual_geoms(model)
    shapes: dict[str, rr.AsComponents] = {}
    for name, kind, draw in (
        ("boxes", mujoco.mjtGeom.mjGEOM_BOX, _boxes),
        ("spheres", mujoco.mjtGeom.mjGEOM_SPHERE, _spheres),
        ("ellipsoids", mujoco.mjtGeom.mjGEOM_ELLIPSOID, _ellipsoids),
        ("cylinders", mujoco.mjtGeom.mjGEOM_CYLINDER, _cylinders),
        ("capsules", mujoco.mjtGeom.mjGEOM_CAPSULE, _capsules),
    ):
        some = geoms.of(kind)
        if some.ids.size:
            shapes[name] = draw(some)
    meshes = geoms.of(mujoco.mjtGeom.mjGEOM_MESH)
    for i, geom in enumerate(meshes.ids):
        vertices, faces = _mesh(model, model.geom_dataid[geom])
        shapes[f"mesh_{geom}"] = rr.Mesh3D(
            vertex_positions=vertices @ meshes.matrices[i].T + meshes.centres[i],
            triangle_indices=faces,
            albedo_factor=meshes.colours[i],
        )
    return shapes


def _boxes(geoms: _Geoms) -> rr.Boxes3D:
    return rr.Boxes3D(
        centers=geoms.centres,
        half_sizes=geoms.sizes,
        quaternions=geoms.quaternions,
        colors=geoms.colours,
        fill_mode="solid",
    )


def _spheres(geoms: _Geoms) -> rr.Ellipsoids3D:
    return rr.Ellipsoids3D(
        centers=geoms.centres,
        radii=geoms.sizes[:, 0],
        colors=geoms.colours,
        fill_mode="solid",
    )


def _ellipsoids(geoms: _Geoms) -> rr.Ellipsoids3D:
    return rr.Ellipsoids3D(
        centers=geoms.centres,
        half_sizes=geoms.sizes,
        quaternions=geoms.quaternions,
        colors=geoms.colours,
        fill_mode="solid",
    )


def _cylinders(geoms: _Geoms) -> rr.Cylinders3D:
    return rr.Cylinders3D(
        centers=geoms.centres,
        radii=geoms.sizes[:, 0],
        lengths=2.0 * geoms.sizes[:, 1],
        quaternions=geoms.quaternions,
        colors=geoms.colours,
        fill_mode="solid",
    )


def _capsules(geoms: _Geoms) -> rr.Capsules3D:
    """Rerun's capsules start at their origin and rise along z, MuJoCo's are centred on it."""
    return rr.Capsules3D(
        translations=geoms.centres - geoms.sizes[:, 1:2] * geoms.matrices[:, :, 2],
        radii=geoms.sizes[:, 0],
        lengths=2.0 * geoms.sizes[:, 1],
        quaternions=geoms.quaternions,
        colors=geoms.colours,
        fill_mode="solid",
    )


def _mesh(model: mujoco.MjModel, mesh: int) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Return the (n, 3) vertices of a mesh in its geom's axes, and its (m, 3) faces."""
    vertex, face = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
    return (
        model.mesh_vert[vertex : vertex + model.mesh_vertnum[mesh]],
        model.mesh_face[face : face + model.mesh_facenum[mesh]],
    )
