"""Energy of whole flights: what motor, height, speed and wind give, and what the air gets.

Then what a supply does: the JR700's battery in a heave sweep, and the Lynx's turbines, whose rotor
droops in a pull of collective, on a stand, from no torque to the hover's within half a second. A
UH-60's fell "to less than 95 % rotor speed during collective pulls from zero torque" (AD-A140882,
1983). The flights and how their energy is summed: tests/verification/energy.py.

    python scripts/proof/energy_balance.py
"""

import sys
from pathlib import Path

import common
import mujoco
import numpy as np

sys.path.extend(str(Path(__file__).parents[2] / "tests" / one) for one in ("", "verification"))
import energy

import helisim as hs
from helisim.physics.layout import PARAM, STATE
from helisim.sim.flight import simulate
from helisim.vehicle.addresses import addresses


def main() -> None:
    vehicle, rows = hs.load("jr700", parameters={"drive.governor": "motor"}), []
    for name in energy.FLIGHTS:
        found, end = energy.flown(vehicle, name)
        missing = float(np.abs(found.missing[:end]).max())
        given = found.delivered[-1], found.stored[0] - found.stored[-1], found.wind[-1]
        legs = found.missing[end - 1] - found.missing[-1]
        share = f"   {missing / found.turned_over:.1e}"
        rows.append((name, *given, found.lost[-1], missing, legs, share))
    heads = ("motor", "stored", "wind", "heat", "missing", "legs")
    common.table("|".join(["J:<30", *(f"{one}:10.1f" for one in heads), "   of heat:<10"]), rows)
    for left in (1.0, 0.2):
        fed = {"drive.governor": "motor", "drive.supply": "battery", "battery.charge": left}
        vehicle = hs.load("jr700", parameters=fed)
        flown = simulate(vehicle, hs.FlightPlan(**energy.FLIGHTS["heave sweep"]), seed=1)
        volts, amperes, charge, _ = next(flown).battery.T
        taken = vehicle.parameters["battery.capacity"] * (charge[0] - charge[-1])
        missing = 1.0 - np.trapezoid(amperes, dx=vehicle.model.opt.timestep) / taken
        print(
            f"battery at {left:.0%}: throttle {vehicle.trim.throttle:.3f}, {volts.min():.1f} to "
            f"{volts.max():.1f} V, {taken:.0f} C, {abs(missing):.0e} more than the current's"
        )
    idle, speeds = droop()
    print(f"Lynx: from {idle:.3f} to {speeds.min():.3f}, at last {speeds[-1]:.3f} (UH-60: < 0.95)")


def droop() -> tuple[float, np.ndarray]:
    """Return the Lynx's rotor speed on a stand, without a load and in a pull of collective."""
    vehicle = hs.load("lynx", parameters={"drive.governor": "motor"})
    data, own, model = vehicle.hovering(), addresses(vehicle.model), vehicle.model
    model.opt.gravity[:], model.body_mass[:] = 0.0, 1e6 * model.body_mass
    model.body_inertia[:], par = 1e6 * model.body_inertia, model.actuator_user[own.rotor]
    par[PARAM.gyro_on], data.qvel[:], speeds = 0.0, 0.0, []
    act, flat = data.act[own.state :], -par[PARAM.main_pitch_trim] / par[PARAM.main_pitch_range]
    idle = 1.0 + par[PARAM.drive_droop] * vehicle.trim.throttle
    act[STATE.speed], act[STATE.engine], act[STATE.fuel] = idle, 0.0, 0.0
    with hs.installed():
        while data.time < 20.0:
            col = flat + min(1.0, 2.0 * data.time) * (vehicle.trim.col - flat)
            data.ctrl[own.control + 4 : own.control + 7] = vehicle.swashplate.mix(col, 0.0, 0.0)
            mujoco.mj_step(model, data)
            speeds.append(act[STATE.speed])
    return idle, np.array(speeds)


if __name__ == "__main__":
    common.run(main)
