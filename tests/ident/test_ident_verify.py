"""Time-domain simulation and verification."""

import control
import numpy as np
import pytest
from scipy.signal import cont2discrete, dlsim

from helisim.ident.simulation import simulate


def test_simulation_is_the_exact_discretisation():
    """The blocked simulation equals scipy's step-by-step one, also for an unstable model."""
    random = np.random.default_rng(0)
    for shift in (-2.0, 0.3):
        a = random.normal(size=(4, 4)) + shift * np.eye(4)
        b, c = random.normal(size=(4, 2)), random.normal(size=(2, 4))
        inputs = random.normal(size=(333, 2))
        inputs[0] = 0.0  # scipy's first-order hold starts from a shifted state otherwise
        a_d, b_d, c_d, d_d, step = cont2discrete((a, b, c, np.zeros((2, 2))), 0.01, method="foh")
        expected = dlsim((a_d, b_d, c_d, d_d, step), inputs)[1]
        got = simulate(control.ss(a, b, c, 0), inputs, 0.01)
        np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-10 * np.max(np.abs(expected)))


def test_simulation_starts_from_a_state():
    """A first-order model decays from its initial state as the exponential does."""
    model = control.ss([[-2.0]], [[1.0]], [[3.0]], [[0.0]])
    got = simulate(model, np.zeros((200, 1)), 0.01, start=np.array([1.0]))
    np.testing.assert_allclose(got[:, 0], 3.0 * np.exp(-0.02 * np.arange(200)), rtol=1e-12)


def test_a_static_gain_simulates():
    """A model without states is its gain."""
    got = simulate(control.ss([], [], [], [[2.0]]), np.ones((70, 1)), 0.01)
    assert got == pytest.approx(2.0)
