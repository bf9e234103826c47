"""Momentum theory's closed forms, in SI and in the air, where tests/physics has ratios.

Leishman, Principles of Helicopter Aerodynamics, chapter 2: hover, climb, descent, forward flight.
"""

import math

import mujoco
import pytest

from helisim.physics.native import installed
from helisim.vehicle.trim import Motion, write_motion
from quasi_steady import drag_torque


def loads(vehicle, motion):
    data = vehicle.hovering()
    write_motion(vehicle.model, data, motion)
    with installed():
        mujoco.mj_forward(vehicle.model, data)
    first = vehicle.model.sensor("rotor").adr[0]
    return data.sensordata[first], data.sensordata[first + 1]


def test_hover_power_of_the_vehicle_is_the_textbooks(jr700):
    """P = kappa T^1.5 / sqrt(2 rho A) and the sum of the blades' drag, in the air and in SI."""
    own = jr700.parameters
    thrust, torque = loads(jr700, Motion(phi=jr700.trim.phi, theta=jr700.trim.theta))
    area = math.pi * own["main_rotor.radius"] ** 2
    tip = own["main_rotor.speed"] * own["main_rotor.radius"]
    flow = math.sqrt(thrust / (2.0 * own["air.density"] * area))
    induced = own["main_rotor.induced_factor"] * thrust * flow
    unit = own["air.density"] * area * tip**2
    profile = drag_torque(own, "main_rotor", thrust / unit, flow / tip) * unit * tip
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
    tip = own["main_rotor.speed"] * own["main_rotor.radius"]
    unit, inflows = 0.5 * disc * tip**2, (math.sqrt(weight / disc), climb + induced)
    drag = [
        drag_torque(own, "main_rotor", load / unit, inflow / tip)
        for load, inflow in zip((weight, thrust), inflows)
    ]
    profile += (drag[1] - drag[0]) * unit * tip
    power = thrust * (climb + own["main_rotor.induced_factor"] * induced) + profile
    # the disc leans by 6e-4 against the tail's torque, which counts by its square
    assert torque * own["main_rotor.speed"] == pytest.approx(power, rel=1e-7)
