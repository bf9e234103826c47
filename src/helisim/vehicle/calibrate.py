"""Solve for the physical parameters whose linearised flight has given derivatives.

Wu and Chen's equations (1), (8), (10); starts of Padfield, Helicopter Flight Dynamics, ch. 3 and 4.
"""

import math
from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root

from helisim.base.errors import InputError, ModelError
from helisim.physics.rotor import mean_square_lift
from helisim.vehicle.assembly import assemble, mass_and_gravity
from helisim.vehicle.linearize import linearize, plain_rotor, stability_derivatives
from helisim.vehicle.parameters import (
    Parameters,
    PhysicalParameter,
    check_values,
    completed,
    glossary,
    untuned,
)
from helisim.vehicle.swashplate import (
    INERTIA,
    Flapping,
    Swashplate,
    flapping_from_blade,
)
from helisim.vehicle.trim import find_trim

DIRECT = ("tau_f", "A_b", "B_a", "A_lat", "A_lon", "B_lat", "B_lon")
"""Derivatives that are parameters of the tip-path-plane equations themselves."""

SOLVED = ("Z_w", "Z_col", "N_r", "N_ped", "L_b", "M_a")  # parameters are solved for these

UNKNOWNS = {  # PhysicalParameter -> unit, and the condition that fixes it
    "main_rotor.lift_slope": ("1/rad", "Z_w"),
    "main_rotor.pitch_trim": ("rad", "hover with the collective centred"),
    "main_rotor.pitch_range": ("rad", "Z_col"),
    "main_rotor.hub_stiffness": ("N m/rad", "L_b"),
    "main_rotor.hub_cross": ("N m/rad", "L_a = 0"),
    "airframe.iyy": ("kg m^2", "M_a"),
    "airframe.izz": ("kg m^2", "N_r"),
    "tail_rotor.pitch_trim": ("rad", "hover with the pedals centred"),
    "tail_rotor.pitch_range": ("rad", "N_ped"),
}

_TOLERANCE = 1e-8  # relative error allowed in each condition


def calibrate(
    vehicle: str | PathLike[str],
    given: Parameters,
    targets: Mapping[str, float],
    source: str,
    *,
    on_progress: Callable[[str], None] | None = None,
) -> Parameters:
    """Return the parameters of a vehicle that `given` leaves open, so that it has the targets.

    vehicle: name of a shipped one, or path of a folder, whose MJCF is flown; targets: a value of
    each name in DIRECT and SOLVED, SI, but no tau_f where the blades' inertia is given; source:
    where they come from, for the provenance. Raises InputError if a target is missing, not finite
    or one too many, and ModelError if there is no solution.
    """
    direct_ones = tuple(key for key in DIRECT if key not in spared(given))
    for wanted in direct_ones + SOLVED:
        if not np.isfinite(targets.get(wanted, np.nan)):
            raise InputError(f"calibration needs a finite {wanted}, got {targets.get(wanted)!r}")
    for extra in (name for name in spared(given) if name in targets):
        raise InputError(
            f"{INERTIA} and the target {extra} both say how fast the disc follows: give one"
        )
    fixed = given.entries()
    for key in direct_ones:
        name = f"flapping.{key.lower()}"
        fixed[name] = PhysicalParameter(name, targets[key], UNITS[key], source)
    guess = first_guess(given, targets, *mass_and_gravity(vehicle, given))
    starts = np.array([guess[key] for key in UNKNOWNS])

    def join(scale: NDArray[np.float64]) -> Parameters:
        solved = {
            key: PhysicalParameter(key, float(value), unit, f"solved: {condition}, {source}")
            for (key, (unit, condition)), value in zip(UNKNOWNS.items(), scale * starts)
        }
        return untuned(Parameters({**fixed, **solved}))

    def miss(scale: NDArray[np.float64]) -> NDArray[np.float64]:
        parameters = join(scale)
        model = plain_rotor(assemble(vehicle, parameters))
        trim = find_trim(model)
        base = linearize(model, trim)
        found = stability_derivatives(base, Swashplate.of(completed(parameters)))
        across = base.derivative("p", "flap_a") / targets["L_b"]
        if on_progress is not None:
            on_progress(Path(vehicle).name)
        errors = (found[key] / targets[key] - 1.0 for key in SOLVED)
        return np.array([trim.col, trim.ped, across, *errors])

    solution = root(miss, np.ones(len(starts)), method="hybr", tol=1e-13)
    worst = float(np.max(np.abs(miss(solution.x))))
    if not worst < _TOLERANCE:
        raise ModelError(
            f"calibration of {str(vehicle)!r} misses a condition by {worst:.2g} (relative); "
            f"the targets may be out of reach: {dict(targets)}"
        )
    complete = join(solution.x)
    direct = (name for name in fixed if name not in given)
    return Parameters({key: complete.entry(key) for key in (*direct, *UNKNOWNS)})


