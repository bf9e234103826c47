"""Vibration in logs of known tones: what turns so, what notches leave, and what is not proposed."""

import math

import numpy as np
import pytest
from scipy.signal import bilinear, freqz, lfilter

import blackbox_logs
from flown_copter import PARAMETERS
from helisim.handling.arducopter import ArduCopterLaw, Notch
from helisim.logs.blackbox import Blackbox
from helisim.look import vibration as looks
from helisim.look.vibration import blackbox_vibration, vibration
from sid_logs import SidLog
from tabled import tabled
from told_log import Rows, Told

OWN = {**PARAMETERS, "SCHED_LOOP_RATE": 400.0, "INS_GYRO_FILTER": 40.0}
MAIN, TAIL = 28.3, 4.72
TONES = {1.0: 0.1, 2.0: 0.06, 4.0: 0.16, TAIL: 0.12, 10.0: 0.01}  # turns of the mast -> rad/s
IN_FLIGHT = np.arange(40_000) / 1000.0


def shaken(time, tones=TONES, drift=0.0, noise=0.002):
    """Return rates of roll, pitch and yaw, (n_time, 3) rad/s; `drift` is of the rotor's speed."""
    turned = np.cumsum(np.gradient(time) * MAIN * (1.0 + drift * np.sin(0.7 * time)))
    one = sum((size * np.sin(2.0 * np.pi * n * turned) for n, size in tones.items()), 0.0 * time)
    noises = np.random.default_rng(1).standard_normal((time.size, 3))
    return one[:, None] * [1.0, 0.5, 0.2] + noise * noises


def a_log(folder, *, batches=(), loops=(), imu=(), step=2_500, rpm=None, own=OWN, ends=True):
    log = SidLog(parameters=own, without=("SIDD",))
    log.define(20, "ISBH", "QHBBHHQf", "TimeUS,N,type,instance,mul,smp_cnt,SampleUS,smp_rate")
    log.define(21, "ISBD", "QHHaaa", "TimeUS,N,seqno,x,y,z")
    log.define(22, "IMU", "Qfff", "TimeUS,GyrX,GyrY,GyrZ", units="sEEE", multipliers="F---")
    log.define(23, "RPM", "Qff", "TimeUS,rpm1,rpm2", units="s--", multipliers="F--")
    for _ in range(ends):
        log.write(12, 9_000_000, 28)
    for n, k in enumerate(range(0, len(batches) - 1023, 1024)):
        at = 10_000_000 + 1000 * k
        log.write(20, at, n, n % 2, 0, 938, 1024, at, 1000.0)  # accelerometer and gyro by turns
        for part in np.split(np.round(938.0 * batches[k : k + 1024]).astype(int), 32):
            log.write(21, at, n, 0, *part.T.ravel().tolist())
    if len(loops):
        rates = np.insert(np.degrees(loops), (0, 1, 1, 2, 2, 3, 3, 3, 3), 0.0, axis=1).T
        log.messages.append(log._rows(6, 10.0 + np.arange(len(loops)) / 400.0, rates).tobytes())
    for k, rate in enumerate(imu):
        log.write(22, 10_000_000 + step * k, *rate)
    for k in range(400 * (rpm is not None)):
        log.write(23, 10_000_000 + 100_000 * k, rpm * (1.0 + 1e-3 * np.sin(k)), 0.0)
    for _ in range(ends):
        log.write(12, 54_000_000, 18)
    return log.save(folder)


def test_tones_are_told_by_turns_of_the_rotors_and_notched_where_servos_move(tmp_path):
    rates = shaken(IN_FLIGHT, drift=0.003)
    found = vibration(a_log(tmp_path, batches=rates))
    names = ["1/rev of main", "2/rev of main", "4/rev of main", "1/rev of tail", "10/rev of main"]
    assert [one.name for one in found.peaks] == names
    assert [one.logged for one in found.peaks] == pytest.approx([*TONES.values()], rel=0.05)
    told = [found.settings[f"INS_{one}"] for one in ("HNTCH_HMNCS", "HNTCH_FREQ", "HNTC2_FREQ")]
    assert told == pytest.approx([0b1011, MAIN, TAIL * MAIN], rel=2e-3)
    assert all(one.left < 0.05 * one.now for one in found.peaks[:4])
    assert 2.0 < np.diff(found.lag(20.0)) < 6.0
    flown = vibration(a_log(tmp_path, batches=rates, own={**OWN, **found.settings}))
    assert not flown.settings
    assert flown.peaks[0].now == pytest.approx(found.peaks[0].left, rel=0.01)


