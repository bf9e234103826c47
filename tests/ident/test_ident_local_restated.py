"""The local method's parts against closed forms, plain sums and many draws of a disturbance."""

import numpy as np
import pytest

from helisim.ident.local import choose, smoothed
from helisim.ident.local_fit import Lines, fit_band, flight_lines
from helisim.ident.scatter import LineWeights, LocalScatter
from helisim.records.channels import channel
from helisim.records.record import FlightRecord

SPACING = np.array([0.02, 0.027])
COUNT = np.array([400, 310])
NAMES = ("lat", "lon", "p", "q")
MIDDLE = np.array([1.0, 2.3, 4.0])
HALF = 0.4 * MIDDLE


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
    return Lines(NAMES, SPACING, COUNT, values)


def polynomial(middle):
    """Return a response that is of order 2 in ln(w / middle), and its value there."""
    random = np.random.default_rng(7)
    a = random.normal(size=(3, 2, 2)) + 1j * random.normal(size=(3, 2, 2))
    return (lambda w: sum(a[k][..., None] * np.log(w / middle) ** k for k in range(3))), a[0]


@pytest.mark.parametrize("transient", [False, True])
def test_a_polynomial_response_comes_back_with_its_transients(transient):
    """Order 2 in the logarithm, transients of 1/w, 1 and w of each flight: nothing is left."""
    for middle in MIDDLE:
        response, value = polynomial(middle)

        def start(flight, w, middle=middle):
            terms = np.stack([1.0 / w, np.ones_like(w), w])
            size = (flight + 1) * np.array([[3.0, -2.0j, 0.5], [1.0j, 4.0, -1.0]])
            return size @ terms

        made = lines(response, start if transient else None)
        fit = fit_band(
            made, [0, 1], [2, 3], np.array([middle]), np.array([0.4 * middle]), transient=transient
        )
        assert fit.fits.all()
        assert fit.gain[0] == pytest.approx(value, rel=1e-8)
        assert np.abs(fit.residual).max() < 1e-16 * np.abs(made.values).max() ** 2


def test_a_pole_in_the_band_comes_back():
    """1 / (1 - (w - w0) / p) beside a polynomial: a resonance narrower than the band."""
    middle, place = 2.0, 0.05 + 0.15j
    made = lines(lambda w: (np.eye(2) + 0.5)[..., None] / (1.0 - (w - middle) / (place * middle)))
    fit = fit_band(
        made, [0, 1], [2, 3], np.array([middle]), np.array([0.4 * middle]), transient=False
    )
    # without the pole a polynomial of order 2 misses this by a quarter
    assert fit.gain[0] == pytest.approx(np.eye(2) + 0.5, abs=1e-6)


def test_the_gain_is_its_weights_sum_and_errs_as_they_say():
    """E of a residual's spectrum is the disturbance's, E|dG|^2 is the weights' sum of squares."""
    response, noise = (lambda w: np.ones((2, 2, w.size))), 0.3
    gaps, stated, left, freedom = [], [], [], []
    for seed in range(60):
        made = lines(response, noise=noise, seed=seed)
        fit = fit_band(made, [0, 1], [2, 3], MIDDLE, HALF, transient=True)
        for k in range(MIDDLE.size):
            total = np.zeros((2, 2), dtype=complex)
            for flight in range(2):
                at = fit.first[k, flight] + np.arange(fit.weight.shape[3])
                inside = at < COUNT[flight]
                own = made.values[flight, at[inside], 2:]
                total += own.T @ fit.weight[k, :, flight, inside]
            # a pole, where one is found by chance, isn't linear in the lines
            if np.allclose(total, fit.gain[k], rtol=1e-9):
                gaps.append(np.abs(fit.gain[k] - 1.0) ** 2 / noise**2)
                stated.append(
                    np.sum(np.abs(fit.weight[k]) ** 2, axis=(1, 2))[None, :] + np.zeros((2, 1))
                )
                left.append(np.real(np.diagonal(fit.residual[k])) / noise**2)
                freedom.append(fit.freedom[k])
    assert len(gaps) > 0.8 * 60 * MIDDLE.size
    # means of about 170 x 4 squares of complex normal numbers: scatter by 4 %, four of them
    assert np.mean(gaps) / np.mean(stated) == pytest.approx(1.0, abs=0.16)
    # each is a mean over `freedom` lines
    assert np.mean(left) == pytest.approx(1.0, abs=4.0 / np.sqrt(2.0 * np.sum(freedom)))


