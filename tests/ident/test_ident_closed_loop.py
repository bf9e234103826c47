"""Joint and direct estimates side by side: what is carried, and when a warning is raised."""

import json
import warnings

import numpy as np
import pytest
from scipy.signal import lfilter

from helisim.base.errors import InputError
from helisim.ident import ClosedLoopWarning, FrequencyResponse, frequency_response
from helisim.records.channels import channel
from helisim.records.record import FlightRecord

STEP = 0.05
ARGUMENTS = {"inputs": "ped", "outputs": "r", "band": (2.0, 20.0), "reference": "PED"}


def loop(seed, gain, disturbance, samples=6000):
    """Return r = 0.3/(1 - 0.7/z) ped + v, ped = PED - gain r one sample ago, v slow noise."""
    random = np.random.default_rng(seed)
    stick = random.standard_normal(samples)
    slow = disturbance * lfilter([0.3], [1.0, -0.7], random.standard_normal(samples))
    ped, r, state = np.zeros(samples), np.zeros(samples), 0.0
    for k in range(samples):
        ped[k] = stick[k] - (gain * r[k - 1] if k else 0.0)
        state = 0.7 * state + 0.3 * ped[k]
        r[k] = state + slow[k]
    columns = np.stack([stick, ped, r], axis=1)
    return FlightRecord(
        np.arange(samples) * STEP, columns, tuple(map(channel, ("PED", "ped", "r")))
    )


def truth(frequency):
    return 0.3 / (1.0 - 0.7 * np.exp(-1j * frequency * STEP))


def test_the_direct_estimate_is_carried_for_comparison():
    """With a reference, the response holds the direct estimate, equal to one made alone."""
    with pytest.warns(ClosedLoopWarning):
        joint = frequency_response(loop(1, 1.0, 1.0), **ARGUMENTS)
    alone = frequency_response(loop(1, 1.0, 1.0), **{**ARGUMENTS, "reference": None})
    # Rounding: products over four signals are summed in another order than over two.
    np.testing.assert_allclose(joint.direct.response, alone.response, rtol=1e-7)
    assert joint.direct.reference == ()
    assert alone.direct is None
    wrong = np.abs(joint.direct.response[0, 0] / truth(joint.frequency) - 1.0)
    right = np.abs(joint.response[0, 0] / truth(joint.frequency) - 1.0)
    assert np.mean(right) < 0.5 * np.mean(wrong)


def test_the_warning_says_where_how_much_and_what_to_do():
    """Feedback with a disturbance is named with response, frequency, size and advice."""
    with pytest.warns(ClosedLoopWarning, match="r/ped disagree beyond their errors"):
        frf = frequency_response(loop(2, 1.0, 1.0), **ARGUMENTS)
    assert len(frf.flags) == 1
    assert "use the joint one" in frf.flags[0]
    assert "rad/s" in frf.flags[0]


@pytest.mark.parametrize(("gain", "disturbance"), [(0.0, 1.0), (1.0, 0.0)])
@pytest.mark.parametrize("seed", range(5))
def test_agreeing_estimates_raise_no_warning(gain, disturbance, seed):
    """Without feedback, or without a disturbance, both estimates are the same within errors."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        frf = frequency_response(loop(seed, gain, disturbance), **ARGUMENTS)
    assert frf.flags == ()


def test_files_keep_the_response_without_what_records_alone_give():
    """An archived response comes back without its error model, and is fitted by J."""
    frf = frequency_response(loop(3, 0.0, 1.0), **ARGUMENTS)
    again = FrequencyResponse.from_dict(json.loads(json.dumps(frf.to_dict())))
    np.testing.assert_array_equal(again.response, frf.response)
    assert again.scatter is None
    assert again.direct is None


def noise(seed, names=("lat", "p"), *, samples=1500, step=0.02):
    random = np.random.default_rng(seed)
    values = random.normal(size=(samples, len(names)))
    values[:, -1] += 2.0 * values[:, 0]
    return FlightRecord(step * np.arange(samples), values, tuple(map(channel, names)))


def test_too_few_references_are_counted():
    """As many references as inputs and conditioning inputs together."""
    record = noise(1, ("LAT", "lat", "lon", "p"))
    with pytest.raises(InputError, match=r"1 reference\(s\) for 2 active inputs"):
        frequency_response(
            record,
            inputs=["lat"],
            conditioning=["lon"],
            outputs=["p"],
            reference=["LAT"],
            band=(1.0, 20.0),
        )
