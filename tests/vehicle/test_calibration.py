"""Calibration: from the paper's derivatives to physical parameters."""

import pytest

from helisim.base.errors import InputError
from helisim.study.paper import published
from helisim.vehicle import calibrate, read_parameters
from helisim.vehicle.calibrate import DIRECT, SOLVED
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
