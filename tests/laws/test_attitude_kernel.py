"""What the attitude law does at its ticks: models, filters, limits, waiting."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import bilinear_zpk, freqz_zpk, tf2zpk

from helisim.design.laws import AttitudeCommand, Lead
from helisim.design.laws.attitude_command import command_model
from helisim.design.laws.attitude_kernel import ATTITUDE, COMPILED, INTEGRAL, LAT, LON, PED
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.loop import NoResponse
from helisim.physics.gyro import Seen
from own_laws import HOLDS

PERIOD = 0.002
STILL = Seen(*np.zeros(len(Seen._fields)).tolist())
OMEGA = np.geomspace(0.5, 300.0, 50)
STATES = {"LAT": LAT + ATTITUDE.state, "LON": LON + ATTITUDE.state, "PED": PED + ATTITUDE.state}
"""Stick -> setting that says where its axis's states begin."""


class Ticks:
    """A law at its ticks, its swashplate as it is: commands col, lon, lat, ped."""

    def __init__(self, law, period=PERIOD):
        self.settings, states = law.numbers(period)
        self.state = np.zeros(states)

    def __call__(self, **seen):
        return COMPILED(STILL._replace(**seen), self.state, self.settings)

    def states(self, stick):
        return self.state[int(self.settings[STATES[stick]]) :]


@pytest.mark.parametrize("damping", [0.5, 1.0, 1.5, 200.0, 1e6])
def test_command_model_is_a_second_order_system(damping):
    """Its step, as text books have it: x = 1 - (s2 e^(s1 t) - s1 e^(s2 t)) / (s2 - s1)."""
    w = 6.0
    axis = replace(HOLDS.lat, damping=damping, k_angle=0.0, k_rate=0.0, k_integral=0.0)
    ticks = Ticks(replace(HOLDS, lat=axis))
    angles = []
    for _ in range(500):
        ticks(LAT=0.5)
        angles.append(ticks.states("LAT")[0])
    t = PERIOD * np.arange(1, 501)
    apart = w * np.sqrt(complex((damping + 1e-7) ** 2 - 1.0))
    one, other = -damping * w - apart, -damping * w + apart
    step = 1.0 - (other * np.exp(one * t) - one * np.exp(other * t)) / (other - one)
    # the poles of a damping of 1 are kept apart by 1e-7 here
    np.testing.assert_allclose(angles, 0.6 * 0.5 * step.real, atol=1e-6)


@pytest.mark.parametrize("frequency", [0.5, 8.0, 300.0])
def test_the_command_model_of_yaw_is_a_lag_and_its_integral(frequency):
    """Over a tick, of angle, rate and a rate asked for: the matrix exponential."""
    moved, by = command_model(replace(HOLDS.ped, frequency=frequency), PERIOD)
    lag = np.array([[0.0, 1.0, 0.0], [0.0, -frequency, frequency], [0.0, 0.0, 0.0]])
    np.testing.assert_allclose(np.c_[moved, by], expm(PERIOD * lag)[:2], rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("one", [Lead(zero=20.0, pole=80.0), Lead(zero=60.0, pole=15.0)])
def test_filters_are_those_of_scipy_s_bilinear_rule(one):
    b0, b1, a1 = one.coefficients(PERIOD)
    z = np.exp(1j * OMEGA * PERIOD)
    ours = (b0 + b1 / z) / (1.0 + a1 / z)
    above, below = ([1.0 / place, 1.0] for place in (one.zero, one.pole))
    zpk = bilinear_zpk(*tf2zpk(above, below), 1.0 / PERIOD)
    theirs = freqz_zpk(*zpk, worN=OMEGA, fs=2.0 * np.pi / PERIOD)[1]
    np.testing.assert_allclose(ours, theirs, rtol=1e-10)


def test_an_inverse_ahead_makes_the_aircraft_follow_its_model():
    """Of dp/dt = -a p + b u the stick's answer is the command model, half a tick late.

    What a held stick costs; the rest, a (w T)^2 / 6 of rates that change within a tick, is 1e-4.
    """
    a, b = 3.0, 60.0
    axis = replace(HOLDS.lat, ff_acceleration=1.0 / b, ff_rate=a / b)
    law = AttitudeCommand(lat=axis, lon=HOLDS.lon, ped=HOLDS.ped)
    omega = np.geomspace(0.2, 10.0, 30)
    s = 1j * omega
    modelled = 0.6 * axis.frequency**2 / (s + axis.frequency) ** 2
    flown = ClosedLoop(Roll(a, b), law.linear(PERIOD), omega).command("lat").response
    np.testing.assert_allclose(flown / modelled, np.exp(-0.5 * PERIOD * s), rtol=1e-3)


def test_a_law_that_lacks_a_signal_closes_no_loop():
    rates_alone = Roll(3.0, 60.0)
    rates_alone.outputs = ("p", "r")
    loop = ClosedLoop(rates_alone, HOLDS.linear(PERIOD), OMEGA)
    with pytest.raises(NoResponse, match=r"the law senses .*phi, .*: the vehicle's model has p, r"):
        loop.broken("lat")


class Roll:
    """dp/dt = -a p + b u of commands that are held, from lat to p and phi."""

    inputs, outputs = ("lat",), ("p", "phi")

    def __init__(self, a, b):
        self.a, self.b = a, b

    def response(self, frequency):
        z, left = np.exp(1j * frequency * PERIOD), math.exp(-self.a * PERIOD)
        rate = self.b / self.a * (1.0 - left) / (z - left)
        moved = PERIOD - (1.0 - left) / self.a
        turned = (self.b / self.a * moved + (1.0 - left) / self.a * rate) / (z - 1.0)
        return np.stack([rate, turned])[:, None]


def test_it_starts_with_its_models_at_the_motion():
    ticks, motion = Ticks(HOLDS), {"phi": 0.2, "theta": -0.1, "psi": 1.5}
    seen = STILL._replace(**motion, p=0.3, q=-0.4, r=0.7)
    COMPILED.reset(seen, ticks.state, ticks.settings)
    found = [ticks.states(stick)[:2].tolist() for stick in STATES]
    assert found == [[0.2, 0.3], [-0.1, -0.4], [1.5, 0.7]]


@pytest.mark.parametrize(("stick", "angle"), [("LAT", "phi"), ("LON", "theta"), ("PED", "psi")])
def test_an_integral_does_not_wind_up(stick, angle):
    """At its stop it stays what it was, and works again when the command comes back."""
    ticks = Ticks(replace(HOLDS, phase=0.0))
    assert max(ticks(**{angle: -1.0})) == 0.5
    for _ in range(500):
        ticks(**{angle: -1.0})
    assert ticks.states(stick)[INTEGRAL] == 0.0
    ticks(**{angle: 0.01})
    assert ticks.states(stick)[INTEGRAL] < 0.0


def test_a_heading_is_held_through_south_and_let_go_where_it_can_not_be_reached():
    ticks = Ticks(HOLDS)
    for _ in range(2000):
        ticks(PED=0.5)
    assert abs(ticks.states("PED")[0]) < 1.0
    ticks = Ticks(HOLDS)
    ticks.states("PED")[0] = math.pi - 0.001
    commands = [ticks(psi=psi)[3] for psi in (math.pi - 0.002, -math.pi + 0.002)]
    assert abs(commands[1] - commands[0]) < 0.01
