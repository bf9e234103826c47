"""The helicopter's shapes for Rerun: MuJoCo's geoms, forward-right-down from their centre.

The geoms of a body called `rotor` and of what it carries stand apart and relative to their hub:
they turn, and tilt with the tip-path plane. So do those of `tail_rotor`, which turn alone.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import mujoco
import numpy as np
import rerun as rr
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from helisim.base.errors import InputError
from helisim.base.value import FrozenMap
from helisim.physics.frames import flip
from helisim.vehicle.roles import Roles

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


@dataclass(frozen=True, eq=False)
class Shapes:
    """What a helicopter looks like.

    Attributes:
        body: archetype by name, from the centre of gravity.
        rotor: archetype by name, from the hub.
        tail_rotor: archetype by name, from the tail hub; empty where there is no tail hub.
        hub: (3,) m from the centre of gravity.
        tail_hub: (3,) m from the centre of gravity; None where the model names none.
        radius: m, of the main rotor's disc; None where there is none.
    """

    body: Mapping[str, rr.AsComponents]
    rotor: Mapping[str, rr.AsComponents] = field(default_factory=dict)
    tail_rotor: Mapping[str, rr.AsComponents] = field(default_factory=dict)
    hub: NDArray[np.float64] = field(default_factory=lambda: np.array([0.0, 0.0, -0.28]))
    tail_hub: NDArray[np.float64] | None = None
    radius: float | None = None

    def __post_init__(self) -> None:
        for name in ("body", "rotor", "tail_rotor"):
            object.__setattr__(self, name, FrozenMap(getattr(self, name)))


def box_shapes() -> Shapes:
    """Return a few boxes that look like a helicopter."""
    boxes = {
        name: rr.Boxes3D(centers=[centre], half_sizes=[half], colors=[colour], fill_mode="solid")
        for name, centre, half, colour in _BOXES
    }
    return Shapes(boxes)


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


def model_shapes(model: mujoco.MjModel, roles: Roles | None = None) -> Shapes:
    """Return the visual geoms of the model's first free body and of all that it carries.

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
    right_down = np.diag(flip(1.0, 1.0, 1.0))
    to_body = right_down @ data.xmat[root].reshape(3, 3).T
    ids = np.flatnonzero(
        (model.body_rootid[model.geom_bodyid] == root) & (model.geom_group < _VISUAL_GROUPS)
    )
    rotor, tail_rotor = (
        mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, roles.body(role))
        for role in ("rotor", "tail_rotor")
    )
    tail = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, roles.site("tail_hub"))
    disc = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, roles.geom("rotor_disc"))
    hub = np.zeros(3) if rotor < 0 else to_body @ (data.xpos[rotor] - data.subtree_com[root])
    tail_hub = to_body @ (data.site_xpos[tail] - data.subtree_com[root]) if tail >= 0 else None
    main = _carried(model, rotor, ids)
    aft = _carried(model, tail_rotor, ids) & (tail_hub is not None)

    def draw(which: NDArray[np.bool], origin: NDArray[np.float64]) -> dict[str, rr.AsComponents]:
        return _archetypes(model, _geoms(model, data, root, ids[which], to_body, origin))

    return Shapes(
        body=draw(~(main | aft), np.zeros(3)),
        rotor=draw(main, hub),
        tail_rotor={} if tail_hub is None else draw(aft, tail_hub),
        hub=hub,
        tail_hub=tail_hub,
        radius=float(model.geom_size[disc, 0]) if disc >= 0 else None,
    )


def _carried(model: mujoco.MjModel, ancestor: int, ids: NDArray[np.intp]) -> NDArray[np.bool]:
    """Return which geoms a body and its descendants carry; none for the body -1."""
    return np.array([_carries(model, ancestor, int(model.geom_bodyid[k])) for k in ids], dtype=bool)


def _carries(model: mujoco.MjModel, ancestor: int, body: int) -> bool:
    while body > 0 and ancestor >= 0:
        if body == ancestor:
            return True
        body = int(model.body_parentid[body])
    return False


