"""The gyro's laws, one by one."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from helisim.physics import gyro
from helisim.physics.layout import NEVER, PARAM
from helisim.vehicle.swashplate import PLATE
from plates import H3_120

PERIOD, LEAD, FILTER, FAST, SLOW = 0.002, 0.0109, 0.002, 0.004, 0.006
K_P, K_I, K_DELTA, K_A = 0.9, 17.0, 2.0, 0.3
SETTINGS = np.zeros(len(PARAM))
for slot, number in {
    "period": PERIOD,
    "k_p": K_P,
    "k_i": K_I,
    "k_delta": K_DELTA,
    "k_a": K_A,
    "lead": LEAD,
    "lead_share": gyro.filter_share(FILTER, PERIOD),
    "lead_lag": gyro.held_lag(FILTER, PERIOD),
    "heading_lock": 1.0,
    "attitude_lock": 1.0,
    "hold_above": NEVER,
    "filter_share": gyro.filter_share(FAST, PERIOD),
    "filter_mean": gyro.filter_mean(FAST, PERIOD),
    "derivative_share": gyro.filter_share(SLOW, PERIOD),
    "derivative_through": gyro.filter_through(FAST, SLOW, PERIOD),
    "derivative_lag": gyro.held_lag(SLOW, PERIOD),
    "kp_lat": 0.05,
    "ki_lat": 1.3,
    "p_per_lat": 6.0,
    "phase_cosine": 1.0,
}.items():
    SETTINGS[getattr(PARAM, f"gyro_{slot}")] = number
SETTINGS[PLATE] = H3_120.numbers
NOTHING = gyro.Seen(*[0.0] * len(gyro.Seen._fields))


def response(law, states, name, omega):
    """Return the frequency response of a linear law from one of the numbers that it sees."""
    columns = []
    for unit in 1e-3 * np.eye(states + 1):  # far from the commands' limits
        state = unit[:states].copy()
        command = law(NOTHING._replace(**{name: unit[states]}), state, SETTINGS)
        columns.append([command, *state])
    found = 1e3 * np.array(columns).T
    z = np.exp(1j * omega * PERIOD)
    state = np.linalg.solve(z * np.eye(states) - found[1:, :states], found[1:, states])
    return found[0, :states] @ state + found[0, states]


@pytest.mark.parametrize("omega", [0.5, 5.0, 50.0])
def test_yaw_law_is_the_papers_with_a_lead(omega):
    """Eq. (7), ped = (k_p + k_I/s)(k_delta PED - k_a r), the rate led in its proportional part.

    What is left is half a period of the filter, where the integral takes the lead from it.
    """
    s = 1j * omega
    lag = gyro.held_lag(FILTER, PERIOD)
    left = 0.5 * omega * PERIOD * omega * (LEAD + lag)
    pedal = response(gyro.yaw_law, 2, "PED", omega)
    assert pedal == pytest.approx((K_P + K_I / s) * K_DELTA, rel=left)
    rate = response(gyro.yaw_law, 2, "r", omega)
    led = (1.0 + (LEAD + lag) * s) / (1.0 + lag * s)
    assert rate == pytest.approx(-(K_P + K_I / s) * K_A * led, rel=left)


@pytest.mark.parametrize("omega", [0.5, 5.0, 50.0])
def test_cyclic_law_is_rate_tracking(omega):
    """(Kp + Ki/s)(R d - y), y the rate behind its filter and held: design, section 5.

    The integral is that of the filter's output within the period too; what is left is of second
    order in the period. The derivative's sampling is in the tests of the restated dynamics.
    """

    def lat(seen, state, settings):
        front, left, right = gyro.cyclic_law(seen, state, settings)
        assert front == pytest.approx(-0.5 * (left + right), abs=1e-15)  # no collective
        return (left - right) / math.sqrt(3.0)

    s = 1j * omega
    hold = -np.expm1(-s * PERIOD) / (s * PERIOD)
    y = hold / (FAST * s + 1.0)
    left = (omega * PERIOD) ** 2
    found = response(lat, 6, "p", omega)
    assert found == pytest.approx(-(0.05 + 1.3 / s) * y, rel=left)
    stick = response(lat, 6, "LAT", omega)
    assert stick == pytest.approx(6.0 * (0.05 + 1.3 * hold / s), rel=left)


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
