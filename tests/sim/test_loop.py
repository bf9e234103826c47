"""Inside the loop: the pedal's latency, the integrator's order, the pilot's remnant."""

import copy
from itertools import pairwise

import control
import mujoco
import numpy as np
import pytest
from scipy.optimize import least_squares

from helisim.physics.layout import PARAM, STATE
from helisim.physics.native import installed
from helisim.records.record import IN1, SERVOS
from helisim.sim import Doublet, Sweep
from helisim.sim.flight import fly, simulate
from helisim.sim.plan import FlightPlan, Pilot
from helisim.sim.recorder import Recorder
from helisim.study.tune import margins
from helisim.vehicle import GyroSettings, load
from helisim.vehicle.trim import Motion, addresses, place, write_motion
from plates import H3_120


@pytest.mark.parametrize(
    ("axis", "motion"),
    [("lat", "p"), ("lon", "q"), ("ped", "r"), ("lat", "q"), ("lon", "p")],
)
@pytest.mark.parametrize(
    ("timestep", "integrator"), [(0.002, "RK4"), (0.001, "RK4"), (0.002, "Euler")]
)
def test_the_sampled_linear_model_is_what_flies(axis, motion, timestep, integrator):
    """Driven by the recorded sticks, the exact linear model moves as the nonlinear flight does."""
    vehicle = load(timestep=timestep, integrator=integrator)
    excitation = Sweep(
        axis=axis, duration=30.0, amplitude=0.002, leakage=0.0, unsteadiness=0.0, trim_time=2.0
    )
    truth = next(
        simulate(vehicle, FlightPlan(excitation=excitation, pilot=Pilot(remnant=0.0)), jobs=1)
    )
    linear = vehicle.linearize("IN2")
    each = round(linear.system.dt / timestep)
    sticks = truth.sticks[::each] - truth.sticks[0]
    ticks = truth.time[::each]
    late = np.interp(ticks - linear.delays["PED"], ticks, sticks[:, 3])
    driven = np.column_stack([sticks[:, :3], late])
    motions = control.forced_response(linear.system, ticks, driven.T).outputs
    found = motions[linear.system.output_labels.index(motion)]
    flown = truth.rates[::each, "pqr".index(motion)]
    # 1 %: what is left is the nonlinearity, which falls with the amplitude
    assert np.std(found - flown) < 0.01 * np.std(flown)


def test_a_pedal_step_arrives_after_its_latency(jr700):
    """The tail does not move before the pedal's latency has passed, and does a period later."""
    data = jr700.hovering()
    where = addresses(jr700.model)
    rows = []
    with installed():
        for _ in range(20):
            data.ctrl[where.control + 3] = 0.1
            mujoco.mj_step(jr700.model, data)
            rows.append([*data.sensor("clock").data, *data.sensor("servo_command").data[3:]])
    time, command = np.array(rows).T
    latency, period = jr700.parameters["gyro.ped_latency"], jr700.parameters["gyro.period"]
    moved = np.abs(command - jr700.trim.ped) > 1e-6
    # the history is linear between samples: the ramp up to a step starts one sample early
    assert latency - period <= time[moved][0] <= latency + 1e-9
    settled = np.abs(command - jr700.trim.ped) > 0.1 * 2.68 * 0.8646 * 0.999
    assert latency <= time[settled][0] <= latency + period


