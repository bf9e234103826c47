"""`helisim margins`: a closed loop's margins, from logs alone."""

import json

import numpy as np
import pytest

from autopilot_logs import dataflash, ulog
from closed_loops import flown, known_loop
from helisim.cli import main
from helisim.records.storage import write_record


@pytest.fixture(scope="module")
def record():
    """A flight of a known loop."""
    return flown(known_loop(), seed=3, noise=0.02)


def test_a_record_needs_no_option(record, tmp_path, capsys):
    """The table has the three figures of the loop; so has the JSON, with intervals."""
    path, out = tmp_path / "loop.parquet", tmp_path / "found.json"
    write_record(record, path)
    assert (
        main(
            [
                "margins",
                str(path),
                "--band",
                "4",
                "20",
                "--draws",
                "20",
                "--json",
                str(out),
                "--quiet",
            ]
        )
        == 0
    )
    text = capsys.readouterr().out
    assert all(words in text for words in ("phase margin", "gain margin", "crossover", "lat"))
    figures = {one["figure"]: one for one in json.loads(out.read_text())["figures"]}
    assert figures["phase_margin"]["low"] < 51.4 < figures["phase_margin"]["high"]  # the loop's own
    assert figures["phase_margin"]["unit"] == "deg"


def test_columns_of_ones_own_are_named(record, tmp_path, capsys):
    """A CSV by anyone, times in ms, the sum with the other sign."""
    path, out = tmp_path / "own.csv", tmp_path / "found.json"
    table = np.column_stack([1e3 * record.time, record.values[:, 0], -record.values[:, 1]])
    np.savetxt(path, table, delimiter=",", header="t,dither,mixer", comments="")
    words = ["--time", "t:ms", "--channel", "dither=dither:1", "--channel", "mixer=mixer:1:sign=-1"]
    given = ["--axis", "roll", "--injected", "dither", "--total", "mixer", "--band", "4", "9"]
    json_ = ["--draws", "20", "--json", str(out)]
    assert main(["margins", str(path), *words, *given, *json_, "--quiet"]) == 0
    figures = {one["figure"]: one for one in json.loads(out.read_text())["figures"]}
    assert figures["phase_margin"]["value"] == pytest.approx(51.4, abs=3.0)  # three deviations
    assert "gain margin of lat at actuators isn't within" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("suffix", "write", "injected", "total"),
    [
        (".bin", dataflash, ("SIDD", "Targ"), ("RATE", "ROut")),
        (".ulg", ulog, ("probe", "dither"), ("vehicle_torque_setpoint", "xyz")),
    ],
)
def test_logs_of_autopilots(record, tmp_path, suffix, write, injected, total):
    """ArduPilot's chirp at the mixer: SIDD.Targ is added, RATE.ROut is the sum; a ULog likewise."""
    path, out = tmp_path / f"flight{suffix}", tmp_path / "found.json"
    stamps = np.round(1e6 * (1.0 + record.time))
    signals = {injected: record["lat_disturbance"], total: record["lat_sum"]}
    path.write_bytes(write({name: (stamps, {field: x}) for (name, field), x in signals.items()}))
    given = ["--channel", f"dither={'.'.join(injected)}:1", "--channel", f"sum={'.'.join(total)}:1"]
    words = ["--axis", "lat", "--injected", "dither", "--total", "sum", "--band", "4", "9"]
    more = ["--resample", "100", "--draws", "2", "--quiet", "--json", str(out)]
    assert main(["margins", str(path), *given, *words, *more]) == 0
    figures = {one["figure"]: one for one in json.loads(out.read_text())["figures"]}
    assert figures["phase_margin"]["value"] == pytest.approx(51.4, abs=3.0)  # three deviations
