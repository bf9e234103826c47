"""Blackbox logs: every value that was written is read, and what is lost is said."""

import re
import struct

import numpy as np
import pytest

import blackbox_logs as written
import helisim as hs
from blackbox_logs import Field, adjusted, encode, event, frame
from helisim.base.errors import HelisimError, InputError, StorageError, UnknownNameError
from helisim.cli import main
from helisim.ident import structures
from helisim.logs import Blackbox, Column, Layout, Map, read_log
from helisim.logs.blackbox import is_blackbox, read_dump
from tabled import rows, tabled

COUNT = 300
TIME = 5_000_000 + 8000 * np.arange(COUNT)
OF_4_2 = {"Firmware revision": "Rotorflight 4.2.11 (0) STM32F4"}
BETAFLIGHT = {"Firmware type": "Cleanflight", "Firmware revision": "Betaflight 4.5.0 (0) STM32F7X2"}
BETAFLIGHT |= {"pidsum_limit": "500", "pidsum_limit_yaw": "400"}


def each(name, count, size=300):
    random = np.random.default_rng([count, *name.encode()])
    steps = random.integers(-size, size + 1, (COUNT, count)) * (random.random((COUNT, 1)) < 0.3)
    return {f"{name}[{k}]": one for k, one in enumerate((np.cumsum(steps, axis=0) % 9000 - 4500).T)}


def saved(folder, data, name="LOG00001.TXT"):
    path = folder / name
    path.write_bytes(data)
    return path


def check(log, columns, rows=slice(None)):
    for name, values in columns.items():
        if name != "time":
            np.testing.assert_array_equal(log.raw(name), np.asarray(values)[rows], err_msg=name)


def test_every_field_of_rotorflight_is_read(tmp_path):
    random, columns = np.random.default_rng(1), {"time": TIME + np.arange(COUNT) % 7}
    for name, one in written.ROTORFLIGHT.items():
        if name not in ("time", "loopIteration"):
            low = -9000 if one.signed else 0
            steps = random.integers(-1, 2, COUNT) * random.choice([1, 5, 30, 300], COUNT)
            columns[name] = np.abs(np.cumsum(steps)) % 8000 + low
    log = Blackbox(saved(tmp_path, encode(columns)))
    check(log, columns)
    np.testing.assert_array_equal(np.rint(1e6 * log.time()), columns["time"])
    assert (log.header["rollPID"], log.firmware) == ("50,100,0,100,0", "Rotorflight 4.6.0")
    assert not log.source.findings


@tabled("predictor", "encoding", "p_predictor", "p_encoding")
def test_every_predictor_and_encoding_is_undone(
    tmp_path, predictor, encoding, p_predictor, p_encoding
):
    own = Field(1, predictor, encoding, p_predictor, p_encoding)
    columns = {"time": TIME, **each("motor", 1), **each("own", 12), **each("small", 12, 2)}
    if {encoding, p_encoding} & {written.UNSIGNED_VB, written.NEG_14BIT}:
        columns = {name: np.abs(one) for name, one in columns.items()}
    fields = dict.fromkeys(columns, own)
    fields["last"], columns["last"] = own._replace(encoding=0, p_encoding=6), columns["own[0]"]
    alone = Field(1, written.ZERO, written.SIGNED_VB, written.PREVIOUS)
    kept = {name: written.ROTORFLIGHT[name] for name in ("loopIteration", "time")}
    fields = {**kept, **fields, "motor[0]": alone, "time": kept["time"]}
    header = {"motorOutput": "158,2047"}
    check(Blackbox(saved(tmp_path, encode(columns, header, fields=fields))), columns)


def test_time_goes_on_beyond_32_bits(tmp_path):
    """After 71.6 minutes the firmware's clock of 32 bits, us, begins anew."""
    time = 2**31 - 1_000_000 + 8_000_000 * np.arange(COUNT)
    log = Blackbox(saved(tmp_path, encode({"time": time, **each("gyroADC", 3)})))
    np.testing.assert_allclose(log.time(), 1e-6 * time, atol=1e-9)
    np.testing.assert_array_equal(log.raw("time"), time % 2**32)


