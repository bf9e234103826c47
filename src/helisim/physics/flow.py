"""The air's flow past a vehicle, and the loads of its rotors and airframe.

Common arguments: `motion`, the body's velocities through the air; `speed`, of the rotor over the
nominal one; `nearness`, (R / 4d)^2 of the ground; `wash`, the wake's velocity there, m/s downwards;
`a` and `b`, rearward and right tilt, rad; `mast`, torque on the main rotor, N m.
"""

import math
from collections import namedtuple

from helisim.physics import air
from helisim.physics.gyro import unmix
from helisim.physics.kernel import from_element, kernel
from helisim.physics.layout import PARAM, STATE, WASH
from helisim.physics.memory import position_ahead, speed_ratio
from helisim.physics.motion import Wrench, from_shaft, to_shaft
from helisim.physics.rotor import (
    cyclic_tilt,
    main_rotor,
    normal,
    tail_rotor,
    tail_wrench,
    turning,
)

Wash = namedtuple("Wash", "fuselage tail tailplane")
"""Velocities of the main rotor's wake, m/s downwards; `tail` is at tail rotor and fin."""


@kernel()
def wash(par, motion, main, speed=1.0, nearness=0.0):
    """Return the `Wash` of a `MainRotor`; it fades with rotor speed and near the ground."""
    _, turns = turning(speed)
    induced = main.induced * main.tip_speed
    through = induced - motion.w + motion.q * par[PARAM.hub_x]
    ahead = motion.u + motion.q * par[PARAM.hub_z]
    aside = motion.v - motion.p * par[PARAM.hub_z] + motion.r * par[PARAM.hub_x]
    square = ahead**2 + aside**2 + through**2
    if square == 0.0:
        return Wash(0.0, 0.0, 0.0)
    induced *= turns
    cosine = through / math.sqrt(square)
    behind = max(ahead, 0.0) ** 2 / square
    fuselage = par[PARAM.download] * induced
    tail = induced * wash_share(par, PARAM.tail_wash, cosine, behind)
    tailplane = induced * wash_share(par, PARAM.tailplane_wash, cosine, behind)
    return Wash(
        fuselage * air.wash_residual(par, nearness, par[PARAM.drag_centre_z]),
        tail * air.wash_residual(par, nearness, par[PARAM.tail_z]),
        tailplane * air.wash_residual(par, nearness, par[PARAM.tailplane_z]),
    )


@kernel()
def wash_share(par, first, cosine, behind):
    """Return the downwash at a place over the induced velocity at the disc.

    cosine: of the skew angle, 1 in hover, -1 where the wake rises; behind: its sine squared.
    """
    polynomial = 0.0
    for k in range(WASH - 1, 1, -1):
        polynomial = polynomial * cosine + par[first + k]
    upright = par[first] if cosine > 0.0 else par[first + 1]
    return upright * cosine**2 + behind * polynomial


Flow = namedtuple("Flow", "motion hub speed main tail wash air nearness shaft")
"""The flow past a vehicle; hub: `motion` in shaft axes; air: velocities of the air itself.

speed, shaft: of the rotor through the air, and of its shaft in the body, over the nominal one; an
ideal governor has one for both.
"""


@kernel()
def flow(view, ahead):
    """Return the `Flow` past a vehicle; the blades' pitch is that of a time `ahead` (s)."""
    moving = air.motion(view)
    motion = air.relative_motion(view, moving)
    nearness, mean = air.nearness(view), view.act[STATE.inflow_0]
    return flow_in(view, motion, moving, speed_ratio(view), nearness, mean, ahead)


