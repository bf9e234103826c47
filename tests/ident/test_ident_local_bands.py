"""Which bands the local method takes, where it looks for transients, and how weights are kept."""

import numpy as np
import pytest
from test_ident_local_restated import COUNT, SPACING, lines

from helisim.ident.local import (
    WIDTHS,
    Task,
    estimate_bands,
    transients,
)
from helisim.ident.scatter import LineWeights

FREQUENCY = np.geomspace(0.3, 6.0, 60)


def smooth(w):
    return np.array([[1.0, 0.5], [-0.3, 2.0]])[..., None] / (1.0 + 0.2j * w)


def task(made, *, active=()):
    return Task(made, [0, 1], [2, 3], list(active), 2, FREQUENCY)


def testtransients_are_estimated_where_they_are():
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
        enough = []
        for relative in WIDTHS:
            low, high = w * (1.0 - relative), w * (1.0 + relative)
            count = sum(
                sum(low - 1e-9 <= n * spacing <= high + 1e-9 for n in range(1, most))
                for spacing, most in zip(SPACING, COUNT)
            )
            enough.append(count >= 1.5 * (2 * 3 + 4))
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
        for one in used:
            for other in used:
                total = np.zeros(2)
                for flight in range(2):
                    kept = []
                    for width in (one, other):
                        first, value = bands.weights[k][width]
                        row = np.zeros((2, COUNT.max() + 99), dtype=complex)
                        begin = first[flight]
                        row[:, begin : begin + value.shape[2]] = value[:, flight]
                        kept.append(row)
                    total += np.real(np.sum(kept[0] * kept[1].conj(), axis=1))
                # weights are kept in single precision
                assert shared[one, other, :, k] == pytest.approx(total, rel=1e-4, abs=1e-7)
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
    inputs = made.values[:, :, :2] @ follow.T
    made = type(made)(
        ("LAT", "LON", "p", "q", "lat", "lon"),
        made.spacing,
        made.count,
        np.concatenate([made.values, inputs], axis=2),
    )
    bands = estimate_bands(Task(made, [0, 1], [2, 3], [4, 5], 2, FREQUENCY))
    for k in range(FREQUENCY.size):
        used = np.flatnonzero(bands.valid[:, k])
        assert np.allclose(bands.gain[used, :, :, k], vehicle, rtol=1e-6)
        assert bands.active_gain[k] == pytest.approx(follow, rel=1e-6)
        assert bands.full_gain[k] == pytest.approx(vehicle, rel=1e-6)


def test_weights_side_by_side_begin_at_the_first_line_of_any():
    """Each keeps its place; where one has no weight there is none."""
    one = np.array([3, 7]), np.full((1, 2, 2), 1.0 + 2.0j, dtype=np.complex64)
    two = np.array([2, 9]), np.full((1, 2, 3), 5.0, dtype=np.complex64)
    both = LineWeights.side_by_side([1, 4], [one, two])
    assert list(both.part) == [1, 4]
    assert list(both.first) == [2, 7]
    assert np.array_equal(both.value[0, 0, 0], [0.0, 1.0 + 2.0j, 1.0 + 2.0j, 0.0, 0.0])
    assert np.array_equal(both.value[0, 0, 1], [1.0 + 2.0j, 1.0 + 2.0j, 0.0, 0.0, 0.0])
    assert np.array_equal(both.value[1, 0, 0], [5.0, 5.0, 5.0, 0.0, 0.0])
    assert np.array_equal(both.value[1, 0, 1], [0.0, 0.0, 5.0, 5.0, 5.0])
