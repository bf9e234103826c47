"""Derivatives of a helicopter that has not flown yet, from its geometry, in closed form.

Momentum theory and untwisted blades for thrust, as in `calibrate`; for the tip-path plane a rotor
with a spring at its centre, `helisim.vehicle.blade`, its Lock number reduced by the inflow that the
blades' own flapping makes, under a swashplate that is turned so that it tilts the disc straight. No
delta-3, no dampers: flown derivatives of small helicopters are up to some four times larger in
tau_f and in A_b and B_a. A start, not a truth.
"""

import math
from collections.abc import Mapping

from helisim.base.errors import ModelError
from helisim.vehicle.blade import flapping_from_blade, lock_reduction
from helisim.vehicle.calibrate import Disc, hover_torque
from helisim.vehicle.glossary import glossary
from helisim.vehicle.parameters import Parameters, PhysicalParameter
from helisim.vehicle.targets import UNITS

GEOMETRY = (
    "lift_slope",
    "blade_inertia",
    "hub_stiffness",
    "collective_range",
    "cyclic_range",
    "tail_range",
    "iyy",
    "izz",
)
"""What an estimate takes beside the vehicle's other parameters, all in `[geometry]`."""

_SECTION = "geometry."
_SOURCE = "estimated: closed form, from the geometry"


def estimated_targets(given: Parameters, mass: float, gravity: float) -> Parameters:
    """Return an estimate of every derivative that a calibration takes, by name.

    Args:
        given: the vehicle's parameters, those of `GEOMETRY` among them.
        mass: kg.
        gravity: m/s^2.

    Raises:
        ModelError: one of the geometry is missing, or not positive.
    """
    terms = {name: glossary()[_SECTION + name] for name in GEOMETRY}
    missing = [f"{name} ({terms[name].unit})" for name in GEOMETRY if _SECTION + name not in given]
    if missing:
        raise ModelError(
            f"an estimate from the geometry needs a section [geometry] with {', '.join(missing)}"
        )
    own = {name: given[_SECTION + name] for name in GEOMETRY}
    for name, value in own.items():
        if not value > 0.0:
            raise ModelError(f"geometry.{name} must be positive, got {value:g} {terms[name].unit}")
    values = {**_forces(given, own, mass, gravity), **_flapping(given, own, mass * gravity)}
    return Parameters(
        {name: PhysicalParameter(name, values[name], unit, _SOURCE) for name, unit in UNITS.items()}
    )


def _forces(
    given: Mapping[str, float], own: Mapping[str, float], mass: float, gravity: float
) -> dict[str, float]:
    """Return the derivatives of vertical force, yaw moment and hub moment."""
    main = Disc.of(given, "main_rotor", mass * gravity)
    slope = own["lift_slope"] * main.solidity
    arm = abs(given["tail_rotor.arm_x"])
    tail = Disc.of(given, "tail_rotor", hover_torque(given, main) / arm)
    tail_slope = given["tail_rotor.lift_slope"] * tail.solidity
    stiffness = own["hub_stiffness"] - main.thrust * given["main_rotor.hub_z"]
    return {
        "Z_w": -main.per_climb(slope) / mass,
        "Z_col": -own["collective_range"] * main.per_pitch(slope) / mass,
        "N_r": -(arm**2) * tail.per_climb(tail_slope) / own["izz"],
        "N_ped": arm * own["tail_range"] * tail.per_pitch(tail_slope) / own["izz"],
        "L_b": stiffness / given["airframe.ixx"],
        "M_a": stiffness / own["iyy"],
    }


def _flapping(
    given: Mapping[str, float], own: Mapping[str, float], weight: float
) -> dict[str, float]:
    """Return the derivatives of the tip-path plane."""
    main = Disc.of(given, "main_rotor", weight)
    radius, speed = given["main_rotor.radius"], given["main_rotor.speed"]
    inertia, slope = own["blade_inertia"], own["lift_slope"]
    lock = given["air.density"] * slope * given["main_rotor.chord"] * radius**4 / inertia
    spring = 2.0 * own["hub_stiffness"] / given["main_rotor.blades"]  # of one blade
    found = flapping_from_blade(
        lock_number=lock / lock_reduction(slope, main.solidity, main.inflow),
        speed=speed,
        direction=given["main_rotor.direction"],
        flap_frequency=math.sqrt(1.0 + spring / (inertia * speed**2)),
        lon_range=own["cyclic_range"],
        lat_range=own["cyclic_range"],
    )
    return {
        "tau_f": found.tau_f,
        "A_b": found.a_b,
        "B_a": found.b_a,
        "A_lat": 0.0,
        "A_lon": own["cyclic_range"],
        "B_lat": own["cyclic_range"],
        "B_lon": 0.0,
    }
