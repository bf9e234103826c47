"""Frequency responses: conditioning, gates, and refusals that say what to do."""

import json
import math
import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.signal import lfilter

from helisim.base.errors import IdentificationError, InputError, UnknownNameError
from helisim.ident import (
    CrossControlWarning,
    FrequencyResponse,
    frequency_response,
    identify,
    structures,
    verify,
)
from helisim.ident.composite import PERIODS, compose, window_lengths
from helisim.ident.conditioning import condition, random_error
from helisim.ident.evaluate import response
from helisim.ident.spectra import cross_spectra
from helisim.records.channels import channel
from helisim.records.record import FlightRecord

STEP = 0.05
BAND = (2.0, 20.0)


def record(columns, samples=4000):
    time = np.arange(samples) * STEP
    values = np.stack([columns[name] for name in columns], axis=1)
    return FlightRecord(time, values, tuple(map(channel, columns)))


def two_inputs(seed, coupling=0.0, samples=4000, off=1.0):
    """Return p = 0.3/(1 - 0.7/z) lat + 0.2 lon, with lon partly a copy of lat."""
    random = np.random.default_rng(seed)
    lat = random.standard_normal(samples)
    lon = coupling * lat + off * random.standard_normal(samples)
    p = lfilter([0.3], [1.0, -0.7], lat) + 0.2 * lon
    return record({"lat": lat, "lon": lon, "p": p}, samples)


def truth(frequency):
    return 0.3 / (1.0 - 0.7 * np.exp(-1j * frequency * STEP))


def test_conditioning_removes_a_correlated_input():
    """MISO gives the truth where an off-axis input follows the main one; SISO doesn't."""
    flight = two_inputs(3, coupling=0.7, off=0.9)
    miso = frequency_response(flight, inputs=("lat", "lon"), outputs="p", band=BAND)
    siso = frequency_response(flight, inputs="lat", outputs="p", band=BAND)
    expected = truth(miso.frequency)
    # Without noise only the windows' smoothing is left: under 1 %.
    np.testing.assert_allclose(miso.response[0, 0], expected, rtol=0.03)
    np.testing.assert_allclose(np.abs(miso.response[0, 1]), 0.2, rtol=0.05)
    # SISO sees 0.2 * 0.7 more gain, between 14 % and 80 % of the truth in this band.
    assert np.mean(np.abs(siso.response[0, 0] / expected - 1.0)) > 0.14


def test_conditioning_leaves_uncorrelated_inputs_alone():
    """With independent inputs MISO and SISO agree within the random error."""
    flight = two_inputs(4)
    miso = frequency_response(flight, inputs=("lat", "lon"), outputs="p", band=BAND)
    siso = frequency_response(flight, inputs="lat", outputs="p", band=BAND)
    gap = np.abs(siso.response[0, 0] / miso.response[0, 0] - 1.0)
    assert np.mean(gap) < 2.0 * np.mean(siso.random_error)


def test_wanted_and_conditioning_inputs_are_the_same_estimate():
    """An input counts the same whether it is wanted or conditioned out."""
    flight = two_inputs(5, coupling=0.3)
    both = frequency_response(flight, inputs=("lat", "lon"), outputs="p", band=BAND)
    one = frequency_response(flight, inputs="lat", conditioning="lon", outputs="p", band=BAND)
    np.testing.assert_allclose(one.response[0, 0], both.response[0, 0], rtol=1e-9)
    assert one.conditioning == ("lon",)


def test_joint_method_with_the_input_as_reference_is_the_direct_one():
    """Taking the inputs as their own reference changes nothing."""
    flight = two_inputs(6, coupling=0.3)
    direct = frequency_response(flight, inputs=("lat", "lon"), outputs="p", band=BAND)
    joint = frequency_response(
        flight, inputs=("lat", "lon"), outputs="p", band=BAND, reference=("lat", "lon")
    )
    np.testing.assert_allclose(joint.response, direct.response, rtol=1e-9)
    np.testing.assert_allclose(joint.coherence, direct.coherence, rtol=1e-6)


