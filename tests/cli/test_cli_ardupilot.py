"""`helisim ardupilot` and `helisim parm`: what ArduPilot reads of a model and of a vehicle."""

import json

import pytest

from exact_fits import found
from helisim import ident
from helisim.cli import main
from parm_file import parm_file


def test_it_writes_the_file(tmp_path, capsys):
    """Half the pedal's travel is ArduPilot's 1, and the recorder's latency is none of the delay."""
    model, out = tmp_path / "yaw.json", tmp_path / "heli.json"
    found(ident.structures.yaw_base, N_r=-2.0, N_ped=60.0, tau_r_base=0.0505).save(model)
    words = ["--rpm", "1700", "--late", "r=0.0405", "--out", str(out)]
    assert main(["ardupilot", str(model), *words]) == 0
    text = capsys.readouterr().out
    assert "Nped            30" in text
    assert f"Written: {out}" in text
    values = json.loads(out.read_text(encoding="utf-8"))
    assert values["Nped"] == pytest.approx(30.0)
    assert values["time_delay_ped"] == 10.0
    assert values["nominal_rpm"] == pytest.approx(1700.0)


def test_it_prints_the_derivation_and_writes_the_file(tmp_path, capsys):
    """What is printed is the file; each gain says what it follows from."""
    path = tmp_path / "jr700.parm"
    assert main(["parm", "jr700", "--out", str(path), "--quiet"]) == 0
    shown = capsys.readouterr().out
    assert shown == path.read_text()
    assert "the command that holds 1 rad/s of p" in shown
    assert parm_file(path)["FRAME_CLASS"] == 6.0
