"""Pulses of an autopilot's outputs become what servos and rotor are asked for."""

import shutil

import pytest

import helisim as hs
from helisim.base.errors import InputError, ModelError
from helisim.sitl.mixing import Output, Outputs
from helisim.vehicle.folder import model_folder


@pytest.mark.parametrize("name", ["jr700", "blade360", "lynx"])
def test_the_shipped_vehicles_have_the_usual_outputs(name):
    vehicle = hs.load(name)
    assert Outputs.of(vehicle.parameters) == Outputs(reach=vehicle.parameters["servo.travel"])


def test_a_vehicle_that_says_nothing_has_them_too_and_says_so():
    entry = hs.load("lynx").parameters.entry("outputs.rotor_trim")
    assert entry.source.startswith("not given")


def test_an_own_vehicle_s_file_says_them(tmp_path):
    folder = shutil.copytree(model_folder("jr700"), tmp_path / "mine")
    path = folder / "parameters.toml"
    text = path.read_text()
    line = next(one for one in text.splitlines() if one.startswith("tail_travel"))
    path.write_text(text.replace(line, line.replace("0.5e-3", "-0.4e-3")))
    tail = Outputs.of(hs.load(folder).parameters).tail
    assert tail == Output(4, travel=-400.0)


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
    assert outputs.left.pulse(outputs.left.share(pulses)) == 1720.0


@pytest.mark.parametrize("pulse", [0, 499, 2501, 65535])
def test_a_servo_without_pulses_stays_and_a_motor_without_stops(pulse):
    held, pulses = [0.1, 0.2, 0.3, 0.4], [pulse] * 16
    assert Outputs().servos(pulses, held) == pytest.approx(held)
    assert Outputs().speed(pulses) == 0.0
    assert Outputs().pedals(pulses, 0.25) == 0.25


@pytest.mark.parametrize(("pulse", "speed"), [(900, 0.0), (1000, 0.0), (1350, 0.5), (1700, 1.0)])
def test_the_rotor_is_off_up_to_its_trim(pulse, speed):
    assert Outputs().speed([1500] * 7 + [pulse] + [1500] * 8) == pytest.approx(speed)


def test_pedals_at_the_end_of_the_travel_are_at_their_stop():
    assert Outputs().pedals([1500, 1500, 1500, 1000] + [1500] * 12, 0.0) == -0.5


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"left_channel": 1.0}, "output 1 can't move both front and left"),
        ({"left_channel": 2.5}, "a whole number from 1 to 32, got 2.5"),
        ({"tail_travel": 0.0}, "travel must not be 0 us"),
    ],
)
def test_outputs_that_are_none_are_refused_by_name(changes, why):
    parameters = {
        **hs.load("jr700").parameters,
        **{f"outputs.{name}": value for name, value in changes.items()},
    }
    with pytest.raises(ModelError, match=why):
        Outputs.of(parameters)


def test_a_channel_is_one_of_the_autopilots():
    with pytest.raises(InputError, match="from 1 to 32, got 33"):
        Output(33)