def test_the_gate_warns_of_coherent_inputs():
    """Inputs that mostly move together are named in a warning that is kept in the result."""
    with pytest.warns(CrossControlWarning, match="'lat' and 'lon'"):
        frf = frequency_response(
            two_inputs(7, coupling=1.0, off=0.5), inputs=("lat", "lon"), outputs="p", band=BAND
        )
    assert len(frf.flags) == 1
    assert "add records" in frf.flags[0]
    assert np.mean(frf.cross_control_coherence[0, 1]) > 0.5


def test_the_gate_refuses_inputs_that_move_as_one():
    """Fully coherent inputs end in an error that says what to do."""
    with pytest.raises(IdentificationError, match="can't be told apart; add records"):
        frequency_response(
            two_inputs(8, coupling=1.0, off=0.0), inputs=("lat", "lon"), outputs="p", band=BAND
        )


def test_independent_inputs_raise_no_warning():
    """The gate is silent for a good experiment."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        frf = frequency_response(two_inputs(9), inputs=("lat", "lon"), outputs="p", band=BAND)
    assert frf.flags == ()
    # Unrelated inputs: chance leaves 1 / n_d, and n_d is 5 or more by the windows' rule.
    assert np.mean(frf.cross_control_coherence[0, 1]) < 0.2


def test_arrays_are_read_only_and_exported_to_control():
    """A frequency response can't be changed, and python-control reads it with its names."""
    frf = frequency_response(two_inputs(1), inputs=("lat", "lon"), outputs="p", band=BAND)
    with pytest.raises(ValueError, match="read-only"):
        frf.response[0, 0, 0] = 0.0
    exported = frf.to_frd()
    assert list(exported.input_labels) == ["lat", "lon"]
    assert list(exported.output_labels) == ["p"]
    np.testing.assert_allclose(exported(1j * frf.frequency), frf.response)
    assert frf.response.shape == (1, 2, frf.frequency.size)
    assert frf.pairs == ("p/lat", "p/lon")


def test_one_window_is_allowed():
    """A single window length gives a response without a composite."""
    frf = frequency_response(two_inputs(1), inputs="lat", outputs="p", band=BAND, windows=20.0)
    assert frf.windows == (20.0,)


def refusals():
    flight = two_inputs(1)
    good = {"records": flight, "inputs": "lat", "outputs": "p", "band": BAND}
    still = record({"lat": np.full(4000, 0.25), "p": flight["p"]})
    return {
        "unknown channel": ({**good, "inputs": "roll"}, UnknownNameError, "available: lat, lon, p"),
        "no records": ({**good, "records": []}, InputError, "at least one FlightRecord"),
        "not a record": ({**good, "records": [3]}, InputError, "record 0 is a int"),
        "no input": ({**good, "inputs": ()}, InputError, "at least one input"),
        "one channel twice": ({**good, "outputs": "lat"}, InputError, "lat"),
        "nan band": ({**good, "band": (float("nan"), 3.0)}, InputError, "nan to 3"),
        "band backwards": ({**good, "band": (5.0, 2.0)}, InputError, "0 < lower < upper"),
        "band not a pair": ({**good, "band": 5.0}, InputError, "two frequencies"),
        "beyond Nyquist": ({**good, "band": (2.0, 90.0)}, InputError, "record faster"),
        "too short": ({**good, "band": (0.01, 9.0)}, IdentificationError, "too short"),
        "constant input": ({**good, "records": still}, IdentificationError, "'lat' is constant"),
        "two samples": (
            {**good, "records": flight.slice(0.0, 0.06)},
            IdentificationError,
            "too short",
        ),
        "window too long": ({**good, "windows": 1e4}, IdentificationError, "does not fit"),
        "window too short": ({**good, "windows": 1.0}, InputError, "lengthen the window"),
        "window negative": ({**good, "windows": -1.0}, InputError, "positive lengths"),
        "overlap": ({**good, "overlap": 1.0}, InputError, "0.75 to 0.8"),
        "few references": (
            {**good, "inputs": ("lat", "lon"), "reference": "lat"},
            InputError,
            "as many references",
        ),
    }


@pytest.mark.parametrize("case", refusals())
def test_bad_input_is_refused_with_advice(case):
    """Each bad argument ends in helisim's own error, which says what was expected."""
    arguments, error, message = refusals()[case]
    with pytest.raises(error, match=message.replace("(", r"\(")):
        frequency_response(**arguments)


