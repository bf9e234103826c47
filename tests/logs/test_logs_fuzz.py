"""Property tests: whatever the bytes are, a log is a record or an error with a message."""

import csv
import io
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from helisim.base.errors import HelisimError, InputError, LogError
from helisim.logs import REPAIRS, Clock, Column, Layout, Log, Map, read_log

MAP = Map(
    {"p": Column("p", "deg/s"), "lat": Column("u", "us", trim=1500, range=800)}, Clock("t", "s")
)
REPAIR_SETS = st.sampled_from(
    [(), ("missing",), ("duplicates", "gaps", "missing", "order", "tail"), ("resets", "gaps")]
)
SETTINGS = settings(
    max_examples=150, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large]
)


def read(data: bytes, channels=MAP, **options) -> Log | HelisimError:
    """Return bytes as a log, or the error that they are; anything else that is raised fails."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "any.log")
        path.write_bytes(data)
        try:
            return read_log(path, channels=channels, **options)
        except HelisimError as error:
            return error


def faults(data: bytes, channels=MAP, **options) -> list[str]:
    """Return what is wrong with the records that bytes give, or with the error's message."""
    log = read(data, channels, **options)
    if isinstance(log, HelisimError):
        return [] if "any.log" in str(log) else [f"the message doesn't name the file: {log}"]
    return list(unsound(log, options.get("resample_hz")))


def unsound(log: Log, rate: float | None) -> Iterator[str]:
    """Yield what is wrong with a log that was read."""
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
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "latin-1", "utf-16", "utf-16-le", "utf-32"]),
    repair=REPAIR_SETS,
    resample_hz=st.sampled_from([None, 0.5, 50.0]),
)
@SETTINGS
def test_any_table_is_a_record_or_an_error(rows, header, delimiter, encoding, repair, resample_hz):
    """Cells of every kind, in every encoding, quoted or not, give a record or a message."""
    text = io.StringIO()
    csv.writer(text, delimiter=delimiter).writerows([header, *rows] if header else rows)
    data = text.getvalue().encode(encoding, "replace")
    assert not faults(data, repair=repair, resample_hz=resample_hz)


@given(
    rows=st.lists(
        st.tuples(
            st.one_of(st.floats(0.0, 2.0), st.integers(0, 20).map(float), st.floats()),
            st.one_of(st.just(float("nan")), st.floats(allow_infinity=False)),
            st.one_of(st.just(float("nan")), st.floats(-1e3, 1e3)),
        ),
        max_size=30,
    ),
    repair=REPAIR_SETS,
    resample_hz=st.sampled_from([None, 1.0, 20.0]),
    max_gap=st.sampled_from([None, 0.5]),
)
@SETTINGS
def test_any_numbers_are_a_record_or_an_error(rows, repair, resample_hz, max_gap):
    """Any times and values, with holes, repeats and resets, give a record or a message."""
    text = "t,p,u\n" + "".join(f"{t!r},{p!r},{u!r}\n" for t, p, u in rows)
    assert not faults(text.encode(), repair=repair, resample_hz=resample_hz, max_gap=max_gap)


@given(
    steps=st.lists(st.integers(0, 40), min_size=3, max_size=60),
    holes=st.sets(st.integers(0, 59)),
    more=st.sampled_from([(), ("resets",)]),
    resample_hz=st.sampled_from([None, 30.0, 100.0]),
)
@SETTINGS
def test_no_row_disappears_without_a_word(steps, holes, more, resample_hz):
    """Every row is in a part, or in a finding that says what became of it."""
    stamps = np.cumsum(steps) / 100.0
    lines = [f"{t!r},{'' if k in holes else k},1500\n" for k, t in enumerate(stamps.tolist())]
    repair = ("duplicates", "missing", "gaps", *more)
    log = read(("t,p,u\n" + "".join(lines)).encode(), repair=repair, resample_hz=resample_hz)
    if isinstance(log, HelisimError):
        return
    findings = log.report.findings
    spans = [(part.first_row, part.last_row) for part in log.report.parts]
    spans += [finding.rows[:2] for finding in findings if finding.kind == "short part"]
    kept = {row for first, last in spans for row in range(first, last + 1)}
    lost = set(range(2, 2 + len(steps))) - kept
    assert not lost or {f.kind for f in findings} & {"gap", "duplicate stamp"}
    empty = {k + 2 for k in holes}
    assert lost <= empty | {2 + k for k in range(1, len(steps)) if steps[k] == 0}


