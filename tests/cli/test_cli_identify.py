"""The command line on logs: identify, verify, frf, structures, and their options."""

import csv
import json
import subprocess
import sys
import textwrap
import tomllib

import numpy as np
import pytest

from command import fails
from helisim.cli import main
from helisim.ident import Structure, load_fit, structures
from helisim.logs import read_log
from helisim.logs.mapping import Map
from helisim.records.storage import write_record
from swept_logs import HEAVE, csv_writer, flown, write_foreign

RESAMPLE = ["--resample", "50"]
SLOW = {"control", "matplotlib", "mujoco", "numba", "pandas", "rerun", "scipy.signal"}
"""Modules whose import takes a tenth of a second or more."""


@pytest.fixture
def sweep_csv(tmp_path):
    return csv_writer(tmp_path)


def test_a_model_is_verified_on_another_log(tmp_path, sweep_csv, capsys):
    """`verify` reads identify's JSON, judges another log, and refuses the log of the fit."""
    model, figures = tmp_path / "model.json", tmp_path / "figures.json"
    path = sweep_csv(name="sweep.csv")
    assert main(["identify", str(path), "--structure", "heave", "--json", str(model)]) == 0
    time, inputs, outputs = flown(structures.heave, HEAVE, "col", 9, duration=20.0, noise=0.01)
    other = tmp_path / "other.csv"
    headings = ["t [s]", "col [1]", "w [m/s]"]
    write_foreign(other, headings, time, [*inputs.T, *outputs.T], delimiter="|")
    capsys.readouterr()
    assert main(["verify", str(model), str(other), "--json", str(figures)]) == 0
    assert "acceptable" in capsys.readouterr().out
    assert json.loads(figures.read_text())["tic"] < 0.05
    message = fails(capsys, "verify", model, path)
    assert "sweep.csv" in message
    assert "was used in the fit" in message
    wrong = tmp_path / "wrong.csv"
    write_foreign(wrong, headings, time, [*inputs.T, -outputs.T[0]], delimiter=",")
    assert main(["verify", str(model), str(wrong)]) == 1


def test_a_model_is_verified_in_segments_and_ahead(tmp_path, sweep_csv, capsys):
    """--segment and --ahead are the library's, and the output says what was done."""
    model, figures = tmp_path / "model.json", tmp_path / "figures.json"
    path = sweep_csv(name="sweep.csv")
    assert main(["identify", str(path), "--structure", "heave", "--json", str(model)]) == 0
    time, inputs, outputs = flown(structures.heave, HEAVE, "col", 9, duration=20.0, noise=0.01)
    other = tmp_path / "other.csv"
    write_foreign(other, ["t [s]", "col [1]", "w [m/s]"], time, [*inputs.T, *outputs.T])
    for options, kind, says in (
        (["--segment", "5"], "segments", "predicted in segments of 5 s"),
        (["--ahead", "0.5", "--segment", "4"], "ahead", "predicted 0.5 s ahead"),
    ):
        capsys.readouterr()
        assert main(["verify", str(model), str(other), *options, "--json", str(figures)]) == 0
        assert says in " ".join(capsys.readouterr().out.split())
        approach = json.loads(figures.read_text())["approach"]
        assert approach["kind"] == kind
        assert approach["pole"] is None
    assert "must be a positive time in s" in fails(capsys, "verify", model, other, "--ahead=0")


