"""Responses, slopes and time histories of structures with numbers, by closed forms and SciPy."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest
from test_structures import GOOD

from helisim.base.errors import UnknownNameError
from helisim.ident import Parameter, Structure, structures
from helisim.ident.evaluate import Sensitivity, linear, response
from ident_data import response_and_slope, slopes
from tabled import rows, tabled

GRID = np.geomspace(0.5, 20.0, 15)


JORDAN = Structure(
    name="lags",
    parameters=tuple(Parameter(name, "1", 1.0) for name in ("T", "K")),
    states=("x", "y"),
    inputs=("u",),
    outputs=("y",),
    M=(("T", "0"), ("0", "T")),
    F=(("-1", "0"), ("1", "-1")),
    G=(("K",), ("0",)),
)
"""Two equal lags in a row: no two independent eigenvectors."""


def test_equal_lags_are_their_transfer_function():
    """K / (T s + 1)^2 and its slopes by hand; at T = 0 M is singular, the slope by T -2 K s."""
    s, k = 1j * GRID, 2.0
    for t in (0.1, 0.0):
        found, slope = response_and_slope(JORDAN, {"T": t, "K": k}, GRID)
        np.testing.assert_allclose(found[0, 0], k / (t * s + 1) ** 2, rtol=1e-13)
        np.testing.assert_allclose(slope[0, 0, 0], -2 * k * s / (t * s + 1) ** 3, rtol=1e-13)
        np.testing.assert_allclose(slope[1, 0, 0], 1 / (t * s + 1) ** 2, rtol=1e-13)


def test_points_are_those_of_the_whole_response():
    structure = structures.hover
    values = {one.name: one.start or 0.3 * one.magnitude for one in structure.parameters}
    total, slope = response_and_slope(structure, values, GRID)
    random = np.random.default_rng(5)
    o, i, k = (random.integers(0, top, 50) for top in (4, 2, GRID.size))
    program = structure.program
    sample = Sensitivity(program, GRID[k], o, i).at(program.ordered(values))
    scale = random.normal(size=50) + 1j
    np.testing.assert_allclose(sample.response, total[o, i, k], rtol=1e-12)
    np.testing.assert_allclose(sample.slope(scale), scale * slope[:, o, i, k], rtol=1e-9, atol=1e-9)


def test_a_parameter_that_stands_nowhere_has_no_slope_and_one_without_a_value_is_named():
    idle = replace(JORDAN, parameters=(Parameter("idle", "1", 1.0), *JORDAN.parameters))
    _, slope = response_and_slope(idle, {"idle": 3.0, "T": 0.1, "K": 2.0}, GRID)
    np.testing.assert_array_equal(slope[0], np.zeros((1, 1, GRID.size)))
    with pytest.raises(UnknownNameError, match=r"unknown parameter 'K'.* available: T"):
        response(JORDAN, {"T": 0.1}, GRID)


def test_what_is_undefined_is_not_finite():
    for change, values in (
        ({"F": (("1/K", "0"), ("1", "-1"))}, {"T": 0.1, "K": 0.0}),
        ({"G": (("1/K",), ("0",))}, {"T": 0.1, "K": 0.0}),
        ({"F": (("0", "0"), ("0", "0"))}, {"T": 0.0, "K": 1.0}),
    ):
        assert not np.any(np.isfinite(response(replace(JORDAN, **change), values, GRID)))


WIDE = np.geomspace(0.4, 30.0, 40)


LATE = Structure(**dict(rows(globals(), "LATE")))
SIDE = Structure.from_dict(tomllib.loads(GOOD))
"""With H1, D, delays on both sides and a tied parameter."""


@tabled("structure", "values")
def test_derivatives_through_every_matrix_and_delay_are_exact(structure, values):
    _, slope = response_and_slope(structure, values, WIDE)
    # the square of the step, and rounding of 1e-16 over it
    np.testing.assert_allclose(slope, slopes(structure, values, WIDE), rtol=1e-6, atol=2e-6)


def test_delays_turn_the_phase():
    late = {**LATE.starts, "tau_in": 0.0, "tau_p": 0.0, "tau_q": 0.0}
    lag = np.array([[0.03 + 0.04, 0.03], [-0.02 + 0.04, -0.02]])
    expected = response(LATE, late, GRID) * np.exp(-1j * lag[:, :, None] * GRID)
    assert response(LATE, LATE.starts, GRID) == pytest.approx(expected, rel=1e-12)
    for one in (SIDE, LATE):
        found = response(one, one.starts, GRID)
        assert linear(one, one.starts).response(GRID) == pytest.approx(found, rel=1e-10)
