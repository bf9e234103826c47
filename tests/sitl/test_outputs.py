"""Pulses of an autopilot's outputs become what servos and rotor are asked for."""

import pytest

import helisim as hs
from helisim.sitl.mixing import Outputs


def test_the_ends_of_the_pulses_are_the_ends_of_the_travel():
    pulses = [2000, 1000, 1750, 1500, *[0] * 12]
    assert Outputs(reach=0.75).servos(pulses, [0.0] * 4) == [0.75, -0.75, 0.375, 0.0]


def test_a_reversed_servo_on_another_channel_with_another_trim():
    parameters = dict(hs.load("jr700").parameters)
    parameters |= {
        "outputs.left_channel": 11.0,
        "outputs.left_trim": 1520e-6,
        "outputs.left_travel": -400e-6,
    }
    outputs, pulses = Outputs.of(parameters), [1500] * 10 + [1720] + [1500] * 5
    assert outputs.servos(pulses, [0.0] * 4) == pytest.approx([0.0, -0.375, 0.0, 0.0])


@pytest.mark.parametrize("pulse", [0, 499, 2501, 65535])
def test_a_servo_without_pulses_stays_and_a_motor_without_stops(pulse):
    held, pulses = [0.1, 0.2, 0.3, 0.4], [pulse] * 16
    assert Outputs().servos(pulses, held) == pytest.approx(held)
    assert Outputs().speed(pulses) == 0.0


@pytest.mark.parametrize(("pulse", "speed"), [(900, 0.0), (1000, 0.0), (1350, 0.5), (1700, 1.0)])
def test_the_rotor_is_off_up_to_its_trim(pulse, speed):
    assert Outputs().speed([1500] * 7 + [pulse] + [1500] * 8) == pytest.approx(speed)
