"""Shaft axes: those of the body, leaned forward with the main rotor's shaft.

What the main rotor meets is told in them, and what it does: its plane is level there.
"""

from helisim.physics.body import Velocities, Wrench
from helisim.physics.kernel import kernel
from helisim.physics.params import PARAM


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
