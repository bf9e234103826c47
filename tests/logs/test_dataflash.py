"""The reader of ArduPilot's binary logs, on logs made here byte by byte, and against pymavlink."""

import numpy as np
import pytest

from autopilot_logs import LETTERS, Log
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


def every_letter(count=40):
    """Return a log with each letter of the format, random numbers and words in each."""
    random = np.random.default_rng(7)
    log = Log()
    letters = "".join(letter for letter in LETTERS if letter not in "aQ")
    for number, some in enumerate((letters[:9], letters[9:]), start=1):
        labels = ",".join(["TimeUS", *(f"F{k}{letter}" for k, letter in enumerate(some))])
        log.define(number, f"T{number}", "Q" + some, labels)
        for k in range(count):
            log.write(number, 1000 * k, *(x for one in some for x in _values(one, random)))
    log.define(4, "GYR", "QBff", "TimeUS,I,X,Y", units="s#kE", multipliers="F-00")
    for k in range(count):
        log.write(4, 1000 * k + 1, k % 3, 0.125 * k, -k)
    return log


def _values(letter, random):
    form = LETTERS[letter]
    if form.endswith("s"):
        size = int(random.integers(0, int(form[:-1]) + 1))
        return [bytes(random.integers(97, 123, size, np.uint8))]
    if form in "fde":
        return [float(np.float16(random.normal() * 100.0))]
    info = np.iinfo(np.dtype(form))
    return [int(random.integers(info.min, info.max, dtype=info.dtype, endpoint=True))]


def rows_of(path):
    """Return what pymavlink reads: type -> (columns, instance's column, rows)."""
    missing = "pymavlink isn't installed: pip install helisim[sitl]"
    module = pytest.importorskip("pymavlink.DFReader", reason=missing)
    reader = module.DFReader_binary(str(path))
    found = {}
    while (message := reader.recv_msg()) is not None:
        columns = message.fmt.columns
        found.setdefault(message.get_type(), []).append([getattr(message, c) for c in columns])
    formats = {one.name: one for one in reader.formats.values()}
    reader.close()
    return {
        name: (formats[name].columns, formats[name].instance_field, rows)
        for name, rows in found.items()
    }


def same_as_reference(log, reference):
    """Assert that all columns of all types and instances are the reference's."""
    assert set(log.types) == set(reference)
    for name, (columns, instance_field, rows) in reference.items():
        for instance in log.instances(name):
            where = columns.index(instance_field) if instance_field else None
            kept = [row for row in rows if where is None or row[where] == instance]
            table = log.table(name, instance)
            assert len(table) == len(kept) > 0
            for column, values in zip(columns, zip(*kept)):
                if column == "TimeUS":
                    assert table.time == pytest.approx(1e-6 * np.array(values), abs=1e-10)
                elif isinstance(values[0], str):
                    assert list(table[column]) == list(values)
                elif (name, column) != ("MULT", "Mult"):
                    # the reference takes M for signed; ArduPilot's description says uint8
                    values = np.array(values) % 256 if column.endswith("M") else values
                    assert np.array_equal(table[column], np.array(values, np.float64))


def test_every_letter_of_the_format_is_read_as_the_reference_does(tmp_path):
    path = every_letter().save(tmp_path)
    same_as_reference(DataFlash(path), rows_of(path))


def test_text_is_refused(tmp_path):
    path = tmp_path / "a.log"
    path.write_text("FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\nGYR, 5, 1.0\n")
    for read in (DataFlash, read_log):
        with pytest.raises(StorageError, match=r"as text.*\.bin") as caught:
            read(path)
        assert str(path) in str(caught.value)
