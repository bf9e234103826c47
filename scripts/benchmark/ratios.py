"""Every benchmark in one table of ratios, measured in one run on this machine.

Speeds are CPU time, the best of several rounds that alternate; only the scaling over threads is
wall time, which means something on an idle machine alone: the machine's load is printed first. The
whole experiment has a benchmark of its own, `experiment.py`. Peers come with
`pip install helisim[benchmark]`; rows of those that aren't installed say so.

    OPENBLAS_NUM_THREADS=1 python scripts/benchmark/ratios.py
"""

import os
import time
from collections.abc import Iterator
from itertools import product

import numpy as np

import controller
import helisim as hs
import identification
import step
from helisim.sim import simulate

THREADS, FLIGHTS, ROUNDS, SEEDS = (1, 2), 6, 5, 3
IDLE = 0.5  # load of a machine below which wall time is that of the benchmark
KINDS = (("pole error", "%", "< 1"), ("J", "", "< 1"), ("CPU time", "s", ""))
Row = tuple[str, str, str, float | None, str]
"""What is compared, both figures, their ratio, what is wanted."""


def steps() -> Iterator[Row]:
    """Compare a step with stock MuJoCo's and with JSBSim's."""
    cost = {name: 1e6 * one for name, one in step.step_costs().items()}
    for flown in step.FLOWN:
        ours = cost[f"helisim, {flown}"]
        for stock in ("stock", "stock, timers at rest"):
            peer = cost[f"{stock}, {flown}"]
            what = f"{flown} step, {stock}"
            yield what, f"{ours:.2f} us", f"{peer:.2f} us", ours / peer, "<= 1.6"
        if step.READ not in cost:
            yield f"{flown} steps/CPU s, JSBSim ah1s", "-", "no jsbsim", None, ""
            continue
        for name in (step.READ, step.UNREAD):
            peer, what = cost[name], f"{flown} steps/CPU s, {name}"
            yield what, f"{1e3 / ours:.0f} k/s", f"{1e3 / peer:.0f} k/s", peer / ours, ">= 2"


def laws() -> Iterator[Row]:
    """Compare control laws of one's own with the shipped gyro: a step, and whole flights."""
    for integrator, name in product(step.INTEGRATORS, ("njit", "cfunc")):
        cost = controller.step_costs(integrator, ROUNDS)
        own, shipped = cost[name], cost["shipped"]
        what = f"{integrator} step, law by {name}"
        yield what, f"{1e6 * shipped:.2f} us", f"{1e6 * own:.2f} us", own / shipped, "<= 1.05"
    cost = controller.flight_costs(ROUNDS)
    own, shipped = (1e-3 * controller.TICKS / cost[name] for name in ("Python", "shipped"))
    what = "flown ticks/CPU s, law in Python"
    yield what, f"{shipped:.0f} k/s", f"{own:.0f} k/s", own / shipped, "30 k/s"


def threads() -> Iterator[Row]:
    """Compare flights in several threads with those in one, simulated only and recorded.

    CPU time says what the threads cost each other, even where others use the processors.
    """
    vehicle, sweep = hs.load("jr700"), hs.Sweep(axis="lat", duration=90.0)
    works = {
        "simulated": lambda jobs: list(simulate(vehicle, sweep, count=FLIGHTS, jobs=jobs)),
        "recorded": lambda jobs: hs.fly(vehicle, sweep, count=FLIGHTS, jobs=jobs),
    }
    spent = {key: np.full(2, np.inf) for key in product(works, THREADS)}
    for what, jobs in ROUNDS * list(spent):
        start = np.array([time.perf_counter(), time.process_time()])
        works[what](jobs)
        now = np.array([time.perf_counter(), time.process_time()])
        spent[what, jobs] = np.minimum(spent[what, jobs], now - start)
    one, many = THREADS
    for what, (k, name, wanted) in product(works, ((0, "wall", ">= 1.8"), (1, "CPU", "about 1"))):
        slow, fast = (FLIGHTS * 90.0 / spent[what, jobs][k] for jobs in (one, many))
        text = f"{what} s/{name} s, {many} threads, one"
        yield text, f"{fast:.0f} s/s", f"{slow:.0f} s/s", fast / slow, wanted


def identifications() -> Iterator[Row]:
    """Compare accuracy and time of the identification with a subspace method's."""
    for case in identification.CASES:
        flown = [identification.flights(case, seed) for seed in range(SEEDS)]
        reference = identification.STICKS if case == "closed loop" else None
        ours = identification.measure(identification.ours, flown, reference)
        try:
            peer = identification.measure(identification.peer, flown, "N4SID")
        except ImportError:
            yield f"{case}, N4SID of sippy-unipi", "-", "no sippy-unipi", None, ""
            continue
        for (what, unit, wanted), a, b in zip(KINDS, np.mean(ours, 0), np.mean(peer, 0)):
            yield f"{what}, N4SID, {case}", f"{a:.3g} {unit}", f"{b:.3g} {unit}", a / b, wanted


def main() -> None:
    """Print the table, row by row."""
    busy = os.getloadavg()[0]
    note = "" if busy < IDLE else f", above {IDLE}: wall times are those of a busy machine"
    print(f"load of the machine {busy:.1f}{note}")
    print(f"{'helisim beside ...':<42}{'helisim':>10}{'beside':>12}{'ratio':>8}  wanted")
    for rows in (steps(), laws(), threads(), identifications()):
        for what, ours, peer, ratio, wanted in rows:
            shown = "-" if ratio is None else f"{ratio:.3g}"
            print(f"{what:<42}{ours:>10}{peer:>12}{shown:>8}  {wanted}", flush=True)


if __name__ == "__main__":
    main()
