"""Flights that go wrong, each in its own way: what ends them, when, and what is kept.

Last comes what the envelope costs a flight that it finds nothing in, in processor time, and whether
that flight is the same to the bit without it.

    python scripts/proof/envelope_study.py
"""

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import helisim as hs
from helisim.sim import simulate
from helisim.sim.fly import LAST_SECONDS

QUIET = hs.Doublet(axis="ped", duration=30.0, amplitude=1e-6)
SWEEP = hs.Sweep(axis="ped", duration=30.0)
LATE = {"gyro.period": 0.001, "gyro.latency": 0.041, "gyro.lead": 0.0}

CASES: dict[str, tuple[dict[str, Any], Any, dict[str, Any]]] = {
    "half the stick": ({}, hs.Sweep(axis="lat", duration=30.0, amplitude=0.5), {}),
    "roll gyro of the wrong sign": ({"parameters": {"gyro.kp_lat": -1.0}}, SWEEP, {}),
    "yaw gyro of the wrong sign": ({"parameters": {"gyro.k_a": -0.29}}, SWEEP, {}),
    "50.5 ms in the gyro's loop": ({"parameters": LATE, "timestep": 0.001}, SWEEP, {}),
    "tail servo stuck": ({}, SWEEP, {"faults": [hs.ServoStuck(servo="servo_tail", at=10.0)]}),
    "swashplate servo stuck low, at 3 m": (
        {},
        QUIET,
        {
            "faults": [hs.ServoStuck(servo="servo_front", at=5.0, position=-0.02)],
            "weather": hs.Weather(height=3.0),
        },
    ),
    "gust from below, 12 m/s": (
        {},
        QUIET,
        {"weather": hs.Weather(gust=hs.Gust(down=-12.0, start=5.0))},
    ),
    "gyro reads no yaw rate": (
        {},
        SWEEP,
        {"faults": [hs.GyroDropout(at=10.0, lasts=20.0, rates="r")]},
    ),
}


def case(name: str, folder: Path) -> str:
    """Fly a case and return its line."""
    loading, manoeuvre, parts = CASES[name]
    plan = hs.FlightPlan(excitation=manoeuvre, **parts)
    flown = hs.fly_to(folder / name, hs.load(**loading), plan, count=1, seed=1, jobs=1)
    (path,) = flown.paths
    if not flown.ended:
        return f"{name:<36}flown to the end"
    last = hs.read_record(path.parent / LAST_SECONDS / path.name)
    kept = f"{hs.read_record(path).duration:.2f} s, {len(last)} samples of the last second"
    return f"{name:<36}{flown.ended[path]}\n{'':<36}kept: {kept}"


def cost() -> str:
    """Return what the envelope costs a sweep of 90 s."""
    vehicle, sweep = hs.load(), hs.Sweep(axis="lat")

    def flight(envelope: hs.FlightEnvelope) -> hs.FlightRecord:
        plan = hs.FlightPlan(excitation=sweep, envelope=envelope)
        return hs.fly(vehicle, plan, seed=1, jobs=1)[0]

    usual, off = hs.FlightEnvelope(), hs.FlightEnvelope.off()
    trajectory = next(simulate(vehicle, sweep, seed=1, jobs=1))
    share = _seconds(lambda: usual.end(vehicle, trajectory)) / _seconds(lambda: flight(usual))
    same = np.array_equal(flight(usual).values, flight(off).values)
    return f"the envelope takes {100.0 * share:.1f} % of a flight's time; same bits without: {same}"


def _seconds(work: Callable[[], object]) -> float:
    """Return the shortest processor time of five."""
    found = []
    for _ in range(5):
        began = time.process_time()
        work()
        found.append(time.process_time() - began)
    return min(found)


def main() -> None:
    """Print a case a line, and the cost."""
    with tempfile.TemporaryDirectory(prefix="helisim-envelope-") as folder:
        for name in CASES:
            print(case(name, Path(folder)), flush=True)
    print(cost())


if __name__ == "__main__":
    main()
