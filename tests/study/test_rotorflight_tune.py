"""Rotorflight's gains from Blackbox logs, of a linear yaw that flies under the law itself."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import bessel, lfilter

import blackbox_logs
import helisim as hs
from helisim.base.errors import LogError
from helisim.cli import main
from helisim.design import laws
from helisim.design.plant import Plant
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.loop import Curve
from helisim.handling.measured.interval import Interval
from helisim.handling.predicted import PredictedLoop
from helisim.logs.blackbox import Blackbox
from helisim.look.speeds import most_flown
from helisim.study import rotorflight_models, rotorflight_tune
from helisim.study.rotorflight_tune import Feedback, law_of_log, tune_blackbox
from script import loaded

pytestmark = pytest.mark.usefixtures("fewer_draws")
flights = loaded("proof/rotorflight_flights")
header = flights.header

PERIOD, LATE = 0.004, 3  # s of a loop, and loops until a command acts
N_R, N_PED = -2.0, 60.0  # 1/s, 1/s^2 by rad of blade pitch
Z_W, Z_COL = -0.9, -150.0  # 1/s, m/s^2 by rad
FULL = {"range": 1.0}
LAW = laws.Rotorflight(
    roll=laws.CyclicRotorflight(**FULL, p=52.0, b=7.0, gyro_cutoff=40.0, o=43.0),
    pitch=laws.CyclicRotorflight(**FULL, p=45.0, d=40.0, d_cutoff=12.0, o=61.0),
    yaw=laws.YawRotorflight(**FULL, p=60.0, i=70.0, d=5.0, ccw_stop_gain=100.0, cw_stop_gain=100.0),
    collective=laws.CollectiveRotorflight(**FULL),
    gyro_lowpass=0.0,
)


class Yaw:
    """The exact yaw as the law has it: a delay, and a zero-order hold."""

    inputs, outputs = ("ped",), ("p", "q", "r", "phi", "theta", "psi")

    def response(self, frequency):
        z = np.exp(1j * np.asarray(frequency) * PERIOD)
        grows = math.exp(N_R * PERIOD)
        rate = z**-LATE * N_PED / N_R * (grows - 1.0) / (z - grows)
        found = np.zeros((6, 1, z.size), complex)
        found[2, 0], found[5, 0] = rate, rate * PERIOD / (z - 1.0) * 0.5 * (z + 1.0)
        return found


def flown(seconds, *, sticks=1.0, gusts=0.02, seed=1):
    rng, law, count = np.random.default_rng(seed), LAW.linear(PERIOD), round(seconds / PERIOD)
    state, rate, grows = np.zeros(len(law.a)), 0.0, math.exp(N_R * PERIOD)
    waits, rows, asked, gust = [0.0] * LATE, [], 0.0, 0.0
    for k in range(count):
        if k % 100 == 0:
            asked = sticks * rng.uniform(-0.5, 0.5)
        gust += PERIOD * (-2.0 * gust) + gusts * math.sqrt(PERIOD) * rng.standard_normal()
        sensed = rate + 0.003 * rng.standard_normal()
        given = {"r": sensed, "PED": asked}
        seen = np.array([given.get(name, 0.0) for name in law.inputs])
        ped = float((law.c @ state + law.d @ seen)[law.outputs.index("ped")])
        state = law.a @ state + law.b @ seen
        rows.append((asked, ped, sensed))
        acts, waits = waits[0], [*waits[1:], ped]
        rate = grows * rate + (grows - 1.0) / N_R * (N_PED * acts + 30.0 * gust)
    asked, ped, rates = np.array(rows).T
    deg, still, moves = np.degrees(rates), np.zeros(count), 60.0 * (sticks > 0.0)
    pump = np.rint(moves * np.repeat(rng.random(count // 50 + 1), 50)[:count])
    col = math.radians(0.012) * np.roll(pump, LATE)
    low_pass, gust = bessel(2, 10.0, norm="mag", fs=1.0 / PERIOD), rng.standard_normal(count)
    fall = lfilter([PERIOD], [1.0, -1.0 - PERIOD * Z_W], Z_COL * col + 0.3 * gust)
    upward = 9.80665 - lfilter(*low_pass, Z_W * np.roll(fall, 1) + Z_COL * col + 0.02 * gust)
    columns = {
        "time": 5e6 + 1e6 * PERIOD * np.arange(count),
        "setpoint[2]": -2.0 * LAW.yaw.rate * asked,
        "mixer[2]": -1000.0 * ped / math.radians(24.0),
        "gyroADC[2]": -deg,
        "attitude[2]": np.mod(10.0 * np.cumsum(deg) * PERIOD, 3600.0),
        "headspeed": 2100.0 - 0.7 * pump,
        "accADC[2]": 2048.0 / 9.80665 * upward,
    }
    for name in ("setpoint", "mixer", "attitude"):
        columns |= {f"{name}[{k}]": still for k in (0, 1)}
    columns |= {f"gyroADC[{k}]": 2.0 * rng.standard_normal(count) for k in (0, 1)}
    columns |= dict.fromkeys(("setpoint[3]", "mixer[3]"), pump + 300.0)
    return {name: np.rint(one).astype(np.int64) for name, one in columns.items()}


def saved(folder, columns, **lines):
    path = folder / "flight.bbl"
    path.write_bytes(blackbox_logs.encode(columns, header(LAW, PERIOD) | lines))
    return path


@pytest.fixture(scope="module")
def columns():
    return flown(60.0)


@pytest.fixture(scope="module")
def log(tmp_path_factory, columns):
    return saved(tmp_path_factory.mktemp("log"), columns)


@pytest.fixture(scope="module")
def tuned(log, fewer_draws):
    return tune_blackbox([str(log)])


def test_the_law_is_the_header_s(log):
    own = law_of_log(Blackbox(log), collective=0.1)
    assert (own.collective.centre, own.roll.o, own.pitch.o) == (0.1, 43.0, 61.0)
    for axis in ("roll", "pitch", "yaw"):
        for name in ("p", "i", "d", "f", "b", "gyro_cutoff", "d_cutoff"):
            assert getattr(getattr(own, axis), name) == getattr(getattr(LAW, axis), name), name


def test_gains_change_the_law_as_they_do_its_own_file():
    frequency = np.array([0.5, 5.0, 50.0])
    gains = {"yaw": {"p": 97.0, "i": 33.0, "d": 20.0}, "roll": {"i": 250.0}}
    changed = {axis: replace(getattr(LAW, axis), **some) for axis, some in gains.items()}
    exact = replace(LAW, **changed).linear(PERIOD).response(frequency)
    found = Feedback(LAW, PERIOD, gains).response(frequency)
    np.testing.assert_allclose(found, exact, rtol=1e-6, atol=1e-9)


def test_ordinary_flying_tells_the_loop_and_better_gains(log, tuned, tmp_path, capsys, monkeypatch):
    """Half an interval more than its own: one figure of twenty lies outside of 95 %.

    Predicted margins of the new gains hold with the exact yaw: required ones, 6 dB and 45 degrees.
    """
    (yaw,) = tuned.axes
    loop = PredictedLoop.of([Yaw()] * 3, LAW.linear(PERIOD))
    exact = {name: one.value for name, one in loop.figures("ped").items()}
    for name in ("crossover", "phase_margin", "DRB"):
        own = yaw.today[name]
        assert abs(own.value - exact[name]) < own.high - own.low, name
    assert yaw.changes
    out, data = tmp_path / "gains.txt", tmp_path / "found.json"
    monkeypatch.setattr(rotorflight_tune, "tune_blackbox", lambda logs, **_: {log: tuned}[logs[0]])
    assert main(["tune", str(log), "--out", str(out), "--json", str(data), "--quiet"]) == 0
    assert json.loads(data.read_text(encoding="utf-8"))["logs"] == [str(log)]
    told = capsys.readouterr().out
    assert re.search("it droop by 1.8 %.*no model of roll and pitch", " ".join(told.split()))
    lines = out.read_text(encoding="utf-8").splitlines()
    settings = dict(line.removeprefix("set ").split(" = ") for line in lines if line[:4] == "set ")
    assert settings == {one.name: f"{one.after:g}" for one in yaw.changes}
    gains = {name.split("_")[1]: float(value) for name, value in settings.items()}
    new = replace(LAW, yaw=replace(LAW.yaw, **gains))
    flies = PredictedLoop.of([Yaw()] * 3, new.linear(PERIOD)).figures("ped")
    assert flies["gain_margin"].value > 6.0
    assert flies["phase_margin"].value > 45.0
    assert flies["DRB"].value > 1.03 * exact["DRB"]
    hot, calm = (replace(LAW, yaw=replace(LAW.yaw, p=1.0, i=i)).linear(PERIOD) for i in (1e3, 1.0))
    loops = [PredictedLoop.of([Yaw()] * 3, hot, flew=one) for one in (None, calm, hot)]
    told = [one.figures("ped")["gain_margin"].value for one in loops]
    assert told[0] == told[1] == -told[2] < 0.0  # a law that flew is stable, whatever it encircles


def test_a_flight_without_information_is_refused(tmp_path):
    """Sticks at rest, gusts alone: feedback without a reference would give the law's inverse."""
    found = tune_blackbox([str(saved(tmp_path, flown(60.0, sticks=0.0)))])
    assert not found.axes
    assert sum("no model of" in one and "quick stops" in one for one in found.remarks) == 3


