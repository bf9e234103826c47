"""The air's loads on a vehicle: rotors, hub, fuselage, fin and tailplane, body axes."""

from helisim.physics.body import Wrench
from helisim.physics.fuselage import fuselage
from helisim.physics.kernel import kernel
from helisim.physics.main_rotor import normal, turning
from helisim.physics.params import PARAM
from helisim.physics.shaft import from_shaft
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
    """Return the power that is lost to the air, W.

    Of both rotors what they induce and their blades' drag, and what fuselage and surfaces take from
    the vehicle's motion, a fin in the tail rotor's slipstream too. What those and the tail rotor
    take from the main rotor's wake was lost before.
    """
    drag, moving, tail = airframe(par, flow), flow.motion, flow.tail
    work = drag.fx * moving.u + drag.fy * moving.v + drag.fz * moving.w
    work += drag.mx * moving.p + drag.my * moving.q + drag.mz * moving.r
    aside = moving.v + moving.r * par[PARAM.tail_x] - moving.p * par[PARAM.tail_z]
    work += par[PARAM.main_direction] * par[PARAM.tail_blockage] * tail.thrust * aside
    return flow.main.heat + tail.heat - tail.drag_z * flow.wash.tail - work


@kernel()
def hub_wrench(par, a, b, main, speed, mast):
    """Return the wrench of the main rotor's hub, shaft axes: thrust, springs and torque.

    Thrust stands on the tip-path plane, the blades' drag in the hub's. Half of the air's torque
    tilts with the tips: the drag of blades that flap acts across them, level with the hub
    (Padfield, Helicopter Flight Dynamics, chapter 3, of the hub's moments). A head whose springs
    lag in phase has a moment across the tilt too, against it.

    Args:
        par: parameters.
        a: rearward tilt, rad.
        b: right tilt, rad.
        main: what the main rotor does, a `MainRotor`.
        speed: rotor speed over the nominal one.
        mast: torque that turns the rotor, N m.
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
