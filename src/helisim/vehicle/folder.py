"""Where a vehicle is: a folder with its parameters and its MJCF, shipped or anyone's own."""

import os
from pathlib import Path

from helisim.base.errors import ModelError, StorageError, UnknownNameError
from helisim.base.files import read_toml
from helisim.vehicle.roles import Roles

PARAMETER_FILES = ("parameters.toml", "calibrated.toml", "tuned.toml")
"""Given and chosen; solved by `helisim calibrate`; solved by `helisim tune`."""

_SCENE = "scene.xml"
_NEEDED = (
    "a vehicle of one's own is a folder with parameters.toml, calibrated.toml, tuned.toml and its "
    "MJCF, which `helisim vehicle new NAME --like jr700` makes"
)


def models_folder() -> Path:
    """Return the folder of the shipped vehicles: in the package, or beside it in a checkout."""
    package = Path(__file__).resolve().parents[1]
    inside, beside = package / "models", package.parents[1] / "models"
    return inside if inside.is_dir() else beside


def vehicle_names() -> tuple[str, ...]:
    """Return the names of the shipped vehicles."""
    found = (item.name for item in models_folder().iterdir() if _is_vehicle(item))
    return tuple(sorted(found))


def model_folder(vehicle: str | os.PathLike[str], *, beside: Path | None = None) -> Path:
    """Return the folder of a vehicle, with its whole path.

    Args:
        vehicle: a name without a separator that a shipped vehicle has is that one; anything else,
            and any `pathlib.Path`, is the path of a folder.
        beside: folder from which a relative path counts; the present one if None.

    Raises:
        UnknownNameError: it is neither; the message lists the shipped vehicles and says what a
            folder needs.
    """
    if isinstance(vehicle, str) and vehicle in vehicle_names():
        return models_folder() / vehicle
    path, lacking = Path(beside or "") / vehicle, ""
    try:
        if vehicle and _is_vehicle(path):
            return path.resolve()
        if vehicle and path.is_dir():
            lacking = f"the folder {path} has no {PARAMETER_FILES[0]}; "
        elif vehicle and path.is_file():
            lacking = f"{path} is a file; give the folder that it is in; "
    except (OSError, ValueError):
        pass  # a name that no file can have
    raise UnknownNameError("vehicle", str(vehicle), vehicle_names(), advice=lacking + _NEEDED)


def is_shipped(folder: Path) -> bool:
    """Return whether a vehicle's folder is one of helisim's own."""
    return folder.parent == models_folder()


def _is_vehicle(folder: Path) -> bool:
    return (folder / PARAMETER_FILES[0]).is_file()


def read_roles(folder: Path) -> Roles:
    """Return the names that the author of a vehicle's MJCF gave, of `[roles]`.

    Raises:
        ModelError: the file or the table is malformed; the message names the file.
    """
    path = folder / PARAMETER_FILES[0]
    try:
        return Roles.of(read_toml(path).get("roles", {}))
    except StorageError as error:
        raise ModelError(f"can't read parameters: {error}") from None
    except ModelError as error:
        raise ModelError(f"{path}: {error}") from None


def mjcf_file(folder: Path, roles: Roles) -> Path:
    """Return the MJCF of the vehicle alone: as `[roles]` says, or named as its folder is.

    Where there is no file of that name, the only other one beside the scene is taken.

    Raises:
        ModelError: there is none, or several could be meant.
    """
    if roles.mjcf is not None:
        return folder / roles.mjcf
    own = folder / f"{folder.name}.xml"
    if own.is_file():
        return own
    scene = roles.scene or _SCENE
    found = sorted(path for path in folder.glob("*.xml") if path.name != scene)
    found = [path for path in found if path.name != "scenery.xml"]
    if len(found) == 1:
        return found[0]
    listed = ", ".join(path.name for path in found) or "none"
    raise ModelError(
        f"{folder}: which file is the vehicle's MJCF? {own.name} isn't there, and of others there "
        f'are: {listed}; name it in parameters.toml: [roles] mjcf = "FILE"'
    )


def scene_file(folder: Path, roles: Roles) -> Path | None:
    """Return the MJCF of the vehicle in its scene, as `[roles]` says or scene.xml; None without.

    Raises:
        ModelError: `[roles]` names a file that isn't there.
    """
    path = folder / (roles.scene or _SCENE)
    if path.is_file():
        return path
    if roles.scene is not None:
        raise ModelError(f"{folder}: [roles] scene = {roles.scene!r}: no such file")
    return None


def rig_names(vehicle: str | os.PathLike[str]) -> tuple[str, ...]:
    """Return the names of the rigs that can hold a vehicle on the ground."""
    return tuple(sorted(path.stem for path in (model_folder(vehicle) / "rigs").glob("*.xml")))


def rig_file(folder: Path, rig: str) -> Path:
    """Return the MJCF of a rig with the vehicle in it.

    Raises:
        UnknownNameError: no such rig.
    """
    if rig not in rig_names(folder):
        advice = f"a rig is an MJCF in the vehicle's folder {folder.name}/rigs"
        raise UnknownNameError("rig", rig, rig_names(folder), advice=advice)
    return folder / "rigs" / f"{rig}.xml"
