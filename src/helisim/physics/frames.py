"""The one place where MuJoCo's forward-left-up meets the field's forward-right-down.

Both flips are the same: x stays, y and z change sign; so do the axes of a rotation. The
world turns from north-west-up to north-east-down likewise.
"""

import math

from helisim.physics.kernel import kernel


@kernel()
def flip(x, y, z):
    """Turn a vector from forward-left-up to forward-right-down, or back. Floats or arrays."""
    return x, -y, -z


@kernel()
def euler_angles(xmat):
    """Return roll, pitch and yaw (rad) of a forward-right-down body in north-east-down.

    Args:
        xmat: nine numbers, MuJoCo's row-major rotation from body to world.
    """
    sine = min(1.0, max(-1.0, xmat[6]))
    phi = math.atan2(xmat[7], xmat[8])
    theta = math.asin(sine)
    psi = math.atan2(-xmat[3], xmat[0])
    return phi, theta, psi


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
