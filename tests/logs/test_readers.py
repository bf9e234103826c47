"""One flight in every format: read alike, cut alike, refused by one table; then each one's own."""

import csv
import hashlib
import io
import json
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import autopilot_logs
from helisim.base.errors import HelisimError, InputError, StorageError
from helisim.logs import Clock, Column, Layout, Log, Map, read_log  # noqa: F401  (rows name them)
from helisim.logs import ulog as module
from tabled import tabled

RATE = 0.004
"""s between gyro messages: 250 Hz."""
P = {"p": Column("p", "rad/s")}
TIMES = pa.array([0.0, 0.1, 0.2])


def stamped(count):
    """Return stamps in us, and s since the first."""
    t = np.arange(count) * RATE
    return 1000 + np.round(1e6 * t), t


def ulog(count=500):
    stamps, t = stamped(count)
    gyro = np.column_stack([np.sin(t), np.arange(count), 0.0 * t])
    topics = {"gyro": (stamps, {"xyz": gyro}), "stick": (stamps[::5], {"roll": np.cos(t[::5])})}
    return autopilot_logs.ulog(topics)


def dataflash(count=500):
    stamps, t = stamped(count)
    return autopilot_logs.dataflash({"GYR": (stamps, {"X": np.sin(t), "Y": np.arange(count)})})


def table(count=500):
    k = np.arange(count)
    return {"t": 5.0 + k * RATE, "p": np.sin(k * RATE), "k": k.astype(float)}


def text(count=500):
    rows = zip(*(column.tolist() for column in table(count).values()))
    return ("t [s],p,k\n" + "".join(f"{t!r},{p!r},{k!r}\n" for t, p, k in rows)).encode()


def columnar(count=500):
    sink = pa.BufferOutputStream()
    columns = table(count)
    pq.write_table(pa.table({"t [s]": columns.pop("t"), **columns}), sink)
    return sink.getvalue().to_pybytes()


FORMATS = {
    # bytes, the rate's column, another one, what rows are counted from, the first stamp
    "CSV": (text, "p", "k", ("line", 2, "5.0 s")),
    "Parquet": (columnar, "p", "k", ("row", 0, "5.0 s")),
    "ULog": (ulog, "gyro.xyz[0]", "gyro.xyz[1]", ("gyro row", 0, "1000 us")),
    "DataFlash": (dataflash, "GYR.X", "GYR.Y", ("GYR row", 0, "1000 us")),
}


@pytest.fixture(params=FORMATS)
def log_of(request, tmp_path):
    pytest.importorskip("pyulog", reason="pyulog isn't installed: pip install -e '.[logs]'")
    make, *rest = FORMATS[request.param]
    path = tmp_path / "a.log"
    path.write_bytes(make())
    return request.param, path, *rest


def test_every_format_gives_the_same_record(log_of):
    name, path, column, other, (counts, first, origin) = log_of
    log = read_log(path, channels={"p": Column(column, "deg/s", sign=-1)})
    record, report = log.record, log.report
    assert record.sample_time == pytest.approx(RATE)
    assert record.time[0] == 0.0
    assert record["p"] == pytest.approx(-np.radians(np.sin(record.time)), abs=1e-8)
    told = (report.format, report.counts, report.samples, report.origin)
    assert told == (name, counts, 500, origin)
    assert report.digest == hashlib.blake2b(path.read_bytes(), digest_size=16).hexdigest()
    assert other in report.unused
    assert log.where("p") == f"{path}, column {column!r}, {counts}s {first} to {first + 499}"
    assert json.loads(json.dumps(report.to_dict())) == record.provenance["log"]
    assert report.columns["p"] == f"-{column!r} [deg/s] in rad/s"
    assert str(path) in str(report)
    part = read_log(path, channels={"p": Column(column, "rad/s")}, start=0.5, stop=1.0)
    assert len(part.record) == 126
    assert [(one.kind, one.count) for one in part.report.repairs] == [("limits", 374)]
    even = read_log(path, channels={"p": Column(column, "rad/s")}, resample_hz=50.0)
    inside = slice(5, -5)
    assert even.record["p"][inside] == pytest.approx(np.sin(even.record.time[inside]), abs=1e-4)


