import errno
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helisim.base.errors import RecordError, StorageError
from helisim.records.record import Channel, FlightRecord, channel
from helisim.records.storage import read_record, write_record

SUFFIXES = (".parquet", ".csv")
AWKWARD = Channel('gap, "rotor" [x]', "m/s^2 [raw]", "OTHER", "an odd name; Ω and a\nsecond line")


SMALL = FlightRecord(
    [0.0, 0.5, 1.0], [[1.0, 4.0], [2.0, 5.0], [3.0, 6.0]], (channel("p"), channel("q"))
)
"""Its CSV has five comment lines, the header on line 6 and the rows on lines 7 to 9."""


def make_record(n: int = 50, provenance: dict | None = None) -> FlightRecord:
    """Numbers that no short decimal represents, on standard and odd channels."""
    rng = np.random.default_rng(7)
    channels = (channel("lat"), channel("LAT"), channel("p"), AWKWARD)
    return FlightRecord(
        time=np.arange(n) / 100.0,
        values=rng.standard_normal((n, len(channels))) * [1e-12, 1.0, 1e9, np.pi],
        channels=channels,
        provenance={"seed": 7, "note": "zero gyro µ"} if provenance is None else provenance,
    )


# Round trip


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_record_comes_back_exactly(tmp_path, suffix):
    """Numbers to the last bit, units, kinds, meanings and provenance survive the disk."""
    record = make_record()
    assert read_record(write_record(record, tmp_path / f"flight{suffix}")) == record


@given(
    values=st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=2, max_size=8),
    seed=st.integers(0, 2**53),
)
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_any_finite_double_survives(tmp_path_factory, suffix, values, seed):
    """Subnormals, minus zero and the largest doubles come back bit for bit."""
    path = tmp_path_factory.mktemp("any") / f"flight{suffix}"
    record = FlightRecord(
        np.arange(len(values)), np.array(values)[:, None], (channel("p"),), {"seed": seed}
    )
    back = read_record(write_record(record, path))
    assert back.values.tobytes() == record.values.tobytes()
    assert back.provenance["seed"] == seed


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_equal_records_give_equal_bytes(tmp_path, suffix):
    """A file depends on the record alone: not on the clock, nor on the order of keys."""
    origins = ({"a": 1, "b": [2, {"c": 3, "d": 4}]}, {"b": [2, {"d": 4, "c": 3}], "a": 1})
    first, second = (
        write_record(make_record(provenance=one), tmp_path / f"{k}{suffix}").read_bytes()
        for k, one in enumerate(origins)
    )
    assert first == second


def test_parquet_is_plain_to_other_readers(tmp_path):
    """Any Parquet reader finds one column a channel, its unit, and JSON provenance."""
    record = make_record()
    table = pq.read_table(write_record(record, tmp_path / "flight.parquet"))
    assert table.column_names == ["time", *record.names]
    np.testing.assert_array_equal(table["p"].to_numpy(), record["p"])
    assert table.schema.field("p").metadata[b"unit"] == b"rad/s"
    assert table.schema.field("p").metadata[b"kind"] == b"OUT"
    header = json.loads(table.schema.metadata[b"helisim"])
    assert header["version"] == 1
    assert header["provenance"] == dict(record.provenance)


def test_csv_is_plain_to_other_readers(tmp_path):
    """Apart from the comment lines a CSV is a header with units and rows of numbers."""
    path = write_record(make_record(), tmp_path / "flight.csv")
    lines = [line for line in path.read_text("utf-8").splitlines() if not line.startswith("#")]
    assert lines[0].startswith("time [s],lat [1],LAT [1],p [rad/s],")
    assert len(lines) == 51


def test_csv_saved_by_a_windows_editor_is_read(tmp_path):
    """A byte order mark and CRLF line ends change nothing."""
    record = make_record()
    path = write_record(record, tmp_path / "flight.csv")
    text = path.read_text("utf-8").replace("\n", "\r\n")
    path.write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert read_record(path) == record


# Refusals


