"""Faults in flight and in the recorder: what becomes of the flight, and of a model from it.

Two pedal sweeps are flown with each fault. Printed are the greatest tilt and rate of the
flights, what the screening noted or left out, and by how many of its standard errors the yaw
base model's parameter that moves most differs from that of the same flights without the fault:
from the records as they are, and as screened; and the fit's average cost, of which 100 is the
most that the guidelines accept.

    python scripts/proof/fault_study.py [FAULT...]
"""

import sys
import warnings
from collections import Counter
from collections.abc import Sequence

import numpy as np

import helisim as hs
from helisim.base.errors import DivergedError, HelisimError
from helisim.sim import parse_fault
from helisim.study.comparison import identify_model
from helisim.study.models import YAW_BASE

FAULTS = (
    "servo_front:stuck@45",
    "servo_front:stuck@45,position=0.02",
    "servo_left:weak@45,rate_limit=0.2",
    "servo_tail:stuck@45",
    "servo_tail:stuck@45,position=0.05",
    "servo_tail:weak@45,rate_limit=0.3",
    "servo_tail:weak@45,travel=0.02",
    "gyro:restart@45,lasts=0.3",
    "gyro:dropout@45,lasts=0.3",
    "gyro:dropout@45,lasts=0.3,reads=held",
    "gyro:dropout@45,lasts=20,rates=r",
    "r+ped:spikes,size=0.5",
    "r:dropout@40,lasts=2",
    "r:dropout@40,lasts=2,reads=zero",
    "recorder:loss,share=0.01",
    "recorder:loss,share=0.05",
    "recorder:gap@55,lasts=1",
    "recorder:drift,ppm=100",
    "recorder:drift,ppm=2000",
    "recorder:drift,ppm=200,channels=p+q+r",
)
REPAIR = ("spikes", "frozen", "gaps")
SHORTEST = 22.0  # s, of a part that two windows of the band's longest period fit into.


def identified(records: Sequence[hs.FlightRecord]) -> hs.Fit:
    """Return the yaw base model of records."""
    return identify_model(YAW_BASE, {"ped": list(records)})


def shift(records: Sequence[hs.FlightRecord], good: hs.Fit) -> str:
    """Return by how many standard errors which parameter moves, and the cost; or what fails."""
    try:
        fit = identified(records)
    except HelisimError as error:
        return type(error).__name__
    moved = {
        name: (one.value - good[name].value) / good[name].standard_error
        for name, one in fit.parameters.items()
    }
    worst = max(moved, key=lambda name: abs(moved[name]))
    return f"{worst} {moved[worst]:+.1f}, J {fit.cost:.1f}"


def study(vehicle: hs.Vehicle, text: str, good: hs.Fit) -> str:
    """Return one fault's line."""
    try:
        flights = hs.fly(
            vehicle,
            hs.FlightPlan(excitation=hs.Sweep(axis="ped"), faults=[parse_fault(text)]),
            count=2,
            seed=1,
        )
    except DivergedError as error:
        return f"{text:<40}{str(error).split(';')[0]}"
    tilt = max(np.abs(one.select(("phi", "theta"))).max() for one in flights)
    rate = max(np.abs(one.select(("p", "q", "r"))).max() for one in flights)
    logs = [
        hs.screen(one, resample_hz=100.0, repair=REPAIR, min_duration=SHORTEST) for one in flights
    ]
    noted: Counter[str] = Counter()
    for log in logs:
        noted.update({one.kind: one.count for one in log.report.findings})
    notes = ", ".join(f"{count} {kind}" for kind, count in noted.items()) or "nothing"
    parts = [record for log in logs for record in log.records]
    columns = "".join(f"{shift(one, good):<29}" for one in (flights, parts))
    return f"{text:<40}{tilt:6.2f}{rate:7.2f}  {columns}{notes}"


def main(faults: Sequence[str]) -> None:
    """Print a line a fault."""
    warnings.simplefilter("ignore")  # the screening's notes are printed
    vehicle = hs.load("jr700")
    good = identified(hs.fly(vehicle, hs.Sweep(axis="ped"), count=2, seed=1))
    head = f"{'fault':<40}{'tilt':>6}{'rate':>7}  {'as recorded':<29}{'screened':<29}"
    print(f"{head}noted in two records\n{'':<40}{'rad':>6}{'rad/s':>7}  standard errors")
    for text in faults:
        print(study(vehicle, text, good), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:] or FAULTS)
