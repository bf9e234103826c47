"""Several logs with several faults: all are said at once, each with what mends it."""

import pickle
import re

import numpy as np
import pytest

from autopilot_logs import table
from command import said
from helisim.base.errors import HelisimError, InputError, LogError, RecordError, StorageError
from helisim.logs import Clock, Column, Map, read_log, read_logs, screen
from helisim.records.record import FlightRecord, channel
from helisim.records.storage import write_record
from tabled import tabled

P, SECONDS = {"p": Column("p", "rad/s")}, Clock("t", "s")
MAP = Map({"p": Column("p", "rad/s"), "q": Column("q"), "lat": Column("u", "1")}, SECONDS)


def faulty(folder):
    t = np.arange(200) / 50.0
    p = np.sin(t)
    p[[20, 21]] = np.nan
    one = table(folder / "one.csv", t, p, np.cos(t), np.sin(2.0 * t), header="t,p,q,u")
    time = np.where(np.arange(200) >= 100, t + 3.0, t)
    time[50] = time[49]
    two = table(folder / "two.csv", time, np.sin(t), np.cos(t), np.ones(200), header="t,p,q,u")
    return one, two


def test_everything_that_is_wrong_is_said_at_once(tmp_path):
    paths = faulty(tmp_path)
    with pytest.raises(LogError) as raised:
        read_logs(paths, channels=MAP, wanted=("p", "q", "lat"), resample_hz=50.0)
    findings = raised.value.findings
    found = {(finding.kind, said(finding)) for finding in findings}
    assert ("missing number", "--repair missing") in found
    assert ("gap", "--repair gaps") in found
    assert ("duplicate stamp", "--repair duplicates") in found
    units = [finding for finding in findings if "says its unit" in finding.text]
    assert [finding.text.split(":")[0] for finding in units] == list(map(str, paths))
    assert len(findings) == 5
    message = str(raised.value)
    assert message.startswith("5 things are wrong:")
    assert all(f"- {finding.text}" in message for finding in findings)
    channels = Map({**MAP.channels, "q": Column("q", "rad/s")}, MAP.time)
    repairs = ("missing", "gaps", "duplicates")
    logs = read_logs(paths, channels=channels, resample_hz=50.0, repair=repairs)
    assert [len(log.records) for log in logs] == [1, 2]  # the options, given together, mend all
    given = {"channels": channels, "repair": repairs, "resample_hz": 50.0}
    assert len(read_logs(paths, wanted=("lat",), **given)) == 2
    with pytest.raises(LogError, match=r"two\.csv: has no channel 'r'; available: p, q, lat"):
        read_logs(paths[1:], wanted=("r",), **given)


def test_the_error_is_of_every_kind_and_survives_a_process(tmp_path):
    one, _ = faulty(tmp_path)
    with pytest.raises(LogError) as raised:
        read_log(one, channels=MAP)
    for kind in (InputError, RecordError, StorageError, HelisimError, ValueError):
        assert isinstance(raised.value, kind)
    back = pickle.loads(pickle.dumps(raised.value))
    assert (str(back), back.findings) == (str(raised.value), raised.value.findings)


@pytest.mark.parametrize(("unit", "declared"), [(1e3, "s"), (1e6, "s"), (1e-3, "ms")])
def test_a_wrong_unit_of_time_is_refused_with_the_reason(tmp_path, unit, declared):
    t = unit * np.arange(200) / 50.0
    path = table(tmp_path / "a.csv", t, np.sin(t), header="t,p")
    with pytest.raises(LogError, match="its steps are") as raised:
        read_log(path, channels=P, time=Clock("t", declared))
    right = {1e3: "ms", 1e6: "us", 1e-3: "s"}[unit]
    assert said(raised.value.findings[0]) == f"--time t:{right}"


def jittery(folder, share, seed=0, rate=100.0):
    rng = np.random.default_rng(seed)
    t = (np.arange(3000) + share * rng.uniform(-0.5, 0.5, 3000)) / rate
    return table(folder / "jitter.csv", t, np.sin(5.0 * t), header="t,p")


