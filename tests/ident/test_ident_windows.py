"""CIFER's windows: transforms, averages, the composite of lengths, and the errors of all."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.signal import chirp, lfilter

from helisim.base.errors import IdentificationError
from helisim.ident import frequency_response, identify, structures
from helisim.ident.windows import (
    OVERLAP,
    PERIODS,
    compose,
    condition,
    cross_spectra,
    random_error,
    segment_starts,
    window_lengths,
)
from ident_data import YAW, of_model, record

STEP = 0.05


def white(seed, samples=4000, noise=0.0):
    random = np.random.default_rng(seed)
    x = random.standard_normal(samples)
    return record(lat=x, p=lfilter([0.3], [1.0, -0.7], x) + noise * random.standard_normal(samples))


@pytest.mark.parametrize(("samples", "length"), [(1000, 300), (1001, 500), (97, 31)])
def test_windows_reach_over_both_ends_evenly(samples, length):
    """No sample near an end of a record is fainter than those in the middle by half."""
    weight, starts = np.zeros(samples + 2 * length), segment_starts(samples, length)
    for start in starts + length:
        weight[start : start + length] += np.sin(np.pi * (np.arange(length) + 0.5) / length) ** 2
    weight = weight[length:-length]
    assert weight.min() > 0.5 * np.median(weight)
    assert np.diff(starts).max() <= np.ceil(length * (1.0 - OVERLAP))


def test_overlap_factor_is_the_published_one():
    """For a long record C_eps^2 = n_d / n_e is Hann's 0.481 at 75 %."""
    flown = white(0, samples=20000)
    spectra = cross_spectra([flown], ["lat"], np.array([2.0]), 50.0)
    # Windows over the ends and the fade into trim add up to one in twenty windows.
    assert (flown.duration / 50.0) / spectra.averages == pytest.approx(0.481, rel=0.05)


@pytest.mark.parametrize(
    ("durations", "band", "lengths"),
    [
        ([90.0, 90.0], (0.8, 45.0), np.linspace(36.0, 7.2, 5)),
        ([60.0, 80.0, 90.0], (1.0, 12.0), np.linspace(30.0, 20.0 * 2.0 * np.pi / 12.0, 5)),
        ([30.0], (1.1, 4.0), [6.0]),
        ([8.0 * np.pi] * 5, (0.5, 50.0), np.linspace(4.0 * np.pi, 0.8 * np.pi, 5)),
    ],
)
def test_window_lengths_follow_the_published_rules(durations, band, lengths):
    """At most half a record and a fifth of all, at least 20 periods of the highest frequency."""
    assert window_lengths(durations, band) == pytest.approx(tuple(lengths), rel=1e-12)


def test_records_too_short_for_the_band_are_told_with_their_figures():
    """What they last, the window that they allow, and the frequency that it resolves."""
    with pytest.raises(IdentificationError) as raised:
        window_lengths([30.0, 40.0], (0.4, 20.0))
    for told in ("lasts 30 s", "together 70 s", "of 14 s", "from 0.4488 rad/s", "at 0.4 "):
        assert told in str(raised.value)


def test_composite_spectra_minimise_the_published_cost():
    """No general optimiser finds composite spectra of lower cost (Tischler and Remple, 11)."""
    frequency = np.geomspace(2.0, 20.0, 12)
    flown = [white(11, noise=0.2)]
    spectra = [cross_spectra(flown, ["lat", "p"], frequency, one) for one in (40.0, 25.0, 12.0)]
    each = [condition(one, ["lat"], ["p"]) for one in spectra]
    composed = compose(each)
    error = np.stack([random_error(one.coherence, one.averages) for one in each])[:, 0, 0]
    usable = np.stack([one.periods >= PERIODS for one in each])
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


# The errors of a response and how they hang together, against many flights


def swept(seed, samples=2400):
    """Return a sweep seen through 0.3/(1 - 0.7/z) and a gain, with correlated coloured noise."""
    random = np.random.default_rng(seed)
    time = np.arange(samples) * STEP
    lat = chirp(time, 0.1, time[-1], 3.0, method="logarithmic")
    shared, own = random.standard_normal((2, samples))
    slow = lfilter([0.3], [1.0, -0.8], shared)
    p = lfilter([0.3], [1.0, -0.7], lat) + 0.3 * slow
    return record(lat=lat, p=p, q=0.5 * lat + 0.3 * slow + 0.1 * own)


@pytest.mark.study
@pytest.mark.parametrize("estimator", ["windows", "local"])
def test_stated_covariance_is_that_of_many_flights(estimator):
    """Variances and correlations of a sweep's response are as stated.

    The outputs share a disturbance, and neighbouring frequencies share lines. Of the random part,
    that is: what scatters between flights; a bias does not.
    """
    found, stated = [], []
    asked = {"inputs": "lat", "outputs": ("p", "q"), "band": (2.0, 12.0), "estimator": estimator}
    for seed in range(150):
        frf = frequency_response(swept(seed), **asked)
        index = np.arange(0, frf.frequency.size, 4)
        found.append(frf.response[:, 0, index].ravel())
        if seed < 20:
            outputs = np.repeat([0, 1], index.size)
            at = (outputs, np.zeros_like(outputs), np.tile(index, 2))
            none = np.zeros(frf.response.shape)
            more = {"spread": none} if estimator == "local" else {}
            random = replace(frf.scatter, bias=none, **more)
            stated.append(random.covariance(*at))
    expected, measured = np.mean(stated, axis=0), np.cov(np.array(found).T)
    size = np.sqrt(np.diagonal(measured).real)
    ratio = np.sqrt(np.diagonal(expected).real) / size
    # 150 replicates at some 8 independent frequencies of two related outputs: 3 %.
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.1)
    np.testing.assert_allclose(ratio, 1.0, atol=0.3)
    gap = np.abs(expected - measured) / np.outer(size, size)
    # A correlation of 150 replicates is known to 0.08; the largest of 400 to some 0.25.
    assert np.mean(gap) < 0.12
    assert np.max(gap) < 0.4


def test_weighing_by_error_needs_records():
    """A response without records is fitted by J."""
    exact = of_model(structures.yaw_base, YAW)
    by_coherence = identify(exact, structures.yaw_base, weighting="coherence")
    assert identify(exact, structures.yaw_base).values == by_coherence.values
