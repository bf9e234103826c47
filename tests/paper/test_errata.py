"""The paper's errors: each is computed from the transcribed tables, and does contradict them."""

import json
from dataclasses import replace

import pytest

from helisim.cli import main
from helisim.show.terminal import render_errata
from helisim.study.errata import errata
from helisim.study.paper import published


@pytest.fixture(scope="module")
def found():
    return {erratum.title: erratum for erratum in errata()}


def changed(table, **values):
    """A reference table with other values, as if the paper had printed them."""
    rows = tuple(
        replace(row, value=values[row.name]) if row.name in values else row for row in table
    )
    return replace(table, values=rows)


def test_every_erratum_is_confirmed_by_its_calculation(found):
    """Nothing is listed that its own numbers do not show."""
    assert len(found) == len(errata()) >= 20  # titles are unique; the design names eleven
    for erratum in found.values():
        assert erratum.confirmed, erratum.title
        for part in ("where", "printed", "calculation", "computed", "conclusion"):
            assert getattr(erratum, part)


@pytest.mark.parametrize(
    ("title", "part", "expected"),
    [
        # design, section 8: 5.2 m/s tip speed, ratio 4.72, 8023 rpm
        ("Tail rotor speed is the gear ratio upside down", "calculation", "5.2 m/s"),
        ("Tail rotor speed is the gear ratio upside down", "calculation", "= 4.720"),
        ("Tail rotor speed is the gear ratio upside down", "computed", "8023 rpm"),
        # Table 3: 0.0323 / 0.04456 - 1
        ("The rotor's time constant falls", "computed", "a fall of 27.5 %"),
        # the paper's 37 % is the inverse ratio, cut off
        ("The rotor's time constant falls", "computed", "= 38.0 %"),
        # 439.2 / 539.5 - 1 and 310.8 / 315.1 - 1
        ("L_b and M_a fall", "computed", "L_b falls by 18.6 %, M_a falls by 1.4 %"),
        # 0.00845 / 0.06571 - 1 and 0.04006 / 0.06070 - 1
        ("A_lat and B_lon fall", "computed", "A_lat falls by 87.1 %, B_lon falls by 34.0 %"),
        ("All parameters decrease", "calculation", "0 of 9"),
        # design, section 8: 0.57, not quite 0.6
        ("The ratio of the gyro's settings is not quite met", "calculation", "= 0.570"),
        # design, section 5: phase margin -20 degrees, delay margin 36.6 ms
        ("The base model's delay can't be in the gyro's loop", "calculation", "= -19.9 degrees"),
        ("The base model's delay can't be in the gyro's loop", "computed", "36.6 ms"),
        ("Four gains where the signals hold three", "calculation", "rank 3 of 4"),
        # 11.5 + 8.3 ms
        ("A delay that leads", "computed", "19.8 ms"),
        ("Parameters kept beyond the guidelines", "computed", "6 bounds too wide"),
        ("A symmetry imposed on one column only", "calculation", "IN2 -0.2261 / 0.2261 = -1.000"),
        ("Numbers given twice", "computed", "equation 8, figure 3"),
        # N_ped / -N_r = 101.1, k_delta / k_a = 9.11
        ("Overall yaw model labelled with the base model's input", "computed", "11.1 times"),
        # exp(-0.0505)
        ("Delays printed as constants", "calculation", "= 0.951"),
    ],
)
def test_what_is_computed(found, title, part, expected):
    """The figures that were worked out by hand, from the paper, are those that are computed."""
    assert expected in getattr(found[title], part)


def test_the_printed_tail_speed_can_not_hold_the_hover(found):
    """By helisim's force laws it leaves hundredths of a newton where some five are needed."""
    text = found["Tail rotor speed is the gear ratio upside down"].computed
    idle, full, needed = (float(word) for word in text.replace(",", "").split() if is_newton(word))
    # thrust goes with the square of the speed: 5.25 N x (360.2 / 8023)^2 is 0.0106 N
    assert idle == pytest.approx(needed * (360.2 / 8023.0) ** 2, abs=0.005)  # two decimals
    assert idle < full < 0.1


def is_newton(word):
    """Tell a decimal number from other words; the speeds have no or three decimals."""
    whole, point, decimals = word.partition(".")
    return bool(point) and whole.isdigit() and len(decimals) == 2


def test_errata_follow_the_tables(monkeypatch):
    """With other tables the same code computes other figures, and confirms nothing false."""
    printed = {"rollpitch_in1": {"tau_lon": 0.0083}, "rollpitch_in2": {"tau_f": 0.06}}
    paper = published("jr700")
    tables = tuple(changed(table, **printed.get(table.name, {})) for table in paper.tables)
    other = replace(paper, tables=tables)
    monkeypatch.setattr("helisim.study.errata.published", lambda _: other)
    found = {erratum.title: erratum for erratum in errata()}
    assert not found["A delay that leads"].confirmed
    assert not found["The rotor's time constant falls"].confirmed
    assert "34.6 %" in found["The rotor's time constant falls"].calculation  # 0.06 / 0.04456
    assert not found["All parameters decrease"].confirmed


def test_errata_are_printed(capsys):
    """`helisim errata` numbers them in 80 columns; --json gives the same as data."""
    assert main(["errata"]) == 0
    text = capsys.readouterr().out
    assert text.rstrip("\n") == render_errata(errata())
    assert max(map(len, text.splitlines())) <= 80
    assert main(["errata", "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert [item["title"] for item in data] == [erratum.title for erratum in errata()]
    assert f"{len(data)}. " in text
