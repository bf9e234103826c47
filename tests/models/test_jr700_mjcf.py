"""The JR700's MJCF: what it weighs, what it is called, and that stock MuJoCo runs it."""

import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

FOLDER = Path(__file__).parents[2] / "models" / "jr700"
VEHICLE = FOLDER / "jr700.xml"
SCENE = FOLDER / "scene.xml"

SAFETY_BARS = ["safety_bar_1", "safety_bar_2"]


@pytest.fixture(scope="module")
def model():
    return mujoco.MjModel.from_xml_path(str(VEHICLE))


def warnings_of(data):
    return {str(mujoco.mjtWarning(i)): w.number for i, w in enumerate(data.warning) if w.number}


def test_only_skids_and_bars_collide_and_never_with_the_vehicle(model):
    """In the air a step pays for no contact."""
    touching = np.flatnonzero(model.geom_contype | model.geom_conaffinity)
    owners = {model.body(model.geom_bodyid[i]).name for i in touching}
    assert owners == {"skids", *SAFETY_BARS}
    assert not np.any(model.geom_contype)  # two geoms of the vehicle can never meet
    assert np.all(model.geom_group[touching] == 3)


@pytest.mark.parametrize("file", [VEHICLE, SCENE], ids=lambda path: path.stem)
def test_compiles_silently(file, tmp_path):
    """Loading prints nothing, and leaves no MuJoCo log behind."""
    code = "import sys, mujoco; mujoco.MjModel.from_xml_path(sys.argv[1])"
    run = subprocess.run(
        [sys.executable, "-W", "always::UserWarning", "-c", code, str(file)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("file", [VEHICLE, SCENE], ids=lambda path: path.stem)
@pytest.mark.parametrize("start", ["hover", None], ids=["hover", "ground"])
def test_runs_under_random_control_without_a_warning(file, start):
    """Two seconds of pseudo-random control without callbacks raise no warning."""
    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)
    if start:
        mujoco.mj_resetDataKeyframe(model, data, model.key(start).id)
    random = np.random.default_rng(7)
    low, high = model.actuator_ctrlrange.T
    while data.time < 2.0:
        data.ctrl[:] = random.uniform(low, high)
        mujoco.mj_step(model, data)
    assert warnings_of(data) == {}
    assert np.all(np.isfinite(data.qpos))
