"""Write into a vehicle's MJCF the numbers that its force laws need, so that stock MuJoCo flies it.

The numbers are the parameters', calibrated and tuned. They stand in the MJCF where MuJoCo has a
place for them: the force laws' in the `user` numbers of the actuators, the gyro's timing in delays
and intervals, the moments of inertia in the fuselage, the trim in the keyframe `hover`. Nothing
else of the file is touched.

An MJCF is text here: MuJoCo reads it for what it says and forgets how it is written. Every element
knows its file and line, through what the file includes, and an attribute is changed without
touching anything else: the author's comments, order and layout stay.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any
from xml.parsers import expat
from xml.sax.saxutils import escape

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import ModelError, StorageError
from helisim.base.files import atomic_write, read_bytes
from helisim.physics.layout import ACTUATORS, PARAM, ROTOR
from helisim.physics.native import check_model
from helisim.vehicle.assembly import specified
from helisim.vehicle.folder import Roles, mjcf_file, model_folder, read_roles
from helisim.vehicle.vehicle import Vehicle, load

_MAX_BYTES = 1 << 26
"""A larger MJCF is refused: people write them."""
_WIDTH = 130
"""Columns; an attribute that would go beyond begins a line."""
_START_TAG = re.compile(rb"""<[^\s/>]+(?:\s+[^\s=]+\s*=\s*(?:"[^"]*"|'[^']*'))*\s*/?>""")
_ATTRIBUTE = re.compile(rb"""(\s+)([^\s=]+)(\s*=\s*)("[^"]*"|'[^']*')""")


@dataclass(frozen=True, eq=False)
class Element:
    """One element of an MJCF, and where it stands.

    tag: such as "body"; attributes: as they are written; those of default classes are not among
    them; file: that it stands in; line: of that file, from 1; parent: the innermost element around
    it, None for the outermost; start: of its start tag, a byte of the file.
    """

    tag: str
    attributes: Mapping[str, str]
    file: Path
    line: int
    parent: "Element | None"
    start: int

    @property
    def name(self) -> str:
        """Its name, "" if it has none."""
        return self.attributes.get("name", "")

    @property
    def section(self) -> str:
        """The part of the MJCF that it is in: "worldbody", "actuator", "sensor" and so on."""
        element = self
        while element.parent is not None and element.parent.parent is not None:
            element = element.parent
        return element.tag

    @property
    def place(self) -> str:
        """Its place for a message: file, line, tag and name."""
        named = f' name="{self.name}"' if self.name else ""
        return f"{self.file}, line {self.line}: <{self.tag}{named}>"


