"""Files are written whole or not at all, and read only where they are of a sane size."""

import errno
import math
import os
import tomllib
from pathlib import Path

import pytest

from helisim.base.errors import StorageError
from helisim.base.files import atomic_write, read_json, read_toml, toml_value, write_json
from helisim.ident import load_fit, structures
from helisim.logs import Map


def write_half(path: Path, failure: type[BaseException]) -> None:
    with atomic_write(path) as temporary:
        temporary.write_text("half")
        raise failure


@pytest.mark.parametrize("failure", [KeyboardInterrupt, RuntimeError, OSError])
def test_an_interrupted_write_leaves_the_old_file(tmp_path, failure):
    path = tmp_path / "results.json"
    path.write_text("old")
    with pytest.raises(StorageError if failure is OSError else failure):
        write_half(path, failure)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


# Writers of other modules


def refuse(*_):
    raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize(
    "write", [structures.heave.to_toml, lambda path: write_json({"a": 1}, path)]
)
def test_every_writer_leaves_the_old_file_when_the_disk_is_full(tmp_path, monkeypatch, write):
    path = tmp_path / "file.json"
    path.write_text("old")
    monkeypatch.setattr(os, "fsync", refuse)
    with pytest.raises(StorageError, match=r"file\.json: can't write it: No space left"):
        write(path)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


# Names


@pytest.mark.parametrize(
    "name", ["Flüge und Läufe/日本 1.json", 'it\'s "a" % {file} #1.json', "é" * 120 + ".json"]
)
def test_any_name_that_the_system_takes_is_written_and_read(tmp_path, name):
    """Blanks, quotes, other alphabets, and names as long as a file system allows."""
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    write_json({"name": name}, path)
    assert read_json(path) == {"name": name}
    assert list(path.parent.iterdir()) == [path]


# Sizes and depths


@pytest.mark.parametrize(
    ("name", "text", "read"),
    [
        ("deep.json", "[" * 100_000, read_json),
        ("deep.json", '{"format":' * 100_000, load_fit),
        ("deep.toml", "a = " + "[" * 100_000, read_toml),
        ("deep.toml", "a = " + "[" * 100_000, Map.from_toml),
        ("deep.toml", "a = " + "9" * 10_000, read_toml),
        ("list.json", "[1, 2]", read_json),
        ("half.json", '{"a": 1', read_json),
        ("bytes.json", "\udcff", read_json),
    ],
)
def test_what_parsers_stumble_over_is_one_clear_error(tmp_path, name, text, read):
    """Nesting that exhausts the stack, endless numbers, cut or foreign files name the file."""
    path = tmp_path / name
    path.write_text(text, encoding="utf-8", errors="surrogateescape")
    with pytest.raises(StorageError, match=name.replace(".", r"\.")):
        read(path)


# TOML


@pytest.mark.parametrize(
    "value",
    ["", 'a "b" \\ c', "two\nlines", "\x7f\x1f", "é", True, 3, 0.1, 1e-300, math.inf, ["a", [1]]],
)
def test_a_toml_value_comes_back(value):
    """Text of any characters, numbers to the last bit, lists in lists; so do keys, quoted."""
    assert tomllib.loads(f"x = {toml_value(value)}") == {"x": value}
