"""The shipped MJCF and its folders: what weighs and collides, and that stock MuJoCo runs it."""

import shutil
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

import helisim as hs
from helisim.vehicle.build import unwritten
from helisim.vehicle.parameters import model_folder, models_folder, vehicle_names
from tabled import tabled

FOLDER = Path(__file__).parents[2] / "models" / "jr700"
VEHICLE = FOLDER / "jr700.xml"
SCENE = FOLDER / "scene.xml"

SAFETY_BARS = ["safety_bar_1", "safety_bar_2"]


@pytest.fixture(scope="module")
def model():
    return mujoco.MjModel.from_xml_path(str(VEHICLE))


def test_only_skids_and_bars_collide_and_never_with_the_vehicle(model):
    touching = np.flatnonzero(model.geom_contype | model.geom_conaffinity)
    owners = {model.body(model.geom_bodyid[i]).name for i in touching}
    assert owners == {"skids", *SAFETY_BARS}
    assert not np.any(model.geom_contype)  # two geoms of the vehicle can never meet
    assert np.all(model.geom_group[touching] == 3)


@pytest.mark.parametrize("file", [VEHICLE, SCENE], ids=lambda path: path.stem)
def test_compiles_silently(file, tmp_path):
    code = "import sys, mujoco; mujoco.MjModel.from_xml_path(sys.argv[1])"
    command = [sys.executable, "-W", "always::UserWarning", "-c", code, str(file)]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("file", [VEHICLE, SCENE], ids=lambda path: path.stem)
@pytest.mark.parametrize("start", ["hover", None], ids=["hover", "ground"])
def test_runs_under_random_control_without_a_warning(file, start):
    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)
    if start:
        mujoco.mj_resetDataKeyframe(model, data, model.key(start).id)
    random = np.random.default_rng(7)
    low, high = model.actuator_ctrlrange.T
    while data.time < 2.0:
        data.ctrl[:] = random.uniform(low, high)
        mujoco.mj_step(model, data)
    assert not [one for one in data.warning if one.number]
    assert np.all(np.isfinite(data.qpos))


@pytest.mark.parametrize("name", vehicle_names())
def test_a_copied_folder_has_its_scene(name, tmp_path):
    copied = shutil.copytree(models_folder() / name, tmp_path / "elsewhere")
    model = mujoco.MjModel.from_xml_path(str(copied / "scene.xml"))
    assert model.geom("ground").type == mujoco.mjtGeom.mjGEOM_PLANE


def test_every_vehicle_has_the_same_scenery():
    texts = {(models_folder() / name / "scenery.xml").read_bytes() for name in vehicle_names()}
    assert len(texts) == 1


INTEGRATORS = {"RK4": mujoco.mjtIntegrator.mjINT_RK4, "Euler": mujoco.mjtIntegrator.mjINT_EULER}
HOVER = 1e-7
"""m in 10 s: the keyframe's ten digits are 1e-10 rad, times half of g and 100 s^2."""


def shipped(name, file="scene"):
    path = model_folder(name) / f"{name if file == 'alone' else file}.xml"
    return mujoco.MjModel.from_xml_path(str(path))


def farthest(model, data, seconds=10.0):
    free = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
    rows = (model.jnt_qposadr[free][:, None] + np.arange(3)).ravel()
    start, far = data.qpos[rows].copy(), 0.0
    with hs.installed():
        while data.time < seconds:
            mujoco.mj_step(model, data)
            far = max(far, np.abs(data.qpos[rows] - start).max())
    return far


@tabled("file", "integrator")
@pytest.mark.parametrize("name", vehicle_names())
def test_hover_from_the_keyframe(name, file, integrator):
    model = shipped(name, file)
    model.opt.integrator = INTEGRATORS[integrator]
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("hover").id)
    assert farthest(model, data) < HOVER


@pytest.mark.parametrize("name", vehicle_names())
def test_the_numbers_are_what_the_parameters_give(name):
    assert [change.element.place for change in unwritten(name)] == []


def attached(*vehicles):
    world = mujoco.MjSpec()
    for k, name in enumerate(vehicles):
        child = mujoco.MjSpec.from_file(str(model_folder(name) / f"{name}.xml"))
        for option in ("integrator", "timestep", "cone", "impratio", "gravity"):
            setattr(world.option, option, getattr(child.option, option))
        world.attach(child, prefix=f"{k}/", frame=world.worldbody.add_frame())
    model = world.compile()
    data = mujoco.MjData(model)
    for k in range(len(vehicles)):  # each keyframe leaves the other vehicles where they start
        key = model.key(f"{k}/hover")
        data.qpos += key.qpos - model.qpos0
        data.act += key.act
        data.ctrl += key.ctrl
        data.qpos[7 * k + 1] += 5.0 * k
    return model, data


@pytest.mark.parametrize("name", vehicle_names())
def test_one_attached_hovers(name, recwarn):
    model, data = attached(name)
    assert hs.check_model(model) == (f"0/{name}",)
    assert farthest(model, data) < HOVER
    # the options are the world's own, which attach says; it doesn't mind the number of numbers
    assert not [one for one in recwarn if "nuser_actuator" in str(one.message)]


# What of the vehicles is only to be seen: it weighs nothing, touches nothing, and is true.

DRAWN = 2  # the geom group
MASSIVE = {"boom", "mast", "swashplate", "hub_block", "tail_case", "flight_computer"}
MASSIVE |= {"skid_left", "skid_right"}
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
    copy = tmp_path_factory.mktemp("models") / "models"
    shutil.copytree(models_folder(), copy, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.rmtree(copy / name / "assets")
    build(copy / name, "meshes")
    return copy / name


def build(folder: Path, job: str) -> str:
    command = [sys.executable, folder / "build.py", job]
    return subprocess.check_output(command, text=True, timeout=300)


def test_only_the_named_parts_have_a_mass(name, folder):
    spec = mujoco.MjSpec.from_file(str(folder / f"{name}.xml"))
    assert {geom.name for geom in spec.geoms if geom.mass != 0.0} == MASSIVE | MORE[name]
    assert all(geom.mass >= 0.0 for geom in spec.geoms)  # NaN would be: of its volume


def test_what_is_drawn_touches_nothing(scene):
    touching = (scene.geom_contype | scene.geom_conaffinity) != 0
    assert not np.any(touching & (scene.geom_group == DRAWN))
    assert scene.geom_contype[scene.geom("ground").id] == 1


@pytest.mark.slow
def test_meshes_are_what_build_makes(folder, rebuilt):
    stored, made = (
        {path.name: path for path in (place / "assets").glob("*.obj")}
        for place in (folder, rebuilt)
    )
    assert set(stored) == set(made)
    assert len(made) > 10
    for name, path in made.items():
        mine, theirs = (
            [line.split()[1:] for line in file.read_text().splitlines() if line.startswith("v ")]
            for file in (path, stored[name])
        )
        mine, theirs = np.array(mine, dtype=float), np.array(theirs, dtype=float)
        # written to 10 micrometres: another machine's rounding may change the last digit
        np.testing.assert_allclose(mine, theirs, atol=2e-5, rtol=0, err_msg=name)


@pytest.mark.slow
def test_the_readme_has_the_parts_that_build_prints(folder):
    printed = build(folder, "parts")
    assert "total" in printed
    assert printed in (folder / "README.md").read_text()
