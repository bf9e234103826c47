"""The gyro's gains are the tuning step's output, and the loops they close are stable."""

import tomllib

import pytest

from helisim.cli import main
from helisim.sim import Recorder
from helisim.study.models import ROLLPITCH_IN2, YAW_OVERALL
from helisim.study.paper import published
from helisim.study.truth import true_values
from helisim.study.tune import LOOPS, margins
from helisim.vehicle import load


@pytest.fixture(scope="module")
def vehicle():
    return load()


@pytest.mark.study
def test_tuning_again_prints_the_shipped_gains_and_the_margins(vehicle, capsys):
    """`helisim tune` finds the numbers of tuned.toml: nobody typed them. Margins stand below."""
    assert main(["tune"]) == 0
    printed = capsys.readouterr().out
    found = {
        f"{section}.{name}": entry["value"]
        for section, entries in tomllib.loads(printed).items()
        for name, entry in entries.items()
    }
    assert {"gyro.ped_latency", "gyro.kp_lat", "recorder_latency.LAT"} <= found.keys()
    for name, value in found.items():
        # the search stops at 1e-8 of its sum of squares, which is flat to 1e-4 of a setting
        assert value == pytest.approx(vehicle.parameters[name], rel=1e-3), name
    rows = [line.split()[1:] for line in printed.splitlines() if line.startswith(("# l", "# p"))]
    assert [row[0] for row in rows] == list(LOOPS)
    for axis, gain, phase, *_ in rows:
        found = margins(vehicle, axis)
        # printed digits, and what 1e-3 of a gain does to them
        assert [float(gain), float(phase)] == pytest.approx(
            [found.gain_db, found.phase_deg], abs=0.2
        )


@pytest.mark.parametrize("model", [YAW_OVERALL, ROLLPITCH_IN2], ids=lambda model: model.name)
def test_the_sticks_see_the_papers_vehicle(vehicle, model):
    found = true_values(vehicle, model, Recorder.of(vehicle))
    for name in model.tolerances:
        # 3 %: one setting for the five numbers of eq. (8); the least bound that the paper
        # prints is 3.9 %
        printed = published("jr700")[model.name][name].value
        assert found[name] == pytest.approx(printed, rel=0.03), name


@pytest.mark.parametrize("axis", LOOPS)
def test_loops_are_stable_with_margin(vehicle, axis):
    """Each loop keeps 6 dB and 30 degrees, the usual least of a flight control law."""
    found = margins(vehicle, axis)
    assert found.gain_db > 6.0
    assert found.phase_deg > 30.0
