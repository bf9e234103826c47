"""Blocks by name: each has its closed form, and in series it multiplies the response."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, cont2discrete, freqs, lfilter
from test_ardupilot import BLADE
from test_ardupilot import FULL as AS_IT_IS

from helisim.base.errors import InputError, UnknownNameError
from helisim.cli import main
from helisim.ident import Structure, blocks, frequency_response, identify, in_series, structures
from helisim.ident.ardupilot import ArduPilotModel, numbers_of
from helisim.ident.conditions import Conditions
from helisim.ident.evaluate import response
from helisim.ident.feedback import answered
from helisim.ident.result import Fit
from helisim.ident.structures import heave_inflow, hover_imu, rollpitch, yaw_base
from helisim.records.record import FlightRecord
from helisim.records.storage import write_record
from ident_data import HEAVE, data, fitted, record
from script import loaded
from tabled import rows, tabled

GRID = np.geomspace(0.5, 80.0, 25)
S = 1j * GRID
SERVO = blocks.second_order("servo", omega=(60.0, 1.0), zeta=(0.7, 0.01))
SERVO_RESPONSE = 3600.0 / (S**2 + 84.0 * S + 3600.0)


def alone(block):
    return response(block, block.starts, GRID)[0, 0]


def test_blocks_have_their_closed_forms():
    assert alone(SERVO) == pytest.approx(SERVO_RESPONSE, rel=1e-12)
    assert alone(blocks.first_order(tau=0.1)) == pytest.approx(1.0 / (1.0 + 0.1 * S), rel=1e-12)
    assert alone(blocks.delay(tau=0.03)) == pytest.approx(np.exp(-0.03 * S), rel=1e-12)
    for order in range(1, 9):
        expected = freqs(*butter(order, 40.0, analog=True), GRID)[1]
        # eight poles one after the other, the response down to 1e-3 of itself
        assert alone(blocks.low_pass(corner=40.0, order=order)) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("plant", [rollpitch, hover_imu, heave_inflow], ids=lambda one: one.name)
def test_series_multiply_the_response(plant):
    rng = np.random.default_rng(4)
    values = {one.name: one.start or 0.1 * rng.normal() for one in plant.parameters}
    inner = response(plant, values, GRID)
    lag, late = blocks.first_order(tau=0.1), blocks.delay(tau=0.02)
    first, last = plant.inputs[0], plant.inputs[-1]
    ends = {plant.outputs[0]: blocks.low_pass(corner=40.0, order=3), plant.outputs[-1]: late}
    made = in_series(plant, inputs={first: SERVO, last: lag}, outputs=ends)
    expected = inner.copy()
    expected[:, plant.inputs.index(last)] *= alone(lag)
    if first != last:
        expected[:, 0] *= SERVO_RESPONSE
    expected[0] *= alone(blocks.low_pass(corner=40.0, order=3))
    expected[-1] *= alone(late)
    found = response(made, {**made.starts, **values}, GRID)
    # a few dozen operations, of states that differ by 1e4
    assert np.abs(found / expected - 1.0) == pytest.approx(0.0, abs=1e-10)


def test_one_servo_for_two_inputs_has_one_natural_frequency():
    made = in_series(rollpitch, inputs={"lat": SERVO, "lon": SERVO})
    assert made.names == (*rollpitch.names, "servo_omega", "servo_zeta")
    assert len(made.states) == len(rollpitch.states) + 4
    assert made.parameter("servo_omega").error == 1.0
    other = blocks.second_order("servo", omega=50.0, zeta=0.7)
    with pytest.raises(InputError, match=r"'servo_omega': 50 rad/s of the block 'servo' and 60"):
        in_series(rollpitch, inputs={"lat": SERVO, "lon": other})
    again = Structure.from_dict(made.to_dict())
    assert again == made


def test_a_known_servo_is_taken_out_and_its_error_carried_through():
    """A first order behind a servo is found exactly, with more error than a servo without any."""
    exact = 50.0 / (S + 0.7) * np.exp(-0.03 * S) * SERVO_RESPONSE
    frf = data(exact, GRID, inputs=("ped",), outputs=("r",))
    found = identify(frf, in_series(yaw_base, inputs={"ped": SERVO}), band=(0.5, 12.0))
    expected = {"N_r": -0.7, "N_ped": 50.0, "tau_r_base": 0.03}
    assert {name: found.values[name] for name in expected} == pytest.approx(expected, rel=1e-6)
    # far below it a servo is the delay 2 zeta / omega; the band goes to a fifth of omega
    delay = 2.0 * 0.7 / 60.0 * np.hypot(1.0 / 60.0, 0.01 / 0.7)
    assert found["tau_r_base"].standard_error == pytest.approx(delay, rel=0.1)


def test_blocks_are_read_from_words():
    made = blocks.with_blocks(
        rollpitch,
        {"lat,lon": "second_order:omega=62+-1,zeta=0.7", "p": "low_pass:corner=40,order=4"},
    )
    assert made.parameter("lat_lon_omega").error == 1.0
    assert made.parameter("lat_lon_zeta").start == 0.7
    assert made.parameter("lat_lon_zeta").fixed
    assert made.parameter("p_corner").start == 40.0
    free = blocks.with_blocks(rollpitch, {"p": "first_order:name=servo"})
    assert not free.parameter("servo_tau").fixed
    for words, error, what in rows(globals(), "test_blocks_are_read_from_words"):
        with pytest.raises(error, match=what):
            blocks.with_blocks(rollpitch, {"lat": words})
    with pytest.raises(UnknownNameError, match="'pad'"):
        blocks.with_blocks(rollpitch, {"pad": "first_order:tau=1"})
    with pytest.raises(InputError, match="lat has two blocks"):
        blocks.with_blocks(rollpitch, {"lat": "first_order", "lat,lon": "delay"})


def test_a_file_has_its_blocks_in_a_table(tmp_path):
    path = tmp_path / "yaw.toml"
    path.write_text(
        yaw_base.to_toml() + '\n[series]\nped = "second_order:omega=60+-1,zeta=0.7,name=servo"\n'
    )
    found = Structure.from_toml(path)
    assert found.parameter("servo_omega").error == 1.0
    assert found.states == ("r", "ped_servo_x0", "ped_servo_x1")
    found.to_toml(path)
    assert Structure.from_toml(path) == found
    path.write_text(yaw_base.to_toml() + "\n[series]\nped = 3\n")
    with pytest.raises(InputError, match=r"series.ped must be text, got 3"):
        Structure.from_toml(path)


# Identified models as ArduPilot's state-space helicopter: its file, its equations, its limits.

HALF = {**dict.fromkeys(AS_IT_IS, 0.5), "col": 1.0}
HOVER = {"rotor_speed": 100.0 * np.pi, "hover_lean": np.pi / 60, "hover": 0.4}


def test_blade_360_becomes_the_numbers_of_ardupilots_own_file():
    """The published helicopter in helisim's structures gives what the pull request's file holds."""
    # Tools/autotest/models/blade360.json of ArduPilot's pull request 29462, at commit 5ad7596;
    # the forces of the tilted thrust there are 9.81 m/s^2
    theirs = {
        "Ma1s": 796.7, "Lb1s": 5115.2, "Xa1s": -9.81, "Yb1s": 9.81, "Zw": -0.5910, "Nr": -2.0131,
        "Nped": 63.0040, "Zcol": -22.3239, "tf": 0.0353, "Lfa1s": 1.0477, "Mfb1s": -1.0057,
        "Lflt": 0.2375, "Lflg": -0.0286, "Mflt": 0.0344, "Mflg": 0.2292, "time_delay_rp": 40,
        "time_delay_ped": 40, "time_delay_col": 40,
    }  # fmt: skip
    numbers, remarks = numbers_of(BLADE, late={})
    assert numbers == pytest.approx(theirs, rel=5e-4)  # 9.81 for 9.80665
    assert not remarks
    halved, _ = numbers_of([(*part[:2], HALF) for part in BLADE], late={})
    by_full = {"Nped": 0.5, "Lflt": 0.5, "Lflg": 0.5, "Mflt": 0.5, "Mflg": 0.5}
    ratios = {name: halved[name] / numbers[name] for name in numbers}
    assert ratios == pytest.approx({**dict.fromkeys(numbers, 1.0), **by_full})


def test_servos_become_delays():
    servo = blocks.second_order("swash", omega=200.0, zeta=0.7)
    structure = in_series(structures.rollpitch, inputs={"lat": servo, "lon": servo})
    own = BLADE[0][1] | {"tau_lon": 0.041}
    values = structure.starts | own
    numbers, remarks = numbers_of([(structure, values, AS_IT_IS)], late={"p": 0.02, "q": 0.02})
    # servo 2 zeta / omega = 7 ms, and of 40 and 41 ms the recorder's 20: 27 and 28 ms
    assert numbers["time_delay_rp"] == 28.0
    said = " ".join(remarks)
    assert "stand as delays" in said
    assert "27.0 ms of lat, 28.0 ms of lon" in said
    found, _ = numbers_of([(structures.rollpitch, own, AS_IT_IS)], late={})
    assert {**numbers, "time_delay_rp": 0.0} == pytest.approx({**found, "time_delay_rp": 0.0})


def test_a_model_of_a_fit_has_the_vehicles_numbers():
    heave = fitted(structures.heave, HEAVE)
    made = ArduPilotModel.of([heave], full={"col": 1.0}, **HOVER)
    assert made.values["Zw"] == pytest.approx(HEAVE["Z_w"])
    vehicle = {"nominal_rpm": 3000.0, "hover_lean": 3.0, "coll_hover": 0.4}
    vehicle |= {"coll_min": 0.0, "coll_max": 1.0}
    assert {name: made.values[name] for name in vehicle} == pytest.approx(vehicle)
    for wrong in ({"rotor_speed": 0.0}, {"hover": 1.1}, {"hover": -0.1}):
        with pytest.raises(InputError, match="rotor_speed must be above 0"):
            ArduPilotModel.of([heave], full={"col": 1.0}, **HOVER | wrong)


def test_what_no_flight_says_is_asked_for_and_flights_apart_are_told():
    heave = fitted(structures.heave, HEAVE)
    with pytest.raises(InputError, match=r"travel of col of heave; .*speed .*collective .*lean"):
        ArduPilotModel.of([heave])
    ours = {"model_digest": "", "parameters": {"main_rotor.speed": 178.0}}
    still = record(provenance=ours, col=np.full(9, 0.1), phi=np.full(9, 0.07))
    known = replace(heave, data=replace(heave.data, conditions=Conditions.of([still])))
    found = ArduPilotModel.of([known])
    assert found.values["coll_hover"] == pytest.approx(0.6)
    assert found.values["Zcol"] == pytest.approx(HEAVE["Z_col"])
    assert "ArduPilot's 1 is col 1 of heave (helisim's own record)" in found.remarks
    slower = Conditions(full={"col": 2.0}, rotor_speed=150.0)
    other = replace(heave, data=replace(heave.data, conditions=slower))
    assert "another rotor speed 150 rad/s" in " ".join(ArduPilotModel.of([known, other]).remarks)
    assert ArduPilotModel.of([other, known]).values["Zcol"] == pytest.approx(2.0 * HEAVE["Z_col"])
    # a file from before they were kept says none
    old = heave.to_dict()
    del old["data"]["conditions"]
    assert Fit.from_dict(old).data.conditions == Conditions()


SPEEDS = structures.rollpitch_speeds


def test_flap_back_becomes_derivatives_by_the_velocities():
    """Without coupling the disc rests at A_u u + A_v v, back: M_u = M_a A_u, M_v = M_a A_v."""
    drift = {"A_u": 2e-3, "A_v": -5e-3, "A_b": 0.0, "B_a": 0.0, "L_b": 500.0, "M_a": 300.0}
    found, remarks = numbers_of([(SPEEDS, SPEEDS.starts | drift, AS_IT_IS)], late={})
    expected = {"Mu": 0.6, "Mv": -1.5, "Lu": -2.5, "Lv": -1.0, "Xu": -9.80665 * 2e-3}
    assert {name: found[name] for name in expected} == pytest.approx(expected)
    assert "no place for 0.049 in du/dt by v, -0.049 in dv/dt by u" in " ".join(remarks)


ORDER = structures.transfer_function(zeros=0, poles=2, input="lat", output="p")


LAGS = tuple(map(tuple, np.diag([0, 0, -2, -1]).astype(str).tolist()))
SPLIT = replace(structures.rollpitch, name="split", M=(), F=LAGS)


def numbered(*parts):
    return numbers_of([(one, one.starts, HALF) for one in parts], late={})


@tabled("make", "error", "message")
def test_what_no_model_of_ardupilot_or_series_has_is_refused(make, error, message):
    with pytest.raises(error, match=message):
        make()


# Feedback without a recorded reference is seen where gusts go round it, and only there.

gusts = loaded("proof/gusts")
YAW = replace(gusts.TRUTHS["yaw"], length=60.0, count=2)


@pytest.fixture(scope="module")
def records():
    return gusts.fly(YAW, 0)[0]


def test_gusts_that_go_round_a_loop_are_told_and_a_reference_ends_that(records):
    direct = gusts.estimated(YAW, records, reference=False)
    assert direct.verdict.word != "sound"
    (note,) = [note for note in direct.verdict.reasons if note.kind == "feedback"]
    assert "comes back in ped" in note.text
    assert "record the sticks" in note.text
    joint = gusts.estimated(YAW, records, reference=True)
    assert joint.verdict.word == "sound", str(joint)
    for name, value in YAW.values.items():
        # three standard errors: one parameter in 370 is beyond
        assert abs(joint[name].value - value) < 3.0 * joint[name].standard_error


@pytest.mark.parametrize(
    "change", [gusts.open_loop, pytest.param(gusts.calm, marks=pytest.mark.slow)]
)
def test_gusts_without_a_loop_and_a_loop_without_gusts_are_no_feedback(change):
    (records,) = gusts.fly(change(YAW), 0)
    frf = frequency_response(records, inputs="ped", outputs="r", band=(0.6, 25.0))
    assert frf.evidence == ()


@pytest.mark.slow
@pytest.mark.parametrize("reference", [None, ("PED", "LAT")])
def test_the_answer_to_a_conditioning_input_is_no_feedback(reference):
    # a mode that rings for 3 s after a sweep of the other axis has passed it
    dice, step, records = np.random.default_rng(0), 0.02, []
    servo = cont2discrete(([30.0], [1.0, 30.0]), step, "zoh")
    own = cont2discrete(([60.0], [1.0, 1.5]), step, "zoh")
    ringing = cont2discrete(([200.0, 0.0], [1.0, 0.6, 9.0]), step, "zoh")
    every = round(step / gusts.FINE)
    for k in range(4):
        stick = 0.02 * gusts.sweeps(YAW, dice, 2)[::every]
        stick[:, k % 2] *= 50.0
        at = [lfilter(servo[0].ravel(), servo[1], one) for one in stick.T]
        r = sum(lfilter(b.ravel(), a, u) for (b, a, _), u in zip((own, ringing), at))
        columns = np.column_stack([*at, *stick.T, r + dice.normal(0.0, 0.01, len(r))])
        names = map(gusts.common.channel_of, ("ped", "lat", "PED", "LAT", "r"))
        records.append(FlightRecord(np.arange(len(r)) * step, columns, tuple(names)))
    frf = frequency_response(
        records,
        inputs="ped",
        conditioning="lat",
        outputs="r",
        band=(0.6, 25.0),
        reference=reference,
    )
    assert not [note for note in frf.evidence if note.kind == "feedback"]


def test_a_reference_that_answers_gusts_is_told(records):
    assert records[0].names == ("ped", "PED", "r")
    # a pilot who closes the loop himself
    held = [replace(one, values=one.values[:, [0, 0, 2]]) for one in records]
    frf = frequency_response(held, inputs="ped", outputs="r", band=(0.6, 25.0), reference="PED")
    (note,) = frf.evidence
    assert note.kind == "feedback"
    assert "fly hands off" in note.text


def test_the_bias_that_noise_in_a_loop_makes_is_measured():
    # y = 2 u + v and u = r - v / 2, white: H = 2 + S_vu / S_uu of least squares
    dice = np.random.default_rng(0)
    count, step = 40_000, 0.05
    swept = np.where(np.arange(count) % 4000 < 1000, 1.0, 0.1)
    r, v = swept * dice.normal(size=count), 0.3 * dice.normal(size=count)
    u = r - 0.5 * v
    bias = -0.5 * 0.09 / np.mean(u**2)
    rest, made = (2.0 * u + v) - (2.0 + bias) * u, (2.0 + bias) * u
    _, found = answered([(u[:, None], rest[:, None], made[:, None])], [step], (1.0, 20.0), 1)
    assert np.mean(found[:, 0]) > 20.0
    # of 7 bands, with 5 % error each by chance, which is in the size
    true = np.hypot(bias / (2.0 + bias), 0.05)
    assert np.sqrt(np.mean(found[:, 1])) == pytest.approx(true, rel=0.2)
    _, noise = answered([(r[:, None], v[:, None], made[:, None])], [step], (1.0, 20.0), 1)
    assert np.mean(noise[:, 0]) < 3.0  # exponential: one of 7 in 10 million


@pytest.mark.slow
def test_gusts_in_a_loop_leave_the_sticks_the_reference(tmp_path, capsys):
    (records,) = gusts.fly(replace(YAW, gust=(2.4, 0.5, {"r": 1.0})), 0)
    logs = [str(write_record(one, tmp_path / f"{k}.parquet")) for k, one in enumerate(records)]
    status = main(["identify", *logs, "--structure", "yaw_base", "--quiet"])
    said = capsys.readouterr().out
    assert "disagree beyond" in said
    assert "joint input-output" in said
    assert status != 1
