"""`helisim vehicle new`: a folder that flies at once, and that calibrates and tunes."""

import os
import tomllib

import numpy as np
import pytest

from command import fails
from helisim.base.errors import InputError, StorageError, UnknownNameError
from helisim.cli import main
from helisim.records.storage import read_record
from helisim.study.new_vehicle import new_vehicle
from helisim.vehicle import load, standard_parameters
from helisim.vehicle.parameters import vehicle_names


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return new_vehicle("own", to=tmp_path_factory.mktemp("hangar"))


@pytest.mark.parametrize("like", vehicle_names())
def test_it_is_at_first_what_it_was_made_from(like, tmp_path):
    own, other = load(new_vehicle("libelle", like=like, to=tmp_path)), load(like)
    assert dict(other.parameters).items() <= dict(own.parameters).items()
    assert (own.name, own.trim) == ("libelle", other.trim)
    for matrix in "ABCD":
        np.testing.assert_array_equal(
            getattr(own.linearize("IN2").system, matrix),
            getattr(other.linearize("IN2").system, matrix),
        )
    assert own.visual_model().body("libelle").id == 1
    for file in own.folder.rglob("*.xml"):
        assert like not in file.read_text()


@pytest.mark.slow
def test_new_fly_linearize_calibrate_tune_from_the_command_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["vehicle", "new", "own", "--like", "blade360"]) == 0
    assert "own/README.md" in capsys.readouterr().out
    for command in (
        "linearize own",
        "trim own --speeds 0,5 --quiet",
        "fly own --axis lat --duration 12 --out lat.parquet --quiet",
        "calibrate own --write --quiet",
        "tune own --write --quiet",
        "linearize own --inputs IN2",
    ):
        assert main(command.split()) == 0, command
    assert read_record(tmp_path / "lat.parquet").provenance["vehicle"] == "own"
    tuned, shipped = standard_parameters("./own"), standard_parameters("blade360")
    for name in shipped:
        # calibration stops at 1e-8 of its conditions, tuning where its cost changes by 1e-8
        assert tuned[name] == pytest.approx(shipped[name], rel=1e-3), name
    assert "[targets] of parameters.toml" in tuned.entry("airframe.izz").source
    for file in ("parameters.toml", "calibrated.toml", "tuned.toml"):
        assert tomllib.loads((tmp_path / "own" / file).read_text())


def test_what_is_there_is_not_overwritten(made, capsys):
    before = sorted(made.parent.rglob("*"))
    message = fails(capsys, "vehicle", "new", "own", "--to", made.parent)
    assert "is there already" in message
    assert sorted(made.parent.rglob("*")) == before


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("jr700", "no shipped one's, got 'jr700'"),
        ("../x", r"got '../x'; `to` takes the folder around it"),
        ("3x", "begins with a letter"),
        ("a" * 300, "at most 100 letters"),
    ],
)
def test_a_name_that_cannot_be_is_refused(tmp_path, name, message):
    with pytest.raises(InputError, match=message):
        new_vehicle(name, to=tmp_path)
    assert not list(tmp_path.iterdir())


def test_nothing_half_made_is_left(tmp_path, monkeypatch):
    with pytest.raises(UnknownNameError, match="did you mean jr700"):
        new_vehicle("own", like="jr70", to=tmp_path)
    (tmp_path / "file").touch()
    with pytest.raises(StorageError, match="can't make"):
        new_vehicle("own", to=tmp_path / "file")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "rename", full)
    with pytest.raises(StorageError, match="No space left on device"):
        new_vehicle("own", to=tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
