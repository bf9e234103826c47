"""CIFER's windows: transforms, averages, the composite of lengths, and the errors of all."""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.signal import lfilter

from helisim.base.errors import IdentificationError
from helisim.ident import identify, structures
from helisim.ident.windows import (
    PERIODS,
    compose,
    condition,
    cross_spectra,
    random_error,
    window_lengths,
)
from ident_data import YAW, of_model, record
from tabled import tabled

STEP = 0.05


def white(seed, samples=4000, noise=0.0):
    random = np.random.default_rng(seed)
    x = random.standard_normal(samples)
    return record(lat=x, p=lfilter([0.3], [1.0, -0.7], x) + noise * random.standard_normal(samples))


@pytest.mark.parametrize("others", [(), ("lon",)])
def test_inputs_that_follow_each_other_late_are_told_apart(others):
    """Gains without dynamics have no leakage: exact, however the inputs' cross spectrum turns."""
    random = np.random.default_rng(0)
    lat, own = random.standard_normal((2, 4000))
    lon = 0.8 * np.roll(lat, 5) + 0.5 * own
    flown = record(lat=lat, lon=lon, p=2.0 * lat + 3.0 * lon)
    spectra = cross_spectra([flown], ["lat", "lon", "p"], np.array([2.0, 5.0, 11.0]), 20.0)
    inputs = [name for name in ("lat", "lon") if name not in others]
    found = condition(spectra, inputs, ["p"], others)
    exact = np.array([2.0, 3.0])[: len(inputs), None]
    np.testing.assert_allclose((found.gxy / found.gxx)[0], exact + np.zeros(3), rtol=1e-9)


def test_overlap_factor_is_the_published_one():
    """For a long record C_eps^2 = n_d / n_e is Hann's 0.481 at 75 %."""
    flown = white(0, samples=20000)
    spectra = cross_spectra([flown], ["lat"], np.array([2.0]), 50.0)
    # Windows over the ends and the fade into trim add up to one in twenty windows.
    assert (flown.duration / 50.0) / spectra.averages == pytest.approx(0.481, rel=0.05)


@tabled("durations", "band", "lengths")
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


def test_weighing_by_error_needs_records():
    """A response without records is fitted by J."""
    exact = of_model(structures.yaw_base, YAW)
    by_coherence = identify(exact, structures.yaw_base, weighting="coherence")
    assert identify(exact, structures.yaw_base).values == by_coherence.values
