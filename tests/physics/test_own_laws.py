"""A law of one's own in the process's table, and in a vehicle's ticks."""

import mujoco
import numpy as np
import pytest

import helisim as hs
from helisim.base.errors import CallbackError, ModelError
from helisim.physics import laws
from helisim.physics.gyro import cyclic_law, yaw_law
from helisim.physics.laws import OwnLaw, Registered, is_registered, token
from helisim.physics.layout import HISTORY, INJECTION, PARAM, STATE
from helisim.vehicle import Controller
from helisim.vehicle.addresses import addresses
from helisim.vehicle.trim import Motion, write_motion
from tabled import tabled


def test_a_law_is_known_until_it_is_released():
    """By handle, process and count of states; a failure is told once."""
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


def test_a_failed_law_leaves_the_servos_where_they_were(jr700):
    """At its third tick; the second tick's commands stay, and the block says why."""
    given = []

    def law(seen, state):
        state[0] += 1.0
        given.append(state[0])
        return [0.1 * state[0], 0.2, 0.3, np.nan if state[0] > 2.0 else 0.4]

    model = jr700.model.__copy__()
    hs.set_controller(model, Controller(law, states=1))
    data = mujoco.MjData(model)
    with pytest.raises(CallbackError, match="finite numbers"), hs.installed():
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
    """Functions of one to three arguments; state and settings are its own, traceback and all."""

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


@pytest.mark.parametrize("bad", ["swash", "tail"])
def test_either_half_that_fails_stops_both(jr700, bad):
    halves = {"swash": lambda seen: (0.1, 0.2, 0.3), "tail": lambda seen: 0.4}
    halves[bad] = lambda seen: NAN
    model = jr700.model.__copy__()
    hs.set_controller(model, Controller(**halves))
    data = mujoco.MjData(model)
    with pytest.raises(CallbackError, match="finite numbers"), hs.installed():
        mujoco.mj_step(model, data)
    assert np.isnan(data.sensor("servo_command").data).all()


def test_a_law_that_is_gone_is_missed(jr700):
    """Even while it flies: the servos stay, and the block says why."""
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
    """Each law has its own servos and states, beside the other half, shipped or not."""
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
    """Rates and attitude with what it adds, the heading within half a turn; nothing else moves."""
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
