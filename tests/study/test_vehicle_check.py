"""`helisim vehicle check`: a copy is broken in one way, and a sentence says it."""

import re
import shutil

import pytest

from helisim.base.errors import UnknownNameError
from helisim.base.note import Command, Option
from helisim.cli import main
from helisim.study.check import Problem, check_vehicle
from helisim.study.new_vehicle import new_vehicle
from helisim.vehicle.parameters import vehicle_names

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
WRONG = r"""
p radius = { value = 0.767, unit = "|m ~ mm ~ main_rotor.radius is in 'm', not in 'mm'
p radius = { value = |0.767 ~ 767 ~ main_rotor.radius = 767 m is implausible: it is usually 0.05 to
p hub_|x = ~ ex = ~ did you mean hub_x?
p |[servo] ~ [servos] ~ there is no section [servos]; did you mean [servo]?
P |drag_area_z = { ~ # drag_area_z = { ~ parameter airframe.drag_area_z (m^2) is missing
p ground_effect = { value = 0.0, unit = "1", |source ~ from ~ needs value (a number), unit and
p ixx = { value = |0.2 ~ nan ~ parameter 'airframe.ixx' must be a finite number, got nan
p [airframe|] ~  ~ not TOML: Expected ']'
t [gyro]| ~ \nk_a = { value = 1.0, unit = "s/rad", source = "mine" } ~ 'gyro.k_a' is already defined
C izz = { value = |<number> ~ 0.6 ~ inertia
P period = { value = |0.002 ~ 0.003 ~ gyro.period
p hub_z = { value = |-0.28 ~ -0.2 ~ is -0.2 m, and the site 'hub' of the MJCF is at -0.28 m; make
p radius = { value = |0.767 ~ 0.8 ~ Z_w is -
t kp_lat = { value = |<number> ~ 0.954 ~ ; tune
X <gyro name="imu|_gyro" ~ gyro" ~ imu_gyro
X <user name="air" dim="|6" ~ 5" ~ air
X <sensor|> ~  ~ XML
X <key name="hover" qpos="0| ~  0 ~ qpos
X |fullinertia=" ~ diaginertia="0.1 0.1 0.1" user=" ~ inertia
X name="flight_computer" pos="0.|08 0 ~ 28 0 ~ the centre of gravity is 6.2 mm ahead, 0.0 mm left
X mass="4|.19" ~ 00.19" ~ it does not hover:
X <general name="L|ON" ~ AT" ~ LAT
"""
"""File, large if what is said is of no one; what is changed behind |, to what; what is said."""


@pytest.mark.parametrize("row", WRONG.strip().splitlines())
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
    assert "to make it (helisim calibrate 'my own' --write)" in capsys.readouterr().out


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
    """One line each, by file; exit status 2."""
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
    """Figures of the hover, poles, margins; exit status 0."""
    assert main(["vehicle", "check", str(own)]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith("own: All is well.")
    for text in (
        "mass                    8.01 kg",
        "disc loading            42.48 N/m^2",
        "power                   899.8 W",
        "figure of merit         0.38",
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


def test_numbers_in_the_mjcf_that_are_out_of_date(own):
    _change(own / PARAMETERS, "drag_area_x = { value = 0.03", "drag_area_x = { value = 0.04")
    (problem,) = check_vehicle(own).problems
    assert "the <general> 'rotor' has other numbers (user)" in problem.text
    assert problem.remedy == Command("vehicle build", ("own",))
    line = int(problem.text.removeprefix("line ").split(":")[0])
    assert (own / MJCF).read_text().splitlines()[line - 1].lstrip().startswith("<general")
    assert main(["vehicle", "build", str(own), "--quiet"]) == 0
    assert check_vehicle(own).problems == ()


def test_no_mjcf_and_no_vehicle(own, tmp_path):
    (own / MJCF).rename(own / "a.xml")
    (own / "b.xml").write_text("<mujoco/>")
    (problem,) = check_vehicle(own).problems
    assert "which file is the vehicle's MJCF?" in problem.text
    with pytest.raises(UnknownNameError):
        check_vehicle(tmp_path)