def test_servo_commands_are_held_between_the_gyros_ticks():
    """With a step of half the gyro's period, each command stays for two steps."""
    vehicle = load(timestep=0.001)
    truth = next(simulate(vehicle, Sweep(axis="lat", duration=13.0), jobs=1))
    pairs = truth.servo_commands[: 2 * (len(truth.time) // 2)].reshape(-1, 2, 4)
    assert np.array_equal(pairs[:, 0], pairs[:, 1])
    assert np.unique(pairs[:, 0, 0]).size > 0.9 * len(pairs)


def test_rate_mode_does_not_hold_the_heading():
    """Without heading lock a disturbed heading stays off, with it the gyro brings it back."""
    turned = {}
    for lock in (0.0, 1.0):
        vehicle = load(parameters={"gyro.heading_lock": lock})
        data = vehicle.hovering()
        with installed():
            mujoco.mj_step(vehicle.model, data, 200)
            data.qvel[5] += 0.5
            mujoco.mj_step(vehicle.model, data, 1500)
        turned[lock] = abs(2.0 * np.arctan2(data.qpos[6], data.qpos[3]))
    # r decays over 1/(k_p k_a N_ped) = 52 ms: 0.5 rad/s turns by 0.026 rad; locked, by nothing
    assert turned[0.0] > 0.01
    assert turned[1.0] < 0.1 * turned[0.0]


def final_state(timestep, *, pilot):
    """Fly 0.6 s from a small disturbance; return every state, not the rates kept of them."""
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
    kept = addresses(model).state + np.r_[STATE.flap_a_rate : STATE.governor_rate + 1]
    return np.concatenate([data.qpos, data.qvel, np.delete(data.act, kept)])


def convergence(timesteps, *, pilot):
    states = [final_state(timestep, pilot=pilot) for timestep in timesteps]
    errors = [np.linalg.norm(one - two) for one, two in pairwise(states)]
    return errors[0] / errors[1]


def test_integration_is_fourth_order():
    """Halving the step divides the error of servos, rotor and body by 2^4; the gyro has none."""
    ratio = convergence((0.001, 0.0005, 0.00025), pilot=False)
    # 2^4 = 16 in the limit; of the 2 ms filter's fifth order, up to 2^5, some is left (21)
    assert 14.0 < ratio < 26.0


def test_integration_with_the_pilot_is_fourth_order():
    """The pilot's sticks are held between ticks, so they cost no order: 2^4 and more."""
    ratio = convergence((0.001, 0.0005, 0.00025), pilot=True)
    assert 14.0 < ratio < 26.0  # as without the pilot


SWEPT = ("sticks", "servo_commands", "servo_positions", "flapping", "rotor", "rates")
SWEPT += ("attitudes", "velocities", "specific_forces", "positions")


def swept(axis, timestep, integrator):
    """Return what truly happens in a short sweep, at the gyro's ticks, by name."""
    vehicle = load(timestep=timestep, integrator=integrator)
    sweep = Sweep(axis=axis, duration=25.0, trim_time=2.0)
    truth = next(simulate(vehicle, sweep, seed=4, jobs=1)).at_ticks()
    return {name: getattr(truth, name) for name in SWEPT}


@pytest.mark.parametrize("axis", ["lat", "ped"])
def test_one_evaluation_a_step_flies_as_four(axis):
    """With Euler's staggered steps every signal of a sweep converges to that of fine RK4 steps.

    Of first order is left half a step of the airframe's own damping, of about 1/s, and of the
    pilot's attitude, held at about 1 rad/s: 0.1 % each at 2 ms, which may add up. Steps that
    are not staggered would damp roll and pitch by 2 to 4 % less.
    """
    fine = swept(axis, 0.0005, "RK4")
    errors = []
    for step, most in ((0.002, 0.002), (0.001, 0.001)):
        coarse = swept(axis, step, "Euler")
        error = {name: np.std(coarse[name] - fine[name], axis=0) for name in SWEPT}
        for name in SWEPT:
            assert error[name].max() < most * np.std(fine[name], axis=0).max(), name
        errors.append(np.linalg.norm(error["rates"]))
    assert 1.9 < errors[0] / errors[1] < 4.0


def test_remnant_is_what_was_asked(jr700):
    """The hand's unrest has the rms of the pilot, on every stick, on top of the holding."""
    steady, human = Pilot(remnant=0.0), Pilot(remnant=0.01)
    excitation = Sweep(axis="col", duration=40.0, amplitude=1e-6, band=(0.3, 1.0))
    truth = next(simulate(jr700, FlightPlan(excitation=excitation, pilot=human), jobs=1))
    quiet = next(simulate(jr700, FlightPlan(excitation=excitation, pilot=steady), jobs=1))
    assert np.abs(quiet.sticks[:, 1:]).max() < 1e-4
    # the fast part alone: the holding moves well below 5 rad/s
    fast = np.diff(truth.sticks[:: round(0.1 / truth.timestep)], axis=0)
    # knots 0.1 s apart are independent with variance 1.5 x remnant^2: var of a difference 3
    expected = np.sqrt(3.0) * 0.01
    # 400 differences: relative standard error 5 %; 3.5 sigma, and the holding's own part
    assert np.std(fast, axis=0) == pytest.approx(expected, rel=0.2)
    assert jr700.model.actuator_user[addresses(jr700.model).rotor, PARAM.pilot_on] == 0.0


# Three swashplate servos and the tail servo in flight: their limits, and what is recorded


STEP = 0.002


@pytest.fixture
def commanded(jr700):
    """Return the four servos' positions in free flight, gyro off, after a command, (n, 4)."""

    def fly_it(commands, seconds):
        model = copy.copy(jr700.model)
        where = addresses(model)
        model.actuator_user[where.rotor, PARAM.gyro_on] = 0.0
        data = jr700.hovering()
        data.ctrl[where.control + 4 : where.control + 8] = commands
        positions = []
        with installed():
            for _ in range(round(seconds / STEP)):
                mujoco.mj_step(model, data)
                positions.append(data.sensor("servo_position").data.copy())
        return np.array(positions)

    return fly_it


def test_no_servo_is_faster_than_its_rate_limit(jr700, commanded):
    """Sent from the hover to full travel, all four run at the limit, 10 of unit travel a second."""
    positions = commanded([0.7, -0.7, 0.7, -0.7], 0.2)
    speed = np.abs(np.diff(positions, axis=0)) / STEP
    limit = jr700.parameters["servo.rate_limit"]
    # RK4 samples the limited speed inside a step: rounding only
    assert speed.max(axis=0) == pytest.approx([limit] * 4, rel=1e-9)
    running = np.count_nonzero(speed > 0.999 * limit, axis=0) * STEP
    # of 0.7 / 10 s = 70 ms, what speeding up and settling leave
    assert np.all(running > 0.04)
    assert np.abs(positions[-1]) == pytest.approx([0.7] * 4, abs=1e-3)  # 0.1 s of settling


def test_no_servo_goes_beyond_its_travel(jr700, commanded):
    """Commands beyond the travel, as collective and cyclic together may be, end at it."""
    travel = jr700.parameters["servo.travel"]
    positions = commanded([1.0, -1.0, 0.9, -0.9], 0.4)
    # the swashplate's servos, damping 0.7, overshoot by 4.6 %; the tail servo, 1.0, does not
    assert np.abs(positions[:, :3]).max() < 1.05 * travel
    assert np.abs(positions[:, 3]).max() <= travel * (1.0 + 1e-9)
    assert positions[-1] == pytest.approx(travel * np.array([1, -1, 1, -1]), abs=1e-3)


def test_a_limited_swashplate_moves_less_than_asked(commanded):
    """Full collective and full cyclic at once: the front servo stops, so the swashplate does."""
    asked = H3_120.mix(0.4, 0.5, 0.0)
    assert asked[0] == pytest.approx(0.9)
    positions = commanded([*asked, 0.0], 0.4)
    col, lon, lat = H3_120.unmix(*positions[-1, :3])
    # the front is 0.15 short: a third of it in collective, two thirds in longitudinal
    assert (col, lon, lat) == pytest.approx((0.4 - 0.05, 0.5 - 0.1, 0.0), abs=1e-3)


def test_four_servo_signals_are_recorded_and_give_in1(jr700):
    """Also where limits are met: IN1 is of the commands, as the paper recomputes it."""
    kept = Recorder(latency={}, antialias_hz=49.0)
    record = fly(
        jr700,
        FlightPlan(excitation=Doublet(axis="ped", amplitude=0.3, width=0.2), recorder=kept),
        jobs=1,
    )[0]
    assert set(SERVOS) <= set(record.names)
    front, left, right, tail = record.select(SERVOS).T
    recomputed = np.column_stack([*H3_120.unmix(front, left, right), tail])
    assert record.select(IN1) == pytest.approx(recomputed, abs=1e-15)  # rounding
    assert np.abs(record["ped"]).max() > 0.45  # the gyro's own limit of 0.5, filtered


# In flight: an integral that is held while its servo command is saturated, and one that isn't


START = 0.1
"""s, at which the stick goes to its stop."""


def flown(jr700, stick, hold, *, anti_windup):
    """Hold one stick at its stop, let go, fly on for 1 s; return time, rates and cyclic, pedal."""
    # the whole travel of the cyclic sticks commands more than full cyclic can give
    settings = GyroSettings(aileron_rate=1.0, elevator_rate=1.0).as_parameters()
    vehicle = jr700.with_settings({**settings, "gyro.anti_windup": float(anti_windup)})
    data, control = vehicle.hovering(), addresses(vehicle.model).control
    rows = []
    with installed():
        for _ in range(round((START + hold + 1.0) / vehicle.model.opt.timestep)):
            data.ctrl[control + stick] = 0.5 if START <= data.time < START + hold else 0.0
            mujoco.mj_step(vehicle.model, data)
            commands = data.sensor("servo_command").data
            swash = H3_120.unmix(*commands[:3])
            rates = data.sensor("imu_gyro").data * [1.0, -1.0, -1.0]
            rows.append([*data.sensor("clock").data, *rates, swash[2], swash[1], commands[3]])
    time, p, q, r, lat, lon, ped = np.array(rows).T
    return time, {"p": p, "q": q, "r": r}, {"lat": lat, "lon": lon, "ped": ped}


def test_a_held_pedal_overshoots_little_with_anti_windup(jr700):
    """Full pedal saturates the tail servo; what the integral gathers meanwhile is overshoot."""
    asked = 0.5 * jr700.parameters["gyro.k_delta"] / jr700.parameters["gyro.k_a"]
    over, under = {}, {}
    for anti_windup in (True, False):
        time, rates, commands = flown(jr700, 3, 0.3, anti_windup=anti_windup)
        assert np.count_nonzero(commands["ped"] >= 0.5) > 20  # 40 ms at the stop
        assert np.abs(commands["ped"]).max() <= 0.5
        let_go = time > START + 0.3
        over[anti_windup] = rates["r"][~let_go].max() - asked
        under[anti_windup] = -rates["r"][let_go].min()
    # the loop's own overshoot of a step that stays within the limits is a quarter (see below)
    assert over[True] < 0.25 * asked < over[False]
    assert under[True] < 0.25 * asked < under[False]


def test_the_overshoot_within_the_limits(jr700):
    """A pedal step that never saturates overshoots by a quarter, with anti-windup or without."""
    peaks = []
    for anti_windup in (1.0, 0.0):
        vehicle = jr700.with_settings({"gyro.anti_windup": anti_windup})
        data, control = vehicle.hovering(), addresses(vehicle.model).control
        rates = []
        with installed():
            for _ in range(250):
                data.ctrl[control + 3] = 0.02
                mujoco.mj_step(vehicle.model, data)
                rates.append(-data.sensor("imu_gyro").data[2])
        peaks.append(max(rates) / (0.02 * vehicle.parameters["gyro.k_delta"]))
    assert peaks[0] == peaks[1]
    assert peaks[0] * jr700.parameters["gyro.k_a"] == pytest.approx(1.25, abs=0.03)


@pytest.mark.parametrize(("stick", "rate", "command"), [(2, "p", "lat"), (1, "q", "lon")])
def test_recovery_does_not_depend_on_how_long_the_cyclic_was_saturated(jr700, stick, rate, command):
    """Once let go, the angle still swept is the same after 0.2 and 0.5 s; without, it grows."""
    swept = {}
    for anti_windup in (True, False):
        for hold in (0.2, 0.5):
            time, rates, commands = flown(jr700, stick, hold, anti_windup=anti_windup)
            assert np.count_nonzero(commands[command] >= 0.5 - 1e-9) > 20
            after = (time > START + hold) & (time < START + hold + 0.5)
            swept[anti_windup, hold] = np.sum(rates[rate][after]) * 0.002
    # the attitude meanwhile differs by more than a radian, and with it gravity: 5 %
    assert swept[True, 0.5] == pytest.approx(swept[True, 0.2], rel=0.05)
    assert swept[False, 0.5] > 1.3 * swept[False, 0.2]
    # and after the longer time it is still less than without after the shorter
    assert swept[True, 0.5] < swept[False, 0.2]


# With all of tau_r_base inside the yaw gyro's loop the helicopter can't be flown


LATE = {"gyro.period": 0.001, "gyro.latency": 0.041, "gyro.lead": 0.0}
"""41 ms in the gyro, 0.5 ms of hold and 9 ms of servo: 50.5 ms."""


@pytest.fixture(scope="module")
def vehicle():
    return load(parameters=LATE, timestep=0.001)


@pytest.fixture(scope="module")
def growth(vehicle):
    """Unstable pole of the exact linear model, rad/s."""
    system = vehicle.linearize("IN2").system
    poles = system.poles()
    inside = np.log(poles[np.abs(poles) > 0.5].astype(complex)) / system.dt
    return max(inside, key=lambda pole: pole.real)


@pytest.fixture(scope="module")
def flight(vehicle):
    """4.5 s of a hover, kicked by a milliradian a second: time, r, tail servo command."""
    data = vehicle.hovering()
    data.qvel[5] += 1e-3
    rows = []
    with installed():
        for _ in range(4500):
            mujoco.mj_step(vehicle.model, data)
            rate, command = data.sensor("imu_gyro").data[2], data.sensor("servo_command").data[3]
            rows.append((data.time, rate, command))
    return np.array(rows).T


def test_the_whole_base_delay_is_in_this_loop(vehicle):
    """Servo, hold and latency are the paper's 50.5 ms, and the phase margin is negative."""
    total = vehicle.servo_delay("ped") + vehicle.parameters["gyro.latency"]
    assert total == pytest.approx(0.0505, abs=1e-12)
    assert margins(vehicle, "ped").phase_deg < -15.0  # as pure delays, by hand: -20


def test_the_linear_model_grows(growth):
    """The pole is that of first-order base, PI and 50.5 ms of delay, +4.1 +- 22.4j."""
    # 5 % of its size: a servo turns less than the delay it is equal to at low frequency
    assert abs(growth - (4.1 + 22.4j)) < 0.05 * 22.8


def test_a_small_disturbance_grows_as_the_pole_says(flight, growth):
    """While it is small, the nonlinear flight swings and grows by the unstable pole."""
    time, rate, command = flight
    small = (time > 0.4) & (time < 1.0)  # other modes have died, and limits are far
    assert np.abs(command[small]).max() < 0.05

    def left(x):
        swing = np.exp(np.outer(time[small], [complex(*x), complex(*x).conjugate()]))
        size, *_ = np.linalg.lstsq(swing, rate[small].astype(complex), rcond=None)
        return rate[small] - (swing @ size).real

    found = least_squares(left, [1.0, 20.0]).x
    # 0.4 % measured: the tail rotor's curvature at 0.06 rad/s
    assert found == pytest.approx([growth.real, growth.imag], rel=0.01)


def test_it_ends_in_a_limit_cycle_between_the_servos_limits(flight, growth):
    """The command runs from limit to limit, the rate stays finite and keeps its size."""
    time, rate, command = flight
    assert np.all(np.isfinite(rate))
    first, second = (np.abs(rate[(time > start) & (time <= start + 1.0)]) for start in (2.5, 3.5))
    assert second.max() == pytest.approx(first.max(), rel=0.02)  # 0.3 % measured
    assert first.max() > 1.5  # rad/s, from a milliradian a second
    last = time > 2.5
    assert command[last].max() == 0.5
    assert command[last].min() == -0.5
    crossings = time[last][np.flatnonzero(np.diff(np.sign(rate[last])) > 0.0)]
    omega = 2.0 * np.pi / np.mean(np.diff(crossings))
    # a saturated loop gains less, so it swings where the phase alone closes it: below the pole
    assert 0.8 * growth.imag < omega < growth.imag
