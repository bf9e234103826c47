"""Controllers in models: of MuJoCo's own steps, of several helicopters, of other processes."""

import copy
import pickle
import subprocess
import sys
from pathlib import Path

import mujoco
import numba
import numpy as np
import pytest
from mujoco import rollout
from numba import types

import helisim as hs
import own_laws
from helisim.base.errors import CallbackError, InputError, ModelError, UnknownNameError
from helisim.physics import laws
from helisim.physics.layout import NO_LAW, PARAM, STATE
from helisim.sim.flight import simulate
from helisim.vehicle import Controller
from helisim.vehicle.folder import model_folder
from helisim.vehicle.trim import addresses, place

TESTS = Path(__file__).resolve().parents[1]
FAST = hs.Doublet(axis="lat", duration=4.0, trim_time=1.0)
_POINTER = types.CPointer(types.float64)


@numba.cfunc(types.void(_POINTER, _POINTER, _POINTER, _POINTER))
def stays(seen, state, settings, commands):
    for k in range(4):
        commands[k] = seen[10 + k]


def same(one, other):
    return np.array_equal(one.values, other.values)


def test_without_a_controller_the_servos_are_the_callers(jr700):
    """Nothing overwrites their `ctrl`, in steps of one's own."""
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


def test_without_a_controller_a_flight_is_of_the_base_helicopter(jr700):
    """The servos stay at the trim's, and move by what the plan adds to them only."""
    quiet = hs.Pilot(remnant=0.0)
    plan = hs.FlightPlan(
        excitation=hs.Step(axis="ped", amplitude=0.02, trim_time=1.0, duration=2.0, at="servos"),
        pilot=quiet,
    )
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
    """The keyframe's are those of the shipped gyro."""
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


def test_helicopters_in_one_scene_have_controllers_of_their_own(jr700):
    """By prefix; each flies as it does alone, and the third by its servos' `ctrl`."""
    path = str(model_folder("jr700") / "jr700.xml")
    controllers = (
        own_laws.attitude_controllers(jr700)[0],
        own_laws.attitude_controllers(jr700)[1],
        None,
    )
    world = mujoco.MjSpec.from_string(
        '<mujoco><option timestep="0.002" integrator="RK4" density="0" viscosity="0" '
        'gravity="0 0 -9.8015"/></mujoco>'
    )
    for k in range(3):
        frame = world.worldbody.add_frame(pos=[0.0, 5.0 * k, 0.0])
        world.attach(mujoco.MjSpec.from_file(path), prefix=f"{k}/", frame=frame)
    model = world.compile()
    data = mujoco.MjData(model)
    single = mujoco.MjModel.from_xml_path(path)
    ends = []
    for k, controller in enumerate(controllers):
        hs.set_controller(model, controller, prefix=f"{k}/")
        alone = copy.copy(single)
        hs.set_controller(alone, controller)
        own, where = addresses(alone), addresses(model, f"{k}/")
        other = mujoco.MjData(alone)
        place(alone, other, jr700.trim)
        other.ctrl[own.control + 2] = 0.03
        data.qpos[7 * k : 7 * k + 7] = other.qpos
        data.act[where.state : where.state + alone.na] = other.act
        data.ctrl[where.control : where.control + 9] = other.ctrl
        with hs.installed():
            mujoco.mj_step(alone, other, 100)
        ends.append(other)
    with hs.installed():
        mujoco.mj_step(model, data, 100)
    for k, other in enumerate(ends):
        assert np.array_equal(data.qpos[7 * k : 7 * k + 7], other.qpos)
    assert len({end.qpos.tobytes() for end in ends}) == 2  # python and njit are the same


