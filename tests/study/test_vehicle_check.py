"""`helisim vehicle check`: a copy is broken in one way, and the sentence with the line says it."""

import re
import shutil

import pytest

from helisim.base.errors import ModelError, UnknownNameError
from helisim.base.note import Command, Option
from helisim.cli import main
from helisim.study.check import check_vehicle
from helisim.study.check_files import Problem
from helisim.study.new_vehicle import new_vehicle
from helisim.vehicle import load
from helisim.vehicle.folder import vehicle_names
from own_vehicle import renamed

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
        assert [str(one) for one in (*found.problems, *found.remarks)] == []
        assert found.figures is not None
        assert set(found.margins) == {"lat", "lon", "ped"}


def test_nothing_is_wrong_with_names_of_ones_own(tmp_path):
    assert check_vehicle(renamed(tmp_path / "libelle")).problems == ()


FILES = {
    "a unit": (
        PARAMETERS,
        'radius = { value = 0.767, unit = "m"',
        'radius = { value = 767, unit = "mm"',
        r"main_rotor.radius is in 'm', not in 'mm': 767 mm are value = 0.767",
    ),
    "degrees": (
        CALIBRATED,
        'pitch_trim = { value = <number>, unit = "rad"',
        'pitch_trim = { value = 4.58, unit = "deg"',
        "main_rotor.pitch_trim is in 'rad', not in 'deg': 4.58 deg are value = 0.0799361",
    ),
    "revolutions": (
        PARAMETERS,
        'speed = { value = 178.0235837034216, unit = "rad/s"',
        'speed = { value = 1700, unit = "rpm"',
        "1700 rpm are value = 178.024",
    ),
    "a radius of 767 m": (
        PARAMETERS,
        "radius = { value = 0.767",
        "radius = { value = 767",
        "main_rotor.radius = 767 m is implausible: it is usually 0.05 to 12 m. Radius of the main",
    ),
    "a tail ahead": (
        PARAMETERS,
        "arm_x = { value = -0.9",
        "arm_x = { value = 0.9",
        "tail_rotor.arm_x = 0.9 m is implausible: it is usually -15 to -0.05 m. Tail rotor",
    ),
    "a misspelt parameter": (
        PARAMETERS,
        "hub_x =",
        "hub_ex =",
        "did you mean hub_x?",
    ),
    "a misspelt section": (
        PARAMETERS,
        "[servo]",
        "[servos]",
        "The section [servos] is not one that a vehicle has; did you mean [servo]?",
    ),
    "a missing parameter": (
        PARAMETERS,
        "drag_area_z = {",
        "# drag_area_z = {",
        'airframe.drag_area_z is missing: add drag_area_z = { value = ..., unit = "m^2", source',
        "[airframe]",
    ),
    "a missing target": (
        PARAMETERS,
        "N_ped = {",
        "# N_ped = {",
        "[targets] lacks N_ped: `helisim calibrate` needs all of them.",
        "[targets]",
    ),
    "no source": (
        PARAMETERS,
        'ground_effect = { value = 0.0, unit = "1", source =',
        'ground_effect = { value = 0.0, unit = "1", from =',
        "air.ground_effect needs a value (a number), a unit and a source",
    ),
    "no number": (
        PARAMETERS,
        "ixx = { value = 0.2",
        "ixx = { value = nan",
        "airframe.ixx must be a finite number, got nan.",
    ),
    "no TOML": (PARAMETERS, "[airframe]", "[airframe", "This is not TOML: Expected ']'"),
    "defined twice": (
        TUNED,
        "[gyro]",
        '[gyro]\nk_a = { value = 1.0, unit = "s/rad", source = "mine" }',
        "gyro.k_a is defined already, in parameters.toml, line",
        "k_a = {",
    ),
    "a role": (
        PARAMETERS,
        "# [roles]",
        '[roles.sight]\nimu = "x"',
        "Unknown kind of role 'sight'; available: mjcf, scene, body, site",
        "[roles.sight]",
    ),
    "an inertia": (
        CALIBRATED,
        "izz = { value = <number>",
        "izz = { value = 0.6",
        "airframe.izz = 0.6 kg m^2 is more than the other two moments together, 0.5424, which no",
    ),
    "what is left to the fuselage": (
        PARAMETERS,
        "ixx = { value = 0.2",
        "ixx = { value = 0.12",
        "The fuselage is left with principal moments of inertia of",
        "ixx = {",
    ),
    "a period": (
        PARAMETERS,
        "period = { value = 0.002",
        "period = { value = 0.003",
        "gyro.period = 0.003 s must be a whole number of the MJCF's time steps of 0.002 s: 0.004 s",
    ),
    "a hub elsewhere": (
        PARAMETERS,
        "hub_z = { value = -0.28",
        "hub_z = { value = -0.2",
        "main_rotor.hub_z is -0.2 m, and the site 'hub' of the MJCF is at -0.28 m; make them one",
        "hub_z",
    ),
    "a chord": (
        PARAMETERS,
        "chord = { value = 0.065",
        "chord = { value = 0.9",
        "The solidity is 0.747, which is implausible: it is usually 0.01 to 0.25.",
        None,
    ),
    "an old calibration": (
        PARAMETERS,
        "radius = { value = 0.767",
        "radius = { value = 0.8",
        "Z_w is -",
        "Z_w = {",
    ),
    "a gyro out of tune": (
        TUNED,
        "kp_lat = { value = <number>",
        "kp_lat = { value = 0.954",
        "; tune ",
        "",
    ),
}
ELEMENTS = {
    "a misspelt sensor": (
        '<gyro name="imu_gyro"',
        '<gyro name="imugyro"',
        "The sensor 'imu_gyro' is missing; this one may be meant: call it 'imu_gyro', or say in "
        'parameters.toml: [roles.sensor] imu_gyro = "imugyro".',
    ),
    "a misspelt actuator": (
        '<general name="PED"',
        '<general name="PEDAL"',
        "The actuator 'PED' is missing; this one may be meant: call it 'PED'",
    ),
    "a misspelt site": (
        '<site name="tail_hub"',
        '<site name="tailhub"',
        "The site 'tail_hub' is missing; this one may be meant",
    ),
    "a misspelt body": (
        '<body name="fuselage"',
        '<body name="fuselag"',
        "The body 'fuselage' is missing; this one may be meant",
    ),
    "another kind": (
        '<gyro name="gyro_rate"',
        '<velocimeter name="gyro_rate"',
        "The sensor 'gyro_rate' must be a <gyro>, it is a <velocimeter>.",
    ),
    "another size": (
        '<user name="air" dim="6"',
        '<user name="air" dim="5"',
        "The sensor 'air' must have dim=\"6\", it has 5",
    ),
    "no XML": ("<sensor>", "<sensor", "Not XML: not well-formed", "<gyro name"),
    "what MuJoCo refuses": ('<key name="hover" qpos="0', '<key name="hover" qpos="0 0', "qpos", ""),
    "no fullinertia": (
        'fullinertia="',
        'diaginertia="0.1 0.1 0.1" user="',
        "The fuselage 'fuselage' needs <inertial pos=",
        "diaginertia",
    ),
    "a centre of gravity": (
        'name="flight_computer" pos="0.08 0 -0.12"',
        'name="flight_computer" pos="0.68 0 -0.12"',
        "The centre of gravity is 18.7 mm ahead, 0.0 mm left and 0.0 mm above the origin of the",
        "<inertial pos=",
    ),
    "no free joint": ('class="rotor" joint="root"', 'class="rotor" site="cg"', "free joint"),
}


