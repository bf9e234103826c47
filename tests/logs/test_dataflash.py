"""The reader of ArduPilot's binary logs, on logs made here byte by byte, and against pymavlink."""

import numpy as np
import pytest

from autopilot_logs import Log
from helisim.base.errors import StorageError, UnknownNameError
from helisim.logs import dataflash, read_log
from helisim.logs.dataflash import DataFlash


def small():
    """Return a log with two gyros, parameters that change and texts."""
    log = Log()
    log.define(1, "GYR", "QBfcha", "TimeUS,I,Rate,Roll,Yaw,Raw", units="s#kdd", multipliers="F-0BB")
    log.define(2, "PARM", "QNff", "TimeUS,Name,Value,Default")
    log.define(3, "MSG", "QZ", "TimeUS,Message")
    log.write(3, 5, b"ArduCopter V4.7.0 (abc)")
    for k in range(100):
        log.write(1, 1000 + 2500 * k, k % 2, 0.5 * k, -3 * k, 7 * k, *range(32))
        if k in (0, 60):
            log.write(2, 1000 + 2500 * k, b"ATC_RAT_RLL_FF", 0.25 + k, 0.0)
    return log


@pytest.mark.parametrize("window", [1, 2, 3, 64, 1000, 1 << 22])
def test_messages_of_a_type_are_columns(tmp_path, monkeypatch, window):
    """Each gyro's messages, in the log's units, however much of it is searched and read at once."""
    monkeypatch.setattr(dataflash, "_WINDOW", window)
    monkeypatch.setattr(dataflash, "_ROWS", window)
    log = DataFlash(small().save(tmp_path))
    assert log.skipped == 0
    assert {"GYR", "PARM", "MSG", "FMT"} <= set(log.types)
    assert log.instances("GYR") == (0, 1)
    second = log.table("GYR", 1)
    odd = np.arange(1, 100, 2)
    assert second.time == pytest.approx(1e-3 + 2.5e-3 * odd, abs=1e-9)
    assert np.array_equal(second["Rate"], 0.5 * odd)
    assert np.array_equal(second["Roll"], -3 * odd / 100.0)
    assert np.array_equal(second["Yaw"], 7 * odd / 100.0)
    assert second.units == {"Rate": "deg/s", "Roll": "deg", "Yaw": "deg", "I": "instance"}
    assert read_log(log.path, channels={"p": "GYR[1].Rate"}).report.findings == ()
    assert not second["Rate"].flags.writeable


def test_parameters_are_those_of_a_time(tmp_path):
    """At last, at the start, and in between; and what wrote the log."""
    log = DataFlash(small().save(tmp_path))
    assert log.parameters() == {"ATC_RAT_RLL_FF": 60.25}
    assert log.parameters(at=-np.inf) == {"ATC_RAT_RLL_FF": 0.25}
    assert log.parameters(at=0.15) == {"ATC_RAT_RLL_FF": 0.25}
    assert log.parameters(at=0.152) == {"ATC_RAT_RLL_FF": 60.25}
    assert log.version == "ArduCopter V4.7.0 (abc)"
    assert [(one.time, one.text) for one in log.messages()] == [(5e-6, log.version)]
    later = small()
    later.define(4, "VER", "QBZ", "TimeUS,BT,FWS")
    later.write(4, 7, 1, b"ArduCopter V4.8.0")
    assert DataFlash(later.save(tmp_path)).version == "ArduCopter V4.8.0"


def test_what_is_not_there_is_named(tmp_path):
    path = small().save(tmp_path)
    log = DataFlash(path)
    with pytest.raises(UnknownNameError, match=r"type of message 'GYRO'; available: .*GYR"):
        log.table("GYRO")
    with pytest.raises(UnknownNameError, match="instance of GYR 2; available: 0, 1"):
        log.table("GYR", 2)
    with pytest.raises(UnknownNameError, match="field of GYR 'Rat'; available: I, Rate, Roll, Yaw"):
        log.table("GYR")["Rat"]
    table = log.table("GYR")
    for left, why in ((2000, "was written to while it was read"), (0, "can't read it")):
        path.write_bytes(path.read_bytes()[:left])
        with pytest.raises(StorageError, match=why):
            table["Rate"]
    path.unlink()
    with pytest.raises(StorageError, match="can't read it"):
        table["Rate"]
    (tmp_path / "b.bin").write_bytes(bytes(5000))
    with pytest.raises(StorageError, match="no DataFlash message in its 5000 bytes"):
        DataFlash(tmp_path / "b.bin")