def test_models_are_of_the_speeds_most_flown(log):
    """A ramp of 10 % in rotor speed; 10 s of thrust tilted by 0.2 rad, as air brakes in 20 s."""
    one, remarks = rotorflight_tune.read_log(log).records[0], list[str]()

    def kept(**columns):
        changed = np.array(one.values)
        for name, values in columns.items():
            changed[:, one.names.index(name)] = values
        parts, said = most_flown([replace(one, values=changed)])
        remarks.extend(said)
        return sum(part.duration for part in parts)

    assert most_flown([one]) == ([one], [])
    ramp = kept(rotor_speed=220.0 * np.linspace(1.0, 1.1, len(one)))
    assert ramp == pytest.approx(one.duration * 1.05 * 0.05 / 0.1, abs=2.0 * PERIOD)  # its ends
    since = one.time - one.time[0]
    stands = kept(rotor_speed=np.where(since < 0.6 * since[-1], 0.0, 220.0))
    assert stands == pytest.approx(0.4 * one.duration - 1.0, abs=0.2)  # less half of the mean
    most = 9.80665 * math.tan(0.2) * 20.0
    fast = (
        20.0 * math.log(most * (1.0 - math.exp(-0.5)) / 8.0) + 10.0 + 20.0 * math.log1p(-8.0 / most)
    )
    slow = kept(psi=0.0, theta=np.where((since > 20.0) & (since < 30.0), -0.2, 0.0))
    assert slow == pytest.approx(one.duration - fast, abs=4.0 * PERIOD)  # a sample at each end
    assert ["one model doesn't hold for all speeds" in text for text in remarks] == [True] * 3
    assert re.search(r"of 41 s of 60: 0 to 8 m/s by attitude, \d+ to \d+ rpm", remarks[-1])