@pytest.mark.parametrize("how", FILES)
def test_what_is_wrong_with_the_parameters(own, how):
    file, old, new, message, *at = FILES[how]
    _change(own / file, old, new)
    _is_said(own, message, *(at or [new.splitlines()[0]]))


@pytest.mark.parametrize("how", ELEMENTS)
def test_what_is_wrong_with_the_mjcf(own, how):
    old, new, message, *at = ELEMENTS[how]
    _change(own / MJCF, old, new)
    _is_said(own, message, *(at or [new]))


def test_the_remedy_is_a_command_to_be_typed_where_one_is(own, monkeypatch, capsys):
    """From below the folder, from beside it with a space in its path, and of a shipped vehicle."""
    (own / CALIBRATED).unlink()
    monkeypatch.chdir(own / "assets")
    assert main(["vehicle", "check", str(own), "--quiet"]) == 2
    assert f"to make it. (helisim calibrate {own} --write)" in capsys.readouterr().out
    spaced = own.rename(own.with_name("my own"))
    monkeypatch.chdir(own.parent)
    assert main(["vehicle", "check", str(spaced), "--quiet"]) == 2
    assert "to make it. (helisim calibrate 'my own' --write)" in capsys.readouterr().out


@pytest.mark.parametrize("value", ['"0.767"', "true"])
def test_a_number_is_no_text_and_not_true(own, value):
    """Python would take both for a number; neither loads."""
    _change(own / PARAMETERS, "radius = { value = 0.767", f"radius = {{ value = {value}")
    _is_said(own, "main_rotor.radius needs a value (a number)", "radius")
    with pytest.raises(ModelError, match=r"main_rotor.radius needs value \(a number\)"):
        load(own)


