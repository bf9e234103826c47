"""The JR700 as stock MuJoCo draws it."""

import os
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

SCENE = Path(__file__).parents[2] / "models" / "jr700" / "scene.xml"

RENDER = """
import sys
import mujoco
import numpy as np
scene, out = sys.argv[1:]
model = mujoco.MjModel.from_xml_path(scene)
data = mujoco.MjData(model)
mujoco.mj_resetDataKeyframe(model, data, model.key("hover").id)
mujoco.mj_forward(model, data)
try:
    renderer = mujoco.Renderer(model, 240, 320)
except Exception as error:
    print(f"{type(error).__name__}: {error}")
    sys.exit(77)
shots = {}
discs = [model.geom("rotor_disc").id, model.geom("tail_rotor_disc").id]
materials, colours = model.geom_matid.copy(), model.geom_rgba.copy()
for camera in ("chase", "side", "top"):
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


@pytest.fixture(scope="module")
def shots(tmp_path_factory):
    """What each camera sees, from a process of its own: MuJoCo reads MUJOCO_GL only once."""
    out = tmp_path_factory.mktemp("render") / "shots.npz"
    reasons = []
    for backend in dict.fromkeys([os.environ.get("MUJOCO_GL") or "egl", "egl", "osmesa"]):
        environment = {**os.environ, "MUJOCO_GL": backend}
        run = subprocess.run(
            [sys.executable, "-c", RENDER, str(SCENE), str(out)],
            env=environment,
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
        if run.returncode == 0:
            return np.load(out)
        # A missing GL library ends the import of mujoco, a missing device only the renderer.
        missing = run.returncode == 77 or "gl_context.py" in run.stderr
        assert missing, run.stderr
        reasons.append(f"{backend}: {(run.stdout + run.stderr).strip().splitlines()[-1]}")
    pytest.skip(f"no off-screen GL (install libegl1 libgl1, or libosmesa6): {'; '.join(reasons)}")


@pytest.mark.parametrize("camera", ["chase", "side", "top"])
def test_cameras_show_the_vehicle(shots, camera):
    """Each camera has the vehicle in its middle, and its main parts in view."""
    picture, geoms = shots[camera], shots[camera + "_geoms"]
    assert picture.std() > 10  # a blank picture has 0
    scene = mujoco.MjModel.from_xml_path(str(SCENE))
    root = scene.body("jr700").id
    own = np.array([scene.body_rootid[scene.geom_bodyid[g]] == root for g in range(scene.ngeom)])
    vehicle = (geoms >= 0) & own[np.clip(geoms, 0, None)]
    # Discs left out, the vehicle is thin: 1 % of a view is a tenth of its width and height.
    assert vehicle.mean() > 0.01
    border = np.concatenate([vehicle[0], vehicle[-1], vehicle[:, 0], vehicle[:, -1]])
    assert not border.any()  # wholly in view
    seen = {scene.body(scene.geom_bodyid[g]).name for g in np.unique(geoms[vehicle])}
    assert {"rotor", "boom", "fuselage", "tail", "safety_bar_1", "safety_bar_2"} <= seen
    assert not shots["warnings"].any()
