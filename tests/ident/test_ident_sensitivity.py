"""Responses at points: both ways to the resolvent, against scipy and against each other."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import StateSpace, freqresp

from helisim.base.errors import UnknownNameError
from helisim.ident import Parameter, Structure, structures
from helisim.ident import evaluate as module
from helisim.ident.evaluate import Sensitivity, matrices, response, response_and_slope
from helisim.ident.expression import Expression

GRID = np.geomspace(0.5, 20.0, 15)


TWO = Structure(
    name="two",
    parameters=(Parameter("K", "1", 2.0),),
    states=("x", "y"),
    inputs=("u",),
    outputs=("y",),
    F=(("-1", "0"), ("1", "-3")),
    G=(("K",), ("0",)),
)


def jordan():
    """Two equal lags in a row: no two independent eigenvectors."""
    return Structure(
        name="lags",
        parameters=(Parameter("T", "s", 0.1), Parameter("K", "1", 2.0)),
        states=("x", "y"),
        inputs=("u",),
        outputs=("y",),
        M=(("T", "0"), ("0", "T")),
        F=(("-1", "0"), ("1", "-1")),
        G=(("K",), ("0",)),
    )


@pytest.mark.parametrize("few", [0, 1e9])
def test_equal_lags_are_their_transfer_function(few, monkeypatch):
    """K / (T s + 1)^2 and its slopes by hand, where eigenvectors can't be used."""
    monkeypatch.setattr(module, "_FEW", few)
    s, t, k = 1j * GRID, 0.1, 2.0
    found, slope = response_and_slope(jordan(), {"T": t, "K": k}, GRID)
    np.testing.assert_allclose(found[0, 0], k / (t * s + 1) ** 2, rtol=1e-13)
    np.testing.assert_allclose(slope[0, 0, 0], -2 * k * s / (t * s + 1) ** 3, rtol=1e-13)
    np.testing.assert_allclose(slope[1, 0, 0], 1 / (t * s + 1) ** 2, rtol=1e-13)


@pytest.mark.parametrize("few", [0, 1e9])
def test_a_state_without_inertia_is_an_equation(few, monkeypatch):
    """With T = 0, M is singular and y = K u; by T, the slope of the lags is -2 K s."""
    monkeypatch.setattr(module, "_FEW", few)
    found, slope = response_and_slope(jordan(), {"T": 0.0, "K": 2.0}, GRID)
    np.testing.assert_allclose(found[0, 0], 2.0, rtol=1e-13)
    np.testing.assert_allclose(slope[0, 0, 0], -4j * GRID, rtol=1e-13)


@pytest.mark.parametrize("name", list(structures.BUILT_IN))
def test_eigenvectors_and_inverses_give_the_same(name, monkeypatch):
    """To the ten digits that are promised, slopes included."""
    structure = structures.named(name)
    random = np.random.default_rng(3)
    values = {
        one.name: (one.start or 0.3 * one.magnitude) * random.uniform(0.5, 1.5)
        for one in structure.parameters
    }
    ways = []
    monkeypatch.setattr(module, "_FEW", 0)
    for independent in (1e5, 0.0):
        monkeypatch.setattr(module, "_INDEPENDENT", independent)
        ways.append(response_and_slope(structure, values, GRID))
    for one, other in zip(*ways):
        scale = np.max(np.abs(other))
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-10 * scale)


@pytest.mark.parametrize("name", list(structures.BUILT_IN))
def test_modes_serve_where_they_can(name, monkeypatch):
    """They are what makes large fits fast; inverses serve small ones, and those that have none."""
    monkeypatch.setattr(module, "_FEW", 0)
    structure = structures.named(name)
    random = np.random.default_rng(4)
    values = {
        one.name: (one.start or 0.3 * one.magnitude) * random.uniform(0.5, 1.5)
        for one in structure.parameters
    }

    def refused(*_):
        raise AssertionError("the slow way was taken")

    monkeypatch.setattr(module, "_by_inverse", refused)
    assert np.all(np.isfinite(response(structure, values, GRID)))
    with pytest.raises(AssertionError, match="slow way"):
        response(jordan(), {"T": 0.1, "K": 2.0}, GRID)
    monkeypatch.setattr(module, "_FEW", 2**2 * GRID.size)
    with pytest.raises(AssertionError, match="slow way"):
        response(TWO, {"K": 2.0}, GRID)
    monkeypatch.setattr(module, "_FEW", 2**2 * GRID.size - 1)
    assert np.all(np.isfinite(response(TWO, {"K": 2.0}, GRID)))


