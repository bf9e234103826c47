"""Controllers of one's own in flight: Python, njit and cfunc; whole, in part, or none."""

import copy
from pathlib import Path

import control
import mujoco
import numba
import numpy as np
import pytest
from numba import types

import helisim as hs
import own_laws
from helisim.base.errors import CallbackError, DivergedError, InputError, ModelError
from helisim.physics import gyro
from helisim.physics.gyro import Seen, cyclic_law, gyro_law
from helisim.physics.layout import PARAM, STATE
from helisim.sim.flight import simulate
from helisim.vehicle import Controller
from helisim.vehicle.trim import addresses, place

TESTS = Path(__file__).resolve().parents[1]
SHORT = hs.Sweep(axis="ped", duration=12.0, trim_time=1.0)
FAST = hs.Doublet(axis="lat", duration=4.0, trim_time=1.0)


def shipped(seen, state, settings):
    """Do what the shipped gyro does."""
    return gyro_law(seen, state, settings)


def shipped_tail(seen, state, settings):
    """Do what the shipped gyro does with the tail."""
    return gyro.yaw_law(seen, state, settings)


def shipped_swash(seen, state, settings):
    """Do what the shipped gyro does with the swashplate."""
    return cyclic_law(seen, state, settings)


@pytest.fixture(scope="module")
def numbers(jr700):
    """Settings of the shipped laws, and their state in the hover, (n_param,) and (8,)."""
    par = jr700.model.actuator_user[addresses(jr700.model).rotor].copy()
    first = STATE.gyro_q_filter
    return par, jr700.hovering().act[first : first + 8].copy()


def starting(state):
    """Return a reset to a state."""
    values = tuple(state.tolist())
    count = len(values)

    def reset(seen, state):
        for k in range(count):
            state[k] = values[k]

    return reset


class Part:
    """A law as an object, with states, a start and a reset of its own."""

    def __init__(self, function, first):
        self.function, self.first, self.states = function, first, first.size

    def __call__(self, seen, state, settings):
        return self.function(seen, state, settings)

    def reset(self, seen, state):
        state[:] = self.first


def same(one, other):
    return np.array_equal(one.values, other.values)


COUNT = len(PARAM)
_POINTER = types.CPointer(types.float64)


@numba.cfunc(types.void(_POINTER, _POINTER, _POINTER, _POINTER))
def shipped_cfunc(seen, state, settings, commands):
    if seen[18] != 0.0:  # it starts: the state is behind the settings
        for k in range(8):
            state[k] = settings[COUNT + k]
    now = Seen(
        seen[0], seen[1], seen[2], seen[3], seen[4], seen[5], seen[6], seen[7], seen[8], seen[9],
        seen[10], seen[11], seen[12], seen[13], seen[14], seen[15], seen[16], seen[17],
    )  # fmt: skip
    front, left, right, tail = gyro_law(now, state, settings)
    commands[0], commands[1], commands[2], commands[3] = front, left, right, tail


def test_a_copy_of_the_shipped_laws_flies_the_same(jr700, numbers):
    """As Python, njit and cfunc, to the last bit: they are instances of the same protocol."""
    par, state = numbers
    par = par[:COUNT]
    expected = hs.fly(jr700, SHORT, seed=3, jobs=1)[0]
    python = Controller(shipped, settings=par, reset=starting(state))
    native = Controller(numba.njit(shipped), settings=par, reset=numba.njit(starting(state)))
    pointer = Controller(shipped_cfunc, settings=[*par, *state])
    for controller in (python, native, pointer):
        found = hs.fly(jr700, SHORT, seed=3, jobs=1, controller=controller)[0]
        assert same(found, expected)


def test_a_part_of_the_shipped_laws_flies_the_same(jr700, numbers):
    """One's own tail with the shipped swashplate, the other way round, and both apart."""
    par, state = numbers
    par = par[:COUNT]
    expected = hs.fly(jr700, SHORT, seed=3, jobs=1)[0]
    tail = {"tail": numba.njit(shipped_tail), "states": 2}
    swash = {"swash": numba.njit(shipped_swash), "states": 6}
    for parts, first in ((tail, state[6:]), (swash, state[:6])):
        reset = numba.njit(starting(first))
        controller = Controller(**parts, settings=par, reset=reset)
        assert same(hs.fly(jr700, SHORT, seed=3, jobs=1, controller=controller)[0], expected)
    apart = Controller(
        swash=Part(shipped_swash, state[:6]), tail=Part(shipped_tail, state[6:]), settings=par
    )
    assert apart.state_counts == (6, 2)
    assert same(hs.fly(jr700, SHORT, seed=3, jobs=1, controller=apart)[0], expected)


