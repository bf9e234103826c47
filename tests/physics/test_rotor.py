"""Momentum theory, blade elements and power against closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helisim.physics import rotor

SOLIDITY = 2 * 0.065 / (math.pi * 0.767)
SLOPE = 6.0
STALL = 0.18
FLOOR = 0.015
NEVER = 1e3
"""A stall limit that no thrust reaches."""

ROUNDING = 2e-15
"""Newton ends quadratically, after a last step below 1e-9: what is left is a few roundings of
terms below 1 (1.2e-16 is the worst of 200000 random cases)."""

pitches = st.floats(-0.3, 0.45)
climbs = st.floats(-0.3, 0.3)
advances = st.floats(0.0, 0.4)


def solve(pitch, climb=0.0, advance=0.0, *, stall=STALL, floor=FLOOR, nearness=0.0):
    return rotor.inflow_and_thrust(pitch, climb, advance, SOLIDITY, SLOPE, stall, floor, nearness)


def loading(pitch, inflow, advance, stall=STALL):
    linear = rotor.blade_element_thrust(pitch, inflow, advance, SOLIDITY, SLOPE)
    return rotor.soft_limit(linear, stall * SOLIDITY, 0.7)


@given(pitch=st.floats(0.03, 0.25))
def test_hover_inflow_is_the_closed_form(pitch):
    """In hover, blade elements and momentum meet at the root of one quadratic."""
    inflow, thrust = solve(pitch, stall=NEVER, floor=1e-6)
    # 2 l^2 = (a s / 2)(theta / 3 - l / 2), solved for l > 0
    k = SLOPE * SOLIDITY
    closed = k / 16.0 * (math.sqrt(1.0 + 64.0 * pitch / (3.0 * k)) - 1.0)
    assert inflow == pytest.approx(closed, rel=1e-13)  # rounding of a square root
    assert thrust == pytest.approx(2.0 * inflow**2, rel=1e-12)  # CT = 2 lambda^2


def test_hover_induced_velocity_is_froudes():
    """v_i = sqrt(T / 2 rho A), in SI and with the JR700's own numbers."""
    density, radius, tip_speed = 1.225, 0.767, 178.02358 * 0.767
    area = math.pi * radius**2
    inflow, thrust = solve(0.08)
    newtons = density * area * tip_speed**2 * thrust
    assert inflow * tip_speed == pytest.approx(
        math.sqrt(newtons / (2.0 * density * area)), rel=1e-12
    )


@given(pitch=st.floats(0.05, 0.2), climb=st.floats(0.0, 0.1))
def test_climb_induced_velocity_is_the_quadratics_root(pitch, climb):
    """In axial climb, v_i = -V/2 + sqrt(V^2/4 + v_h^2), with v_h of the same thrust."""
    inflow, thrust = solve(pitch, climb, stall=NEVER, floor=1e-6)
    if thrust <= 0.0:
        return
    closed = -0.5 * climb + math.sqrt(0.25 * climb**2 + 0.5 * thrust)
    # 1e-15 in lambda, which may be a small difference of larger numbers
    assert inflow - climb == pytest.approx(closed, abs=2e-14)


@pytest.mark.parametrize("advance", [0.2, 0.4, 0.8])
def test_fast_forward_flight_is_a_wing(advance):
    """At speed, v_i tends to T / (2 rho A V): CT / (2 mu) in ratios."""
    inflow, thrust = solve(0.08, advance=advance, stall=NEVER, floor=1e-6)
    # sqrt(mu^2 + l^2) = mu (1 + l^2 / 2 mu^2 - ...)
    assert inflow == pytest.approx(thrust / (2.0 * advance), rel=0.51 * (inflow / advance) ** 2)
    assert inflow < thrust / (2.0 * advance)
    # the rounded-off mass flow adds less than (floor / mu)^2 / 2
    rounded, _ = solve(0.08, advance=advance, stall=NEVER)
    assert rounded == pytest.approx(inflow, rel=0.5 * (FLOOR / advance) ** 2)


