"""`helisim vehicle new` and `check`: a folder that flies at once; what breaks it is said."""

import os
import re
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest

from command import fails
from helisim.base.errors import InputError, StorageError, UnknownNameError
from helisim.base.note import Command, Option
from helisim.cli import main
from helisim.records.storage import read_record
from helisim.study.check import Problem, check_vehicle
from helisim.study.new_vehicle import new_vehicle
from helisim.vehicle import load, standard_parameters
from helisim.vehicle.parameters import vehicle_names
from tabled import tabled

PARAMETERS, CALIBRATED, TUNED, MJCF = "parameters.toml", "calibrated.toml", "tuned.toml", "own.xml"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return new_vehicle("own", to=tmp_path_factory.mktemp("hangar"))


@pytest.fixture
def own(made, tmp_path, monkeypatch):
    """A vehicle to be broken, in the present folder."""
    monkeypatch.chdir(tmp_path)
    return shutil.copytree(made, tmp_path / "own")


@pytest.mark.parametrize("name", vehicle_names())
def test_nothing_is_wrong_with_the_shipped(name, tmp_path):
    for vehicle in (name, new_vehicle("own", like=name, to=tmp_path)):
        found = check_vehicle(vehicle)
        assert [str(one) for one in found.problems] == []
        assert set(found.margins) == {"lat", "lon", "ped"}


FILES = {"p": PARAMETERS, "c": CALIBRATED, "t": TUNED, "x": MJCF}
WRONG = Path(__file__).with_name("vehicle_check.txt").read_text(encoding="utf-8").splitlines()
"""File, large if what is said is of no one; what is changed behind |, to what; what is said."""


@pytest.mark.parametrize("row", WRONG)
def test_what_is_wrong_with_a_file_is_said(own, row):
    old, new, message = row[2:].split(" ~ ")
    kept, gone = old.split("|")
    _change(own / FILES[row[0].lower()], kept + gone, kept + new.replace(r"\n", "\n"))
    assert (_said(own, message).file is None) == row[0].isupper()


def test_the_remedy_is_a_command_to_be_typed_where_one_is(own, monkeypatch, capsys):
    (own / CALIBRATED).unlink()
    spaced = own.rename(own.with_name("my own"))
    monkeypatch.chdir(own.parent)
    assert main(["vehicle", "check", str(spaced), "--quiet"]) == 2
    assert "to make it (helisim vehicle calibrate 'my own' --write)" in capsys.readouterr().out


def _change(path, old, new):
    """Change what stands first in a file; <number> is whatever was solved for."""
    text = path.read_text()
    changed = re.sub(re.escape(old).replace("<number>", r"[0-9.]+"), lambda _: new, text, count=1)
    assert changed != text
    path.write_text(changed)


def _said(own, message):
    problems = check_vehicle(own).problems
    found = [one for one in problems if message in one.text]
    assert found, [str(one) for one in problems]
    return found[0]


def test_everything_is_said_at_once(own, capsys, monkeypatch):
    monkeypatch.chdir(own.parent)
    _change(own / PARAMETERS, "radius = { value = 0.767", "radius = { value = 767")
    _change(own / PARAMETERS, "hub_x =", "hub_ex =")
    _change(own / PARAMETERS, "[tail_rotor]", "[tailrotor]")
    (own / TUNED).unlink()
    assert main(["vehicle", "check", "own"]) == 2
    *lines, last = capsys.readouterr().out.splitlines()
    places = [line.split(": ")[0] for line in lines]
    file = "own/parameters.toml"
    assert places == [file, "own/tuned.toml", file, file]
    assert last == "own: 4 problems."


