"""The reader of ArduPilot's binary logs, on logs made here byte by byte, and against pymavlink."""

import numpy as np
import pytest

from autopilot_logs import LETTERS, Log, flipped
from command import said
from helisim.base.errors import HelisimError, InputError, LogError, StorageError, UnknownNameError
from helisim.logs import dataflash, read_log
from helisim.logs.dataflash import DataFlash
from tabled import tabled


def small():
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


SMALL = (pytest.param(k, marks=pytest.mark.slow) for k in (1, 2, 1000))


@pytest.mark.parametrize("window", [3, 64, 1 << 22, *SMALL])
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
    missing = "pymavlink isn't installed: pip install -e '.[sitl]'"
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


# DataFlash logs that are cut, overwritten, interleaved with other bytes, or defined twice.


def counting(count=200, **options):
    log = Log(**options)
    log.define(1, "ONE", "QIf", "TimeUS,N,X", units="s-k", multipliers="F-0")
    log.define(2, "TWO", "QIffB", "TimeUS,N,X,Y,C", units="s-kk-", multipliers="F-00-")
    for k in range(count):
        log.write(1, 2500 * k, k, 0.1 * k)
        if k % 3 == 0:
            log.write(2, 2500 * k + 7, k, 0.2 * k, 1.0, 3)
    return log


def saved(folder, data, name="a.bin"):
    path = folder / name
    path.write_bytes(data)
    return path


def test_a_log_that_ends_in_the_middle_of_a_message(tmp_path):
    log = counting(50)
    sizes = np.cumsum([len(one) for one in log.messages])
    for cut in range(int(sizes[-6]), len(log.data)):
        read = DataFlash(saved(tmp_path, log.data[:cut]))
        whole = int(np.searchsorted(sizes, cut, side="right"))
        kept = sum(len(read.table(name)) for name in read.types)
        assert kept in (whole, whole - 1)  # a message counts where the next one's marks are
        assert read.skipped == cut - sizes[kept - 1]


def test_a_letter_that_is_not_known(tmp_path):
    log = counting(5)
    log.define(9, "NEW", "QfxB", "TimeUS,A,B,C", length=3 + 8 + 4 + 5 + 1)
    log._forms[9] = "Qf5sB"
    for k in range(4):
        log.write(9, k, 1.5, b"?????", 2)
    read = DataFlash(log.save(tmp_path))
    assert (read.skipped, *read.table("NEW").columns) == (0, "A", "C")  # 5 bytes of B are the rest
    assert (*read.table("NEW")["A"], *read.table("NEW")["C"]) == (1.5,) * 4 + (2.0,) * 4
    log = read_log(tmp_path / "a.bin", channels={"p": "ONE.X"})
    (said,) = (one.text for one in log.report.findings if one.kind == "format")
    assert said.startswith("NEW: 'B', of the format letter 'x'")


@tabled("at", "value", "columns", "told")
def test_damage_to_a_row_of_formats_shifts_no_field(tmp_path, at, value, columns, told):
    """What a log states once of its messages: what contradicts itself is not read, and told."""
    log = counting(600)
    at += log.data.index(bytes((0xA3, 0x95, 128, 1)))
    read = DataFlash(saved(tmp_path, log.data[:at] + bytes((value,)) + log.data[at + 1 :]))
    assert (told in read.damage, bool(told)) == (True, read.damaged)
    assert (read.has("TWO", "N", "X"), read.has("ONE", "X")) == (True, False)
    assert (read.table("ONE").columns if "ONE" in read else None) == columns


def test_a_clock_that_goes_back(tmp_path):
    log = counting(100)
    for k in range(100, 200):
        log.write(1, 2500 * (k - 100) + 50, k, 0.0)
    path = log.save(tmp_path)
    table = DataFlash(path).table("ONE")
    assert np.array_equal(table["N"], np.arange(200))
    assert np.flatnonzero(np.diff(table.time) < 0.0).tolist() == [99]
    with pytest.raises(HelisimError, match=r"row 100.*resets"):
        read_log(path, channels={"p": "ONE.X"})
    assert len(read_log(path, channels={"p": "ONE.X"}, repair="resets").records) == 2


