"""Solve for the physical parameters whose linearised flight is a table of derivatives.

The search starts from closed forms of a hovering helicopter: momentum theory and untwisted blades
(Padfield, Helicopter Flight Dynamics, ch. 3 and 4), without stall, tilt of the thrust or the
tail's side force: a few percent from the solution, whatever the size of the helicopter.

What is solved for are the derivatives of Wu and Chen's equations (1), (8) and (10), in the field's
axes, as an identification of one's own flights finds them and `Vehicle.derivatives` has them. They
are stated in `[targets]` of the vehicle's parameters:

    [targets]
    Z_w = { value = -0.80, unit = "1/s", source = "sweeps of 12 May" }

Or they are estimated from its geometry, in closed form: a start, not a truth. For the tip-path
plane that is a rotor with a spring at its centre, its Lock number reduced by the inflow that the
blades' own flapping makes, under a swashplate that is turned so that it tilts the disc straight. No
delta-3, no dampers: flown derivatives of small helicopters are up to some four times larger in
tau_f and in A_b and B_a. Of a vehicle whose blades, hub and inertias are known, only the pitch of
its hover is solved for, with collective and pedals centred; its derivatives are then a prediction.
"""

import math
from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root

from helisim.base.errors import InputError, ModelError
from helisim.vehicle.assembly import assemble, mass_and_gravity
from helisim.vehicle.linearize import linearize, plain_rotor, stability_derivatives
from helisim.vehicle.parameters import Parameters, PhysicalParameter, completed, glossary, untuned
from helisim.vehicle.swashplate import (
    INERTIA,
    Flapping,
    Swashplate,
    flapping_from_blade,
    lock_reduction,
)
from helisim.vehicle.trim import find_trim

DIRECT = ("tau_f", "A_b", "B_a", "A_lat", "A_lon", "B_lat", "B_lon")
"""Derivatives that are parameters of the tip-path-plane equations themselves."""

SOLVED = ("Z_w", "Z_col", "N_r", "N_ped", "L_b", "M_a")
"""Derivatives that the physical parameters are solved for; hover at centred controls too."""

