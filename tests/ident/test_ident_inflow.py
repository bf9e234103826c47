"""The structures with inflow states: what they reduce to, and their recovery."""

import numpy as np
import plants
import pytest

from helisim.ident import FrequencyResponse, frequency_response, identify, structures
from helisim.ident.evaluate import response, state_space

HEAVE = {"Z_w": -0.9, "Z_col": -25.0, "tau_0": 0.05, "C": 0.6, "tau_col": 0.01}
TURN = {"turn": 1.0 / 178.0}
ROLLPITCH = {**plants.ROLLPITCH_IN1, "C": 0.6, "tau_1": 0.03, **TURN, "torque": 0.02}
HOVER = {
    **ROLLPITCH, "X_u": -0.05, "X_a": -9.8, "Y_v": -0.15, "Y_b": 9.8, "L_u": -1.5, "L_v": -1.2,
    "M_u": 0.9, "M_v": -0.8,
}  # fmt: skip
FREQUENCY = np.geomspace(1.0, 60.0, 160)


def exact(structure, values, frequency=FREQUENCY):
    return FrequencyResponse.exact(
        frequency,
        response(structure, values, frequency),
        inputs=structure.inputs,
        outputs=structure.outputs,
    )


def test_slow_heave_is_the_model_without_inflow():
    """Far below 1 / tau_0 the inflow has come: w/col is that of `heave`."""
    slow = np.geomspace(1e-4, 1e-3, 10)
    plain = {name: HEAVE[name] for name in structures.heave.names}
    found = response(structures.heave_inflow, HEAVE, slow)[0]
    # what the lag tau_0 leaves at 1e-3 rad/s: of the order of 1e-3 x 0.05
    np.testing.assert_allclose(found, response(structures.heave, plain, slow)[0], rtol=1e-4)


def test_a_load_comes_at_once_and_larger():
    """Far above, collective accelerates 1 / C times as much as it will: the lift deficiency."""
    fast = response(structures.heave_inflow, {**HEAVE, "tau_col": 0.0}, np.array([1e5]))
    assert abs(fast[1, 0, 0]) == pytest.approx(25.0 / 0.6, rel=1e-6)


def test_heave_is_chen_and_hindsons_without_coning():
    """NASA TM 88327, Table 1, rows of inflow and heave, blades that don't flap.

    v' = -75 pi Omega / 32 (v + a s / 16) C_0 v + 75 pi Omega / 64 (v + a s / 8) C_0 w + ..., with
    C_0 = 0.639 for Carpenter and Fridovich's mass of air: their M11 = 128 / (75 pi) / C_0.
    """
    speed, mean, loading, weighed = 24.085, 0.0485, 5.73 * 0.067, 0.639  # a CH-47's rotor
    rows = 75.0 * np.pi * speed * weighed
    a11, a12 = -rows / 32.0 * (mean + loading / 16.0), rows / 64.0 * (mean + loading / 8.0)
    deficiency = 1.0 / (1.0 + loading / (16.0 * mean))
    values = {**HEAVE, "C": deficiency, "tau_0": -1.0 / a11}
    a = np.asarray(state_space(structures.heave_inflow, values).A)
    assert a[1, 1] == pytest.approx(a11)
    assert a[1, 0] == pytest.approx(a12)
    assert a[0, 0] == -a[0, 1]


@pytest.mark.parametrize(
    ("structure", "without"),
    [
        (structures.rollpitch_inflow, structures.rollpitch),
        (structures.hover_inflow, structures.hover),
    ],
)
def test_without_lag_and_turn_the_model_without_inflow_comes_back(structure, without):
    """With inflow that follows at once the slopes are no states; without torque none leans."""
    values = {**HOVER, "tau_1": 1e-9, "turn": 0.0, "torque": 0.0}
    free = structure.with_bounds({"tau_1": None})
    np.testing.assert_allclose(
        response(free, {name: values[name] for name in free.names}, FREQUENCY),
        response(without, {name: HOVER[name] for name in without.names}, FREQUENCY),
        rtol=1e-6,  # a lag of 1e-9 s at 60 rad/s
    )


@pytest.mark.parametrize(
    ("structure", "values"),
    [
        (structures.heave_inflow, HEAVE),
        (structures.rollpitch_inflow.with_fixed(TURN), ROLLPITCH),
        (structures.hover_inflow.with_fixed(TURN), HOVER),
    ],
    ids=["heave", "rollpitch", "hover"],
)
def test_they_come_back_from_their_own_responses(structure, values):
    """From exact responses every parameter is found to 0.1 %, the inflow's lag too."""
    fit = identify(exact(structure, values), structure, frequencies_per_response=40)
    for name, value in values.items():
        assert fit[name].value == pytest.approx(value, rel=1e-3)


def test_heave_comes_back_from_sweeps():
    """From noisy sweeps the inflow's lag and lift deficiency are within 3 of their errors."""
    flights = [
        plants.fly(
            structures.heave_inflow,
            HEAVE,
            axis="col",
            seed=seed,
            band=(0.5, 70.0),
            amplitude=0.05,
            noise={"w": 0.02, "az": 0.05},
        )
        for seed in range(3)
    ]
    frf = frequency_response(flights, inputs="col", outputs=("w", "az"), band=(0.8, 60.0))
    fit = identify(frf, structures.heave_inflow, frequencies_per_response=40)
    for name, value in HEAVE.items():
        error = fit[name].standard_error
        assert fit[name].value == pytest.approx(value, abs=3.0 * error + 0.01 * abs(value)), name
    plain = identify(frf, structures.heave, frequencies_per_response=40)
    assert fit.cost < 0.1 * plain.cost
