"""A vehicle on the ground: standing, sliding, tipping over, falling, riding on a deck."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest

import helisim as hs
from helisim.physics.layout import CONTROL, PARAM, STATE
from helisim.physics.native import installed
from helisim.sim.ground import Deck, Ground, Swing
from helisim.vehicle.motion import addresses

SWAYING = Deck(
    heave=Swing(amplitude=0.3, period=6.0, phase=0.4),
    surge=Swing(amplitude=0.2, period=7.0),
    roll=Swing(amplitude=0.05, period=8.0),
    pitch=Swing(amplitude=0.03, period=5.0, phase=1.0),
)


@pytest.fixture(scope="module")
def blade360():
    return hs.load("blade360")


def standing(vehicle, ground, rotor=0.0):
    """Return a model and data with the vehicle on its landing gear, its rotor at some speed."""
    model = vehicle.grounded_model(ground.put_into)
    data = mujoco.MjData(model)
    replace(ground, parked=True).begin(vehicle, model, data)
    model.actuator_user[addresses(model).rotor, PARAM.gyro_on] = 0.0
    data.ctrl[addresses(model).control + CONTROL.rotor] = rotor
    return model, data


def stepped(model, data, seconds):
    """Step, and return time, position and force of contact at each step, (n,), (n, 3), (n, 3)."""
    rows = []
    with installed():
        while data.time < seconds:
            mujoco.mj_step(model, data)
            rows.append([data.time, *data.qpos[:3], *data.sensor("contact").data])
    rows = np.array(rows)
    return rows[:, 0], rows[:, 1:4], rows[:, 4:]


@pytest.mark.parametrize("integrator", ["RK4", "Euler"])
@pytest.mark.parametrize("slope", [0.0, math.radians(10.0)])
def test_it_stands_for_a_minute_with_its_rotor_stopped(integrator, slope):
    """The ground carries the weight, straight up on a slope too; nothing creeps or jitters."""
    vehicle = hs.load(integrator=integrator)
    model, data = standing(vehicle, Ground(slope=slope, uphill=0.7))
    _, position, contact = stepped(model, data, 60.0)
    weight = model.body_subtreemass[1] * 9.8015
    assert contact[-1] == pytest.approx([0.0, 0.0, -weight], abs=1e-3 * weight)  # while it creeps
    assert np.ptp(contact[1000:, 2]) < 1e-3 * weight  # it jitters by less than that
    # regularised friction creeps with 1/impratio of the slip that a soft contact would have
    assert np.ptp(position, axis=0).max() < 1e-3
    assert np.abs(data.qvel).max() < 1e-4


def test_it_slides_from_the_angle_of_friction_on(blade360):
    """Coulomb: it stands up to atan(friction), and slides at g (sin - friction cos) beyond."""
    friction, gravity = 0.3, 9.80665
    steepest = math.atan(friction)
    for slope in (0.97 * steepest, 1.03 * steepest, steepest + 0.1):
        model, data = standing(blade360, Ground(slope=0.0, friction=friction))
        tilted = [gravity * math.sin(slope), 0.0, -gravity * math.cos(slope)]  # the same, level
        model.opt.gravity[:] = tilted
        time, position, _ = stepped(model, data, 1.0)
        moved = position[-1, 0] - position[0, 0]
        if slope < steepest:
            assert abs(moved) < 1e-3  # it settles into the soft contact
            continue
        speed = np.gradient(position[:, 0], time)
        late = time > 0.3  # when it has settled
        slid = np.polyfit(time[late], speed[late], 1)[0]
        expected = gravity * (math.sin(slope) - friction * math.cos(slope))
        # what is left of two near numbers at the edge: 1 % of the friction
        assert slid == pytest.approx(expected, abs=0.01 * friction * gravity)


@pytest.mark.parametrize("share", [0.97, 1.03])
def test_it_tips_over_where_its_weight_leaves_the_skids(blade360, share):
    """Statics: the slope's tangent is half the track over the height of the centre of gravity."""
    # of the MJCF: skids 70 mm aside and 85 mm below the centre of gravity, of 3 mm radius
    steepest = math.atan(0.070 / 0.088)
    model, data = standing(blade360, Ground(friction=2.0))
    slope = share * steepest
    model.opt.gravity[:] = 9.80665 * np.array([0.0, math.sin(slope), -math.cos(slope)])
    stepped(model, data, 4.0)
    upright = data.body("blade360").xmat[8]
    # the soft skids give way by a fraction of a degree; over, it lies on its side
    assert (upright > math.cos(0.05)) == (share < 1.0)


