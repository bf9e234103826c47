import json
import math

import pytest

from helisim import ident
from helisim.base.errors import InputError, UnknownNameError
from helisim.study.comparison import ComparisonTable, GivenValue, ParameterRow
from helisim.study.results import Exclusion, Results, as_json
from made_run import EQ_8, GROUND, GYRO_EFFECT, make_verification

INCOHERENT = Exclusion(
    flight="lat_03", reason="less coherent", coherence=0.98765, limit=0.9912, kept=10
)
ENDED = Exclusion(
    flight="ped_01", reason="terminated early", ended="it touched the ground at 12.50 s"
)


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
        excluded=(INCOHERENT, ENDED),
    )


@pytest.mark.parametrize(
    ("identified", "truth", "paper"),
    [
        (500.0, "agrees", "agrees"),
        (514.9, "agrees", "agrees"),
        (515.1, "differs", "agrees"),
        (594.1, "differs", "differs"),
        (485.9, "agrees", "differs"),
        (484.9, "differs", "differs"),
        (-500.0, "differs", "differs"),
    ],
)
def test_agreement_is_with_each_reference(identified, truth, paper):
    """Truth 500 to 3 % is 485 to 515; paper 540 to 10 % is 486 to 594."""
    row = make_row(identified=identified)
    assert (row.truth_agreement, row.paper_agreement) == (truth, paper)
    assert row.agreement == ("differs" if "differs" in (truth, paper) else "agrees")


def test_support_says_nothing_of_agreement():
    """A value that the data don't fix can be right by luck, a well fixed one wrong."""
    lucky = make_row(support="poor", cr_percent=71.0)
    assert (lucky.support, lucky.agreement) == ("poor", "agrees")
    wrong = make_row(support="good", identified=600.0)
    assert (wrong.support, wrong.agreement) == ("good", "differs")


def test_a_tolerance_that_is_not_given_is_not_judged():
    """Another truth is not held against the paper, and a reported parameter is not a failure."""
    alone = make_row(identified=800.0, truth=810.0, paper_tolerance_percent=None)
    assert (alone.agreement, alone.paper_agreement) == ("agrees", "not judged")
    assert alone.paper_error_percent == pytest.approx(48.15, rel=1e-3)  # printed digits
    reported = make_row(identified=800.0, tolerance_percent=None, paper_tolerance_percent=None)
    assert reported.agreement == "not judged"
    assert reported.misses() == ()


def test_negative_values_are_judged_by_magnitude():
    """The error's sign is that of identified minus truth, whatever the truth's sign."""
    row = make_row(identified=-1.02, truth=-1.0, paper=-1.0)
    assert row.error_percent == pytest.approx(-2.0, rel=1e-12)  # rounding
    assert row.agreement == "agrees"


def test_a_zero_truth_is_met_only_by_zero():
    """No percentage of zero is a distance."""
    assert make_row(truth=0.0, identified=0.0).truth_agreement == "agrees"
    assert make_row(truth=0.0, identified=1e-9).truth_agreement == "differs"


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


def test_a_miss_names_the_truth_that_is_missed():
    """A low-order equivalent isn't the linearisation that figures draw: it has another name."""
    table = ComparisonTable(
        name="rollpitch_in2",
        input="IN2",
        cost=1.5,
        band_rad_s=(3.0, 30.0),
        parameters=(make_row(identified=520.0, paper_tolerance_percent=None),),
        truth="equivalent",
    )
    (miss,) = table.misses
    assert "4 % from the equivalent's 500" in miss


def everything() -> Results:
    """Results with all that results can hold."""
    table = ComparisonTable(
        name="rollpitch_in1",
        input="IN1",
        cost=1.5,
        band_rad_s=(3.0, 30.0),
        parameters=(
            make_row(),
            make_row(name="unseen", cr_percent=math.inf),
            make_row(name="given", cr_percent=None, insensitivity_percent=None),
        ),
        given=(
            GivenValue(name="k_I", unit="1/s", value=17.7, source="bench", standard_error=0.0014),
        ),
    )
    checked = make_verification(ident.structures.rollpitch)
    return Results(
        tables=(table,),
        seed=7,
        versions={"helisim": "0.1.0"},
        configuration={"flights": 10},
        excluded=(INCOHERENT, ENDED),
        ground={"bench": GROUND},
        verification={"rollpitch_in1": checked.figures},
        gyro_effect=GYRO_EFFECT,
        eq_8=EQ_8,
    )