def test_events_and_frames_beside_the_main_ones_are_read(tmp_path):
    home = frame("H", written.GPS_HOME, -338_567_844, 1_512_152_967)  # beyond 2^30
    before = {
        3: event(50, 4) + event(30, 5, 1) + b"E\x65\x04oops",
        5: frame("S", written.SLOW, 9, 2, 0, 1, 1) + frame("G", written.GPS, 0, 1, 2, 3, 4, 5, 6),
        7: home + frame("G", written.GPS, 1500, 11, -5, 7, 300, 20, 900),
        9: adjusted(11, -60) + b"E\x0d\x8b" + struct.pack("<f", 1.5) + event(15, 200),
        11: event(0, 77) + event(40, 1) + event(51, 1) + event(52, 300),
    }
    columns = {"time": TIME, **each("gyroADC", 3)}
    log = Blackbox(saved(tmp_path, encode(columns, before=before, gps=True)))
    check(log, columns)
    assert [(one.kind, *one.numbers) for one in log.events if one.kind != 101] == [
        *((50, 4, 0), (30, 5, 1), (13, 11, -60), (13, 139, 0x3FC00000), (15, 200, 0)),
        *((0, 77, 0), (40, 1, 0), (51, 1, 0), (52, 300, 0), (255, 0, 0)),
    ]
    assert [one.text for one in log.events][:4] == ["", "", "oops", ""]
    assert log.events[3].time == 1e-6 * TIME[8]
    slow = [*log.raw("stateFlags"), *log.raw("rxSignalReceived"), *log.time("slow")]
    assert slow == [2, 1, 1e-6 * TIME[4]]
    # 1.5 ms after the main frame before; the frame ahead of home has no place
    assert log.time("gps") == pytest.approx([1e-6 * (TIME[6] + 1500)], abs=1e-9)
    gps = {"coord[0]": -33.8567849, "coord[1]": 151.2152974, "speed": 20.0, "ground_course": 90.0}
    assert {name: log[f"GPS_{name}"][0] for name in gps} == pytest.approx(gps, abs=1e-9)
    assert [one.kind for one in log.source.findings] == ["corruption", "adjusted"]
    assert "1 frames without the one that they build on" in log.source.findings[0].text


def test_old_intervals_are_a_share(tmp_path):
    """Two of three iterations were logged, in Betaflight's words of before 2018."""
    kept = np.flatnonzero(np.arange(450) % 32 % 3 != 1)[:COUNT]
    data, last, further = encode({"time": TIME}), 0, 0
    data = data[: data.index(b"I interval")] + b"I interval:32\nH P interval:2/3\n"
    for n in kept.tolist():
        if n % 32 == 0:
            data, further = data + b"I" + 2 * written.unsigned(n), n
        else:
            data, further = data + b"P" + written.signed(n - 2 * last + further), last
        last = n
    log = Blackbox(saved(tmp_path, data))
    np.testing.assert_array_equal(log.raw("loopIteration"), kept)
    np.testing.assert_array_equal(np.rint(1e6 * log.time()), kept)
    assert [one.kind for one in log.source.findings] == ["no end"]
    assert log.header["P interval"] == "2/3"


def test_of_several_logs_the_largest_is_read_and_another_can_be_chosen(tmp_path, capsys):
    parts = [
        encode({"time": TIME[:n], **{k: v[:n] for k, v in each("gyroADC", 3).items()}})
        for n in (40, 300, 60)
    ]
    path = saved(tmp_path, b"\x00garbage" + b"".join(parts), "a.bbl")
    assert is_blackbox(path)
    found = read_log(path)
    assert len(found.record) == 300
    said = found.report.findings[0]
    assert said.kind == "logs"
    assert "log 2 of 3 is read; the others are 3 (" in said.text
    assert len(read_log(path, channels=Map(file=Layout(log=3))).record) == 60
    with pytest.raises(InputError, match="has logs 1 to 3, and 4 was asked for"):
        Blackbox(path, 4)
    main(["look", str(path), "--log", "3", "--quiet"])
    assert "log 3 of 3 is read" in capsys.readouterr().out


