"""A vehicle on the ground: standing, sliding, tipping over, falling, riding on a deck."""

import math
import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import helisim as hs
from helisim.physics.layout import CONTROL, PARAM, STATE
from helisim.physics.native import installed
from helisim.show.viewer import prepare_live
from helisim.sim.flight import simulate
from helisim.sim.ground import Deck, Ground, Swing
from helisim.sim.missions import TakeOffHoverLand
from helisim.vehicle.trim import addresses

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


# Flights over a ground: taking off, landing, by plan, mission and hand, and how they end


STILL = hs.Doublet(axis="ped", amplitude=1e-9, duration=8.0)
QUIET = hs.Pilot(remnant=0.0)


def flown(vehicle, plan):
    (flight,) = simulate(vehicle, plan, seed=1, keep_ended=True, jobs=1)
    return flight


def pushed(axis, amplitude, ground, *, height=1.5, duration=8.0):
    """Return the plan of a stick that is held over from a second on."""
    step = hs.Step(axis=axis, amplitude=amplitude, trim_time=1.0, duration=duration)
    return hs.FlightPlan(
        excitation=step, pilot=QUIET, ground=ground, weather=hs.Weather(height=height)
    )


def test_flat_ground_is_a_slope_of_nothing_and_todays_plane(jr700):
    """Ground effect over the model's plane is that of the plane at height 0, to rounding."""
    plan = hs.FlightPlan(
        excitation=STILL, pilot=QUIET, ground=Ground(), weather=hs.Weather(height=1.2)
    )
    felt = flown(jr700, plan)
    before = flown(hs.load(parameters={"air.ground_effect": 1.0}), replace(plan, ground=None))
    assert felt.rotor == pytest.approx(before.rotor, abs=1e-6)
    assert felt.positions == pytest.approx(before.positions, abs=1e-9)
    sloping = flown(jr700, replace(plan, ground=Ground(slope=1e-12)))
    assert sloping.rotor == pytest.approx(felt.rotor, abs=1e-6)


def test_it_takes_off_by_itself(jr700):
    """Parked, the pilot that holds a height climbs there, and the ground lets go at once."""
    plan = hs.FlightPlan(
        excitation=replace(STILL, duration=10.0),
        pilot=QUIET,
        ground=Ground(parked=True),
        weather=hs.Weather(height=1.5),
    )
    flight = flown(jr700, plan)
    assert flight.end is None
    weight = 8.01 * 9.8015
    assert flight.contact[0] == pytest.approx([0.0, 0.0, -weight], abs=0.08 * weight)
    assert not flight.contact[200:].any()
    assert -flight.positions[-1, 2] == pytest.approx(1.5, abs=0.2)


def test_a_landing_is_no_end(jr700):
    """Let down with a second of less collective, it stands; in the air alone that is the end."""
    down = pushed("col", -0.03, Ground(), height=0.35, duration=8.0)
    flight = flown(jr700, down)
    assert flight.end is None
    assert np.abs(flight.contact[-1]).max() > 0.0
    assert "touched the ground" in flown(jr700, replace(down, ground=None)).end.why


@pytest.mark.parametrize(
    ("plan", "why"),
    [
        (pushed("col", -0.4, Ground()), r"the helicopter hit the ground at 4\.\d m/s"),
        (pushed("lat", 0.5, Ground(parked=True), height=0.2), "tipped over and struck the ground"),
        (pushed("lat", 0.3, Ground(), height=0.7), "struck the ground with its main rotor"),
        (
            pushed("lon", -0.2, Ground(deck=Deck(length=3.0, width=3.0))),
            "came down beside the deck",
        ),
    ],
)
def test_ends_and_their_reasons(jr700, plan, why):
    """A landing that is too hard, a rotor in the ground, a helicopter beside its deck."""
    end = flown(jr700, plan).end
    assert end is not None
    assert re.search(why, end.why)


def test_limits_of_the_ground_can_be_let_go(jr700):
    """With touchdown and clearance off the same fall goes on."""
    plan = pushed("col", -0.2, Ground(), height=0.8, duration=2.5)
    assert "hit the ground" in flown(jr700, plan).end.why
    free = replace(plan, envelope=hs.FlightEnvelope.off())
    assert flown(jr700, free).end is None


def test_same_seed_same_bytes_for_any_threads(jr700):
    """Contact and a moving deck depend on the seed and the number alone."""
    plan = hs.FlightPlan(
        excitation=hs.Doublet(axis="lat", duration=8.0),
        ground=Ground(deck=SWAYING, parked=True),
        weather=hs.Weather(height=4.0, turbulence="light"),
    )
    one = list(simulate(jr700, plan, count=3, seed=5, jobs=1))
    other = list(simulate(jr700, plan, count=3, seed=5, jobs=3))
    for left, right in zip(one, other):
        assert left.positions.tobytes() == right.positions.tobytes()
        assert left.contact.tobytes() == right.contact.tobytes()
    assert one[0].positions.tobytes() != one[1].positions.tobytes()


def test_a_flight_without_ground_touches_nothing(jr700):
    """Its model solves no constraint, and neither plan nor record speak of a ground."""
    plan = hs.FlightPlan(excitation=STILL)
    assert jr700.model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    assert "ground" not in plan.to_dict()
    assert "ground" not in plan.to_toml()
    assert not flown(jr700, plan).contact.any()


