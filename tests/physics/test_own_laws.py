"""A law of one's own in the process's table, and in a vehicle's ticks."""

import threading
from contextlib import nullcontext

import mujoco
import numpy as np
import pytest
from mujoco import rollout

import helisim as hs
from helisim.base.errors import CallbackError, InputError, ModelError
from helisim.physics import laws, memory
from helisim.physics.gyro import cyclic_law, yaw_law
from helisim.physics.laws import OwnLaw, Registered, is_registered, token
from helisim.physics.layout import ACTUATORS, HISTORY, INJECTION, PARAM, STATE
from helisim.physics.native import installed
from helisim.vehicle import Controller
from helisim.vehicle.addresses import addresses
from helisim.vehicle.assembly import model_folder
from helisim.vehicle.trim import Motion, write_motion
from tabled import section, tabled


def test_a_law_is_known_until_it_is_released():
    law = Registered(
        OwnLaw(lambda seen: (1.0,) * 3, "all", 2, np.zeros(1), None, "short"), watched=True
    )
    assert is_registered(law.handle, token(), 2)
    for wrong in ((law.handle + 1, token(), 2), (law.handle, 0, 2), (law.handle, token(), 3)):
        assert not is_registered(*wrong)
    with pytest.raises(ModelError, match="where finite numbers for front"):
        law([0.0] * 18, np.zeros(2), starts=True)
    assert law.failure().why.startswith("returned")
    assert law.failure() is None
    law.release()
    assert not is_registered(law.handle, token(), 2)


@pytest.mark.parametrize(
    ("left", "why"), [(3.0, "finite numbers"), (np.inf, "left a state that is")]
)
def test_a_failed_law_leaves_the_servos_where_they_were(jr700, left, why):
    given = []

    def law(seen, state):
        state[0] += 1.0
        given.append(state[0])
        state[0] = left if state[0] > 2.0 else state[0]
        return [0.1 * given[-1], 0.2, 0.3, np.nan if state[0] == 3.0 else 0.4]

    model = jr700.model.__copy__()
    hs.set_controller(model, Controller(law, states=1))
    data = mujoco.MjData(model)
    with pytest.raises(CallbackError, match=why), hs.installed():
        mujoco.mj_step(model, data, 5)
    assert given == [1.0, 2.0, 3.0]
    assert np.isnan(data.sensor("servo_command").data).all()
    assert data.ctrl[4:8].tolist() == [0.2, 0.2, 0.3, 0.4]


NAN = np.nan


@tabled("place", "given", "commands")
def test_commands_go_to_their_servos_or_are_refused(place, given, commands):
    law = Registered(OwnLaw(lambda seen: given, place, 0, np.zeros(0), None, "own"), watched=True)
    if isinstance(commands, str):
        with pytest.raises(ModelError, match=commands):
            law([0.0] * 18, np.zeros(0), starts=False)
    else:
        found = law([0.0] * 18, np.zeros(0), starts=False)
        assert found == pytest.approx(commands, abs=0.0, nan_ok=True)


def test_a_law_is_reset_when_it_starts_and_says_where_it_fails():
    def law(seen, state, settings):
        state[:] += settings
        if state[1] > 5.0:
            raise OverflowError("full")
        return state[0] + seen.PED

    def reset(seen, state):
        state[:] = seen.time

    own = Registered(OwnLaw(law, "tail", 2, np.array([1.0, 2.0]), reset, "mine"), watched=True)
    state, seen = np.array([9.0, 9.0]), [0.5, *[0.0] * 16, 0.25]
    assert own(seen, state, starts=True)[3] == 1.75
    assert own(seen, state, starts=False)[3] == 2.75
    assert state.tolist() == [2.5, 4.5]
    with pytest.raises(ModelError, match="'mine' raised OverflowError: full") as caught:
        own(seen, state, starts=False)
    assert state.tolist() == [2.5, 4.5]
    (note,) = caught.value.__notes__
    assert 'File "test_own_laws.py", line' in note
    assert "laws.py" not in note.replace("test_own_laws.py", "")


def test_a_law_that_is_gone_is_missed(jr700):
    model, where = jr700.model.__copy__(), addresses(jr700.model)
    hs.set_controller(model, Controller(lambda seen: (0.1, 0.2, 0.3, 0.4)))
    data, handle = mujoco.MjData(model), model.actuator_user[where.rotor, PARAM.swash_law]

    def flying():
        with hs.installed():
            mujoco.mj_step(model, data, 2)
            next(one for one in laws.WATCHED if one.handle == handle).release()
            data.ctrl[where.control + 4 : where.control + 8] = 0.0
            mujoco.mj_step(model, data)

    with pytest.raises(CallbackError, match="names a controller that this process does not know"):
        flying()
    assert not data.ctrl[where.control + 4 : where.control + 8].any()


def test_a_law_is_given_its_numbers_by_name():
    assert list(laws._seen_at(range(18))) == [*range(18)]


