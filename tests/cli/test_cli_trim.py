"""`helisim trim`: what it prints, draws and writes, and how a mistake is answered."""

import json
import math
import re

import numpy as np
import pytest

from helisim.base.errors import InputError
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
    """The JSON holds trims, powers and exact linear models, with where they come from."""
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


def test_the_linearisation_may_be_of_the_sticks(tmp_path):
    """--inputs IN2 has the gyro inside."""
    path = tmp_path / "sticks.json"
    arguments = ["--speeds", "8", "--inputs", "IN2", "--json", str(path), "--quiet"]
    assert main(["trim", *arguments]) == 0
    (flight,) = json.loads(path.read_text())["flights"]
    assert flight["inputs"] == ["COL", "LON", "LAT", "PED"]


def test_the_ground_takes_power_away(capsys, jr700):
    """By k^1.5 of the induced power (Cheeseman and Bennett), and the tail's; less with speed."""
    near = ("--set", "air.ground_effect=1", "--height", "0.6")
    low, _ = printed(capsys, "--speeds", "0,12", *near)
    high, _ = printed(capsys, "--speeds", "0,12")
    saved = [high[speed][0] - low[speed][0] for speed in (0.0, 12.0)]
    own, weight = jr700.parameters, 8.01 * 9.8015
    disc = 2.0 * own["air.density"] * math.pi * own["main_rotor.radius"] ** 2
    induced = own["main_rotor.induced_factor"] * weight * math.sqrt(weight / disc)
    k = 1.0 - (0.767 / (4.0 * (0.6 + 0.28))) ** 2  # the hub is 0.28 m above the vehicle
    # two powers printed to 0.1 W; 3e-4 of the inflow, as in tests/physics/test_ground_effect;
    # the roll of 3.8 degrees raises the thrust by 0.2 % and what is saved by 0.3 %
    error = 0.1 + 3e-4 * induced
    less = induced * (1.0 - k**1.5)
    # less torque to hold: the tail rotor's thrust, and its induced power by the power of 1.5
    thrust = jr700.main_power / own["main_rotor.speed"] / 0.90
    aft = 2.0 * own["air.density"] * math.pi * own["tail_rotor.radius"] ** 2
    tail = own["tail_rotor.induced_factor"] * thrust * math.sqrt(thrust / aft)
    less += tail * (1.0 - (1.0 - less / jr700.main_power) ** 1.5)
    assert saved[0] == pytest.approx(less, rel=0.003, abs=error)
    assert saved[1] < 0.2 * saved[0]


def test_figures_are_pictures_of_both_kinds(tmp_path, capsys):
    """By their suffix."""
    for name, start in (("a.png", b"\x89PNG"), ("a.svg", b"<?xml")):
        printed(capsys, "--speeds", "0,10", "--figure", str(tmp_path / name))
        assert (tmp_path / name).read_bytes().startswith(start)


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
    """A range has both ends if the step fits."""
    assert speeds_of(text) == pytest.approx(speeds, abs=1e-12)


@pytest.mark.parametrize(
    "text", ["", "fast", "0:20", "0:20:0", "20:0:1", "0:20:-1", "0,nan", "0:inf:1", "0:1:1e-6"]
)
def test_other_speeds_are_refused(text):
    """With what was given and what is expected."""
    with pytest.raises(InputError, match=r"--speeds takes FROM:TO:STEP .* got "):
        speeds_of(text)