@pytest.mark.parametrize(
    ("law", "reset"),
    [
        (own_laws.pi_yaw, own_laws.pi_yaw_from_trim),
        (own_laws.pi_yaw_native, own_laws.pi_yaw_from_trim_native),
    ],
    ids=["python", "njit"],
)
def test_a_users_pi_law_is_the_shipped_yaw_gyro(jr700, law, reset):
    """Written anew from eq. (7), with the shipped cyclic: the same flight but for rounding."""
    settings = own_laws.pi_settings(jr700)
    controller = Controller(tail=law, states=2, settings=settings, reset=reset)
    expected = next(simulate(jr700, SHORT, seed=3, jobs=1))
    found = next(simulate(jr700.with_controller(controller), SHORT, seed=3, jobs=1))
    # 12 s of rounding of 1e-16 in a loop that is stable
    assert found.rates == pytest.approx(expected.rates, abs=1e-11)
    assert found.servo_commands == pytest.approx(expected.servo_commands, abs=1e-11)


def test_python_and_njit_fly_the_same_bits(jr700):
    """A law of all that is seen, sines included; all of it does something."""
    python, native = own_laws.attitude_controllers(jr700)
    one = hs.fly(jr700, FAST, seed=5, jobs=1, controller=python)[0]
    other = hs.fly(jr700, FAST, seed=5, jobs=1, controller=native)[0]
    assert same(one, other)
    assert not same(one, hs.fly(jr700, FAST, seed=5, jobs=1)[0])
    for k in range(5):
        without = own_laws.attitude_settings(jr700)
        without[k] *= 0.5
        _, changed = own_laws.attitude_controllers(jr700, without)
        assert not same(one, hs.fly(jr700, FAST, seed=5, jobs=1, controller=changed)[0])


def stepped(vehicle, stick, size, seconds):
    """Return p, q, r after a step of a stick, the mean odd part of two, (n_time, 3)."""
    rows = []
    for sign in (1.0, -1.0):
        data, where = vehicle.hovering(), addresses(vehicle.model)
        data.ctrl[where.control + stick] += sign * size
        rates = []
        with hs.installed():
            for _ in range(round(seconds / vehicle.model.opt.timestep) + 1):
                rates.append(sign * data.qvel[3:6] * [1.0, -1.0, -1.0])
                mujoco.mj_step(vehicle.model, data)
        rows.append(np.array(rates))
    return 0.5 * (rows[0] + rows[1])


@pytest.mark.parametrize("kind", [0, 1], ids=["python", "njit"])
@pytest.mark.parametrize("latency", [0.0, 0.004])
@pytest.mark.parametrize("timestep", [0.002, 0.001])
def test_linearisation_is_what_a_law_flies(kind, latency, timestep):
    """A small step of each stick, in flight and by `linearize("IN2")`, of a law of everything.

    Rates, late by the gyro's latency, angles, forces a time step late, servos: what the law makes
    of them. Half the gain of any one of them in the linear model, or a force that isn't late,
    would show by 3e-4 of the greatest rate and more.
    """
    vehicle = hs.load(parameters={"gyro.latency": latency}, timestep=timestep)
    vehicle = vehicle.with_controller(own_laws.attitude_controllers(vehicle)[kind])
    linear = vehicle.linearize("IN2")
    law = vehicle.gyro.system
    assert {"p", "phi", "psi", "ax", "ay", "front", "left", "right"} <= set(law.input_labels)
    assert "tail" not in law.input_labels
    size, seconds = 1e-3, 0.5
    rows = [linear.system.output_labels.index(name) for name in ("p", "q", "r")]
    every = round(0.002 / timestep)
    for stick in (1, 2):
        flown = stepped(vehicle, stick, size, seconds)[::every]
        time = 0.002 * np.arange(len(flown))
        inputs = np.zeros((4, time.size))
        inputs[stick] = size
        said = np.asarray(control.forced_response(linear.system, time, inputs).outputs)[rows].T
        # even terms cancel; cubic ones, (1e-3)^2, and RK4 of servos of 200 rad/s are left
        assert flown == pytest.approx(said, abs=1e-5 * np.abs(said).max())


