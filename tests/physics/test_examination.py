"""A model that lacks what the force laws count on: one sentence, which names it, never silence."""

import mujoco
import numpy as np
import pytest
from mujoco import rollout

import helisim as hs
from helisim.base.errors import CallbackError, InputError
from helisim.physics.layout import ACTUATORS, LAYOUT, PARAM, ROTOR_STATES
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


def too_few_states(spec):
    spec.actuator("rotor").actdim -= 1
    spec.delete(spec.key("hover"))


def beside_a_door(spec):
    door = spec.worldbody.add_body(name="door", mass=1.0, inertia=[1.0, 1.0, 1.0])
    door.explicitinertial = True
    door.add_joint(name="hinge")
    spec.delete(spec.key("hover"))


def hinged(spec):
    beside_a_door(spec)
    spec.actuator("rotor").target = "hinge"


def steps(timestep):
    return lambda spec: setattr(spec.option, "timestep", timestep)


ORDER = "actuators don't stand one after the other.*COL, LON, LAT.*helisim vehicle build"
ACCELEROMETER = mujoco.mjtSensor.mjSENS_ACCELEROMETER
SENSORS = "lacks a helicopter's sensors.*imu_position, gyro_rate, stick"
LACKING = [
    (without("actuator", "rotor"), ORDER),
    (no_numbers, "actuator 'rotor' has no user numbers.*helisim vehicle build"),
    (lambda spec: no_numbers(spec, ["rotor"]), ORDER),
    (too_few, f"has 100 user numbers, .* where {len(PARAM)} .*nuser_actuator"),
    (lambda spec: renumber(spec, "rotor", PARAM.layout, LAYOUT + 1.0), "of another helisim"),
    (two_exchanged, ORDER),
    (without("sensor", "stick"), SENSORS),
    (without("sensor", "air"), SENSORS),
    (without("sensor", "clock"), SENSORS),
    (lambda spec: setattr(spec.sensor("imu_gyro"), "type", ACCELEROMETER), SENSORS),
    (switched_off("ACTUATION"), "'rotor' can't fly: .*switches off actuation"),
    (switched_off("ACTUATION", "SPRING", "DAMPER"), "switches off actuation"),
    (switched_off("SPRING", "DAMPER"), "both spring and damper"),
    (switched_off("SENSOR"), "switches off .*sensors"),
    (group_off, "a group of actuators"),
    (lambda spec: setattr(spec.option, "disableactuator", 1), "a group of actuators"),
    (one_state, r"actdim \[2, 1, 2, 2, \d+\], needed are \[2, 2, 2, 2"),
    (too_few_states, rf"actdim .*, needed are \[2, 2, 2, 2, {ROTOR_STATES}\]"),
    (lambda spec: renumber(spec, "rotor", PARAM.tail_law, 7.0), "names a controller that this"),
    (hinged, "must have the free joint"),
    (steps(0.005), "gyro that acts each 0.002 s; .*timestep"),
    (steps(0.0005), "nsample=16, and their delay needs 51"),
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


def other_group_off(spec):
    spec.option.disableactuator = 1 << 3


@pytest.mark.parametrize(
    "harmless",
    [other_group_off, beside_a_door, *map(switched_off, ["SPRING", "DAMPER"]), steps(0.025 / 15)],
)
def test_a_whole_model_is_said_nothing_of(spec, recwarn, harmless):
    """Neither in flight nor by `check_model`, which names its body."""
    harmless(spec)
    model = spec.compile()
    fly(model)
    assert hs.check_model(model) == ("jr700",)
    assert not recwarn.list


def test_a_gyro_without_room_leaves_the_servos_alone(spec):
    too_few_states(spec)
    model = spec.compile()
    data = mujoco.MjData(model)
    data.ctrl[4:8] = commands = [0.1, -0.2, 0.3, -0.4]
    with pytest.raises(CallbackError, match="actdim"), hs.installed():
        mujoco.mj_step(model, data, 3)
    assert data.ctrl[4:8].tolist() == commands


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


@pytest.mark.parametrize("integrator", ["Euler", "RK4"])
def test_compiling_is_no_flight(spec, integrator):
    """MuJoCo takes a step when it compiles; who compiles in a block is not told off for it."""
    no_numbers(spec)
    spec.option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    with hs.installed():
        model = spec.compile()
    with pytest.raises(CallbackError), hs.installed():
        step(model)


def test_rollout_in_threads_says_it_once(spec):
    """The threads are MuJoCo's own; the block that called it raises."""
    no_numbers(spec, ["rotor"])
    models = [spec.compile() for _ in range(4)]
    data = [mujoco.MjData(models[0]) for _ in range(2)]
    size = mujoco.mj_stateSize(models[0], mujoco.mjtState.mjSTATE_FULLPHYSICS)
    with pytest.raises(CallbackError, match="don't stand one after"), hs.installed():
        rollout.rollout(models, data, np.zeros((4, size)), nstep=20)


@pytest.mark.parametrize("model", ["scene.xml", None])
def test_what_is_no_model_is_told_so(model):
    """A path is not yet a model."""
    for ask in (hs.check_model, lambda model: hs.set_controller(model, None)):
        with pytest.raises(InputError, match=r"a mujoco\.MjModel is needed"):
            ask(model)
