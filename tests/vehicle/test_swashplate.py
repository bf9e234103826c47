"""Swashplates: where three servos stand, and what each does for collective and cyclic."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from helisim.base.errors import ModelError
from helisim.records.record import IN1, SERVOS
from helisim.sim import FlightPlan, Recorder, Sweep, fly
from helisim.vehicle import load
from helisim.vehicle.parameters import Parameters, completed
from helisim.vehicle.swashplate import Swashplate
from plates import H3_120

DEFAULT = completed(Parameters({}))
ROOT_2, ROOT_3 = math.sqrt(2.0), math.sqrt(3.0)

FRONT_REAR_120 = {"front_angle": 180.0, "left_angle": 60.0, "right_angle": -60.0}
H3_140 = {
    "front_angle": 180.0,
    "left_angle": 45.0,
    "right_angle": -45.0,
    "left_arm": ROOT_2,
    "right_arm": ROOT_2,
}
H3_90 = {"front_angle": 180.0, "left_angle": 90.0, "right_angle": -90.0}


def plate(**changes):
    """Return a swashplate that differs from the default, angles in degrees."""
    values = {
        f"swashplate.{name}": math.radians(value) if name.endswith("angle") else value
        for name, value in changes.items()
    }
    return Swashplate.of(DEFAULT.replace(values))


# ArduPilot, libraries/AP_Motors/AP_MotorsHeli_Swash.cpp: roll, pitch and collective factors of
# servo 1 (left), 2 (right) and 3 (elevator, behind): H3-140 as plain numbers, H3-120 by cosines of
# angles, H3-90 by its adjustable servo positions of -90, 90 and 180 degrees. Its roll is positive
# left servo up, its pitch front up, both as here.
@pytest.mark.parametrize(
    ("geometry", "left", "right", "elevator"),
    [
        (FRONT_REAR_120, (0.5 * ROOT_3, 0.5), (-0.5 * ROOT_3, 0.5), (0.0, -1.0)),
        (H3_140, (1.0, 1.0), (-1.0, 1.0), (0.0, -1.0)),
        (H3_90, (1.0, 0.0), (-1.0, 0.0), (0.0, -1.0)),
    ],
)
def test_the_mixing_is_that_of_a_published_autopilot(geometry, left, right, elevator):
    """The geometry that the documentation gives for each gives ArduPilot's factors."""
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
    """A plate's height at the ball link is col + x lon + y lat; a reversed servo turns it over."""
    turns = np.radians(angles)
    x, y = arms * np.cos(turns), arms * np.sin(turns)
    area = abs((x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]))
    assume(area > 0.05)
    found = plate(
        **{f"{name}_angle": value for name, value in zip(("front", "left", "right"), angles)},
        **{f"{name}_arm": value for name, value in zip(("front", "left", "right"), arms)},
        **{f"{name}_sign": value for name, value in zip(("front", "left", "right"), signs)},
    )
    col, lon, lat = at
    servos = found.mix(col, lon, lat)
    # rounding; cosines within 1e-12 of a plain value take it
    assert servos == pytest.approx(signs * (col + x * lon + y * lat), abs=1e-11)
    assert found.unmix(*servos) == pytest.approx(at, abs=1e-11 / area)
    assert np.abs(H3_120.mix(-0.25, 1.0, 0.0)).max() == pytest.approx(0.75)


def test_the_flight_does_not_depend_on_where_the_servos_stand():
    """Within travel and rate the swashplate goes where the gyro sends it, so IN1 is the same."""
    plan = FlightPlan(
        excitation=Sweep(axis="lat", duration=8.0, trim_time=1.0),
        recorder=Recorder(latency={}, noise={}, resolution={}),
    )
    angles = {
        f"swashplate.{name}": math.radians(value)
        for name, value in H3_140.items()
        if name.endswith("angle")
    }
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


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"swashplate.left_arm": 0.0}, "'swashplate.left_arm' must be positive, got 0"),
        ({"swashplate.front_sign": 0.5}, "'swashplate.front_sign' must be one of -1, 1"),
        ({"swashplate.left_angle": 0.0}, "too nearly in one line .* ways: 0, 0, -120 degrees"),
    ],
)
def test_a_swashplate_that_is_none_is_refused(changes, message):
    """One sentence with what was given and what to change."""
    with pytest.raises(ModelError, match=message):
        load("jr700", parameters=changes)
