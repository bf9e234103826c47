"""Calibrate a vehicle from what is published of it, as the text of its `calibrated.toml`."""

from helisim.paper import published
from helisim.vehicle import calibrate, read_parameters
from helisim.vehicle.assembly import model_folder
from helisim.vehicle.parameters import to_toml

_HEADER = """\
Written by `helisim calibrate --write`; not by hand.
Solved so that the linearised nonlinear model has the published derivatives."""


def calibrated_text(name: str) -> str:
    """Return a vehicle's `calibrated.toml`, solved from what is published of it.

    Raises:
        UnknownNameError: no such vehicle, or nothing is published of it.
        ModelError: the published derivatives can't be met.
    """
    folder = model_folder(name)
    known = published(name)
    files = (folder / "parameters.toml", folder / "tuned.toml")
    given = read_parameters(*(path for path in files if path.is_file()))
    return to_toml(calibrate(name, given, known.targets, known.source), _HEADER)
