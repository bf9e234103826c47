"""The Lynx's published numbers: that they were read and written without slips."""

import math

import pytest

from helisim.study import paper

LYNX = paper.published("lynx").full_scale
KNOTS = tuple(LYNX.padfield)


@pytest.mark.parametrize("knots", KNOTS)
def test_each_table_has_one_attitude(knots):
    """Gravity's elements and the Euler angles' say the same theta and phi, to their last digit."""
    flight = LYNX.padfield[knots]
    theta = math.atan2(-flight.derivative("w", "theta"), -flight.derivative("u", "theta"))
    phi = -math.asin(flight.derivative("theta", "r"))
    g = paper.GRAVITY
    # four decimals are printed; w by theta lacks cos(phi), of 0.999
    assert flight.derivative("u", "theta") == pytest.approx(-g * math.cos(theta), abs=2e-3)
    assert flight.derivative("w", "phi") == pytest.approx(
        -g * math.cos(theta) * math.sin(phi), abs=2e-3
    )
    assert flight.derivative("v", "phi") == pytest.approx(
        g * math.cos(theta) * math.cos(phi), abs=3e-3
    )
    assert flight.derivative("phi", "r") == pytest.approx(math.tan(theta) * math.cos(phi), abs=2e-3)


@pytest.mark.parametrize("knots", KNOTS)
def test_the_tables_speed_is_the_one_they_bear(knots):
    """Y_r carries -U_e and Z_q +U_e; the rotors add less than 0.6 m/s per rad/s to it."""
    flight, speed = LYNX.padfield[knots], knots * paper.KNOT
    assert flight.derivative("w", "q") == pytest.approx(speed, abs=0.6)
    assert flight.derivative("v", "r") == pytest.approx(-speed, abs=0.6)


def test_what_both_sources_print_alike():
    """Of side force by sideslip and thrust by collective they differ by less than a tenth."""
    for name in ("Y_v", "Z_theta_0", "L_theta_1c", "M_theta_1s"):
        for knots in KNOTS:
            assert abs(LYNX.apart(name, knots)) < 0.1, (name, knots)


def test_every_curve_has_a_value_for_each_speed():
    for curves in (LYNX.thesis_trims, LYNX.thesis_derivatives):
        assert {len(values) for values in curves.values()} == {len(LYNX.thesis_knots)}