def _change(path, old, new):
    """Change what stands first in a file; <number> is whatever was solved for."""
    text = path.read_text()
    changed = re.sub(re.escape(old).replace("<number>", r"[0-9.]+"), lambda _: new, text, count=1)
    assert changed != text
    path.write_text(changed)


def _is_said(own, message, at):
    """Hold that a problem says so, of a line with that text; of no line if that is empty."""
    problems = check_vehicle(own).problems
    found = [one for one in problems if message in one.text]
    assert found, [str(one) for one in problems]
    problem = found[0]
    assert problem.text.endswith((".", "?"))
    if at is None:
        assert problem.file is None
    elif at:
        assert at in problem.file.read_text().splitlines()[problem.line - 1]
    else:
        assert problem.file.parent == own


def test_everything_is_said_at_once(own, capsys, monkeypatch):
    """One line each, by file and line as compilers do; exit status 2."""
    monkeypatch.chdir(own.parent)
    _change(own / PARAMETERS, "radius = { value = 0.767", "radius = { value = 767")
    _change(own / PARAMETERS, "hub_x =", "hub_ex =")
    _change(own / PARAMETERS, "[tail_rotor]", "[tailrotor]")
    _change(own / MJCF, 'name="air" dim="6"', 'name="air" dim="7"')
    (own / TUNED).unlink()
    assert main(["vehicle", "check", "own"]) == 2
    *lines, last = capsys.readouterr().out.splitlines()
    places = [line.split(": ")[0].rstrip("0123456789").rstrip(":") for line in lines]
    expected = ["own/parameters.toml"] * 3 + ["own/tuned.toml", "own/own.xml"]
    assert [place for place in places if place] == expected
    assert last == "own: 5 problems."


def test_what_is_well_is_shown(own, capsys):
    """Figures of the hover, poles, margins; exit status 0."""
    assert main(["vehicle", "check", str(own)]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith("own: All is well.")
    for text in (
        "mass                    8.01 kg",
        "disc loading            42.5 N/m^2",
        "hover collective        4.58 deg",
        "hover power             899.8 W",
        "figure of merit         0.389",
        "-8.64 +- 12.4j",
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
        f"There is no such file: {command} the vehicle to make it.",
        own / file,
        remedy=Command(command, ("own",), (Option("write"),)),
    )


def test_no_hover(own):
    """A vehicle that is too heavy for its rotors; what to look at is said."""
    _change(own / MJCF, 'mass="4.19"', 'mass="400.19"')
    texts = [one.text for one in check_vehicle(own).problems]
    assert any(text.startswith("It does not hover: ") for text in texts), texts


def test_actuators_out_of_order(own):
    text = (own / MJCF).read_text()
    for old, new in (("LON", "X"), ("LAT", "LON"), ("X", "LAT")):
        text = text.replace(f'<general name="{old}"', f'<general name="{new}"')
    (own / MJCF).write_text(text)
    _is_said(own, "here is 'LAT' where 'LON' must be.", '<general name="LAT"')


def test_too_few_activations(own):
    """A class of servos with one state, where the keyframe has none that MuJoCo would refuse."""
    text = re.sub(r' act="[^"]*"', "", (own / MJCF).read_text())
    (own / MJCF).write_text(text)
    _change(own / MJCF, 'actdim="2"', 'actdim="1"')
    _is_said(own, 'must have dyntype="user" actdim="2"', 'name="servo_front"')


def test_numbers_in_the_mjcf_that_are_out_of_date(own):
    _change(own / PARAMETERS, "drag_area_x = { value = 0.03", "drag_area_x = { value = 0.04")
    (problem,) = check_vehicle(own).problems
    assert "the <general> 'rotor' has other numbers (user)" in problem.text.lower()
    assert problem.remedy == Command("vehicle build", ("own",))
    assert (own / MJCF).read_text().splitlines()[problem.line - 1].lstrip().startswith("<general")
    assert main(["vehicle", "build", str(own), "--quiet"]) == 0
    assert check_vehicle(own).problems == ()


def test_a_section_that_nothing_reads_is_remarked(own, capsys):
    with (own / PARAMETERS).open("a") as file:
        file.write('[my_law]\ngain = { value = 2.0, unit = "1", source = "mine" }\n')
    assert main(["vehicle", "check", str(own)]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "Nothing in helisim reads the section [my_law]: it is left to you." in printed


def test_no_mjcf_and_no_vehicle(own, tmp_path):
    """Of two MJCF neither is guessed; what is no vehicle at all is refused."""
    (own / MJCF).rename(own / "a.xml")
    (own / "b.xml").write_text("<mujoco/>")
    (problem,) = check_vehicle(own).problems
    assert "which file is the vehicle's MJCF?" in problem.text
    with pytest.raises(UnknownNameError):
        check_vehicle(tmp_path)