@kernel(forceinline=False)
def flow_in(view, motion, moving, speed, nearness, mean, ahead):
    """Return the `Flow`; moving: the air's velocities; mean: induced velocity, m/s; ahead: s."""
    hub = to_shaft(view.par, motion)
    main = main_rotor_in(view, hub, speed, nearness, mean, ahead)
    pedal = position_ahead(view, STATE.tail_position, ahead)
    wake = wash(view.par, hub, main, speed, nearness)
    shaft = geared = speed
    if view.par[PARAM.drive_governor] != 0.0:
        yaw = hub.r + to_shaft(view.par, moving).r
        shaft -= view.par[PARAM.main_direction] * yaw / view.par[PARAM.main_speed]
        pitching = view.par[PARAM.tail_direction] * (motion.q + moving.q)
        geared = shaft + pitching / view.par[PARAM.tail_speed]
    tail = tail_rotor(view.par, motion, geared, pedal, wake.tail)
    return Flow(motion, hub, speed, main, tail, wake, moving, nearness, shaft)


@kernel(forceinline=False)
def main_rotor_in(view, hub, speed, nearness, mean, ahead):
    """Return what a vehicle's main rotor does in velocities in shaft axes, else as `flow_in`."""
    collective, lon, lat = unmix(
        from_element(view.par, PARAM.mix_front_col),
        position_ahead(view, STATE.front_position, ahead),
        position_ahead(view, STATE.left_position, ahead),
        position_ahead(view, STATE.right_position, ahead),
    )
    tips = view.act[STATE.flap_a], view.act[STATE.flap_b]
    swashplate = cyclic_tilt(view.par, lon, lat)
    return main_rotor(view.par, hub, speed, collective, tips, swashplate, nearness, mean)


@kernel()
def flow_later(view, past, mean, ahead):
    """Return the `Flow` as it is with another induced velocity, m/s, the pitch `ahead` (s)."""
    return flow_in(view, past.motion, past.air, past.speed, past.nearness, mean, ahead)


@kernel()
def fuselage(par, motion, wash):
    """Return the wrench of the fuselage, with the moments of a long body (Munk, NACA TR 184)."""
    u, v, w = motion.u, motion.v, motion.w - wash
    x, z = par[PARAM.drag_centre_x], par[PARAM.drag_centre_z]
    half = 0.5 * par[PARAM.air_density]
    pressure = half * math.sqrt(u**2 + v**2 + w**2)
    fx = -pressure * par[PARAM.drag_x] * u
    fy = -pressure * par[PARAM.drag_y] * v
    fz = -pressure * par[PARAM.drag_z] * w
    return Wrench(
        fx,
        fy,
        fz,
        -z * fy,
        z * fx - x * fz + half * par[PARAM.pitch_volume] * u * (w - par[PARAM.pitch_zero] * u),
        x * fy - half * par[PARAM.yaw_volume] * u * v,
    )


_STILL = 1e-60  # (m/s)^2: its square is lost below


@kernel()
def normal_force(density, area, slope, greatest, square, normal):
    """Return the force on a flat surface along its normal, N, against the flow, with induced drag.

    Lift slope times sine of incidence, at most `greatest` (Hoerner, Fluid-Dynamic Drag, ch. 3).
    slope: 1/rad; square: airspeed squared; normal: the surface's velocity along its normal, m/s.
    """
    if square < _STILL:
        return 0.0
    stalled = (slope * normal / greatest) ** 2
    lifting = square / math.sqrt(math.sqrt(square**2 + stalled**2))
    return -0.5 * density * area * slope * normal * lifting


@kernel()
def pressed(density, pressure, ahead, square):
    """Return the density that makes up for the dynamic pressure lost behind hub and fuselage.

    pressure: share left in flow from ahead (Prouty, ch. 8); ahead: m/s; square: airspeed squared.
    """
    lost = (1.0 - pressure) * max(0.0, ahead) ** 2
    return density * (1.0 - lost / max(_STILL, square))


