"""Cost of a time step beside stock MuJoCo's, and beside JSBSim's where that is installed.

All run in turn, several times, in this process; the least of each counts. The flight has
rotor, flapping, gyro, servos, pilot with sweep and remnant, and all sensors active. Stock
MuJoCo steps the same model with the same options and sensors, without callbacks: as it comes,
and with its profiling timers at rest, as they are while helisim's callbacks are installed.
JSBSim's AH-1S hovers, and what helisim's sensors write too is read after each step, or nothing is.

    python scripts/benchmark/step.py [ROUNDS]
"""

import sys
import time
from collections.abc import Callable

import mujoco
from numba import cfunc, types

import ah1s
import helisim as hs
from helisim.physics.native import installed
from helisim.sim.simulation import prepare
from helisim.vehicle.assembly import Integrator
from helisim.vehicle.trim import place

STEPS = 20_000
ROUNDS = 7
INTEGRATORS: tuple[Integrator, ...] = ("RK4", "Euler")
READ, UNREAD = "JSBSim, outputs read", "JSBSim, nothing read"


@cfunc(types.float64())
def resting() -> float:
    """Return the same time whenever MuJoCo asks."""
    return 0.0


def step_costs(rounds: int = ROUNDS) -> dict[str, float]:
    """Return CPU seconds a step of each, by name; JSBSim's are left out where there is none."""
    rivals: dict[str, Callable[[], float]] = {}
    for integrator in INTEGRATORS:
        rivals |= _of_ours(integrator)
    try:
        helicopter = ah1s.hovering()
    except ImportError:
        pass
    else:
        rivals[READ] = lambda: ah1s.cost(helicopter, read=True)
        rivals[UNREAD] = lambda: ah1s.cost(helicopter, read=False)
    seconds: dict[str, list[float]] = {name: [] for name in rivals}
    for _ in range(rounds):
        for name, rival in rivals.items():
            seconds[name].append(rival())
    return {name: min(each) for name, each in seconds.items()}


def _of_ours(integrator: Integrator) -> dict[str, Callable[[], float]]:
    """Return our vehicle with our callbacks and without, stepped by one of the integrators."""
    vehicle = hs.load("jr700", integrator=integrator)
    model = prepare(
        vehicle,
        hs.Sweep(axis="lat"),
        seed=1,
        number=0,
    )

    def ours() -> float:
        with installed():
            return _cost(vehicle, model, height=20.0)

    def stock() -> float:  # it falls, so start it high
        return _cost(vehicle, model, height=1e6)

    def untimed() -> float:
        mujoco.set_mjcb_time(resting.ctypes)
        try:
            return stock()
        finally:
            mujoco.set_mjcb_time(None)

    return {
        f"helisim, {integrator}": ours,
        f"stock, {integrator}": stock,
        f"stock, timers at rest, {integrator}": untimed,
    }


def _cost(vehicle: hs.Vehicle, model: mujoco.MjModel, height: float) -> float:
    data = mujoco.MjData(model)
    place(model, data, vehicle.trim, height=height)
    mujoco.mj_step(model, data, 500)
    start = time.process_time()
    mujoco.mj_step(model, data, STEPS)
    return (time.process_time() - start) / STEPS


def main(rounds: int = ROUNDS) -> None:
    """Print a line for each integrator, and JSBSim's."""
    cost = step_costs(rounds)
    peers = [name for name in (READ, UNREAD) if name in cost]
    print(f"{'':22}{'us a step':>10}{'steps/s':>9}{'x stock':>9}{'x same timers':>15}", end="")
    print(f"{'times as fast as JSBSim, read / unread':>41}" if peers else "")
    for integrator in INTEGRATORS:
        ours = cost[f"helisim, {integrator}"]
        print(f"{'helisim, ' + integrator:22}{1e6 * ours:10.2f}{1.0 / ours:9.0f}", end="")
        print(f"{ours / cost[f'stock, {integrator}']:9.2f}", end="")
        print(f"{ours / cost[f'stock, timers at rest, {integrator}']:15.2f}", end="")
        print(f"{' / '.join(f'{cost[name] / ours:.2f}' for name in peers):>41}")
    for name in peers:
        print(f"{name:22}{1e6 * cost[name]:10.2f}{1.0 / cost[name]:9.0f}")
    if not peers:
        print("JSBSim is not installed: pip install helisim[benchmark]")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