def test_a_vehicle_is_found_by_its_numbers():
    """Beside somebody's actuator that is called as a rotor is; of several the prefix is asked."""
    path = hs.model_folder("jr700") / "jr700.xml"
    world = mujoco.MjSpec.from_file(str(path))
    for actuator in world.actuators:
        actuator.name = f"my_{actuator.name}".replace("rotor", "headspeed")
    world.add_actuator(name="rotor", target="root", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    model = world.compile()
    hs.set_controller(model, None)
    assert model.actuator("my_headspeed").user[PARAM.tail_law] == NO_LAW
    for prefix in ("a/", "b/"):
        spec = mujoco.MjSpec.from_file(str(path))
        world.attach(spec, prefix=prefix, frame=world.worldbody.add_frame())
    model = world.compile()
    hs.set_controller(model, None, prefix="b/")
    with pytest.raises(UnknownNameError, match=r"my_headspeed, a/rotor, b/rotor; .*prefix"):
        hs.set_controller(model, None)
    with pytest.raises(UnknownNameError, match="'c/rotor'; available: my_headspeed"):
        hs.set_controller(model, None, prefix="c/")


def test_threads_of_rollout_take_turns_in_a_python_law(jr700):
    """Several simulations of one model in several threads: no stuck thread, the same bits."""
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


def test_a_law_of_another_process_is_refused_and_called_never(jr700):
    """By its token, as where a model was loaded from a file: the servos stay with the caller."""
    model = copy.copy(jr700.model)
    hs.set_controller(model, own_laws.Counter())
    where = addresses(model)
    for slots, value in (
        (["law_token"], 7.0),
        (["swash_law", "tail_law"], 3e9),
        (["swash_law", "tail_law"], np.inf),
        (["swash_states"], 2.0),
    ):
        strange, data = copy.copy(model), jr700.hovering()
        for slot in slots:
            strange.actuator_user[where.rotor, getattr(PARAM, slot)] = value
        before = data.ctrl.copy()
        with pytest.raises(CallbackError, match="names a controller that"), hs.installed():
            mujoco.mj_step(strange, data, 5)
        assert np.array_equal(data.ctrl[4:8], before[4:8])
    assert laws.token() != 7


def test_a_model_that_outlives_its_vehicle_is_refused(jr700):
    """A copy of the model doesn't keep the controller; `set_controller` gives it one for good."""
    vehicle = jr700.with_controller(own_laws.Counter())
    model = copy.copy(vehicle.model)
    data = mujoco.MjData(model)
    place(model, data, vehicle.trim)
    del vehicle
    with pytest.raises(CallbackError, match="set_controller"), hs.installed():
        mujoco.mj_step(model, data, 5)
    hs.set_controller(model, own_laws.Counter())
    with hs.installed():
        mujoco.mj_step(model, data, 5)


def test_states_need_room(jr700):
    """A vehicle makes it; a compiled model that has too little says what it needs."""

    def remembers(seen, state):
        state[1:] = state[:-1]
        state[0] = seen.r
        return seen.front, seen.left, seen.right, seen.tail - 1e-6 * state[-1]

    controller = Controller(remembers, states=40)
    model = copy.copy(jr700.model)
    with pytest.raises(
        ModelError, match=r'has 40 states and the model has room for 8.*actdim="114"'
    ):
        hs.set_controller(model, controller)
    vehicle = jr700.with_controller(controller)
    assert vehicle.model.na == jr700.model.na + 2 * (40 - 8)
    record = hs.fly(jr700, FAST, controller=controller, jobs=1)[0]
    assert record.ended == ""
    assert vehicle.visual_model().na == vehicle.model.na
    back = vehicle.with_controller(Controller())
    assert same(hs.fly(back, FAST, jobs=1)[0], hs.fly(jr700, FAST, jobs=1)[0])


def _damps(seen):
    return -0.3 * seen.r


def _integrates(seen, state):
    state[0] += 0.002 * seen.r
    return -0.3 * seen.r - 0.1 * state[0]


@pytest.mark.parametrize("law", [_damps, _integrates, numba.njit(_integrates)])
def test_every_model_has_room_for_a_part_of_the_gyro(law):
    """A tail law beside the shipped cyclic one fits a shipped MJCF where nothing is said."""
    path = hs.model_folder("jr700") / "jr700.xml"
    model = mujoco.MjModel.from_xml_path(str(path))
    hs.set_controller(model, Controller(tail=law))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("hover").id)
    with hs.installed():
        mujoco.mj_step(model, data, 500)
    assert data.sensor("servo_command").data[3] != model.key("hover").ctrl[7]
    assert np.abs(data.qvel).max() < 1.0  # the cyclic gyro flies, nobody trims the tail


