"""`helisim identify` of a ULog that nothing is said about."""

import json

import numpy as np
import pytest
from scipy.signal import lfilter

from autopilot_logs import ulog
from helisim.cli import main

RATE = 50.0
POLE, GAIN = 4.0, 30.0
"""1/s and rad/s^2: of a roll rate that answers as gain / (s + pole)."""


@pytest.fixture
def flown(tmp_path):
    """A log in which a sweep moves the roll torque, and a first-order system answers."""
    time = np.arange(0.0, 60.0, 1.0 / RATE)
    sweep = 0.1 * np.sin(2.0 * np.pi * (0.2 * time + 0.04 * time**2)) * (time < 55.0)
    kept = np.exp(-POLE / RATE)
    rate = lfilter([0.0, GAIN / POLE * (1.0 - kept)], [1.0, -kept], sweep)  # held between samples
    noise = np.random.default_rng(1).normal(0.0, 1e-3, (2, time.size, 3))
    stamps = np.rint(1e6 * time) + 1e6
    path = tmp_path / "a flight.ulg"
    torque, turns = (x[:, None] * [1.0, 0.0, 0.0] + n for x, n in zip((sweep, rate), noise))
    path.write_bytes(
        ulog(
            {
                "vehicle_torque_setpoint": (stamps, {"xyz": torque}),
                "vehicle_angular_velocity": (stamps, {"xyz": turns}),
            }
        )
    )
    return path


def test_a_sweep_in_a_log_of_px4_is_found_and_identified(flown, tmp_path, capsys):
    """Pole and gain are within two of their standard errors and the hold's half a sample."""
    model = tmp_path / "model.json"
    assert main(["identify", str(flown), "--json", str(model), "--quiet"]) == 0
    said = capsys.readouterr().out
    assert "a log of PX4" in said
    assert "sweep on lat" in said
    assert "helisim identify" in said
    found = {one["name"]: one for one in json.loads(model.read_text())["parameters"]}
    assert found["b0"]["value"] == pytest.approx(GAIN, rel=0.02)  # about 1/50 of noise and hold
    assert found["a0"]["value"] == pytest.approx(POLE, rel=0.02)


def test_what_is_said_comes_first(flown, capsys):
    main(["identify", str(flown), "--band", "4", "9", "--quiet"])
    assert "band 4 to 9 rad/s" in capsys.readouterr().out


def test_a_log_of_px4_without_a_sweep_is_one_line(tmp_path, capsys):
    noise = np.random.default_rng(2).normal(0.0, 1e-3, (1000, 3))
    stamps = np.arange(1000) * 2e4 + 1e6
    path = tmp_path / "still.ulg"
    path.write_bytes(ulog({"vehicle_angular_velocity": (stamps, {"xyz": noise})}))
    assert main(["identify", str(path)]) == 2
    said = capsys.readouterr()
    assert said.err.count("\n") == 1
    assert "SDLOG_PROFILE" in said.err
