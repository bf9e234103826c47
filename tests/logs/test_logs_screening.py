"""Logs of recorders and sensors that fail: what is noted, and what is left out where asked for."""

import numpy as np
import pytest

from helisim.base.errors import RecordError
from helisim.logs import read_log, screen
from helisim.records.record import FlightRecord, channel
from helisim.records.storage import write_record
from remedies import said

TIME = np.arange(6001) / 100.0


def made(time=TIME, **changes):
    """Return a noisy minute of a rate and an input at 100 Hz, with channels replaced."""
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


def test_spikes_are_noted_and_interpolated_on_request():
    """To a rate's own noise; every other sample keeps its bits; the provenance tells it."""
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
    """Noted, or left out, with the record split there; an input that rests is no sensor."""
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


def test_lost_samples_are_counted():
    """By the steps that are whole multiples of a steady recorder's; a gap counts as such."""
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
    """By the same rules, with lines for rows, as CSV has them."""
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
    """Constant or absurd numbers under the names of rates and angles are no reason to fail."""
    names = ("p", "q", "r", "phi", "theta", "psi")
    odd = {name: np.full(TIME.size, value) for name in names} | {"q": value * np.sin(TIME)}
    assert screen(made(**odd), channels=()).report.findings == ()
