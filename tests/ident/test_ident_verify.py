"""Time-domain simulation and verification."""

import json

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import cont2discrete, dlsim

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.units import UserUnits
from helisim.ident import Fit, FrequencyResponse, identify, structures, verify
from helisim.ident.evaluate import delayed, matrices, response, simulate, state_space
from helisim.ident.verification import Approach, overall_theil, theil
from helisim.records.record import FlightRecord, channel


def test_simulation_is_the_exact_discretisation():
    """The blocked simulation equals scipy's step-by-step one, also for an unstable model."""
    random = np.random.default_rng(0)
    for shift in (-2.0, 0.3):
        a = random.normal(size=(4, 4)) + shift * np.eye(4)
        b, c = random.normal(size=(4, 2)), random.normal(size=(2, 4))
        inputs = random.normal(size=(333, 2))
        inputs[0] = 0.0  # scipy's first-order hold starts from a shifted state otherwise
        a_d, b_d, c_d, d_d, step = cont2discrete((a, b, c, np.zeros((2, 2))), 0.01, method="foh")
        expected = dlsim((a_d, b_d, c_d, d_d, step), inputs)[1]
        got = simulate(control.ss(a, b, c, 0), inputs, 0.01)
        np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-10 * np.max(np.abs(expected)))


def test_simple_models_simulate_as_their_closed_forms():
    """A decay from an initial state is the exponential; a model without states is its gain."""
    model = control.ss([[-2.0]], [[1.0]], [[3.0]], [[0.0]])
    got = simulate(model, np.zeros((200, 1)), 0.01, start=np.array([1.0]))
    np.testing.assert_allclose(got[:, 0], 3.0 * np.exp(-0.02 * np.arange(200)), rtol=1e-12)
    gain = simulate(control.ss([], [], [], [[2.0]]), np.ones((70, 1)), 0.01)
    assert gain == pytest.approx(2.0)


