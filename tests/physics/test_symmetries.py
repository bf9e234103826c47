"""Whole evaluations: what no place, heading, hand or steady wind changes."""

import copy

import mujoco
import numpy as np
import pytest
from mujoco import rollout
from mujoco.batch import Batch

from helisim.physics.layout import PARAM, STATE, SWEEP
from helisim.physics.native import installed
from helisim.vehicle import load
from helisim.vehicle.addresses import addresses
from helisim.vehicle.assembly import assemble
from helisim.vehicle.trim import Motion, place, rotation_matrix, write_motion
from mirror import mirrored, mirrored_parts
from tabled import rows

FRD = np.array([1.0, -1.0, -1.0])
RICH = dict(rows(globals(), "RICH"))
"""What the JR700 lacks, and a real one may have."""
MOVING = {"drive.governor": 1.0, "main_rotor.inflow": 1.0}
WIND = (3.0, -2.0, 0.5)
SWAPPED = {"left": "right", "right": "left"}
ODD = {"tail", "b", "s", "p", "r", "v"}
"""Parts of the names of states that change sign in the mirror."""


def models_of(vehicle, parameters):
    own = vehicle.parameters.replace({**RICH, **parameters})
    models = assemble("jr700", own), assemble("jr700", mirrored(own))
    mirrored_parts(models[1])
    return models


def felt(model, seed, *, hand=1.0, heading=0.0, north=0.0, wind=(0.0, 0.0, 0.0), air=1.0):
    """Return the body's accelerations in its axes, the states' rates by name, and the sensors.

    A random moment, the same whatever is seen from; `wind`, north-east-down, takes it along.
    """
    rng, where, data = np.random.default_rng(seed), addresses(model), mujoco.MjData(model)
    numbers = model.actuator_user[where.rotor]
    numbers[[PARAM.turbulence_on, PARAM.turbulence_span]] = air, 1.5
    numbers[[PARAM.turbulence_cosine, PARAM.turbulence_sine]] = np.cos(heading), np.sin(heading)
    numbers[PARAM.turbulence_lag_u : PARAM.turbulence_lag_p + 1] = 3.0, 2.0, 2.5, 1.5
    u, v, w, p, q, r, phi, theta, psi = rng.uniform(-1.0, 1.0, 9) * [9, 3, 3, 1, 1, 1, 0.4, 0.4, 3]
    attitude = {"phi": hand * phi, "theta": theta, "psi": hand * psi + heading}
    states = rng.uniform(-0.1, 0.1, len(STATE))
    drift = rotation_matrix(**attitude).T @ wind
    velocity = dict(zip("uvw", np.array([u, hand * v, w]) + drift))
    turn = {"p": hand * p, "q": q, "r": hand * r}
    write_motion(model, data, Motion(north=north, down=-1.0, **velocity, **turn, **attitude))
    model.opt.wind[:] = wind * FRD
    for name, at in zip(STATE._fields, np.arange(STATE.feels_x) + where.state):
        parts = name.split("_")
        namesake = "_".join(SWAPPED.get(part, part) for part in parts) if hand < 0.0 else name
        data.act[at] = states[STATE._fields.index(namesake)] * (hand if ODD & set(parts) else 1.0)
    data.act[where.state + np.array([STATE.inflow_0, STATE.speed, STATE.engine])] += 4.0, 0.95, 0.5
    data.ctrl[where.control + 8] = 1.0
    with installed():
        mujoco.mj_forward(model, data)
    matrix = rotation_matrix(**attitude)
    accelerations = np.concatenate([matrix.T @ (data.qacc[:3] * FRD), data.qacc[3:6] * FRD])
    rates = dict(zip(STATE._fields[: STATE.feels_x], data.act_dot[where.state :]))
    return accelerations, rates, data.sensordata[model.sensor("imu_gyro").adr[0] :], data


@pytest.mark.parametrize("integrator", ["RK4", "EULER"])
@pytest.mark.parametrize("parameters", [{}, MOVING])
@pytest.mark.parametrize("seed", range(3))
def test_a_mirrored_moment_is_the_mirror_image(jr700, parameters, seed, integrator):
    """Left for right, and the rotor's other way round: forces, tilt, inflow, drive and air."""
    seen = []
    for model, hand in zip(models_of(jr700, parameters), (1.0, -1.0)):
        model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
        seen.append(felt(model, seed, hand=hand)[:2])
    (one, rates), (other, other_rates) = seen
    # rounding of 1e2 m/s^2 and 1e3 rad/s^2, and the solver's
    assert other == pytest.approx(one * [1, -1, 1, -1, 1, -1], rel=1e-9, abs=1e-9)
    for name in STATE._fields[STATE.flap_a : STATE.feels_x]:
        sign = -1.0 if ODD & set(name.split("_")) else 1.0
        assert other_rates[name] == pytest.approx(sign * rates[name], rel=1e-9, abs=1e-9), name
    assert np.abs(one).min() > 1e-3