def test_a_part_of_a_log_is_used_and_known_again(tmp_path, sweep_csv, capsys):
    """--from and --to cut a log; what a fit has seen can't verify it, wherever it is cut."""
    path, model = sweep_csv(name="sweep.csv"), tmp_path / "model.json"
    part = ["--from", "3", "--to", "20"]
    options = ["--structure", "heave", "--json", str(model)]
    assert main(["identify", str(path), *options, *part]) == 0
    assert "from 3 s to 20 s" in capsys.readouterr().out
    (log,) = json.loads(model.read_text())["logs"]
    assert log["parts"][0]["start_s"] == pytest.approx(3.0)
    assert log["parts"][0]["duration_s"] == pytest.approx(17.0)
    assert "was used in the fit" in fails(capsys, "verify", model, path, "--from=6", "--to=12")
    assert main(["verify", str(model), str(path), "--from", "20.1"]) == 0
    capsys.readouterr()
    for limits, says in (
        (["--from", "500"], "0 samples from 500 s to the end, and the log goes from 0 to"),
        (["--from", "50", "--to", "10"], "expected start < stop"),
        (["--to", "nan"], "expected start < stop"),
    ):
        assert says in fails(capsys, "identify", path, *options, *limits)


def test_a_reduction_is_kept_with_the_model(tmp_path, sweep_csv):
    """--reduce --json has every attempt with its costs, and what the search was asked."""
    own, model = tmp_path / "own.toml", tmp_path / "model.json"
    needless = structures.heave.to_toml().replace('Z_w"', 'Z_w + K"')
    own.write_text(needless + '[parameters.K]\nunit = "1/s"\nstart = 0.1\n')
    options = ["--structure", str(own), "--reduce", "--seed", "3", "--json", str(model)]
    assert main(["identify", str(sweep_csv()), *options]) == 0
    found = json.loads(model.read_text())
    # Z_w and K stand for each other, so rounding says which of them is tried first
    (drop,) = (step for step in found["reduction"]["steps"] if step["dropped"])
    assert drop["cost_after"] == pytest.approx(drop["cost_before"], abs=0.1)
    asked = found["provenance"]["options"]
    assert (asked["seed"], asked["weighting"], asked["searches"]) == (3, "error", 12)
    assert load_fit(model).options == asked


OWN = """
name = "climb"
states = ["w", "inflow"]
inputs = ["col"]
outputs = ["w"]
[parameters.Z_w]
unit = "1/s"
start = -0.5
[parameters.Z_col]
unit = "m/s^2"
start = -10.0
[parameters.lag]
unit = "s"
start = 0.1
bounds = [0.01, 1.0]
[M]
inflow = { inflow = "lag" }
[F]
w = { w = "Z_w", inflow = "Z_col" }
inflow = { inflow = -1 }
[G]
inflow = { col = 1 }
"""
CLIMB = {"Z_w": -0.8, "Z_col": -25.0, "lag": 0.12}


def test_a_new_structure_takes_one_file(tmp_path, capsys):
    """A TOML file is printed, identified with, stored in the model, and verified with."""
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


def test_a_damaged_model_is_refused(tmp_path, sweep_csv, capsys):
    """A model file that is cut or isn't one ends in one line with its name."""
    path, model = sweep_csv(), tmp_path / "model.json"
    for text in ("", "{", "[]", '{"format": "other"}', '{"format": "helisim fit, version 1"}'):
        model.write_text(text)
        assert "model.json" in fails(capsys, "verify", model, path)
    assert "none.json" in fails(capsys, "verify", tmp_path / "none.json", path)