@tabled("column", "options", "message")
def test_what_no_format_allows_is_refused_in_one_way(log_of, column, options, message):
    _, path, own, _, _ = log_of
    name, unit = column
    with pytest.raises(HelisimError) as raised:
        read_log(path, channels={"p": Column(name or own, unit)}, **options)
    assert message in str(raised.value)
    assert str(path) in str(raised.value)
    known = ["channel", "map"] if name else []
    assert [one.name for found in raised.value.findings for one in found.remedy] == known


def test_clocks_of_topics_meet_on_a_common_grid(tmp_path):
    pytest.importorskip("pyulog", reason="pyulog isn't installed: pip install -e '.[logs]'")
    path = tmp_path / "a.ulg"
    path.write_bytes(ulog())
    channels = Map({"p": Column("gyro.xyz[0]", "rad/s"), "LAT": Column("stick.roll", "1")})
    unasked = read_log(path, channels=channels)
    assert unasked.record.sample_time == pytest.approx(0.02)
    (finding,) = unasked.report.repairs
    assert "gyro's clock 250 Hz, stick's clock 50 Hz" in finding.text
    assert "resampled at 50 Hz, the slowest one's" in finding.text
    record = read_log(path, channels=channels, resample_hz=100.0).record
    assert record["LAT"][10:-10] == pytest.approx(np.cos(record.time[10:-10]), abs=1e-3)


def test_a_missing_reader_says_what_to_install(tmp_path, monkeypatch):

    def absent(name):
        raise ImportError(name)

    monkeypatch.setattr(module, "import_module", absent)
    path = tmp_path / "a.ulg"
    path.write_bytes(ulog(10))
    with pytest.raises(StorageError, match=r"pip install -e '\.\[logs\]'"):
        read_log(path, channels={"p": Column("gyro.xyz[0]", "rad/s")})


@pytest.mark.parametrize("tail", [b"\xff" * 104, b"\xff" * 3, b"\x00\x01X" * 5 + b"\xff\xffX"])
def test_a_ulog_that_leads_in_circles_ends(tmp_path, tail):
    """A cut message among the definitions sends pyulog back to the start, for ever."""
    path = tmp_path / "circles.ulg"
    path.write_bytes(b"ULog\x01\x12\x35\x01" + bytes(8) + tail)
    with pytest.raises(StorageError, match=r"circles\.ulg: (not ULog, truncated|no messages)"):
        read_log(path)


SECONDS = Clock("time", "s")
T, P3 = ("time", TIMES), ("p", TIMES)
BIG = pa.array([0, 1, 2**64 - 1], pa.uint64())


@tabled("content", "time", "error", "message")
def test_a_file_that_is_no_log_is_refused_by_its_place(tmp_path, content, time, error, message):
    path = tmp_path / "a.log"
    if isinstance(content, str):
        path.write_text(content)
    else:
        pq.write_table(pa.table(dict(content)), path)
    with pytest.raises(error) as raised:
        read_log(path, channels=Map(P, time))
    assert message in str(raised.value)
    assert "a.log" in str(raised.value)


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
def test_timestamps_of_a_table_are_seconds_since_the_first(tmp_path, unit):
    per_second = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}[unit]
    stamps = pa.array([k * per_second for k in (2, 3, 4)], pa.timestamp(unit))
    path = tmp_path / "a.parquet"
    pq.write_table(pa.table({"when": stamps, "p": TIMES}), path)
    for time in (None, Clock("when"), Clock("when", "iso8601"), Clock(rate=1.0)):
        log = read_log(path, channels=Map(P, time))
        assert log.record.time == pytest.approx([0.0, 1.0, 2.0], abs=1e-12)
        assert log.report.origin == ("0" if time and time.rate else "1970-01-01 00:00:02")


@tabled("make", "message")
def test_a_map_that_makes_no_sense_is_refused_by_its_entry(tmp_path, make, message):
    path = tmp_path / "map.toml"
    if isinstance(make, str):
        path.write_text(make)
    with pytest.raises((InputError, StorageError)) as raised:
        Map.from_toml(path) if isinstance(make, str) else make()
    assert message in str(raised.value)
    assert ("map.toml" in str(raised.value)) == isinstance(make, str)


# Property tests: whatever a log holds, it is a record, and a look at it a value, or an error.

