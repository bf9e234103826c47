"""Physics steps a second of the vector environment, beside one thread and beside plain rollouts.

All run in turn, several times, in this process; the best of each counts. The agent holds the
sticks of the hover; rewards, observations, ends and new episodes are all part of it. "In one
block" the loop is inside `with helisim.installed()`, which otherwise each frame enters and leaves.
The plain rollout is `mujoco.rollout` of the same models from the same states with the same threads,
into the same memory, in one block, and nothing else: what is left of it is the cost of the
environment. With other programs at work only the processor time means something.

    python scripts/benchmark/environments.py [NUM_ENVS] [ROUNDS]
"""

import os
import sys
import time
from collections.abc import Callable

import gymnasium
import numpy as np

from helisim.gym.flights import Flights
from helisim.physics.native import installed

INTEGRATORS = ("Euler", "RK4")
CORES = os.cpu_count() or 1
FRAMES = 100
ROUNDS = 7
NUM_ENVS = 64
Cost = tuple[float, float]  # Wall and processor seconds of a physics step.


def costs(count: int, rounds: int) -> dict[str, Cost]:
    """Return the least cost a step of each way to fly so many helicopters, by name."""
    ways: dict[str, Callable[[], int]] = {}
    for integrator in INTEGRATORS:
        for threads in (CORES, 1):
            ways |= _ways(count, integrator=integrator, threads=threads)
    least: dict[str, Cost] = dict.fromkeys(ways, (np.inf, np.inf))
    for _ in range(rounds):
        for name, way in ways.items():
            wall, processor = time.perf_counter(), time.process_time()
            steps = way()
            spent = time.perf_counter() - wall, time.process_time() - processor
            least[name] = tuple(min(old, new / steps) for old, new in zip(least[name], spent))
    return least


def _ways(count: int, *, integrator: str, threads: int) -> dict[str, Callable[[], int]]:
    """Return, by name, what steps an environment or rolls the same out, and returns its steps."""
    env = gymnasium.make_vec(
        "helisim.gym:helisim/Hover-v0",
        count,
        vectorization_mode="vector_entry_point",
        integrator=integrator,
        threads=threads,
    )
    env.reset(seed=1)
    hold = np.zeros((count, 4), dtype=np.float32)
    flights = Flights(env.unwrapped.setup, count)
    flights.reset(range(count), [np.random.default_rng(k) for k in range(count)])
    start = flights.states.copy()
    steps = FRAMES * count * env.unwrapped.setup.frame_skip

    def fly() -> int:
        for _ in range(FRAMES):
            env.step(hold)
        return steps

    def in_one_block() -> int:
        with installed():
            return fly()

    def roll() -> int:
        flights.states[:] = start
        with installed():
            for _ in range(FRAMES):
                flights.roll()
        return steps

    name = _name(integrator, threads)
    return {name: fly, f"{name}, in one block": in_one_block, f"{name}, plain rollout": roll}


def _name(integrator: str, threads: int) -> str:
    return f"{integrator}, {threads} thread{'s' if threads > 1 else ''}"


def main(count: int = NUM_ENVS, rounds: int = ROUNDS) -> None:
    """Print the table, and how much faster all processors are than one."""
    print(f"{count} environments, load of the machine {os.getloadavg()[0]:.1f}")
    found = costs(count, rounds)
    print(f"{'':34}{'steps/s':>10}{'wall us':>9}{'CPU us':>8}")
    for name, (wall, processor) in found.items():
        print(f"{name:34}{1.0 / wall:10,.0f}{1e6 * wall:9.3f}{1e6 * processor:8.3f}")
    for integrator in INTEGRATORS:
        for kind in ("", ", in one block", ", plain rollout"):
            many, one = (found[_name(integrator, threads) + kind] for threads in (CORES, 1))
            print(f"{integrator}{kind}: {one[0] / many[0]:.2f} times as fast as one thread")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
