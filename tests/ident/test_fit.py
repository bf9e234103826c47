"""Fits: cost and accuracy with closed forms, starts, delays, known parameters, refusals."""

import math
import sys
from dataclasses import replace

import numpy as np
import pytest

from helisim.base.errors import InputError
from helisim.ident import Parameter, Structure, identify, structures
from helisim.ident.bounds import accuracy
from helisim.ident.cost import Cost, select
from helisim.ident.evaluate import response
from helisim.ident.rational import delay_grid, rational_fits
from ident_data import GRID, HEAVE, ROLLPITCH, YAW, data, fitted, of_model
from script import SCRIPTS

sys.path.insert(0, str(SCRIPTS / "proof"))
from delay_study import study

from tabled import rows, tabled


def gain(*, inputs=("lat",), cell="K", names=("K",)):
    return Structure(
        name="gain",
        parameters=tuple(Parameter(name, "1", 1.0 + k) for k, name in enumerate(names)),
        states=(),
        inputs=inputs,
        outputs=("p",),
        H0=((),),
        D=((cell,) * len(inputs),),
    )


GAIN = gain()
YAW_BASE = structures.yaw_base
WEIGHT = 20.0 * (1.58 * (1.0 - math.exp(-1.0))) ** 2
"""Of a response of coherence 1, in J."""


def test_pure_gain_has_the_closed_form_accuracy():
    """A gain fitted to one response of coherence 1 has I = 1.82 % and CR = 2 I.

    J = 20 W (20 log10 K/K0)^2 with W = [1.58 (1 - 1/e)]^2, so d2J/dK2 = 2 * 20 W (8.686/K)^2
    = 3010 / K^2 and I = K / sqrt(3010) (Tischler and Remple's definitions).
    """
    fit = fitted(GAIN, {"K": -3.0})
    assert fit["K"].value == pytest.approx(-3.0, rel=1e-9)
    assert fit["K"].insensitivity_percent == pytest.approx(1.82, abs=0.005)
    assert fit["K"].cr_percent == pytest.approx(2.0 * 1.8227, abs=0.01)


def test_printed_cost_is_the_average_and_accuracy_uses_the_sum():
    two = gain(inputs=("lat", "lon"))
    frf = of_model(two, {"K": 2.0})
    assert identify(frf, two)["K"].insensitivity_percent == pytest.approx(
        1.8227 / math.sqrt(2.0), abs=0.005
    )
    shifted = identify(frf, two.with_fixed({"K": 2.0 * 10 ** (1.0 / 20.0)}))
    # One dB of error everywhere costs 20 W a response.
    assert shifted.cost == pytest.approx(WEIGHT, rel=1e-9)
    assert list(shifted.costs.values()) == pytest.approx([WEIGHT] * 2, rel=1e-9)


@tabled("low", "high", "ends")
def test_a_parameter_is_at_its_bound_when_the_data_want_it_beyond(low, high, ends):
    free = structures.heave.with_bounds({"Z_w": None}).with_starts({"Z_w": 0.5 * (low + high)})
    fit = identify(of_model(structures.heave, HEAVE), free.with_bounds({"Z_w": (low, high)}))
    assert (fit.at_bound, "at bound" in str(fit)) == (ends, bool(ends))


def test_what_the_data_do_not_see_is_called_poor():
    fit = identify(of_model(GAIN, {"K": 6.0}), gain(cell="a*b", names=("a", "b")))
    assert fit["a"].value * fit["b"].value == pytest.approx(6.0, rel=1e-6)
    assert [one.support for one in fit.parameters.values()] == ["degenerate"] * 2
    assert math.isinf(fit["a"].cr_percent)
    assert fit.to_dict()["parameters"][0]["cr_percent"] is None


def test_responses_that_can_not_be_fitted_are_left_out_and_named():
    clean = of_model(structures.rollpitch, ROLLPITCH)
    coherence = clean.coherence.copy()
    coherence[0, 1] = 0.3
    fit = identify(replace(clean, coherence=coherence), structures.rollpitch)
    assert fit.dropped == ("p/lon",)
    assert "left out for lack of coherence: p/lon" in str(fit)
    assert set(fit.costs) == {"p/lat", "q/lat", "q/lon"}
    none = dict.fromkeys(("A_b", "B_a", "A_lat", "B_lon"), 0.0)
    zero = of_model(structures.rollpitch, ROLLPITCH | none).response.copy()
    zero[0, 1] = zero[1, 0] = 0.0
    fit = identify(replace(clean, response=zero), structures.rollpitch.with_fixed(none))
    assert fit.dropped == ("p/lon", "q/lat")
    assert fit["tau_lat"].value == pytest.approx(ROLLPITCH["tau_lat"], rel=1e-6)
    assert fit.cost < 1e-9


