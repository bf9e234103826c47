"""Composite windows: their lengths, and the search for the spectra that agree with all."""

import numpy as np
import pytest

from helisim.ident import frequency_response
from helisim.ident.composite import window_lengths
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
