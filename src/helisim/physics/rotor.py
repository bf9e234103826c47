"""Rotors in the air that passes them: blade elements, their drag and stall, main and tail rotor.

Coefficients are those of the field: CT = T / (rho A (Omega R)^2), CQ and CP likewise with R and
with the third power; inflow and climb ratios are over Omega R, positive when air passes the disc
against the thrust, as in a climb.

Three planes meet at the main rotor's hub. The shaft's carries the forces in the plane of the disc.
In that of no feathering, which the swashplate tilts, blades see no cyclic pitch: what passes
through it gives their lift. Thrust stands on the tips' plane: what passes along it is what momentum
theory knows, and what thrust works against, so that the shaft's power is the work of thrust and
drag on the vehicle and the heat that the air keeps.
"""

import math
from collections import namedtuple

from helisim.physics.inflow import balance, carried, soft_limit
from helisim.physics.kernel import kernel
from helisim.physics.layout import PARAM
from helisim.physics.motion import Wrench


@kernel()
def unloaded_inflow(pitch, twist, climb, advance):
    """Return the induced velocity at which unstalled blades carry no thrust, over Omega R.

    CT falls from there by a sigma / 4 for each unit of it (Leishman, Principles of Helicopter
    Aerodynamics, chapter 3, in axes of no feathering):
    CT = (a sigma / 2) (theta_0 / 3 (1 + 3/2 mu^2) + theta_tw / 4 (1 + mu^2) - lambda / 2).

    pitch: collective pitch at 3/4 of the radius, rad, where twist doesn't matter in hover; twist:
    tip's pitch minus the root's, rad, linear between; climb: along the normal of the plane in which
    the blades don't feather; advance: advance ratio mu.
    """
    square = advance**2
    return pitch * (2.0 / 3.0 + square) - 0.25 * twist * square - climb


@kernel()
def inflow_and_thrust(pitch, climb, advance, solidity, lift_slope, stall, nearness=0.0):
    """Return the total inflow ratio lambda and CT where blade elements and momentum meet.

    For blades without twist that don't feather about another axis than the thrust's.

    pitch: collective pitch, rad; climb: climb ratio along the thrust; advance: advance ratio mu;
    solidity: sigma; lift_slope: 1/rad; stall: greatest |CT| / sigma that the blades carry;
    nearness: (R / 4z)^2 of the ground, 0 far from it.
    """
    free = unloaded_inflow(pitch, 0.0, climb, advance)
    slope = 0.25 * lift_slope * solidity
    induced, thrust = balance(free, slope, stall * solidity, climb, advance, nearness)
    return climb + induced, thrust


Losses = namedtuple("Losses", "torque drag")
"""The cost of a rotor's thrust, apart from the work that it does on what it moves.

torque: CQ; drag: force against the edgewise flow in the disc's plane, CH over mu.
"""


@kernel()
def losses(thrust, unstalled, induced, advance, solidity, slope, induced_factor, least_drag):
    """Return the `Losses` of a rotor: induced, and of its blades' drag.

    The shaft's CQ is that and climb times CT; the air's heat is CQ + mu CH of this.

    thrust: CT; unstalled: CT that the blades would carry without stall; induced: v over the tip
    speed; advance: mu; solidity: sigma; slope: of CT by v, a sigma / 4; induced_factor: kappa,
    ratio of induced power to that of uniform inflow; least_drag: c_d0 of blades that don't stall.
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

    pitch: collective pitch at 3/4 of the radius, rad; twist: tip's pitch minus the root's, rad;
    inflow: lambda, along the thrust; slope: of CT by v, a sigma / 4.
    """
    return slope * inflow * (inflow - pitch / 3.0 - 0.25 * twist)


@kernel()
def stalled_drag(incidence, kept):
    """Return by how much the drag coefficient of the blades' sections rises past the stall.

    Where lift is lost the flow has left the blades, and the force that is left is that on a
    plate, whose drag comes on with the loss: 2 sin^2 of the incidence. NACA 0012 at 25 to 90
    degrees (Sheldahl and Klimas, SAND80-2114) has that within 25 %.

    incidence: mean of the sections, rad; kept: share of the unstalled lift that is left.
    """
    return 2.0 * (1.0 - kept**2) * math.sin(min(incidence, 0.5 * math.pi)) ** 2


