"""A model that lacks what the force laws count on: one sentence, which names it, never silence."""

import threading

import mujoco
import numpy as np
import pytest
from mujoco import rollout

import helisim as hs
from helisim.base.errors import CallbackError, InputError
from helisim.physics.layout import ACTUATORS, LAYOUT, PARAM
from helisim.vehicle.assembly import model_folder


@pytest.fixture
def spec():
    """The shipped MJCF, with all that the force laws need."""
    return mujoco.MjSpec.from_file(str(model_folder("jr700") / "jr700.xml"))


def fly(model, steps=3):
    data = mujoco.MjData(model)
    with hs.installed():
        mujoco.mj_step(model, data, steps)


def renumber(spec, name, slot, number):
    numbers = np.array(spec.actuator(name).userdata)
    numbers[slot] = number
    spec.actuator(name).userdata = numbers


def no_numbers(spec, names=ACTUATORS):
    for name in names:
        spec.actuator(name).userdata = []


def too_few(spec):
    spec.nuser_actuator = -1
    for name in ACTUATORS:
        spec.actuator(name).userdata = np.array(spec.actuator(name).userdata)[:100]


def two_exchanged(spec):
    renumber(spec, "LON", PARAM.ordinal, 2.0)
    renumber(spec, "LAT", PARAM.ordinal, 1.0)


def without(kind, name):
    """Return what takes an element out of a model, and the keyframe of all of them."""

    def damage(spec):
        spec.delete(getattr(spec, kind)(name))
        if kind == "actuator":
            spec.delete(spec.key("hover"))

    return damage


def switched_off(*flags):
    def damage(spec):
        for flag in flags:
            spec.option.disableflags |= getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag}")

    return damage


def group_off(spec):
    spec.actuator("servo_left").group = 3
    spec.option.disableactuator = 1 << 3


def one_state(spec):
    spec.actuator("servo_left").actdim = 1
    spec.delete(spec.key("hover"))


def steps(timestep):
    return lambda spec: setattr(spec.option, "timestep", timestep)


STILL = "'rotor' and the servos stand still"
LACKING = [
    (without("actuator", "rotor"), "'COL' has the user numbers of COL, .* no rotor in its place"),
    (no_numbers, "actuator 'rotor' has no user numbers.*helisim vehicle build"),
    (lambda spec: no_numbers(spec, ["rotor"]), "'rotor' has not the user numbers of .* rotor"),
    (too_few, f"room for 100 user numbers, and a vehicle has {len(PARAM)}.*nuser_actuator"),
    (
        lambda spec: renumber(spec, "rotor", PARAM.layout, LAYOUT + 1.0),
        "actuator 'rotor' has user numbers of another helisim.*helisim vehicle build",
    ),
    (two_exchanged, "'LON' has not the .* vehicle's LON.*COL, LON, LAT.*helisim vehicle build"),
    (without("sensor", "stick"), "'flapping' is not 'servo_position'.*imu_position, gyro_rate, st"),
    (without("sensor", "air"), "'contact' is not 'air', which should be in its place; .*air, con"),
    (without("sensor", "clock"), "behind sensor 'contact' there is no 'clock'; .*air, contact"),
    (without("sensor", "imu_velocity"), "'imu_accelerometer' is not 'imu_velocity', which should"),
    (without("sensor", "imu_gyro"), "before sensor 'imu_accelerometer' there is no 'imu_gyro'; "),
    (switched_off("ACTUATION"), f'{STILL}, .*<flag actuation="disable"/> out'),
    (switched_off("ACTUATION", "SPRING", "DAMPER"), STILL),
    (switched_off("SPRING", "DAMPER"), "'rotor' give no force, .*spring=\"disable\""),
    (switched_off("SENSOR"), "gyro and the recorder of .*'rotor' see nothing, .*<flag sensor="),
    (group_off, "'servo_left' is in group 3, which is switched off; .*actuatorgroupdisable"),
    (one_state, "'servo_left' has 1 activations where 2 are needed; .*actdim=\"2\""),
    (steps(0.005), "'gyro_rate' is what the gyro reads each 0.002 s.*0.005 s.*timestep=\"0.002\""),
    (steps(0.0005), "actuator 'PED' keeps 16 samples, and its delay needs 51"),
]


@pytest.mark.parametrize(("damage", "said"), LACKING)
def test_what_is_missing_is_named(spec, damage, said):
    """By `check_model` at once, by `installed` when the block ends: the same sentence."""
    damage(spec)
    model = spec.compile()
    with pytest.raises(CallbackError, match=f"model 'jr700': .*{said}") as at_once:
        hs.check_model(model)
    with pytest.raises(CallbackError) as in_the_end:
        fly(model)
    assert str(in_the_end.value) == str(at_once.value)
    assert "\n" not in str(at_once.value)


