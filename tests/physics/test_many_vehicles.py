"""Vehicles side by side, in one scene and in threads: each flies as it does alone."""

import copy

import mujoco
import numpy as np
import pytest
from mujoco import rollout
from mujoco.batch import Batch

from helisim.physics.layout import PARAM, SWEEP
from helisim.physics.native import installed
from helisim.vehicle.addresses import addresses
from helisim.vehicle.parameters import model_folder
from helisim.vehicle.trim import place


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
    return numbers.copy()


def state_of(model, data):
    size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    state = np.empty(size)
    mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    return state


SCENE = """
<mujoco><option timestep="0.002" integrator="RK4" density="0" viscosity="0" gravity="0 0 -9.8015">
<flag autoreset="disable"/></option><size nuserdata="16"/></mujoco>
"""


def alone(model, blocks, start, steps):
    """Fly one vehicle with each block of numbers; return how each flight ends."""
    where, ends = addresses(model), []
    for block in blocks:
        model.actuator_user[where.rotor] = block
        data = mujoco.MjData(model)
        mujoco.mj_setState(model, data, start, mujoco.mjtState.mjSTATE_INTEGRATION)
        for _ in range(steps):
            mujoco.mj_step(model, data)
        ends.append((data.qpos.copy(), data.qvel.copy(), data.act.copy()))
    return ends


def together(single, pair, blocks, start, steps, offset):
    """Fly the attached vehicles, the second `offset` metres to the left of the first."""
    own = addresses(single)
    first = mujoco.MjData(single)
    mujoco.mj_setState(single, first, start, mujoco.mjtState.mjSTATE_INTEGRATION)
    data = mujoco.MjData(pair)
    for k, (prefix, block) in enumerate(zip(("one/", "two/"), blocks)):
        where = addresses(pair, prefix)
        ordinals = slice(where.rotor - 8, where.rotor + 1)
        pair.actuator_user[ordinals] = single.actuator_user[own.rotor - 8 : own.rotor + 1]
        pair.actuator_user[where.rotor] = block
        pair.actuator_user[where.rotor, PARAM.pilot_east] = -offset * k
        data.qpos[7 * k : 7 * k + 7] = first.qpos
        data.qpos[7 * k + 1] += offset * k
        data.act[where.state : where.state + first.act.size] = first.act
        data.ctrl[where.control : where.control + 9] = first.ctrl
    for _ in range(steps):
        mujoco.mj_step(pair, data)
    data.qpos[8] -= offset
    return [
        (
            data.qpos[7 * k : 7 * k + 7],
            data.qvel[6 * k : 6 * k + 6],
            data.act[single.na * k : single.na * (k + 1)],
        )
        for k in range(2)
    ]


@pytest.mark.parametrize("offset", [0.0, 5.0])
def test_two_vehicles_in_one_scene(jr700, offset):
    """Attached twice, each vehicle flies as it does alone: to the bit, at the same place.

    Five metres away it is the same to the rounding of a position of five metres.
    """
    path = str(model_folder(jr700.name) / "jr700.xml")
    single = mujoco.MjModel.from_xml_path(path)
    single.actuator_user[:, : len(PARAM)] = jr700.model.actuator_user[:, : len(PARAM)]
    world = mujoco.MjSpec.from_string(SCENE)
    for prefix in ("one/", "two/"):
        world.attach(
            mujoco.MjSpec.from_file(path), prefix=prefix, frame=world.worldbody.add_frame()
        )
    pair = world.compile()
    blocks = [sweeping(single, axis, seed) for axis, seed in ((2, 5), (3, 9))]
    data = mujoco.MjData(single)
    place(single, data, jr700.trim)
    start = np.empty(mujoco.mj_stateSize(single, mujoco.mjtState.mjSTATE_INTEGRATION))
    mujoco.mj_getState(single, data, start, mujoco.mjtState.mjSTATE_INTEGRATION)
    with installed():
        expected = alone(single, blocks, start, 400)
        found = together(single, pair, blocks, start, 400, offset)
    for vehicle in range(2):
        for one, other in zip(found[vehicle], expected[vehicle]):
            if vehicle == 0 or offset == 0.0:
                assert np.array_equal(one, other)
            else:
                # 5 m round off by 1e-15; 0.8 s of an unstable hover multiply that by < 1e3
                assert one == pytest.approx(other, abs=1e-11)


@pytest.fixture
def flights(jr700):
    """Four vehicles with sweeps of their own, and a common start."""
    models = []
    for axis in range(4):
        model = copy.copy(jr700.model)
        sweeping(model, axis, seed=axis)
        models.append(model)
    data = mujoco.MjData(models[0])
    place(models[0], data, jr700.trim)
    return models, state_of(models[0], data), data.ctrl.copy()


def roll(flights, threads, steps=300):
    models, state, ctrl = flights
    with installed():
        states, sensors = rollout.rollout(
            models,
            [mujoco.MjData(models[0]) for _ in range(threads)],
            initial_state=np.tile(state, (len(models), 1)),
            control=np.tile(ctrl, (len(models), steps, 1)),
            nstep=steps,
        )
    return states, sensors


def test_batch_threads_do_not_matter(flights):
    """mujoco.batch takes the callbacks; one thread and two give the same bits as rollout."""
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
                mujoco.mj_setState(model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
                batch.qpos[sim], batch.act[sim] = data.qpos, data.act
                batch.history[sim] = data.history
            control = np.tile(ctrl, (len(models), 100, 1))
            out = batch.rollout(100, control=control, record=("qpos", "qvel", "act"))
        ends.append(out)
    for name in ("qpos", "qvel", "act"):
        assert np.array_equal(ends[0][name], ends[1][name])
    states, _ = roll(flights, 1, steps=100)
    assert np.array_equal(ends[0]["qpos"], states[:, :, 1:8])  # after the time
