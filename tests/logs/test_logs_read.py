"""Reading CSV and Parquet by other programs: units, clocks, repairs, resampling."""

import math

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from autopilot_logs import table
from helisim.base.errors import InputError, RecordError, StorageError
from helisim.logs import UNITS, Clock, Column, Layout, Map, read_log
from helisim.records.record import FlightRecord, channel
from helisim.records.storage import write_record

P = {"p": Column("p", "rad/s")}


FOOT, KNOT, DEGREE = 0.3048, 1852.0 / 3600.0, math.pi / 180.0
FACTORS = {"deg": DEGREE, "deg/s": DEGREE, "°/s": DEGREE, "rpm": math.pi / 30.0, "ft": FOOT}
FACTORS |= {"ft/s": FOOT, "kt": KNOT, "knots": KNOT, "km/h": 1.0 / 3.6, "ft/min": FOOT / 60.0}
FACTORS |= {"g": 9.80665, "percent": 0.01, "%": 0.01}


@pytest.mark.parametrize(("unit", "si"), FACTORS.items())
def test_units_become_si(tmp_path, unit, si):
    path = table(tmp_path / "a.csv", [0, 1], [1, 2], header="t [s],x")
    log = read_log(path, channels={"x": Column("x", unit)})
    assert log.record["x"] == pytest.approx([si, 2.0 * si], rel=1e-15)
    assert log.record.unit("x") in {one.si for one in UNITS.values()}


def test_pulses_are_unitised_by_trim_and_range(tmp_path):
    """1120 and 1920 us with trim 1520 and range 800 are the ends, -0.5 and 0.5."""
    path = table(tmp_path / "a.csv", [0, 1, 2], [1120, 1520, 1920], header="t [s],c1")
    log = read_log(path, channels={"lat": Column("c1", "us", trim=1520, range=800)})
    assert log.record["lat"].tolist() == [-0.5, 0.0, 0.5]
    assert log.report.columns["lat"] == "('c1' - 1520) / 800 [us] in 1"
    with pytest.raises(InputError, match="trim"):
        read_log(path, channels={"lat": Column("c1", "us")})


STAMPS = {
    "s": ["1700000000.000001", "1700000000.010001", "1700000000.020001"],
    "us": ["1700000000000001", "1700000000010001", "1700000000020001"],
    "ns": ["1700000000000000001", "1700000000010000001", "1700000000020000001"],
}


@pytest.mark.parametrize(("unit", "stamps"), STAMPS.items())
def test_clocks_since_1970_lose_nothing(tmp_path, unit, stamps):
    path = tmp_path / "a.csv"
    path.write_text("t,p\n" + "".join(f"{stamp},1.{k}\n" for k, stamp in enumerate(stamps)))
    record = read_log(path, channels=P, time=Clock("t", unit)).record
    assert record.sample_time == pytest.approx(0.01, rel=1e-12)
    assert record.time[0] == 0.0


@pytest.mark.parametrize(
    ("encoding", "delimiter"),
    [("utf-8", ","), ("utf-8-sig", ";"), ("utf-16", "\t"), ("latin-1", "|")],
)
def test_encoding_and_delimiter_are_found_out(tmp_path, encoding, delimiter):
    path = tmp_path / "a.csv"
    lines = ["Zeit [s],größe [°/s],x", "0,90,1", "1,180,2"]
    path.write_bytes("\r\n".join(lines).replace(",", delimiter).encode(encoding))
    log = read_log(path, channels={"p": Column("größe")}, time="Zeit")
    assert log.record["p"] == pytest.approx([math.pi / 2.0, math.pi])
    assert log.report.unused == ("x",)
    assert [one.kind for one in log.report.findings] == ["encoding"] * (encoding == "latin-1")
    assert log.report.repairs == ()


