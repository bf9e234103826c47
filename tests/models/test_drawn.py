"""What of the vehicles is only to be seen: it weighs nothing, touches nothing, and is true."""

import shutil
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

from helisim.vehicle import read_parameters
from helisim.vehicle.folder import models_folder

DRAWN = 2  # the geom group
MASSIVE = {
    "boom",
    "mast",
    "swashplate",
    "hub_block",
    "tail_case",
    "flight_computer",
    "skid_left",
    "skid_right",
}
"""Primitives that carry their part's mass; fuselage and blades have inertial elements."""
MORE = {
    "jr700": {"battery_left", "battery_right", "gyro", "safety_bar_1", "safety_bar_2"},
    "blade360": {"battery"},
}


@pytest.fixture(scope="module", params=["jr700", "blade360"])
def name(request):
    return request.param


@pytest.fixture(scope="module")
def folder(name):
    return models_folder() / name


@pytest.fixture(scope="module")
def scene(folder):
    return mujoco.MjModel.from_xml_path(str(folder / "scene.xml"))


@pytest.fixture(scope="module")
def rebuilt(name, tmp_path_factory):
    """A copy of the models, whose meshes build.py has made again."""
    copy = tmp_path_factory.mktemp("models") / "models"
    shutil.copytree(models_folder(), copy, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.rmtree(copy / name / "assets")
    build(copy / name, "meshes")
    return copy / name


def build(folder: Path, job: str) -> str:
    run = subprocess.run(
        [sys.executable, folder / "build.py", job],
        capture_output=True,
        text=True,
        timeout=300,
        check=True,
    )
    return run.stdout


def points_of(model, mesh):
    start = model.mesh_vertadr[mesh]
    return model.mesh_vert[start : start + model.mesh_vertnum[mesh]]


def rotor_points(model, body, mesh):
    """Points of meshes whose name begins so, in a rotor's own axes, (n, 3) m."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    number, points = model.body(body).id, []
    for geom in np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_MESH):
        drawn = model.mesh(model.geom_dataid[geom])
        if model.geom_bodyid[geom] == number and drawn.name.startswith(mesh):
            turn = data.geom_xmat[geom].reshape(3, 3)
            place = data.geom_xpos[geom] - data.xpos[number]
            points.append(points_of(model, drawn.id) @ turn.T + place)
    return np.concatenate(points)


def test_only_the_named_parts_have_a_mass(name, folder):
    """Whatever else is drawn or collides has a mass of exactly 0, not one of its volume."""
    spec = mujoco.MjSpec.from_file(str(folder / f"{name}.xml"))
    assert {geom.name for geom in spec.geoms if geom.mass != 0.0} == MASSIVE | MORE[name]
    assert all(geom.mass >= 0.0 for geom in spec.geoms)  # NaN would be: of its volume


def test_what_is_drawn_touches_nothing(scene):
    """Group 2 never collides; what does is not drawn, but the ground."""
    touching = (scene.geom_contype | scene.geom_conaffinity) != 0
    assert not np.any(touching & (scene.geom_group == DRAWN))
    assert scene.geom_contype[scene.geom("ground").id] == 1


def test_the_suns_shadow_map_holds_the_vehicle_wherever_it_flies(name, scene):
    """The map reaches shadowclip extents from the light's axis; all that casts is within."""
    data = mujoco.MjData(scene)
    sun = scene.light("sun").id
    assert scene.light_castshadow[sun]
    root = scene.body(name).id
    drawn = (scene.body_rootid[scene.geom_bodyid] == root) & (scene.geom_group == DRAWN)
    casting = np.flatnonzero(drawn & (scene.geom_castshadow != 0))
    assert casting.size > 50
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    for at in ((0.0, 0.0, 1.0), (30.0, -20.0, 40.0)):
        data.qpos[:3] = at
        mujoco.mj_forward(scene, data)
        for geom in casting:
            box = scene.geom_aabb[geom]
            points = (box[:3] + corners * box[3:]) @ data.geom_xmat[geom].reshape(3, 3).T
            arm = points + data.geom_xpos[geom] - data.light_xpos[sun]
            off = np.linalg.norm(np.cross(arm, data.light_xdir[sun]), axis=1)
            assert off.max() < scene.vis.map.shadowclip * scene.stat.extent


def test_what_is_seen_through_casts_no_shadow(scene):
    """Nor does the ground, which would be striped by its own."""
    for geom in range(scene.ngeom):
        material = scene.geom_matid[geom]
        if material >= 0 and scene.mat_rgba[material, 3] < 1.0:
            assert not scene.geom_castshadow[geom], scene.geom(geom).name
    assert not scene.geom_castshadow[scene.geom("ground").id]


@pytest.mark.parametrize(
    ("body", "axis", "mesh", "section"),
    [("rotor", 2, "blade", "main_rotor"), ("tail_rotor", 1, "tail_blade", "tail_rotor")],
)
def test_drawn_blades_have_the_radius_and_chord_that_fly(scene, folder, body, axis, mesh, section):
    """They reach the disc's rim, lie in its plane, and are as broad as the parameters say."""
    parameters = read_parameters(folder / "parameters.toml")
    radius, chord = (parameters[f"{section}.{key}"] for key in ("radius", "chord"))
    points = rotor_points(scene, body, mesh)
    across = np.delete(points, axis, axis=1)
    reach = np.linalg.norm(across, axis=1).max()
    # the tip's corners lie a few millimetres of chord off the radius through its quarter chord
    assert radius <= reach < radius * 1.015
    disc = scene.geom(f"{body}_disc")
    assert disc.size[0] == pytest.approx(radius)
    # a blade pitched by 0.08 rad leaves the plane by less than a tenth of its chord
    assert np.abs(points[:, axis]).max() < 0.1 * chord
    # Far out, about the radius through the tip; the blade is symmetric to neither edge.
    tip = across[np.linalg.norm(across, axis=1).argmax()]
    out = across @ tip / np.linalg.norm(tip)
    side = across @ np.array([-tip[1], tip[0]]) / np.linalg.norm(tip)
    outer = (out > 0.6 * radius) & (out < 0.95 * radius)
    assert np.ptp(side[outer]) == pytest.approx(chord, rel=0.15)


def test_meshes_are_what_build_makes(folder, rebuilt):
    """Nobody edited a mesh, and none is left over."""
    stored, made = (
        {path.name: path for path in (place / "assets").glob("*.obj")}
        for place in (folder, rebuilt)
    )
    assert set(stored) == set(made)
    assert len(made) > 10
    for name, path in made.items():
        mine, theirs = (
            [line.split() for line in file.read_text().splitlines() if line.startswith("v ")]
            for file in (path, stored[name])
        )
        # written to 10 micrometres: another machine's rounding may change the last digit
        np.testing.assert_allclose(
            np.array(mine)[:, 1:].astype(float),
            np.array(theirs)[:, 1:].astype(float),
            atol=2e-5,
            rtol=0,
            err_msg=name,
        )


def test_the_readme_has_the_parts_that_build_prints(folder):
    """The table under Parts is build.py's, to the character."""
    printed = build(folder, "parts")
    assert "total" in printed
    assert printed in (folder / "README.md").read_text()


def test_an_unknown_job_says_which_there_are(folder):
    """Without a job, or with a wrong one, the script fails and lists them."""
    run = subprocess.run(
        [sys.executable, folder / "build.py", "paint"],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert run.returncode == 1
    assert all(f"`{job}`" in run.stderr for job in ("parts", "close", "meshes", "picture"))


def test_the_drawn_fin_has_the_area_that_flies(scene, folder):
    """One side of the plate, without its hole."""
    mesh = scene.mesh("tail_fin").id
    start = scene.mesh_faceadr[mesh]
    faces = scene.mesh_face[start : start + scene.mesh_facenum[mesh]]
    corner = points_of(scene, mesh)[faces]
    across = 0.5 * np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    # The plate's two sides face along one axis of its frame, which is that of its inertia.
    side = 0.5 * np.abs(across).sum(axis=0).max()
    wanted = read_parameters(folder / "parameters.toml")["fin.area"]
    assert side == pytest.approx(wanted, rel=0.1)  # the parameter has one digit
