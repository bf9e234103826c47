"""Calibrate a vehicle from what is published of it, as the text of its `calibrated.toml`."""

from collections.abc import Callable

from helisim.paper import published
from helisim.vehicle import calibrate, read_parameters
from helisim.vehicle.assembly import model_folder
from helisim.vehicle.parameters import to_toml

_HEADER = """\
Written by `helisim calibrate --write`; not by hand.
Solved so that the linearised nonlinear model has the published derivatives."""


def calibrated_text(name: str, *, on_progress: Callable[[str], None] | None = None) -> str:
    """Return a vehicle's `calibrated.toml`, solved from what is published of it.

    Args:
        name: of the vehicle.
        on_progress: called with the vehicle's name after each trial.

    Raises:
        UnknownNameError: no such vehicle, or nothing is published of it.
        ModelError: the published derivatives can't be met.
    """
    folder = model_folder(name)
    known = published(name)
    files = (folder / "parameters.toml", folder / "tuned.toml")
    given = read_parameters(*(path for path in files if path.is_file()))
    solved = calibrate(name, given, known.targets, known.source, on_progress=on_progress)
    return to_toml(solved, _HEADER)
