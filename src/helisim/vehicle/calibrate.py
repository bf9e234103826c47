"""Solve for the physical parameters whose linearised flight is a table of derivatives."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root

from helisim.errors import InputError, ModelError
from helisim.vehicle.assembly import assemble, mass_and_gravity
from helisim.vehicle.first_guess import first_guess
from helisim.vehicle.linearize import linearize, stability_derivatives
from helisim.vehicle.parameters import Parameter, Parameters, untuned
from helisim.vehicle.trim import find_trim

DIRECT = ("tau_f", "A_b", "B_a", "A_lat", "A_lon", "B_lat", "B_lon")
"""Derivatives that are parameters of the tip-path-plane equations themselves."""

SOLVED = ("Z_w", "Z_col", "N_r", "N_ped", "L_b", "M_a")
"""Derivatives that the physical parameters are solved for; hover at centred controls too."""

_UNKNOWNS = {
    "main_rotor.lift_slope": ("1/rad", "Z_w"),
    "main_rotor.pitch_trim": ("rad", "hover with the collective centred"),
    "main_rotor.pitch_range": ("rad", "Z_col"),
    "main_rotor.hub_stiffness": ("N m/rad", "L_b"),
    "airframe.iyy": ("kg m^2", "M_a"),
    "airframe.izz": ("kg m^2", "N_r"),
    "tail_rotor.pitch_trim": ("rad", "hover with the pedals centred"),
    "tail_rotor.pitch_range": ("rad", "N_ped"),
}
"""Parameter -> unit, and the condition that fixes it."""

_TOLERANCE = 1e-8
"""Relative error allowed in each condition: four digits beyond any published one."""


def calibrate(
    name: str, given: Parameters, targets: Mapping[str, float], source: str
) -> Parameters:
    """Return the solved parameters of a vehicle: those that `given` leaves open.

    Root finding on the nonlinear force laws: at the solution the hover needs no control
    offsets and the linearised derivatives equal the targets.

    Args:
        name: of the vehicle, whose MJCF is flown.
        given: given and chosen parameters; the gyro's may be missing.
        targets: values of DIRECT and SOLVED by name, SI.
        source: where the targets come from, for the provenance.

    Raises:
        InputError: a target is missing or not finite.
        ModelError: no solution.
    """
    for wanted in DIRECT + SOLVED:
        if not np.isfinite(targets.get(wanted, np.nan)):
            raise InputError(
                f"calibration needs a finite {wanted}, got {targets.get(wanted)!r}; "
                f"it takes {', '.join(DIRECT + SOLVED)}"
            )
    direct = {
        f"flapping.{key.lower()}": Parameter(
            f"flapping.{key.lower()}", targets[key], "s" if key == "tau_f" else _unit(key), source
        )
        for key in DIRECT
    }
    guess = first_guess(given, targets, *mass_and_gravity(name))
    starts = np.array([guess[key] for key in _UNKNOWNS])

    entries = {key: given.entry(key) for key in given}

    def join(scale: NDArray[np.float64]) -> Parameters:
        solved = {
            key: Parameter(key, float(value), unit, f"solved: {condition}, {source}")
            for (key, (unit, condition)), value in zip(_UNKNOWNS.items(), scale * starts)
        }
        return untuned(Parameters({**entries, **direct, **solved}))

    def miss(scale: NDArray[np.float64]) -> NDArray[np.float64]:
        return _miss(name, join(scale), targets)

    solution = root(miss, np.ones(len(starts)), method="hybr", tol=1e-13)
    worst = float(np.max(np.abs(miss(solution.x))))
    if not worst < _TOLERANCE:
        raise ModelError(
            f"calibration of {name!r} misses a condition by {worst:.2g} (relative); "
            f"the targets may be out of reach: {dict(targets)}"
        )
    complete = join(solution.x)
    return Parameters({key: complete.entry(key) for key in (*direct, *_UNKNOWNS)})


def _unit(derivative: str) -> str:
    return "1" if derivative in ("A_b", "B_a") else "rad"


def _miss(name: str, parameters: Parameters, targets: Mapping[str, float]) -> NDArray[np.float64]:
    model = assemble(name, parameters, delays=False)
    trim = find_trim(model)
    found = stability_derivatives(linearize(model, trim, inputs="IN1"))
    errors = [found[key] / targets[key] - 1.0 for key in SOLVED]
    return np.array([trim.col, trim.ped, *errors])
