"""What a control law of one's own costs: a step beside the shipped gyro's, and ticks a second.

The same law, the shipped one's own source, in turn, several times, in this process; the least of
each counts. "step" is a time step under `installed()`, "flown" all of `fly`: simulated, recorded.

    python scripts/benchmark/controller.py [ROUNDS]
"""

import sys
import time
from collections.abc import Callable

import mujoco
import numba
from numba import types

import helisim as hs
from helisim.physics.gyro import Seen, gyro_law
from helisim.physics.layout import PARAM
from helisim.sim.flight import prepare
from helisim.vehicle import ControllerLike
from helisim.vehicle.assembly import Integrator
from helisim.vehicle.motion import addresses
from helisim.vehicle.trim import place

STEPS = 10_000
ROUNDS = 15
INTEGRATORS: tuple[Integrator, ...] = ("RK4", "Euler")
FLIGHT = hs.Sweep(axis="lat", duration=30.0)
_POINTER = types.CPointer(types.float64)


def law(seen, state, settings):
    """Do what the shipped gyro does."""
    return gyro_law(seen, state, settings)


@numba.cfunc(types.void(_POINTER, _POINTER, _POINTER, _POINTER))
def pointer(seen, state, settings, commands):
    """Do so as a C function."""
    now = Seen(
        seen[0], seen[1], seen[2], seen[3], seen[4], seen[5], seen[6], seen[7], seen[8], seen[9],
        seen[10], seen[11], seen[12], seen[13], seen[14], seen[15], seen[16], seen[17],
    )  # fmt: skip
    commands[0], commands[1], commands[2], commands[3] = gyro_law(now, state, settings)


def passing(seen):
    """Leave the servos where they are: what the call of a Python law costs by itself."""
    return seen.front, seen.left, seen.right, seen.tail


def controllers(vehicle: hs.Vehicle) -> dict[str, ControllerLike]:
    """Return the shipped laws, and those of one's own that do the same, by name."""
    settings = vehicle.model.actuator_user[addresses(vehicle.model).rotor, : len(PARAM)]
    return {
        "shipped": hs.Controller(),
        "njit": hs.Controller(numba.njit(law), settings=settings),
        "cfunc": hs.Controller(pointer, settings=settings),
        "Python": hs.Controller(law, settings=settings),
        "Python, empty": passing,
    }


def step_costs(integrator: Integrator, rounds: int) -> dict[str, float]:
    """Return CPU seconds a step by controller, pilot and remnant on."""
    vehicle = hs.load("jr700", integrator=integrator)
    flown = {name: vehicle.with_controller(one) for name, one in controllers(vehicle).items()}
    models = {name: prepare(one, FLIGHT, seed=1, number=0) for name, one in flown.items()}

    def cost(name: str) -> float:
        data = mujoco.MjData(models[name])
        place(models[name], data, vehicle.trim)
        with hs.installed():
            mujoco.mj_step(models[name], data, 100)
            begun = time.process_time()
            mujoco.mj_step(models[name], data, STEPS)
            return (time.process_time() - begun) / STEPS

    return _least({name: lambda name=name: cost(name) for name in flown}, rounds)


def flight_costs(rounds: int) -> dict[str, float]:
    """Return CPU seconds of a recorded flight by controller, RK4 at 2 ms, one thread."""
    vehicle = hs.load("jr700")

    def cost(controller: ControllerLike) -> float:
        begun = time.process_time()
        hs.fly(vehicle, FLIGHT, controller=controller, jobs=1, keep_ended=True)
        return time.process_time() - begun

    works = controllers(vehicle)
    del works["Python, empty"]  # it doesn't hold the hover for long
    return _least({name: lambda one=one: cost(one) for name, one in works.items()}, rounds)


def _least(works: dict[str, Callable[[], float]], rounds: int) -> dict[str, float]:
    seconds: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(rounds):
        for name, work in works.items():
            seconds[name].append(work())
    return {name: min(each) for name, each in seconds.items()}


def main(rounds: int = ROUNDS) -> None:
    """Print a line for each law and integrator; wanted: native within 1.05, Python 30 k/s."""
    print(f"{'':24}{'us a step':>10}{'x shipped':>11}{'k ticks/s':>11}")
    for integrator in INTEGRATORS:
        _print(integrator, step_costs(integrator, rounds))
    ticks = FLIGHT.duration / 0.002
    flown = flight_costs(max(1, rounds // 3))
    _print("flown", {name: cost / ticks for name, cost in flown.items()})


def _print(how: str, costs: dict[str, float]) -> None:
    for name, cost in costs.items():
        ratio = cost / costs["shipped"]
        print(f"{f'{how}, {name}':24}{1e6 * cost:10.2f}{ratio:11.3f}{1e-3 / cost:11.0f}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
