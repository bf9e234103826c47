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
from itertools import product

import gymnasium
import numpy as np

from helisim.gym.flights import Flights
from helisim.physics.native import installed

INTEGRATORS = ("Euler", "RK4")
CORES = os.cpu_count() or 1
FRAMES, ROUNDS, NUM_ENVS = 100, 7, 64
KINDS = ("", ", in one block", ", plain rollout")


def ways(count: int, integrator: str, threads: int) -> dict[str, Callable[[], int]]:
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

    return dict(zip(_names(integrator, threads), (fly, in_one_block, roll)))


def _names(integrator: str, threads: int) -> list[str]:
    name = f"{integrator}, {threads} thread{'s' if threads > 1 else ''}"
    return [f"{name}{kind}" for kind in KINDS]


def main(count: int = NUM_ENVS, rounds: int = ROUNDS) -> None:
    """Print the least cost a step of each way, and how much faster all processors are than one."""
    print(f"{count} environments, load of the machine {os.getloadavg()[0]:.1f}")
    every: dict[str, Callable[[], int]] = {}
    for integrator, threads in product(INTEGRATORS, (CORES, 1)):
        every |= ways(count, integrator, threads)
    found = {name: np.full(2, np.inf) for name in every}
    for name in rounds * list(every):
        start = np.array([time.perf_counter(), time.process_time()])
        steps = every[name]()
        spent = np.array([time.perf_counter(), time.process_time()]) - start
        found[name] = np.minimum(found[name], spent / steps)
    print(f"{'':34}{'steps/s':>10}{'wall us':>9}{'CPU us':>8}")
    for name, (wall, processor) in found.items():
        print(f"{name:34}{1.0 / wall:10,.0f}{1e6 * wall:9.3f}{1e6 * processor:8.3f}")
    for integrator in INTEGRATORS:
        for kind, many, one in zip(KINDS, _names(integrator, CORES), _names(integrator, 1)):
            ratio = found[one][0] / found[many][0]
            print(f"{integrator}{kind}: {ratio:.2f} times as fast as one thread")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