MAP = Map(
    {"p": Column("p", "deg/s"), "lat": Column("u", "us", trim=1500, range=800)}, Clock("t", "s")
)
REPAIRS = [(), ("missing",), ("duplicates", "gaps", "missing"), ("resets", "gaps")]
REPAIR_SETS = st.sampled_from(REPAIRS)
LARGE = [HealthCheck.too_slow, HealthCheck.data_too_large]
SETTINGS = settings(max_examples=60, suppress_health_check=LARGE)


def opened(data: bytes, read, **options) -> Any:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "any.log")
        path.write_bytes(data)
        try:
            return read(path, **options)
        except HelisimError as error:
            return error


def faults(data: bytes, **options) -> list[str]:
    log = opened(data, read_log, channels=MAP, **options)
    if isinstance(log, HelisimError):
        return [] if "any.log" in str(log) else [f"the message doesn't name the file: {log}"]
    return list(unsound(log, options.get("resample_hz")))


def unsound(log: Log, rate: float | None) -> Iterator[str]:
    for k, record in enumerate(log.records):
        if not np.all(np.isfinite(record.values)):
            yield f"record {k} has numbers that are not finite"
        if not np.all(np.diff(record.time) > 0.0):
            yield f"time doesn't increase in record {k}"
        if rate is not None and abs(record.sample_time * rate - 1.0) > 1e-6:
            yield f"record {k} has steps of {record.sample_time} s, asked for were {1.0 / rate}"
    stated, kept = sum(part.samples for part in log.report.parts), sum(map(len, log.records))
    if stated != kept:
        yield f"the report has {stated} samples, the records have {kept}"


ODD = ["", "nan", "-inf", "1e999", "1_000", "1,5", '"', "\0", "0x10", "٣", " 7 ", "é"]
CELLS = st.one_of(
    st.floats().map(repr),
    st.integers(-(10**400), 10**400).map(str),
    st.integers(0, 50).map(str),
    st.floats(0.0, 1.0).map(repr),
    st.sampled_from(ODD),
    st.text(max_size=6),
)
HEADERS = [["t", "p", "u"], ["t [ms]", "p [deg/s]", "u"], ["t", "t", "p", "u"], []]


@given(
    rows=st.lists(st.lists(CELLS, min_size=1, max_size=5), max_size=12),
    header=st.sampled_from(HEADERS),
    delimiter=st.sampled_from([",", ";", "\t", "|"]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "latin-1", "utf-16", "utf-16-le"]),
    repair=REPAIR_SETS,
    resample_hz=st.sampled_from([None, 0.5, 50.0]),
)
@SETTINGS
def test_any_table_is_a_record_or_an_error(rows, header, delimiter, encoding, repair, resample_hz):
    text = io.StringIO()
    csv.writer(text, delimiter=delimiter).writerows([header, *rows] if header else rows)
    data = text.getvalue().encode(encoding, "replace")
    assert not faults(data, repair=repair, resample_hz=resample_hz)


@given(
    steps=st.lists(st.integers(0, 40), min_size=3, max_size=60),
    holes=st.sets(st.integers(0, 59)),
    more=st.sampled_from([(), ("resets",)]),
    resample_hz=st.sampled_from([None, 30.0, 100.0]),
)
@SETTINGS
def test_no_row_disappears_without_a_word(steps, holes, more, resample_hz):
    stamps = np.cumsum(steps) / 100.0
    lines = [f"{t!r},{'' if k in holes else k},1500\n" for k, t in enumerate(stamps.tolist())]
    repair = ("duplicates", "missing", "gaps", *more)
    data, options = ("t,p,u\n" + "".join(lines)).encode(), {"repair": repair, "channels": MAP}
    log = opened(data, read_log, resample_hz=resample_hz, **options)
    if isinstance(log, HelisimError):
        return
    findings = log.report.findings
    spans = [(part.first_row, part.last_row) for part in log.report.parts]
    short = [finding.rows for finding in findings if finding.kind == "short part"]
    spans += [pair for rows in short for pair in zip(rows[::2], rows[1::2])]
    kept = {row for first, last in spans for row in range(first, last + 1)}
    lost = set(range(2, 2 + len(steps))) - kept
    assert not lost or {f.kind for f in findings} & {"gap", "duplicate stamp"}
    empty = {k + 2 for k in holes}
    assert lost <= empty | {2 + k for k in range(1, len(steps)) if steps[k] == 0}