def test_a_records_lines_hold_its_power():
    """Parseval: the one-sided spectrum's integral, over Hz, is the mean square less the level's."""
    random = np.random.default_rng(3)
    records = [
        FlightRecord(
            step * np.arange(samples),
            5.0 + random.normal(size=(samples, 2)),
            (channel("lat"), channel("p")),
        )
        for samples, step in ((401, 0.02), (300, 0.05))
    ]
    highest = np.pi / 0.02
    found = flight_lines(records, ("p", "lat"), highest)
    for flight, record in enumerate(records):
        samples = len(record)
        assert found.spacing[flight] == pytest.approx(2.0 * np.pi / (samples * record.sample_time))
        hertz = found.spacing[flight] / (2.0 * np.pi)
        power = np.sum(np.abs(found.values[flight]) ** 2, axis=0) * hertz
        centred = record.select(("p", "lat"))
        centred = centred - centred.mean(axis=0)
        if samples % 2 == 0:  # the line at half the rate is left out
            alternating = (-1.0) ** np.arange(samples)
            centred = centred - np.outer(alternating, alternating @ centred) / samples
        assert power == pytest.approx(np.mean(centred**2, axis=0), rel=1e-9)
        assert np.all(found.values[flight, found.count[flight] :] == 0.0)


def test_lines_within_are_those_between():
    """Ends included, the level never."""
    made = lines(lambda w: np.ones((2, 2, w.size)))
    low, high = np.array([0.0, 0.06, 7.5]), np.array([0.05, 1.0, 99.0])
    first, count = made.within(low, high)
    for k in range(low.size):
        for flight, (spacing, most) in enumerate(zip(SPACING, COUNT)):
            inside = [n for n in range(1, most) if low[k] - 1e-9 <= n * spacing <= high[k] + 1e-9]
            assert count[k, flight] == len(inside)
            if inside:
                assert first[k, flight] == inside[0]


def test_a_mean_over_neighbours_is_gaussian_in_the_logarithm():
    """A constant stays; one point's share falls as exp(-d^2/2); nothing counted gives zero."""
    frequency = np.geomspace(1.0, 10.0, 31)
    weight = np.ones(31)
    assert smoothed(np.full(31, 4.2), frequency, weight, 0.2) == pytest.approx(np.full(31, 4.2))
    spike = np.zeros(31)
    spike[15] = 1.0
    mean = smoothed(spike, frequency, weight, 0.2)
    ratio = mean[15 + 4] / mean[15]
    d = np.log(frequency[19] / frequency[15]) / 0.2
    kernel = np.exp(-0.5 * (np.subtract.outer(np.log(frequency), np.log(frequency)) / 0.2) ** 2)
    assert ratio == pytest.approx(np.exp(-0.5 * d**2) * kernel[15].sum() / kernel[19].sum())
    assert np.all(smoothed(spike, frequency, np.zeros(31), 0.2) == 0.0)


def widths_of(bias, variance, n_freq=40, seed=None):
    """Return what `choose` takes for three widths with given bias and variance, G = 2."""
    frequency = np.geomspace(1.0, 8.0, n_freq)
    gain = 2.0 + np.asarray(bias)[:, None, None, None] + np.zeros((3, 1, 1, n_freq), dtype=complex)
    shared = np.zeros((3, 3, 1, n_freq))
    for a in range(3):  # wider ones average the narrower one's lines too: cov = the wider's
        for b in range(3):
            shared[a, b] = min(variance[a], variance[b])
    return (
        gain, shared, np.ones((1, n_freq)), np.ones((3, n_freq), dtype=bool),
        np.array([0.1, 0.2, 0.4]), frequency,
    )  # fmt: skip


def test_without_bias_widths_count_by_their_variance():
    """Shares go with the inverse squares of the variances, 16 to 4 to 1; no bias is stated."""
    choice = choose(*widths_of([0.0, 0.0, 0.0], [4e-4, 2e-4, 1e-4]))
    # the smallest share, 1/21, is below a twentieth and left out
    assert choice.share[:, 0, 0, 20] == pytest.approx([0.0, 0.2, 0.8])
    assert np.all(choice.bias == 0.0)


def test_a_biased_width_is_left_out_and_its_bias_is_known():
    """Squared gaps less their chance are squared biases; the narrowest's follows by the law."""
    choice = choose(*widths_of([0.0, 0.0, 0.5], [4e-4, 2e-4, 1e-4]))
    assert np.all(choice.share[2] == 0.0)
    assert choice.share[:2, 0, 0, 20] == pytest.approx([0.2, 0.8])
    choice = choose(*widths_of([0.0, 0.3, 0.3], [4e-4, 2e-4, 1e-4]))
    assert choice.share[0, 0, 0, 20] == 1.0
    # gap^2 - 1.5 (var_1 - var_2) of the first two: by half the chance it must be sure. Biases grow
    # with the width to the power 4, so the gap is b (1 - 2^-4), and the narrowest's b / 2^4
    surely = (0.09 - 1.5 * 2e-4) / (1.0 - 2.0**-4) ** 2
    assert choice.bias[0, 0, 20] ** 2 == pytest.approx(surely / 2.0**8, rel=1e-9)