def test_a_whole_model_is_said_nothing_of(spec, recwarn):
    """Neither in flight nor by `check_model`, which names its body."""
    model = spec.compile()
    fly(model)
    assert hs.check_model(model) == ("jr700",)
    assert not recwarn.list


def test_a_model_of_others_has_no_vehicle():
    """`check_model` was asked for one; `installed` has nothing to say of it."""
    model = mujoco.MjModel.from_xml_string('<mujoco model="empty"/>')
    with pytest.raises(CallbackError, match="model 'empty' has no helicopter of helisim"):
        hs.check_model(model)
    with hs.installed():
        step(model)


def named(spec, name):
    """Compile a model of that name, which has no numbers."""
    no_numbers(spec)
    spec.modelname = name
    return spec.compile()


def step(*models):
    """Take three steps with each."""
    for model in models:
        mujoco.mj_step(model, mujoco.MjData(model), 3)


def repeat(times, do, *arguments):
    for _ in range(times):
        do(*arguments)


def test_the_block_says_it_once_and_forgets(spec):
    """Of three models the first; the next block starts with a clean slate."""
    sound, first, second = spec.compile(), named(spec, "first"), named(spec, "second")
    with pytest.raises(CallbackError, match="model 'first'"), hs.installed():
        step(sound, first, second, first)
    fly(sound)


def test_an_exception_of_the_block_comes_first(spec):
    """What was found is its note."""

    def failing():
        with hs.installed():
            step(named(spec, "first"))
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError) as caught:
        failing()
    assert "no user numbers" in "".join(caught.value.__notes__)


def test_a_block_within_a_block_leaves_it_to_the_outer_one(spec):
    """What a library does in a block of its own is not to be blamed for the model of the outer."""
    ended = []

    def nested():
        with hs.installed():
            step(named(spec, "first"))
            with hs.installed():
                pass
            ended.append("inner")

    with pytest.raises(CallbackError, match="no user numbers"):
        nested()
    assert ended == ["inner"]


def test_check_model_within_a_block_keeps_what_was_found(spec):
    """The block still says what it has met; of the model that was checked it says nothing."""
    sound, first, second = spec.compile(), named(spec, "first"), named(spec, "second")

    def checking():
        with hs.installed():
            step(first)
            with pytest.raises(CallbackError, match="second"):
                hs.check_model(second)
            assert hs.check_model(sound) == ("jr700",)

    with pytest.raises(CallbackError, match="first"):
        checking()


@pytest.mark.parametrize("integrator", ["Euler", "RK4"])
def test_compiling_is_no_flight(spec, integrator):
    """MuJoCo takes a step when it compiles; who compiles in a block is not told off for it."""
    no_numbers(spec)
    spec.option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    with hs.installed():
        model = spec.compile()
    with pytest.raises(CallbackError), hs.installed():
        step(model)


@pytest.mark.parametrize("integrator", ["Euler", "RK4"])
def test_three_steps_are_a_flight(spec, integrator):
    """Compiled within the block or before it, by steps or by evaluations at one time."""
    no_numbers(spec)
    spec.option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    model = spec.compile()
    data = mujoco.MjData(model)
    for evaluate in (mujoco.mj_step, mujoco.mj_forward):
        mujoco.mj_resetData(model, data)
        with pytest.raises(CallbackError), hs.installed():
            repeat(3, evaluate, model, data)
    with pytest.raises(CallbackError), hs.installed():
        step(spec.compile())


def test_rollout_in_threads_says_it_once(spec):
    """The threads are MuJoCo's own; the block that called it raises."""
    no_numbers(spec, ["rotor"])
    models = [spec.compile() for _ in range(4)]
    data = [mujoco.MjData(models[0]) for _ in range(2)]
    size = mujoco.mj_stateSize(models[0], mujoco.mjtState.mjSTATE_FULLPHYSICS)
    with pytest.raises(CallbackError, match="'rotor' has not the user numbers"), hs.installed():
        rollout.rollout(models, data, np.zeros((4, size)), nstep=20)


def test_another_threads_model_is_said_by_a_block_that_ends_later(spec):
    """Blocks overlap between threads; a note is said by the first outermost block to end."""
    no_numbers(spec)
    model, said = spec.compile(), []

    def stepping():
        try:
            fly(model)
        except CallbackError as error:
            said.append(str(error))

    with hs.installed():
        thread = threading.Thread(target=stepping)
        thread.start()
        thread.join()
    assert len(said) == 1
    assert "no user numbers" in said[0]


@pytest.mark.parametrize("model", ["scene.xml", None])
def test_what_is_no_model_is_told_so(model):
    """A path is not yet a model."""
    for ask in (hs.check_model, lambda model: hs.set_controller(model, None)):
        with pytest.raises(InputError, match=r"a mujoco\.MjModel is needed"):
            ask(model)
