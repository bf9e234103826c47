"""The exact loop of a vehicle with its law: the sampled linearisation."""

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.polynomial.hermite_e import hermegauss

from helisim.base.arrays import Real
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.loop import GRID
from helisim.sim import Weather
from helisim.vehicle import Vehicle
from helisim.vehicle.sampled import sensed_base

Air = tuple[tuple[float, Vehicle], ...]
"""Shares of the time, which sum to 1, with a vehicle trimmed in the wind of each."""


def exact_loop(vehicle: Vehicle, frequency: Sequence[float] | Real | None = None) -> ClosedLoop:
    """Return the exact linear loop of a vehicle with its controller, sampled at the gyro's ticks.

    At (n_freq,) rad/s, without the pilot. Raises InputError if no law moves a servo, ModelError if
    the law can't hold the trim, or the gyro's latency is no whole number of ticks.
    """
    gyro = vehicle.gyro
    sensed = sensed_base(vehicle.linearize("IN1"), gyro, imu=vehicle.imu_offset)
    airframe = sensed.select(outputs=[name for name in sensed.outputs if " " not in name])
    airframe = replace(airframe, d=0.0 * airframe.d)
    pedal = {name: late for name, late in gyro.delays.items() if name == "PED"}
    law = replace(gyro, delays=pedal).with_delays_as_states()
    return ClosedLoop(airframe, law, np.asarray(GRID if frequency is None else frequency, float))


def hands_off(vehicle: Vehicle) -> Vehicle:
    """Return the vehicle with a pilot who moves only the collective, to keep the height."""
    return vehicle.with_settings({"pilot.k_attitude": 0.0, "pilot.k_heading": 0.0})


def air_met(vehicle: Vehicle, weather: Weather, points: tuple[int, int, int] = (3, 7, 3)) -> Air:
    """Return a vehicle trimmed in the winds that it meets: one if there is no turbulence.

    Gauss-Hermite quadrature over steady winds of the turbulence's rms, by `points` along the path,
    across and down: 3 across miss 6 % of the JR700's mean N_r (7: 1 %), 3 down
    miss 3 % of Z_w. Raises TrimError.
    """
    dryden = weather.dryden
    if dryden is None:
        return ((1.0, weather.trimmed(vehicle)),)
    rules = [hermegauss(count) for count in points]
    cosine, sine = np.cos(dryden.heading), np.sin(dryden.heading)
    path_to_earth = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    air = []
    for at in itertools.product(*map(range, points)):
        picked = [(nodes[k], weights[k] / weights.sum()) for (nodes, weights), k in zip(rules, at)]
        gust = path_to_earth @ (np.array(dryden.rms) * [node for node, _ in picked])
        wind = tuple(np.array(weather.wind_to) + gust)
        share = float(np.prod([weight for _, weight in picked]))
        air.append((share, vehicle.trimmed(height=weather.height, wind=wind)))
    return tuple(air)
