"""A script's pilot against a played autopilot: what it sends, waits for, and holds."""

import math

import numpy as np
import pytest

from helisim.base.errors import AutopilotError, UnknownNameError
from helisim.sim.weather import Weather
from helisim.sitl.pilot import MODES, Hold, Pilot, Sticks, Telemetry
from helisim.sitl.systemid import Sweep, fly_sweep, fly_sweeps

pytest.importorskip("pymavlink", reason="a ground station speaks by pymavlink")

from played_copter import GUIDED, LAND, STABILIZE, STEP, SYSTEMID, PlayedCopter
from tabled import rows, tabled

ARM, TAKE_OFF = 400, 22
"""MAVLink's common.xml: MAV_CMD_COMPONENT_ARM_DISARM, MAV_CMD_NAV_TAKEOFF."""
HELD = {"ATC_ANGLE_MAX": 30.0, "ATC_HOVR_ROL_TRM": -400.0}
HELD |= {f"IM_STB_COL_{k}": one for k, one in ((1, 0.0), (2, 50.0), (3, 70.0), (4, 100.0))}


@pytest.fixture
def copter():
    with PlayedCopter() as one:
        yield one


def piloted(copter, said=None):
    said = [] if said is None else said
    return Pilot(copter, Telemetry(copter.channel, said.append), said.append)


def held(copter, pilot):
    copter.parameters |= HELD
    copter.place = np.array([3.0, -2.0, -20.0])
    copter.fly(pilot.wait(1.5), pilot)
    return Hold(pilot)


def test_from_the_ground_to_the_ground(copter):
    """In ArduPilot's order: aligned, logging, armed, rotor up to speed, off; down, rotor off."""
    said = []
    pilot = piloted(copter, said)

    def script():
        yield from pilot.take_off(4.0)
        assert abs(pilot.height - 4.0) < 0.3
        assert pilot.speed < 0.3
        yield from pilot.go_to(6.0, -8.0, 5.0)
        assert math.dist(copter.place, (6.0, -8.0, -5.0)) < 0.3
        assert pilot.speed < 0.3
        yield from pilot.land()

    copter.fly(script(), pilot)
    log = rows(globals(), "test_from_the_ground_to_the_ground")
    assert [tuple(what) for _, *what in copter.log] == log
    begun = {tuple(what[:3]): time for time, *what in copter.log}
    # the EKF, its rest, and the log's start; then the rotor's run-up
    assert begun["mode", STABILIZE] > 9.0 + 5.0 + 3.0
    assert begun["command", TAKE_OFF, 0.0] > begun["command", ARM, 1.0] + 7.0 + 2.0
    assert copter.rates == {0: 10.0, 193: 5.0, 32: 20.0, 30: 20.0, 83: 20.0}
    assert copter.station == (255, 190)
    assert copter.rotor_speed < 0.02
    assert not copter.armed
    assert copter.pulses == [1500, 1500, 1000, 1500, 1000, 1000, 1000, 1000]
    assert said == [
        *("waiting for the EKF", "arming", "rotor on", "taking off to 4 m", "landing", "rotor off")
    ]


@pytest.mark.parametrize(("weather", "turns"), [(None, 0.02), (Weather(turbulence="light"), 0.3)])
def test_a_rotor_in_gusts_need_not_stand_still(weather, turns):
    """It is over once the rotor is slower than 2 %, or 30 % that gusts may turn it at."""
    with PlayedCopter(weather=weather) as copter:
        pilot = piloted(copter)
        copter.fly(pilot.wait(1.5), pilot)
        copter.rotor_speed = 1.0
        copter.fly(pilot.land(), pilot)
        assert copter.rotor_speed == pytest.approx(turns, abs=1.5e-3)  # 0.1 a second, in steps


@tabled("sticks", "pulses")
def test_sticks_are_pulses_in_ardupilots_order(sticks, pulses):
    """Channels 1 to 4 are roll, pitch, throttle, yaw (ArduPilot's RCMAP), 8 the interlock."""
    assert sticks.pulses == pulses


def test_modes_are_those_of_pymavlinks_own_list():
    from pymavlink.mavutil import mode_mapping_acm

    assert {mode_mapping_acm[number].lower(): number for number in MODES.values()} == MODES


@tabled("steps", "seconds", "says")
def test_what_does_not_come_is_told_in_time(copter, steps, seconds, says):
    pilot = piloted(copter)
    copter.say("bad day")
    copter.fly(pilot.wait(1.5), pilot)
    copter.refused = {GUIDED: 1, TAKE_OFF: 4, "NO": 1}
    begun = copter.time
    with pytest.raises(AutopilotError, match=says):
        copter.fly(steps(pilot), pilot)
    assert copter.time - begun == pytest.approx(seconds, abs=0.1)
    with pytest.raises(UnknownNameError, match="hover"):
        copter.fly(pilot.mode("hover"), pilot)


def test_what_it_says_is_kept_and_warnings_are_told(copter):
    said = []
    pilot = piloted(copter, said)
    assert pilot.telemetry.mode is None
    assert not pilot.telemetry.armed
    assert pilot.shown["mode"] == ""
    assert math.isnan(pilot.telemetry.numbers("ATTITUDE", "yaw")[0])
    for severity in range(3, 7):
        copter.say(f"text {severity}", severity)
    copter.say("another's", 1, component=2)
    copter.fly(pilot.wait(0.05), pilot)
    assert pilot.telemetry.said == [f"text {severity}" for severity in range(3, 7)]
    assert said == ["ArduPilot: text 3", "ArduPilot: text 4"]
    pilot.sticks = Sticks(roll=0.1, throttle=0.5, rotor=True)
    copter.fly(pilot.wait(1.5), pilot)
    sticks = {"roll": "+0.10", "pitch": "+0.00", "throttle": "+0.50", "yaw": "+0.00"}
    assert pilot.shown == {"mode": "number 17", **sticks, "rotor": "on"}
    copter.mode = SYSTEMID
    copter.fly(pilot.wait(0.2), pilot)
    assert pilot.shown["mode"] == "systemid"


