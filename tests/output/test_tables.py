import io
import re

import pytest

from helisim.output.tables import render_results, render_table, wants_color
from helisim.study.results import ComparisonTable, ParameterRow, Results

ESCAPE = re.compile(r"\x1b\[[0-9;]*m")


def make_row(**changes) -> ParameterRow:
    fields = {
        "name": "L_b",
        "unit": "1/s^2",
        "identified": 541.2345,
        "truth": 539.5,
        "paper": 539.5,
        "cr_percent": 3.14159,
        "insensitivity_percent": 0.987,
        "tolerance_percent": 3.0,
        "tolerance_reason": "asked for",
    }
    return ParameterRow(**(fields | changes))


def make_table(*rows: ParameterRow) -> ComparisonTable:
    return ComparisonTable(
        name="rollpitch_in1", input="IN1", cost=1.2345, band_rad_s=(3.0, 30.0), parameters=rows
    )


def test_a_table_reads_as_expected():
    """Four digits a value, two a bound, the same decimals along a row."""
    unknown = {"truth": None, "paper": None, "tolerance_percent": None}
    text = render_table(
        make_table(
            make_row(),
            make_row(name="tau_lon", unit="s", identified=-0.0085, truth=-0.0083, paper=None),
            make_row(name="bias", identified=1.0, cr_percent=None, **unknown),
        )
    )
    title, headings, rule, *rows = text.splitlines()
    assert title == "rollpitch_in1: from IN1, 3 to 30 rad/s, average cost 1.23"
    assert headings == "parameter  unit   paper      truth  identified  CR %  insens. %  verdict"
    assert rule == "-" * len(headings)
    assert rows == [
        "L_b        1/s^2  539.5      539.5       541.2   3.1       0.99  ok",
        "tau_lon    s          -  -0.008300   -0.008500   3.1       0.99  ok",
        "bias       1/s^2      -          -       1.000     -       0.99  not judged",
    ]


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (0.0, "0.000"),
        (3602.6, "3603"),
        (-41.8503, "-41.85"),
        (0.00045678, "0.0004568"),
        (1.2346e-7, "1.235e-07"),
        (9.87654e12, "9.877e+12"),
    ],
)
def test_any_magnitude_is_readable(value, shown):
    """Decimals where they fit, an exponent where they would not."""
    row = make_row(identified=value, truth=None, paper=None, tolerance_percent=None)
    assert shown in render_table(make_table(row)).splitlines()[-1].split()


@pytest.mark.parametrize(
    ("percent", "shown"),
    [(0.01234, "0.012"), (9.94, "9.9"), (23.12, "23"), (5e6, "5e+06"), (float("inf"), "inf")],
)
def test_bounds_have_two_digits(percent, shown):
    """A bound that is enormous or infinite is shown as such."""
    text = render_table(make_table(make_row(cr_percent=percent)))
    assert shown in text.splitlines()[-1].split()


def test_the_widest_table_fits_80_columns():
    """The longest names, units, numbers and verdicts of our models stay within a terminal."""
    wide = make_row(
        name="tau_r_base",
        unit="rad/s^2",
        identified=-0.00083456,
        truth=-0.0008,
        paper=-0.0008,
        cr_percent=5e6,
        insensitivity_percent=5e6,
        tolerance_percent=None,
    )
    results = Results(
        tables=(make_table(wide, make_row(identified=700.0)),),
        seed=1,
        versions={},
        excluded=("lat-07: its coherence is below 0.6 over more than half of the band " * 2,),
    )
    for color in (False, True):
        lines = ESCAPE.sub("", render_results(results, color=color)).splitlines()
        assert max(map(len, lines)) <= 80


def test_colour_adds_only_escapes():
    """Coloured text without its escapes is the plain text; plain text has none."""
    results = Results(
        tables=(make_table(make_row(), make_row(name="M_a", identified=700.0)),),
        seed=1,
        versions={},
    )
    plain, coloured = render_results(results), render_results(results, color=True)
    assert "\x1b" not in plain
    assert coloured != plain
    assert ESCAPE.sub("", coloured) == plain
    assert coloured.count("\x1b[0m") == len(ESCAPE.findall(coloured)) / 2


def test_misses_and_exclusions_are_listed():
    """The list names the parameter and keeps a number and its percent sign on one line."""
    results = Results(
        tables=(make_table(make_row(identified=700.0)),),
        seed=1,
        versions={},
        excluded=("lat-07: incoherent",),
    )
    text = render_results(results)
    assert "Left out:\n- lat-07: incoherent" in text
    assert "1 missed:\n- rollpitch_in1: L_b is 700 1/s^2, 29.7 % from the truth's 539.5" in text
    assert not any(line.lstrip().startswith("%") for line in text.splitlines())
    good = Results(tables=(make_table(make_row()),), seed=1, versions={})
    assert render_results(good).endswith("All tolerances hold.")


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("stream", "environment", "expected"),
    [
        (Terminal(), {}, True),
        (Terminal(), {"NO_COLOR": ""}, True),  # no-color.org: an empty value counts as unset
        (Terminal(), {"NO_COLOR": "1"}, False),
        (Terminal(), {"TERM": "dumb"}, False),
        (io.StringIO(), {}, False),
    ],
)
def test_colour_is_for_terminals_that_want_it(stream, environment, expected):
    """A pipe, a dumb terminal and NO_COLOR get plain text."""
    assert wants_color(stream, environment) is expected
