"""The command line on logs: identify, verify, frf, structures, their options and advice."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import helisim
from command import fails, python
from helisim.cli import main, parser
from helisim.ident import Structure, load_fit, structures
from helisim.logs import read_log
from helisim.logs.examples import copy_examples
from helisim.records.storage import write_record
from sid_logs import SidLog
from swept_logs import HEAVE, csv_writer, flown, write_foreign
from tabled import section

SLOW = {"control", "matplotlib", "mujoco", "numba", "pandas", "rerun", "scipy.signal"}
"""Modules whose import takes a tenth of a second or more."""


@pytest.fixture
def sweep_csv(tmp_path):
    return csv_writer(tmp_path)


def test_a_model_is_verified_on_another_log(tmp_path, sweep_csv, capsys):
    model, figures = tmp_path / "model.json", tmp_path / "figures.json"
    path = sweep_csv(name="sweep.csv")
    assert main(["identify", str(path), "--structure", "heave", "--json", str(model)]) == 0
    time, inputs, outputs = flown(structures.heave, HEAVE, "col", 9, duration=20.0, noise=0.01)
    other = tmp_path / "other.csv"
    headings = ["t [s]", "col [1]", "w [m/s]"]
    write_foreign(other, headings, time, [*inputs.T, *outputs.T], delimiter="|")
    capsys.readouterr()
    page = tmp_path / "verified.html"
    written = ["--json", str(figures), "--report", str(page)]
    assert main(["verify", str(model), str(other), *written]) == 0
    assert "Verification in the time domain" in page.read_text()
    assert "acceptable" in capsys.readouterr().out
    assert json.loads(figures.read_text())["tic"] < 0.05
    written = ["--segment", "5", "--json", str(figures)]
    assert main(["verify", str(model), str(other), *written]) == 0
    assert "predicted in segments of 5 s" in " ".join(capsys.readouterr().out.split())
    assert json.loads(figures.read_text())["approach"]["kind"] == "segments"
    said = fails(capsys, "verify", model, other, "--segment=0")
    assert "segment must be a number above 0" in said
    assert re.search(r"sweep\.csv.*was used in the fit", fails(capsys, "verify", model, path))
    wrong = tmp_path / "wrong.csv"
    write_foreign(wrong, headings, time, [*inputs.T, -outputs.T[0]], delimiter=",")
    assert main(["verify", str(model), str(wrong)]) == 1


OWN = Path(__file__).with_name("own_structure.toml").read_text(encoding="utf-8")
CLIMB = {"Z_w": -0.8, "Z_col": -25.0, "lag": 0.12}


def test_a_new_structure_takes_one_file(tmp_path, capsys):
    own, model = tmp_path / "climb.toml", tmp_path / "model.json"
    own.write_text(OWN)
    assert main(["structures", str(own)]) == 0
    printed = tmp_path / "printed.toml"
    printed.write_text(capsys.readouterr().out)
    structure = Structure.from_toml(own)
    assert Structure.from_toml(printed).to_dict() == structure.to_dict()
    logs = []
    for seed, duration in ((5, 60.0), (9, 20.0)):
        time, inputs, outputs = flown(structure, CLIMB, "col", seed, duration=duration, noise=0.01)
        logs.append(str(tmp_path / f"{seed}.csv"))
        headings = ["t [s]", "col [1]", "w [m/s]"]
        write_foreign(tmp_path / f"{seed}.csv", headings, time, [*inputs.T, *outputs.T])
    options = ["--band", "1", "25", "--json", str(model)]
    assert main(["identify", logs[0], "--structure", str(own), *options]) == 0
    fit = load_fit(model)
    assert fit.structure.to_dict() == structure.to_dict()
    for name, one in fit.parameters.items():
        assert abs(one.value - CLIMB[name]) < 4.0 * one.standard_error, name
        assert not one.poorly_identified, name
    assert main(["verify", str(model), logs[1]]) == 0


@pytest.mark.slow
def test_a_first_order_model_takes_no_slow_imports(tmp_path, sweep_csv):
    """`identify` draws nothing and simulates nothing, so it waits for no module that would."""
    log = str(sweep_csv())
    (record,) = read_log(log, channels=("col", "w"), resample_hz=50.0).records
    parquet = str(write_record(record, tmp_path / "sweep.parquet"))
    options = ["--structure", "tf:0/1", "--inputs", "col", "--outputs", "w", "--quiet"]
    for logs in ([log], [parquet], [log, "--resample", "40"]):
        run = f"from helisim.cli import main\nassert main({['identify', *logs, *options]!r}) == 0\n"
        python(f"{run}import sys\nfound = {SLOW!r} & set(sys.modules)\nassert not found, found")


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    path = csv_writer(tmp_path_factory.mktemp("sweep"))()
    return lambda: path


def test_what_messages_advise_exists():
    words = set()
    for package in ("ident", "records"):
        for path in (Path(helisim.__file__).parent / package).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            words |= set(re.findall(r"--[a-z][a-z-]+", text))
            for remedy in re.findall(r'remedy="([^"]+)"', text):
                names = (part.partition("=")[0] for part in remedy.split(","))
                words |= {f"--{name.replace('_', '-')}" for name in names}
    known = set()
    for command in ("identify", "frf", "verify"):
        actions = parser([command])._actions[-1].choices[command]._actions
        known |= {name for action in actions for name in action.option_strings}
    assert words <= known


def test_a_poor_fit_names_the_options_that_help(tmp_path, swept, capsys):
    """One search from far away, and a bound that holds: the output says what to try."""
    options = ["--structure", "heave", "--searches", "1", "--bounds", "Z_w=-0.5:-0.4"]
    options += ["--start", "Z_w=-0.45"]
    main(["identify", str(swept()), *options])
    printed = " ".join(capsys.readouterr().out.split())
    assert "say where to start (--searches, --start)" in printed
    assert "doubt the structure (--bounds)" in printed


def fitted(tmp_path, logs, *options, structure):
    model = tmp_path / "model.json"
    where = ["--structure", structure, "--json", str(model), "--quiet"]
    assert main(["identify", *map(str, logs), *where, *options]) in (0, 1, 3)
    return load_fit(model)


def test_estimator_and_bounds_are_the_users(tmp_path, swept):
    out = tmp_path / "frf.json"
    signals = ["--inputs", "col", "--outputs", "w", "--band", "2", "20", "--quiet"]
    words = ["--estimator", "windows", "--json", str(out)]
    assert main(["frf", str(swept()), *signals, *words]) == 0
    assert json.loads(out.read_text())["response"]["estimator"] == "windows"
    path = swept()
    bounds = ["--bounds", "Z_w=-0.5:-0.4", "--start", "Z_w=-0.45"]
    held = fitted(tmp_path, [path], *bounds, structure="heave")
    assert held["Z_w"].value == pytest.approx(-0.5)
    assert held.at_bound == ("Z_w",)
    free = fitted(tmp_path, [path], "--bounds", "Z_w=:-0.4", structure="heave")
    assert free["Z_w"].value < -0.6
    assert free["Z_w"].definition.limits == (-np.inf, -0.4)


def test_short_records_are_fitted_by_their_likelihood(tmp_path, capsys):
    time, inputs, outputs = flown(structures.heave, HEAVE, "col", 9, duration=8.0, noise=0.01)
    path = tmp_path / "short.csv"
    headings = ["t [s]", "col [1]", "w [m/s]"]
    write_foreign(path, headings, time, [*inputs.T, *outputs.T], delimiter=",")
    fit = fitted(tmp_path, [path], structure="heave")
    assert fit.data.estimator == "likelihood"
    assert "Fourier transforms" in capsys.readouterr().out
    for name, value in HEAVE.items():  # three stated errors
        assert abs(fit[name].value - value) < 3.0 * fit[name].standard_error
    local = fitted(tmp_path, [path], "--estimator", "local", structure="heave")
    assert local.data.estimator == "local"
    capsys.readouterr()
    words = ["--structure", "heave", "--estimator", "likelihood", "--responses", "w/col"]
    assert "--responses: the likelihood is of all" in fails(capsys, "identify", path, *words)


def test_what_is_known_from_a_bench_carries_its_error(tmp_path, swept):
    path = swept()
    exact = fitted(tmp_path, [path], "--fix", "Z_w=-0.8", structure="heave")
    fit = fitted(tmp_path, [path], "--fix", "Z_w=-0.8+-0.5", structure="heave")
    assert fit["Z_w"].definition.error == 0.5
    assert fit["Z_col"].value == pytest.approx(exact["Z_col"].value)
    assert fit["Z_col"].standard_error > 1.2 * exact["Z_col"].standard_error


def test_recorded_sticks_are_the_reference(tmp_path, capsys):
    copy_examples(tmp_path)
    log = str(tmp_path / "sweep_ped.parquet")
    words = ["identify", log, "--structure", "yaw_base", "--quiet"]
    main(words)
    said = capsys.readouterr().out
    assert "joint input-output" in said
    assert "the direct estimate beside it" in said
    main([*words, "--reference", "none"])
    said = capsys.readouterr().out
    assert "rad/s, direct, local" in said
    assert "verdict: doubtful: feedback" in said  # N_r is 1.8 errors from the joint one's
    assert "beside it" not in said


# `helisim identify flight.bin`, and nothing else.

SHORT = {"length": 12.0, "low": 1.0}


def test_options_overrule_what_the_log_says(tmp_path, capsys):
    path = SidLog().sweep(10, **SHORT).sweep(12, **SHORT).save(tmp_path)
    out = tmp_path / "yaw.json"
    words = ["--structure", "yaw_base", "--band", "8", "40", "--channel", "r=RATE.Y:deg/s"]
    main(["identify", str(path), *words, "--json", str(out), "--quiet"])
    text = capsys.readouterr().out
    assert "r = RATE.Y [deg/s], 100 Hz: given" in text
    assert "from 8 to 40 rad/s" in text.replace("\n", " ")
    assert out.exists()


def test_a_refused_fit_and_a_sweep_that_sank_end_no_other(tmp_path, capsys):
    log, out = SidLog().sweep(10, lands=6.0, told="height", **SHORT), tmp_path / "model.json"
    for axis in (11, 12, 13):
        log.sweep(axis, noise=0.3, seed=axis, **SHORT)
    words = [str(log.save(tmp_path)), "--channel", "q=SIDD.Gz:deg/s", "--json", str(out)]
    assert main(["identify", *words]) == 2
    printed = capsys.readouterr()
    named = r"mixer roll: .*not used: it was on the ground, or within 0\.5 m of it, at 15\.8 s"
    assert re.search(named, " ".join(printed.out.split()))
    (said,) = (one for one in printed.err.splitlines() if "q_lon isn't identified: " in one)
    assert "no response has 5 points with a coherence of 0.6" in said
    models = {path.stem: json.loads(path.read_text()) for path in tmp_path.glob("*.json")}
    assert sorted(models) == ["model-heave_imu", "model-yaw_alone"]


def test_what_cannot_be_used_is_said_in_one_line(tmp_path, capsys):
    path, other = SidLog().save(tmp_path), tmp_path / "a.csv"
    assert "no SystemID messages (SIDS, SIDD)" in fails(capsys, "identify", path)
    assert "has one" in fails(capsys, "identify", path, "--time", "t:s")
    other.write_text("t,p\n0,0\n")
    assert "--structure has to be said" in fails(capsys, "identify", other)
    SidLog().sweep(10, **SHORT).sweep(12, **SHORT).save(tmp_path)
    assert "choose one by --structure" in fails(capsys, "identify", path, "--fix", "N_r=-3")


CODE = section(globals(), "CODE")


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="peak memory is read of Linux")
def test_ten_minutes_are_identified_within_twice_the_logs_memory(tmp_path):
    """Sweeps at 400 Hz between what an autopilot logs besides: 110 MB, 2 million messages."""
    log = SidLog(rate=400.0)
    count = 250_000
    fields = [("head", "u1", 3), ("us", "<u8"), ("numbers", "<f4", 10), ("flag", "u1")]
    rows = np.zeros(count, fields)
    rows["head"] = (0xA3, 0x95, 90)
    rows["us"] = 2500 * np.arange(count)
    rows["numbers"] = np.random.default_rng(1).normal(size=(count, 10)) * 20.0
    for number in (90, 91):
        log.define(number, f"PI{number}", "Q" + 10 * "f" + "B", "TimeUS,A,B,C,D,E,F,G,H,I,J,K")
    for axis in (10, 11, 12, 13):
        for number in (90, 91):
            rows["head"][:, 2] = number
            log.messages.append(rows.tobytes())
        log.sweep(axis)
    path = log.save(tmp_path)
    size = path.stat().st_size
    assert size > 100e6
    status, kilobytes, fitted = python(CODE, path).split()
    assert (status, fitted) == ("0", "True")
    assert 1024.0 * float(kilobytes) < 2.0 * size
