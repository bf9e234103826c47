"""A vehicle is a folder, anywhere, and the names in its MJCF are its author's."""

import pickle
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

import helisim as hs
from command import fails
from helisim.base.errors import InputError, ModelError, UnknownNameError
from helisim.cli import main
from helisim.physics.layout import ACTUATORS
from helisim.records.storage import read_record, write_record
from helisim.sim.rigs import suspension_test
from helisim.study.campaign import read_campaign
from helisim.study.replicates import run_campaign
from helisim.vehicle.assembly import assemble, mass_and_gravity
from helisim.vehicle.folder import model_folder
from own_vehicle import copied, edited, renamed


@pytest.fixture(scope="module")
def myheli(tmp_path_factory):
    """A copy of the JR700's folder under another name; nothing in it is changed."""
    return copied(tmp_path_factory.mktemp("hangar") / "myheli")


@pytest.fixture(scope="module")
def foreign(tmp_path_factory):
    """The same vehicle with every name in its MJCF changed."""
    return renamed(tmp_path_factory.mktemp("abroad") / "libelle")


@pytest.mark.parametrize("kind", [str, Path])
def test_a_copy_elsewhere_under_another_name_is_the_same_to_the_bit(jr700, myheli, kind):
    """Same trim, same matrices; the name is its folder's."""
    own = hs.load(kind(myheli))
    assert (own.name, own.folder) == ("myheli", myheli)
    assert own.trim == jr700.trim
    for inputs in ("IN1", "IN2"):
        found, wanted = own.linearize(inputs), jr700.linearize(inputs)
        for matrix in "ABCD":
            np.testing.assert_array_equal(
                getattr(found.system, matrix), getattr(wanted.system, matrix)
            )


def test_names_of_ones_own_change_no_bit(jr700, foreign):
    """Bodies, sites, actuators, sensors and files named otherwise, with roles."""
    own = hs.load(foreign)
    found, wanted = own.linearize("IN2"), jr700.linearize("IN2")
    for matrix in "ABCD":
        np.testing.assert_array_equal(getattr(found.system, matrix), getattr(wanted.system, matrix))
    flown, expected = (hs.fly(one, hs.Sweep(axis="lat", duration=12.0))[0] for one in (own, jr700))
    np.testing.assert_array_equal(flown["p"], expected["p"])
    assert flown.provenance["vehicle"] == "libelle"
    assert mass_and_gravity(foreign) == mass_and_gravity("jr700")


def test_names_of_ones_own_are_known_where_it_is_held_and_drawn(jr700, foreign):
    """Rigs, the model to look at, and a recording of it."""
    own = hs.load(foreign)
    model = own.visual_model()
    assert model.body("my_rotor_body").id > 0
    assert model.key("hover").ctrl[model.actuator("rotor").id] == 1.0
    assert [model.actuator(k).name for k in range(model.nu)] == list(ACTUATORS)
    assert suspension_test(own).to_dict() == suspension_test(jr700).to_dict()
    from helisim.show.scene import model_shapes

    shapes = model_shapes(model, own.roles)
    assert shapes.radius == own.parameters["main_rotor.radius"]
    assert shapes.rotor
    assert shapes.tail_rotor


def test_relative_paths_are_taken_from_where_one_is(myheli, monkeypatch):
    """A name that no shipped vehicle has is a folder here; the vehicle keeps its whole path."""
    monkeypatch.chdir(myheli.parent)
    assert model_folder("myheli") == model_folder("./myheli") == myheli
    monkeypatch.chdir(myheli)
    assert model_folder(".") == myheli
    assert model_folder("jr700").name == "jr700"


def test_a_path_is_never_a_shipped_name(monkeypatch, tmp_path):
    """`Path("jr700")` is a folder here, which there is not; "jr700" is the shipped vehicle."""
    monkeypatch.chdir(tmp_path)
    assert model_folder("jr700").is_dir()
    with pytest.raises(UnknownNameError, match="a folder with"):
        model_folder(Path("jr700"))