def test_what_else_was_found_is_in_the_json():
    """A given value carries its source; findings stand beside the tables, by name."""
    data = json.loads(json.dumps(everything().to_dict(), allow_nan=False))
    assert data["tables"][0]["given"] == [
        {
            "name": "k_I",
            "unit": "1/s",
            "value": 17.7,
            "source": "bench",
            "standard_error": 0.0014,
        }
    ]
    assert data["tables"][0]["parameters"][1]["cr_percent"] == "inf"
    assert data["eq_8"]["gain_db"] == EQ_8.gain_db
    assert data["before_after"]["changes"][0]["ratio"] == GYRO_EFFECT.changes[0].ratio
    assert data["ground"]["bench"]["findings"][1]["truth"] is None
    assert [one["name"] for one in data["verification"]["rollpitch_in1"]["outputs"]] == ["p", "q"]


def test_the_json_has_its_shape():
    """The keys of a table and of a parameter, and plain JSON data."""
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
    assert (first["truth_agreement"], first["paper_agreement"]) == ("agrees", "agrees")
    assert second["truth"] is None
    assert data["misses"] == []
    assert data["excluded"] == [
        {
            "flight": "lat_03",
            "reason": "less coherent",
            "coherence": 0.98765,
            "limit": 0.9912,
            "kept": 10,
            "message": INCOHERENT.message,
        },
        {
            "flight": "ped_01",
            "reason": "terminated early",
            "ended": "it touched the ground at 12.50 s",
            "message": "flight ped_01: was terminated early: it touched the ground at 12.50 s",
        },
    ]


def test_results_come_back_from_json():
    """All of them, equal: tables, bounds that are infinite, and what stands beside the tables."""
    results = everything()
    text = json.dumps(results.to_dict(), allow_nan=False)
    again = Results.from_dict(json.loads(text))
    assert again == results
    assert json.dumps(again.to_dict()) == text
    assert again["rollpitch_in1"]["unseen"].cr_percent == math.inf
    assert again["rollpitch_in1"].given == results["rollpitch_in1"].given


def test_results_without_what_a_run_of_one_axis_has_are_read():
    """No ground tests, verification or comparison: those of `helisim recover`, for instance."""
    results = make_results(make_row())
    assert results.to_dict().keys().isdisjoint({"ground", "verification", "before_after", "eq_8"})
    assert Results.from_dict(results.to_dict()) == results


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"seed": "one"}, r"results\.seed must be an integer, got 'one'"),
        ({"seed": True}, "seed must be an integer, got True"),
        ({"tables": [{"name": "heave"}]}, r"tables\[0\] needs input and "),
        ({"tables": {}}, "tables must be a list of tables, got {}"),
        ({"excluded": ["flight 3 was bad"]}, r"excluded\[0\] must be a table .*flight 3 was bad"),
        (
            {"excluded": [{"flight": "lat_01", "reason": "disliked"}]},
            "unknown .*reason 'disliked'; available: terminated early",
        ),
        ({"excluded": [{"flight": "lat_01", "reason": "less coherent"}]}, "needs coherence"),
        (
            {"eq_8": {**as_json(EQ_8), "band_rad_s": [1.0]}},
            r"eq_8\.band_rad_s must be a list of 2 numbers",
        ),
        ({"ground": {"bench": 3}}, r"ground\.bench must be a table .*, got 3"),
    ],
)
def test_what_is_no_result_is_refused(change, message):
    """The place, what is there and what was expected; also of a file that is only damaged."""
    data = {**everything().to_dict(), **change}
    with pytest.raises(InputError, match=f"a file: not the results of a run.*{message}"):
        Results.from_dict(data, "a file")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"identified": math.nan}, r"L_b\.identified must be a finite number, got nan"),
        ({"truth": math.inf}, r"L_b\.truth must be a finite number, got inf"),
        ({"truth": None}, "tolerance_percent needs a value of truth"),
        ({"paper": None}, "paper_tolerance_percent needs a value of paper"),
        ({"tolerance_percent": 0.0}, "tolerance_percent must be a number above 0, got 0"),
        ({"tolerance_percent": math.nan}, "tolerance_percent must be a finite number above 0"),
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
        ({"cost": math.nan}, "cost must be a finite number"),
        ({"cost": -1.0}, "cost must be a number 0 or more"),
        ({"band_rad_s": (30.0, 3.0)}, "band must rise"),
        ({"band_rad_s": (0.0, 3.0)}, "band_rad_s.* must be a number above 0"),
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
