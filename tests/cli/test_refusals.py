"""Every mistake on the command line is one line that says what to do, with status 2, and no file.

`refusals.txt` beside this file has a command line and what is said of it in each line.
"""

import shlex
import sys
from pathlib import Path

import pytest

from closed_loops import flown, known_loop
from command import fails
from exact_fits import found
from helisim import ident
from helisim.records.storage import write_record
from swept_logs import csv_writer

CASES = Path(__file__).with_name("refusals.txt").read_text(encoding="utf-8").splitlines()
LAWS = "def yaw(seen):\n    return seen.PED\n\nnumber = 3\n"
FILES = {"laws_of_the_folder.py": LAWS, "file": "", "map.toml": "", "bad.toml": "[vari]"}
FILES["good.toml"] = '[campaign]\nmodels = ["heave"]\nflights = 2\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with one sound file of each kind, and a few that are not."""
    path = tmp_path_factory.mktemp("refused")
    for name, text in FILES.items():
        (path / name).write_text(text)
    (path / "none").mkdir()
    write = csv_writer(path)
    for name in ("sweep.csv", "log.csv"):
        write(name=name)
    found(ident.structures.yaw_base, N_r=-2.0, N_ped=60.0, tau_r_base=0.05).save(path / "yaw.json")
    write_record(flown(known_loop(), seed=3, noise=0.02), path / "loop.parquet")
    return path


@pytest.mark.parametrize("case", CASES)
def test_a_mistake_is_one_line(folder, monkeypatch, capsys, case):
    """Status 2, one line on standard error, nothing printed and nothing written."""
    monkeypatch.chdir(folder)
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "HELISIM_ARDUPILOT"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.delitem(sys.modules, "laws_of_the_folder", raising=False)
    before = sorted(folder.iterdir())
    command, _, said = case.rpartition("=> ")
    assert said in fails(capsys, *shlex.split(command))
    made = {"__pycache__", "reproduction"}  # the latter by a run that fails in its first flight
    assert [one for one in sorted(folder.iterdir()) if one.name not in made] == [
        one for one in before if one.name not in made
    ]


def test_too_large_a_task_is_one_line(monkeypatch, capsys):
    """Memory that a machine doesn't have is no traceback."""

    def allocate(*_, **__):
        raise MemoryError("Unable to allocate 1 TiB")

    monkeypatch.setattr("helisim.vehicle.load", allocate)
    assert "too much for this machine: Unable to allocate 1 TiB" in fails(capsys, "linearize")