@given(
    lag=st.integers(-37, 37),
    other=st.integers(-37, 37),
    seed=st.integers(0, 1000),
)
def test_delays_of_either_sign_are_exact_between_samples(lag, other, seed):
    """A delay of so many tenths of a sample is what a ten times finer simulation shifts by."""
    random = np.random.default_rng(seed)
    model = control.ss(
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
    frequency = np.geomspace(0.3, 25.0, 60)
    frf = FrequencyResponse.exact(
        frequency,
        response(structures.yaw_base, values, frequency),
        inputs=("ped",),
        outputs=("r",),
    )
    return identify(frf, structures.yaw_base)


def doublet(delay, *, bias=0.0, trim=0.0, noise=0.0, size=0.1, seed=0):
    """A smooth doublet flown by the true yaw model, with sensor bias and control trim."""
    values = {**YAW, "tau_r_base": delay}
    time = np.arange(600) * STEP
    ped = size * np.sin(2.0 * np.pi * (time - 1.0) / 1.5) * ((time > 1.0) & (time < 2.5))
    numbers = matrices(structures.yaw_base, values)
    model = state_space(structures.yaw_base, values)
    r = delayed(model, ped[:, None], STEP, numbers.input_delays[None, :])[:, 0]
    r = r + bias + noise * np.random.default_rng(seed).standard_normal(time.size)
    return FlightRecord(time, np.stack([ped + trim, r], axis=1), (channel("ped"), channel("r")))


@pytest.mark.parametrize("delay", [0.0333, -0.0127])
def test_the_true_model_predicts_without_error(delay):
    """With a delay of either sign between samples, bias and trim, nothing is left."""
    result = verify(yaw_fit(delay), doublet(delay, bias=0.3, trim=-0.2))
    assert result.j_rms < 1e-5
    assert result.tic < 1e-5
    assert result.traces[0].residual.shape == (600, 1)
    assert result.traces[0].starts.size == 0  # one state serves the record
    # a model whose delay is 40 ms off predicts worse: it is simulated, not dropped
    assert verify(yaw_fit(0.0), doublet(0.04)).tic > 0.02


def test_a_verification_in_other_units_is_scaled():
    """Its outputs, with all that is told of them; coefficients have no unit."""
    result = verify(yaw_fit(0.02), doublet(0.02, bias=0.3, noise=0.01))
    shown, many = result.in_units(UserUnits.of("deg")), np.degrees(1.0)
    assert shown.units == ("deg/s",)
    assert shown.j_rms == pytest.approx(result.j_rms * many)
    assert shown.j_rms_by_output["r"] == pytest.approx(result.j_rms_by_output["r"] * many)
    assert shown.tic == result.tic
    for name in ("measured", "predicted", "bias", "telling"):
        one, other = (getattr(found.traces[0], name) for found in (shown, result))
        assert one == pytest.approx(other * many)


def test_several_records_are_pooled_and_told_apart():
    """Overall figures pool the records' errors; each record has its own, and all are stored."""
    fit = yaw_fit(0.02)
    quiet, noisy = doublet(0.02, noise=0.001), doublet(0.02, noise=0.03, seed=1)
    result = verify(fit, [quiet, noisy])
    one, two = (float(trace.j_rms[0]) for trace in result.traces)
    assert one == pytest.approx(0.001, rel=0.1)
    assert two == pytest.approx(0.03, rel=0.1)
    assert result.j_rms == pytest.approx(np.hypot(one, two) / np.sqrt(2.0), rel=1e-9)
    assert result.traces[0].tic[0] < result.tic < result.traces[1].tic[0]
    plain = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert [row["j_rms"]["r"] for row in plain["records"]] == [one, two]
    assert plain["outputs"][0]["unit"] == "rad/s"


def test_theil_is_near_one_for_a_model_that_predicts_nothing():
    """A model of no gain has a coefficient near one, the right one, as it was stored, of zero."""
    fit, record = yaw_fit(0.015), doublet(0.015, noise=0.01)
    again = Fit.from_dict(json.loads(json.dumps(fit.to_dict())))
    assert verify(again, record).to_dict() == verify(fit, record).to_dict()
    plain = yaw_fit(0.0).to_dict()
    assert verify(Fit.from_dict(plain), doublet(0.0)).tic < 1e-5
    next(row for row in plain["parameters"] if row["name"] == "N_ped")["value"] = 1e-9
    # The free motion of N_r alone can stand for a part of the doublet.
    assert verify(Fit.from_dict(plain), doublet(0.0)).tic > 0.7


def test_unsuitable_records_are_refused():
    """No records and a missing channel end in messages that say what exists."""
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


def test_what_does_not_move_has_no_theil_coefficient():
    """Zero over zero is zero, by output and in all; a still output leaves the others alone."""
    still, moving = np.zeros((5, 2)), np.array([[0.0, 1.0], [0.0, -1.0]])
    assert list(theil(still, still)) == [0.0, 0.0]
    assert overall_theil(still, still) == 0.0
    assert list(theil(moving, -moving)) == [0.0, 1.0]
    # of two outputs of which one stands still, the mean squares are halved on both sides
    assert overall_theil(moving, -moving) == pytest.approx(1.0)


def wandering(samples, *, moves=True):
    """Return a record in which the pedal wanders; the yaw rate is noise, or stands still."""
    random = np.random.default_rng(6)
    ped = 0.001 * np.cumsum(random.standard_normal(samples))
    r = random.standard_normal(samples) if moves else np.zeros(samples)
    channels = (channel("ped"), channel("r"))
    return FlightRecord(0.02 * np.arange(samples), np.stack([ped, r], axis=1), channels)


def test_the_past_that_gives_a_state_is_a_period_of_the_lowest_frequency():
    """At most half of the longest record; a length that is asked for is taken."""
    fit = yaw_fit(0.0)  # from 0.3 rad/s
    period = 2.0 * np.pi / 0.3
    long, short = wandering(3000), wandering(1001)
    assert verify(fit, long, ahead=0.2).approach.length_s == pytest.approx(period)
    assert verify(fit, short, ahead=0.2).approach.length_s == pytest.approx(10.0)
    assert verify(fit, long, ahead=0.2, segment=7.0).approach.length_s == pytest.approx(7.0)


def test_an_output_that_stands_still_is_predicted_in_segments_too():
    """It has no size to be weighed by; what the model predicts is all error."""
    found = verify(yaw_fit(0.0), wandering(2000, moves=False), segment=5.0)
    assert found.j_rms > 0.0
    assert found.tic == pytest.approx(1.0)


def test_what_an_unstable_pole_does_is_its_exponential():
    """An error doubles in ln 2 / real part, whatever the imaginary part is."""
    told = {"pole": (0.3, 1.2), "estimated": 4, "samples": 90}
    parts = Approach(kind="segments", length_s=2.0, **told)
    ahead = Approach(kind="ahead", length_s=2.0, ahead_s=0.5, **told)
    assert parts.doubling_s == ahead.doubling_s == pytest.approx(np.log(2.0) / 0.3)
    assert parts.growth == pytest.approx(np.exp(0.6))
    assert ahead.growth == pytest.approx(np.exp(0.15))
    assert "its pole 0.3 +- 1.2j rad/s doubles an error in 2.31 s" in str(parts)
    assert "segments of 2 s, over which one grows 1.8 times" in str(parts)
    assert "0.5 s ahead, over which one grows 1.2 times" in str(ahead)
    assert Approach.from_dict(json.loads(json.dumps(ahead.to_dict()))) == ahead
    stable = Approach(kind="whole", length_s=9.0, estimated=1, samples=9)
    assert stable.growth == 1.0
    assert stable.doubling_s is None
    assert str(stable).startswith("each record predicted whole, up to 9 s, from one")
    assert Approach.from_dict(json.loads(json.dumps(stable.to_dict()))) == stable
