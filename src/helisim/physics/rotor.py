"""Rotors in the air that passes them: blade elements, their drag and stall, main and tail rotor.

CT = T / (rho A (Omega R)^2), CQ and CP likewise; inflow and climb are over Omega R, positive when
air passes the disc against the thrust. The shaft's plane has the in-plane forces, the plane of no
feathering the blades' lift, the tips' plane thrust and momentum. Arguments: `pitch`, collective at
3/4 radius, rad; `twist`, tip's pitch minus the root's, rad; `advance`, mu; `solidity`, sigma;
`slope`, of CT by v, a sigma / 4; `nearness`, (R / 4z)^2 of the ground; `speed`, over nominal.
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

    CT = (a sigma / 2) (theta_0 / 3 (1 + 3/2 mu^2) + theta_tw / 4 (1 + mu^2) - lambda / 2)
    (Leishman, ch. 3), climb along the normal of the plane of no feathering.
    """
    square = advance**2
    return pitch * (2.0 / 3.0 + square) - 0.25 * twist * square - climb


_SLOW = 0.02  # advance ratio over which the stall begins to come earlier
_TRANSONIC = 0.64  # square of the Mach number above which the slope of lift rises no more
_GREATEST = 1.2  # square of the lift coefficient above which the polar rises no more
_STEEPNESS = 13.5  # of c_d by the cube of the Mach number (Prouty, ch. 6: 21 (M - 0.725)^3.2)


@kernel()
def stall_limit(solidity, stall, fall, advance):
    """Return the greatest CT; stall: CT / sigma at the hover; fall: of the limit, by mu.

    At a fall of 1.8 that of blades without hub moment whose sections have one greatest lift
    coefficient, retreating or not: within 2 % of the sum over the disc up to mu = 0.5.
    """
    more = _SLOW + advance
    return solidity * stall * more / (more + fall * advance**2)


@kernel()
def compressed(mach, speed, advance):
    """Return the slope of lift over that of the hover, by Prandtl and Glauert's rule.

    At the Mach number whose square is the mean over the disc, weighted by dynamic pressure.
    """
    square = advance**2
    whole = 1.0 + 1.5 * square
    now = (mach * speed) ** 2 * (0.6 + square * (3.0 + 1.125 * square))
    still = 1.0 - min(0.6 * mach**2, _TRANSONIC)
    return math.sqrt(still * whole / (whole - min(now, _TRANSONIC * whole)))


Section = namedtuple("Section", "solidity twist induced_factor least_drag lift_drag divergence")
"""Blades: kappa, c_d = least_drag + lift_drag c_l^2, Mach number of drag rise at no lift."""

Losses = namedtuple("Losses", "torque drag")
"""The cost of a rotor's thrust beside its work; torque: CQ; drag: CH over mu, in the disc."""


@kernel()
def losses(blades, thrust, unstalled, induced, inflow, advance, slope, mach):
    """Return the `Losses` of a `Section`.

    thrust, unstalled: CT; induced: v; inflow: along the thrust; mach: of the tips now.
    """
    section = blades.least_drag
    if thrust != unstalled:
        incidence = 1.5 * abs(unstalled) / (slope * (1.0 + 1.5 * advance**2))
        section += stalled_drag(incidence, thrust / unstalled)
    loading = thrust / blades.solidity
    square, rising = advance**2, blades.divergence * (1.0 - 6.0 * loading**2)
    lifting = blades.lift_drag * mean_square_lift(
        loading, 4.0 * slope / blades.solidity, inflow, blades.twist
    )
    lifting *= 1.0 + square * (0.7 + 1.7 * square / (1.0 + square))
    torque, drag = profile_drag(advance)
    rise_torque, rise_drag = drag_rise(mach, rising, advance)
    part = 0.125 * blades.solidity
    profile = section * torque + lifting + rise_torque
    return Losses(
        blades.induced_factor * induced * thrust + part * profile,
        part * (section * drag + rise_drag),
    )


