"""ArduPilot's mixing and our swashplate meet: its roll is our lat, its pitch our lon."""

import math

import numpy as np
import pytest

from helisim.errors import InputError
from helisim.sitl.mixing import Controls, Mixer
from helisim.sitl.outputs import Output, Outputs
from helisim.vehicle.swashplate import Swashplate

ANYWHERE = {
    "H_SW_TYPE": 0.0,
    "H_SW_H3_SV1_POS": 0.0,
    "H_SW_H3_SV2_POS": -120.0,
    "H_SW_H3_SV3_POS": 120.0,
    "H_COL_MIN": 1167.0,
    "H_COL_MAX": 1833.0,
    "SERVO4_MIN": 1000.0,
    "SERVO4_MAX": 2000.0,
}
EQUAL = {"H_SW_TYPE": 3.0, "H_COL_MIN": 1460.0, "H_COL_MAX": 1740.0}


# What ArduCopter-heli 4.7.0-dev logged at one time: RATE's ROut, POut, YOut, AOut, and RCOU's C1
# to C4. The first three flew the JR700, the last three its own simulated helicopter.
@pytest.mark.parametrize(
    ("parameters", "lat", "lon", "ped", "col", "pulses"),
    [
        (ANYWHERE, 0.066048, 0.010228, -0.113141, 0.473976, (1487, 1506, 1454, 1443)),
        (ANYWHERE, -0.021438, -0.020229, 0.01363, 0.0, (1157, 1163, 1179, 1506)),
        (ANYWHERE, 0.006698, 0.003613, 0.004299, 0.500486, (1501, 1502, 1496, 1502)),
        (EQUAL, -0.038366, -0.082324, 0.203614, 0.494, (1564, 1594, 1635, 1581)),
        (EQUAL, 0.031711, 0.088157, 0.203636, 0.494, (1630, 1605, 1558, 1581)),
        (EQUAL, 0.00048, -0.000133, 0.208034, 0.50322, (1601, 1600, 1600, 1583)),
    ],
)
def test_a_real_log_s_pulses_are_repeated(parameters, lat, lon, ped, col, pulses):
    """From what its rate controllers ask for come the pulses that it sent, to the microsecond."""
    mixer = Mixer.of(parameters)
    assert mixer.pulses({"lat": lat, "lon": lon, "ped": ped, "col": col}) == dict(
        zip((1, 2, 3, 4), pulses)
    )


PLATE = {
    **{
        f"swashplate.{name}_angle": math.radians(angle)
        for name, angle in {"front": 0.0, "left": 120.0, "right": -120.0}.items()
    },
    **{f"swashplate.{name}_arm": 1.0 for name in ("front", "left", "right")},
    **{f"swashplate.{name}_sign": 1.0 for name in ("front", "left", "right")},
}


def test_servos_at_their_azimuths_turn_roll_into_lat_alone():
    """450 us of 500 for a travel of 0.75 are 0.675 of lat; no command moves another's control."""
    controls = Controls(Mixer.of(ANYWHERE), Outputs(), Swashplate.of(PLATE))
    expected = np.diag([0.75 * 666.0 / 500.0, 0.675, 0.675, 0.75])
    np.testing.assert_allclose(controls.scale(0.5), expected, atol=1e-12)


def test_a_wrong_azimuth_is_seen_in_the_scale():
    """Left and right exchanged, roll goes the other way: the diagonal says so."""
    wrong = {**ANYWHERE, "H_SW_H3_SV2_POS": 120.0, "H_SW_H3_SV3_POS": -120.0}
    scale = Controls(Mixer.of(wrong), Outputs(), Swashplate.of(PLATE)).scale(0.5)
    assert scale[2, 2] == pytest.approx(-0.675)


def test_full_cyclic_stops_at_its_limit():
    """H_CYC_MAX 2500 lets a servo move by 250 us (wiki: swashplate setup, H_CYC_MAX of 4500)."""
    pulses = Mixer.of(ANYWHERE).exact({"lon": 1.0, "col": 0.5})
    assert pulses[1] - 1500.0 == pytest.approx(250.0)
    reversed_one = Mixer.of({**ANYWHERE, "SERVO1_REVERSED": 1.0})
    assert reversed_one.exact({"lon": 1.0, "col": 0.5})[1] - 1500.0 == pytest.approx(-250.0)


def test_a_servo_s_trim_moves_its_pulse_and_not_its_position():
    """A servo that stands in its middle at 1520 us has SERVO1_TRIM 1520."""
    outputs = Outputs(front=Output(1, 1520.0, -500.0))
    matched = {**ANYWHERE, "SERVO1_TRIM": 1520.0, "SERVO1_REVERSED": 1.0}
    scale = Controls(Mixer.of(matched), outputs, Swashplate.of(PLATE)).scale(0.5)
    np.testing.assert_allclose(scale, np.diag(np.diag(scale)), atol=1e-12)


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"H_SW_TYPE": 4.0}, "H_SW_TYPE 4"),
        ({"H_TAIL_TYPE": 2.0}, "H_TAIL_TYPE 2"),
        ({"SERVO2_FUNCTION": 0.0}, "34"),
    ],
)
def test_what_it_does_not_know_is_said(parameters, said):
    """Four servos, a motor at the tail, a servo without output: one line each."""
    with pytest.raises(InputError, match=said):
        Mixer.of({**ANYWHERE, **parameters})
