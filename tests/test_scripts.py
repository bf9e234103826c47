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
def test_a_controller_of_ones_own_flies(run):
    printed = run("own_controller.py", 0.3, 0.5)
    peaks, errors = zip(*re.findall(r"sensitivity ([\d.]+), rate error ([\d.]+)", printed))
    assert float(peaks[0]) > float(peaks[1]) > 1.0
    assert float(errors[0]) > float(errors[1]) > 0.0
    assert printed.count("the same flight: True") == 2


@pytest.mark.study
def test_a_vehicle_of_ones_own_is_made_changed_and_identified(run, tmp_path):
    printed = run("own_vehicle.py", "myheli", 2)
    assert "myheli: All is well." in printed
    assert "tip speed               125.7 m/s" in printed
    assert (tmp_path / "myheli" / "README.md").is_file()
    found = [line.replace(",", "").split() for line in printed.splitlines() if "truth:" in line]
    for _, _, truth, _, identified in found:
        # three standard errors of N_r from two flights, of 1.7 % each
        assert float(identified) == pytest.approx(float(truth), rel=0.052)
    assert len(found) == 2


@pytest.mark.slow
def test_an_agent_of_a_few_lines_flies(run):
    printed = run("fly_in_gymnasium.py", 4)
    assert "heading_error_sine" in printed
    score, lost = re.search(r"mean return (\d+) of 500, (\d+) lost", printed).groups()
    assert int(score) > 150  # of the still sticks: some 60
    assert int(lost) == 0


@pytest.mark.parametrize("vehicle", ["jr700", "blade360"])
def test_stock_mujoco_flies_the_shipped_models(run, vehicle):
    printed = run("stock_mujoco.py", vehicle)
    off = re.search(rf"{vehicle}: (\S+) m off after 10 s of hover", printed)
    assert float(off[1]) < 1e-7  # as in tests/models/test_mjcf.py
    assert float(re.search(r"rolls with (\S+) rad/s", printed)[1]) > 0.2
    assert f"a/{vehicle}, b/{vehicle}, c/{vehicle}" in printed
    one, two, three = map(float, printed.splitlines()[-1].split(":")[1].split(","))
    assert one == three == 0.0
    assert two > 0.5


@pytest.mark.study
def test_a_program_flies_by_hand(run, tmp_path):
    printed = run("fly_by_hand.py", "hand.parquet")
    assert "hand.parquet, 90.0 s, flown with a program" in printed
    assert float(printed.split("r / PED: ")[1].split()[0]) > 0.9
    assert "landed: upright" in printed
