"""Inside the loop: the pedal's latency, the integrator's order, the pilot's remnant."""

import copy
from itertools import pairwise

import mujoco
import numpy as np
import pytest
from scipy.signal import lsim

from helisim.physics.layout import PARAM
from helisim.physics.native import installed
from helisim.sim.excitation import Sweep
from helisim.sim.fly import simulate
from helisim.sim.pilot import Pilot
from helisim.vehicle import load
from helisim.vehicle.motion import Motion, addresses, write_motion
from helisim.vehicle.trim import place

LATENCY = 0.022
"""s, parameters.toml, gyro.ped_latency."""


def tail_command(parameters, time, stick, r, delay):
    """Return what eq. (7), with its lead, asks of the tail for a stick that is `delay` late."""
    late = np.interp(time - delay, time, stick)
    fast = parameters["gyro.lead_filter"]
    slow = parameters["gyro.lead"] + fast
    _, led, _ = lsim(([slow, 1.0], [fast, 1.0]), r, time, X0=[r[0] * fast])
    error = parameters["gyro.k_delta"] * late - parameters["gyro.k_a"] * led
    step = time[1] - time[0]
    integral = np.concatenate([[0.0], np.cumsum(0.5 * step * (error[1:] + error[:-1]))])
    return parameters["gyro.k_p"] * error + parameters["gyro.k_i"] * integral


def apparent_delay(parameters, time, stick, r, command):
    """Return the delay of the stick that explains the command best, s: the parabola's vertex."""
    offsets = np.array([-0.002, 0.0, 0.002])
    misses = [
        np.mean((tail_command(parameters, time, stick, r, LATENCY + d) - command) ** 2)
        for d in offsets
    ]
    curve = np.polyfit(offsets, misses, 2)
    return LATENCY - curve[1] / (2.0 * curve[0])


@pytest.mark.parametrize("integrator", ["RK4", "Euler"])
@pytest.mark.parametrize("timestep", [0.002, 0.001])
def test_pedal_reaches_the_gyro_22_ms_late(timestep, integrator):
    """The tail follows the pilot's pedal with the latency, to a tenth of a millisecond."""
    vehicle = load(timestep=timestep)
    vehicle.model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    excitation = Sweep(axis="ped", duration=16.0, trim_time=2.0, unsteadiness=0.0)
    truth = next(simulate(vehicle, excitation, pilot=Pilot(remnant=0.0), jobs=1))
    found = apparent_delay(
        vehicle.parameters,
        truth.time,
        truth.sticks[:, 3],
        truth.rates[:, 2],
        truth.servo_commands[:, 3] - vehicle.trim.ped,
    )
    # Euler's integral of the error is a rectangle's: half a step of 1/k_i's share
    bound = 1e-4 if integrator == "RK4" else 5e-4
    assert found == pytest.approx(LATENCY, abs=bound)


@pytest.mark.parametrize("timestep", [0.002, 0.001])
def test_users_pedal_reaches_the_gyro_22_ms_late(timestep):
    """With the pilot off, a pedal that the user moves before each step is as late."""
    vehicle = load(timestep=timestep)
    data = vehicle.hovering()
    where = addresses(vehicle.model)
    rows = []
    with installed():
        for _ in range(round(12.0 / timestep)):
            phase = 0.8 * data.time + 1.2 * data.time**2
            data.ctrl[where.control + 3] = 0.05 * np.sin(phase)
            mujoco.mj_step(vehicle.model, data)
            rows.append([*data.sensor("clock").data, *data.sensor("stick").data[3:]])
            rows[-1] += [*data.sensor("servo_command").data[3:], -data.sensor("imu_gyro").data[2]]
    time, stick, command, r = np.array(rows).T
    found = apparent_delay(vehicle.parameters, time, stick, r, command - vehicle.trim.ped)
    assert found == pytest.approx(LATENCY, abs=1e-4)


def test_pedal_step_arrives_at_its_time(jr700):
    """Nothing moves the tail before 22 ms have passed, and something does one step later."""
    data = jr700.hovering()
    where = addresses(jr700.model)
    rows = []
    with installed():
        for _ in range(20):
            data.ctrl[where.control + 3] = 0.1
            mujoco.mj_step(jr700.model, data)
            rows.append([*data.sensor("clock").data, *data.sensor("servo_command").data[3:]])
    time, command = np.array(rows).T
    moved = np.abs(command - jr700.trim.ped) > 1e-6
    # the history is linear between samples: the ramp up to a step starts one sample early
    assert time[moved][0] == pytest.approx(LATENCY, abs=0.0021)
    settled = np.abs(command - jr700.trim.ped) > 0.1 * 2.68 * 0.8646 * 0.999
    assert time[settled][0] == pytest.approx(LATENCY, abs=1e-9)


def final_state(timestep, *, pilot):
    """Fly 0.6 s from a small disturbance; return every state."""
    vehicle = load(timestep=timestep)
    model = copy.copy(vehicle.model)
    if pilot:
        numbers = model.actuator_user[addresses(model).rotor]
        Pilot(remnant=0.0).write(numbers, vehicle, seed=1, height=10.0)
    data = mujoco.MjData(model)
    place(model, data, vehicle.trim)
    small = Motion(u=0.05, v=0.03, w=-0.02, p=0.05, q=-0.03, r=0.04, phi=vehicle.trim.phi, down=-10)
    write_motion(model, data, small)
    with installed():
        for _ in range(round(0.6 / timestep)):
            mujoco.mj_step(model, data)
    return np.concatenate([data.qpos, data.qvel, data.act])


def convergence(timesteps, *, pilot):
    states = [final_state(timestep, pilot=pilot) for timestep in timesteps]
    errors = [np.linalg.norm(one - two) for one, two in pairwise(states)]
    return errors[0] / errors[1]


def test_integration_is_fourth_order():
    """Halving the step divides the error of gyro, servos, rotor and body by 2^4 and more."""
    ratio = convergence((0.001, 0.0005, 0.00025), pilot=False)
    # 2^4 = 16 in the limit; of the 2 ms filter's fifth order, up to 2^5, some is left (21)
    assert 14.0 < ratio < 26.0


def test_integration_with_the_delay_line_is_second_order():
    """With the pilot's pedal in the loop, linear interpolation of its delay rules: 2^2."""
    ratio = convergence((0.001, 0.0005, 0.00025), pilot=True)
    # 2^2 in the limit; what a sample finds between its neighbours differs with the step
    assert 3.4 < ratio < 4.6


def test_remnant_is_what_was_asked(jr700):
    """The hand's unrest has the rms of the pilot, on every stick, on top of the holding."""
    still, human = Pilot(remnant=0.0), Pilot(remnant=0.01)
    excitation = Sweep(axis="col", duration=40.0, amplitude=1e-6, band=(0.3, 1.0))
    truth = next(simulate(jr700, excitation, pilot=human, jobs=1))
    quiet = next(simulate(jr700, excitation, pilot=still, jobs=1))
    assert np.abs(quiet.sticks[:, 1:]).max() < 1e-4
    # the fast part alone: the holding moves well below 5 rad/s
    fast = np.diff(truth.sticks[:: round(0.1 / truth.timestep)], axis=0)
    # knots 0.1 s apart are independent with variance 1.5 x remnant^2: var of a difference 3
    expected = np.sqrt(3.0) * 0.01
    # 400 differences: relative standard error 5 %; 3.5 sigma, and the holding's own part
    assert np.std(fast, axis=0) == pytest.approx(expected, rel=0.2)
    assert jr700.model.actuator_user[addresses(jr700.model).rotor, PARAM.pilot_on] == 0.0