def test_small_jitter_is_resampled_unasked_and_told(tmp_path):
    path = jittery(tmp_path, 0.2)
    log = read_log(path, channels=P, time=SECONDS)
    log.check_uniform()
    (finding,) = log.report.repairs
    assert finding.kind == "jitter"
    stated = re.search(r"off by (\S+) ms rms", finding.text)
    assert stated is not None
    # the difference of two stamps that are uniform over a fifth of 10 ms has 2 / sqrt(6) ms; the
    # estimate from 3000 such differences scatters by 1.5 %, here three times that
    assert float(stated[1]) == pytest.approx(2.0 / 6.0**0.5, rel=0.045)
    assert "resampled at 100 Hz" in finding.text
    record = log.record
    assert record.sample_time == pytest.approx(0.01, rel=1e-9)
    # Akima's interpolation, to (w h)^3 = 1.3e-4 of the amplitude
    first = float(path.read_text().splitlines()[1].split(",")[0])
    assert record["p"] == pytest.approx(np.sin(5.0 * (first + record.time)), abs=1.3e-4)


def test_large_jitter_is_refused_with_its_size_and_a_gap_is_none(tmp_path):
    path = jittery(tmp_path, 1.0)
    log = read_log(path, channels=P, time=SECONDS)
    assert not log.report.repairs
    with pytest.raises(LogError, match=r"irregular: .*by 4\.\d ms rms.*resample") as raised:
        log.check_uniform()
    assert said(raised.value.findings[0]) == "--resample 100"
    stamps = [float(line.split(",")[0]) for line in path.read_text().splitlines()[1:]]
    worst = np.argmax(np.abs(np.diff(stamps) - np.mean(np.diff(stamps))))
    assert f"jitter.csv, line {worst + 3}, column 't': " in str(raised.value)
    path = jittery(tmp_path, 0.2)
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:1000], *lines[1200:]]) + "\n")
    with pytest.raises(LogError, match="split the log at its gaps"):
        read_logs([path], channels=P, time=SECONDS)
    (log,) = read_logs([path], channels=P, time=SECONDS, repair="gaps")
    assert [finding.kind for finding in log.report.repairs] == ["jitter", "gap"]
    assert len(log.records) == 2


@tabled("rate", "steps", "count", "told")
def test_gaps_are_short_by_a_tenth_of_a_second_or_ten_of_the_loggers_steps(
    tmp_path, rate, steps, count, told
):
    rows = np.arange(60 * (count + 1))
    rows = rows[(rows % 60 >= steps - 1) | (rows < 60)]  # `steps` from one sample to the next
    path = table(tmp_path / "a.csv", rows / rate, np.sin(0.1 * rows), header="t,p")
    with pytest.raises(LogError, match="split the log at its gaps") as raised:
        read_log(path, channels=P, time=SECONDS, resample_hz=rate)
    (finding,) = raised.value.findings
    assert f"({count} gaps" in finding.text
    # told are those that are a tenth longer, in two digits
    allowed = f"--max-gap {float(f'{1.1 * steps / rate:.2g}'):g} " if told else ""
    assert said(finding) == f"{allowed}--repair gaps"


TIME = np.arange(6001) / 100.0


def made(time=TIME, **changes):
    rng = np.random.default_rng(1)
    columns = {
        "p": np.sin(3.0 * time) + 0.005 * rng.standard_normal(time.size),
        "lat": 0.1 * np.cos(3.0 * time) + 0.001 * rng.standard_normal(time.size),
        **changes,
    }
    values = np.column_stack(list(columns.values()))
    return FlightRecord(time, values, tuple(map(channel, columns)), {"seed": 1})


def kinds(log):
    return [finding.kind for finding in log.report.findings]


def spiked():
    rate = made()["p"].copy()
    rate[[700, 3000, 3001]] += [2.0, -3.0, -3.0]
    return made(p=rate)


def test_what_was_injected_has_no_spikes():
    names, peaks = ("p", "lat_disturbance", "lat_sum"), spiked()["p"]
    columns = np.column_stack([peaks] * len(names))
    record = FlightRecord(TIME, columns, tuple(channel(name) for name in names))
    (finding,) = screen(record).report.findings
    assert "column 'p'" in finding.text


