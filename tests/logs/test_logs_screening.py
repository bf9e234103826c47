"""Logs of recorders and sensors that fail: what is noted, and what is left out where asked for."""

import numpy as np
import pytest

from helisim.base.errors import InputError, RecordError
from helisim.logs import read_log, screen
from helisim.logs.screening import clock_errors
from helisim.records.record import FlightRecord, channel
from helisim.records.storage import write_record
from remedies import said

TIME = np.arange(6001) / 100.0
NAMES = ("p", "lat")


def made(time=TIME, names=NAMES, **changes):
    """Return a noisy minute of a rate and an input at 100 Hz, with channels replaced."""
    rng = np.random.default_rng(1)
    columns = {
        "p": np.sin(3.0 * time) + 0.005 * rng.standard_normal(time.size),
        "lat": 0.1 * np.cos(3.0 * time) + 0.001 * rng.standard_normal(time.size),
        **changes,
    }
    values = np.column_stack([columns[name] for name in names])
    return FlightRecord(time, values, tuple(channel(name) for name in names), {"seed": 1})


def kinds(log):
    return [finding.kind for finding in log.report.findings]


def spiked():
    rate = made()["p"].copy()
    rate[[700, 3000, 3001]] += [2.0, -3.0, -3.0]
    return made(p=rate)


def test_a_sound_record_is_left_as_it_is():
    """Nothing is noted, and the very record comes back."""
    record = made()
    log = screen(record, repair=("spikes", "frozen"))
    assert log.record is record
    assert log.report.findings == ()


def test_spikes_are_noted_with_their_place():
    """The record stays as it is; the note says how many, where, and what can be done."""
    record = spiked()
    log = screen(record)
    assert log.record is record
    (finding,) = log.report.findings
    assert (finding.kind, finding.count, finding.rows) == ("spikes", 3, (700, 3000, 3001))
    assert not finding.repaired
    assert "column 'p': 3 of 6001 samples" in finding.text
    assert "7 s after the start" in finding.text
    assert said(finding) == "--repair spikes"


def test_spikes_are_interpolated_on_request():
    """To a rate's own noise; every other sample keeps its bits; the provenance tells it."""
    good, record = made(), spiked()
    log = screen(record, repair="spikes")
    out = [700, 3000, 3001]
    # the smooth part to (w h)^3, the noise of the sample itself and of its neighbours
    assert log.record["p"][out] == pytest.approx(np.sin(3.0 * TIME[out]), abs=5 * 0.005)
    kept = np.setdiff1d(np.arange(TIME.size), out)
    assert np.array_equal(log.record.values[kept], record.values[kept])
    assert np.array_equal(log.record["lat"], good["lat"])
    (finding,) = log.report.repairs
    assert "interpolated" in finding.text
    assert log.record.provenance["seed"] == 1
    assert log.record.provenance["log"]["findings"][0]["count"] == 3


def test_a_dead_sensor_is_cut_out_on_request():
    """Noted, or left out, with the record split there; an input that rests is no sensor."""
    rate, stick = made()["p"].copy(), made()["lat"].copy()
    rate[2000:2151] = rate[2000]
    stick[4000:4400] = stick[4000]
    record = made(p=rate, lat=stick)
    noted = screen(record)
    assert kinds(noted) == ["frozen"]
    assert "is frozen for 1.5 s, in one run from row 2000" in noted.report.findings[0].text
    cut = screen(record, repair="frozen")
    assert kinds(cut) == ["frozen", "gap"]
    before, after = cut.records
    assert before.time[-1] == pytest.approx(19.99)
    assert after.time[0] == pytest.approx(21.51)
    assert len(before) + len(after) == TIME.size - 151


def test_only_wanted_channels_are_looked_at():
    """A channel that nobody asked for may fail."""
    assert kinds(screen(spiked(), channels="lat")) == []
    assert kinds(screen(spiked(), channels=("p", "lat"))) == ["spikes"]


def test_lost_samples_are_counted():
    """By the steps that are whole multiples of a steady recorder's; a gap counts as such."""
    kept = np.ones(TIME.size, dtype=bool)
    kept[[100, 2000, 2001, 2002]] = False
    kept[3000:3100] = False
    record = made()
    log = screen(
        FlightRecord(TIME[kept], record.values[kept], record.channels, {}),
        resample_hz=100.0,
        repair="gaps",
    )
    assert kinds(log) == ["lost samples", "gap"]
    lost, gap = log.report.findings
    assert lost.count == 4
    assert "4 samples were lost in 2 places" in lost.text
    assert gap.count == 1
    # filled to what is between: a sine of 3 rad/s over 4 steps, and the noise
    assert log.records[0]["p"][[100, 2001]] == pytest.approx(
        np.sin(3.0 * TIME[[100, 2001]]), abs=5 * 0.005
    )
    assert [len(one) for one in log.records] == [3000, 2901]


