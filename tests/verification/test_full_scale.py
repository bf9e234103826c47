"""A full-scale helicopter, fitted to none of its derivatives, beside two prints of them."""

import math
from dataclasses import replace

import pytest

import script

proof = script.loaded("proof/full_scale")


def test_every_number_agrees_or_is_explained():
    assert proof.unexplained() == []
    assert len([*proof.rows(proof.PADFIELD), *proof.rows(proof.THESIS)]) == 379


def test_most_numbers_agree_of_themselves():
    """Explanations are for the rest."""
    alike = [row for row in proof.rows(proof.PADFIELD) if row.close]
    assert len(alike) > 0.85 * len(proof.rows(proof.PADFIELD))


@pytest.mark.parametrize(
    ("name", "within"),
    [
        ("Z_w", 0.06),
        ("Z_theta_0", 0.02),
        ("M_theta_1s", 0.03),
        ("L_theta_1c", 0.01),
        ("L_p", 0.05),
        ("M_q", 0.12),
        ("X_q", 0.03),
        ("N_theta_0", 0.06),
        ("phi", 0.05),
    ],
)
def test_the_main_derivatives_are_padfields(name, within):
    off = [row.off for row in proof.rows(proof.PADFIELD) if row.name == name]
    assert len(off) == 4
    assert max(map(abs, off)) < within


def test_it_flies_at_every_speed_with_controls_to_spare():
    for flight in proof.flights():
        assert abs(flight.angles["theta_1s"]) < 0.1
        assert 3e5 < flight.power < 9e5
    powers = [flight.power for flight in proof.flights()]
    assert powers.index(min(powers)) in (3, 4)  # least at 60 or 80 kn, as of any helicopter


def test_what_is_not_the_reason_explains_nothing():
    """An explanation must take the difference away."""
    row = next(
        row
        for row in proof.rows(proof.PADFIELD)
        if (row.name, row.knots) == ("M_v", 0) and proof.verdict(row) == "s"
    )
    wake = next(one for one in proof.EXPLANATIONS if one.letter == "w")
    assert not wake.holds(row)


def test_a_number_that_is_off_is_found():
    row = next(row for row in proof.rows(proof.PADFIELD) if row.name == "Z_theta_0")
    assert proof.verdict(replace(row, found=1.3 * row.found)) == "?"


def test_prints_say_the_same_of_the_speeds_they_share():
    assert set(proof.LYNX.padfield) <= set(proof.LYNX.thesis_knots)


@pytest.mark.parametrize("knots", tuple(proof.LYNX.padfield))
def test_each_table_has_one_attitude(knots):
    """Gravity's elements and the Euler angles' say the same theta and phi, to their last digit."""
    flight = proof.LYNX.padfield[knots]
    theta = math.atan2(-flight.derivative("w", "theta"), -flight.derivative("u", "theta"))
    phi = -math.asin(flight.derivative("theta", "r"))
    g = proof.GRAVITY
    # four decimals are printed; w by theta lacks cos(phi), of 0.999
    assert flight.derivative("u", "theta") == pytest.approx(-g * math.cos(theta), abs=2e-3)
    assert flight.derivative("w", "phi") == pytest.approx(
        -g * math.cos(theta) * math.sin(phi), abs=2e-3
    )
    assert flight.derivative("v", "phi") == pytest.approx(
        g * math.cos(theta) * math.cos(phi), abs=3e-3
    )
    assert flight.derivative("phi", "r") == pytest.approx(math.tan(theta) * math.cos(phi), abs=2e-3)


@pytest.mark.parametrize("knots", tuple(proof.LYNX.padfield))
def test_the_tables_speed_is_the_one_they_bear(knots):
    """Y_r carries -U_e and Z_q +U_e; the rotors add less than 0.6 m/s per rad/s to it."""
    flight, speed = proof.LYNX.padfield[knots], knots * proof.KNOT
    assert flight.derivative("w", "q") == pytest.approx(speed, abs=0.6)
    assert flight.derivative("v", "r") == pytest.approx(-speed, abs=0.6)


def test_what_both_sources_print_alike():
    """Of side force by sideslip and thrust by collective they differ by less than a tenth."""
    for name in ("Y_v", "Z_theta_0", "L_theta_1c", "M_theta_1s"):
        for knots in proof.LYNX.padfield:
            assert abs(proof.LYNX.apart(name, knots)) < 0.1, (name, knots)


def test_every_curve_has_a_value_for_each_speed():
    for curves in (proof.LYNX.thesis_trims, proof.LYNX.thesis_derivatives):
        assert {len(values) for values in curves.values()} == {len(proof.LYNX.thesis_knots)}
