"""The frames: MuJoCo's forward-left-up and the field's forward-right-down."""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from helisim.physics import motion as frames
from helisim.vehicle.trim import Motion, motion_rates, rotation_matrix, write_motion

ROUNDING = 1e-13
FREE = """
<mujoco><option gravity="0 0 0"/><worldbody><body><freejoint/>
<inertial pos="0 0 0" mass="2" diaginertia="0.2 0.3 0.4"/></body></worldbody></mujoco>
"""

number = st.floats(-20.0, 20.0)
roll = st.floats(-3.0, 3.0)
pitch = st.floats(-1.5, 1.5)
yaw = st.floats(-3.0, 3.0)


@pytest.fixture(scope="module")
def free():
    model = mujoco.MjModel.from_xml_string(FREE)
    return model, mujoco.MjData(model)


def placed(free, **motion):
    model, data = free
    write_motion(model, data, Motion(**motion))
    mujoco.mj_forward(model, data)
    return data.xmat[1].copy(), data


@given(x=number, y=number, z=number)
def test_flip_is_an_involution(x, y, z):
    """Flipped twice, a vector is itself; its length never changes."""
    assert frames.flip(*frames.flip(x, y, z)) == (x, y, z)
    assert frames.flip(x, y, z) == (x, -y, -z)


@given(phi=roll, theta=pitch, psi=yaw)
def test_euler_angles_are_scipys(free, phi, theta, psi):
    """Angles written through scipy's rotations come back out of MuJoCo's matrix."""
    matrix, _ = placed(free, phi=phi, theta=theta, psi=psi)
    # near theta = pi/2 arcsine loses digits: 1e-16 / cos(theta)
    bound = ROUNDING / np.cos(theta)
    assert frames.euler_angles(matrix) == pytest.approx((phi, theta, psi), abs=bound)


@given(phi=roll, theta=pitch, psi=yaw, x=number, y=number, z=number)
def test_to_body_undoes_to_world(free, phi, theta, psi, x, y, z):
    """A vector turned to the world and back is itself, for any attitude."""
    matrix, _ = placed(free, phi=phi, theta=theta, psi=psi)
    there = frames.to_world(matrix, x, y, z)
    assert frames.to_body(matrix, *there) == pytest.approx((x, y, z), abs=1e-12)  # 20 x rounding


@given(phi=roll, theta=pitch, psi=yaw, u=number, v=number, w=number)
def test_to_world_is_the_field_rotation(free, phi, theta, psi, u, v, w):
    """North, east and down of a body vector are those of the aerospace 3-2-1 rotation."""
    matrix, _ = placed(free, phi=phi, theta=theta, psi=psi)
    ned = frames.flip(*frames.to_world(matrix, u, v, w))
    direct = Rotation.from_euler("ZYX", [psi, theta, phi]).apply([u, v, w])
    assert ned == pytest.approx(direct, abs=1e-12)


@pytest.mark.parametrize(
    ("angle", "body", "world"),
    [
        ("phi", (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),  # rolled right by 90: right wing down
        ("theta", (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)),  # pitched up by 90: nose up
        ("psi", (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),  # turned right by 90: nose east
    ],
)
def test_signs_are_the_pilots(angle, body, world):
    """Right wing down, nose up and nose right are positive."""
    matrix = rotation_matrix(**{"phi": 0.0, "theta": 0.0, "psi": 0.0, angle: np.pi / 2.0})
    assert matrix @ body == pytest.approx(world, abs=1e-15)


@pytest.mark.parametrize("name", ["p", "q", "r"])
def test_rates_turn_the_matching_angle(free, name):
    """A positive p, q or r in MuJoCo's own integration makes phi, theta or psi grow."""
    model, data = free
    mujoco.mj_resetData(model, data)
    write_motion(model, data, Motion(**{name: 0.5}))
    mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    angles = dict(zip("pqr", frames.euler_angles(data.xmat[1])))
    step = 0.5 * model.opt.timestep
    assert angles.pop(name) == pytest.approx(step, rel=1e-9)  # a turn about one fixed axis
    assert list(angles.values()) == pytest.approx([0.0, 0.0], abs=1e-15)


@given(
    phi=st.floats(-1.0, 1.0),
    theta=st.floats(-1.0, 1.0),
    psi=yaw,
    rates=st.tuples(*[st.floats(-2.0, 2.0)] * 3),
    velocity=st.tuples(*[st.floats(-5.0, 5.0)] * 3),
)
def test_motion_rates_are_mujocos_motion(free, phi, theta, psi, rates, velocity):
    """What the field's kinematics predict is where MuJoCo's integration goes."""
    model, data = free
    p, q, r = rates
    u, v, w = velocity
    start = Motion(u=u, v=v, w=w, p=p, q=q, r=r, phi=phi, theta=theta, psi=psi)
    write_motion(model, data, start)
    mujoco.mj_forward(model, data)
    predicted = motion_rates(data, start)[6:]
    h = 1e-5
    ends = []
    for sign in (1.0, -1.0):
        qpos = data.qpos.copy()
        mujoco.mj_integratePos(model, qpos, data.qvel, sign * h)
        matrix = np.zeros(9)
        mujoco.mju_quat2Mat(matrix, qpos[3:7])
        ends.append([*frames.euler_angles(matrix), *frames.flip(*qpos[:3])])
    found = (np.array(ends[0]) - ends[1]) / (2.0 * h)
    # truncation h^2 x third derivative (below 1e3), rounding 1e-15 / h
    assert found == pytest.approx(predicted, abs=1e-6)