@given(pitch=pitches, climb=climbs, advance=advances, floor=st.floats(1e-3, 0.05))
def test_glauerts_equation_is_solved_everywhere(pitch, climb, advance, floor):
    """Residual zero to rounding in climb, descent, negative thrust and stall."""
    inflow, thrust = solve(pitch, climb, advance, floor=floor)
    flow, _ = rotor.mass_flow(inflow, advance, floor)
    assert 2.0 * (inflow - climb) * flow - thrust == pytest.approx(0.0, abs=ROUNDING)
    assert thrust == loading(pitch, inflow, advance)
    assert abs(thrust) <= STALL * SOLIDITY


@pytest.mark.parametrize("climb", np.linspace(-0.065, 0.065, 14))
def test_one_inflow_for_every_moderate_descent(climb):
    """To 8.8 m/s of descent the momentum balance has one root: no fork in the vortex ring.

    Faster (and turned upside down) three roots exist at some pitch; the solver takes one.
    """
    inflows = np.linspace(-0.35, 0.35, 1401)
    for pitch in np.linspace(-0.04, 0.2, 9) + 1e-4:
        for advance in (0.0, 0.02):
            residual = [
                2.0 * (x - climb) * rotor.mass_flow(x, advance, FLOOR)[0]
                - loading(pitch, x, advance)
                for x in inflows
            ]
            assert np.count_nonzero(np.diff(np.sign(residual))) == 1


@given(pitch=st.floats(-0.2, 0.35), climb=st.floats(-0.065, 0.065), advance=advances)
def test_more_collective_is_more_thrust(pitch, climb, advance):
    """Thrust grows with collective, in slow descent always, in fast descent below the windmill.

    Where the air comes through the disc from behind (2.7 m/s of descent and more, at little
    thrust) momentum theory itself turns the sign round.
    """
    inflow, less = solve(pitch, climb, advance)
    _, more = solve(pitch + 1e-3, climb, advance)
    if abs(climb) > 0.02 and inflow * less <= 0.0:
        return
    # deep in stall tanh is flat: rounding
    assert more > less or (abs(less) > 0.99 * STALL * SOLIDITY and more >= less - 1e-15)


@given(pitch=pitches, climb=climbs, advance=advances)
def test_thrust_is_odd(pitch, climb, advance):
    """Turned upside down (pitch and climb reversed) the rotor pulls the other way."""
    if abs(climb) > 0.065:
        return  # several roots may exist there, see above
    inflow, thrust = solve(pitch, climb, advance)
    mirrored_inflow, mirrored = solve(-pitch, -climb, advance)
    # two solutions from different sides of the root, each within 1e-15 over the slope of 0.03
    assert mirrored == pytest.approx(-thrust, abs=1e-13)
    assert mirrored_inflow == pytest.approx(-inflow, abs=1e-13)


def test_thrust_is_continuous_through_descent():
    """From 8.8 m/s of descent to climb, thrust never jumps: its steps shrink with the step."""
    for pitch in (0.05, 0.08, 0.15):
        jumps = []
        for count in (2001, 4001):
            thrust = [solve(pitch, c)[1] for c in np.linspace(-0.065, 0.05, count)]
            jumps.append(np.max(np.abs(np.diff(thrust))))
        # a jump would keep its size (ratio 1), a continuous function halves it
        assert jumps[0] / jumps[1] == pytest.approx(2.0, rel=0.05)


