"""The local method against closed forms, plain sums and many draws of a disturbance."""

import math
from dataclasses import replace
from itertools import accumulate  # noqa: F401  (rows name it)

import numpy as np
import pytest
from scipy import stats
from scipy.optimize import minimize
from scipy.signal import detrend, freqz, lfilter

from helisim.base.errors import IdentificationError
from helisim.ident import frequency_response, identify, structures, verify
from helisim.ident import windows as win
from helisim.ident.bounds import accuracy
from helisim.ident.cost import Cost, select
from helisim.ident.evaluate import response
from helisim.ident.local import Task, estimate_bands, transients
from helisim.ident.local_fit import Lines, fit_band, flight_lines
from helisim.ident.scatter import LineWeights, LocalScatter
from helisim.records.record import FlightRecord
from ident_data import YAW, fitted, of_model, record
from tabled import tabled

STEP = 0.05
LIGHT = np.poly(0.995 * np.exp([0.05j, -0.05j]))
"""Denominator of a mode at 1 rad/s with a damping of 0.1, in steps of 0.05 s."""


def truth(b, a, frequency):
    return freqz(b, a, frequency * STEP)[1]


def cut(seed, b, a, samples=2400):
    lat = np.random.default_rng(seed).standard_normal(samples + 500)
    return record(lat=lat[500:], p=lfilter(b, a, lat)[500:])


def worst(frf, expected):
    return np.max(np.abs(frf.response[0, 0] / expected - 1.0))


ASKED = {"inputs": "lat", "outputs": "p", "band": (0.5, 20.0)}


def test_a_lightly_damped_mode_is_not_smeared():
    """Half of its width is two lines; what is left is 0.1 % at most, where windows leave 30 %."""
    flights = [cut(k, [0.01], LIGHT) for k in range(2)]
    local = frequency_response(flights, estimator="local", **ASKED)
    windows = frequency_response(flights, estimator="windows", **ASKED)
    expected = truth([0.01], LIGHT, local.frequency)
    assert worst(local, expected) < 1e-3
    assert worst(windows, expected) > 0.2


