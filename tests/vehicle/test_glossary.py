"""The glossary of parameters: complete, and a wrong unit or name is refused by it."""

import pytest

from command import fails
from helisim.base.errors import ModelError
from helisim.vehicle import load, read_parameters, standard_parameters
from helisim.vehicle.calibrate import DIRECT, SOLVED
from helisim.vehicle.folder import vehicle_names
from helisim.vehicle.parameters import WrittenUnit, glossary, term, unit_fault
from own_vehicle import copied, edited


@pytest.mark.parametrize("name", vehicle_names())
def test_the_shipped_vehicles_are_plausible(name):
    """Every parameter is in the glossary, in its unit and range; none that is needed lacks."""
    parameters = standard_parameters(name)
    for key in parameters:
        known = term(key)
        assert known is not None, key
        assert parameters.entry(key).unit == known.unit
        assert known.low <= parameters[key] <= known.high, key
    assert all(key in parameters for key, known in glossary().items() if not known.optional)


def test_every_term_says_what_it_is_and_where_from():
    """Sentences; a unit that is one; a range with the low end first."""
    for known in glossary().values():
        assert known.meaning[0].isupper() or known.meaning[0].isdigit()
        assert known.meaning.endswith(".")
        assert known.origin.endswith(".")
        assert known.low < known.high
        assert WrittenUnit.of(known.unit).factor == 1.0, known.unit
    assert all(f"targets.{name}" in glossary() for name in DIRECT + SOLVED)


@pytest.mark.parametrize(
    ("unit", "value", "expected", "message"),
    [
        ("deg", 20.0, "rad", "20 deg are value = 0.349066"),
        ("rpm", 1700.0, "rad/s", "1700 rpm are value = 178.024"),
        ("mm", 767.0, "m", "767 mm are value = 0.767"),
        ("g mm^2", 2e8, "kg m^2", "value = 0.2, "),
        ("g/cm^3", 1.2e-3, "kg/m^3", "value = 1.2, "),
        ("ms", 2.0, "s", "value = 0.002"),
        ("Hz", 50.0, "rad/s", "value = 314.159"),
        ("Nmm/deg", 1500.0, "N m/rad", "value = 85.9437"),
        ("kgm2", 1.0, "kg m^2", "written 'kg m^2', not 'kgm2'"),
        ("m/s/s", 1.0, "m/s^2", "written 'm/s^2'"),
        ("kg·m²", 1.0, "kg m^2", "written 'kg m^2'"),
        ("-", 1.0, "1", "written '1'"),
        ("kg", 1.0, "m", "is in 'm', not in 'kg'"),
        ("furlong", 1.0, "m", "is in 'm', not in 'furlong'"),
        ("", 1.0, "m", "is in 'm', not in ''"),
        ("m", 1.0, "m", ""),
    ],
)
def test_a_unit_is_met_with_the_value_in_the_right_one(unit, value, expected, message):
    """Degrees, revolutions a minute, millimetres and grams, and other spellings."""
    found = unit_fault(unit, value, expected)
    assert message in found
    assert bool(found) == bool(message)


def test_a_wrong_unit_is_refused_on_loading(tmp_path, capsys):
    """One line: the file, what is expected, and the value in it."""
    own = copied(tmp_path / "own")
    edited(own, "parameters.toml", 'radius = { value = 0.767, unit = "m"', _RADIUS)
    with pytest.raises(ModelError, match=r"parameters\.toml: main_rotor\.radius is in 'm'"):
        load(own)
    assert 'value = 0.767, unit = "m"' in fails(capsys, "linearize", own)


_RADIUS = 'radius = { value = 767, unit = "mm"'


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "hub_x =",
            "hub_ex =",
            r"parameter of \[main_rotor\] 'hub_ex'.*did you mean hub_x",
        ),
        (
            "[servo]",
            "[servos]",
            r"servo\.swash_frequency \(rad/s\) is missing and 5 more",
        ),
        ("tau_f =", "x_f =", r"unknown parameter of \[flapping\] 'x_f'"),
    ],
)
def test_a_misspelt_parameter_is_refused_on_loading(tmp_path, old, new, message):
    """With what may have been meant; a section of one's own is left alone, but not taken."""
    own = copied(tmp_path / "own")
    file = "calibrated.toml" if "tau" in old else "parameters.toml"
    edited(own, file, old, new)
    with pytest.raises(ModelError, match=message):
        load(own)


def test_a_section_of_ones_own_is_left_alone(tmp_path):
    """Whoever writes a controller may keep its numbers with the vehicle's."""
    own = copied(tmp_path / "own")
    with (own / "parameters.toml").open("a") as file:
        file.write('[my_law]\ngain = { value = 2.0, unit = "bananas", source = "mine" }\n')
    assert load(own).parameters["my_law.gain"] == 2.0
    assert read_parameters(own / "parameters.toml").entry("my_law.gain").unit == "bananas"


@pytest.mark.parametrize(("file", "command"), [("calibrated", "calibrate"), ("tuned", "tune")])
def test_a_file_that_a_command_makes_is_asked_of_it(tmp_path, file, command):
    """Without it the vehicle can't fly yet; the message has the command."""
    own = copied(tmp_path / "own")
    (own / f"{file}.toml").unlink()
    with pytest.raises(ModelError, match=f"{file}.toml: no such file") as caught:
        load(own)
    (remedy,) = caught.value.remedy
    assert (remedy.name, remedy.arguments) == (command, (str(own),))
    assert [option.name for option in remedy.options] == ["write"]
