"""Who sets the servos while the gyro flies them is told once; nobody else is."""

import copy
import warnings

import mujoco
import numpy as np
import pytest
from mujoco import rollout
from mujoco.batch import Batch

import helisim as hs
from helisim.physics.layout import CONTROL
from helisim.physics.params import NO_LAW, PARAM
from helisim.vehicle.folder import model_folder
from helisim.vehicle.motion import addresses

SERVOS = slice(CONTROL.servo_front, CONTROL.servo_tail + 1)
SAID = "somebody set ctrl of actuator 'servo_front' to 0.1 while the gyro flies.*set_controller"


@pytest.fixture(scope="module")
def model():
    return mujoco.MjModel.from_xml_path(str(model_folder("jr700") / "scene.xml"))


@pytest.fixture
def data(model):
    """In the hover, a little turned, so that the gyro has something to do."""
    data = mujoco.MjData(model)
    hover(model, data)
    return data


def hover(model, data):
    mujoco.mj_resetDataKeyframe(model, data, model.key("hover").id)
    data.qvel[3:6] = [0.2, -0.1, 0.15]


@pytest.fixture
def silence():
    """A word about a model is an error; interpreted, the pilot's noise overflows with a warning."""
    with warnings.catch_warnings():
        warnings.filterwarnings("error", message="model ")
        yield


def fly(model, data, steps=20, before=None):
    for k in range(steps):
        if before is not None:
            before(k)
        mujoco.mj_step(model, data)


@pytest.mark.parametrize("start", [0, 7])
def test_who_sets_a_servo_is_told_once(model, data, start):
    """Once or at every step, from the start or later: one warning, at the line of the block."""
    for again in (False, True):
        hover(model, data)

        def command(k, again=again):
            if k == start or (again and k > start):
                data.ctrl[CONTROL.servo_front] = 0.1

        with pytest.warns(RuntimeWarning, match=SAID) as caught, hs.installed():
            fly(model, data, before=command)
        assert [one.filename for one in caught] == [__file__]


def test_commands_that_change_are_noticed_from_the_first_step(model, data):
    """Whoever steers the servos is told, whatever he began with."""
    with pytest.warns(RuntimeWarning, match="servo_tail"), hs.installed():
        fly(model, data, before=lambda k: data.ctrl.__setitem__(CONTROL.servo_tail, 1e-3 * k))


def test_a_servo_without_a_law_is_its_callers(model, data, silence):
    """Where no law flies the tail, its control is nobody else's."""
    model = copy.copy(model)
    model.actuator_user[addresses(model).rotor, PARAM.tail_law] = NO_LAW
    with hs.installed():
        fly(model, data, before=lambda k: data.ctrl.__setitem__(CONTROL.servo_tail, 1e-3 * k))


