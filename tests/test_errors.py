"""Names that do not exist: the message lists those that do, or those that may have been meant."""

import copy
import pickle

import pytest

from helisim.base.errors import UnknownNameError, similar
from helisim.cli import main

AXES = ("col", "lon", "lat", "ped")
MANY = tuple(f"rotor.part_{k:02d}" for k in range(40))


def test_a_short_list_is_in_the_message():
    """All names, then the one that was probably meant."""
    error = UnknownNameError("axis", "lta", AXES)
    assert str(error) == "unknown axis 'lta'; available: col, lon, lat, ped; did you mean lat?"
    assert error.unlisted == ()


def test_of_a_long_list_only_those_alike_are():
    """Their number is said, and the error keeps them all."""
    error = UnknownNameError("parameter", "rotor.part_7", MANY)
    assert "there are 40" in str(error)
    assert "did you mean rotor.part_07 or " in str(error)
    assert error.available == MANY
    assert error.unlisted == MANY


def test_what_is_like_nothing_is_not_guessed():
    """No name is offered that shares little with what was written."""
    assert "did you mean" not in str(UnknownNameError("axis", "yaw", AXES))


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
    """Another case, a part of a longer name, and one wrong letter."""
    assert similar(name, ("lat", "main.stiffness", "main.radius", "tail.speed")) == meant


def test_nothing_is_meant_where_there_is_nothing():
    """An empty list of names gives no suggestion and no failure."""
    assert similar("lat", ()) == []


@pytest.mark.parametrize("again", [copy.copy, lambda one: pickle.loads(pickle.dumps(one))])
def test_the_error_passes_between_processes(again):
    """Campaign workers send it to their parent."""
    error = UnknownNameError("axis", "lta", AXES)
    assert str(again(error)) == str(error)
    assert again(error).available == AXES


def test_the_command_line_lists_all_on_request(capsys):
    """One line without --names; with it each name follows on a line of its own."""
    wrong = ["linearize", "--set", "main_rotor.hub_stifness=3"]
    assert main(wrong) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "did you mean main_rotor.hub_stiffness?" in line
    assert "--names" in line
    assert main([*wrong, "--names"]) == 2
    first, *names = capsys.readouterr().err.splitlines()
    assert "--names" not in first
    assert len(names) > 50
    assert "main_rotor.hub_stiffness" in names
