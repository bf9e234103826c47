"""Parameters for an autopilot: they follow from the vehicle, fly it with margins, and say why."""

import dataclasses
import functools
import math

import numpy as np
import pytest

import helisim as hs
from command import parm_file
from helisim.base.errors import InputError
from helisim.base.linear import LinearSystem
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.figures import margins as margins_of
from helisim.handling.figures import rejection as rejection_of
from helisim.sitl import gains
from helisim.sitl.gains import AHEAD, BAND, Commanded, Required, _Closed, tune
from helisim.sitl.mixing import Mixer, Outputs, command_scale
from helisim.sitl.parameters import Setting, swashplate, tail
from helisim.study.log_tune import errs
from helisim.vehicle.parameters import model_folder
from plates import H3_120
from sid_logs import TRUTH, SidLog
from tabled import rows, tabled

LINE = 98  # characters of a line that ArduPilot reads; the rest would be the next line's name


@pytest.fixture(scope="module")
def made():
    return hs.autopilot_parameters("jr700")


def test_its_file_is_read_again_and_moves_each_control_by_one_command(made, tmp_path):
    """The file's geometry, mixed as ArduPilot does, meets the swashplate: no coupling."""
    path = tmp_path / "jr700.parm"
    made.write(path)
    assert parm_file(path) == made.values
    assert max(map(len, made.text.splitlines())) <= LINE
    own = hs.load("jr700")
    outputs, hover = Outputs.of(own.parameters), made.values["H_COL_HOVER"]
    scale = command_scale(Mixer(made.values), outputs, own.swashplate, hover)
    np.testing.assert_allclose(scale, np.diag(np.diag(scale)), atol=1e-9)
    assert np.all(np.diag(scale) > 0.0)


def test_the_hover_is_the_vehicle_s(made):
    own, values = hs.load("jr700"), made.values
    degrees = math.degrees(own.parameters["main_rotor.pitch_trim"])
    low, high = values["H_COL_ANG_MIN"], values["H_COL_ANG_MAX"]
    # angles are rounded to 0.01 degrees
    assert low + values["H_COL_HOVER"] * (high - low) == pytest.approx(degrees, abs=0.01)
    assert values["ATC_HOVR_ROL_TRM"] == round(100.0 * math.degrees(own.trim.phi))
    outputs = Outputs.of(own.parameters)
    span = values["SERVO8_MAX"] - values["SERVO8_MIN"]
    pulse = values["SERVO8_MIN"] + 0.01 * values["H_RSC_SETPOINT"] * span
    assert outputs.speed([0] * 7 + [round(pulse)]) == 1.0


def test_reversed_servos_and_turned_plates_are_set_right():
    """Mixed as ArduPilot mixes, each of its commands still moves its own control the right way."""
    changes = dict(rows(globals(), "test_reversed_servos_and_turned_plates_are_set_right"))
    own = hs.load("jr700", parameters=changes)
    outputs = Outputs.of(own.parameters)
    plate, remarks = swashplate(own, outputs)
    values = {one.name: one.value for one in (*plate, *tail(outputs))}
    assert remarks == []
    assert values["SERVO1_REVERSED"] == values["SERVO2_REVERSED"] == 1.0
    assert values["SERVO5_FUNCTION"] == 35.0
    scale = command_scale(Mixer(values), outputs, own.swashplate, values["H_COL_HOVER"])
    expected = np.diag([0.75 * 666.0 / 500.0, 0.675, 0.675, 0.75])
    np.testing.assert_allclose(scale, expected, atol=1e-9)


def test_the_shipped_file_is_what_identified_models_gave():
    """Of sweeps at constant rotor speed: gains are the exact model's but for 15 %, others equal."""
    shipped = parm_file(model_folder("jr700") / "jr700.parm")
    exact = dataclasses.replace(hs.load("jr700").linearize(), delays={})
    made = hs.sitl.parameters.parameters_for("jr700", exact)
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


def test_commands_act_when_their_pulses_do():
    """Half a tick of 2.5 ms that holds them, 0.25 ms to the next frame, of the tail a tick more."""
    frequency = np.array([1.0, 30.0])
    for held, seconds in ((True, 0.01 + 1.5 * 0.0025 + 0.25e-3), (False, 0.01)):
        found = Commanded(Gain(), np.diag([1.0, 1.0, 1.0, 2.0]), 0.01, held).response(frequency)
        late = 2.0 * Gain().response(frequency) * np.exp(-1j * frequency * seconds)
        np.testing.assert_allclose(found, late, rtol=1e-12)


def test_gains_that_swing_a_flapping_mode_up_are_not_allowed():
    """What grows is counted by roots, of hover modes that grow and a flapping mode of 60 rad/s.

    The loop rises through -180 degrees past the first and falls through it at the second, with more
    than 1 at both: a count of net falls alone is none, whatever the gain.
    """
    s, hover, flapping = 1j * BAND, [1.0, -0.4, 1.0], [1.0 / 3600.0, 0.4 / 60.0, 1.0]
    bottom = np.polymul([1.0, 0.0], np.polymul(hover, flapping))
    loops = {k: k * (s + 0.5) ** 2 / np.polyval(bottom, s) for k in (0.2, 5.0, 15.0, 40.0, 120.0)}
    grow = {
        k: np.count_nonzero(np.roots(np.polyadd(bottom, k * np.poly([-0.5, -0.5]))).real > 0.0)
        for k in loops
    }
    assert grow == {0.2: 2, 5.0: 0, 15.0: 0, 40.0: 2, 120.0: 2}
    for k, loop in loops.items():
        one = _Closed(*[loop[None]] * 3, loop, loops[120.0], -2.0)
        assert one.growing() == grow[k] - 2
        assert one.growing(10.0) == (0 if k > 15.0 else -2)  # those of flapping alone
        assert one.keeps(Required(0.0, 0.0, np.inf)) == (grow[k] == 0)


