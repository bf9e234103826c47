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


@pytest.fixture
def airless():
    return load("jr700", parameters=NO_AIRFRAME)


def test_free_fall_keeps_momentum_and_energy_and_is_a_parabola(airless):
    """Of its rotation: angular momentum keeps its place in the world, and energy its amount."""
    model, data, rows = airless.model, mujoco.MjData(airless.model), []
    write_motion(model, data, SPIN)
    flip = np.array([1.0, -1.0, -1.0])
    with installed():
        for _ in range(round(3.0 / model.opt.timestep)):
            rows.append([data.time, *data.qvel[3:6] * flip, *data.qpos[3:7], *data.qpos[:3] * flip])
            mujoco.mj_step(model, data)
    rows = np.array(rows)
    time, rates, position = rows[:, :1], rows[:, 1:4], rows[:, 8:]
    attitude = Rotation.from_quat(rows[:, 4:8] * [1, 1, -1, -1], scalar_first=True)  # FRD in NED
    inertia = total_inertia(model, "jr700") * np.outer(flip, flip)
    momentum = attitude.apply(rates @ inertia)
    energy = np.einsum("ni,ij,nj->n", rates, inertia, rates)
    # fourth order in h, relative
    assert momentum == pytest.approx(np.tile(momentum[0], (time.size, 1)), abs=2e-9)
    assert energy == pytest.approx(energy[0], rel=2e-9)
    velocity = rotation_matrix(SPIN.phi, SPIN.theta, SPIN.psi) @ [SPIN.u, SPIN.v, SPIN.w]
    expected = time * velocity + 0.5 * time**2 * [0.0, 0.0, 9.8015]  # Table 1
    # a Runge-Kutta step is exact for a parabola: rounding of 1500 steps of 50 m
    assert position == pytest.approx(expected, abs=1e-10)
    assert np.ptp(rates[:, 0]) > 0.5  # it did tumble


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
