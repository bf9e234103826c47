"""The bars of a design on the JR700, by the script that prints them; each with room to spare."""

import pytest

import helisim as hs
from helisim.study.design_chain import run_design
from script import loaded

STUDY = loaded("design_study")
BARS, errors = STUDY.BARS, STUDY.errors

AXES = ("lat", "lon", "ped")
SHARE = {"predicted": 0.8, "flown": 0.9}
"""Of the bars, which are given: 0.41 and 0.54 of them were the largest errors of ten flights an
axis, and six flights have 1.3 times the scatter."""


@pytest.fixture(scope="module")
def run(jr700):
    """The chain from six sweeps on each axis to the flown proof."""
    sweeps = {axis: hs.fly(jr700, hs.Sweep(axis=axis), count=6, seed=3) for axis in (*AXES, "col")}
    return run_design(sweeps, vehicle=jr700)


@pytest.mark.study
def test_predicted_and_flown_figures_are_within_their_bars(run):
    found = list(errors(run))
    assert {(one.axis, one.figure) for one in found} == {(a, b) for a in AXES for b in BARS}
    for one in found:
        bar, _ = BARS[one.figure]
        assert abs(one.predicted) < SHARE["predicted"] * bar, one
        assert abs(one.flown) < SHARE["flown"] * bar, one


@pytest.mark.study
def test_it_keeps_its_levels_in_flight_away_from_all_stops(run):
    assert run.met
    assert run.result.share == 1.0
    assert not run.proof.stops


@pytest.mark.study
@pytest.mark.parametrize("angle", ["phi", "theta", "psi"])
def test_a_gust_turns_it_less_than_with_the_shipped_gyro(run, angle):
    peaks = []
    for record in (run.proof.events["gust"], run.proof.before["gust"]):
        peaks.append(abs(record[angle] - record[angle][:100].mean()).max())
    assert peaks[0] < peaks[1]
