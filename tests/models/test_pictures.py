"""The vehicles as stock MuJoCo draws them."""

from pathlib import Path

import numpy as np
import pytest

from off_screen import draws

MODELS = Path(__file__).parents[2] / "models"
RENDER = """
import sys
import mujoco
import numpy as np
scene, out = sys.argv[1:]
model = mujoco.MjModel.from_xml_path(scene)
data = mujoco.MjData(model)
mujoco.mj_resetDataKeyframe(model, data, model.key("hover").id)
mujoco.mj_forward(model, data)
renderer, shots = mujoco.Renderer(model, 240, 320), {}
for camera in ("chase", "top"):
    renderer.update_scene(data, camera)
    shots[camera] = renderer.render().copy()
hidden = model.geom_bodyid > 0  # all but the ground
model.geom_rgba[hidden, 3], model.geom_matid[hidden] = 0.0, -1
for camera in ("chase", "top"):
    renderer.update_scene(data, camera)
    shots[camera + "_empty"] = renderer.render().copy()
np.savez(out, **shots)
"""


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", ["jr700", "blade360", "lynx"])
def test_cameras_show_the_whole_vehicle(vehicle, tmp_path):
    draws(RENDER, str(MODELS / vehicle / "scene.xml"), str(tmp_path / "shots.npz"))
    shots = np.load(tmp_path / "shots.npz")
    for camera in ("chase", "top"):
        picture, empty = (shots[name].astype(float) for name in (camera, camera + "_empty"))
        assert picture.std() > 10  # a blank picture has 0
        # the rotor's disc, seen at an angle over half of the height, has a tenth of the picture
        assert np.mean(np.abs(picture - empty).max(axis=2) > 20.0) > 0.08
