"""Parameters for an autopilot: they follow from the vehicle, fly it with margins, and say why."""

import math

import numpy as np
import pytest

import helisim as hs
from helisim.errors import InputError
from helisim.sitl.gains import LEAST_GAIN, LEAST_PHASE, MOST_PEAK, Commanded, tune
from helisim.sitl.mixing import Controls, Mixer
from helisim.sitl.outputs import Outputs
from helisim.sitl.parameter_file import AutopilotParameters, Setting, read_parameters
from helisim.vehicle.folder import model_folder

LINE = 98
"""Characters of a line that ArduPilot reads; the rest would be the next line's name."""


@pytest.fixture(scope="module")
def made():
    """Parameters of the JR700, by its exact linearisation."""
    return hs.autopilot_parameters("jr700")


def test_its_file_is_read_again(made, tmp_path):
    """What is written is what is read, each name once, no line longer than ArduPilot takes."""
    path = tmp_path / "jr700.parm"
    made.write(path)
    assert read_parameters(path) == made.values
    assert max(map(len, made.text.splitlines())) <= LINE


def test_the_hover_is_the_vehicle_s(made):
    """Collective, lean and rotor speed of the file are those of its hover (calibrated.toml)."""
    own, values = hs.load("jr700"), made.values
    degrees = math.degrees(own.parameters["main_rotor.pitch_trim"])
    low, high = values["H_COL_ANG_MIN"], values["H_COL_ANG_MAX"]
    # angles are rounded to 0.01 degrees
    assert low + values["H_COL_HOVER"] * (high - low) == pytest.approx(degrees, abs=0.01)
    assert values["ATC_HOVR_ROL_TRM"] == round(100.0 * math.degrees(own.trim.phi))
    outputs = Outputs.of(own.parameters)
    pulse = values["SERVO8_MIN"] + 0.01 * values["H_RSC_SETPOINT"] * (
        values["SERVO8_MAX"] - values["SERVO8_MIN"]
    )
    assert outputs.speed([0] * 7 + [round(pulse)]) == 1.0


def test_its_own_mixer_moves_each_control_by_one_command(made):
    """The file's geometry, mixed as ArduPilot does, meets the vehicle's swashplate: no coupling."""
    own = hs.load("jr700")
    controls = Controls(Mixer.of(made.values), Outputs.of(own.parameters), own.swashplate)
    scale = controls.scale(made.values["H_COL_HOVER"])
    np.testing.assert_allclose(scale, np.diag(np.diag(scale)), atol=1e-9)
    assert np.all(np.diag(scale) > 0.0)


def test_the_shipped_file_is_what_identified_models_gave(made):
    """Its gains, from sweeps of `helisim reproduce`, are those of the exact model but for 15 %.

    A grid of gains is searched: its steps are up to 13 % wide. What is not tuned is the same.
    """
    shipped = read_parameters(model_folder("jr700") / "jr700.parm")
    assert set(shipped) == set(made.values)
    for name, value in made.values.items():
        loose = 0.15 if name.startswith(("ATC_RAT", "ATC_ANG", "PSC_ACCZ")) else 0.0
        assert shipped[name] == pytest.approx(value, rel=loose), name


class Gain:
    """r and psi over ped: k / (s + a), nothing else."""

    inputs, outputs = ("ped",), ("r", "psi")

    def __init__(self, gain=50.0, slow=0.8):
        self.gain, self.slow = gain, slow

    def response(self, frequency):
        """Return (2, 1, n_freq)."""
        s = 1j * frequency
        rate = self.gain / (s + self.slow)
        return np.stack([rate, rate / s])[:, None]


class Heave(Gain):
    """The same of w over col."""

    inputs, outputs = ("col",), ("w", "az")


def test_feed_forward_is_the_inverse_of_a_steady_rate():
    """Of k / (s + a), half held by the autopilot's unit, it is a / k / 2, and margins are kept."""
    scale = np.diag([1.0, 1.0, 1.0, 2.0])
    tuning = tune(Gain(), scale)
    # delays of 4 ms turn the phase at 2 rad/s: cos and sin of 0.008 move it by 4 ms 2^2 / a
    assert tuning.gains["ped"].ff == pytest.approx(0.8 / 100.0, rel=0.03)
    margins, rejection = tuning.margins("ped"), tuning.rejection("ped")
    assert margins.stable
    assert margins.least_gain >= LEAST_GAIN
    assert margins.least_phase >= LEAST_PHASE
    assert rejection.peak <= MOST_PEAK