def test_the_record_says_how_the_ground_carries(jr700):
    """With the rotor's true loads also the ground's, and its plan; the pilot takes off."""
    plan = hs.FlightPlan(
        excitation=STILL, pilot=QUIET, ground=Ground(parked=True), weather=hs.Weather(height=1.0)
    )
    recorder = hs.Recorder.of(jr700, rotor=True)
    (record,) = hs.fly(jr700, replace(plan, recorder=recorder), seed=1)
    # it stands on 78 N until collective has come, 50 ms later
    assert 70.0 < record["contact"][0] < 80.0
    assert np.abs(record["contact"][100:]).max() < 0.1  # what the anti-alias filter leaves
    assert hs.FlightPlan.of_record(record).ground == Ground(parked=True)
    (aloft,) = hs.fly(jr700, replace(plan, ground=None, recorder=recorder), seed=1)
    assert "contact" not in aloft


@pytest.mark.parametrize(
    "ground",
    [Ground(slope=0.1), Ground(slope=0.1, uphill=0.5 * math.pi), Ground(deck=SWAYING)],
    ids=["uphill", "across", "deck"],
)
def test_a_mission_takes_off_and_lands_again(jr700, ground):
    """On slopes of 6 degrees, and on a deck that sways; then it stands there, as it leans."""
    mission = TakeOffHoverLand(height=3.0, hover=3.0)
    plan = hs.FlightPlan(mission=mission, pilot=QUIET, ground=replace(ground, parked=True))
    flight = flown(jr700, plan)
    assert flight.end is None
    touches = np.any(flight.contact != 0.0, axis=1)
    assert touches[0]
    assert touches[-1]
    aloft = np.flatnonzero(~touches)
    assert (aloft[-1] - aloft[0]) * flight.timestep > 8.0
    here = flight.rows(slice(-1, None))
    nose, belly = np.eye(3)[[0, 2]]
    turn = Rotation.from_euler("ZYX", here.attitudes[0, ::-1]).as_matrix()
    for body in (nose, np.array([0.0, 1.0, 0.0])):  # along both axes it lies in the surface
        ahead = here.positions[:, None] + np.array([[np.zeros(3), turn @ body]])
        heights = ground.heights(here.time, ahead)[0]
        assert heights[1] - heights[0] == pytest.approx(0.0, abs=0.02)
    assert (turn @ belly)[2] > 0.98


def test_a_hand_lands_on_a_slope(jr700):
    """And feels the ground's effect: it stands as the slope leans, and no crash is told."""
    flight = hs.HandFlight(jr700, ground=Ground(slope=0.1))
    hover = flight.hover_collective
    flight.fly(3.0, col=-0.4)  # level, with the skids' toes uphill
    flight.assist = "none"
    flight.fly(3.0, col=-1.0)
    assert not flight.crashed
    assert flight.motion.theta == pytest.approx(0.1, abs=5e-3)
    assert flight.clearance == pytest.approx(0.0, abs=5e-3)
    aloft = hs.HandFlight(jr700, ground=Ground(effect=0.0))
    assert hover < aloft.hover_collective - 1e-3


def test_a_hand_and_the_viewer_start_parked(jr700):
    """On the slope, still and at the origin; a pilot that is switched on already doesn't matter."""
    ground = Ground(slope=0.2, parked=True)
    flight = hs.HandFlight(jr700, ground=ground)
    assert flight.clearance == pytest.approx(0.0, abs=1e-3)
    live = prepare_live(jr700, ground=ground)
    for data in (flight.data, live.data):
        assert np.abs(data.qpos[:2]).max() < 0.1  # the centre of gravity is up the slope's normal
        assert data.qvel == pytest.approx(np.zeros(6))
        assert data.body("jr700").xmat[8] == pytest.approx(math.cos(0.2), abs=1e-3)


def test_a_hand_crashes_into_a_deck_that_comes_up(jr700):
    """The deck's own motion counts: hovering still, it is hit by 3 m/s from below."""
    deck = Deck(heave=Swing(amplitude=3.0, period=6.0), above=10.0)
    flight = hs.HandFlight(jr700, ground=Ground(deck=deck), height=1.0)
    flight.fly(2.0)
    assert re.search(r"hit the ground at [23]\.\d m/s", flight.crashed)


def test_the_viewers_deck_moves_as_the_flights_own(jr700):
    """`prepare_live` lays the same ground below the drawn vehicle, pad and all."""
    heave = Swing(amplitude=0.3, period=6.0, phase=1.0)
    live = prepare_live(jr700, ground=Ground(deck=Deck(heave=heave, above=2.0)))
    assert live.data.body("deck").xpos[2] == pytest.approx(heave.at(0.0))
    assert live.model.geom("ground").pos[2] == -2.0
    with installed():
        for _ in range(500):
            live.step()
    mujoco.mj_kinematics(live.model, live.data)
    assert live.data.body("deck").xpos[2] == pytest.approx(heave.at(live.data.time), abs=1e-4)
    sloping = prepare_live(jr700, ground=Ground(slope=0.2, uphill=0.5 * math.pi))
    rise = sloping.data.geom("ground").xmat.reshape(3, 3) @ [0.0, -1.0, 0.0]
    assert rise == pytest.approx([0.0, -math.cos(0.2), math.sin(0.2)], abs=1e-9)
