"""Calibration: from the paper's derivatives to physical parameters."""

import pytest

from helisim.base.errors import InputError
from helisim.study.new_vehicle import calibrated_text
from helisim.study.paper import published
from helisim.vehicle import calibrate, read_parameters, standard_parameters
from helisim.vehicle.calibrate import DIRECT, SOLVED, flapping_of, is_known, settled
from helisim.vehicle.parameters import model_folder

FOLDER = model_folder("jr700")
TARGETS = {
    item.name: item.value
    for name in ("yaw_base", "rollpitch_in1", "heave")
    for item in published("jr700")[name]
    if item.name in DIRECT + SOLVED
}


def test_calibrated_file_is_what_calibrate_writes():
    """Solving again gives the numbers of calibrated.toml: nobody typed them."""
    given = read_parameters(FOLDER / "parameters.toml", FOLDER / "tuned.toml")
    stored = read_parameters(FOLDER / "calibrated.toml")
    tried = []
    solved = calibrate("jr700", given, TARGETS, "paper", on_progress=tried.append)
    assert set(tried) == {"jr700"}
    assert list(solved) == list(stored)
    for name in stored:
        # the solver stops at 1e-8 of each condition; conditions are well scaled
        assert solved[name] == pytest.approx(stored[name], rel=1e-6)
        assert solved.entry(name).unit == stored.entry(name).unit


@pytest.mark.parametrize("value", [None, float("nan")])
def test_missing_target_is_named(value):
    """A target that is missing or no number is named before anything is solved."""
    given = read_parameters(FOLDER / "parameters.toml")
    targets = {key: item for key, item in TARGETS.items() if key != "N_r"}
    if value is not None:
        targets["N_r"] = value
    with pytest.raises(InputError, match="N_r"):
        calibrate("jr700", given, targets, "test")


LYNX = model_folder("lynx")


@pytest.fixture(scope="module")
def given():
    return read_parameters(LYNX / "parameters.toml")


def test_the_disc_of_a_spring_at_the_centre_is_the_books(given):
    """Padfield's closed form: S = 8 (nu^2 - 1) / gamma; per cyclic 1 / (1 + S^2) and S / (1 + S^2).

    In eq. (8) the steady tilt is inv([[1, -A_b], [-B_a, 1]]) times the cyclic's.
    """
    assert is_known(given)
    assert not is_known(standard_parameters("jr700"))
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
    stored = read_parameters(LYNX / "calibrated.toml")
    solved = settled("lynx", read_parameters(LYNX / "parameters.toml", LYNX / "tuned.toml"))
    assert dict(solved) == pytest.approx(dict(stored), rel=1e-9)
    assert calibrated_text("lynx") == (LYNX / "calibrated.toml").read_text()
