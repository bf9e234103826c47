"""Every benchmark in one table of ratios, measured in one run on this machine.

Speeds are CPU time, the best of several rounds that alternate; only the scaling over threads is
wall time, which means something on an idle machine alone: the machine's load is printed first. The
whole experiment has a benchmark of its own, `experiment.py`. Peers come with
`pip install helisim[benchmark]`; rows of those that aren't installed say so.

    OPENBLAS_NUM_THREADS=1 python scripts/benchmark/ratios.py
"""

import os
import time
from collections.abc import Callable, Iterator
from itertools import product
from typing import NamedTuple

import numpy as np

import controller
import helisim as hs
import identification
import memory
import step
from helisim.sim import simulate
from helisim.vehicle import Vehicle, load

THREADS = (1, 2)
FLIGHTS = 6
IDLE = 0.5
"""Load of a machine below which wall time is that of the benchmark."""
ROUNDS = 5
SEEDS = 3
KINDS = (("pole error", "%", "< 1"), ("J", "", "< 1"), ("CPU time", "s", ""))


class Row(NamedTuple):
    """A line of the table: what is compared, both figures, their ratio, what is wanted."""

    what: str
    ours: str
    peer: str
    ratio: float | None
    wanted: str


def steps() -> Iterator[Row]:
    """Compare a step with stock MuJoCo's and with JSBSim's."""
    cost = step.step_costs()
    for flown in step.FLOWN:
        ours = cost[f"helisim, {flown}"]
        for stock in ("stock", "stock, timers at rest"):
            theirs = cost[f"{stock}, {flown}"]
            yield Row(
                f"{flown} step, {stock}",
                f"{1e6 * ours:.2f} us",
                f"{1e6 * theirs:.2f} us",
                ours / theirs,
                "<= 1.6",
            )
        for name in (step.READ, step.UNREAD):
            if name not in cost:
                yield missing(f"{flown} steps/CPU s, JSBSim ah1s", "jsbsim")
                break
            yield Row(
                f"{flown} steps/CPU s, {name}",
                f"{1e-3 / ours:.0f} k/s",
                f"{1e-3 / cost[name]:.0f} k/s",
                cost[name] / ours,
                ">= 2",
            )


def laws() -> Iterator[Row]:
    """Compare control laws of one's own with the shipped gyro: a step, and whole flights."""
    for integrator in controller.INTEGRATORS:
        cost = controller.step_costs(integrator, ROUNDS)
        for name in ("njit", "cfunc"):
            ours, theirs = cost[name], cost["shipped"]
            yield Row(
                f"{integrator} step, law by {name}",
                f"{1e6 * theirs:.2f} us",
                f"{1e6 * ours:.2f} us",
                ours / theirs,
                "<= 1.05",
            )
    cost = controller.flight_costs(ROUNDS)
    ticks = controller.FLIGHT.duration / 0.002
    ours, theirs = ticks / cost["Python"], ticks / cost["shipped"]
    yield Row(
        "flown ticks/CPU s, law in Python",
        f"{1e-3 * theirs:.0f} k/s",
        f"{1e-3 * ours:.0f} k/s",
        ours / theirs,
        "30 k/s",
    )


def threads(vehicle: Vehicle) -> Iterator[Row]:
    """Compare flights in several threads with those in one: by wall time, and by CPU time.

    Simulated only, and recorded too. CPU time says what the threads cost each other, even where
    others use the processors.
    """
    sweep = hs.Sweep(axis="lat", duration=90.0)
    works: dict[str, Callable[[int], object]] = {
        "simulated": lambda jobs: list(simulate(vehicle, sweep, count=FLIGHTS, jobs=jobs)),
        "recorded": lambda jobs: hs.fly(vehicle, sweep, count=FLIGHTS, jobs=jobs),
    }
    clocks = {"wall": time.perf_counter, "CPU": time.process_time}
    best: dict[tuple[str, str, int], float] = {}
    for what, jobs in ROUNDS * list(product(works, THREADS)):
        start = {name: clock() for name, clock in clocks.items()}
        works[what](jobs)
        for name, clock in clocks.items():
            spent = clock() - start[name]
            best[what, name, jobs] = min(best.get((what, name, jobs), spent), spent)
    many = THREADS[-1]
    for what, (name, wanted) in product(works, (("wall", ">= 1.8"), ("CPU", "about 1"))):
        ours, one = (FLIGHTS * 90.0 / best[what, name, jobs] for jobs in (many, 1))
        yield Row(
            f"{what} s/{name} s, {many} threads, one",
            f"{ours:.0f} s/s",
            f"{one:.0f} s/s",
            ours / one,
            wanted,
        )


def memories() -> Iterator[Row]:
    """Compare the peak memory of many flights with that of few."""
    few, *more = memory.FLIGHTS
    first = memory.peak_memory(few)
    for flights in more:
        peak = memory.peak_memory(flights)
        yield Row(
            f"memory, {flights} flights, {few} flights",
            f"{peak:.0f} MB",
            f"{first:.0f} MB",
            peak / first,
            "about 1",
        )


def identifications() -> Iterator[Row]:
    """Compare accuracy and time of the identification with a subspace method's."""
    for case in ("quiet", "gusty", "closed loop"):
        flown = [identification.flights(case, seed) for seed in range(SEEDS)]
        reference = identification.STICKS if case == "closed loop" else None
        ours = identification.measure(
            lambda k, f=flown, r=reference: identification.ours(f[k], r), SEEDS
        )
        try:
            peer = identification.measure(
                lambda k, f=flown: identification.peer(f[k], "N4SID"), SEEDS
            )
        except ImportError:
            yield missing(f"{case}, N4SID of sippy-unipi", "sippy-unipi")
            continue
        for (what, unit, wanted), a, b in zip(KINDS, np.mean(ours, 0), np.mean(peer, 0)):
            yield Row(f"{what}, N4SID, {case}", f"{a:.3g} {unit}", f"{b:.3g} {unit}", a / b, wanted)


def missing(what: str, package: str) -> Row:
    """Return the row of a peer that isn't there."""
    return Row(what, "-", f"no {package}", None, "")


def main() -> None:
    """Print the table, row by row."""
    busy = os.getloadavg()[0]
    note = "" if busy < IDLE else f", above {IDLE}: wall times are those of a busy machine"
    print(f"load of the machine {busy:.1f}{note}")
    vehicle = load("jr700")
    print(f"{'helisim beside ...':<42}{'helisim':>10}{'beside':>12}{'ratio':>8}  wanted")
    for rows in (steps(), laws(), threads(vehicle), memories(), identifications()):
        for row in rows:
            ratio = "-" if row.ratio is None else f"{row.ratio:.3g}"
            print(f"{row.what:<42}{row.ours:>10}{row.peer:>12}{ratio:>8}  {row.wanted}", flush=True)


if __name__ == "__main__":
    main()
