"""Loads a vehicle from its folder: its parameters, calibrated and tuned, and its trim."""

from collections.abc import Mapping
from os import PathLike

from helisim.base.errors import ModelError
from helisim.vehicle.assembly import Integrator, assemble
from helisim.vehicle.blade_inertia import INSTEAD, changed, with_both
from helisim.vehicle.folder import PARAMETER_FILES, model_folder
from helisim.vehicle.glossary import glossary
from helisim.vehicle.parameters import Parameters, completed, read_parameters, untuned
from helisim.vehicle.trim import find_trim
from helisim.vehicle.vehicle import Vehicle


def load(
    vehicle: str | PathLike[str] = "jr700",
    *,
    parameters: Mapping[str, float | str] | None = None,
    timestep: float | None = None,
    tuned: bool = True,
    integrator: Integrator | None = None,
) -> Vehicle:
    """Load a vehicle, calibrated and trimmed.

    Args:
        vehicle: name of a shipped one, such as "jr700", or path of a folder of your own.
        parameters: values that replace the calibrated ones, such as
            {"main_rotor.hub_stiffness": 100.0}, or a word where one is chosen, such as
            {"drive.governor": "ideal"}; the truth then follows them.
        timestep: s; the MJCF's own if None.
        tuned: False accepts a vehicle whose gyro is not tuned yet, to tune it.
        integrator: "RK4", fourth order, the MJCF's own and the default; or "Euler", staggered to
            second order: at 2 ms within a few parts in a thousand of it, at a quarter of the cost.

    Raises:
        UnknownNameError: no such vehicle or parameter.
        InputError: a value is not finite or no such choice, or no such integrator.
        ModelError: the model can't be built.
        TrimError: it can't hover.
    """
    folder = model_folder(vehicle)
    values = changed(standard_parameters(folder, tuned=tuned), parameters or {})
    model = assemble(folder, values, timestep=timestep, integrator=integrator)
    return Vehicle(folder, values, model, find_trim(model))


def standard_parameters(
    vehicle: str | PathLike[str] = "jr700", *, tuned: bool = True
) -> Parameters:
    """Return a vehicle's parameters as its files give them, calibrated and tuned.

    Args:
        vehicle: name of a shipped one, or path of a folder.
        tuned: False accepts a vehicle whose gyro is not tuned yet.

    Raises:
        UnknownNameError: no such vehicle.
        ModelError: a file is missing or malformed.
    """
    folder = model_folder(vehicle)
    files = [folder / file for file in PARAMETER_FILES]
    _, calibrated, tuned_file = files
    if not calibrated.is_file():
        raise ModelError(f"{calibrated}: no such file; helisim calibrate {folder} --write makes it")
    if tuned and not tuned_file.is_file():
        raise ModelError(f"{tuned_file}: no such file; helisim tune {folder} --write makes it")
    if tuned_file.is_file():
        found = read_parameters(*files)
    else:
        found = untuned(read_parameters(*files[:-1]))
    missing = [
        known
        for known in glossary().values()
        if known.needed and not {known.name, *INSTEAD.get(known.name, ())} & set(found)
    ]
    if missing:
        first, more = missing[0], len(missing) - 1
        others = f" and {more} more, which helisim vehicle check lists" if more else ""
        raise ModelError(f"{folder}: parameter {first.name} ({first.unit}) is missing{others}")
    return with_both(completed(found))