def test_linearisation_of_a_copy_is_that_of_the_shipped_laws(jr700, numbers):
    """Matrices, loop and tuning's sensitivity: the same to the difference quotient's rounding."""
    par, state = numbers
    controller = Controller(shipped, settings=par[:COUNT], reset=starting(state))
    own, known = jr700.with_controller(controller).gyro.system, jr700.gyro.system
    for name in "ABCD":
        assert getattr(own, name) == pytest.approx(getattr(known, name), abs=1e-9)
    assert own.input_labels == known.input_labels
    assert jr700.gyro.system.state_labels[0] == "gyro_q_filter"


def test_a_law_that_can_not_hold_the_hover_is_refused_by_the_linearisation(jr700):
    """One that keeps the nose of the swashplate up, whatever it sees."""
    vehicle = jr700.with_controller(lambda seen: (0.1, 0.0, 0.0, 0.1 * seen.r))
    with pytest.raises(ModelError, match="can't hold this flight"):
        vehicle.linearize("IN2")
    with pytest.raises(InputError, match="no controller moves the servos"):
        jr700.with_controller(None).linearize("IN2")
    assert jr700.with_controller(None).linearize("IN1").system.nstates == 22


def test_flights_have_copies_of_an_object(jr700):
    """The same bytes for any number of threads, and the object itself never flies."""
    law = own_laws.Counter()
    one = hs.fly(jr700, FAST, seed=2, count=3, jobs=1, controller=law)
    two = hs.fly(jr700, FAST, seed=2, count=3, jobs=3, controller=law)
    assert all(map(same, one, two))
    assert law.calls == law.resets == 0


def test_a_method_as_a_law_flies_a_copy_of_its_object(jr700):
    """Law and reset of one object stay with one another."""
    law = own_laws.Counter()
    method = Controller(law.__call__, states=1, reset=law.reset)
    expected = hs.fly(jr700, FAST, seed=2, jobs=1, controller=law)[0]
    assert same(hs.fly(jr700, FAST, seed=2, jobs=1, controller=method)[0], expected)
    assert law.calls == law.resets == 0


def test_an_object_that_can_not_be_copied_is_refused(jr700):
    """Each flight has a copy of its own."""

    class Locked(own_laws.Counter):
        def __deepcopy__(self, memo):
            raise TypeError("it is bolted down")

    with pytest.raises(InputError, match=r"can't be copied.*bolted down"):
        hs.fly(jr700, FAST, controller=Locked())


def test_a_restart_resets_a_law(jr700):
    """Its state is zeros while the gyro restarts; then it is reset, with what it sees."""
    vehicle = jr700.with_controller(own_laws.Counter())
    model = copy.copy(vehicle.model)
    where = addresses(model)
    par = model.actuator_user[where.rotor]
    par[PARAM.faults], par[PARAM.restart_at], par[PARAM.restart_until] = 1.0, 0.1, 0.12
    data, kept = vehicle.hovering(), []
    with hs.installed():
        for _ in range(100):
            mujoco.mj_step(model, data)
            kept.append(data.act[where.state + STATE.gyro_q_filter])
    kept = np.array(kept)
    assert kept[:50].tolist() == [100.0 + k for k in range(1, 51)]
    assert np.all(kept[50:60] == 0.0)
    assert kept[60:].tolist() == pytest.approx([200.12 + k for k in range(1, 41)])


@pytest.mark.parametrize("own", [False, True])
def test_an_evaluation_can_be_made_again(jr700, own):
    """`mj_forward` before steps, any number of times, changes nothing: no integral winds up."""
    python, _ = own_laws.attitude_controllers(jr700)
    vehicle = jr700.with_controller(python) if own else jr700
    ends = []
    for times in (0, 1, 3):
        data, where = vehicle.hovering(), addresses(vehicle.model)
        with hs.installed():
            for k in range(60):
                data.ctrl[where.control + 1 : where.control + 4] = 0.02 * np.sin(0.2 * k)
                for _ in range(times):
                    mujoco.mj_forward(vehicle.model, data)
                mujoco.mj_step(vehicle.model, data)
        ends.append(np.concatenate([data.qpos, data.qvel, data.act]))
    assert np.array_equal(ends[0], ends[1])
    assert np.array_equal(ends[0], ends[2])


