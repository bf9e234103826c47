"""`helisim ardupilot`: identified models as the JSON of ArduPilot's state-space helicopter."""

import pytest

import helisim as hs
from command import fails
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


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("MODEL", "--out", "OUT"), "--rpm is missing"),
        (("MODEL", "MODEL"), "--out FILE is missing"),
        (("MODEL",), "no number of a state-space helicopter"),
        (("MODEL", "--out", "OUT", "--rpm", "0"), "rotor_speed must be above 0"),
        (("MODEL", "--out", "OUT", "--rpm", "9", "--set", "Nx=1"), "model 'Nx'"),
        (("MODEL", "--out", "OUT", "--rpm", "9", "--full", "roll=1"), "command 'roll'"),
        (("MODEL", "--out", "OUT", "--rpm", "9", "--late", "r"), "--late takes NAME=VALUE"),
    ],
)
def test_a_mistake_is_one_line(words, message, model, tmp_path, capsys):
    places = {"MODEL": model, "OUT": tmp_path / "heli.json"}
    assert message in fails(capsys, "ardupilot", *(places.get(word, word) for word in words))
    assert not (tmp_path / "heli.json").exists()