def test_exact_response_checks_its_shape():
    """An exact response with the wrong axes is refused."""
    with pytest.raises(InputError, match="expected"):
        FrequencyResponse.exact([1.0, 2.0], np.ones((1, 2)), inputs=["lat"], outputs=["p"])


def test_composite_spectra_minimise_the_published_cost():
    """No general optimiser finds composite spectra of lower cost (Tischler and Remple, 11)."""
    flight = two_inputs(11)
    frequency = np.geomspace(*BAND, 12)
    each = [
        condition(spectra, ["lat"], ["p"], [], None)
        for spectra in cross_spectra(
            [flight], ["lat", "p"], frequency, windows=(40.0, 25.0, 12.0), overlap=0.75
        )
    ]
    composed = compose(each)
    error = np.stack([random_error(one.coherence, one.averages) for one in each])[:, 0, 0]
    usable = np.stack([one.periods >= PERIODS for one in each])
    usable[0] = True
    weight = np.where(usable, (np.min(np.where(usable, error, np.inf), axis=0) / error) ** 4, 0.0)
    for k in range(frequency.size):
        parts = np.array(
            [
                (one.gxx[0, 0, k], one.gyy[0, 0, k], one.gxy[0, 0, k].real, one.gxy[0, 0, k].imag)
                for one in each
            ]
        )
        start = weight[:, k] ** 2 @ parts / np.sum(weight[:, k] ** 2)
        g2 = (parts[:, 2] ** 2 + parts[:, 3] ** 2) / (parts[:, 0] * parts[:, 1])
        unit = np.maximum(np.abs(start), [0.0, 0.0, *[0.1 * np.hypot(*start[2:])] * 2])
        g2_unit = (start[2] ** 2 + start[3] ** 2) / (start[0] * start[1])

        def cost(z, parts=parts, g2=g2, unit=unit, g2_unit=g2_unit, w=weight[:, k]):
            x = z * unit
            own = (x[2] ** 2 + x[3] ** 2) / (x[0] * x[1])
            misfit = np.sum(((x - parts) / unit) ** 2, axis=1) + 5.0 * ((own - g2) / g2_unit) ** 2
            return float(w @ misfit)

        best = minimize(cost, start / unit, method="Nelder-Mead", tol=1e-12)
        x = best.x * unit
        # Nelder-Mead ends within 1e-6 of the minimum.
        np.testing.assert_allclose(composed.response[0, 0, k], (x[2] + 1j * x[3]) / x[0], rtol=1e-4)
        np.testing.assert_allclose(
            composed.coherence[0, 0, k], (x[2] ** 2 + x[3] ** 2) / (x[0] * x[1]), rtol=1e-4
        )


GRID = np.geomspace(0.5, 20.0, 40)


def test_a_point_is_usable_from_a_coherence_of_six_tenths():
    """The published limit, which counts itself."""
    data = FrequencyResponse.exact(GRID[:3], np.ones((1, 1, 3)), inputs=["lat"], outputs=["p"])
    doubtful = replace(data, coherence=np.array([[[0.59, 0.6, 0.61]]]))
    assert doubtful.usable().tolist() == [[[False, True, True]]]


FINE = np.geomspace(0.5, 20.0, 60)


def noise(seed, names=("lat", "p"), *, samples=1500, step=0.02):
    random = np.random.default_rng(seed)
    values = random.normal(size=(samples, len(names)))
    values[:, -1] += 2.0 * values[:, 0]
    return FlightRecord(step * np.arange(samples), values, tuple(map(channel, names)))


def vars_of(value):
    return {name: getattr(value, name) for name in value.__dataclass_fields__}


def test_records_too_short_for_the_band_are_told_with_their_figures():
    """What they last, the window that they allow, and the frequency that it resolves."""
    with pytest.raises(IdentificationError) as raised:
        window_lengths([30.0, 40.0], (0.4, 20.0))
    for message in (
        "lasts 30 s",
        "together 70 s",
        "windows of 14 s",
        "from 0.4488 rad/s",
        "at 0.4 ",
    ):
        assert message in str(raised.value)


@pytest.mark.parametrize("windows", [[], [0.0], [-1.0], [math.inf], [math.nan]])
def test_windows_are_positive_lengths(windows):
    """Anything else is in the message."""
    with pytest.raises(InputError, match="expected positive lengths in s"):
        frequency_response(
            noise(1), inputs=["lat"], outputs=["p"], band=(1.0, 20.0), windows=windows
        )


