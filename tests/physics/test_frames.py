"""The frames: MuJoCo's forward-left-up and the field's forward-right-down."""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from helisim.physics import motion as frames
from helisim.physics.layout import PARAM
from helisim.vehicle.trim import Motion, motion_rates, write_motion

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


@given(phi=roll, theta=pitch, psi=yaw)
def test_euler_angles_are_scipys(free, phi, theta, psi):
    """Angles written through scipy's rotations come back out of MuJoCo's matrix."""
    matrix, _ = placed(free, phi=phi, theta=theta, psi=psi)
    # near theta = pi/2 arcsine loses digits: 1e-16 / cos(theta)
    bound = ROUNDING / np.cos(theta)
    assert frames.euler_angles(matrix) == pytest.approx((phi, theta, psi), abs=bound)


@pytest.mark.parametrize("up", [1.0, -1.0])
def test_straight_up_and_down_are_right_angles(up):
    """Where rounding makes a sine a little more than 1."""
    _, theta, _ = frames.euler_angles([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, up * (1.0 + 4e-16), 0.0, 0.0])
    assert theta == up * 0.5 * np.pi


@given(phi=roll, theta=pitch, psi=yaw, u=number, v=number, w=number)
def test_to_world_is_the_field_rotation(free, phi, theta, psi, u, v, w):
    """North, east and down of a body vector are those of the aerospace 3-2-1 rotation."""
    matrix, _ = placed(free, phi=phi, theta=theta, psi=psi)
    ned = frames.flip(*frames.to_world(matrix, u, v, w))
    direct = Rotation.from_euler("ZYX", [psi, theta, phi]).apply([u, v, w])
    assert ned == pytest.approx(direct, abs=1e-12)


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


def test_a_leaning_shaft_turns_velocities_and_forces(par):
    """Its axes are the body's, nose down by the lean, as scipy turns them."""
    par[[PARAM.shaft_cosine, PARAM.shaft_sine]] = np.cos(0.1), np.sin(0.1)
    moving = frames.to_shaft(par, frames.Velocities(1.0, 2.0, 3.0, 4.0, 5.0, 6.0))
    turn = Rotation.from_euler("y", -0.1).inv()
    assert moving == pytest.approx(turn.apply([[1, 2, 3], [4, 5, 6]]).ravel(), rel=1e-14)
    assert frames.from_shaft(par, frames.Wrench(*moving)) == pytest.approx(range(1, 7), rel=1e-14)
