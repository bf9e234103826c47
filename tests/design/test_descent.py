"""Descents against minimax problems whose solutions are printed or in closed form."""

import numpy as np
import pytest

from helisim.design.descent import Goal, Trial, descend

WIDE = np.array([-3.0, -3.0]), np.array([3.0, 3.0])


def solved(distances, start, *, box=WIDE, cost=None, goal=0.0):
    """Return where a descent from a start ends; it asks for nothing outside of its box."""

    def trial(at, near=False):
        assert np.all((box[0] <= at) & (at <= box[1]))
        found = np.array(distances(*at))
        return Trial(at, found, cost(*at) if cost else 0.0) if np.all(np.isfinite(found)) else None

    here = trial(np.array(start))
    wanted = Goal(
        np.full(here.distances.size, goal), np.ones(here.distances.size), float(bool(cost))
    )
    return descend(trial, here, wanted, box, steps=100)


def cb3(x, y):
    return -(x**4) - y**2, -((2.0 - x) ** 2) - (2.0 - y) ** 2, -2.0 * np.exp(y - x)


@pytest.mark.parametrize("start", [(2.0, 2.0), (-1.0, 3.0), (-3.0, -3.0), (3.0, -3.0)])
def test_the_least_of_the_worst_is_the_printed_one(start):
    """C. Charalambous and A. Conn, SIAM J. Numerical Analysis 15, 1978, their third: 2 at (1, 1).

    All three are active there, with multipliers 2 : 3 : 1, which the share of 0.1 of each leaves
    positive.
    """
    found = solved(cb3, start)
    assert found.at == pytest.approx([1.0, 1.0], abs=2e-3)  # the least radius
    assert -found.distances.min() == pytest.approx(2.0, abs=1e-3)


@pytest.mark.parametrize("start", [(0.5, -3.0), (-3.0, -0.2), (0.5, -0.2)])
def test_it_ends_at_the_border_of_its_box(start):
    """Of -2 + x + y / 2 and -2 + x / 4 + y: at the upper corner, where neither can be more."""
    box = WIDE[0], np.array([0.5, -0.2])
    found = solved(lambda x, y: (-2.0 + x + y / 2.0, -2.0 + x / 4.0 + y), start, box=box)
    assert found.at == pytest.approx(box[1], abs=1e-12)


@pytest.mark.parametrize("start", [(0.0, 0.5), (-2.0, -2.0)])
def test_a_cost_is_the_least_where_nothing_is_short(start):
    """x^2 + 2 y^2 of x + y at least 3: 2 and 1, not beyond x of 2.5, where a loop is unstable."""
    found = solved(
        lambda x, y: (x + y if x <= 2.5 else np.nan,),
        start,
        cost=lambda x, y: x**2 + 2 * y**2,
        goal=3,
    )
    assert found.at == pytest.approx([2.0, 1.0], abs=0.02)  # flat to 1e-4 of cost foreseen
    assert found.distances[0] == pytest.approx(3.0, abs=1e-3)


def test_what_is_met_is_left():
    assert solved(lambda x, y: (1.0 - x,), (0.3, 0.2)).at.tolist() == [0.3, 0.2]
