"""The figures by which a helicopter is judged at a glance, and what is usual of each."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from helisim.study.check.problem import Problem
from helisim.vehicle import Vehicle
from helisim.vehicle.blade import lock_number
from helisim.vehicle.motion import root_body

_USUAL = {
    "disc_loading": (
        2.0,
        1000.0,
        "N/m^2",
        "weight over the disc's area: look at the mass in the MJCF and at main_rotor.radius",
    ),
    "tip_speed": (
        20.0,
        300.0,
        "m/s",
        "radius times speed: look at main_rotor.radius and main_rotor.speed (rad/s, not rpm)",
    ),
    "solidity": (
        0.01,
        0.25,
        "",
        "blades' area over the disc's: look at main_rotor.chord, blades and radius",
    ),
    "blade_loading": (
        0.005,
        0.16,
        "",
        "CT over solidity in the hover, beyond which blades stall: look at mass, speed and chord",
    ),
    "lock_number": (
        0.3,
        20.0,
        "",
        "how the air holds a blade beside its inertia, and so how fast the disc follows: look at "
        "flapping.tau_f or main_rotor.blade_inertia",
    ),
    "figure_of_merit": (
        0.15,
        0.9,
        "",
        "ideal over real power of the hover: look at main_rotor.profile_drag and induced_factor",
    ),
}
"""Figure -> lowest and highest usual value, unit, what it is and where to look."""


@dataclass(frozen=True, kw_only=True)
class Figures:
    """What a vehicle is in the hover.

    Attributes:
        mass: kg.
        disc_loading: N/m^2.
        tip_speed: m/s, of the main blades.
        solidity: of the main rotor.
        blade_loading: thrust coefficient over solidity.
        lock_number: density x lift slope x chord x radius^4 over a blade's flapping inertia.
        collective: pitch of the main blades, rad.
        power: W, of the main rotor's shaft.
        figure_of_merit: ideal over real power.
        poles: rad/s, of the base helicopter's modes that are not at zero and slower than its
            servos, slowest first; one of each pair.
    """

    mass: float
    disc_loading: float
    tip_speed: float
    solidity: float
    blade_loading: float
    lock_number: float
    collective: float
    power: float
    figure_of_merit: float
    poles: tuple[complex, ...]

    @classmethod
    def of(cls, vehicle: Vehicle) -> "Figures":
        """Return those of a vehicle in its hover."""
        own, model = vehicle.parameters, vehicle.model
        mass = float(model.body_subtreemass[root_body(model)])
        weight = mass * float(np.linalg.norm(model.opt.gravity))
        disc = math.pi * own["main_rotor.radius"] ** 2
        pitch = own["main_rotor.pitch_trim"] + own["main_rotor.pitch_range"] * vehicle.trim.col
        ideal = weight**1.5 / math.sqrt(2.0 * own["air.density"] * disc)
        return cls(
            mass=mass,
            **at_a_glance(own, weight),
            collective=pitch,
            power=vehicle.power,
            figure_of_merit=ideal / vehicle.main_power,
            poles=_poles(vehicle),
        )


def at_a_glance(own: Mapping[str, float], weight: float) -> dict[str, float]:
    """Return the figures that need no flight, by name.

    Args:
        own: parameters of the vehicle.
        weight: N.
    """
    radius, speed = own["main_rotor.radius"], own["main_rotor.speed"]
    disc = math.pi * radius**2
    solidity = own["main_rotor.blades"] * own["main_rotor.chord"] / (math.pi * radius)
    dynamic = own["air.density"] * disc * (speed * radius) ** 2
    return {
        "disc_loading": weight / disc,
        "tip_speed": speed * radius,
        "solidity": solidity,
        "blade_loading": weight / dynamic / solidity,
        "lock_number": lock_number(own),
    }


def implausible(figures: Mapping[str, float]) -> Iterator[Problem]:
    """Yield the figures, by name, that no helicopter is likely to have."""
    for name, value in figures.items():
        low, high, unit, why = _USUAL[name]
        if not low <= value <= high:
            space = f" {unit}" if unit else ""
            yield Problem(
                f"The {name.replace('_', ' ')} is {value:.4g}{space}, which is implausible: it is "
                f"usually {low:g} to {high:g}{space}. It is {why}.",
                flies=True,
            )


def _poles(vehicle: Vehicle) -> tuple[complex, ...]:
    poles = np.linalg.eigvals(np.asarray(vehicle.linearize("IN1").system.A))
    slowest_servo = min(
        vehicle.parameters["servo.swash_frequency"], vehicle.parameters["servo.tail_frequency"]
    )
    size = np.abs(poles)
    kept = poles[(size > 1e-3) & (size < 0.9 * slowest_servo) & (poles.imag >= 0.0)]
    return tuple(complex(pole) for pole in kept[np.argsort(np.abs(kept))])
