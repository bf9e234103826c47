"""Samples that were lost: found, expected by what is there, and told."""

import numpy as np
import pytest

from helisim.logs import screen
from helisim.records.missing import completed, in_gaps, missing_of, told, with_more_missing
from helisim.records.record import CHANNELS, FlightRecord
from helisim.records.storage import read_record, write_record

RATE = 100.0
TIME = np.arange(3000) / RATE


def bursts(share, seed, count=TIME.size):
    """Return which samples are lost in bursts of 20 to 250 ms, none at the ends."""
    random, lost = np.random.default_rng(seed), np.zeros(count, bool)
    while lost.mean() < share:
        at = int(random.integers(10, count - 40))
        lost[at : at + int(random.integers(2, 26))] = True
    return lost


def sweep():
    u = np.sin(2.0 * np.pi * (0.2 * TIME + 0.5 * 7.8 / 30.0 * TIME**2))
    y = np.zeros(u.size)
    for k in range(u.size - 1):
        y[k + 1] = np.exp(-0.1) * y[k] + (1.0 - np.exp(-0.1)) * u[k]
    return np.column_stack([u, y])


def record(values, lost=None):
    channels = tuple(CHANNELS[name] for name in ("lat", "p")[: values.shape[1]])
    facts = {}
    if lost is not None:
        facts["missing"] = told(TIME, [one.name for one in channels], lost)
    return FlightRecord(TIME, values, channels, facts)


def test_what_lies_between_samples_far_apart_is_a_gap():
    known = np.delete(TIME[:100], np.r_[20, 40:60])
    gone = in_gaps(known, TIME[:120], 1.0 / RATE)
    assert np.flatnonzero(gone).tolist() == [20, *range(40, 60)]  # what comes after isn't one
    assert not in_gaps(TIME[::10], TIME, 1.0 / RATE).any()  # a slower channel isn't all gaps
    assert not in_gaps(TIME[:1], TIME, 1.0 / RATE).any()


def test_a_burst_of_a_fast_sweep_is_expected_from_both_sides():
    values, lost = sweep(), bursts(0.16, 1)
    made = values.copy()
    for column in made.T:
        column[lost] = np.interp(TIME[lost], TIME[~lost], column[~lost])
    found = completed(made, np.repeat(lost[:, None], 2, axis=1), RATE)
    assert np.array_equal(found[~lost], values[~lost])
    straight, expected = (
        np.sqrt(np.mean((one - values)[lost] ** 2, axis=0)) for one in (made, found)
    )
    # without noise little but the change of frequency in a window of 4 s isn't known
    assert np.all(expected < 0.05 * straight)


def test_noise_is_no_part_of_what_is_expected():
    values, lost = sweep(), bursts(0.2, 2)
    noisy = values + np.random.default_rng(3).normal(0.0, [0.0, 0.3], values.shape)
    noisy[lost, 1] = 0.0
    found = completed(noisy, np.column_stack([lost & False, lost]), RATE)
    gain = float(found[lost, 1] @ values[lost, 1] / (values[lost, 1] @ values[lost, 1]))
    # the noise of 500 samples of a known size: 0.3 / (0.4 sqrt(500)), three times
    assert gain == pytest.approx(1.0, abs=0.1)


def test_few_equal_constant_and_huge_channels_stop_nothing():
    values, lost = np.repeat(sweep()[:, :1], 4, axis=1), np.zeros((TIME.size, 4), bool)
    values[:, 2], values[:, 3] = 3.0, 2.0 * values[:, 0]
    lost[100:120] = True
    holed = np.where(lost & (values != 3.0), 0.0, values)
    # 0.2 s of a sweep whose frequency changes: a twentieth of the largest channel
    assert completed(holed, lost, RATE) == pytest.approx(values, abs=0.1)
    few = completed(holed[90:110], lost[90:110], RATE)
    assert np.array_equal(few, holed[90:110])  # too few for a model
    huge = completed(1e307 * holed, lost, RATE)
    assert np.array_equal(huge, 1e307 * holed)


def test_single_samples_lost_here_and_there_in_each_channel():
    values = sweep()
    lost = np.random.default_rng(4).random(values.shape) < 0.28
    lost[[0, -1]] = False
    holed = values.copy()
    for column, gone in zip(holed.T, lost.T):
        column[gone] = np.interp(TIME[gone], TIME[~gone], column[~gone])
    found = completed(holed, lost, RATE)
    before, after = (np.sqrt(np.mean((one - values)[lost] ** 2)) for one in (holed, found))
    assert after < 0.1 * before


def test_a_record_tells_what_is_missing_wherever_it_goes(tmp_path):
    lost = np.column_stack([bursts(0.1, 5), bursts(0.1, 6)])
    one = record(sweep(), lost)
    assert np.array_equal(missing_of(one), lost)
    for name in ("a.csv", "a.parquet"):
        write_record(one, tmp_path / name)
        assert np.array_equal(missing_of(read_record(tmp_path / name)), lost)
    part = one.slice(5.0, 20.0)
    assert np.array_equal(missing_of(part), lost[500:2001])
    hidden = with_more_missing(part)
    moved = np.any(hidden.values != part.values, axis=0)
    assert moved.all()
    (again,) = screen(one, resample_hz=50.0).records
    assert np.array_equal(missing_of(again), lost[::2])


def test_a_reader_marks_what_it_bridges():
    lost, values = bursts(0.16, 7), sweep()
    damaged = FlightRecord(TIME[~lost], values[~lost], record(values).channels)
    (found,) = screen(damaged, resample_hz=RATE, max_gap=1.0).records
    assert np.array_equal(missing_of(found), np.column_stack([lost, lost]))
    assert np.sqrt(np.mean((found.values - values) ** 2)) < 0.01
    whole = screen(record(values), resample_hz=RATE).record
    assert not missing_of(whole).any()
