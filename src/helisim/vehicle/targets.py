"""What a vehicle of one's own is calibrated to: the derivatives in `[targets]` of its parameters.

    [targets]
    Z_w = { value = -0.80, unit = "1/s", source = "sweeps of 12 May" }

They are those of Wu and Chen's equations (1), (8) and (10), in the field's axes, as an
identification of one's own flights finds them and `Vehicle.derivatives` has them.
"""

from collections.abc import Mapping

from helisim.errors import ModelError, UnknownNameError
from helisim.vehicle.parameters import Parameters, PhysicalParameter, to_toml

UNITS = {
    "tau_f": "s",
    "A_b": "1",
    "B_a": "1",
    "A_lat": "rad",
    "A_lon": "rad",
    "B_lat": "rad",
    "B_lon": "rad",
    "Z_w": "1/s",
    "Z_col": "m/s^2",
    "N_r": "1/s",
    "N_ped": "rad/s^2",
    "L_b": "1/s^2",
    "M_a": "1/s^2",
}
"""Every derivative that a calibration takes, and its unit."""

_SIGNS = {"tau_f": 1, "Z_w": -1, "Z_col": -1, "N_r": -1, "N_ped": 1, "L_b": 1, "M_a": 1}
"""Of those that can have one sign only, whichever way the rotor turns."""

_SECTION = "targets."


def stated_targets(given: Parameters) -> Parameters:
    """Return the derivatives that a vehicle's parameters state, by name, such as "Z_w".

    Raises:
        ModelError: there is no such derivative, or a unit or a sign is wrong.
    """
    found = {}
    for name in given:
        if name.startswith(_SECTION):
            entry = _checked(name, given.entry(name))
            found[entry.name] = entry
    return Parameters(found)


def _checked(name: str, entry: PhysicalParameter) -> PhysicalParameter:
    key = name.removeprefix(_SECTION)
    if key not in UNITS:
        raise ModelError(f"[targets] {UnknownNameError('derivative', key, UNITS)}")
    if entry.unit != UNITS[key]:
        raise ModelError(f"[targets] {key} must be in {UNITS[key]!r}, got {entry.unit!r}")
    sign = _SIGNS.get(key)
    if sign is not None and not sign * entry.value > 0.0:
        wanted = "positive" if sign > 0 else "negative"
        raise ModelError(f"[targets] {key} must be {wanted}, got {entry.value:g}")
    return PhysicalParameter(key, entry.value, entry.unit, entry.source)


def lacking(targets: Mapping[str, float]) -> list[str]:
    """Return the derivatives that a calibration still lacks, each with its unit."""
    return [f"{name} ({unit})" for name, unit in UNITS.items() if name not in targets]


def targets_toml(derivatives: Mapping[str, float], source: str) -> str:
    """Return the text of a section `[targets]` with a vehicle's own derivatives.

    Args:
        derivatives: such as `Vehicle.derivatives`; others than `UNITS` are left out.
        source: where they come from.
    """
    entries = {
        _SECTION + name: PhysicalParameter(_SECTION + name, float(derivatives[name]), unit, source)
        for name, unit in UNITS.items()
    }
    return to_toml(Parameters(entries), "What `helisim calibrate` solves the parameters for. SI.")
