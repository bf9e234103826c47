"""Rebuild what in a vehicle's folder is computed, and print what it adds up to.

Run it as `python models/VEHICLE/build.py` with one of

- `parts`: print mass, position and inertia part by part, and the totals;
- `close`: rewrite the fuselage's inertial element in the vehicle's MJCF, so that the totals are
  those of parameters.toml and calibrated.toml;
- `meshes`: write the drawn shapes to assets/;
- `picture`: render the vehicle over its pad (headless: MUJOCO_GL=egl or osmesa).
"""

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
from balance import Balance
from shapes import Shape


class View(NamedTuple):
    """Where a picture is taken from: MuJoCo's free camera, lookat from the vehicle's frame."""

    lookat: tuple[float, float, float]
    distance: float
    azimuth: float
    elevation: float
    height: float
    """m of the vehicle's frame above the pad."""


def build(
    folder: Path, *, total_mass_kg: float, shapes: Callable[[], Mapping[str, Shape]], view: View
) -> None:
    """Do what the command line asks for.

    Args:
        folder: of the vehicle, whose MJCF and parameters bear its name.
        total_mass_kg: that the parts must add up to.
        shapes: makes every mesh of the MJCF, by name.
        view: of the README's picture.
    """
    balance = Balance(folder, total_mass_kg=total_mass_kg)
    jobs = {
        "parts": balance.print_parts,
        "close": balance.close,
        "meshes": lambda: write_meshes(folder / "assets", shapes()),
        "picture": lambda: write_picture(folder, view),
    }
    if len(sys.argv) != 2 or sys.argv[1] not in jobs:
        sys.exit(__doc__)
    jobs[sys.argv[1]]()


def write_meshes(assets: Path, shapes: Mapping[str, Shape]) -> None:
    """Write every mesh of a vehicle, and remove those that are no longer made."""
    assets.mkdir(exist_ok=True)
    for old in set(assets.glob("*.obj")) - {assets / f"{name}.obj" for name in shapes}:
        old.unlink()
    for name, shape in shapes.items():
        shape.write(assets / f"{name}.obj")


def write_picture(folder: Path, view: View) -> None:
    """Render the picture beside the README."""
    import matplotlib.image

    model = mujoco.MjModel.from_xml_path(str(folder / "scene.xml"))
    matplotlib.image.imsave(folder / f"{folder.name}.png", render(model, view))


def render(model: mujoco.MjModel, view: View, size: tuple[int, int] = (900, 1600)) -> np.ndarray:
    """One picture of the vehicle hovering low, (height, width, 3) bytes."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("hover").id)
    data.qpos[2] = view.height
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.lookat[:] = np.add(view.lookat, data.qpos[:3])
    camera.distance, camera.azimuth, camera.elevation = view.distance, view.azimuth, view.elevation
    with mujoco.Renderer(model, *size) as renderer:
        renderer.update_scene(data, camera)
        return renderer.render()
