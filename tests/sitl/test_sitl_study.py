"""The study of logs that ArduPilot wrote: its truths, and that it judges by them."""

import numpy as np
import pytest

from helisim.handling.arducopter import COMMANDS, ArduCopterLaw
from helisim.records.record import IN1
from helisim.vehicle.parameters import model_folder
from parm_file import parm_file
from script import loaded


@pytest.fixture
def study():
    return loaded("sitl_study")


def test_its_own_helicopter_in_ardupilots_units(study):
    """By hand: swashplate 120 degrees, 280 us of collective, the tail 400 us to each side.

    Full roll puts the two front servos 0.45 x 2 cos 30 degrees of 1000 us apart, full pitch the
    front ones 0.45 x 1.5 above the rear one.
    """
    parameters = {"H_COL_MIN": 1460.0, "H_COL_MAX": 1740.0}
    true = study.stated(study.SOURCES["heli"], parameters, 0.5)
    roll, pitch = 1.283 * 0.9 * 3**0.5 / 2.0 / 7.2, 1.48 * 0.675 / 7.2
    assert true["B_lat"] == pytest.approx(1.7635 * roll)
    assert true["B_lon"] == pytest.approx(-0.61171 * pitch)
    assert true["A_lat"] == pytest.approx(0.52454 * roll)
    assert true["A_lon"] == pytest.approx(1.9432 * pitch)
    assert true["N_ped"] == pytest.approx(21.6 * 2.96 * 0.8)
    # 14 degrees of collective, of which 5 carry the weight; 0.2 %: it rounds a turn's rad/s
    assert true["Z_col"] == pytest.approx(-9.80665 * 14.0 / 5.0, rel=2.1e-3)


def test_the_jr700_in_ardupilots_units(study, jr700):
    """By hand: 900 us of full cyclic on servos that 500 us move by their whole travel, 0.75."""
    parameters = {
        "H_SW_TYPE": 0.0,
        "H_SW_H3_SV1_POS": 0.0,
        "H_SW_H3_SV2_POS": -120.0,
        "H_SW_H3_SV3_POS": 120.0,
        "SERVO4_MIN": 1000.0,
        "SERVO4_MAX": 2000.0,
    }
    true, own = study.exact_jr700(parameters, 0.5), jr700.derivatives
    for name, scale in {"B_lat": 0.675, "A_lon": 0.675, "N_ped": 0.75, "Z_col": 0.75}.items():
        # it flies with its motor, whose trim is another by 1e-5
        assert true[name] == pytest.approx(scale * own[name], rel=1e-4)
    assert true["L_b"] == pytest.approx(own["L_b"], rel=1e-4)


@pytest.mark.study
def test_logs_that_it_wrote_meet_the_bars(study, ardupilot, monkeypatch, tmp_path):
    """The JR700 and ArduPilot's own helicopter, flown by the program itself."""
    monkeypatch.setenv("HELISIM_ARDUPILOT", str(ardupilot))
    assert study.main(["--fly", str(tmp_path)]) == 0


@pytest.fixture(scope="module")
def proof():
    return loaded("proof/flown_loops")


@pytest.fixture(scope="module")
def flown_jr700(proof):
    """The vehicle as the autopilot moves it, and the law, by the shipped parameters."""
    parameters = parm_file(model_folder("jr700") / "jr700.parm")
    return proof.exact_plant(parameters, 0.5, 0.0025), ArduCopterLaw.of(parameters)


def test_the_exact_vehicle_is_that_of_python_control_at_ticks(flown_jr700, jr700):
    """Held for a tick; a full roll is 0.675 of the vehicle's lat; the tail's pulses wait a tick."""
    plant, _ = flown_jr700
    frequency = np.array([1.0, 10.0, 60.0])
    system = jr700.linearize().system
    own = system.sample(0.0025)(np.exp(0.0025j * frequency))
    found = plant.response(frequency)
    late = {"ped": np.exp(-0.0025j * frequency)}
    for axis, rate, scale in (("lat", "p", 0.675), ("lon", "q", 0.675), ("ped", "r", 0.75)):
        row, column = system.output_labels.index(rate), system.input_labels.index(axis)
        true = scale * own[row, column] * late.get(axis, 1.0)
        here = found[plant.outputs.index(rate), COMMANDS.index(axis)]
        # it flies with its motor, which the tail feels: 0.5 dB at 60 rad/s
        near = {"rel": 1e-3} if axis != "ped" else {"rel": 0.07}
        assert here == pytest.approx(true, **near)
    assert set(plant.inputs) < set(IN1)


def test_ardupilots_own_helicopter_turns_as_its_source_states(proof):
    """Yaw: 21.6 x 2.96 over s + 2.96, 80 % of the servo's way; 50 ms, and a tick, held for another.

    Roll above the rotor's modes: 3588.6 / 0.068232 x 1.7635 of the cyclic over s squared.
    """
    plant, frequency = proof.ardupilots_helicopter({}), np.array([2.0, 20.0, 300.0])
    found = plant.response(frequency)
    s = 1j * frequency
    yaw = 21.6 * 2.96 * 0.8 / (s + 2.96) * np.exp(-s * (0.05 + 0.0025 + 0.00125))
    # half a frame early by Euler's method, and the gyro's age
    assert found[2, 2, :2] == pytest.approx(yaw[:2], rel=0.02)
    cyclic = 1.283 * 0.9 * 3**0.5 / 2.0 / 7.2
    high = 3588.6 * 1.7635 * cyclic / 0.068232 / s[2] ** 2
    assert abs(found[0, 0, 2]) == pytest.approx(abs(high), rel=0.05)  # 3588.6 / 300^2
