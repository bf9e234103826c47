"""An MJCF as text: where each element stands, and how to change its attributes in place.

MuJoCo reads an MJCF for what it says and forgets how it is written. Here every element knows its
file and line, through what the file includes, and an attribute is changed without touching
anything else: the author's comments, order and layout stay.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any
from xml.parsers import expat
from xml.sax.saxutils import escape

from helisim.base.errors import ModelError, StorageError
from helisim.base.files import atomic_write, read_bytes

_MAX_BYTES = 1 << 26
"""A larger MJCF is refused: people write them."""
_WIDTH = 130
"""Columns; an attribute that would go beyond begins a line."""
_START_TAG = re.compile(rb"""<[^\s/>]+(?:\s+[^\s=]+\s*=\s*(?:"[^"]*"|'[^']*'))*\s*/?>""")
_ATTRIBUTE = re.compile(rb"""(\s+)([^\s=]+)(\s*=\s*)("[^"]*"|'[^']*')""")


@dataclass(frozen=True, eq=False)
class Element:
    """One element of an MJCF, and where it stands.

    Attributes:
        tag: such as "body".
        attributes: as they are written; those of default classes are not among them.
        file: that it stands in.
        line: of that file, from 1.
        parent: the innermost element around it, None for the outermost.
        start: of its start tag, a byte of the file.
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
        """Where it is, for a message: file, line, tag and name."""
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

        Args:
            section: such as "actuator", whose elements share their names' room.
            name: of the element.
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

        Args:
            element: one of these.
            attributes: text of each; its line breaks are kept in the file.
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
