"""Steps per CPU second of JSBSim's helicopter, flying its own flight test's hover.

`pip install helisim[benchmark]`; the AH-1S and its script are in JSBSim's wheel. Its rotor has no
states of its own: thrust, torque and flapping follow from the body's motion at once.

    python scripts/benchmark/ah1s.py
"""

import contextlib
import os
import sys
import time
from collections.abc import Iterator
from typing import Any

STEPS = 20_000
ROUNDS = 5
HOVER = 60.0
"""s, by which the flight test hovers."""
OUTPUTS = (
    *(f"velocities/{name}" for name in ("p-rad_sec", "q-rad_sec", "r-rad_sec")),
    *(f"velocities/{name}" for name in ("u-fps", "v-fps", "w-fps")),
    *(f"attitude/{name}" for name in ("phi-rad", "theta-rad", "psi-rad")),
    *(f"accelerations/{name}" for name in ("n-pilot-x-norm", "n-pilot-y-norm", "n-pilot-z-norm")),
    *(f"position/{name}" for name in ("lat-geod-rad", "long-gc-rad", "h-sl-ft")),
    *(f"fcs/{name}" for name in ("elevator-cmd-norm", "aileron-cmd-norm", "rudder-cmd-norm")),
    "fcs/collective-cmd-norm",
    "propulsion/engine/rotor-rpm",
    "propulsion/engine/thrust-lbs",
    "simulation/sim-time-sec",
)
"""What helisim's sensors write too, as far as JSBSim has it."""


def hovering() -> Any:
    """Return the AH-1S in the hover of its flight test. Raises ImportError without JSBSim."""
    import jsbsim

    with _silence():
        simulation = jsbsim.FGFDMExec(None)
        simulation.set_debug_level(0)
        simulation.load_script("scripts/ah1s_flight_test.xml")
        simulation.run_ic()
        while simulation["simulation/sim-time-sec"] < HOVER:
            simulation.run()
    height = simulation["position/h-agl-ft"]
    if not 20.0 < height < 150.0:
        raise RuntimeError(f"JSBSim's helicopter should hover, and is {height:.0f} ft high")
    return simulation


def cost(simulation: Any, *, read: bool) -> float:
    """Return CPU seconds a step, outputs read after each or not."""
    with _silence():
        start = time.process_time()
        for _ in range(STEPS):
            simulation.run()
            if read:
                for name in OUTPUTS:
                    simulation[name]
        return (time.process_time() - start) / STEPS


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Keep what JSBSim prints natively off the terminal."""
    sys.stdout.flush()
    kept = os.dup(1)
    with open(os.devnull, "w") as nothing:
        os.dup2(nothing.fileno(), 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


def main() -> None:
    """Print steps per CPU second."""
    simulation = hovering()
    for read in (False, True):
        how = "outputs read" if read else "nothing read"
        best = min(cost(simulation, read=read) for _ in range(ROUNDS))
        print(f"JSBSim ah1s, {how}  {1e-3 / best:7.1f} thousand steps/s")


if __name__ == "__main__":
    main()