@pytest.mark.parametrize("name", ["", "jr70", "nowhere/at_all", "\0", "x" * 5000, "models"])
def test_neither_name_nor_folder(name, monkeypatch, tmp_path):
    """The error lists the shipped vehicles and says what a folder needs."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "models").mkdir()
    with pytest.raises(UnknownNameError) as caught:
        hs.load(name)
    message = str(caught.value)
    assert "available: blade360, jr700" in message
    assert "parameters.toml, calibrated.toml" in message
    assert ("did you mean jr700?" in message) == (name == "jr70")
    assert ("has no parameters.toml" in message) == (name == "models")
    assert str(pickle.loads(pickle.dumps(caught.value))) == message


def test_a_file_of_the_folder_is_not_the_folder(myheli):
    """Its MJCF, its parameters: the folder is asked for."""
    file = myheli / "parameters.toml"
    with pytest.raises(UnknownNameError, match="is a file; give the folder that"):
        hs.load(file)


@pytest.mark.slow
def test_a_vehicle_of_ones_own_passes_between_processes(myheli):
    """Pickled, it flies the same in another process, and is linearised from its folder."""
    own = hs.load(myheli)
    code = (
        "import pickle, sys\n"
        "vehicle = pickle.load(sys.stdin.buffer)\n"
        "print(vehicle.folder, vehicle.digest, vehicle.derivatives['N_r'])\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], input=pickle.dumps(own), capture_output=True, check=True
    )
    found = done.stdout.decode().split()
    assert found == [str(myheli), own.digest, repr(own.derivatives["N_r"])]


def test_records_keep_no_path(myheli, tmp_path):
    """What a record says of its vehicle is the same on every machine."""
    record = hs.fly(hs.load(myheli), hs.Sweep(axis="ped", duration=12.0))[0]
    assert record.provenance["vehicle"] == "myheli"
    assert str(myheli.parent) not in str(record.provenance)
    path = tmp_path / "ped.parquet"
    write_record(record, path)
    assert read_record(path).provenance == record.provenance


def test_a_recording_asks_for_the_vehicle_that_flew(myheli, tmp_path, capsys):
    """It isn't shipped, so its shape must be given; then it is drawn."""
    record = hs.fly(hs.load(myheli), hs.Sweep(axis="ped", duration=12.0))[0]
    path = tmp_path / "ped.parquet"
    write_record(record, path)
    out = tmp_path / "ped.rrd"
    message = fails(capsys, "record", path, "--out", out)
    assert "flown by 'myheli'" in message
    assert "--vehicle PATH" in message
    assert not out.exists()
    assert main(["record", str(path), "--out", str(out), "--vehicle", str(myheli), "--quiet"]) == 0
    assert out.stat().st_size > 0


def test_commands_take_a_path(myheli, tmp_path, capsys, monkeypatch):
    """Linearise, trim, fly and record by path; `helisim linearize ../myheli` too."""
    monkeypatch.chdir(tmp_path)
    hangar = Path("..") / myheli.parent.name / "myheli"
    assert main(["linearize", str(hangar)]) == 0
    printed = capsys.readouterr().out
    assert main(["linearize"]) == 0
    assert capsys.readouterr().out == printed
    assert main(["trim", str(myheli), "--speeds", "0,5"]) == 0
    command = f"fly {myheli} --axis lat --duration 12 --out lat.parquet --rerun lat.rrd --quiet"
    assert main(command.split()) == 0
    assert read_record(tmp_path / "lat.parquet").provenance["vehicle"] == "myheli"


def test_a_campaign_takes_a_path_from_its_file(myheli, tmp_path):
    """Relative to the file that names it; the dataset keeps the name alone."""
    file = tmp_path / "noise.toml"
    file.write_text(
        f'[campaign]\nvehicle = "../{myheli.parent.name}/myheli"\nmodels = ["heave"]\nflights = 1\n'
        "[set.sweep]\nduration = 40\n"
    )
    (myheli.parent.parent / tmp_path.name).mkdir(exist_ok=True)
    file = file.rename(myheli.parent.parent / tmp_path.name / "noise.toml")
    campaign = read_campaign(file)
    assert campaign.vehicle == str(myheli)
    assert campaign.to_dict()["vehicle"] == "myheli"
    path = run_campaign(campaign, tmp_path / "noise")
    assert str(myheli.parent).encode() not in path.read_bytes()
    file.write_text('[campaign]\nvehicle = "jr701"\n')
    with pytest.raises(InputError, match=r"noise\.toml.*did you mean jr700"):
        read_campaign(file)


