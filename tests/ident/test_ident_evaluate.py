"""Responses of structures at given values: delays, derivatives."""

import numpy as np
import pytest

from helisim.ident.evaluate import response, response_and_slope
from late import LATE

GRID = np.geomspace(0.5, 20.0, 40)


def test_delays_of_outputs_turn_the_phase_and_have_exact_derivatives():
    """exp(-j w tau) of the output times that of the input; slopes by central differences."""
    values = {parameter.name: parameter.start for parameter in LATE.parameters}
    without = {**values, "tau_in": 0.0, "tau_p": 0.0, "tau_q": 0.0}
    waits = np.array([[0.03 + 0.04, 0.03], [-0.02 + 0.04, -0.02]])
    expected = response(LATE, without, GRID) * np.exp(-1j * waits[:, :, None] * GRID)
    total, slope = response_and_slope(LATE, values, GRID)
    assert total == pytest.approx(expected, rel=1e-12)
    for k, parameter in enumerate(LATE.free):
        step = 1e-6
        up, down = (
            response(LATE, {**values, parameter.name: values[parameter.name] + sign * step}, GRID)
            for sign in (1.0, -1.0)
        )
        # the square of the step, and rounding of 1e-16 over it
        assert slope[k] == pytest.approx((up - down) / (2.0 * step), rel=1e-6, abs=1e-8)
