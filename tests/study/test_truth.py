"""The truth that an identification is judged by, and structures fitted to exact responses."""

from dataclasses import replace

import numpy as np
import pytest

from helisim import ident
from helisim.design.exact import air_met
from helisim.sim import Recorder, Weather
from helisim.study.models import HEAVE, ROLLPITCH_IN2, YAW_BASE, YAW_GYRO, YAW_OVERALL
from helisim.study.truth import exact_response, true_values

GAINS = ("k_p", "k_delta", "k_a")
LIGHT = Weather(turbulence="light")


@pytest.fixture(scope="module")
def recorder(jr700):
    return Recorder.of(jr700)


def fitted_gyro(vehicle, recorder, **given):
    """The gyro's parameters from its exact response, and from true knowledge of the rest."""
    omega = np.geomspace(*YAW_GYRO.band, 100)
    exact = exact_response(vehicle, YAW_GYRO, recorder, omega)
    known = {
        "N_ped": vehicle.derivatives["N_ped"],
        "tau_r_base": vehicle.servo_delay("ped") + recorder.latency["r"],
        "tau_r": recorder.latency["r"],
        "lead": vehicle.parameters["gyro.lead"],
        "lead_filter": 0.00263,  # of 2.5 ms, sampled every 2 ms
        "k_I": vehicle.parameters["gyro.k_i"],
    }
    return ident.identify(exact, YAW_GYRO.structure.with_fixed(known | given))


def test_the_yaw_gyros_structure_has_all_that_is_in_the_loop(jr700, recorder):
    fit = fitted_gyro(jr700, recorder)
    truth = true_values(jr700, YAW_GYRO, recorder)
    for name in (*GAINS, "N_r_slip", "tau_PED"):
        # 0.4 % measured: the lead as it is sampled, 0.1 ms of the loop's 10
        assert fit.values[name] == pytest.approx(truth[name], rel=0.006), name


def test_the_damping_in_the_gyros_loop_is_that_of_a_slipping_helicopter(jr700, recorder):
    """N_r (1 + I_zz/(m l^2)): the tail's thrust moves the helicopter sideways as it turns it."""
    slip = true_values(jr700, YAW_GYRO, recorder)["N_r_slip"]
    arm, mass = jr700.parameters["tail_rotor.arm_x"], 8.01
    share = jr700.parameters["airframe.izz"] / (mass * arm**2)
    # 0.1 %: the tail's thrust is not all of the force that side velocity makes
    assert slip == pytest.approx(jr700.derivatives["N_r"] * (1.0 + share), rel=2e-3)


def test_an_equivalents_truth_depends_on_the_weights(jr700, recorder):
    """Doubt p/LON around its dip, and the low-order fit gives up something else there."""
    omega = np.geomspace(*ROLLPITCH_IN2.band, 200)
    even = exact_response(jr700, ROLLPITCH_IN2, recorder, omega)
    plain = true_values(jr700, ROLLPITCH_IN2, recorder)
    same = true_values(jr700, ROLLPITCH_IN2, recorder, like=even)
    assert same == pytest.approx(plain, rel=1e-9)
    coherence = even.coherence.copy()
    coherence[0, 1, (omega > 12.0) & (omega < 25.0)] = 0.65
    doubted = true_values(jr700, ROLLPITCH_IN2, recorder, like=replace(even, coherence=coherence))
    assert abs(doubted["tau_lon"] / plain["tau_lon"] - 1.0) > 0.02
    # the base model's truth is in the vehicle, whatever the weights
    assert true_values(jr700, YAW_BASE, recorder)["N_r"] == jr700.derivatives["N_r"]


@pytest.mark.study
def test_the_truth_in_gusts_is_the_mean_over_the_air(jr700, recorder):
    air = air_met(jr700, LIGHT)
    for model, name in ((HEAVE, "Z_w"), (YAW_GYRO, "N_r_slip")):
        mean = true_values(jr700, model, recorder, air=air)[name]
        each = [true_values(there, model, recorder)[name] for _, there in air]
        assert mean == pytest.approx(sum(share * x for (share, _), x in zip(air, each)), rel=1e-3)
        assert mean != pytest.approx(true_values(jr700, model, recorder)[name], rel=1e-3)
    calm, same = (true_values(jr700, HEAVE, recorder, air=some) for some in (None, air))
    assert calm["tau_col"] == same["tau_col"]
    calm, mean = (true_values(jr700, YAW_OVERALL, recorder, air=some) for some in (None, air))
    each = sum(share * true_values(there, YAW_OVERALL, recorder)["a0"] for share, there in air)
    # the fit of a mean is not quite the mean of fits, by 7e-4
    assert mean["a0"] == pytest.approx(each, rel=1e-3)
    assert abs(mean["a0"] / calm["a0"] - 1.0) > 1e-3
