"""Parameters: names, units, words and sources; what can't be is refused with one clear line."""

import math
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helisim.base.errors import HelisimError, InputError, ModelError, UnknownNameError
from helisim.vehicle import load, read_parameters, standard_parameters
from helisim.vehicle.parameters import glossary, number_of, term, to_toml, vehicle_names
from own_vehicle import copied, edited
from tabled import tabled

CHOICES = {name: known.words for name, known in glossary().items() if known.words}


@pytest.mark.parametrize("name", vehicle_names())
def test_the_shipped_vehicles_are_plausible(name, tmp_path):
    parameters = standard_parameters(name)
    for key, entry in parameters.entries().items():
        known = term(key)
        assert known is not None, key
        assert (entry.name, entry.unit) == (key, known.unit)
        assert entry.source
        assert known.low <= entry.value <= known.high, key
    assert all(key in parameters for key, known in glossary().items() if not known.optional)
    (tmp_path / "p.toml").write_text(to_toml(parameters, "header"))
    assert dict(read_parameters(tmp_path / "p.toml")) == dict(parameters)


@pytest.mark.parametrize("name", CHOICES)
def test_every_word_stands_for_a_number_and_back(name):
    for k, word in enumerate(CHOICES[name]):
        assert number_of(name, word) == number_of(name, k) == k
        chosen = standard_parameters("jr700").replace({name: word})
        assert chosen.word(name) == word
        assert f'value = "{word}"' in to_toml(chosen, "header")


GOVERNOR = "[drive]\ngovernor = { value = 'perfect', unit = '1', source = 'x' }"
DENSITY = "[air]\ndensity = "


@tabled("text", "message")
def test_a_malformed_file_is_refused(tmp_path, text, message):
    path = tmp_path / "parameters.toml"
    path.write_text(text)
    with pytest.raises(ModelError, match=message) as caught:
        read_parameters(path)
    assert str(path) in str(caught.value)


def test_a_parameter_is_defined_once_and_ones_own_section_is_left_alone(tmp_path):
    """Whoever writes a controller may keep its numbers with the vehicle's."""
    text = DENSITY + "{ value = 1.2, unit = 'kg/m^3', source = 'x' }"
    for name in ("a.toml", "b.toml"):
        (tmp_path / name).write_text(text)
    with pytest.raises(ModelError, match=r"air\.density' is already defined"):
        read_parameters(tmp_path / "a.toml", tmp_path / "b.toml")
    with pytest.raises(ModelError, match=r"none\.toml"):
        read_parameters(tmp_path / "none.toml")
    own = copied(tmp_path / "own")
    with (own / "parameters.toml").open("a") as file:
        file.write('[my_law]\ngain = { value = 2.0, unit = "bananas", source = "mine" }\n')
    assert load(own).parameters["my_law.gain"] == 2.0
    edited(own, "parameters.toml", "[servo]", "[servos]")
    with pytest.raises(ModelError, match=r"servo\.swash_frequency \(rad/s\) is missing"):
        load(own)


@tabled("changes", "error", "message")
def test_a_value_that_can_not_be_is_refused(changes, error, message):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(error, match=message) as raised:
            load(parameters=changes).linearize()
    assert len(str(raised.value).splitlines()) == 1


def test_replace_leaves_the_original(jr700):
    changed = jr700.parameters.replace({"air.density": 1.0})
    assert changed["air.density"] == 1.0
    assert changed.entry("air.density").source == "set by the user"
    assert jr700.parameters["air.density"] == 1.225
    assert "main_rotor.radios" not in jr700.parameters
    with pytest.raises(UnknownNameError, match=r"air\.density"):
        jr700.parameters["density"]


@pytest.mark.parametrize("timestep", [-0.001, math.nan, math.inf])
def test_a_bad_time_step_is_refused(timestep):
    with pytest.raises(InputError, match="timestep"):
        load(timestep=timestep)


@pytest.mark.parametrize(("file", "command"), [("calibrated", "calibrate"), ("tuned", "tune")])
def test_a_file_that_a_command_makes_is_asked_of_it(tmp_path, file, command):
    own = copied(tmp_path / "own")
    (own / f"{file}.toml").unlink()
    with pytest.raises(ModelError, match=f"{file}.toml: no such file") as caught:
        load(own)
    (remedy,) = caught.value.remedy
    assert remedy.name == command


NAMES = sorted(load().parameters)
VALUES = st.one_of(
    st.floats(allow_nan=False),
    st.floats(-10.0, 10.0),
    st.sampled_from([0.0, 5e-324, 1e-12, 1e9, -1e300, 1e300, float("inf")]),
)


@given(changes=st.dictionaries(st.sampled_from(NAMES), VALUES, min_size=1, max_size=3))
@settings(max_examples=20)
def test_any_override_loads_or_is_one_clear_error(changes):
    """No other exception, no warning, no linearisation with NaN, and one line of text."""
    message = ""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            system = load(parameters=changes).linearize()
        except HelisimError as error:
            message = str(error)
        else:
            assert np.all(np.isfinite(system.a))
    assert len(message.splitlines()) <= 1
