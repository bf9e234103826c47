"""`helisim ardupilot`: identified models as the JSON of ArduPilot's state-space helicopter."""

import pytest

import helisim as hs
from exact_fits import found
from helisim import ident
from helisim.cli import main


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    """A yaw model as `helisim identify --json` writes it."""
    path = tmp_path_factory.mktemp("models") / "yaw.json"
    found(ident.structures.yaw_base, N_r=-2.0, N_ped=60.0, tau_r_base=0.0505).save(path)
    return path


def test_it_writes_and_shows_the_file(model, tmp_path, capsys):
    """Half the pedal's travel is ArduPilot's 1, and the recorder's latency is none of the delay."""
    out = tmp_path / "heli.json"
    words = ["--rpm", "1700", "--late", "r=0.0405", "--set", "Nv=1.7", "--out", str(out)]
    assert main(["ardupilot", str(model), *words]) == 0
    text = capsys.readouterr().out
    assert f"Written: {out}" in text
    values = hs.ArduPilotModel.read(out).values
    assert values["Nped"] == pytest.approx(30.0)
    assert values["time_delay_ped"] == 10.0
    assert (values["Nr"], values["Nv"]) == (pytest.approx(-2.0), 1.7)
    assert values["nominal_rpm"] == pytest.approx(1700.0)
    assert main(["ardupilot", str(out)]) == 0
    assert "Nped            30" in capsys.readouterr().out