def test_marks_inside_of_messages(tmp_path):
    log = Log()
    log.define(1, "ONE", "QIf", "TimeUS,N,X")
    log.define(3, "RAW", "QZZ", "TimeUS,A,B")
    inner = Log(with_units=False)
    inner.define(1, "ONE", "B", "N")
    false = inner.messages[-1]
    for k in range(50):
        log.write(1, k, k, np.frombuffer(b"\xa3\x95\x01\x00", "<f4")[0])
        log.write(3, k, false[:64], false[64:] + b"\xa3\x95\x01\xa3\x95\x80")
    read = DataFlash(log.save(tmp_path))
    assert read.skipped == 0
    assert np.array_equal(read.table("ONE")["N"], np.arange(50))
    assert len(read.table("RAW")) == 50


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2, 3))])
def test_damage_anywhere_costs_no_other_message(tmp_path, seed):
    random = np.random.default_rng(seed)
    log = counting(150)
    starts = np.cumsum([0, *(len(one) for one in log.messages)])
    first = next(k for k, one in enumerate(log.messages) if one[2] == 1)
    whole = len(log.messages)
    for _ in range(20):
        data, k = bytearray(log.data), int(random.integers(first, whole - 1))
        at = int(random.integers(starts[k], starts[k + 1]))
        count = int(random.integers(1, 120))
        junk = random.integers(0, 256, count, np.uint8).tobytes()
        kind = int(random.integers(3))
        data[at : at + (0 if kind == 2 else count)] = b"" if kind == 1 else junk[:count]
        hurt = range(k, int(np.searchsorted(starts, at + (0 if kind == 2 else count))) + 1)
        read = DataFlash(saved(tmp_path, bytes(data)))
        types = {1: "ONE", 2: "TWO"}
        found = {
            (name, int(n)) for name in types.values() for n in read.table(name)["N"] if n < 1e3
        }
        numbered = [(one[2], int.from_bytes(one[11:15], "little")) for one in log.messages]
        every = [(types.get(kind, "TWO"), number) for kind, number in numbered]
        expected = {every[j] for j in range(first, whole) if j not in hurt}
        if kind == 1:  # nothing is read as the rest of what was cut out
            assert found <= set(every)
            table = read.table("ONE")
            assert table.time == pytest.approx(2.5e-3 * table["N"], abs=1e-9)
        assert len(expected - found) <= 1  # the one before the damage, which no other follows


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("share", [1e-2, 1e-3, 1e-4])
def test_random_bytes_cost_the_numbers_that_they_hit(tmp_path, share, seed):
    log = counting(3000)
    head = sum(len(one) for one in log.messages[:-4000])
    data = log.data[:head] + flipped(log.data[head:], share, seed)
    read = DataFlash(saved(tmp_path, data))
    for name, count in (("ONE", 3000), ("TWO", 1000)):
        table = read.table(name)
        assert 0.8 * count < len(table) + read.strays[name] <= count
        assert not np.any(np.diff(table.time) < 0.0)
        assert 0.0 <= table.time[0] <= table.time[-1] < 8.0  # none of centuries
        off = np.abs(table["X"] - (40.0 if name == "ONE" else 80.0) * table.time)
        assert np.count_nonzero(off > 2.0) <= share * count
        assert np.count_nonzero(np.isnan(table["X"])) < 8.0 * share * count + 2
    assert read.damaged
    assert (f"({read.skipped} of {read.size} bytes)" in read.damage) == (read.skipped > 0)


def test_what_stands_beside_a_spike_is_dropped_after_it():
    values = np.sin(0.01 * np.arange(400.0))
    values[200:205] += 10.0, 20.0, 40.0, 20.0, 10.0
    for rounds, dropped in ((2, range(201, 204)), (20, range(200, 205))):
        dataflash._drop_wild(values, rounds)
        assert np.flatnonzero(np.isnan(values)).tolist() == [*dropped]


def test_one_stamp_that_goes_back_costs_one_message(tmp_path):
    log = counting(200)
    where = max(k for k, one in enumerate(log.messages) if one[2] == 1) - 100
    log.messages[where] = log.messages[where][:3] + bytes(8) + log.messages[where][11:]
    path = log.save(tmp_path)
    report = read_log(path, channels={"p": "ONE.X"}, repair="gaps").report
    assert report.counts == "ONE row"
    assert "1 messages (1 of ONE) have stamps that don't fit" in report.findings[0].text
    assert report.samples == 199


