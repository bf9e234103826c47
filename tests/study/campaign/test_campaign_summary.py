"""The summary of a dataset whose numbers are made, so that the answer is known."""

import numpy as np
import pyarrow as pa
import pytest

from helisim.base.errors import UnknownNameError
from helisim.study.replicates import render, summarise

TRUTH = -2.0


def made(count, *, std, bias=0.0, stated=None, noise=1.0, seed=0):
    """Rows of one parameter with normal errors of a known size."""
    errors = np.random.default_rng(seed).normal(bias, std, count)
    return [
        {
            "noise": noise,
            "flights": 10,
            "method": "designed",
            "model": "heave",
            "parameter": "Z_w",
            "truth": TRUTH,
            "estimate": TRUTH + error,
            "standard_error": std if stated is None else stated,
            "cramer_rao": 3.0 * std,
            "failure": None,
        }
        for error in errors
    ]


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
    """Each value of a column is a row, in order of appearance; without it they are pooled."""
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
    empty = dict.fromkeys(("estimate", "truth", "standard_error", "cramer_rao"))
    failed = [{**rows[0], **empty, "failure": "diverged"}] * 3
    (clean,) = summarise(pa.Table.from_pylist(rows))
    (one,) = summarise(pa.Table.from_pylist(rows + failed))
    assert (one.count, one.failed) == (50, 3)
    assert (one.bias, one.scatter, one.covered) == (clean.bias, clean.scatter, clean.covered)
    (none,) = summarise(pa.Table.from_pylist(failed))
    assert (none.count, none.failed) == (0, 3)
    assert "nan" in render([none])


def test_the_table_has_a_line_a_parameter():
    (one,) = summarise(pa.Table.from_pylist(made(100, std=0.1)))
    title, heading, line = render([one]).splitlines()
    assert title == "heave (flights 10, method designed)"
    assert "in 95 %" in heading
    assert line.split()[:3] == ["Z_w", "100", "0"]
    assert float(line.split()[4]) == pytest.approx(100 * one.scatter, abs=0.005)
    assert line.split()[-2] == f"{100 * one.covered:.1f}%"
