"""Laws that fail, and what is no law: told in one line, and nothing flies on."""

import mujoco
import numba
import numpy as np
import pytest

import helisim as hs
import own_laws
from helisim.base.errors import CallbackError, DivergedError, InputError
from helisim.vehicle import Controller
from helisim.vehicle.trim import place

SHORT = hs.Sweep(axis="ped", duration=12.0, trim_time=1.0)
FAST = hs.Doublet(axis="lat", duration=4.0, trim_time=1.0)


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
        assert 'File "test_failing_controller.py", line' in traceback
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
