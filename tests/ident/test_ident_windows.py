"""CIFER's windows: transforms, averages, the composite of lengths, and the errors of all."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.signal import ZoomFFT, chirp, lfilter

from helisim.base.errors import IdentificationError, InputError
from helisim.base.units import without_trend
from helisim.ident import FrequencyResponse, frequency_response, identify, structures
from helisim.ident.composite import PERIODS, compose, window_lengths
from helisim.ident.conditioning import condition, random_error
from helisim.ident.cost import Cost, select
from helisim.ident.evaluate import response
from helisim.ident.scatter import hann_lobe
from helisim.ident.spectra import cross_spectra, segment_starts
from helisim.records.record import FlightRecord, channel

STEP = 0.05


def record(**columns):
    values = np.stack(list(columns.values()), axis=1)
    return FlightRecord(np.arange(len(values)) * STEP, values, tuple(map(channel, columns)))


def white(seed, samples=4000, noise=0.0):
    random = np.random.default_rng(seed)
    x = random.standard_normal(samples)
    return record(lat=x, p=lfilter([0.3], [1.0, -0.7], x) + noise * random.standard_normal(samples))


def test_a_transform_is_the_chirp_z_transform():
    """Of each window, at the same frequencies as scipy's; ends of a record are faded."""
    hertz = np.linspace(0.1, 5.0, 40)
    signal = np.random.default_rng(1).standard_normal(2000)
    (found,) = cross_spectra(
        [record(lat=signal)], ["lat"], 2.0 * np.pi * hertz, windows=[333 * STEP], overlap=0.75
    )
    zoom = ZoomFFT(333, [0.1, 5.0], m=40, fs=1.0 / STEP, endpoint=True)
    hann = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(333) / 333)
    level = without_trend(signal[:, None])[:, 0]
    begins = np.rint(found.start / STEP).astype(int)
    inside = np.flatnonzero((begins >= 100) & (begins + 333 <= 1900))
    assert inside.size > 10
    for k in inside:
        expected = STEP * zoom(hann * level[begins[k] : begins[k] + 333])
        # rounding only: both sum 333 terms of order 0.05
        np.testing.assert_allclose(found.transforms[:, 0, k], expected, atol=1e-12)


def test_white_noise_has_its_known_level():
    """The one-sided spectrum of unit white noise is 2 dt at every frequency."""
    records = [white(seed) for seed in range(8)]
    frequency = np.geomspace(2.0, 30.0, 60)
    (spectra,) = cross_spectra(records, ["lat"], frequency, windows=[10.0], overlap=0.75)
    # 8 records of 20 windows average 300 independent ones: 6 % a frequency, 1.5 % together.
    assert np.mean(np.real(spectra.matrix[:, 0, 0])) == pytest.approx(2.0 * STEP, rel=0.05)


@pytest.mark.parametrize(("samples", "length"), [(1000, 300), (1001, 500), (97, 31)])
@pytest.mark.parametrize("overlap", [0.0, 0.5, 0.75, 0.8])
def test_windows_reach_over_both_ends_evenly(samples, length, overlap):
    """No sample near an end of a record is fainter than those in the middle by half."""
    weight, starts = np.zeros(samples + 2 * length), segment_starts(samples, length, overlap)
    for start in starts + length:
        weight[start : start + length] += np.sin(np.pi * (np.arange(length) + 0.5) / length) ** 2
    weight = weight[length:-length]
    assert overlap < 0.5 or weight.min() > 0.5 * np.median(weight)
    assert np.diff(starts).max() <= np.ceil(length * (1.0 - overlap))