@pytest.mark.parametrize("thrust", [0.3, 0.6])
def test_thrust_makes_it_tip_over_earlier(blade360, thrust):
    """Dynamic rollover: with a share of the weight on the rotor, cos - (h/b) sin = share.

    The moments about the lower skid, as of FAA-H-8083-21B, chapter 11: "the critical rollover
    angle is reduced" by thrust. So with 0.6 of the weight it is 16 degrees in place of 38.
    """
    angles = np.linspace(0.0, 1.0, 100001)
    left = np.cos(angles) - 0.088 / 0.070 * np.sin(angles) - thrust
    critical = angles[np.argmin(np.abs(left))]
    for share in (0.95, 1.05):
        model, data = standing(blade360, Ground(friction=2.0))
        slope, weight = share * critical, model.body_subtreemass[1] * 9.80665
        model.opt.gravity[:] = 9.80665 * np.array([0.0, math.sin(slope), -math.cos(slope)])
        with installed():
            while data.time < 3.0:
                up = data.body("blade360").xmat.reshape(3, 3)[:, 2]
                data.xfrc_applied[1, :3] = thrust * weight * up  # at the origin, along the shaft
                mujoco.mj_step(model, data)
        assert (data.body("blade360").xmat[8] > math.cos(0.05)) == (share < 1.0)


