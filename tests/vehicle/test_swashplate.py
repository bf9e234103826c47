"""Swashplates, and from a blade to eq. (8) and back: against the flapping of one blade."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from helisim.base.errors import InputError, ModelError
from helisim.records.record import IN1, SERVOS
from helisim.sim import FlightPlan, Recorder, Sweep, fly
from helisim.vehicle import load
from helisim.vehicle.parameters import Parameters, completed
from helisim.vehicle.swashplate import Flapping, Swashplate, TipPathPlane, flapping_from_blade
from one_blade import OneBlade
from plates import H3_120
from tabled import tabled

DEFAULT = completed(Parameters({}))
ROOT_2, ROOT_3 = math.sqrt(2.0), math.sqrt(3.0)

FRONT_REAR_120 = {"front_angle": 180.0, "left_angle": 60.0, "right_angle": -60.0}
ANGLES_140 = {"front_angle": 180.0, "left_angle": 45.0, "right_angle": -45.0}
H3_140 = {**ANGLES_140, "left_arm": ROOT_2, "right_arm": ROOT_2}
H3_90 = {"front_angle": 180.0, "left_angle": 90.0, "right_angle": -90.0}


def disc_of(flapping, speed, direction):
    turned = {"main_rotor.speed": speed, "main_rotor.direction": direction}
    return TipPathPlane.of(flapping.to_parameters() | turned)


def plate(**changes):
    values = {
        f"swashplate.{name}": math.radians(value) if name.endswith("angle") else value
        for name, value in changes.items()
    }
    return Swashplate.of(DEFAULT.replace(values))


# ArduPilot, libraries/AP_Motors/AP_MotorsHeli_Swash.cpp: roll, pitch and collective factors of
# servo 1 (left), 2 (right) and 3 (elevator, behind): H3-140 as plain numbers, H3-120 by cosines of
# angles, H3-90 by its adjustable servo positions of -90, 90 and 180 degrees. Its roll is positive
# left servo up, its pitch front up, both as here.
@tabled("geometry", "left", "right", "elevator")
def test_the_mixing_is_that_of_a_published_autopilot(geometry, left, right, elevator):
    found = np.array(plate(**geometry).mix(*np.eye(3)))  # servos by (col, lon, lat)
    roll_pitch_collective = [(*factors, 1.0) for factors in (elevator, left, right)]
    assert found[:, [2, 1, 0]] == pytest.approx(np.array(roll_pitch_collective), abs=1e-15)


angle = st.floats(-180.0, 180.0)
arm = st.floats(0.5, 2.0)
unit = st.floats(-1.0, 1.0)


@given(
    angles=st.tuples(angle, angle, angle),
    arms=st.tuples(arm, arm, arm),
    signs=st.tuples(*[st.sampled_from([-1.0, 1.0])] * 3),
    at=st.tuples(unit, unit, unit),
)
def test_any_three_servos_stand_on_the_plane_of_the_swashplate(angles, arms, signs, at):
    turns = np.radians(angles)
    x, y = arms * np.cos(turns), arms * np.sin(turns)
    area = abs((x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]))
    assume(area > 0.05)
    given = {
        f"{name}_{what}": value
        for what, values in (("angle", angles), ("arm", arms), ("sign", signs))
        for name, value in zip(("front", "left", "right"), values)
    }
    found = plate(**given)
    col, lon, lat = at
    servos = found.mix(col, lon, lat)
    # rounding; cosines within 1e-12 of a plain value take it
    assert servos == pytest.approx(signs * (col + x * lon + y * lat), abs=1e-11)
    assert found.unmix(*servos) == pytest.approx(at, abs=1e-11 / area)
    assert np.abs(H3_120.mix(-0.25, 1.0, 0.0)).max() == pytest.approx(0.75)


def test_the_flight_does_not_depend_on_where_the_servos_stand():
    plan = FlightPlan(
        excitation=Sweep(axis="lat", duration=8.0, trim_time=1.0),
        recorder=Recorder(latency={}, noise={}, resolution={}),
    )
    angles = {f"swashplate.{name}": math.radians(value) for name, value in ANGLES_140.items()}
    arms = {"swashplate.left_arm": ROOT_2, "swashplate.right_arm": ROOT_2}
    other = load("jr700", parameters={**angles, **arms, "swashplate.front_sign": -1.0})
    one, two = (fly(vehicle, plan, jobs=1)[0] for vehicle in (load("jr700"), other))
    assert np.abs(one.select(SERVOS[:3]) - two.select(SERVOS[:3])).max() > 0.01
    for name in set(one.names) - set(SERVOS):
        # rounding, in a stable loop
        assert one[name] == pytest.approx(two[name], abs=1e-10), name
    assert two.select(IN1)[:, :3] == pytest.approx(
        np.column_stack(other.swashplate.unmix(*two.select(SERVOS[:3]).T)), abs=1e-12
    )
    parameters = two.provenance["parameters"]
    assert Swashplate.of(parameters).numbers == pytest.approx(other.swashplate.numbers, abs=0.0)


def steady(found: Flapping, lat=0.0, lon=0.0, p=0.0, q=0.0):
    asked = [
        found.a_lat * lat + found.a_lon * lon - found.tau_f * q,
        found.b_lat * lat + found.b_lon * lon - found.tau_f * p,
    ]
    return np.linalg.solve([[1.0, -found.a_b], [-found.b_a, 1.0]], asked)


@tabled("direction", "lock", "frequency", "flown")
def test_a_steady_disc_is_that_of_one_blade(direction, lock, frequency, flown):
    turning = {"lock_number": lock, "speed": 100.0, "direction": direction}
    ranges = {"lon_range": 0.3, "lat_range": 0.25}
    found = flapping_from_blade(**turning, flap_frequency=frequency, **ranges)
    rates = flown.get("p", 0.0), flown.get("q", 0.0)
    cyclic = 0.3 * flown.get("lon", 0.0), 0.25 * flown.get("lat", 0.0)
    moved = {"direction": direction, "rates": rates, "cyclic": cyclic}
    blade = OneBlade(lock=lock, spring=frequency**2 - 1.0, **moved)
    _, a, b = blade.steady()
    size = np.hypot(a, b)
    # nothing is neglected in a steady state: 60 strips miss the moment by 1 / (2 x 60^2), and 1e-6
    # of the beginning is left
    assert steady(found, **flown) == pytest.approx([a, b], abs=3e-4 * size)


sizes = st.floats(0.01, 0.5)


@given(
    tau=st.floats(0.005, 0.3),
    couplings=st.tuples(sizes, sizes),
    cyclic=st.tuples(*[st.floats(-0.5, 0.5)] * 4),
    speed=st.floats(20.0, 300.0),
    direction=st.sampled_from([1.0, -1.0]),
)
def test_there_and_back(tau, couplings, cyclic, speed, direction):
    coupled = {"a_b": -direction * couplings[0], "b_a": direction * couplings[1]}
    given = Flapping(
        tau_f=tau, **coupled, **dict(zip(("a_lat", "a_lon", "b_lat", "b_lon"), cyclic))
    )
    disc = disc_of(given, speed, direction)
    again = disc.flapping(speed=speed, direction=direction)
    # rounding, where a short time constant makes the air strong: share up to 10
    assert again.to_parameters() == pytest.approx(given.to_parameters(), rel=1e-11, abs=1e-11)
    assert np.trace(disc.springs) == pytest.approx(0.0, abs=1e-11)


def test_what_no_rotor_has_is_refused():
    other = Flapping(tau_f=0.01, a_b=2.0, b_a=-2.0, a_lat=0.0, a_lon=0.3, b_lat=0.3, b_lon=0.0)
    with pytest.raises(ModelError, match="turns the other way"):
        disc_of(other, 100.0, 1.0)
    usual = {"speed": 27.0, "direction": -1.0, "lon_range": 0.3, "lat_range": 0.3}
    for wrong in ({"lock_number": 0.0}, {"lock_number": 8.0, "flap_frequency": 0.9}):
        with pytest.raises(InputError, match="a positive lock_number and speed"):
            flapping_from_blade(**usual, **wrong)
