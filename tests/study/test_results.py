import json
import math

import pytest

from helisim.errors import InputError, UnknownNameError
from helisim.study.results import ComparisonTable, GivenValue, ParameterRow, Results


def make_row(**changes) -> ParameterRow:
    """L_b judged against a truth of 500 (3 %) and a paper value of 540 (10 %)."""
    fields = {
        "name": "L_b",
        "unit": "1/s^2",
        "identified": 505.0,
        "truth": 500.0,
        "paper": 540.0,
        "cr_percent": 4.0,
        "insensitivity_percent": 1.5,
        "tolerance_percent": 3.0,
        "tolerance_reason": "asked for",
        "paper_tolerance_percent": 10.0,
        "paper_tolerance_reason": "the paper's bound",
    }
    return ParameterRow(**(fields | changes))


def make_results(*rows: ParameterRow) -> Results:
    table = ComparisonTable(
        name="rollpitch_in1", input="IN1", cost=1.5, band_rad_s=(3.0, 30.0), parameters=rows
    )
    return Results(
        tables=(table,),
        seed=7,
        versions={"helisim": "0.1.0"},
        configuration={"flights": 10},
        excluded=("flight 3: incoherent",),
    )


@pytest.mark.parametrize(
    ("identified", "verdict"),
    [
        (500.0, "ok"),
        (514.9, "ok"),
        (515.1, "off truth"),
        (594.1, "off both"),
        (485.9, "off paper"),
        (484.9, "off both"),
        (-500.0, "off both"),
    ],
)
def test_the_verdict_is_both_tolerances(identified, verdict):
    """Truth 500 to 3 % is 485 to 515; paper 540 to 10 % is 486 to 594."""
    assert make_row(identified=identified).verdict == verdict


def test_a_tolerance_that_is_not_given_is_not_judged():
    """Another truth is not held against the paper, and a reported parameter is not a failure."""
    alone = make_row(identified=800.0, truth=810.0, paper_tolerance_percent=None)
    assert alone.verdict == "ok"
    assert alone.paper_error_percent == pytest.approx(48.15, rel=1e-3)  # printed digits
    reported = make_row(identified=800.0, tolerance_percent=None, paper_tolerance_percent=None)
    assert reported.verdict == "not judged"
    assert reported.misses == ()


def test_negative_values_are_judged_by_magnitude():
    """The error's sign is that of identified minus truth, whatever the truth's sign."""
    row = make_row(identified=-1.02, truth=-1.0, paper=-1.0)
    assert row.error_percent == pytest.approx(-2.0, rel=1e-12)  # rounding
    assert row.verdict == "ok"


def test_a_zero_truth_is_met_only_by_zero():
    """No percentage of zero is a distance."""
    assert make_row(truth=0.0, identified=0.0, paper_tolerance_percent=None).verdict == "ok"
    assert make_row(truth=0.0, identified=1e-9, paper_tolerance_percent=None).verdict == "off truth"


def test_a_miss_says_which_by_how_much_and_why():
    """One plain sentence a missed tolerance, with the table's name before it."""
    results = make_results(make_row(), make_row(name="M_a", identified=600.0))
    assert results.misses == (
        "rollpitch_in1: M_a is 600 1/s^2, 20 % from the truth's 500; "
        "the tolerance is 3 % (asked for)",
        "rollpitch_in1: M_a is 600 1/s^2, 11.1 % from the paper's 540; "
        "the tolerance is 10 % (the paper's bound)",
    )
    assert make_results(make_row()).misses == ()


def test_what_a_fit_was_given_and_what_else_was_found_are_in_the_json():
    """A given value carries its source; findings stand beside the tables, by name."""

    class Found:
        def to_dict(self):
            return {"gain_db": 0.1}

    given = GivenValue(name="k_I", unit="1/s", value=17.7, source="bench")
    table = ComparisonTable(
        name="yaw_gyro", input="IN2", cost=1.0, band_rad_s=(1, 9), parameters=(), given=(given,)
    )
    results = Results(
        tables=(table,),
        seed=1,
        versions={},
        further={"eq_8": Found(), "verification": {"rollpitch_in1": Found()}},
    )
    data = json.loads(json.dumps(results.to_dict(), allow_nan=False))
    assert data["tables"][0]["given"] == [
        {"name": "k_I", "unit": "1/s", "value": 17.7, "source": "bench"}
    ]
    assert data["eq_8"] == {"gain_db": 0.1}
    assert data["verification"] == {"rollpitch_in1": {"gain_db": 0.1}}


def test_the_json_has_the_shape_of_issue_2():
    """Point 7 of the issue: the keys of a table and of a parameter, and plain JSON data."""
    data = make_results(make_row(), make_row(name="free", truth=None, tolerance_percent=None))
    data = json.loads(json.dumps(data.to_dict(), allow_nan=False))
    assert data["seed"] == 7
    assert data["versions"] == {"helisim": "0.1.0"}
    (table,) = data["tables"]
    assert {key: table[key] for key in ("name", "input", "cost", "band_rad_s")} == {
        "name": "rollpitch_in1",
        "input": "IN1",
        "cost": 1.5,
        "band_rad_s": [3.0, 30.0],
    }
    first, second = table["parameters"]
    assert list(first)[:7] == [
        "name",
        "unit",
        "paper",
        "truth",
        "identified",
        "cr_percent",
        "insensitivity_percent",
    ]
    assert first["verdict"] == "ok"
    assert second["truth"] is None
    assert data["misses"] == []
    assert data["excluded"] == ["flight 3: incoherent"]


def test_an_infinite_bound_is_null_in_json():
    """JSON has no infinity: a parameter that the data do not see has no number there."""
    assert make_row(cr_percent=math.inf).to_dict()["cr_percent"] is None


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"identified": math.nan}, "L_b: identified must be finite"),
        ({"truth": math.inf}, "L_b: truth must be finite"),
        ({"truth": None}, "tolerance_percent needs a value of truth"),
        ({"paper": None}, "paper_tolerance_percent needs a value of paper"),
        ({"tolerance_percent": 0.0}, "tolerance_percent must be positive"),
        ({"tolerance_percent": math.nan}, "tolerance_percent must be positive"),
        ({"tolerance_reason": ""}, "tolerance_percent needs its reason"),
    ],
)
def test_a_row_that_can_not_be_judged_is_refused(changes, message):
    """NaN never passes a tolerance by comparing false, and no tolerance lacks its reason."""
    with pytest.raises(InputError, match=message):
        make_row(**changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"cost": math.nan}, "cost must be finite"),
        ({"cost": -1.0}, "cost must be finite and not negative"),
        ({"band_rad_s": (30.0, 3.0)}, "band must rise"),
        ({"band_rad_s": (0.0, 3.0)}, "band must rise from above 0"),
    ],
)
def test_a_malformed_table_is_refused(changes, message):
    """A cost and a band are numbers that can be."""
    fields = {"name": "heave", "input": "IN1", "cost": 1.0, "band_rad_s": (1, 9), "parameters": ()}
    with pytest.raises(InputError, match=message):
        ComparisonTable(**(fields | changes))


def test_results_are_addressed_by_name():
    """Tables and parameters by name; unknown names list those that exist."""
    results = make_results(make_row())
    assert results["rollpitch_in1"]["L_b"].identified == 505.0
    with pytest.raises(UnknownNameError, match="available: rollpitch_in1"):
        results["heave"]
    with pytest.raises(UnknownNameError, match="available: L_b"):
        results["rollpitch_in1"]["M_a"]