def test_a_tone_above_half_the_rate_is_told_as_one_that_may_appear_there(tmp_path):
    found = vibration(a_log(tmp_path, loops=shaken(np.arange(16_000) / 400.0, noise=0.0003)))
    assert "10/rev of main, if 283 Hz appears there" in [one.name for one in found.peaks]


@pytest.mark.parametrize("ends", [False, True])
def test_gyros_that_are_logged_behind_the_filters_are_as_they_are_now(tmp_path, ends):
    """As logged with events of lift-off and landing, and without; a notch is foreseen alike."""
    rates = shaken(np.arange(16_000) / 400.0)
    found = vibration(a_log(tmp_path, imu=rates, ends=ends))
    assert (found.source, found.rate) == ("IMU", pytest.approx(400.0))
    said = "IMU is logged behind the gyro's filters, and what is above 200 Hz appears below it"
    assert said in found.remarks[-1]
    tones = {one.name: one for one in found.peaks}
    for name, size in (("1/rev of main", 0.1), ("4/rev of main", 0.16), ("1/rev of tail", 0.12)):
        assert tones[name].logged == tones[name].now == pytest.approx(size, rel=0.05)
        assert tones[name].left < 0.05 * tones[name].now


def test_without_tones_or_fast_messages_nothing_is_proposed(tmp_path):
    quiet = vibration(a_log(tmp_path, batches=shaken(IN_FLIGHT, {})))
    assert (quiet.peaks, quiet.settings) == ((), {})
    weak = vibration(a_log(tmp_path, batches=shaken(IN_FLIGHT, {1.0: 2e-3, 2.0: 2e-3})))
    assert len(weak.peaks) == 2
    assert not weak.settings  # no servo moves by them
    slow = vibration(a_log(tmp_path, imu=shaken(IN_FLIGHT[::40]), step=40_000))
    assert not slow.settings
    assert "set INS_LOG_BAT_MASK 1" in slow.remarks[0]


def test_a_loop_that_oscillates_gets_no_notch(tmp_path):
    """At 10.6 Hz with harmonics, which look as a rotor's."""
    found = vibration(
        a_log(tmp_path, batches=shaken(IN_FLIGHT, {0.375: 2.5, 0.75: 0.1, 1.125: 0.2}))
    )
    assert not found.settings
    assert any("a loop oscillates" in one for one in found.remarks)


@pytest.mark.parametrize(("rpm", "mode", "ref"), [(0.0, 0.0, 0.0), (600.0 * MAIN, 2.0, 0.1)])
def test_a_notch_follows_rpm_messages_that_are_live_alone(tmp_path, rpm, mode, ref):
    found = vibration(a_log(tmp_path, batches=shaken(IN_FLIGHT), rpm=rpm))
    assert found.settings["INS_HNTCH_MODE"] == mode
    assert found.settings["INS_HNTCH_REF"] == pytest.approx(ref, abs=1e-3)
    assert found.notches[0].centre == pytest.approx(MAIN, abs=0.1)


def test_the_notch_is_as_deep_and_wide_as_its_parameters_say():
    notch = {"INS_HNTCH_ENABLE": 1.0, "INS_HNTCH_FREQ": 60.0, "INS_HNTCH_BW": 10.0}
    law = ArduCopterLaw.of({**OWN, "INS_GYRO_FILTER": 0.0, **notch})
    assert law.notches == (Notch(60.0, 10.0, 40.0, 3),)
    passed = np.abs(law.gyro(2.0 * np.pi * np.array([60.0, 120.0, 55.0, 1.0])))
    assert passed == pytest.approx([0.01, 0.01, 0.71, 1.0], rel=0.03)