@pytest.mark.parametrize("name", ["flight.hdf5", "flight", "flight.csv.gz"])
def test_an_unknown_suffix_lists_those_that_exist(tmp_path, name):
    """Neither writing nor reading guesses a format."""
    for attempt in (lambda path: write_record(SMALL, path), read_record):
        with pytest.raises(StorageError, match=r"unknown suffix .*available: \.parquet, \.csv"):
            attempt(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_an_unusable_place_is_one_clear_error(tmp_path, suffix, monkeypatch):
    """A file that is absent, a folder in its place, a folder that is none or is read-only."""
    (tmp_path / f"folder{suffix}").mkdir()
    (tmp_path / "file").write_text("")
    for name, says in ((f"absent{suffix}", "no such file"), (f"folder{suffix}", "not a regular")):
        with pytest.raises(StorageError, match=f"{name}: {says}"):
            read_record(tmp_path / name)
    for name, says in (
        (f"folder{suffix}", "not a regular file"),
        (f"absent/flight{suffix}", "absent is not a folder"),
        (f"file/flight{suffix}", "file is not a folder"),
    ):
        with pytest.raises(StorageError, match=says):
            write_record(SMALL, tmp_path / name)
    before = set(tmp_path.iterdir())

    def refuse(*_):  # also for root, who ignores mode bits
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(StorageError, match="can't write it: Permission denied"):
        write_record(SMALL, tmp_path / f"flight{suffix}")
    assert set(tmp_path.iterdir()) == before


def test_a_channel_called_time_is_refused(tmp_path):
    """It would be a second column of that name."""
    record = FlightRecord([0, 1], [[1.0], [2.0]], (Channel("time", "s", "OTHER"),))
    with pytest.raises(RecordError, match="time column"):
        write_record(record, tmp_path / "flight.parquet")


@pytest.mark.parametrize("keep", [0, 3, 200, 0.5, 0.99, "flip"])
def test_damaged_parquet_is_refused(tmp_path, keep):
    """Wherever the file was cut; and a flipped bit is found by the pages' checksums."""
    path = write_record(make_record(), tmp_path / "flight.parquet")
    data = bytearray(path.read_bytes())
    if keep == "flip":
        data[300] ^= 0x10  # inside the first page, the time column
    else:
        del data[keep if isinstance(keep, int) else int(keep * len(data)) :]
    path.write_bytes(data)
    with pytest.raises(StorageError, match=r"flight\.parquet: not Parquet, truncated or corrupt"):
        read_record(path)


READ_AND_END = """
import ctypes, os, sys
import pyarrow.parquet  # first: on import its allocator starts a thread, which knows no Python
from helisim.base.errors import StorageError
from helisim.records.storage import read_record

def threads():
    return len(os.listdir("/proc/self/task"))

sys.setswitchinterval(0.1)
before = threads()
for path in sys.argv[2:]:
    try:
        read_record(path)
    except StorageError:
        pass
if sys.argv[1] == "count":
    print(threads() - before)
else:
    ctypes.PyDLL(None).usleep(20_000)
"""
"""Reads records, and says how many threads that has left. Or ends without once letting go of the
interpreter's lock after the last one, as a short command does by chance; a thread that waits for
the lock then finds that the interpreter has gone."""


def read_and_end(how, *paths):
    command = [sys.executable, "-c", READ_AND_END, how, *map(str, paths)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)


@pytest.fixture
def whole_and_damaged(tmp_path):
    """A record of many channels, each of which is a task for a thread, and a damaged copy."""
    channels = tuple(Channel(f"c{k}", "1", "OTHER") for k in range(40))
    values = np.random.default_rng(7).standard_normal((3000, len(channels)))
    record = FlightRecord(np.arange(3000) / 100.0, values, channels)
    whole = write_record(record, tmp_path / "flight.parquet")
    damaged = bytearray(whole.read_bytes())
    middle = len(damaged) // 2
    damaged[middle : middle + 50] = bytes(50)
    (tmp_path / "damaged.parquet").write_bytes(damaged)
    return whole, tmp_path / "damaged.parquet"


@pytest.mark.skipif(sys.platform != "linux", reason="counts threads by /proc")
def test_reading_parquet_starts_no_thread(whole_and_damaged):
    """None is left that could reach for a Python object after the interpreter's end."""
    done = read_and_end("count", *whole_and_damaged)
    assert (done.returncode, done.stdout, done.stderr) == (0, "0\n", "")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="holds the interpreter's lock by libc")
@pytest.mark.parametrize("which", ["whole", "damaged"])
def test_the_interpreter_ends_right_after_a_read(whole_and_damaged, which):
    """Of such ends more than half were SIGABRT when threads of Arrow had read."""
    path = whole_and_damaged[which == "damaged"]
    for _ in range(8):
        done = read_and_end("end", path)
        assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        (lambda t: t.replace_schema_metadata(None), StorageError, "not a helisim flight record"),
        (
            lambda t: headed(t, version=2),
            StorageError,
            "version 2 of the format, .* reads version 1",
        ),
        (
            lambda t: headed(t, format="dataset"),
            StorageError,
            "a 'dataset', expected a 'flight rec",
        ),
        (lambda t: headed(t, provenance=[]), StorageError, "has no provenance"),
        (lambda t: t.remove_column(0), StorageError, "the first column must be 'time'"),
        (
            lambda t: with_p(t, [1.0] * 4 + [None] * 46, pa.float64()),
            StorageError,
            "column 'p' has no number at row 4",
        ),
        (
            lambda t: with_p(t, ["fast"] * 50, pa.string()),
            StorageError,
            "column 'p' holds string, expected double",
        ),
        (
            lambda t: with_p(t, [1.0] * 9 + [np.nan] * 41, pa.float64()),
            RecordError,
            r"foreign\.parquet: channel 'p' is not finite at row 9",
        ),
    ],
)
def test_foreign_parquet_is_refused(tmp_path, change, error, message):
    """Without our metadata, of another version, or with holes: it is not guessed at."""
    path = tmp_path / "foreign.parquet"
    pq.write_table(change(pq.read_table(write_record(make_record(), path))), path)
    with pytest.raises(error, match=message):
        read_record(path)


