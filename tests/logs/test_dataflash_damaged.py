"""DataFlash logs that are cut, overwritten, interleaved with other bytes, or defined twice."""

import numpy as np
import pytest

from dataflash_logs import Log
from helisim.base.errors import HelisimError, InputError, LogError, StorageError
from helisim.logs import Column, read_log
from helisim.logs.dataflash import DataFlash
from remedies import said


def counting(count=200, **options):
    """Return a log whose messages number themselves, in two types of different lengths."""
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


def test_bytes_between_messages_are_counted_and_skipped(tmp_path):
    """Text of a console between all messages costs no message."""
    log = counting()
    junk = b"APM: flight mode\r\n\xa3"
    log = DataFlash(saved(tmp_path, junk.join(log.messages)))
    assert log.skipped == len(junk) * (len(counting().messages) - 1)
    assert np.array_equal(log.table("ONE")["N"], np.arange(200))
    assert np.array_equal(log.table("TWO")["N"], np.arange(0, 200, 3))


def test_lost_bytes_cost_the_messages_that_they_were_of(tmp_path):
    """The message that a hole begins in is left out: the next one isn't read as its rest."""
    log = counting()
    sizes = np.cumsum([len(one) for one in log.messages])
    at = int(sizes[150]) + 12  # inside of message 151
    data = log.data[:at] + log.data[at + 40 :]  # and of one of the two after it
    read = DataFlash(saved(tmp_path, data, "b.bin"))
    numbers = np.concatenate([read.table(name)["N"] for name in ("ONE", "TWO")])
    whole = np.concatenate([DataFlash(log.save(tmp_path)).table(n)["N"] for n in ("ONE", "TWO")])
    assert len(whole) - 4 <= len(numbers) < len(whole)
    assert set(numbers) <= set(whole)
    times = read.table("ONE")
    assert times.time == pytest.approx(2.5e-3 * times["N"], abs=1e-9)


def test_a_log_that_ends_in_the_middle_of_a_message(tmp_path):
    """Cut at any byte of its last messages, it has all that are whole."""
    log = counting(50)
    sizes = np.cumsum([len(one) for one in log.messages])
    for cut in range(int(sizes[-6]), len(log.data)):
        read = DataFlash(saved(tmp_path, log.data[:cut]))
        whole = int(np.searchsorted(sizes, cut, side="right"))
        assert sum(read.count(name) for name in read.types) == whole
        assert read.skipped == cut - sizes[whole - 1]


def test_a_log_whose_head_is_lost(tmp_path):
    """Types that are defined later on are read from the start."""
    log = counting(20)
    log.define(1, "ONE", "QIf", "TimeUS,N,X")
    for k in range(20, 40):
        log.write(1, 2500 * k, k, 0.0)
    first = next(k for k, one in enumerate(log.messages) if one[2] == 1)
    read = DataFlash(saved(tmp_path, b"".join(log.messages[first:])))
    assert np.array_equal(read.table("ONE")["N"], np.arange(40))
    assert "TWO" not in read
    with pytest.raises(StorageError, match="no DataFlash message"):
        DataFlash(saved(tmp_path, b"".join(counting(20).messages[first:])))


def test_a_type_that_is_defined_anew(tmp_path):
    """The same again changes nothing; another layout counts from where it stands."""
    log = counting(10)
    log.define(1, "ONE", "QIf", "TimeUS,N,X")
    log.write(1, 25_000, 10, 1.0)
    log.define(1, "ONE", "QIBd", "TimeUS,N,New,X")
    log.write(1, 27_500, 11, 5, 1.1)
    log.define(1, "ONE", "QIN", "TimeUS,N,X")
    log.write(1, 30_000, 12, b"a word")
    read = DataFlash(log.save(tmp_path))
    table = read.table("ONE")
    assert read.skipped == 0
    assert np.array_equal(table["N"], np.arange(13))
    assert table["X"][:12] == pytest.approx(0.1 * np.arange(12), abs=1e-6)
    assert np.isnan(table["X"][12])
    assert np.array_equal(table["New"], [*[np.nan] * 11, 5.0, np.nan], equal_nan=True)
    assert table.time == pytest.approx(2.5e-3 * np.arange(13), abs=1e-9)


def test_a_letter_that_is_not_known(tmp_path):
    """What stands before it is read, what follows it is named."""
    log = counting(5)
    log.define(9, "NEW", "QfxB", "TimeUS,A,B,C", length=3 + 8 + 4 + 5 + 1)
    log._forms[9] = "Qf5sB"
    for k in range(4):
        log.write(9, k, 1.5, b"?????", 2)
    log.define(8, "BAD", "QffffB", "TimeUS,A,B,C,D,E", length=3 + 8 + 4)
    log._forms[8] = "Qf"
    log.write(8, 7, 2.5)
    read = DataFlash(log.save(tmp_path))
    assert read.skipped == 0
    assert tuple(read.table("NEW").columns) == ("A",)
    assert np.array_equal(read.table("NEW")["A"], [1.5] * 4)
    assert np.array_equal(read.table("BAD")["A"], [2.5])
    assert read.notes == (
        "NEW: format letter 'x' isn't known, so B and what follows it is left out",
        "BAD: its format QffffB is longer than 15 bytes, so B and what follows it is left out",
    )
    log = read_log(tmp_path / "a.bin", channels={"p": "ONE.X"})
    assert [one.text for one in log.report.findings if one.kind == "format"] == list(read.notes)


def test_a_clock_that_goes_back(tmp_path):
    """Its messages stay in the file's order, and the reader of logs refuses them with the row."""
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
    """Numbers that look like the start of a message, or even like a whole FMT, are numbers."""
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
    assert read.count("RAW") == 50


