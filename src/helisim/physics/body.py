"""How a body moves through space, and a wrench that acts on it."""

from typing import NamedTuple

from helisim.physics import frames
from helisim.physics.kernel import kernel
from helisim.physics.memory import doubles, doubles_from, ints


class Velocities(NamedTuple):
    """A velocity (m/s) and a rotation (rad/s), body axes: forward, right, down."""

    u: float
    v: float
    w: float
    p: float
    q: float
    r: float


class Wrench(NamedTuple):
    """A force (N) and a moment (N m) at the body's origin, body axes."""

    fx: float
    fy: float
    fz: float
    mx: float
    my: float
    mz: float


@kernel()
def rotation(view):
    """Return the body's rotation to the world, MuJoCo's axes, row-major, (9,)."""
    return doubles_from(view.d, view.offsets.xmat, 9 * view.body)


@kernel()
def rates(view):
    """Return p, q, r (rad/s)."""
    cvel = doubles_from(view.d, view.offsets.cvel, 6 * view.body)
    return frames.to_body(rotation(view), cvel[0], cvel[1], cvel[2])


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
    return frames.flip(force[0], force[1], force[2])


@kernel()
def apply_wrench(view, wrench):
    """Add a wrench at the body's origin, body axes, to the passive forces of its joints."""
    m, d, offsets, body = view.m, view.d, view.offsets, view.body
    matrix = rotation(view)
    fx, fy, fz = frames.to_world(matrix, wrench.fx, wrench.fy, wrench.fz)
    mx, my, mz = frames.to_world(matrix, wrench.mx, wrench.my, wrench.mz)
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
