"""The window by hand on a real display: pictures, keys that go down and up, a recording."""

import shutil
import sys

import numpy as np
import pytest

from helisim.records.storage import read_record
from off_screen import on_display
from tabled import section

NEEDED = ("Xvfb", "xvfb-run", "xdotool")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not all(map(shutil.which, NEEDED)), reason="no virtual display: apt install xvfb xdotool"
    ),
]

# The script is driven by the flight's own time, so a slow renderer gives the same flight.
FLOWN = section(globals(), "FLOWN")


def test_keys_of_a_real_window_fly_and_no_joystick_is_said(tmp_path):
    done = on_display(tmp_path, sys.executable, "-c", FLOWN)
    assert done.returncode == 0, done.stderr
    record = read_record(tmp_path / "hand.parquet")
    assert record["LON"].min() < -0.005
    assert record["north"][-1] > 0.3
    assert record["u"][-1] < record["u"].max() - 0.2  # it brakes
    pictures = np.load(tmp_path / "pictures.npy").astype(float)
    assert pictures.shape == (2, 360, 480, 3)
    assert pictures[0].std() > 20.0
    assert np.abs(pictures[1] - pictures[0]).mean() > 2.0  # it has flown on
    done = on_display(tmp_path, sys.executable, "-m", "helisim", "view", "--joystick")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "no joystick '': there are none; say which by number or name, plug one in" in done.stderr
