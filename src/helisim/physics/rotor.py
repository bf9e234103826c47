"""Forces and power of a rotor's blades: elements in uniform inflow, their drag, their stall.

Coefficients are those of the field: CT = T / (rho A (Omega R)^2), CQ and CP likewise with R and
with the third power; inflow and climb ratios are over Omega R, positive when air passes the disc
against the thrust, as in a climb.
"""

import math
from typing import NamedTuple

from helisim.physics.inflow import balance, soft_limit
from helisim.physics.kernel import kernel

__all__ = ["soft_limit"]


@kernel()
def unloaded_inflow(pitch, twist, climb, advance):
    """Return the induced velocity at which unstalled blades carry no thrust, over Omega R.

    CT falls from there by a sigma / 4 for each unit of it (Leishman, Principles of Helicopter
    Aerodynamics, chapter 3, in axes of no feathering):
    CT = (a sigma / 2) (theta_0 / 3 (1 + 3/2 mu^2) + theta_tw / 4 (1 + mu^2) - lambda / 2).

    Args:
        pitch: collective pitch at 3/4 of the radius, rad, where twist doesn't matter in hover.
        twist: tip's pitch minus the root's, rad, linear between.
        climb: along the normal of the plane in which the blades don't feather.
        advance: advance ratio mu.
    """
    square = advance**2
    return pitch * (2.0 / 3.0 + square) - 0.25 * twist * square - climb


@kernel()
def inflow_and_thrust(pitch, climb, advance, solidity, lift_slope, stall, nearness=0.0):
    """Return the total inflow ratio lambda and CT where blade elements and momentum meet.

    For blades without twist that don't feather about another axis than the thrust's.

    Args:
        pitch: collective pitch, rad.
        climb: climb ratio along the thrust.
        advance: advance ratio mu.
        solidity: sigma.
        lift_slope: 1/rad.
        stall: greatest |CT| / sigma that the blades carry.
        nearness: (R / 4z)^2 of the ground, 0 far from it.
    """
    free = unloaded_inflow(pitch, 0.0, climb, advance)
    slope = 0.25 * lift_slope * solidity
    induced, thrust = balance(free, slope, stall * solidity, climb, advance, nearness)
    return climb + induced, thrust


class Losses(NamedTuple):
    """What a rotor's thrust costs, apart from the work that it does on what it moves.

    Attributes:
        torque: CQ.
        drag: force against the edgewise flow in the disc's plane, CH over mu.
    """

    torque: float
    drag: float


@kernel()
def losses(thrust, unstalled, induced, advance, solidity, slope, induced_factor, least_drag):
    """Return the `Losses` of a rotor: induced, and of its blades' drag.

    The shaft's CQ is that and climb times CT; the air's heat is CQ + mu CH of this.

    Args:
        thrust: CT.
        unstalled: CT that the blades would carry without stall.
        induced: v over the tip speed.
        advance: mu.
        solidity: sigma.
        slope: of CT by v, a sigma / 4.
        induced_factor: kappa, ratio of induced power to that of uniform inflow.
        least_drag: c_d0 of blades that don't stall.
    """
    section = 0.125 * solidity * least_drag
    if thrust != unstalled:
        incidence = 1.5 * abs(unstalled) / (slope * (1.0 + 1.5 * advance**2))
        section += 0.125 * solidity * stalled_drag(incidence, thrust / unstalled)
    torque, drag = profile_drag(advance)
    return Losses(induced_factor * induced * thrust + section * torque, section * drag)


@kernel()
def leaning_lift(pitch, twist, inflow, slope):
    """Return the force of the lift itself against the edgewise flow, CH over mu.

    Lift leans with its local flow, and more so where the blade moves slowly: on the disc of free
    blades, which feather by -8/3 mu theta + 2 mu lambda over the tips' plane, what is left is
    a sigma / 2 lambda (lambda / 2 - theta / 6 - theta_tw / 8) (the sums of Bramwell, Helicopter
    Dynamics, chapter 3, on the tips' plane, to first order in mu). Level with the disc it works
    against the airspeed, and the shaft is spared that work.

    Args:
        pitch: collective pitch at 3/4 of the radius, rad.
        twist: tip's pitch minus the root's, rad.
        inflow: lambda, along the thrust.
        slope: of CT by v, a sigma / 4.
    """
    return slope * inflow * (inflow - pitch / 3.0 - 0.25 * twist)


@kernel()
def stalled_drag(incidence, kept):
    """Return by how much the drag coefficient of the blades' sections rises past the stall.

    Where lift is lost the flow has left the blades, and the force that is left is that on a
    plate, whose drag comes on with the loss: 2 sin^2 of the incidence. NACA 0012 at 25 to 90
    degrees (Sheldahl and Klimas, SAND80-2114) has that within 25 %.

    Args:
        incidence: mean of the sections, rad.
        kept: share of the unstalled lift that is left.
    """
    return 2.0 * (1.0 - kept**2) * math.sin(min(incidence, 0.5 * math.pi)) ** 2


@kernel()
def profile_drag(advance):
    """Return CQ and CH of the blades' drag, over sigma c_d / 8, the latter also over mu.

    Drag along the local flow in the disc's plane, radial and reversed flow included. These are
    exact for small and great mu; between, their sum CP = CQ + mu CH is within 0.4 % of the
    integral, torque within 1.8 % and force within 0.9 %. Johnson's fit to mu = 0.5 is
    1 + 4.5 mu^2 + 1.61 mu^3.7 (Rotorcraft Aeromechanics, chapter 6).

    Args:
        advance: mu.
    """
    square = advance**2
    torque = math.sqrt(1.0 + square * (3.0 + square / (1.0 + square)))
    return torque, math.sqrt(9.0 + 16.0 * square)
