"""The local method against closed forms, plain sums and many draws of a disturbance."""

import numpy as np
import pytest
from scipy.signal import freqz, lfilter

from helisim.ident import frequency_response
from helisim.ident.local import Task, estimate_bands, transients
from helisim.ident.local_fit import Lines, fit_band, flight_lines
from helisim.ident.scatter import LineWeights, LocalScatter
from ident_data import record

STEP = 0.05
LIGHT = np.poly(0.995 * np.exp([0.05j, -0.05j]))
"""Denominator of a mode at 1 rad/s with a damping of 0.1, in steps of 0.05 s."""


def truth(b, a, frequency):
    return freqz(b, a, frequency * STEP)[1]


def cut(seed, b, a, samples=2400):
    """Return a filter's motion under white noise, cut out in full swing at both ends."""
    lat = np.random.default_rng(seed).standard_normal(samples + 500)
    return record(lat=lat[500:], p=lfilter(b, a, lat)[500:])


def worst(frf, expected):
    return np.max(np.abs(frf.response[0, 0] / expected - 1.0))


ASKED = {"inputs": "lat", "outputs": "p", "band": (0.5, 20.0)}


def test_a_gain_comes_back_to_rounding():
    """A response that is a polynomial of order 0, with a transient of none."""
    lat = np.random.default_rng(0).standard_normal(2400)
    frf = frequency_response(record(lat=lat, p=-3.0 * lat), estimator="local", **ASKED)
    np.testing.assert_allclose(frf.response[0, 0], -3.0, rtol=1e-10)
    assert frf.estimator == "local"
    assert frf.windows == ()
    assert np.all(frf.coherence > 0.999999)


def test_a_lightly_damped_mode_is_not_smeared():
    """Half of its width is two lines; what is left is 0.1 % at most, where windows leave 30 %."""
    flights = [cut(k, [0.01], LIGHT) for k in range(2)]
    local = frequency_response(flights, estimator="local", **ASKED)
    windows = frequency_response(flights, estimator="windows", **ASKED)
    expected = truth([0.01], LIGHT, local.frequency)
    assert worst(local, expected) < 1e-3
    assert worst(windows, expected) > 0.2


def unstable(seed, disturbance=0.0, samples=2400):
    """Return r = 1.02 r + 0.1 ped + v one sample ago, held by ped = PED - r, v white."""
    random = np.random.default_rng(seed)
    stick, v = random.standard_normal(samples), disturbance * random.standard_normal(samples)
    r, ped = np.zeros(samples), np.zeros(samples)
    for k in range(samples):
        if k:
            r[k] = 1.02 * r[k - 1] + 0.1 * ped[k - 1] + v[k - 1]
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
        samples = len(one)
        assert found.spacing[flight] == pytest.approx(2.0 * np.pi / (samples * one.sample_time))
        hertz = found.spacing[flight] / (2.0 * np.pi)
        power = np.sum(np.abs(found.values[flight]) ** 2, axis=0) * hertz
        centred = one.select(("p", "lat"))
        centred = centred - centred.mean(axis=0)
        if samples % 2 == 0:  # the line at half the rate is left out
            alternating = (-1.0) ** np.arange(samples)
            centred = centred - np.outer(alternating, alternating @ centred) / samples
        assert power == pytest.approx(np.mean(centred**2, axis=0), rel=1e-9)
        assert np.all(found.values[flight, found.count[flight] :] == 0.0)


# The error model


def scatter(seed):
    """Return an error model of two parts, three outputs, two inputs and two flights."""
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
    """Common lines cancel; biases and spreads add in squares."""
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
    """Of seven times the disturbance below 1.2 rad/s, none above; and none in trimmed flights."""

    def early(flight, w):
        return np.where(w < 1.2, 2.0, 0.0) * np.array([[1.0], [-1.0j]]) * (1.0 + flight)

    found = transients(task(lines(smooth, early, noise=0.3)))
    assert np.all(found[FREQUENCY < 0.8])
    assert not np.any(found[FREQUENCY > 4.0])
    assert not np.any(transients(task(lines(smooth, noise=0.3))))


def test_with_references_responses_are_ratios():
    """Inputs that follow the references by R, outputs by H R: their ratio is H."""
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
