"""One problem of a vehicle's folder."""

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

_PLACED = re.compile(r"(?P<file>.+?)(?:, line |:)(?P<line>\d+): (?P<text>.*)", re.S)


@dataclass(frozen=True)
class Problem:
    """What is wrong, where, and what to do, in full sentences.

    Attributes:
        text: what is wrong and what to do.
        file: that it is in; None where it is in no one file.
        line: of the file, from 1; None where it is in no one line.
        flies: whether the vehicle can be flown all the same.
    """

    text: str
    file: Path | None = None
    line: int | None = None
    flies: bool = False

    @classmethod
    def of(cls, message: str, file: Path | None = None) -> "Problem":
        """Return the problem that an error's message tells, with its own file and line if any."""
        text = " ".join(message.split())
        placed = _PLACED.fullmatch(text)
        if placed is not None and Path(placed["file"]).is_file():
            return cls(sentence(placed["text"]), Path(placed["file"]), int(placed["line"]))
        if file is not None:
            text = text.removeprefix(f"{file}: ")
            within = re.search(r"\bline (\d+)", text)
            return cls(sentence(text), file, int(within[1]) if within else None)
        return cls(sentence(text))

    def __str__(self) -> str:
        """Return file, line and text, as compilers do."""
        if self.file is None:
            return self.text
        line = "" if self.line is None else f":{self.line}"
        return f"{_shown(self.file)}{line}: {self.text}"


def sentence(text: str) -> str:
    """Return a message as a sentence: it begins with a capital, if with a word, and ends."""
    first = re.match(r"[a-z]+(?=[ ,])", text)
    begun = text[:1].upper() + text[1:] if first else text
    return begun if begun.endswith((".", "?", "!")) else f"{begun}."


def command(words: str, folder: Path, *options: str) -> str:
    """Return a command with a vehicle's folder, to be typed where one is."""
    return " ".join(["`helisim", words, shlex.quote(str(_shown(folder))), *options]) + "`"


def _shown(path: Path) -> Path:
    """Return a path from where one is, if it is below."""
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path
