"""The hover: an equilibrium of the nonlinear model, and steady in time."""

import mujoco
import numpy as np
import pytest

from helisim.base.errors import TrimError
from helisim.physics.native import installed
from helisim.vehicle import find_trim, load

SOLVER = 1e-9
"""What find_trim promises to leave, m/s^2 and rad/s^2."""


def test_nothing_accelerates(jr700):
    data = jr700.hovering()
    with installed():
        mujoco.mj_forward(jr700.model, data)
    assert data.qacc == pytest.approx(np.zeros(6), abs=SOLVER)
    # states move at up to the square of 175 rad/s times rounding of their positions
    assert data.act_dot == pytest.approx(np.zeros(data.act.size), abs=1e-8)


def test_place_centres_all_sticks_and_settles_the_gyro():
    vehicle = load(parameters={"main_rotor.hub_x": 0.01, "tail_rotor.arm_z": -0.05})
    assert abs(vehicle.trim.lon) > 0.005
    data = vehicle.hovering()
    with installed():
        mujoco.mj_forward(vehicle.model, data)
        assert data.act_dot == pytest.approx(np.zeros(data.act.size), abs=1e-8)
        sticks = data.ctrl[1:4]
        assert sticks.tolist() == [0.0, 0.0, 0.0]
        for _ in range(500):
            mujoco.mj_step(vehicle.model, data)
    assert data.qvel == pytest.approx(np.zeros(6), abs=1e-7)


def test_no_hover_without_lift(altered):
    with pytest.raises(TrimError, match=r"no hover|outside"):
        find_trim(altered(main_lift_slope=1.0))
    with pytest.raises(TrimError):
        load(parameters={"tail_rotor.speed": 100.0})
