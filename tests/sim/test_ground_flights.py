"""Flights over a ground: taking off, landing, by plan, mission and hand, and how they end."""

import math
import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_ground import SWAYING

import helisim as hs
from helisim.base.errors import InputError
from helisim.physics.native import installed
from helisim.show.viewer import prepare_live
from helisim.sim.flight import simulate
from helisim.sim.ground import Deck, Ground, Swing
from helisim.sim.missions import TakeOffHoverLand

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


@pytest.mark.parametrize(
    ("make", "why"),
    [
        (lambda: Ground(slope=-0.1), "slope must be a number 0 or more and below 1.57"),
        (lambda: Ground(slope=0.1, deck=Deck()), "a slope or a deck, not both"),
        (lambda: Ground(slope="steep"), "slope must be a number .*got 'steep'"),
        (lambda: Ground(parked=3), "parked must be"),
        (lambda: Deck(length="8"), "length must be a number .*got '8'"),
        (lambda: Swing(amplitude="a", period=1.0), "amplitude must be a number, got 'a'"),
        (lambda: Ground(friction=0.0), "friction must be a number above 0"),
        (lambda: Ground(effect=1.5), "effect must be a number 0 or more and at most 1"),
        (lambda: Ground(rotor=-1.0), "rotor must be a number 0 or more and at most 1"),
        (lambda: Ground(rotor=0.0), "only a parked flight starts with a slow rotor"),
        (lambda: Ground(deck=3.0), "must be a .*Deck"),
        (lambda: Deck(heave=0.3), "heave must be a .*Swing"),
        (lambda: Deck(length=0.0), "length must be a number above 0 m"),
        (lambda: Deck(roll=Swing(amplitude=0.6)), "roll must stay below 0.5 rad"),
        (lambda: Deck(above=1.0, heave=Swing(amplitude=-1.0)), "1 m above .* can't heave by 1 m"),
        (lambda: Swing(amplitude=1.0, period=0.0), "period must be a number above 0 s"),
        (lambda: Swing(amplitude=math.nan), "amplitude must be a finite number"),
    ],
)
def test_what_no_ground_is(make, why):
    """Each mistake is told in one line."""
    with pytest.raises(InputError, match=why) as caught:
        make()
    assert "\n" not in str(caught.value)


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