def test_what_is_well_is_shown(own, capsys):
    assert main(["vehicle", "check", str(own)]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith("own: All is well.")
    for text in (
        "mass                    8.01 kg",
        "disc loading            42.48 N/m^2",
        "power                   976.6 W",
        "figure of merit         0.36",
        "ped margins             23.1 dB",
    ):
        assert text in printed
    assert main(["vehicle", "check", str(own), "--quiet"]) == 0
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(("file", "command"), [(CALIBRATED, "calibrate"), (TUNED, "tune")])
def test_a_file_that_is_not_made_yet(own, file, command):
    (own / file).unlink()
    (problem,) = check_vehicle(own).problems
    assert problem == Problem(
        f"there is no such file: {command} the vehicle to make it",
        own / file,
        remedy=Command(command, ("own",), (Option("write"),)),
    )


def test_an_mjcf_that_is_out_of_date_or_missing_and_no_vehicle(own, tmp_path):
    _change(own / PARAMETERS, "drag_area_x = { value = 0.03", "drag_area_x = { value = 0.04")
    (problem,) = check_vehicle(own).problems
    assert "the <general> 'rotor' has other numbers (user)" in problem.text
    assert problem.remedy == Command("vehicle build", ("own",))
    line = int(problem.text.removeprefix("line ").split(":")[0])
    assert (own / MJCF).read_text().splitlines()[line - 1].lstrip().startswith("<general")
    assert main(["vehicle", "build", str(own), "--quiet"]) == 0
    assert check_vehicle(own).problems == ()
    (own / MJCF).rename(own / "a.xml")
    (own / "b.xml").write_text("<mujoco/>")
    (problem,) = check_vehicle(own).problems
    assert "which file is the vehicle's MJCF?" in problem.text
    with pytest.raises(UnknownNameError):
        check_vehicle(tmp_path)


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
        "vehicle linearize own",
        "vehicle trim own --speeds 0,5 --quiet",
        "fly --vehicle own --axis lat --duration 12 --out lat.parquet --quiet",
        "vehicle calibrate own --write --quiet",
        "tune --vehicle own --write --quiet",
        "vehicle linearize own --inputs IN2",
    ):
        assert main(command.split()) == 0, command
    assert read_record(tmp_path / "lat.parquet").provenance["vehicle"] == "own"
    tuned, shipped = standard_parameters("./own"), standard_parameters("blade360")
    for name in shipped:
        # calibration stops at 1e-8 of its conditions, tuning where its cost changes by 1e-8
        assert tuned[name] == pytest.approx(shipped[name], rel=1e-3), name
    assert tuned.entry("airframe.izz").source == f"blade360: {shipped.entry('airframe.izz').source}"
    for file in ("parameters.toml", "calibrated.toml", "tuned.toml"):
        assert tomllib.loads((tmp_path / "own" / file).read_text())


FROUDE = 0.5  # of lengths: masses as the third power, times as the root


@pytest.mark.slow
def test_an_airframe_of_half_the_size_is_dynamically_similar(tmp_path, monkeypatch, capsys):
    """Froude's law: rates of the hover's derivatives go with 1 / root of the size, hub moments too.

    Without Mach number, which does not scale, nothing but rounding and solvers is left.
    """
    large = new_vehicle("large", to=tmp_path)
    _change(large / PARAMETERS, "sound_speed = { value = 340.3", "sound_speed = { value = 0.0")
    monkeypatch.chdir(tmp_path)
    own = load(large).parameters
    mass, rotor = FROUDE**3 * own["airframe.mass"], 2.0 * FROUDE * own["main_rotor.radius"]
    rpm = own["main_rotor.speed"] / FROUDE**0.5 * 30.0 / np.pi
    numbers = f"--mass {mass!r} --rotor {rotor!r} --rpm {rpm!r}"
    assert main(f"vehicle new half --like large {numbers}".split()) == 0
    assert "half: All is well." in capsys.readouterr().out
    half = load("half")
    assert check_vehicle("half").problems == ()
    assert half.parameters.entry("airframe.mass").source == "given"
    assert half.parameters.entry("airframe.ixx").source == "estimated: 0.2 of large, in proportion"
    assert half.parameters.entry("main_rotor.twist").source == "estimated: as large"
    assert not any(name.startswith("targets.") for name in half.parameters)
    assert main(["vehicle", "calibrate", "large", "--write", "--quiet"]) == 0  # for that air
    found, wanted = half.derivatives, load(large).derivatives
    times = {"N_r": 1, "Z_w": 1, "L_b": 2, "M_a": 2, "N_ped": 2, "tau_f": -1, "B_a": 0, "Y_v": 1}
    for name, power in times.items():
        assert found[name] == pytest.approx(wanted[name] / FROUDE ** (0.5 * power), rel=1e-6), name


def test_an_airframe_lacks_nothing_that_it_needs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert "a vehicle from numbers needs rpm" in fails(
        capsys, "vehicle", "new", "own", "--mass", 4.2, "--rotor", 1.35
    )
    assert "mass must be a number above 0" in fails(
        capsys, "vehicle", "new", "own", "--mass", 0, "--rotor", 1.35, "--rpm", 2100
    )
    # 42 kg on a rotor of 0.35 m: no pitch of the blades lifts it
    assert "no hover found" in fails(
        capsys, "vehicle", "new", "own", "--mass", 42, "--rotor", 0.35, "--rpm", 2000
    )
    assert not list(tmp_path.iterdir())


def test_what_is_there_is_not_overwritten(made, capsys):
    before = sorted(made.parent.rglob("*"))
    message = fails(capsys, "vehicle", "new", "own", "--to", made.parent)
    assert "is there already" in message
    assert sorted(made.parent.rglob("*")) == before


@tabled("name", "message")
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