@kernel()
def profile_drag(advance):
    """Return CQ and CH of the blades' drag, over sigma c_d / 8, the latter also over mu.

    Drag along the local flow in the disc's plane, radial and reversed flow included. These are
    exact for small and great mu; between, their sum CP = CQ + mu CH is within 0.4 % of the
    integral, torque within 1.8 % and force within 0.9 %. Johnson's fit to mu = 0.5 is
    1 + 4.5 mu^2 + 1.61 mu^3.7 (Rotorcraft Aeromechanics, chapter 6).

    advance: mu.
    """
    square = advance**2
    torque = math.sqrt(1.0 + square * (3.0 + square / (1.0 + square)))
    return torque, math.sqrt(9.0 + 16.0 * square)


STOPPED = 0.05
"""Fraction of its speed below which a rotor's forces fade, to nothing where it stands."""


MainRotor = namedtuple(
    "MainRotor",
    "thrust torque drag_x drag_y heat inflow induced climb advance tip_speed pitch",
)
"""Forces and flow of the main rotor.

thrust: N, along the normal of the tips' plane; torque: N m, which the shaft takes; negative
where the air turns the rotor; drag_x: force of the blades in the plane of the hub, N, forward;
drag_y: likewise to the right, N; heat: power that the air keeps, induced and of the blades'
drag, W; inflow: ratio of the air's velocity through the plane of no feathering to the tip
speed; induced: share of it that the rotor itself makes; climb: ratio of the hub's velocity
along the thrust, through the air, to the tip speed; advance: likewise across the shaft;
tip_speed: m/s, at least that of a rotor that counts as stopped; pitch: collective pitch of the
blades, rad.
"""


@kernel()
def turning(speed):
    """Return the speed at which a rotor is computed, and the share of its forces that it has.

    Both over nominal ones. A rotor that hardly turns has its forces in the ratio of an endless
    advance ratio; so they are found at `STOPPED`, and fade from there as a smooth cubic.

    speed: of the rotor, over the nominal one.
    """
    if speed >= STOPPED:
        return speed, 1.0
    part = max(0.0, speed) / STOPPED
    return STOPPED, part * part * (3.0 - 2.0 * part)


@kernel()
def main_rotor(par, motion, speed, collective, tips, swashplate, nearness=0.0, mean=0.0):
    """Return what the main rotor does.

    speed: rotor speed over the nominal one; collective: unitised; tips: tilt of the tips' plane,
    rearward and right, rad, (2,); swashplate: tilt of the plane of no feathering, likewise, (2,);
    nearness: (R / 4z)^2 of the ground, 0 far from it; mean: induced velocity, m/s, where inflow is
    dynamic; else it is what the thrust asks for.
    """
    speed, share = turning(speed)
    radius = par[PARAM.main_radius]
    tip_speed = par[PARAM.main_speed] * speed * radius
    pitch = par[PARAM.main_pitch_trim] + par[PARAM.main_pitch_range] * collective
    u = (motion.u + motion.q * par[PARAM.hub_z]) / tip_speed
    v = (motion.v - motion.p * par[PARAM.hub_z]) / tip_speed
    w = (motion.w - motion.q * par[PARAM.hub_x]) / tip_speed
    advance = math.sqrt(u**2 + v**2)
    x, y, z = normal(par, tips)
    climb = u * x + v * y + w * z
    through = -swashplate[0] * u + swashplate[1] * v - w
    slope = 0.25 * par[PARAM.main_lift_slope] * par[PARAM.main_solidity]
    limit = par[PARAM.main_stall] * par[PARAM.main_solidity]
    free = unloaded_inflow(pitch, par[PARAM.main_twist], through, advance)
    if par[PARAM.main_dynamic_inflow] != 0.0:
        induced = mean / tip_speed
        thrust = carried(free, slope, limit, induced)
    else:
        induced, thrust = balance(free, slope, limit, climb, advance, nearness)
    unstalled = slope * (free - induced)
    spent = losses(
        thrust,
        unstalled,
        induced,
        advance,
        par[PARAM.main_solidity],
        slope,
        par[PARAM.main_induced_factor],
        par[PARAM.main_profile_drag],
    )
    lean = leaning_lift(pitch, par[PARAM.main_twist], climb + induced, slope)
    if thrust != unstalled:
        lean *= thrust / unstalled
    drag = spent.drag + lean
    force = share * par[PARAM.air_density] * math.pi * radius**2 * tip_speed**2
    return MainRotor(
        force * thrust,
        force * radius * (climb * thrust + spent.torque - lean * advance**2),
        -force * drag * u,
        -force * drag * v,
        force * tip_speed * (spent.torque + spent.drag * advance**2),
        through + induced,
        induced,
        climb,
        advance,
        tip_speed,
        pitch,
    )


