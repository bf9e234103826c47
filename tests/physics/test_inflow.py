"""Induced velocity from climb to windmill: measured in the vortex ring, theory outside, one answer.

Leishman, Principles of Helicopter Aerodynamics, chapter 2, gives the fit of the measurements
v / v_h = 1 - 1.125 x - 1.372 x^2 - 1.718 x^3 - 0.655 x^4, x = V_c / v_h from -2 to 0.
"""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.optimize import brentq

from helisim.physics import inflow
from helisim.physics.inflow import balance, mass_flow
from tabled import tabled

SLOPE = 0.25 * 6.0 * 0.054
"""Of the blades' CT by v: a sigma / 4."""
NEVER = 1e3
"""A thrust limit that no blade reaches."""


def measured(x):
    return 1.0 - 1.125 * x - 1.372 * x**2 - 1.718 * x**3 - 0.655 * x**4


def induced_velocity(climb, advance=0.0):
    """Return v / v_h at a climb and an edgewise speed over v_h: v V = v_h^2."""
    return brentq(
        lambda v: v * mass_flow(v, climb, advance)[0] - 1.0, 1e-9, 4.0, xtol=1e-15, rtol=1e-15
    )


@tabled("x", "within")
def test_descent_follows_leishmans_fit(x, within):
    assert induced_velocity(x) == pytest.approx(measured(x), rel=within)


@pytest.mark.parametrize("x", [-2.0, -2.1, -2.5, -3.0, -5.0])
def test_windmill_is_momentum_theory(x):
    """It has v / v_h = -x / 2 - sqrt(x^2 / 4 - 1) from a descent of 2 v_h on."""
    closed = -0.5 * x - math.sqrt(0.25 * x**2 - 1.0)
    # at x = -2 thrust has no slope with v: half of the digits are lost
    assert induced_velocity(x) == pytest.approx(closed, rel=1e-7 if x == -2.0 else 1e-12)


@pytest.mark.parametrize("x", [-0.28, -0.2, -0.1, 0.0, 0.5, 1.0, 3.0])
def test_hover_and_climb_are_momentum_theory(x):
    """They have v / v_h = -x / 2 + sqrt(x^2 / 4 + 1), and in slow descent to 0.29 v_h."""
    closed = -0.5 * x + math.sqrt(0.25 * x**2 + 1.0)
    assert induced_velocity(x) == pytest.approx(closed, rel=1e-13)


@given(x=st.floats(-3.0, 3.0), edgewise=st.floats(1.05, 5.0))
def test_forward_flight_is_glauerts(x, edgewise):
    """It has v sqrt(V_x^2 + (V_c + v)^2) = v_h^2 where the edgewise flow is faster than v_h.

    There v is below v_h, in descent too, and the ring blown away: Johnson (NASA TP-2005-213477)
    has it gone at 0.95 v_h.
    """
    v = induced_velocity(x, edgewise)
    assert v * math.hypot(edgewise, x + v) == pytest.approx(1.0, rel=1e-13)


@pytest.mark.parametrize("edgewise", [0.25, 0.5, 0.75])
def test_edgewise_flow_calms_the_ring(edgewise):
    for x in np.linspace(-2.0, -0.3, 18):
        slower, faster = induced_velocity(x, edgewise - 0.05), induced_velocity(x, edgewise)
        assert faster < slower


def test_heave_damping_is_lost_in_the_ring():
    """At one thrust the flow through the blades, V_c + v, stops falling with faster descent.

    In hover half of a descent reaches the blades, which damps heave. Johnson (NASA
    TP-2005-213477) finds flight unstable from 0.45 to 1.5 v_h of descent, with V_c + v no
    longer falling; the mean of Leishman's fit stands still there until 1.2 v_h. In the windmill
    state the blades feel more than the descent.
    """
    step = 1e-4

    def felt(x):
        above, below = induced_velocity(x + step), induced_velocity(x - step)
        return 1.0 + (above - below) / (2.0 * step)

    assert felt(0.0) == pytest.approx(0.5, abs=1e-6)  # 1 - 1/2, momentum theory
    assert all(-0.05 < felt(x) < 0.1 for x in np.linspace(-0.85, -0.5, 8))
    assert min(felt(x) for x in np.linspace(-0.85, -0.5, 8)) < 0.0
    assert felt(-3.0) == pytest.approx(1.0 - 0.5 + 0.75 / math.sqrt(1.25), rel=1e-6)


