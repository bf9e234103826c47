"""The vehicle with its rotors stopped, against the closed forms of rigid-body motion."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from helisim.physics.native import installed
from helisim.vehicle import load
from helisim.vehicle.assembly import total_inertia
from helisim.vehicle.trim import Motion, rotation_matrix, write_motion

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


def test_what_touches_it_makes_up_for_its_acceleration(airless):
    """Pushed askew into the ground: mass times (acceleration less gravity) (Newton)."""
    model = airless.grounded_model(
        lambda spec, _: spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
    )
    data = mujoco.MjData(model)
    write_motion(model, data, Motion(u=1.0, v=-0.5, w=0.3, phi=0.3, theta=0.2, psi=1.0, down=0.05))
    with installed():
        mujoco.mj_forward(model, data)
    felt = model.body_subtreemass[1] * (data.qacc[:3] - model.opt.gravity) * [1.0, -1.0, -1.0]
    # the constraint solver's tolerance
    assert data.sensor("contact").data == pytest.approx(felt, abs=1e-6 * np.linalg.norm(felt))
    assert np.all(np.abs(felt) > 1.0)


def test_free_fall_is_a_parabola(airless):
    """With gravity the centre of gravity falls g t^2 / 2, however the vehicle tumbles."""
    gravity = 9.8015  # Table 1
    time, _, _, position = tumble(airless, 2.0, gravity=gravity)
    velocity = rotation_matrix(SPIN.phi, SPIN.theta, SPIN.psi) @ [SPIN.u, SPIN.v, SPIN.w]
    expected = time[:, None] * velocity + 0.5 * gravity * np.outer(time**2, [0.0, 0.0, 1.0])
    # a Runge-Kutta step is exact for a parabola: rounding of 1000 steps of 20 m
    assert position == pytest.approx(expected, abs=1e-10)
