"""What of the vehicles is only to be seen: it weighs nothing, touches nothing, and is true."""

import shutil
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

from helisim.vehicle.parameters import models_folder

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
    """A copy of the models, whose meshes build.py has made again."""
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
    """Nobody edited a mesh, and none is left over."""
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