def test_a_response_that_the_structure_lacks_is_left_out_and_told():
    apart = Structure(
        name="apart",
        parameters=tuple(
            Parameter(name, "1", start)
            for name, start in (("L_p", -2.0), ("L_lat", 10.0), ("Z_w", -1.0), ("Z_col", -30.0))
        ),
        states=("p", "w"),
        inputs=("lat", "col"),
        outputs=("p", "w"),
        F=(("L_p", "0"), ("0", "Z_w")),
        G=(("L_lat", "0"), ("0", "Z_col")),
    )
    truth = {"L_p": -3.0, "L_lat": 20.0, "Z_w": -0.6, "Z_col": -40.0}
    found = response(apart, truth, GRID)
    found[0, 1] = 0.01
    frf = data(found, inputs=apart.inputs, outputs=apart.outputs)
    fit = identify(frf, apart)
    # to rounding, as everything that is fitted is exact
    assert fit.values == pytest.approx(truth, rel=1e-6)
    assert set(fit.costs) == {"p/lat", "w/col"}
    assert set(fit.dropped) == {"p/col", "w/lat"}
    assert [line for line in fit.remarks if "zero in the structure: p/col;" in line]
    assert not [line for line in fit.remarks if "lack of coherence" in line]
    with pytest.raises(InputError, match=r"p/col is zero in 'apart'.*from col to p"):
        identify(frf, apart, responses=("p/lat", "p/col"))


G = 9.80665
HOVER = {
    "X_u": -0.05, "X_a": -G, "Y_v": -0.15, "Y_b": G, "L_u": -0.5, "L_v": 0.4, "L_b": 170.0,
    "M_u": -0.2, "M_v": -0.2, "M_a": 80.0, "tau_f": 0.05, "A_b": -0.2, "B_a": 0.35,
    "A_lat": 0.03, "A_lon": -0.1, "B_lat": 0.14, "B_lon": 0.014, "tau_lat": 0.05,
    "tau_lon": -0.01,
}  # fmt: skip
"""Of the size of a small helicopter's; no published set."""
INFLOW = {"Z_w": -0.9, "Z_col": -25.0, "tau_0": 0.05, "C": 0.6, "tau_col": 0.01}
TURN = {"turn": 1.0 / 178.0}
SLOPES = {**ROLLPITCH, "C": 0.6, "tau_1": 0.03, **TURN, "torque": 0.02}
HOVER_SLOPES = {
    **SLOPES, "X_u": -0.05, "X_a": -9.8, "Y_v": -0.15, "Y_b": 9.8, "L_u": -1.5, "L_v": -1.2,
    "M_u": 0.9, "M_v": -0.8,
}  # fmt: skip


@tabled("structure", "values", "band")
def test_large_structures_come_back_from_their_own_responses(structure, values, band):
    fit = fitted(structure, values, np.geomspace(*band, 160), frequencies_per_response=40)
    assert fit.values == pytest.approx(values, rel=1e-3)


@pytest.mark.parametrize("seed", range(2))
def test_exact_data_give_exact_parameters_from_any_seed(seed):
    fit = identify(of_model(structures.rollpitch, ROLLPITCH), structures.rollpitch, seed=seed)
    assert fit.values == pytest.approx(ROLLPITCH, rel=1e-4)  # the optimiser's tolerance
    assert fit.converged
    assert fit.cost < 1e-6


def test_a_delay_of_many_turns_is_unwrapped():
    values = {"N_r": -0.7, "N_ped": -50.0, "tau_r_base": 0.28}
    fit = fitted(structures.yaw_base, values, np.geomspace(0.5, 60.0, 120))
    assert fit.values == pytest.approx(values, rel=1e-5)


@tabled("structure", "options", "error", "message")
def test_bad_calls_are_refused_with_advice(structure, options, error, message):
    with pytest.raises(error, match=message):
        identify(of_model(YAW_BASE, YAW), structure, **options)


WIDE = np.geomspace(0.1, 10.0, 80)


