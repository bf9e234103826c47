"""Forms of logs beside the tables of tests/logs/test_readers.py: arrays, dates, PX4 of old."""

import numpy as np
import pytest
from scipy.io import savemat

import autopilot_logs
from helisim.base.errors import StorageError
from helisim.logs import Clock, Column, Layout, Map, read_log
from helisim.logs.read import open_source
from tabled import tabled

T = np.arange(400) * 0.01
P = np.sin(3.0 * T)
RATE = {"p": Column("p", "rad/s")}


def read(path, *names, time=None):
    map_ = Map(RATE, time, Layout(names=names))
    return read_log(path, channels=map_).records[0]["p"]


@tabled("text", "names")
def test_a_table_is_read_with_decimal_commas_blanks_no_heading_or_dates(tmp_path, text, names):
    path = tmp_path / "a.csv"
    path.write_text(text)
    np.testing.assert_allclose(read(path, *names), P, atol=1e-8)  # of nine decimals


def test_seconds_are_taken_where_the_steps_say_so_and_others_are_asked_for(tmp_path):
    path = tmp_path / "a.csv"
    np.savetxt(path, np.column_stack([T, P]), header="time,p", comments="", delimiter=",")
    (found,) = read_log(path, channels=RATE).report.findings
    assert "its steps are 0.01, the median, so it is taken to be in s" in found.text
    np.savetxt(path, np.column_stack([1e3 * T, P]), header="time,p", comments="", delimiter=",")
    with pytest.raises(StorageError) as raised:
        read_log(path, channels=RATE)
    assert [str(one.value) for one in raised.value.findings[0].remedy] == ["time:ms"]
    even = read_log(path, channels=RATE, time="100:Hz").records[0].time
    np.testing.assert_allclose(even, T, atol=1e-12)


def test_numpy_and_matlab_are_read(tmp_path):
    table = np.column_stack([T, P])
    np.save(tmp_path / "a.npy", table)
    np.testing.assert_array_equal(read(tmp_path / "a.npy", "t", "p"), P)
    with pytest.raises(StorageError, match=r"2 columns of 400 numbers, and 0 names"):
        read(tmp_path / "a.npy")
    named = np.array(list(zip(T, P)), dtype=[("t", "f8"), ("p", "f8")])
    np.save(tmp_path / "b.npy", named)
    np.testing.assert_array_equal(read(tmp_path / "b.npy"), P)
    np.savez(tmp_path / "a.npz", t=(1e3 * T).astype(np.uint32), p=P)
    np.testing.assert_array_equal(read(tmp_path / "a.npz", time=Clock("t", "ms")), P)
    nested = {"log": {"t": T, "gyro": np.column_stack([P, P])}, "note": "a text", "one": 1.0}
    savemat(tmp_path / "a.mat", nested | {"two": {"t": T[:99], "p": P[:99]}})
    assert open_source(tmp_path / "a.mat").names == ("log.t", "log.gyro[0]", "log.gyro[1]")
    other = read_log(tmp_path / "a.mat", channels={"p": Column("two.p", "rad/s")}, time="two.t:s")
    np.testing.assert_array_equal(other.record["p"], P[:99])
    np.testing.assert_array_equal(read(tmp_path / "a.mat", "t", "p", "q"), P)
    for name, data, message in [
        ("b.mat", b"MATLAB 7.3 MAT-file", r"save\('log.mat', '-v7'\)"),
        ("c.mat", b"MATLAB 5.0 MAT-file" + bytes(200), "not MATLAB, or damaged"),
        ("d.npy", b"\x93NUMPY\x01\x00", "not NumPy, or damaged"),
    ]:
        (tmp_path / name).write_bytes(data)
        with pytest.raises(StorageError, match=message):
            read(tmp_path / name)


def test_a_log_of_px4_before_ulog_is_read(tmp_path):
    log = autopilot_logs.Log(with_units=False)
    log.messages.clear()
    log.define(129, "TIME", "Q", "StartTime")
    log.define(2, "ATT", "ffffff", "Roll,Pitch,Yaw,RollRate,PitchRate,YawRate")
    for t, p in zip(T, P):
        log.write(129, round(1e6 * t) + 5_000_000)
        log.write(2, 0.0, 0.0, 0.0, p, 0.0, 0.0)
    path = log.save(tmp_path, "a.px4log")
    source = open_source(path)
    assert (source.format, *source.findings) == ("sdlog2",)
    found = read_log(path, channels={"p": Column("ATT.RollRate", "rad/s")})
    np.testing.assert_allclose(found.records[0].time, T, atol=1e-9)
    np.testing.assert_allclose(found.records[0]["p"], P, atol=1e-6)  # single precision


def test_times_of_a_ulog_count_from_when_logging_began(tmp_path):
    pytest.importorskip("pyulog", reason="pyulog isn't installed: pip install -e '.[logs]'")
    stamps = np.round(1e6 * T) + 90_000_000
    stale = np.concatenate([[0.0], stamps[1:]])
    fields = {"p": P, "text": np.frombuffer(b"\nFMT, 1 " * 200, "<f4")[:400]}
    data = autopilot_logs.ulog({"body": (stamps, fields), "stale": (stale, {"p": P})})
    data = data[:8] + np.uint64(89_999_000).tobytes() + data[16:]
    path = tmp_path / "a.ulg"
    path.write_bytes(data)
    for topic, first in [("body", 0.0), ("stale", 0.01)]:
        found = read_log(path, channels={"p": Column(f"{topic}.p", "rad/s")})
        assert found.records[0].time.size == 400 - (topic == "stale")
        assert found.report.parts[0].start == pytest.approx(first, abs=1e-6)


def test_a_deflection_in_degrees_is_a_control(tmp_path):
    path = tmp_path / "a.csv"
    np.savetxt(path, np.column_stack([T, P]), header="time,ail", comments="", delimiter=",")
    found = read_log(path, channels={"lat": Column("ail", "deg", trim=0.0)})
    np.testing.assert_allclose(found.records[0]["lat"], np.radians(P), atol=1e-12)
