"""Write into a vehicle's MJCF the numbers that its force laws need, so that stock MuJoCo flies it.

The numbers are the parameters', calibrated and tuned. They stand in the MJCF where MuJoCo has a
place for them: the force laws' in the `user` numbers of the actuators, the gyro's timing in delays
and intervals, the moments of inertia in the fuselage, the trim in the keyframe `hover`. Nothing
else of the file is touched.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import ModelError
from helisim.base.files import atomic_write
from helisim.physics.layout import ACTUATORS, PARAM, ROTOR
from helisim.physics.native import check_model
from helisim.vehicle.assembly import specified
from helisim.vehicle.folder import mjcf_file, model_folder, read_roles
from helisim.vehicle.load import load
from helisim.vehicle.mjcf import Element, Mjcf
from helisim.vehicle.roles import Roles
from helisim.vehicle.vehicle import Vehicle

Numbers = Sequence[float] | NDArray[np.float64]

_BLOCK = """Written by `helisim vehicle build` from parameters.toml, calibrated.toml and tuned.toml:
     what the force laws read, SI, a name here for each number below. Don't change them here."""
_WIDTH = 100
"""Columns of a line of numbers or names."""
_IN_LINE = 6
_PART = 3
"""Of the force laws' numbers: so many in a line, and so many of a part begin one."""
_ROUNDING = 1e-14
"""By which a number may differ and stand, relative: another processor's cosine or square root."""
_DECIMALS = 10
"""Of the trim, whose solver leaves 1e-13 rad: the gyro holds it."""


@dataclass(frozen=True, eq=False)
class Change:
    """What an element of the MJCF should say.

    Attributes:
        element: of the MJCF as it is.
        numbers: by attribute; none takes the attribute away.
        lines: of an attribute that is written in several, how many numbers stand in each.
        comment: straight before the element, None for none.
        solved: to how much the numbers are known, where a solver found them.
    """

    element: Element
    numbers: Mapping[str, Numbers]
    lines: Mapping[str, Sequence[int]] = field(default_factory=dict)
    comment: str | None = None
    solved: float = 0.0

    @property
    def stands(self) -> bool:
        """Whether the element says so already."""
        for name, numbers in self.numbers.items():
            found = _numbers(self.element.attributes.get(name, ""))
            if len(found) != len(numbers):
                return False
            if not np.allclose(found, numbers, rtol=_ROUNDING, atol=self.solved):
                return False
        return True

    @property
    def attributes(self) -> dict[str, str | None]:
        """The text of each attribute."""
        return {
            name: _text(numbers, self.lines.get(name)) if len(numbers) else None
            for name, numbers in self.numbers.items()
        }


def write_numbers(vehicle: str | PathLike[str]) -> tuple[Path, ...]:
    """Write a vehicle's numbers into its MJCF, and return the files that changed.

    Args:
        vehicle: name of a shipped one, or path of a folder; calibrated, and tuned or not.

    Raises:
        UnknownNameError: no such vehicle.
        ModelError: parameters or MJCF are not a vehicle's; the message names file and line.
        TrimError: it can't hover.
        CallbackError: written, it would not fly; the files are as they were.
        StorageError: a file can't be written.
    """
    mjcf = Mjcf(_file(vehicle))
    before = mjcf.texts
    for change in unwritten(vehicle):
        # each change moves what stands behind it
        element = next(one for one in mjcf if _same(one, change.element))
        mjcf.set(element, change.attributes, comment=change.comment)
    written = mjcf.write()
    try:
        check_model(mujoco.MjModel.from_xml_path(str(mjcf.path)))
    except BaseException:
        for path in written:
            with atomic_write(path) as temporary:
                temporary.write_bytes(before[path])
        raise
    return written


def unwritten(vehicle: str | PathLike[str]) -> tuple[Change, ...]:
    """Return what in a vehicle's MJCF is not what its parameters say, in the file's order.

    Args:
        vehicle: name of a shipped one, or path of a folder.

    Raises:
        UnknownNameError: no such vehicle.
        ModelError: parameters or MJCF are not a vehicle's.
        TrimError: it can't hover.
    """
    loaded = load(vehicle, tuned=False)
    mjcf = Mjcf(_file(vehicle))
    wanted = list(_changes(mjcf, loaded))
    order = list(mjcf)
    wanted.sort(key=lambda change: order.index(change.element))
    return tuple(change for change in wanted if not change.stands)


def _file(vehicle: str | PathLike[str]) -> Path:
    folder = model_folder(vehicle)
    return mjcf_file(folder, read_roles(folder))


def _same(one: Element, other: Element) -> bool:
    places = [(e.file, e.tag, e.name, e.parent.name if e.parent else "") for e in (one, other)]
    return places[0] == places[1]


