"""Problems of a vehicle's files: parameters, the MJCF's elements, and the rigid body they make."""

import math
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import HelisimError, InputError, ModelError, StorageError, similar
from helisim.base.files import read_text
from helisim.base.note import Command, Option
from helisim.physics.layout import ACTUATORS, ROTOR, ROTOR_STATES, SENSORS
from helisim.physics.memory import TICK_TOLERANCE
from helisim.vehicle.assembly import total_inertia, wanted_inertia
from helisim.vehicle.build import Element, Mjcf
from helisim.vehicle.calibrate import DIRECT, SOLVED, UNKNOWNS, spared
from helisim.vehicle.folder import PARAMETER_FILES, ROLES, Roles
from helisim.vehicle.parameters import (
    Parameters,
    PhysicalParameter,
    Term,
    completed,
    glossary,
    name_fault,
    plain_number,
    sections,
    term,
    unit_fault_of,
)
from helisim.vehicle.rate_command import STARTS
from helisim.vehicle.swashplate import INERTIA, INSTEAD, lock_number, with_both
from helisim.vehicle.trim import root_body

_PLACED = re.compile(r"(?P<file>.+?)(?:, line |:)(?P<line>\d+): (?P<text>.*)", re.S)


@dataclass(frozen=True)
class Problem:
    """What is wrong, where, and what to do, in full sentences.

    Attributes:
        text: what is wrong and what to do; it begins with a capital, if with a word, and ends.
        file: that it is in; None where it is in no one file.
        line: of the file, from 1; None where it is in no one line.
        flies: whether the vehicle can be flown all the same.
        remedy: command that mends it; None where a person must.
    """

    text: str
    file: Path | None = None
    line: int | None = None
    flies: bool = False
    remedy: Command | None = None

    def __post_init__(self) -> None:
        text = self.text
        if re.match(r"[a-z]+(?=[ ,])", text):
            text = text[:1].upper() + text[1:]
        object.__setattr__(self, "text", text if text.endswith((".", "?", "!")) else f"{text}.")

    @classmethod
    def of(cls, message: str, file: Path | None = None) -> "Problem":
        """Return the problem that an error's message tells, with its own file and line if any."""
        text = " ".join(message.split())
        placed = _PLACED.fullmatch(text)
        if placed is not None and Path(placed["file"]).is_file():
            return cls(placed["text"], Path(placed["file"]), int(placed["line"]))
        if file is None:
            return cls(text)
        text = text.removeprefix(f"{file}: ")
        within = re.search(r"\bline (\d+)", text)
        return cls(text, file, int(within[1]) if within else None)

    @classmethod
    def at(cls, text: str, element: Element | None, path: Path | None = None) -> "Problem":
        """Return the problem of an element of an MJCF, or of the file where there is none."""
        return cls(text, path) if element is None else cls(text, element.file, element.line)

    def __str__(self) -> str:
        """Return file, line and text, as compilers do."""
        if self.file is None:
            return self.text
        line = "" if self.line is None else f":{self.line}"
        return f"{_below_here(self.file)}{line}: {self.text}"


def solving(command: str, folder: Path) -> Command:
    """Return the command that solves for parameters of a vehicle and writes them."""
    written = () if command.startswith("vehicle") else (Option("write"),)
    return Command(command, (str(_below_here(folder)),), written)


def _below_here(path: Path) -> Path:
    """Return a path from where one is, if it is below."""
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path


_HEADER = re.compile(r"\s*\[\s*([\w.\-]+)\s*\]")
_KEY = re.compile(r"\s*[\"']?([\w\-]+)[\"']?\s*=")
_LINE = re.compile(r"\(at line (\d+)")
_MADE_BY = {"calibrated.toml": "calibrate", "tuned.toml": "tune"}