def test_no_window_crosses_a_join():
    """Two records average like two records, whatever offset the second one starts from."""
    first, second = white(1), white(2)
    shifted = replace(second, values=second.values + 100.0)
    frequency = np.geomspace(1.0, 20.0, 30)
    (plain,), (moved,) = (
        cross_spectra([first, other], ["lat", "p"], frequency, windows=[8.0], overlap=0.75)
        for other in (second, shifted)
    )
    # Detrending removes the offset to rounding, 1e-16 of 100.
    np.testing.assert_allclose(moved.matrix, plain.matrix, rtol=1e-8, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("overlap", [0.0, 0.5, 0.8])
def test_random_error_matches_monte_carlo(overlap):
    """The stated random error is the scatter of the magnitude over many flights."""
    gains, stated = [], []
    for seed in range(60):
        flown = white(seed, samples=2400, noise=0.5)
        frf = frequency_response(
            flown, inputs="lat", outputs="p", band=(2.0, 12.0), windows=8.0, overlap=overlap
        )
        gains.append(np.abs(frf.response[0, 0]))
        # The formula with the true coherence: |H|^2 / (|H|^2 + noise), known here.
        power = np.abs(0.3 / (1.0 - 0.7 * np.exp(-1j * frf.frequency * STEP))) ** 2
        (spectra,) = cross_spectra(
            [white(seed, samples=2400)], ["lat"], frf.frequency, windows=[8.0], overlap=overlap
        )
        stated.append(random_error(power / (power + 0.25), spectra.averages))
    scatter = np.std(gains, axis=0) / np.mean(gains, axis=0)
    # 60 replicates at about 10 independent frequencies know the scatter to 3 %.
    assert np.mean(scatter) == pytest.approx(np.mean(stated), rel=0.1)


@pytest.mark.parametrize(("overlap", "factor"), [(0.5, 0.528), (0.75, 0.481)])
def test_overlap_factor_is_the_published_one(overlap, factor):
    """For a long record C_eps^2 = n_d / n_e is Hann's 0.528 at 50 % and 0.481 at 75 %."""
    flown = white(0, samples=20000)
    (spectra,) = cross_spectra([flown], ["lat"], np.array([2.0]), windows=[50.0], overlap=overlap)
    # Windows over the ends and the fade into trim add up to one in twenty windows.
    assert (flown.duration / 50.0) / spectra.averages == pytest.approx(factor, rel=0.05)


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


def test_a_short_window_takes_part_from_six_periods_upwards():
    """Below, its main lobe, two bins either way, is a third of the frequency itself and more.

    The longest window serves all frequencies, so that none is left without an estimate.
    """
    columns = np.random.default_rng(4).normal(size=(2400, 2))
    flown = record(lat=columns[:, 0], p=columns[:, 1] + columns[:, 0])
    band, windows = (2.0 * np.pi / 40.0, 12.0), (40.0, 20.0, 10.0)
    frf = frequency_response([flown] * 2, inputs="lat", outputs="p", band=band, windows=windows)
    for one in frf.scatter.windows:
        periods = one.length * frf.frequency / (2.0 * np.pi)
        expected = (periods >= 6.0) | (one.length == 40.0)
        assert np.array_equal(one.share[0, 0] > 0.0, expected)


def test_composite_spectra_minimise_the_published_cost():
    """No general optimiser finds composite spectra of lower cost (Tischler and Remple, 11)."""
    frequency = np.geomspace(2.0, 20.0, 12)
    spectra = cross_spectra(
        [white(11, noise=0.2)], ["lat", "p"], frequency, windows=(40.0, 25.0, 12.0), overlap=0.75
    )
    each = [condition(one, ["lat"], ["p"], [], None) for one in spectra]
    composed = compose(each)
    error = np.stack([random_error(one.coherence, one.averages) for one in each])[:, 0, 0]
    usable = np.stack([one.periods >= PERIODS for one in each])
    usable[0] = True
    weight = np.where(usable, (np.min(np.where(usable, error, np.inf), axis=0) / error) ** 4, 0.0)
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


@pytest.mark.slow
@pytest.mark.parametrize(
    ("estimator", "windows", "overlap"),
    [
        ("windows", 12.0, 0.5),
        ("windows", 12.0, 0.75),
        ("windows", None, 0.8),
        ("local", None, 0.75),
    ],
)
def test_stated_covariance_is_that_of_many_flights(estimator, windows, overlap):
    """Variances and correlations of a sweep's response are as stated, composite included.

    The sweep passes each frequency once, so averages over its windows say nothing of its error;
    the outputs share a disturbance, and neighbouring frequencies share windows or lines. Of the
    random part, that is: what scatters between flights; a bias does not.
    """
    found, stated = [], []
    asked = {"inputs": "lat", "outputs": ("p", "q"), "band": (2.0, 12.0), "estimator": estimator}
    for seed in range(150):
        frf = frequency_response(swept(seed), windows=windows, overlap=overlap, **asked)
        index = np.arange(0, frf.frequency.size, 4)
        found.append(frf.response[:, 0, index].ravel())
        if seed < 20:
            outputs = np.repeat([0, 1], index.size)
            at = (outputs, np.zeros_like(outputs), np.tile(index, 2))
            none = np.zeros(frf.response.shape)
            more = {"spread": none} if estimator == "local" else {}
            random = replace(frf.scatter, bias=none, **more)
            stated.append(random.covariance(*at))
            # local weights are kept in single precision
            np.testing.assert_allclose(
                random.variance(*at), np.diagonal(stated[-1]).real, rtol=1e-5
            )
            assert np.all(frf.scatter.variance(*at) >= random.variance(*at))
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
    """A response without records is fitted by J; asking for its points' errors is refused."""
    values, grid = {"N_r": -0.7, "N_ped": 50.0, "tau_r_base": 0.04}, np.geomspace(0.5, 20.0, 60)
    exact = FrequencyResponse.exact(
        grid, response(structures.yaw_base, values, grid), inputs=["ped"], outputs=["r"]
    )
    by_coherence = identify(exact, structures.yaw_base, weighting="coherence")
    assert identify(exact, structures.yaw_base).values == by_coherence.values
    points = select(exact, structures.yaw_base, band=None, responses=None, count=20)
    with pytest.raises(IdentificationError, match="not estimated from records"):
        _ = Cost(structures.yaw_base, points).spread
    with pytest.raises(InputError, match="expected 'error' or 'coherence'"):
        identify(exact, structures.yaw_base, weighting="cifer")


def test_the_interval_is_1_96_standard_errors_either_way():
    """A parameter's interval follows from its standard error."""
    frf = frequency_response(swept(0), inputs="lat", outputs="q", band=(2.0, 12.0))
    fit = identify(frf, structures.first_order_delay(input="lat", output="q"), searches=2)
    one = next(iter(fit.parameters.values()))
    assert np.diff(one.interval)[0] == pytest.approx(2.0 * 1.96 * one.standard_error)


def test_the_windows_lobe_holds_its_power():
    """Parseval: the integral of |W|^2 over w is 2 pi 3/8 T, of which 0.0014 % is further out.

    At its middle a Hann window's transform is its area T/2, one bin away half of that.
    """
    length = 7.0
    offset = np.linspace(-8.0, 8.0, 40001) * 2.0 * np.pi / length
    lobe = hann_lobe(offset, length)
    held = np.sum(lobe**2) * (offset[1] - offset[0]) / (2.0 * np.pi * 0.375 * length)
    assert 1.0 - held == pytest.approx(1.4e-5, abs=0.1e-5)
    bins = hann_lobe(np.array([0.0, 1.0, -1.0, 2.0]) * 2.0 * np.pi / length, length)
    assert bins == pytest.approx([3.5, 1.75, 1.75, 0.0], abs=1e-5)
