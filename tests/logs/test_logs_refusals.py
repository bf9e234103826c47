"""What a log or its map can't be: each is refused by name, and says what was expected."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from helisim.base.errors import HelisimError, InputError, RecordError, StorageError
from helisim.logs import Clock, Column, Layout, Map, read_log, source

P = {"p": Column("p", "rad/s")}


def parquet(path, **columns):
    pq.write_table(pa.table(columns), path)
    return path


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Column(""), "expected a column's name"),
        (lambda: Column("p", 3), "column 'p'.unit must be text, got 3"),
        (lambda: Column("p", "rad/s", sign=2), "column 'p'.sign must be one of 1, -1, got 2"),
        (
            lambda: Column("p", "us", trim="mid", range=800),
            "'p'.trim must be a number, got 'mid'",
        ),
        (
            lambda: Column("p", "us", trim=1500, range=0),
            "'p'.range must be a number above 0, got 0",
        ),
        (lambda: Column("p", "rad/s", unwrap="yes"), "column 'p'.unwrap must be true or false"),
        (lambda: Column("p", "parsec"), "parsec"),
        (lambda: Clock(), "either a column or a rate"),
        (lambda: Clock("t", "s", 50.0), "either a column or a rate"),
        (lambda: Clock(3), "Clock.column must be text, got 3"),
        (lambda: Clock("t", 3), "Clock.unit must be text, got 3"),
        (lambda: Clock("t", "fortnight"), "fortnight"),
        (lambda: Clock(rate=-1.0), "-1"),
        (lambda: Layout(encoding="klingon"), "unknown encoding 'klingon'"),
        (lambda: Layout(header=0), "Layout.header must be an integer 1 or more, got 0"),
        (lambda: Layout(skip=-1), "Layout.skip must be an integer 0 or more, got -1"),
        (lambda: Layout(names="p"), "Layout.names must be a list of names, got 'p'"),
        (lambda: Map({"p": "p"}), "Map.channels.p must be a table (Column), got 'p'"),
        (lambda: Map({"time": Column("p")}), "can't be called 'time'"),
    ],
)
def test_a_map_that_makes_no_sense_is_refused_by_its_entry(make, message):
    """One line with what was given."""
    with pytest.raises(InputError) as raised:
        make()
    assert message in str(raised.value)


TIMES = pa.array([0.0, 0.1, 0.2])


@pytest.mark.parametrize(
    ("columns", "time", "error", "message"),
    [
        ({"time": TIMES, "p": ["a", "b", "c"]}, Clock("time", "s"), StorageError, "holds string"),
        ({"time": TIMES[:0], "p": TIMES[:0]}, Clock("time", "s"), StorageError, "no rows"),
        ({"x": TIMES, "p": TIMES}, None, InputError, "no column is time"),
        ({"t": TIMES, "time": TIMES, "p": TIMES}, None, InputError, "several columns may be time"),
        ({"time": TIMES, "p": TIMES}, None, InputError, "says no unit"),
        ({"time": TIMES, "p": TIMES}, Clock("clock", "s"), InputError, "clock"),
        (
            {"time": TIMES, "p": TIMES},
            Clock("time", "iso8601"),
            StorageError,
            "only timestamps are",
        ),
        ({"time": [0, None, 2], "p": TIMES}, Clock("time", "s"), RecordError, "row 1"),
        (
            {"time": pa.array([0, 1, 2**64 - 1], pa.uint64()), "p": TIMES},
            Clock("time", "s"),
            RecordError,
            "column 'time'",
        ),
        (
            {"time": pa.array([-(2**62), 0, 2**62]), "p": TIMES},
            Clock("time", "s"),
            RecordError,
            "span too much",
        ),
        ({"time": TIMES, "p": [0.0, np.inf, 1.0]}, Clock("time", "s"), RecordError, "p"),
    ],
)
def test_a_table_that_is_no_log_is_refused_by_its_column(tmp_path, columns, time, error, message):
    """The file, the column and what it holds."""
    path = parquet(tmp_path / "a.parquet", **columns)
    with pytest.raises(error) as raised:
        read_log(path, channels=Map(P, time))
    assert message in str(raised.value)
    assert "a.parquet" in str(raised.value)


def test_a_table_of_too_many_columns_is_refused(tmp_path, monkeypatch):
    """A limit on columns, as on bytes."""
    monkeypatch.setattr(source, "MAX_COLUMNS", 3)
    path = parquet(tmp_path / "a.parquet", time=TIMES, p=TIMES, q=TIMES, r=TIMES)
    with pytest.raises(StorageError, match="4 columns, at most 3 are read"):
        read_log(path, channels=Map(P, Clock("time", "s")))


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
def test_timestamps_of_a_table_are_seconds_since_the_first(tmp_path, unit):
    """Whatever they count, named as dates or not, or found as the only dates there are."""
    per_second = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}[unit]
    stamps = pa.array([k * per_second for k in (5, 6, 7)], pa.timestamp(unit))
    path = parquet(tmp_path / "a.parquet", when=stamps, p=TIMES)
    for time in (None, Clock("when"), Clock("when", "iso8601")):
        log = read_log(path, channels=Map(P, time))
        assert log.record.time == pytest.approx([0.0, 1.0, 2.0], abs=1e-12)


def test_a_tables_rate_replaces_its_clock(tmp_path):
    """Rows at 20 Hz are 50 ms apart."""
    path = parquet(tmp_path / "a.parquet", p=TIMES)
    log = read_log(path, channels=Map(P, Clock(rate=20.0)))
    assert log.record.time == pytest.approx([0.0, 0.05, 0.1], abs=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('t [s],"p\n0,1\n', "header"),
        ("t [s],p\n", "no numbers below the header"),
        ("t [s],p\n0,1\n1,one\n2,3\n", "one"),
        ("t [s],p\n0,1\n1,1_0\n2,3\n", "1_0"),
        ("t [iso8601],p\n2024-05-01T12:00:00,1\nyesterday,2\n2024-05-01T12:00:02,3\n", "yesterday"),
        (
            "t [iso8601],p\n2024-05-01T12:00:00,1\n2024-05-01T12:00:01+02:00,2\n",
            "another time zone",
        ),
        ('t [s],p\n0,1\n1,"2\n', "line"),
    ],
)
def test_a_text_that_is_no_log_is_refused_by_its_line(tmp_path, text, message):
    """The file, and the cell or line that can't be read."""
    path = tmp_path / "a.csv"
    path.write_text(text)
    with pytest.raises(HelisimError) as raised:
        read_log(path, channels=Map({"p": Column("p", "rad/s")}))
    assert message in str(raised.value)
    assert "a.csv" in str(raised.value)
