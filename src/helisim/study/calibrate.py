"""Calibrate a vehicle from what is published of it, as the text of its `calibrated.toml`."""

from collections.abc import Callable
from os import PathLike

from helisim.study.published import published_of
from helisim.vehicle import calibrate, read_parameters
from helisim.vehicle.calibrate import DIRECT, SOLVED
from helisim.vehicle.folder import model_folder
from helisim.vehicle.parameters import to_toml

_HEADER = """\
Written by `helisim calibrate --write`; not by hand.
Solved so that the linearised nonlinear model has the published derivatives."""

_TARGETS = "targets."
_INSTEAD = (
    "give the derivatives that it is to have in a section [targets] of its parameters.toml: "
    f"{', '.join(DIRECT + SOLVED)}"
)


def calibrated_text(
    vehicle: str | PathLike[str], *, on_progress: Callable[[str], None] | None = None
) -> str:
    """Return a vehicle's `calibrated.toml`, solved from its derivatives.

    They stand in `[targets]` of its parameters.toml; of a shipped one they are published.

    Args:
        vehicle: name of a shipped one, or path of a folder.
        on_progress: called with the vehicle's name after each trial.

    Raises:
        UnknownNameError: no such vehicle.
        InputError: one of its targets is missing.
        ModelError: it has no targets, or they can't be met.
    """
    folder = model_folder(vehicle)
    files = (folder / "parameters.toml", folder / "tuned.toml")
    given = read_parameters(*(path for path in files if path.is_file()))
    targets = {
        name.removeprefix(_TARGETS): given[name] for name in given if name.startswith(_TARGETS)
    }
    source = "targets of parameters.toml"
    if not targets:
        known = published_of(folder, instead=_INSTEAD)
        targets, source = known.targets, known.source
    solved = calibrate(folder, given, targets, source, on_progress=on_progress)
    return to_toml(solved, _HEADER)
