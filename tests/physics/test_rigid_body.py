"""The vehicle with its rotors stopped, against the closed forms of rigid-body motion."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from helisim.physics.native import installed
from helisim.vehicle import load
from helisim.vehicle.assembly import total_inertia
from helisim.vehicle.trim import Motion, addresses, rotation_matrix, write_motion

NO_AIRFRAME = {"airframe.drag_area_x": 0.0, "airframe.drag_area_y": 0.0}
NO_AIRFRAME |= {"airframe.drag_area_z": 0.0, "fin.area": 0.0}
SPIN = Motion(u=1.0, v=-0.5, w=0.3, p=2.0, q=1.0, r=-1.5, phi=0.3, theta=0.2, psi=1.0)


def tumble(vehicle, seconds, *, gravity):
    """Return time, rates, attitudes (FRD in NED) and positions (NED) with the rotors stopped."""
    model = vehicle.model
    model.opt.gravity[:] = [0.0, 0.0, -gravity]
    data = mujoco.MjData(model)
    write_motion(model, data, SPIN)
    rows = []
    with installed():
        for _ in range(round(seconds / model.opt.timestep)):
            quaternion = data.qpos[3:7] * [1.0, 1.0, -1.0, -1.0]
            rows.append([data.time, *data.qvel[3:6] * [1, -1, -1], *quaternion, *data.qpos[:3]])
            mujoco.mj_step(model, data)
    rows = np.array(rows)
    attitude = Rotation.from_quat(rows[:, 4:8], scalar_first=True)
    return rows[:, 0], rows[:, 1:4], attitude, rows[:, 8:] * [1.0, -1.0, -1.0]


@pytest.fixture
def airless():
    return load("jr700", parameters=NO_AIRFRAME)


def test_symmetric_top_precesses_as_the_closed_form(airless):
    """With I_yy = I_zz = I, q and r turn in the body at (I_xx - I) p / I, and p is constant."""
    inertia = airless.parameters["airframe.izz"]
    vehicle = load("jr700", parameters={**NO_AIRFRAME, "airframe.iyy": inertia})
    time, rates, _, _ = tumble(vehicle, 3.0, gravity=0.0)
    slip = (vehicle.parameters["airframe.ixx"] - inertia) / inertia * SPIN.p
    turned = (SPIN.q + 1j * SPIN.r) * np.exp(1j * slip * time)
    # fourth order in h = 2 ms: (2 rad/s x h)^4 x 6 rad = 2e-9 at the most
    assert rates[:, 1] + 1j * rates[:, 2] == pytest.approx(turned, abs=2e-9)
    assert rates[:, 0] == pytest.approx(SPIN.p, abs=2e-9)


def test_force_free_flight_keeps_momentum_and_energy(airless):
    """Nothing acts: angular momentum keeps its place in the world, and energy its amount."""
    time, rates, attitude, position = tumble(airless, 3.0, gravity=0.0)
    signs = np.array([1.0, -1.0, -1.0])
    inertia = total_inertia(airless.model, "jr700") * np.outer(signs, signs)
    momentum = attitude.apply(rates @ inertia)
    energy = np.einsum("ni,ij,nj->n", rates, inertia, rates)
    # fourth order in h, as above, relative
    assert momentum == pytest.approx(np.tile(momentum[0], (time.size, 1)), abs=2e-9)
    assert energy == pytest.approx(energy[0], rel=2e-9)
    velocity = rotation_matrix(SPIN.phi, SPIN.theta, SPIN.psi) @ [SPIN.u, SPIN.v, SPIN.w]
    # the centre of gravity goes straight: 1500 roundings of a few metres
    assert position == pytest.approx(time[:, None] * velocity, abs=1e-12)
    # and the vehicle did tumble
    assert np.ptp(rates[:, 0]) > 0.5


def test_free_fall_is_a_parabola(airless):
    """With gravity the centre of gravity falls g t^2 / 2, however the vehicle tumbles."""
    gravity = 9.8015  # Table 1
    time, _, _, position = tumble(airless, 2.0, gravity=gravity)
    velocity = rotation_matrix(SPIN.phi, SPIN.theta, SPIN.psi) @ [SPIN.u, SPIN.v, SPIN.w]
    expected = time[:, None] * velocity + 0.5 * gravity * np.outer(time**2, [0.0, 0.0, 1.0])
    # a Runge-Kutta step is exact for a parabola: rounding of 1000 steps of 20 m
    assert position == pytest.approx(expected, abs=1e-10)


def test_drag_slows_a_gliding_body():
    """With drag but no rotor, energy only falls, and the flight path bends to the wind."""
    vehicle = load("jr700")
    model = vehicle.model
    model.opt.gravity[:] = 0.0
    data = mujoco.MjData(model)
    write_motion(model, data, Motion(u=6.0, v=2.0, w=-1.0))
    energy = []
    with installed():
        for _ in range(500):
            energy.append(8.01 * np.sum(data.qvel[:3] ** 2))
            energy[-1] += data.qvel[3:6] @ total_inertia(model, "jr700") @ data.qvel[3:6]
            mujoco.mj_step(model, data)
    assert np.all(np.diff(energy) < 0.0)


def test_wind_is_airspeed(airless):
    """A vehicle drifting with the wind feels what one at rest feels in calm air."""
    model = airless.model
    accelerations = []
    for wind, motion in (
        ((0.0, 0.0, 0.0), Motion()),
        ((3.0, -2.0, 0.5), Motion(u=3.0, v=2.0, w=-0.5)),
    ):
        model.opt.wind[:] = wind
        data = airless.hovering()
        write_motion(model, data, motion)
        data.ctrl[addresses(model).control + 8] = 1.0
        with installed():
            mujoco.mj_forward(model, data)
        accelerations.append(data.qacc.copy())
    # rounding of a difference of 3 m/s
    assert accelerations[0] == pytest.approx(accelerations[1], abs=1e-11)