def spared(given: Container[str]) -> tuple[str, ...]:
    """Return the targets that follow from what is given."""
    return ("tau_f",) if INERTIA in given else ()


@dataclass(frozen=True)
class Disc:
    """A rotor at the hover; force: rho A (Omega R)^2, N; tip_speed: m/s; thrust: N."""

    force: float
    tip_speed: float
    solidity: float
    thrust: float

    @classmethod
    def of(cls, given: Mapping[str, float], rotor: str, thrust: float) -> "Disc":
        """Return "main_rotor" or "tail_rotor" of a vehicle's parameters at a thrust, N."""
        radius = given[f"{rotor}.radius"]
        tip_speed = given[f"{rotor}.speed"] * radius
        solidity = given[f"{rotor}.blades"] * given[f"{rotor}.chord"] / (math.pi * radius)
        force = given["air.density"] * math.pi * radius**2 * tip_speed**2
        return cls(force, tip_speed, solidity, thrust)

    @property
    def inflow(self) -> float:
        """Ratio of the induced velocity to the tip speed."""
        return math.sqrt(0.5 * self.thrust / self.force)

    def pitch(self, slope: float) -> float:
        """Return the blade pitch, rad; `slope` is lift slope times solidity."""
        return 3.0 * (2.0 * self.thrust / self.force / slope + 0.5 * self.inflow)

    def per_climb(self, slope: float) -> float:
        """Return by how much climbing takes thrust away, N s/m."""
        inflow = self.inflow
        return 2.0 * inflow * slope / (16.0 * inflow + slope) * self.force / self.tip_speed

    def per_pitch(self, slope: float) -> float:
        """Return by how much pitch adds thrust, N/rad."""
        inflow = self.inflow
        return 8.0 / 3.0 * inflow * slope / (16.0 * inflow + slope) * self.force


def hover_torque(given: Mapping[str, float], main: Disc, slope: float) -> float:
    """Return the torque that the main rotor takes in hover, N m; slope: of lift, 1/rad."""
    loading, twist = main.thrust / main.force / main.solidity, given.get("main_rotor.twist", 0.0)
    section = given.get("main_rotor.lift_drag", 0.0)
    section *= mean_square_lift(loading, slope, main.inflow, twist)
    power = given["main_rotor.induced_factor"] * main.inflow * main.thrust / main.force
    power += main.solidity * (given["main_rotor.profile_drag"] + section) / 8.0
    return main.force * given["main_rotor.radius"] * power


def first_guess(
    given: Mapping[str, float], targets: Mapping[str, float], mass: float, gravity: float
) -> dict[str, float]:
    """Return a start for each parameter solved for, or ModelError; mass: kg; gravity: m/s^2."""
    main = Disc.of(given, "main_rotor", mass * gravity)
    wanted = -targets["Z_w"] * mass * main.tip_speed / main.force
    if not 0.0 < wanted < 2.0 * main.inflow:
        limit = 2.0 * main.inflow * main.force / (mass * main.tip_speed)
        raise ModelError(
            f"Z_w = {targets['Z_w']:g} 1/s is out of a hovering rotor's reach: momentum theory "
            f"allows {-limit:.3g} to 0 for this disc and {mass:g} kg"
        )
    slope = 16.0 * main.inflow * wanted / (2.0 * main.inflow - wanted)
    arm = abs(given["tail_rotor.arm_x"])
    torque = hover_torque(given, main, slope / main.solidity)
    tail = Disc.of(given, "tail_rotor", torque / arm)
    tail_slope = given["tail_rotor.lift_slope"] * tail.solidity
    ixx = given["airframe.ixx"]
    izz = -(arm**2) * tail.per_climb(tail_slope) / targets["N_r"]
    return {
        "main_rotor.lift_slope": slope / main.solidity,
        "main_rotor.pitch_trim": main.pitch(slope),
        "main_rotor.pitch_range": -targets["Z_col"] * mass / main.per_pitch(slope),
        "main_rotor.hub_stiffness": targets["L_b"] * ixx + main.thrust * given["main_rotor.hub_z"],
        "main_rotor.hub_cross": 0.5 * torque,
        "airframe.iyy": ixx * targets["L_b"] / targets["M_a"],
        "airframe.izz": izz,
        "tail_rotor.pitch_trim": tail.pitch(tail_slope),
        "tail_rotor.pitch_range": targets["N_ped"] * izz / (arm * tail.per_pitch(tail_slope)),
    }


