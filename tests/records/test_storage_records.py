import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helisim.base.errors import RecordError, StorageError
from helisim.records.record import Channel, FlightRecord, channel
from helisim.records.storage import read_record, write_record
from tabled import tabled

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


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_record_comes_back_exactly_and_equal_ones_are_equal_bytes(tmp_path, suffix):
    """A file depends on the record alone: not on the clock, nor on the order of keys."""
    record = make_record()
    assert read_record(write_record(record, tmp_path / f"flight{suffix}")) == record
    origins = ({"a": 1, "b": [2, {"c": 3, "d": 4}]}, {"b": [2, {"d": 4, "c": 3}], "a": 1})
    first, second = (
        write_record(make_record(provenance=one), tmp_path / f"{k}{suffix}").read_bytes()
        for k, one in enumerate(origins)
    )
    assert first == second


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


def test_parquet_is_plain_to_other_readers(tmp_path):
    record = make_record()
    table = pq.read_table(write_record(record, tmp_path / "flight.parquet"))
    assert table.column_names == ["time", *record.names]
    np.testing.assert_array_equal(table["p"].to_numpy(), record["p"])
    assert table.schema.field("p").metadata[b"unit"] == b"rad/s"
    assert table.schema.field("p").metadata[b"kind"] == b"OUT"
    header = json.loads(table.schema.metadata[b"helisim"])
    assert header["version"] == 1
    assert header["provenance"] == dict(record.provenance)


@pytest.mark.parametrize("name", ["flight.hdf5", "flight", "flight.csv.gz"])
def test_an_unknown_suffix_lists_those_that_exist(tmp_path, name):
    for attempt in (lambda path: write_record(SMALL, path), read_record):
        with pytest.raises(StorageError, match=r"unknown suffix .*available: \.parquet, \.csv"):
            attempt(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("keep", [0, 3, 200, 0.5, 0.99, "flip"])
def test_damaged_parquet_is_refused(tmp_path, keep):
    path = write_record(make_record(), tmp_path / "flight.parquet")
    data = bytearray(path.read_bytes())
    if keep == "flip":
        data[300] ^= 0x10  # inside the first page, the time column
    else:
        del data[keep if isinstance(keep, int) else int(keep * len(data)) :]
    path.write_bytes(data)
    with pytest.raises(StorageError, match=r"flight\.parquet: not Parquet, truncated or corrupt"):
        read_record(path)


@tabled("change", "error", "message")
def test_foreign_parquet_is_refused(tmp_path, change, error, message):
    path = tmp_path / "foreign.parquet"
    pq.write_table(change(pq.read_table(write_record(make_record(), path))), path)
    with pytest.raises(error, match=message):
        read_record(path)


def headed(table, **changes):
    header = json.loads(table.schema.metadata[b"helisim"])
    return table.replace_schema_metadata({"helisim": json.dumps({**header, **changes})})


def with_p(table, row, value):
    """Return a table with another column p: 1 up to a row, the value from there on."""
    kind = pa.string() if isinstance(value, str) else pa.float64()
    field = pa.field("p", kind, metadata=table.schema.field("p").metadata)
    return table.set_column(3, field, pa.array([1.0] * row + [value] * (50 - row), kind))


@pytest.mark.parametrize(
    ("old", "new", "error", "message"),
    [
        ("# helisim", "# other", StorageError, "line 1 must be"),
        ("version 1", "version 9", StorageError, "version 9 of the format"),
        ("# rows: 3\n", "", StorageError, "needs a line '# rows:'"),
        ("# rows: 3", "# rows: 4", StorageError, "truncated: 3 rows, .* says 4"),
        ("{}", "{", StorageError, "'# provenance:' is not JSON"),
        ('"OUT"', '"IN7"', StorageError, "unknown kind 'IN7'; available: IN1, IN2"),
        ('"unit": "rad/s", ', "", StorageError, "a channel lacks its unit"),
        ("p [rad/s]", "p [deg/s]", StorageError, "line 6: .* they must be time .s., p .rad/s., q"),
        ("0.5,2.0,5.0", "0.5,2.0", StorageError, "line 8: expected 3 numbers, got"),
        ("0.5,2.0,5.0", "0.5,2.0,nan", RecordError, "channel 'q' is not finite at row 1"),
        ("0.5,2.0,5.0", "0.0,2.0,5.0", RecordError, "row 1 has 0 s after 0 s"),
        ("1.0,3.0,6.0\n", "1.0,3.0,6", StorageError, "truncated"),
    ],
)
def test_a_damaged_csv_is_refused(tmp_path, old, new, error, message):
    path = write_record(SMALL, tmp_path / "flight.csv")
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(error, match=message) as caught:
        read_record(path)
    assert str(caught.value).startswith(str(path))
