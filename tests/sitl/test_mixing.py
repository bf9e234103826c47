"""ArduPilot's mixing and our swashplate meet: its roll is our lat, its pitch our lon."""

import numpy as np
import pytest

import helisim as hs
from helisim.base.errors import InputError
from helisim.sitl.mixing import Mixer, Outputs, command_scale
from plates import H3_120
from tabled import tabled

ANYWHERE = {"H_SW_TYPE": 0.0, "H_COL_MIN": 1167.0, "H_COL_MAX": 1833.0}
ANYWHERE |= {"H_SW_H3_SV1_POS": 0.0, "H_SW_H3_SV2_POS": -120.0, "H_SW_H3_SV3_POS": 120.0}
ANYWHERE |= {"SERVO4_MIN": 1000.0, "SERVO4_MAX": 2000.0}
EQUAL = {"H_SW_TYPE": 3.0, "H_COL_MIN": 1460.0, "H_COL_MAX": 1740.0}


# What ArduCopter-heli 4.7.0-dev logged: RATE's ROut, POut and AOut at one time and YOut a tick
# before, as the tail's pulse is sent a tick late, and RCOU's C1 to C4. The first three flew the
# JR700, the last three its own simulated helicopter.
@tabled("parameters", "lat", "lon", "ped", "col", "pulses")
def test_a_real_log_s_pulses_are_repeated(parameters, lat, lon, ped, col, pulses):
    exact = Mixer(parameters).exact({"lat": lat, "lon": lon, "ped": ped, "col": col})
    assert [int(exact[channel]) for channel in (1, 2, 3)] == list(pulses[:3])
    assert abs(exact[4] - pulses[3]) < 1.2  # the yaw command is cut too, to 1 of 4500
    if parameters is EQUAL:  # as three servos stand that say nothing (H_SW_H3_SV1_POS: -60, ...)
        anywhere = Mixer({**EQUAL, "H_SW_TYPE": 0.0}).exact({"lat": lat, "lon": lon, "col": col})
        assert [anywhere[k] for k in (1, 2, 3)] == pytest.approx([exact[k] for k in (1, 2, 3)])


def test_servos_at_their_azimuths_turn_roll_into_lat_alone():
    """450 us of 500 for a travel of 0.75 are 0.675 of lat; no command moves another's control."""
    scale = command_scale(Mixer(ANYWHERE), Outputs(), H3_120, 0.5)
    expected = np.diag([0.75 * 666.0 / 500.0, 0.675, 0.675, 0.75])
    np.testing.assert_allclose(scale, expected, atol=1e-12)


def test_full_cyclic_stops_at_its_limit():
    """H_CYC_MAX 2500 lets a servo move by 250 us (wiki: swashplate setup, H_CYC_MAX of 4500)."""
    pulses = Mixer(ANYWHERE).exact({"lon": 1.0, "col": 0.5})
    assert pulses[1] - 1500.0 == pytest.approx(250.0)
    assert Mixer({**ANYWHERE, "H_SW_COL_DIR": 1.0}).exact({"col": 1.0})[1] == 1500.0 - 333.0
    reversed_one = Mixer({**ANYWHERE, "SERVO1_REVERSED": 1.0})
    assert reversed_one.exact({"lon": 1.0, "col": 0.5})[1] - 1500.0 == pytest.approx(-250.0)


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
        Mixer({**ANYWHERE, **parameters})


def test_the_ends_of_the_pulses_are_the_ends_of_the_travel():
    pulses = [2000, 1000, 1750, 1500, *[0] * 12]
    assert Outputs(reach=0.75).servos(pulses, [0.0] * 4) == [0.75, -0.75, 0.375, 0.0]


def test_a_reversed_servo_on_another_channel_with_another_trim():
    left = {"left_channel": 11.0, "left_trim": 1520e-6, "left_travel": -400e-6}
    changed = {f"outputs.{name}": value for name, value in left.items()}
    outputs = Outputs.of({**hs.load("jr700").parameters, **changed})
    pulses = [1500] * 10 + [1720] + [1500] * 5
    assert outputs.servos(pulses, [0.0] * 4) == pytest.approx([0.0, -0.375, 0.0, 0.0])


@pytest.mark.parametrize("pulse", [0, 499, 2501, 65535])
def test_a_servo_without_pulses_stays_and_a_motor_without_stops(pulse):
    held, pulses = [0.1, 0.2, 0.3, 0.4], [pulse] * 16
    assert Outputs().servos(pulses, held) == pytest.approx(held)
    assert Outputs().speed(pulses) == 0.0


@pytest.mark.parametrize(("pulse", "speed"), [(900, 0.0), (1000, 0.0), (1350, 0.5), (1700, 1.0)])
def test_the_rotor_is_off_up_to_its_trim(pulse, speed):
    assert Outputs().speed([1500] * 7 + [pulse] + [1500] * 8) == pytest.approx(speed)
