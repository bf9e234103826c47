"""Tune a gyro to a rate command: sticks that ask for a rate, and get it as fast as is safe.

For a vehicle of which nothing is published from the sticks. The response wanted of each axis is
k w_b / (s + w_b) with a delay, without coupling; the search brings the exact linear model near it
while the sensitivity |1 / (1 + L)| of each loop stays under a peak, which keeps its margins:
a phase margin of 2 asin(1 / (2 M_S)) and a gain margin of M_S / (M_S - 1) at least.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from helisim.base.errors import ModelError
from helisim.vehicle.parameters import Parameters, PhysicalParameter
from helisim.vehicle.vehicle import Vehicle

_POINTS = 40
_STEPS = 60
_PHASE = "gyro.phase"
_USUAL = 8.0
"""rad/s, of a small helicopter; gains of a rate have its dimension, so others' are scaled by it."""
_STIFFNESS = 10.0
"""Weight of sensitivity above its peak against the relative error of the response."""
_REACH = 0.01
"""By how much the sensitivity's peak may be missed: less than 0.1 dB of gain margin."""


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
STARTS = {**_YAW_STARTS, **_CYCLIC_STARTS}
"""Setting that is solved for -> where the search starts for a usual helicopter, SI."""


@dataclass(frozen=True, kw_only=True)
class Search:
    """The aim of a search, on some axes.

    Attributes:
        sticks: inputs of the response, IN2.
        rates: outputs of the response, in the sticks' order.
        gains: stick's unit to rad/s, the wanted steady response of each axis.
        loops: servo commands at which the sensitivity is judged, IN1.
        bandwidth: rad/s, w_b.
        starts: setting -> where the search starts, SI.
    """

    sticks: tuple[str, ...]
    rates: tuple[str, ...]
    gains: tuple[float, ...]
    loops: tuple[str, ...]
    bandwidth: float
    starts: dict[str, float]


def tune_rate_command(vehicle: Vehicle) -> Parameters:
    """Return the gyro's settings that make a vehicle's sticks command rates.

    The vehicle's parameters state what is wanted: `tuning.cyclic_bandwidth` and
    `tuning.yaw_bandwidth` (rad/s), `tuning.peak_sensitivity`, and the sticks' ranges
    (`gyro.p_per_lat`, `gyro.q_per_lon`, `gyro.k_delta` over `gyro.k_a`).

    Raises:
        UnknownNameError: one of those is missing.
        ModelError: no settings keep the sensitivity below its peak.
    """
    own = vehicle.parameters
    yaw = Search(
        sticks=("PED",),
        rates=("r",),
        gains=(own["gyro.k_delta"] / own["gyro.k_a"],),
        loops=("ped",),
        bandwidth=own["tuning.yaw_bandwidth"],
        starts=_YAW_STARTS,
    )
    cyclic = Search(
        sticks=("LAT", "LON"),
        rates=("p", "q"),
        gains=(own["gyro.p_per_lat"], own["gyro.q_per_lon"]),
        loops=("lat", "lon"),
        bandwidth=own["tuning.cyclic_bandwidth"],
        starts=_cyclic_starts(own),
    )
    peak = own["tuning.peak_sensitivity"]
    settings = {**yaw.starts, **cyclic.starts}
    for search in (yaw, cyclic):  # whatever the vehicle was tuned to before
        settings |= _solve(vehicle.with_settings(settings), search, peak)
    source = "solved by helisim tune: rate command, peak sensitivity"
    return Parameters(
        {
            name: PhysicalParameter(name, value, own.entry(name).unit, source)
            for name, value in settings.items()
        }
    )


def _cyclic_starts(own: Parameters) -> dict[str, float]:
    """Return where the search starts, by the bandwidth wanted and the way the rotor turns."""
    slow = _USUAL / own["tuning.cyclic_bandwidth"]
    scales = {"s/rad": slow, "s^2/rad": slow**2, "rad": own["main_rotor.direction"]}
    return {
        name: start * scales.get(own.entry(name).unit, 1.0)
        for name, start in _CYCLIC_STARTS.items()
    }


def sensitivity(vehicle: Vehicle, axis: str, omega: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return |1 / (1 + L)| of the gyro's loop at one servo command, others closed, (n_freq,).

    vehicle: trimmed; axis: of the servo command, such as "lat"; omega: rad/s, (n_freq,).
    """
    loop = vehicle.loop(axis)
    a, b, c, d = (np.asarray(getattr(loop, name)) for name in "ABCD")
    point = np.exp(1j * omega * loop.dt)[:, None, None]
    positive = (c @ np.linalg.solve(point * np.eye(len(a)) - a, b) + d)[:, 0, 0]
    return np.abs(1.0 / (1.0 - positive))


def _solve(vehicle: Vehicle, search: Search, peak: float) -> dict[str, float]:
    names, starts = list(search.starts), np.array(list(search.starts.values()))
    omega = np.geomspace(0.1 * search.bandwidth, 4.0 * search.bandwidth, _POINTS)
    wide = np.geomspace(0.3, 0.99 * np.pi / vehicle.parameters["gyro.period"], 4 * _POINTS)

    turns = np.array([name == _PHASE for name in names])

    def setting(x: NDArray[np.float64]) -> dict[str, float]:
        # a gain never changes its sign, the phase may
        return dict(zip(names, (starts * np.where(turns, x[:-1], np.abs(x[:-1]))).tolist()))

    def unsafe(tried: Vehicle) -> NDArray[np.float64]:
        felt = [sensitivity(tried, axis, wide) for axis in search.loops]
        return np.maximum(0.0, np.concatenate(felt) - peak)

    def far(x: NDArray[np.float64]) -> NDArray[np.float64]:
        tried = vehicle.with_settings(setting(x))
        error = _error(tried, search, omega, delay=0.01 * x[-1]).ravel() / np.sqrt(_POINTS)
        return np.concatenate([error.real, error.imag, _STIFFNESS * unsafe(tried)])

    found = least_squares(far, np.ones(len(names) + 1), max_nfev=_STEPS).x
    over = float(np.max(unsafe(vehicle.with_settings(setting(found)))))
    if over > _REACH:
        raise ModelError(
            f"no gyro settings keep the sensitivity of {', '.join(search.loops)} below {peak:g}: "
            f"{peak + over:.2f} is left; ask for less bandwidth than {search.bandwidth:g} rad/s "
            "or a higher peak"
        )
    return setting(found)


def _error(
    vehicle: Vehicle, search: Search, omega: NDArray[np.float64], *, delay: float
) -> NDArray[np.complex128]:
    """Return the response's error, relative to what is wanted of each rate's own stick."""
    linear = vehicle.linearize("IN2")
    rows = [linear.system.output_labels.index(name) for name in search.rates]
    columns = [linear.system.input_labels.index(name) for name in search.sticks]
    wanted = search.bandwidth / (1j * omega + search.bandwidth) * np.exp(-1j * delay * omega)
    ratio = linear.response(omega)[np.ix_(rows, columns)] / wanted
    return ratio / np.array(search.gains)[:, None, None] - np.eye(len(rows))[:, :, None]
