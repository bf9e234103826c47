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
def rotation(d, offsets, body):
    """Return a body's rotation to the world, MuJoCo's axes, row-major, (9,)."""
    return doubles_from(d, offsets.xmat, 9 * body)


@kernel()
def rates(d, offsets, body):
    """Return p, q, r (rad/s)."""
    cvel = doubles(d, offsets.cvel)
    k = 6 * body
    return frames.to_body(rotation(d, offsets, body), cvel[k], cvel[k + 1], cvel[k + 2])


@kernel()
def arm(m, d, offsets, body):
    """Return the body's origin from its tree's centre of mass, where MuJoCo counts moments."""
    position = doubles(d, offsets.xpos)
    centre = doubles(d, offsets.subtree_com)
    root = ints(m, offsets.body_rootid)[body]
    return (
        position[3 * body] - centre[3 * root],
        position[3 * body + 1] - centre[3 * root + 1],
        position[3 * body + 2] - centre[3 * root + 2],
    )


@kernel()
def velocity(m, d, offsets, body):
    """Return the velocity of the body's origin in the world, north-west-up, m/s."""
    cvel = doubles(d, offsets.cvel)
    x, y, z = arm(m, d, offsets, body)
    k = 6 * body
    return (
        cvel[k + 3] + cvel[k + 1] * z - cvel[k + 2] * y,
        cvel[k + 4] + cvel[k + 2] * x - cvel[k] * z,
        cvel[k + 5] + cvel[k] * y - cvel[k + 1] * x,
    )


@kernel()
def apply_wrench(m, d, offsets, body, wrench):
    """Add a wrench at the body's origin, body axes, to the passive forces of its joints."""
    matrix = rotation(d, offsets, body)
    fx, fy, fz = frames.to_world(matrix, wrench.fx, wrench.fy, wrench.fz)
    mx, my, mz = frames.to_world(matrix, wrench.mx, wrench.my, wrench.mz)
    x, y, z = arm(m, d, offsets, body)
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
