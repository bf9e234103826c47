"""Blade elements, stall and power against closed forms."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from helisim.physics import rotor
from helisim.physics.inflow import mass_flow

SOLIDITY = 2 * 0.065 / (math.pi * 0.767)
SLOPE = 6.0
STALL = 0.18
NEVER = 1e3
"""A stall limit that no thrust reaches."""

ROUNDING = 5e-15
"""Newton ends quadratically, after a last step below 1e-8: what is left is a few roundings of
terms below 1 (3.2e-15 is the worst of 200000 random cases)."""

pitches = st.floats(-0.3, 0.45)
climbs = st.floats(-0.3, 0.3)
advances = st.floats(0.0, 0.4)


def solve(pitch, climb=0.0, advance=0.0, *, stall=STALL, nearness=0.0):
    return rotor.inflow_and_thrust(pitch, climb, advance, SOLIDITY, SLOPE, stall, nearness)


def loading(pitch, inflow, advance, stall=STALL):
    linear = rotor.blade_element_thrust(pitch, inflow, advance, SOLIDITY, SLOPE)
    return rotor.soft_limit(linear, stall * SOLIDITY, 0.7)


@given(pitch=st.floats(0.03, 0.25))
def test_hover_inflow_is_the_closed_form(pitch):
    """In hover, blade elements and momentum meet at the root of one quadratic."""
    inflow, thrust = solve(pitch, stall=NEVER)
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
    inflow, thrust = solve(pitch, climb, stall=NEVER)
    if thrust <= 0.0:
        return
    closed = -0.5 * climb + math.sqrt(0.25 * climb**2 + 0.5 * thrust)
    # 1e-15 in lambda, which may be a small difference of larger numbers
    assert inflow - climb == pytest.approx(closed, abs=2e-14)


@pytest.mark.parametrize("advance", [0.2, 0.4, 0.8])
def test_fast_forward_flight_is_a_wing(advance):
    """At speed, v_i tends to T / (2 rho A V): CT / (2 mu) in ratios."""
    inflow, thrust = solve(0.08, advance=advance, stall=NEVER)
    # sqrt(mu^2 + l^2) = mu (1 + l^2 / 2 mu^2 - ...)
    assert inflow == pytest.approx(thrust / (2.0 * advance), rel=0.51 * (inflow / advance) ** 2)
    assert inflow < thrust / (2.0 * advance)


@given(pitch=pitches, climb=climbs, advance=advances)
def test_blade_elements_and_momentum_meet(pitch, climb, advance):
    """Both thrusts agree to rounding in climb, descent, negative thrust and stall."""
    inflow, thrust = solve(pitch, climb, advance)
    flow, _ = mass_flow(inflow - climb, climb, advance)
    assert 2.0 * (inflow - climb) * flow - thrust == pytest.approx(0.0, abs=ROUNDING)
    # what cancels in the difference are terms of the size of the pitch
    assert thrust == pytest.approx(loading(pitch, inflow, advance), abs=ROUNDING)
    assert abs(thrust) <= STALL * SOLIDITY


@given(pitch=pitches, climb=climbs, advance=advances)
def test_more_collective_is_more_thrust(pitch, climb, advance):
    """Thrust grows with collective, in climb, ring and windmill."""
    _, less = solve(pitch, climb, advance)
    _, more = solve(pitch + 1e-3, climb, advance)
    # deep in stall tanh is flat: rounding
    assert more > less or (abs(less) > 0.99 * STALL * SOLIDITY and more >= less - 1e-15)


@given(pitch=pitches, climb=climbs, advance=advances, nearness=st.floats(0.0, 0.4))
def test_upside_down_all_signs_change(pitch, climb, advance, nearness):
    """Pitch and climb reversed, the rotor pulls the other way, to the bit."""
    inflow, thrust = solve(pitch, climb, advance, nearness=nearness)
    assert solve(-pitch, -climb, advance, nearness=nearness) == (-inflow, -thrust)


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
