"""The command line on logs by other programs: identify, frf, verify, structures."""

import csv
import json
import sys
from pathlib import Path

import numpy as np
import pytest

from helisim.channels import channel
from helisim.cli import main
from helisim.ident import load_fit, structures
from helisim.record import FlightRecord
from helisim.storage import write_record

sys.path.insert(0, str(Path(__file__).parent / "recovery"))

import plants

FOOT = 0.3048
ROLLPITCH = plants.ROLLPITCH_IN1
HEAVE = {"Z_w": -0.8, "Z_col": -25.0, "tau_col": 0.03}
MAP = """\
[time]
column = "Zeit"
unit = "ms"

[channels.lat]
column = "Kanal 1"
unit = "us"
trim = 1520
range = 800

[channels.lon]
column = "Kanal 2"
unit = "us"
trim = 1490
range = -800

[channels.p]
column = "Rollrate"
unit = "deg/s"

[channels.q]
column = "Nickrate"
unit = "deg/s"
sign = -1
"""


def fails(capsys, *arguments):
    """Run a command that must fail on its input; return the one line that it prints."""
    try:
        status = main(list(map(str, arguments)))
    except SystemExit as exit_:
        status = exit_.code
    captured = capsys.readouterr()
    assert status == 2, captured
    assert captured.out == ""
    lines = captured.err.strip().splitlines()
    assert len(lines) == 1, captured.err
    return lines[0]