MAGIC = [b"", b"t,p,u\n0,1,1500\n", b"PAR1", b"#", b"%t,p,u\n", b"\xa3\x95", b"ULog\x01\x12\x35"]
MAGIC += [b"\xef\xbb\xbf# helisim flight record, version 1\n"]


@given(magic=st.sampled_from(MAGIC), data=st.binary(max_size=300), repair=REPAIR_SETS)
@SETTINGS
def test_any_bytes_are_a_record_or_an_error(magic, data, repair):
    """Random bytes, also behind what a format begins with, give a message."""
    assert not faults(magic + data, repair=repair)
    assert not faults(magic + data, channels=None)


WORDS = st.sampled_from(["t", "p", "deg/s", "us", "ft"])
LEAVES = st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=5), WORDS)
KEYS = st.sampled_from(["column", "unit", "sign", "trim", "range", "p", "lat", "x"])
MAP_VALUES = st.recursive(
    LEAVES,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=4),
    max_leaves=12,
)
TABLES = st.sampled_from(["time", "channels", "file", "other"])


@given(data=st.dictionaries(TABLES, MAP_VALUES, max_size=3))
@SETTINGS
def test_any_map_is_a_map_or_an_error(data):
    """Whatever a TOML file holds, it is a map or a message."""
    try:
        map_ = Map.from_dict(data)
    except HelisimError:
        return
    assert not faults(b"t,p,u\n0,1,1500\n1,2,1501\n2,3,1502\n", channels=map_)


@given(data=st.binary(max_size=200))
@settings(max_examples=60)
def test_any_bytes_as_a_map_are_an_error(data):
    """A map that isn't TOML gives a message with the file's name; an empty file is a map."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "map.toml")
        path.write_bytes(data)
        message = "map.toml"
        try:
            Map.from_toml(path)
        except HelisimError as error:
            message = str(error)
    assert "map.toml" in message


@given(
    rate=st.floats(),
    max_gap=st.one_of(st.none(), st.floats()),
    min_duration=st.floats(),
    repair=st.lists(st.sampled_from([*REPAIRS, "all"]), max_size=3),
)
@SETTINGS
def test_any_option_is_used_or_refused(rate, max_gap, min_duration, repair):
    """Options in their range give a record, others a message."""
    sound = (
        1e-3 <= rate <= 1e6
        and (max_gap is None or max_gap > 0.0)
        and 0.0 <= min_duration < float("inf")
        and "all" not in repair
        and not {"order", "resets"} <= set(repair)
    )
    text = "t,p,u\n" + "".join(f"{k / 10},{k},1500\n" for k in range(20))
    options = {"resample_hz": rate, "max_gap": max_gap, "min_duration": min_duration}
    log = read(text.encode(), repair=repair, **options)
    # a gap, or nothing as long as that: the log is at fault, not an option
    refused = isinstance(log, InputError) and not isinstance(log, LogError)
    assert refused != sound


@given(
    delimiter=st.one_of(st.none(), st.text(max_size=2)),
    decimal=st.text(max_size=1),
    encoding=st.one_of(
        st.none(), st.text(max_size=6), st.sampled_from(["utf-16", "rot13", "base64", "idna"])
    ),
    header=st.one_of(st.none(), st.integers(-2, 5)),
    skip=st.integers(-1, 5),
)
@SETTINGS
def test_any_layout_is_used_or_refused(delimiter, decimal, encoding, header, skip):
    """A layout that can't be gives a message."""
    try:
        layout = Layout(delimiter, decimal, encoding, header, skip)
    except HelisimError:
        return
    assert not faults(b"t,p,u\n0,1,1500\n1,2,1501\n", channels=Map(MAP.channels, MAP.time, layout))
