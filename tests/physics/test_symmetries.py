"""Whole evaluations: what no place, heading, hand or steady wind changes, and where power goes."""

import mujoco
import numpy as np
import pytest

from helisim.physics.layout import PARAM, SENSOR, STATE
from helisim.physics.motion import Velocities, to_shaft
from helisim.physics.native import installed
from helisim.physics.rotor import normal
from helisim.vehicle.addresses import addresses
from helisim.vehicle.assembly import assemble
from helisim.vehicle.trim import Motion, rotation_matrix, write_motion
from mirror import mirrored, mirrored_parts

FRD = np.array([1.0, -1.0, -1.0])
RICH = {
    "air.ground_effect": 1.0,
    "airframe.download": 1.3,
    "airframe.drag_centre_x": -0.1,
    "airframe.drag_centre_z": 0.05,
    "airframe.pitch_volume": 0.008,
    "airframe.yaw_volume": 0.006,
    "fin.incidence": 0.05,
    "main_rotor.hub_x": 0.03,
    "main_rotor.shaft_tilt": 0.06,
    "main_rotor.twist": -0.1,
    "tail_rotor.blockage": 0.1,
    "tailplane.area": 0.008,
    "tailplane.incidence": -0.04,
    "tailplane.x": -0.7,
}
"""What the JR700 lacks, and a real one may have."""
MOVING = {"drive.governor": 1.0, "main_rotor.inflow": 1.0}
WIND = (3.0, -2.0, 0.5)
SWAPPED = {"left": "right", "right": "left"}
ODD = {"tail", "b", "s", "p", "r", "v"}
"""Parts of the names of states that change sign in the mirror."""


def models_of(vehicle, parameters):
    """Return the models of a vehicle with so much more, and of its mirror image."""
    own = vehicle.parameters.replace({**RICH, **parameters})
    models = assemble("jr700", own), assemble("jr700", mirrored(own))
    mirrored_parts(models[1])
    return models


def felt(model, seed, *, hand=1.0, heading=0.0, north=0.0, wind=(0.0, 0.0, 0.0), air=1.0):
    """Return the body's accelerations in its axes, the states' rates by name, and the sensors.

    A random moment, the same whatever is seen from; `wind`, north-east-down, takes it along.
    """
    rng, where, data = np.random.default_rng(seed), addresses(model), mujoco.MjData(model)
    numbers = model.actuator_user[where.rotor]
    numbers[[PARAM.turbulence_on, PARAM.turbulence_span]] = air, 1.5
    numbers[[PARAM.turbulence_cosine, PARAM.turbulence_sine]] = np.cos(heading), np.sin(heading)
    numbers[PARAM.turbulence_lag_u : PARAM.turbulence_lag_p + 1] = 3.0, 2.0, 2.5, 1.5
    u, v, w, p, q, r, phi, theta, psi = rng.uniform(-1.0, 1.0, 9) * [9, 3, 3, 1, 1, 1, 0.4, 0.4, 3]
    attitude = {"phi": hand * phi, "theta": theta, "psi": hand * psi + heading}
    states = rng.uniform(-0.1, 0.1, len(STATE))
    drift = rotation_matrix(**attitude).T @ wind
    velocity = dict(zip("uvw", np.array([u, hand * v, w]) + drift))
    turn = {"p": hand * p, "q": q, "r": hand * r}
    write_motion(model, data, Motion(north=north, down=-1.0, **velocity, **turn, **attitude))
    model.opt.wind[:] = wind * FRD
    for name, at in zip(STATE._fields, np.arange(STATE.feels_x) + where.state):
        parts = name.split("_")
        namesake = "_".join(SWAPPED.get(part, part) for part in parts) if hand < 0.0 else name
        data.act[at] = states[STATE._fields.index(namesake)] * (hand if ODD & set(parts) else 1.0)
    data.act[where.state + np.array([STATE.inflow_0, STATE.speed, STATE.engine])] += 4.0, 0.95, 0.5
    data.ctrl[where.control + 8] = 1.0
    with installed():
        mujoco.mj_forward(model, data)
    matrix = rotation_matrix(**attitude)
    accelerations = np.concatenate([matrix.T @ (data.qacc[:3] * FRD), data.qacc[3:6] * FRD])
    rates = dict(zip(STATE._fields[: STATE.feels_x], data.act_dot[where.state :]))
    return accelerations, rates, data.sensordata[model.sensor("imu_gyro").adr[0] :], data


