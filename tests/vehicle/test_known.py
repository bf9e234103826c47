"""A vehicle that is calibrated to nothing: what its blades and hub say themselves."""

import pytest

from helisim.study.new_vehicle import calibrated_text
from helisim.vehicle import read_parameters, standard_parameters
from helisim.vehicle.calibrate import flapping_of, is_known, settled
from helisim.vehicle.parameters import model_folder

FOLDER = model_folder("lynx")


@pytest.fixture(scope="module")
def given():
    return read_parameters(FOLDER / "parameters.toml")


def test_what_is_known_is_told_from_what_is_solved_for(given):
    assert is_known(given)
    assert not is_known(standard_parameters("jr700"))


def test_the_disc_of_a_spring_at_the_centre_is_the_books(given):
    """Padfield's closed form: S = 8 (nu^2 - 1) / gamma; per cyclic 1 / (1 + S^2) and S / (1 + S^2).

    In eq. (8) the steady tilt is inv([[1, -A_b], [-B_a, 1]]) times the cyclic's.
    """
    found = flapping_of(given)
    inertia, speed = 678.14, 35.63
    lock = 1.225 * 6.0 * 0.391 * 6.4**4 / inertia
    stiffness = 8.0 * 166352.0 / (inertia * speed**2) / lock
    back = (found.a_lon + found.a_b * found.b_lon) / (1.0 - found.a_b * found.b_a)
    right = (found.b_lon + found.b_a * found.a_lon) / (1.0 - found.a_b * found.b_a)
    assert back == pytest.approx(0.35 / (1.0 + stiffness**2), rel=1e-9)
    # blades turn counter-clockwise: back cyclic tilts left, too
    assert right == pytest.approx(-0.35 * stiffness / (1.0 + stiffness**2), rel=1e-9)


def test_the_calibrated_file_is_what_calibrate_writes():
    """Nobody typed it."""
    stored = read_parameters(FOLDER / "calibrated.toml")
    solved = settled("lynx", read_parameters(FOLDER / "parameters.toml", FOLDER / "tuned.toml"))
    assert dict(solved) == pytest.approx(dict(stored), rel=1e-9)
    assert calibrated_text("lynx") == (FOLDER / "calibrated.toml").read_text()
