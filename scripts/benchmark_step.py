"""Cost of a time step beside stock MuJoCo stepping the same model without callbacks.

Both run in turn, several times, in this process; the best of each counts. The flight has
rotor, flapping, gyro, servos, pilot with sweep and remnant, and all sensors active.
"""

import time

import mujoco

from helisim.physics.native import installed
from helisim.sim import Pilot, Sweep
from helisim.sim.fly import prepare
from helisim.vehicle import Vehicle, load
from helisim.vehicle.trim import place

STEPS = 20_000
ROUNDS = 7


def costs(vehicle: Vehicle, model: mujoco.MjModel) -> tuple[float, float]:
    """Return CPU seconds a step of helisim, and of stock MuJoCo with the same model."""
    ours, stock = [], []
    for _ in range(ROUNDS):
        stock.append(_cost(vehicle, model, height=1e6))
        with installed():
            ours.append(_cost(vehicle, model, height=20.0))
    return min(ours), min(stock)


def flying(vehicle: Vehicle) -> mujoco.MjModel:
    """Return the model with a pilot who sweeps."""
    return prepare(vehicle, Sweep(axis="lat"), Pilot(), seed=1, number=0)


def main() -> None:
    """Print microseconds a step, their ratio, and simulated seconds per CPU second."""
    vehicle = load("jr700")
    model = flying(vehicle)
    best, base = costs(vehicle, model)
    print(
        f"model         {model.nv} degrees of freedom, {model.na} activations, RK4, "
        f"{1e3 * model.opt.timestep:g} ms"
    )
    print(f"stock MuJoCo  {1e6 * base:6.2f} us a step")
    print(f"helisim       {1e6 * best:6.2f} us a step")
    print(f"ratio         {best / base:6.2f}")
    print(f"speed         {model.opt.timestep / best:6.0f} simulated seconds per CPU second")


def _cost(vehicle: Vehicle, model: mujoco.MjModel, height: float) -> float:
    """Return CPU seconds a step; without callbacks the vehicle falls, so start it high."""
    data = mujoco.MjData(model)
    place(model, data, vehicle.trim, height=height)
    mujoco.mj_step(model, data, 500)
    start = time.process_time()
    mujoco.mj_step(model, data, STEPS)
    return (time.process_time() - start) / STEPS


if __name__ == "__main__":
    main()