@kernel()
def normal(par, tips):
    """Return the direction of thrust, body axes, at a tilt of the tips' plane (2,), rad.

    Tilts are the slopes of that plane, as the first harmonic of small flapping angles is.
    """
    stop = par[PARAM.flap_stop]
    a, b = soft_limit(tips[0], stop, 0.7), soft_limit(tips[1], stop, 0.7)
    level = 1.0 / math.sqrt(1.0 + a * a + b * b)
    return -a * level, b * level, -level


@kernel()
def cyclic_tilt(par, lon, lat):
    """Return the tilt that the swashplate alone calls for, rearward and right, rad.

    It is that of the plane in which the blades don't feather, on which free blades settle in still
    air.

    lon: longitudinal cyclic, unitised; lat: lateral cyclic, unitised.
    """
    a = par[PARAM.cyclic_a_lat] * lat + par[PARAM.cyclic_a_lon] * lon
    return a, par[PARAM.cyclic_b_lat] * lat + par[PARAM.cyclic_b_lon] * lon


TailRotor = namedtuple("TailRotor", "thrust inflow torque drag_x drag_z heat")
"""Forces and flow of the tail rotor.

thrust: N; inflow: ratio of the air's velocity through the disc to the tip speed; torque: at its
own shaft, N m; drag_x: force of the blades' drag in the disc's plane, N, forward; drag_z:
likewise downward, N; heat: power that the air keeps, induced and of the blades' drag, W.
"""


@kernel()
def tail_rotor(par, motion, speed, pedal, wash=0.0):
    """Return what the tail rotor does, a `TailRotor`.

    Under blades that turn clockwise it pushes the tail to the left (nose right), and more so with
    the pedals; under others to the right, and less so: pedals forward is nose right for both.

    speed: rotor speed over the nominal one; pedal: of the tail servo, unitised; wash: velocity of
    the main rotor's wake there, m/s downwards.
    """
    speed, share = turning(speed)
    radius = par[PARAM.tail_radius]
    tip_speed = par[PARAM.tail_speed] * speed * radius
    hand, x, z = par[PARAM.main_direction], par[PARAM.tail_x], par[PARAM.tail_z]
    pitch = par[PARAM.tail_pitch_trim] + hand * par[PARAM.tail_pitch_range] * pedal
    ahead, down = motion.u + motion.q * z, motion.w - motion.q * x - wash
    advance = math.sqrt(ahead**2 + down**2) / tip_speed
    climb = -hand * (motion.v + motion.r * x - motion.p * z) / tip_speed
    slope = 0.25 * par[PARAM.tail_lift_slope] * par[PARAM.tail_solidity]
    limit = par[PARAM.tail_stall] * par[PARAM.tail_solidity]
    free = unloaded_inflow(pitch, 0.0, climb, advance)
    induced, thrust = balance(free, slope, limit, climb, advance, 0.0)
    spent = losses(
        thrust,
        slope * (free - induced),
        induced,
        advance,
        par[PARAM.tail_solidity],
        slope,
        par[PARAM.tail_induced_factor],
        par[PARAM.tail_profile_drag],
    )
    force = share * par[PARAM.air_density] * math.pi * radius**2 * tip_speed**2
    torque = force * radius * (climb * thrust + spent.torque)
    drag = -force * spent.drag / tip_speed
    heat = force * tip_speed * (spent.torque + spent.drag * advance**2)
    return TailRotor(force * thrust, climb + induced, torque, drag * ahead, drag * down, heat)


@kernel()
def tail_wrench(par, tail):
    """Return the wrench of a tail rotor that does what `tail`, a `TailRotor`, says."""
    x, z = par[PARAM.tail_x], par[PARAM.tail_z]
    side = -par[PARAM.main_direction] * (1.0 - par[PARAM.tail_blockage]) * tail.thrust
    pitching = z * tail.drag_x - x * tail.drag_z - par[PARAM.tail_direction] * tail.torque
    return Wrench(tail.drag_x, side, tail.drag_z, -z * side, pitching, x * side)
