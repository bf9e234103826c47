"""Momentum theory's closed forms, in SI and in the air, where tests/physics has ratios.

Leishman, Principles of Helicopter Aerodynamics, chapter 2: hover, climb, descent, forward flight.
"""

import math

import mujoco
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from helisim.physics import rotor
from helisim.physics.inflow import mass_flow
from helisim.physics.native import installed
from helisim.vehicle.trim import Motion, write_motion
from quasi_steady import inflow_and_thrust

SOLIDITY, SLOPE, NEVER = 0.054, 6.0, 1e3


def solve(pitch, climb=0.0, advance=0.0):
    return inflow_and_thrust(pitch, climb, advance, SOLIDITY, SLOPE, NEVER)


@given(pitch=st.floats(0.03, 0.2), advance=st.floats(0.0, 0.4))
def test_level_flight_is_glauerts_quartic(pitch, advance):
    """At any speed, v^2 = -V^2 / 2 + sqrt(V^4 / 4 + v_h^4), v_h of the same thrust in hover."""
    induced, thrust = solve(pitch, advance=advance)
    hover = 0.5 * thrust
    closed = math.sqrt(-0.5 * advance**2 + math.sqrt(0.25 * advance**4 + hover**2))
    # 1e-15 of the solver; the difference of two terms of mu^2 / 2 loses mu^2 / v^2 of it
    assert induced == pytest.approx(closed, abs=1e-14 * (1.0 + (advance / closed) ** 2))


@given(pitch=st.floats(0.05, 0.2), ratio=st.floats(0.0, 0.28))
def test_slow_descent_stays_on_the_hover_branch(pitch, ratio):
    """Down to 0.28 v_h, v = -V / 2 + sqrt(V^2 / 4 + v_h^2): the root that joins the hover."""
    hover, _ = solve(pitch)
    climb = -ratio * hover
    inflow, thrust = solve(pitch, climb)
    closed = -0.5 * climb + math.sqrt(0.25 * climb**2 + 0.5 * thrust)
    assert inflow - climb == pytest.approx(closed, abs=1e-13)


@given(pitch=st.floats(-0.06, -0.03), climb=st.floats(-0.12, -0.06))
def test_windmill_takes_power_from_the_air(pitch, climb):
    """In fast descent, v = -V / 2 - sqrt(V^2 / 4 - v_h^2), and the air drives the rotor."""
    inflow, thrust = solve(pitch, climb)
    if thrust <= 0.0 or inflow >= 0.0:
        return
    closed = -0.5 * climb - math.sqrt(0.25 * climb**2 - 0.5 * thrust)
    # near V = -2 v_h the square root's argument vanishes and with it half of the digits
    assert inflow - climb == pytest.approx(closed, abs=1e-7)
    assert thrust * inflow < 0.0


def loads(vehicle, motion):
    """Return main rotor thrust (N) and torque (N m) that the vehicle's own sensors report."""
    data = vehicle.hovering()
    write_motion(vehicle.model, data, motion)
    with installed():
        mujoco.mj_forward(vehicle.model, data)
    first = vehicle.model.sensor("rotor").adr[0]
    return data.sensordata[first], data.sensordata[first + 1]


def test_hover_power_of_the_vehicle_is_the_textbooks(jr700):
    """P = kappa T^1.5 / sqrt(2 rho A) + sigma c_d0 / 8 rho A (Omega R)^3, in the air and in SI."""
    own = jr700.parameters
    thrust, torque = loads(jr700, Motion(phi=jr700.trim.phi, theta=jr700.trim.theta))
    area = math.pi * own["main_rotor.radius"] ** 2
    tip = own["main_rotor.speed"] * own["main_rotor.radius"]
    solidity = 2.0 * own["main_rotor.chord"] / (math.pi * own["main_rotor.radius"])
    induced = own["main_rotor.induced_factor"] * thrust**1.5
    induced /= math.sqrt(2.0 * own["air.density"] * area)
    profile = solidity * own["main_rotor.profile_drag"] / 8.0 * own["air.density"] * area * tip**3
    assert torque * own["main_rotor.speed"] == pytest.approx(induced + profile, rel=1e-9)
    # the thrust carries 8.01 kg; tilts of 0.1 rad leave less than 1 % of it
    assert thrust == pytest.approx(8.01 * 9.8015, rel=0.01)


@pytest.mark.parametrize("climb", [-1.0, 2.0, 5.0])
def test_climb_power_of_the_vehicle_is_the_textbooks(jr700, climb):
    """P = T (V + kappa v) + profile, with v the quadratic's root, climbing and sinking slowly."""
    own = jr700.parameters
    thrust, torque = loads(jr700, Motion(w=-climb))
    disc = 2.0 * own["air.density"] * math.pi * own["main_rotor.radius"] ** 2
    climb *= math.cos(jr700.trim.a) * math.cos(jr700.trim.b)  # along the thrust
    induced = -0.5 * climb + math.sqrt(0.25 * climb**2 + thrust / disc)
    _, still = loads(jr700, Motion())
    weight, _ = loads(jr700, Motion())
    ideal = own["main_rotor.induced_factor"] * weight * math.sqrt(weight / disc)
    profile = still * own["main_rotor.speed"] - ideal
    power = thrust * (climb + own["main_rotor.induced_factor"] * induced) + profile
    # the disc leans by 6e-4 against the tail's torque, which counts by its square
    assert torque * own["main_rotor.speed"] == pytest.approx(power, rel=1e-7)


@pytest.mark.parametrize(
    ("ratio", "watts", "within"),
    [(-1.75, 583.0, 1.0), (-2.0, 198.0, 15.0), (-3.0, -371.0, 1.0)],
)
def test_descent_power_of_the_vehicle_is_the_measured_one(jr700, ratio, watts, within):
    """P = T (V + kappa v) + profile at the hover's thrust, in W, v from fit and windmill theory.

    At the windmill's edge the fit has 1.026 v_h where theory has 1: 10 W of the 198.
    """
    own = jr700.parameters
    disc = math.pi * own["main_rotor.radius"] ** 2
    weight = 8.01 * 9.8015
    tip = own["main_rotor.speed"] * own["main_rotor.radius"]
    unit = own["air.density"] * disc * tip**2
    hover = math.sqrt(weight / (2.0 * own["air.density"] * disc)) / tip
    climb = ratio * hover
    induced = brentq(
        lambda v: 2.0 * v * mass_flow(v, climb, 0.0)[0] - weight / unit, 1e-9, 1.0, xtol=1e-15
    )
    solidity = own["main_rotor.blades"] * own["main_rotor.chord"] / (math.pi * 0.767)
    slope = 0.25 * own["main_rotor.lift_slope"] * solidity
    factor, drag = own["main_rotor.induced_factor"], own["main_rotor.profile_drag"]
    thrust = weight / unit
    spent = rotor.losses(thrust, thrust, induced, 0.0, solidity, slope, factor, drag)
    power = climb * thrust + spent.torque
    assert power * unit * tip == pytest.approx(watts, abs=within)