@kernel()
def mean_square_lift(loading, slope, inflow, twist):
    """Return the mean of c_l^2 over the blade, weighted by r^3; loading: CT / sigma; slope: a.

    Of c_l = a (theta - lambda / r), the integral (Leishman, ch. 3); edgewise flow leaves its sum
    over the disc in equilibrium, by loading and inflow on the tips' plane, as `losses` has it.
    """
    lift, flow, bent = 6.0 * loading, slope * inflow, slope * twist
    square = (lift + flow / 6.0) ** 2 + flow**2 * (2.0 / 9.0)
    square += bent * (0.1 * lift + 0.15 * flow + bent * (7.0 / 240.0))
    return soft_limit(square, _GREATEST, 0.7)


@kernel()
def drag_rise(mach, divergence, advance):
    """Return CQ, and CH over mu, over sigma / 8, of sections above the Mach number of drag rise.

    c_d rises by 13.5 (M - M_dd)^3; up to 0.2 above M_dd this is within 3 % of the sum over the
    disc at the hover and from mu = 0.2 on, 7.5 % from 0.1, 26 % between.
    """
    tip = 1.0 + advance
    excess = mach * tip - divergence
    if excess <= 0.0:
        return 0.0, 0.0
    width = math.sqrt(excess / (excess + 29.9 * mach * advance))
    rise = _STEEPNESS * (tip * excess**2) ** 2 * width / mach
    rise /= 1.0 + 0.7 * excess
    return rise, rise / (advance + 0.1 * excess)


@kernel()
def leaning_lift(pitch, twist, inflow, slope):
    """Return the force of the lift against the edgewise flow, CH over mu; inflow: along the thrust.

    a sigma / 2 lambda (lambda / 2 - theta / 6 - theta_tw / 8), to first order in mu (Bramwell,
    Helicopter Dynamics, ch. 3, on the tips' plane).
    """
    return slope * inflow * (inflow - pitch / 3.0 - 0.25 * twist)


@kernel()
def stalled_drag(incidence, kept):
    """Return the rise of sectional drag past the stall; incidence: rad.

    2 sin^2(incidence), as lift is lost (`kept`: share left): within 25 % of NACA 0012 at 25 to 90
    degrees (Sheldahl and Klimas, SAND80-2114).
    """
    return 2.0 * (1.0 - kept**2) * math.sin(min(incidence, 0.5 * math.pi)) ** 2


@kernel()
def profile_drag(advance):
    """Return CQ, and CH over mu, of the blades' drag over sigma c_d / 8, reversed flow included.

    Exact for small and great mu; else CP within 0.4 % of the integral, CQ 1.8 %, CH 0.9 %.
    """
    square = advance**2
    torque = math.sqrt(1.0 + square * (3.0 + square / (1.0 + square)))
    return torque, math.sqrt(9.0 + 16.0 * square)


STOPPED = 0.05  # speed below which a rotor's forces fade


MainRotor = namedtuple(
    "MainRotor",
    "thrust torque drag_x drag_y heat inflow induced climb advance tip_speed pitch",
)
"""Forces and flow of the main rotor.

thrust: N, normal to the tips' plane; torque: N m, negative where air turns the rotor; drag_x,
drag_y: N, hub's plane, forward and right; heat: W; inflow, induced, climb: over tip speed.
"""


@kernel()
def turning(speed):
    """Return the speed at which a rotor is computed, and its share of the forces."""
    part = min(1.0, max(0.0, speed) / STOPPED)
    return max(STOPPED, speed), part * part * (3.0 - 2.0 * part)


