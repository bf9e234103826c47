"""The gyro's laws, one by one."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helisim.physics import gyro

LEAD, FILTER = 0.0109, 0.002
finite = st.floats(-10.0, 10.0)


@pytest.mark.parametrize("omega", [1.0, 20.0, 300.0])
def test_yaw_lead_is_its_transfer_function(omega):
    """The rate reaches the error as (1 + (lead + filter) s) / (1 + filter s)."""
    pole = gyro.yaw_error(0.0, 0.0, 1.0, 1.0, 1.0, LEAD, FILTER, FILTER)[1]
    drive = gyro.yaw_error(0.0, 1.0, 0.0, 1.0, 1.0, LEAD, FILTER, FILTER)[1]
    state = drive / (1j * omega - pole)
    by_state = -gyro.yaw_error(0.0, 0.0, 1.0, 1.0, 1.0, LEAD, FILTER, FILTER)[0]
    direct = -gyro.yaw_error(0.0, 1.0, 0.0, 1.0, 1.0, LEAD, FILTER, FILTER)[0]
    s = 1j * omega
    closed = (1.0 + (LEAD + FILTER) * s) / (1.0 + FILTER * s)
    assert by_state * state + direct == pytest.approx(closed, rel=1e-12)  # rounding


def test_yaw_error_of_a_steady_turn():
    """With the lead settled the error is eq. (7)'s k_delta PED - k_a r: zero at r = 9.11 PED."""
    r = 0.1 * 2.68 / 0.2941
    error, lead_rate = gyro.yaw_error(0.1, r, r, 2.68, 0.2941, LEAD, FILTER, FILTER)
    assert error == pytest.approx(0.0, abs=1e-16)
    assert lead_rate == 0.0
    assert gyro.yaw_command(0.5, 0.02, 0.8646, 17.7) == 0.8646 * 0.5 + 17.7 * 0.02


@given(phase=st.floats(-4.0, 4.0), lat=finite, lon=finite)
def test_rotation_keeps_length_and_turns_back(phase, lat, lon):
    """The swashplate phase is a rotation: its inverse is the opposite angle."""
    cosine, sine = math.cos(phase), math.sin(phase)
    turned = gyro.rotate(cosine, sine, lat, lon)
    assert math.hypot(*turned) == pytest.approx(math.hypot(lat, lon), rel=1e-12)  # rounding
    assert gyro.rotate(cosine, -sine, *turned) == pytest.approx((lat, lon), abs=1e-14)


def test_rotation_sign():
    """A quarter turn moves lon into lat, as M = [cos sin; -sin cos] says."""
    assert gyro.rotate(0.0, 1.0, 0.0, 1.0) == (1.0, 0.0)


def test_rate_filter_is_first_order():
    """A low-pass of time constant T moves at (signal - state) / T."""
    assert gyro.filter_rate(0.25, 1.25, 0.004) == 250.0


@given(error=finite, command=finite)
def test_anti_windup_holds_only_what_makes_it_worse(error, command):
    """Beyond the limit the integral may only come back; within it, it is free."""
    rate = gyro.hold_when_saturated(error, command, 0.5)
    pushes = abs(command) > 0.5 and np.sign(error) == np.sign(command)
    assert rate == (0.0 if pushes and error * command > 0.0 else error)


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