@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_a_hold_brings_back_what_is_away(copter, heading):
    """Of 1/s^2 twice at 0.1 rad/s: away (1 + 0.1 t) exp(-0.1 t), whatever the heading."""
    copter.heading, pilot = heading, piloted(copter)
    hold = held(copter, pilot)
    copter.attitude = (math.radians(-4.0), 0.0)  # which the autopilot adds to the sticks' roll
    copter.lean = math.radians(30.0)
    copter.fly(pilot.wait(0.2), pilot)
    copter.fly(hold.learn(), pilot)
    copter.mode = STABILIZE
    copter.place += [15.0, -12.0, 0.0]
    begun = copter.time
    copter.fly(hold.fly(20.0), pilot)
    assert copter.time - begun == pytest.approx(20.0, abs=1.5 * STEP)
    left = 3.0 * math.exp(-2.0)
    # sticks are whole us: half of one is 5 mm/s^2, which 0.01/s^2 holds half a metre away
    assert copter.place[:2] - [3.0, -2.0] == pytest.approx([15.0 * left, -12.0 * left], abs=0.5)


@pytest.mark.parametrize(
    ("down", "sink", "thrust"), [(0.0, 0.0, 0.56), (1.0, 0.0, 0.563), (0.0, 0.5, 0.575)]
)
def test_a_hold_gives_the_thrust_of_its_height(copter, down, sink, thrust):
    """0.03 s/m over the velocity, and over 0.1 rad/s of what it is too low; the stick by the curve.

    IM_STB_COL: thrust of 0, 50, 70 and 100 % at 0, 40, 60 and 100 % of the stick.
    """
    pilot = piloted(copter)
    hold = held(copter, pilot)
    copter.thrust = 0.56
    copter.fly(pilot.wait(0.2), pilot)
    copter.fly(hold.learn(), pilot)
    copter.place[2] += down - sink * STEP
    copter.velocity[2] = sink
    copter.fly(pilot.wait(STEP), pilot)
    next(hold.fly(0.0))
    assert pilot.sticks.throttle == pytest.approx(0.4 + (thrust - 0.5), abs=1e-6)
    copter.place += [1e3, 0.0, 1e3]  # m: no more than 0.05 of thrust, and 3 degrees of 30
    pilot.sensed = copter.sensed
    next(hold.fly(0.0))
    assert pilot.sticks.throttle == pytest.approx(0.4 + 0.61 - 0.5, abs=1e-6)
    assert pilot.sticks.pitch == pytest.approx(0.1, abs=1e-6)


@pytest.mark.slow
def test_sweeps_are_flown_one_after_the_other_in_one_place(copter):
    copter.parameters |= HELD
    pilot = piloted(copter, said := [])
    sweeps = [Sweep("roll", 0.06, 1.0, 5.0, 10.0), Sweep("yaw", 0.07, 1.0, 5.0, 12.0)]
    copter.fly(fly_sweeps(sweeps)(pilot), pilot)
    assert (pilot.sticks.roll, pilot.sticks.pitch, pilot.sticks.yaw) == (0.0, 0.0, 0.0)
    modes = [(what[1], time) for time, *what in copter.log if what[0] == "mode"]
    order = [STABILIZE, GUIDED, *[GUIDED, STABILIZE, SYSTEMID] * 2, GUIDED, GUIDED, LAND]
    assert [mode for mode, _ in modes] == order
    for k, seconds in ((4, 13.0), (7, 15.0)):
        took = [modes[k + one][1] - modes[k + one - 1][1] for one in (1, 0)]
        assert took == pytest.approx([seconds, 2.0], abs=0.2)  # heartbeats are 0.1 s apart
    assert [what[2] for _, *what in copter.log if what[1] == "SID_AXIS"] == [10, 12]
    assert [copter.parameters[name] for name in list(sweeps[1].parameters)[1:]] == pytest.approx(
        [0.07, 1.0, 5.0, 12.0, 5.0, 2.0]
    )
    heights = [-what[3] for _, *what in copter.log if what[0] == "target"]
    assert heights == [50.0, 50.0, 50.0, 5.0]
    told = "SystemID axis 12, yaw: 0.07 of the mixer's 1, 1 to 5 Hz in 12 s"
    assert f"sweep 2 of 2: {told}" in said


@tabled("away", "text", "says")
def test_a_sweep_ends_where_the_autopilot_stops_it_or_it_goes_far(copter, away, text, says):
    """What was said before it began is of an earlier sweep."""
    pilot = piloted(copter)
    held(copter, pilot)
    copter.say("SystemID Stopped")

    def script():
        for step in fly_sweep(pilot, Sweep("pitch", 0.06, 1.0, 5.0, 10.0)):
            if copter.mode == SYSTEMID and not gone:
                gone.append(copter.time)
                copter.place += away
            if gone and text and copter.time > gone[0] + 1.0:
                copter.say(text)
            yield step

    gone = []
    with pytest.raises(AutopilotError, match=says):
        copter.fly(script(), pilot)
    assert copter.time - gone[0] < 1.2
