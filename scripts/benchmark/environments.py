"""Physics steps a second of the vector environment, beside one thread and beside plain rollouts.

All run in turn, several times, in this process; the best of each counts. The agent holds the
sticks of the hover; rewards, observations, ends and new episodes are all part of it. The plain
rollout is `mujoco.rollout` of the same models from the same states with the same threads, into the
same memory, and nothing else: what is left of it is the cost of the environment. With other
programs at work only the processor time means something.

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

FRAMES = 100
ROUNDS = 7
NUM_ENVS = 64
Cost = tuple[float, float]
"""Wall and processor seconds of a physics step."""


def costs(count: int, rounds: int) -> dict[str, Cost]:
    """Return the least cost a step of each way to fly so many helicopters, by name."""
    cores = os.cpu_count() or 1
    ways: dict[str, Callable[[], None]] = {}
    steps = {}
    for integrator in ("Euler", "RK4"):
        for threads in (cores, 1):
            name = f"{integrator}, {threads} thread{'s' if threads > 1 else ''}"
            fly, plain, steps[name] = _ways(count, integrator=integrator, threads=threads)
            ways[name], ways[f"{name}, plain rollout"] = fly, plain
            steps[f"{name}, plain rollout"] = steps[name]
    least: dict[str, Cost] = dict.fromkeys(ways, (np.inf, np.inf))
    for _ in range(rounds):
        for name, way in ways.items():
            wall, processor = time.perf_counter(), time.process_time()
            way()
            spent = time.perf_counter() - wall, time.process_time() - processor
            least[name] = (
                min(least[name][0], spent[0] / steps[name]),
                min(least[name][1], spent[1] / steps[name]),
            )
    return least


def _ways(count: int, **settings: object) -> tuple[Callable[[], None], Callable[[], None], int]:
    """Return what steps an environment, what rolls the same out, and how many steps each takes."""
    env = gymnasium.make_vec(
        "helisim.gym:helisim/Hover-v0", count, vectorization_mode="vector_entry_point", **settings
    )
    env.reset(seed=1)
    hold = np.zeros((count, 4), dtype=np.float32)
    flights = Flights(env.unwrapped.setup, count)
    flights.reset(range(count), [np.random.default_rng(k) for k in range(count)])
    start = flights.states.copy()

    def fly() -> None:
        for _ in range(FRAMES):
            env.step(hold)

    def plain() -> None:
        flights.states[:] = start
        with installed():
            for _ in range(FRAMES):
                flights.roll()

    return fly, plain, FRAMES * count * env.unwrapped.setup.frame_skip


def main(count: int = NUM_ENVS, rounds: int = ROUNDS) -> None:
    """Print the table, and how much faster all processors are than one."""
    print(f"{count} environments, load of the machine {os.getloadavg()[0]:.1f}")
    found = costs(count, rounds)
    print(f"{'':34}{'steps/s':>10}{'wall us':>9}{'CPU us':>8}")
    for name, (wall, processor) in found.items():
        print(f"{name:34}{1.0 / wall:10,.0f}{1e6 * wall:9.3f}{1e6 * processor:8.3f}")
    cores = os.cpu_count() or 1
    for integrator in ("Euler", "RK4"):
        many, one = (f"{integrator}, {threads} thread{'s' if threads > 1 else ''}"
                     for threads in (cores, 1))  # fmt: skip
        beside = [
            found[way][kind] / found[f"{way}, plain rollout"][kind]
            for way, kind in ((many, 0), (one, 1))
        ]
        print(
            f"{integrator}: {found[one][0] / found[many][0]:.2f} times as fast as one thread; "
            f"{beside[0]:.2f} times the time of the plain rollout, {beside[1]:.2f} times its "
            "processor time in one thread"
        )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
