"""A manoeuvre as numbers: what is added to a vehicle's signals at each step of a flight."""

import hashlib
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from helisim.base.errors import InputError
from helisim.physics.layout import INJECTION
from helisim.records.channels import AXES, RATES
from helisim.sim.excitation import PLACES, Excitation, is_compiled, limit
from helisim.vehicle import Vehicle

_FIRST = {
    "sticks": INJECTION.stick_col,
    "servos": INJECTION.command_front,
    "actuators": INJECTION.actuator_front,
    "sensors": INJECTION.rate_p,
}
"""Where the numbers of a place begin."""


def injection(excitation: Excitation, vehicle: Vehicle) -> NDArray[np.float64] | None:
    """Return what an excitation adds at each step of a flight, (n_step, n_injection), read-only.

    The columns are those of `INJECTION`. What servos, actuators and sensors get is held between
    the gyro's ticks, as the commands are. None: the force laws compute it themselves.

    Raises:
        InputError: the class returns something else than such values.
    """
    if is_compiled(excitation):
        return None
    mixing = tuple(tuple(map(float, vehicle.swashplate.mix(*unit))) for unit in np.eye(3))
    timestep = float(vehicle.model.opt.timestep)
    return _injection(excitation, timestep, vehicle.parameters["gyro.period"], mixing)


@lru_cache(maxsize=4)
def _injection(
    excitation: Excitation,
    timestep: float,
    period: float,
    mixing: tuple[tuple[float, ...], ...],
) -> NDArray[np.float64]:
    time = step_times(excitation.duration, timestep)
    each = max(1, round(period / timestep))
    ticks = np.arange(time.size) // each * each
    rows = np.zeros((time.size, len(INJECTION)))
    for place, columns in excitation.added(time).items():
        values = columns if place == "sticks" else columns[ticks]
        if place in ("servos", "actuators"):  # the four servos' own, and what is mixed for them
            mixed, values = values[:, : len(AXES)], values[:, len(AXES) :].copy()
            values[:, :3] += mixed[:, :3] @ np.array(mixing)
            values[:, 3] += mixed[:, 3]
        elif place == "sensors":
            values = _turned(values, time, each)
        rows[:, _FIRST[place] : _FIRST[place] + values.shape[1]] = values
        _check_total(excitation, place, values, time)
    rows.setflags(write=False)
    return rows


def _turned(
    columns: NDArray[np.float64], time: NDArray[np.float64], each: int
) -> NDArray[np.float64]:
    """Return what is added to rates and angles, (n_time, 6), an angle's own rate in the rates.

    That is the derivative of a cubic spline through the angle at the ticks: of an oscillation w
    sampled with period T it is off by (w T)^4 / 180, 1e-6 at 60 rad/s and 500 Hz.
    """
    angles = columns[::each, len(RATES) :]
    moved = angles.any(axis=0)
    if not moved.any() or len(angles) < 2:
        return columns
    rates, turned = np.zeros_like(angles), columns.copy()
    rates[:, moved] = CubicSpline(time[::each], angles[:, moved])(time[::each], 1)
    turned[:, : len(RATES)] += np.repeat(rates, each, axis=0)[: len(columns)]
    return turned


def _check_total(
    excitation: Excitation, place: str, values: NDArray[np.float64], time: NDArray[np.float64]
) -> None:
    """Refuse what several parts add up to beyond the range."""
    servos = place in ("servos", "actuators")
    axes = PLACES[place][len(AXES) :] if servos else PLACES[place]
    # of one servo twice its range: collective and cyclic both at their ends
    most = np.array([limit(place, axis) * (1.0 + servos) for axis in axes])
    bad = ~(np.abs(values) <= most)
    if bad.any():
        row, column = np.argwhere(bad)[0]
        turns = place == "sensors" and values[:, len(RATES) :].any()
        why = "; a disturbance of an attitude adds its own rate too" if turns else ""
        raise InputError(
            f"what {type(excitation).__name__} adds at {place} comes to "
            f"{values[row, column]:g} at {time[row]:g} s, beyond {most[column]:g}{why}"
        )


def step_times(duration: float, timestep: float) -> NDArray[np.float64]:
    """Return the times at which the steps of a flight begin, (n_step,) s.

    They are added up as MuJoCo does, so that they equal its own to the last bit.
    """
    steps = round(duration / timestep)
    return np.concatenate([[0.0], np.cumsum(np.full(steps, timestep))])


def injection_digest(excitation: Excitation, vehicle: Vehicle) -> str | None:
    """Return a digest of what an excitation adds; None where the force laws compute it.

    A record keeps a class's name and settings, not its code: this shows whether the code that
    is at hand still flies the same. Arguments and errors are those of `injection`.
    """
    rows = injection(excitation, vehicle)
    if rows is None:
        return None
    if excitation.places == ("sticks",):
        rows = rows[:, : len(PLACES["sticks"])]
    elif not rows[:, INJECTION.angle_phi :].any():
        rows = rows[:, : INJECTION.angle_phi]  # as it was before attitudes could be disturbed
    return hashlib.blake2b(rows.astype("<f8").tobytes(), digest_size=16).hexdigest()