@given(induced=st.floats(-0.1, 0.1), climb=st.floats(-3.0, 3.0), advance=st.floats(0.0, 2.0))
def test_slope_of_the_mass_flow_is_its_derivative(induced, climb, advance):
    """What Newton is told is what central differences find, a seventh of them in the ring."""
    climb, advance = climb * induced, advance * abs(induced)
    assume(math.hypot(induced, advance) > 1e-3)
    h = 1e-7
    above, below = (mass_flow(induced + side, climb, advance)[0] for side in (h, -h))
    # curvature below 20 / scale jumps where the branches meet; rounding of 1e-17 / h
    bound = 20.0 * h / math.hypot(induced, advance) + 1e-9
    assert mass_flow(induced, climb, advance)[1] == pytest.approx(
        (above - below) / (2.0 * h), abs=bound
    )


SLOW = [pytest.param(one, marks=pytest.mark.slow) for one in ("climb", "advance")]
POINTS = [(x, y) for x in (0.05, 0.15) for y in (0.0, 0.02)]


@pytest.mark.parametrize("along", [*SLOW, "free"])
def test_thrust_is_smooth_in_all_directions(along):
    """One-sided slopes agree the better the smaller the step: no jump, no kink.

    On lines through hover, ring, windmill and negative thrust. Where a slope jumped, the
    greatest difference of neighbours would stay as the step is halved; here it halves.
    """
    kinks = []
    for count in (4000, 8000):
        worst = 0.0
        for free, other in POINTS:
            line = np.linspace(-0.2, 0.2, count + 1)
            if along == "climb":
                thrust = [balance(free - c, SLOPE, NEVER, c, other, 0.0)[1] for c in line]
            elif along == "advance":
                line = np.linspace(0.0, 0.1, count + 1)
                c = -2.0 * other
                thrust = [balance(free, SLOPE, NEVER, c, mu, 0.0)[1] for mu in line]
            else:
                thrust = [balance(f, SLOPE, NEVER, -2.0 * other, 0.004, 0.0)[1] for f in line]
            slopes = np.diff(thrust) / np.diff(line)
            worst = max(worst, np.abs(np.diff(slopes)).max())
        kinks.append(worst)
    assert kinks[1] < 0.6 * kinks[0]


@given(free=st.floats(0.0, 0.4), advance=st.floats(0.0, 0.2), climb=st.floats(-0.3, 0.3))
def test_the_answer_is_the_only_one(free, advance, climb):
    """Scanned from no inflow to that which unloads the blades, the balance changes sign once."""

    def residual(v):
        return 2.0 * v * mass_flow(v, climb, advance)[0] - SLOPE * (free - v)

    signs = [residual(v) > 0.0 for v in np.linspace(0.0, free, 400)]
    assert sum(one != other for one, other in pairwise(signs)) <= 1
    induced, _ = balance(free, SLOPE, NEVER, climb, advance, 0.0)
    assert -1e-15 <= induced <= free + 1e-15  # rounding


@given(free=st.floats(-0.4, 0.4), climb=st.floats(0.0, 0.3))
def test_in_hover_and_climb_newton_starts_at_the_answer(free, climb):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(inflow, "_MAX_ITERATIONS", 0)
        v, thrust = balance(free, SLOPE, NEVER, math.copysign(climb, free), 0.0, 0.0)
    assert 2.0 * v * abs(v + math.copysign(climb, free)) == pytest.approx(thrust, abs=1e-14)
