"""Results, models and a run's files: their verdicts, and that they come back from JSON."""

import json
import math
import re

import numpy as np
import pytest

from helisim import ident
from helisim.base.errors import InputError, StorageError
from helisim.study.comparison import ComparisonTable, GivenValue, ParameterRow
from helisim.study.results import Exclusion, Results, as_json, read_models, write_models
from made_run import EQ_8, GROUND, GYRO_EFFECT, make_model, make_verification

COHERENT = {"coherence": 0.98765, "limit": 0.9912, "kept": 10}
INCOHERENT = Exclusion(flight="lat_03", reason="less coherent", **COHERENT)
TOUCHED = "it touched the ground at 12.50 s"
ENDED = Exclusion(flight="ped_01", reason="terminated early", ended=TOUCHED)
ROW = {"name": "L_b", "unit": "1/s^2", "identified": 505.0, "truth": 500.0, "paper": 540.0}
ROW |= {"cr_percent": 4.0, "insensitivity_percent": 1.5}
ROW |= {"tolerance_percent": 3.0, "tolerance_reason": "asked for"}
ROW |= {"paper_tolerance_percent": 10.0, "paper_tolerance_reason": "the paper's bound"}
"""Truth 500 to 3 % is 485 to 515; paper 540 to 10 % is 486 to 594."""
TABLE = {"name": "rollpitch_in1", "input": "IN1", "cost": 1.5, "band_rad_s": (3.0, 30.0)}


LEFT = {"flight": "lat_01"}


def make_row(**changes) -> ParameterRow:
    return ParameterRow(**(ROW | changes))


def make_results(*rows: ParameterRow, given=(), **more) -> Results:
    return Results(
        tables=(ComparisonTable(**TABLE, parameters=rows, given=given),),
        seed=7,
        versions={"helisim": "0.1.0"},
        configuration={"flights": 10},
        excluded=(INCOHERENT, ENDED),
        **more,
    )


def everything() -> Results:
    """Results with all that results can hold."""
    checked = make_verification(ident.structures.rollpitch)
    given = {"name": "k_I", "unit": "1/s", "value": 17.7, "standard_error": 0.0014}
    return make_results(
        make_row(),
        make_row(name="unseen", cr_percent=math.inf),
        make_row(name="given", cr_percent=None, insensitivity_percent=None),
        make_row(name="free", truth=None, tolerance_percent=None),
        given=(GivenValue(**given, source="bench"),),
        **{"ground": {"bench": GROUND}, "verification": {"rollpitch_in1": checked.figures}},
        **{"gyro_effect": GYRO_EFFECT, "eq_8": EQ_8},
    )


@pytest.mark.parametrize(
    ("changes", "truth", "paper"),
    [
        ({"identified": 514.9}, "agrees", "agrees"),
        ({"identified": 515.1}, "differs", "agrees"),
        ({"identified": 594.1}, "differs", "differs"),
        ({"identified": 485.9}, "agrees", "differs"),
        ({"identified": -500.0}, "differs", "differs"),
        # what the data say of a value says nothing of its agreement
        ({"support": "poor", "cr_percent": 71.0}, "agrees", "agrees"),
        # another truth is not held against the paper, a reported parameter is no failure
        ({"paper_tolerance_percent": None}, "agrees", "not judged"),
        ({"truth": None}, "not judged", "agrees"),
        ({"tolerance_percent": None}, "not judged", "agrees"),
        # by magnitude; and no percentage of zero is a distance
        ({"identified": -1.02, "truth": -1.0, "paper": -1.0}, "agrees", "agrees"),
        ({"identified": 0.0, "truth": 0.0}, "agrees", "differs"),
        ({"identified": 1e-9, "truth": 0.0}, "differs", "differs"),
    ],
)
def test_agreement_is_with_each_reference(changes, truth, paper):
    row = make_row(**changes)
    assert (row.truth_agreement, row.paper_agreement) == (truth, paper)
    both = {truth, paper}
    expected = "differs" if "differs" in both else "agrees" if "agrees" in both else "not judged"
    assert row.agreement == expected
    assert len(row.misses()) == [truth, paper].count("differs")


def test_a_miss_says_which_by_how_much_and_why():
    """One plain sentence a missed tolerance, with the table's name before it.

    A low-order equivalent isn't the linearisation that figures draw: it has another name.
    """
    results = make_results(make_row(), make_row(name="M_a", identified=600.0))
    assert results.misses == (
        "rollpitch_in1: M_a is 600 1/s^2, 20 % from the truth's 500; "
        "the tolerance is 3 % (asked for)",
        "rollpitch_in1: M_a is 600 1/s^2, 11.1 % from the paper's 540; "
        "the tolerance is 10 % (the paper's bound)",
    )
    assert make_results(make_row()).misses == ()
    row = make_row(identified=520.0, paper_tolerance_percent=None)
    (miss,) = ComparisonTable(**TABLE, parameters=(row,), truth="equivalent").misses
    assert "4 % from the equivalent's 500" in miss


