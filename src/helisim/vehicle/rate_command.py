"""Tune a gyro to a rate command, k w_b / (s + w_b) with a delay on each axis, without coupling.

With sensitivity peak M_S, phase margin is 2 asin(1 / (2 M_S)), gain margin M_S / (M_S - 1).
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from helisim.base.errors import ModelError
from helisim.vehicle.parameters import Parameters, solved
from helisim.vehicle.vehicle import Vehicle

_POINTS, _STEPS = 40, 60
_PHASE = "gyro.phase"
_USUAL = 8.0  # rad/s, of a small helicopter; starts of gains are scaled by it
_STIFFNESS = 10.0  # weight of sensitivity above its peak against response error
_REACH = 0.01  # allowed excess of the sensitivity's peak: under 0.1 dB of gain margin

_YAW_STARTS = {"gyro.k_p": 0.1, "gyro.k_i": 0.3}
_CYCLIC_STARTS = {
    "gyro.kp_lat": 0.05,
    "gyro.kp_lon": 0.05,
    "gyro.ki_lat": 1.0,
    "gyro.ki_lon": 1.0,
    "gyro.kd_lat": 0.001,
    "gyro.kd_lon": 0.001,
    _PHASE: 0.3,
}
STARTS = {**_YAW_STARTS, **_CYCLIC_STARTS}  # setting -> start, SI
_RATE = {"lat": "p", "lon": "q", "ped": "r"}


def tune_rate_command(vehicle: Vehicle) -> Parameters:
    """Return the gyro's settings that make a vehicle's sticks command rates.

    Wanted: `tuning.*` (bandwidths in rad/s), `gyro.p_per_lat`, `gyro.q_per_lon`, `gyro.k_delta`
    over `gyro.k_a`. UnknownNameError: one is missing; ModelError: the peak can't be kept.
    """
    own = vehicle.parameters
    starts = {"yaw": _YAW_STARTS, "cyclic": _cyclic_starts(own)}
    gains = {
        "yaw": {"ped": own["gyro.k_delta"] / own["gyro.k_a"]},
        "cyclic": {"lat": own["gyro.p_per_lat"], "lon": own["gyro.q_per_lon"]},
    }
    settings = {**starts["yaw"], **starts["cyclic"]}
    for axes in starts:  # whatever the vehicle was tuned to before
        bandwidth = own[f"tuning.{axes}_bandwidth"]
        settings |= _solve(vehicle.with_settings(settings), gains[axes], bandwidth, starts[axes])
    return solved(settings, own, "solved by helisim tune: rate command, peak sensitivity")


def _cyclic_starts(own: Parameters) -> dict[str, float]:
    slow = _USUAL / own["tuning.cyclic_bandwidth"]
    scales = {"s/rad": slow, "s^2/rad": slow**2, "rad": own["main_rotor.direction"]}
    return {
        name: start * scales.get(own.entry(name).unit, 1.0)
        for name, start in _CYCLIC_STARTS.items()
    }


def sensitivity(vehicle: Vehicle, axis: str, omega: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return |1 / (1 + L)| at a servo command, other loops closed; omega: rad/s; (n_freq,) each."""
    return np.abs(1.0 / (1.0 - vehicle.cut(axis).response(omega)[0, 0]))


def _solve(
    vehicle: Vehicle, gains: Mapping[str, float], bandwidth: float, starts: Mapping[str, float]
) -> dict[str, float]:
    """Return settings for steady gains, rad/s per unit of each stick, and a bandwidth, rad/s."""
    names, first = list(starts), np.array(list(starts.values()))
    omega = np.geomspace(0.1 * bandwidth, 4.0 * bandwidth, _POINTS)
    wide = np.geomspace(0.3, 0.99 * np.pi / vehicle.parameters["gyro.period"], 4 * _POINTS)
    peak = vehicle.parameters["tuning.peak_sensitivity"]
    turns = np.array([name == _PHASE for name in names])

    def setting(x: NDArray[np.float64]) -> dict[str, float]:
        # a gain never changes its sign, the phase may
        return dict(zip(names, (first * np.where(turns, x[:-1], np.abs(x[:-1]))).tolist()))

    def unsafe(tried: Vehicle) -> NDArray[np.float64]:
        felt = [sensitivity(tried, axis, wide) for axis in gains]
        return np.maximum(0.0, np.concatenate(felt) - peak)

    def far(x: NDArray[np.float64]) -> NDArray[np.float64]:
        tried = vehicle.with_settings(setting(x))
        error = _error(tried, gains, bandwidth, omega, delay=0.01 * x[-1]) / np.sqrt(_POINTS)
        return np.concatenate([error.real, error.imag, _STIFFNESS * unsafe(tried)])

    found = least_squares(far, np.ones(len(names) + 1), max_nfev=_STEPS).x
    over = float(np.max(unsafe(vehicle.with_settings(setting(found)))))
    if over > _REACH:
        raise ModelError(
            f"no gyro settings keep the sensitivity of {', '.join(gains)} below {peak:g}: "
            f"{peak + over:.2f} is left; ask for less bandwidth than {bandwidth:g} rad/s "
            "or a higher peak"
        )
    return setting(found)


def _error(
    vehicle: Vehicle,
    gains: Mapping[str, float],
    bandwidth: float,
    omega: NDArray[np.float64],
    *,
    delay: float,
) -> NDArray[np.complex128]:
    sticks, rates = [one.upper() for one in gains], [_RATE[one] for one in gains]
    found = vehicle.linearize("IN2").select(sticks, rates).response(omega)
    wanted = bandwidth / (1j * omega + bandwidth) * np.exp(-1j * delay * omega)
    ratio = found / wanted / np.array(list(gains.values()))[:, None, None]
    return (ratio - np.eye(len(rates))[:, :, None]).ravel()