class ParameterFiles:
    """What a vehicle's parameter files say, and what is wrong with them.

    Args:
        folder: of the vehicle.

    Attributes:
        entries: parameters that could be read, by name.
        problems: what is wrong, in the order of the files.
        remarks: what is not wrong, but may not be meant.
        roles: as they are given, or the usual ones where they can't be read.
        whole: whether every parameter is there to load the vehicle.
    """

    def __init__(self, folder: Path) -> None:
        self.entries: dict[str, PhysicalParameter] = {}
        self.problems: list[Problem] = []
        self.remarks: list[Problem] = []
        self.roles = Roles()
        self._folder = folder
        self._places: dict[str, tuple[Path, int]] = {}
        self._meant: set[str] = set()
        self._read = True
        for file in PARAMETER_FILES:
            self._read_file(folder / file)
        self._check_complete()
        self.whole = self._read and not self.problems
        self._check_plausible()

    def place(self, name: str) -> tuple[Path | None, int | None]:
        """Return the file and the line of a parameter, of its section, or None."""
        for key in (name, name.split(".")[0]):
            if key in self._places:
                return self._places[key]
        return None, None

    def add(self, text: str, name: str) -> None:
        """Note a problem with a parameter."""
        self.problems.append(Problem(text, *self.place(name)))

    def _read_file(self, path: Path) -> None:
        if not path.is_file() and path.name in _MADE_BY:
            solver = _MADE_BY[path.name]
            text = f"There is no such file: {solver} the vehicle to make it"
            self.problems.append(Problem(text, path, remedy=solving(solver, self._folder)))
            return
        try:
            text = read_text(path)
            content = tomllib.loads(text)
        except StorageError as error:
            self.problems.append(Problem.of(str(error), path))
            self._read = False
            return
        except tomllib.TOMLDecodeError as error:
            found = _LINE.search(str(error))
            line = int(found[1]) if found else None
            self.problems.append(Problem(f"This is not TOML: {error}.", path, line))
            self._read = False
            return
        lines = _lines(text)
        for section, members in content.items():
            place = path, lines.get(section, lines.get(f"{section}.", 1))
            self._places.setdefault(section, place)
            if section == "roles" and path.name == PARAMETER_FILES[0]:
                self._read_roles(members, place)
            elif not isinstance(members, dict):
                text = f"{section} must stand in a section, such as [air]."
                self.problems.append(Problem(text, *place))
            else:
                self._read_section(path, section, members, lines)

    def _read_roles(self, table: object, place: tuple[Path, int]) -> None:
        try:
            self.roles = Roles.of(table)
        except ModelError as error:
            self.problems.append(Problem(str(error), *place))

    def _read_section(
        self, path: Path, section: str, members: Mapping[str, Any], lines: Mapping[str, int]
    ) -> None:
        if section not in sections():
            self._unused(section)
            return
        for key, item in members.items():
            name = f"{section}.{key}"
            before = self._places.get(name)
            self._places[name] = path, lines.get(name, self.place(section)[1] or 1)
            if before is not None:
                file, line = before
                fault = f"{name} is defined already, in {file.name}, line {line}; keep one"
            elif fault := name_fault(name):
                self._meant.update(similar(name, glossary()))
            else:
                fault = self._take(name, item)
            if fault:
                self.add(fault, name)

    def _take(self, name: str, item: Any) -> str:
        """Keep a parameter, or return what is wrong with it."""
        known = term(name)
        unit = known.unit if known else "1"
        try:
            value, written = plain_number(name, item["value"]), str(item["unit"])
            entry = PhysicalParameter(name, value, written, str(item["source"]))
        except InputError as error:
            return str(error)
        except (TypeError, KeyError, ValueError):
            example = f'{{ value = 1.0, unit = "{unit}", source = "measured" }}'
            return f"{name} needs a value (a number), a unit and a source: {example}"
        if not math.isfinite(value):
            return f"{name} must be a finite number, got {item['value']!r}"
        fault = unit_fault_of(entry)
        if not fault:
            self.entries[name] = entry
        return fault

    def _unused(self, section: str) -> None:
        meant = similar(section, sections())
        if meant:
            self._meant.update(meant)
            self.add(
                f"The section [{section}] is not one that a vehicle has; did you mean "
                f"[{'] or ['.join(meant)}]?",
                section,
            )
            return
        text = f"Nothing in helisim reads the section [{section}]: it is left to you."
        self.remarks.append(Problem(text, *self.place(section)))

    def _check_complete(self) -> None:
        """Note what is missing: of the files that are there, and of the targets as a whole."""
        for known in glossary().values():
            file = _file_of(known.name)
            there = (self._folder / file).is_file()
            section = known.name.split(".")[0]
            others = {known.name, *INSTEAD.get(known.name, ())}
            found = bool(others & set(self._places) or {known.name, section} & self._meant)
            if not known.optional and there and self._read and not found:
                in_file, line = self._places.get(section, (None, None))
                line = line if in_file is not None and in_file.name == file else None
                self.problems.append(Problem(_missing_parameter(known), self._folder / file, line))
        needed = [name for name in (*DIRECT, *SOLVED) if name not in spared(self._places)]
        targets = [f"targets.{name}" for name in needed]
        lacking = [name for name in targets if name not in self._places]
        if lacking and len(lacking) < len(targets):
            names = ", ".join(name.split(".")[1] for name in lacking)
            self.add(f"[targets] lacks {names}: `helisim calibrate` needs all of them", "targets")

    def _check_plausible(self) -> None:
        for name, entry in self.entries.items():
            known = term(name)
            if known is not None and not known.low <= entry.value <= known.high:
                unit = "" if known.unit == "1" else f" {known.unit}"
                self.add(
                    f"{name} = {entry.value:g}{unit} is implausible: it is usually {known.low:g} "
                    f"to {known.high:g}{unit}. {known.meaning} {known.origin}",
                    name,
                )


