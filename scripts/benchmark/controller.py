"""What a control law of one's own costs: a step beside the shipped gyro's, and ticks a second.

The same law, the shipped one's own source, in turn, several times, in this process; the least of
each counts. "step" is a time step under `installed()`, "flown" all of `fly`: simulated, recorded.

    python scripts/benchmark/controller.py [ROUNDS]
"""

import sys
import time

import mujoco
import numba
from numba import types

import helisim as hs
from helisim.physics.gyro import Seen, gyro_law
from helisim.physics.layout import PARAM
from helisim.sim.flight import prepare
from helisim.vehicle import ControllerLike
from helisim.vehicle.assembly import Integrator
from helisim.vehicle.trim import addresses, place
from step import INTEGRATORS, least

STEPS, ROUNDS = 10_000, 15
FLIGHT = hs.Sweep(axis="lat", duration=30.0)
TICKS = FLIGHT.duration / 0.002
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
    own = {"njit": numba.njit(law), "cfunc": pointer, "Python": law}
    made = {name: hs.Controller(one, settings=settings) for name, one in own.items()}
    return {"shipped": hs.Controller(), **made, "Python, empty": passing}


def step_costs(integrator: Integrator, rounds: int) -> dict[str, float]:
    """Return CPU seconds a step by controller, pilot and remnant on."""
    vehicle = hs.load("jr700", integrator=integrator)

    def cost(model: mujoco.MjModel) -> float:
        data = mujoco.MjData(model)
        place(model, data, vehicle.trim)
        with hs.installed():
            mujoco.mj_step(model, data, 100)
            begun = time.process_time()
            mujoco.mj_step(model, data, STEPS)
            return (time.process_time() - begun) / STEPS

    flown = {name: vehicle.with_controller(one) for name, one in controllers(vehicle).items()}
    models = {name: prepare(one, FLIGHT, seed=1, number=0) for name, one in flown.items()}
    return least({name: lambda m=model: cost(m) for name, model in models.items()}, rounds)


def flight_costs(rounds: int) -> dict[str, float]:
    """Return CPU seconds of a recorded flight by controller, RK4 at 2 ms, one thread."""
    vehicle = hs.load("jr700")

    def cost(controller: ControllerLike) -> float:
        begun = time.process_time()
        hs.fly(vehicle, FLIGHT, controller=controller, jobs=1, keep_ended=True)
        return time.process_time() - begun

    laws = controllers(vehicle)
    del laws["Python, empty"]  # it doesn't hold the hover for long
    return least({name: lambda one=one: cost(one) for name, one in laws.items()}, rounds)


def main(rounds: int = ROUNDS) -> None:
    """Print a line for each law and integrator; wanted: native within 1.05, Python 30 k/s."""
    print(f"{'':24}{'us a step':>10}{'x shipped':>11}{'k ticks/s':>11}")
    found = {integrator: step_costs(integrator, rounds) for integrator in INTEGRATORS}
    flown = flight_costs(max(1, rounds // 3))
    found["flown"] = {name: cost / TICKS for name, cost in flown.items()}
    for how, costs in found.items():
        for name, cost in costs.items():
            ratio = cost / costs["shipped"]
            print(f"{f'{how}, {name}':24}{1e6 * cost:10.2f}{ratio:11.3f}{1e-3 / cost:11.0f}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
