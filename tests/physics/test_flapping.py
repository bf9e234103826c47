"""Tip-path-plane dynamics against their closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helisim.physics.flapping import flap_back, flapping_rates

TAU, A_B, B_A = 0.04456, -0.3514, 0.5340  # Wu and Chen, Table 3, IN1
small = st.floats(-0.3, 0.3)


def rates(a, b, p=0.0, q=0.0, a_target=0.0, b_target=0.0):
    return np.array(flapping_rates(a, b, p, q, a_target, b_target, TAU, A_B, B_A))


@given(p=small, q=small, a_target=small, b_target=small)
def test_steady_tilt_is_the_closed_form(p, q, a_target, b_target):
    """At the solution of [1 -A_b; -B_a 1] [a b] = target - tau_f [q p] nothing moves."""
    a, b = np.linalg.solve([[1.0, -A_B], [-B_A, 1.0]], [a_target - TAU * q, b_target - TAU * p])
    # terms of order 1 / tau_f = 22 cancel: rounding of 22 x 2e-16 each
    assert rates(a, b, p, q, a_target, b_target) == pytest.approx(0.0, abs=1e-13)


@pytest.mark.parametrize("omega", [0.5, 15.0, 60.0])
def test_transfer_function_is_the_closed_form(omega):
    """Two first-order lags coupled by A_b and B_a: the determinant of the pair."""
    jacobian = np.column_stack([rates(1.0, 0.0), rates(0.0, 1.0)])
    gain = rates(0.0, 0.0, a_target=1.0)
    s = 1j * omega
    a, b = np.linalg.solve(s * np.eye(2) - jacobian, gain)
    lag = 1.0 + TAU * s
    determinant = lag**2 - A_B * B_A
    assert a == pytest.approx(lag / determinant, rel=1e-13)  # rounding
    assert b == pytest.approx(B_A / determinant, rel=1e-13)


def test_shaft_rates_drag_the_disc_behind():
    """A steady nose-up rate leaves the disc tilted forward by tau_f q, as Table 3's eq. (8)."""
    assert flapping_rates(-TAU * 0.5, 0.0, 0.0, 0.5, 0.0, 0.0, TAU, 0.0, 0.0)[0] == 0.0
    assert flapping_rates(0.0, -TAU * 0.5, 0.5, 0.0, 0.0, 0.0, TAU, 0.0, 0.0)[1] == 0.0


@given(advance=st.floats(-0.2, 0.2), pitch=st.floats(0.05, 0.2))
def test_flap_back_opposes_the_airspeed(advance, pitch):
    """The disc tilts away from the wind, in proportion and evenly for both directions."""
    tilt = flap_back(pitch, 0.03, advance)
    assert tilt * advance >= 0.0
    assert flap_back(pitch, 0.03, -advance) == -tilt


def test_flap_back_is_the_designs():
    """1.1e-3 rad per m/s in hover (design, section 3)."""
    tip_speed = 178.02358 * 0.767
    # two printed digits
    assert flap_back(0.07997, 0.0305, 1.0 / tip_speed) == pytest.approx(1.1e-3, abs=0.05e-3)
