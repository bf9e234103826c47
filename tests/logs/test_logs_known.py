"""Small logs whose answers are known by hand: clocks, gaps, units, formats, and what is said."""

import math

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import autopilot_logs
import helisim as hs
from autopilot_logs import table
from helisim.base.errors import LogError
from helisim.base.units import UNITS
from helisim.logs import Clock, Column, read_log, resample  # noqa: F401  (rows name it)
from helisim.logs.mapping import named_column
from helisim.logs.read import open_source
from helisim.logs.screening import Channels
from helisim.logs.timing import steadiness
from tabled import tabled

P = {"p": Column("p", "rad/s")}


@tabled("steps", "max_gap", "kind", "numbers", "rate")
def test_a_clock_is_judged_by_its_steps(steps, max_gap, kind, numbers, rate):
    found = steadiness(np.cumsum([5.0, *(1e-3 * one for one in steps)]), max_gap)
    assert (found.kind, found.gaps, found.rate) == (kind, numbers[3], rate)
    # five digits are written here
    assert np.multiply(1e3, found[1:4]) == pytest.approx(numbers[:3], rel=1e-5, abs=1e-9)


def test_gaps_and_parts_are_told_with_their_numbers(tmp_path):
    t = np.r_[0:10, 30:40, 60].astype(float)
    path = table(tmp_path / "a.csv", t, np.arange(21.0), header="t [s],p [rad/s]")
    with pytest.raises(LogError) as caught:
        read_log(path)
    gap = "a gap of 21 s from 9 s after the start (2 gaps, 42 s, 70 % of the log); "
    split = "split the log at its gaps with the repair 'gaps'"
    assert str(caught.value) == f"{path}, line 12, column 't [s]': {gap}{split}"
    assert [(one.count, one.rows) for one in caught.value.findings] == [(2, (12, 22))]
    log = read_log(path, repair="gaps")
    assert log.report.step == (1.0, 1.0, 21.0)
    assert [vars(one) for one in log.report.parts] == [
        {"first_row": a, "last_row": b, "samples": 10, "start": s, "duration": 9.0, "uneven": None}
        for a, b, s in ((2, 11, 0.0), (12, 21, 30.0))
    ]
    assert str(log.report).splitlines() == [
        f"{path}: CSV, 21 samples, 18 s, step 1 s (from 1 to 21 s)",
        "  p = 'p [rad/s]' [rad/s] in rad/s",
        "  2 records, the first of them:",
        "    lines 2 to 11, 9 s",
        "    lines 12 to 21, 9 s",
        f"  repaired: line 12: {gap}split there",
        "  repaired: left out as too short: lines 22 to 22",
    ]
    (part,) = read_log(path, repair="gaps", start=10.0).report.parts
    assert (part.start, part.first_row) == (30.0, 12)
    filled = read_log(path, max_gap=math.inf, resample_hz=0.5)
    text = "  resampled to 0.5 Hz, low-pass filtered, unchanged up to 0.2 Hz"
    gaps = "  repaired: 2 gaps, 70 % of the log, count as missing"
    assert str(filled.report).splitlines()[2:] == [text, gaps]
    assert filled.report.findings[0].rows == (12, 22)
    assert filled.record.time.tolist() == list(range(0, 61, 2))


def test_findings_count_all_rows_and_averages_pass_over_holes(tmp_path):
    t = np.repeat(np.arange(40.0), 2)
    (one,) = read_log(
        table(tmp_path / "a.csv", t, t), channels=P, repair="duplicates"
    ).report.findings
    assert (one.count, one.rows) == (40, tuple(range(3, 43, 2)))
    assert one.to_dict()["rows"] == list(one.rows)
    path = table(tmp_path / "a.csv", [0, 1, 1, 2, 3, 3, 4], [0, 1, math.nan, 4, 5, 7, 8])
    log = read_log(path, channels=P, repair=("duplicates",))
    assert log.record["p"].tolist() == [0, 1, 4, 6, 8]
    words = ("", "nan", "-nan", "NA", "n/a", "#N/A", "null", "None", "nan(ind)", "-NaN(ind)")
    rows = "".join(f"{k},{k}\n{k}.5,{word}\n" for k, word in enumerate(words))
    path.write_text(f"t [s],p [rad/s]\n{rows}")
    with pytest.raises(LogError, match=r"no number \(10 of 20 numbers are missing\)"):
        read_log(path)


@pytest.mark.parametrize("factor", [2, 4, 8, 30])
def test_the_filter_passes_and_stops_what_it_says(factor):
    """80 dB down from the new half rate on, unchanged to 0.8 of it: Kaiser's design formulas."""
    taps = resample._low_pass(factor)
    assert np.array_equal(taps, taps[::-1])
    frequency = np.linspace(0.0, math.pi, 2000)
    middle = np.arange(taps.size) - taps.size // 2
    gain = np.cos(np.outer(frequency, middle)) @ taps
    half = math.pi / factor
    # 80 dB, and 2 dB by which his formulas may miss
    assert np.abs(gain[frequency >= half]).max() < 10.0 ** (-78.0 / 20.0)
    assert np.abs(gain[frequency <= resample.PASSBAND * half] - 1.0).max() < 10.0 ** (-78.0 / 20.0)


TEXT = st.text("abcXYZ_ 019[].", min_size=1, max_size=9).filter(str.strip)
NUMBER = st.floats(-1e4, 1e4).map(lambda x: float(f"{x:g}"))


