"""A vehicle's parameter files, read as far as they can be, with the line of every parameter."""

import math
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from helisim.base.errors import InputError, ModelError, StorageError, similar
from helisim.base.files import read_text
from helisim.study.check.problem import Problem, command, sentence
from helisim.vehicle.blade import INSTEAD
from helisim.vehicle.calibrate import DIRECT, SOLVED, UNKNOWNS, spared
from helisim.vehicle.folder import PARAMETER_FILES, Roles
from helisim.vehicle.parameters import (
    PhysicalParameter,
    Term,
    glossary,
    name_fault,
    plain_number,
    sections,
    term,
    unit_fault_of,
)
from helisim.vehicle.rate_command import STARTS

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
        self.problems.append(Problem(sentence(text), *self.place(name)))

    def _read_file(self, path: Path) -> None:
        if not path.is_file() and path.name in _MADE_BY:
            makes = command(_MADE_BY[path.name], self._folder, "--write")
            self.problems.append(Problem(f"There is no such file. {makes} makes it.", path))
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
            self.problems.append(Problem(sentence(str(error)), *place))

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
                text = f"{name} is defined already, in {before[0].name}, line {before[1]}; keep one"
                self.add(text, name)
                continue
            fault = name_fault(name)
            if fault:
                self.add(fault, name)
                self._meant.update(similar(name, glossary()))
                continue
            entry = self._entry(name, item)
            if entry is not None:
                self.entries[name] = entry

    def _entry(self, name: str, item: Any) -> PhysicalParameter | None:
        """Return a parameter, or None and a problem."""
        known = term(name)
        unit = known.unit if known else "1"
        try:
            value, written = plain_number(name, item["value"]), str(item["unit"])
            entry = PhysicalParameter(name, value, written, str(item["source"]))
        except InputError as error:
            self.add(str(error), name)
            return None
        except (TypeError, KeyError, ValueError):
            example = f'{{ value = 1.0, unit = "{unit}", source = "measured" }}'
            self.add(f"{name} needs a value (a number), a unit and a source: {example}", name)
            return None
        if not math.isfinite(value):
            self.add(f"{name} must be a finite number, got {item['value']!r}", name)
            return None
        fault = unit_fault_of(entry)
        if fault:
            self.add(fault, name)
            return None
        return entry

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
                self.problems.append(Problem(_missing(known), self._folder / file, line))
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


def _missing(known: Term) -> str:
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
