"""A vehicle is a folder, anywhere."""

import pickle
import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

import helisim as hs
from command import fails
from helisim.base.errors import CallbackError, InputError, ModelError, UnknownNameError
from helisim.cli import main
from helisim.records.storage import write_record
from helisim.study.campaign import read_campaign
from helisim.study.new_vehicle import calibrated_text, new_vehicle
from helisim.study.replicates import run_campaign
from helisim.study.tune import tune
from helisim.vehicle import build
from helisim.vehicle.build import Change, elements, unwritten, write_numbers
from helisim.vehicle.parameters import model_folder, read_parameters
from heron import copied, edited
from tabled import rows, tabled


@pytest.fixture(scope="module")
def myheli(tmp_path_factory):
    return copied(tmp_path_factory.mktemp("hangar") / "myheli")


def test_a_copy_elsewhere_is_the_same_to_the_bit_and_found_from_there(jr700, myheli, monkeypatch):
    own = hs.load(str(myheli))
    assert (own.name, own.folder) == ("myheli", myheli)
    assert own.trim == jr700.trim
    for inputs in ("IN1", "IN2"):
        found, wanted = own.linearize(inputs).system, jr700.linearize(inputs).system
        for matrix in "ABCD":
            np.testing.assert_array_equal(getattr(found, matrix), getattr(wanted, matrix))
    monkeypatch.chdir(myheli.parent)
    assert model_folder("myheli") == model_folder("./myheli") == myheli
    monkeypatch.chdir(myheli)
    assert model_folder(".") == myheli
    assert model_folder("jr700").name == "jr700"


@pytest.mark.parametrize("name", ["", "jr70", "\0", "x" * 5000])
def test_neither_name_nor_folder(name, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UnknownNameError) as caught:
        hs.load(name)
    message = str(caught.value)
    assert "available: blade360, jr700" in message
    assert "parameters.toml, calibrated.toml" in message
    assert ("did you mean jr700?" in message) == (name == "jr70")
    assert str(pickle.loads(pickle.dumps(caught.value))) == message


def test_a_recording_asks_for_the_vehicle_that_flew(myheli, tmp_path, capsys):
    record = hs.fly(hs.load(myheli), hs.Sweep(axis="ped", duration=12.0))[0]
    assert record.provenance["vehicle"] == "myheli"
    assert str(myheli.parent) not in str(record.provenance)
    path = tmp_path / "ped.parquet"
    write_record(record, path)
    out = tmp_path / "ped.rrd"
    message = fails(capsys, "rerun", path, "--out", out)
    assert "flown by 'myheli'" in message
    assert "--vehicle PATH" in message
    assert not out.exists()
    assert main(["rerun", str(path), "--out", str(out), "--vehicle", str(myheli), "--quiet"]) == 0
    assert out.stat().st_size > 0


@pytest.mark.slow
def test_a_campaign_takes_a_path_from_its_file(myheli, tmp_path):
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
    own = copied(tmp_path / "jr700")
    before = read_parameters(own / "calibrated.toml")
    text = calibrated_text(own)
    assert "Without [targets] only the blades' pitch is solved" in text
    (own / "calibrated.toml").write_text(text)
    found = read_parameters(own / "calibrated.toml")
    assert dict(found) == pytest.approx(dict(before), rel=1e-6)  # the trim's controls: 1e-9
    assert found.entry("airframe.izz") == before.entry("airframe.izz")
    (own / "calibrated.toml").unlink()
    with pytest.raises(ModelError, match=r"section \[targets\]"):
        calibrated_text(own)
    copied(tmp_path / "again")
    (tmp_path / "again" / "calibrated.toml").rename(own / "calibrated.toml")
    with pytest.raises(ModelError, match=r"section \[tuning\]"):
        tune(hs.load(own))


def test_which_file_is_the_mjcf_must_be_clear(tmp_path):
    own = copied(tmp_path / "own")
    (own / "draft.xml").write_text("<mujoco/>")
    with pytest.raises(ModelError, match="there are 2 others; give it that name"):
        hs.load(own)
    (own / "jr700.xml").rename(own / "own.xml")
    assert hs.load(own).name == "own"


@tabled("old", "new", "message")
def test_what_is_missing_from_the_mjcf_is_said(tmp_path, old, new, message):
    own = copied(tmp_path / "own")
    edited(own, "jr700.xml", old, new)
    with pytest.raises(ModelError, match=message) as caught:
        hs.load(own)
    assert "jr700.xml" in str(caught.value)


MJCF = Path(__file__).with_name("own_elements.xml").read_text(encoding="utf-8")


