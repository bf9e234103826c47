"""What all stands on: short messages that say what mends them, and linear systems."""

import copy
import math
import pickle
from dataclasses import replace

import numpy as np
import pytest

from helisim.base.errors import IdentificationError, InputError, LogError, UnknownNameError, similar
from helisim.base.linear import LinearSystem
from helisim.base.note import Note, Option, options
from helisim.base.text import shown
from helisim.cli.options import worded
from tabled import tabled


@tabled("given", "found")
def test_a_remedy_is_given_in_short(given, found):
    assert options(given) == found
    assert Note.of("gaps", "there are gaps", given).remedy == found


def test_the_command_line_words_a_remedy():
    """Dashes, and the value if there is one."""
    assert worded(options("max_gap=0.5,windows")) == " (--max-gap 0.5, --windows)"
    assert worded(()) == ""


def test_an_error_carries_its_remedy_between_processes():
    for error in (
        IdentificationError("too short", remedy="windows"),
        UnknownNameError("axis", "x", ("lat",), remedy="windows"),
    ):
        other = pickle.loads(pickle.dumps(error))
        assert other.remedy == (Option("windows"),)
        assert "windows" not in str(other)
        assert str(other) == str(error)


def test_messages_are_short_without_control_characters_and_keep_their_ends():
    error = InputError(f"\x1b[2Jcolumn {'x' * 900} is none; rename it")
    assert len(str(error)) <= 500
    assert "\x1b" not in str(error)
    assert str(error).endswith("rename it")
    assert str(InputError("one\ntwo")) == "one two"
    assert str(LogError("one\ntwo\x07")).splitlines() == ["one", "two"]
    unknown = UnknownNameError("axis", "y" * 900, [f"{k}" * 200 for k in range(5)])
    assert len(str(unknown)) <= 500
    assert unknown.unlisted == unknown.available
    assert shown("a\x1b[2Jb\nc") == "a[2Jb c"
    assert len(shown("x" * 1000, 40)) == 40
    assert shown("x" * 40, 40) == "x" * 40
    assert shown(["a\x00"]) == "['a\\x00']"


AXES = ("col", "lon", "lat", "ped")
MANY = tuple(f"rotor.part_{k:02d}" for k in range(40))


def test_of_a_long_list_only_those_alike_are():
    error = UnknownNameError("parameter", "rotor.part_7", MANY)
    assert "there are 40" in str(error)
    assert "did you mean rotor.part_07 or " in str(error)
    assert error.available == MANY
    assert error.unlisted == MANY


@tabled("name", "meant")
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


LAG = LinearSystem([[-2.0]], [[1.0, 3.0]], [[1.0]], [[0.0, 0.0]], None, ("u", "v"), ("y",))


@pytest.mark.parametrize("period", [0.0, -0.1, math.nan, math.inf, "fast"])
def test_a_period_that_is_none_is_refused(period):
    with pytest.raises(InputError, match=r"period must be a .*number above 0 s, got"):
        LAG.discretise(period)


def test_one_frequency_is_a_response_of_one():
    """1 / (s + 2) and 3 / (s + 2) at s = 2j."""
    assert LAG.response(2.0)[0, :, 0] == pytest.approx(np.array([1.0, 3.0]) / (2.0 + 2.0j))


def test_delays_of_inputs_that_were_left_out_are_no_states():
    late = replace(LAG.discretise(0.1), delays={"u": 0.3, "v": 0.2})
    found = late.select(["v"]).with_delays_as_states()
    assert found.states == ("x[0]", "v_1_ago", "v_2_ago")
    omega = np.array([0.5, 5.0])
    assert found.response(omega) == pytest.approx(late.select(["v"]).response(omega))