def curve(num, den, tau):
    s = 1j * WIDE
    return np.polyval(num, s) / np.polyval(den, s) * np.exp(-tau * s)


@pytest.mark.parametrize("tau", [-0.25, 0.5, 1.25])
def test_a_rational_fit_needs_no_start(tau):
    """Coefficients of exact data to 1e-6, at any delay: 1.25 s is two cycles of 10 rad/s."""
    num, den = (2.0, -1.0, 5.0), (1.0, 3.0, 4.0, 2.0)
    weight, grid = np.ones(WIDE.size), delay_grid(WIDE)
    fits = rational_fits(WIDE, curve(num, den, tau), weight, zeros=2, poles=3, delays=grid)
    best = np.argmin(fits.errors)
    assert fits.delays[best] == pytest.approx(tau, abs=1e-6)
    np.testing.assert_allclose(fits.numerators[best], num[::-1], rtol=1e-6)
    np.testing.assert_allclose(fits.denominators[best], den[::-1], rtol=1e-6)


@pytest.mark.parametrize("given", [{"b1": 0.0, "a0": 0.0}, {"tau": 0.4}])
def test_what_is_given_of_a_transfer_function_stays(given):
    truth = {"b1": 3.0, "b0": -2.0, "a1": 1.5, "a0": 4.0, "tau": 0.4} | given
    structure = structures.transfer_function(zeros=1, poles=2, input="u", output="y")
    found = curve((truth["b1"], truth["b0"]), (1.0, truth["a1"], truth["a0"]), truth["tau"])
    fit = identify(data(found, WIDE), structure.with_fixed(given), searches=1)
    assert fit.values == pytest.approx(truth, rel=1e-6)


@pytest.mark.parametrize(("case", "number"), [("1/2", 6), ("rollpitch", 2)])
def test_random_systems_are_found(case, number):
    assert study(case, 0.5, 77, number) == number


def test_each_delay_of_a_structure_is_scanned_whatever_the_signs():
    """Two outputs over one first-order lag, 0.05 and 0.45 s late, one of the other sign.

    The second gain starts at +1 and is -0.5: only a start of the other sign leads there.
    """
    lag = Structure(
        name="lag",
        parameters=(
            Parameter("T", "s", 1.0, (0.01, 10.0)),
            *(Parameter(name, "1", 1.0) for name in ("K", "K_2")),
            *(Parameter(name, "s", 0.0, (-0.3, 5.0), scale=0.03) for name in ("tau_1", "tau_2")),
        ),
        states=("x",),
        inputs=("u",),
        outputs=("y", "z"),
        M=(("T",),),
        F=(("-1",),),
        G=(("K",),),
        H0=(("1",), ("K_2",)),
        output_delays={"y": "tau_1", "z": "tau_2"},
    )
    truth = {"T": 0.3, "K": 2.0, "K_2": -0.5, "tau_1": 0.05, "tau_2": 0.45}
    both = [curve((2.0,), (0.3, 1.0), 0.05), curve((-1.0,), (0.3, 1.0), 0.45)]
    fit = identify(data(both, WIDE, outputs=["y", "z"]), lag)
    assert fit.values == pytest.approx(truth, rel=1e-5)
    assert fit.searches_agreeing >= 2


KNOWN_GRID = np.geomspace(0.5, 20.0, 30)
AT = 1j * KNOWN_GRID
BEHIND_SERVO = Structure(**dict(rows(globals(), "BEHIND_SERVO")))


def yaw_data(found, **options):
    return data(found, KNOWN_GRID, inputs=("ped",), outputs=("r",), **options)


@pytest.fixture(scope="module")
def known():
    behind = 50.0 / (AT + 0.7) / (1.0 + 0.05 * AT)
    return identify(yaw_data(behind, noise=0.01, seed=2), BEHIND_SERVO)


def test_what_a_known_error_makes_of_the_others_is_what_fits_with_other_values_find(known):
    exact = identify(known.data, BEHIND_SERVO.with_fixed({"lag": 0.05}))
    step = 1e-4
    ends = [
        identify(known.data, BEHIND_SERVO.with_fixed({"lag": 0.05 + sign * step})).values
        for sign in (1.0, -1.0)
    ]
    names = [one.name for one in BEHIND_SERVO.free]
    slope = np.array([(ends[0][name] - ends[1][name]) / (2.0 * step) for name in names])
    # residuals of 1 % bend the cost by as much, which Gauss and Newton's derivative leaves out
    added = known.covariance - exact.covariance
    assert added == pytest.approx(0.01**2 * np.outer(slope, slope), rel=0.02)
    assert known["lag"].standard_error == 0.01
    assert known["lag"].interval == pytest.approx((0.05 - 0.0196, 0.05 + 0.0196))