def _changes(mjcf: Mjcf, vehicle: Vehicle) -> Iterator[Change]:
    spec, roles = specified(vehicle.folder, vehicle.parameters), vehicle.roles
    for ordinal, role in enumerate(ACTUATORS):
        actuator, element = spec.actuator(role), _found(mjcf, roles, "actuator", role)
        user = np.asarray(actuator.userdata)
        if ordinal == ROTOR:
            lines = list(_lines())
            names = (" ".join(line) for line in lines)
            comment = "\n".join([_BLOCK, *(f"     {line}" for line in names)])
            yield Change(element, {"user": user}, {"user": [len(line) for line in lines]}, comment)
        else:
            yield Change(element, {"user": user[: PARAM.ordinal + 1]})
    pedal = spec.actuator("PED")
    delayed = [[pedal.delay], [pedal.nsample]] if pedal.nsample else [[], []]
    yield Change(_found(mjcf, roles, "actuator", "PED"), dict(zip(("delay", "nsample"), delayed)))
    seen = spec.sensor("gyro_rate")
    numbers = {
        "interval": np.asarray(seen.interval),
        "delay": [seen.delay] if seen.delay else [],
        "nsample": [seen.nsample],
    }
    yield Change(_found(mjcf, roles, "sensor", "gyro_rate"), numbers)
    inertia = np.asarray(spec.body(roles.body("fuselage")).fullinertia)
    yield Change(_inertial(mjcf, roles), {"fullinertia": inertia})
    yield _hover(mjcf, roles, vehicle)


def _hover(mjcf: Mjcf, roles: Roles, vehicle: Vehicle) -> Change:
    data = vehicle.hovering()
    moving = data.qvel if np.any(data.qvel) else []
    numbers = {"qpos": data.qpos, "qvel": moving, "ctrl": data.ctrl, "act": data.act}
    element = _found(mjcf, roles, "keyframe", "hover")
    rounded = {name: np.round(kept, _DECIMALS) for name, kept in numbers.items()}
    return Change(element, rounded, solved=10.0 * 10.0**-_DECIMALS)


def _found(mjcf: Mjcf, roles: Roles, section: str, role: str) -> Element:
    name = roles.name(section, role)
    element = mjcf.find(section, name)
    if element is None:
        example = {"keyframe": f': add <keyframe><key name="{name}"/></keyframe>'}
        raise ModelError(f"{mjcf.path}: no {section} {name!r}{example.get(section, '')}")
    return element


def _inertial(mjcf: Mjcf, roles: Roles) -> Element:
    """Return the element with the fuselage's moments of inertia."""
    name = roles.body("fuselage")
    body = mjcf.find("worldbody", name, tag="body")
    if body is None:
        raise ModelError(f"{mjcf.path}: no body {name!r}")
    for element in mjcf.children(body):
        if element.tag == "inertial" and "fullinertia" in element.attributes:
            return element
    raise ModelError(
        f'{body.place}: needs <inertial pos=".." mass=".." fullinertia=".."/>, whose moments of '
        "inertia are written by `helisim vehicle build`"
    )


def _lines() -> Iterator[tuple[str, ...]]:
    """Yield the names of the force laws' numbers, line by line; a larger part begins a line."""
    parts = [name.split("_")[0] for name in PARAM._fields]
    line: list[str] = []
    for k, name in enumerate(PARAM._fields):
        begins = parts[k : k + _PART] == [parts[k]] * _PART and parts[k - 1] != parts[k]
        if line and (begins or len(line) == _IN_LINE or len(" ".join([*line, name])) > _WIDTH):
            yield tuple(line)
            line = []
        line.append(name)
    yield tuple(line)


def _text(numbers: Numbers, lines: Sequence[int] | None) -> str:
    """Return numbers with all their digits, wrapped where they are many."""
    words = [_word(float(number)) for number in numbers]
    if lines is None:
        if len(" ".join(words)) <= _WIDTH:
            return " ".join(words)
        lines = list(_wrapped(words))
    rows, start = [], 0
    for count in lines:
        rows.append(" ".join(words[start : start + count]))
        start += count
    return "".join(f"\n      {row}" for row in rows)


def _wrapped(words: Sequence[str]) -> Iterator[int]:
    """Yield how many words there are in each line."""
    count = length = 0
    for word in words:
        if count and length + 1 + len(word) > _WIDTH:
            yield count
            count = length = 0
        count, length = count + 1, length + 1 + len(word)
    yield count


def _word(number: float) -> str:
    whole = number == int(number) if abs(number) < 1e15 else False
    return str(int(number)) if whole else repr(number)


def _numbers(text: str) -> list[float]:
    try:
        return [float(word) for word in text.split()]
    except ValueError:
        return []
