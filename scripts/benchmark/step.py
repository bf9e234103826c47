"""Cost of a time step beside stock MuJoCo's, and beside JSBSim's where that is installed.

All run in turn, several times, in this process; the least of each counts. The flight has rotor,
flapping, gyro, servos, pilot with sweep and remnant, and all sensors active. Stock MuJoCo steps the
same model with the same options and sensors, without callbacks: as it comes, and with its profiling
timers at rest, as they are while helisim's callbacks are installed. With all on, a motor turns the
rotor, the inflow is Pitt and Peters', the air is turbulent, and a ground below has its effect and
could be touched; stock MuJoCo then has that ground too. JSBSim's AH-1S hovers as in its own flight
test; its rotor has no states. What helisim's sensors write too is read after each step, or nothing.

    python scripts/benchmark/step.py [ROUNDS]
"""

import contextlib
import os
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

import mujoco
from numba import cfunc, types

import helisim as hs
from helisim.sim.flight import prepare
from helisim.vehicle.assembly import Integrator
from helisim.vehicle.trim import place

STEPS, ROUNDS, HOVER = 20_000, 7, 60.0  # HOVER: s, by which JSBSim's flight test hovers
INTEGRATORS: tuple[Integrator, ...] = ("RK4", "Euler")
ALL_ON = {"main_rotor.inflow": "pitt-peters", "drive.governor": "motor", "air.ground_effect": 1.0}
FLOWN = (*INTEGRATORS, *(f"{integrator}, all on" for integrator in INTEGRATORS))
READ, UNREAD = "JSBSim, outputs read", "JSBSim, nothing read"
OUTPUTS = (  # what helisim's sensors write too, as far as JSBSim has it
    *(f"velocities/{axis}-rad_sec" for axis in "pqr"),
    *(f"velocities/{axis}-fps" for axis in "uvw"),
    *(f"attitude/{name}-rad" for name in ("phi", "theta", "psi")),
    *(f"accelerations/n-pilot-{axis}-norm" for axis in "xyz"),
    *("position/lat-geod-rad", "position/long-gc-rad", "position/h-sl-ft"),
    *(f"fcs/{name}-cmd-norm" for name in ("elevator", "aileron", "rudder", "collective")),
    *("propulsion/engine/rotor-rpm", "propulsion/engine/thrust-lbs", "simulation/sim-time-sec"),
)


def step_costs(rounds: int = ROUNDS) -> dict[str, float]:
    """Return the least time of a step, s, of some rounds of everything in turn."""
    works: dict[str, Callable[[], float]] = {}
    sweep, ground = hs.Sweep(axis="lat"), hs.Ground()
    rough = {"weather": hs.Weather(turbulence="light"), "ground": ground}
    for integrator in INTEGRATORS:
        vehicle = hs.load("jr700", integrator=integrator)
        model = prepare(vehicle, hs.FlightPlan(excitation=sweep), seed=1, number=0)
        works |= _of_ours(integrator, vehicle, model)
        vehicle = hs.load("jr700", integrator=integrator, parameters=ALL_ON)
        below = vehicle.grounded_model(ground.put_into)
        plan = hs.FlightPlan(excitation=sweep, **rough)
        model = prepare(vehicle, plan, seed=1, number=0, model=below)
        works |= _of_ours(f"{integrator}, all on", vehicle, model)
    with contextlib.suppress(ImportError):
        helicopter = ah1s()
        works[READ] = lambda: ah1s_cost(helicopter, OUTPUTS)
        works[UNREAD] = lambda: ah1s_cost(helicopter, ())
    found = [{name: work() for name, work in works.items()} for _ in range(rounds)]
    return {name: min(one[name] for one in found) for name in works}


def _of_ours(
    name: str, vehicle: hs.Vehicle, model: mujoco.MjModel
) -> dict[str, Callable[[], float]]:
    def cost(height: float) -> float:
        data = mujoco.MjData(model)
        place(model, data, vehicle.trim, height=height)
        mujoco.mj_step(model, data, 500)
        start = time.process_time()
        mujoco.mj_step(model, data, STEPS)
        return (time.process_time() - start) / STEPS

    def ours() -> float:
        with hs.installed():
            return cost(20.0)

    def untimed() -> float:
        resting = cfunc(types.float64())(lambda: 0.0)  # kept while MuJoCo calls it
        mujoco.set_mjcb_time(resting.ctypes)
        try:
            return cost(1e6)
        finally:
            mujoco.set_mjcb_time(None)

    return {
        f"helisim, {name}": ours,
        f"stock, {name}": lambda: cost(1e6),  # it falls, so start it high
        f"stock, timers at rest, {name}": untimed,
    }


def ah1s() -> Any:
    import jsbsim

    with _silence():
        simulation = jsbsim.FGFDMExec(None)
        simulation.set_debug_level(0)
        simulation.load_script("scripts/ah1s_flight_test.xml")
        simulation.run_ic()
        while simulation["simulation/sim-time-sec"] < HOVER:
            simulation.run()
    height = simulation["position/h-agl-ft"]
    if not 20.0 < height < 150.0:
        raise RuntimeError(f"JSBSim's helicopter should hover, and is {height:.0f} ft high")
    return simulation


def ah1s_cost(simulation: Any, outputs: tuple[str, ...]) -> float:
    with _silence():
        start = time.process_time()
        for _ in range(STEPS):
            simulation.run()
            for name in outputs:
                simulation[name]
        return (time.process_time() - start) / STEPS


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    sys.stdout.flush()
    kept = os.dup(1)
    with open(os.devnull, "w") as nothing:
        os.dup2(nothing.fileno(), 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


def main(rounds: int = ROUNDS) -> None:
    cost = step_costs(rounds)
    peers = [name for name in (READ, UNREAD) if name in cost]
    print(f"{'':22}{'us a step':>10}{'steps/s':>9}{'x stock':>9}{'x same timers':>15}", end="")
    print(f"{'times as fast as JSBSim, read / unread':>41}" if peers else "")
    for flown in FLOWN:
        ours = cost[f"helisim, {flown}"]
        print(
            f"{'helisim, ' + flown:22}{1e6 * ours:10.2f}{1.0 / ours:9.0f}"
            f"{ours / cost[f'stock, {flown}']:9.2f}"
            f"{ours / cost[f'stock, timers at rest, {flown}']:15.2f}"
            f"{' / '.join(f'{cost[name] / ours:.2f}' for name in peers):>41}"
        )
    for name in peers:
        print(f"{name:22}{1e6 * cost[name]:10.2f}{1.0 / cost[name]:9.0f}")
    if not peers:
        print("JSBSim is not installed: pip install -e '.[benchmark]'")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
