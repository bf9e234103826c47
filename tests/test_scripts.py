"""The scripts that a user copies: each runs, and says what it is for."""

import re
import runpy
import sys

import pytest

from command import python
from script import SCRIPTS


@pytest.fixture
def run(monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)

    def script(name, *arguments):
        monkeypatch.setattr(sys, "argv", [name, *map(str, arguments)])
        runpy.run_path(str(SCRIPTS / name), run_name="__main__")
        return capsys.readouterr().out

    return script


@pytest.mark.slow
def test_proofs_and_benchmarks_find_what_they_import():
    paths = sorted(str(path) for path in SCRIPTS.glob("*/*.py"))
    assert len(paths) > 10
    code = (
        "import runpy, sys\n"
        "for path in sys.argv[1:]:\n"
        "    sys.path[0] = path.rpartition('/')[0]\n"
        "    runpy.run_path(path, run_name='loaded')\n"
    )
    assert python(code, *paths) == ""


@pytest.mark.slow
def test_an_agent_of_a_few_lines_flies(run):
    printed = run("fly_in_gymnasium.py", 4)
    assert "heading_error_sine" in printed
    score, lost = re.search(r"mean return (\d+) of 500, (\d+) lost", printed).groups()
    assert int(score) > 150  # of the still sticks: some 60
    assert int(lost) == 0
