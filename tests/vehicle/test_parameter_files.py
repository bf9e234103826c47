"""Parameters: names, units and sources; files that are refused with one clear line."""

import math

import pytest

from helisim.base.errors import InputError, ModelError, UnknownNameError
from helisim.vehicle import load, read_parameters
from helisim.vehicle.folder import model_folder
from helisim.vehicle.parameters import to_toml


@pytest.fixture
def written(tmp_path):
    def write(text, name="parameters.toml"):
        path = tmp_path / name
        path.write_text(text)
        return path

    return write


def test_every_parameter_has_value_unit_and_source(jr700):
    """No number of the vehicle is without a unit and an origin."""
    for name in jr700.parameters:
        entry = jr700.parameters.entry(name)
        assert math.isfinite(entry.value)
        assert entry.unit
        assert entry.source
        assert entry.name == name


def test_files_survive_the_round_trip(jr700, written):
    """Written and read again, every value is the same to the bit."""
    again = read_parameters(written(to_toml(jr700.parameters, "header")))
    assert dict(again) == dict(jr700.parameters)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[air]\ndensity = { value = 1.2, source = 'x' }", "air.density needs value"),
        ("[air]\ndensity = { value = 1.2, unit = 'kg' }", "air.density needs value"),
        ("[air]\ndensity = { value = 'thick', unit = 'kg', source = 'x' }", "air.density needs"),
        ("[air]\ndensity = 1.2", "air.density needs value"),
        ("[air]\ndensity = { value = nan, unit = 'kg', source = 'x' }", "must be finite"),
        ("[air\ndensity", "can't read parameters"),
    ],
)
def test_malformed_file_is_refused(written, text, message):
    """A file without unit, source, number or syntax is refused; the message names the place."""
    path = written(text)
    with pytest.raises(ModelError, match=message) as caught:
        read_parameters(path)
    assert str(path) in str(caught.value)


def test_value_outside_a_section_is_refused(written):
    """A parameter without a section is a malformed file, not a traceback."""
    with pytest.raises(ModelError):
        read_parameters(written("density = 1.2"))


def test_missing_file_is_refused(tmp_path):
    """A file that isn't there is named."""
    with pytest.raises(ModelError, match=r"none\.toml"):
        read_parameters(tmp_path / "none.toml")


def test_parameter_defined_twice_is_refused(written):
    """Two files may not both define a parameter."""
    text = "[air]\ndensity = { value = 1.2, unit = 'kg/m^3', source = 'x' }"
    with pytest.raises(ModelError, match=r"air\.density' is already defined"):
        read_parameters(written(text, "a.toml"), written(text, "b.toml"))


def test_given_and_solved_do_not_overlap():
    """Every number stands in one of the two files of the model folder."""
    folder = model_folder("jr700")
    given = read_parameters(folder / "parameters.toml")
    solved = read_parameters(folder / "calibrated.toml")
    assert not set(given) & set(solved)


def test_unknown_names_list_the_known(jr700):
    """A wrong vehicle or parameter name is answered with those that exist."""
    with pytest.raises(UnknownNameError, match="jr700"):
        load("jr7000")
    with pytest.raises(UnknownNameError, match=r"main_rotor\.lift_slope"):
        load(parameters={"main_rotor.liftslope": 6.0})
    with pytest.raises(UnknownNameError, match=r"air\.density"):
        jr700.parameters["density"]


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_value_that_is_no_number_is_refused(value):
    """NaN and infinity never reach the force laws."""
    with pytest.raises(InputError, match=r"main_rotor\.hub_stiffness.*finite"):
        load(parameters={"main_rotor.hub_stiffness": value})


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("main_rotor.lift_slope", 0.0),
        ("air.density", -1.0),
        ("flapping.tau_f", 0.0),
        ("servo.tail_frequency", -140.0),
        ("gyro.k_i", 0.0),
        ("airframe.ixx", -0.2),
        ("airframe.izz", 0.0),
    ],
)
def test_a_value_that_must_be_positive_is_refused(name, value):
    """Zero or negative density, stiffness of time or inertia is one clear line."""
    with pytest.raises(ModelError):
        load(parameters={name: value})


def test_replace_leaves_the_original(jr700):
    """Parameters are read-only: a change is a copy, with its own source."""
    changed = jr700.parameters.replace({"air.density": 1.0})
    assert changed["air.density"] == 1.0
    assert changed.entry("air.density").source == "set by the user"
    assert jr700.parameters["air.density"] == 1.225


@pytest.mark.parametrize("timestep", [0.0, -0.001, math.nan, math.inf])
def test_bad_time_step_is_refused(timestep):
    """The time step must be a positive number."""
    with pytest.raises(InputError, match="timestep"):
        load(timestep=timestep)


def test_a_name_can_be_asked_for(jr700):
    """Whether a parameter exists is a question, not an error."""
    assert "main_rotor.radius" in jr700.parameters
    assert "main_rotor.radios" not in jr700.parameters
