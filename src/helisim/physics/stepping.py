"""How MuJoCo's integrators use what the callbacks return.

Runge-Kutta asks for derivatives, four times a step. The others ask once and hold the answer
for the step: v += h dv/dt, then x += h v, and act += h d(act)/dt. To be of second order with
one evaluation, they are given what the step's mean is, by a staggered (leapfrog) scheme:
velocities belong to the steps, positions and the tip-path plane's tilt to halfway between
them. The tilt kept at a step is half a step old; moved on by a step with the rates at its
middle, it acts on the body half a step ahead. Servos and gyro are driven by what is held, so
they take a Runge-Kutta step of their own.
"""

import mujoco

from helisim.physics.kernel import kernel
from helisim.physics.layout import PARAM
from helisim.physics.memory import double, integer

_RUNGE_KUTTA = int(mujoco.mjtIntegrator.mjINT_RK4)


@kernel()
def held_for(m, offsets):
    """Return for how long (s) the integrator holds an evaluation; 0 if it wants derivatives."""
    if integer(m, offsets.integrator) == _RUNGE_KUTTA:
        return 0.0
    return double(m, offsets.timestep)


@kernel()
def position_ahead(par, act, position, ahead):
    """Return a servo's position a time `ahead` (s) from now; its rate stands behind it."""
    limit = par[PARAM.servo_rate_limit]
    return act[position] + ahead * min(limit, max(-limit, act[position + 1]))
