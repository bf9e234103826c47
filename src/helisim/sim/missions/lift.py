"""Where a pilot who knows his rotor puts the collective for a thrust: blade element and momentum.

It needs no precision, as he sees what comes of it; but between a hover and a descent on the wind
the same thrust takes a whole travel of the stick less.
"""

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from helisim.physics.layout import PARAM
from helisim.vehicle import Vehicle
from helisim.vehicle.motion import root_body
from helisim.vehicle.trim import collective_stick

_SETTLES = 8
"""Rounds in which the induced velocity is found."""
_MIXING = 0.5
"""Of the hover's induced velocity, below which no flow through the disc falls: a vortex ring."""


@dataclass(frozen=True)
class Lift:
    """The main rotor as its pilot knows it, SI.

    Attributes:
        weight: N.
        mass: kg.
        tip_speed: m/s, nominal.
        area: of the disc times the density of the air, kg/m.
        blades: lift slope times solidity, over 2.
        travel: blade pitch of a unit of collective stick, rad.
        offset: collective stick, unitised, by which the hover is off what these say.
    """

    weight: float
    mass: float
    tip_speed: float
    area: float
    blades: float
    travel: float
    offset: float = 0.0

    @classmethod
    def of(cls, vehicle: Vehicle, model: mujoco.MjModel, rotor: int) -> "Lift":
        """Return that of a vehicle, right in a hover.

        Args:
            vehicle: that flies.
            model: of the flight.
            rotor: its rotor's actuator.
        """
        par = model.actuator_user[rotor]
        mass = float(model.body_subtreemass[root_body(model)])
        radius = float(par[PARAM.main_radius])
        plain = cls(
            weight=mass * float(np.linalg.norm(model.opt.gravity)),
            mass=mass,
            tip_speed=float(par[PARAM.main_speed]) * radius,
            area=float(par[PARAM.air_density]) * math.pi * radius**2,
            blades=0.5 * float(par[PARAM.main_lift_slope] * par[PARAM.main_solidity]),
            travel=float(par[PARAM.main_pitch_range] * par[PARAM.gyro_collective]),
        )
        hover = collective_stick(model, vehicle.trim)
        return cls(**{**vars(plain), "offset": hover - plain.collective(0.0, 1.0, 0.0, 0.0)})

    @property
    def induced(self) -> float:
        """Induced velocity of the hover, m/s."""
        return math.sqrt(self.weight / (2.0 * self.area))

    def collective(self, push: float, speed: float, through: float, across: float) -> float:
        """Return where the collective stick makes a thrust, unitised.

        Args:
            push: m/s^2, beside the weight.
            speed: of the rotor, over the nominal one.
            through: velocity of the air up through the disc, m/s.
            across: in the disc's plane, m/s.
        """
        thrust = self.weight + self.mass * push
        tip = speed * self.tip_speed
        least = _MIXING * self.induced
        induced = self.induced
        for _ in range(_SETTLES):
            flow = math.hypot(across, max(least, abs(induced - through)))
            induced = 0.5 * (induced + thrust / (2.0 * self.area * flow))
        coefficient = thrust / (self.area * tip**2)
        pitch = 3.0 * (coefficient / self.blades + 0.5 * (induced - through) / tip)
        return self.offset + pitch / self.travel
