"""Controllers of one's own in flight: Python, and njit; whole, in part, or none."""

import warnings

import control
import mujoco
import numba
import numpy as np
import pytest

import helisim as hs
import own_laws
from helisim.base.errors import DivergedError
from helisim.physics.gyro import gyro_law
from helisim.physics.layout import PARAM, STATE
from helisim.vehicle import Controller
from helisim.vehicle.addresses import addresses
from helisim.vehicle.law import on_law, trimmed_sticks
from own_laws import HOLDS
from tabled import tabled

SHORT = hs.Sweep(axis="ped", duration=7.0, trim_time=1.0, band=(1.0, 30.0))
FAST = hs.Doublet(axis="lat", duration=4.0, trim_time=1.0)


def shipped(seen, state, settings):
    return gyro_law(seen, state, settings)


@pytest.fixture(scope="module")
def numbers(jr700):
    par = jr700.model.actuator_user[addresses(jr700.model).rotor].copy()
    first = STATE.gyro_q_filter
    return par, jr700.hovering().act[first : first + 8].copy()


def starting(state):
    values = tuple(state.tolist())
    count = len(values)

    def reset(seen, state):
        for k in range(count):
            state[k] = values[k]

    return reset


def same(one, other):
    return np.array_equal(one.values, other.values)


COUNT = len(PARAM)


def test_a_copy_of_the_shipped_laws_flies_the_same(jr700, numbers):
    """As Python and njit, to the last bit: they are instances of the same protocol."""
    par, state = numbers
    par = par[:COUNT]
    expected = hs.fly(jr700, SHORT, seed=3, jobs=1)[0]
    python = Controller(shipped, settings=par, reset=starting(state))
    native = Controller(numba.njit(shipped), settings=par, reset=numba.njit(starting(state)))
    for controller in (python, native):
        found = hs.fly(jr700, SHORT, seed=3, jobs=1, controller=controller)[0]
        assert same(found, expected)


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


@tabled("kind", "latency", "timestep")
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


def test_flights_have_copies_of_an_object(jr700):
    law = own_laws.Counter()
    one = hs.fly(jr700, FAST, seed=2, count=2, jobs=1, controller=law)
    two = hs.fly(jr700, FAST, seed=2, count=2, jobs=2, controller=law)
    assert all(map(same, one, two))
    assert law.calls == law.resets == 0


@pytest.mark.parametrize("own", [False, True])
def test_an_evaluation_can_be_made_again(jr700, own):
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


def test_what_a_law_sees_is_the_truth(jr700):
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


@numba.njit
def divides(seen):
    return seen.front, seen.left, seen.right, seen.tail / (1.0 if seen.time < 0.9995 else 0.0)


FAILING = {
    "raises": (raises, "raised RuntimeError: out of fuel after 501 ticks", "in raises"),
    "divides": (divides, "returned a command or left a state that is not finite", None),
}


@pytest.mark.parametrize("how", FAILING)
def test_a_law_that_fails_ends_the_flight(jr700, how):
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


@tabled("law", "error", "says")
def test_what_is_no_law_or_returns_something_else_is_refused(jr700, law, error, says):
    with pytest.raises(error, match=says) as caught:
        hs.fly(jr700, FAST, controller=law, keep_ended=True, jobs=1)
    assert "\n" not in str(caught.value)


# A pilot's gains on other laws: drift beside that on the gyro, known ratios, what is refused.

GIVEN = (-0.01, 0.15, 0.15, 0.035)
"""Gains of COL, LON, LAT and PED as the JR700's file has them."""
OUTER = (0.04, 0.1, 0.15)


@tabled("changes", "times")
def test_sticks_that_ask_for_times_as_much_are_moved_by_one_over_it(jr700, changes, times):
    gyro = hs.RateCommand.of(jr700)
    own = gyro.parameters()
    law = gyro.replace({name: by * own[name] for name, by in changes.items()})
    for found in on_law(jr700.with_controller(law), GIVEN, *OUTER):
        # 2 %: roll and pitch turn into each other, which a stick of one alone doesn't undo
        np.testing.assert_allclose(found, np.multiply(times, GIVEN), rtol=0.02 * bool(changes))


def test_an_attitude_command_is_led_and_where_feedback_diverges_not_fed_back(jr700):
    """The attitude wanted is reached, on the Lynx by leading; the loop closes by 0.92 to 1."""
    lynx = (-0.01, 0.5, 0.5, 0.1), 0.02, 0.05, 0.1  # of its file
    for vehicle, gains, share in ((jr700, (GIVEN, *OUTER), 0.6), (hs.load("lynx"), lynx, 2e-3)):
        ahead, back = (one[1:3] for one in on_law(vehicle.with_controller(HOLDS), *gains))
        np.testing.assert_allclose(0.6 * ahead / (1.0 + 0.6 * back), 1.0, rtol=0.1)
        assert np.all(back < share * ahead)


def test_a_law_that_diverges_keeps_the_files_gains_with_a_note(jr700):
    plate, trim = jr700.swashplate, jr700.trim

    def rates_up(seen):
        return (*plate.mix(seen.COL, seen.LON + 0.02 + 0.3 * seen.q, seen.LAT - 0.03), seen.PED)

    vehicle = jr700.with_controller(rates_up)
    with pytest.warns(UserWarning, match=r"'rates_up': .*grows at .* 1/s; the pilot keeps"):
        ahead, back = on_law(vehicle, GIVEN, *OUTER)
    assert tuple(ahead) == tuple(back) == GIVEN
    found = trimmed_sticks(vehicle.controller, vehicle.model, trim)
    held = (trim.col, trim.lon - 0.02, trim.lat + 0.03, trim.ped)
    np.testing.assert_allclose(found, held, atol=2e-9)  # commands settle to 1e-9


def fails(seen):
    raise ValueError("no law")


@pytest.mark.parametrize("law", [None, hs.Controller(tail=None), fails])
def test_nothing_is_scaled_where_there_is_nothing_to_scale_by(jr700, law):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ahead, back = on_law(jr700.with_controller(law), GIVEN, *OUTER)
    assert tuple(ahead) == tuple(back) == GIVEN
