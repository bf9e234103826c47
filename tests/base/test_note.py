"""Messages: notes and errors carry what mends them as data; text in them is short and clean."""

import pickle

import pytest

from helisim.base.errors import IdentificationError, InputError, LogError, UnknownNameError
from helisim.base.note import Note, Option, options
from helisim.base.text import shown
from helisim.cli.options import worded


@pytest.mark.parametrize(
    ("given", "found"),
    [
        ("", ()),
        ("windows", (Option("windows"),)),
        ("windows, min_duration", (Option("windows"), Option("min_duration"))),
        ("repair=gaps", (Option("repair", "gaps"),)),
        (Option("from_time", "3"), (Option("from_time", "3"),)),
        (("a=1", Option("b")), (Option("a", "1"), Option("b"))),
    ],
)
def test_a_remedy_is_given_in_short(given, found):
    """As text, as an option, or several."""
    assert options(given) == found
    assert Note.of("gaps", "there are gaps", given).remedy == found


def test_the_command_line_words_a_remedy():
    """Dashes, and the value if there is one."""
    assert worded(options("max_gap=0.5,windows")) == " (--max-gap 0.5, --windows)"
    assert worded(()) == ""


def test_an_error_carries_its_remedy_between_processes():
    """And its message has no option in it."""
    for error in (
        IdentificationError("too short", remedy="windows"),
        UnknownNameError("axis", "x", ("lat",), remedy="windows"),
    ):
        other = pickle.loads(pickle.dumps(error))
        assert other.remedy == (Option("windows"),)
        assert "windows" not in str(other)
        assert str(other) == str(error)


def test_messages_are_short_and_without_control_characters():
    """Whatever a file has for a name."""
    error = InputError(f"\x1b[2Jcolumn {'x' * 900} is none; rename it")
    assert len(str(error)) <= 500
    assert "\x1b" not in str(error)
    assert str(error).endswith("rename it")
    assert str(InputError("one\ntwo")) == "one two"
    assert str(LogError("one\ntwo\x07")).splitlines() == ["one", "two"]
    unknown = UnknownNameError("axis", "y" * 900, [f"{k}" * 200 for k in range(5)])
    assert len(str(unknown)) <= 500
    assert unknown.unlisted == unknown.available


def test_shown_text_keeps_its_ends():
    """The middle goes."""
    assert shown("a\x1b[2Jb\nc") == "a[2Jb c"
    assert len(shown("x" * 1000, 40)) == 40
    assert shown("x" * 40, 40) == "x" * 40
    assert shown(["a\x00"]) == "['a\\x00']"
