"""The scripts that a user copies: each runs, and says what it is for."""

import re
import runpy
import subprocess
import sys

import pytest

from helisim.records.storage import write_record
from script import SCRIPTS


@pytest.fixture
def run(monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)

    def script(name, *arguments):
        monkeypatch.setattr(sys, "argv", [name, *map(str, arguments)])
        runpy.run_path(str(SCRIPTS / name), run_name="__main__")
        return capsys.readouterr().out

    return script


def test_a_few_scripts_are_for_users():
    """Proofs and benchmarks have folders of their own."""
    assert sorted(path.name for path in SCRIPTS.glob("*.py")) == [
        "design_study.py",
        "first_look.py",
        "fly_and_identify.py",
        "fly_by_hand.py",
        "fly_in_gymnasium.py",
        "identify_log.py",
        "learn_to_hover.py",
        "multisine.py",
        "own_controller.py",
        "own_flight.py",
        "own_structure.py",
        "own_vehicle.py",
        "run_campaign.py",
        "sitl_study.py",
        "stock_mujoco.py",
        "write_report.py",
    ]


@pytest.mark.slow
def test_proofs_and_benchmarks_find_what_they_import():
    """Each is loaded, beside its neighbours as when it is run; none does anything yet."""
    paths = sorted(str(path) for path in SCRIPTS.glob("*/*.py"))
    assert len(paths) > 10
    code = (
        "import runpy, sys\n"
        "for path in sys.argv[1:]:\n"
        "    sys.path[0] = path.rpartition('/')[0]\n"
        "    runpy.run_path(path, run_name='loaded')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *paths], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (0, ""), done.stderr


def test_flights_are_identified_and_verified(run):
    """Parameters, the truth beside them, and the prediction of a doublet."""
    printed = run("fly_and_identify.py", 1)
    assert "rollpitch: " in printed
    assert "truth: L_b 539.5, M_a 315.1" in printed
    assert "TIC" in printed


def test_a_first_look_needs_no_flight(run, tmp_path):
    """A model from recorded logs, its prediction, and four figures."""
    printed = run("first_look.py", tmp_path)
    assert "average J" in printed
    assert "acceptable" in printed
    written = sorted(path.name for path in tmp_path.glob("*.png"))
    assert written == ["fit.png", "flight.png", "response.png", "verification.png"]


def test_a_log_is_identified(run, jr700, tmp_path):
    """Records that were written to disk; without any, the usage is printed."""
    import helisim as hs

    paths = [tmp_path / f"ped_{k}.parquet" for k in range(2)]
    for path, record in zip(paths, hs.fly(jr700, hs.Sweep(axis="ped"), count=2, seed=1)):
        write_record(record, path)
    printed = run("identify_log.py", *paths)
    assert "N_ped" in printed
    with pytest.raises(SystemExit, match="usage"):
        run("identify_log.py")


@pytest.mark.slow
def test_a_controller_of_ones_own_flies(run):
    """A higher gain has a lower peak of sensitivity; Python and compiled code fly the same."""
    printed = run("own_controller.py", 0.3, 0.5)
    peaks, errors = zip(*re.findall(r"sensitivity ([\d.]+), rate error ([\d.]+)", printed))
    assert float(peaks[0]) > float(peaks[1]) > 1.0
    assert float(errors[0]) > float(errors[1]) > 0.0
    assert printed.count("the same flight: True") == 2


def test_a_structure_of_ones_own_is_identified_and_written(run):
    """The structure that is printed as TOML is one that can be read again."""
    from helisim.ident import Structure

    printed = run("own_structure.py", 1)
    assert "poorly" not in printed
    start = printed.index('name = "roll"')
    with open("roll.toml", "w", encoding="utf-8") as file:
        file.write(printed[start:])
    again = Structure.from_toml("roll.toml")
    assert again.names == ("L_b", "tau_f", "B_lat", "tau_lat")


@pytest.mark.slow
def test_a_vehicle_of_ones_own_is_made_changed_and_identified(run, tmp_path):
    """What is wrong after the change, nothing after solving, and its yaw as it is."""
    printed = run("own_vehicle.py", "myheli", 2)
    assert "which calibration centres" in printed
    assert "myheli: All is well." in printed
    assert "tip speed               125.6 m/s" in printed
    assert (tmp_path / "myheli" / "README.md").is_file()
    found = [line.replace(",", "").split() for line in printed.splitlines() if "truth:" in line]
    for _, _, truth, _, identified in found:
        # three standard errors of N_r from two flights, of 1.7 % each
        assert float(identified) == pytest.approx(float(truth), rel=0.052)
    assert len(found) == 2


def test_a_report_of_a_fit_is_one_page(run, tmp_path):
    """Parameters, Bode plots, and the verification."""
    assert "Written: yaw.html" in run("write_report.py", "yaw.html", 2)
    page = (tmp_path / "yaw.html").read_text(encoding="utf-8")
    for part in ("N_ped", "r / ped", "Verification in the time domain"):
        assert part in page


@pytest.mark.study
def test_a_campaign_is_flown_and_looked_at(run):
    """Both levels of noise; a second run flies nothing and prints the same."""
    printed = run("run_campaign.py", "noise", 1)
    assert "heave (recorder.noise 4, flights 2, method designed)" in printed
    assert len(printed.split("replicate  noise", 1)[1].splitlines()) == 3
    assert run("run_campaign.py", "noise", 1) == printed


def test_an_agent_of_a_few_lines_flies(run):
    """The tables of what is seen and moved; no helicopter is lost, and more is won than by luck."""
    printed = run("fly_in_gymnasium.py", 4)
    assert "heading_error_sine" in printed
    assert "PED" in printed
    score, lost = re.search(r"mean return (\d+) of 500, (\d+) lost", printed).groups()
    assert int(score) > 150  # of the still sticks: some 60
    assert int(lost) == 0


@pytest.mark.study
def test_a_policy_learns_to_hover(run, tmp_path):
    """A fifth of a million frames: a curve that rises, a picture, a policy that beats none."""
    pytest.importorskip("stable_baselines3", reason="pip install helisim[learn]")
    printed = run("learn_to_hover.py", 0.2, "out")
    returns = [float(one) for one in re.findall(r"frames: return +([\d.]+)", printed)]
    assert returns[-1] > returns[0]
    assert (tmp_path / "out" / "policy.zip").is_file()
    assert (tmp_path / "out" / "curve.png").read_bytes().startswith(b"\x89PNG")
    found = re.findall(r"as it learned, .*: return ([\d.]+) of 500", printed)
    learned, held = map(float, found)
    assert learned > 2.0 * held


@pytest.mark.study
def test_four_axes_at_once_take_a_fifth_of_the_time(run):
    """The sweeps' Cramér-Rao bounds, to 5 %, and no parameter further from the truth than its own.

    5 %: over five seeds the largest ratio was 1.01; one seed's bounds scatter by a percent or two.
    """
    *_, time, bounds = run("multisine.py", 1).splitlines()
    assert time == "flight time: 288 s instead of 1440 s, 0.20"
    ratio, beyond = re.fullmatch(
        r"Cramér-Rao bounds: (.*) of the sweeps' at most; errors beyond them: (.*)", bounds
    ).groups()
    assert float(ratio) < 1.05
    assert beyond == "0"


@pytest.mark.parametrize("vehicle", ["jr700", "blade360"])
def test_stock_mujoco_flies_the_shipped_models(run, vehicle):
    """It hovers, it rolls, and of three in a scene the one climbs that is told to."""
    printed = run("stock_mujoco.py", vehicle)
    off = re.search(rf"{vehicle}: (\S+) m off after 10 s of hover", printed)
    assert float(off[1]) < 1e-7  # as in tests/models/test_stock_flight.py
    assert float(re.search(r"rolls with (\S+) rad/s", printed)[1]) > 0.2
    assert f"a/{vehicle}, b/{vehicle}, c/{vehicle}" in printed
    one, two, three = map(float, printed.splitlines()[-1].split(":")[1].split(","))
    assert one == three == 0.0
    assert two > 0.5


@pytest.mark.slow
def test_a_program_flies_by_hand(run, tmp_path):
    """Its pedals show the yaw; its landing is one."""
    printed = run("fly_by_hand.py", "hand.parquet")
    assert "hand.parquet, 90.0 s, flown with a program" in printed
    assert float(printed.split("r / PED: ")[1].split()[0]) > 0.9
    assert "landed: upright" in printed
