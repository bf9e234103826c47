"""Spectra: the transform, the averages and their random error."""

import numpy as np
import pytest
from scipy.signal import ZoomFFT, lfilter

from helisim.base.errors import IdentificationError, InputError
from helisim.ident import frequency_response
from helisim.ident.conditioning import random_error
from helisim.ident.spectra import _kernel, cross_spectra, segment_starts
from helisim.records.channels import channel
from helisim.records.record import FlightRecord


def white_record(seed, samples=4000, step=0.05, noise=0.0, names=("lat", "p")):
    random = np.random.default_rng(seed)
    x = random.standard_normal(samples)
    y = lfilter([0.3], [1.0, -0.7], x) + noise * random.standard_normal(samples)
    return FlightRecord(
        np.arange(samples) * step, np.stack([x, y], axis=1), tuple(map(channel, names))
    )


def test_kernel_is_the_chirp_z_transform():
    """The windowed transform equals scipy's chirp-z transform at the same frequencies."""
    length, step = 333, 0.02
    signal = np.random.default_rng(1).standard_normal(length)
    hertz = np.linspace(0.1, 5.0, 40)
    zoom = ZoomFFT(length, [0.1, 5.0], m=40, fs=1.0 / step, endpoint=True)
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(length) / length)
    expected = step * zoom(window * signal)
    # Rounding only: both sum 333 terms of order 0.02.
    np.testing.assert_allclose(
        signal @ _kernel(length, step, 2.0 * np.pi * hertz), expected, atol=1e-12
    )


def test_white_noise_has_its_known_level():
    """The one-sided spectrum of unit white noise is 2 dt at every frequency."""
    records = [white_record(seed) for seed in range(8)]
    frequency = np.geomspace(2.0, 30.0, 60)
    (spectra,) = cross_spectra(records, ["lat"], frequency, windows=[10.0], overlap=0.75)
    level = np.real(spectra.matrix[:, 0, 0])
    # 8 records of 20 windows average 300 independent ones: 6 % a frequency, 1.5 % together.
    assert np.mean(level) == pytest.approx(2.0 * 0.05, rel=0.05)


@pytest.mark.parametrize(("samples", "length"), [(1000, 300), (1001, 500), (97, 31)])
@pytest.mark.parametrize("overlap", [0.0, 0.5, 0.75, 0.8])
def test_windows_reach_over_both_ends_evenly(samples, length, overlap):
    """No sample near an end of a record is fainter than those in the middle by half."""
    weight = np.zeros(samples)
    hann = np.sin(np.pi * (np.arange(length) + 0.5) / length) ** 2
    for start in segment_starts(samples, length, overlap):
        inside = (np.arange(samples) - start >= 0) & (np.arange(samples) - start < length)
        weight[inside] += hann[np.arange(samples)[inside] - start]
    if overlap >= 0.5:
        assert weight.min() > 0.5 * np.median(weight)
    hops = np.diff(segment_starts(samples, length, overlap))
    assert hops.max() <= np.ceil(length * (1.0 - overlap))


def test_no_window_crosses_a_join():
    """Two records average like two records, whatever offset the second one starts from."""
    first, second = white_record(1), white_record(2)
    shifted = FlightRecord(second.time, second.values + 100.0, second.channels)
    frequency = np.geomspace(1.0, 20.0, 30)
    options = {"windows": [8.0], "overlap": 0.75}
    (plain,) = cross_spectra([first, second], ["lat", "p"], frequency, **options)
    (moved,) = cross_spectra([first, shifted], ["lat", "p"], frequency, **options)
    # Detrending removes the offset to rounding, 1e-16 of 100.
    np.testing.assert_allclose(moved.matrix, plain.matrix, rtol=1e-8, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("overlap", [0.0, 0.5, 0.8])
def test_random_error_matches_monte_carlo(overlap):
    """The stated random error is the scatter of the magnitude over many flights."""
    gains, stated = [], []
    for seed in range(60):
        frf = frequency_response(
            white_record(seed, samples=2400, noise=0.5),
            inputs="lat",
            outputs="p",
            band=(2.0, 12.0),
            windows=8.0,
            overlap=overlap,
        )
        gains.append(np.abs(frf.response[0, 0]))
        # The formula with the true coherence: |H|^2 / (|H|^2 + noise), known here.
        z = np.exp(-1j * frf.frequency * 0.05)
        power = np.abs(0.3 / (1.0 - 0.7 * z)) ** 2
        (spectra,) = cross_spectra(
            [white_record(seed, samples=2400)],
            ["lat"],
            frf.frequency,
            windows=[8.0],
            overlap=overlap,
        )
        stated.append(random_error(power / (power + 0.25), spectra.averages))
    scatter = np.std(gains, axis=0) / np.mean(gains, axis=0)
    # 60 replicates at about 10 independent frequencies know the scatter to 3 %.
    assert np.mean(scatter) == pytest.approx(np.mean(stated), rel=0.1)


@pytest.mark.parametrize(("overlap", "factor"), [(0.5, 0.528), (0.75, 0.481)])
def test_overlap_factor_is_the_published_one(overlap, factor):
    """For a long record C_eps^2 = n_d / n_e is Hann's 0.528 at 50 % and 0.481 at 75 %."""
    record = white_record(0, samples=20000)
    (spectra,) = cross_spectra([record], ["lat"], np.array([2.0]), windows=[50.0], overlap=overlap)
    # Windows over the ends and the fade into trim add up to one in twenty windows.
    assert (record.duration / 50.0) / spectra.averages == pytest.approx(factor, rel=0.05)


def noise(seed, names=("lat", "p"), *, samples=1500, step=0.02):
    random = np.random.default_rng(seed)
    values = random.normal(size=(samples, len(names)))
    values[:, -1] += 2.0 * values[:, 0]
    return FlightRecord(step * np.arange(samples), values, tuple(map(channel, names)))


def test_a_window_that_does_not_fit_is_told_in_seconds():
    """Its length and the record's; and what it resolves, and where the band starts."""
    ask = {"inputs": ["lat"], "outputs": ["p"]}
    with pytest.raises(IdentificationError) as raised:
        frequency_response(noise(1), **ask, band=(1.0, 20.0), windows=[40.0])
    assert "a window of 40 s does not fit into a record of 30 s" in str(raised.value)
    with pytest.raises(InputError) as refused:
        frequency_response(noise(1), **ask, band=(0.5, 20.0), windows=[10.0])
    assert "from 0.6283 rad/s, but the band starts at 0.5 rad/s" in str(refused.value)
