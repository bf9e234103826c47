"""The local method against closed forms, plain sums and many draws of a disturbance."""

import numpy as np
import pytest
from scipy.signal import freqz, lfilter

from helisim.ident import frequency_response
from helisim.ident.local import WIDTHS, Task, choose, estimate_bands, smoothed, transients
from helisim.ident.local_fit import Lines, fit_band, flight_lines
from helisim.ident.scatter import LineWeights, LocalScatter
from helisim.records.record import FlightRecord, channel

STEP = 0.05
LIGHT = np.poly(0.995 * np.exp([0.05j, -0.05j]))
"""Denominator of a mode at 1 rad/s with a damping of 0.1, in steps of 0.05 s."""


def record(step=STEP, **columns):
    values = np.stack(list(columns.values()), axis=1)
    return FlightRecord(np.arange(len(values)) * step, values, tuple(map(channel, columns)))


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


@pytest.mark.parametrize("seed", range(3))
def test_a_lightly_damped_mode_is_not_smeared(seed):
    """Half of its width is two lines; what is left is 0.1 % at most, where windows leave 30 %."""
    flights = [cut(10 * seed + k, [0.01], LIGHT) for k in range(2)]
    local = frequency_response(flights, estimator="local", **ASKED)
    windows = frequency_response(flights, estimator="windows", **ASKED)
    expected = truth([0.01], LIGHT, local.frequency)
    assert worst(local, expected) < 1e-3
    assert worst(windows, expected) > 0.2


def test_lengths_and_rates_of_flights_may_differ():
    """Each flight has lines of its own."""
    lat = np.random.default_rng(5).standard_normal(3000)
    p = lfilter([0.3], [1.0, -0.7], lat)
    flights = [record(lat=lat[:1300], p=p[:1300]), record(lat=lat[1300:], p=p[1300:])]
    frf = frequency_response(flights, estimator="local", **ASKED)
    assert worst(frf, truth([0.3], [1.0, -0.7], frf.frequency)) < 1e-3


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


@pytest.mark.parametrize("transient", [False, True])
@pytest.mark.parametrize("middle", MIDDLE)
def test_a_polynomial_response_comes_back_with_its_transients(middle, transient):
    """Order 2 in the logarithm, transients of 1/w, 1 and w of each flight: nothing is left."""
    random = np.random.default_rng(7)
    a = random.normal(size=(3, 2, 2)) + 1j * random.normal(size=(3, 2, 2))

    def start(flight, w):
        size = (flight + 1) * np.array([[3.0, -2.0j, 0.5], [1.0j, 4.0, -1.0]])
        return size @ np.stack([1.0 / w, np.ones_like(w), w])

    made = lines(
        lambda w: sum(a[k][..., None] * np.log(w / middle) ** k for k in range(3)),
        start if transient else None,
    )
    fit = fit_at(made, middle, transient)
    assert fit.fits.all()
    assert fit.gain[0] == pytest.approx(a[0], rel=1e-8)
    assert np.abs(fit.residual).max() < 1e-16 * np.abs(made.values).max() ** 2


def test_a_pole_in_the_band_comes_back():
    """1 / (1 - (w - w0) / p) beside a polynomial: a resonance narrower than the band."""
    place = 0.05 + 0.15j
    made = lines(lambda w: (np.eye(2) + 0.5)[..., None] / (1.0 - (w / 2.0 - 1.0) / place))
    # without the pole a polynomial of order 2 misses this by a quarter
    assert fit_at(made, 2.0, False).gain[0] == pytest.approx(np.eye(2) + 0.5, abs=1e-6)


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


def between(low, high):
    """Return the lines of each flight from `low` to `high`, ends included, the level never."""
    return [
        [n for n in range(1, most) if low - 1e-9 <= n * spacing <= high + 1e-9]
        for spacing, most in zip(SPACING, COUNT)
    ]


def test_lines_within_are_those_between():
    """Ends included, the level never."""
    low, high = np.array([0.0, 0.06, 7.5]), np.array([0.05, 1.0, 99.0])
    first, count = lines(lambda w: np.ones((2, 2, w.size))).within(low, high)
    for k in range(low.size):
        for flight, inside in enumerate(between(low[k], high[k])):
            assert count[k, flight] == len(inside)
            assert not inside or first[k, flight] == inside[0]


# Averages over neighbours and widths


def test_a_mean_over_neighbours_is_gaussian_in_the_logarithm():
    """A constant stays; one point's share falls as exp(-d^2/2); nothing counted gives zero."""
    frequency, spike, weight = np.geomspace(1.0, 10.0, 31), np.zeros(31), np.ones(31)
    assert smoothed(np.full(31, 4.2), frequency, weight, 0.2) == pytest.approx(np.full(31, 4.2))
    spike[15] = 1.0
    mean = smoothed(spike, frequency, weight, 0.2)
    d = np.subtract.outer(np.log(frequency), np.log(frequency)) / 0.2
    total = np.exp(-0.5 * d**2).sum(axis=1)
    assert mean[19] / mean[15] == pytest.approx(
        np.exp(-0.5 * d[15, 19] ** 2) * total[15] / total[19]
    )
    assert np.all(smoothed(spike, frequency, np.zeros(31), 0.2) == 0.0)


