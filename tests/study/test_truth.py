"""The truth that an identification is judged by, and structures fitted to exact responses."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial.hermite_e import hermegauss

from helisim import ident
from helisim.design.exact import air_met
from helisim.physics.motion import flip
from helisim.sim import Recorder, Weather
from helisim.study.models import HEAVE, ROLLPITCH_IN2, YAW_BASE, YAW_GYRO, YAW_OVERALL
from helisim.study.truth import exact_response, mean_derivatives, true_values

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
    """Fitted to the exact response, it gives the gains that were set and the slipping damping."""
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


@pytest.mark.parametrize("left_out", [{"lead": 1e-9}, {"tau_r": 0.0504}], ids=["lead", "servo"])
def test_what_is_left_out_of_the_loop_biases_the_gains(jr700, recorder, left_out):
    """Servo and lead nearly cancel: knowing one without the other is worse than neither."""
    fit = fitted_gyro(jr700, recorder, **left_out)
    truth = true_values(jr700, YAW_GYRO, recorder)
    assert all(abs(fit.values[name] / truth[name] - 1.0) > 0.2 for name in GAINS)
    neither = fitted_gyro(jr700, recorder, lead=1e-9, tau_r=0.0504)
    # 2.0 % measured, as much again as the flights' own scatter allows
    assert 0.01 < max(abs(neither.values[name] / truth[name] - 1.0) for name in GAINS) < 0.03


def test_signals_tell_the_gains_up_to_one_factor(jr700, recorder):
    right = fitted_gyro(jr700, recorder)
    double = fitted_gyro(jr700, recorder, k_I=2.0 * jr700.parameters["gyro.k_i"])
    for name, factor in (("k_p", 2.0), ("k_delta", 0.5), ("k_a", 0.5)):
        # where two searches of one minimum end
        assert double.values[name] == pytest.approx(factor * right.values[name], rel=1e-4)
    assert double.cost == pytest.approx(right.cost, rel=1e-4, abs=1e-9)


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


def test_calm_air_is_met_as_it_is(jr700):
    """One wind, which blows all the time: the steady one."""
    ((share, there),) = air_met(jr700, Weather())
    assert (share, there) == (1.0, jr700)
    ((share, there),) = air_met(jr700, Weather(wind=3.0))
    assert share == 1.0
    assert there.derivatives["Z_w"] == jr700.trimmed(wind=(-3.0, 0.0, 0.0)).derivatives["Z_w"]


def test_heave_damping_in_gusts(jr700):
    """It grows with the square of the wind along the disc; gusts down and up take some of it back.

    An updraught is a descent, at whose 0.3 v_h the vortex ring begins.
    """
    mean = mean_derivatives(air_met(jr700, LIGHT, points=(5, 5, 5)))["Z_w"]

    def damping(*wind):
        return jr700.trimmed(wind=wind).derivatives["Z_w"]

    level, _, vertical = LIGHT.dryden.rms
    still = damping(0.0, 0.0, 0.0)
    # two axes of level wind, each adding its mean square
    expected = 2.0 * (damping(level, 0.0, 0.0) - still)
    # the mean over the vertical one, which is far from a parabola where the ring begins
    nodes, weights = hermegauss(5)
    changes = [damping(0.0, 0.0, vertical * node) - still for node in nodes]
    expected += weights @ changes / weights.sum()
    # both at once: of fourth order
    assert mean - still == pytest.approx(expected, rel=0.2)


def test_gusts_lie_along_the_path_through_the_air(jr700):
    """A rms of its own along the path is from the side where the wind comes from there."""
    rms = (2.0, 0.1, 0.1)
    weather = Weather(wind=1.0, wind_from=np.pi / 2, rms=rms)
    air = air_met(jr700, weather, points=(3, 3, 3))
    assert sum(share for share, _ in air) == pytest.approx(1.0, rel=1e-12)
    winds = np.array([flip(*there.model.opt.wind) for _, there in air])
    shares = np.array([share for share, _ in air])
    mean = shares @ winds
    assert mean == pytest.approx([0.0, -1.0, 0.0], abs=1e-12)
    spread = np.sqrt(shares @ (winds - mean) ** 2)
    # the quadrature has the variance of the normal distribution, and the path points east
    assert spread == pytest.approx([0.1, 2.0, 0.1], rel=1e-9)


@pytest.mark.study
def test_the_truth_in_gusts_is_the_mean_over_the_air(jr700, recorder):
    """Derivatives, the gyro's sideslip and the equivalents; delays stay."""
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
