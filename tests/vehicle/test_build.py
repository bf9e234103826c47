"""`helisim vehicle build`: a vehicle's numbers in its MJCF, for stock MuJoCo."""

import re

import mujoco
import numpy as np
import pytest

import helisim as hs
from helisim.base.errors import CallbackError, ModelError, UnknownNameError
from helisim.cli import main
from helisim.study.new_vehicle import new_vehicle
from helisim.vehicle import build
from helisim.vehicle.build import unwritten, write_numbers


@pytest.fixture
def folder(tmp_path):
    """A vehicle of one's own, the Blade 360's copy."""
    return new_vehicle("own", like="blade360", to=tmp_path)


def mjcf(folder):
    return folder / "own.xml"


def alter(path, old, new, count=1):
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, count), encoding="utf-8")


def drift(model, seconds=10.0):
    """Return how far it gets from its keyframe in stock MuJoCo, m."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("hover").id)
    start = data.qpos[:3].copy()
    with hs.installed():
        mujoco.mj_step(model, data, round(seconds / model.opt.timestep))
    return np.abs(data.qpos[:3] - start).max()


def test_a_changed_parameter_reaches_stock_mujoco(folder):
    """Without the build the numbers are the old ones; with it the vehicle hovers by the new."""
    assert unwritten(folder) == ()
    path = folder / "parameters.toml"
    text = path.read_text(encoding="utf-8")
    changed = re.sub(r"(?m)^density = \{ value = [0-9.]+", "density = { value = 1.15", text)
    assert changed != text
    path.write_text(changed, encoding="utf-8")
    said = [change.element.name or change.element.tag for change in unwritten(folder)]
    assert said == ["rotor", "hover"]
    before = mjcf(folder).read_text(encoding="utf-8").splitlines()
    assert write_numbers(folder) == (mjcf(folder),)
    after = mjcf(folder).read_text(encoding="utf-8").splitlines()
    # the lines of density and of what it does to a blade whose tau_f stays; attitude, controls,
    # states and the force felt of the keyframe
    assert len(set(before) - set(after)) == 6
    model = mujoco.MjModel.from_xml_path(str(mjcf(folder)))
    vehicle = hs.load(folder)
    assert np.array_equal(model.actuator_user, vehicle.model.actuator_user)
    assert drift(model) < 1e-6
    assert write_numbers(folder) == ()


def test_numbers_of_an_older_helisim_are_replaced(folder):
    """Another layout, fewer numbers, a keyframe with other states: the build mends them all."""
    fresh = mjcf(folder).read_text(encoding="utf-8")
    stale = re.sub(r'user="\s+48756173 8 \d+', 'user="\n      48756173 8 17', fresh)
    stale = re.sub(r'act="[^"]*"', 'act="0 0 0"', stale)
    mjcf(folder).write_text(stale, encoding="utf-8")
    write_numbers(folder)
    assert mjcf(folder).read_text(encoding="utf-8") == fresh


def test_the_authors_names_are_found_through_the_roles(folder):
    """An actuator, a sensor, a keyframe and a body of other names."""
    for old, new in (
        ('<general name="PED"', '<general name="rudder"'),
        ('<gyro name="gyro_rate"', '<gyro name="seen"'),
        ('<key name="hover"', '<key name="aloft"'),
        ('<body name="fuselage"', '<body name="hull"'),
    ):
        alter(mjcf(folder), old, new)
    with open(folder / "parameters.toml", "a", encoding="utf-8") as file:
        file.write('[roles.actuator]\nPED = "rudder"\n[roles.sensor]\ngyro_rate = "seen"\n')
        file.write('[roles.keyframe]\nhover = "aloft"\n[roles.body]\nfuselage = "hull"\n')
    text = mjcf(folder).read_text(encoding="utf-8")
    bare = re.sub(r' user="48756173 3"', "", text).replace(' interval="0.002 -0.0005"', "")
    mjcf(folder).write_text(bare, encoding="utf-8")
    write_numbers(folder)
    model = mujoco.MjModel.from_xml_path(str(mjcf(folder)))
    assert hs.check_model(model) == ("own",)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (r"<key name=.*?/>", "", r"own\.xml: no keyframe \'hover\': add <keyframe>"),
        (r"fullinertia=", "diaginertia=", r"own\.xml"),
        (r"</mujoco>", "", r"own\.xml"),
    ],
)
def test_what_can_not_be_written_is_said_and_nothing_is(folder, old, new, said):
    """One line with the file; the MJCF stays."""
    text = re.sub(old, new, mjcf(folder).read_text(encoding="utf-8"), flags=re.DOTALL)
    mjcf(folder).write_text(text, encoding="utf-8")
    with pytest.raises(ModelError, match=said) as caught:
        write_numbers(folder)
    assert "\n" not in str(caught.value)
    assert mjcf(folder).read_text(encoding="utf-8") == text


def test_what_would_not_fly_is_taken_back(folder, monkeypatch):
    """The files are read by stock MuJoCo and checked; if that fails they are as they were."""
    alter(mjcf(folder), ' user="48756173 3"', "")
    before = mjcf(folder).read_bytes()

    def refuse(model):
        assert mjcf(folder).read_bytes() != before
        raise CallbackError("lacks something")

    monkeypatch.setattr(build, "check_model", refuse)
    with pytest.raises(CallbackError, match="lacks something"):
        write_numbers(folder)
    assert mjcf(folder).read_bytes() == before


def test_no_such_vehicle():
    """As everywhere."""
    with pytest.raises(UnknownNameError, match="jr700"):
        write_numbers("nowhere")


def test_the_command(folder, capsys):
    """`--check` says where, status 1; without it they are written; then there is nothing to do."""
    alter(mjcf(folder), ' user="48756173 3"', "")

    def run(*options):
        return main(["vehicle", "build", str(folder), *options]), capsys.readouterr().out.strip()

    status, said = run("--check")
    assert status == 1
    assert re.search(r'own\.xml, line \d+: <general name="PED">: user', said)
    assert run() == (0, f"Written: {mjcf(folder)}")
    assert run() == (0, "Nothing to write: the MJCF says what the parameters give")
    assert run("--check", "--quiet") == (0, "")