def test_layouts_and_columns_that_state_their_unit(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t;p\ns;deg/s\n0,0;1,5\n0,5;2,5\n")
    layout = Layout(decimal=",", skip=1)
    decimal = read_log(path, channels=Map(P, Clock("t", "s"), layout)).record
    assert decimal["p"].tolist() == [1.5, 2.5]
    found = read_log(path, channels=Map(P)).record  # a row of units, and decimal commas
    assert (found["p"] == decimal["p"]).all()
    path.write_text("# made by x\n\nt,p\n0,1\n \n1,2\n")
    assert len(read_log(path, channels=P, time=Clock("t", "s")).record) == 2
    path.write_text("0,1\n1,2\n")
    with pytest.raises(StorageError, match="line 1: numbers, expected the columns' names"):
        read_log(path, channels=P, time=Clock("t", "s"))
    path.write_text("p\n1\n2\n3\n")
    assert read_log(path, channels=P, time=Clock(rate=50.0)).record.sample_time == 0.02
    path = table(tmp_path / "a.csv", [0, 1], [1, 2], [3, 4], header="time (ms),q [deg/s],note")
    log = read_log(path)
    assert log.record.names == ("q",)
    assert log.report.unused == ("note",)
    assert "unused" not in str(log.report)


def test_repairs_do_what_they_say(tmp_path):
    t = np.arange(10.0)
    tail = tmp_path / "tail.csv"
    tail.write_text("t [s],p,q\n0,1,2\n1,2,3\n2,3")
    log = read_log(tail, channels=P)
    assert (len(log.record), log.report.repairs[0].kind) == (2, "incomplete last line")
    same = table(tmp_path / "same.csv", [0, 1, 1, 2], [0, 1, 3, 4])
    assert read_log(same, channels=P, repair=("duplicates",)).record["p"].tolist() == [0, 2, 4]
    holes = table(tmp_path / "holes.csv", t, np.where(t == 4, np.nan, 2.0 * t))
    filled = read_log(holes, channels=P, repair=("missing",))
    assert filled.record["p"] == pytest.approx(2.0 * t)
    (hole,) = filled.report.repairs
    assert hole.rows == (6,)
    assert hole.text.startswith("column 'p', line 6: no number (1 of 10 numbers are missing)")
    resets = table(tmp_path / "resets.csv", [0, 1, 2, 0, 1, 2, 3], range(7))
    assert [len(x) for x in read_log(resets, channels=P, repair=("resets",)).records] == [3, 4]
    with pytest.raises(RecordError, match="2 parts"):
        _ = read_log(resets, channels=P, repair=("resets",)).record


def test_angles_are_made_continuous_and_resampling_is_filtered_and_even(tmp_path):
    """The passband is kept, what is above is gone; at its own rate all is kept."""
    t = np.arange(50.0)
    heading = (10.0 * t + 180.0) % 360.0 - 180.0
    path = table(tmp_path / "a.csv", t, heading, header="t [s],psi [deg]")
    log = read_log(path, channels=["psi"], resample_hz=2.0)
    assert log.record["psi"] == pytest.approx(np.radians(10.0) * log.record.time)
    (wraps,) = log.report.repairs
    assert (wraps.kind, wraps.count, wraps.rows) == ("angle wraps", 1, (20,))
    t = np.arange(0.0, 20.0, 0.002)
    slow, fast = np.sin(2.0 * np.pi * 6.0 * t), np.sin(2.0 * np.pi * 33.0 * t)
    path = table(tmp_path / "a.csv", t, slow, fast, header="t [s],slow [1],fast [1]")
    log = read_log(path, resample_hz=20.0)
    record, inside = log.record, slice(30, -30)
    assert log.report.passband_hz == 8.0
    assert record.sample_time == pytest.approx(0.05)
    expected = np.sin(2.0 * np.pi * 6.0 * record.time)
    assert record["slow"][inside] == pytest.approx(expected[inside], abs=1e-3)
    assert np.max(np.abs(record["fast"][inside])) < 1e-3  # 80 dB down, and a margin
    t = np.arange(300) / 100.0
    values = np.random.default_rng(0).standard_normal(300)
    path = table(tmp_path / "a.csv", t, values)
    log = read_log(path, channels=P, resample_hz=100.0)
    assert log.record["p"] == pytest.approx(values, abs=1e-12)
    assert log.report.passband_hz is None


def test_parquet_by_others(tmp_path):
    path = tmp_path / "a.parquet"
    stamps = pa.array([1_700_000_000_000_000 + 10_000 * k for k in range(4)], pa.timestamp("us"))
    fields = [
        pa.field("when", stamps.type),
        pa.field("gyro", pa.int16(), metadata={"unit": "deg/s"}),
        pa.field("name", pa.string()),
    ]
    columns = [stamps, pa.array([180, 90, None, 0], pa.int16()), pa.array(list("abcd"))]
    pq.write_table(pa.Table.from_arrays(columns, schema=pa.schema(fields)), path)
    with pytest.raises(RecordError, match="row 2, column 'gyro'"):
        read_log(path, channels={"p": Column("gyro")})
    record = read_log(path, channels={"p": Column("gyro")}, repair=("missing",)).record
    assert record["p"] == pytest.approx([math.pi, math.pi / 2.0, math.pi / 4.0, 0.0], abs=0.2)
    assert record.sample_time == pytest.approx(0.01)
    with pytest.raises(StorageError, match="column 'name'"):
        read_log(path, channels={"p": Column("name", "deg/s")})


@pytest.mark.parametrize("suffix", [".parquet", ".csv"])
def test_helisim_records_need_no_map(tmp_path, suffix):
    time = np.arange(5) * 0.1 + 3.0
    record = FlightRecord(time, np.ones((5, 1)), (channel("p"),), {"seed": 1})
    path = write_record(record, tmp_path / f"a{suffix}")
    log = read_log(path)
    assert np.array_equal(log.record.time, time)
    assert (log.record.provenance["seed"], log.report.origin) == (1, "3 s")
    assert read_log(path, start=0.1, stop=0.3).record.time.tolist() == time[1:4].tolist()
    mapped = read_log(path, channels={"q": Column("p", "rad/s", sign=-1)}, time=Clock("time", "s"))
    assert mapped.record["q"].tolist() == [-1.0] * 5


def test_a_map_is_read_from_toml(tmp_path):
    path = tmp_path / "map.toml"
    path.write_text(
        '[time]\ncolumn = "t"\nunit = "us"\n\n[channels.p]\ncolumn = "gyro_x"\n'
        'unit = "deg/s"\nsign = -1\n\n[channels.q]\nunit = "rad/s"\n\n[file]\ndelimiter = ";"\n'
    )
    map_ = Map.from_toml(path)
    assert map_.channels["p"] == Column("gyro_x", "deg/s", sign=-1)
    assert map_.channels["q"] == Column("q", "rad/s")
    assert map_.time == Clock("t", "us")
    assert map_.file.delimiter == ";"