def test_a_ratio_to_nothing_is_infinite():
    data = everything().to_dict()
    (gain,) = data["eq_8"]["coefficients"]
    gain["direct"] = 0.0
    results = Results.from_dict(data)
    assert results.to_dict()["eq_8"]["coefficients"][0]["difference_percent"] == "inf"
    gain["direct"] = math.inf
    with pytest.raises(InputError, match=r"coefficients\[0\]\.direct must be .*, got inf"):
        Results.from_dict(data)


def test_the_json_has_its_shape():
    data = json.loads(json.dumps(everything().to_dict(), allow_nan=False))
    assert (data["seed"], data["versions"], data["misses"]) == (7, {"helisim": "0.1.0"}, [])
    (table,) = data["tables"]
    first, unseen, _, free = table["parameters"]
    assert (first["truth_agreement"], first["paper_agreement"]) == ("agrees", "agrees")
    assert (unseen["cr_percent"], free["truth"]) == ("inf", None)
    given = {"name": "k_I", "unit": "1/s", "value": 17.7, "source": "bench"}
    assert table["given"] == [{**given, "standard_error": 0.0014}]
    assert data["before_after"]["changes"][0]["ratio"] == GYRO_EFFECT.changes[0].ratio
    told = {"flight": "ped_01", "reason": "terminated early", "ended": ENDED.ended}
    assert data["excluded"][1] == {
        **told,
        "message": "flight ped_01: was terminated early: it touched the ground at 12.50 s",
    }


@pytest.mark.parametrize("results", [everything(), make_results(make_row())], ids=["all", "few"])
def test_results_come_back_from_json(results):
    text = json.dumps(results.to_dict(), allow_nan=False)
    again = Results.from_dict(json.loads(text))
    assert again == results
    assert json.dumps(again.to_dict()) == text
    assert again["rollpitch_in1"].given == results["rollpitch_in1"].given
    more = {"ground", "verification", "before_after", "eq_8"}
    assert len(more & results.to_dict().keys()) == (4 if results.eq_8 else 0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"seed": "one"}, r"results\.seed must be an integer, got 'one'"),
        ({"tables": [{"name": "heave"}]}, r"tables\[0\] needs input and "),
        ({"excluded": ["flight 3 was bad"]}, r"excluded\[0\] must be a table .*'flight 3 was bad'"),
        ({"excluded": [{**LEFT, "reason": "disliked"}]}, "'disliked'; available: terminated early"),
        ({"excluded": [{**LEFT, "reason": "less coherent"}]}, "needs coherence"),
        ({"eq_8": {**as_json(EQ_8), "band_rad_s": [1.0]}}, r"eq_8\.band_rad_s must be a list of 2"),
    ],
)
def test_what_is_no_result_is_refused(change, message):
    data = {**everything().to_dict(), **change}
    with pytest.raises(InputError, match=f"a file: not the results of a run.*{message}"):
        Results.from_dict(data, "a file")


@pytest.mark.parametrize(
    ("kind", "changes", "message"),
    [
        (make_row, {"identified": math.nan}, r"L_b\.identified must be a finite number, got nan"),
        (make_row, {"tolerance_percent": 0.0}, "tolerance_percent must be a number above 0, got"),
        (ComparisonTable, {"cost": -1.0}, "cost must be a number 0 or more"),
    ],
)
def test_what_cant_be_judged_is_refused(kind, changes, message):
    """NaN never passes a tolerance by comparing false."""
    given = {**TABLE, "parameters": ()} if kind is ComparisonTable else {}
    with pytest.raises(InputError, match=message):
        kind(**{**given, **changes})


@pytest.fixture(scope="module")
def item():
    return make_model("rollpitch_in1", verified=True)


def test_a_model_comes_back_and_another_file_is_refused(tmp_path, item):
    (read,) = read_models(write_models(tmp_path / "fits.json", [item]))
    assert (read.name, read.note, read.verified_on) == (item.name, item.note, item.verified_on)
    assert read.fit.values == item.fit.values
    np.testing.assert_array_equal(read.exact.response, item.exact.response)
    found, kept = (one.verification.traces[0].predicted for one in (read, item))
    np.testing.assert_array_equal(found, kept)
    assert read.verification.tic_by_output == item.verification.tic_by_output
    path = tmp_path / "other.json"
    with pytest.raises(StorageError, match=r"other\.json"):
        read_models(path)
    for text, says in (
        ('{"format": "other"}', "its format is 'other'"),
        ('{"format": "helisim fits, version 1", "models": [{}]}', "can't read a model"),
        ('{"format": "helisim fits, version 1", "models": 3}', "models must be a list, got 3"),
    ):
        path.write_text(text)
        with pytest.raises(InputError, match=says):
            read_models(path)


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (("fit",), {}),
        (("verified_on",), "doublet"),
        (("exact", "frequency"), "fast"),
        (("verification", "j_rms"), "large"),
        (("verification", "traces"), [{"time": "early"}]),
    ],
)
def test_a_damaged_model_is_refused(tmp_path, item, place, value):
    path = write_models(tmp_path / "fits.json", [item])
    data = json.loads(path.read_text())
    at = data["models"][0]
    for part in place[:-1]:
        at = at[part]
    at[place[-1]] = value
    path.write_text(json.dumps(data))
    with pytest.raises(InputError, match=re.escape(f"{path}: can't read a model: ")) as caught:
        read_models(path)
    assert "\n" not in str(caught.value)
