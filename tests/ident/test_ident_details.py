"""Details of the identification that other tests pass by: delays of outputs, names, tables."""

import json
from dataclasses import replace

import numpy as np
import pytest

from helisim.errors import InputError
from helisim.ident import FrequencyResponse, Parameter, Structure, identify, structures
from helisim.ident.evaluate import response, response_and_slope
from helisim.ident.expression import Expression
from helisim.ident.verify import _tic

GRID = np.geomspace(0.5, 20.0, 40)
LATE = Structure(
    name="late",
    parameters=(
        Parameter("a", "1/s", -1.5),
        Parameter("b", "1", 3.0),
        Parameter("tau_in", "s", 0.04),
        Parameter("tau_p", "s", 0.03),
        Parameter("tau_q", "s", -0.02),
    ),
    states=("p", "q"),
    inputs=("lat", "lon"),
    outputs=("p", "q"),
    F=(("a", "0.4"), ("0", "2*a")),
    G=(("b", "0"), ("1", "b")),
    input_delays={"lat": "tau_in"},
    output_delays={"p": "tau_p", "q": "tau_q"},
)


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


def test_renamed_structures_keep_their_name_unless_given_another():
    """New channels, in their places, and the rest as it was."""
    moved = structures.heave.renamed({"col": "COL"})
    assert moved.name == structures.heave.name
    assert moved.inputs == ("COL",)
    assert moved.names == structures.heave.names
    assert structures.heave.renamed({"col": "COL"}, name="heave by stick").name == "heave by stick"


def test_an_expression_has_at_most_so_many_characters():
    """Two hundred are read; one more is refused with what was given."""
    longest = "11" + "+a" * 99
    assert len(longest) == 200
    assert Expression(longest).names == {"a"}
    with pytest.raises(InputError):
        Expression(longest + "1")


def test_a_matrix_that_is_no_table_is_refused_by_its_row():
    """Rows are counted from 1."""
    plain = json.loads(json.dumps(LATE.to_dict()))
    plain["F"] = [["a", "0.4"], 3.0]
    with pytest.raises(InputError, match="row 2"):
        Structure.from_dict(plain)


@pytest.fixture(scope="module")
def fit():
    exact = response(LATE, {p.name: p.start for p in LATE.parameters}, GRID)
    data = FrequencyResponse.exact(GRID, exact, inputs=LATE.inputs, outputs=LATE.outputs)
    return identify(data, LATE)


def test_the_latex_table_marks_what_is_poorly_identified_or_at_its_bound(fit):
    """A star for either, and the figures of each parameter; one of these five is poor."""
    rows = [line for line in fit.to_latex().splitlines() if line.count("&") == 4][1:]
    assert len(rows) == len(LATE.parameters)
    stars = 0
    for row, parameter in zip(rows, LATE.parameters):
        one = fit[parameter.name]
        assert ("^*" in row) == (one.poorly_identified or one.at_bound)
        assert f" & {one.cr_percent:.1f} & {one.insensitivity_percent:.1f} " in row
        stars += "^*" in row
    assert 0 < stars < len(rows)


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
    assert _tic(measured, predicted) == pytest.approx(error / (one + other), rel=1e-12)


def test_a_point_is_usable_from_a_coherence_of_six_tenths():
    """The published limit, which counts itself."""
    data = FrequencyResponse.exact(GRID[:3], np.ones((1, 1, 3)), inputs=["lat"], outputs=["p"])
    doubtful = replace(data, coherence=np.array([[[0.59, 0.6, 0.61]]]))
    assert doubtful.usable().tolist() == [[[False, True, True]]]
