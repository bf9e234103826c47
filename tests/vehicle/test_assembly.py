"""What the compiled vehicle weighs and is made of."""

import mujoco
import numpy as np
import pytest

from helisim.physics.layout import (
    ACTUATORS,
    MAGIC,
    PARAM,
    ROTOR,
    STATE,
    SWASH_STATES,
    TAIL_STATES,
)
from helisim.physics.native import installed
from helisim.vehicle import load
from helisim.vehicle.assembly import assemble, total_inertia
from helisim.vehicle.trim import addresses, place


def test_inertia_is_the_calibrated_about_the_centre_of_gravity(jr700):
    """About the root body's frame, which the force laws act about, and without products."""
    wanted = [jr700.parameters[f"airframe.{axis}"] for axis in ("ixx", "iyy", "izz")]
    # MuJoCo keeps principal axes as a quaternion: rounding of 0.4 kg m^2
    assert total_inertia(jr700.model, "jr700") == pytest.approx(np.diag(wanted), abs=1e-12)
    data = mujoco.MjData(jr700.model)
    mujoco.mj_kinematics(jr700.model, data)
    mujoco.mj_comPos(jr700.model, data)
    # a micrometre under a thrust of 78 N is 8e-5 N m
    assert data.subtree_com[1] == pytest.approx(data.xpos[1], abs=1e-6)


def test_time_step_is_set():
    for timestep in (0.002, 0.0005):
        model = load(timestep=timestep).model
        assert model.opt.timestep == timestep
        pedal = model.actuator("PED").id
        # one delay, one step of skew between stamp and sample, one sample for the slope
        assert model.actuator_history[pedal, 0] * timestep >= 0.022 + timestep


def test_force_laws_carry_the_parameters_and_states(jr700):
    """All nine actuators say whose they are; the laws' states are once more behind the layout's."""
    where = addresses(jr700.model)
    user = jr700.model.actuator_user[where.rotor - ROTOR : where.rotor + 1]
    assert user[:, PARAM.magic].tolist() == [MAGIC] * len(ACTUATORS)
    assert user[:, PARAM.ordinal].tolist() == list(range(len(ACTUATORS)))
    assert user[ROTOR, PARAM.air_density] == jr700.parameters["air.density"]
    blades = jr700.parameters["main_rotor.blades"] * jr700.parameters["main_rotor.chord"]
    solidity = blades / (np.pi * jr700.parameters["main_rotor.radius"])
    assert user[ROTOR, PARAM.main_solidity] == solidity
    assert user[ROTOR, PARAM.pilot_on] == 0.0
    model = jr700.model
    assert model.na == len(STATE) + SWASH_STATES + TAIL_STATES
    servo = model.actuator("servo_front").id
    assert addresses(model).state == model.actuator_actadr[servo] == STATE.front_position == 0
    assert model.actuator_actadr[model.actuator("servo_tail").id] == STATE.tail_position
    assert model.actuator_actadr[model.actuator("rotor").id] == STATE.flap_a


def test_the_model_to_look_at_flies_the_same(jr700):
    """With every part, ground and light, the vehicle has the same dynamics."""
    seen = assemble("jr700", jr700.parameters, visual=True)
    assert seen.ngeom > jr700.model.ngeom
    assert seen.nbody > jr700.model.nbody
    assert total_inertia(seen, "jr700") == pytest.approx(
        total_inertia(jr700.model, "jr700"), abs=1e-12
    )
    ends = []
    for model in (seen, jr700.model):
        data = mujoco.MjData(model)
        place(model, data, jr700.trim)
        data.qvel[3:6] = [0.3, -0.2, 0.1]
        with installed():
            for _ in range(200):
                mujoco.mj_step(model, data)
        ends.append(np.concatenate([data.qpos, data.qvel, data.act]))
    # inertias summed in another order: rounding, grown over 0.4 s
    assert ends[0] == pytest.approx(ends[1], abs=1e-11)
