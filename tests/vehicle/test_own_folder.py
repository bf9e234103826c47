"""A vehicle is a folder, anywhere."""

import pickle
import subprocess
import sys

import numpy as np
import pytest

import helisim as hs
from command import fails
from helisim.base.errors import InputError, ModelError, UnknownNameError
from helisim.cli import main
from helisim.records.storage import write_record
from helisim.study.campaign import read_campaign
from helisim.study.new_vehicle import calibrated_text
from helisim.study.replicates import run_campaign
from helisim.study.tune import tune
from helisim.vehicle.parameters import model_folder
from own_vehicle import copied, edited


@pytest.fixture(scope="module")
def myheli(tmp_path_factory):
    """A copy of the JR700's folder under another name; nothing in it is changed."""
    return copied(tmp_path_factory.mktemp("hangar") / "myheli")


def test_a_copy_elsewhere_under_another_name_is_the_same_to_the_bit(jr700, myheli):
    """Same trim, same matrices; the name is its folder's."""
    own = hs.load(str(myheli))
    assert (own.name, own.folder) == ("myheli", myheli)
    assert own.trim == jr700.trim
    for inputs in ("IN1", "IN2"):
        found, wanted = own.linearize(inputs).system, jr700.linearize(inputs).system
        for matrix in "ABCD":
            np.testing.assert_array_equal(getattr(found, matrix), getattr(wanted, matrix))


def test_relative_paths_are_taken_from_where_one_is(myheli, monkeypatch):
    """A name that no shipped vehicle has is a folder here; the vehicle keeps its whole path."""
    monkeypatch.chdir(myheli.parent)
    assert model_folder("myheli") == model_folder("./myheli") == myheli
    monkeypatch.chdir(myheli)
    assert model_folder(".") == myheli
    assert model_folder("jr700").name == "jr700"


@pytest.mark.parametrize("name", ["", "jr70", "\0", "x" * 5000])
def test_neither_name_nor_folder(name, monkeypatch, tmp_path):
    """The error lists the shipped vehicles and says what a folder needs."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UnknownNameError) as caught:
        hs.load(name)
    message = str(caught.value)
    assert "available: blade360, jr700" in message
    assert "parameters.toml, calibrated.toml" in message
    assert ("did you mean jr700?" in message) == (name == "jr70")
    assert str(pickle.loads(pickle.dumps(caught.value))) == message


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


def test_a_recording_asks_for_the_vehicle_that_flew(myheli, tmp_path, capsys):
    """Records keep its name and no path, so its shape must be given; then it is drawn."""
    record = hs.fly(hs.load(myheli), hs.Sweep(axis="ped", duration=12.0))[0]
    assert record.provenance["vehicle"] == "myheli"
    assert str(myheli.parent) not in str(record.provenance)
    path = tmp_path / "ped.parquet"
    write_record(record, path)
    out = tmp_path / "ped.rrd"
    message = fails(capsys, "record", path, "--out", out)
    assert "flown by 'myheli'" in message
    assert "--vehicle PATH" in message
    assert not out.exists()
    assert main(["record", str(path), "--out", str(out), "--vehicle", str(myheli), "--quiet"]) == 0
    assert out.stat().st_size > 0


@pytest.mark.slow
def test_a_campaign_takes_a_path_from_its_file(myheli, tmp_path):
    """Relative to the file that names it; the dataset keeps the name alone."""
    text = (
        f'[campaign]\nvehicle = "../{myheli.parent.name}/myheli"\nmodels = ["heave"]\nflights = 1'
    )
    file = myheli.parent.parent / tmp_path.name / "noise.toml"
    file.parent.mkdir(exist_ok=True)
    file.write_text(f"{text}\n[set.sweep]\nduration = 40\n")
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
    with pytest.raises(ModelError, match=r"section \[targets\]"):
        calibrated_text(own)
    with pytest.raises(ModelError, match=r"section \[tuning\]"):
        tune(hs.load(own))


def test_which_file_is_the_mjcf_must_be_clear(tmp_path):
    """Of two that could be it neither is guessed."""
    own = copied(tmp_path / "own")
    (own / "draft.xml").write_text("<mujoco/>")
    with pytest.raises(ModelError, match="there are 2 others; give it that name"):
        hs.load(own)
    (own / "jr700.xml").rename(own / "own.xml")
    assert hs.load(own).name == "own"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('<gyro name="gyro_rate"', '<gyro name="gyro_rates"', "did you mean gyro_rates"),
        ('<site name="hub"', '<site name="hubb"', "did you mean hub"),
        ('<body name="fuselage">', '<body name="hull">', "unknown body 'fuselage'"),
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