@pytest.mark.parametrize("integrator", ["RK4", "Euler"])
@pytest.mark.parametrize("name", ["jr700", "blade360"])
def test_a_fall_is_stopped_by_skids_that_give_way(name, integrator):
    """Touching down at 2 m/s: no more than 15 g and 25 mm, and each bounce less than the last."""
    vehicle = hs.load(name, integrator=integrator)
    model, data = standing(vehicle, Ground())
    stands = data.qpos[2]
    data.qpos[2] += 0.01
    data.qvel[2] = -2.0
    _, position, contact = stepped(model, data, 3.0)
    weight = model.body_subtreemass[1] * 9.81
    height = position[:, 2] - stands
    assert height.min() > -0.025
    assert np.abs(contact[:, 2]).max() < 15.0 * weight
    # a skid with half of the critical damping gives back a sixth of the speed, exp(-1.8): 6 mm
    bounce = height[int(np.argmin(height)) :]
    assert bounce.max() < 0.010
    assert bounce[len(bounce) // 2 :].max() < 1e-3


def test_energy_never_grows_while_it_stands(jr700):
    """Kinetic and potential energy only fall as it comes to rest, and then stay."""
    model, data = standing(jr700, Ground(slope=0.1))
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    data.qvel[:6] = [0.3, -0.2, 0.0, 0.5, 0.3, 0.2]
    energy = []
    with installed():
        while data.time < 20.0:
            mujoco.mj_step(model, data)
            energy.append(data.energy.sum())
    energy = np.array(energy[:10000])
    assert np.diff(energy[2500:]).max() < 1e-9  # J, rounding of 80
    highest = energy.reshape(20, -1).max(axis=1)  # while the skids have some of it on loan
    assert (np.diff(highest) < 1e-9).all()


def test_friction_holds_it_against_the_rotors_torque(jr700):
    """At flying speed and flat pitch the torque of profile drag is far below that of friction."""
    model, data = standing(jr700, Ground(), rotor=1.0)
    stepped(model, data, 5.0)
    turned = math.atan2(data.body("jr700").xmat[3], data.body("jr700").xmat[0])
    torque = data.sensor("rotor").data[1]
    weight = model.body_subtreemass[1] * 9.8015
    assert 0.5 < torque < 0.6 * weight * 0.2  # N m; the skids' ends are 0.2 m away
    assert abs(turned) < 1e-3


def test_friction_holds_it_while_the_motor_spins_the_rotor_up():
    """From rest to flying speed; the heading gives way by what the skids' springs do."""
    vehicle = hs.load(parameters={"drive.governor": "motor"})
    model, data = standing(vehicle, Ground(parked=True, rotor=0.0))
    where = addresses(model)
    data.ctrl[where.control + CONTROL.rotor] = 1.0
    speed, turned = [], []
    with installed():
        while data.time < 20.0:
            mujoco.mj_step(model, data)
            speed.append(data.act[where.state + STATE.speed])
            matrix = data.body("jr700").xmat
            turned.append(math.atan2(matrix[3], matrix[0]))
    assert speed[0] < 0.01
    assert speed[-1] == pytest.approx(1.0, abs=1e-3)
    assert np.abs(turned).max() < 2e-3


@pytest.mark.parametrize("integrator", ["RK4", "Euler"])
def test_it_stands_on_a_deck_that_moves(integrator):
    """The deck carries it along: force of contact and place follow the prescribed motion."""
    vehicle = hs.load(integrator=integrator)
    heave = Swing(amplitude=0.5, period=6.0, phase=0.4)
    model, data = standing(vehicle, Ground(deck=Deck(heave=heave)))
    time, position, contact = stepped(model, data, 30.0)
    mass, step = model.body_subtreemass[1], model.opt.timestep
    acceleration = -(heave.frequency**2) * heave.at(time - step)  # sensors are of the step's start
    # the skids' own springs add (0.16 Hz / 8 Hz)^2
    assert -contact[1000:, 2] == pytest.approx(mass * (9.8015 + acceleration[1000:]), rel=1e-3)
    rise = position[:, 2] - heave.at(time)
    assert np.ptp(rise) < 1e-3


def test_it_is_carried_along_by_a_deck_that_rolls_and_surges(jr700):
    """Relative to a deck with four motions it moves by less than a millimetre in half a minute."""
    model, data = standing(jr700, Ground(deck=SWAYING))
    own = []
    with installed():
        while data.time < 30.0:
            mujoco.mj_step(model, data)
            deck = data.body("deck")
            own.append(deck.xmat.reshape(3, 3).T @ (data.xpos[1] - deck.xpos))
    assert np.ptp(own, axis=0).max() < 1e-3


@pytest.mark.parametrize("integrator", ["RK4", "Euler"])
def test_the_deck_moves_as_it_is_told(integrator):
    """The heavy body on springs keeps to its sines, with a helicopter on it, as `pose` has it."""
    vehicle = hs.load(integrator=integrator)
    model, data = standing(vehicle, Ground(deck=SWAYING))
    for until in (3.3, 11.7, 29.1):
        stepped(model, data, until)
        mujoco.mj_kinematics(model, data)
        place, turn = SWAYING.pose(np.array([data.time]))
        deck, signs = data.body("deck"), np.array([1.0, -1.0, -1.0])
        # Euler keeps velocities half a step early, at up to 0.3 m/s; the landing pushes by 10 um
        assert deck.xpos == pytest.approx(signs * place[0], abs=1e-3)
        matrix = signs[:, None] * turn[0] * signs
        assert deck.xmat.reshape(3, 3) == pytest.approx(matrix, abs=1e-3)


def test_heights_above_a_slope_and_a_deck():
    """Distances from planes through the origin, by their normals."""
    north_rise = Ground(slope=0.3)
    point = np.array([[[1.0, 5.0, -2.0]]])
    normal = np.array([-math.sin(0.3), 0.0, -math.cos(0.3)])
    assert north_rise.heights(np.zeros(1), point)[0, 0] == pytest.approx(point[0, 0] @ normal)
    east_rise = Ground(slope=0.3, uphill=0.5 * math.pi)
    assert east_rise.heights(np.zeros(1), np.array([[[7.0, 1.0, 0.0]]]))[0, 0] == pytest.approx(
        -math.sin(0.3)
    )
    deck = Ground(deck=Deck(length=4.0, width=2.0, above=3.0, heave=Swing(amplitude=1.0)))
    points = np.array([[[1.9, 0.9, -2.0], [2.1, 0.0, -2.0], [0.0, 1.1, -2.0]]])
    assert deck.heights(np.array([2.0]), points)[0] == pytest.approx([1.0, 5.0, 5.0])
