"""Residualisation: six degrees of freedom from a model with rotor and servos."""

import numpy as np
import pytest

from helisim.base.errors import InputError
from helisim.base.linear import LinearSystem
from helisim.vehicle.linearize import RIGID_BODY


def spring_with_actuator():
    """A mass on a spring, pushed through a first-order lag, and its place counted by a meter.

    x'' = -4 x - x' + f, f' = 20 (u - f), meter' = x: by hand, x'' = -4 x - x' + u.
    """
    a = [[0, 1, 0, 0], [-4, -1, 1, 0], [0, 0, -20, 0], [1, 0, 0, 0]]
    b, c, d = [[0], [0], [20], [0]], [[1, 0, 0, 0], [0, 0, 1, 0]], [[0], [0]]
    return LinearSystem(a, b, c, d, None, ("u",), ("x", "f"), ("x", "speed", "f", "meter"))


def test_a_lag_is_where_it_settles():
    """The lag's output is its input, in the states' rates and in the outputs."""
    found = spring_with_actuator().residualised(("x", "speed"), without=("meter",))
    assert found.states == ("x", "speed")
    assert found.a == pytest.approx(np.array([[0, 1], [-4, -1]]))
    assert found.b == pytest.approx(np.array([[0], [1]]))
    assert found.d == pytest.approx(np.array([[0], [1]]))


def test_what_never_settles_is_named():
    """The meter counts for ever: it has no value at which it stays."""
    with pytest.raises(InputError, match="never settles, among f, meter"):
        spring_with_actuator().residualised(("x", "speed"))


def test_a_sampled_model_and_a_missing_state_are_refused():
    sampled = spring_with_actuator().discretise(0.01)
    with pytest.raises(InputError, match=r"period of 0\.01 s"):
        sampled.residualised([sampled.states[0]])
    with pytest.raises(InputError, match="no state 'u'"):
        spring_with_actuator().residualised(RIGID_BODY)


def test_six_degrees_of_freedom_have_the_whole_models_response_at_low_frequency(jr700):
    """Far below the rotor's 15 and 27 rad/s both models answer alike; the fast modes are gone."""
    whole = jr700.linearize("IN1")
    rigid = whole.rigid_body()
    assert rigid.system.state_labels == list(RIGID_BODY)
    assert rigid.trim == whole.trim
    omega = np.array([0.01])
    rows = [whole.system.output_labels.index(name) for name in ("u", "v", "w", "p", "q", "r")]
    wanted, found = whole.response(omega)[rows], rigid.response(omega)[rows]
    # the servos' and rotor's lags, 0.1 s together, turn a response at 0.01 rad/s by 1e-3
    assert np.abs(found - wanted).max() < 5e-3 * np.abs(wanted).max()


def test_hovers_pitch_damping_is_the_closed_form(jr700):
    """M_q of a disc that follows at once: M_a times its lag behind the shaft.

    0 = -a + A_b b - tau q and 0 = -b + B_a a: a = -tau q / (1 - A_b B_a); M_q = M_a a / q.
    """
    derivatives = jr700.derivatives
    found = jr700.linearize("IN1").rigid_body().derivative("q", "q")
    disc = 1.0 - derivatives["A_b"] * derivatives["B_a"]
    wanted = -derivatives["M_a"] * derivatives["tau_f"] / disc
    # left out: the airflow's own turning about the hub, and the tail's part
    assert found == pytest.approx(wanted, rel=0.02)
