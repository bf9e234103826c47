"""What the commands print, in 80 columns: numbers, tables, and the sentences around them."""

import pytest

from helisim.show import page, tables
from helisim.show.table import PERCENT, as_text, common_form, number, table
from helisim.show.terminal import render_results
from helisim.study.comparison import ComparisonTable, ParameterRow
from helisim.study.results import Exclusion, Results


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


def make_table(*rows: ParameterRow, **more) -> ComparisonTable:
    return ComparisonTable(
        name="rollpitch_in1",
        input="IN1",
        cost=1.2345,
        band_rad_s=(3.0, 30.0),
        parameters=rows,
        **more,
    )


def show(shown: ComparisonTable) -> str:
    return as_text(tables.comparison(shown))


@pytest.mark.parametrize(
    ("value", "form", "text"),
    [
        (-0.0, ".4g", "0"),
        (-0.00004, ".2f", "0.00"),
        (-1e-9, ".1e", "-1.0e-09"),
        (2.5, "+.2f", "+2.50"),
        (0.01234, PERCENT, "0.012"),
        (9.94, PERCENT, "9.9"),
        (23.12, PERCENT, "23"),
        (5e6, PERCENT, "5e+06"),
        (float("inf"), PERCENT, "inf"),
        (None, PERCENT, "-"),
    ],
)
def test_a_number_alone(value, form, text):
    assert number(value, form) == text


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
    assert common_form(values) == form


def test_columns_for_the_page_alone_are_not_on_the_terminal():
    found = table("", "speed [m/s]|how<*", [("3", "a < b")])
    assert as_text(found).split() == ["speed", "m/s", "-----", "3"]
    text = page.table(found)
    assert ">speed, m/s</th>" in text
    assert "a &lt; b" in text
    assert page.table(table("", "a", [])) == ""


def test_a_table_reads_as_expected():
    unknown = {"truth": None, "paper": None, "tolerance_percent": None}
    text = show(
        make_table(
            make_row(),
            make_row(name="tau_lon", unit="s", identified=-0.0085, truth=-0.0083, paper=None),
            make_row(name="bias", identified=1.0, cr_percent=None, support=None, **unknown),
        )
    )
    assert text.splitlines() == [
        "rollpitch_in1: from IN1, 3 to 30 rad/s, average cost 1.23",
        "parameter  unit   paper      truth  identified  CR %  support  agreement",
        "-" * 72,
        "L_b        1/s^2  539.5      539.5       541.2   3.1  good     agrees",
        "tau_lon    s          -  -0.008300   -0.008500   3.1  good     agrees",
        "bias       1/s^2      -          -       1.000     -  -        not judged",
        "given: nothing",
    ]


def test_the_widest_table_fits_80_columns():
    wide = make_row(
        name="tau_r_base",
        unit="rad/s^2",
        identified=-0.00083456,
        truth=-0.0008,
        paper=-0.0008,
        cr_percent=float("inf"),
        insensitivity_percent=5e6,
        support="degenerate",
        tolerance_percent=None,
    )
    left = Exclusion(flight="lat_07", reason="less coherent", coherence=0.97123, limit=0.98, kept=3)
    ended = Exclusion(flight="lat_08", reason="terminated early", ended="flapping at 2.00 s " * 9)
    shown = (make_table(wide, make_row(identified=700.0)),)
    results = Results(tables=shown, seed=1, versions={}, excluded=(left, ended))
    text = render_results(results)
    assert max(map(len, text.splitlines())) <= 80
    assert "Left out:\n- flight lat_07: its mean coherence of 0.9712 is not among the best" in text
    assert "1 missed:\n- rollpitch_in1: L_b is 700 1/s^2, 29.7 % from the truth's 539.5" in text
    assert not any(line.lstrip().startswith("%") for line in text.splitlines())
    good = Results(tables=(make_table(make_row()),), seed=1, versions={})
    assert render_results(good).endswith("All tolerances hold.")
    assert render_results(Results(tables=(), seed=1, versions={})) == ""
