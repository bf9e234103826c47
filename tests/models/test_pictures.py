"""The vehicles as stock MuJoCo draws them."""

from pathlib import Path

import numpy as np
import pytest

from off_screen import draws
from tabled import section

MODELS = Path(__file__).parents[2] / "models"
RENDER = section(globals(), "RENDER")


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
