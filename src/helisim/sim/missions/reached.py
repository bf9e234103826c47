"""What a mission reached: how near to what its script wanted, and how it touched down."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from helisim.base.value import Value
from helisim.sim.clearance import outline
from helisim.sim.ground import Ground
from helisim.sim.landing import point_heights
from helisim.sim.trajectory import Trajectory
from helisim.vehicle import Vehicle

_AIRBORNE = 0.05
"""m, of clearance from which on a helicopter has been in the air."""


@dataclass(frozen=True)
class TouchDown:
    """How the landing gear met the ground.

    Attributes:
        at: s.
        sink: m/s, at which the lowest point of the gear came down on it.
        ground_speed: m/s.
        phi: roll angle, rad.
        theta: pitch angle, rad.
    """

    at: float
    sink: float
    ground_speed: float
    phi: float
    theta: float


@dataclass(frozen=True, eq=False)
class Reached(Value):
    """What a flight of a mission reached, of the true trajectory.

    Attributes:
        finished: whether the script came to its end.
        phases: times, s, and what the script said then.
        place_error: m, the most that the helicopter was away from where it was to be, level; None
            where it was to be nowhere.
        height_error: m, likewise upwards or downwards.
        heading_error: rad.
        top_speed: m/s, over the ground.
        rotor_speed: the lowest and the highest, over the nominal one.
        touch_down: how it landed; None if it never touched the ground.
    """

    finished: bool
    phases: tuple[tuple[float, str], ...]
    place_error: float | None
    height_error: float | None
    heading_error: float
    top_speed: float
    rotor_speed: tuple[float, float]
    touch_down: TouchDown | None

    @classmethod
    def of(cls, vehicle: Vehicle, flight: Trajectory) -> "Reached":
        """Return what a flight of a mission reached."""
        assert flight.script is not None
        last = float(flight.time[-1])  # a script goes on behind a flight's early end
        wanted = flight.script.wanted[flight.script.wanted[:, 0] <= last]
        positions, velocities = _at_centre(flight)
        place = np.column_stack(
            [np.interp(wanted[:, 0], flight.time, positions[:, k]) for k in range(3)]
        )
        psi = np.interp(wanted[:, 0], flight.time, flight.attitudes[:, 2])
        off = np.abs(place - wanted[:, 1:4])
        turned = np.abs(np.mod(psi - wanted[:, 4] + np.pi, 2.0 * np.pi) - np.pi)
        speeds = flight.rotor[:, 4]
        return cls(
            finished=flight.script.finished and flight.end is None,
            phases=tuple(one for one in flight.script.phases if one[0] <= last),
            place_error=_most(np.hypot(off[:, 0], off[:, 1])),
            height_error=_most(off[:, 2]),
            heading_error=float(turned.max()),
            top_speed=float(np.hypot(velocities[:, 0], velocities[:, 1]).max()),
            rotor_speed=(float(speeds.min()), float(speeds.max())),
            touch_down=_touch_down(vehicle, flight, velocities),
        )

    @classmethod
    def from_dict(cls, facts: Mapping[str, Any]) -> "Reached":
        """Return what `to_dict` made plain data of, as a record's provenance has it."""
        landed = facts["touch_down"]
        return cls(
            **{
                **facts,
                "phases": tuple((time, text) for time, text in facts["phases"]),
                "rotor_speed": tuple(facts["rotor_speed"]),
                "touch_down": None if landed is None else TouchDown(**landed),
            }
        )

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain data, for provenance."""
        return {**asdict(self), "phases": [list(one) for one in self.phases]}

    def __str__(self) -> str:
        """Return it in a line."""
        parts = ["" if self.finished else "the script did not end"]
        if self.place_error is not None:
            parts.append(f"place within {self.place_error:.2f} m")
        if self.height_error is not None:
            parts.append(f"height within {self.height_error:.2f} m")
        parts.append(f"heading within {math.degrees(self.heading_error):.1f} deg")
        parts.append(f"up to {self.top_speed:.1f} m/s")
        low, high = (round(100.0 * one) for one in self.rotor_speed)
        if (low, high) != (100, 100):
            parts.append(f"rotor at {low} to {high} %")
        if self.touch_down is not None:
            landed = self.touch_down
            parts.append(
                f"touch-down at {landed.at:.2f} s, sinking at {landed.sink:.2f} m/s, "
                f"{landed.ground_speed:.2f} m/s over the ground"
            )
        return ", ".join(filter(None, parts))


def _most(values: NDArray[np.float64]) -> float | None:
    """Return the greatest number of those that are numbers; None if none is."""
    held = values[np.isfinite(values)]
    return float(held.max()) if held.size else None


def _at_centre(flight: Trajectory) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return position and velocity of the centre of gravity, (n_time, 3) each, NED."""
    earth = Rotation.from_euler("ZYX", flight.attitudes[:, ::-1])
    arm = flight.imu_offset
    body = flight.velocities - np.cross(flight.rates, arm)
    return flight.positions - earth.apply(arm), earth.apply(body)


def _touch_down(
    vehicle: Vehicle, flight: Trajectory, velocities: NDArray[np.float64]
) -> TouchDown | None:
    """Return how the gear first met the ground after it was in the air."""
    shape = outline(vehicle)
    above = point_heights(flight.ground or Ground(), flight, shape.points) - shape.radii
    lowest = above.min(axis=1)
    airborne = lowest > _AIRBORNE
    down = lowest <= 0.0
    down[: int(np.argmax(airborne))] = False
    if not (airborne.any() and down.any()):
        return None
    k = max(int(np.argmax(down)), 1)
    sink = float(lowest[k - 1] - lowest[k]) / flight.timestep
    north, east, _ = (float(one) for one in velocities[k - 1])
    phi, theta, _ = (float(one) for one in flight.attitudes[k])
    return TouchDown(float(flight.time[k]), sink, math.hypot(north, east), phi, theta)