def test_a_folder_of_that_name_is_not_the_published_vehicle(tmp_path):
    """Nothing is published of someone's folder, even if it is called jr700."""
    own = copied(tmp_path / "jr700")
    from helisim.study.new_vehicle import calibrated_text
    from helisim.study.tune import tune

    with pytest.raises(ModelError, match=r"section \[targets\]"):
        calibrated_text(own)
    with pytest.raises(ModelError, match=r"section \[tuning\]"):
        tune(hs.load(own))


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("roles = 3", "must be a table"),
        ('[roles.sight]\nimu = "x"', "unknown kind of role 'sight'.*did you mean site"),
        ('[roles]\nimu = "x"', r"unknown kind of role 'imu'.*did you mean \[roles.site\] imu"),
        ('[roles.site]\nimuu = "x"', "unknown role of a site 'imuu'.*did you mean imu"),
        ("[roles.site]\nimu = 3", "roles.site.imu must be a name in quotes"),
        ('[roles]\nmjcf = ""', "roles.mjcf must be a name in quotes"),
        ('[roles]\nsite = "x"', r"\[roles.site\] must be a table"),
        ('[roles.site]\nimu = "hub"', "imu and hub are both 'hub'"),
        ('[roles.site]\nimu = "imuu"', "vehicle's imu: unknown site 'imuu'.*did you mean imu"),
        ('[roles.actuator]\nCOL = "COLL"', "unknown actuator 'COLL'.*did you mean COL"),
        ('[roles.sensor]\nair = "wind"', "unknown sensor 'wind'"),
        ('[roles.body]\nfuselage = "hull"', "vehicle's fuselage: unknown body 'hull'"),
        ('[roles]\nmjcf = "none.xml"', "none.xml"),
    ],
)
def test_a_role_that_cannot_be_is_one_line(tmp_path, capsys, table, message):
    """The line names the file, the role, what there is, and what may have been meant."""
    own = copied(tmp_path / "own")
    text = (own / "parameters.toml").read_text()
    (own / "parameters.toml").write_text(f"{table}\n{text}")
    with pytest.raises(ModelError, match=message) as caught:
        hs.load(own)
    assert str(own) in str(caught.value)
    assert fails(capsys, "linearize", own).startswith("helisim linearize: ")


def test_names_may_be_exchanged(jr700, tmp_path):
    """An author may call the lateral stick LON, and something else by a canonical name."""
    own = copied(tmp_path / "own")
    mjcf = own / "jr700.xml"
    text = mjcf.read_text().replace('general name="LAT"', 'general name="X"')
    text = text.replace('general name="LON"', 'general name="LAT"')
    mjcf.write_text(text.replace('general name="X"', 'general name="LON"'))
    with pytest.raises(ModelError, match="COL, LON, LAT"):
        hs.load(own)
    with (own / "parameters.toml").open("a") as file:
        file.write('[roles.actuator]\nLON = "LAT"\nLAT = "LON"\n')
    assert hs.load(own).trim == jr700.trim


def test_a_sensor_of_an_actuator_follows_its_name(foreign, tmp_path):
    """What an author measures of an actuator is still measured when that has another name."""
    own = renamed(tmp_path / "own")
    edited(
        own,
        "drawing.xml",
        "<sensor>",
        '<sensor><actuatorfrc name="effort" actuator="my_rotor_actuator"/>',
    )
    model = hs.load(own).model
    assert model.sensor("effort").objid[0] == model.actuator("rotor").id


def test_a_vehicle_without_a_scene_is_drawn_over_plain_ground(tmp_path):
    """The scene is optional; a picture has ground and light."""
    own = copied(tmp_path / "own")
    (own / "scene.xml").unlink()
    model = hs.load(own).visual_model()
    planes = np.count_nonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE)
    assert (planes, model.nlight) == (1, 2)


def test_which_file_is_the_mjcf_must_be_clear(tmp_path):
    """Of two that could be it neither is guessed."""
    own = copied(tmp_path / "own")
    (own / "draft.xml").write_text("<mujoco/>")
    with pytest.raises(ModelError, match=r"draft\.xml, jr700\.xml; name it in parameters\.toml"):
        hs.load(own)
    (own / "jr700.xml").rename(own / "own.xml")
    assert hs.load(own).name == "own"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('<gyro name="gyro_rate"', '<gyro name="gyro_rates"', "sensors must be"),
        ('<framequat name="imu_attitude"', '<framequat name="attitude"', "imu_attitude missing"),
        ('<site name="hub"', '<site name="hubb"', "did you mean hub"),
        ('<body name="fuselage">', '<body name="hull">', "vehicle's fuselage"),
        ('class="rotor" joint="root"', 'class="rotor" site="cg"', "free joint"),
    ],
)
def test_what_is_missing_from_the_mjcf_is_said(tmp_path, old, new, message):
    """With the file, and as one line: never a traceback."""
    own = copied(tmp_path / "own")
    edited(own, "jr700.xml", old, new)
    with pytest.raises(ModelError, match=message) as caught:
        hs.load(own)
    assert "jr700.xml" in str(caught.value)


def test_a_rig_that_a_vehicle_lacks_is_said(capsys):
    """The Blade 360 has none."""
    message = fails(capsys, "bench", "blade360")
    assert "unknown rig 'bench'; there is none; a rig is an MJCF in" in message


def test_assembly_takes_a_folder(myheli, jr700):
    """By path, as by name."""
    model = assemble(myheli, jr700.parameters, delays=False)
    assert not model.actuator_delay.any()