class Mjcf:
    """An MJCF file and those that it includes, element by element.

    Args:
        path: of the file that MuJoCo is given; what it includes is found beside it.

    Raises:
        ModelError: not XML; the message has file and line.
        StorageError: a file is missing or can't be read.
    """

    def __init__(self, path: str | PathLike[str]) -> None:
        self.path = Path(path)
        self._texts: dict[Path, bytes] = {}
        self._elements: list[Element] = []
        self._comments: dict[Path, list[int]] = {}
        self._read(self.path, parent=None)

    def __iter__(self) -> Iterator[Element]:
        """Give every element in the order in which MuJoCo meets it."""
        return iter(self._elements)

    @property
    def files(self) -> tuple[Path, ...]:
        """The file and all that it includes."""
        return tuple(self._texts)

    def find(self, section: str, name: str, *, tag: str | None = None) -> Element | None:
        """Return the element of a section with a name, None if there is none.

        section: such as "actuator", whose elements share their names' room; name: of the element;
        tag: of the element, where a section has several kinds, such as "body".
        """
        for element in self:
            of_kind = element.section == section and tag in (None, element.tag)
            if of_kind and element.name == name:
                return element
        return None

    def children(self, element: Element) -> tuple[Element, ...]:
        """Return the elements that stand directly in another."""
        return tuple(one for one in self if one.parent is element)

    def set(
        self, element: Element, attributes: Mapping[str, str | None], *, comment: str | None = None
    ) -> None:
        """Change attributes of an element where it stands: new ones follow, None takes one away.

        The elements are read anew: those that were taken before are of the text before.

        element: one of these; attributes: text of each; its line breaks are kept in the file;
        comment: what the comment straight before the element says from now on. One there is
        replaced if its first line is the same, else this one is put behind it.
        """
        text = self._texts[element.file]
        tag = _START_TAG.match(text, element.start)
        assert tag is not None  # expat has read it
        parts = [text[: element.start]]
        if comment is not None:
            parts = [self._with_comment(element, comment)]
        column = element.start - text.rfind(b"\n", 0, element.start) - 1
        changed = _changed(tag.group(), dict(attributes), column)
        self._texts[element.file] = b"".join([*parts, changed, text[tag.end() :]])
        self._read_again()

    def write(self) -> tuple[Path, ...]:
        """Write the files whose text changed, each whole or not at all, and return them.

        Raises:
            StorageError: one can't be written.
        """
        changed = [path for path, text in self._texts.items() if path.read_bytes() != text]
        for path in changed:
            with atomic_write(path) as temporary:
                temporary.write_bytes(self._texts[path])
        return tuple(changed)

    @property
    def texts(self) -> Mapping[Path, bytes]:
        """The text of each file, as it would be written."""
        return dict(self._texts)

    def _read_again(self) -> None:
        self._elements, self._comments = [], {}
        self._read(self.path, parent=None)

    def _read(self, path: Path, parent: Element | None) -> None:
        if path not in self._texts:
            self._texts[path] = read_bytes(path, limit=_MAX_BYTES)
        elif path in self._comments:
            raise ModelError(f"{path}: is included twice, which MuJoCo refuses")
        self._comments[path] = []
        stack = [] if parent is None else [parent]
        outermost = parent is not None  # of an included file, which stands for its content

        parser = expat.ParserCreate()

        def opened(tag: str, attributes: dict[str, Any]) -> None:
            nonlocal outermost
            if outermost:
                outermost = False
                stack.append(stack[-1])
                return
            above = stack[-1] if stack else None
            element = Element(
                tag, attributes, path, parser.CurrentLineNumber, above, parser.CurrentByteIndex
            )
            self._elements.append(element)
            stack.append(element)
            if tag == "include" and "file" in attributes:
                self._include(element, above)

        def commented(_: str) -> None:
            self._comments[path].append(parser.CurrentByteIndex)

        parser.StartElementHandler = opened
        parser.EndElementHandler = lambda _: stack.pop()
        parser.CommentHandler = commented
        try:
            parser.Parse(self._texts[path], True)
        except expat.ExpatError as error:
            said = expat.ErrorString(error.code)
            raise ModelError(f"{path}, line {error.lineno}: not XML: {said}") from None

    def _include(self, element: Element, above: Element | None) -> None:
        file = self.path.parent / element.attributes["file"]  # as MuJoCo finds it
        try:
            self._read(file, above)
        except StorageError as error:
            raise ModelError(f"{element.place}: {error}") from None

    def _with_comment(self, element: Element, comment: str) -> bytes:
        """Return what stands before an element, its comment in place."""
        before = self._texts[element.file][: element.start]
        line = before.rpartition(b"\n")[2]
        indent = line if not line.strip() else b""
        written = f"<!-- {comment} -->".encode().replace(b"\n", b"\n" + indent)
        last = max((at for at in self._comments[element.file] if at < element.start), default=None)
        if last is not None:
            stands = before[last:]
            first = written.partition(b"\n")[0]
            if stands.startswith(first) and stands.rstrip().endswith(b"-->"):
                before = before[:last]
        return before + written + b"\n" + indent


def _changed(tag: bytes, attributes: dict[str, str | None], column: int) -> bytes:
    """Return a start tag, which stands at a column, with its attributes changed."""

    def replaced(found: re.Match[bytes]) -> bytes:
        name = found[2].decode()
        if name not in attributes:
            return found[0]
        value = attributes.pop(name)
        return b"" if value is None else found[1] + found[2] + found[3] + _quoted(value)

    body = _ATTRIBUTE.sub(replaced, tag)
    end = re.search(rb"\s*/?>$", body)
    assert end is not None
    body, closing = body[: end.start()], body[end.start() :]
    for name, value in attributes.items():
        if value is None:
            continue
        added = f"{name}=".encode() + _quoted(value)
        taken = len(body.rpartition(b"\n")[2]) + (0 if b"\n" in body else column)
        fits = taken + 1 + len(added.partition(b"\n")[0]) <= _WIDTH
        body += (b" " if fits else b"\n" + b" " * (column + 2)) + added
    return body + closing


def _quoted(value: str) -> bytes:
    """Return an attribute's value in quotes, its line breaks as they are."""
    return b'"' + escape(value, {'"': "&quot;"}).encode() + b'"'


Numbers = Sequence[float] | NDArray[np.float64]

_BLOCK = """Written by `helisim vehicle build` from parameters.toml, calibrated.toml and tuned.toml:
     what the force laws read, SI, a name here for each number below. Don't change them here."""
_WIDTH = 100
"""Columns of a line of numbers or names."""
_IN_LINE = 6
_PART = 3
"""The force laws' numbers stand so many in a line; so many of a part begin one."""
_ROUNDING = 1e-14
"""By which a number may differ and stand, relative: another processor's cosine or square root."""
_DECIMALS = 10
"""Decimals of the trim, whose solver leaves 1e-13 rad: the gyro holds it."""


@dataclass(frozen=True, eq=False)
class Change:
    """The numbers that an element of the MJCF should have.

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
