"""Calibrate a vehicle to its derivatives, as the text of its `calibrated.toml`.

A shipped vehicle has the published ones, one of one's own what `[targets]` of its parameters.toml
says. What neither says can be estimated from the geometry.
"""

from collections.abc import Callable, Mapping
from os import PathLike
from pathlib import Path

from helisim.base.errors import ModelError
from helisim.study.paper import published
from helisim.vehicle import calibrate, read_parameters
from helisim.vehicle.assembly import mass_and_gravity
from helisim.vehicle.blade import INERTIA, REDUCTION, lock_number, with_both
from helisim.vehicle.calibrate import (
    estimated_targets,
    is_known,
    lacking,
    settled,
    spared,
    stated_targets,
)
from helisim.vehicle.folder import is_shipped, model_folder
from helisim.vehicle.parameters import Parameters, PhysicalParameter, completed, to_toml

_HEADER = """\
Written by `helisim calibrate --write`; not by hand.
Solved so that the linearised nonlinear model has the {derivatives} derivatives.

A blade has a flapping inertia of {inertia:.3g} kg m^2, as {mass:.3g} kg spread evenly over
{radius:g} m: a Lock number gamma of {lock:.3g}. Inflow that follows its flapping leaves
{felt:.3g} of it; 16 / ({felt:.3g} Omega) is the disc's own time constant, and springs and
couplings make tau_f of that."""

_KNOWN = """\
Written by `helisim calibrate --write`; not by hand.
Computed from blades and hub, which parameters.toml says; no derivative was given."""


def calibrated_text(
    vehicle: str | PathLike[str],
    *,
    from_geometry: bool = False,
    on_progress: Callable[[str], None] | None = None,
) -> str:
    """Return a vehicle's `calibrated.toml`, solved from its derivatives.

    Where parameters.toml says itself what would be solved for, the blade's inertia too, nothing
    but the pitch of the blades in hover is, and no derivative is needed.

    Args:
        vehicle: name of a shipped one, or path of a folder.
        from_geometry: True estimates the derivatives that it doesn't state, in closed form.
        on_progress: called with the vehicle's name after each trial.

    Raises:
        UnknownNameError: no such vehicle.
        ModelError: a derivative is missing or malformed, or they can't be met.
    """
    folder = model_folder(vehicle)
    files = (folder / "parameters.toml", folder / "tuned.toml")
    given = completed(read_parameters(*(path for path in files if path.is_file())))
    if is_known(given) and not stated_targets(given):
        return to_toml(settled(folder, given), _KNOWN)
    if is_shipped(folder) and not from_geometry:
        known = published(folder.name)
        targets, source, whose = known.targets, known.source, "published"
    else:
        whose = "estimated" if from_geometry else "stated"
        try:
            targets, source = _own(folder, given, from_geometry=from_geometry)
        except ModelError as error:
            raise ModelError(f"{files[0]}: {error}") from None
    solved = calibrate(folder, given, targets, source, on_progress=on_progress)
    whole = with_both(Parameters({**_entries(given), **_entries(solved)}))
    return to_toml(solved, _HEADER.format(derivatives=whose, **_blade(whole)))


def _entries(parameters: Parameters) -> dict[str, PhysicalParameter]:
    return {name: parameters.entry(name) for name in parameters}


def _blade(own: Parameters) -> dict[str, float]:
    """Return what is said of a blade, by name."""
    inertia, radius = own[INERTIA], own["main_rotor.radius"]
    return {
        "lock": lock_number(own),
        "felt": lock_number(own) / own[REDUCTION],
        "inertia": inertia,
        "mass": 3.0 * inertia / radius**2,
        "radius": radius,
    }


def _own(
    folder: Path, given: Parameters, *, from_geometry: bool
) -> tuple[Mapping[str, float], str]:
    """Return a vehicle's own targets, those that it states before those that are estimated."""
    stated = stated_targets(given)
    if not from_geometry:
        missing = lacking(stated, given)
        if missing:
            raise ModelError(
                f"section [targets] lacks {', '.join(missing)}; each is "
                '{ value = NUMBER, unit = "UNIT", source = "WHERE FROM" }; what is missing can be '
                "estimated from the geometry",
                remedy="from_geometry",
            )
        return dict(stated), "[targets] of parameters.toml"
    estimated = dict(estimated_targets(given, *mass_and_gravity(folder)))
    for name in spared(given):
        del estimated[name]
    return {**estimated, **stated}, "[targets] and closed forms of the geometry"
