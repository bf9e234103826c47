"""Property tests: whatever a log holds, it is a record, and a look at it a value, or an error."""

import csv
import io
import shlex
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from helisim.base.errors import HelisimError
from helisim.cli import parser
from helisim.cli.logs import command_line
from helisim.logs import Clock, Column, Log, Map, read_log
from helisim.look import look

MAP = Map(
    {"p": Column("p", "deg/s"), "lat": Column("u", "us", trim=1500, range=800)}, Clock("t", "s")
)
REPAIRS = [(), ("missing",), ("duplicates", "gaps", "missing"), ("resets", "gaps")]
REPAIR_SETS = st.sampled_from(REPAIRS)
LARGE = [HealthCheck.too_slow, HealthCheck.data_too_large]
SETTINGS = settings(max_examples=60, suppress_health_check=LARGE)


def opened(data: bytes, read, **options) -> Any:
    """Return what a file of these bytes is, or the error; anything else that is raised fails."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "any.log")
        path.write_bytes(data)
        try:
            return read(path, **options)
        except HelisimError as error:
            return error


def faults(data: bytes, **options) -> list[str]:
    """Return what is wrong with the records that bytes give, or with the error's message."""
    log = opened(data, read_log, channels=MAP, **options)
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


HEADS = st.sampled_from(
    [
        *("t [s]", "time", "time_ms", "stamp", "p", "q [deg/s]", "rollRate", "Roll", "pitch_cmd"),
        *("lat", "LAT [percent]", "rc1", "collective [%]", "acc_z", "az [g]", "climb", "a:b", "n"),
    ]
)
KINDS = ["time", "ms", "sine", "zero", "noise", "pulses", "holes", "wild", "none"]
COLUMNS = st.sampled_from(KINDS)


def column(kind, count, seed):
    """Return numbers of a kind, (count,)."""
    t, random = np.arange(count) / 50.0, np.random.default_rng(seed)
    return {
        "time": t,
        "ms": 1e3 * t,
        "sine": np.sin(3.0 * t),
        "zero": 0.0 * t,
        "noise": random.standard_normal(count),
        "pulses": 1500.0 + 300.0 * np.sin(np.exp(t / 8.0)),
        "holes": np.where(random.random(count) < 0.1, np.nan, np.sin(t)),
        "wild": 1e300 * random.standard_normal(count),
        "none": np.full(count, np.nan),
    }[kind]


@pytest.mark.slow
@given(
    columns=st.lists(st.tuples(HEADS, COLUMNS), min_size=1, max_size=6),
    count=st.sampled_from([0, 1, 3, 60, 600]),
    cut=st.integers(0, 60),
    seed=st.integers(0, 9),
)
@settings(max_examples=150, deadline=None)
def test_any_table_is_looked_at_or_refused(columns, count, cut, seed):
    """Columns of any kind under any name, with a gap: a value that prints, or an error."""
    heads = [head for head, _ in columns]
    rows = zip(*(column(kind, count, seed).tolist() for _, kind in columns))
    lines = [",".join("" if cell != cell else repr(cell) for cell in row) for row in rows]
    del lines[20 : 20 + cut]
    found = opened("\n".join([",".join(heads), *lines, ""]).encode(), look)
    if isinstance(found, HelisimError):
        assert "any.log" in str(found)
        return
    assert str(found)
    assert found.to_dict()["logs"][0]["format"] == "CSV"
    if found.proposal is not None:
        words = shlex.split(command_line(found.proposal))[1:]
        assert parser(words).parse_args(words).command == "identify"
