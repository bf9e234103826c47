"""Time-domain simulation and verification."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import cont2discrete, dlsim, periodogram

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.linear import LinearSystem
from helisim.ident import Parameter, Structure, structures, verify
from helisim.ident.evaluate import delayed, linear, simulate
from helisim.ident.verification import overall_theil
from helisim.ident.verify import _noise
from helisim.records.record import FlightRecord
from ident_data import fitted, record
from ident_data import found as exactly
from tabled import tabled


def system(*matrices):
    return LinearSystem(*matrices, None, ("u", "v"), ("y", "z"))


def test_simulation_is_the_exact_discretisation():
    random = np.random.default_rng(0)
    for shift in (-2.0, 0.3):
        a = random.normal(size=(4, 4)) + shift * np.eye(4)
        b, c = random.normal(size=(4, 2)), random.normal(size=(2, 4))
        inputs = random.normal(size=(333, 2))
        inputs[0] = 0.0  # scipy's first-order hold starts from a shifted state otherwise
        a_d, b_d, c_d, d_d, step = cont2discrete((a, b, c, np.zeros((2, 2))), 0.01, method="foh")
        expected = dlsim((a_d, b_d, c_d, d_d, step), inputs)[1]
        got = simulate(system(a, b, c, np.zeros((2, 2))), inputs, 0.01)
        np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-10 * np.max(np.abs(expected)))


@settings(max_examples=15, deadline=None)
@given(lag=st.integers(-37, 37), other=st.integers(-37, 37), seed=st.integers(0, 1000))
def test_delays_of_either_sign_are_exact_between_samples(lag, other, seed):
    random = np.random.default_rng(seed)
    model = system(
        random.normal(size=(3, 3)) - 2.0 * np.eye(3),
        random.normal(size=(3, 2)),
        random.normal(size=(2, 3)),
        random.normal(size=(2, 2)),
    )
    coarse, fine = np.arange(60.0) * 0.02, np.arange(-50, 660) * 0.002
    inputs = np.cumsum(random.normal(size=(60, 2)), axis=0)
    lags = np.array([[lag, other], [other, 0]]) * 0.002
    got = delayed(model, inputs - inputs[0], 0.02, lags)
    expected = np.zeros_like(got)
    for k in range(2):
        for j in range(2):
            only = np.zeros((fine.size, 2))
            at = fine - lags[k, j]
            only[:, j] = np.interp(at, coarse, inputs[:, j]) - inputs[0, j]
            expected[:, k] += simulate(model, only, 0.002)[50:650:10, k]
    np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-9)


YAW = {"N_r": -0.9, "N_ped": 60.0, "tau_r_base": 0.0}
STEP = 0.01


def yaw_fit(delay):
    values = {**YAW, "tau_r_base": delay}
    return fitted(structures.yaw_base, values, np.geomspace(0.3, 25.0, 60))


def doublet(delay, *, bias=0.0, trim=0.0, noise=0.0, size=0.1, seed=0):
    values = {**YAW, "tau_r_base": delay}
    time = np.arange(600) * STEP
    ped = size * np.sin(2.0 * np.pi * (time - 1.0) / 1.5) * ((time > 1.0) & (time < 2.5))
    model = linear(structures.yaw_base, values)
    r = delayed(model, ped[:, None], STEP, model.lags)[:, 0]
    r = r + bias + noise * np.random.default_rng(seed).standard_normal(time.size)
    return record(STEP, ped=ped + trim, r=r)


@pytest.mark.parametrize("delay", [0.0333, -0.0127])
def test_the_true_model_predicts_without_error(delay):
    result = verify(yaw_fit(delay), doublet(delay, bias=0.3, trim=-0.2))
    assert result.j_rms < 1e-5
    assert result.tic < 1e-5
    assert result.traces[0].residual.shape == (600, 1)
    assert result.traces[0].starts.size == 0  # one state serves the record
    # a model whose delay is 40 ms off predicts worse: it is simulated, not dropped
    assert verify(yaw_fit(0.0), doublet(0.04)).tic > 0.02


def test_unsuitable_records_are_refused():
    fit = yaw_fit(0.0)
    with pytest.raises(InputError, match="no records"):
        verify(fit, [])
    lacking = doublet(0.0)
    lacking = FlightRecord(lacking.time, lacking.values[:, :1], lacking.channels[:1])
    with pytest.raises(UnknownNameError, match="'r'; available: ped"):
        verify(fit, lacking)


def test_theils_coefficient_of_all_weighs_each_output_by_its_own_size():
    """Outputs of 0.1 and 0.01, each in units of its own root mean square."""
    random = np.random.default_rng(4)
    measured = random.normal(size=(50, 2)) * [0.1, 0.01]
    predicted = measured + random.normal(size=(50, 2)) * [0.02, 0.005]
    size = np.sqrt(np.mean(measured**2, axis=0))
    error, one, other = (
        np.sqrt(np.mean((values / size) ** 2))
        for values in (measured - predicted, measured, predicted)
    )
    assert overall_theil(measured, predicted) == pytest.approx(error / (one + other), rel=1e-12)


def test_an_output_that_stands_still_is_predicted_in_segments_too():
    ped = 0.001 * np.cumsum(np.random.default_rng(6).standard_normal(2000))
    still = record(0.02, ped=ped, r=np.zeros(2000))
    found = verify(yaw_fit(0.0), still, segment=5.0)
    assert found.j_rms > 0.0
    assert found.tic == pytest.approx(1.0)


BANK = Structure(
    name="bank",
    parameters=tuple(Parameter(name, "1", 1.0) for name in ("L_p", "L_lat")),
    states=("p", "phi"),
    inputs=("lat",),
    outputs=("p", "phi"),
    F=(("L_p", "0"), ("1", "0")),
    G=(("L_lat",), ("0",)),
)


def banked(samples, growth=-2.0, trim=0.0, noise=0.0, step=0.02):
    random = np.random.default_rng(3)
    fit = exactly(BANK, L_p=growth, L_lat=5.0)
    lat = 0.1 * np.cumsum(random.standard_normal((samples, 1)), axis=0) * step**0.5
    moved = simulate(linear(BANK, fit.values), lat, step)
    moved = moved + [0.0, noise] * random.standard_normal((samples, 2))
    return fit, record(step, lat=lat[:, 0] + trim, p=moved[:, 0], phi=moved[:, 1])


@pytest.mark.parametrize("segment", [None, 2.0])
def test_an_integrator_drifts_by_the_controls_trim(segment):
    found = verify(*banked(500, trim=0.3), segment=segment)
    assert found.j_rms < 1e-9
    # two biases and states, or two states for each of five segments, two biases and a trim
    assert found.approach.estimated == (4 if segment is None else 13)


@pytest.mark.parametrize(("size", "lat", "elsewhere"), [(1e-4, 0.1, True), (0.1, 0.3, False)])
def test_a_manoeuvre_of_another_control_is_no_test(size, lat, elsewhere):
    flown = doublet(0.05, noise=0.01, size=size)
    channels = {name: flown[name] for name in ("ped", "r")}
    found = verify(yaw_fit(0.05), record(STEP, **channels, lat=lat * np.sin(flown.time)))
    assert found.elsewhere == (("lat",) if elsewhere else ())
    assert found.acceptable is not elsewhere
    assert ("lat moved, and its inputs ped hardly" in " ".join(str(found).split())) is elsewhere
    assert found.to_dict().get("elsewhere", []) == list(found.elsewhere)


def test_an_output_that_is_noise_does_not_count():
    found = verify(*banked(2000, noise=20.0))
    assert found.quiet == ("phi",)
    assert found.tic == pytest.approx(found.tic_by_output["p"])
    assert verify(*banked(2000, noise=0.01)).quiet == ()


def test_noise_is_told_by_the_fastest_fifth_of_the_spectrum():
    """Scipy's periodogram under Hann's window, whose density of white noise is 2 sigma^2."""
    values = np.random.default_rng(1).normal(size=(601, 2)).cumsum(axis=0)
    density = periodogram(values, window=np.hanning(601), axis=0)[1]
    expected = np.sqrt(0.5 * density[-60:].mean(axis=0))  # of 301 lines
    assert _noise(values) == pytest.approx(expected, rel=1e-9)


@tabled("growth", "samples", "kind", "unstable")
def test_a_model_is_unstable_from_a_hundredth_of_a_doubling_and_cut_from_three(
    growth, samples, kind, unstable
):
    approach = verify(*banked(samples, growth)).approach
    assert approach.kind == kind
    assert approach.pole == ((pytest.approx(growth), 0.0) if unstable else None)
    assert approach.samples == 2 * samples
    grown = np.exp(growth * approach.length_s)
    assert approach.growth == pytest.approx(grown if unstable else 1.0)