@given(inflow=st.floats(-0.1, 0.1), advance=st.floats(0.001, 0.3))
def test_mass_flow_slope_is_its_derivative(inflow, advance):
    """The slope that Newton uses equals a central difference, also within the floor."""
    h = 1e-6
    above = rotor.mass_flow(inflow + h, advance, FLOOR)[0]
    below = rotor.mass_flow(inflow - h, advance, FLOOR)[0]
    slope = rotor.mass_flow(inflow, advance, FLOOR)[1]
    # truncation h^2/6 |f'''|, |f'''| < 5 / advance^2 + 30 / floor^2; rounding 1e-17 / h
    bound = h**2 * (5.0 / advance**2 + 30.0 / FLOOR**2) + 1e-9
    assert slope == pytest.approx((above - below) / (2.0 * h), abs=bound)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_inflow_floor_joins_smoothly(side):
    """At the floor the mass flow and its slope are continuous, and the slope has no kink."""
    h = 1e-6
    value, slope = rotor.mass_flow(side * FLOOR, 0.0, FLOOR)
    inside, inner_slope = rotor.mass_flow(side * FLOOR * (1.0 - h), 0.0, FLOOR)
    assert value == FLOOR
    assert slope == side
    assert inside == pytest.approx(FLOOR * (1.0 - h), rel=h**2)
    # s'' = 1.5 - 1.5 s^2 vanishes at s = 1, so what is left is of second order
    assert inner_slope == pytest.approx(side, abs=2.0 * h**2 + 1e-15)


def test_without_floor_mass_flow_is_untouched():
    """Above the floor the mass flow is the textbook's, to the bit."""
    assert rotor.mass_flow(0.03, 0.04, FLOOR)[0] == 0.05
    assert rotor.mass_flow(0.0, 0.0, 0.0) == (0.0, 0.0)


@given(x=st.floats(-5.0, 5.0))
def test_soft_limit_is_itself_then_bounded(x):
    """Identity within the core, odd, monotone, and never beyond the limit."""
    y = rotor.soft_limit(x, 1.0, 0.7)
    assert abs(y) <= 1.0
    assert y == -rotor.soft_limit(-x, 1.0, 0.7)
    if abs(x) <= 0.7:
        assert y == x
    assert rotor.soft_limit(x + 1e-3, 1.0, 0.7) >= y


def test_soft_limit_joins_with_two_derivatives():
    """At the core's edge, slope 1 and curvature 0: tanh(x) = x - x^3/3."""
    h = 1e-4
    beyond = [rotor.soft_limit(0.7 + k * h, 1.0, 0.7) - 0.7 - k * h for k in (1, 2)]
    # the cubic (k h)^3 / (3 room^2), room = 0.3, to the next (fifth) order
    assert beyond == pytest.approx([-((k * h) ** 3) / 0.27 for k in (1, 2)], rel=1e-4)


@given(pitch=st.floats(0.0, 0.25), climb=st.floats(-0.05, 0.1), advance=advances)
def test_power_balances_thrust_times_flow(pitch, climb, advance):
    """With an ideal wake and no profile drag, power is thrust times (climb + v_i)."""
    inflow, thrust = solve(pitch, climb, advance)
    power = rotor.power(thrust, inflow, climb, advance, SOLIDITY, 1.0, 0.0)
    assert power == pytest.approx(thrust * inflow, rel=1e-12, abs=1e-17)  # rounding


def test_hover_power_is_the_closed_form():
    """CP = kappa CT^1.5 / sqrt 2 + sigma c_d0 / 8 (design, section 3: induced and profile)."""
    inflow, thrust = solve(0.08)
    power = rotor.power(thrust, inflow, 0.0, 0.0, SOLIDITY, 1.15, 0.012)
    closed = 1.15 * thrust**1.5 / math.sqrt(2.0) + SOLIDITY * 0.012 / 8.0
    assert power == pytest.approx(closed, rel=1e-12)  # rounding


def test_hover_torque_and_power_are_the_designs():
    """Q = 4.73 N m and 842 W (design, section 3) at a thrust equal to the weight."""
    density, radius, speed = 1.225, 0.767, 1700.0 * 2.0 * math.pi / 60.0
    tip_speed = speed * radius
    force = density * math.pi * radius**2 * tip_speed**2
    thrust = 8.01 * 9.8015 / force
    inflow = math.sqrt(0.5 * thrust)
    power = rotor.power(thrust, inflow, 0.0, 0.0, SOLIDITY, 1.15, 0.012)
    assert force * radius * power == pytest.approx(4.73, abs=0.005)  # printed digit
    assert force * tip_speed * power == pytest.approx(842.0, abs=0.5)  # printed digit
