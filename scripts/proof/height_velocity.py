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
from itertools import product

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


VEHICLE = hs.load("jr700")


def fall(case: tuple[float, float]) -> tuple[float, bool]:
    """Return the sink rate (m/s) after one failure, of a height (m) and a speed (m/s); if landed.

    Landed means that the helicopter can fly again.
    """
    height, speed = case
    mission = hs.missions.Autorotation(height=height + GEAR, speed=speed)
    plan = hs.FlightPlan(mission=mission, pilot=hs.Pilot(remnant=0.0))
    (flight,) = simulate(VEHICLE, plan, keep_ended=True, jobs=1)
    down = Reached.of(VEHICLE, flight).touch_down
    sink = float(flight.velocities[-1, 2]) if down is None else down.sink
    return sink, flight.end is None and sink <= SOFT


def drawn(landed: NDArray[np.bool_], path: str) -> None:
    """Draw the diagram; what is to be avoided is shaded halfway between a landing and none."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    across, up = np.meshgrid(SPEEDS, HEIGHTS)
    figure, axes = plt.subplots(figsize=(7.2, 5.0), layout="constrained")
    axes.contourf(
        SPEEDS, HEIGHTS, landed.astype(float), levels=[-0.5, 0.5], colors=["tab:red"], alpha=0.2
    )
    axes.plot(across[landed], up[landed], "o", ms=4, color="tab:green", label="landed")
    axes.plot(across[~landed], up[~landed], "x", ms=5, color="tab:red", label="broken")
    axes.set(
        xlabel="speed when the engine fails [m/s]",
        ylabel="height of the skids [m]",
        title="JR700: from where the scripted pilot lands without an engine",
        ylim=(0.0, HEIGHTS[-1] + 2.0),
    )
    axes.grid(alpha=0.3)
    axes.legend(loc="upper right")
    figure.savefig(path, dpi=150)
    print(f"Written: {path}")


def main() -> None:
    """Fly the grid, print each touch-down, in brackets where it was no landing, and draw it."""
    with ProcessPoolExecutor(2) as pool:  # each flight is the same alone
        falls = list(pool.map(fall, product(HEIGHTS, SPEEDS), chunksize=8))
    print("height m | sink rate at the touch-down, m/s, after a failure at a speed of ... m/s")
    print("         |" + "".join(f"{speed:8.0f}" for speed in SPEEDS))
    for k, height in reversed(list(enumerate(HEIGHTS))):
        row = falls[k * len(SPEEDS) : (k + 1) * len(SPEEDS)]
        cells = [f"{sink:.1f}" if landed else f"({sink:.1f})" for sink, landed in row]
        print(f"{height:8.1f} |" + "".join(f"{cell:>8}" for cell in cells))
    if len(sys.argv) > 1:
        landed = np.array([one for _, one in falls]).reshape(len(HEIGHTS), len(SPEEDS))
        drawn(landed, sys.argv[1])


if __name__ == "__main__":
    main()
