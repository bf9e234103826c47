"""NASA/NESC atmospheric check cases 1 to 3, flown by the model that flies the helicopter.

NASA/TM-2015-218675: a sphere and a brick dropped from 30000 ft over the equator of a rotating
WGS-84 earth with J2. The helicopter's own compiled model (its integrator, time step, options,
free joint and instruments) is given their mass and inertia and stopped rotors. helisim's earth
is flat and still, so the cases are flown in inertial axes: north, west and up of the start, in a
frame that keeps the start's velocity (far from the origin and fast, positions round off). What
helisim has no law for (gravitation that falls off, the brick's damping) comes through the same
hook of MuJoCo as its air loads. The earth's turn enters only when positions, velocities and
angles are read out.
"""

import copy
import csv
import math
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.physics.layout import PARAM
from helisim.physics.motion import flip
from helisim.vehicle import Vehicle
from helisim.vehicle.addresses import addresses

DIGITS = Path(__file__).with_name("nesc_sim04.csv")

FOOT = 0.3048
SLUG = 0.45359237 * 9.80665 / FOOT
"""kg, from the pound and the standard gravity."""
# Table 73 of the report
EQUATOR = 6378137.0
MU = 3.986004418e14
J2 = 0.00108262982
SPIN = 7.292115e-5
START = 30000.0 * FOOT
"""m of altitude; the report's tables say 0 for the brick, its text and data 30000 ft."""


@dataclass(frozen=True)
class Body:
    """What falls: kg, kg m^2, rad/s inertial, and whether the air damps its rotation."""

    mass: float
    inertia: tuple[float, float, float]
    rates: tuple[float, float, float]
    damped: bool = False


_BRICK = tuple(moment * SLUG * FOOT**2 for moment in (0.001894220, 0.006211019, 0.007194665))
_TURN = tuple(math.radians(rate) for rate in (10.0, 20.0, 30.0))
CASES = {
    1: Body(SLUG, (3.6 * SLUG * FOOT**2,) * 3, (0.0, 0.0, 0.0)),
    2: Body(0.155404754 * SLUG, _BRICK, _TURN),
    3: Body(0.155404754 * SLUG, _BRICK, _TURN, damped=True),
}
# Table 5: a brick of 8 by 4 inches (printed 0.22222, 0.33333 and 0.66667); coefficients of -1
_AREA, _SPAN, _CHORD = 2.0 / 9.0 * FOOT**2, FOOT / 3.0, 2.0 * FOOT / 3.0
_SLOWEST = 0.5 * FOOT
"""m/s by which the damping's rates are divided at least (brick_aero.dml)."""

COLUMNS = ("altitude", "v_east", "v_down", "yaw", "pitch", "roll", "p", "q", "r")


def digits(case: int) -> dict[float, NDArray[np.float64]]:
    """Return the report's digits, time -> COLUMNS, feet and degrees."""
    lines = [line for line in DIGITS.read_text().splitlines() if not line.startswith("#")]
    rows = [row for row in csv.DictReader(lines) if int(row["case"]) == case]
    return {float(row["time"]): np.array([float(row[name]) for name in COLUMNS]) for row in rows}


def air_density(altitude: float) -> float:
    """Return the U.S. Standard Atmosphere 1976 below 11 km, kg/m^3."""
    geopotential = 6356766.0 * altitude / (6356766.0 + altitude)
    temperature = 288.15 - 0.0065 * geopotential
    gas = 8314.32 / 28.9644
    pressure = 101325.0 * (temperature / 288.15) ** (9.80665 / (gas * 0.0065))
    return pressure / (gas * temperature)


def gravitation(up: float, east: float) -> tuple[float, float]:
    """Return the acceleration outwards and eastwards at a place in the equator's plane, m/s^2."""
    square = up**2 + east**2
    pull = -MU / square**1.5 * (1.0 + 1.5 * J2 * EQUATOR**2 / square)
    return pull * up, pull * east


def drop(
    vehicle: Vehicle, case: int, times: list[float], *, timestep: float | None = None
) -> NDArray[np.float64]:
    """Return COLUMNS at each time, (n, 9), feet and degrees, of a body dropped in place of ours."""
    body = CASES[case]
    model = _replaced(vehicle, body)
    model.opt.timestep = timestep or model.opt.timestep
    data = mujoco.MjData(model)
    data.qpos[:7] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
    data.qvel[3:6] = flip(*body.rates)
    rows = []
    mujoco.set_mjcb_passive(lambda _, now: _add_loads(now, body))
    try:
        for time in times:
            while data.time < time - 0.5 * model.opt.timestep:
                mujoco.mj_step(model, data)
            rows.append(_seen(data))
    finally:
        mujoco.set_mjcb_passive(None)
    return np.array(rows)


def _replaced(vehicle: Vehicle, body: Body) -> mujoco.MjModel:
    model = copy.copy(vehicle.model)
    falling = model.body(vehicle.name).id
    model.body_mass[falling] = body.mass
    model.body_inertia[falling] = body.inertia
    model.body_ipos[falling], model.body_iquat[falling] = 0.0, [1.0, 0.0, 0.0, 0.0]
    model.actuator_user[addresses(model).rotor, PARAM.gyro_on] = 0.0
    model.opt.gravity[:] = 0.0
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


_EASTWARDS = SPIN * (EQUATOR + START)
"""m/s of the frame, and of the body at the start."""


def _place(data: mujoco.MjData) -> tuple[float, float]:
    """Return how far up and east of the earth's centre the body is, m."""
    return EQUATOR + START + float(data.qpos[2]), _EASTWARDS * data.time - float(data.qpos[1])


def _airspeed(data: mujoco.MjData) -> tuple[float, float, float]:
    up, east = _place(data)
    north, west, climb = data.qvel[:3].tolist()
    return north, _EASTWARDS - west - SPIN * up, climb + SPIN * east


def _add_loads(data: mujoco.MjData, body: Body) -> None:
    up, east = _place(data)
    outwards, eastwards = gravitation(up, east)
    data.qfrc_passive[1] -= body.mass * eastwards
    data.qfrc_passive[2] += body.mass * outwards
    if not body.damped:
        return
    speed = math.hypot(*_airspeed(data))
    density = air_density(math.hypot(up, east) - EQUATOR)
    # the rates are inertial, as SIM 4 took them; SIM 5 and 6 took them from the earth
    per_rate = -0.25 * density * speed**2 / max(_SLOWEST, speed) * _AREA
    for axis, length in enumerate((_SPAN, _CHORD, _SPAN)):
        data.qfrc_passive[3 + axis] += per_rate * length**2 * data.qvel[3 + axis]


def _seen(data: mujoco.MjData) -> list[float]:
    up, east = _place(data)
    turned = math.atan2(east, up)  # of the local vertical since the start
    c, s = math.cos(turned), math.sin(turned)
    level = np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])
    north, eastwards, climb = _airspeed(data)
    velocity = level @ [north, eastwards, -climb]
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, data.qpos[3:7])
    signs = np.array(flip(1.0, 1.0, 1.0))
    attitude = level @ (signs[:, None] * matrix.reshape(3, 3) * signs)
    angles = (
        math.atan2(attitude[1, 0], attitude[0, 0]),
        -math.asin(attitude[2, 0]),
        math.atan2(attitude[2, 1], attitude[2, 2]),
    )
    rates = flip(*data.qvel[3:6])
    altitude = math.hypot(up, east) - EQUATOR
    return [
        altitude / FOOT,
        velocity[1] / FOOT,
        velocity[2] / FOOT,
        *(math.degrees(angle) for angle in (*angles, *rates)),
    ]
