"""`helisim margins`: a closed loop's margins, from logs alone."""

import json

import numpy as np
import pytest

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
    words = ["--band", "4", "20", "--json", str(out), "--quiet"]
    assert main(["margins", str(path), *words]) == 0
    text = capsys.readouterr().out
    assert all(words in text for words in ("phase margin", "gain margin", "crossover", "lat"))
    figures = {one["figure"]: one for one in json.loads(out.read_text())["figures"]}
    assert figures["phase_margin"]["low"] < 51.4 < figures["phase_margin"]["high"]  # the loop's own
    assert figures["phase_margin"]["unit"] == "deg"


def test_columns_of_ones_own_are_named(record, tmp_path, capsys):
    path, out = tmp_path / "own.csv", tmp_path / "found.json"
    table = np.column_stack([1e3 * record.time, record.values[:, 0], -record.values[:, 1]])
    np.savetxt(path, table, delimiter=",", header="t,dither,mixer", comments="")
    words = ["--time", "t:ms", "--channel", "dither=dither:1", "--channel", "mixer=mixer:1:sign=-1"]
    given = ["--axis", "roll", "--injected", "dither", "--total", "mixer", "--band", "4", "9"]
    json_ = ["--json", str(out), "--quiet"]
    assert main(["margins", str(path), *words, *given, *json_]) == 0
    figures = {one["figure"]: one for one in json.loads(out.read_text())["figures"]}
    assert figures["phase_margin"]["value"] == pytest.approx(51.4, abs=3.0)  # three deviations
    assert "gain margin of lat at actuators isn't within" in capsys.readouterr().out
