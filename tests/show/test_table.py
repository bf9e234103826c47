"""One table for terminal, page and recording: formats, zeros, widths, cards."""

import re

import pytest

from helisim.show import page
from helisim.show.table import (
    PERCENT,
    Cell,
    Column,
    Table,
    as_markdown,
    as_text,
    common_form,
    formatted,
    number,
    words,
)

NAMED = (Column("found", left=True), Column("unit", left=True))


def table(*rows, columns=("value",), **options):
    return Table("", (*NAMED, *(Column(name) for name in columns)), rows, **options)


def row(name, unit, *values, form=".5g"):
    return (words(name, "name"), words(unit), *(number(x, form, unit=unit) for x in values))


def shown(text):
    return [line.split() for line in text.splitlines()]


@pytest.mark.parametrize(
    ("value", "form", "text"),
    [
        (-0.0, ".4g", "0"),
        (-0.00004, ".2f", "0.00"),
        (0.00004, "+.2f", "0.00"),
        (-1e-9, ".1e", "-1.0e-09"),
        (2.5, "+.2f", "+2.50"),
        (0.01234, PERCENT, "0.012"),
        (9.94, PERCENT, "9.9"),
        (23.12, PERCENT, "23"),
        (5e6, PERCENT, "5e+06"),
        (float("inf"), PERCENT, "inf"),
    ],
)
def test_a_number_alone(value, form, text):
    """No zero has a sign; uncertainties in percent have two digits."""
    assert formatted(value, form) == text


def test_what_rounding_left_of_a_zero_is_zero_beside_its_unit():
    """2.776e-17 m beside 0.3 mm and 20 mm is 0; alone in its unit it is a number."""
    found = table(
        row("offset", "m", 0.0003, 2.776e-17),
        row("arm", "m", 0.02, -1e-17),
        row("share", "1", 2.776e-17, None),
        columns=("value", "truth"),
    )
    rows = shown(as_text(found))[2:]
    assert rows[0] == ["offset", "m", "0.0003", "0"]
    assert rows[1] == ["arm", "m", "0.02", "0"]
    assert rows[2] == ["share", "1", "2.776e-17", "-"]


def test_a_small_number_that_can_be_known_is_kept():
    """A millionth of the largest of its unit is shown: only a billionth is rounding."""
    rows = shown(as_text(table(row("a", "s", 1.0), row("b", "s", 1e-6))))
    assert rows[-1] == ["b", "s", "1e-06"]


def test_the_page_shows_the_same_numbers_and_holds_them_in_full():
    """The texts of the terminal, with value and place as attributes; words are escaped."""
    cell = Cell("", 2.776e-17, ".4g", "m", key="ground.x.truth")
    found = table((words("a < b"), words("m"), cell), row("c", "m", 1.0))
    text = page.table(found)
    assert "a &lt; b" in text
    assert 'data-key="ground.x.truth" data-value="2.776e-17">0</td>' in text
    assert page.table(table()) == ""


def test_columns_for_the_page_alone_are_not_on_the_terminal():
    """Nor in a recording; a longer heading and the unit are on the page."""
    columns = (Column("speed", unit="m/s", label="airspeed"), Column("how", page_only=True))
    found = Table("", columns, ((number(3.0, "g"), words("as said")),))
    assert shown(as_text(found)) == [["speed"], ["m/s"], ["-----"], ["3"]]
    assert as_markdown(found).splitlines()[1:] == ["| ---: |", "| 3 |"]
    assert re.findall(r"<th\b[^>]*>([^<]*)", page.table(found)) == ["airspeed, m/s", "how"]


def test_long_words_become_cards_of_80_columns():
    """Each row is a list of labelled lines; no percent is cut from its number."""
    columns = (Column("", left=True, label="error"), Column("printed", left=True))
    text = "A_lon 0.570, -4.9 % from 0.6; " * 6
    found = Table("", columns, ((words("first"), words(text)), (words("second"), words("x"))))
    for cards, mark in (("1.", "1. first"), ("-", "- first")):
        lines = as_text(Table(**{**vars(found), "cards": cards})).splitlines()
        assert lines[0] == mark
        assert lines[1].split()[0] == "printed:"
        assert max(map(len, lines)) <= 80
        assert not any(line.lstrip().startswith("%") for line in lines)
    assert max(map(len, as_text(found).splitlines())) > 80  # columns would not fit


@pytest.mark.parametrize(
    ("values", "form"),
    [
        ((0.0,), ".3f"),
        ((3602.6, 1.0), ".0f"),
        ((-0.05, None, float("inf")), ".5f"),
        ((1e-7,), ".3e"),
    ],
)
def test_a_rows_numbers_share_their_decimals(values, form):
    """Those that give the largest four digits; an exponent where decimals would not fit."""
    assert common_form(values) == form
