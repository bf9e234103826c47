"""What was flown on a control, told from its time history; what answers; what columns mean."""

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from command import said
from helisim.logs import Column
from helisim.logs.source import Topics
from helisim.look import excitation as excited
from helisim.look.channels import SeenChannel, SeenClock, _geographic, guess, named  # noqa: F401  (rows name them)
from helisim.look.excitation import FoundAnswer, FoundExcitation, answers, excitation, loops
from helisim.records.record import CHANNELS, Channel, FlightRecord
from tabled import tabled

T = np.arange(6000) / 100.0


def noise(level, seed=0):
    return level * np.random.default_rng(seed).standard_normal(T.size)


def found(values, level=0.02):
    return excitation("lat", T, values + noise(level))


def chirp(low, high, start=10.0, stop=50.0):
    share = np.clip((T - start) / (stop - start), 0.0, 1.0)
    ratio = high / low
    phase = low * (stop - start) / np.log(ratio) * (ratio**share - 1.0)
    return np.where((start <= T) & (stop >= T), np.sin(phase), 0.0)


@pytest.mark.parametrize("backwards", [False, True])
def test_a_sweep_is_told_with_its_range_and_times(backwards):
    wave = chirp(1.0, 30.0)
    one = found(wave[::-1] if backwards else wave)
    assert one.kind == "sweep"
    assert one.start == pytest.approx(10.0, abs=1.5)
    assert one.stop == pytest.approx(50.0, abs=1.5)
    # a first wave that half is seen; an end that is an average of the last tenth of waves
    assert 0.7 < one.low < 1.5
    assert 0.85 * 30.0 < one.high < 1.1 * 30.0


def test_half_waves_are_told():
    shapes = {"pulse": [3.0], "doublet": [1.0, 1.0], "3-2-1-1": [3.0, 2.0, 1.0, 1.0]}
    for kind, lengths in shapes.items():
        values, at, side = np.zeros(T.size), 10.0, 0.5
        for length in lengths:
            values[(at <= T) & (at + length > T)] = side
            at, side = at + length, -side
        one = found(values)
        assert one.kind == kind
        assert (one.start, one.stop) == pytest.approx((10.0, at), abs=0.05)
        assert one.amplitude == pytest.approx(0.5, rel=0.1)


def doublet(at, width):
    return 0.5 * ((at <= T) & (at + width > T)) - 0.5 * ((at + width <= T) & (at + 2 * width > T))


def test_a_doublet_has_its_power_where_its_transform_is_large():
    """|sin^2(w / 2) / (w / 2)| of half-waves of 1 s has half of its power's peak at the ends.

    At 1.14 and 3.65 rad/s: to 15 %, in which it falls by a fifth.
    """
    one = found(doublet(20.0, 2.0))
    assert (2.0 * one.low, 2.0 * one.high) == pytest.approx((1.144, 3.653), rel=0.15)


@tabled("slow", "gap", "start", "kind")
def test_a_rest_within_an_excitation_is_short(slow, gap, start, kind):
    """6 s, or twice the 5 s of a long log in which a control is looked at; then the longest."""
    moved = doublet(10.0, 2.0) + doublet(14.0 + gap, 3.0)
    one = excitation("lat", slow * T, moved + noise(0.005))
    assert (one.kind, one.start) == (kind, pytest.approx(slow * start, abs=0.02 * slow))
    assert one.stop == pytest.approx(slow * (20.0 + gap), abs=0.02 * slow)


def test_a_sweep_is_seen_to_the_logs_end():
    one = excitation("lat", T[:5950], (chirp(1.0, 30.0, 10.0, T[-1]) + noise(0.02))[:5950])
    assert one.stop == pytest.approx(T[5949], abs=0.05)
    slow = excitation("lat", 25.0 * T, chirp(0.4, 12.0) + noise(0.02))  # as of a ship
    assert (slow.kind, slow.start) == ("sweep", pytest.approx(265.0, abs=15.0))


@pytest.mark.parametrize(("share", "low", "high"), [(0.04, 3.0, 20.0), (0.02, 8.0, 8.0)])
def test_a_motion_has_the_band_of_94_percent_of_its_power(share, low, high):
    """Lines at 3, 8 and 20 rad/s, the outer ones of 4 or 2 % each; a minute resolves 0.1 rad/s."""
    sizes = np.sqrt([share, 1.0 - 2.0 * share, share])
    one = excitation("lat", T, np.sin(np.outer(T, [3.0, 8.0, 20.0])) @ sizes)
    assert (one.kind, one.start, one.stop) == ("motion", 0.03, T[-1])  # of what isn't near 0
    assert (one.low, one.high) == pytest.approx((low, high), abs=0.25)  # a Hann window's two lines