def test_a_single_band_wider_than_its_frequency_is_not_to_be_trusted():
    """There is nothing to see its bias by, so it is stated as the response's own size, G = 2."""
    given = widths_of([0.0, 0.0, 0.0], [4e-4, 2e-4, 1e-4])
    valid = given[3].copy()
    valid[:2, :5] = False  # at the lowest frequencies only the widest has lines enough
    choice = choose(*given[:3], valid, *given[4:], widest=0.3)
    assert choice.bias[0, 0, :5] == pytest.approx(2.0)
    assert np.all(choice.bias[0, 0, 6:] == 0.0)
    trusted = choose(*given[:3], valid, *given[4:], widest=0.5)
    assert np.all(trusted.bias == 0.0)


def scatter(seed):
    """Return an error model of two parts, three outputs, two inputs and two flights."""
    random = np.random.default_rng(seed)
    frequency = np.array([1.0, 1.3, 2.0, 4.5])
    root = random.normal(size=(4, 3, 3)) + 1j * random.normal(size=(4, 3, 3))
    weights = []
    for k in range(4):
        length = 3 + k
        value = random.normal(size=(2, 2, 2, length)) + 1j * random.normal(size=(2, 2, 2, length))
        # any two frequencies share lines, of one flight or of both
        first = np.array([[1, 2], [9, 3], [5, 4], [2, 6]][k], dtype=np.intp)
        weights.append(LineWeights(np.arange(len(value)), first, value.astype(np.complex64)))
    return LocalScatter(
        frequency=frequency,
        weights=tuple(weights),
        share=random.uniform(size=(2, 3, 2, 4)),
        noise=root @ root.conj().swapaxes(1, 2),
        bias=random.uniform(size=(3, 2, 4)),
        spread=np.zeros((3, 2, 4)),
    )


def line_weights(one, o, i, w):
    """Return by what a point takes the lines, as a dictionary of flight and line."""
    found = {}
    for part in range(one.share.shape[0]):
        value = one.weights[w].value[part, i] * one.share[part, o, i, w]
        for flight in range(value.shape[0]):
            for k, number in enumerate(value[flight]):
                place = (flight, int(one.weights[w].first[flight]) + k)
                found[place] = found.get(place, 0.0) + complex(number)
    return found


def hermitian_root(matrix):
    value, vector = np.linalg.eigh(matrix)
    return (vector * np.sqrt(value)) @ vector.conj().T


POINTS = [(o, i, w) for w in (0, 1, 2, 3) for o in (0, 2) for i in (0, 1)]


def expected_covariance(weights_of, one):
    total = np.zeros((len(POINTS), len(POINTS)), dtype=complex)
    roots = [hermitian_root(matrix) for matrix in one.noise]
    for k, (o, i, w) in enumerate(POINTS):
        for m, (o2, i2, w2) in enumerate(POINTS):
            left, right = weights_of(o, i, w), weights_of(o2, i2, w2)
            shared = sum(left[at] * np.conj(right[at]) for at in left.keys() & right.keys())
            total[k, m] = shared * (roots[w] @ roots[w2])[o, o2]
            if (o, i) == (o2, i2):
                apart = np.log(one.frequency[w] / one.frequency[w2]) / 0.25
                total[k, m] += one.bias[o, i, w] * one.bias[o, i, w2] * np.exp(-0.5 * apart**2)
    return total


def test_the_covariance_is_the_sum_over_common_lines():
    """Weight times conjugate weight times the disturbance's spectrum, and the bias that is left."""
    one = scatter(1)
    o, i, w = np.array(POINTS).T
    expected = expected_covariance(lambda *at: line_weights(one, *at), one)
    assert one.covariance(o, i, w) == pytest.approx(
        expected, rel=1e-5, abs=1e-5
    )  # single precision
    assert one.variance(o, i, w) == pytest.approx(np.real(np.diagonal(expected)), rel=1e-5)


def test_the_scatter_of_a_difference_has_the_difference_of_the_weights():
    """Common lines cancel; biases add in squares."""
    one, other = scatter(2), scatter(3)
    both = one.minus(other)
    o, i, w = np.array(POINTS).T

    def difference(*at):
        mine, theirs = line_weights(one, *at), line_weights(other, *at)
        return {k: mine.get(k, 0.0) - theirs.get(k, 0.0) for k in mine.keys() | theirs.keys()}

    assert both.bias == pytest.approx(np.sqrt(one.bias**2 + other.bias**2))
    expected = np.real(np.diagonal(expected_covariance(difference, both)))
    assert both.variance(o, i, w) == pytest.approx(expected, rel=1e-5)
    assert np.allclose(one.minus(one).variance(o, i, w), 2.0 * one.bias[o, i, w] ** 2, atol=1e-4)
