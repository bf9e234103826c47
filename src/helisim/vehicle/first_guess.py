"""Closed forms of a hovering helicopter: where calibration starts to search.

Momentum theory and untwisted blades at the hover (Padfield, Helicopter Flight Dynamics, ch. 3 and
4), without stall, tilt of the thrust or the tail's side force: a few percent from the solution,
whatever the size of the helicopter.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from helisim.errors import ModelError


@dataclass(frozen=True)
class _Disc:
    """A rotor at the hover: its reference force (N), tip speed (m/s), solidity, thrust (N)."""

    force: float
    tip_speed: float
    solidity: float
    thrust: float

    @classmethod
    def of(cls, given: Mapping[str, float], rotor: str, thrust: float) -> "_Disc":
        radius = given[f"{rotor}.radius"]
        tip_speed = given[f"{rotor}.speed"] * radius
        solidity = given[f"{rotor}.blades"] * given[f"{rotor}.chord"] / (math.pi * radius)
        force = given["air.density"] * math.pi * radius**2 * tip_speed**2
        return cls(force, tip_speed, solidity, thrust)

    @property
    def inflow(self) -> float:
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


def first_guess(
    given: Mapping[str, float], targets: Mapping[str, float], mass: float, gravity: float
) -> dict[str, float]:
    """Return a value near the solution for each parameter that calibration solves for.

    Args:
        given: given and chosen parameters, by name.
        targets: derivatives, by name.
        mass: kg.
        gravity: m/s^2.

    Raises:
        ModelError: the heave damping is none that a hovering rotor can have.
    """
    main = _Disc.of(given, "main_rotor", mass * gravity)
    wanted = -targets["Z_w"] * mass * main.tip_speed / main.force
    if not 0.0 < wanted < 2.0 * main.inflow:
        limit = 2.0 * main.inflow * main.force / (mass * main.tip_speed)
        raise ModelError(
            f"Z_w = {targets['Z_w']:g} 1/s is out of a hovering rotor's reach: momentum theory "
            f"allows {-limit:.3g} to 0 for this disc and {mass:g} kg"
        )
    slope = 16.0 * main.inflow * wanted / (2.0 * main.inflow - wanted)
    coefficient = main.thrust / main.force
    power = given["main_rotor.induced_factor"] * main.inflow * coefficient
    power += main.solidity * given["main_rotor.profile_drag"] / 8.0
    torque = main.force * given["main_rotor.radius"] * power
    arm = abs(given["tail_rotor.arm_x"])
    tail = _Disc.of(given, "tail_rotor", torque / arm)
    tail_slope = given["tail_rotor.lift_slope"] * tail.solidity
    ixx = given["airframe.ixx"]
    izz = -(arm**2) * tail.per_climb(tail_slope) / targets["N_r"]
    return {
        "main_rotor.lift_slope": slope / main.solidity,
        "main_rotor.pitch_trim": main.pitch(slope),
        "main_rotor.pitch_range": -targets["Z_col"] * mass / main.per_pitch(slope),
        "main_rotor.hub_stiffness": targets["L_b"] * ixx + main.thrust * given["main_rotor.hub_z"],
        "airframe.iyy": ixx * targets["L_b"] / targets["M_a"],
        "airframe.izz": izz,
        "tail_rotor.pitch_trim": tail.pitch(tail_slope),
        "tail_rotor.pitch_range": targets["N_ped"] * izz / (arm * tail.per_pitch(tail_slope)),
    }