@given(
    column=TEXT,
    unit=st.sampled_from([None, "deg/s", "us", "percent"]),
    sign=st.sampled_from([1, -1]),
    trim=st.none() | NUMBER,
    range_=st.none() | NUMBER.filter(lambda x: x > 0.0),
)
def test_a_column_is_read_again_from_its_option(column, unit, sign, trim, range_):
    one = Column(column, unit, sign, trim, range_)
    assert named_column(one.option("p").value) == ("p", one)


@pytest.mark.parametrize(
    ("name", "si"), [("p", "rad/s"), ("phi", "rad"), ("down", "m"), ("az", "m/s^2")]
)
def test_a_unit_is_told_by_its_factor(name, si):
    same = {k: one.factor for k, one in UNITS.items() if one.si == si}
    channels = Channels(0.01, {}, {name: Column("x", si)})
    for unit, factor in same.items():
        if unit != si:
            assert [channels.unit_of(name, f * factor) for f in (0.91, 1.0, 1.1)] == [unit] * 3
            assert [channels.unit_of(name, f * factor) for f in (0.9, 1.11)] == [None] * 2
    assert [channels.unit_of(name, one) for one in (0.0, math.inf)] == [None] * 2


@tabled("heading", "time", "seconds")
def test_a_clock_has_the_unit_that_its_heading_or_map_says(tmp_path, heading, time, seconds):
    stamps = (np.arange(5.0) + 3.0) * 0.02 / seconds
    path = table(tmp_path / "a.csv", stamps, np.arange(5.0), header=f"{heading},p")
    log = read_log(path, channels=P, time=time)
    assert log.record.time == pytest.approx(0.02 * np.arange(5.0), abs=1e-9)
    unit = {1e-3: "ms", 1e-6: "us", 60.0: "min", 1e-9: "ns", 1.0: "s"}[seconds]
    assert log.report.origin == f"{float(stamps[0])!r} {unit}"


def test_a_quaternion_is_euler_angles_as_others_turn(tmp_path):
    pytest.importorskip("pyulog", reason="pyulog isn't installed: pip install -e '.[logs]'")
    turns = Rotation.random(200, random_state=1)
    stamps, q = 1000 * np.arange(200), turns.as_quat(scalar_first=True)
    still = {"q": q, "roll": np.full(200, 0.5)}
    fields = {"": {"q": q[::-1]}, "[0]": {"q": q[::-1]}, "[1]": {"q": q}, "_own": still}
    fields["_bare"] = {"x": stamps}
    topics = {f"vehicle_attitude{end}": (stamps, one) for end, one in fields.items()}
    path = tmp_path / "a.ulg"
    path.write_bytes(autopilot_logs.ulog(topics, dropouts=(30, 12)))
    source = open_source(path)
    names = ("yaw", "pitch", "roll")
    for topic, true in (("vehicle_attitude", turns[::-1]), ("vehicle_attitude[1]", turns)):
        angles = [source.numbers(f"{topic}.{name}") for name in names]
        found = Rotation.from_euler("ZYX", np.transpose(angles))
        # sqrt(2 x 6e-8) of single precision where the pitch is near 90 degrees
        assert (found.inv() * true).magnitude().max() < 1e-3
    assert {source.stated_unit(f"vehicle_attitude.{name}") for name in names} == {"rad"}
    assert set(source.numbers("vehicle_attitude_own.roll")) == {0.5}
    assert not {"vehicle_attitude_own.yaw", "vehicle_attitude_bare.roll"} & set(source.names)
    (lost,) = source.findings
    assert (lost.text, lost.count) == ("2 dropouts of the logger, 42 ms in all", 2)


def test_clocks_of_which_one_was_reset_can_not_be_matched(tmp_path):
    t = 2500 * np.arange(200)
    back = np.where(np.arange(200) < 100, t, t - 200_000)
    log = autopilot_logs.Log(with_units=False)
    log.define(1, "A", "Qf", "TimeUS,X")
    log.define(2, "B", "Qf", "TimeUS,Y")
    for one, other in zip(t.tolist(), back.tolist()):
        log.write(1, one, 0.1)
        log.write(2, other, 0.1)
    channels = {"p": Column("A.X", "rad/s"), "q": Column("B.Y", "rad/s")}
    with pytest.raises(
        LogError, match=r"B row 100.*2 clocks of the channels can't be matched after it"
    ):
        read_log(log.save(tmp_path), channels=channels, repair="resets")


@pytest.mark.parametrize(
    ("name", "length"), [(b"", 15), (b"BAD", 2), (b"BAD", 0), (b"B\xe9D", 15), (b"B\nD", 15)]
)
def test_a_definition_that_is_none_defines_nothing(tmp_path, name, length):
    log = autopilot_logs.Log(with_units=False)
    log.define(1, "GYR", "Qf", "TimeUS,X")
    log.write(128, 9, length, name, b"Qf", b"TimeUS,X")
    for k in range(5):
        log.write(1, k, k)
    read = hs.DataFlash(log.save(tmp_path))
    assert set(read.types) == {"FMT", "GYR"}
    assert (read.skipped, len(read.table("GYR"))) == (0, 5)


def test_any_kind_of_number_in_a_table_is_read(tmp_path):
    kinds = [pa.int8(), pa.uint16(), pa.int64(), pa.float16(), pa.float32(), pa.bool_()]
    whole = pa.array([0, 1, 1])
    columns = {f"{kind} [1]": whole.cast(kind) for kind in [*kinds, pa.decimal128(21, 2)]}
    pq.write_table(pa.table({"t [s]": [5.0, 6.0, 7.0], **columns}), tmp_path / "a.parquet")
    log = read_log(tmp_path / "a.parquet")
    assert (log.report.origin, len(log.record.names)) == ("5.0 s", 7)
    assert np.array_equal(log.record.values.T, [[0.0, 1.0, 1.0]] * 7)