def flown(vehicle, controller, steps=8):
    """Return the servos' commands at each step, (n, 4), and the last states, of moving sticks."""
    model, where = vehicle.model.__copy__(), addresses(vehicle.model)
    hs.set_controller(model, controller)
    data, rows = vehicle.hovering(), []
    data.act[where.state + STATE.gyro_q_filter : where.state + STATE.gyro_r_integral + 1] = 0.0
    with hs.installed():
        for k in range(steps):
            data.ctrl[where.control : where.control + 4] = 0.03 * np.sin(k + np.arange(4.0))
            mujoco.mj_step(model, data)
            rows.append(data.ctrl[where.control + 4 : where.control + 8].copy())
    return np.array(rows), data.act[where.state :]


@pytest.mark.parametrize("own", [("swash",), ("tail",), ("swash", "tail")])
def test_copies_of_the_gyros_halves_fly_as_it_does(jr700, own):
    copies = {"swash": lambda *seen: cyclic_law(*seen), "tail": lambda *seen: yaw_law(*seen)}
    par = jr700.model.actuator_user[addresses(jr700.model).rotor, : len(PARAM)]
    controller = Controller(**{place: copies[place] for place in own}, settings=par)
    expected, state = flown(jr700, Controller())
    found, own_state = flown(jr700, controller)
    assert found == pytest.approx(expected, rel=1e-13, abs=1e-15)
    own_state[STATE.feels_x : STATE.law_tick] = state[STATE.feels_x : STATE.law_tick]
    assert own_state == pytest.approx(state, rel=1e-9, abs=1e-15)
    assert np.ptp(expected, axis=0).min() > 1e-4


@pytest.mark.parametrize("place", ["swash", "tail"])
@pytest.mark.parametrize("plans", [True, False])
def test_servos_that_no_law_moves_are_the_plans_or_the_callers(jr700, place, plans):
    model, where = jr700.model.__copy__(), addresses(jr700.model)
    controller = Controller(**{place: None})
    hs.set_controller(model, controller)
    planned = [0.1, 0.2, 0.3, 0.4]
    if plans:
        controller.plan_for(model.actuator_user[where.rotor], planned)
    data = jr700.hovering()
    servos = data.ctrl[where.control + 4 : where.control + 8]
    servos[:] = -0.5
    with hs.installed():
        mujoco.mj_forward(model, data)
    held = np.arange(4) == 3 if place == "tail" else np.arange(4) < 3
    assert np.array_equal(servos[held], np.array(planned if plans else [-0.5] * 4)[held])
    assert np.all(np.abs(servos[~held]) < 0.1)  # the gyro's, in the hover


def test_a_manoeuvres_disturbance_is_seen(altered):
    model, rows = altered(excitation=HISTORY), []

    def watch(seen):
        rows.append(np.array(seen))
        return 0.0, 0.0, 0.0, 0.0

    hs.set_controller(model, Controller(watch))
    added = np.array([0.1, -0.2, 0.3, 0.04, -0.05, 0.5])
    for share, psi in ((0.0, 3.0), (1.0, 3.0), (0.0, -3.0), (-1.0, -3.0)):
        data = mujoco.MjData(model)
        write_motion(model, data, Motion(p=0.2, q=0.3, r=0.4, phi=0.1, theta=0.2, psi=psi))
        data.userdata[INJECTION.rate_p : INJECTION.angle_psi + 1] = share * added
        with hs.installed():
            mujoco.mj_forward(model, data)
    for plain, seen, sign in ((*rows[:2], 1.0), (*rows[2:], -1.0)):
        expected = plain.copy()
        expected[1:7] += sign * added
        expected[6] -= sign * 2.0 * np.pi
        assert seen == pytest.approx(expected, abs=1e-14)


# The callbacks inside MuJoCo: harmless to others, the same for any number of threads.

HOOKS = ("passive", "control", "act_dyn", "sensor")

PENDULUM = section(globals(), "PENDULUM")

USER = '<general joint="a" dyntype="user" actdim="2"'


def actuators(numbers):
    """Return nine user actuators, as a vehicle has, with their first user numbers."""
    return "".join(f'{USER} user="{numbers(k)[0]:.1f} {numbers(k)[1]} 1 1"/>' for k in range(9))


BARE = {"integrator": "RK4", "size": "", "actuator": "", "sensor": ""}
SIZE = {"size": '<size nuser_actuator="240"/>'}
SMALL = ("qpos", "qvel", "act", "qacc", "sensordata", "qfrc_passive", "ctrl")


def history(model, steps=200):
    data = mujoco.MjData(model)
    data.qvel[:] = 1.0
    data.act[:] = 0.3
    rows = []
    for k in range(steps):
        if model.nu:
            data.ctrl[:] = np.sin(0.1 * k)
        mujoco.mj_step(model, data)
        rows.append(np.concatenate([np.array(getattr(data, name)).ravel() for name in SMALL]))
    return np.array(rows)


@tabled("parts", "said")
def test_other_models_are_left_alone(parts, said):
    model = mujoco.MjModel.from_xml_string(PENDULUM.format(**{**BARE, **parts}))
    stock = history(model)
    with pytest.raises(CallbackError, match=said) if said else nullcontext(), installed():
        ours = history(model)
    assert np.array_equal(stock, ours)


