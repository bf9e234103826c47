"""Names that do not exist: the message lists those that do, or those that may have been meant."""

import copy
import pickle

import pytest

from helisim.base.errors import UnknownNameError, similar

AXES = ("col", "lon", "lat", "ped")
MANY = tuple(f"rotor.part_{k:02d}" for k in range(40))


def test_of_a_long_list_only_those_alike_are():
    error = UnknownNameError("parameter", "rotor.part_7", MANY)
    assert "there are 40" in str(error)
    assert "did you mean rotor.part_07 or " in str(error)
    assert error.available == MANY
    assert error.unlisted == MANY


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("LAT", ["lat"]),
        ("stiffness", ["main.stiffness"]),
        ("", []),
        ("main.radios", ["main.radius"]),
    ],
)
def test_case_parts_and_slips_are_seen(name, meant):
    assert similar(name, ("lat", "main.stiffness", "main.radius", "tail.speed")) == meant


@pytest.mark.parametrize("again", [copy.copy, lambda one: pickle.loads(pickle.dumps(one))])
def test_the_error_passes_between_processes(again):
    error = UnknownNameError("axis", "lta", AXES)
    said = "unknown axis 'lta'; available: col, lon, lat, ped"
    assert (str(error), error.unlisted) == (f"{said}; did you mean lat?", ())
    assert str(UnknownNameError("axis", "yaw", AXES)) == said.replace("lta", "yaw")
    assert str(again(error)) == str(error)
    assert again(error).available == AXES
