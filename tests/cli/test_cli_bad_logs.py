"""The command line on logs of others: a mistake is one line, other units give the same model."""

import json

import numpy as np
import plants
import pytest

from command import fails
from helisim.cli import main
from helisim.ident import load_fit, structures
from swept_logs import BAD, csv_writer, flown, same_within_errors, write_clean, write_foreign

ROLLPITCH = plants.ROLLPITCH_IN1


@pytest.fixture
def sweep_csv(tmp_path):
    return csv_writer(tmp_path)


def test_uneven_samples_are_refused_until_resampled(sweep_csv, capsys):
    random = np.random.default_rng(0)
    path = sweep_csv(lambda rows: [row for row in rows if random.random() > 0.1])
    message = fails(capsys, "identify", path, "--structure", "heave")
    for text in ("bad.csv, line ", "column 't [s]'", "--resample"):
        assert text in message
    arguments = ["identify", str(path), "--structure", "heave", "--resample", "50"]
    assert main([*arguments, "--max-gap", "0.1"]) == 0


def test_inputs_that_move_as_one_are_refused(tmp_path, capsys):
    time, inputs, outputs = flown(structures.rollpitch, ROLLPITCH, "lat", 5, duration=40.0)
    path = tmp_path / "both.csv"
    headings = ["t [s]", "lat [1]", "mixed [1]", "p [rad/s]", "q [rad/s]"]
    columns = [inputs[:, 0], 0.5 * inputs[:, 0], *outputs.T]
    write_foreign(path, headings, time, columns, delimiter=",")
    options = ["--channel", "lon=mixed", "--band", "2", "30"]
    message = fails(capsys, "identify", path, "--structure", "rollpitch", *options)
    for text in ("both.csv", "'lat [1]'", "'mixed [1]'", "lines 2 to 4001"):
        assert text in message


def test_several_faults_of_several_logs_are_printed_together(sweep_csv, capsys):
    holes = sweep_csv(BAD["holes"], name="holes.csv")
    dead = sweep_csv(BAD["twice"], name="repeats.csv")
    out = holes.with_suffix(".json")
    arguments = ["identify", str(holes), str(dead), "--structure", "heave", "--json", str(out)]
    assert main(arguments) == 2
    captured = capsys.readouterr()
    lines = captured.err.splitlines()
    assert lines[0] == "helisim identify: 2 things are wrong with the logs:"
    assert "holes.csv, line 6, column 'w [m/s]': no number" in lines[1]
    assert "repeats.csv, line 52" in lines[2]
    assert "'duplicates'" in lines[2]
    assert len(lines) == 3
    assert not out.exists()
    assert captured.out == ""


MAP = """\
time = { column = "Zeit", unit = "ms" }
[channels]
lat = { column = "Kanal 1", unit = "us", trim = 1520, range = 800 }
lon = { column = "Kanal 2", unit = "us", trim = 1490, range = 800, sign = -1 }
p = { column = "Rollrate", unit = "deg/s" }
q = { column = "Nickrate", unit = "deg/s", sign = -1 }
"""


@pytest.mark.slow
def test_a_foreign_log_in_degrees_gives_the_same_model(tmp_path, capsys):
    (tmp_path / "map.toml").write_text(MAP)
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


STRUCTURE = """\
name = "roll"
states = ["p", "phi"]
inputs = ["lat"]
outputs = ["p", "phi"]
F = [["L_p", 0], [1, 0]]
G = [["L_lat"], [0]]
[parameters]
L_p = { unit = "1/s", start = -3 }
L_lat = { unit = "1/s^2", start = 50 }
"""


def write(path, factor):
    """Write a roll of p' = -6 p + 90 lat as CSV, the rate times a factor."""
    t = np.arange(6000) / 100.0
    lat = 0.1 * np.sin(np.cumsum(np.geomspace(1.0, 20.0, t.size)) / 100.0)
    p, phi = np.zeros(t.size), np.zeros(t.size)
    for k in range(1, t.size):
        p[k] = p[k - 1] * np.exp(-0.06) + (1.0 - np.exp(-0.06)) * 15.0 * lat[k - 1]
        phi[k] = phi[k - 1] + 0.005 * (p[k] + p[k - 1])
    table = np.column_stack([t, lat, factor * p, phi])
    header = "t [s],lat [1],p [rad/s],phi [rad]"
    np.savetxt(path, table, delimiter=",", header=header, comments="")
    return path


@pytest.mark.slow
def test_a_fit_that_fails_is_explained(tmp_path, capsys):
    """A rate in deg/s declared rad/s: by the data, and by the log's own attitude."""
    structure = tmp_path / "roll.toml"
    structure.write_text(STRUCTURE)
    log = write(tmp_path / "roll.csv", 180.0 / np.pi)
    options = ["--structure", str(structure), "--band", "2", "15", "--quiet"]
    assert main(["identify", str(log), *options]) == 1
    printed = " ".join(capsys.readouterr().out.split())
    assert "likely causes, by what the data show:" in printed
    assert "with p's column in deg/s, not rad/s: J would be" in printed
    option = ["--channel", "p=p [rad/s]:deg/s"]
    assert "(--channel 'p=p [rad/s]:deg/s')" in printed
    assert main(["identify", str(log), *options, *option]) == 0
    assert "likely causes" not in capsys.readouterr().out