@kernel()
def main_rotor(par, motion, speed, collective, tips, swashplate, nearness=0.0, mean=0.0):
    """Return the `MainRotor`; collective: unitised.

    tips, swashplate: rearward and right tilt of tips' and no-feathering plane, rad, (2,); mean:
    induced velocity, m/s, where inflow is dynamic.
    """
    speed, share = turning(speed)
    radius = par[PARAM.main_radius]
    tip_speed = par[PARAM.main_speed] * speed * radius
    pitch = par[PARAM.main_pitch_trim] + par[PARAM.main_pitch_range] * collective
    u = (motion.u + motion.q * par[PARAM.hub_z]) / tip_speed
    v = (motion.v - motion.p * par[PARAM.hub_z] + motion.r * par[PARAM.hub_x]) / tip_speed
    w = (motion.w - motion.q * par[PARAM.hub_x]) / tip_speed
    advance = math.sqrt(u**2 + v**2)
    x, y, z = normal(par, tips)
    climb = u * x + v * y + w * z
    through = -swashplate[0] * u + swashplate[1] * v - w
    slope = 0.25 * par[PARAM.main_lift_slope] * par[PARAM.main_solidity]
    slope *= compressed(par[PARAM.main_mach], speed, advance)
    blades = Section(
        par[PARAM.main_solidity],
        par[PARAM.main_twist],
        par[PARAM.main_induced_factor],
        par[PARAM.main_profile_drag],
        par[PARAM.main_lift_drag],
        par[PARAM.main_divergence],
    )
    limit = stall_limit(blades.solidity, par[PARAM.main_stall], par[PARAM.main_stall_fall], advance)
    free = unloaded_inflow(pitch, par[PARAM.main_twist], through, advance)
    if par[PARAM.main_dynamic_inflow] != 0.0:
        induced = mean / tip_speed
        thrust = carried(free, slope, limit, induced)
    else:
        induced, thrust = balance(free, slope, limit, climb, advance, nearness)
    unstalled = slope * (free - induced)
    mach = speed * par[PARAM.main_mach]
    spent = losses(blades, thrust, unstalled, induced, climb + induced, advance, slope, mach)
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
    """Return the direction of thrust, body axes, at a tilt of the tips' plane (2,), rad."""
    stop = par[PARAM.flap_stop]
    a, b = soft_limit(tips[0], stop, 0.7), soft_limit(tips[1], stop, 0.7)
    level = 1.0 / math.sqrt(1.0 + a * a + b * b)
    return -a * level, b * level, -level


@kernel()
def cyclic_tilt(par, lon, lat):
    """Return the swashplate's tilt, rearward and right, rad; lon, lat: unitised."""
    a = par[PARAM.cyclic_a_lat] * lat + par[PARAM.cyclic_a_lon] * lon
    return a, par[PARAM.cyclic_b_lat] * lat + par[PARAM.cyclic_b_lon] * lon


TailRotor = namedtuple("TailRotor", "thrust inflow torque drag_x drag_z heat")
"""Forces and flow of the tail rotor; inflow: over the tip speed.

thrust: N; torque: at its shaft, N m; drag_x, drag_z: N, forward, down; heat: W.
"""


@kernel()
def tail_rotor(par, motion, speed, pedal, wash=0.0):
    """Return the `TailRotor`; pedal: unitised; wash: main rotor's wake there, m/s downwards."""
    speed, share = turning(speed)
    radius = par[PARAM.tail_radius]
    tip_speed = par[PARAM.tail_speed] * speed * radius
    hand, x, z = par[PARAM.main_direction], par[PARAM.tail_x], par[PARAM.tail_z]
    pitch = par[PARAM.tail_pitch_trim] + hand * par[PARAM.tail_pitch_range] * pedal
    ahead, down = motion.u + motion.q * z, motion.w - motion.q * x - wash
    advance = math.sqrt(ahead**2 + down**2) / tip_speed
    climb = -hand * (motion.v + motion.r * x - motion.p * z) / tip_speed
    slope = 0.25 * par[PARAM.tail_lift_slope] * par[PARAM.tail_solidity]
    slope *= compressed(par[PARAM.tail_mach], speed, advance)
    blades = Section(
        par[PARAM.tail_solidity],
        0.0,
        par[PARAM.tail_induced_factor],
        par[PARAM.tail_profile_drag],
        par[PARAM.tail_lift_drag],
        par[PARAM.tail_divergence],
    )
    limit = stall_limit(blades.solidity, par[PARAM.tail_stall], par[PARAM.tail_stall_fall], advance)
    free = unloaded_inflow(pitch, 0.0, climb, advance)
    induced, thrust = balance(free, slope, limit, climb, advance, 0.0)
    unstalled, mach = slope * (free - induced), speed * par[PARAM.tail_mach]
    spent = losses(blades, thrust, unstalled, induced, climb + induced, advance, slope, mach)
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