def test_logs_that_are_joined_follow_each_other(tmp_path):
    one, other, short = counting(100), counting(100), Log()
    other.write(1, 2500 * 100, 100, 0.0)
    short.define(1, "ONE", "Qf", "TimeUS,X")
    path = saved(tmp_path, one.data + other.data + one.data + short.data)
    read, size = DataFlash(path), len(one.data)
    table = read.table("ONE")
    assert table["N"].tolist() == [*range(100), *range(101)]
    assert np.diff(table.time)[99] == pytest.approx(10.0, abs=0.1)
    assert np.delete(np.diff(table.time), 99) == pytest.approx(2.5e-3, abs=1e-9)
    (said,) = (one.text for one in read.source.findings if one.kind == "joined")
    third = size + len(other.data)
    assert f"4 logs are joined, one after the other, from byte 0, byte {size}, " in said
    assert f"byte {third} (the same as one before: left out)" in said
    assert f"byte {third + size} (its ONE has other fields: left out)" in said
    assert not read.damage


@pytest.mark.parametrize("first", [True, False])
@pytest.mark.parametrize(("at", "value"), [(3, 2), (10, ord("B")), (26, 0xE9)])
def test_a_hit_format_of_joined_logs_costs_nothing(tmp_path, at, value, first):
    """Its number, which is another type's then, a letter or a name: the other log has it whole."""
    parts = [bytearray(counting(count).data) for count in (300, 400)]
    hit = parts[not first]
    hit[hit.index(bytes((0xA3, 0x95, 128, 1))) + at] = value
    read = DataFlash(saved(tmp_path, b"junk" + parts[0] + parts[1]))
    assert [*read.joints.values()] == ["", ""]
    assert read.table("ONE")["N"].tolist() == [*range(300), *range(400)]
    assert read.table("TWO")["N"].tolist() == [*range(0, 300, 3), *range(0, 400, 3)]


def test_a_logger_that_drops_messages(tmp_path):
    log, random = Log(), np.random.default_rng(3)
    log.define(1, "ONE", "Qf", "TimeUS,X", units="sk", multipliers="F0")
    log.define(2, "SLO", "Qf", "TimeUS,Y", units="sk", multipliers="F0")
    away = np.zeros(4000, bool)
    for at in random.integers(10, 3900, 60):
        away[at : at + 10] = True
    for k in np.flatnonzero(~away).tolist():
        log.write(1, 2500 * k, np.sin(0.005 * k))
        if k % 100 == 0:
            log.write(2, 2500 * k, 1.0)
    log.define(3, "DSF", "QII", "TimeUS,Dp,Blk")
    log.write(3, 9_000_000, int(away.sum()), 7)
    path = log.save(tmp_path)
    asked = {"channels": {"p": "ONE.X"}, "resample_hz": 100.0}
    advice = r"most are short.*up to 0\.\d+ s \(max_gap\), and split"
    with pytest.raises(LogError, match=advice) as error:
        read_log(path, **asked)
    (finding,) = error.value.findings
    _, allowed, *repair = said(finding).split()
    assert repair == ["--repair", "gaps"]
    read = read_log(path, **asked, max_gap=float(allowed), repair="gaps")
    (bridged,) = [one for one in read.report.findings if one.kind == "bridged gap"]
    (dropped,) = [one for one in read.report.findings if one.kind == "dropped"]
    assert dropped.count == away.sum()
    assert len(read.records) < 10
    assert bridged.repaired
    assert bridged.count > 40
    largest = max(np.max(np.abs(one["p"])) for one in read.records)
    # ten samples of a period of 1257 are missing at most
    assert largest == pytest.approx(np.radians(1.0), rel=1e-3)
    slow = read_log(path, channels={"q": "SLO.Y"}, max_gap=float(allowed), resample_hz=4.0)
    assert len(slow.records) == 1  # a clock that is slower than the gap isn't all gaps


def test_an_autopilots_whole_log_is_no_record(tmp_path):
    log = Log()
    for number in range(1, 8):
        log.define(number, f"T{number}", "Qff", "TimeUS,A,B", units="skd", multipliers="F00")
        for k in range(50):
            log.write(number, 10_000 * k + number, 0.1 * k, 1.0)
    with pytest.raises(InputError, match=r"14 columns .* on 7 clocks; say which") as error:
        read_log(log.save(tmp_path))
    assert "\n" not in str(error.value)
