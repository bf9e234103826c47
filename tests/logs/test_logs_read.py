"""Reading CSV and Parquet by other programs: units, clocks, repairs, resampling."""

import math
from functools import cache

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

import helisim as hs
from autopilot_logs import table
from command import said
from helisim.base.errors import InputError, RecordError, StorageError
from helisim.base.units import RAD_PER_DEG, STANDARD_GRAVITY
from helisim.logs import UNITS, Clock, Column, Layout, Map, read_log
from helisim.logs.examples import examples
from helisim.logs.screening import Channels, implausible
from helisim.records.record import FlightRecord, channel
from helisim.records.storage import write_record
from tabled import tabled

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


@tabled("encoding", "delimiter")
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
    assert (log.record.names, log.report.unused) == (("q",), ("note",))
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
    t = np.arange(60.0)
    heading = (10.0 * t + 180.0) % 360.0 - 180.0
    path = table(tmp_path / "a.csv", t, heading, header="t [s],psi [deg]")
    log = read_log(path, channels=["psi"], resample_hz=2.0)
    assert log.record["psi"] == pytest.approx(np.radians(10.0) * log.record.time)
    (wraps,) = log.report.repairs
    assert (wraps.kind, wraps.count, wraps.rows) == ("angle wraps", 2, (20, 56))
    assert wraps.text == "column 'psi [deg]': unwrapped"
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
    assert (map_.time, map_.file.delimiter) == (Clock("t", "us"), ";")


# What a flight's channels can't be: units, signs and axes, told from the data alone.

SI = {
    **dict.fromkeys("pqr", "rad/s"),
    **dict.fromkeys(("phi", "theta", "psi"), "rad"),
    **dict.fromkeys("uvw", "m/s"),
    **dict.fromkeys(("north", "east", "down"), "m"),
    **dict.fromkeys(("ax", "ay", "az"), "m/s^2"),
}
ANGLES, FORCES = ("phi", "theta", "psi"), ("ax", "ay", "az")


@cache
def flight(seed=0, size=1.0):
    return turned_flight(60.0, seed, size=size, noise=0.02)[1]


def found(columns, step=0.01, **declared):
    """Return the findings of columns that are declared in SI, but for those in `declared`."""
    said = {name: Column(f"{name}_raw", SI.get(name, "1")) for name in columns}
    return implausible(Channels(step, columns, said | declared))


def options(columns, **declared):
    return {said(finding) for finding in found(columns, **declared)}


@pytest.mark.parametrize("seed", range(2))
def test_nothing_is_said_of_a_sound_flight(seed):
    assert found(flight(seed)) == []


def test_rates_and_angles_in_another_unit_are_told():
    fast = flight() | {name: flight()[name] / RAD_PER_DEG for name in "pqr"}
    expected = {f"--channel {name}={name}_raw:deg/s" for name in "pqr"}
    assert options(fast) == expected
    alone = {"p": flight(size=0.2)["p"] / RAD_PER_DEG}
    (swing,) = found(alone)
    assert said(swing) == "--channel p=p_raw:deg/s"
    assert "more than it can" in swing.text
    slow = flight(size=0.05) | {name: flight(size=0.05)[name] / RAD_PER_DEG for name in "pqr"}
    assert options(slow) == expected
    (one, *_) = found(slow)
    assert "times d(phi)/dt" in one.text
    assert float(one.text.split()[2]) == pytest.approx(57.3, rel=0.03)
    columns = flight() | {name: flight()[name] / RAD_PER_DEG for name in ANGLES}
    assert options(columns) == {f"--channel {name}={name}_raw:deg" for name in ("phi", "theta")}
    turning = {"p": 3.0 * np.gradient(flight()["phi"], 0.01), "phi": 3.0 * flight()["phi"]}
    assert options(turning) == set()  # in rad, beyond half a turn
    both = {name: one / 3.0 / RAD_PER_DEG for name, one in turning.items()}
    assert options(both) == {"--channel p=p_raw:deg/s", "--channel phi=phi_raw:deg"}
    degrees = {name: Column(f"{name}_raw", "deg") for name in ANGLES}
    gentle = flight(size=0.2)
    columns = gentle | {name: RAD_PER_DEG * gentle[name] for name in ANGLES}
    assert options(columns, **degrees) == {f"--channel {name}={name}_raw:rad" for name in ANGLES}


def test_swapped_axes_are_told_with_their_signs():
    own = flight()
    (two,) = options(own | {"p": own["q"], "q": -own["p"]})
    assert two == "--channel q=p_raw:rad/s --channel p=q_raw:rad/s:sign=-1"
    (ring,) = options(own | {"p": own["q"], "q": own["r"], "r": own["p"]})
    assert ring == "--channel q=p_raw:rad/s --channel r=q_raw:rad/s --channel p=r_raw:rad/s"


