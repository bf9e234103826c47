"""What stands below the tables: verification, before and after the gyro, eq. (8)."""

import pytest

from helisim import ident
from helisim.output.findings import render_further
from helisim.paper.eq8 import Coefficient, OverallCheck
from helisim.paper.gyro_effect import BeforeAfter, Change, Statement
from made_run import make_verification

CHANGE = Change(
    name="A_lon", unit="rad", paper_before=0.3697, paper_after=0.2109, before=0.37, after=0.2128
)
SAID = Statement(
    said="A_lon is about " + "0.6 " * 30, paper="A_lon 0.570", identified="A_lon 0.575"
)
OVERALL = OverallCheck(
    coefficients=(
        Coefficient(name="b1", unit="rad/s^2", paper=175.969, parts=176.84, direct=177.62),
    ),
    band_rad_s=(0.6, 25.0),
    gain_db=0.0934,
    gain_at_rad_s=14.8,
    phase_deg=-2.76,
    phase_at_rad_s=25.0,
)


@pytest.fixture
def text():
    found = {
        "ground": {"bench": OVERALL},  # of no interest here
        "verification": {"rollpitch_in1": make_verification(ident.structures.rollpitch)},
        "before_after": BeforeAfter(changes=(CHANGE,), statements=(SAID,)),
        "eq_8": OVERALL,
    }
    return "\n\n".join(render_further(found))


def test_each_finding_has_its_rows(text):
    """Numbers in columns under their headings."""
    rows = [line.split() for line in text.splitlines()]
    assert ["A_lon", "rad", "0.3697", "0.2109", "0.570", "0.37", "0.2128", "0.575"] in rows
    assert ["b1", "rad/s^2", "175.97", "176.84", "177.62", "-0.44"] in rows
    assert ["rollpitch_in1", "p", "rad/s"] in [row[:3] for row in rows]
    assert "+0.09 dB at 14.8 rad/s, -2.8 degrees" in text


def test_no_line_is_wider_than_a_terminal(text):
    """80 columns, also with a long statement."""
    assert max(map(len, text.splitlines())) <= 80


def test_nothing_found_says_nothing():
    """A run without them prints tables alone."""
    assert render_further({}) == ()
