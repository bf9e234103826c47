"""The local polynomial method against transfer functions that are known in closed form."""

import numpy as np
import pytest
from scipy.signal import freqz, lfilter

from helisim.base.errors import InputError
from helisim.ident import frequency_response
from helisim.records.channels import channel
from helisim.records.record import FlightRecord

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


def test_names_of_estimators_and_windows_without_use_are_refused():
    """With what was received and what exists."""
    flight = cut(0, [0.3], [1.0, -0.7])
    with pytest.raises(InputError, match="'welch', expected one of: local, windows"):
        frequency_response(flight, estimator="welch", **ASKED)
    with pytest.raises(InputError, match="has no windows"):
        frequency_response(flight, estimator="local", windows=20.0, **ASKED)
