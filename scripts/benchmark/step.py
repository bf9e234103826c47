"""Cost of a time step beside stock MuJoCo's, and beside JSBSim's where that is installed.

All run in turn, several times, in this process; the least of each counts. The flight has
rotor, flapping, gyro, servos, pilot with sweep and remnant, and all sensors active. Stock
MuJoCo steps the same model with the same options and sensors, without callbacks: as it comes,
and with its profiling timers at rest, as they are while helisim's callbacks are installed.
With all on, a motor turns the rotor, the inflow is Pitt and Peters', the air is turbulent, and a
ground below has its effect and could be touched; stock MuJoCo then has that ground too.
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
from helisim.sim.flight import prepare
from helisim.vehicle.assembly import Integrator
from helisim.vehicle.trim import place

STEPS = 20_000
ROUNDS = 7
INTEGRATORS: tuple[Integrator, ...] = ("RK4", "Euler")
ALL_ON = {
    "main_rotor.inflow": "pitt-peters",
    "drive.governor": "motor",
    "air.ground_effect": 1.0,
}
"""What the force laws can do beyond what a vehicle is shipped with."""
FLOWN = (*INTEGRATORS, *(f"{integrator}, all on" for integrator in INTEGRATORS))
READ, UNREAD = "JSBSim, outputs read", "JSBSim, nothing read"


@cfunc(types.float64())
def resting() -> float:
    """Return the same time whenever MuJoCo asks."""
    return 0.0


def step_costs(rounds: int = ROUNDS) -> dict[str, float]:
    """Return CPU seconds a step of each, by name; JSBSim's are left out where there is none."""
    rivals: dict[str, Callable[[], float]] = {}
    for integrator in INTEGRATORS:
        rivals |= _of_ours(integrator, "", *_as_shipped(integrator))
        rivals |= _of_ours(integrator, ", all on", *_with_all_on(integrator))
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


def _as_shipped(integrator: Integrator) -> tuple[hs.Vehicle, mujoco.MjModel]:
    """Return a vehicle and its model in the flight of a sweep."""
    vehicle = hs.load("jr700", integrator=integrator)
    return vehicle, prepare(vehicle, hs.Sweep(axis="lat"), seed=1, number=0)


def _with_all_on(integrator: Integrator) -> tuple[hs.Vehicle, mujoco.MjModel]:
    """Return them with all that the force laws can do."""
    ground = hs.Ground()
    plan = hs.FlightPlan(
        excitation=hs.Sweep(axis="lat"), weather=hs.Weather(turbulence="light"), ground=ground
    )
    vehicle = hs.load("jr700", integrator=integrator, parameters=ALL_ON)
    below = vehicle.grounded_model(ground.put_into)
    return vehicle, prepare(vehicle, plan, seed=1, number=0, model=below)


def _of_ours(
    integrator: Integrator, what: str, vehicle: hs.Vehicle, model: mujoco.MjModel
) -> dict[str, Callable[[], float]]:
    """Return our vehicle with our callbacks and without, stepped by one of the integrators."""

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
        f"helisim, {integrator}{what}": ours,
        f"stock, {integrator}{what}": stock,
        f"stock, timers at rest, {integrator}{what}": untimed,
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
    for flown in FLOWN:
        ours = cost[f"helisim, {flown}"]
        print(f"{'helisim, ' + flown:22}{1e6 * ours:10.2f}{1.0 / ours:9.0f}", end="")
        print(f"{ours / cost[f'stock, {flown}']:9.2f}", end="")
        print(f"{ours / cost[f'stock, timers at rest, {flown}']:15.2f}", end="")
        print(f"{' / '.join(f'{cost[name] / ours:.2f}' for name in peers):>41}")
    for name in peers:
        print(f"{name:22}{1e6 * cost[name]:10.2f}{1.0 / cost[name]:9.0f}")
    if not peers:
        print("JSBSim is not installed: pip install helisim[benchmark]")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
