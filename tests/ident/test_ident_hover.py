"""The hover model: its equations, what it shares with the smaller models, and its recovery."""

import numpy as np
import pytest

from helisim.base.units import STANDARD_GRAVITY
from helisim.ident import FrequencyResponse, identify, structures
from helisim.ident.evaluate import response, state_space

G = STANDARD_GRAVITY
HOVER = {
    "X_u": -0.05, "X_a": -G, "Y_v": -0.15, "Y_b": G, "L_u": -0.5, "L_v": 0.4, "L_b": 170.0,
    "M_u": -0.2, "M_v": -0.2, "M_a": 80.0, "tau_f": 0.05, "A_b": -0.2, "B_a": 0.35,
    "A_lat": 0.03, "A_lon": -0.1, "B_lat": 0.14, "B_lon": 0.014, "tau_lat": 0.05,
    "tau_lon": -0.01,
}  # fmt: skip
"""Of the size of a small helicopter's; no published set."""

FREQUENCY = np.geomspace(0.3, 30.0, 160)


def exact(structure, values, frequency=FREQUENCY):
    return FrequencyResponse.exact(
        frequency,
        response(structure, values, frequency),
        inputs=structure.inputs,
        outputs=structure.outputs,
    )


def test_without_speed_derivatives_hover_is_rollpitch():
    """The rates of the hover model without speed derivatives are those of rollpitch."""
    values = {**HOVER, **dict.fromkeys(("L_u", "L_v", "M_u", "M_v"), 0.0)}
    small = {name: HOVER[name] for name in structures.rollpitch.names}
    whole = response(structures.hover, values, FREQUENCY)[:2]
    np.testing.assert_allclose(whole, response(structures.rollpitch, small, FREQUENCY), rtol=1e-9)


def test_speeds_settle_where_gravity_balances_damping():
    """Eight states obey u' = X_u u - g theta + X_a a and its mirror for v."""
    a = np.asarray(state_space(structures.hover, HOVER).A)
    u, v, _, _, phi, theta, tilt, roll_tilt = range(8)
    assert a[u, [u, theta, tilt]] == pytest.approx([-0.05, -G, -G])
    assert a[v, [v, phi, roll_tilt]] == pytest.approx([-0.15, G, G])
    assert a.shape == (8, 8)


def test_accelerometers_feel_forces_and_not_gravity():
    """What hover_imu's ax measures is X_u u + X_a a, the force without weight."""
    frequency = FREQUENCY
    speeds = response(structures.hover, HOVER, frequency)
    felt = response(structures.hover_imu, HOVER, frequency)
    s = 1j * frequency
    theta, phi = speeds[1] / s, speeds[0] / s
    np.testing.assert_allclose(felt[2], s * speeds[2] + G * theta, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(felt[3], s * speeds[3] - G * phi, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("structure", [structures.hover, structures.hover_imu])
def test_hover_comes_back_from_its_own_responses(structure):
    """From exact responses every parameter of the hover model is found to 0.1 %."""
    fit = identify(exact(structure, HOVER), structure, frequencies_per_response=40)
    for name, value in HOVER.items():
        assert fit[name].value == pytest.approx(value, rel=1e-3)