def test_spikes_are_noted_and_interpolated_on_request():
    good, record = made(), spiked()
    clean = screen(good, repair=("spikes", "frozen"))
    assert clean.record is good
    assert clean.report.findings == ()
    noted = screen(record)
    assert noted.record is record
    (finding,) = noted.report.findings
    assert (finding.kind, finding.count, finding.rows) == ("spikes", 3, (700, 3000, 3001))
    assert "column 'p': 3 of 6001 samples" in finding.text
    assert said(finding) == "--repair spikes"
    log = screen(record, repair="spikes")
    out = [700, 3000, 3001]
    # the smooth part to (w h)^3, the noise of the sample itself and of its neighbours
    assert log.record["p"][out] == pytest.approx(np.sin(3.0 * TIME[out]), abs=5 * 0.005)
    kept = np.setdiff1d(np.arange(TIME.size), out)
    assert np.array_equal(log.record.values[kept], record.values[kept])
    assert np.array_equal(log.record["lat"], good["lat"])
    assert log.record.provenance["seed"] == 1
    assert log.record.provenance["log"]["findings"][0]["count"] == 3
    assert kinds(screen(record, channels="lat")) == []


def test_a_dead_sensor_is_cut_out_on_request():
    rate, stick = made()["p"].copy(), made()["lat"].copy()
    rate[2000:2151] = rate[2000]
    stick[4000:4400] = stick[4000]
    record = made(p=rate, lat=stick)
    noted = screen(record)
    assert kinds(noted) == ["frozen"]
    assert "151 of 6001 samples are frozen" in noted.report.findings[0].text
    cut = screen(record, repair="frozen")
    assert kinds(cut) == ["frozen", "gap"]
    before, after = cut.records
    assert before.time[-1] == pytest.approx(19.99)
    assert after.time[0] == pytest.approx(21.51)
    assert len(before) + len(after) == TIME.size - 151


def test_lost_samples_are_counted_and_a_record_says_which():
    kept = np.ones(TIME.size, dtype=bool)
    kept[[100, 2000, 2001, 2002]] = False
    kept[3000:3100] = False
    record = made()
    lossy = FlightRecord(TIME[kept], record.values[kept], record.channels, {})
    log = screen(lossy, resample_hz=100.0, repair="gaps")
    assert kinds(log) == ["lost samples", "gap"]
    lost, gap = log.report.findings
    assert lost.count == 4
    assert "4 samples were lost in 2 places" in lost.text
    assert gap.count == 1
    first, second = log.records[0].provenance["missing"]["p"]
    assert np.ravel([first, second]) == pytest.approx([1.0, 1.0, 20.0, 20.02])
    # filled to what is between: a sine of 3 rad/s over 4 steps, and the noise
    between = np.sin(3.0 * TIME[[100, 2001]])
    assert log.records[0]["p"][[100, 2001]] == pytest.approx(between, abs=5 * 0.005)
    assert [len(one) for one in log.records] == [3000, 2901]
    with pytest.raises(RecordError, match="screen"):
        _ = lossy.sample_time
    with pytest.raises(RecordError, match="resample the log"):
        screen(lossy, repair="gaps").check_uniform()
    assert said(screen(lossy, repair="gaps").report.findings[0]) == "--resample 100"
    time = np.cumsum(np.random.default_rng(2).uniform(0.005, 0.015, TIME.size))
    assert kinds(screen(made(time=time), resample_hz=100.0)) == []  # no steady recorder


def test_foreign_logs_are_screened_too(tmp_path):
    record = spiked()
    rows = [f"{t!r},{57.29577951308232 * p!r}" for t, p in zip(TIME.tolist(), record["p"].tolist())]
    path = tmp_path / "other.csv"
    path.write_text("\n".join(["t [s],p [deg/s]", *rows]) + "\n")
    (finding,) = read_log(path).report.findings
    assert (finding.kind, finding.rows) == ("spikes", (702, 3002, 3003))
    ours = tmp_path / "ours.parquet"
    write_record(record, ours)
    assert kinds(read_log(ours, channels=("p",))) == ["spikes"]
    assert kinds(read_log(ours, channels=("lat",))) == []


@pytest.mark.parametrize("value", [0.0, 1e200, -1e308])
def test_channels_that_are_no_motion_say_nothing(value):
    names = ("p", "q", "r", "phi", "theta", "psi")
    odd = {name: np.full(TIME.size, value) for name in names} | {"q": value * np.sin(TIME)}
    assert screen(made(**odd), channels=()).report.findings == ()
