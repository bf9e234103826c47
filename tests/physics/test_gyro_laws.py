"""The gyro's filters, the swashplate's mixing and the servos' delay."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from helisim.physics import gyro
from plates import H3_120

FREQUENCY, DAMPING = 175.0, 0.7
unit = st.floats(-1.0, 1.0)


@given(
    first=st.floats(1e-4, 0.1),
    second=st.floats(1e-4, 0.1),
    period=st.sampled_from([0.001, 0.002, 0.01]),
)
def test_filters_are_sampled_exactly(first, second, period):
    """Two filters in a row, what drives them held: their convolution, also if they are alike."""
    decay = math.exp(-period / first)
    assert gyro.filter_share(first, period) == pytest.approx(1.0 - decay, rel=1e-12)
    for other in (second, first, first * (1.0 + 1e-9)):

        def arriving(time, other=other):
            return math.exp(-time / first - (period - time) / other) / other

        wanted, _ = quad(arriving, 0.0, period, epsabs=1e-14, epsrel=1e-12, limit=200)
        assert gyro.filter_through(first, other, period) == pytest.approx(wanted, rel=1e-9)
    mean = first / period * (1.0 - decay)
    assert gyro.filter_mean(first, period) == pytest.approx(mean, rel=1e-12)


@pytest.mark.parametrize("period", [0.001, 0.002, 0.004])
def test_held_lag_is_the_lag_of_the_sampled_filter(period):
    """A ramp through the filter of held samples comes out late by `held_lag`."""
    time_constant = 0.003
    decay = math.exp(-period / time_constant)
    state, ramp = 0.0, 0.0
    for k in range(200):
        ramp = k * period
        late = ramp - state
        state = decay * state + (1.0 - decay) * ramp
    assert late == pytest.approx(gyro.held_lag(time_constant, period), rel=1e-9)  # settled


@given(col=unit, lon=unit, lat=unit)
def test_unmix_undoes_mix(col, lon, lat):
    """From swashplate to servos and back is the identity, to rounding."""
    assert H3_120.unmix(*H3_120.mix(col, lon, lat)) == pytest.approx((col, lon, lat), abs=1e-15)


@given(omega=st.floats(0.1, 10.0))
def test_equivalent_delay_is_the_low_frequency_phase(omega):
    """Well below its bandwidth the servo's phase is that of a delay 2 z / w."""
    phase = -np.angle(FREQUENCY**2 / (FREQUENCY**2 - omega**2 + 2j * DAMPING * FREQUENCY * omega))
    delay = gyro.equivalent_delay(FREQUENCY, DAMPING)
    assert delay == pytest.approx(0.008, rel=1e-12)  # 8 ms (design, section 5)
    # next term of the phase is of relative order (omega / frequency)^2
    assert phase / omega == pytest.approx(delay, rel=(omega / FREQUENCY) ** 2 + 1e-12)
