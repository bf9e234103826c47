"""The ground rigs: they hold the vehicle as it is, and their records give its hidden numbers."""

import mujoco
import numpy as np
import pytest

from helisim.base.errors import InputError, RecordError, UnknownNameError
from helisim.physics.layout import ACTUATORS
from helisim.records.record import CHANNELS, FlightRecord
from helisim.sim import rigs
from helisim.sim.rigs import bench_test, hang, hold, loop_gains, plumb_line, run_rigs
from helisim.vehicle import load
from helisim.vehicle.assembly import total_inertia
from helisim.vehicle.parameters import models_folder

RIGS = ("bench", "suspension", "turntable")
GAINS = {"gyro.k_p": 0.6, "gyro.k_i": 11.0, "gyro.k_delta": 2.0, "gyro.k_a": 0.4}
"""Another gyro than the shipped one: what is found then can't be typed anywhere."""


@pytest.fixture(scope="module")
def ground(jr700):
    reported = []
    tests = run_rigs(jr700, seed=1, on_progress=reported.append)
    assert reported == [test.rig for test in tests]
    return {test.rig: test for test in tests}


def percent(finding):
    return 100.0 * abs(finding.error / finding.truth)


@pytest.mark.parametrize("rig", RIGS)
def test_a_rig_holds_the_vehicle_as_it_flies_in_stock_mujoco(rig, jr700):
    """Without callbacks, without a warning; mass, inertia, parameters are those in the air."""
    path = models_folder() / "jr700" / "rigs" / f"{rig}.xml"
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    first = min(k for k in range(model.nkey) if model.key(k).name != "hover")
    mujoco.mj_resetDataKeyframe(model, data, first)
    height = data.qpos[2]
    for _ in range(500):
        mujoco.mj_step(model, data)
    assert not [warning.number for warning in data.warning if warning.number]
    # the welds give by well under a tenth of a millimetre under 78 N
    assert data.qpos[2] == pytest.approx(height, abs=1e-4)
    held = hold(jr700, rig).model
    flying = jr700.model
    assert held.body("jr700").subtreemass == pytest.approx(flying.body("jr700").subtreemass)
    # the same parts, summed: rounding of 0.4 kg m^2
    assert total_inertia(held, "jr700") == pytest.approx(total_inertia(flying, "jr700"), abs=1e-12)
    for name in ACTUATORS:
        assert held.actuator(name).user.tolist() == flying.actuator(name).user.tolist()
        assert held.jnt_bodyid[held.actuator(name).trnid[0]] == held.body("jr700").id


def test_bench_and_turntable_give_the_controllers_gains(ground):
    """k_p and k_I, given k_delta; k_a, given both, two ways; and the lead on the rate."""
    found = ground["bench"]
    # 0.4 % measured; the resolution of the recorded servo is 2 % of the smallest jump
    assert percent(found["k_p"]) < 1.0
    # 0.01 % measured: a slope is an average of fifty samples and more
    assert percent(found["k_I"]) < 0.1
    assert percent(found["k_I / k_p"]) < 1.0
    # a twentieth of a sample: the edges of the steps fall between samples
    assert found["delay"].error == pytest.approx(0.0, abs=5e-4)
    found = ground["turntable"]
    assert percent(found["k_a"]) < 0.5  # 0.01 to 0.1 % over seeds 1 to 3
    assert percent(found["k_a by k_p"]) < 2.0  # 0.1 to 0.5 %; with the bench's error of k_p
    # the lead changes the gain by 7 % at the upper edge, of which 1 % of noise is seen
    assert percent(found["lead"]) < 5.0
    # its phase and the recorder's latency look alike: together they are seen ten times as well
    assert found["tau_r"].truth == 0.0405  # parameters.toml, recorder_latency.r
    assert found["tau_r"].error == pytest.approx(0.0, abs=3e-4)
    # a filter sampled every 2 ms answers like a continuous one that is 0.3 ms quicker
    assert found["lead_filter"].error == pytest.approx(0.0, abs=5e-4)
    assert found["lead_filter"].standard_error < 0.1e-3
    both = found["tau_r"].error + found["lead"].error
    assert both == pytest.approx(0.0, abs=2e-4)  # 0.03 to 0.13 ms over seeds 1 to 5


def test_the_gains_found_are_those_of_the_vehicle_tested():
    vehicle = load(parameters=GAINS)
    bench = bench_test(vehicle)
    table = rigs.turntable_test(vehicle, k_p=bench["k_p"], k_i=bench["k_I"])
    # tolerances of the shipped gyro; smaller gains move the servo less
    assert bench["k_p"].value == pytest.approx(GAINS["gyro.k_p"], rel=0.015)
    assert bench["k_I"].value == pytest.approx(GAINS["gyro.k_i"], rel=0.002)
    assert table["k_a"].value == pytest.approx(GAINS["gyro.k_a"], rel=0.005)