def test_the_residual_is_what_the_structure_cannot_follow():
    ripple = 1.0 + 0.02 * np.sqrt(2.0) * np.cos(2.0 * np.pi * np.arange(AT.size) / 2.5)
    frf = yaw_data(50.0 / (AT + 0.7) * ripple)
    found = identify(frf, structures.yaw_base, frequencies_per_response=30)
    # the ripple's own nonlinearity in dB, and the little that three parameters take from it
    assert found.residual.magnitude["r/ped"] == pytest.approx(0.4 / math.log(10.0), rel=0.05)
    assert found.residual.percent["r/ped"] == pytest.approx(2.0, rel=0.05)
    # a tenth of a ripple of 1.15 deg: the delay takes what it can of the uneven ends
    assert found.residual.phase["r/ped"] < 0.1
    assert found.residual.ratio is None
    assert "dB, " in str(found)


def test_without_known_errors_residuals_count_as_independent():
    """Standard errors are then those of least squares, with n minus p degrees of freedom."""
    frf = of_model(YAW_BASE, YAW, noise=0.05, seed=5)
    cost = Cost(YAW_BASE, select(frf, YAW_BASE, band=None, responses=None, count=20))
    x = np.array([YAW[parameter.name] for parameter in structures.yaw_base.free])
    jacobian, residual = cost.log_jacobian(x), cost.log(x, unwrap=False)
    variance = residual @ residual / (residual.size - x.size)
    expected = np.sqrt(variance * np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    assert accuracy(cost, x).standard_error == pytest.approx(expected, rel=1e-8)


# Accuracy where numbers are at their limits: what only rounding sees, and units far apart.

FREQUENCY = np.geomspace(0.5, 20.0, 60)
WOBBLE = np.random.default_rng(0).standard_normal((2, 60)).T @ [1.0, 1.0j]
LAG = structures.transfer_function(zeros=0, poles=1, input="lat", output="p")


def test_what_only_rounding_sees_has_no_bounds():
    structure = Structure(
        name="cancelling",
        parameters=(
            *(Parameter("Z_w", "1/s", -0.6), Parameter("Z_col", "m/s^2", -40.0)),
            Parameter("M_col", "1/s^2", 1.1),
        ),
        states=("w", "q", "three_q"),
        inputs=("col",),
        outputs=("w",),
        F=(("Z_w", "0", "0"), ("0", "-2.1", "0"), ("0", "0", "-2.1")),
        G=(("Z_col",), ("M_col",), ("3*M_col",)),
        H0=(("1", "1", "-1/3"),),
    )
    known = -40.0 / (1j * FREQUENCY + 0.6) * np.exp(0.01 * WOBBLE)
    fit = identify(data(known, FREQUENCY, inputs=["col"], outputs=["w"]), structure)
    assert math.isinf(fit["M_col"].cramer_rao)
    assert math.isinf(fit["M_col"].standard_error)
    assert fit["M_col"].support == "not seen"
    assert fit["Z_w"].support == fit["Z_col"].support == "good"


def test_units_of_parameters_do_not_change_their_relative_accuracy():
    other = replace(
        LAG,
        parameters=tuple(
            replace(one, start=one.start * {"b0": 1e9, "a0": 1e-9}.get(one.name, 1.0))
            for one in LAG.parameters
        ),
        F=(("-1e9*a0",),),
        G=(("1e-9*b0",),),
    )
    s = 1j * FREQUENCY
    exact = 3.0 / (s + 2.0) * np.exp(-0.1 * s + 0.01 * WOBBLE)
    frf = data(exact, FREQUENCY, inputs=["lat"], outputs=["p"])
    known = {"tau": 0.1}, {"tau": 0.01}
    one, two = (identify(frf, a.with_fixed(*known)) for a in (LAG, other))
    for name in ("b0", "a0"):
        expected = one[name].standard_error / one[name].value
        # to how far two searches of the same minimum end apart
        assert two[name].standard_error / two[name].value == pytest.approx(expected, rel=1e-4)