def test_a_minute_of_flying_a_stiff_rotor_tells_roll_and_pitch(tmp_path, monkeypatch):
    """Its lateral mode, 71 rad/s, lies above what is flown; intervals of 95 %."""
    vehicle = hs.load("blade360")
    law, period = flights.law_for(vehicle), vehicle.parameters["gyro.period"]
    columns = flights.columns(vehicle, law, *flights.fly(vehicle, law, seed=1, duration=60.0))
    (tmp_path / "log.bbl").write_bytes(blackbox_logs.encode(columns, header(law, period)))
    monkeypatch.setattr(rotorflight_models, "_FITS", rotorflight_models._FITS[:1])
    records = rotorflight_tune.read_log(tmp_path / "log.bbl").records
    (fit,), _ = rotorflight_models.models_of(records, [], {}, motor_tail=False)
    assert fit.parameters["odd_cross"].definition.fixed  # its usual size tells more
    for name in ("L_b", "M_a", "tau_f"):
        low, high = fit.parameters[name].interval
        assert low < vehicle.derivatives[name] < high < 2.0 * low, name
    assert fit.verdict.word == "sound"


def test_heave_is_told_from_the_accelerometer_behind_its_filter(tuned):
    (fit,) = (one for one in tuned.fits if one.structure.name == "heave_imu")
    late = PERIOD * LATE  # from sample to sample
    # of a minute, and of 6 % by which Z_w's band may differ along a flight at its lower edge
    for name, true, wide in (("Z_w", Z_W, 0.5), ("Z_col", Z_COL, 20.0), ("tau_col", late, 0.01)):
        low, high = fit.parameters[name].interval
        assert low < true < high < low + wide, name
    assert {one.kind for one in fit.verdict.reasons} <= {"lost"}  # steps in whole counts
    assert any(one.startswith("heave: a degree more of collective lifts") for one in tuned.remarks)