UNKNOWNS = {
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
"""PhysicalParameter -> unit, and the condition that fixes it."""

_TOLERANCE = 1e-8
"""Relative error allowed in each condition: four digits beyond any published one."""


def calibrate(
    vehicle: str | PathLike[str],
    given: Parameters,
    targets: Mapping[str, float],
    source: str,
    *,
    on_progress: Callable[[str], None] | None = None,
) -> Parameters:
    """Return the solved parameters of a vehicle: those that `given` leaves open.

    Root finding on the nonlinear force laws: at the solution the hover needs no control
    offsets and the linearised derivatives equal the targets.

    Args:
        vehicle: name of a shipped one or path of a folder, whose MJCF is flown.
        given: given and chosen parameters; the gyro's may be missing.
        targets: values of DIRECT and SOLVED by name, SI; without tau_f where the blades' inertia is
            given.
        source: where the targets come from, for the provenance.
        on_progress: called with the vehicle's name each time other parameters are tried.

    Raises:
        InputError: a target is missing or not finite, or there is one too many.
        ModelError: no solution.
    """
    direct_ones = tuple(key for key in DIRECT if key not in spared(given))
    for wanted in direct_ones + SOLVED:
        if not np.isfinite(targets.get(wanted, np.nan)):
            raise InputError(
                f"calibration needs a finite {wanted}, got {targets.get(wanted)!r}; "
                f"it takes {', '.join(direct_ones + SOLVED)}"
            )
    for extra in spared(given):
        if extra in targets:
            raise InputError(
                f"{INERTIA} and the target {extra} both say how fast the disc follows: give one"
            )
    direct = {
        f"flapping.{key.lower()}": PhysicalParameter(
            f"flapping.{key.lower()}", targets[key], "s" if key == "tau_f" else _unit(key), source
        )
        for key in direct_ones
    }
    guess = first_guess(given, targets, *mass_and_gravity(vehicle))
    starts = np.array([guess[key] for key in UNKNOWNS])

    entries = {key: given.entry(key) for key in given}

    def join(scale: NDArray[np.float64]) -> Parameters:
        solved = {
            key: PhysicalParameter(key, float(value), unit, f"solved: {condition}, {source}")
            for (key, (unit, condition)), value in zip(UNKNOWNS.items(), scale * starts)
        }
        return untuned(Parameters({**entries, **direct, **solved}))

    def miss(scale: NDArray[np.float64]) -> NDArray[np.float64]:
        missed = _miss(vehicle, join(scale), targets)
        if on_progress is not None:
            on_progress(Path(vehicle).name)
        return missed

    solution = root(miss, np.ones(len(starts)), method="hybr", tol=1e-13)
    worst = float(np.max(np.abs(miss(solution.x))))
    if not worst < _TOLERANCE:
        raise ModelError(
            f"calibration of {str(vehicle)!r} misses a condition by {worst:.2g} (relative); "
            f"the targets may be out of reach: {dict(targets)}"
        )
    complete = join(solution.x)
    return Parameters({key: complete.entry(key) for key in (*direct, *UNKNOWNS)})


def spared(given: Container[str]) -> tuple[str, ...]:
    """Return the targets that are not needed, as they follow from what is given."""
    return ("tau_f",) if INERTIA in given else ()


def _unit(derivative: str) -> str:
    return "1" if derivative in ("A_b", "B_a") else "rad"


def _miss(
    vehicle: str | PathLike[str], parameters: Parameters, targets: Mapping[str, float]
) -> NDArray[np.float64]:
    model = plain_rotor(assemble(vehicle, parameters, delays=False))
    trim = find_trim(model)
    plate = Swashplate.of(completed(parameters))
    base = linearize(model, trim)
    found = stability_derivatives(base, plate)
    errors = [found[key] / targets[key] - 1.0 for key in SOLVED]
    across = base.derivative("p", "flap_a") / targets["L_b"]
    return np.array([trim.col, trim.ped, across, *errors])


@dataclass(frozen=True)
class Disc:
    """A rotor at the hover.

    force: N, the reference of its coefficients, rho A (Omega R)^2; tip_speed: m/s; solidity: sigma;
    thrust: N.
    """

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


def hover_torque(given: Mapping[str, float], main: Disc) -> float:
    """Return the torque that the main rotor takes in hover, N m."""
    power = given["main_rotor.induced_factor"] * main.inflow * main.thrust / main.force
    power += main.solidity * given["main_rotor.profile_drag"] / 8.0
    return main.force * given["main_rotor.radius"] * power


def first_guess(
    given: Mapping[str, float], targets: Mapping[str, float], mass: float, gravity: float
) -> dict[str, float]:
    """Return a value near the solution for each parameter that calibration solves for.

    given: given and chosen parameters, by name; targets: derivatives, by name; mass: kg; gravity:
    m/s^2.

    Raises:
        ModelError: the heave damping is none that a hovering rotor can have.
    """
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
    tail = Disc.of(given, "tail_rotor", hover_torque(given, main) / arm)
    tail_slope = given["tail_rotor.lift_slope"] * tail.solidity
    ixx = given["airframe.ixx"]
    izz = -(arm**2) * tail.per_climb(tail_slope) / targets["N_r"]
    return {
        "main_rotor.lift_slope": slope / main.solidity,
        "main_rotor.pitch_trim": main.pitch(slope),
        "main_rotor.pitch_range": -targets["Z_col"] * mass / main.per_pitch(slope),
        "main_rotor.hub_stiffness": targets["L_b"] * ixx + main.thrust * given["main_rotor.hub_z"],
        "main_rotor.hub_cross": 0.5 * hover_torque(given, main),
        "airframe.iyy": ixx * targets["L_b"] / targets["M_a"],
        "airframe.izz": izz,
        "tail_rotor.pitch_trim": tail.pitch(tail_slope),
        "tail_rotor.pitch_range": targets["N_ped"] * izz / (arm * tail.per_pitch(tail_slope)),
    }


UNITS = {name: glossary()["targets." + name].unit for name in DIRECT + SOLVED}
"""Every derivative that a calibration takes, and its unit."""

_SIGNS = {"tau_f": 1, "Z_w": -1, "Z_col": -1, "N_r": -1, "N_ped": 1, "L_b": 1, "M_a": 1}
"""Signs of the targets that can have one only, whichever way the rotor turns."""


def stated_targets(given: Parameters) -> Parameters:
    """Return the derivatives that a vehicle's parameters state, by name, such as "Z_w".

    Raises:
        ModelError: one has a sign that no helicopter has.
    """
    found = {}
    for key, unit in UNITS.items():
        if "targets." + key not in given:
            continue
        entry = given.entry("targets." + key)
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
"""Parameters that an estimate takes beside the vehicle's other parameters, all in `[geometry]`."""

_SOURCE = "estimated: closed form, from the geometry"


def estimated_targets(given: Parameters, mass: float, gravity: float) -> Parameters:
    """Return an estimate of every derivative that a calibration takes, by name.

    given: the vehicle's parameters, those of `GEOMETRY` among them; mass: kg; gravity: m/s^2.

    Raises:
        ModelError: one of the geometry is missing, or not positive.
    """
    terms = {name: glossary()["geometry." + name] for name in GEOMETRY}
    missing = [
        f"{name} ({terms[name].unit})" for name in GEOMETRY if "geometry." + name not in given
    ]
    if missing:
        raise ModelError(
            f"an estimate from the geometry needs a section [geometry] with {', '.join(missing)}"
        )
    own = {name: given["geometry." + name] for name in GEOMETRY}
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


HOVER = ("main_rotor.pitch_trim", "tail_rotor.pitch_trim")
"""Parameters that hovering fixes."""
BLADE = ("main_rotor.blade_inertia", "flapping.lock_reduction", "geometry.cyclic_range")
"""Parameters that the tip-path plane takes beside the rotor's own parameters."""
_TRIALS = 4
"""Pitch is linear in the controls: one trial finds the hover, a second confirms it."""
_CENTRED = 1e-9
"""Tolerance of the controls, unitised."""


def is_known(given: Mapping[str, float]) -> bool:
    """Return whether parameters, uncalibrated, say all but the hover that is solved for."""
    solved = set(UNKNOWNS) - {*HOVER, "main_rotor.hub_cross"}
    return all(name in given for name in (*solved, *BLADE))


def settled(vehicle: str | PathLike[str], given: Parameters) -> Parameters:
    """Return what follows from a vehicle's known parameters: section [flapping], and the hover.

    Args:
        vehicle: name of a shipped one or path of a folder, whose MJCF is flown.
        given: its parameters; the gyro's may be missing.

    Raises:
        ModelError: there are no such blades, or they carry it in no hover.
        TrimError: it can't hover.
    """
    entries = {name: given.entry(name) for name in given}
    for name, value in flapping_of(given).to_parameters().items():
        unit = {"flapping.tau_f": "s", "flapping.a_b": "1", "flapping.b_a": "1"}.get(name, "rad")
        source = "computed: blade, hub stiffness and cyclic range"
        entries[name] = PhysicalParameter(name, value, unit, source)
    pitch = _first_pitch(given, *mass_and_gravity(vehicle))
    for _ in range(_TRIALS):
        for name, value in pitch.items():
            source = (
                f"solved: hover with the {'pedals' if 'tail' in name else 'collective'} centred"
            )
            entries[name] = PhysicalParameter(name, value, "rad", source)
        complete = completed(untuned(Parameters(entries)))
        trim = find_trim(assemble(vehicle, complete, delays=False))
        if max(abs(trim.col), abs(trim.ped)) < _CENTRED:
            solved = (name for name in entries if name not in given)
            return Parameters({name: entries[name] for name in solved})
        pitch["main_rotor.pitch_trim"] += complete["main_rotor.pitch_range"] * trim.col
        hand = complete["main_rotor.direction"]
        pitch["tail_rotor.pitch_trim"] += hand * complete["tail_rotor.pitch_range"] * trim.ped
    raise ModelError(f"{vehicle}: no pitch of the blades holds the hover with controls centred")


def flapping_of(given: Mapping[str, float]) -> Flapping:
    """Return the tip-path plane's equation of a rotor whose blade and hub are known.

    Args:
        given: parameters by name, `BLADE` and the main rotor's among them.

    Raises:
        InputError: a number that no rotor has.
    """
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


def _first_pitch(given: Mapping[str, float], mass: float, gravity: float) -> dict[str, float]:
    """Return the pitch of main and tail blades in hover, near enough to solve from."""
    main = Disc.of(given, "main_rotor", mass * gravity)
    tail = Disc.of(given, "tail_rotor", hover_torque(given, main) / abs(given["tail_rotor.arm_x"]))
    return {
        f"{rotor}.pitch_trim": disc.pitch(given[f"{rotor}.lift_slope"] * disc.solidity)
        for rotor, disc in (("main_rotor", main), ("tail_rotor", tail))
    }
