"""`helisim law`: what a law's file says, and a law of what sweeps identify."""

import json

import numpy as np
import pytest

import helisim as hs
from helisim.cli import main
from helisim.design.laws import read_law
from helisim.sim import Recorder
from helisim.study.experiment import fly_sweeps


@pytest.fixture
def law(tmp_path):
    """A law of two states, in a file."""
    one = hs.StateSpaceLaw(
        period=0.004,
        inputs=("p", "LAT"),
        a=[[0.9, 0.0], [0.0, 1.0]],
        b=[[0.1, 0.0], [0.0, 0.2]],
        c=[[0.0, 0.0], [0.0, 0.0], [1.0, 0.5], [0.0, 0.0]],
        d=np.zeros((4, 2)),
    )
    one.write(tmp_path / "law.toml")
    return tmp_path / "law.toml"


def test_show_says_what_it_sees_and_its_poles(law, capsys):
    """A pole at 0.9 of a tick of 4 ms is ln 0.9 / 0.004 = -26.3 rad/s; one at 1 an integral."""
    assert main(["law", "show", str(law)]) == 0
    text = capsys.readouterr().out
    assert "state_space: p, LAT -> col, lon, lat, ped" in text
    assert "2 states, each 4 ms" in text
    assert "poles, rad/s: 0, -26.3" in text


def test_show_as_json_is_the_matrices(law, capsys):
    assert main(["law", "show", str(law), "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["a"] == [[0.9, 0.0], [0.0, 1.0]]
    assert (data["inputs"], data["period"]) == (["p", "LAT"], 0.004)


@pytest.mark.slow
def test_lqg_of_sweeps_flies(jr700, tmp_path, capsys):
    """One sweep of each axis: the law is written, its predicted margins printed, and it flies."""
    folder = tmp_path / "sweeps"
    folder.mkdir()
    flights = fly_sweeps(jr700, 1, 1, 1, Recorder.of(jr700), None, lambda _: None)[0]
    for axis, records in flights.items():
        hs.write_record(records[0], folder / f"{axis}.parquet")
    out = tmp_path / "lqg.toml"
    assert main(["law", "lqg", str(folder), "--out", str(out), "--error", "phi=0.05"]) == 0
    text = capsys.readouterr().out
    margins = {line.split()[0]: line.split()[1:] for line in text.splitlines()}
    for axis in ("roll", "pitch", "yaw"):
        assert float(margins[axis][1]) > 45.0
    law = read_law(out)
    assert law.provenance["tracked"]["phi"]["error"] == 0.05
    (record,) = hs.fly(jr700, hs.Doublet(axis="lat"), controller=law, seed=1)
    assert np.abs(record["phi"]).max() < 0.5
