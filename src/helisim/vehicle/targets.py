"""What a vehicle of one's own is calibrated to: the derivatives in `[targets]` of its parameters.

    [targets]
    Z_w = { value = -0.80, unit = "1/s", source = "sweeps of 12 May" }

They are those of Wu and Chen's equations (1), (8) and (10), in the field's axes, as an
identification of one's own flights finds them and `Vehicle.derivatives` has them.
"""

from collections.abc import Container, Mapping

from helisim.base.errors import ModelError
from helisim.vehicle.calibrate import DIRECT, SOLVED, spared
from helisim.vehicle.glossary import glossary
from helisim.vehicle.parameters import Parameters, PhysicalParameter

_SECTION = "targets."

UNITS = {name: glossary()[_SECTION + name].unit for name in DIRECT + SOLVED}
"""Every derivative that a calibration takes, and its unit."""

_SIGNS = {"tau_f": 1, "Z_w": -1, "Z_col": -1, "N_r": -1, "N_ped": 1, "L_b": 1, "M_a": 1}
"""Of those that can have one sign only, whichever way the rotor turns."""


def stated_targets(given: Parameters) -> Parameters:
    """Return the derivatives that a vehicle's parameters state, by name, such as "Z_w".

    Raises:
        ModelError: one has a sign that no helicopter has.
    """
    found = {}
    for key, unit in UNITS.items():
        if _SECTION + key not in given:
            continue
        entry = given.entry(_SECTION + key)
        sign = _SIGNS.get(key)
        if sign is not None and not sign * entry.value > 0.0:
            wanted = "positive" if sign > 0 else "negative"
            raise ModelError(f"targets.{key} must be {wanted}, got {entry.value:g} {unit}")
        found[key] = PhysicalParameter(key, entry.value, unit, entry.source)
    return Parameters(found)


def lacking(targets: Mapping[str, float], given: Container[str]) -> list[str]:
    """Return the derivatives that a calibration still lacks, each with its unit.

    Args:
        targets: derivatives that are stated, by name.
        given: the vehicle's parameters, from which one may follow.
    """
    there = {*targets, *spared(given)}
    return [f"{name} ({unit})" for name, unit in UNITS.items() if name not in there]
