"""Fly a yaw law of your own, with the shipped cyclic: in Python, compiled, and as a linear model.

    ped = k_p e + k_i int(e) dt,  e = k_delta PED - k_a r

python scripts/own_controller.py [K_P ...]
"""

import sys
import time

import numba
import numpy as np

import helisim as hs


def yaw(seen, state, settings):
    """Return the tail servo's command; the state is the integral of the error."""
    k_p, k_i, k_delta, k_a, period = settings
    error = k_delta * seen.PED - k_a * seen.r
    command = k_p * error + k_i * state[0]
    if abs(command) < 0.5 or error * command < 0.0:  # else it would wind up
        state[0] += period * error
    return min(0.5, max(-0.5, command))


def start(seen, state, settings):
    """Begin with the integral that holds the tail servo where it stands."""
    state[0] = seen.tail / settings[1]


def main(*gains: float) -> None:
    """Print, for each k_p, the loop's sensitivity, and the error of a doublet's yaw rate."""
    vehicle, doublet = hs.load("jr700"), hs.Doublet(axis="ped")
    yaw_native, start_native = numba.njit(yaw), numba.njit(start)
    for k_p in gains or (0.3, 0.5):
        settings = [k_p, 10.0, 2.68, 0.2941, vehicle.parameters["gyro.period"]]
        law = hs.Controller(tail=yaw_native, reset=start_native, states=1, settings=settings)
        own = vehicle.with_controller(law)
        loop = own.loop("ped")
        point = np.exp(1j * np.geomspace(1.0, 300.0, 300) * loop.dt)
        peak = np.abs(1.0 / (1.0 - loop(point, squeeze=True))).max()
        (record,) = hs.fly(own, doublet, seed=1)
        error = record["r"] - 2.68 / 0.2941 * record["PED"]
        print(f"k_p {k_p:.2f}: peak sensitivity {peak:.2f}, rate error {error.std():.4f} rad/s")
        python = hs.Controller(tail=yaw, reset=start, states=1, settings=settings)
        begun = time.process_time()
        (again,) = hs.fly(vehicle, doublet, seed=1, controller=python)
        spent = time.process_time() - begun
        same = np.array_equal(again.values, record.values)
        rate = record.duration / vehicle.parameters["gyro.period"] / spent
        print(f"  in Python the same flight: {same}, {rate / 1e3:.0f} thousand ticks a second")


if __name__ == "__main__":
    main(*map(float, sys.argv[1:]))