SEEDS = [0, *(pytest.param(k, marks=pytest.mark.slow) for k in range(1, 8))]
"""The first in each run of the tests."""


@pytest.mark.parametrize("seed", SEEDS)
def test_damage_anywhere_costs_no_other_message(tmp_path, seed):
    """Bytes overwritten, cut out or put in: what lies elsewhere is read, or the error is ours."""
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
        found = {
            (name, int(n)) for name in ("ONE", "TWO") for n in read.table(name)["N"] if n < 1000
        }
        safe = {j for j in range(first, whole) if j not in hurt}
        expected = {
            (
                "ONE" if log.messages[j][2] == 1 else "TWO",
                int.from_bytes(log.messages[j][11:15], "little"),
            )
            for j in safe
        }
        assert len(expected - found) <= 1  # one may be swallowed by junk that looks like a message


@pytest.mark.parametrize("seed", SEEDS)
def test_any_bytes_are_a_log_or_an_error(tmp_path, seed):
    """Definitions damaged too, every type, field, parameter and text is read, or said not to be."""
    random = np.random.default_rng(100 + seed)
    log = counting(20)
    log.define(4, "PARM", "QNf", "TimeUS,Name,Value")
    log.define(5, "MSG", "QZ", "TimeUS,Message")
    log.define(6, "ISB", "QBaH", "TimeUS,I,x,n", units="s#--", multipliers="F---")
    for k in range(10):
        log.write(4, k, b"P%d" % k, k)
        log.write(5, k, b"ArduCopter V4.%d" % k)
        log.write(6, k, k % 2, *range(32), k)
    whole, read = log.data, 0
    for _ in range(25):
        data = bytearray(whole)
        for _ in range(int(random.integers(1, 12))):
            data[int(random.integers(len(data)))] = int(random.integers(256))
        if random.random() < 0.3:
            a, b = sorted(random.integers(0, len(data), 2))
            del data[a:b]
        try:
            one = DataFlash(saved(tmp_path, bytes(data)))
            for name in one.types:
                for instance in one.instances(name):
                    table = one.table(name, instance)
                    assert all(len(table[field]) == len(table) for field in table.columns)
            one.parameters(), one.messages(), one.version, one.first_stamps
            read += 1
        except HelisimError:
            continue
    assert read > 12


def test_noise_is_no_log(tmp_path):
    """Random bytes, and marks alone, end in one line."""
    random = np.random.default_rng(0)
    for data in (random.integers(0, 256, 300_000, np.uint8).tobytes(), b"\xa3\x95" * 50_000):
        with pytest.raises(StorageError, match=r"no DataFlash message in its \d+ bytes"):
            DataFlash(saved(tmp_path, data))


def test_a_logger_that_drops_messages(tmp_path):
    """Many short gaps: how long they are is said, and those that are interpolated are noted."""
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
    with pytest.raises(
        LogError, match=r"most are short.*up to 0\.\d+ s \(max_gap\), and split"
    ) as error:
        read_log(path, channels={"p": "ONE.X"}, resample_hz=100.0)
    (finding,) = error.value.findings
    _, allowed, *repair = said(finding).split()
    assert repair == ["--repair", "gaps"]
    read = read_log(
        path, channels={"p": "ONE.X"}, resample_hz=100.0, max_gap=float(allowed), repair="gaps"
    )
    (bridged,) = [one for one in read.report.findings if one.kind == "bridged gap"]
    (dropped,) = [one for one in read.report.findings if one.kind == "dropped"]
    assert dropped.count == away.sum()
    assert len(read.records) < 10
    assert bridged.repaired
    assert bridged.count > 40
    assert max(np.max(np.abs(one["p"])) for one in read.records) == pytest.approx(
        np.radians(1.0),
        rel=1e-3,  # ten samples of a period of 1257 are missing at most
    )
    slow = read_log(path, channels={"q": "SLO.Y"}, max_gap=float(allowed), resample_hz=4.0)
    assert len(slow.records) == 1  # a clock that is slower than the gap isn't all gaps


def test_thousands_of_parts_share_what_is_said_of_their_log(tmp_path):
    """The report is copied once, not once a part: it lists all of them."""
    log = Log(with_units=False)
    log.define(1, "ONE", "Qf", "TimeUS,X")
    for k in range(9000):
        log.write(1, 2500 * k + 100_000 * (k // 3), 0.1 * (k % 7))
    channels = {"p": Column("ONE.X", "rad/s")}
    read = read_log(log.save(tmp_path), channels=channels, repair="gaps")
    assert len(read.records) == len(read.report.parts) == 3000
    first, *others = (one.provenance["log"] for one in read.records)
    assert all(one is first for one in others)
    assert len(first["parts"]) == 3000
    assert [one.provenance["part"] for one in read.records] == list(range(3000))
    assert read.records[5].slice(0.0, 1e9).provenance is read.records[5].provenance
    assert str(read.report).count("\n") < 40


def test_an_autopilots_whole_log_is_no_record(tmp_path):
    """Of hundreds of columns on many clocks, the user says which are channels: in one line."""
    log = Log()
    for number in range(1, 8):
        log.define(number, f"T{number}", "Qff", "TimeUS,A,B", units="skd", multipliers="F00")
        for k in range(50):
            log.write(number, 10_000 * k + number, 0.1 * k, 1.0)
    with pytest.raises(InputError, match=r"14 columns with a unit on 7 clocks; say which") as error:
        read_log(log.save(tmp_path))
    assert "\n" not in str(error.value)
