"""The reader of ArduPilot's binary logs, on logs made here byte by byte, and against pymavlink."""

import pickle

import numpy as np
import pytest

from dataflash_logs import Log
from helisim.base.errors import StorageError, UnknownNameError
from helisim.logs.dataflash import DataFlash


def small():
    """Return a log with two gyros, parameters that change and texts."""
    log = Log()
    log.define(1, "GYR", "QBfc", "TimeUS,I,Rate,Roll", units="s#kd", multipliers="F-0B")
    log.define(2, "PARM", "QNff", "TimeUS,Name,Value,Default")
    log.define(3, "MSG", "QZ", "TimeUS,Message")
    log.write(3, 5, b"ArduCopter V4.7.0 (abc)")
    for k in range(100):
        log.write(1, 1000 + 2500 * k, k % 2, 0.5 * k, -3 * k)
        if k in (0, 60):
            log.write(2, 1000 + 2500 * k, b"ATC_RAT_RLL_FF", 0.25 + k, 0.0)
    return log


def test_messages_of_a_type_are_columns(tmp_path):
    """Each gyro's messages, in the units that the log states, with its clock in seconds."""
    log = DataFlash(small().save(tmp_path))
    assert log.skipped == 0
    assert {"GYR", "PARM", "MSG", "FMT"} <= set(log.types)
    assert log.instances("GYR") == (0, 1)
    second = log.table("GYR", 1)
    odd = np.arange(1, 100, 2)
    assert second.time == pytest.approx(1e-3 + 2.5e-3 * odd, abs=1e-9)
    assert np.array_equal(second["Rate"], 0.5 * odd)
    assert second["Roll"] == pytest.approx(-0.03 * odd, abs=1e-12)
    assert second.units == {"Rate": "deg/s", "Roll": "deg", "I": "instance"}
    assert not second["Rate"].flags.writeable


def test_a_table_is_a_value(tmp_path):
    """Equal to another reading of it, and to itself from a pickle, which needs no file."""
    path = small().save(tmp_path)
    table, other = (DataFlash(path).table("GYR", 1) for _ in range(2))
    kept = pickle.dumps(table)
    assert table == other
    assert hash(table) == hash(other)
    assert table != DataFlash(path).table("GYR", 0)
    path.unlink()
    assert pickle.loads(kept) == table
    assert repr(table) == "Table('GYR': 50 messages, fields I, Rate, Roll)"


def test_parameters_are_those_of_a_time(tmp_path):
    """At last, at the start, and in between; and what wrote the log."""
    log = DataFlash(small().save(tmp_path))
    assert log.parameters() == {"ATC_RAT_RLL_FF": 60.25}
    assert log.parameters(at=-np.inf) == {"ATC_RAT_RLL_FF": 0.25}
    assert log.parameters(at=0.15) == {"ATC_RAT_RLL_FF": 0.25}
    assert log.parameters(at=0.152) == {"ATC_RAT_RLL_FF": 60.25}
    assert log.version == "ArduCopter V4.7.0 (abc)"
    assert [(one.time, one.text) for one in log.messages()] == [(5e-6, log.version)]


def test_what_is_not_there_is_named(tmp_path):
    """A type, a field or an instance that doesn't exist: the message lists those that do."""
    path = small().save(tmp_path)
    log = DataFlash(path)
    with pytest.raises(UnknownNameError, match=r"type of message 'GYRO'; available: .*GYR"):
        log.table("GYRO")
    with pytest.raises(UnknownNameError, match="instance of GYR 2; available: 0, 1"):
        log.table("GYR", 2)
    with pytest.raises(UnknownNameError, match="field of GYR 'Rat'; available: I, Rate, Roll"):
        log.table("GYR")["Rat"]
    table = log.table("GYR")
    path.write_bytes(path.read_bytes()[:2000])
    with pytest.raises(StorageError, match="was written to while it was read"):
        table["Rate"]
    (tmp_path / "b.bin").write_bytes(bytes(5000))
    with pytest.raises(StorageError, match="no DataFlash message in its 5000 bytes"):
        DataFlash(tmp_path / "b.bin")
