"""An autopilot's parameters from what was identified of a vehicle."""

from os import PathLike
from pathlib import Path

from helisim.design.plant import Plant
from helisim.ident import load_fit
from helisim.sitl.parameter_file import AutopilotParameters
from helisim.sitl.parameters import parameters_for
from helisim.study.for_design import identify_for_design
from helisim.study.swept import Source
from helisim.vehicle import Vehicle


def autopilot_parameters(
    vehicle: Vehicle | str, source: "Source | Plant | None" = None, *, seed: int = 1
) -> AutopilotParameters:
    """Return parameters with which ArduCopter-heli flies a vehicle, each with its derivation.

    Args:
        vehicle: or its name or folder: its servos, rotor and hover are what is set.
        source: what its gains come from: sweeps (see `identify_for_design`), one identified model
            as `helisim identify` writes it (.json), or a `Plant`; None takes the vehicle's exact
            linearisation, as if it were known.
        seed: of the bench test that finds its servos.

    Raises:
        StorageError: a file can't be read.
        InputError: no axis can be tuned, or a servo needs a pulse that ArduPilot doesn't send.
        IdentificationError: a model can't be identified.
    """
    if source is None:
        return parameters_for(vehicle)
    plant = source if isinstance(source, Plant) else _plant(source, seed)
    told = ", ".join(fit.structure.name for fit in plant.fits)
    return parameters_for(
        vehicle, plant, late=-0.5 * plant.period, made_from=f"identified models ({told})"
    )


def _plant(source: Source, seed: int) -> Plant:
    if isinstance(source, str | PathLike) and Path(source).suffix == ".json":
        return Plant((load_fit(source),))
    return identify_for_design(source, seed=seed)
