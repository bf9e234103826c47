"""The Bode plots of a recording: what is drawn is where its numbers say."""

import numpy as np
import pytest
from test_rerun_recording import SINGLE, read

from helisim.show.bode import decibels
from helisim.show.rerun.recording import write_recording
from helisim.study.run import read_run
from made_run import make_flight, write_run


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bode")
    write_run(folder)
    run = read_run(folder)
    found = read(write_recording(folder / "run.rrd", {"lat_02": make_flight()}, run=run))
    (item,) = (item for item in run.models if item.name == "heave")
    root = "/models/heave/w_col/bode"
    return item, {name.removeprefix(f"{root}/"): one for name, one in found.items() if root in name}


def places(entity):
    return np.array(entity["Points2D:positions"][0].tolist(), dtype=float)


def marks(ticks):
    return [str(text).replace("\u2212", "-") for text in np.ravel(ticks["Points2D:labels"][0])]


def test_points_are_where_the_ticks_say(drawn):
    """Positions, read off the drawn ticks, give back frequency and gain of the data."""
    item, found = drawn
    data = item.fit.data
    at, said = places(found["axes/ticks"]), marks(found["axes/ticks"])
    row = at[:, 1] == at[-1, 1]  # of frequencies, below all panels
    omega = np.log([float(text) for text, there in zip(said, row) if there])
    points = places(found["data"])[: data.frequency.size]
    across = np.polyfit(at[row, 0], omega, 1)
    # single precision of places up to 1240 units, over an axis of some four of log frequency
    np.testing.assert_allclose(
        np.polyval(across, points[:, 0]), np.log(data.frequency), atol=100.0 * SINGLE
    )
    values = np.array([float(text) for text in said[:2]])  # of the magnitude, the first panel
    gain = np.polyfit(at[:2, 1], values, 1)
    offset = 17.0  # a number hangs this far above its line
    o, i = data.index("w", "col")
    np.testing.assert_allclose(
        np.polyval(gain, points[:, 1] - offset), decibels(data.response[o, i]), atol=1e-3
    )


def test_a_point_tells_its_values(drawn):
    """Pointed at, a point says its frequency, gain, phase and coherence."""
    item, found = drawn
    said = marks(found["data"])[0]
    assert said.startswith(f"{item.fit.data.frequency[0]:.4g} rad/s: ")
    assert "coherence 1.000" in said


def test_axes_have_names_and_units(drawn):
    """What is on each axis, in which unit, and which line is which."""
    _, found = drawn
    names = marks(found["axes/names"])
    assert names[0].startswith("magnitude, dB (")
    assert names[1:] == ["phase, deg", "coherence", "frequency, rad/s"]
    assert set(marks(found["legend/models"])) == {"flight data", "identified", "exact"}
