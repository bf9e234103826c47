"""A vehicle's MJCF, element by element: what is missing, misspelt, out of order or place."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from helisim.base.errors import ModelError, StorageError, similar
from helisim.physics.layout import ACTUATORS, SENSORS
from helisim.study.check.problem import Problem
from helisim.vehicle.build import Element, Mjcf
from helisim.vehicle.folder import ROLES, Roles

_TAGS = {
    "imu_gyro": "gyro",
    "imu_accelerometer": "accelerometer",
    "imu_velocity": "velocimeter",
    "imu_attitude": "framequat",
    "imu_position": "framepos",
    "gyro_rate": "gyro",
    "clock": "clock",
}
"""Sensor -> its kind; the others are user sensors."""

_LOOKED_UP = ("body", "site")
_ORDERED = {"actuator": ACTUATORS, "sensor": tuple(SENSORS)}


def element_problems(path: Path, roles: Roles) -> list[Problem]:
    """Return what is wrong with the elements of an MJCF.

    Args:
        path: of the vehicle's MJCF.
        roles: the names that its author gave.
    """
    try:
        mjcf = Mjcf(path)
    except (ModelError, StorageError) as error:
        return [Problem.of(str(error), path)]
    problems = []
    for kind, known in _ORDERED.items():
        there = [one for one in mjcf if one.section == kind and one.tag != kind and one.name]
        lacking = list(_missing(kind, known, there, roles, path))
        problems += lacking or list(_out_of_order(kind, known, there, roles))
    for kind in _LOOKED_UP:
        there = [one for one in mjcf if one.section == "worldbody" and one.tag == kind and one.name]
        problems += _missing(kind, ROLES[kind], there, roles, path)
    problems += _wrong_sensors(mjcf, roles)
    problems += _wrong_fuselage(mjcf, roles)
    return problems


def _missing(
    kind: str, known: Sequence[str], there: Sequence[Element], roles: Roles, path: Path
) -> Iterator[Problem]:
    """Yield the roles that no element has."""
    names = {one.name: one for one in there}
    wanted = {role: roles.name(kind, role) for role in known}
    free = [name for name in names if name not in wanted.values()]
    for role, name in wanted.items():
        if name in names:
            continue
        by_role = "" if name == role else f", which [roles.{kind}] says is {role},"
        meant = similar(name, free)
        if not meant:
            text = (
                f"The {kind} {name!r}{by_role} is missing: add it, or name another in "
                f'parameters.toml: [roles.{kind}] {role} = "...".'
            )
            section = next((one for one in there if one.parent is not None), None)
            line = None if section is None or section.parent is None else section.parent.line
            yield Problem(text, path, line)
            continue
        found = names[meant[0]]
        yield Problem(
            f"The {kind} {name!r}{by_role} is missing; this one may be meant: call it {name!r}, or "
            f'say in parameters.toml: [roles.{kind}] {role} = "{found.name}".',
            found.file,
            found.line,
        )


def _out_of_order(
    kind: str, known: Sequence[str], there: Sequence[Element], roles: Roles
) -> Iterator[Problem]:
    """Yield the first element that doesn't stand where the force laws count on it."""
    wanted = [roles.name(kind, role) for role in known]
    names = [one.name for one in there]
    start = min(names.index(name) for name in wanted)
    for number, name in enumerate(wanted):
        found = there[start + number] if start + number < len(there) else there[-1]
        if found.name != name:
            yield Problem(
                f"The {kind}s must stand one after the other in the order {', '.join(wanted)}; "
                f"here is {found.name!r} where {name!r} must be.",
                found.file,
                found.line,
            )
            return


def _wrong_sensors(mjcf: Mjcf, roles: Roles) -> Iterator[Problem]:
    """Yield sensors of another kind, or with another number of values."""
    for role, numbers in SENSORS.items():
        found = mjcf.find("sensor", roles.name("sensor", role))
        if found is None:
            continue
        tag = _TAGS.get(role, "user")
        if found.tag != tag:
            yield Problem(
                f"The sensor {found.name!r} must be a <{tag}>, it is a <{found.tag}>.",
                found.file,
                found.line,
            )
        elif tag == "user" and found.attributes.get("dim") != str(numbers):
            given = found.attributes.get("dim", "none")
            yield Problem(
                f'The sensor {found.name!r} must have dim="{numbers}", it has {given}: with fewer '
                "the force laws would write into the next one.",
                found.file,
                found.line,
            )


def _wrong_fuselage(mjcf: Mjcf, roles: Roles) -> Iterator[Problem]:
    """Yield a fuselage whose inertia can't be closed as it stands."""
    fuselage = mjcf.find("worldbody", roles.body("fuselage"), tag="body")
    if fuselage is None:
        return
    inertial = [one for one in mjcf.children(fuselage) if one.tag == "inertial"]
    if not inertial or "fullinertia" not in inertial[0].attributes:
        place = inertial[0] if inertial else fuselage
        yield Problem(
            f'The fuselage {fuselage.name!r} needs <inertial pos="x y z" mass="kg" '
            'fullinertia="Ixx Iyy Izz Ixy Ixz Iyz"/>: it is given what the other parts lack of the '
            "vehicle's moments of inertia.",
            place.file,
            place.line,
        )