def test_without_a_request_lost_samples_stop_the_use():
    """A record that isn't uniform is refused where uniform samples are needed, with a way out."""
    kept = np.arange(TIME.size) != 100
    record = made()
    lossy = FlightRecord(TIME[kept], record.values[kept], record.channels, {})
    with pytest.raises(RecordError, match="screen"):
        _ = lossy.sample_time
    with pytest.raises(RecordError, match="resample the log"):
        screen(lossy).check_uniform()


def test_a_jittery_recorder_loses_nothing():
    """Where steps are no multiples of one step, nothing can be said to be lost."""
    rng = np.random.default_rng(2)
    time = np.cumsum(rng.uniform(0.005, 0.015, TIME.size))
    assert kinds(screen(made(time=time), resample_hz=100.0)) == []


def test_foreign_logs_are_screened_too(tmp_path):
    """By the same rules, with lines for rows, as CSV has them."""
    record = spiked()
    rows = [f"{t!r},{57.29577951308232 * p!r}" for t, p in zip(TIME.tolist(), record["p"].tolist())]
    path = tmp_path / "other.csv"
    path.write_text("\n".join(["t [s],p [deg/s]", *rows]) + "\n")
    log = read_log(path)
    (finding,) = log.report.findings
    assert (finding.kind, finding.rows) == ("spikes", (702, 3002, 3003))
    ours = tmp_path / "ours.parquet"
    write_record(record, ours)
    assert kinds(read_log(ours, channels=("p",))) == ["spikes"]
    assert kinds(read_log(ours, channels=("lat",))) == []


def test_an_unknown_repair_lists_those_there_are():
    """As for files."""
    with pytest.raises(InputError, match="frozen, gaps, missing, order, resets, spikes"):
        screen(made(), repair="spike")


def turning(fast=0.0, slip=0.0, noise=1.0, seed=0):
    """Return time and channels of a rolling flight whose clocks go wrong."""
    rng = np.random.default_rng(seed)
    time = np.arange(9001) / 100.0

    def phi(t):
        return 0.2 * np.sin(2.0 * t + 0.05 * t**2)

    def p(t):
        return 0.2 * (2.0 + 0.1 * t) * np.cos(2.0 * t + 0.05 * t**2)

    nothing = np.zeros(time.size)
    channels = {
        "phi": phi(time / (1.0 + fast)) + noise * 0.002 * rng.standard_normal(time.size),
        "p": p((time - slip * time) / (1.0 + fast))
        + noise * 0.005 * rng.standard_normal(time.size),
        "q": nothing,
        "r": nothing,
        "theta": nothing,
        "psi": nothing,
    }
    return time, channels


@pytest.mark.parametrize("fast", [-5e-3, 0.0, 5e-3])
@pytest.mark.parametrize("slip", [-1e-4, 0.0, 1e-4])
def test_angles_and_rates_tell_the_clock(fast, slip):
    """How fast the clock is, within five standard errors, also where rates slip."""
    with np.errstate(all="ignore"):
        found = clock_errors(*turning(fast, slip))[0]
    assert found.angle == "phi"
    assert found.coherence > 0.999
    assert found.error < 1e-3
    # of the slip a part, 1e-4, is a scale as well
    assert found.fast == pytest.approx(fast, abs=5.0 * found.error + 1.1 * abs(slip))


def test_errors_of_the_clock_are_honest():
    """Over forty seeds the found values scatter as their standard errors say, around none."""
    with np.errstate(all="ignore"):
        found = [clock_errors(*turning(seed=seed))[0] for seed in range(40)]
    pulls = [one.fast / one.error for one in found]
    # 40 pulls of 14 degrees of freedom: their rms is 1.08, to 12 %; the mean to 0.17
    assert 0.7 < np.sqrt(np.mean(np.square(pulls))) < 1.5
    assert abs(np.mean(pulls)) < 0.7


@pytest.mark.parametrize("value", [0.0, 1.0, 1e200, -1e308])
def test_channels_that_are_no_motion_say_nothing(value):
    """Constant or absurd numbers under the names of rates and angles are no reason to fail."""
    time, channels = turning()
    for name in channels:
        odd = {**channels, name: np.full(time.size, value), "q": value * np.sin(time)}
        log = screen(made(time=time, names=tuple(channels), **odd), channels=())
        assert set(kinds(log)) <= {"clock"}


def test_a_clock_that_goes_wrong_is_noted():
    """In the report, with its error; sound clocks, and too little turning, say nothing."""
    time, channels = turning(5e-3)
    record = made(time=time, names=tuple(channels), **channels)
    (finding,) = screen(record, channels=("phi",)).report.findings
    assert finding.kind == "clock"
    assert "clock is fast" in finding.text
    assert not finding.repaired
    time, channels = turning()
    assert kinds(screen(made(time=time, names=tuple(channels), **channels))) == []
    time, channels = turning(5e-3, noise=30.0)
    assert kinds(screen(made(time=time, names=tuple(channels), **channels))) == []