def headed(table, **changes):
    header = json.loads(table.schema.metadata[b"helisim"])
    return table.replace_schema_metadata({"helisim": json.dumps({**header, **changes})})


def with_p(table, values, kind):
    field = pa.field("p", kind, metadata=table.schema.field("p").metadata)
    return table.set_column(3, field, pa.array(values, kind))


@pytest.mark.parametrize(
    ("old", "new", "error", "message"),
    [
        ("# helisim", "# other", StorageError, "line 1 must be"),
        ("version 1", "version 9", StorageError, "version 9 of the format"),
        ("version 1", "version one", StorageError, "'one' is not a whole number"),
        ("# rows: 3\n", "", StorageError, "needs one line '# rows:'"),
        ("# rows: 3", "# rows: 4", StorageError, "truncated: 3 rows, .* says 4"),
        ("{}", "{", StorageError, "'# provenance:' is not JSON"),
        ("{}", "[]", StorageError, "'# provenance:' is not a JSON object"),
        ('"OUT"', '"IN7"', StorageError, "unknown kind 'IN7'; available: IN1, IN2"),
        ('"unit": "rad/s", ', "", StorageError, "a channel lacks its unit"),
        (",q [rad/s]", "", StorageError, "line 6: missing columns: q \\[rad/s\\]"),
        ("p [rad/s]", "p [deg/s]", StorageError, "missing columns: p \\[rad/s\\]"),
        ("q [rad/s]\n", "q [rad/s],x\n", StorageError, "without a '# channel:' line: x"),
        ("time [s],p [rad/s]", "p [rad/s],time [s]", StorageError, "in this order: time"),
        ("0.5,2.0,5.0", "0.5,2.0", StorageError, "line 8: 2 columns, expected 3"),
        ("0.5,2.0,5.0", "0.5,fast,5.0", StorageError, "line 8, column 'p .rad/s.': 'fast' is not"),
        ("0.5,2.0,5.0", "0.5,,5.0", StorageError, "line 8, column 'p .rad/s.': '' is not"),
        ("0.5,2.0,5.0", "0.5,2.0,nan", RecordError, "line 8, column 'q .rad/s.': 'nan' is not fin"),
        ("0.5,2.0,5.0", "0.5,2.0,inf", RecordError, "line 8, column 'q .rad/s.': 'inf' is not fin"),
        ("0.5,2.0,5.0", "0.0,2.0,5.0", RecordError, "time must increase"),
        ("1.0,3.0,6.0\n", "1.0,3.0,6", StorageError, "truncated"),
        ("1.0,3.0,6.0\n", "", StorageError, "truncated: 2 rows"),
    ],
)
def test_a_damaged_csv_is_refused(tmp_path, old, new, error, message):
    """Each damage ends in an error that names the file, the place and the fault."""
    path = write_record(SMALL, tmp_path / "flight.csv")
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(error, match=message) as caught:
        read_record(path)
    assert str(caught.value).startswith(str(path))


@pytest.mark.parametrize("content", [b"", b"\x00\xff\xfe\x00", b"PAR1", b"time,p\n0,1\n"])
def test_what_is_not_our_csv_is_refused(tmp_path, content):
    """Empty, binary and foreign files end in a StorageError."""
    path = tmp_path / "flight.csv"
    path.write_bytes(content)
    with pytest.raises(StorageError):
        read_record(path)


def test_a_full_disk_leaves_nothing(tmp_path, monkeypatch):
    """When the disk fills while a record is written, no part of a file stays."""

    def fill(_table, path, **_):
        Path(path).write_bytes(b"PAR1")
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(pq, "write_table", fill)
    with pytest.raises(StorageError, match=r"flight\.parquet: .*No space left"):
        write_record(make_record(), tmp_path / "flight.parquet")
    assert list(tmp_path.iterdir()) == []


def test_a_written_file_has_ordinary_permissions(tmp_path):
    """The file is as readable as any that the user creates, not private as temporaries are."""
    plain = tmp_path / "plain"
    plain.write_text("")
    path = write_record(SMALL, tmp_path / "flight.csv")
    assert path.stat().st_mode == plain.stat().st_mode
