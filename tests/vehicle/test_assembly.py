"""What the compiled vehicle weighs and is made of, and what its mirror image flies."""

import mujoco
import numpy as np
import pytest

from helisim.physics import layout
from helisim.physics.layout import ACTUATORS, PARAM, ROTOR, STATE
from helisim.physics.native import installed
from helisim.records.record import IN1, IN2, POSITIONS, RATES, SERVOS
from helisim.sim import FlightPlan, Pilot, Recorder, Weather, fly
from helisim.sim.excitation import Excitation
from helisim.vehicle import Vehicle, load
from helisim.vehicle.addresses import addresses
from helisim.vehicle.assembly import assemble, total_inertia
from helisim.vehicle.parameters import model_folder
from helisim.vehicle.trim import find_trim, place
from mirror import mirrored, mirrored_parts


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
    assert user[:, PARAM.magic].tolist() == [layout.MAGIC] * len(ACTUATORS)
    assert user[:, PARAM.ordinal].tolist() == list(range(len(ACTUATORS)))
    assert user[ROTOR, PARAM.air_density] == jr700.parameters["air.density"]
    blades = jr700.parameters["main_rotor.blades"] * jr700.parameters["main_rotor.chord"]
    solidity = blades / (np.pi * jr700.parameters["main_rotor.radius"])
    assert user[ROTOR, PARAM.main_solidity] == solidity
    assert user[ROTOR, PARAM.pilot_on] == 0.0
    model = jr700.model
    assert model.na == len(STATE) + layout.SWASH_STATES + layout.TAIL_STATES
    servo = model.actuator("servo_front").id
    assert addresses(model).state == model.actuator_actadr[servo] == STATE.front_position == 0
    assert model.actuator_actadr[model.actuator("servo_tail").id] == STATE.tail_position
    assert model.actuator_actadr[model.actuator("rotor").id] == STATE.flap_a


def test_the_model_to_look_at_flies_the_same(jr700):
    seen = assemble("jr700", jr700.parameters, visual=True)
    assert seen.ngeom > jr700.model.ngeom
    assert seen.nbody > jr700.model.nbody
    one, other = (total_inertia(model, "jr700") for model in (seen, jr700.model))
    assert one == pytest.approx(other, abs=1e-12)
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


ROUNDING = 1e-11
"""Of some 10 m, m/s and rad: a sum in another order, in a flight that is stable."""
ASKEW = {
    "swashplate.front_angle": 0.2,
    "swashplate.left_angle": 1.9,
    "swashplate.right_angle": -2.3,
    "swashplate.left_arm": 1.1,
    "swashplate.right_sign": -1.0,
    "drive.governor": "motor",
}
"""A swashplate that is not its own mirror image, and a motor that turns the rotor."""


@pytest.fixture(scope="module", params=["as shipped", "askew"])
def pair(request):
    """A vehicle and its mirror image, as shipped, and with mass and swashplate off the middle."""
    askew = request.param == "askew"
    own = load("jr700", parameters=ASKEW).parameters if askew else load("jr700").parameters
    models = assemble("jr700", own), assemble("jr700", mirrored(own))
    if askew:
        for model in models:
            model.body_ipos[:, 1] += 0.003
    mirrored_parts(models[1])
    each = zip((own, mirrored(own)), models)
    return tuple(
        Vehicle(model_folder("jr700"), values, model, find_trim(model)) for values, model in each
    )


class MirroredWeave(Excitation):
    """Sines on all sticks; the mirrored pilot moves two of them the other way."""

    def sticks(self, time):
        hand = 1.0 if self.axis == "lat" else -1.0
        waves = [0.02 * np.sin(time), 0.05 * np.sin(3.0 * time), 0.05 * np.cos(2.0 * time)]
        waves[2] *= hand
        return np.column_stack([*waves, 0.03 * hand * np.sin(4.0 * time)])


ODD = {"LAT", "PED", "lat", "ped", "p", "r", "phi", "psi", "v", "ay", "east"}
ODD |= {"b", "air_v", "air_p", "air_r"}
SWAPPED = {"left": "right", "right": "left"}


def test_a_recorded_flight_is_the_mirror_image(pair):
    records = [
        fly(
            vehicle,
            FlightPlan(
                excitation=MirroredWeave(axis=axis, duration=6.0),
                pilot=Pilot(remnant=0.0),
                weather=Weather(wind=2.2, wind_from=hand),
                recorder=Recorder(latency=None, noise={}, resolution={}, rotor=True),
            ),
            jobs=1,
        )[0]
        for vehicle, hand, axis in zip(pair, (1.0, -1.0), ("lat", "ped"))
    ]
    assert set(records[0].names) >= {*IN1, *IN2, *SERVOS, *RATES, *POSITIONS}
    for name in records[0].names:
        namesake = "_".join(SWAPPED.get(part, part) for part in name.split("_"))
        sign = -1.0 if name in ODD or name.startswith("servo_tail") else 1.0
        there = sign * records[1][namesake]
        scale = max(1.0, np.abs(there).max())
        assert records[0][name] / scale == pytest.approx(there / scale, abs=ROUNDING), name