def test_more_room_changes_nothing_else():
    """Time step, integrator, delays and wind of the vehicle stay: the same flight, to the bit."""
    vehicle = hs.load(timestep=0.001, integrator="Euler").trimmed(wind=(-2.0, 1.0, 0.0))
    python, _ = own_laws.attitude_controllers(vehicle)
    wide = Controller(
        own_laws.attitude, states=30, settings=python.settings, reset=own_laws.attitude_from_trim
    )
    assert vehicle.with_controller(wide).model.na > vehicle.model.na
    one, other = (hs.fly(vehicle, FAST, jobs=1, controller=law)[0] for law in (python, wide))
    assert same(one, other)


def test_settings_and_weather_keep_the_controller(jr700):
    """A vehicle with other settings, or in another flight, flies by the same law."""
    vehicle = jr700.with_controller(own_laws.attitude_controllers(jr700)[1])
    for other in (vehicle.with_settings({"gyro.k_p": 0.5}), vehicle.trimmed(wind=(-3.0, 0.0, 0.0))):
        assert other.controller is vehicle.controller
        data = other.hovering()
        with hs.installed():
            mujoco.mj_step(other.model, data, 20)
        assert data.act[STATE.law_tick] == 20.0
    with pytest.raises(InputError, match="airframe"):
        vehicle.with_settings({"main_rotor.speed": 100.0})


def test_the_controller_stands_in_the_provenance(jr700):
    """Name, where each law is, a digest of its source, its settings; the model's digest is kept."""
    python, native = own_laws.attitude_controllers(jr700)
    record = hs.fly(jr700, FAST, jobs=1, controller=python)[0]
    said = record.provenance["controller"]
    assert said["name"] == "attitude"
    assert said["all"]["law"] == "own_laws:attitude"
    assert said["settings"] == own_laws.attitude_settings(jr700)
    assert record.provenance["model_digest"] == jr700.digest
    assert str(TESTS) not in str(record.provenance)
    compiled = jr700.with_controller(native).provenance["controller"]
    assert compiled["all"]["source_digest"] == said["all"]["source_digest"]
    part = jr700.with_controller(Controller(tail=own_laws.pi_yaw)).provenance["controller"]
    assert part["swash"] == "shipped"
    assert part["tail"]["law"] == "own_laws:pi_yaw"
    assert jr700.with_controller(None).provenance["controller"] == {
        "name": "none",
        "swash": "none",
        "tail": "none",
    }
    assert "controller" not in jr700.provenance


ELSEWHERE = """
import pickle, sys
import numpy as np
import helisim as hs
vehicle = pickle.loads(sys.stdin.buffer.read())
record = hs.fly(vehicle, hs.Doublet(axis="lat", duration=4.0, trim_time=1.0), seed=5, jobs=1)[0]
sys.stdout.buffer.write(record.values.tobytes())
"""


@pytest.mark.parametrize(
    "kind", [pytest.param(0, id="python", marks=pytest.mark.slow), pytest.param(1, id="njit")]
)
def test_a_vehicle_takes_its_controller_to_another_process(jr700, kind):
    """Where the law's module can be imported, it flies the same bytes."""
    vehicle = jr700.with_controller(own_laws.attitude_controllers(jr700)[kind])
    done = subprocess.run(
        [sys.executable, "-c", ELSEWHERE],
        input=pickle.dumps(vehicle),
        capture_output=True,
        cwd=TESTS,
        check=False,
    )
    assert done.returncode == 0, done.stderr.decode()
    here = hs.fly(vehicle, FAST, seed=5, jobs=1)[0]
    assert done.stdout == here.values.tobytes()


@pytest.mark.parametrize("law", [lambda seen: (0, 0, 0, 0), stays], ids=["local", "cfunc"])
def test_a_law_that_no_other_process_can_find_says_so(jr700, law):
    """Instead of pickle's own words."""
    with pytest.raises(InputError, match=r"can't pass to another process: .*top of a module"):
        pickle.dumps(jr700.with_controller(law))


def test_vehicles_with_equal_controllers_are_equal(jr700):
    """Compared by value, copied whole."""
    one, other = (jr700.with_controller(Controller(own_laws.attitude, states=3)) for _ in "ab")
    assert one == other
    assert hash(one.controller) == hash(other.controller)
    assert one != jr700
    assert one != jr700.with_controller(own_laws.attitude)
    assert copy.deepcopy(one) == one
    assert pickle.loads(pickle.dumps(one)) == one
    assert repr(one.controller) == "Controller('attitude')"
