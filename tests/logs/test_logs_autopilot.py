"""Logs of PX4 and ArduPilot, made here byte by byte from their format's description."""

import struct

import numpy as np
import pytest

from helisim.base.errors import HelisimError, RecordError, StorageError
from helisim.logs import Column, Map, read_log
from helisim.logs import ulog as module

RATE = 0.004
"""s between gyro messages: 250 Hz."""


def ulog(count=500):
    """Return a ULog with a gyro at 250 Hz and sticks at 50 Hz (PX4 user guide, ULog format)."""

    def message(kind, payload):
        return struct.pack("<HB", len(payload), ord(kind)) + payload

    data = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 1000)
    data += message("B", bytes(40))
    data += message("F", b"gyro:uint64_t timestamp;float[3] xyz;")
    data += message("F", b"stick:uint64_t timestamp;float roll;")
    for number, topic in enumerate((b"gyro", b"stick")):
        data += message("A", struct.pack("<BH", 0, number) + topic)
    for k in range(count):
        stamp = 1000 + round(1e6 * k * RATE)
        data += message("D", struct.pack("<HQfff", 0, stamp, np.sin(k * RATE), k, 0.0))
        if k % 5 == 0:
            data += message("D", struct.pack("<HQf", 1, stamp, np.cos(k * RATE)))
    return data


def dataflash(count=500):
    """Return a DataFlash log of the same (ArduPilot, AP_Logger's FMT)."""

    def message(kind, payload):
        return struct.pack("<BBB", 0xA3, 0x95, kind) + payload

    def layout(kind, name, form, columns):
        size = 3 + struct.calcsize("<" + form.replace("Z", "64s").replace("N", "16s"))
        packed = struct.pack("<BB4s16s64s", kind, size, name, form.encode(), columns)
        return message(0x80, packed)

    data = message(
        0x80,
        struct.pack("<BB4s16s64s", 128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns"),
    )
    data += layout(1, b"GYR", "Qff", b"TimeUS,X,Y")
    data += layout(2, b"RCIN", "QH", b"TimeUS,C1")
    for k in range(count):
        stamp = 1000 + round(1e6 * k * RATE)
        data += message(1, struct.pack("<Qff", stamp, np.sin(k * RATE), k))
        if k % 5 == 0:
            data += message(2, struct.pack("<QH", stamp, round(1500 + 400 * np.cos(k * RATE))))
    return data


def test_a_ulog_becomes_a_record(tmp_path):
    """Topics with their own clocks meet on a common grid, in SI."""
    pytest.importorskip("pyulog", reason="pyulog isn't installed: pip install helisim[logs]")
    path = tmp_path / "a.ulg"
    path.write_bytes(ulog())
    channels = Map({"p": Column("gyro.xyz[0]", "rad/s"), "LAT": Column("stick.roll", "1")})
    unasked = read_log(path, channels=channels)
    assert unasked.record.sample_time == pytest.approx(0.02)
    (finding,) = unasked.report.repairs
    assert "gyro's clock 250 Hz, stick's clock 50 Hz" in finding.text
    assert "resampled at 50 Hz, the slowest one's" in finding.text
    log = read_log(path, channels=channels, resample_hz=100.0)
    record = log.record
    assert record["p"][10:-10] == pytest.approx(np.sin(record.time[10:-10]), abs=1e-4)
    assert record["LAT"][10:-10] == pytest.approx(np.cos(record.time[10:-10]), abs=1e-3)
    assert "gyro.xyz[1]" in log.report.unused
    alone = read_log(path, channels={"p": Column("gyro.xyz[0]", "rad/s")}).record
    assert alone.sample_time == pytest.approx(RATE)
    assert len(alone) == 500


def test_a_dataflash_log_becomes_a_record(tmp_path):
    """A gyro and pulses of the radio meet on a common grid, pulses unitised."""
    path = tmp_path / "a.bin"
    path.write_bytes(dataflash())
    channels = {
        "p": Column("GYR.X", "rad/s"),
        "LAT": Column("RCIN.C1", "us", trim=1500, range=800),
    }
    record = read_log(path, channels=channels, resample_hz=50.0).record
    assert record["p"][10:-10] == pytest.approx(np.sin(record.time[10:-10]), abs=1e-4)
    assert record["LAT"][10:-10] == pytest.approx(0.5 * np.cos(record.time[10:-10]), abs=1e-3)


def test_lost_bytes_are_reported(tmp_path):
    """A hole in a DataFlash log is in the report, and the gap that it leaves is found."""
    path = tmp_path / "a.bin"
    data = bytearray(dataflash())
    half = len(data) // 2
    data[half : half + 600] = bytes(600)
    path.write_bytes(bytes(data))
    channels = {"p": Column("GYR.X", "rad/s")}
    report = read_log(path, channels=channels).report
    assert {"corruption", "gap"} <= {finding.kind for finding in report.findings}
    with pytest.raises(RecordError, match="a gap"):
        read_log(path, channels=channels, resample_hz=50.0)
    assert len(read_log(path, channels=channels, resample_hz=50.0, repair=("gaps",)).records) == 2


@pytest.mark.parametrize("make", [ulog, dataflash])
def test_damaged_logs_are_records_or_errors(tmp_path, make):
    """Cut anywhere, or with bytes flipped, a log is a record or one of helisim's errors."""
    pytest.importorskip("pyulog", reason="pyulog isn't installed: pip install helisim[logs]")
    whole, path = make(60), tmp_path / "a.log"
    random = np.random.default_rng(0)
    column = Column("gyro.xyz[0]" if make is ulog else "GYR.X", "rad/s")
    read, messages = 0, []
    for k in range(150):
        data = bytearray(whole[: random.integers(8, len(whole) + 1)])
        if k % 2:
            for place in random.integers(0, len(data), size=5):
                data[place] = random.integers(256)
        path.write_bytes(bytes(data))
        try:
            read_log(path, channels={"p": column})
            read += 1
        except HelisimError as error:
            messages.append(str(error))
    assert read > 10
    assert all("a.log" in message for message in messages)


def test_a_missing_reader_says_what_to_install(tmp_path, monkeypatch):
    """Without pyulog the message is the command that installs it."""

    def absent(name):
        raise ImportError(name)

    monkeypatch.setattr(module, "import_module", absent)
    path = tmp_path / "a.ulg"
    path.write_bytes(ulog(10))
    with pytest.raises(StorageError, match=r"pip install helisim\[logs\]"):
        read_log(path, channels={"p": Column("gyro.xyz[0]", "rad/s")})


@pytest.mark.parametrize("tail", [b"\xff" * 104, b"\xff" * 3, b"\x00\x01X" * 5 + b"\xff\xffX"])
def test_a_ulog_that_leads_in_circles_ends(tmp_path, tail):
    """A cut message among the definitions sends pyulog back to the start, for ever."""
    path = tmp_path / "circles.ulg"
    path.write_bytes(b"ULog\x01\x12\x35\x01" + bytes(8) + tail)
    with pytest.raises(StorageError, match=r"circles\.ulg: (not ULog, truncated|no messages)"):
        read_log(path)
