"""Composite windows: their lengths, and the search for the spectra that agree with all."""

import numpy as np
import pytest

from helisim.ident import frequency_response
from helisim.ident.responses.composite import _COHERENCE_WEIGHT, _Aim, _cost, _step, window_lengths
from helisim.records.channels import channel
from helisim.records.record import FlightRecord


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


@pytest.mark.parametrize("seed", range(3))
def test_a_composites_step_is_gauss_and_newtons(seed):
    """-(J'J)^-1 J'r of the residuals, with J by differences: rows of the identity and one more."""
    random = np.random.default_rng(seed)
    target = np.array([1.0, 1.0, 0.7, 0.5]) + 0.1 * random.normal(size=4)
    unit, g2, g2_unit = random.uniform(0.5, 2.0, size=4), 0.6, 0.2
    z = target + 0.1 * random.normal(size=4)
    aim = _Aim(target[:, None], unit[:, None], np.array([g2]), np.array([g2_unit]))

    def residuals(at):
        gxx, gyy, real, imaginary = at * unit
        coherence = (real**2 + imaginary**2) / (gxx * gyy)
        misfit = np.sqrt(_COHERENCE_WEIGHT) * (coherence - g2) / g2_unit
        return np.append(at - target, misfit)

    steps = 1e-6 * np.eye(4)
    jacobian = np.array([(residuals(z + d) - residuals(z - d)) / 2e-6 for d in steps]).T
    expected = np.linalg.lstsq(jacobian, -residuals(z), rcond=None)[0]
    # central differences of 1e-6 are good to 1e-9 here
    assert _step(z[:, None], aim)[:, 0] == pytest.approx(expected, abs=1e-7)
    assert _cost(z[:, None], aim)[0] == pytest.approx(np.sum(residuals(z) ** 2), rel=1e-12)


def test_a_short_window_takes_part_from_six_periods_upwards():
    """Below, its main lobe, two bins either way, is a third of the frequency itself and more.

    The longest window serves all frequencies, so that none is left without an estimate.
    """
    random = np.random.default_rng(4)
    columns = random.normal(size=(2400, 2))
    columns[:, 1] += columns[:, 0]
    record = FlightRecord(0.05 * np.arange(2400), columns, (channel("lat"), channel("p")))
    windows = (40.0, 20.0, 10.0)
    band = (2.0 * np.pi / 40.0, 12.0)
    frf = frequency_response(
        [record] * 2, inputs="lat", outputs="p", band=band, windows=windows, estimator="windows"
    )
    assert frf.scatter is not None
    for one in frf.scatter.windows:
        takes_part = one.share[0, 0] > 0.0
        periods = one.length * frf.frequency / (2.0 * np.pi)
        expected = (periods >= 6.0) | (one.length == 40.0)
        assert np.array_equal(takes_part, expected)