def test_frequency_responses_are_written(tmp_path, sweep_csv, capsys):
    """`frf` writes the response that the heave model has, as CSV and JSON."""
    out, data = tmp_path / "frf.csv", tmp_path / "frf.json"
    arguments = ["--inputs", "col", "--outputs", "w", "--band", "1.5", "20"]
    files = ["--csv", str(out), "--json", str(data)]
    assert main(["frf", str(sweep_csv()), *arguments, *files]) == 0
    assert "w/col" in capsys.readouterr().out
    first, *lines = out.read_text().splitlines()
    provenance = json.loads(first.removeprefix("# provenance: "))
    assert provenance["band_rad_s"] == pytest.approx([1.5, 20.0])
    assert provenance == json.loads(data.read_text())["provenance"]
    rows = list(csv.DictReader(lines))
    middle = rows[len(rows) // 2]
    omega = float(middle["frequency [rad/s]"])
    gain = 20.0 * np.log10(abs(HEAVE["Z_col"]) / np.hypot(omega, HEAVE["Z_w"]))
    error = 4.0 * float(middle["w/col random error [1]"])
    assert 0.0 < error < 0.2
    measured = float(middle["w/col magnitude [dB]"])
    assert measured == pytest.approx(gain, abs=20.0 * np.log10(1.0 + error))
    assert len(json.loads(data.read_text())["response"]["frequency"]) == len(rows)


def test_a_parameter_is_fixed_and_a_channel_renamed(tmp_path, sweep_csv, capsys):
    """--fix keeps a value, --rename takes other channels, --latex and --matlab write files."""
    path = sweep_csv(header="t [s],COL [1],w [m/s]")
    table, mat = tmp_path / "heave.tex", tmp_path / "heave.mat"
    arguments = ["--structure", "heave", "--rename", "col=COL", "--fix", "Z_w=-0.8"]
    files = ["--latex", str(table), "--matlab", str(mat)]
    assert main(["identify", str(path), *arguments, *files]) == 0
    assert "fixed" in capsys.readouterr().out
    assert "tabular" in table.read_text()
    assert mat.stat().st_size > 0


def test_a_transfer_function_and_a_file_are_structures(tmp_path, sweep_csv, capsys):
    """tf:0/1 and a TOML file that `structures` printed give the built-in heave's result."""
    path = str(sweep_csv())
    assert main(["structures", "heave"]) == 0
    file = tmp_path / "own.toml"
    file.write_text(capsys.readouterr().out)
    values = []
    for structure in ("heave", str(file), "tf:0/1"):
        out = tmp_path / "m.json"
        names = ["--inputs", "col", "--outputs", "w", "--json", str(out)]
        assert main(["identify", path, "--structure", structure, *names]) == 0
        fit = load_fit(out)
        values.append(fit.values.get("Z_w", -fit.values.get("a0", 0.0)))
    assert values == pytest.approx([values[0]] * 3, rel=1e-6)


def test_structures_are_listed(capsys):
    """`structures` names every built-in structure."""
    assert main(["structures"]) == 0
    printed = capsys.readouterr().out
    assert all(name in printed for name in structures.BUILT_IN)


@pytest.mark.parametrize("command", ["identify", "frf", "verify", "structures"])
def test_help_has_an_example(capsys, command):
    """--help of every command explains it and gives an example."""
    with pytest.raises(SystemExit) as exit_:
        main([command, "--help"])
    assert exit_.value.code == 0
    assert f"helisim {command}" in capsys.readouterr().out.split("example:")[1]


@pytest.mark.slow
def test_a_first_order_model_takes_no_slow_imports(tmp_path, sweep_csv):
    """`identify` draws nothing and simulates nothing, so it waits for no module that would."""
    log = str(sweep_csv())
    (record,) = read_log(log, channels=("col", "w"), resample_hz=50.0).records
    parquet = str(write_record(record, tmp_path / "sweep.parquet"))
    options = ["--structure", "tf:0/1", "--inputs", "col", "--outputs", "w", "--quiet"]
    for logs in ([log], [parquet], [log, "--resample", "40"]):
        run = [
            "import sys",
            "from helisim.cli import main",
            f"assert main({['identify', *logs, *options]!r}) == 0",
            f"assert not {SLOW!r} & set(sys.modules), {SLOW!r} & set(sys.modules)",
        ]
        subprocess.run([sys.executable, "-c", "\n".join(run)], check=True)


def test_the_map_of_the_help_is_a_map(capsys):
    """The example that a user copies is read, with its comments."""
    with pytest.raises(SystemExit):
        main(["identify", "--help"])
    page = textwrap.dedent(capsys.readouterr().out.split("such as\n  [time]")[1])
    example = textwrap.dedent("  [time]" + page.partition("\n\n  [file]")[0])
    given = Map.from_dict(tomllib.loads(example))
    assert given.channels["lat"].trim == 1520
    assert given.time is not None
    assert given.time.unit == "us"
