"""Killed at random moments: nothing that was reported as saved is lost, and nothing is torn."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[1] / "scripts" / "kill_study.py"


@pytest.fixture(scope="module")
def study():
    spec = importlib.util.spec_from_file_location("kill_study", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def found(study, tmp_path_factory):
    return study.study("fly", 3, tmp_path_factory.mktemp("kills"))


def test_a_folder_of_flights_survives_kills(found):
    """Three kills; then it is gone on with, to the same bytes as an undisturbed run's."""
    assert found["kills"] == 3
    assert found["in time"] > 0
    assert found["reported"] > 0
    assert (found["lost"], found["torn"], found["not complete in the end"]) == (0, 0, 0)


def test_the_study_sees_what_is_torn_or_missing(study, found, tmp_path):
    """A file that was cut, one of other bytes, one that is gone."""
    whole, folder = tmp_path / "fly whole", tmp_path / "fly 0"
    for one in (whole, folder):
        one.mkdir()
        (one / "lat_0001.parquet").write_bytes(b"PAR1 whole PAR1")
        (one / "results.json").write_text("{}")
    assert study.torn(folder, whole) == []
    (folder / "lat_0001.parquet").write_bytes(b"PAR1 wh")
    (folder / "lat_0002.parquet").write_bytes(b"PAR1 of a part")
    (folder / "fits.json").write_text('{"a":')
    (folder / ".lat_0003.12345678.tmp.parquet").write_bytes(b"a stray")
    assert len(study.torn(folder, whole)) == 3
    assert study.units("fly", folder) == 2


ORPHANS = """
from helisim.campaign import local
import mortal

if __name__ == "__main__":
    for number in local(2)(mortal.square_or_sleep, range(4)):
        print(number, flush=True)
"""


def test_workers_end_with_a_parent_that_was_killed(tmp_path):
    """They hold its standard output, so that ends when the last of them has gone."""
    script = tmp_path / "orphans.py"
    script.write_text(ORPHANS)
    folders = (str(Path(__file__).parent / "campaign"), os.environ.get("PYTHONPATH"))
    path = [folder for folder in folders if folder]
    with subprocess.Popen(
        [sys.executable, str(script)],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(path)},
    ) as process:
        assert process.stdout.readline() == "0\n"
        process.kill()
        rest, _ = process.communicate(timeout=120)
        assert rest in ("", "1\n")
