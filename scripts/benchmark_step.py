"""Cost of a time step beside stock MuJoCo's, and beside JSBSim's where that is installed.

All run in turn, several times, in this process; the least of each counts. The flight has
rotor, flapping, gyro, servos, pilot with sweep and remnant, and all sensors active. Stock
MuJoCo steps the same model with the same options and sensors, without callbacks: as it comes,
and with its profiling timers at rest, as they are while helisim's callbacks are installed.
"""

import time
from collections.abc import Callable
from typing import Any

import mujoco
from numba import cfunc, types

import helisim as hs
from helisim.physics.native import installed
from helisim.sim.simulation import prepare
from helisim.vehicle.assembly import Integrator
from helisim.vehicle.trim import place

STEPS = 20_000
ROUNDS = 7


@cfunc(types.float64())
def resting() -> float:
    """Return the same time whenever MuJoCo asks."""
    return 0.0


def step_costs(integrator: Integrator, rounds: int = ROUNDS) -> dict[str, float]:
    """Return CPU seconds a step of "helisim", "stock" and "stock, timers at rest"."""
    vehicle = hs.load("jr700", integrator=integrator)
    model = prepare(vehicle, hs.Sweep(axis="lat"), hs.Pilot(), hs.Weather(), seed=1, number=0)
    rows: dict[str, list[float]] = {"helisim": [], "stock": [], "stock, timers at rest": []}
    for _ in range(rounds):
        with installed():
            rows["helisim"].append(_cost(vehicle, model, height=20.0))
        rows["stock"].append(_cost(vehicle, model, height=1e6))
        mujoco.set_mjcb_time(resting.ctypes)
        rows["stock, timers at rest"].append(_cost(vehicle, model, height=1e6))
        mujoco.set_mjcb_time(None)
    return {name: min(costs) for name, costs in rows.items()}


def jsbsim_cost(rounds: int = ROUNDS) -> float | None:
    """Return CPU seconds a step of JSBSim's helicopter, its engine running; None without it."""
    try:
        import jsbsim
    except ImportError:
        return None
    fdm = jsbsim.FGFDMExec(jsbsim.get_default_root_dir())
    fdm.set_debug_level(0)
    fdm.load_model("ah1s")
    return min(_jsbsim_round(fdm) for _ in range(rounds))


def _jsbsim_round(fdm: Any) -> float:
    """Return CPU seconds a step from five seconds after each of ten starts: it soon falls."""
    spent, steps = 0.0, 600
    for _ in range(10):
        fdm["ic/h-agl-ft"] = 3000.0
        fdm.reset_to_initial_conditions(0)
        fdm["propulsion/set-running"] = -1
        fdm["fcs/throttle-cmd-norm"] = 0.6
        spent += _cpu(lambda: [fdm.run() for _ in range(steps)])
    return spent / (10 * steps)


def _cost(vehicle: hs.Vehicle, model: mujoco.MjModel, height: float) -> float:
    """Return CPU seconds a step; without callbacks the vehicle falls, so start it high."""
    data = mujoco.MjData(model)
    place(model, data, vehicle.trim, height=height)
    mujoco.mj_step(model, data, 500)
    return _cpu(lambda: mujoco.mj_step(model, data, STEPS)) / STEPS


def _cpu(work: Callable[[], Any]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


def main() -> None:
    """Print a line for each integrator, and JSBSim's."""
    jsbsim = jsbsim_cost()
    print(f"{'':18}{'us a step':>10}{'steps/s':>10}{'x stock':>9}{'x same timers':>15}", end="")
    print(f"{'steps/s over JSBSim':>21}")
    for integrator in ("RK4", "Euler"):
        cost = step_costs(integrator)
        ours = cost["helisim"]
        print(f"{'helisim, ' + integrator:18}{1e6 * ours:10.2f}{1.0 / ours:10.0f}", end="")
        print(f"{ours / cost['stock']:9.2f}{ours / cost['stock, timers at rest']:15.2f}", end="")
        print(f"{jsbsim / ours:21.2f}" if jsbsim else f"{'JSBSim not installed':>21}")
    if jsbsim:
        print(f"{'JSBSim, ah1s':18}{1e6 * jsbsim:10.2f}{1.0 / jsbsim:10.0f}")


if __name__ == "__main__":
    main()
