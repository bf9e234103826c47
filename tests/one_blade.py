"""One rigid blade that flaps, from first principles: no tip-path plane, no closed form.

In the rotating frame, about a hinge at the mast with a spring: the inertia of its elements from
vectors, the air's force on strips from the velocity there, both in body axes (forward, right,
down). Small flapping, linear lift, no stall, no reversed flow, no drag; the second derivative of
flapping stays. Angles by azimuth come out of it as what a fit of one turn finds.
"""

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

Pair = tuple[float, float]


def cross(a, b):
    """Return the cross product of two vectors, (3,): numpy's own takes ten times as long."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


@dataclass(frozen=True, kw_only=True)
class OneBlade:
    """A blade, its flight and its air.

    Attributes:
        lock: gamma = rho a c R^4 / I.
        spring: nu^2 - 1, stiffness over inertia and square of speed.
        speed: rad/s.
        direction: 1 clockwise seen from above, -1 the other way.
        pitch: collective, rad, at the root.
        twist: rad from root to tip.
        cyclic: tilts against the shaft a, b (rad) that the swashplate asks for.
        rates: p, q of the body, rad/s.
        air: p, q of the air, rad/s.
        advance: of the hub through the air, forward and right, over the tip's speed.
        inflow: through the disc, over the tip's speed.
        rear: how much more of it there is at the trailing tip, where the advance comes from ahead.
    """

    lock: float
    spring: float = 0.0
    speed: float = 100.0
    direction: float = -1.0
    pitch: float = 0.0
    twist: float = 0.0
    cyclic: Pair = (0.0, 0.0)
    rates: Pair = (0.0, 0.0)
    air: Pair = (0.0, 0.0)
    advance: Pair = (0.0, 0.0)
    inflow: float = 0.0
    rear: float = 0.0
    strips: int = 60

    def turned(self, start: Pair, share=(1.0,)):
        """Integrate one turn; return angle and rate at shares of it, (2, n), from a start."""
        speed, hand = self.speed, self.direction
        r = (np.arange(self.strips) + 0.5) / self.strips
        ahead = np.array([*self.advance, 0.0])
        length = np.linalg.norm(ahead)
        upstream = ahead / length if length else np.array([1.0, 0.0, 0.0])

        def rate(t, state):
            up, rising = state
            psi = speed * t  # from the tail, in the sense of rotation
            out = np.array([-np.cos(psi), -hand * np.sin(psi), 0.0])
            along = np.array([np.sin(psi), -hand * np.cos(psi), 0.0])
            body = np.array([*self.rates, 0.0])
            # the inertia of an element at `out`: of the shaft that turns about itself and is turned
            spin = np.array([0.0, 0.0, hand * speed])
            turning, angular = body + spin, cross(body, spin)
            lifted = -(cross(angular, out) + cross(turning, cross(turning, out)))[2]
            # the air at the strips, over the tip's speed
            tangential = r + ahead @ along
            swing = body - np.array([*self.air, 0.0])
            blown = self.inflow - self.rear * r * (out @ upstream)
            # across a blade that stands up by `up`, so that its face leans inwards
            upward = -cross(swing, out)[2] / speed * r + r * rising / speed - up * (ahead @ out)
            a, b = self.cyclic
            angle = self.pitch + self.twist * r + a * np.sin(psi) + hand * b * np.cos(psi)
            lift = tangential**2 * angle - tangential * (blown + upward)
            moment = 0.5 * self.lock * speed**2 * np.mean(r * lift)
            return [rising, moment - (1.0 + self.spring) * speed**2 * up - lifted]

        turn = 2.0 * np.pi / speed
        # to 1e-9 of angles near 0.01: six digits
        exact = {"rtol": 1e-8, "atol": 1e-11, "max_step": turn / 16}
        return solve_ivp(rate, (0.0, turn), start, t_eval=turn * np.array(share), **exact).y

    def steady(self) -> tuple[float, float, float]:
        """Return coning and the tilts a and b, rad, of the motion that comes back after a turn.

        The blade's equation is linear, so that a turn takes its state x to M x + b.
        """
        rest, *ends = (self.turned(one)[:, -1] for one in ((0.0, 0.0), (1.0, 0.0), (0.0, 100.0)))
        turn = (np.array(ends).T - rest[:, None]) / [1.0, 100.0]
        start = np.linalg.solve(np.eye(2) - turn, rest)
        share = np.arange(360) / 360.0
        up, psi = self.turned(tuple(start), share)[0], 2.0 * np.pi * share
        sideways = -2.0 * np.mean(up * np.sin(psi))
        return np.mean(up), -2.0 * np.mean(up * np.cos(psi)), -self.direction * sideways
