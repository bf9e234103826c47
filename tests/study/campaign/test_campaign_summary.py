"""Summaries of datasets whose numbers are made, so that the answer is known, and their study."""

import numpy as np
import pyarrow as pa
import pytest

from helisim.base.errors import UnknownNameError
from helisim.study.replicates import render, summarise
from script import loaded

TRUTH = -2.0


def row(truth, error, stated, **more):
    """Return a row of one parameter; where there is no error, of one that failed."""
    found = {"truth": truth, "estimate": truth + (error or 0.0), "standard_error": stated}
    found |= {"cramer_rao": 3.0 * stated}
    found = dict.fromkeys(found) if error is None else found
    return {**more, "method": "designed", **found, "failure": "none" if error is None else None}


def made(count, *, std, bias=0.0, stated=None, noise=1.0, seed=0):
    """Rows of one parameter with normal errors of a known size."""
    errors = np.random.default_rng(seed).normal(bias, std, count)
    what = {"noise": noise, "flights": 10, "model": "heave", "parameter": "Z_w"}
    return [row(TRUTH, error, stated or std, **what) for error in errors]


def test_honest_errors_are_found_honest():
    """Normal errors of the stated size: 95 % coverage, no bias, relative to the truth's size."""
    (one,) = summarise(pa.Table.from_pylist(made(4000, std=0.1)))
    assert one.covered == pytest.approx(0.95, abs=4 * (0.95 * 0.05 / 4000) ** 0.5)
    assert one.covered_by_cr == pytest.approx(0.9973, abs=0.004)  # three standard deviations
    assert one.scatter == pytest.approx(0.05, rel=4 / 8000**0.5)
    assert one.stated == pytest.approx(0.05, rel=1e-12)
    assert one.cramer_rao == pytest.approx(0.15, rel=1e-12)
    assert abs(one.bias) < 4 * one.scatter / 4000**0.5
    assert (one.count, one.failed) == (4000, 0)


def test_bias_and_overconfidence_show():
    """A bias has its sign, towards larger size or not; half the true error covers less."""
    (one,) = summarise(pa.Table.from_pylist(made(4000, std=0.1, bias=-0.2, stated=0.05)))
    # the truth is -2: an error of -0.2 makes it larger, but the error is signed as the value
    assert one.bias == pytest.approx(-0.1, abs=4 * 0.05 / 4000**0.5)
    assert one.covered < 0.2


def test_groups_are_kept_apart():
    rows = made(50, std=0.1, noise=1.0) + made(70, std=0.4, noise=4.0, seed=1)
    table = pa.Table.from_pylist(rows)
    one, other = summarise(table, by=("noise",))
    assert (one.group["noise"], other.group["noise"]) == (1.0, 4.0)
    assert (one.count, other.count) == (50, 70)
    assert other.scatter > 2.0 * one.scatter
    assert [both.count for both in summarise(table)] == [120]
    with pytest.raises(UnknownNameError, match="available: noise"):
        summarise(table, by=("weather",))


def test_failures_are_counted_not_judged():
    rows = made(50, std=0.1)
    failed = [{**rows[0], **row(TRUTH, None, 0.1)}] * 3
    (clean,) = summarise(pa.Table.from_pylist(rows))
    (one,) = summarise(pa.Table.from_pylist(rows + failed))
    assert (one.count, one.failed) == (50, 3)
    assert (one.bias, one.scatter, one.covered) == (clean.bias, clean.scatter, clean.covered)
    (none,) = summarise(pa.Table.from_pylist(failed))
    assert (none.count, none.failed) == (0, 3)
    assert "nan" in render([none])


@pytest.fixture(scope="module")
def study():
    return loaded("proof/campaign_study")


def rows_of(errors, *, duration=90, flights=1, turbulence=0.0):
    """Rows of N_r, whose truth is -1, with these relative errors; a failed one for None."""
    what = {"sweep.duration": duration, "weather.turbulence": turbulence, "flights": flights}
    what |= {"model": "yaw_base", "parameter": "N_r"}
    times = [None if error is None else float(duration * flights) for error in errors]
    return [
        row(-1.0, error, 0.01, replicate=number, flight_time=time, **what)
        for number, (error, time) in enumerate(zip(errors, times))
    ]


KEY = ("yaw_base", "N_r")
GOOD, BAD = [0.04, -0.04] * 10, [0.04] * 18 + [0.06, -0.06]


@pytest.mark.parametrize(
    ("flown", "least"),
    [
        ({(90, 1): GOOD, (90, 3): BAD, (90, 10): GOOD}, "900 (10 x 90)"),  # one may be luck
        ({(90, 1): BAD, (90, 3): GOOD, (30, 3): GOOD}, "90 (3 x 30)"),
        ({(90, 1): [0.04] * 19 + [0.06]}, "90 (1 x 90)"),  # 19 of 20 are 95 %
        ({(90, 1): [0.04] * 18 + [None, None]}, "not reached"),  # a failure is not within
    ],
)
def test_the_shortest_flight_is_the_least_from_which_on_all_suffice(study, flown, least):
    """Within 5 % in 95 % of the replicates, and in longer flights too."""
    rows = [
        row
        for (duration, flights), errors in flown.items()
        for row in rows_of(errors, duration=duration, flights=flights)
    ]
    assert study.need(rows, KEY, 0.05) == least


def test_intervals_may_hold_the_mean_and_miss_the_truth(study, capsys):
    """Errors of 10 and 13 % with 1 % of standard error: off the truth, near their mean."""
    rows = rows_of([0.10, 0.13] * 10, turbulence=0.0) + rows_of([-0.01, 0.01] * 10, turbulence=3.0)
    study.apart(rows, ("weather.turbulence",), {KEY: -0.95})
    *_, line = capsys.readouterr().out.splitlines()
    # half of all within 1.96 % of the truth, all within 1.96 % of their condition's mean;
    # the bias is the mean of 11.5 % and none, the structure's -0.95 against -1
    assert line.split() == ["yaw_base", "N_r", "50.0", "100.0", "5.75", "5.00"]


def test_the_papers_bounds_are_the_limits(study):
    """Cramér-Rao bounds of its Table 3; 5 % for N_r, for which it has none."""
    # Wu and Chen, Table 3, IN1: CR of L_b 13.9 % and of M_a 7.54 %
    found = [100.0 * study.bound(model, name) for model, name in study.WANTED]
    assert found == pytest.approx([5.0, 13.9, 7.54], rel=1e-12)