@pytest.mark.parametrize("integrator", ["RK4", "EULER"])
@pytest.mark.parametrize("parameters", [{}, MOVING])
@pytest.mark.parametrize("seed", range(3))
def test_a_mirrored_moment_is_the_mirror_image(jr700, parameters, seed, integrator):
    """Left for right, and the rotor's other way round: forces, tilt, inflow, drive and air."""
    seen = []
    for model, hand in zip(models_of(jr700, parameters), (1.0, -1.0)):
        model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
        seen.append(felt(model, seed, hand=hand)[:2])
    (one, rates), (other, other_rates) = seen
    # rounding of 1e2 m/s^2 and 1e3 rad/s^2, and the solver's
    assert other == pytest.approx(one * [1, -1, 1, -1, 1, -1], rel=1e-9, abs=1e-9)
    for name in STATE._fields[STATE.flap_a : STATE.feels_x]:
        sign = -1.0 if ODD & set(name.split("_")) else 1.0
        assert other_rates[name] == pytest.approx(sign * rates[name], rel=1e-9, abs=1e-9), name
    assert np.abs(one).min() > 1e-3


@pytest.mark.parametrize("seen", [{"heading": 2.0, "north": 7.0}, {"wind": WIND, "heading": -1.0}])
@pytest.mark.parametrize("parameters", [{}, MOVING])
def test_place_heading_and_steady_wind_are_not_felt(jr700, parameters, seen):
    """Whoever drifts with the wind, elsewhere and turned, feels what calm air does (Galilei)."""
    model, _ = models_of(jr700, parameters)
    accelerations, rates, _, _ = felt(model, 5)
    other_accelerations, other_rates, _, _ = felt(model, 5, **seen)
    assert other_accelerations == pytest.approx(accelerations, rel=1e-9, abs=1e-9)  # rounding
    assert other_rates == pytest.approx(rates, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("governor", [0.0, 1.0])
def test_the_shafts_power_is_work_and_heat(jr700, seed, governor):
    """In air at rest: what the drive gives moves the body and the rotor, or is lost to the air.

    Springs of the hub are left out; half of the torque leans with the disc, and works there.
    """
    model, _ = models_of(jr700, {"drive.governor": governor})
    par = model.actuator_user[addresses(model).rotor]
    par[[PARAM.hub_stiffness, PARAM.hub_cross]] = 0.0
    _, rates, sensed, data = felt(model, seed, air=0.0)
    act = data.act[addresses(model).state :]
    turn = to_shaft(par, Velocities(0.0, 0.0, 0.0, *data.qvel[3:6] * FRD))
    x, y, _ = normal(par, act[STATE.flap_a : STATE.flap_b + 1])
    leaning = 0.5 * par[PARAM.main_direction] * sensed[SENSOR.torque] * (x * turn.p + y * turn.q)
    given = data.qfrc_passive[:6] @ data.qvel[:6] + sensed[SENSOR.heat]
    spun = par[PARAM.drive_inertia] * par[PARAM.main_speed] ** 2 * sensed[SENSOR.speed]
    given += spun * rates["speed"]
    assert sensed[SENSOR.drive_power] + leaning == pytest.approx(given, rel=1e-9)  # the solver's
    shafts = sensed[SENSOR.main_power] + sensed[SENSOR.tail_power]
    assert governor or abs(given / shafts - 1.0) < 0.05
