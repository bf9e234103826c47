"""A vehicle's folder is whole: it can be copied, and what every vehicle has is the same in all."""

import shutil

import mujoco
import pytest

from helisim.vehicle.parameters import models_folder, vehicle_names


@pytest.mark.parametrize("name", vehicle_names())
def test_a_copied_folder_has_its_scene(name, tmp_path):
    """Ground, sky and meshes come with it; nothing is read from beside the folder."""
    copied = shutil.copytree(models_folder() / name, tmp_path / "elsewhere")
    model = mujoco.MjModel.from_xml_path(str(copied / "scene.xml"))
    assert model.geom("ground").type == mujoco.mjtGeom.mjGEOM_PLANE


def test_every_vehicle_has_the_same_scenery():
    """The copies don't drift apart."""
    texts = {(models_folder() / name / "scenery.xml").read_bytes() for name in vehicle_names()}
    assert len(texts) == 1
