"""The order of a transfer function to begin with, told from a response."""

import numpy as np
import pytest

from helisim.ident.rational import order as found_order
from tabled import tabled

OMEGA = np.geomspace(1.0, 25.0, 60)
S = 1j * OMEGA


def named(omega, response):
    """Return the order as a structure's name."""
    zeros, poles = found_order(omega, response)
    return f"tf:{zeros}/{poles}"


@pytest.mark.parametrize("noise", [0.0, 0.02, 0.1])
@pytest.mark.parametrize(
    ("response", "order"),
    [
        (90.0 / (S + 6.0) * np.exp(-0.04 * S), "tf:0/1"),
        (90.0 / (S + 6.0) / (S / 200.0 + 1.0), "tf:0/1"),  # a servo far above the band
        (400.0 / (S**2 + 12.0 * S + 144.0) * np.exp(-0.1 * S), "tf:0/2"),
        ((-20.0 * S - 40.0) / (S**2 + 6.0 * S + 25.0) * np.exp(-0.03 * S), "tf:1/2"),
        ((0.4 * S + 0.1) / (S**2 + 0.9 * S + 4.0) * np.exp(-0.2 * S), "tf:1/2"),
    ],
)
def test_the_simplest_order_that_follows_is_chosen(response, order, noise):
    """A lag, an oscillation without and with a zero, each with a delay and up to 10 % of noise."""
    random = np.random.default_rng(0)
    spoiled = 1.0 + noise * (random.standard_normal(60) + 1j * random.standard_normal(60))
    assert named(OMEGA, response * spoiled) == order


HOVER = np.poly([0.8 + 1.9j, 0.8 - 1.9j, -2.8, -18.0])


def test_an_unstable_hover_with_a_motor_keeps_its_slow_poles():
    """Speeds that roll a multirotor back: two zeros, four poles, two of them slow and unstable."""
    response = 2200.0 * S * (S + 0.25) / np.polyval(HOVER, S) * np.exp(-0.08 * S)
    assert named(OMEGA, response) == "tf:2/4"


def test_no_fast_unstable_pole_stands_for_a_lag():
    """A flapping rotor looks like an unstable pole with a long delay, to 9 %: two poles are it."""
    omega = np.geomspace(1.7, 31.0, 40)
    s = 1j * omega
    lagging = 5200.0 / (s**2 + 27.0 * s + 572.0) * np.exp(-0.012 * s)
    assert named(omega, lagging) == "tf:0/2"


@tabled("poles", "order")
def test_poles_are_near_the_band(poles, order):
    """From 0.3 of its lower edge, 1 rad/s, to twice its upper one, 25 rad/s."""
    assert named(OMEGA, 100.0 / np.polyval(np.real(np.poly(poles)), S)) == order


@pytest.mark.parametrize(("count", "order"), [(8, "tf:0/1"), (9, "tf:0/2")])
def test_a_coefficient_takes_three_frequencies(count, order):
    """Three of the numerator and the denominator take nine."""
    omega = np.geomspace(1.0, 25.0, count)
    assert named(omega, 400.0 / (144.0 - omega**2 + 12.0j * omega)) == order