def test_a_flight_goes_on_from_a_saved_state(jr700):
    """All that a law knows is in MuJoCo's state: forces of the step before, too."""
    python, _ = own_laws.attitude_controllers(jr700)
    vehicle = jr700.with_controller(python)
    kind = mujoco.mjtState.mjSTATE_INTEGRATION
    state = np.empty(mujoco.mj_stateSize(vehicle.model, kind))
    data = vehicle.hovering()
    data.ctrl[addresses(vehicle.model).control + 2] = 0.03
    with hs.installed():
        mujoco.mj_step(vehicle.model, data, 50)
        mujoco.mj_getState(vehicle.model, data, state, kind)
        mujoco.mj_step(vehicle.model, data, 50)
        again = mujoco.MjData(vehicle.model)
        mujoco.mj_setState(vehicle.model, again, state, kind)
        mujoco.mj_step(vehicle.model, again, 50)
    assert np.array_equal(again.qpos, data.qpos)
    assert np.array_equal(again.act, data.act)


def test_what_a_law_sees_is_the_truth(jr700):
    """Time, rates, angles, servos and sticks now; forces of a step ago; PED late by 22 ms."""
    rows = []

    def watch(seen, state, settings):
        rows.append(seen)
        return gyro_law(seen, state, settings)

    par = jr700.model.actuator_user[addresses(jr700.model).rotor, :COUNT]
    vehicle = jr700.with_controller(Controller(watch, settings=par))
    data, where, true = vehicle.hovering(), addresses(vehicle.model), []
    with hs.installed():
        for k in range(40):
            data.ctrl[where.control : where.control + 4] = [0.01, 0.002 * k, -0.02, 0.03 * (k > 9)]
            x, y, z = data.qpos[4:7]
            w = data.qpos[3]
            roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
            pitch = -np.arcsin(2 * (w * y - z * x))
            servos = data.act[where.state : where.state + 8 : 2].copy()
            force = data.sensor("imu_accelerometer").data * [1, -1, -1]
            true.append([data.time, *(data.qvel[3:6] * [1, -1, -1]), roll, pitch, *force, *servos])
            mujoco.mj_step(vehicle.model, data)
    found = np.array(rows)
    true = np.array(true)
    assert np.array_equal(found[:, 0], true[:, 0])
    assert found[:, 1:6] == pytest.approx(true[:, 1:6], abs=1e-12)  # rounding
    assert np.array_equal(found[1:, 7:10], true[1:, 6:9])
    phi, theta, g = jr700.trim.phi, jr700.trim.theta, 9.8015
    weight = [np.sin(theta), -np.sin(phi) * np.cos(theta), -np.cos(phi) * np.cos(theta)]
    assert found[0, 7:10] == pytest.approx(g * np.array(weight), abs=1e-12)
    assert np.array_equal(found[:, 10:14], true[:, 9:])
    assert found[1:, 9] == pytest.approx(-10.0, abs=0.5)  # g, and a little more collective
    assert np.array_equal(found[:, 15], 0.002 * np.arange(40))
    assert np.all(found[:21, 17] == 0.0)  # from tick 10 on, and 22 ms later, linear between ticks
    assert np.all(found[22:, 17] == 0.03)


# Laws that fail, and what is no law: told in one line, and nothing flies on


def raises(seen, state):
    state[0] += 1.0
    if seen.time > 0.9995:
        raise RuntimeError(f"out of fuel after {state[0]:.0f} ticks")
    return seen.front, seen.left, seen.right, seen.tail


def gives_nan(seen):
    return seen.front, seen.left, seen.right, float("nan") if seen.time > 0.9995 else seen.tail


def gives_infinite_state(seen, state):
    state[0] = 1e308 * 10.0 if seen.time > 0.9995 else 0.0
    return seen.front, seen.left, seen.right, seen.tail


@numba.njit
def raises_natively(seen, state):
    state[0] += 1.0
    if seen.time > 0.9995:
        raise ValueError("too late")
    return seen.front, seen.left, seen.right, seen.tail


@numba.njit
def divides(seen):
    return seen.front, seen.left, seen.right, seen.tail / (1.0 if seen.time < 0.9995 else 0.0)


FAILING = {
    "raises": (raises, "raised RuntimeError: out of fuel after 501 ticks", "in raises"),
    "nan": (gives_nan, "returned tail = nan", None),
    "infinite": (gives_infinite_state, "left a state that is not finite", None),
    "native": (raises_natively, "raised ValueError: too late", "in raises_natively"),
    "divides": (divides, "raised ZeroDivisionError", "in divides"),
}