def chosen(bias, lowest=0, **more):
    """Return the choice between three widths with given biases, G = 2; the widest alone below."""
    variance, n_freq = [4e-4, 2e-4, 1e-4], 40
    gain = 2.0 + np.asarray(bias)[:, None, None, None] + np.zeros((3, 1, 1, n_freq), dtype=complex)
    # wider ones average the narrower one's lines too: cov = the wider's
    shared = np.minimum.outer(variance, variance)[:, :, None, None] * np.ones((1, 1, 1, n_freq))
    valid = np.ones((3, n_freq), dtype=bool)
    valid[:2, :lowest] = False
    widths, frequency = np.array([0.1, 0.2, 0.4]), np.geomspace(1.0, 8.0, n_freq)
    return choose(gain, shared, np.ones((1, n_freq)), valid, widths, frequency, **more)


def test_widths_count_by_variance_and_bias():
    """Shares go with the inverse squares of the variances; a biased width is left out.

    Squared gaps less their chance are squared biases; the narrowest's follows by the law.
    """
    choice = chosen([0.0, 0.0, 0.0])
    # 1 to 4 to 16, and the smallest share, 1/21, is below a twentieth and left out
    assert choice.share[:, 0, 0, 20] == pytest.approx([0.0, 0.2, 0.8])
    assert np.all(choice.bias == 0.0)
    choice = chosen([0.0, 0.0, 0.5])
    assert np.all(choice.share[2] == 0.0)
    assert choice.share[:2, 0, 0, 20] == pytest.approx([0.2, 0.8])
    choice = chosen([0.0, 0.3, 0.3])
    assert choice.share[0, 0, 0, 20] == 1.0
    # gap^2 - 1.5 (var_1 - var_2) of the first two: by half the chance it must be sure. Biases grow
    # with the width to the power 4, so the gap is b (1 - 2^-4), and the narrowest's b / 2^4
    surely = (0.09 - 1.5 * 2e-4) / (1.0 - 2.0**-4) ** 2
    assert choice.bias[0, 0, 20] ** 2 == pytest.approx(surely / 2.0**8, rel=1e-9)


def test_a_single_band_wider_than_its_frequency_is_not_to_be_trusted():
    """There is nothing to see its bias by, so it is stated as the response's own size, G = 2."""
    choice = chosen([0.0, 0.0, 0.0], lowest=5, widest=0.3)
    assert choice.bias[0, 0, :5] == pytest.approx(2.0)
    assert np.all(choice.bias[0, 0, 6:] == 0.0)
    assert np.all(chosen([0.0, 0.0, 0.0], lowest=5, widest=0.5).bias == 0.0)


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
                apart = np.log(one.frequency[w] / one.frequency[w2]) / 0.25
                total[k, m] += one.bias[o, i, w] * one.bias[o, i, w2] * np.exp(-0.5 * apart**2)
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


def test_a_band_has_lines_enough_and_four_widths_at_most():
    """1.5 lines for each of 6 coefficients and 4 more; the narrowest such and three wider ones.

    The widest of them reaches to the frequency itself at most.
    """
    bands = estimate_bands(task(lines(smooth, noise=0.3)))
    for k, w in enumerate(FREQUENCY):
        counts = [sum(map(len, between(w * (1.0 - x), w * (1.0 + x)))) for x in WIDTHS]
        enough = [count >= 1.5 * (2 * 3 + 4) for count in counts]
        first = enough.index(True)
        expected = [
            one and number < first + 4 and (number == first or WIDTHS[number] <= 1.0)
            for number, one in enumerate(enough)
        ]
        assert list(bands.valid[:, k]) == expected
        assert sorted(bands.weights[k]) == list(np.flatnonzero(bands.valid[:, k]))


def test_every_width_is_near_a_smooth_response_and_errs_as_its_weights_say():
    """Wider bands scatter less; what widths share is the product of their weights."""
    bands = estimate_bands(task(lines(smooth, noise=0.05, seed=4)))
    true, shared = smooth(FREQUENCY), bands.shared()
    for k in range(0, FREQUENCY.size, 7):
        used = np.flatnonzero(bands.valid[:, k])
        rows = np.zeros((used.size, 2, 2, COUNT.max() + 99), dtype=complex)
        for row, width in zip(rows, used):
            first, value = bands.weights[k][width]
            for flight, begin in enumerate(first):
                row[:, flight, begin : begin + value.shape[2]] = value[:, flight]
        total = np.real(np.einsum("aiel,biel->abi", rows, rows.conj()))
        # weights are in single precision
        assert shared[np.ix_(used, used, [0, 1], [k])][..., 0] == pytest.approx(
            total, rel=1e-4, abs=1e-7
        )
        own = shared[used, used, 0, k]
        assert np.all(np.diff(own) < 0.0)
        # five deviations of a complex number, or 2 % of a slope across the widest band
        allowed = 5.0 * 0.05 * np.sqrt(own)[:, None, None] + 0.02
        assert np.all(np.abs(bands.gain[used, :, :, k] - true[:, :, k]) < allowed)


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