@pytest.mark.parametrize("name", ["p", "q", "r"])
def test_a_wrong_sign_is_told(name):
    (finding,) = found(flight() | {name: -flight()[name]})
    assert finding.kind == "sign"
    assert f"{name}={name}_raw:{SI[name]}:sign=-1" in said(finding)


def test_gravity_alone_tells_an_accelerometer():
    random = np.random.default_rng(0)
    rest = {name: 0.02 * random.standard_normal(6000) for name in FORCES}
    down = rest | {"az": rest["az"] - STANDARD_GRAVITY}
    assert found(down) == []
    assert options(down | {"az": -down["az"]}) == {"--channel 'az=az_raw:m/s^2:sign=-1'"}
    in_g = {name: down[name] / STANDARD_GRAVITY for name in FORCES}
    assert options(in_g) == {"--channel az=az_raw:g"}
    assert options({"az": -down["az"] / STANDARD_GRAVITY}) == {"--channel az=az_raw:g:sign=-1"}


def test_controls_that_are_pulses_or_percent_are_told():
    t = 2.0 * np.pi * np.arange(6000) / 1000.0
    pulses = found({"lat": 1500.0 + 400.0 * np.sin(t)})
    assert said(pulses[0]) == "--channel lat=lat_raw:us:trim=1500:range=800"
    assert options({"LON": 40.0 * np.sin(t)}) == {"--channel LON=LON_raw:percent"}
    assert found({"lat": 0.5 * np.sin(t)}) == []


def test_example_flights_are_plausible():
    for example in examples().values():
        map_ = None if example.map is None else Map.from_toml(example.map)
        log = read_log(example.path, channels=map_)
        kinds = {one.kind for one in log.report.findings}
        assert not kinds & {"unit", "sign", "axes", "scale", "unit of time"}
        assert hs.open_example(example.name) == log.record


def test_a_log_that_is_read_is_told_so(tmp_path):
    t = np.arange(6000) / 100.0
    columns = np.column_stack([t, flight()["p"] / RAD_PER_DEG, flight()["phi"]])
    path = tmp_path / "a.csv"
    np.savetxt(path, columns, delimiter=",", header="t [s],p [rad/s],phi [rad]", comments="")
    report = read_log(path).report
    assert [finding.kind for finding in report.findings] == ["unit"]
    assert any(said(one) == "--channel 'p=p [rad/s]:deg/s'" for one in report.findings)


RATE = 100.0
GRAVITY = 9.80665
_FINE = 1000.0
_POLE, _SLOW = np.exp(-2.0 * np.pi * np.array([1.2, 0.15]) / _FINE)


def turned_flight(duration=60.0, seed=0, *, size=1.0, noise=0.0):
    """Return time, and SI channels by name: p to r, phi to psi, u to w, north to down, ax to az.

    Rates and velocities are noise from 0.15 to 1.2 Hz; the rest follows from them.
    """
    random = np.random.default_rng(seed)
    fine, every = _FINE, round(_FINE / RATE)
    count = int(duration * fine)
    white = random.standard_normal((count, 6))
    columns = white - np.mean(white, axis=0)
    for _ in range(3):  # to about 1 Hz
        columns = lfilter([1.0 - _POLE], [1.0, -_POLE], columns, axis=0)
    drift = lfilter([1.0 - _SLOW], [1.0, -_SLOW], columns, axis=0)
    columns = (columns - drift) / np.std(columns - drift, axis=0)
    rates, velocity = 0.5 * size * columns[:, :3], 2.0 * size * columns[:, 3:]
    attitude = np.empty((count, 4))
    quaternions = Rotation.from_rotvec(rates / fine).as_quat()  # exact for a constant rate
    q = Rotation.identity().as_quat()
    for k in range(count):
        attitude[k] = q
        x, y, z, w = q
        a, b, c, d = quaternions[k]
        i, j = w * a + x * d + y * c - z * b, w * b - x * c + y * d + z * a
        q = np.array([i, j, w * c + x * b - y * a + z * d, w * d - x * a - y * b - z * c])
    turned = Rotation.from_quat(attitude)
    psi, theta, phi = turned.as_euler("ZYX").T
    world = turned.apply(velocity)
    position = np.cumsum(world, axis=0) / fine
    force = turned.inv().apply(np.gradient(world, 1.0 / fine, axis=0) - [0.0, 0.0, GRAVITY])
    table = {
        **dict(zip("pqr", rates.T)),
        "phi": phi,
        "theta": theta,
        "psi": np.unwrap(psi),
        **dict(zip("uvw", velocity.T)),
        **dict(zip(("north", "east", "down"), position.T)),
        **dict(zip(("ax", "ay", "az"), force.T)),
    }
    time = np.arange(count) / fine
    spoiled = {
        name: values[::every] + noise * np.std(values) * random.standard_normal(count // every)
        for name, values in table.items()
    }
    return time[::every], spoiled