def test_a_blackbox_log_tells_tones_by_its_speeds_and_the_lag_of_its_filters(tmp_path):
    rng, step, speed = np.random.default_rng(4), 0.001, 1700.0
    time = step * np.arange(60_000)
    moves = 60.0 * np.cumsum(rng.standard_normal((time.size, 3)), axis=0) * math.sqrt(step)
    turn = 2.0 * np.pi * speed / 60.0 * time[:, None]
    raw = moves + 6.0 * np.sin(turn) + 4.0 * np.sin(4.72 * turn) * [0.0, 0.0, 1.0]
    corner = 2.0 * np.pi * 60.0
    low_pass = bilinear([corner], [1.0, corner], 1.0 / step)
    behind = lfilter(*low_pass, raw, axis=0)
    columns = {"time": 1e6 * time, "headspeed": speed + 0.0 * time, "tailspeed": 4.72 * speed}
    for name, gyro in (("gyroRAW", raw), ("gyroADC", behind)):
        columns |= {f"{name}[{k}]": one for k, one in enumerate(gyro.T)}
    counts = {name: np.rint(one + 0.0 * time).astype(int) for name, one in columns.items()}
    path = tmp_path / "flight.bbl"

    def told(columns):
        path.write_bytes(blackbox_logs.encode(columns, {"gyro_scale": "0x3f800000"}))
        return blackbox_vibration(Blackbox(path), lambda at: np.eye(3)[..., None] / at)

    found = told(counts)
    tones = {one.name: one for one in found.peaks}
    sizes = {"1/rev of main": 6.0, "1/rev of tail": 4.0}
    assert tones.keys() == sizes.keys()
    for name, size in sizes.items():
        # the walk beside a tone is in it; of tones and walk the shares add as squares: below 10 %
        assert math.degrees(tones[name].logged) == pytest.approx(size, rel=0.1)
        passed = abs(freqz(*low_pass, [tones[name].frequency], fs=1.0 / step)[1][0])
        assert tones[name].now / tones[name].logged == pytest.approx(passed, rel=0.05)
        assert tones[name].left is None
        # a law that takes angles, the integrals of rates, for commands
        assert tones[name].felt == pytest.approx(tones[name].now / tones[name].frequency / math.tau)
    assert tones["1/rev of tail"].axis == "r"
    # counts of 1 deg/s of both gyros: the phase of 60 s' average is off by a few percent
    (lag,) = found.lag(20.0)
    assert lag == pytest.approx(math.degrees(math.atan(20.0 / corner)), rel=0.05)
    # the rotor idles for longer than it is at speed, and logging pauses: the longest stretch counts
    idles = np.arange(time.size) < 35_000
    paused = {**counts, "headspeed": np.where(idles, 800, counts["headspeed"])}
    paused["time"] = counts["time"] + np.where(time > 40.0, 30_000_000, 0)
    again = {one.name: one for one in told(paused).peaks}
    assert math.degrees(again["1/rev of main"].logged) == pytest.approx(6.0, rel=0.1)
    assert "too short" in told({name: one[:1] for name, one in counts.items()})
    del counts["gyroRAW[1]"]
    assert told(counts) == "vibration isn't told without gyroRAW[1] in the log"


@tabled("made", "wanted")
def test_multiples_tones_and_notches_are_those_by_hand(made, wanted):
    """Of lines 0.5 Hz apart; what is unknown is NaN."""
    assert made() == wanted


LINES, FLOWN = np.arange(600), ArduCopterLaw.of(OWN)


def white(rate, filtered):
    noise = np.random.default_rng(1).standard_normal((8000, 3))
    return looks._Gyros("", rate, [noise], filtered)


def tones(**powers):
    """Return the tones of spectra of 1 with so much at a few lines, such as k16=100.0."""
    logged = np.ones((3, LINES.size))
    for line, power in powers.items():
        logged[:, int(line[1:])] = power
    return pytest.approx(np.array([*looks._tones(0.5 * LINES, logged).items()]), abs=1e-4)


def gyros(own=None, **tables):
    """Return name, rate, roll's values of each part, and whether behind the filters."""
    found = looks._sources(Told(own, **tables))
    parts = [
        (one.name, one.rate, [part[:, 0] for part in one.parts], one.filtered) for one in found
    ]
    return [(name, pytest.approx(rate), [[*map(float, one)] for one in part], behind)
            for name, rate, part, behind in parts]  # fmt: skip


def axes(rows, x="GyrX", y="GyrY", z="GyrZ"):
    """Return a message each 0.1 s whose first field counts from 1."""
    count = 1.0 + np.arange(rows)
    return Rows(0.1 * count, **{x: count, y: 0.0 * count, z: 0.0 * count})


@tabled("found", "wanted")
def test_gyros_are_what_is_logged_in_flight_best_first(found, wanted):
    """Between lift-off (EV 28) and three seconds before landing (18), RATE's in degrees."""
    assert found() == wanted
