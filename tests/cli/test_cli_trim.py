"""`helisim trim`: what it prints, draws and writes, and how a mistake is answered."""

import json
import re

import numpy as np
import pytest

from helisim.cli import main
from helisim.cli.vehicle import speeds_of


def printed(capsys, *arguments):
    """Return the rows that the command prints, as numbers, by speed."""
    assert main(["trim", *arguments]) == 0
    text = capsys.readouterr().out
    assert max(len(line) for line in text.splitlines() if "Written" not in line) <= 80
    rows = [line.split() for line in text.splitlines() if re.match(r"^ +[\d.]+ +[\d.]+ ", line)]
    return {float(row[0]): np.array(row[1:], float) for row in rows}, text


def test_the_table_has_a_power_bucket_and_a_stick_that_goes_forward(capsys):
    """From hover to 20 m/s, in steps of 4."""
    rows, text = printed(capsys, "--speeds", "0:20:4")
    assert list(rows) == [0.0, 4.0, 8.0, 12.0, 16.0, 20.0]
    power, lon, theta = (np.array([row[k] for row in rows.values()]) for k in (0, 2, 5))
    assert np.argmin(power) == 3
    assert f"Least power: {power[3]:.1f} W at 12 m/s" in text
    assert (np.diff(lon) < 0.0).all()
    assert (np.diff(theta) < 0.0).all()


def test_each_speed_has_its_linearisation(tmp_path, capsys, jr700):
    path = tmp_path / "trim.json"
    rows, text = printed(capsys, "--speeds", "0,15", "--json", str(path))
    assert f"Written: {path}" in text
    written = json.loads(path.read_text())
    assert written["provenance"]["vehicle"] == "jr700"
    hover, fast = written["flights"]
    assert [hover["speed_m_s"], fast["trim"]["speed"]] == [0.0, 15.0]
    assert fast["power_w"] == pytest.approx(rows[15.0][0], abs=0.05)  # printed to 0.1 W
    np.testing.assert_allclose(hover["A"], jr700.linearize().system.A, rtol=1e-6, atol=1e-6)
    linear = jr700.trimmed(speed=15.0)
    for name in ("X_u", "Z_w", "M_a"):
        # central differences of 1e-10
        assert fast["derivatives"][name] == pytest.approx(linear.derivatives[name], rel=1e-6)
    assert fast["inputs"] == ["col", "lon", "lat", "ped"]


@pytest.mark.parametrize(
    ("text", "speeds"),
    [
        ("0:20:5", [0.0, 5.0, 10.0, 15.0, 20.0]),
        ("0:0.3:0.1", [0.0, 0.1, 0.2, 0.3]),  # three steps of 0.1 are more than 0.3, rounded
        ("0:7:4", [0.0, 4.0]),
        ("3:3:1", [3.0]),
        ("12,0", [12.0, 0.0]),
    ],
)
def test_speeds_are_read_as_they_are_meant(text, speeds):
    assert speeds_of(text) == pytest.approx(speeds, abs=1e-12)