def test_what_is_lost_is_counted_and_the_rest_is_right(tmp_path):
    columns = {"time": TIME, **each("gyroADC", 3), **each("axisP", 3)}
    data = encode(columns).replace(b"throttle:2000\n", b"throttle:2000\n\1\2\3")
    middle = data.index(b"I", len(data) // 2)
    log = Blackbox(saved(tmp_path, data[: middle + 20] + data[middle + 75 :]))
    kept = np.flatnonzero(np.isin(TIME, np.rint(1e6 * log.time())))
    assert COUNT - 12 < kept.size < COUNT
    check(log, columns, kept)
    (said,) = log.source.findings
    assert said.kind == "corruption"
    assert " 2 places (8 bytes) where no whole frame is" in said.text  # three, and the cut's five
    assert f"{COUNT - kept.size} frames missing between others" in said.text
    found = read_log(log.path, max_gap=0.1)
    assert said in found.report.findings


def test_a_pause_is_no_loss(tmp_path):
    rows = np.r_[0:100, 200:COUNT]
    columns = {"time": TIME[rows], "loopIteration": 8 * rows}
    columns |= {name: one[rows] for name, one in each("gyroADC", 3).items()}
    log = Blackbox(saved(tmp_path, encode(columns)))
    check(log, columns)
    assert [one.text for one in log.source.findings] == ["logging paused 1 times"]


def test_wild_stamps_cost_their_frames_and_a_jump_few(tmp_path):
    """Of a whole frame and those that build on it, four here: two in a row that don't agree."""
    wild, late = TIME.copy(), TIME + 60_000_000 * (np.arange(COUNT) >= 100)
    wild[[100, 104]] += 2_000_000_000, 1_000_000_000
    for time, lost, frames in ((wild, 8, (6, 2)), (late, 4, (3, 1))):
        log = Blackbox(saved(tmp_path, encode({"time": time, **each("gyroADC", 3)})))
        kept = np.delete(time, range(100, 100 + lost))
        np.testing.assert_array_equal(np.rint(1e6 * log.time()), kept)
        text = f" {frames[0]} frames without the one that they build on, {frames[1]} frames whose "
        assert text in log.source.findings[0].text


def moving(count=4000, rate=500.0):
    """Return counts of a helicopter that rolls, pitches and turns: rates as their angles' slopes.

    In forward, left and up, but the heading, which counts to the right.
    """
    time = np.arange(count) / rate
    angles = np.stack([np.sin(one * time) * 0.05 for one in (30.0, 37.0, 45.0)])
    rates = np.degrees(np.gradient(angles, time, axis=1))
    down = [np.sin(angles[1]), np.sin(angles[0]), np.cos(angles[0]) * np.cos(angles[1])]
    turned = np.array([1, 1, -1])[:, None]
    columns = {"time": np.rint(1e6 * time) + 1_000_000}
    for name, each_row in (
        ("gyroADC", rates),
        ("attitude", 10.0 * np.degrees(angles * turned)),
        ("accADC", 2048.0 * np.array(down) * np.array([[-1], [1], [1]])),
        ("setpoint", 100.0 * np.stack([*np.sin(angles), angles[0]])),
        ("mixer", 1000.0 * np.stack([*angles, angles[0]])),
    ):
        columns |= {f"{name}[{k}]": np.rint(one) for k, one in enumerate(each_row)}
    return columns | {"headspeed": np.full(count, 2000) + np.arange(count) % 3}


RAPID = {"P interval": "2", "I interval": "32", "pid_process_denom": "8"}


def test_fields_of_rotorflight_are_channels_in_si(tmp_path):
    columns = moving()
    path = saved(tmp_path, encode(columns, RAPID))
    found = read_log(path)
    record, degree = found.record, np.pi / 180.0
    for name, field, factor in (
        *((one, f"gyroADC[{k}]", degree) for k, one in enumerate(("p", "q", "r"))),
        *((one, f"attitude[{k}]", 0.1 * degree) for k, one in enumerate(("phi", "theta", "psi"))),
        *((one, f"setpoint[{k}]", degree) for k, one in enumerate(("LAT", "LON", "PED"))),
        *((one, f"mixer[{k}]", 0.012 * degree) for k, one in enumerate(("lat", "lon"))),
        *(("ped", "mixer[2]", 0.024 * degree), ("col", "mixer[3]", 0.012 * degree)),
        *(("COL", "setpoint[3]", 0.012 * degree), ("rotor_speed", "headspeed", np.pi / 30.0)),
        *((one, f"accADC[{k}]", 9.80665 / 2048.0) for k, one in enumerate(("ax", "ay", "az"))),
    ):
        sign = -1.0 if name in ("q", "r", "theta", "lon", "ped", "LON", "PED", "ay", "az") else 1.0
        np.testing.assert_allclose(record[name], sign * factor * columns[field], atol=1e-9)
    assert record.unit("LAT") == record.unit("lat") == "1"
    full = dict.fromkeys(("col", "lon", "lat"), 12.0 * degree) | {"ped": 24.0 * degree}  # at 1000
    assert record.provenance["conditions"]["full"] == pytest.approx(full)
    # rates are the slopes of angles, and gravity is down: signs and units hold together
    assert not {one.kind for one in found.report.findings} & {"sign", "axes", "unit", "scale"}

    turned = {**Blackbox(path).channels, "q": Column("gyroADC[1]")}  # as a wrong sign is found
    assert "sign" in {one.kind for one in read_log(path, channels=turned).report.findings}


def test_a_motor_at_the_tail_makes_the_controllers_sum_the_pedal(tmp_path):
    columns = {**moving(), **each("axisP", 3), **each("axisF", 3)}
    count = columns["time"].size
    columns = {name: np.resize(one, count) for name, one in columns.items()}
    columns |= {f"motor[{k}]": np.full(count, 500) for k in range(2)}
    log = Blackbox(saved(tmp_path, encode(columns, RAPID)))
    assert log.channels["ped"].column == "axisSum[2]"
    assert log.channels["lat"].column == "mixer[0]"
    total = columns["axisP[2]"] + columns["axisF[2]"]
    np.testing.assert_allclose(log["axisSum[2]"], 1e-3 * total, atol=1e-12)
    assert log.units["axisSum[2]"] == log.units["mixer[2]"] == "1"
    assert log.units["axisSum[0]"] == "deg"
    columns = {name: one for name, one in columns.items() if not name.startswith("mixer")}
    assert Blackbox(saved(tmp_path, encode(columns, RAPID))).units["axisSum[2]"] == "1"


@tabled("header", "column", "factor", "unit")
def test_counts_differ_by_firmware(tmp_path, header, column, factor, unit):
    rounding = 1e-7 if "gyro_scale" in header else 1e-12  # single precision
    more = "rcCommand[4] altitude vario govP govI govD govF govSum govTarget govRequest headspeed "
    more += "tailspeed Vbec Vbus EscV Esc2V Ibat EscI Esc2I servo[0]"
    columns = {"time": TIME, "Vbat": 4440 - np.arange(COUNT) % 50, **each("mixer", 4)}
    columns |= dict.fromkeys(more.split(), TIME % 900)
    for count, some in ((3, "axisP axisI gyroADC accADC attitude"), (4, "rcCommand setpoint")):
        for name in some.split():
            columns |= each(name, count)
    log = Blackbox(saved(tmp_path, encode({k: x[:60] for k, x in columns.items()}, header)))
    np.testing.assert_allclose(log[column], factor * log.raw(column), rtol=rounding)
    assert log.units.get(column, "") == unit


@pytest.mark.parametrize(("header", "limits"), [(BETAFLIGHT, (0.5, 0.4)), (OF_4_2, (np.inf,) * 2)])
def test_without_a_mixer_the_limited_sum_of_terms_is_the_command(tmp_path, header, limits):
    columns = {"time": TIME, "rcCommand[4]": TIME % 900}
    columns |= each("rcCommand", 4) | each("setpoint", 4)
    for name in ("axisP", "axisI", "axisD", "axisF", "gyroADC"):
        columns |= each(name, 3)
    log = Blackbox(saved(tmp_path, encode(columns, header)))
    assert [log.channels[one].column for one in ("lat", "lon", "ped")] == [
        f"axisSum[{k}]" for k in range(3)
    ]
    count = 1e-3 if header is BETAFLIGHT else 2e-3
    for k, limit in ((0, limits[0]), (1, limits[0]), (2, limits[1])):
        total = count * sum(columns[f"axis{one}[{k}]"] for one in "PIDF")
        assert np.max(np.abs(total)) > 0.5
        np.testing.assert_allclose(log[f"axisSum[{k}]"], np.clip(total, -limit, limit), atol=1e-12)
    collective = "rcCommand[4]" if header is OF_4_2 else "setpoint[3]"
    assert log.channels["col"].column == collective
    assert "COL" not in log.channels
    sticks = ("LAT", "LON", "PED")
    assert [log.channels[one].column for one in sticks] == [f"setpoint[{k}]" for k in range(3)]
    old = {name: one for name, one in columns.items() if not name.startswith("setpoint")}
    log = Blackbox(saved(tmp_path, encode(old, header)))
    found = {one: log.channels[one] for one in sticks if one in log.channels}
    # Betaflight's sticks where no setpoints are logged: +-500 to the right, forward, to the left
    wanted = {} if header is OF_4_2 else {"LAT": 1, "LON": -1, "PED": -1}
    assert {name: one.sign for name, one in found.items()} == wanted
    for k, one in enumerate(found.values()):
        assert one.column == f"rcCommand[{k}]"
        np.testing.assert_allclose(log[one.column], 2e-3 * old[one.column], atol=1e-12)


def flown():
    rate, count = 250.0, 15_000
    time = np.arange(count) / rate
    asked = 200.0 * np.sin(np.cumsum(2.0 + 20.0 * time / time[-1]) / rate)
    noise = np.random.default_rng(2).normal(0.0, 20.0, count)
    p, moved = np.zeros(count), np.zeros(count)
    for k in range(count - 1):
        moved[k] = 2.0 * (asked[k] - p[k]) + noise[k]
        p[k + 1] = p[k] + (8.0 * moved[k] - 10.0 * p[k]) / rate
    columns = {"setpoint[0]": asked, "mixer[0]": moved, "gyroADC[0]": p}
    others = {f"{one}[{k}]": 0.0 * p for one in ("setpoint", "mixer") for k in range(1, 4)}
    others |= {f"gyroADC[{k}]": 0.0 * p for k in (1, 2)}
    stamps = {"time": np.rint(1e6 * time) + 1_000_000}
    return stamps | {name: np.rint(one) for name, one in (columns | others).items()}


def test_a_log_is_looked_at_and_identified_by_its_own_channels(tmp_path, capsys):
    path = saved(tmp_path, encode(flown(), {"P interval": "4", "I interval": "64"}))
    found = hs.look(path)
    assert {"lat", "LAT", "p"} <= {one.name for one in found.logs[0].channels}
    assert found.proposal is not None
    options = ["--inputs", "lat", "--outputs", "p", "--structure", "tf:0/1", "--band", "3", "20"]
    assert main(["identify", str(path), *options, "--reference", "LAT", "--quiet"]) == 0
    assert "LAT" in capsys.readouterr().out
    frf = hs.frequency_response(
        read_log(path).record, inputs="lat", outputs="p", reference="LAT", band=(3.0, 20.0)
    )
    lag = structures.transfer_function(zeros=0, poles=1, input="lat", output="p")
    found = hs.identify(frf, lag)
    gain, pole = (found.parameters[one] for one in ("b0", "a0"))
    # p' = 8 mixer - 10 p in deg/s and counts of 0.012 deg, as steps of 4 ms have them
    exact = -250.0 * np.log(1.0 - 10.0 / 250.0)
    assert gain.value == pytest.approx(0.8 * exact / 0.012, abs=3 * gain.standard_error)
    assert pole.value == pytest.approx(exact, abs=3 * pole.standard_error)


@tabled("replaced", "by", "message")
def test_a_header_that_cant_be_is_refused(tmp_path, replaced, by, message):
    data = encode({"time": TIME, **each("gyroADC", 3), **each("axisP", 3)})
    assert replaced in data
    with pytest.raises(StorageError, match=message) as raised:
        Blackbox(saved(tmp_path, data.replace(replaced, by)))
    assert len(str(raised.value)) <= 500


def attempt(path, data):
    path.write_bytes(data)
    read, said = [], "read"
    try:
        read.append(Blackbox(path))
        read_log(path, repair=("gaps", "missing", "duplicates", "resets"))
    except HelisimError as error:
        said = str(error)
    assert 0 < max(map(len, said.splitlines())) <= 500
    assert all(np.isfinite(log[name]).all() for log in read for name in log.columns)
    return bool(read)


def test_a_log_that_is_cut_anywhere_is_read_or_refused(tmp_path):
    columns = {"time": TIME[:12], **{k: v[:12] for k, v in each("gyroADC", 3).items()}}
    data = encode(columns, {"Craft name": None}, ended=False)
    begins = data.index(b"maxthrottle:2000\n") + len("maxthrottle:2000\n")
    read = [attempt(tmp_path / "a.bbl", data[:stop]) for stop in range(0, len(data), 3)]
    assert not any(read[: begins // 3])
    assert read[-1]


def test_nothing_and_a_header_alone_are_refused(tmp_path):
    data = encode({"time": TIME})
    header = data[: data.index(b"I" + written.unsigned(0))]
    for one, message in ((header, "a header, and no frame"), (b"x" * 100, "no Blackbox log in")):
        with pytest.raises(StorageError, match=message):
            Blackbox(saved(tmp_path, one))
    with pytest.raises(StorageError, match="the file is empty"):
        read_log(saved(tmp_path, b""))


def test_unknown_fields_and_clocks_are_listed(tmp_path):
    log = Blackbox(saved(tmp_path, encode({"time": TIME, **each("gyroADC", 3)})))
    for wanted in (lambda: log["gyro"], lambda: log.raw("time2"), lambda: log.time("gps")):
        with pytest.raises(UnknownNameError, match=r"gyroADC|main"):
            wanted()


def test_a_dump_of_the_command_line_is_a_mapping(tmp_path):
    path = tmp_path / "dump.txt"
    path.write_text(written.DUMP)
    found = read_dump(path)
    assert dict(found) == dict(rows(globals(), "test_a_dump_of_the_command_line_is_a_mapping"))
    path.write_text(re.sub("set|servo|mixer", "x", written.DUMP))
    with pytest.raises(StorageError, match="no setting in it, such as 'set roll_p_gain = 50'"):
        read_dump(path)
