"""Fits: cost, accuracy figures with closed forms, verdicts and refusals."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from helisim.base.errors import IdentificationError, InputError, UnknownNameError
from helisim.ident import FrequencyResponse, Parameter, Structure, identify, structures
from helisim.ident.bounds import gauss_newton_hessian
from helisim.ident.cost import Cost, select
from helisim.ident.evaluate import response

FREQUENCY = np.geomspace(0.5, 20.0, 60)
GAIN = Structure(
    name="gain",
    parameters=(Parameter("K", "1", 1.0),),
    states=(),
    inputs=("lat",),
    outputs=("p",),
    H0=((),),
    D=(("K",),),
)
YAW = {"N_r": -0.7, "N_ped": 50.0, "tau_r_base": 0.04}


def exact(structure, values, frequency=FREQUENCY):
    return FrequencyResponse.exact(
        frequency,
        response(structure, values, frequency),
        inputs=structure.inputs,
        outputs=structure.outputs,
    )


def noisy(structure, values, size, seed=0):
    clean = exact(structure, values)
    random = np.random.default_rng(seed)
    wobble = random.standard_normal(clean.response.shape) + 1j * random.standard_normal(
        clean.response.shape
    )
    return FrequencyResponse.exact(
        clean.frequency,
        clean.response * np.exp(size * wobble),
        inputs=clean.inputs,
        outputs=clean.outputs,
    )


def test_pure_gain_has_the_closed_form_accuracy():
    """A gain fitted to one response of coherence 1 has I = 1.82 % and CR = 2 I.

    J = 20 W (20 log10 K/K0)^2 with W = [1.58 (1 - 1/e)]^2, so d2J/dK2 = 2 * 20 W (8.686/K)^2
    = 3010 / K^2 and I = K / sqrt(3010) (Tischler and Remple's definitions).
    """
    fit = identify(exact(GAIN, {"K": -3.0}), GAIN)
    assert fit["K"].value == pytest.approx(-3.0, rel=1e-9)
    assert fit["K"].insensitivity_percent == pytest.approx(1.82, abs=0.005)
    assert fit["K"].cr_percent == pytest.approx(2.0 * 1.8227, abs=0.01)


def test_printed_cost_is_the_average_and_accuracy_uses_the_sum():
    """Two responses of the same gain halve the variance but leave the average cost alone."""
    two = Structure(
        name="gains",
        parameters=GAIN.parameters,
        states=(),
        inputs=("lat", "lon"),
        outputs=("p",),
        H0=((),),
        D=(("K", "K"),),
    )
    fit = identify(exact(two, {"K": 2.0}), two)
    assert fit["K"].insensitivity_percent == pytest.approx(1.8227 / math.sqrt(2.0), abs=0.005)
    shifted = identify(exact(two, {"K": 2.0}), two.with_fixed({"K": 2.0 * 10 ** (1.0 / 20.0)}))
    # One dB of error everywhere costs 20 W a response.
    weight = (1.58 * (1.0 - math.exp(-1.0))) ** 2
    assert shifted.cost == pytest.approx(20.0 * weight, rel=1e-9)
    assert list(shifted.costs.values()) == pytest.approx([20.0 * weight] * 2, rel=1e-9)


@pytest.mark.parametrize("count", [20, 40])
def test_cost_does_not_depend_on_the_number_of_points(count):
    """One degree of phase error everywhere costs 0.01745 * 20 W for any number of points."""
    data = exact(GAIN, {"K": 1.0})
    turned = FrequencyResponse.exact(
        data.frequency, data.response * np.exp(1j * np.deg2rad(1.0)), inputs=["lat"], outputs=["p"]
    )
    fit = identify(turned, GAIN, frequencies_per_response=count)
    weight = (1.58 * (1.0 - math.exp(-1.0))) ** 2
    assert fit.cost == pytest.approx(0.01745 * 20.0 * weight, rel=1e-6)


def exact_hessian(cost, x):
    """Return the full Hessian of J by central differences of its exact gradient."""

    def gradient(at):
        return 2.0 * cost.log_jacobian(at).T @ cost.log(at, unwrap=False)

    shifts = np.diag(1e-5 * np.maximum(np.abs(x), 1e-3))
    columns = [(gradient(x + d) - gradient(x - d)) / (2.0 * d.max()) for d in shifts]
    hessian = np.stack(columns, axis=1)
    return 0.5 * (hessian + hessian.T)


def test_gauss_newton_hessian_is_the_exact_one_at_a_perfect_fit():
    """Without residuals the neglected curvature vanishes, and nearly so with small ones."""
    structure = structures.yaw_base
    for size, tolerance in ((0.0, 1e-5), (0.02, 0.05)):
        frf = noisy(structure, YAW, size)
        fit = identify(frf, structure)
        points = select(frf, structure, band=None, responses=None, count=20)
        cost = Cost(structure, points)
        x = np.array([fit[name].value for name in structure.names])
        quick = gauss_newton_hessian(cost.log_jacobian(x))
        scale = np.sqrt(np.diagonal(quick))
        gap = (exact_hessian(cost, x) - quick) / np.outer(scale, scale)
        # 2 % noise is a tenth of a dB and a degree: the curvature term is of that order.
        assert np.max(np.abs(gap)) < tolerance


def test_jacobian_of_the_cost_equals_finite_differences():
    """Both kinds of residuals have their exact Jacobian."""
    structure = structures.rollpitch
    values = {p.name: p.start or 0.3 * p.magnitude for p in structure.parameters}
    other = {name: 1.2 * value for name, value in values.items()}
    points = select(exact(structure, other), structure, band=None, responses=None, count=20)
    cost = Cost(structure, points)
    x = np.array(list(values.values()))
    for residual, jacobian in (
        (cost.log, cost.log_jacobian(x)),
        (cost.relative, cost.relative_jacobian(x)),
    ):
        for k in range(x.size):
            step = np.zeros_like(x)
            step[k] = 1e-6 * x[k]
            numeric = (residual(x + step) - residual(x - step)) / (2.0 * step[k])
            size = np.max(np.abs(jacobian[:, k]))
            # Central differences at 1e-6: rounding 1e-10 of the residuals, over the step.
            np.testing.assert_allclose(jacobian[:, k], numeric, atol=1e-5 * size)


def test_standard_error_is_the_scatter_of_replicates():
    """The residual-scaled standard error is the scatter; the Cramér-Rao bound is not scaled."""
    structure = structures.yaw_base
    found, stated = [], []
    for seed in range(120):
        fit = identify(noisy(structure, YAW, 0.03, seed), structure, searches=1)
        found.append([one.value for one in fit.parameters.values()])
        stated.append([one.standard_error for one in fit.parameters.values()])
    ratio = np.mean(stated, axis=0) / np.std(found, axis=0)
    # 120 replicates know a scatter to 6.5 %, so three sigma are 20 %. The cost weighs dB and
    # degrees by 0.01745 = 1/57.3, where equal errors would have (8.686/57.3)^2 = 1/43.5.
    np.testing.assert_allclose(ratio, 1.0, atol=0.25)


def test_fixed_parameters_stay_and_are_marked():
    """A fixed parameter keeps its value and claims no accuracy."""
    fit = identify(
        exact(structures.yaw_base, YAW),
        structures.yaw_base.with_fixed({"tau_r_base": 0.04}),
    )
    assert fit["tau_r_base"].value == 0.04
    assert fit["tau_r_base"].support == "fixed"
    assert fit["N_r"].value == pytest.approx(-0.7, rel=1e-6)
    assert fit.correlation.shape == (2, 2)


def test_a_parameter_at_its_bound_is_reported():
    """A bound that keeps the fit from its minimum shows up in the verdicts."""
    bounded = structures.yaw_base.with_bounds({"tau_r_base": (-0.01, 0.02)})
    fit = identify(exact(structures.yaw_base, YAW), bounded)
    assert fit.at_bound == ("tau_r_base",)
    assert not fit.ok
    assert "at bound" in str(fit)


def test_what_the_data_do_not_see_is_called_poor():
    """Two parameters that only act as a product are unbounded, fully correlated and poor."""
    product = Structure(
        name="product",
        parameters=(Parameter("a", "1", 1.0), Parameter("b", "1", 2.0)),
        states=(),
        inputs=("lat",),
        outputs=("p",),
        H0=((),),
        D=(("a*b",),),
    )
    fit = identify(exact(GAIN, {"K": 6.0}), product)
    assert fit["a"].value * fit["b"].value == pytest.approx(6.0, rel=1e-6)
    assert fit.poorly_identified == ("a", "b")
    assert math.isinf(fit["a"].cr_percent)
    assert fit.to_dict()["parameters"][0]["cr_percent"] is None


def test_incoherent_responses_are_left_out_and_named():
    """A response below the coherence limit isn't fitted, and the fit says so."""
    clean = exact(structures.rollpitch, ROLLPITCH)
    coherence = clean.coherence.copy()
    coherence[0, 1] = 0.3
    worse = FrequencyResponse(
        **{name: getattr(clean, name) for name in clean.__dataclass_fields__}
        | {"coherence": coherence}
    )
    fit = identify(worse, structures.rollpitch)
    assert fit.dropped == ("p/lon",)
    assert "left out for lack of coherence: p/lon" in str(fit)
    assert set(fit.costs) == {"p/lat", "q/lat", "q/lon"}


def test_a_response_of_zero_is_left_out_and_named():
    """What has neither decibels nor a phase can't be fitted; the others are, as if alone."""
    uncoupled = ROLLPITCH | dict.fromkeys(("A_b", "B_a", "A_lat", "B_lon"), 0.0)
    structure = structures.rollpitch.with_fixed(dict.fromkeys(("A_b", "B_a", "A_lat", "B_lon"), 0))
    data = exact(structures.rollpitch, uncoupled)
    zero = data.response.copy()
    zero[0, 1] = zero[1, 0] = 0.0
    fit = identify(
        FrequencyResponse.exact(data.frequency, zero, inputs=data.inputs, outputs=data.outputs),
        structure,
    )
    assert fit.dropped == ("p/lon", "q/lat")
    assert fit["tau_lat"].value == pytest.approx(0.01, rel=1e-6)
    assert fit.cost < 1e-9


ROLLPITCH = {
    "tau_f": 0.05,
    "L_b": 400.0,
    "M_a": 250.0,
    "A_b": -0.3,
    "B_a": 0.5,
    "A_lat": 0.06,
    "A_lon": 0.3,
    "B_lat": 0.35,
    "B_lon": -0.06,
    "tau_lat": 0.01,
    "tau_lon": -0.01,
}


@pytest.mark.parametrize("seed", range(4))
def test_exact_data_give_exact_parameters_from_any_seed(seed):
    """The search finds the one minimum of exact roll-pitch data whatever its scattered starts."""
    fit = identify(exact(structures.rollpitch, ROLLPITCH), structures.rollpitch, seed=seed)
    for name, value in ROLLPITCH.items():
        assert fit[name].value == pytest.approx(value, rel=1e-4)  # the optimiser's tolerance
    assert fit.converged
    assert fit.cost < 1e-6


def test_a_delay_of_many_turns_is_unwrapped():
    """A delay that turns the phase by more than two turns within the band is still found."""
    values = {"N_r": -0.7, "N_ped": -50.0, "tau_r_base": 0.28}
    frequency = np.geomspace(0.5, 60.0, 120)
    fit = identify(exact(structures.yaw_base, values, frequency), structures.yaw_base)
    for name, value in values.items():
        assert fit[name].value == pytest.approx(value, rel=1e-5)


def test_the_result_is_plain_data_and_a_named_model():
    """A fit gives a JSON table, a state space with names, and its delays beside."""
    fit = identify(exact(structures.rollpitch, ROLLPITCH), structures.rollpitch)
    data = json.loads(json.dumps(fit.to_dict(), allow_nan=False))
    assert {row["name"] for row in data["parameters"]} == set(ROLLPITCH)
    assert fit.model.state_labels == ["p", "q", "a", "b"]
    assert fit.model.input_labels == ["lat", "lon"]
    assert fit.delays["lon"] == pytest.approx(-0.01, rel=1e-4)
    again = fit.response(FREQUENCY)
    np.testing.assert_allclose(again.response, fit.data.response, rtol=1e-3)
    assert "tau_lon" in str(fit)
    with pytest.raises(ValueError, match="read-only"):
        fit.correlation[0, 0] = 2.0
    with pytest.raises(UnknownNameError, match="available: tau_f"):
        _ = fit["tau"]


def test_the_same_call_gives_the_same_numbers():
    """Two fits of the same data are identical to the last bit."""
    frf = noisy(structures.rollpitch, ROLLPITCH, 0.05)
    first, second = (identify(frf, structures.rollpitch) for _ in range(2))
    assert first.values == second.values


def test_bad_calls_are_refused_with_advice():
    """Unknown responses, empty bands and bad numbers end in helisim's own errors."""
    frf, structure = exact(structures.yaw_base, YAW), structures.yaw_base
    with pytest.raises(UnknownNameError, match="available: r/ped"):
        identify(frf, structure, responses=["r/lat"])
    with pytest.raises(UnknownNameError, match="available: ped"):
        identify(frf, structures.rollpitch.renamed({"p": "r", "q": "x"}))
    with pytest.raises(UnknownNameError, match="available: r"):
        identify(frf, structures.heave)
    with pytest.raises(IdentificationError, match="widen the band"):
        identify(frf, structure, band=(100.0, 200.0))
    with pytest.raises(InputError, match=r"0 <= lower < upper|finite number, got nan"):
        identify(frf, structure, band=(float("nan"), 3.0))
    with pytest.raises(UnknownNameError, match="response with a band"):
        identify(frf, structure, band={"q/ped": (1.0, 2.0)})
    with pytest.raises(InputError, match="at least 5"):
        identify(frf, structure, frequencies_per_response=2)


GRID = np.geomspace(0.5, 20.0, 60)


@pytest.fixture(scope="module")
def fit():
    structure = structures.yaw_base
    values = {"N_r": -0.7, "N_ped": 50.0, "tau_r_base": 0.04}
    exact = response(structure, values, GRID)
    wobble = 1.0 + 0.03 * np.random.default_rng(1).normal(size=(*exact.shape, 2)) @ [1.0, 1j]
    data = FrequencyResponse.exact(
        GRID, exact * wobble, inputs=structure.inputs, outputs=structure.outputs
    )
    return identify(data, structure)


@pytest.mark.parametrize(("count", "searches"), [(4, 1), (5, 0)])
def test_too_few_points_or_searches_are_refused(fit, count, searches):
    """At least five frequencies a response, and one search."""
    data = FrequencyResponse.exact(
        GRID, np.ones((1, 1, 60)), inputs=fit.structure.inputs, outputs=fit.structure.outputs
    )
    with pytest.raises(InputError, match="expected at least 5 and 1"):
        identify(data, fit.structure, frequencies_per_response=count, searches=searches)
    identify(data, fit.structure, frequencies_per_response=5, searches=1)


@pytest.mark.parametrize("band", [(2.0, 2.0), (3.0, 2.0), (-1.0, 2.0), (math.nan, 2.0)])
def test_a_band_has_a_lower_and_an_upper_edge(fit, band):
    """Equal or reversed edges, and what is no frequency."""
    data = FrequencyResponse.exact(
        GRID, np.ones((1, 1, 60)), inputs=fit.structure.inputs, outputs=fit.structure.outputs
    )
    with pytest.raises(InputError, match=r"expected 0 <= lower < upper|finite number, got nan"):
        identify(data, fit.structure, band=band)


COARSE = np.geomspace(0.5, 20.0, 40)


TRUE = {"Z_w": -0.8, "Z_col": -25.0, "tau_col": 0.03}


def fitted(structure=structures.heave):
    exact = response(structures.heave, TRUE, COARSE)
    data = FrequencyResponse.exact(
        COARSE, exact, inputs=structure.inputs, outputs=structure.outputs
    )
    return identify(data, structure)


def test_a_parameter_is_at_its_bound_when_the_data_want_it_beyond():
    """Z_w = -0.8 within -2 to 0 is free; within -0.7 to 0, or -2 to -0.9, it ends at the edge."""

    def bounded(low, high):
        old = structures.heave
        new = tuple(
            replace(one, start=0.5 * (low + high), bounds=(low, high)) if one.name == "Z_w" else one
            for one in old.parameters
        )
        return fitted(replace(old, parameters=new))

    assert bounded(-2.0, 0.0).at_bound == ()
    assert bounded(-0.7, 0.0).at_bound == ("Z_w",)
    assert bounded(-2.0, -0.9).at_bound == ("Z_w",)
    # a thousandth of the range inside is not the edge, whose width is a millionth of it
    assert bounded(-0.802, 0.0).at_bound == ()
