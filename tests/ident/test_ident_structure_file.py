"""Structures in TOML files: what a user writes comes in whole, and mistakes are named."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helisim.base.errors import InputError, StorageError, UnknownNameError
from helisim.ident import FrequencyResponse, Parameter, Structure, identify, structures
from helisim.ident.evaluate import response
from late import LATE

GOOD = """
name = "side"
meaning = "side velocity over lateral cyclic"
states = ["v", "x"]
inputs = ["lat"]
outputs = ["ay", "v"]

[constants]
g = 9.80665

[parameters.Y_v]
unit = "1/s"
start = -0.2
meaning = "side damping"

[parameters.Y_lat]
unit = "m/s^2"
start = 2.0
bounds = [0.0, 9.0]

[parameters.tau]
unit = "s"
start = 0.0
scale = 0.05

[input_delays]
lat = "tau"

[output_delays]
ay = -0.01

[M]
x = { x = "2*tau + 1" }

[F]
v = { v = "Y_v", x = "-g" }
x = { v = "-Y_v/4", x = -1 }

[G]
v = { lat = "Y_lat" }

[H0]
v = { v = 1 }

[H1]
ay = { v = 1 }

[D]
ay = { lat = "Y_lat*0.1" }
"""


def write(tmp_path, text):
    path = tmp_path / "side.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_file_is_read_as_it_is_written(tmp_path):
    """Names, units, bounds, delays of either sign and sparse matrices arrive in their places."""
    structure = Structure.from_toml(write(tmp_path, GOOD))
    assert structure.parameter("Y_lat") == Parameter("Y_lat", "m/s^2", 2.0, (0.0, 9.0))
    assert structure.parameter("Y_v").meaning == "side damping"
    assert structure.M == (("1", "0"), ("0", "2*tau + 1"))
    assert structure.F == (("Y_v", "-g"), ("-Y_v/4", "-1"))
    assert structure.H1 == (("1", "0"), ("0", "0"))
    assert dict(structure.output_delays) == {"ay": "-0.01"}


def test_a_structure_of_ones_own_is_identified(tmp_path):
    """A file is all that a new structure takes: delays, bounds, M, H1 and D act in the fit."""
    structure = Structure.from_toml(write(tmp_path, GOOD))
    true = {"Y_v": -0.35, "Y_lat": 3.1, "tau": 0.03}
    grid = np.geomspace(0.2, 30.0, 60)
    data = FrequencyResponse.exact(
        grid, response(structure, true, grid), inputs=structure.inputs, outputs=structure.outputs
    )
    fit = identify(data, structure)
    # the data are exact: what is left is the search's tolerance, 1e-10 of the cost
    assert fit.values == pytest.approx(true, rel=1e-5)
    assert fit.delays == pytest.approx({"lat": true["tau"], "ay": -0.01, "v": 0.0}, rel=1e-5)
    bounded = structure.with_bounds({"Y_lat": (0.0, 2.5)})
    assert identify(data, bounded).at_bound == ("Y_lat",)


@pytest.mark.parametrize("name", list(structures.BUILT_IN))
def test_every_built_in_structure_survives_its_file(name, tmp_path):
    """A built-in structure written to TOML and read back is the same, to the last expression."""
    structure = structures.named(name)
    text = structure.to_toml(tmp_path / "one.toml")
    again = Structure.from_toml(tmp_path / "one.toml")
    assert again.to_dict() == structure.to_dict()
    assert again.to_toml() == text


def test_a_structure_without_states_survives_its_file(tmp_path):
    """A gain has no states and no matrix rows, and still reads back."""
    gain = structures.transfer_function(zeros=0, poles=0, input="lat", output="p")
    gain.to_toml(tmp_path / "gain.toml")
    assert Structure.from_toml(tmp_path / "gain.toml").to_dict() == gain.to_dict()


@given(
    start=st.floats(-1e6, 1e6),
    low=st.one_of(st.none(), st.floats(1e-6, 1e6)),
    high=st.one_of(st.none(), st.floats(1e-6, 1e6)),
    meaning=st.text(st.characters(codec="utf-8"), max_size=30),
    fixed=st.booleans(),
)
def test_any_parameter_survives_a_file(tmp_path_factory, start, low, high, meaning, fixed):
    """Numbers come back to the last bit, open bounds open, and text with any character."""
    bounds = None
    if low is not None or high is not None:
        bounds = (
            -np.inf if low is None else start - low - abs(start),
            np.inf if high is None else start + high + abs(start),
        )
    parameter = Parameter("K", "1", start, bounds, meaning, None, fixed)
    structure = Structure(
        "gain", (parameter,), (), ("lat",), ("p",), H0=((),), D=(("K",),), meaning=meaning
    )
    path = tmp_path_factory.mktemp("any") / "gain.toml"
    structure.to_toml(path)
    again = Structure.from_toml(path)
    assert again.parameters == structure.parameters
    assert again.meaning == meaning


@pytest.mark.parametrize(
    ("old", "new", "error", "message"),
    [
        ('v = "Y_v"', 'v = "Y_w"', UnknownNameError, r"F\.v\.v.*Y_v, Y_lat, tau, g"),
        ('"-Y_v/4"', '"-Y_v/"', InputError, r"F\.x\.v.*can't read the expression"),
        ('"Y_lat*0.1"', "\"open('x')\"", InputError, r"D\.ay\.lat.*isn't allowed"),
        ("ay = { v = 1 }", "az = { v = 1 }", UnknownNameError, "row of H1 'az'.*ay, v"),
        ("v = { lat", "v = { lon", UnknownNameError, r"column of G\.v 'lon'.*lat"),
        ("start = -0.2\n", "", InputError, "parameter 'Y_v' needs start"),
        ("start = -0.2", 'start = "much"', InputError, "'Y_v'.start must be a number, got 'much'"),
        ("start = -0.2", "start = nan", InputError, "'Y_v'.start must be a finite number, got nan"),
        (
            "[0.0, 9.0]",
            "[9.0]",
            InputError,
            r"'Y_lat'.bounds must be a list of 2 numbers, got \[9.0\]",
        ),
        ("[0.0, 9.0]", "[3.0, 9.0]", InputError, "'Y_lat' has bounds 3.0 to 9.0 and starts"),
        ("scale = 0.05", "scale = -1", InputError, "'tau'.scale must be a number above 0, got -1"),
        ("scale = 0.05", 'size = "1"', UnknownNameError, "setting of parameter 'tau' 'size'"),
        ("scale = 0.05", "fixed = 1", InputError, "'tau'.fixed must be true or false, got 1"),
        (
            'states = ["v", "x"]',
            'states = "vx"',
            InputError,
            "states must be a list of names, got 'vx'",
        ),
        ('"v", "x"]', '"v", 3]', InputError, r"states\[1\] must be text, got 3"),
        ('lat = "tau"', 'lon = "tau"', UnknownNameError, "input with a delay 'lon'.*lat"),
        ("g = 9.80665", 'g = "big"', InputError, "constants.g must be a number, got 'big'"),
        ("g = 9.80665", "Y_v = 9.8", InputError, "names repeat: Y_v"),
        ("[F]", "[K]", UnknownNameError, "setting of structure 'K'"),
        ("x = -1 }", "x = true }", InputError, r"F\.x\.x must be text or a number, got True"),
        ('name = "side"\n', "", InputError, "structure needs name"),
    ],
)
def test_mistakes_name_the_file_and_the_entry(tmp_path, old, new, error, message):
    """Each mistake ends in one message with the file, the entry, and what exists or is expected."""
    assert GOOD.count(old) >= 1
    path = write(tmp_path, GOOD.replace(old, new, 1))
    with pytest.raises(error, match=message) as raised:
        Structure.from_toml(path)
    assert str(raised.value).startswith(f"{path}: ")


def test_files_that_are_no_toml_say_where(tmp_path):
    """A missing file and broken TOML are storage errors; the latter with its line."""
    with pytest.raises(StorageError, match=r"none\.toml"):
        Structure.from_toml(tmp_path / "none.toml")
    with pytest.raises(StorageError, match="line 3"):
        Structure.from_toml(write(tmp_path, 'name = "x"\nstates = [\n=\n'))
    (tmp_path / "side.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(StorageError, match=r"side\.toml"):
        Structure.from_toml(tmp_path / "side.toml")


plain_data = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=8)),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3), st.dictionaries(st.text(max_size=4), inner, max_size=3)
    ),
    max_leaves=8,
)


@given(data=st.data())
def test_whatever_is_written_ends_in_a_structure_or_an_input_error(data):
    """No entry of a structure, whatever its type and content, ends in another exception."""
    plain = structures.hover.to_dict()
    for key in data.draw(st.lists(st.sampled_from(sorted(plain)), min_size=1, max_size=2)):
        plain[key] = data.draw(plain_data)
    if data.draw(st.booleans()):
        plain["parameters"] = {"K": data.draw(plain_data)}
    try:
        structure = Structure.from_dict(plain)
    except InputError as error:
        message = str(error)
    else:
        assert Structure.from_dict(structure.to_dict()).to_dict() == structure.to_dict()
        return
    assert message


def test_a_matrix_that_is_no_table_is_refused_by_its_row():
    """Rows are counted from 0, as Python does."""
    plain = json.loads(json.dumps(LATE.to_dict()))
    plain["F"] = [["a", "0.4"], 3.0]
    with pytest.raises(InputError, match=r"F\[1\] must be"):
        Structure.from_dict(plain)