def test_gains_follow_the_vehicle_s_scale():
    """A tail twice as strong takes half the gains: the loop is the same."""
    one, two = (tune(Gain(gain), np.eye(4)).gains["ped"] for gain in (50.0, 100.0))
    np.testing.assert_allclose(two[:4], 0.5 * np.array(one[:4]), rtol=1e-9)
    assert two.angle == one.angle


def test_a_vehicle_that_answers_the_other_way_is_refused():
    """With a sign that is wrong no gain is right: a line says so."""
    with pytest.raises(InputError, match="yaw has no gains with margins of 8 dB"):
        tune(Gain(-50.0), np.eye(4))


def test_what_a_model_does_not_know_is_said():
    """A model of yaw alone gives yaw's gains; roll's and height's are said to be missing."""
    made = hs.sitl.parameters.parameters_for("jr700", Gain())
    assert "ATC_RAT_YAW_P" in made.values
    assert "ATC_RAT_RLL_P" not in made.values
    assert any("no gains of roll" in one for one in made.remarks)
    assert any("no gains of height" in one for one in made.remarks)
    with pytest.raises(InputError, match="no axis can be tuned: the model goes from col to w, az"):
        tune(Heave(), np.eye(4))


def test_commands_of_the_autopilot_move_the_vehicle_by_its_scale():
    """Yaw of 1 moves ped by the scale, and it comes late by half a tick and more."""
    frequency = np.array([1.0, 10.0])
    plant = Commanded(Gain(), np.diag([1.0, 1.0, 1.0, 0.75]))
    ratio = plant.response(frequency)[:, 0] / Gain().response(frequency)[:, 0]
    np.testing.assert_allclose(np.abs(ratio), 0.75)
    np.testing.assert_allclose(-np.angle(ratio[0]) / frequency, 4e-3)


@pytest.mark.parametrize(
    ("name", "value"),
    [("h_sw_type", 0.0), ("ATC_RAT_RLL_FLTTXX", 1.0), ("A B", 1.0), ("", 1.0), ("ATC_P", math.nan)],
)
def test_no_parameter_is_written_that_is_none(name, value):
    """ArduPilot's names have 16 capitals at most, and values are finite."""
    with pytest.raises(InputError, match=r"parameter of ArduPilot|finite"):
        Setting(name, value)


def test_no_parameter_is_set_twice():
    """The second would win in silence."""
    with pytest.raises(InputError, match="ATC_ANG_RLL_P is set twice"):
        AutopilotParameters("", {"a": (Setting("ATC_ANG_RLL_P", 1.0),) * 2})


def test_a_file_of_any_ground_station_is_read(tmp_path):
    """Commas or blanks, comments anywhere; what is no parameter is told by its line."""
    path = tmp_path / "a.parm"
    path.write_text("# one\nATC_RAT_RLL_P,0.02\nH_CYC_MAX 2500 # all\n\nRC1_MIN\t1000.0\n")
    assert read_parameters(path) == {"ATC_RAT_RLL_P": 0.02, "H_CYC_MAX": 2500.0, "RC1_MIN": 1000.0}
    path.write_text("ATC_RAT_RLL_P\n")
    with pytest.raises(InputError, match=r"a\.parm:1: 'ATC_RAT_RLL_P' is no parameter"):
        read_parameters(path)
    path.write_text("# nothing\n")
    with pytest.raises(InputError, match="no parameter is in it"):
        read_parameters(path)


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", ["blade360", "lynx"])
def test_other_vehicles_have_parameters_with_margins(vehicle):
    """A third of the size and thirty times the mass: collective that can land, margins kept."""
    made = hs.autopilot_parameters(vehicle)
    assert made.values["H_COL_ANG_MIN"] <= -2.0
    whys = [one.why for one in made.settings if one.name.startswith("ATC_ANG")]
    assert len(whys) == 3
    assert all("Predicted, cut at the command: gain margin" in why for why in whys)