@pytest.mark.parametrize("seen", [{"heading": 2.0, "north": 7.0}, {"wind": WIND, "heading": -1.0}])
@pytest.mark.parametrize("parameters", [{}, MOVING])
def test_place_heading_and_steady_wind_are_not_felt(jr700, parameters, seen):
    """Whoever drifts with the wind, elsewhere and turned, feels what calm air does (Galilei)."""
    model, _ = models_of(jr700, parameters)
    accelerations, rates, _, _ = felt(model, 5)
    other_accelerations, other_rates, _, _ = felt(model, 5, **seen)
    assert other_accelerations == pytest.approx(accelerations, rel=1e-9, abs=1e-9)  # rounding
    assert other_rates == pytest.approx(rates, rel=1e-9, abs=1e-9)


# Vehicles in threads: each flies as it does alone.

FULL = mujoco.mjtState.mjSTATE_FULLPHYSICS


def sweeping(model, axis, seed):
    numbers = model.actuator_user[addresses(model).rotor]
    numbers[PARAM.pilot_on] = 1.0
    numbers[PARAM.pilot_down] = -10.0
    numbers[PARAM.pilot_seed] = seed
    numbers[PARAM.remnant_col : PARAM.remnant_ped + 1] = 0.005
    numbers[PARAM.remnant_interval] = 0.1
    numbers[PARAM.excitation] = SWEEP
    numbers[PARAM.excitation_duration] = 20.0
    numbers[PARAM.excitation_col + axis] = 0.05
    numbers[PARAM.sweep_w_min], numbers[PARAM.sweep_w_max] = 0.8, 40.0
    numbers[PARAM.sweep_fade] = 1.0


@pytest.fixture
def flights(jr700):
    models = []
    for axis in range(4):
        model = copy.copy(jr700.model)
        sweeping(model, axis, seed=axis)
        models.append(model)
    data = mujoco.MjData(models[0])
    place(models[0], data, jr700.trim)
    state = np.empty(mujoco.mj_stateSize(models[0], FULL))
    mujoco.mj_getState(models[0], data, state, FULL)
    return models, state, data.ctrl.copy()


def test_batch_threads_do_not_matter(flights):
    models, state, ctrl = flights
    ends = []
    for threads in (1, 2):
        with installed():
            batch = Batch(models[0], len(models), nthread=threads)
            batch.set_models(models)
            for name in ("qpos", "act"):
                getattr(batch, name)[:] = 0.0
            for sim, model in enumerate(models):
                data = mujoco.MjData(model)
                mujoco.mj_setState(model, data, state, FULL)
                batch.qpos[sim], batch.act[sim] = data.qpos, data.act
                batch.history[sim] = data.history
            control = np.tile(ctrl, (len(models), 100, 1))
            out = batch.rollout(100, control=control, record=("qpos", "qvel", "act"))
        ends.append(out)
    for name in ("qpos", "qvel", "act"):
        assert np.array_equal(ends[0][name], ends[1][name])
    start, same = np.tile(state, (len(models), 1)), np.tile(ctrl, (len(models), 100, 1))
    with installed():
        states, _ = rollout.rollout(models, data, initial_state=start, control=same, nstep=100)
    assert np.array_equal(ends[0]["qpos"], states[:, :, 1:8])  # after the time


# The vehicle with its rotors stopped: what touches it is felt.

NO_AIRFRAME = {"airframe.drag_area_x": 0.0, "airframe.drag_area_y": 0.0}
NO_AIRFRAME |= {"airframe.drag_area_z": 0.0, "fin.area": 0.0}


@pytest.fixture
def airless():
    return load("jr700", parameters=NO_AIRFRAME)


def test_what_touches_it_makes_up_for_its_acceleration(airless):
    model = airless.grounded_model(
        lambda spec, _: spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
    )
    data = mujoco.MjData(model)
    write_motion(model, data, Motion(u=1.0, v=-0.5, w=0.3, phi=0.3, theta=0.2, psi=1.0, down=0.05))
    with installed():
        mujoco.mj_forward(model, data)
    felt = model.body_subtreemass[1] * (data.qacc[:3] - model.opt.gravity) * [1.0, -1.0, -1.0]
    # the constraint solver's tolerance
    assert data.sensor("contact").data == pytest.approx(felt, abs=1e-6 * np.linalg.norm(felt))
    assert np.all(np.abs(felt) > 1.0)
