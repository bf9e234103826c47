"""A full-scale helicopter, fitted to none of its derivatives, beside two prints of them."""

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