def made_up(gap, gain, ratio, delay, lead, lead_filter):
    """A sweep r and the PI loop's exact answer to it, from the analytic response."""
    time = np.arange(6000) * 0.01
    inside = np.clip((time - 5.0) / 50.0, 0.0, 1.0)
    angle = 2.0 * np.pi * (0.3 * 50.0 * inside + 2.5 * 50.0 * inside**2)
    rate = np.sin(angle) * np.sin(np.pi * inside) ** 2
    omega = 2.0 * np.pi * np.fft.rfftfreq(time.size, 0.01)
    s = 1j * np.where(omega > 0.0, omega, 1.0)
    response = gain * (1.0 + ratio / s) * (1.0 + lead * s / (1.0 + lead_filter * s))
    response = np.where(omega > 0.0, response * np.exp(-s * delay), 0.0)
    servo = np.fft.irfft(response * np.fft.rfft(rate), time.size)
    values = np.column_stack([rate + gap, servo])
    return FlightRecord(time, values, (CHANNELS["r"], CHANNELS["servo_tail"]))


def test_known_gains_come_back():
    record = made_up(0.0, -0.25, 20.0, -0.03, 0.01, 0.0015)
    asked = {"input": "r", "output": "servo_tail", "band": (3.0, 30.0)}
    found = loop_gains(record, **asked, noisy_input=True, lead=True)
    # what the record's ends cut off the loop's memory
    assert found.proportional == pytest.approx(-0.25, rel=1e-3)
    assert found.ratio == pytest.approx(20.0, rel=1e-3)
    assert found.delay == pytest.approx(-0.03, abs=2e-5)
    assert found.lead == pytest.approx(0.01, abs=2e-5)
    assert found.lead_filter == pytest.approx(0.0015, abs=5e-5)


def test_a_band_or_channel_that_tells_nothing_is_refused():
    record = made_up(0.0, -0.25, 20.0, 0.0, 0.0, 0.0)
    for band in ((3.0, 400.0), (3.0, 3.01)):
        with pytest.raises(InputError, match="resolves"):
            loop_gains(record, input="r", output="servo_tail", band=band)
    still = FlightRecord(record.time, record.values * [1.0, 0.0], record.channels)
    with pytest.raises(RecordError, match="'servo_tail' does not move"):
        loop_gains(still, input="r", output="servo_tail", band=(3.0, 30.0))


def test_the_suspension_finds_the_centre_of_gravity(ground):
    found = ground["suspension"]
    assert found["cg distance"].value < 1e-3
    for axis in "xyz":
        one = found[f"imu_{axis}"]
        assert abs(one.error) < 1e-3
        assert abs(one.error) < 4.0 * one.standard_error  # over seeds 1 to 4 at most 1.9 of them
        # 2 mrad of white noise over the root of 1000 samples, times 0.6 m: 20 to 40 micrometres
        assert 5e-6 < one.standard_error < 5e-5
    assert found["imu_x"].truth == pytest.approx(0.08)  # jr700.xml: site imu, FRD
    assert found["imu_z"].truth == pytest.approx(0.12)


def test_a_centre_of_gravity_elsewhere_is_found_there(jr700):
    held = hold(jr700, "suspension")
    held.model.body_ipos[held.model.body("jr700").id] += [0.02, -0.01, 0.015]
    lines = [plumb_line(hang(held, name), at) for name, at in rigs.suspension_points(held).items()]
    # MuJoCo's left and up are the airframe's minus right and minus down
    assert rigs.centre_of_gravity(lines) == pytest.approx([0.02, 0.01, -0.015], abs=1e-3)


def test_what_a_rig_can_not_measure_is_refused(jr700):
    held = hold(jr700, "suspension")
    record = hang(held, "frame", duration=6.0)
    with pytest.raises(RecordError, match="still moves"):
        plumb_line(record, rigs.suspension_points(held)["frame"])
    line = rigs.PlumbLine(np.zeros(3), np.array([0.0, 0.0, 1.0]))
    beside = rigs.PlumbLine(np.array([0.1, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]))
    with pytest.raises(InputError, match="two plumb lines"):
        rigs.centre_of_gravity([line])
    with pytest.raises(InputError, match="another point"):
        rigs.centre_of_gravity([line, beside])
    with pytest.raises(UnknownNameError, match="point 'tail'; available: mast, frame"):
        hang(held, "tail")
    with pytest.raises(RecordError, match="limit"):
        bench_test(load(parameters={"gyro.k_delta": 10.0}))


def test_a_record_says_where_it_comes_from(jr700):
    held = hold(jr700, "bench")
    moved = {"test": rigs.pedal_steps, "duration": 5.0}
    first, again, other = (rigs.drive(held, "PED", seed=seed, **moved) for seed in (4, 4, 5))
    assert first.provenance["rig"] == "bench"
    assert first.provenance["test"] == {"moves": "PED", "duration": 5.0}
    assert np.array_equal(first.values, again.values)
    assert not np.array_equal(first.values, other.values)
    with pytest.raises(InputError, match="seed"):
        rigs.drive(held, "PED", seed=-1, **moved)
