"""Table 3 before and after the gyro: ratios, and what the paper says of them."""

import json

import pytest

from helisim.study.paper import gyro_effect, published
from helisim.study.results import as_json


def identified(reference, scale=1.0, *, without=()):
    """The paper's own numbers as if they had been identified, times `scale`."""
    return {one.name: scale * one.value for one in reference if one.name not in without}


@pytest.fixture
def found():
    """IN1 as printed, IN2 a tenth larger than printed, where A_b is tied to B_a."""
    before = identified(published("jr700")["rollpitch_in1"])
    return gyro_effect(
        before, identified(published("jr700")["rollpitch_in2"], 1.1, without=("A_b",))
    )


def test_ratios_are_of_the_papers_columns_and_of_the_identified_ones(found):
    """A_lon and B_lat: 0.2109/0.3697 and 0.2155/0.3778 are 0.570; a tenth more is 0.627."""
    changes = {one.name: one for one in found.changes}
    for name in ("A_lon", "B_lat"):
        assert changes[name].paper_ratio == pytest.approx(0.5704, abs=1e-4)  # printed digits
        assert changes[name].ratio == pytest.approx(1.1 * changes[name].paper_ratio, rel=1e-12)


def test_only_what_both_columns_have_is_compared(found):
    """The tied A_b is not identified from IN2, and delays hold the recorder's latencies."""
    names = [one.name for one in found.changes]
    assert names == ["tau_f", "L_b", "M_a", "B_a", "A_lat", "A_lon", "B_lat", "B_lon"]


def test_each_statement_stands_beside_what_is_so(found):
    """tau_f is said to rise by 37 %: in the table it falls by 27.5 %, here by 20.3 %."""
    first, ratio, *_, everything = found.statements
    assert "37 %" in first.said
    assert first.paper == "tau_f -27.5 %"
    assert first.identified == "tau_f -20.3 %"  # 1.1 x 0.7249 - 1
    assert "A_lon 0.570, -4.9 % from 0.6" in ratio.paper
    assert "B_lat 0.627, +4.6 % from 0.6" in ratio.identified
    assert "M_a -1.4 %" in everything.paper
    assert "M_a +8.5 %" in everything.identified  # 1.1 x 0.9864 - 1: a rise is said as one
    assert len(found.statements) == len(published("jr700").claims)


def test_it_is_plain_data(found):
    """The ratios stand in the JSON, not only what they are made of."""
    data = json.loads(json.dumps(as_json(found), allow_nan=False))
    assert data["changes"][0]["name"] == "tau_f"
    assert data["changes"][0]["paper_ratio"] == pytest.approx(0.0323 / 0.04456, rel=1e-12)
    assert data["statements"][0].keys() == {"said", "paper", "identified"}