@kernel()
def surface(par, first, motion, wash):
    """Return the force on the fin or the tailplane, N, ahead and across, and its x and z, m.

    `first` is where its numbers begin in `PARAM`, in the order of the fin's, which is upright.
    """
    on = first - PARAM.fin_area
    x, z = par[PARAM.fin_x + on], par[PARAM.fin_z + on]
    u = motion.u + motion.q * z
    v = motion.v + motion.r * x - motion.p * z
    w = motion.w - motion.q * x - wash
    cosine, sine = par[PARAM.fin_cosine + on], par[PARAM.fin_sine + on]
    square = u**2 + v**2 + w**2
    force = normal_force(
        pressed(par[PARAM.air_density], par[PARAM.fin_pressure + on], u, square),
        par[PARAM.fin_area + on],
        par[PARAM.fin_slope + on],
        par[PARAM.fin_stall + on],
        square,
        u * sine + (w if on else v) * cosine,
    )
    return force * sine, force * cosine, x, z


@kernel()
def fin(par, motion, wash):
    """Return the wrench of the vertical fin."""
    fx, fy, x, z = surface(par, PARAM.fin_area, motion, wash)
    return Wrench(fx, fy, 0.0, -z * fy, z * fx, x * fy)


@kernel()
def tailplane(par, motion, wash):
    """Return the wrench of the horizontal tailplane."""
    if par[PARAM.tailplane_area] == 0.0:
        return Wrench(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    fx, fz, x, z = surface(par, PARAM.tailplane_area, motion, wash)
    return Wrench(fx, 0.0, fz, 0.0, z * fx - x * fz, 0.0)


@kernel()
def wrench(par, a, b, flow, mast):
    """Return the aerodynamic force and moment at the body's origin, a `Wrench`."""
    hub = from_shaft(par, hub_wrench(par, a, b, flow.main, flow.speed, mast))
    tail, rest = tail_wrench(par, flow.tail), airframe(par, flow)
    return Wrench(
        hub.fx + tail.fx + rest.fx,
        hub.fy + tail.fy + rest.fy,
        hub.fz + tail.fz + rest.fz,
        hub.mx + tail.mx + rest.mx,
        hub.my + tail.my + rest.my,
        hub.mz + tail.mz + rest.mz,
    )


@kernel()
def airframe(par, flow):
    """Return the wrench of all that doesn't turn: fuselage, fin and tailplane."""
    motion, wash = flow.motion, flow.wash
    body = fuselage(par, motion, wash.fuselage)
    upright, level = fin(par, motion, wash.tail), tailplane(par, motion, wash.tailplane)
    return Wrench(
        body.fx + upright.fx + level.fx,
        body.fy + upright.fy,
        body.fz + level.fz,
        body.mx + upright.mx,
        body.my + upright.my + level.my,
        body.mz + upright.mz,
    )


@kernel()
def heat(par, flow):
    """Return the power that is lost to the air, W."""
    drag, moving, tail = airframe(par, flow), flow.motion, flow.tail
    work = drag.fx * moving.u + drag.fy * moving.v + drag.fz * moving.w
    work += drag.mx * moving.p + drag.my * moving.q + drag.mz * moving.r
    aside = moving.v + moving.r * par[PARAM.tail_x] - moving.p * par[PARAM.tail_z]
    work += par[PARAM.main_direction] * par[PARAM.tail_blockage] * tail.thrust * aside
    return flow.main.heat + tail.heat - tail.drag_z * flow.wash.tail - work


@kernel()
def hub_wrench(par, a, b, main, speed, mast):
    """Return the wrench of the main rotor's hub, shaft axes: thrust, springs and torque.

    Thrust is normal to the tips' plane; half of the air's torque tilts with it (Padfield, ch. 3).
    """
    x, y, z = normal(par, (a, b))
    back, right = x / z, -y / z
    _, share = turning(speed)
    stiffness = share * par[PARAM.hub_stiffness]
    direction = par[PARAM.main_direction]
    leaning = direction * (0.5 * main.torque - share * par[PARAM.hub_cross])
    fx, fy, fz = main.drag_x + main.thrust * x, main.drag_y + main.thrust * y, main.thrust * z
    arm_x, arm_z = par[PARAM.hub_x], par[PARAM.hub_z]
    return Wrench(
        fx,
        fy,
        fz,
        stiffness * right - arm_z * fy + leaning * x,
        stiffness * back + arm_z * fx - arm_x * fz + leaning * y,
        arm_x * fy - direction * mast,
    )