@pytest.mark.usefixtures("silence")
def test_flights_resets_keyframes_and_placing_are_nobodys_commands(model, data):
    """Whatever is done to the state as a whole, at any time, with evaluations in between."""
    vehicle = hs.load("jr700")
    size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION)
    state = np.empty(size)
    with hs.installed():
        fly(model, data)
        mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
        fly(model, data, 13)
        mujoco.mj_setState(model, data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
        fly(model, data)
        other = copy.copy(data)
        fly(model, data, 3)
        fly(model, other)
        mujoco.mj_resetData(model, data)
        fly(model, data)
        hover(model, data)
        for _ in range(3):
            mujoco.mj_forward(model, data)
        other = copy.copy(data)
        fly(model, data)
        fly(model, other)
        data.qpos[2] += 1.0
        data.ctrl[: CONTROL.servo_front] = [0.1, 0.05, -0.05, 0.1]
        fly(model, data)
        again = vehicle.hovering()
        fly(vehicle.model, again)
        vehicle.linearize("IN1")
        vehicle.linearize("IN2")
    hs.fly(vehicle, hs.Doublet(axis="lat", duration=8.0))


@pytest.mark.usefixtures("silence")
@pytest.mark.parametrize("column", ["zero", "trim", "stale"])
def test_rollouts_need_something_in_every_column(model, data, column):
    """Zeros, the keyframe's, or what stood there when the sticks' history was made."""
    with hs.installed():
        fly(model, data)
        full = mujoco.mjtState.mjSTATE_FULLPHYSICS
        state = np.empty((4, mujoco.mj_stateSize(model, full)))
        mujoco.mj_getState(model, data, state[0], full)
        state[:] = state[0]
        state[1:, 11] += [0.1, 0.2, 0.3]  # a rate of each one's own, and of each column's:
        state[:, 10] += {"zero": 0.0, "trim": 0.01, "stale": 0.02}[
            column
        ]  # memory that is used again may hold another's flight
        row = {"zero": np.zeros(9), "trim": model.key("hover").ctrl, "stale": data.ctrl}[column]
        control = np.tile(row, (4, 40, 1))
        control[:, :, 1] = 0.1 * np.sin(0.3 * np.arange(40))
        control[:, :, CONTROL.rotor] = 1.0
        threads = [mujoco.MjData(model) for _ in range(2)]
        for _ in range(3):  # each goes on where the one before ended
            states, _ = rollout.rollout(model, threads, state, control, nstep=40)
            state = states[:, -1].copy()


@pytest.mark.usefixtures("silence")
def test_what_another_flight_left_is_nobodys_command(model, data):
    """A state without controls is set, as `mujoco.rollout` does, in blocks that come and go."""
    full = mujoco.mjtState.mjSTATE_FULLPHYSICS
    state = np.empty(mujoco.mj_stateSize(model, full))
    mujoco.mj_getState(model, data, state, full)
    for _ in range(3):
        for _ in range(5):
            with hs.installed():
                fly(model, data, 3)
        assert np.any(data.ctrl[SERVOS] != 0.0)
        mujoco.mj_setState(model, data, state, full)


@pytest.mark.usefixtures("silence")
def test_batches_share_memory_between_flights(model, data):
    """Flights that take turns in the same mjData are told apart."""
    with hs.installed():
        batch = Batch(model, 6, nthread=1)
        batch.qpos[:], batch.act[:] = data.qpos, data.act
        batch.qvel[:, 3] = np.linspace(0.1, 0.6, 6)
        for _ in range(5):
            control = np.tile(model.key("hover").ctrl, (6, 10, 1))
            batch.rollout(10, control=control, record=("qpos",))


def test_other_commands_in_a_rollout_are_noticed(model, data):
    """Servos that are steered by a rollout's controls are overruled all the same."""
    control = np.tile(model.key("hover").ctrl, (1, 40, 1))
    control[:, :, CONTROL.servo_tail] = 0.1 * np.sin(0.3 * np.arange(40))
    full = mujoco.mjtState.mjSTATE_FULLPHYSICS
    state = np.empty((1, mujoco.mj_stateSize(model, full)))
    mujoco.mj_getState(model, data, state[0], full)
    with pytest.warns(RuntimeWarning, match="servo_tail"), hs.installed():
        rollout.rollout(model, data, state, control, nstep=40)


@pytest.mark.usefixtures("silence")
def test_a_flight_at_the_address_of_another_that_ended_as_it_begins_is_its_own(model, data):
    """Memory that is given back holds the next mjData; a reset is the same to whoever watches."""
    integration = mujoco.mjtState.mjSTATE_INTEGRATION
    state = np.empty(mujoco.mj_stateSize(model, integration))
    with hs.installed():
        fly(model, data)
        mujoco.mj_getState(model, data, state, integration)
        mujoco.mj_resetData(model, data)
        mujoco.mj_setState(model, data, state, integration)
        trim = model.key("hover").ctrl[SERVOS]
        assert np.any(trim != 0.0)  # nothing is said of zeros
        fly(model, data, before=lambda _: data.ctrl.__setitem__(SERVOS, trim))