@pytest.mark.parametrize("how", FAILING)
def test_a_law_that_fails_ends_the_flight(jr700, how):
    """The record goes as far as the law did, and says why, with its traceback and no folder."""
    law, why, where = FAILING[how]
    record = hs.fly(jr700, SHORT, controller=law, keep_ended=True, jobs=1)[0]
    assert len(record) == 100
    assert np.isfinite(record.values).all()
    assert record.ended.startswith(f"controller {law.__name__!r} {why}")
    assert record.ended.endswith("at 1.00 s")
    traceback = record.provenance["ended"]["traceback"]
    if where is None:
        assert traceback == ""
    else:
        assert where in traceback
        assert 'File "test_own_controller.py", line' in traceback
    with pytest.raises(DivergedError, match="controller") as caught:
        hs.fly(jr700, SHORT, controller=law, jobs=2, count=2)
    assert "amplitude" not in str(caught.value)
    assert getattr(caught.value, "__notes__", []) == ([traceback] if traceback else [])


@pytest.mark.parametrize(
    ("law", "says"),
    [
        (lambda seen: (1.0, 2.0), r"returned \(1.0, 2.0\) where numbers for front, left, right"),
        (lambda seen: None, "returned None where numbers"),
        (lambda seen: "fast", "returned 'fast'"),
        (lambda seen: (1.0, "2", {}, 4.0), "returned"),
        (lambda seen, state: state[8], "raised IndexError.*has 8 states and 0 settings.*states=N"),
        (
            numba.njit(lambda seen, state: (state[8], 0.0, 0.0, 0.0)),
            "raised IndexError.*has 8 states",
        ),
        (lambda seen: (0.0, 0.0, 0.0), r"for front, left, right, tail .*Controller\(swash=law\)"),
        (lambda seen: 0.0, r"for front, left, right, tail are wanted; .* Controller\(tail=law\)"),
    ],
)
def test_a_law_that_returns_something_else_ends_before_the_flight(jr700, law, says):
    """At its first tick: there is no record."""
    with pytest.raises(DivergedError, match=says):
        hs.fly(jr700, FAST, controller=law, keep_ended=True, jobs=1)


def test_a_law_that_fails_in_steps_of_ones_own_is_said_when_the_block_ends(jr700):
    """The servos stay where they were, the simulation finite, and a reset starts anew."""
    vehicle = jr700.with_controller(raises)
    data = vehicle.hovering()
    with pytest.raises(CallbackError, match="out of fuel") as caught, hs.installed():
        mujoco.mj_step(vehicle.model, data, 520)
    assert "in raises" in str(caught.value)
    assert np.isfinite(data.qpos).all()
    place(vehicle.model, data, vehicle.trim)
    with hs.installed():
        mujoco.mj_step(vehicle.model, data, 400)


def test_of_two_laws_that_fail_both_are_told(jr700):
    """One is the error, the other its note."""
    vehicle = jr700.with_controller(Controller(swash=lambda seen: 1 / 0, tail=lambda seen: None))
    with pytest.raises(CallbackError, match="controller '<lambda>'") as caught, hs.installed():
        mujoco.mj_step(vehicle.model, vehicle.hovering())
    told = " ".join([str(caught.value), *caught.value.__notes__])
    assert "division by zero" in told
    assert "numbers for tail are wanted" in told


@pytest.mark.parametrize(
    ("law", "says"),
    [
        (3, "must be a function of"),
        ("fast", "must be a law, a Controller, None or 'own'"),
        (lambda: (0, 0, 0, 0), "takes nothing"),
        (lambda seen, state, settings, more: None, r"takes \(seen, state, settings, more\)"),
        (own_laws.Counter, r"must be a function of.*give an object of it, Counter\(\.\.\.\)"),
        (numba.njit(lambda seen: (1.0, 2.0)), "can't compile .* expected 4, got 2"),
        (numba.njit(lambda seen: seen.height), "can't compile .* 'height'"),
    ],
)
def test_what_is_no_law_is_refused(jr700, law, says):
    """In one line, before anything flies."""
    with pytest.raises(InputError, match=says) as caught:
        hs.fly(jr700, FAST, controller=law)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"states": -1}, "states must be an integer from 0"),
        ({"states": 2.5}, "states must be"),
        ({"settings": [1.0, float("nan")]}, "settings must be a list of finite numbers"),
        ({"settings": "fast"}, "settings must be"),
        ({"tail": own_laws.pi_yaw}, "not both"),
        ({"reset": 3}, "reset of a controller must be"),
        ({"law": None, "tail": "shiped"}, 'tail of a controller .* "shipped" or None; got \'ship'),
    ],
)
def test_what_is_no_controller_is_refused(given, says):
    """Each argument by its name."""
    with pytest.raises(InputError, match=says):
        Controller(**{"law": raises, **given})