def _geoms(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    root: int,
    ids: NDArray[np.intp],
    to_body: NDArray[np.float64],
    origin: NDArray[np.float64],
) -> _Geoms:
    colours = model.geom_rgba[ids].copy()
    materials = model.geom_matid[ids]
    colours[materials >= 0] = model.mat_rgba[materials[materials >= 0]]
    return _Geoms(
        ids=ids,
        types=model.geom_type[ids],
        centres=(data.geom_xpos[ids] - data.subtree_com[root]) @ to_body.T - origin,
        matrices=to_body @ data.geom_xmat[ids].reshape(-1, 3, 3),
        sizes=model.geom_size[ids],
        colours=colours,
    )


def _archetypes(model: mujoco.MjModel, geoms: _Geoms) -> dict[str, rr.AsComponents]:
    """Return one batch for each type of shape."""
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
    if meshes.ids.size:
        shapes["meshes"] = _meshes(model, meshes)
    return shapes


def _meshes(model: mujoco.MjModel, geoms: _Geoms) -> rr.Mesh3D:
    """Return all meshes as one, coloured by vertex: Rerun spends 3 kB on each entity."""
    places, normals, faces, colours, count = [], [], [], [], 0
    for i, geom in enumerate(geoms.ids):
        corners, triangles = _mesh(model, model.geom_dataid[geom])
        places.append(corners @ geoms.matrices[i].T + geoms.centres[i])
        normals.append(_normals(corners, triangles) @ geoms.matrices[i].T)
        faces.append(triangles + count)
        colours.append(
            np.tile(np.rint(255.0 * geoms.colours[i]).astype(np.uint8), (len(corners), 1))
        )
        count += len(corners)
    return rr.Mesh3D(
        vertex_positions=np.concatenate(places),
        triangle_indices=np.concatenate(faces),
        vertex_normals=np.concatenate(normals),
        vertex_colors=np.concatenate(colours),
    )


def _normals(vertices: NDArray[np.float32], faces: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return a unit normal for each vertex, the mean of its faces': without, light is flat."""
    corners = vertices[faces].astype(np.float64)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros(vertices.shape)
    for k in range(3):
        np.add.at(normals, faces[:, k], across)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return normals / np.where(length > 0.0, length, 1.0)


def _boxes(geoms: _Geoms) -> rr.Boxes3D:
    return rr.Boxes3D(centers=geoms.centres, half_sizes=geoms.sizes, **_look(geoms))


def _ellipsoids(geoms: _Geoms) -> rr.Ellipsoids3D:
    return rr.Ellipsoids3D(centers=geoms.centres, half_sizes=geoms.sizes, **_look(geoms))


def _spheres(geoms: _Geoms) -> rr.Ellipsoids3D:
    return rr.Ellipsoids3D(centers=geoms.centres, radii=geoms.sizes[:, 0], **_look(geoms))


def _cylinders(geoms: _Geoms) -> rr.Cylinders3D:
    return rr.Cylinders3D(centers=geoms.centres, **_rod(geoms), **_look(geoms))


def _capsules(geoms: _Geoms) -> rr.Capsules3D:
    """Rerun's capsules start at their origin and rise along z, MuJoCo's are centred on it."""
    starts = geoms.centres - geoms.sizes[:, 1:2] * geoms.matrices[:, :, 2]
    return rr.Capsules3D(translations=starts, **_rod(geoms), **_look(geoms))


def _rod(geoms: _Geoms) -> dict[str, Any]:
    return {"radii": geoms.sizes[:, 0], "lengths": 2.0 * geoms.sizes[:, 1]}


def _look(geoms: _Geoms) -> dict[str, Any]:
    return {"quaternions": geoms.quaternions, "colors": geoms.colours, "fill_mode": "solid"}


def _mesh(model: mujoco.MjModel, mesh: int) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Return the (n, 3) vertices of a mesh in its geom's axes, and its (m, 3) faces."""
    vertex, face = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
    return (
        model.mesh_vert[vertex : vertex + model.mesh_vertnum[mesh]],
        model.mesh_face[face : face + model.mesh_facenum[mesh]],
    )
