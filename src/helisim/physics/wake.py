"""The main rotor's wake where it passes fuselage and tail.

In hover it falls below the rotor, and a tail stands beside it; with speed it is blown back over
the tail, and at high speed the tail flies in the downwash behind the disc as behind a wing.
"""

import math
from typing import NamedTuple

from helisim.physics.ground import wash_left
from helisim.physics.kernel import kernel
from helisim.physics.main_rotor import turning
from helisim.physics.params import PARAM

COEFFICIENTS = 8
"""Of the wash at one place: of hover and vertical descent, then by powers of the skew's cosine."""


class Wash(NamedTuple):
    """Velocities of the main rotor's wake, m/s downwards.

    Attributes:
        fuselage: at the fuselage.
        tail: at tail rotor and fin.
        tailplane: at the tailplane.
    """

    fuselage: float
    tail: float
    tailplane: float


@kernel()
def wash(par, motion, main, speed=1.0, nearness=0.0):
    """Return the `Wash` of a main rotor.

    Args:
        par: parameters.
        motion: `Velocities` of the body through the air.
        main: what the main rotor does, a `MainRotor`.
        speed: rotor speed over the nominal one; the wake of one that stops fades with its forces.
        nearness: (R / 4z)^2 of the ground, which stops the wake; 0 far from it.
    """
    _, turns = turning(speed)
    induced = main.induced * main.tip_speed
    through = induced - motion.w + motion.q * par[PARAM.hub_x]
    ahead = motion.u + motion.q * par[PARAM.hub_z]
    aside = motion.v - motion.p * par[PARAM.hub_z]
    square = ahead**2 + aside**2 + through**2
    if square == 0.0:
        return Wash(0.0, 0.0, 0.0)
    induced *= turns
    cosine = through / math.sqrt(square)
    behind = max(ahead, 0.0) ** 2 / square
    fuselage = par[PARAM.download] * induced
    tail = induced * share(par, PARAM.tail_wash, cosine, behind)
    tailplane = induced * share(par, PARAM.tailplane_wash, cosine, behind)
    if nearness > 0.0:
        fuselage *= wash_left(par, nearness, par[PARAM.drag_centre_z])
        tail *= wash_left(par, nearness, par[PARAM.tail_z])
        tailplane *= wash_left(par, nearness, par[PARAM.tailplane_z])
    return Wash(fuselage, tail, tailplane)


@kernel()
def share(par, first, cosine, behind):
    """Return the downwash at a place over the induced velocity at the disc.

    Args:
        par: parameters.
        first: where the place's `COEFFICIENTS` start.
        cosine: of the skew angle: 1 in hover, 0 where the wake leaves along the disc, -1 where it
            rises.
        behind: squared sine of the skew angle, of its part that blows back.
    """
    polynomial = 0.0
    for k in range(COEFFICIENTS - 1, 1, -1):
        polynomial = polynomial * cosine + par[first + k]
    upright = par[first] if cosine > 0.0 else par[first + 1]
    return upright * cosine**2 + behind * polynomial