def test_a_log_that_lost_frames_is_tuned_of_the_rest(log, tmp_path, few_draws, monkeypatch):
    """For a moment at hit bytes, of which few are borne, and for a second in its middle."""
    monkeypatch.setattr(rotorflight_models, "_FITS", rotorflight_models._FITS[1:2])
    for count, doubt in (4, set()), (30, {"corruption"}):
        data, place = bytearray(log.read_bytes()), tmp_path / "hit.bbl"
        for at in np.linspace(len(data) // 10, len(data) - 99, count, dtype=int).tolist():
            data[at] ^= 255
        del data[len(data) // 2 : len(data) // 2 + len(data) // 60]
        place.write_bytes(data)
        found = tune_blackbox([str(place)])
        said, (fit,) = " ".join(found.remarks), found.fits
        assert re.search(r"\d{3} frames missing between others, in \d+ places", said)
        assert re.search(r"a gap of 1.\d+ s from \d+.\d+ s after the start \(1 gap,", said)
        assert "count as missing" in said
        assert "repair" not in said
        low, high = fit.parameters["N_ped"].interval
        assert low < N_PED < high < 1.2 * low
        assert {one.kind for one in fit.verdict.reasons} - {"lost"} == doubt
        assert bool(found.changes) == (not doubt)


def test_logs_that_tell_no_gains_are_refused_by_name(log, tmp_path):
    columns = flown(2.0)
    other = {"Firmware type": "Betaflight", "Firmware revision": "Betaflight 4.5.0 (a) X"}
    with pytest.raises(LogError, match=r"Betaflight 4\.5\.0; its models are told by helisim"):
        law_of_log(Blackbox(saved(tmp_path, columns, **other)))
    with pytest.raises(LogError, match="the header's yawPID is '80,x', expected 3 number"):
        law_of_log(Blackbox(saved(tmp_path, columns, yawPID="80,x")))
    with pytest.raises(LogError, match="the header's looptime is '', expected 1 number"):
        tune_blackbox([str(saved(tmp_path, columns, looptime=""))])
    other = saved(tmp_path, columns, yawPID="61,70,5,0,0")
    with pytest.raises(LogError, match=r"flight\.bbl: other gains or filters than in flight\.bbl"):
        tune_blackbox([str(log), str(other)])


def test_a_feed_forward_that_the_header_lacks_is_not_proposed(tmp_path, columns, few_draws):
    """Rotorflight 4.3 writes P, I and D alone: what F is today isn't known."""
    path = saved(tmp_path, columns, rollPID="52,100,0", pitchPID="45,100,40", yawPID="60,70,5")
    (yaw,) = tune_blackbox([str(path)]).axes
    assert yaw.changes
    assert "yaw_f_gain" not in {one.name for one in yaw.changes}


def test_a_loop_that_crosses_over_beyond_its_model_is_no_figure(log, few_draws, monkeypatch):
    monkeypatch.setattr(rotorflight_models, "_FITS", [(*rotorflight_models._FITS[1][:2], 2.0)])
    for top, told in (8.3, "tells the model to 8.11; fly"), (5.0, "beyond 2 to 4.99 rad/s; fly"):
        monkeypatch.setattr(rotorflight_models, "followed_band", lambda *_, top=top: (2.0, top))
        found = tune_blackbox([str(log)])  # of two octaves at least a model is told
        assert told in " ".join([*found.remarks, *(one.why for one in found.axes)])
        assert all(math.isnan(one.today["crossover"].low) for one in found.axes)


def test_a_gain_margin_is_told_within_the_models_band_alone():
    """The nearest is 7 dB at 1 rad/s, which the pilot holds; at 20 rad/s one is told."""
    at, own = np.geomspace(0.5, 500.0, 400), {"gain_margin": Interval(9.0, 8.0, 10.0)}
    for turns, sure in (([1.0, 80.0], False), ([1.0], False), ([1.0, 20.0], True)):
        lag, said = math.pi - 0.3 * np.prod([np.sign(one - at) for one in turns], axis=0), []
        found = rotorflight_tune._seen(own, Curve(at, np.exp(-1j * lag) / (1.3 + at)), "roll", said)
        assert math.isfinite(found["gain_margin"].low) == sure == ("roll: the" not in str(said))


def test_what_the_header_lacks_is_the_dump_s(log, tmp_path):
    moved = (flight := flown(2.0))["setpoint[2]"]
    flight |= {"setpoint[0]": moved, "axisF[0]": 60 * moved // 40}
    flight |= dict.fromkeys(("axisF[1]", "axisF[2]"), 0 * moved)
    lines = {"rollPID": "52,100,0", "pitchPID": "45,100,40", "yawPID": "60,70,5"}
    lines |= dict.fromkeys(("rollBW", "pitchBW", "yawBW", "yaw_stop_gain", "hsi_gain"))
    path = saved(tmp_path, flight, **lines)
    dump = {"yaw_f_gain": "33", "yaw_gyro_cutoff": "90", "yaw_cw_stop_gain": "95", "name": "x"}
    law = law_of_log(Blackbox(path), dump)
    assert (law.yaw.f, law.yaw.gyro_cutoff, law.yaw.cw_stop_gain) == (33.0, 90.0, 95.0)
    assert (law.yaw.p, law.roll.f, law.roll.o) == (60.0, 60.0, 0.0)
    for wrong, said in (
        ({"yaw_p_gain": "61", "roll_o_gain": "9"}, "roll's o is another in the dump"),
        ({"yaw_f_gain": "x"}, "the dump's yaw_f_gain is 'x', expected a whole number"),
    ):
        with pytest.raises(LogError, match=said):
            law_of_log(Blackbox(path), wrong)
    (tmp_path / "dump.txt").write_text("set yaw_p_gain = 61\n")
    assert main(["tune", str(path), "--dump", str(tmp_path / "dump.txt"), "--quiet"]) == 2


def test_a_plant_of_its_models_is_still_where_nothing_was_told(tuned):
    plant = Plant(tuned.fits, period=PERIOD, still=("p", "phi"))
    assert not ClosedLoop(plant, LAW.linear(PERIOD)).reached("rate", "ped")["phi"].response.any()
