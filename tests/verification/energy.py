"""What a flight has of energy, is given and loses, from its trajectory alone."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.spatial.transform import Rotation

import helisim as hs
from helisim.sim import missions  # noqa: F401  (rows name them)
from helisim.sim.flight import simulate
from helisim.vehicle.addresses import root_body
from helisim.vehicle.assembly import total_inertia
from tabled import rows

WIND, LIGHT = hs.Weather(wind=5.0, wind_from=1.0), hs.Weather(turbulence="light")
FLIGHTS = dict(rows(globals(), "FLIGHTS"))


@dataclass(frozen=True, eq=False)
class Ledger:
    """A flight's energy, J, at each of its samples, (n_time,)."""

    kinetic: np.ndarray  # of the body, in translation and rotation
    potential: np.ndarray  # in gravity, from its start on
    spin: np.ndarray  # of the rotor and what turns with it
    delivered: np.ndarray  # by the motor, since the start
    wind: np.ndarray  # by air that moves, likewise
    lost: np.ndarray  # to the air

    @property
    def missing(self):
        """What has gone without a trace since the start, J, (n_time,)."""
        return self.stored - self.stored[0] - self.delivered - self.wind + self.lost

    @property
    def stored(self):
        """What there is, J, (n_time,)."""
        return self.kinetic + self.potential + self.spin

    @property
    def turned_over(self):
        return float(self.lost[-1])

    def __str__(self):
        rows = {
            "stored more": self.stored[-1] - self.stored[0],
            "delivered": self.delivered[-1],
            "of the wind": self.wind[-1],
            "lost": self.lost[-1],
            "missing": self.missing[-1],
            "at most missing": np.abs(self.missing).max(),
        }
        return "\n".join(f"{name:16s} {value:10.1f} J" for name, value in rows.items())


def ledger(vehicle, flight):
    """Return the `Ledger` of a flight, a `Trajectory` of RK4's steps.

    Mass, inertia and gravity are the compiled model's, motions those of MuJoCo's own sensors. What
    the wind does is the force that the accelerometer feels times the air's velocity.
    """
    model, own = vehicle.model, vehicle.parameters
    mass = float(model.body_subtreemass[root_body(model)])
    flip = np.array([1.0, -1.0, -1.0])
    inertia = flip[:, None] * total_inertia(model, root_body(model)) * flip
    rates, arm = flight.rates, flight.imu_offset
    velocity = flight.velocities - np.cross(rates, arm)
    turned = Rotation.from_euler("ZYX", flight.attitudes[:, ::-1])
    height = -(flight.positions - turned.apply(arm))[:, 2]
    spin = own["main_rotor.speed"] * flight.rotor[:, 4]
    angular = np.gradient(rates, flight.timestep, axis=0)
    turning = np.cross(angular, arm) + np.cross(rates, np.cross(rates, arm))
    force = mass * (flight.specific_forces - turning)
    moment = angular @ inertia.T + np.cross(rates, rates @ inertia.T)

    def summed(power):
        return cumulative_trapezoid(power, dx=flight.timestep, initial=0.0)

    return Ledger(
        kinetic=0.5 * mass * np.sum(velocity**2, axis=1)
        + 0.5 * np.einsum("ni,ij,nj->n", rates, inertia, rates),
        potential=-mass * float(model.opt.gravity[2]) * (height - height[0]),
        spin=0.5 * own["drive.inertia"] * spin**2,
        delivered=summed(flight.power[:, 0]),
        wind=summed(np.sum(np.hstack([force, moment]) * flight.air, axis=1)),
        lost=summed(flight.power[:, 3]),
    )


@cache
def flown(vehicle, name):
    (flight,) = simulate(vehicle, hs.FlightPlan(**FLIGHTS[name]), seed=1, jobs=1)
    hard = np.linalg.norm(flight.contact, axis=1) > 3.0 * 8.01 * 9.8015
    return ledger(vehicle, flight), int(np.argmax(hard)) - 1 if hard.any() else flight.time.size
