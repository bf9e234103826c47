"""MJCF as text: elements with their lines, through includes, and attributes changed in place."""

import mujoco
import pytest

from helisim.base.errors import ModelError, StorageError
from helisim.vehicle.build import Mjcf

MAIN = """\
<?xml version="1.0"?>
<mujoco model="m">
  <!-- Ä comment with <geom name="no"/> in it -->
  <include file="parts.xml"/>
  <worldbody>
    <body name='one'>
      <freejoint name="j"/>
      <geom name="g"   size="0.1"  mass="1"/> <!-- behind -->
    </body>
    <body name="two"
          pos="1 0 0"><geom
          size="0.2"/></body>
  </worldbody>
</mujoco>
"""
PARTS = """\
<mujoco>
  <!-- of the parts -->
  <actuator>
    <general name="a" joint="j"/>
    <general name="g" joint="j" user="1 2"/>
  </actuator>
</mujoco>
"""


@pytest.fixture
def path(tmp_path):
    (tmp_path / "parts.xml").write_text(PARTS, encoding="utf-8")
    (tmp_path / "m.xml").write_text(MAIN, encoding="utf-8")
    return tmp_path / "m.xml"


def test_elements_know_where_they_stand(path):
    """Name, file and line, in the order in which MuJoCo meets them."""
    found = [(one.tag, one.name, one.file.name, one.line) for one in Mjcf(path)]
    assert found == [
        ("mujoco", "", "m.xml", 2),
        ("include", "", "m.xml", 4),
        ("actuator", "", "parts.xml", 3),
        ("general", "a", "parts.xml", 4),
        ("general", "g", "parts.xml", 5),
        ("worldbody", "", "m.xml", 5),
        ("body", "one", "m.xml", 6),
        ("freejoint", "j", "m.xml", 7),
        ("geom", "g", "m.xml", 8),
        ("body", "two", "m.xml", 10),
        ("geom", "", "m.xml", 11),
    ]


def test_names_are_of_a_section(path):
    """An actuator and a geom may share a name; what an include holds is in its place."""
    mjcf = Mjcf(path)
    assert mjcf.find("actuator", "g").attributes["user"] == "1 2"
    assert mjcf.find("worldbody", "g").attributes["mass"] == "1"
    assert mjcf.find("worldbody", "g", tag="body") is None
    assert [one.tag for one in mjcf.children(mjcf.find("worldbody", "one"))] == [
        "freejoint",
        "geom",
    ]
    assert (
        mjcf.find("actuator", "a").place == f'{path.parent}/parts.xml, line 4: <general name="a">'
    )


def test_only_what_is_set_changes(path):
    """In place where it is there, behind where it is new, gone where it is None."""
    mjcf = Mjcf(path)
    mjcf.set(mjcf.find("worldbody", "g"), {"size": "0.3", "mass": None, "group": "2"})
    mjcf.set(mjcf.find("worldbody", "two"), {"pos": "2 0 0"})
    assert mjcf.write() == (path,)
    assert path.read_text(encoding="utf-8") == MAIN.replace(
        'size="0.1"  mass="1"/>', 'size="0.3" group="2"/>'
    ).replace('pos="1 0 0"', 'pos="2 0 0"')
    assert mujoco.MjModel.from_xml_path(str(path)).body("two").pos[0] == 2.0


def test_an_included_file_is_written_where_it_is(path):
    """And the file that includes it stays."""
    mjcf = Mjcf(path)
    mjcf.set(mjcf.find("actuator", "a"), {"user": "\n      3\n      4"})
    assert mjcf.write() == (path.parent / "parts.xml",)
    assert path.read_text(encoding="utf-8") == MAIN
    # to MuJoCo a line break between numbers is a space
    assert mujoco.MjModel.from_xml_path(str(path)).actuator("a").user.tolist() == [3.0, 4.0]


def test_a_comment_is_put_once(path):
    """Straight before the element; one that begins alike is replaced, another stays."""
    mjcf = Mjcf(path)
    for text in ("Written.\n     First", "Written.\n     Second"):
        mjcf.set(mjcf.find("actuator", "g"), {}, comment=text)
    mjcf.write()
    assert (path.parent / "parts.xml").read_text(encoding="utf-8") == PARTS.replace(
        '    <general name="g"',
        '    <!-- Written.\n         Second -->\n    <general name="g"',
    )


def test_nothing_changed_writes_nothing(path):
    """Not even the time of the file."""
    before = path.stat().st_mtime_ns
    assert Mjcf(path).write() == ()
    assert path.stat().st_mtime_ns == before


@pytest.mark.parametrize(
    ("file", "text", "said"),
    [
        ("m.xml", MAIN.replace("</worldbody>", ""), r"m\.xml, line 14: not XML: mismatched tag"),
        ("parts.xml", "", r"parts\.xml, line 1: not XML: no element found"),
        ("m.xml", MAIN.replace("parts", "m"), r"m\.xml: is included twice"),
        ("m.xml", MAIN.replace("parts", "odd"), r"line 4: <include>: .*odd\.xml: no such file"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(path, file, text, said):
    """One line: the file, where, and what."""
    (path.parent / file).write_text(text, encoding="utf-8")
    with pytest.raises(ModelError, match=said) as caught:
        Mjcf(path)
    assert "\n" not in str(caught.value)


def test_a_missing_file(tmp_path):
    """As every file that is missing."""
    with pytest.raises(StorageError, match="no such file"):
        Mjcf(tmp_path / "m.xml")
