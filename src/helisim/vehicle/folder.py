"""The folder of a vehicle, with its parameters and its MJCF, shipped or anyone's own.

Roles say which element of its MJCF is what, where its author gave it a name of his own. What
nothing else refers to by name (actuators, sensors, keyframes) gets the canonical name when the
vehicle is assembled; bodies, sites and geoms keep their names and are looked up here.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco

from helisim.base.errors import ModelError, StorageError, UnknownNameError
from helisim.base.files import read_toml
from helisim.physics.layout import ACTUATORS, SENSORS

ROLES: dict[str, tuple[str, ...]] = {
    "body": ("fuselage", "rotor", "tail_rotor"),
    "site": ("imu", "hub", "tail_hub"),
    "geom": ("rotor_disc",),
    "actuator": ACTUATORS,
    "sensor": tuple(SENSORS),
    "keyframe": ("hover",),
}
"""Kind of element -> the roles that there are, which are the canonical names too."""

_FILES = ("mjcf", "scene")
_RENAMED = ("actuator", "sensor", "keyframe")


@dataclass(frozen=True)
class Roles:
    """Names in a vehicle's MJCF by kind and role; a role that isn't there has the canonical name.

    names: kind -> role -> name in the MJCF; mjcf: file of the vehicle alone; None is found by the
    folder's name; scene: file of the vehicle in its scene; None is scene.xml, if it is there.
    """

    names: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    mjcf: str | None = None
    scene: str | None = None

    @classmethod
    def of(cls, table: object) -> "Roles":
        """Return the roles of a table `[roles]`.

        Raises:
            ModelError: an unknown role, or a name that can't be one.
        """
        if not isinstance(table, Mapping):
            raise ModelError("[roles] must be a table, such as [roles.site]")
        for key, item in table.items():
            if key in _FILES:
                _check_name(f"roles.{key}", item)
            elif key not in ROLES:
                kinds = [kind for kind, roles in ROLES.items() if key in roles]
                advice = " or ".join(f"did you mean [roles.{kind}] {key}?" for kind in kinds)
                known = (*_FILES, *ROLES)
                raise ModelError(f"{UnknownNameError('kind of role', key, known, advice=advice)}")
            else:
                _check_kind(key, item)
        names = {kind: dict(table[kind]) for kind in ROLES if kind in table}
        return cls(names, table.get("mjcf"), table.get("scene"))

    def name(self, kind: str, role: str) -> str:
        """Return the name of an element, such as of ("site", "imu"), in the MJCF."""
        return self.names.get(kind, {}).get(role, role)

    def body(self, role: str) -> str:
        """Return the name of a body in the MJCF."""
        return self.name("body", role)

    def site(self, role: str) -> str:
        """Return the name of a site in the MJCF."""
        return self.name("site", role)

    def geom(self, role: str) -> str:
        """Return the name of a geom in the MJCF."""
        return self.name("geom", role)

    def rename(self, spec: mujoco.MjSpec) -> None:
        """Give actuators, sensors and keyframes of a vehicle their canonical names.

        Raises:
            ModelError: an element that a role names isn't there.
        """
        for kind in _RENAMED:
            items = list(getattr(spec, {"keyframe": "keys"}.get(kind, f"{kind}s")))
            renamed = _rename(kind, items, self.names.get(kind, {}))
            if kind == "actuator":
                _follow(spec, renamed)


def _check_kind(kind: str, table: Any) -> None:
    if not isinstance(table, Mapping):
        raise ModelError(f"[roles.{kind}] must be a table of roles and names, got {table!r}")
    for role, name in table.items():
        if role not in ROLES[kind]:
            raise ModelError(f"{UnknownNameError(f'role of a {kind}', role, ROLES[kind])}")
        _check_name(f"roles.{kind}.{role}", name)
    taken = {role: table.get(role, role) for role in ROLES[kind]}
    for role, name in table.items():
        others = [other for other in taken if taken[other] == name and other != role]
        if others:
            raise ModelError(f"[roles.{kind}] {role} and {others[0]} are both {name!r}")


def _check_name(key: str, name: object) -> None:
    if not isinstance(name, str) or not name:
        raise ModelError(f"{key} must be a name in quotes, got {name!r}")


def _rename(kind: str, items: list[Any], names: Mapping[str, str]) -> dict[str, str]:
    """Rename elements of one kind; return old names -> new ones."""
    present = {item.name: item for item in items}
    for role, name in names.items():
        if name not in present:
            unknown = UnknownNameError(kind, name, filter(None, present))
            raise ModelError(f"[roles.{kind}] {role} = {name!r}: {unknown}")
    new = {name: role for role, name in names.items()}
    new |= {role: f"{role} (other)" for role in names if role in present and role not in new}
    for name in new:  # first out of each other's way
        present[name].name = f"{name} (renamed)"
    for name, role in new.items():
        present[name].name = role
    return new


def _follow(spec: mujoco.MjSpec, renamed: Mapping[str, str]) -> None:
    """Let sensors of actuators name them anew."""
    for sensor in spec.sensors:
        if sensor.objtype == mujoco.mjtObj.mjOBJ_ACTUATOR:
            sensor.objname = renamed.get(sensor.objname, sensor.objname)


PARAMETER_FILES = ("parameters.toml", "calibrated.toml", "tuned.toml")
"""Given and chosen; solved by `helisim calibrate`; solved by `helisim tune`."""

_SCENE = "scene.xml"
_NEEDED = (
    "a vehicle of one's own is a folder with parameters.toml, calibrated.toml, tuned.toml and its "
    "MJCF, which `helisim vehicle new NAME` makes"
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