def test_margins_count_from_the_lowest_frequency_that_is_told():
    """Hover modes leave 15.7 dB at 1.2 rad/s to less gain, flapping 28.7 dB at 59 to more."""
    s, bottom = 1j * BAND, np.polymul([1.0, -0.4, 1.0, 0.0], [1.0 / 3600.0, 1.4 / 60.0, 1.0])
    loop = 3.0 * (s + 0.5) ** 2 / np.polyval(bottom, s)
    one = _Closed(*[loop[None]] * 3, loop, loop)
    kept = [one.keeps(Required(20.0, 0.0, np.inf, lowest=at)) for at in (BAND[0], 2.0)]
    assert kept == [False, True]


def test_small_gains_are_found_and_gusts_count():
    """Of a rotor that follows at 40 rad/s, little damped: without P its DRB are 4 rad/s."""
    a, b = [[0.0, 1.0, 0.0], [-1600.0, -8.0, 0.0], [1.0, 0.0, 0.0]], [[0.0], [6400.0], [0.0]]
    c, names = np.eye(3)[[0, 2]], (("lat",), ("p", "phi"))
    rotor = LinearSystem(a, b, c, np.zeros((2, 1)), None, *names, delays={"lat": 0.07})
    law, best = functools.partial(gains.law_of, lean=(0.0, 0.0)), []
    for gusts in (np.outer([by, 0.0, 0.0, 0.0], np.gradient(BAND)) for by in (0.0, 10.0)):
        asked = gains.STANDARD._replace(noise=0.1, rate=3.0, attitude=3.0, moves=gusts)
        best.append(law(gains.search([rotor], law, {"lat": asked}, slopes={"lat": (20.0, 6.0)})))
    by = ClosedLoop(rotor, best[0], BAND).disturbance
    assert all(rejection_of(by("lat", place)).bandwidth > 5 for place in ("sensors", "attitude"))
    assert np.divide(*(errs(rotor, one, "lat", gusts).sum() for one in best)) > 1.0 / 0.98**2


def test_feed_forward_is_the_inverse_of_a_steady_rate():
    """Of k / (s + a), half held by the autopilot's unit, it is a / k / 2, and margins are kept."""
    scale = np.diag([1.0, 1.0, 1.0, 2.0])
    tuning = tune(Gain(), scale)
    # delays of 4 ms turn the phase at 3 rad/s: cos and sin of 0.012 move it by 4 ms 3^2 / a
    assert tuning.gains["ped"].ff == pytest.approx(0.8 / 100.0, rel=0.06)
    margins = margins_of(tuning.loop.broken("ped"))
    assert margins.stable
    assert margins.least_gain >= AHEAD.gain
    assert margins.least_phase >= AHEAD.phase
    assert rejection_of(tuning.loop.disturbance("ped")).peak <= AHEAD.peak


def test_what_gives_no_parameters_is_refused(tmp_path):
    with pytest.raises(InputError, match="yaw has no gains with margins of 8 dB"):
        tune(Gain(-50.0), np.eye(4))
    with pytest.raises(InputError, match="finite"):
        Setting("ATC_P", math.nan)
    path = SidLog().sweep(10, length=12.0, low=1.0).save(tmp_path)
    with pytest.raises(InputError, match="sweep roll and pitch both, or yaw"):
        hs.autopilot_parameters("jr700", path)
    heave = Gain()
    heave.inputs, heave.outputs = ("col",), ("w", "az")
    with pytest.raises(InputError, match="no axis can be tuned: the model goes from col to w, az"):
        tune(heave, np.eye(4))


def test_what_a_model_does_not_know_is_said():
    made = hs.sitl.parameters.parameters_for("jr700", Gain())
    assert {"ATC_RAT_YAW_P", "ATC_RAT_RLL_P"} & made.values.keys() == {"ATC_RAT_YAW_P"}
    assert any("no gains of roll" in one for one in made.remarks)
    assert any("no gains of height" in one for one in made.remarks)
    lifted = hs.sitl.parameters.parameters_for("jr700", Gain(), of_autopilot=True, lift=20.0)
    assert lifted.values["PSC_ACCZ_P"] == pytest.approx(9.80665 / 20.0, rel=1e-4)  # four digits


def test_an_autopilot_s_own_log_gives_gains_in_its_own_unit(tmp_path):
    """A sweep of the mixer's yaw: N_r / N_ped of the log's helicopter, whatever the vehicle's."""
    truth, path = TRUTH["yaw_base"], SidLog().sweep(12, length=12.0, low=1.0).save(tmp_path)
    made = hs.autopilot_parameters("jr700", path)
    # one sweep of 12 s tells it to a few per cent, and delays move it by 1 %
    assert made.values["ATC_RAT_YAW_FF"] == pytest.approx(-truth["N_r"] / truth["N_ped"], rel=0.05)
    assert "identified in its own log (yaw_alone)" in made.title
    assert "ATC_RAT_RLL_P" not in made.values


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", ["blade360", "lynx"])
def test_other_vehicles_have_parameters_with_margins(vehicle):
    """A third of the size and thirty times the mass: collective that can land, margins kept."""
    made = hs.autopilot_parameters(vehicle)
    assert made.values["H_COL_ANG_MIN"] <= -2.0
    whys = [one.why for one in made.settings if one.name.startswith("ATC_ANG")]
    assert len(whys) == 3
    assert all("Predicted, cut at the command: gain margin" in why for why in whys)


# ArduPilot's mixing and our swashplate meet: its roll is our lat, its pitch our lon.

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


@tabled("parameters", "said")
def test_what_it_does_not_know_is_said(parameters, said):
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
