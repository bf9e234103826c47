"""The command line on logs in other units and on other clocks: the same model."""

import json

import numpy as np
import plants
import pytest

from helisim.cli import main
from helisim.ident import load_fit, structures
from swept_logs import flown, same_within_errors, write_clean, write_foreign

ROLLPITCH = plants.ROLLPITCH_IN1
MAP = """\
time = { column = "Zeit", unit = "ms" }
[channels]
lat = { column = "Kanal 1", unit = "us", trim = 1520, range = 800 }
lon = { column = "Kanal 2", unit = "us", trim = 1490, range = 800, sign = -1 }
p = { column = "Rollrate", unit = "deg/s" }
q = { column = "Nickrate", unit = "deg/s", sign = -1 }
"""


def test_a_foreign_log_in_degrees_gives_the_same_model(tmp_path, capsys):
    """Pulses and deg/s with 20 ms jitter give the parameters of the clean record."""
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