UNITS = {name: glossary()["targets." + name].unit for name in DIRECT + SOLVED}


def stated_targets(given: Parameters) -> Parameters:
    """Return a vehicle's stated derivatives by name; ModelError on a sign that none can have."""
    found = {key: given.entry(f"targets.{key}") for key in UNITS if f"targets.{key}" in given}
    check_values({entry.name: entry.value for entry in found.values()})
    return Parameters(
        {key: replace(entry, name=key, unit=UNITS[key]) for key, entry in found.items()}
    )


def lacking(targets: Mapping[str, float], given: Container[str]) -> list[str]:
    """Return the derivatives that a calibration still lacks, each with its unit."""
    there = {*targets, *spared(given)}
    return [f"{name} ({unit})" for name, unit in UNITS.items() if name not in there]


HOVER = ("main_rotor.pitch_trim", "tail_rotor.pitch_trim")
BLADE = ("main_rotor.blade_inertia", "flapping.lock_reduction", "geometry.cyclic_range")
_TRIALS, _CENTRED = 4, 1e-9  # tolerance of the controls, unitised


def is_known(given: Mapping[str, float]) -> bool:
    """Return whether parameters, uncalibrated, say all but the hover that is solved for."""
    return all(
        name in given for name in (*(set(UNKNOWNS) - {*HOVER, "main_rotor.hub_cross"}), *BLADE)
    )


def settled(vehicle: str | PathLike[str], given: Parameters) -> Parameters:
    """Return what follows from a vehicle's known parameters: section [flapping], and the hover.

    vehicle: name of a shipped one or path of a folder, whose MJCF is flown; given: with or without
    the gyro's parameters, and [flapping] unless `is_known`. ModelError or TrimError if it can't
    hover.
    """
    entries = given.entries()
    found = flapping_of(given).to_parameters() if is_known(given) else {}
    for name, value in found.items():
        known = glossary()[name]
        source = "computed: blade, hub stiffness and cyclic range"
        entries[name] = PhysicalParameter(name, value, known.unit, source)
    mass, gravity = mass_and_gravity(vehicle, given)
    main = Disc.of(given, "main_rotor", mass * gravity)
    torque = hover_torque(given, main, given["main_rotor.lift_slope"])
    tail = Disc.of(given, "tail_rotor", torque / abs(given["tail_rotor.arm_x"]))
    pitch = {  # near enough to solve from
        f"{rotor}.pitch_trim": disc.pitch(given[f"{rotor}.lift_slope"] * disc.solidity)
        for rotor, disc in (("main_rotor", main), ("tail_rotor", tail))
    }
    for _ in range(_TRIALS):
        for name, value in pitch.items():
            control = "pedals" if "tail" in name else "collective"
            source = f"solved: hover with the {control} centred"
            entries[name] = PhysicalParameter(name, value, "rad", source)
        complete = completed(untuned(Parameters(entries)))
        trim = find_trim(assemble(vehicle, complete))
        if max(abs(trim.col), abs(trim.ped)) < _CENTRED:
            return Parameters({name: one for name, one in entries.items() if name not in given})
        pitch["main_rotor.pitch_trim"] += complete["main_rotor.pitch_range"] * trim.col
        hand = complete["main_rotor.direction"]
        pitch["tail_rotor.pitch_trim"] += hand * complete["tail_rotor.pitch_range"] * trim.ped
    raise ModelError(f"{vehicle}: no pitch of the blades holds the hover with controls centred")


def flapping_of(given: Mapping[str, float]) -> Flapping:
    """Return the tip-path plane's equation of a known blade and hub; InputError if impossible."""
    inertia, speed = given["main_rotor.blade_inertia"], given["main_rotor.speed"]
    lift = given["air.density"] * given["main_rotor.lift_slope"] * given["main_rotor.chord"]
    lift /= given["flapping.lock_reduction"]
    spring = 2.0 * given["main_rotor.hub_stiffness"] / given["main_rotor.blades"]  # of one blade
    return flapping_from_blade(
        lock_number=lift * given["main_rotor.radius"] ** 4 / inertia,
        speed=speed,
        direction=given["main_rotor.direction"],
        lon_range=given["geometry.cyclic_range"],
        lat_range=given["geometry.cyclic_range"],
        flap_frequency=math.sqrt(1.0 + spring / (inertia * speed**2)),
    )
