"""NASA/NESC check cases 1 to 3, and what helisim adds to a falling body, against closed forms.

The digits are SIM 4's: of the report's simulations the one that integrates Euler's equations to
all that it prints (an independent integration here says so). How they were read: nesc.py.
"""

import math

import mujoco
import nesc
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from helisim.physics.native import installed
from helisim.vehicle import load

ALTITUDE, VELOCITY = slice(0, 1), slice(1, 3)
ANGLES, RATES = slice(3, 6), slice(6, 9)


@pytest.fixture(scope="module")
def differences(jr700):
    """Return, case by case, what was flown less what is printed."""
    found = {}
    for case in nesc.CASES:
        printed = nesc.digits(case)
        rows = nesc.drop(jr700, case, list(printed))
        found[case] = np.abs(rows - np.array(list(printed.values())))
    return found


def spun(time):
    """Return p, q, r of the brick after a time, deg/s, by an independent integration."""
    inertia = np.array(nesc.CASES[2].inertia)
    solution = solve_ivp(
        lambda _, rate: np.cross(inertia * rate, rate) / inertia,
        (0.0, time),
        nesc.CASES[2].rates,
        method="DOP853",
        rtol=1e-13,
        atol=1e-15,
    )
    return np.degrees(solution.y[:, -1])


@pytest.mark.parametrize("case", nesc.CASES)
def test_falls_as_printed(differences, case):
    """A drop of 4.4 km: altitude to the last printed digit but one, velocity likewise."""
    # 12 digits: half a unit of the last is 5e-8 ft, and the start's radius (2.1e7 ft) rounds
    # to 4e-9 ft in each of 300 recorded steps of the report's simulation
    assert np.max(differences[case][:, ALTITUDE]) < 5e-7
    assert np.max(differences[case][:, VELOCITY]) < 5e-9


@pytest.mark.parametrize(
    ("case", "angle", "rate"),
    [
        # no moment: no rate, and the horizon turns by 15 degrees an hour; 12 digits of 0.1 degree
        (1, 1e-11, 1e-11),
        # Euler's equations, 30 s and more than two turns. Half a unit of the last of 12 digits is
        # 5e-10 deg of 150; the rest is rounding in 15000 steps of either side
        (2, 2e-8, 2e-9),
    ],
)
def test_turns_as_printed(differences, case, angle, rate):
    """Attitude and rates of what no air damps."""
    assert np.max(differences[case][:, ANGLES]) < angle
    assert np.max(differences[case][:, RATES]) < rate


def test_damped_brick_stops_as_printed(differences):
    """Moments that grow with airspeed and rate, through the hook of the helicopter's air loads.

    The report prints the lengths that the damping is made of to 1e-5 (0.33333 ft squared, times
    0.22222 sq ft): 3e-5 of the damping, which turns by about 160 degrees before it has stopped.
    """
    assert np.max(differences[3][:, ANGLES]) < 3e-5 * 160.0
    assert np.max(differences[3][:, RATES]) < 3e-5 * 30.0


def test_error_falls_with_the_fourth_power_of_the_step(jr700):
    """Halving the time step of the helicopter's integrator divides its error by sixteen."""
    errors = []
    for step in (0.2, 0.1):
        (row,) = nesc.drop(jr700, 2, [10.0], timestep=step)
        errors.append(np.linalg.norm(row[RATES] - spun(10.0)))
    # order 4 within a tenth: the next order is 20 % of a step of 0.1 rad at most
    assert math.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.4)


def test_helicopter_with_stopped_rotors_falls_to_its_terminal_speed():
    """The vehicle's own drag: w = v_t tanh(g t / v_t), v_t^2 = 2 m g / (rho S)."""
    vehicle = load("jr700", parameters={"airframe.drag_area_z": 0.5})
    model, data = vehicle.model, mujoco.MjData(vehicle.model)
    gravity, area = 9.8015, 0.5
    terminal = math.sqrt(2.0 * 8.01 * gravity / (1.225 * area))
    with installed():
        for _ in range(1500):
            mujoco.mj_step(model, data)
    expected = terminal * math.tanh(gravity * data.time / terminal)
    # fourth order: (g h / v_t)^4 is 1e-12; rounding of 1500 steps
    assert -data.qvel[2] == pytest.approx(expected, rel=1e-10)
    assert expected > 0.95 * terminal
