"""The vehicles as stock MuJoCo draws them."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from off_screen import draws

pytestmark = pytest.mark.slow
MODELS = Path(__file__).parents[2] / "models"
PARTS = {"rotor", "head", "boom", "fuselage", "tail", "tail_rotor", "skids"}
SEEN = {"jr700": PARTS | {"safety_bar_1", "safety_bar_2"}, "blade360": PARTS}

RENDER = """
import sys
import mujoco
import numpy as np
scene, out = sys.argv[1:]
model = mujoco.MjModel.from_xml_path(scene)
data = mujoco.MjData(model)
mujoco.mj_resetDataKeyframe(model, data, model.key("hover").id)
mujoco.mj_forward(model, data)
renderer = mujoco.Renderer(model, 240, 320)
shots = {}
discs = [model.geom("rotor_disc").id, model.geom("tail_rotor_disc").id]
materials, colours = model.geom_matid.copy(), model.geom_rgba.copy()
for camera in ("chase", "top"):
    renderer.update_scene(data, camera)
    shots[camera] = renderer.render().copy()
    # Segmentation knows no translucency: without the discs, what lies behind them counts as seen.
    model.geom_matid[discs], model.geom_rgba[discs, 3] = -1, 0
    renderer.enable_segmentation_rendering()
    renderer.update_scene(data, camera)
    shots[camera + "_geoms"] = renderer.render()[..., 0].copy()
    renderer.disable_segmentation_rendering()
    model.geom_matid[:], model.geom_rgba[:] = materials, colours
shots["warnings"] = np.array([w.number for w in data.warning])
np.savez(out, **shots)
"""


@pytest.fixture(scope="module", params=["jr700", "blade360"])
def vehicle(request):
    return request.param


@pytest.fixture(scope="module")
def shots(vehicle, tmp_path_factory):
    out = tmp_path_factory.mktemp("render") / "shots.npz"
    draws(RENDER, str(MODELS / vehicle / "scene.xml"), str(out))
    return np.load(out)


@pytest.mark.parametrize("camera", ["chase", "top"])
def test_cameras_show_the_vehicle(shots, vehicle, camera):
    picture, geoms = shots[camera], shots[camera + "_geoms"]
    assert picture.std() > 10  # a blank picture has 0
    scene = mujoco.MjModel.from_xml_path(str(MODELS / vehicle / "scene.xml"))
    root = scene.body(vehicle).id
    own = np.array([scene.body_rootid[scene.geom_bodyid[g]] == root for g in range(scene.ngeom)])
    drawn = (geoms >= 0) & own[np.clip(geoms, 0, None)]
    # Discs left out, the vehicle is thin: 1 % of a view is a tenth of its width and height.
    assert drawn.mean() > 0.01
    border = np.concatenate([drawn[0], drawn[-1], drawn[:, 0], drawn[:, -1]])
    assert not border.any()  # wholly in view
    seen = {scene.body(scene.geom_bodyid[g]).name for g in np.unique(geoms[drawn])}
    hidden = {"tail_rotor"} if camera == "top" else set()  # edge on, thinner than a pixel
    assert SEEN[vehicle] - hidden <= seen
    assert not shots["warnings"].any()
