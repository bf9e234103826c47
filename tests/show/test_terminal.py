"""What the commands print, in 80 columns: tables, and the sentences around them."""

import io
import re

import pytest

from helisim import ident
from helisim.show.table import as_text
from helisim.show.tables import comparison
from helisim.show.terminal import render_results, render_rigs, wants_color
from helisim.sim.rigs import Finding, RigTest
from helisim.study.comparison import ComparisonTable, GivenValue, ParameterRow
from helisim.study.paper import Change, Coefficient, GyroEffect, OverallCheck, Statement
from helisim.study.results import Exclusion, Results
from made_run import make_verification

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
        "support": "good",
        "tolerance_percent": 3.0,
        "tolerance_reason": "asked for",
    }
    return ParameterRow(**(fields | changes))


def show(table: ComparisonTable) -> str:
    return as_text(comparison(table))


def make_table(*rows: ParameterRow) -> ComparisonTable:
    return ComparisonTable(
        name="rollpitch_in1", input="IN1", cost=1.2345, band_rad_s=(3.0, 30.0), parameters=rows
    )


def test_a_table_reads_as_expected():
    """Four digits a value, two a bound, the same decimals along a row."""
    unknown = {"truth": None, "paper": None, "tolerance_percent": None}
    text = show(
        make_table(
            make_row(),
            make_row(name="tau_lon", unit="s", identified=-0.0085, truth=-0.0083, paper=None),
            make_row(name="bias", identified=1.0, cr_percent=None, support=None, **unknown),
        )
    )
    title, headings, rule, *rows, given = text.splitlines()
    assert given == "given: nothing"
    assert title == "rollpitch_in1: from IN1, 3 to 30 rad/s, average cost 1.23"
    assert headings == "parameter  unit   paper      truth  identified  CR %  support  agreement"
    assert rule == "-" * len(headings)
    assert rows == [
        "L_b        1/s^2  539.5      539.5       541.2   3.1  good     agrees",
        "tau_lon    s          -  -0.008300   -0.008500   3.1  good     agrees",
        "bias       1/s^2      -          -       1.000     -  -        not judged",
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
    assert shown in show(make_table(row)).splitlines()[-2].split()


def test_an_infinite_bound_is_shown():
    """A parameter that the data don't see has no bound, and says so."""
    assert "inf" in show(make_table(make_row(cr_percent=float("inf")))).split()


def test_the_widest_table_fits_80_columns():
    """The longest names, units, numbers and words of our models stay within a terminal."""
    wide = make_row(
        name="tau_r_base",
        unit="rad/s^2",
        identified=-0.00083456,
        truth=-0.0008,
        paper=-0.0008,
        cr_percent=5e6,
        insensitivity_percent=5e6,
        support="degenerate",
        tolerance_percent=None,
    )
    results = Results(
        tables=(make_table(wide, make_row(identified=700.0)),),
        seed=1,
        versions={},
        excluded=(
            Exclusion(flight="lat_07", reason="terminated early", ended="flapping at 2.00 s " * 9),
        ),
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
        excluded=(LEFT_OUT,),
    )
    text = render_results(results)
    assert "Left out:\n- flight lat_07: its mean coherence of 0.9712 is not among the best" in text
    assert "1 missed:\n- rollpitch_in1: L_b is 700 1/s^2, 29.7 % from the truth's 539.5" in text
    assert not any(line.lstrip().startswith("%") for line in text.splitlines())
    good = Results(tables=(make_table(make_row()),), seed=1, versions={})
    assert render_results(good).endswith("All tolerances hold.")


LEFT_OUT = Exclusion(flight="lat_07", reason="less coherent", coherence=0.97123, limit=0.98, kept=3)
SAID = Statement(
    said="A_lon is about " + "0.6 " * 30, paper="A_lon 0.570", identified="A_lon 0.575"
)


@pytest.fixture
def further():
    """What stands below the tables of a whole run."""
    checked = make_verification(ident.structures.rollpitch)
    change = Change(
        name="A_lon", unit="rad", paper_before=0.3697, paper_after=0.2109, before=0.37, after=0.2128
    )
    b1 = Coefficient(name="b1", unit="rad/s^2", paper=175.969, parts=176.84, direct=177.62)
    eq_8 = OverallCheck(
        coefficients=(b1,),
        band_rad_s=(0.6, 25.0),
        gain_db=0.0934,
        gain_at_rad_s=14.8,
        phase_deg=-2.76,
        phase_at_rad_s=25.0,
    )
    results = Results(
        tables=(),
        seed=1,
        versions={},
        verification={"rollpitch_in1": checked.figures},
        gyro_effect=GyroEffect(changes=(change,), statements=(SAID,)),
        eq_8=eq_8,
    )
    return render_results(results)


def test_what_stands_below_the_tables_has_its_rows(further):
    """Verification, the gyro's effect, eq. (8): numbers in columns under their headings."""
    rows = [line.split() for line in further.splitlines()]
    assert ["A_lon", "rad", "0.3697", "0.2109", "0.570", "0.3700", "0.2128", "0.575"] in rows
    assert ["b1", "rad/s^2", "175.97", "176.84", "177.62", "-0.44"] in rows
    assert ["rollpitch_in1", "p", "rad/s"] in [row[:3] for row in rows]
    assert "+0.09 dB at 14.8 rad/s, -2.8 degrees" in further
    assert max(map(len, further.splitlines())) <= 80  # also with a long statement


def test_nothing_found_says_nothing():
    """Results without tables or anything else are no text."""
    assert render_results(Results(tables=(), seed=1, versions={})) == ""


def test_what_a_fit_was_given_stands_below_its_table():
    """Each value with its unit, error and source, none cut in two by the end of a line."""
    given = tuple(
        GivenValue(name=f"tau_{k}", unit="s", value=0.04 + k, source="turntable", standard_error=x)
        for k, x in enumerate((None, 0.00123, 0.5, None, None))
    )
    table = ComparisonTable(
        name="x", input="IN1", cost=1.0, band_rad_s=(1, 9), parameters=(make_row(),), given=given
    )
    lines = show(table).splitlines()[4:]
    assert lines[0].startswith("given: tau_0 0.04 s (turntable); tau_1 1.04 +- 0.0012 s ")
    assert " ".join(lines).count("(turntable)") == 5
    for value in ("tau_1 1.04 +- 0.0012 s", "tau_2 2.04 +- 0.5 s", "tau_4 4.04 s"):
        assert any(value in line for line in lines)


def test_a_ground_tests_zero_is_zero():
    """A truth of 2.776e-17 m beside an error of 0.3 mm is 0, and no percentage is made of it."""
    offset = Finding(name="x", unit="m", value=-0.0003, truth=2.776e-17, standard_error=0.0005)
    text = render_rigs([RigTest(rig="suspension", findings=(offset,), notes=("hung twice",))])
    assert text.splitlines()[0] == "suspension"
    assert text.splitlines()[3].split() == ["x", "m", "-0.0003", "0", "-0.0003", "0.0005", "-"]
    assert text.splitlines()[4] == "Hung twice."


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