@pytest.mark.parametrize("times", [8, 12, 15, 20])
@pytest.mark.parametrize("samples", [2400, 2401])
def test_pulses_that_repeat_a_whole_number_of_times_tell_a_response(times, samples):
    """Of 120 independent points one errs by 3.1 of its rms once in 120 times: exp(-z^2)."""
    pulse = np.repeat([0.0, 1.0, -1.0, 0.0], [20, 10, 10, 2400 // times - 40])
    lat, random = np.resize(pulse, samples), np.random.default_rng(times)
    made = lfilter([0.3], [1.0, -0.8], lat) + 0.05 * random.standard_normal(samples)
    frf = frequency_response(record(lat=lat, p=made), **ASKED)
    off = np.abs(frf.response / truth([0.3], [1.0, -0.8], frf.frequency) - 1.0)
    assert np.mean(frf.usable()) > 0.8
    assert np.max((off / (math.sqrt(2.0) * frf.random_error))[frf.usable()]) < 3.1


def unstable(seed, disturbance=0.0, samples=2400, answers=0.0):
    """Return r = 1.02 r + 0.1 ped + v one sample ago, held by ped = PED - r; PED `answers` r."""
    random = np.random.default_rng(seed)
    stick, v = random.standard_normal(samples), disturbance * random.standard_normal(samples)
    r, ped = np.zeros(samples), np.zeros(samples)
    for k in range(samples):
        if k:
            r[k] = 1.02 * r[k - 1] + 0.1 * ped[k - 1] + v[k - 1]
        stick[k] -= answers * r[k]
        ped[k] = stick[k] - r[k]
    return record(PED=stick, ped=ped, r=r)


LOOP = {"inputs": "ped", "outputs": "r", "reference": "PED", "band": (0.5, 20.0)}
UNSTABLE = ([0.0, 0.1], [1.0, -1.02])


def test_an_unstable_vehicle_comes_back_from_its_loop():
    """Responses to the stick are damped, so their ratio errs by 2 % at most, by 0.002 % mostly."""
    frf = frequency_response(unstable(1), estimator="local", **LOOP)
    expected = truth(*UNSTABLE, frf.frequency)
    assert worst(frf, expected) < 0.02
    assert np.median(np.abs(frf.response[0, 0] / expected - 1.0)) < 1e-4


def test_a_pilot_who_answers_gusts_does_not_bias_a_predictor():
    """Errors are as stated, three of them at most; the sticks as reference are half off."""
    flight, asked = unstable(3, 0.1, samples=9600, answers=1.0), LOOP | {"band": (2.0, 20.0)}
    joint = frequency_response(flight, **asked)
    expected = truth(*UNSTABLE, joint.frequency)
    assert np.mean(np.abs(joint.response[0, 0] / expected - 1.0)[:32]) > 0.4
    frf = frequency_response(flight, estimator="predictor", **asked | {"reference": None})
    off = np.abs(frf.response[0, 0] / expected - 1.0) / (math.sqrt(2.0) * frf.random_error[0, 0])
    assert (np.max(off) < 3.0, 0.2 < np.mean(off**2) < 2.0, frf.evidence) == (True, True, ())


@tabled("acts", "most")
def test_what_large_motion_does_is_in_a_predictor_s_errors(acts, most):
    """Steps of a normal size: a line fits 12 % off by a slew of 0.4 a sample, 16 % by the cube."""
    random, top = np.random.default_rng(1), [*[0.0] * 6, 0.05]
    lat = np.repeat(random.standard_normal(300), 80)
    p = lfilter(top, [1.0, -0.985], acts(lat)) + 0.05 * random.standard_normal(lat.size)
    asked = ASKED | {"band": (2.0, 20.0), "estimator": "predictor"}
    frf = frequency_response(record(0.005, lat=lat, p=p), **asked)
    expected = freqz(top, [1.0, -0.985], 0.005 * frf.frequency)[1]
    off, held = frf.response[0, 0] - expected, np.abs(frf.scatter.gap[0, 0, 0])
    assert np.mean(np.abs(off / expected)) < most
    assert np.mean(np.abs(off)) < np.mean(held) < 0.2 * np.mean(np.abs(expected))


# The parts: lines of two flights

SPACING = np.array([0.02, 0.027])
COUNT = np.array([400, 310])
MIDDLE = np.array([1.0, 2.3, 4.0])


def lines(response, transient=None, noise=0.0, seed=0):
    """Return two flights' lines: two white inputs, p and q by `response` of w, (2, 2, n)."""
    random = np.random.default_rng(seed)

    def white(*shape):
        return (random.normal(size=shape) + 1j * random.normal(size=shape)) / np.sqrt(2.0)

    values = np.zeros((2, COUNT.max(), 4), dtype=complex)
    for flight, (spacing, count) in enumerate(zip(SPACING, COUNT)):
        omega = spacing * np.maximum(np.arange(count), 1e-9)
        drive = white(2, count)
        out = np.einsum("oin,in->on", response(omega), drive) + noise * white(2, count)
        if transient is not None:
            out = out + transient(flight, omega)
        values[flight, :count] = np.concatenate([drive, out]).T
    return Lines(("lat", "lon", "p", "q"), SPACING, COUNT, values)


def fit_at(made, middle, transient):
    middle = np.atleast_1d(middle)
    return fit_band(made, [0, 1], [2, 3], middle, 0.4 * middle, transient=transient)


def test_the_gain_is_its_weights_sum_and_errs_as_they_say():
    """E of a residual's spectrum is the disturbance's, E|dG|^2 is the weights' sum of squares."""
    noise, gaps, stated, rest, freedom = 0.3, [], [], [], []
    for seed in range(60):
        made = lines(lambda w: np.ones((2, 2, w.size)), noise=noise, seed=seed)
        fit = fit_at(made, MIDDLE, True)
        for k in range(MIDDLE.size):
            total = np.zeros((2, 2), dtype=complex)
            for flight in range(2):
                at = fit.first[k, flight] + np.arange(fit.weight.shape[3])
                inside = at < COUNT[flight]
                total += made.values[flight, at[inside], 2:].T @ fit.weight[k, :, flight, inside]
            # a pole, where one is found by chance, isn't linear in the lines
            if np.allclose(total, fit.gain[k], rtol=1e-9):
                gaps.append(np.abs(fit.gain[k] - 1.0) ** 2 / noise**2)
                stated.append(np.tile(np.sum(np.abs(fit.weight[k]) ** 2, axis=(1, 2)), (2, 1)))
                rest.append(np.real(np.diagonal(fit.residual[k])) / noise**2)
                freedom.append(fit.freedom[k])
    assert len(gaps) > 0.8 * 60 * MIDDLE.size
    # means of about 170 x 4 squares of complex normal numbers: scatter by 4 %, four of them
    assert np.mean(gaps) / np.mean(stated) == pytest.approx(1.0, abs=0.16)
    # each is a mean over `freedom` lines
    assert np.mean(rest) == pytest.approx(1.0, abs=4.0 / np.sqrt(2.0 * np.sum(freedom)))


def test_a_records_lines_hold_its_power():
    """Parseval: the one-sided spectrum's integral, over Hz, is the mean square less the level's."""
    random = np.random.default_rng(3)
    flights = [
        record(step, lat=5.0 + random.normal(size=samples), p=5.0 + random.normal(size=samples))
        for samples, step in ((401, 0.02), (300, 0.05))
    ]
    found = flight_lines(flights, ("p", "lat"), np.pi / 0.02)
    for flight, one in enumerate(flights):
        assert found.spacing[flight] == pytest.approx(2.0 * np.pi / one.duration)
        power = np.sum(np.abs(found.values[flight, 1:]) ** 2, axis=0) / one.duration
        first, *between, last = one.select(("p", "lat"))
        centred = np.array([0.5 * (first + last), *between])  # both ends count half
        centred -= centred.mean(axis=0)
        if len(centred) % 2 == 0:  # the line at half the rate is left out
            alternating = (-1.0) ** np.arange(len(centred))
            centred -= np.outer(alternating, alternating @ centred) / len(centred)
        assert power == pytest.approx(np.mean(centred**2, axis=0), rel=1e-9)
        assert np.all(found.values[flight, found.count[flight] :] == 0.0)


# The error model


def scatter(seed):
    random = np.random.default_rng(seed)

    def numbers(*shape):
        return random.normal(size=shape) + 1j * random.normal(size=shape)

    root = numbers(4, 3, 3)
    # any two frequencies share lines, of one flight or of both
    weights = tuple(
        LineWeights(np.arange(2), np.array(first), numbers(2, 2, 2, 3 + k).astype(np.complex64))
        for k, first in enumerate(([1, 2], [9, 3], [5, 4], [2, 6]))
    )
    return LocalScatter(
        frequency=np.array([1.0, 1.3, 2.0, 4.5]),
        weights=weights,
        share=random.uniform(size=(2, 3, 2, 4)),
        noise=root @ root.conj().swapaxes(1, 2),
        bias=random.uniform(size=(3, 2, 4)),
        spread=random.uniform(size=(3, 2, 4)),
    )


POINTS = [(o, i, w) for w in (0, 1, 2, 3) for o in (0, 2) for i in (0, 1)]


def line_weights(one, o, i, w):
    """Return by what a point takes the lines, (n_flight, n_line)."""
    found = np.zeros((2, 30), dtype=complex)
    weights = one.weights[w]
    for part, value in zip(weights.part, weights.value[:, i]):
        for flight, first in enumerate(weights.first):
            found[flight, first : first + value.shape[1]] += (
                one.share[part, o, i, w] * value[flight]
            )
    return found


def expected_covariance(weights_of, one):
    value, vector = np.linalg.eigh(one.noise)
    roots = (vector * np.sqrt(value)[:, None, :]) @ vector.conj().swapaxes(1, 2)
    total = np.zeros((len(POINTS), len(POINTS)), dtype=complex)
    for k, (o, i, w) in enumerate(POINTS):
        for m, (o2, i2, w2) in enumerate(POINTS):
            shared = np.sum(weights_of(o, i, w) * weights_of(o2, i2, w2).conj())
            total[k, m] = shared * (roots[w] @ roots[w2])[o, o2]
            if (o, i) == (o2, i2):
                apart = abs(np.log(one.frequency[w] / one.frequency[w2])) / 0.5
                total[k, m] += one.bias[o, i, w] * one.bias[o, i, w2] * np.exp(-apart)
                total[k, m] += one.spread[o, i, w] ** 2 * (w == w2)
    return total


def test_the_covariance_is_the_sum_over_common_lines():
    """Weight times conjugate weight times the disturbance's spectrum, bias and spread added."""
    one, at = scatter(1), np.array(POINTS).T
    expected = expected_covariance(lambda *point: line_weights(one, *point), one)
    assert one.covariance(*at) == pytest.approx(expected, rel=1e-5, abs=1e-5)  # single precision
    assert one.variance(*at) == pytest.approx(np.real(np.diagonal(expected)), rel=1e-5)


def test_the_scatter_of_a_difference_has_the_difference_of_the_weights():
    one, other, at = scatter(2), scatter(3), np.array(POINTS).T
    both = one.minus(other)
    for name in ("bias", "spread"):
        expected = np.hypot(getattr(one, name), getattr(other, name))
        assert getattr(both, name) == pytest.approx(expected)
    expected = expected_covariance(
        lambda *point: line_weights(one, *point) - line_weights(other, *point), both
    )
    assert both.variance(*at) == pytest.approx(np.real(np.diagonal(expected)), rel=1e-5)
    rest = 2.0 * (one.bias[tuple(at)] ** 2 + one.spread[tuple(at)] ** 2)
    assert np.allclose(one.minus(one).variance(*at), rest, atol=1e-4)


# The bands

FREQUENCY = np.geomspace(0.3, 6.0, 60)


def smooth(w):
    return np.array([[1.0, 0.5], [-0.3, 2.0]])[..., None] / (1.0 + 0.2j * w)


def task(made, active=()):
    return Task(made, [0, 1], [2, 3], list(active), 2, FREQUENCY)


def test_transients_are_estimated_where_they_are():
    def early(flight, w):
        return np.where(w < 1.2, 2.0, 0.0) * np.array([[1.0], [-1.0j]]) * (1.0 + flight)

    found = transients(task(lines(smooth, early, noise=0.3)))
    assert np.all(found[FREQUENCY < 0.8])
    assert not np.any(found[FREQUENCY > 4.0])
    assert not np.any(transients(task(lines(smooth, noise=0.3))))


def test_with_references_responses_are_ratios():
    random = np.random.default_rng(9)
    follow, vehicle = (random.normal(size=(2, 2)) + np.eye(2) * 2.0 for _ in range(2))
    made = lines(lambda w: (vehicle @ follow)[..., None] * np.ones(w.size))
    values = np.concatenate([made.values, made.values[:, :, :2] @ follow.T], axis=2)
    names = ("LAT", "LON", "p", "q", "lat", "lon")
    bands = estimate_bands(task(Lines(names, made.spacing, made.count, values), (4, 5)))
    for k in range(FREQUENCY.size):
        used = np.flatnonzero(bands.valid[:, k])
        assert np.allclose(bands.gain[used, :, :, k], vehicle, rtol=1e-6)
        assert bands.active_gain[k] == pytest.approx(follow, rel=1e-6)
        assert bands.full_gain[k] == pytest.approx(vehicle, rel=1e-6)


# CIFER's windows: transforms, averages, the composite of lengths, and the errors of all.


def white(seed, samples=4000, noise=0.0):
    random = np.random.default_rng(seed)
    x = random.standard_normal(samples)
    return record(lat=x, p=lfilter([0.3], [1.0, -0.7], x) + noise * random.standard_normal(samples))


@pytest.mark.parametrize("others", [(), ("lon",)])
def test_inputs_that_follow_each_other_late_are_told_apart(others):
    """Gains without dynamics have no leakage: exact, however the inputs' cross spectrum turns."""
    random = np.random.default_rng(0)
    lat, own = random.standard_normal((2, 4000))
    lon = 0.8 * np.roll(lat, 5) + 0.5 * own
    flown = record(lat=lat, lon=lon, p=2.0 * lat + 3.0 * lon)
    spectra = win.cross_spectra([flown], ["lat", "lon", "p"], np.array([2.0, 5.0, 11.0]), 20.0)
    inputs = [name for name in ("lat", "lon") if name not in others]
    found = win.condition(spectra, inputs, ["p"], others)
    exact = np.array([2.0, 3.0])[: len(inputs), None]
    np.testing.assert_allclose((found.gxy / found.gxx)[0], exact + np.zeros(3), rtol=1e-9)


@tabled("durations", "band", "lengths")
def test_window_lengths_follow_the_published_rules(durations, band, lengths):
    """At most half a record and a fifth of all, at least 20 periods of the highest frequency."""
    assert win.window_lengths(durations, band) == pytest.approx(tuple(lengths), rel=1e-12)


def test_records_too_short_for_the_band_are_told_with_their_figures():
    with pytest.raises(IdentificationError) as raised:
        win.window_lengths([30.0, 40.0], (0.4, 20.0))
    for told in ("lasts 30 s", "together 70 s", "of 14 s", "from 0.4488 rad/s", "at 0.4 "):
        assert told in str(raised.value)


def test_composite_spectra_minimise_the_published_cost():
    """No general optimiser finds composite spectra of lower cost (Tischler and Remple, 11)."""
    frequency = np.geomspace(2.0, 20.0, 12)
    flown = [white(11, noise=0.2)]
    spectra = [win.cross_spectra(flown, ["lat", "p"], frequency, one) for one in (40.0, 25.0, 12.0)]
    each = [win.condition(one, ["lat"], ["p"]) for one in spectra]
    composed = win.compose(each)
    error = np.stack([win.random_error(one.coherence, one.averages) for one in each])[:, 0, 0]
    usable = np.stack([one.periods >= win.PERIODS for one in each])
    usable[0] = True
    weight = np.where(usable, (np.min(np.where(usable, error, np.inf), axis=0) / error) ** 4, 0.0)
    power = weight * np.stack([one.gxx[0, 0] for one in each])
    assert composed.share[:, 0, 0] == pytest.approx(power / power.sum(axis=0))
    for one, length in zip(each, (40.0, 25.0, 12.0)):
        assert one.periods == pytest.approx(frequency * length / (2.0 * np.pi))
    for k in range(frequency.size):
        numbers = [(one.gxx[0, 0, k], one.gyy[0, 0, k], one.gxy[0, 0, k]) for one in each]
        parts = np.array([(xx, yy, xy.real, xy.imag) for xx, yy, xy in numbers])
        start = weight[:, k] ** 2 @ parts / np.sum(weight[:, k] ** 2)
        g2 = (parts[:, 2] ** 2 + parts[:, 3] ** 2) / (parts[:, 0] * parts[:, 1])
        unit = np.maximum(np.abs(start), [0.0, 0.0, *[0.1 * np.hypot(*start[2:])] * 2])
        g2_unit = (start[2] ** 2 + start[3] ** 2) / (start[0] * start[1])

        def cost(z, parts=parts, g2=g2, unit=unit, g2_unit=g2_unit, w=weight[:, k]):
            x = z * unit
            own = (x[2] ** 2 + x[3] ** 2) / (x[0] * x[1])
            terms = np.sum(((x - parts) / unit) ** 2, axis=1) + 5.0 * ((own - g2) / g2_unit) ** 2
            return float(w @ terms)

        x = minimize(cost, start / unit, method="Nelder-Mead", tol=1e-12).x * unit
        # Nelder-Mead ends within 1e-6 of the minimum.
        assert composed.response[0, 0, k] == pytest.approx((x[2] + 1j * x[3]) / x[0], rel=1e-4)
        g2 = (x[2] ** 2 + x[3] ** 2) / (x[0] * x[1])
        assert composed.coherence[0, 0, k] == pytest.approx(g2, rel=1e-4)


def test_weighing_by_error_needs_records():
    exact = of_model(structures.yaw_base, YAW)
    by_coherence = identify(exact, structures.yaw_base, weighting="coherence")
    assert identify(exact, structures.yaw_base).values == by_coherence.values


# The identification's formulas a second time, in plain sums and loops.
#
# What differs is rounding, unless a test says otherwise.

GRID = np.geomspace(0.5, 25.0, 70)
ROLLPITCH = structures.rollpitch
TRUE = {
    **{"L_b": 536.0, "M_a": 313.0, "tau_f": 0.045, "A_b": 0.9, "B_a": -0.5, "A_lat": 0.1},
    **{"A_lon": -0.4, "B_lat": 0.2, "B_lon": 0.1, "tau_lat": 0.012, "tau_lon": -0.008},
}


def flight(seed, *, samples=900, step=0.02, names=("lat", "lon", "p")):
    random = np.random.default_rng(seed)
    columns = random.normal(size=(samples, len(names))).cumsum(axis=0) * 0.1
    return record(step, **dict(zip(names, columns.T)))


def test_cross_spectra_are_sums_over_windows():
    """Detrended, faded, Hann windows hanging over both ends, (2/T) mean of A B* / 0.375."""
    records, names = [flight(1), flight(2, samples=700)], ["lat", "p"]
    frequency, window = np.array([1.1, 3.0, 7.7]), 6.0
    found = win.cross_spectra(records, names, frequency, window)
    total, power, shared = 0.0, 0.0, 0.0
    for one in records:
        step, samples, length = one.sample_time, len(one), 300
        ramp = min(2.0 * math.pi / (frequency[0] * step), 0.05 * samples)
        ends = np.minimum(np.arange(samples), np.arange(samples)[::-1]) + 0.5
        fade = np.where(ends < ramp, np.sin(0.5 * np.pi * ends / ramp) ** 2, 1.0)
        signals = detrend(one.select(names), axis=0) * fade[:, None]
        hop = length * (1.0 - win.OVERLAP)
        count = math.ceil((samples + length - 2.0 * hop) / hop) + 1
        begins = [round(x) for x in np.linspace(hop - length, samples - hop, count)]
        windows = []
        for begin in begins:
            k = np.arange(max(begin, 0), min(begin + length, samples))
            hann = np.sin(np.pi * (k - begin) / length) ** 2
            turn = np.exp(-1j * np.outer(frequency, (k - begin) * step))
            sums = turn @ (signals[k] * hann[:, None]) * step
            total = total + sums[:, :, None] * sums[:, None, :].conj()
            full = np.zeros(samples)
            full[k] = hann * fade[k]
            windows.append(full)
        gram = np.array(windows) @ np.array(windows).T / (0.375 * length)
        power, shared = power + np.trace(gram), shared + np.sum(gram**2)
    # the windows' energy is summed at 512 instants instead of at the samples: 1 %
    assert found.averages == pytest.approx(power**2 / shared, rel=1e-2)
    assert found.matrix == pytest.approx(2.0 / (window * 0.375 * power) * total, rel=1e-2)
    ratio = found.matrix / total
    assert ratio == pytest.approx(np.full_like(ratio, ratio[0, 0, 0]), rel=1e-9)


def test_the_random_error_is_the_published_formula():
    """C_eps sqrt(1 - g2) / (|g| sqrt(2 n_d)) with C_eps^2 in the number of averages."""
    coherence = np.array([0.1, 0.6, 0.99])
    expected = np.sqrt((1.0 - coherence) / (2.0 * 7.3 * coherence))
    assert win.random_error(coherence, 7.3) == pytest.approx(expected, rel=1e-12)


@pytest.fixture(scope="module")
def frf():
    random = np.random.default_rng(3)
    records = []
    for _ in range(2):
        x = random.normal(size=(3000, 2))
        y = np.array([np.convolve(x[:, k], np.exp(-np.arange(60) / 15.0))[:3000] for k in (0, 1)])
        noise = 0.4 * random.normal(size=(3000, 2))
        p, q = y[0] + 0.3 * y[1] + noise[:, 0], y[1] - 0.2 * y[0] + noise[:, 1]
        records.append(record(0.02, lat=x[:, 0], lon=x[:, 1], p=p, q=q))
    return frequency_response(records, inputs=["lat", "lon"], outputs=["p", "q"], band=(1.0, 25.0))


def chosen(frf, count=20):
    return select(frf, ROLLPITCH, band=(2.0, 20.0), responses=None, count=count)


def test_points_are_the_nearest_to_log_spaced_ones(frf):
    points = chosen(frf)
    for number, name in enumerate(points.pairs):
        output, input_ = name.split("/")
        o, i = frf.outputs.index(output), frf.inputs.index(input_)
        usable = [
            k
            for k, w in enumerate(frf.frequency)
            if 2.0 <= w <= 20.0 and frf.coherence[o, i, k] >= 0.6
        ]
        place = np.log(frf.frequency[usable])
        targets = np.linspace(place[0], place[-1], 20)
        near = sorted({usable[int(np.argmin(np.abs(place - target)))] for target in targets})
        mine = points.pair == number
        assert points.frequency[mine] == pytest.approx(frf.frequency[near])
        assert points.measured[mine] == pytest.approx(frf.response[o, i, near])
        weight = 20.0 / len(near) * (1.58 * (1.0 - np.exp(-frf.coherence[o, i, near]))) ** 2
        assert points.weight[mine] == pytest.approx(weight)
        assert points.bands[number] == (frf.frequency[near[0]], frf.frequency[near[-1]])
        assert set(points.output[mine]) == {ROLLPITCH.outputs.index(output)}
        assert set(points.input[mine]) == {ROLLPITCH.inputs.index(input_)}


def vector(names):
    return np.array([TRUE.get(name, 0.1) for name in names])


def test_the_cost_is_its_formula_and_its_slopes_are_differences(frf):
    points = chosen(frf)
    cost = Cost(ROLLPITCH, points)
    names = [parameter.name for parameter in ROLLPITCH.free]
    x = vector(names)
    model = response(ROLLPITCH, dict(zip(names, x)), points.frequency)
    each = [model[o, i, k] for k, (o, i) in enumerate(zip(points.output, points.input))]
    z = np.array(each) / points.measured
    root = np.sqrt(points.weight)
    decibels, degrees = 20.0 * np.log10(np.abs(z)), np.rad2deg(np.angle(z))
    plain = np.concatenate([root * decibels, root * math.sqrt(0.01745) * degrees])
    assert cost.log(x, unwrap=False) == pytest.approx(plain, rel=1e-9)
    squares = root**2 * (decibels**2 + 0.01745 * degrees**2)
    by_response = [np.sum(squares[points.pair == k]) for k in range(len(points.pairs))]
    assert cost.per_response(x) == pytest.approx(by_response, rel=1e-9)
    scaled = 20.0 / math.log(10.0) * root * (z - 1.0)
    assert cost.relative(x) == pytest.approx([*scaled.real, *scaled.imag], rel=1e-9)
    spread = np.hypot(np.sqrt(0.5 * np.diagonal(points.covariance).real), 0.005)
    assert cost.spread == pytest.approx(spread, rel=1e-12)
    over = (z - 1.0) / spread
    assert cost.standardised(x) == pytest.approx([*over.real, *over.imag], rel=1e-9)
    for residual, jacobian in (
        (lambda x: cost.log(x, unwrap=False), cost.log_jacobian(x)),
        (cost.relative, cost.relative_jacobian(x)),
        (cost.standardised, cost.standardised_jacobian(x)),
    ):
        for k in range(x.size):
            shift = np.zeros(x.size)
            shift[k] = 1e-6 * max(abs(x[k]), 1e-2)
            slope = (residual(x + shift) - residual(x - shift)) / (2.0 * shift[k])
            # central differences: the square of the step, and rounding over the step
            assert jacobian[:, k] == pytest.approx(
                slope, rel=1e-5, abs=1e-6 * np.max(np.abs(slope))
            )


@pytest.mark.parametrize(("standardised", "exact"), [*np.ndindex(2, 2)])
def test_the_accuracy_is_its_formulas(frf, standardised, exact):
    points = chosen(frf)
    points = replace(points, gap=0.01 * np.exp(1j * np.add(points.frequency, [[0.0], [np.pi]])))
    x = vector([parameter.name for parameter in ROLLPITCH.free])
    cost = Cost(ROLLPITCH, points)
    if exact:
        cost = Cost(ROLLPITCH, replace(points, measured=points.measured * cost.ratio(x)[0]))
    found = accuracy(cost, x, standardised=standardised)
    inverse = np.linalg.inv(hessian := 2.0 * cost.log_jacobian(x).T @ cost.log_jacobian(x))
    root = np.sqrt(np.diag(inverse))
    # a condition number of up to 1e6, squared in H
    assert found.cramer_rao == pytest.approx(2.0 * root, rel=1e-6)
    assert found.insensitivity == pytest.approx(np.diag(hessian) ** -0.5, rel=1e-9)
    assert found.correlation == pytest.approx(inverse / np.outer(root, root), abs=1e-6)
    stacked = 0.5 * np.block([[(e := points.covariance).real, -e.imag], [e.imag, e.real]])
    if standardised:
        scale, jacobian = np.tile(1.0 / cost.spread, 2), cost.standardised_jacobian(x)
        residual = cost.standardised(x)
    else:
        weights = np.sqrt(points.weight) * 180.0 / np.pi * math.sqrt(0.01745)
        scale = np.concatenate([20.0 / math.log(10.0) * np.sqrt(points.weight), weights])
        jacobian, residual = cost.log_jacobian(x), cost.log(x, unwrap=False)
    covariance = scale[:, None] * stacked * scale
    gain = np.linalg.solve(jacobian.T @ jacobian, jacobian.T)
    left = np.eye(residual.size) - jacobian @ gain
    noise = left @ covariance @ left.T
    assert found.ratio == pytest.approx(residual @ residual / np.trace(noise), rel=1e-6)
    assert found.noise == pytest.approx(np.diag(noise) / scale**2, rel=1e-6)
    # what the structure leaves out is alike within half of ln(frequency) in a response
    apart = np.abs(np.subtract.outer(np.log(points.frequency), np.log(points.frequency)))
    near = np.exp(-apart / 0.5) * (points.pair[:, None] == points.pair)
    alike = scale[:, None] * np.kron(np.eye(2), near) * scale
    # its size as the residuals' power, of a chi square, and a half Cauchy of 0.5 % have it
    own, sizes = left @ alike @ left.T, np.geomspace(1e-8, 1e4, 8000)
    total, mean = residual @ residual, np.trace(noise) + sizes**2 * np.trace(own)
    every = noise + max(total - np.trace(noise), 0.0) / np.trace(own) * own
    freedom = np.trace(every) ** 2 / np.sum(every**2)
    likely = stats.chi2.logpdf(total * freedom / mean, freedom) - np.log(mean)
    likely += stats.halfcauchy.logpdf(sizes, scale=0.005) + np.log(sizes)
    square = np.average(sizes**2, weights=np.exp(likely - max(likely)))
    assert (square > 0.005**2) != exact  # x is no minimum
    structural = square * gain @ alike @ gain.T
    # rounding apart, the share of a half Cauchy below the least size that is tried
    assert found.structural == pytest.approx(np.sqrt(np.diag(structural)), rel=3e-4)
    moved = gain @ (scale * np.hstack([points.gap.real, points.gap.imag])).T
    errors = np.diag(gain @ covariance @ gain.T + structural) + np.sum(moved**2, axis=1)
    assert found.standard_error == pytest.approx(np.sqrt(errors), rel=3e-4)


def test_verification_figures_are_their_formulas():
    structure = structures.yaw_base
    fit = fitted(structure, YAW, GRID)
    names = (*structure.inputs, *structure.outputs)
    records = [flight(k, samples=400, names=names) for k in (7, 8)]
    late = FlightRecord(records[1].time + 5.0, records[1].values, records[1].channels)
    found = verify(fit, [records[0], late])
    centred = []
    for trace in found.traces:
        mean = trace.measured.mean(axis=0)
        centred.append((trace.measured - mean, trace.predicted - mean))
    measured, predicted = (np.concatenate(pair)[:, 0] for pair in zip(*centred))

    def rms(x):
        return math.sqrt(np.mean(x**2))

    theil = rms(measured - predicted) / (rms(measured) + rms(predicted))
    assert found.j_rms == pytest.approx(rms(measured - predicted), rel=1e-12)
    assert found.tic == pytest.approx(theil, rel=1e-12)
    assert dict(found.tic_by_output) == pytest.approx({"r": theil}, rel=1e-12)
    plain = found.to_dict()
    assert [one["duration_s"] for one in plain["records"]] == pytest.approx([7.98, 7.98])
    each = [rms(one.measured - one.predicted) for one in found.traces]
    assert [one["j_rms"]["r"] for one in plain["records"]] == pytest.approx(each, rel=1e-12)
    assert plain["outputs"][0]["unit"] == "rad/s"
    verdict = "acceptable" if theil <= 0.25 else "above 0.25"
    (overall,) = (line for line in str(found).splitlines() if line.startswith("all "))
    assert overall.split()[-len(verdict.split()) :] == verdict.split()
    own, quiet = (str(replace(found, quiet=some)).splitlines()[1] for some in ((), ("r",)))
    assert own.endswith("above 0.25") == (theil > 0.25)
    assert quiet.endswith("hardly moved")
    assert "hardly" not in own
