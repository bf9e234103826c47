"""The paper's experiment: fly, record, identify, compare; and a run repeats to the byte."""

import json
from dataclasses import replace
from functools import partial

import pytest

import helisim as hs
from helisim.base.errors import DivergedError
from helisim.records.record import AXES
from helisim.records.storage import read_record
from helisim.sim import Recorder, Sweep
from helisim.study import experiment
from helisim.study.experiment import fly_sweeps
from helisim.study.results import Exclusion, as_json
from helisim.vehicle import load

TIGHT = {"N_r", "N_ped", "L_b", "M_a", "A_lon", "B_lat", "Z_w", "Z_col", "tau_f"}
TIGHT_PERCENT = 3.0  # below the paper's smallest printed bound on a derivative, 3.9 %
LOOSE = {"A_b", "B_a", "A_lat", "B_lon", "tau_lat", "tau_lon"}
LOOSE_PERCENT = 10.0  # the paper's own bounds on these run from 5.6 % to 36 %


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("runs") / "a run, übung"


def short(**asked):
    """Return a reproduction of few flights, with one evaluation of the laws a step, not four."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(experiment, "load", partial(load, integrator="Euler"))
        return hs.reproduce(flights=3, seed=1, **asked).results


@pytest.fixture(scope="module")
def results(folder):
    return short(out=folder)


def rows(results):
    tables = [table for table in results.tables if table.name != "rollpitch_in2"]
    return {row.name: row for table in tables for row in table.parameters}


def check_recovery(results):
    found = rows(results)
    assert found.keys() >= TIGHT | LOOSE
    for name in TIGHT:
        assert abs(found[name].error_percent) < TIGHT_PERCENT, found[name]
    for name in LOOSE:
        assert abs(found[name].error_percent) < LOOSE_PERCENT, found[name]


def test_every_parameter_is_recovered_and_what_was_left_out_is_said(results):
    check_recovery(results)
    assert results.misses == ()
    assert len(results.excluded) == 4
    for one in results.excluded:
        assert one.reason == "less coherent"
        assert one.coherence <= one.limit
        assert one.kept == 3


@pytest.mark.study
def test_another_truth_is_followed():
    """With hub stiffness and both lift slopes changed by 20 %, the estimates move along."""
    changed = {
        "main_rotor.hub_stiffness": 1.2 * 85.966,
        "main_rotor.lift_slope": 0.8 * 6.0205,
        "tail_rotor.lift_slope": 1.2 * 5.0,
    }
    results = hs.reproduce(seed=1, parameters=changed).results
    check_recovery(results)
    found = rows(results)
    # The truths themselves have left the paper's by more than the tolerance of recovery.
    for name in ("N_r", "L_b", "M_a", "Z_w", "Z_col"):
        moved = abs(found[name].truth / found[name].paper - 1.0)
        assert moved > 2.0 * TIGHT_PERCENT / 100.0, (name, moved)


def test_the_gyro_is_given_what_the_ground_tests_found_and_eq_8_follows(results, folder):
    ground = results.ground
    assert results["yaw_gyro"]["k_I"].identified == ground["bench"]["k_I"].value
    assert results["yaw_gyro"]["k_I"].identified != results["yaw_gyro"]["k_I"].truth
    *measured, read_off = results["yaw_gyro"].given
    assert {one.source for one in measured} == {"yaw_base", "turntable", "bench"}
    assert all(one.standard_error is not None for one in measured)
    assert read_off.source == "bench, not measured: as the gyro shows its setting"
    assert read_off.standard_error is None
    for name in ("k_I", "k_p", "k_delta", "k_a"):  # all of Table 2 within 3 %
        assert abs(results["yaw_gyro"][name].paper_error_percent) < 3.0
    check = results.eq_8
    for one in check.coefficients:
        # 2.5 %: the parts leave servo and lead out, whose 10 ms nearly cancel; 2.1 % measured
        assert abs(one.difference_percent) < 2.5, one
    assert abs(check.gain_db) < 0.3  # 0.1 measured; 2.5 % of a coefficient is 0.2 dB
    # the lead cancels the servo inside the loop, but r itself comes through the servo alone
    assert abs(check.phase_deg) < 5.0  # 2.8 at 25 rad/s, where 1 ms is 1.4 degrees
    written = json.loads((folder / "results.json").read_text())["eq_8"]
    assert written == as_json(check)


def test_the_gyros_effect_and_the_doublets_figures_are_in_the_results(results, folder):
    """A_lon and B_lat fall to 0.57 as in the paper, and tau_f falls, whatever the text says."""
    written = json.loads((folder / "results.json").read_text())
    assert written["before_after"] == as_json(results.gyro_effect)
    for one in written["before_after"]["changes"]:
        # both columns within 3 %, couplings within 10 % of the paper's
        limit = 0.06 if one["name"] in TIGHT else 0.2
        assert one["ratio"] == pytest.approx(one["paper_ratio"], rel=limit)
    assert written["verification"].keys() == {"rollpitch_in1", "rollpitch_in2"}
    for found in written["verification"].values():
        assert [one["name"] for one in found["outputs"]] == ["p", "q"]
        for one in found["outputs"]:
            assert one["j_rms"] > 0.0
            assert one["tic"] < 0.25  # the guideline's limit


def test_the_records_alone_give_the_same_model(results, folder):
    flights = [
        hs.read_record(path)
        for path in sorted((folder / "flights").glob("col_*.parquet"))
        if path.stem not in results.left_out
    ]
    assert len(flights) == 3
    asked = {"inputs": "col", "outputs": "w", "band": (0.3, 12.0), "estimator": "windows"}
    frf = hs.frequency_response(flights, **asked)
    fit = hs.identify(frf, hs.structures.heave)
    assert fit["Z_w"].value == results["heave"]["Z_w"].identified


END = {"at": 12.5, "why": "the helicopter touched the ground", "state": [0.0]}


@pytest.fixture
def over(monkeypatch):
    """Let flights of these numbers be over, of sweeps that last 35 s: otherwise as flown."""

    def choose(*numbers):
        def ended(number, record):
            if number not in numbers:
                return record
            return replace(record, provenance={**record.provenance, "ended": END})

        def marked(vehicle, plan, which, then, **options):
            def do(number, record):
                return then(number, ended(number, record))

            return flown(vehicle, plan, which, do, **options)

        flown = experiment.fly_each
        monkeypatch.setattr(experiment, "fly_each", marked)
        monkeypatch.setattr(experiment, "Sweep", lambda axis: Sweep(axis=axis, duration=35.0))

    return choose


@pytest.mark.slow
def test_a_sweep_that_was_over_is_left_out(jr700, tmp_path, over):
    over(0)
    (tmp_path / "flights").mkdir()
    kept, excluded = fly_sweeps(jr700, 1, 1, 2, Recorder.of(jr700), tmp_path, lambda _: None)
    for axis in AXES:
        (record,) = kept[axis]
        assert record.provenance["flight"] == 1
        assert read_record(tmp_path / "flights" / f"{axis}_01.parquet").ended
    assert excluded == tuple(
        Exclusion(
            flight=f"{axis}_01",
            reason="terminated early",
            ended="the helicopter touched the ground at 12.50 s",
        )
        for axis in AXES
    )


def test_too_few_that_went_on_end_the_experiment(jr700, over):
    over(0, 1)
    with pytest.raises(DivergedError, match=r"2 of 2 sweeps of ped .* ground at"):
        fly_sweeps(jr700, 1, 1, 2, Recorder.of(jr700), None, lambda _: None)


# From a faulty recorder to a model: what was left out is told, and what is found still holds.
