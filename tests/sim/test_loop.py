"""Inside the loop: the pedal's latency, the integrator's order, the pilot's remnant."""

import copy

import control
import mujoco
import numpy as np
import pytest
from mujoco import rollout

import helisim as hs
import own_laws
from helisim.base.errors import ModelError
from helisim.physics.layout import PARAM, STATE
from helisim.sim import Sweep
from helisim.sim.flight import simulate
from helisim.sim.plan import FlightPlan, Pilot
from helisim.vehicle import Controller, load
from helisim.vehicle.addresses import addresses
from helisim.vehicle.parameters import model_folder

OTHERS = [pytest.param(*one, marks=pytest.mark.slow) for one in ((0.001, "RK4"), (0.002, "Euler"))]


@pytest.mark.parametrize(("axis", "moves"), [("lat", "pq"), ("lon", "qp"), ("ped", "r")])
@pytest.mark.parametrize(("timestep", "integrator"), [(0.002, "RK4"), *OTHERS])
def test_the_sampled_linear_model_is_what_flies(axis, moves, timestep, integrator):
    vehicle = load(timestep=timestep, integrator=integrator)
    excitation = Sweep(
        axis=axis, duration=30.0, amplitude=0.002, leakage=0.0, unsteadiness=0.0, trim_time=2.0
    )
    plan = FlightPlan(excitation=excitation, pilot=Pilot(remnant=0.0))
    truth = next(simulate(vehicle, plan, jobs=1))
    linear = vehicle.linearize("IN2")
    each = round(linear.system.dt / timestep)
    sticks = truth.sticks[::each] - truth.sticks[0]
    ticks = truth.time[::each]
    late = np.interp(ticks - linear.delays["PED"], ticks, sticks[:, 3])
    driven = np.column_stack([sticks[:, :3], late])
    motions = control.forced_response(linear.system, ticks, driven.T).outputs
    for motion in moves:
        found = motions[linear.system.output_labels.index(motion)]
        flown = truth.rates[::each, "pqr".index(motion)]
        # 1 %: what is left is the nonlinearity, which falls with the amplitude
        assert np.std(found - flown) < 0.01 * np.std(flown), motion


def test_remnant_is_what_was_asked(jr700):
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


# Controllers in models: of MuJoCo's own steps, of several helicopters, of other processes.

FAST = hs.Doublet(axis="lat", duration=4.0, trim_time=1.0)


def test_without_a_controller_the_servos_are_the_callers_also_in_a_flight(jr700):
    model, data = copy.copy(jr700.model), jr700.hovering()
    hs.set_controller(model, None)
    where = addresses(model)
    wanted = [0.1, -0.05, 0.02, 0.3]
    with hs.installed():
        for _ in range(100):
            data.ctrl[where.control + 4 : where.control + 8] = wanted
            mujoco.mj_step(model, data)
    assert data.ctrl[where.control + 4 : where.control + 8].tolist() == wanted
    assert data.sensor("servo_command").data.tolist() == wanted
    found = data.act[where.state : where.state + 8 : 2]
    assert found == pytest.approx(wanted, abs=1e-3)  # the servos are there after 0.2 s
    step = hs.Step(axis="ped", amplitude=0.02, trim_time=1.0, duration=2.0, at="servos")
    plan = hs.FlightPlan(excitation=step, pilot=hs.Pilot(remnant=0.0))
    truth = next(simulate(jr700.with_controller(None), plan, jobs=1))
    held = truth.servo_commands[0]
    assert held[3] == jr700.trim.ped
    moved = truth.servo_commands - held
    late = truth.time > 1.0 - 1e-9
    assert np.all(moved[:, :3] == 0.0)
    assert np.all(moved[~late, 3] == 0.0)
    assert moved[late, 3] == pytest.approx(0.02, abs=1e-15)
    assert np.abs(truth.rates[late, 2]).max() > 0.1


def test_a_law_starts_from_zeros_where_a_keyframe_has_other_states(jr700):
    path = model_folder("jr700") / "jr700.xml"
    model = mujoco.MjModel.from_xml_path(str(path))
    started = []

    def law(seen, state):
        return seen.front, seen.left, seen.right, seen.tail

    def reset(seen, state):
        started.append(state.copy())

    hs.set_controller(model, Controller(law, reset=reset))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("hover").id)
    data.act[STATE.gyro_r_integral] = 0.3
    with hs.installed():
        mujoco.mj_step(model, data, 3)
    assert [state.tolist() for state in started] == [[0.0] * 8]


def test_threads_of_rollout_take_turns_in_a_python_law(jr700):
    vehicle = jr700.with_controller(own_laws.attitude_controllers(jr700)[0])
    kind, starts = mujoco.mjtState.mjSTATE_FULLPHYSICS, []
    for k in range(4):
        data = vehicle.hovering()
        data.qvel[3] = 0.1 * k
        starts.append(np.empty(mujoco.mj_stateSize(vehicle.model, kind)))
        mujoco.mj_getState(vehicle.model, data, starts[-1], kind)
    found = []
    for threads in (1, 2):
        with hs.installed():
            states, _ = rollout.rollout(
                [vehicle.model] * 4,
                [mujoco.MjData(vehicle.model) for _ in range(threads)],
                np.array(starts),
                nstep=100,
            )
        found.append(states)
    assert np.array_equal(*found)
    assert not np.array_equal(found[0][0], found[0][1])


def test_states_need_room(jr700):
    def remembers(seen, state):
        state[1:] = state[:-1]
        state[0] = seen.r
        return seen.front, seen.left, seen.right, seen.tail - 1e-6 * state[-1]

    controller = Controller(remembers, states=40)
    model = copy.copy(jr700.model)
    room = model.actuator_actnum[addresses(model).rotor] + 2 * (40 - 8)
    says = rf'has 40 states and the model has room for 8.*actdim="{room}"'
    with pytest.raises(ModelError, match=says):
        hs.set_controller(model, controller)
    vehicle = jr700.with_controller(controller)
    assert vehicle.model.na == jr700.model.na + 2 * (40 - 8)
    record = hs.fly(jr700, FAST, controller=controller, jobs=1)[0]
    assert record.ended == ""
    assert vehicle.visual_model().na == vehicle.model.na
    back = vehicle.with_controller(Controller())
    (one,), (other,) = (hs.fly(flown, FAST, jobs=1) for flown in (back, jr700))
    assert np.array_equal(one.values, other.values)