def answered(low, high, rates=(), count=5000, noises=(1.0, 0.5, 2.0)):
    """Return the answers of p, q, az to a motion of lat at 50 Hz: twice it, and noise."""
    random = np.random.default_rng(0)
    lat = random.standard_normal(count)
    columns = [lat, *(2.0 * lat + noise * random.standard_normal(count) for noise in noises)]
    names = ("lat", "p", "q", "az")
    channels = tuple(Channel(name, CHANNELS[name].unit, "OTHER") for name in names)
    record = FlightRecord(np.arange(count) / 50.0, np.column_stack(columns), channels, {})
    one = FoundExcitation("lat", "motion", 0.0, record.duration, low, high, 1.0)
    return answers(record, [one], dict(rates))


@pytest.mark.slow
def test_answers_have_their_coherence_and_the_best_is_first():
    """4 / (4 + noise): 0.80, 0.94, and 0.5, which is not enough; means of 60 lines, 9 windows."""
    found = answered(0.5, 20.0)
    assert [one.output for one in found] == ["q", "p"]
    assert [one.coherence for one in found] == pytest.approx([4 / 4.25, 4 / 5], abs=0.03)
    assert found[0].structure.startswith("tf:0/")
    (_, _, az) = sorted(answered(0.5, 20.0, noises=(0.1, 0.1, 0.1)), key=lambda one: one.output)[
        ::-1
    ]
    assert (az.output, az.structure) == ("az", "tf:1/1")


@tabled("low", "high", "rates", "band")
def test_an_answer_has_the_band_that_is_excited_and_sampled(low, high, rates, band):
    found = [one for one in answered(low, high, rates) if one.output == "q"]
    assert len(found) == (band is not None)
    for one in found:
        assert (one.low, one.high) == pytest.approx(band, abs=0.315)  # of lines that are so far off


@tabled("fed_back", "more", "rates", "told")
def test_a_closed_loop_is_told_by_what_the_stick_does_not_explain(fed_back, more, rates, told):
    """Of LAT - k gust it leaves k^2 / (1 + k^2); gust + m noise has 1 / (1 + m^2) in common."""
    stick, gust, noise = np.random.default_rng(0).standard_normal((3, 20_000))
    p = gust + more * noise
    columns = np.column_stack([stick, stick - fed_back * gust, p])
    channels = tuple(Channel(name, CHANNELS[name].unit, "OTHER") for name in ("LAT", "lat", "p"))
    record = FlightRecord(np.arange(20_000) / 50.0, columns, channels, {})
    found = loops(record, [FoundAnswer("lat", "p", 2.0, 20.0, 0.9, "tf:0/1")], rates)
    assert [said(one) for one in found] == (["--reference LAT"] if told else [])


def test_a_record_of_too_few_samples_answers_nothing():
    assert len(answered(9.0, 40.0, count=160, noises=(1e-3,) * 3)) == 3
    assert answered(9.0, 40.0, count=159, noises=(1e-3,) * 3) == ()


def test_noise_is_no_excitation():
    kinds = set()
    for seed in range(100):
        pole = 0.99 * np.random.default_rng(seed).random()
        kinds.add(excitation("lat", T, lfilter([1.0], [1.0, -pole], noise(1.0, seed))).kind)
    assert kinds == {"motion"}
    assert excitation("lat", T, np.full(T.size, 0.3)) is None
    assert excitation("lat", T[:20], noise(1.0)[:20]) is None


@tabled("heading", "channel", "unit", "sign")
def test_names_are_understood(heading, channel, unit, sign):
    meant = named(heading, "CSV")
    assert (meant.channel, meant.unit, meant.sign) == (channel, unit, sign)


def guessed(columns, log_format="CSV", given=(), units=()):
    topics, (rates, values) = {name: name for name in columns}, zip(*columns.values())
    stamps = {k: 1e6 * np.arange(np.size(v)) / r for k, r, v in zip(columns, rates, values)}
    read = {name: np.asarray(value, float) for name, value in zip(columns, values)}
    source = Topics(Path("a"), log_format, topics, read.get, stamps.get, 0.0, dict(units), ())
    clocks = {name: SeenClock.of(name, 1e-6 * stamp) for name, stamp in stamps.items()}
    return {one.name: one for one in guess(source, dict(given), clocks)}


