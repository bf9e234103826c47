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
from helisim.vehicle.build import Change, elements, unwritten, write_numbers

MJCF = """\
<?xml version="1.0"?>
<mujoco model="m">
  <!-- Ä comment with <geom name="no"/> in it -->
  <worldbody>
    <body name='one'>
      <freejoint name="j"/>
      <geom name="g"   size="0.1"  mass="1"/> <!-- behind -->
    </body>
    <body name="two"
          pos="1 0 0"><geom
          size="0.2"/></body>
  </worldbody>
  <actuator>
    <general name="g" joint="j"/>
  </actuator>
</mujoco>
"""


@pytest.fixture
def path(tmp_path):
    (tmp_path / "m.xml").write_text(MJCF, encoding="utf-8")
    return tmp_path / "m.xml"


def test_elements_know_where_they_stand(path):
    """Tag, name and line, without what comments hold."""
    found = [*elements(path, path.read_bytes())]
    assert [(one.tag, one.name, one.line) for one in found][1:8] == [
        ("worldbody", "", 4),
        ("body", "one", 5),
        ("freejoint", "j", 6),
        ("geom", "g", 7),
        ("body", "two", 9),
        ("geom", "", 10),
        ("actuator", "", 13),
    ]
    assert found[2].place == f'{path}, line 5: <body name="one">'


def test_only_what_is_set_changes(path):
    """In place where it is there, behind where it is new, gone where there is none."""
    _, _, _, _, g, two, *_ = elements(path, path.read_bytes())
    geom = Change.to(g, {"size": [0.3], "mass": [], "group": [2], "rgba": []})
    assert geom.attributes == ("size", "mass", "group")
    assert geom.new == b'<geom name="g"   size="0.3" group="2"/>'
    assert Change.to(two, {"pos": [2, 0, 0]}).new == b'<body name="two"\n          pos="2 0 0">'
    assert Change.to(two, {"pos": [1, 0, 1e-9]}, solved=1e-8).attributes == ()


@pytest.fixture
def folder(tmp_path):
    """A vehicle of one's own, the Blade 360's copy."""
    return new_vehicle("own", like="blade360", to=tmp_path)


def alter(folder, pattern, new):
    path = folder / "own.xml"
    text, count = re.subn(pattern, new, path.read_text(encoding="utf-8"), count=1, flags=re.DOTALL)
    assert count == 1
    path.write_text(text, encoding="utf-8")
    return text


def test_a_changed_parameter_reaches_stock_mujoco(folder):
    """Without the build the numbers are the old ones; with it the vehicle hovers by the new."""
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


def test_numbers_of_an_older_helisim_are_replaced(folder):
    """Another layout, and a keyframe with other states: the build mends them all."""
    fresh = mujoco.MjModel.from_xml_path(str(folder / "own.xml"))
    alter(folder, r'user="\s+48756173 8 \d+', 'user="48756173 8 17')
    alter(folder, r'act="[^"]*"', 'act="0 0 0"')
    write_numbers(folder)
    mended = mujoco.MjModel.from_xml_path(str(folder / "own.xml"))
    assert np.array_equal(mended.actuator_user, fresh.actuator_user)
    assert mended.key_act == pytest.approx(fresh.key_act, abs=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (r"<key name=.*?/>", "", r'own\.xml: no <key name="hover"/> in this file'),
        (r"<inertial [^>]*fullinertia=[^>]*>", "", r'<body name="fuselage"> needs <inertial'),
        (r"</mujoco>", "", r"own\.xml"),
    ],
)
def test_what_can_not_be_written_is_said_and_nothing_is(folder, old, new, said):
    """One line with the file; the MJCF stays."""
    text = alter(folder, old, new)
    with pytest.raises(ModelError, match=said) as caught:
        write_numbers(folder)
    assert "\n" not in str(caught.value)
    assert (folder / "own.xml").read_text(encoding="utf-8") == text


def test_what_would_not_fly_is_not_written(folder, monkeypatch):
    """What is to be written is read by stock MuJoCo and checked before."""
    before = alter(folder, ' user="48756173 3"', "")

    def refuse(model):
        assert model.actuator("PED").user[0] == 48756173
        raise CallbackError("lacks something")

    monkeypatch.setattr(build, "check_model", refuse)
    with pytest.raises(CallbackError, match="lacks something"):
        write_numbers(folder)
    assert (folder / "own.xml").read_text(encoding="utf-8") == before


def test_the_command(folder, capsys):
    """`--check` says where, status 1; without it they are written; then there is nothing to do."""
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
