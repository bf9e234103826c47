"""The errors of a response and how they hang together, against many flights."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import chirp, lfilter

from helisim.base.errors import IdentificationError, InputError
from helisim.ident import FrequencyResponse, frequency_response, identify, structures
from helisim.ident.cost import Cost, select
from helisim.ident.evaluate import response
from helisim.ident.scatter import hann_lobe
from helisim.records.channels import channel
from helisim.records.record import FlightRecord

STEP = 0.05
SAMPLES = 2400
REPLICATES = 150
BAND = (2.0, 12.0)


def swept(seed):
    """Return a sweep seen through 0.3/(1 - 0.7/z) and a gain, with correlated coloured noise."""
    random = np.random.default_rng(seed)
    time = np.arange(SAMPLES) * STEP
    lat = chirp(time, 0.1, time[-1], 3.0, method="logarithmic")
    shared, own = random.standard_normal((2, SAMPLES))
    slow = lfilter([0.3], [1.0, -0.8], shared)
    p = lfilter([0.3], [1.0, -0.7], lat) + 0.3 * slow
    q = 0.5 * lat + 0.3 * slow + 0.1 * own
    columns = np.stack([lat, p, q], axis=1)
    return FlightRecord(time, columns, tuple(map(channel, ("lat", "p", "q"))))


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
    for seed in range(REPLICATES):
        frf = frequency_response(
            swept(seed),
            inputs="lat",
            outputs=("p", "q"),
            band=BAND,
            estimator=estimator,
            windows=windows,
            overlap=overlap,
        )
        index = np.arange(0, frf.frequency.size, 4)
        found.append(frf.response[:, 0, index].ravel())
        if seed < 20:
            outputs = np.repeat([0, 1], index.size)
            at = (outputs, np.zeros_like(outputs), np.tile(index, 2))
            none = {"bias": np.zeros(frf.response.shape)}
            if estimator == "local":
                none["spread"] = none["bias"]
            random = replace(frf.scatter, **none)
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
    values = {"N_r": -0.7, "N_ped": 50.0, "tau_r_base": 0.04}
    grid = np.geomspace(0.5, 20.0, 60)
    exact = FrequencyResponse.exact(
        grid, response(structures.yaw_base, values, grid), inputs=["ped"], outputs=["r"]
    )
    by_error = identify(exact, structures.yaw_base)
    by_coherence = identify(exact, structures.yaw_base, weighting="coherence")
    assert by_error.values == by_coherence.values
    points = select(exact, structures.yaw_base, band=None, responses=None, count=20)
    with pytest.raises(IdentificationError, match="not estimated from records"):
        _ = Cost(structures.yaw_base, points).spread
    with pytest.raises(InputError, match="expected 'error' or 'coherence'"):
        identify(exact, structures.yaw_base, weighting="cifer")


def test_the_interval_is_1_96_standard_errors_either_way():
    """A parameter's interval follows from its standard error."""
    frf = frequency_response(swept(0), inputs="lat", outputs="q", band=BAND)
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