SWING = np.sin(np.arange(400) / 20.0)


@tabled("name", "values", "unit")
def test_a_unit_is_guessed_by_size(name, values, unit):
    found = guessed({name: (50.0, values)})
    assert (found[name].column.unit if name in found else None) == unit
    if unit == "us":
        assert found[name].column.trim == pytest.approx(np.median(values), abs=0.5)
        assert found[name].column.range == 800.0
    if unit == "1" and np.abs(values).max() > 1.5:  # as it is, in no known unit
        assert (found[name].column.range, found[name].column.trim) == (1.0, np.median(values))


def test_a_family_has_one_unit_and_what_is_stated_or_given_stays():
    rates = {name: (50.0, size * SWING) for name, size in (("p", 3.0), ("q", 30.0), ("r", 0.1))}
    rates |= {"ax": (50.0, 0.1 * SWING), "az": (50.0, 0.1 * SWING - 1.0)}
    rates |= {"lon": (50.0, 6.0 * SWING), "lat": (50.0, 0.4 * SWING)}
    found = {name: one.column.unit for name, one in guessed(rates).items()}
    assert {found.pop(name) for name in ("lat", "lon")} == {"percent"}
    assert found == {"p": "deg/s", "q": "deg/s", "r": "deg/s", "ax": "g", "az": "g"}
    found = guessed(rates, units={"r": "rad/s", "lat": "1"}, given={"p": Column("p", "rad/s")})
    assert {name: found[name].column.unit for name in (*"pqr", "lat", "lon")} == {
        "p": "rad/s", "q": "deg/s", "r": "rad/s", "lat": "1", "lon": "percent"
    }  # fmt: skip
    assert (found["p"].why, found["r"].why) == ("given", "its name; unit stated")


@tabled("columns", "taken")
def test_of_columns_of_a_channel_the_better_or_the_faster_is_taken(columns, taken):
    found = guessed({name: (rate, SWING) for name, rate in columns.items()}, "DataFlash")
    assert found["p"].column.column == taken
    assert found["p"].rate == pytest.approx(columns[taken])


def held(rate=50.0, count=5000, **columns):
    """Return a record of channels at a rate, Hz; a number is the seed of white noise."""
    made = {name: np.random.default_rng(one).standard_normal(count) if isinstance(one, int) else one
            for name, one in columns.items()}  # fmt: skip
    known = tuple(Channel(name, CHANNELS[name].unit, "OTHER") for name in made)
    return FlightRecord(np.arange(count) / rate, np.column_stack([*made.values()]), known, {})


def band(low, high, seed, count=5000, rate=50.0):
    """Return noise of rms 1 in a band, rad/s."""
    lines = np.fft.rfft(np.random.default_rng(seed).standard_normal(count))
    omega = 2.0 * np.pi * np.fft.rfftfreq(count, 1.0 / rate)
    values = np.fft.irfft(lines * ((low <= omega) & (omega <= high)), count)
    return values / np.std(values)


def small_answer(share):
    """Return what answers 8 to 20 rad/s, a share of a control's power, and nothing else of it."""
    own = np.sqrt(1.0 - share) * band(2.0, 6.0, 1) + np.sqrt(share) * (high := band(8.0, 20.0, 2))
    one = FoundExcitation("lat", "sweep", 0.0, 99.98, 2.0, 20.0, 1.0)
    return [each.output for each in answers(held(lat=own, p=high + band(2.0, 6.0, 3)), [one], {})]


def explained(share, size=1.0, **more):
    """Return which commands explain outputs, of whose power pedals hold a share beyond lat."""
    noise = {name: np.random.default_rng(k).standard_normal(5000) for k, name in enumerate("abcd")}
    p = noise["a"] + np.sqrt(share) * noise["b"] + np.sqrt(1.0 - share) * noise["c"]
    record = held(lat=noise["a"], ped=size * noise["b"], col=0.0 * p, lon=noise["d"], p=p, **more)
    return excited.beside([record, record], ("lat",), ("p",))


def shape(*waves, width=1.0, step=0.01):
    """Return kind, and ends in inverse half-waves, of so high half-waves, each as wide."""
    values = np.repeat(waves, round(width / step))
    kind, low, high = excited._kind(step * np.arange(values.size), np.array(values), 1.0)
    return kind, round(low, 3), round(high, 3)


@tabled("made", "wanted")
def test_what_moved_and_what_it_is_called_by_hand(made, wanted):
    assert made() == wanted