def test_incoherence_is_told_with_its_figures():
    """The best coherence of each response, where it was looked for, and the grid's ends."""
    still = FrequencyResponse.exact(FINE, np.ones((1, 1, 60)), inputs=["col"], outputs=["w"])
    dull = FrequencyResponse(**{**vars_of(still), "coherence": np.full((1, 1, 60), 0.34)})
    with pytest.raises(IdentificationError) as raised:
        identify(dull, structures.heave, band=(1.0, 10.0))
    inside = int(np.sum((FINE >= 1.0) & (FINE <= 10.0)))
    assert f"at most 0.34 at {inside} frequencies" in str(raised.value)
    assert "(frequency response: 0.5 to 20 rad/s)" in str(raised.value)


@pytest.mark.parametrize(
    ("field", "item", "message"),
    [
        ("frequency", [3.0, 2.0, 1.0], "frequenc"),
        ("frequency", "low", r"response\.frequency must be an array of numbers, got 'low'"),
        ("response", {"real": [1.0]}, r"response\.response must be an array of numbers"),
        ("surprise", 1.0, "unknown field"),
    ],
)
def test_a_damaged_frequency_response_is_refused(field, item, message):
    """Fields of another kind, of another shape, or of another version."""
    data = FrequencyResponse.exact(
        np.array([1.0, 2.0, 3.0]), np.ones((1, 1, 3)), inputs=["lat"], outputs=["p"]
    )
    plain = json.loads(json.dumps(data.to_dict()))
    assert FrequencyResponse.from_dict(plain).frequency.tolist() == [1.0, 2.0, 3.0]
    with pytest.raises(InputError, match=message):
        FrequencyResponse.from_dict({**plain, field: item})


TRUE = {"Z_w": -0.8, "Z_col": -25.0, "tau_col": 0.03}


def fitted(structure=structures.heave):
    exact = response(structures.heave, TRUE, GRID)
    data = FrequencyResponse.exact(GRID, exact, inputs=structure.inputs, outputs=structure.outputs)
    return identify(data, structure)


def noisy(seed, **provenance):
    """A record of p that follows lat with as much noise as signal."""
    random = np.random.default_rng(seed)
    values = random.normal(size=(3000, 2))
    values[:, 1] += values[:, 0]
    time = 0.02 * np.arange(len(values))
    return FlightRecord(time, values, (channel("lat"), channel("p")), provenance)


@pytest.mark.parametrize("frequency", [[1.0, 1.0, 2.0], [0.0, 1.0, 2.0], [1.0, 3.0, 2.0], []])
def test_frequencies_are_positive_and_increasing(frequency):
    """None twice, none zero, none out of order, and one at least."""
    exact = np.ones((1, 1, len(frequency)), dtype=complex)
    with pytest.raises(InputError, match="frequency"):
        FrequencyResponse.exact(frequency, exact, inputs=("col",), outputs=("w",))


def test_coherence_of_half_signal_and_half_noise_is_a_half():
    """Of one input the multiple coherence is the ordinary one, near 1/2 in the composite too."""
    found = frequency_response(noisy(1), inputs=("lat",), outputs=("p",), band=(2.0, 40.0))
    assert np.mean(found.multiple_coherence) == pytest.approx(0.5, abs=0.1)
    # 60 s and windows of 20 s and less: the estimate scatters by 0.1 to 0.2 at a frequency
    assert np.mean(found.coherence) == pytest.approx(0.5, abs=0.1)


def test_a_flight_that_was_terminated_early_is_refused_by_default():
    """By the frequency response and by the verification."""
    over = noisy(1, ended={"at": 12.0, "why": "p is 30 rad/s", "state": {}})
    asked = {"inputs": ("lat",), "outputs": ("p",), "band": (2.0, 40.0)}
    with pytest.raises(IdentificationError, match="use_ended=True"):
        frequency_response(over, **asked)
    assert frequency_response(over, use_ended=True, **asked).coherence.size
    heave = fitted()
    flown = replace(over, channels=(channel("col"), channel("w")))
    with pytest.raises(IdentificationError, match="use_ended=True"):
        verify(heave, flown)
    assert verify(heave, flown, use_ended=True)