@pytest.mark.filterwarnings("ignore:Badly conditioned filter")  # of scipy's polynomials
@pytest.mark.parametrize("few", [0, 1e9])
def test_a_state_space_of_scipy_has_the_same_response(few, monkeypatch):
    """An outside program's response of the rigid body with flapping."""
    monkeypatch.setattr(module, "_FEW", few)
    structure = structures.rollpitch
    values = {p.name: p.start or 0.2 * p.magnitude for p in structure.parameters}
    numbers = matrices(structure, values)
    a, b = (np.linalg.solve(numbers.M, x) for x in (numbers.F, numbers.G))
    found = response(structure, {**values, "tau_lat": 0.0, "tau_lon": 0.0}, GRID)
    for i in range(2):
        for o in range(2):
            c = np.eye(4)[[o]]
            _, expected = freqresp(StateSpace(a, b[:, [i]], c, np.zeros((1, 1))), GRID)
            np.testing.assert_allclose(found[o, i], expected, rtol=1e-9)


@pytest.mark.parametrize("few", [0, 1e9])
def test_points_are_those_of_the_whole_response(few, monkeypatch):
    """In any order, any pair, any frequency twice; a scale multiplies each point's slopes."""
    monkeypatch.setattr(module, "_FEW", few)
    structure = structures.hover
    values = {p.name: p.start or 0.2 * p.magnitude for p in structure.parameters}
    total, slope = response_and_slope(structure, values, GRID)
    random = np.random.default_rng(5)
    o, i, k = (random.integers(0, top, 50) for top in (4, 2, GRID.size))
    program = structure.program
    sample = Sensitivity(program, GRID[k], o, i).at(program.ordered(values))
    scale = random.normal(size=50) + 1j
    np.testing.assert_allclose(sample.response, total[o, i, k], rtol=1e-12)
    np.testing.assert_allclose(sample.slope(scale), scale * slope[:, o, i, k], rtol=1e-9, atol=1e-9)


def test_a_parameter_that_stands_nowhere_has_no_slope():
    """Zero, not what stood in the array before."""
    structure = Structure(
        name="gain",
        parameters=(Parameter("idle", "1", 1.0), Parameter("K", "1", 1.0)),
        states=(),
        inputs=("u",),
        outputs=("y",),
        H0=((),),
        D=(("K",),),
    )
    _, slope = response_and_slope(structure, {"idle": 3.0, "K": 2.0}, GRID)
    np.testing.assert_array_equal(slope[:, 0, 0], [np.zeros(GRID.size), np.ones(GRID.size)])


@pytest.mark.parametrize("few", [0, 1e9])
def test_what_is_undefined_is_not_finite(few, monkeypatch):
    """A division by zero in F or in G, and a pencil that is singular at every frequency."""
    monkeypatch.setattr(module, "_FEW", few)
    plain = jordan()
    for change in ({"F": (("1/K", "0"), ("1", "-1"))}, {"G": (("1/K",), ("0",))}):
        broken = Structure.from_dict({**plain.to_dict(), **change})
        found = response(broken, {"T": 0.1, "K": 0.0}, GRID)
        assert not np.any(np.isfinite(found))
    none = Structure.from_dict({**plain.to_dict(), "F": (("0", "0"), ("0", "0"))})
    assert not np.any(np.isfinite(response(none, {"T": 0.0, "K": 1.0}, GRID)))


terms = st.recursive(
    st.sampled_from(["a", "b", "c", "2", "0.5", "-1.5"]),
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from("+-*/"), inner).map(lambda x: f"({x[0]}) {x[1]} ({x[2]})"),
        inner.map(lambda x: f"sqrt(({x})**2 + 1)"),
        inner.map(lambda x: f"sin({x})*exp(-({x})**2)"),
        inner.map(lambda x: f"-({x})**3"),
    ),
    max_leaves=5,
).filter(lambda text: len(text) <= 200)


@settings(max_examples=60, deadline=None)
@given(text=terms, at=st.tuples(*[st.floats(0.4, 2.5)] * 3))
def test_expressions_are_pythons_and_their_derivatives_its_differences(text, at):
    """Python's own arithmetic on the same text, and complex steps, which cancel nothing."""
    names = dict(zip("abc", at))
    value, gradient = Expression(text).evaluate(names)
    own = {"sqrt": np.sqrt, "sin": np.sin, "exp": np.exp, "__builtins__": {}}
    try:
        expected = complex(eval(text, own, {k: np.complex128(x) for k, x in names.items()}))
    except ZeroDivisionError:
        expected = complex(np.nan)
    if not np.isfinite(expected) or abs(expected) > 1e8:
        return
    assert value == pytest.approx(expected.real, rel=1e-12, abs=1e-12)
    for name in gradient:
        step = {**names, name: names[name] + 1e-30j}
        slope = (
            complex(eval(text, own, {k: np.complex128(x) for k, x in step.items()})).imag / 1e-30
        )
        if np.isfinite(slope) and abs(slope) < 1e8:
            assert gradient[name] == pytest.approx(slope, rel=1e-9, abs=1e-9)


def test_a_parameter_without_a_value_is_named():
    """With those that there are."""
    with pytest.raises(UnknownNameError, match=r"unknown parameter 'K'.* available: T"):
        response(jordan(), {"T": 0.1}, GRID)
