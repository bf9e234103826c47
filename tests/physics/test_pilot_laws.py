"""Sweeps, doublets and the hashed noise behind the human remnant."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit

from helisim.physics import pilot

hashed_noise, remnant, sweep = (
    njit(law) for law in (pilot.hashed_noise, pilot.remnant, pilot.sweep)
)  # the hash wraps around at 64 bits, of which Python's own arithmetic warns

W_MIN, W_MAX, DURATION = 0.3, 30.0, 84.0
COUNT = 40_000
SIGMAS = 4.5
"""Chance of a false alarm 7e-6 for each statement, were the seeds not fixed."""


def noise(seed, channel, count=COUNT):
    return np.array([hashed_noise(seed, channel, k) for k in range(count)])


@given(time=st.floats(0.5, DURATION - 0.5))
def test_phase_derivative_is_the_frequency_formula(time):
    """d(phase)/dt = w_min + C2 (exp(C1 t/T) - 1)(w_max - w_min), C1 = 4, C2 = 1/(e^4 - 1)."""
    h = 1e-3
    phase = [pilot.sweep_phase(time + k * h, DURATION, W_MIN, W_MAX) for k in (-1, 1)]
    formula = W_MIN + (math.exp(4.0 * time / DURATION) - 1.0) / (math.exp(4.0) - 1.0) * (
        W_MAX - W_MIN
    )
    # truncation h^2/6 (C1/T)^2 w_max = 1.2e-8; rounding 1e-13 / h
    assert (phase[1] - phase[0]) / (2.0 * h) == pytest.approx(formula, abs=2e-8)


def test_unsteady_sweep_differs_by_seed():
    """A human sweep wobbles about the machine's, each seed in its own way."""
    time = np.linspace(2.0, DURATION - 2.0, 400)
    flown = [
        np.array([sweep(t, DURATION, W_MIN, W_MAX, 1.0, u, s) for t in time])
        for u, s in ((0.0, 1.0), (0.1, 1.0), (0.1, 2.0))
    ]
    assert not np.allclose(flown[1], flown[2])
    for wobbling in flown[1:]:
        # rms of 0.1 in amplitude and 0.1 rad in phase: 0.1 of the sweep, within a factor 2
        assert 0.05 < np.std(wobbling - flown[0]) / np.std(flown[0]) < 0.2


@pytest.mark.parametrize(("seed", "channel"), [(0, 3), (2_000_000_000, 2)])
def test_noise_has_zero_mean_and_unit_variance(seed, channel):
    """Mean 0 and variance 1 within 4.5 standard errors over 40000 knots, in any channel."""
    values = noise(seed, channel)
    assert abs(values.mean()) < SIGMAS / math.sqrt(COUNT)
    # kurtosis of a sum of four uniforms is 3 - 1.2 / 4 = 2.7: var(s^2) = 1.7 / n
    assert abs(values.var() - 1.0) < SIGMAS * math.sqrt(1.7 / COUNT)
    assert np.abs(values).max() <= 2.0 * math.sqrt(3.0)


def test_noise_is_white_and_independent():
    """No correlation from knot to knot, between channels, or between neighbouring seeds."""
    base = noise(7, 0)
    others = [base[1:], noise(7, 1), noise(7, 3), noise(8, 0), noise(6, 0), noise(1, 7)]
    for other in others:
        count = min(base.size, other.size)
        correlation = np.mean(base[:count] * other[:count])
        assert abs(correlation) < SIGMAS / math.sqrt(count)


def test_remnant_is_continuous_with_unit_variance():
    """Linear between knots, and its variance over time is 1."""
    interval = 0.1
    knots = [remnant(k * interval, interval, 4.0, 1) for k in range(1, 6)]
    for k, value in enumerate(knots, start=1):
        around = [remnant(k * interval + d, interval, 4.0, 1) for d in (-1e-9, 1e-9)]
        assert around == pytest.approx([value, value], abs=1e-7)  # slope below 100 / s x 1e-9 s
    time = np.linspace(0.0, 2000.0, 80_001)
    values = np.array([remnant(t, interval, 4.0, 1) for t in time])
    # 20000 independent knots; kurtosis of a mixture of neighbours stays below 3
    assert abs(values.var() - 1.0) < SIGMAS * math.sqrt(2.0 / 20_000)


def test_a_sweep_fades_in_and_out():
    """A sine of its phase, which begins at 0, under a trapezium; nothing before and after."""
    time = np.linspace(-2.0, DURATION + 2.0, 2001)
    shape = np.interp(time, [0.0, 3.0, DURATION - 3.0, DURATION], [0.0, 1.0, 1.0, 0.0])
    phase = [pilot.sweep_phase(t, DURATION, W_MIN, W_MAX) for t in time]
    found = [pilot.sweep(t, DURATION, W_MIN, W_MAX, 3.0, 0.0, 1.0) for t in time]
    assert found == pytest.approx(shape * np.sin(phase), abs=1e-12)  # rounding
    assert pilot.sweep_phase(0.0, DURATION, W_MIN, W_MAX) == 0.0


def test_a_doublet_is_as_long_one_way_as_the_other():
    found = [pilot.doublet(t, 3.0) for t in (-0.1, 0.0, 0.7, 1.49, 1.5, 2.9, 3.0, 9.0)]
    assert found == [0.0, 1.0, 1.0, 1.0, -1.0, -1.0, 0.0, 0.0]
