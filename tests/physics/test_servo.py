"""Servos and swashplate mixing."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from helisim.physics.gyro import equivalent_delay, servo_rates
from plates import H3_120

FREQUENCY, DAMPING = 175.0, 0.7
NO_LIMIT = 1e9
unit = st.floats(-1.0, 1.0)


def step_response(size, time, *, rate_limit=NO_LIMIT, travel=NO_LIMIT):
    def rates(_, state):
        return servo_rates(*state, size, FREQUENCY, DAMPING, rate_limit, travel)

    solution = solve_ivp(rates, (0.0, time[-1]), [0.0, 0.0], t_eval=time, rtol=1e-9, atol=1e-12)
    return solution.y


@given(col=unit, lon=unit, lat=unit)
def test_unmix_undoes_mix(col, lon, lat):
    """From swashplate to servos and back is the identity, to rounding."""
    assert H3_120.unmix(*H3_120.mix(col, lon, lat)) == pytest.approx((col, lon, lat), abs=1e-15)


def test_small_step_is_the_analytic_second_order():
    """Within its limits a servo answers as w^2 / (s^2 + 2 z w s + w^2)."""
    time = np.linspace(0.0, 0.06, 61)
    damped = FREQUENCY * math.sqrt(1.0 - DAMPING**2)
    decay = np.exp(-DAMPING * FREQUENCY * time)
    phase = np.cos(damped * time) + DAMPING * FREQUENCY / damped * np.sin(damped * time)
    # 1e-9 relative error asked of the integration, with a margin for its accumulation
    assert step_response(0.01, time)[0] == pytest.approx(0.01 * (1.0 - decay * phase), abs=1e-9)


@given(omega=st.floats(0.1, 10.0))
def test_equivalent_delay_is_the_low_frequency_phase(omega):
    """Well below its bandwidth the servo's phase is that of a delay 2 z / w."""
    phase = -np.angle(FREQUENCY**2 / (FREQUENCY**2 - omega**2 + 2j * DAMPING * FREQUENCY * omega))
    delay = equivalent_delay(FREQUENCY, DAMPING)
    assert delay == pytest.approx(0.008, rel=1e-12)  # 8 ms (design, section 5)
    # next term of the phase is of relative order (omega / frequency)^2
    assert phase / omega == pytest.approx(delay, rel=(omega / FREQUENCY) ** 2 + 1e-12)
