"""The hover: an equilibrium of the nonlinear model, and steady in time."""

import math

import mujoco
import numpy as np
import pytest

from helisim.base.errors import TrimError
from helisim.physics.layout import PARAM
from helisim.physics.native import installed
from helisim.vehicle import find_trim, load
from helisim.vehicle.trim import addresses, place

SOLVER = 1e-9
"""What find_trim promises to leave, m/s^2 and rad/s^2."""


def test_nothing_accelerates(jr700):
    """At the trim every acceleration and every state's rate is zero."""
    data = jr700.hovering()
    with installed():
        mujoco.mj_forward(jr700.model, data)
    assert data.qacc == pytest.approx(np.zeros(6), abs=SOLVER)
    # states move at up to the square of 175 rad/s times rounding of their positions
    assert data.act_dot == pytest.approx(np.zeros(data.act.size), abs=1e-8)


def test_calibrated_hover_has_centred_controls(jr700):
    """The pitch trims are solved for it: collective and pedals are at their centres."""
    # calibrate() leaves 1e-8 of the conditions
    assert jr700.trim.col == pytest.approx(0.0, abs=1e-7)
    assert jr700.trim.ped == pytest.approx(0.0, abs=1e-7)


def test_hover_is_the_designs(jr700):
    """Forces in hover follow from weight, bank and torque by closed forms."""
    data = jr700.hovering()
    with installed():
        mujoco.mj_forward(jr700.model, data)
    thrust, torque, inflow, tail, _ = data.sensor("rotor").data
    weight = 8.01 * 9.8015
    # balance of forces at a bank phi and disc tilt b: each a closed form, to the trim's residual
    assert tail == pytest.approx(torque / 0.90, abs=1e-7)  # Q / l_tr
    assert thrust * math.cos(jr700.trim.b) == pytest.approx(
        weight * math.cos(jr700.trim.phi), abs=1e-7
    )
    assert math.sin(jr700.trim.phi) == pytest.approx(
        tail / weight, abs=1e-3
    )  # tilt b adds a little
    # design, section 3 (4.73 N m, 842 W) is at thrust = weight; a bank of 3.8 deg takes 0.2 %
    assert torque == pytest.approx(4.73, rel=3e-3)
    assert torque * 178.0236 == pytest.approx(842.0, rel=3e-3)
    assert inflow == pytest.approx(0.0305, abs=5e-5)


def test_hover_holds_without_pilot(jr700):
    """For two seconds with the gyro on and no pilot, the hover does not drift."""
    data = jr700.hovering()
    start = data.qpos.copy()
    with installed():
        for _ in range(1000):
            mujoco.mj_step(jr700.model, data)
    # the residual of 1e-9 m/s^2 over 2 s, the unstable modes adding a factor of a few
    assert data.qvel == pytest.approx(np.zeros(6), abs=1e-8)
    assert data.qpos == pytest.approx(start, abs=1e-8)
    assert not data.warning.number.any()


def test_place_centres_all_sticks_and_settles_the_gyro():
    """A vehicle that needs offset controls starts in its hover too, gyro and all."""
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


@pytest.mark.parametrize("height", [10.0, 20.0])
def test_place_resets_the_clock(jr700, height):
    """Placing a used vehicle gives a fresh flight at the height asked for."""
    data = jr700.hovering()
    with installed():
        for _ in range(20):
            mujoco.mj_step(jr700.model, data)
    place(jr700.model, data, jr700.trim, height=height)
    assert data.time == 0.0
    assert data.qpos[2] == height
    assert np.array_equal(data.act, jr700.hovering().act)


def test_no_hover_without_lift(altered):
    """A rotor that can't carry the weight is one clear line."""
    with pytest.raises(TrimError, match=r"no hover|outside"):
        find_trim(altered(main_lift_slope=1.0))
    with pytest.raises(TrimError):
        load(parameters={"tail_rotor.speed": 100.0})


def test_trim_leaves_the_model_alone(jr700):
    """Looking for the hover changes nothing of the model."""
    before = jr700.model.actuator_user[addresses(jr700.model).rotor].copy()
    find_trim(jr700.model)
    after = jr700.model.actuator_user[addresses(jr700.model).rotor]
    assert np.array_equal(before, after)
    assert after[PARAM.gyro_on] == 1.0