def test_nothing_is_left_behind():
    with installed():
        assert all(getattr(mujoco, f"get_mjcb_{hook}")() is not None for hook in HOOKS)
    assert all(getattr(mujoco, f"get_mjcb_{hook}")() is None for hook in HOOKS)
    with pytest.raises(RuntimeError, match="in the block"), installed():
        raise RuntimeError("in the block")
    assert all(getattr(mujoco, f"get_mjcb_{hook}")() is None for hook in HOOKS)


def test_the_timer_stands_still():
    """MuJoCo reads no clock in the block, which is a third of a step's cost, but after it."""
    model = mujoco.MjModel.from_xml_string(PENDULUM.format(**BARE))
    data = mujoco.MjData(model)
    with installed():
        mujoco.mj_step(model, data, 100)
    assert data.timer[mujoco.mjtTimer.mjTIMER_STEP].number == 100
    assert data.timer[mujoco.mjtTimer.mjTIMER_STEP].duration == 0.0
    mujoco.mj_step(model, data, 100)
    assert data.timer[mujoco.mjtTimer.mjTIMER_STEP].duration > 0.0


def test_blocks_overlap_between_threads():
    inside, leave = threading.Event(), threading.Event()

    def hold():
        with installed():
            inside.set()
            leave.wait(10.0)

    thread = threading.Thread(target=hold)
    with installed():
        thread.start()
        assert inside.wait(10.0)
    assert mujoco.get_mjcb_control() is not None
    leave.set()
    thread.join()
    assert mujoco.get_mjcb_control() is None


@pytest.mark.parametrize("hook", ["passive", "sensor"])
def test_foreign_callback_is_refused_by_name(hook):
    def theirs(*_):
        return 0.0

    getattr(mujoco, f"set_mjcb_{hook}")(theirs)
    try:
        with pytest.raises(CallbackError, match=f"mjcb_{hook}"), installed():
            pass
        assert getattr(mujoco, f"get_mjcb_{hook}")() is theirs
        others = [name for name in HOOKS if name != hook]
        assert all(getattr(mujoco, f"get_mjcb_{name}")() is None for name in others)
    finally:
        getattr(mujoco, f"set_mjcb_{hook}")(None)
    with installed():  # and it works again afterwards
        pass


@pytest.mark.parametrize("name", ["nactuator", "timestep", "wind", "actuator_user", "sensordata"])
def test_wrong_offset_is_noticed(name):
    """A field that is four bytes from where it should be never reaches the force laws."""
    found = memory.offsets()
    with pytest.raises(CallbackError, match=name):
        memory._verify(found._replace(**{name: getattr(found, name) + 4}))


def test_missing_field_is_one_clear_line(monkeypatch):
    """A MuJoCo without a field that we need is refused by its version."""
    monkeypatch.setattr(memory, "_ctype", lambda node: type(node.name, (), {"opt": None}))
    with pytest.raises(CallbackError, match=mujoco.__version__):
        memory.offsets.__wrapped__()


def test_a_replacement_inside_the_block_stays():
    with installed():
        mujoco.set_mjcb_control(_nothing)
    try:
        assert mujoco.get_mjcb_control() is _nothing
    finally:
        mujoco.set_mjcb_control(None)


def _nothing(model, data):
    """Stand for somebody else's callback."""


# A model that lacks what the force laws count on: one sentence, which names it, never silence.


@pytest.fixture
def spec():
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


@tabled("damage", "said")
def test_what_is_missing_is_named(spec, damage, said):
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
    model = mujoco.MjModel.from_xml_string('<mujoco model="empty"/>')
    with pytest.raises(CallbackError, match="model 'empty' has no helicopter of helisim"):
        hs.check_model(model)
    with hs.installed():
        step(model)


def named(spec, name):
    no_numbers(spec)
    spec.modelname = name
    return spec.compile()


def step(*models):
    for model in models:
        mujoco.mj_step(model, mujoco.MjData(model), 3)


def test_the_block_says_it_once_and_forgets(spec):
    sound, first, second = spec.compile(), named(spec, "first"), named(spec, "second")
    with pytest.raises(CallbackError, match="model 'first'"), hs.installed():
        step(sound, first, second, first)
    fly(sound)


def test_an_exception_of_the_block_comes_first(spec):
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
    no_numbers(spec, ["rotor"])
    models = [spec.compile() for _ in range(4)]
    data = [mujoco.MjData(models[0]) for _ in range(2)]
    size = mujoco.mj_stateSize(models[0], mujoco.mjtState.mjSTATE_FULLPHYSICS)
    with pytest.raises(CallbackError, match="don't stand one after"), hs.installed():
        rollout.rollout(models, data, np.zeros((4, size)), nstep=20)


@pytest.mark.parametrize("model", ["scene.xml", None])
def test_what_is_no_model_is_told_so(model):
    for ask in (hs.check_model, lambda model: hs.set_controller(model, None)):
        with pytest.raises(InputError, match=r"a mujoco\.MjModel is needed"):
            ask(model)
