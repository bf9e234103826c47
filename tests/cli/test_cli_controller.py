"""`--controller MODULE:NAME`: a law of the current folder flies, or one line says why not."""

import sys

import numpy as np
import pytest

import helisim as hs
from helisim.cli import main

LAWS = """
import helisim as hs

def yaw(seen, state):
    error = 2.68 * seen.PED - 0.2941 * seen.r
    state[0] += 0.002 * error
    return 0.5 * error + 10.0 * state[0]

tail = hs.Controller(tail=yaw, states=1)

def breaks(seen):
    if seen.time > 1.0:
        raise ValueError("no fuel")
    return seen.front, seen.left, seen.right, seen.tail

number = 3
"""
FLY = ["fly", "--axis", "ped", "--duration", "12", "--quiet", "--out", "ped.parquet"]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A current folder with laws in a module; no other test imports one of this name."""
    (tmp_path / "laws_of_the_folder.py").write_text(LAWS)
    (tmp_path / "json.py").write_text(LAWS)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, "laws_of_the_folder", raising=False)
    return tmp_path


def test_a_law_of_the_current_folder_flies(folder):
    """By its name in a module; the record says which."""
    assert main([*FLY, "--controller", "laws_of_the_folder:tail"]) == 0
    record = hs.read_record(folder / "ped.parquet")
    assert record.provenance["controller"]["tail"]["law"] == "laws_of_the_folder:yaw"
    assert main(FLY) == 0
    assert not np.array_equal(hs.read_record(folder / "ped.parquet").values, record.values)


@pytest.mark.parametrize("word", ["laws/of_a_file.py:tail", "./laws/of_a_file:tail"])
def test_a_law_of_a_file_flies(folder, monkeypatch, word):
    monkeypatch.delitem(sys.modules, "of_a_file", raising=False)
    (folder / "laws").mkdir()
    (folder / "laws" / "of_a_file.py").write_text(LAWS)
    assert main([*FLY, "--controller", word]) == 0
    law = hs.read_record(folder / "ped.parquet").provenance["controller"]["tail"]["law"]
    assert law == "of_a_file:yaw"


def test_a_law_that_raises_is_told_with_its_traceback(folder, capsys):
    """Exit status 3, the flight as far as it went, and the last line says why."""
    assert main([*FLY, "--controller", "laws_of_the_folder:breaks"]) == 3
    said = capsys.readouterr().err.splitlines()
    assert 'File "laws_of_the_folder.py", line 13, in breaks' in said[1]
    assert said[-1].startswith("helisim fly: controller 'breaks' raised ValueError: no fuel at 1.0")
    assert hs.read_record(folder / "ped.parquet").ended
