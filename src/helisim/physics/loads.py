"""The air's loads on a vehicle: rotors, hub, fuselage, fin and tailplane, body axes."""

import math

from helisim.physics import rotor
from helisim.physics.body import Wrench
from helisim.physics.fuselage import fuselage
from helisim.physics.kernel import kernel
from helisim.physics.layout import PARAM
from helisim.physics.main_rotor import turning
from helisim.physics.surfaces import fin, tailplane
from helisim.physics.tail_rotor import tail_wrench


@kernel()
def wrench(par, a, b, flow, mast):
    """Return the aerodynamic force and moment at the body's origin, a `Wrench`.

    Args:
        par: parameters.
        a: rearward tilt, rad.
        b: right tilt, rad.
        flow: the `Flow` past it.
        mast: torque that turns the main rotor, N m.
    """
    motion, wash = flow.motion, flow.wash
    hub = hub_wrench(par, a, b, flow.main, flow.speed, mast)
    tail = tail_wrench(par, flow.tail)
    body = fuselage(par, motion, wash.fuselage)
    upright, level = fin(par, motion, wash.tail), tailplane(par, motion, wash.tailplane)
    return Wrench(
        hub.fx + body.fx + upright.fx + level.fx + tail.fx,
        hub.fy + body.fy + upright.fy + tail.fy,
        hub.fz + body.fz + level.fz + tail.fz,
        hub.mx + body.mx + upright.mx + tail.mx,
        hub.my + body.my + upright.my + level.my + tail.my,
        hub.mz + body.mz + upright.mz + tail.mz,
    )


@kernel()
def hub_wrench(par, a, b, main, speed, mast):
    """Return the wrench of the main rotor's hub: thrust, springs and torque.

    Thrust stands on the tip-path plane, the blades' drag in the hub's. Half of the air's torque
    tilts with the tips: the drag of blades that flap acts across them, level with the hub
    (Padfield, Helicopter Flight Dynamics, chapter 3, of the hub's moments).

    Args:
        par: parameters.
        a: rearward tilt, rad.
        b: right tilt, rad.
        main: what the main rotor does, a `MainRotor`.
        speed: rotor speed over the nominal one.
        mast: torque that turns the rotor, N m.
    """
    stop = par[PARAM.flap_stop]
    a = rotor.soft_limit(a, stop, 0.7)
    b = rotor.soft_limit(b, stop, 0.7)
    _, share = turning(speed)
    stiffness = share * par[PARAM.hub_stiffness]
    back, right = math.sin(a), math.sin(b)
    x, y = main.drag_x - main.thrust * back, main.drag_y + main.thrust * right
    z = -main.thrust * math.cos(a) * math.cos(b)
    direction = par[PARAM.main_direction]
    leaning = 0.5 * direction * main.torque
    arm_x, arm_z = par[PARAM.hub_x], par[PARAM.hub_z]
    return Wrench(
        x,
        y,
        z,
        stiffness * b - arm_z * y - leaning * back,
        stiffness * a + arm_z * x - arm_x * z + leaning * right,
        arm_x * y - direction * mast,
    )
