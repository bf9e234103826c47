"""DataFlash logs that are cut, overwritten, interleaved with other bytes, or defined twice."""

import numpy as np
import pytest

from autopilot_logs import Log
from helisim.base.errors import HelisimError, InputError, LogError
from helisim.logs import read_log
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
    log.define(8, "BAD", "QffffB", "TimeUS,A,B,C,D,E", length=3 + 8 + 4)
    log._forms[8] = "Qf"
    log.write(8, 7, 2.5)
    read = DataFlash(log.save(tmp_path))
    assert read.skipped == 0
    assert tuple(read.table("NEW").columns) == ("A",)
    assert np.array_equal(read.table("NEW")["A"], [1.5] * 4)
    assert np.array_equal(read.table("BAD")["A"], [2.5])
    log = read_log(tmp_path / "a.bin", channels={"p": "ONE.X"})
    said = [one.text for one in log.report.findings if one.kind == "format"]
    assert [one.partition(",")[0] for one in said] == ["NEW: B", "BAD: B"]


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