@pytest.fixture
def path(tmp_path):
    (tmp_path / "m.xml").write_text(MJCF, encoding="utf-8")
    return tmp_path / "m.xml"


def test_elements_know_where_they_stand_and_only_what_is_set_changes(path):
    found = [*elements(path, path.read_bytes())]
    known = rows(globals(), "test_elements_know_where_they_stand_and_only_what_is_set_changes")
    assert [(one.tag, one.name, one.line) for one in found][1:8] == known
    assert found[2].place == f'{path}, line 5: <body name="one">'
    _, _, _, _, g, two, *_ = elements(path, path.read_bytes())
    geom = Change.to(g, {"size": [0.3], "mass": [], "group": [2], "rgba": []})
    assert geom.attributes == ("size", "mass", "group")
    assert geom.new == b'<geom name="g"   size="0.3" group="2"/>'
    assert Change.to(two, {"pos": [2, 0, 0]}).new == b'<body name="two"\n          pos="2 0 0">'
    assert Change.to(two, {"pos": [1, 0, 1e-9]}, solved=1e-8).attributes == ()


@pytest.fixture
def folder(tmp_path):
    return new_vehicle("own", like="blade360", to=tmp_path)


def alter(folder, pattern, new):
    path = folder / "own.xml"
    text, count = re.subn(pattern, new, path.read_text(encoding="utf-8"), count=1, flags=re.DOTALL)
    assert count == 1
    path.write_text(text, encoding="utf-8")
    return text


def test_a_changed_parameter_reaches_stock_mujoco_and_older_numbers_are_replaced(folder):
    assert unwritten(folder) == ()
    path, mjcf = folder / "parameters.toml", folder / "own.xml"
    text = path.read_text(encoding="utf-8")
    changed = re.sub(r"(?m)^density = \{ value = [0-9.]+", "density = { value = 1.15", text)
    path.write_text(changed, encoding="utf-8")
    assert [change.element.name for change in unwritten(folder)] == ["rotor", "hover"]
    before = mjcf.read_text(encoding="utf-8")
    assert write_numbers(folder) == (mjcf,)
    after = mjcf.read_text(encoding="utf-8")
    kept = [re.sub(r'"[^"]*"', '""', text) for text in (before, after)]
    assert kept[0].split() == kept[1].split()
    model, vehicle = mujoco.MjModel.from_xml_path(str(mjcf)), hs.load(folder)
    assert np.array_equal(model.actuator_user, vehicle.model.actuator_user)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("hover").id)
    start = data.qpos[:3].copy()
    with hs.installed():
        mujoco.mj_step(model, data, 5000)
    assert np.abs(data.qpos[:3] - start).max() < 1e-6
    assert write_numbers(folder) == ()
    fresh = mujoco.MjModel.from_xml_path(str(folder / "own.xml"))
    alter(folder, r'user="\s+48756173 8 \d+', 'user="48756173 8 17')
    alter(folder, r'act="[^"]*"', 'act="0 0 0"')
    write_numbers(folder)
    mended = mujoco.MjModel.from_xml_path(str(folder / "own.xml"))
    assert np.array_equal(mended.actuator_user, fresh.actuator_user)
    assert mended.key_act == pytest.approx(fresh.key_act, abs=1e-9)


@tabled("old", "new", "said")
def test_what_can_not_be_written_is_said_and_nothing_is(folder, old, new, said):
    text = alter(folder, old, new)
    with pytest.raises(ModelError, match=said) as caught:
        write_numbers(folder)
    assert "\n" not in str(caught.value)
    assert (folder / "own.xml").read_text(encoding="utf-8") == text


def test_what_would_not_fly_is_not_written(folder, monkeypatch):
    before = alter(folder, ' user="48756173 3"', "")

    def refuse(model):
        assert model.actuator("PED").user[0] == 48756173
        raise CallbackError("lacks something")

    monkeypatch.setattr(build, "check_model", refuse)
    with pytest.raises(CallbackError, match="lacks something"):
        write_numbers(folder)
    assert (folder / "own.xml").read_text(encoding="utf-8") == before


def test_the_command(folder, capsys):
    alter(folder, ' user="48756173 3"', "")

    def run(*options):
        return main(["vehicle", "build", str(folder), *options]), capsys.readouterr().out.strip()

    status, said = run("--check")
    assert status == 1
    assert re.search(r'own\.xml, line \d+: <general name="PED">: user', said)
    assert run() == (0, f"Written: {folder / 'own.xml'}")
    assert run() == (0, "Nothing to write: the MJCF says what the parameters give")
    with pytest.raises(UnknownNameError, match="jr700"):
        write_numbers("nowhere")
