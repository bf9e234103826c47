"""An autopilot's parameters from what was identified of a vehicle."""

from os import PathLike
from pathlib import Path

from helisim.base.errors import InputError
from helisim.design.plant import Plant
from helisim.ident import identify, load_fit, structures
from helisim.logs.dataflash import is_dataflash
from helisim.look.systemid import estimate_fits, followed_band, infer
from helisim.sitl.parameters import AutopilotParameters, parameters_for
from helisim.study.design_chain import identify_for_design
from helisim.study.experiment import Source
from helisim.vehicle import Vehicle


def autopilot_parameters(
    vehicle: Vehicle | str,
    source: "Source | Plant | None" = None,
    *,
    gyro: bool = False,
    seed: int = 1,
) -> AutopilotParameters:
    """Return parameters with which ArduCopter-heli flies a vehicle, each with its derivation.

    Args:
        vehicle: or its name or folder: its servos, rotor and hover are what is set.
        source: what its gains come from: sweeps (see `identify_for_design`), an autopilot's log of
            SystemID's sweeps, one identified model as `helisim identify` writes it of other
            records (.json), or a `Plant`; None takes the vehicle's exact linearisation, as if it
            were known.
        gyro: whether the vehicle's own gyro stays in the tail, and is asked for a rate of yaw.
        seed: of the bench test that finds its servos.

    Raises:
        StorageError: a file can't be read.
        InputError: no axis can be tuned, or a servo needs a pulse that ArduPilot doesn't send.
        IdentificationError: a model can't be identified.
    """
    if source is None:
        return parameters_for(vehicle, gyro=gyro)
    own = isinstance(source, str | PathLike) and Path(source).is_file() and is_dataflash(source)
    plant = source if isinstance(source, Plant) else _plant(source, seed, own)
    told = ", ".join(fit.structure.name for fit in plant.fits)
    lifts = [abs(fit["Z_col"].value) for fit in plant.fits if "Z_col" in fit.parameters]
    return parameters_for(
        vehicle,
        plant,
        of_autopilot=own,
        late=0.0 if own else -0.5 * plant.period,
        lift=lifts[0] if lifts else None,
        gyro=gyro,
        made_from=f"models identified {'in its own log' if own else 'of its records'} ({told})",
    )


def _plant(source: Source, seed: int, own: bool) -> Plant:
    if own:
        return _logged(Path(str(source)))
    if isinstance(source, str | PathLike) and Path(source).suffix == ".json":
        return Plant((load_fit(source),))
    return identify_for_design(source, seed=seed)


def _logged(path: Path) -> Plant:
    """Return what an autopilot's log tells: commands are in its unit, held for its ticks."""
    found = infer([path])
    wanted = tuple(fit for fit in found.fits if not fit.structure.startswith("tf:"))
    if not wanted:
        raise InputError(
            f"{path}: no model of it can be used for gains; sweep roll and pitch both, or yaw"
        )
    names = {
        name
        for fit in wanted
        for name in (*fit.inputs, *fit.outputs, *fit.conditioning, *fit.reference)
    }
    records = [record for log in found.read(names) for record in log.records]
    fits = []
    for fit, response in zip(wanted, estimate_fits(records, wanted)):
        structure = structures.named(fit.structure)
        band = followed_band(response, structure, fit.band)
        fits.append(identify(response, structure, band=band))
    return Plant(tuple(fits))
