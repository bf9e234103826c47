"""Motion of a body in the field's axes, wrenches on it, and the axes of its rotor's shaft.

MuJoCo's forward-left-up and north-west-up become forward-right-down and north-east-down: y and z
change sign. Shaft axes are the body's, leaned forward with the main rotor's shaft.
"""

import math
from collections import namedtuple

from helisim.physics.kernel import kernel
from helisim.physics.layout import PARAM
from helisim.physics.memory import doubles, doubles_from, ints


@kernel()
def flip(x, y, z):
    """Turn a vector from forward-left-up to forward-right-down, or back. Floats or arrays."""
    return x, -y, -z


@kernel()
def euler_angles(xmat):
    """Return roll, pitch and yaw (rad), FRD in NED; xmat: MuJoCo's row-major rotation, (9,)."""
    theta = math.asin(min(1.0, max(-1.0, xmat[6])))
    return math.atan2(xmat[7], xmat[8]), theta, math.atan2(-xmat[3], xmat[0])


@kernel()
def to_body(xmat, x, y, z):
    """Return a world vector (north-west-up) in body axes (forward-right-down)."""
    return flip(
        xmat[0] * x + xmat[3] * y + xmat[6] * z,
        xmat[1] * x + xmat[4] * y + xmat[7] * z,
        xmat[2] * x + xmat[5] * y + xmat[8] * z,
    )


@kernel()
def to_world(xmat, x, y, z):
    """Return a body vector (forward-right-down) in the world (north-west-up)."""
    x, y, z = flip(x, y, z)
    return (
        xmat[0] * x + xmat[1] * y + xmat[2] * z,
        xmat[3] * x + xmat[4] * y + xmat[5] * z,
        xmat[6] * x + xmat[7] * y + xmat[8] * z,
    )


Velocities = namedtuple("Velocities", "u v w p q r")
"""A velocity (m/s) and a rotation (rad/s), body axes: forward, right, down."""


Wrench = namedtuple("Wrench", "fx fy fz mx my mz")
"""A force (N) and a moment (N m) at the body's origin, body axes."""


@kernel()
def rotation(view):
    """Return the body's rotation to the world, MuJoCo's axes, row-major, (9,)."""
    return doubles_from(view.d, view.offsets.xmat, 9 * view.body)


@kernel()
def rates(view):
    """Return p, q, r (rad/s)."""
    cvel = doubles_from(view.d, view.offsets.cvel, 6 * view.body)
    return to_body(rotation(view), cvel[0], cvel[1], cvel[2])


@kernel()
def arm(view):
    """Return the body's origin from its tree's centre of mass, where MuJoCo counts moments."""
    m, d, offsets = view.m, view.d, view.offsets
    root = ints(m, offsets.body_rootid)[view.body]
    position = doubles_from(d, offsets.xpos, 3 * view.body)
    centre = doubles_from(d, offsets.subtree_com, 3 * root)
    return position[0] - centre[0], position[1] - centre[1], position[2] - centre[2]


@kernel()
def velocity(view):
    """Return the velocity of the body's origin in the world, north-west-up, m/s."""
    cvel = doubles_from(view.d, view.offsets.cvel, 6 * view.body)
    x, y, z = arm(view)
    return (
        cvel[3] + cvel[1] * z - cvel[2] * y,
        cvel[4] + cvel[2] * x - cvel[0] * z,
        cvel[5] + cvel[0] * y - cvel[1] * x,
    )


@kernel()
def contact_force(view):
    """Return the force of all that touches or holds a free body, north-east-down, N."""
    dof = ints(view.m, view.offsets.body_dofadr)[view.body]
    force = doubles_from(view.d, view.offsets.qfrc_constraint, dof)
    return flip(force[0], force[1], force[2])


@kernel()
def apply_wrench(view, wrench):
    """Add a wrench at the body's origin, body axes, to the passive forces of its joints."""
    m, d, offsets, body = view.m, view.d, view.offsets, view.body
    matrix = rotation(view)
    fx, fy, fz = to_world(matrix, wrench.fx, wrench.fy, wrench.fz)
    mx, my, mz = to_world(matrix, wrench.mx, wrench.my, wrench.mz)
    x, y, z = arm(view)
    mx += y * fz - z * fy
    my += z * fx - x * fz
    mz += x * fy - y * fx
    force = doubles(d, offsets.qfrc_passive)
    axis = doubles(d, offsets.cdof)
    parent = ints(m, offsets.dof_parentid)
    dof = ints(m, offsets.body_dofadr)[body] + ints(m, offsets.body_dofnum)[body] - 1
    while dof >= 0:
        k = 6 * dof
        force[dof] += axis[k] * mx + axis[k + 1] * my + axis[k + 2] * mz
        force[dof] += axis[k + 3] * fx + axis[k + 4] * fy + axis[k + 5] * fz
        dof = parent[dof]


@kernel()
def to_shaft(par, motion):
    """Return velocities of the body in shaft axes."""
    cosine, sine = par[PARAM.shaft_cosine], par[PARAM.shaft_sine]
    return Velocities(
        motion.u * cosine + motion.w * sine,
        motion.v,
        motion.w * cosine - motion.u * sine,
        motion.p * cosine + motion.r * sine,
        motion.q,
        motion.r * cosine - motion.p * sine,
    )


@kernel()
def from_shaft(par, wrench):
    """Return a wrench in shaft axes in the body's."""
    cosine, sine = par[PARAM.shaft_cosine], par[PARAM.shaft_sine]
    return Wrench(
        wrench.fx * cosine - wrench.fz * sine,
        wrench.fy,
        wrench.fz * cosine + wrench.fx * sine,
        wrench.mx * cosine - wrench.mz * sine,
        wrench.my,
        wrench.mz * cosine + wrench.mx * sine,
    )
