"""A vehicle of one's own: a copy of the JR700's folder, elsewhere."""

import shutil
from pathlib import Path

from helisim.vehicle.parameters import model_folder


def copied(folder: Path, like: str = "jr700") -> Path:
    """Copy a shipped vehicle to a folder, which gives it its name."""
    shutil.copytree(model_folder(like), folder, ignore=shutil.ignore_patterns("*.png", "build.py"))
    return folder


def edited(folder: Path, file: str, old: str, new: str) -> int:
    """Replace what stands once in a file of a folder; return the number of its line."""
    text = (folder / file).read_text()
    assert text.count(old) == 1, (file, old, text.count(old))
    (folder / file).write_text(text.replace(old, new))
    return text[: text.index(old)].count("\n") + 1
