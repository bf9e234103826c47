"""A vehicle on the ground: standing, sliding, tipping over, falling, riding on a deck."""

import math
import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import helisim as hs
from helisim.physics.layout import CONTROL, PARAM
from helisim.physics.native import installed
from helisim.sim.flight import simulate
from helisim.sim.ground import Deck, Ground, Swing
from helisim.sim.missions import TakeOffHoverLand
from helisim.vehicle.addresses import addresses
from tabled import tabled

SWAYING = Deck(
    heave=Swing(amplitude=0.3, period=6.0, phase=0.4),
    roll=Swing(amplitude=0.05, period=8.0),
    pitch=Swing(amplitude=0.03, period=5.0, phase=1.0),
)


@pytest.fixture(scope="module")
def blade360():
    return hs.load("blade360")


def standing(vehicle, ground, rotor=0.0):
    model = vehicle.grounded_model(ground.put_into)
    data = mujoco.MjData(model)
    replace(ground, parked=True).begin(vehicle, model, data)
    model.actuator_user[addresses(model).rotor, PARAM.gyro_on] = 0.0
    data.ctrl[addresses(model).control + CONTROL.rotor] = rotor
    return model, data


def stepped(model, data, seconds):
    rows = []
    with installed():
        while data.time < seconds:
            mujoco.mj_step(model, data)
            rows.append([data.time, *data.qpos[:3], *data.sensor("contact").data])
    rows = np.array(rows)
    return rows[:, 0], rows[:, 1:4], rows[:, 4:]


@pytest.mark.slow
@pytest.mark.parametrize(("integrator", "slope"), [("RK4", math.radians(10.0)), ("Euler", 0.0)])
def test_it_stands_for_a_minute_with_its_rotor_stopped(integrator, slope):
    vehicle = hs.load(integrator=integrator)
    model, data = standing(vehicle, Ground(slope=slope, uphill=0.7))
    _, position, contact = stepped(model, data, 60.0)
    weight = model.body_subtreemass[1] * 9.8015
    assert contact[-1] == pytest.approx([0.0, 0.0, -weight], abs=1e-3 * weight)  # while it creeps
    assert np.ptp(contact[1000:, 2]) < 1e-3 * weight  # it jitters by less than that
    # regularised friction creeps with 1/impratio of the slip that a soft contact would have
    assert np.ptp(position, axis=0).max() < 1e-3
    assert np.abs(data.qvel).max() < 1e-4


@pytest.mark.parametrize("share", [0.97, 1.03])
def test_it_tips_over_where_its_weight_leaves_the_skids(blade360, share):
    """Statics: the slope's tangent is half the track over the height of the centre of gravity."""
    # of the MJCF: skids 70 mm aside and 85 mm below the centre of gravity, of 3 mm radius
    steepest = math.atan(0.070 / 0.088)
    model, data = standing(blade360, Ground())
    model.geom_friction[:, 0] = 2.0
    slope = share * steepest
    model.opt.gravity[:] = 9.80665 * np.array([0.0, math.sin(slope), -math.cos(slope)])
    stepped(model, data, 4.0)
    upright = data.body("blade360").xmat[8]
    # the soft skids give way by a fraction of a degree; over, it lies on its side
    assert (upright > math.cos(0.05)) == (share < 1.0)


@pytest.mark.parametrize(("name", "integrator"), [("jr700", "RK4"), ("blade360", "Euler")])
def test_a_fall_is_stopped_by_skids_that_give_way(name, integrator):
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


def test_the_deck_moves_as_it_is_told():
    """The heavy body on springs keeps to its sines, with a helicopter on it, as `pose` has it."""
    model, data = standing(hs.load(integrator="Euler"), Ground(deck=SWAYING))
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
    north_rise = Ground(slope=0.3)
    point = np.array([[[1.0, 5.0, -2.0]]])
    normal = np.array([-math.sin(0.3), 0.0, -math.cos(0.3)])
    assert north_rise.heights(np.zeros(1), point)[0, 0] == pytest.approx(point[0, 0] @ normal)
    east_rise = Ground(slope=0.3, uphill=0.5 * math.pi)
    aside = east_rise.heights(np.zeros(1), np.array([[[7.0, 1.0, 0.0]]]))
    assert aside[0, 0] == pytest.approx(-math.sin(0.3))
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
    step = hs.Step(axis=axis, amplitude=amplitude, trim_time=1.0, duration=duration)
    return hs.FlightPlan(
        excitation=step, pilot=QUIET, ground=ground, weather=hs.Weather(height=height)
    )


def test_it_takes_off_by_itself_and_a_landing_is_no_end(jr700):
    still, weather = replace(STILL, duration=10.0), hs.Weather(height=1.5)
    parked = {"pilot": QUIET, "ground": Ground(parked=True), "weather": weather}
    flight = flown(jr700, hs.FlightPlan(excitation=still, **parked))
    assert flight.end is None
    weight = 8.01 * 9.8015
    assert flight.contact[0] == pytest.approx([0.0, 0.0, -weight], abs=0.08 * weight)
    assert not flight.contact[200:].any()
    assert -flight.positions[-1, 2] == pytest.approx(1.5, abs=0.2)
    # let down with a second of less collective, it stands; in the air alone that is the end
    down = pushed("col", -0.03, Ground(), height=0.35, duration=8.0)
    flight = flown(jr700, down)
    assert flight.end is None
    assert np.abs(flight.contact[-1]).max() > 0.0
    assert "touched the ground" in flown(jr700, replace(down, ground=None)).end.why


@tabled("plan", "why")
def test_ends_and_their_reasons(jr700, plan, why):
    end = flown(jr700, plan).end
    assert end is not None
    assert re.search(why, end.why)


@tabled("ground")
def test_a_mission_takes_off_and_lands_again(jr700, ground):
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


def test_a_hand_crashes_into_a_deck_that_comes_up(jr700):
    deck = Deck(heave=Swing(amplitude=3.0, period=6.0), above=10.0)
    flight = hs.HandFlight(jr700, ground=Ground(deck=deck), height=1.0)
    flight.fly(2.0)
    assert re.search(r"hit the ground at [23]\.\d m/s", flight.crashed)
