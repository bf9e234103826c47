"""Roles: which element of an MJCF is what, where its author gave it a name of his own.

What nothing else refers to by name (actuators, sensors, keyframes) gets the canonical name when
the vehicle is assembled; bodies, sites and geoms keep their names and are looked up here.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import mujoco

from helisim.base.errors import ModelError, UnknownNameError
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

    Attributes:
        names: kind -> role -> name in the MJCF.
        mjcf: file of the vehicle alone; None is found by the folder's name.
        scene: file of the vehicle in its scene; None is scene.xml, if it is there.
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