def _missing_parameter(known: Term) -> str:
    key = known.name.split(".")[1]
    line = f'{key} = {{ value = ..., unit = "{known.unit}", source = "..." }}'
    return f"{known.name} is missing: add {line}. {known.meaning} {known.origin}"


def _file_of(name: str) -> str:
    """Return the file that a parameter belongs to, unless its author has it elsewhere."""
    if name in UNKNOWNS or name.startswith("flapping."):
        return PARAMETER_FILES[1]
    return PARAMETER_FILES[2] if name in STARTS else PARAMETER_FILES[0]


def _lines(text: str) -> dict[str, int]:
    """Return the line of each section and of each "section.key"."""
    lines: dict[str, int] = {}
    section = ""
    for number, line in enumerate(text.splitlines(), start=1):
        header, key = _HEADER.match(line), _KEY.match(line)
        if header is not None:
            section = header[1]
            lines.setdefault(section, number)
            lines.setdefault(section.split(".")[0], number)
        elif key is not None:
            lines.setdefault(f"{section}.{key[1]}" if section else key[1], number)
    return lines


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
    """Return what is wrong with the elements of an MJCF, whose author gave them names."""
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
            yield Problem.at(
                f"The {kind}s must stand one after the other in the order {', '.join(wanted)}; "
                f"here is {found.name!r} where {name!r} must be.",
                found,
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
            yield Problem.at(
                f"The sensor {found.name!r} must be a <{tag}>, it is a <{found.tag}>.",
                found,
            )
        elif tag == "user" and found.attributes.get("dim") != str(numbers):
            given = found.attributes.get("dim", "none")
            yield Problem.at(
                f'The sensor {found.name!r} must have dim="{numbers}", it has {given}: with fewer '
                "the force laws would write into the next one.",
                found,
            )


def _wrong_fuselage(mjcf: Mjcf, roles: Roles) -> Iterator[Problem]:
    """Yield a fuselage whose inertia can't be closed as it stands."""
    fuselage = mjcf.find("worldbody", roles.body("fuselage"), tag="body")
    if fuselage is None:
        return
    inertial = [one for one in mjcf.children(fuselage) if one.tag == "inertial"]
    if not inertial or "fullinertia" not in inertial[0].attributes:
        place = inertial[0] if inertial else fuselage
        yield Problem.at(
            f'The fuselage {fuselage.name!r} needs <inertial pos="x y z" mass="kg" '
            'fullinertia="Ixx Iyy Izz Ixy Ixz Iyz"/>: it is given what the other parts lack of the '
            "vehicle's moments of inertia.",
            place,
        )


_USUAL = {
    "disc_loading": (2.0, 1000.0, " N/m^2"),
    "tip_speed": (20.0, 300.0, " m/s"),
    "solidity": (0.01, 0.25, ""),
    "blade_loading": (0.005, 0.16, ""),
    "lock_number": (0.3, 20.0, ""),
    "figure_of_merit": (0.15, 0.9, ""),
}
"""Figure -> lowest and highest usual value, and unit."""
_LOOK = {
    "disc_loading": "weight over the disc's area: look at the mass in the MJCF and at "
    "main_rotor.radius",
    "tip_speed": "radius times speed: look at main_rotor.radius and main_rotor.speed (rad/s, not "
    "rpm)",
    "solidity": "blades' area over the disc's: look at main_rotor.chord, blades and radius",
    "blade_loading": "CT over solidity in the hover, beyond which blades stall: look at mass, "
    "speed and chord",
    "lock_number": "how the air holds a blade beside its inertia, and so how fast the disc "
    "follows: look at flapping.tau_f or main_rotor.blade_inertia",
    "figure_of_merit": "ideal over real power of the hover: look at main_rotor.profile_drag and "
    "induced_factor",
}
"""Figure -> what it is, and where to look."""


def at_a_glance(own: Mapping[str, float], weight: float) -> dict[str, float]:
    """Return the figures that need no flight, by name; the weight is in N."""
    radius, speed = own["main_rotor.radius"], own["main_rotor.speed"]
    disc = math.pi * radius**2
    solidity = own["main_rotor.blades"] * own["main_rotor.chord"] / (math.pi * radius)
    dynamic = own["air.density"] * disc * (speed * radius) ** 2
    return {
        "disc_loading": weight / disc,
        "tip_speed": speed * radius,
        "solidity": solidity,
        "blade_loading": weight / dynamic / solidity,
        "lock_number": lock_number(own),
    }


def implausible(figures: Mapping[str, float]) -> Iterator[Problem]:
    """Yield the figures, by name, that no helicopter is likely to have."""
    for name, value in figures.items():
        low, high, unit = _USUAL[name]
        if not low <= value <= high:
            yield Problem(
                f"The {name.replace('_', ' ')} is {value:.4g}{unit}, which is implausible: it is "
                f"usually {low:g} to {high:g}{unit}. It is {_LOOK[name]}.",
                flies=True,
            )


_OFF_CENTRE = 0.002
"""Of the rotor's radius: the trim tilts by as much over the hub's height, some 0.3 degrees."""
_MISPLACED = 0.005
"""Of the rotor's radius: what is drawn is drawn to the millimetre."""
_DIVISORS = (
    "air.density",
    "main_rotor.radius",
    "main_rotor.speed",
    "main_rotor.chord",
    "main_rotor.blades",
)
_AXES = ("ixx", "iyy", "izz")


def body_problems(path: Path, files: ParameterFiles) -> list[Problem]:
    """Return what is wrong with the rigid body of an MJCF, whose elements and files are there."""
    roles, own = files.roles, {name: one.value for name, one in files.entries.items()}
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        roles.rename(spec)
        model = spec.compile()
    except (ValueError, HelisimError) as error:
        return [Problem.of(str(error), path)]
    mjcf = Mjcf(path)
    problems = list(_wrong_channels(model, mjcf, roles))
    try:
        root = root_body(model)
    except HelisimError as error:
        rotor = mjcf.find("actuator", roles.name("actuator", "rotor"))
        return [*problems, Problem.at(str(error), rotor, path)]
    problems += _off_centre(model, root, own["main_rotor.radius"], mjcf, roles, path)
    problems += _misplaced(model, root, own, files)
    problems += _not_solid(model, root, own, files)
    problems += _out_of_step(model, own, files)
    try:
        own = dict(with_both(completed(Parameters(files.entries))))
    except ModelError as error:
        files.add(str(error), INERTIA)
        return problems
    if INERTIA in own and min(own[name] for name in _DIVISORS) > 0.0:
        weight = model.body_subtreemass[root] * np.linalg.norm(model.opt.gravity)
        problems += implausible(at_a_glance(own, float(weight)))
    return problems


def _wrong_channels(model: mujoco.MjModel, mjcf: Mjcf, roles: Roles) -> Iterator[Problem]:
    """Yield actuators that have no room for the states of the force laws."""
    for ordinal, role in enumerate(ACTUATORS):
        found = int(model.actuator_actnum[model.actuator(role).id])
        servo = role.startswith("servo")
        wanted = ROTOR_STATES if ordinal == ROTOR else 2 if servo else 0
        if found == wanted or (ordinal == ROTOR and found > wanted):
            continue
        element = mjcf.find("actuator", roles.name("actuator", role))
        states = f'dyntype="user" actdim="{wanted}"' if wanted else 'no dyntype="user"'
        yield Problem.at(
            f"the actuator {role!r} must have {states}, here or in its class; it has {found} "
            "activations",
            element,
            mjcf.path,
        )


def _off_centre(
    model: mujoco.MjModel, root: int, radius: float, mjcf: Mjcf, roles: Roles, path: Path
) -> Iterator[Problem]:
    """Yield a centre of gravity that isn't the origin of the vehicle's body."""
    data = _at_rest(model)
    offset = _inside(data, root, data.subtree_com[root])
    if np.linalg.norm(offset) <= _OFF_CENTRE * radius:
        return
    name = roles.body("fuselage")
    fuselage = model.body(name).id
    shift = -offset * model.body_subtreemass[root] / model.body_mass[fuselage]
    element = mjcf.find("worldbody", name, tag="body")
    inertial = [one for one in mjcf if one.parent is element and one.tag == "inertial"]
    x, y, z = np.round(1e3 * offset, 1) + 0.0  # no minus before a zero
    found = Problem.at(
        f"the centre of gravity is {x:.1f} mm ahead, {y:.1f} mm left and {z:.1f} mm above the "
        f"origin of the body {model.body(root).name!r}, about which the force laws act; move "
        "parts, or the fuselage's inertial pos by "
        f"{' '.join(f'{part:.4g}' for part in np.round(shift, 6) + 0.0)} m",
        inertial[0] if inertial else element,
        path,
    )
    yield replace(found, flies=True)


def _misplaced(
    model: mujoco.MjModel, root: int, own: Mapping[str, float], files: ParameterFiles
) -> Iterator[Problem]:
    """Yield hubs that the parameters and the MJCF have in different places."""
    data = _at_rest(model)
    for role, section, along, down in (
        ("hub", "main_rotor", "hub_x", "hub_z"),
        ("tail_hub", "tail_rotor", "arm_x", "arm_z"),
    ):
        name = files.roles.site(role)
        x, _, up = _inside(data, root, data.site(name).xpos)
        for key, drawn in ((along, x), (down, -up)):
            given = own[f"{section}.{key}"]
            if abs(given - drawn) > _MISPLACED * own["main_rotor.radius"]:
                text = (
                    f"{section}.{key} is {given:g} m, and the site {name!r} of the MJCF is at "
                    f"{drawn + 0.0:.4g} m; make them one place"
                )
                yield Problem(text, *files.place(f"{section}.{key}"), flies=True)


def _not_solid(
    model: mujoco.MjModel, root: int, own: Mapping[str, float], files: ParameterFiles
) -> Iterator[Problem]:
    """Yield moments of inertia that no solid has: of the whole, or of what is left to a part."""
    whole = {axis: own[f"airframe.{axis}"] for axis in _AXES}
    largest = max(whole, key=lambda axis: whole[axis])
    others = sum(whole.values()) - whole[largest]
    if min(whole.values()) <= 0.0 or whole[largest] > others:
        text = (
            f"airframe.{largest} = {whole[largest]:.4g} kg m^2 is more than the other two moments "
            f"together, {others:.4g}, which no solid has; lower it, or raise another"
        )
        yield Problem(text, *files.place(f"airframe.{largest}"))
        return
    fuselage = model.body(files.roles.body("fuselage")).id
    missing = wanted_inertia(own) - total_inertia(model, root)
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.body_iquat[fuselage])
    matrix = turn.reshape(3, 3)
    left = missing + matrix @ np.diag(model.body_inertia[fuselage]) @ matrix.T
    small, middle, large = np.linalg.eigvalsh(left)
    if small > 0.0 and small + middle >= large:
        return
    parts = np.diag(np.diag(list(whole.values())) - left)
    takes = ", ".join(f"{axis} {part:.4g}" for axis, part in zip(_AXES, parts))
    text = (
        "the fuselage is left with principal moments of inertia of "
        f"{small:.4g}, {middle:.4g} and {large:.4g} kg m^2, which no solid has (each positive, "
        f"none more than the other two together); the other parts take {takes} of the whole: "
        "change airframe.ixx, iyy or izz, or the parts' masses and places"
    )
    yield Problem(text, *files.place("airframe.ixx"))


def _out_of_step(
    model: mujoco.MjModel, own: Mapping[str, float], files: ParameterFiles
) -> Iterator[Problem]:
    """Yield a gyro that does not tick at a time step."""
    step = float(model.opt.timestep)
    steps = own["gyro.period"] / step
    if steps < 0.5 or abs(steps - round(steps)) > TICK_TOLERANCE:
        near = max(1, round(steps)) * step
        text = (
            f"gyro.period = {own['gyro.period']:g} s must be a whole number of the MJCF's time "
            f"steps of {step:g} s: {near:g} s is one"
        )
        yield Problem(text, *files.place("gyro.period"))


def _at_rest(model: mujoco.MjModel) -> mujoco.MjData:
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return data


def _inside(data: mujoco.MjData, root: int, point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a point of the world in the vehicle's axes (forward, left, up), (3,)."""
    return data.xmat[root].reshape(3, 3).T @ (point - data.xpos[root])
