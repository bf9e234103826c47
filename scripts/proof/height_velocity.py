"""The height-velocity diagram of the JR700: from where its scripted pilot lands without an engine.

Over a grid of heights and speeds the engine fails in steady level flight, and the pilot reacts
0.4 s later (`missions.Autorotation`). A flight counts as landed if it stays within the limits of
every flight (no rotor strikes the ground, the helicopter doesn't tip over) and the landing gear
comes down at no more than 2 m/s. Printed is the touch-down of each; what is left out by it is the
dead man's curve.

    python scripts/proof/height_velocity.py [height_velocity.png]
"""

import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import helisim as hs
from helisim.sim import simulate
from helisim.sim.missions.mission import Reached

HEIGHTS = (1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 12.5, 15.0, 17.5, 20.0, 25.0, 30.0, 40.0, 50.0)
"""m, of the gear above the ground where the engine fails."""
SPEEDS = (0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0, 16.0, 18.0, 20.0)  # m/s.
SOFT = 2.0  # m/s, of sinking.
GEAR = 0.1  # m, from the origin down to the skids.


@dataclass(frozen=True)
class Fall:
    """What became of one failure of the engine."""

    height: float
    speed: float
    sink: float
    ended: str

    @property
    def landed(self) -> bool:
        """Whether the helicopter can fly again."""
        return not self.ended and self.sink <= SOFT


def fall(case: tuple[float, float]) -> Fall:
    """Fly one failure, of a height (m) and a speed (m/s)."""
    height, speed = case
    mission = hs.missions.Autorotation(height=height + GEAR, speed=speed)
    plan = hs.FlightPlan(mission=mission, pilot=hs.Pilot(remnant=0.0))
    (flight,) = simulate(VEHICLE, plan, keep_ended=True, jobs=1)
    reached = Reached.of(VEHICLE, flight)
    down = reached.touch_down
    sink = float(flight.velocities[-1, 2]) if down is None else down.sink
    return Fall(height, speed, sink, "" if flight.end is None else flight.end.why)


def grid(cases: list[tuple[float, float]]) -> list[Fall]:
    """Fly all, two processes at a time; each is the same alone."""
    with ProcessPoolExecutor(2) as pool:
        return list(pool.map(fall, cases, chunksize=8))


def printed(falls: list[Fall]) -> None:
    """Print the sink rate at each touch-down, in brackets where it was no landing."""
    print("height m | sink rate at the touch-down, m/s, after a failure at a speed of ... m/s")
    print("         |" + "".join(f"{speed:8.0f}" for speed in SPEEDS))
    for height in reversed(HEIGHTS):
        row = [one for one in falls if one.height == height]
        cells = [f"{one.sink:.1f}" if one.landed else f"({one.sink:.1f})" for one in row]
        print(f"{height:8.1f} |" + "".join(f"{cell:>8}" for cell in cells))


def drawn(falls: list[Fall], path: str) -> None:
    """Draw the diagram."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    speeds, heights = np.array(SPEEDS), np.array(HEIGHTS)
    landed = np.array([one.landed for one in falls]).reshape(heights.size, speeds.size)
    figure, axes = plt.subplots(figsize=(7.2, 5.0), layout="constrained")
    filled(axes, speeds, heights, landed)
    across, up = np.meshgrid(speeds, heights)
    axes.plot(across[landed], up[landed], "o", ms=4, color="tab:green", label="landed")
    axes.plot(across[~landed], up[~landed], "x", ms=5, color="tab:red", label="broken")
    axes.set(
        xlabel="speed when the engine fails [m/s]",
        ylabel="height of the skids [m]",
        title="JR700: from where the scripted pilot lands without an engine",
    )
    axes.set_ylim(0.0, heights[-1] + 2.0)
    axes.grid(alpha=0.3)
    axes.legend(loc="upper right")
    figure.savefig(path, dpi=150)
    print(f"Written: {path}")


def filled(
    axes: object, speeds: NDArray[np.float64], heights: NDArray[np.float64], landed: NDArray
) -> None:
    """Shade what is to be avoided, halfway between a landing and none."""
    axes.contourf(  # pyright: ignore[reportAttributeAccessIssue]
        speeds, heights, landed.astype(float), levels=[-0.5, 0.5], colors=["tab:red"], alpha=0.2
    )


def main() -> None:
    """Fly the grid, print it, and draw it where a file is named."""
    falls = grid([(height, speed) for height in HEIGHTS for speed in SPEEDS])
    printed(falls)
    if len(sys.argv) > 1:
        drawn(falls, sys.argv[1])


VEHICLE = hs.load("jr700")

if __name__ == "__main__":
    main()