def flown(structure, values, axis, seed, *, duration=60.0, noise=0.0, jitter=False):
    """Return time, inputs and outputs of a sweep, uniform or with 20 ms jitter."""
    random = np.random.default_rng(seed)
    inputs = np.zeros((round(duration * plants.RATE), len(structure.inputs)))
    for k, name in enumerate(structure.inputs):
        inputs[:, k] = (
            plants.sweep(duration, 1.0, 40.0, 0.1)
            if name == axis
            else plants.coloured(random, inputs.shape[0], 0.003, 20.0)
        )
    outputs = plants.respond(structure, values, inputs)
    if jitter:  # steps from 0.5 to 20.5 ms, on the simulation's grid
        rows = np.cumsum(random.integers(1, 42, size=inputs.shape[0] // 21))
        rows = rows[rows < inputs.shape[0]]
    else:
        rows = np.arange(0, inputs.shape[0], plants.KEEP)
    outputs = outputs[rows] + noise * random.standard_normal((rows.size, outputs.shape[1]))
    return rows / plants.RATE, inputs[rows], outputs


def write_clean(path, structure, values, axis, seed, noise):
    """Write a sweep as helisim records it."""
    time, inputs, outputs = flown(structure, values, axis, seed, noise=noise)
    names = (*structure.inputs, *structure.outputs)
    record = FlightRecord(time, np.hstack([inputs, outputs]), tuple(map(channel, names)))
    write_record(record, path)


def write_foreign(path, headings, time, columns, *, delimiter=";", encoding="utf-8"):
    """Write columns as another program does."""
    with path.open("w", newline="", encoding=encoding) as file:
        writer = csv.writer(file, delimiter=delimiter)
        writer.writerow(headings)
        for row in zip(time, *columns):
            writer.writerow([f"{cell:.10g}" for cell in row])


def same_within_errors(clean, foreign):
    """Assert that two fits' parameters agree within three of their difference's errors."""
    for name, one in clean.parameters.items():
        other = foreign[name]
        error = np.hypot(one.standard_error, other.standard_error)
        assert abs(other.value - one.value) <= 3.0 * error, (name, one.value, other.value, error)


def test_a_foreign_log_in_degrees_gives_the_same_model(tmp_path, capsys):
    """Pulses and deg/s with 20 ms jitter give the parameters of the clean record."""
    (tmp_path / "map.toml").write_text(MAP.replace("range = -800", "range = 800\nsign = -1"))
    clean, foreign = [], []
    for k, axis in enumerate(("lat", "lon")):
        structure = structures.rollpitch
        clean.append(tmp_path / f"{axis}.parquet")
        write_clean(clean[-1], structure, ROLLPITCH, axis, k, 0.01)
        time, inputs, outputs = flown(structure, ROLLPITCH, axis, 10 + k, noise=0.01, jitter=True)
        p, q = np.degrees(outputs).T
        pulses = 1520.0 + 800.0 * inputs[:, 0], 1490.0 - 800.0 * inputs[:, 1]
        foreign.append(tmp_path / f"{axis}.csv")
        headings = ["Zeit", "Nickrate", "Rollrate", "Kanal 1", "Kanal 2"]
        write_foreign(foreign[-1], headings, 1e3 * time, [-q, p, *pulses])
    options = ["--structure", "rollpitch", "--band", "1", "40"]
    one, two = tmp_path / "clean.json", tmp_path / "foreign.json"
    assert main(["identify", *map(str, clean), *options, "--json", str(one)]) == 0
    capsys.readouterr()
    options += ["--map", str(tmp_path / "map.toml"), "--resample", "100"]
    assert main(["identify", *map(str, foreign), *options, "--json", str(two)]) == 0
    printed = capsys.readouterr().out
    assert "resampled to 100 Hz" in printed
    assert "('Kanal 1' - 1520) / 800" in printed
    same_within_errors(load_fit(one), load_fit(two))
    logs = json.loads(two.read_text())["logs"]
    assert logs[0]["step_s"]["largest"] == pytest.approx(0.0205)
    assert logs[0]["resampled_hz"] == 100.0


def test_a_foreign_log_in_feet_gives_the_same_model(tmp_path, capsys):
    """A climb in ft/min, percent and UTF-16 with 20 ms jitter gives the clean record's model."""
    clean, foreign = tmp_path / "clean.csv", tmp_path / "foreign.txt"
    write_clean(clean, structures.heave, HEAVE, "col", 3, 0.01)
    time, inputs, outputs = flown(structures.heave, HEAVE, "col", 4, noise=0.01, jitter=True)
    climb = -outputs[:, 0] / FOOT * 60.0
    headings = ["t [s]", "climb (ft/min)", "collective"]
    columns = [climb, 60.0 + 100.0 * inputs[:, 0]]
    write_foreign(foreign, headings, time, columns, delimiter="\t", encoding="utf-16")
    options = ["--structure", "heave", "--band", "0.8", "30", "--quiet"]
    one, two = tmp_path / "clean.json", tmp_path / "foreign.json"
    assert main(["identify", str(clean), *options, "--json", str(one)]) == 0
    options += ["--channel", "w=climb::sign=-1", "--channel", "col=collective:percent:trim=60"]
    assert main(["identify", str(foreign), *options, "--resample", "90", "--json", str(two)]) == 0
    same_within_errors(load_fit(one), load_fit(two))


@pytest.fixture
def sweep_csv(tmp_path):
    """Return a function that writes a heave sweep as CSV, its cells changed by the test."""
    time, inputs, outputs = flown(structures.heave, HEAVE, "col", 5, duration=30.0, noise=0.01)
    rows = [[f"{cell:.8g}" for cell in row] for row in zip(time, inputs[:, 0], outputs[:, 0])]

    def write(change=lambda rows: rows, header="t [s],col [1],w [m/s]", name="bad.csv"):
        path = tmp_path / name
        lines = [header, *(",".join(row) for row in change([list(row) for row in rows]))]
        path.write_text("\n".join(lines) + "\n")
        return path

    return write


def changed(row, column, text):
    """Return a change of one cell."""

    def change(rows):
        rows[row][column] = text
        return rows

    return change


def empty(column, rows_of=lambda k: True):
    """Return a change that empties a column where `rows_of` holds."""

    def change(rows):
        for k, row in enumerate(rows):
            row[column] = "" if rows_of(k) else row[column]
        return rows

    return change


def swapped(rows):
    rows[99], rows[100] = rows[100], rows[99]
    return rows


def constant(rows):
    return [[time, "0.25", w] for time, _, w in rows]


@pytest.mark.parametrize(
    ("change", "header", "says"),
    [
        (None, "t [s],stick [1],w [m/s]", ["bad.csv", "'col'", "'stick [1]'", "--channel"]),
        (None, "t [s],col,w [m/s]", ["bad.csv", "'col'", "unit"]),
        (changed(41, 2, "fast"), None, ["bad.csv, line 43, column 'w [m/s]'", "'fast'"]),
        (changed(41, 2, "inf"), None, ["bad.csv, line 43, column 'w [m/s]'", "finite"]),
        (changed(41, 2, "0,5"), None, ["bad.csv, line 43: 4 columns"]),
        (empty(2), None, ["bad.csv, column 'w [m/s]', lines 2 to 3001", "no number"]),
        (empty(1), None, ["bad.csv, column 'col [1]', lines 2 to 3001", "no number"]),
        (empty(0, lambda k: k == 7), None, ["bad.csv, line 9, column 't [s]'", "no time"]),
        (
            empty(2, lambda k: k % 10 == 4),
            None,
            ["bad.csv, line 6, column 'w [m/s]'", "300 of 3000", "'missing'"],
        ),
        (constant, None, ["bad.csv, column 'col [1]', lines 2 to 3001", "constant"]),
        (lambda rows: rows[:2], None, ["bad.csv, lines 2 to 3", "too short"]),
        (lambda rows: rows[:1], None, ["bad.csv, lines 2 to 2", "too short"]),
        (lambda rows: [], None, ["bad.csv", "no numbers"]),
        (swapped, None, ["bad.csv, line 102, column 't [s]'", "goes back", "'order'"]),
        (
            lambda rows: rows[:1000] + rows[:2000],
            None,
            ["bad.csv, line 1002, column 't [s]'", "goes back", "'resets'"],
        ),
        (
            lambda rows: [*rows[:50], rows[49], *rows[50:]],
            None,
            ["bad.csv, line 52, column 't [s]'", "same time", "'duplicates'"],
        ),
        (
            lambda rows: [row for k, row in enumerate(rows) if k % 500 not in range(400, 450)],
            None,
            ["bad.csv, line 402, column 't [s]'", "gap", "10 %", "'gaps'"],
        ),
    ],
)
def test_a_bad_log_is_one_line_with_its_place(sweep_csv, capsys, change, header, says):
    """What is wrong with a log is said with file, column and row, and what to do."""
    path = sweep_csv(change or (lambda rows: rows), header or "t [s],col [1],w [m/s]")
    out = path.with_suffix(".json")
    message = fails(capsys, "identify", path, "--structure", "heave", "--json", out, *RESAMPLE)
    for text in says:
        assert text in message
    assert not out.exists()


RESAMPLE = ["--resample", "50"]


def test_uneven_samples_are_refused_until_resampled(sweep_csv, capsys):
    """A tenth of the rows missing at random is refused with a row, and said how to mend."""
    random = np.random.default_rng(0)
    path = sweep_csv(lambda rows: [row for row in rows if random.random() > 0.1])
    message = fails(capsys, "identify", path, "--structure", "heave")
    assert "bad.csv, line " in message
    assert "column 't [s]'" in message
    assert "--resample" in message
    arguments = ["identify", str(path), "--structure", "heave", "--resample", "50"]
    assert main([*arguments, "--max-gap", "0.1"]) == 0


def test_inputs_that_move_as_one_are_refused(tmp_path, capsys):
    """Fully coherent inputs end in one line with file, both columns and rows."""
    time, inputs, outputs = flown(structures.rollpitch, ROLLPITCH, "lat", 5, duration=40.0)
    path = tmp_path / "both.csv"
    headings = ["t [s]", "lat [1]", "mixed [1]", "p [rad/s]", "q [rad/s]"]
    columns = [inputs[:, 0], 0.5 * inputs[:, 0], *outputs.T]
    write_foreign(path, headings, time, columns, delimiter=",")
    options = ["--channel", "lon=mixed", "--band", "2", "30"]
    message = fails(capsys, "identify", path, "--structure", "rollpitch", *options)
    for text in ("both.csv", "'lat [1]'", "'mixed [1]'", "lines 2 to 4001", "can't be told apart"):
        assert text in message


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
    assert len(found["reduction"]["steps"]) >= 1
    first = found["reduction"]["steps"][0]
    assert first["dropped"]
    assert first["cost_after"] == pytest.approx(first["cost_before"], abs=0.1)  # K is Z_w again
    asked = found["provenance"]["options"]
    assert (asked["seed"], asked["weighting"], asked["searches"]) == (3, "error", 12)
    assert load_fit(model).options == asked


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


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--structure", "heavy"], "heave"),
        (["--structure", "none.toml"], "none.toml"),
        (["--structure", "tf:3/2", "--inputs", "col", "--outputs", "w"], "zeros <= poles"),
        (["--structure", "tf:1/2"], "--inputs"),
        (["--structure", "rollpitch", "--inputs", "col", "--outputs", "w"], "--rename"),
        (["--structure", "heave", "--fix", "Z_q=1"], "Z_w"),
        (["--structure", "heave", "--fix", "Z_w"], "NAME=VALUE"),
        (["--structure", "heave", "--rename", "col"], "OLD=NEW"),
        (["--structure", "heave", "--band", "20", "1"], "band"),
        (["--structure", "heave", "--json", "no/such.json"], "not a folder"),
        (["--structure", "heave", "--json", "model.txt"], ".json"),
        (["--structure", "heave", "--map", "none.toml"], "none.toml"),
        (["--structure", "heave", "--channel", "w"], "--channel"),
        (["--structure", "heave", "--channel", "w=w:furlong"], "deg/s"),
        (["--structure", "heave", "--channel", "w=w:ft:trim=x"], "trim=x"),
        (["--structure", "heave", "--channel", "w=w:deg"], "m/s"),
        (["--structure", "heave", "--time", "clock:s"], "'clock'"),
        (["--structure", "heave", "--rate", "-5"], "rate"),
        (["--structure", "heave", "--repair", "everything"], "duplicates"),
        (["--structure", "heave", "--resample", "0"], "resample"),
        (["--structure", "heave", "--responses", "q/lat"], "w/col"),
        (["--structure", "heave", "--reference", "COL"], "'COL'"),
        ([], "--structure"),
    ],
)
def test_a_bad_option_is_one_line_and_status_2(sweep_csv, monkeypatch, capsys, arguments, says):
    """Every mistake ends in one line that says what to do, and leaves no file."""
    path = sweep_csv()
    monkeypatch.chdir(path.parent)
    assert says in fails(capsys, "identify", path, *arguments)
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize("command", ["identify", "frf", "verify", "structures"])
def test_help_has_an_example(capsys, command):
    """--help of every command explains it and gives an example."""
    with pytest.raises(SystemExit) as exit_:
        main([command, "--help"])
    assert exit_.value.code == 0
    assert f"helisim {command}" in capsys.readouterr().out.split("example:")[1]
