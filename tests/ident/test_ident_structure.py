"""Structures are data: expressions, derivatives, reading and refusing."""

import hashlib
import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helisim.base.errors import InputError, UnknownNameError
from helisim.ident import Parameter, Structure, structures
from helisim.ident.evaluate import response, response_and_slope, state_space
from helisim.ident.expression import Expression

FREQUENCY = np.geomspace(0.7, 30.0, 7)
NAMES = list(structures.BUILT_IN)


@pytest.mark.parametrize(
    ("text", "value", "slope"),
    [
        ("-tau", -2.0, {"tau": -1.0}),
        ("a*tau - 3", 7.0, {"a": 2.0, "tau": 5.0}),
        ("a/tau**2", 1.25, {"a": 0.25, "tau": -1.25}),
        ("sqrt(tau*2) + exp(0)", 3.0, {"tau": 0.5}),
        ("tau**-1", 0.5, {"tau": -0.25}),
        ("log(a*tau/10) + 1", 1.0, {"a": 0.2, "tau": 0.5}),
    ],
)
def test_expressions_give_value_and_exact_derivative(text, value, slope):
    """An expression's derivative is the one found by hand."""
    got, gradient = Expression(text).evaluate({"tau": 2.0, "a": 5.0})
    assert got == pytest.approx(value, rel=1e-15)
    assert gradient == pytest.approx(slope, rel=1e-15)


def test_a_negative_number_has_whole_powers_only():
    """Its cube is real, its root undefined."""
    assert Expression("tau**3").evaluate({"tau": -2.0}) == (-8.0, {"tau": 12.0})
    root, slope = Expression("tau**0.5").evaluate({"tau": -2.0})
    assert np.isnan([root, slope["tau"]]).all()


@pytest.mark.parametrize(
    "text",
    ["", "__import__('os')", "a.b", "a[0]", "lambda: 1", "a if b else c", "a and b", "1e999",
     "sqrt", "sqrt(a, b)", "open(a)", "2**a", "'a'", "True", "a := 3", "a" * 300, "a +", "1j"],
)  # fmt: skip
def test_only_arithmetic_is_read(text):
    """Whatever isn't plain arithmetic is refused, and nothing is executed."""
    with pytest.raises(InputError):
        Expression(text)


def test_undefined_values_are_nan():
    """A division by zero is a hopeless model, not a crash."""
    assert np.isnan(Expression("1/a").evaluate({"a": 0.0})[0])
    assert np.isnan(Expression("sqrt(a)").evaluate({"a": -1.0})[0])


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=10, deadline=None)
@given(data=st.data())
def test_response_derivative_equals_finite_difference(name, data):
    """Each built-in structure's analytic derivative is that of its response."""
    structure = structures.named(name)
    factor = data.draw(
        st.lists(
            st.floats(0.5, 1.5),
            min_size=len(structure.names),
            max_size=len(structure.names),
        )
    )
    values = {
        parameter.name: (parameter.start or 0.3 * parameter.magnitude) * scale
        for parameter, scale in zip(structure.parameters, factor)
    }
    _, slope = response_and_slope(structure, values, FREQUENCY)
    for k, parameter in enumerate(structure.free):
        step = 1e-5 * parameter.magnitude
        up = response(
            structure, {**values, parameter.name: values[parameter.name] + step}, FREQUENCY
        )
        down = response(
            structure, {**values, parameter.name: values[parameter.name] - step}, FREQUENCY
        )
        numeric = (up - down) / (2.0 * step)
        # Central differences of 1e-5: truncation 1e-10, and rounding of 1e-13 of the response,
        # which the eigenvectors of slow modes leave, over the step 1e-8.
        scale = np.max(np.abs(up)) / parameter.magnitude
        np.testing.assert_allclose(slope[k], numeric, rtol=1e-5, atol=1e-7 * scale)


def mettler_like():
    """A structure with H1, D, delays on both sides and a tied parameter."""
    return Structure.from_dict(
        {
            "name": "side",
            "parameters": {
                "Y_v": {"unit": "1/s", "start": -0.2},
                "Y_lat": {"unit": "m/s^2", "start": 2.0, "bounds": [0.0, 9.0]},
                "tau": {"unit": "s", "start": 0.0, "scale": 0.05},
            },
            "states": ["v", "x"],
            "inputs": ["lat"],
            "outputs": ["ay", "v"],
            "M": {"x": {"x": "2*tau + 1"}},
            "F": {"v": {"v": "Y_v", "x": -9.8}, "x": {"v": "-Y_v/4", "x": -1}},
            "G": {"v": {"lat": "Y_lat"}},
            "H0": {"v": {"v": 1}},
            "H1": {"ay": {"v": 1}},
            "D": {"ay": {"lat": "Y_lat*0.1"}},
            "input_delays": {"lat": "tau"},
            "output_delays": {"ay": "-tau/2"},
        }
    )


def test_user_structure_with_h1_and_feedthrough_has_exact_derivatives():
    """Derivatives are exact through M, H1, D and delays of either sign."""
    structure = mettler_like()
    values = {"Y_v": -0.3, "Y_lat": 3.0, "tau": 0.04}
    _, slope = response_and_slope(structure, values, FREQUENCY)
    for k, name in enumerate(values):
        up = response(structure, {**values, name: values[name] + 1e-6}, FREQUENCY)
        down = response(structure, {**values, name: values[name] - 1e-6}, FREQUENCY)
        np.testing.assert_allclose(slope[k], (up - down) / 2e-6, rtol=1e-6, atol=1e-8)


def test_response_is_the_state_space_with_delays():
    """Frequency response and state space are the same model."""
    structure = mettler_like()
    values = {"Y_v": -0.3, "Y_lat": 3.0, "tau": 0.04}
    plain = state_space(structure, values)(1j * FREQUENCY, squeeze=False)
    lag = np.array([0.04 - 0.02, 0.04])
    expected = plain[:, 0] * np.exp(-1j * FREQUENCY * lag[:, None])
    np.testing.assert_allclose(response(structure, values, FREQUENCY)[:, 0], expected, rtol=1e-10)


@pytest.mark.parametrize("name", NAMES)
def test_structures_survive_json(name):
    """A structure written to plain data and read back is the same model."""
    structure = structures.named(name)
    again = Structure.from_dict(json.loads(json.dumps(structure.to_dict())))
    assert again.names == structure.names
    values = {p.name: p.start or 0.2 * p.magnitude for p in structure.parameters}
    np.testing.assert_array_equal(
        response(again, values, FREQUENCY), response(structure, values, FREQUENCY)
    )


def test_a_structure_moves_to_other_channels():
    """The roll-pitch structure fits the sticks as it does the swashplate."""
    sticks = structures.rollpitch.renamed({"lat": "LAT", "lon": "LON"}, name="rollpitch_in2")
    assert sticks.inputs == ("LAT", "LON")
    assert set(sticks.input_delays) == {"LAT", "LON"}


def test_transfer_function_is_its_polynomials():
    """A third-order transfer function with as many zeros is the ratio of its polynomials."""
    structure = structures.transfer_function(zeros=3, poles=3, input="ped", output="r")
    values = {"b3": 0.5, "b2": 1.0, "b1": -2.0, "b0": 4.0, "a2": 3.0, "a1": 7.0, "a0": 9.0}
    s = 1j * FREQUENCY
    ratio = np.polyval([0.5, 1.0, -2.0, 4.0], s) / np.polyval([1.0, 3.0, 7.0, 9.0], s)
    got = response(structure, {**values, "tau": 0.1}, FREQUENCY)[0, 0]
    np.testing.assert_allclose(got, ratio * np.exp(-0.1 * s), rtol=1e-12)


def test_mistakes_in_a_structure_are_named():
    """Unknown names, repeated names and wrong shapes end in errors that list what exists."""
    data = structures.heave.to_dict()
    with pytest.raises(UnknownNameError, match="available: Z_w, Z_col, tau_col"):
        Structure.from_dict({**data, "F": [["Z_q"]]})
    with pytest.raises(InputError, match="expected 1 of 1"):
        Structure.from_dict({**data, "G": [["Z_col", "0"]]})
    with pytest.raises(UnknownNameError, match="setting of structure"):
        Structure.from_dict({**data, "K": []})
    with pytest.raises(InputError, match="F is missing"):
        Structure.from_dict({key: value for key, value in data.items() if key != "F"})
    with pytest.raises(UnknownNameError, match="output with a delay"):
        Structure.from_dict({**data, "output_delays": {"q": "tau_col"}})
    with pytest.raises(UnknownNameError, match="available: heave"):
        structures.named("hove")
    with pytest.raises(UnknownNameError, match="available: Z_w"):
        structures.heave.with_fixed({"tau": 0.0})
    with pytest.raises(InputError, match="repeat"):
        Structure("twice", (), ("w",), ("col",), ("col",), F=(("0",),), G=(("1",),), H0=(("1",),))
    with pytest.raises(InputError, match="bounds"):
        Parameter("x", "1", 3.0, (0.0, 1.0))
    with pytest.raises(InputError, match="isn't an identifier"):
        Parameter("N r", "1", 3.0)


def test_no_start_is_a_published_result():
    """Starts are orders of magnitude: a power of ten or plain number, never an answer."""
    for structure in structures.BUILT_IN.values():
        for parameter in structure.parameters:
            assert float(f"{parameter.start:.1g}") == parameter.start or (
                structure.name == "yaw_overall"  # well-damped poles at 10 rad/s
            )


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


def built_in():
    found = {name: getattr(structures, name) for name in dir(structures)}
    return {name: one for name, one in found.items() if isinstance(one, Structure)}


@pytest.mark.parametrize("bounds", [(2.0, 1.0), (1.0, 1.0), (1.5, 2.0), (0.0, 0.5)])
def test_bounds_that_hold_no_start_are_refused(bounds):
    """Reversed, equal, above and below the start."""
    with pytest.raises(InputError, match="expected lower < upper with the start between"):
        Parameter("K", "1", 1.0, bounds)


def test_a_bound_may_be_open_and_a_start_may_not():
    """Infinity leaves a side open; a start or a scale is a finite number."""
    plain = structures.heave.to_dict()
    name = next(iter(plain["parameters"]))

    def changed(**fields):
        copied = json.loads(json.dumps(plain))
        copied["parameters"][name].update(fields)
        return Structure.from_dict(copied)

    start = plain["parameters"][name]["start"]
    for pair, limits in (
        (["-inf", start + 1.0], (-math.inf, start + 1.0)),
        ([start - 1.0, "inf"], (start - 1.0, math.inf)),
        ([-math.inf, math.inf], (-math.inf, math.inf)),
    ):
        assert changed(bounds=pair).parameter(name).limits == limits
    for field in ("start", "scale"):
        with pytest.raises(InputError, match=rf"{field} must be a finite number.*, got inf"):
            changed(**{field: math.inf})
        with pytest.raises(InputError, match=rf"{field} must be a finite number.*, got nan"):
            changed(**{field: math.nan})


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"input_delays": {"q": "K"}}, UnknownNameError, "input with a delay"),
        ({"output_delays": {"q": "K"}}, UnknownNameError, "output with a delay"),
        ({"inputs": (), "D": ((),)}, InputError, "at least one input"),
        ({"outputs": (), "H0": (), "D": ()}, InputError, "at least one input and one output"),
        ({"inputs": ("p",)}, InputError, "signal names repeat: p"),
        (
            {
                "states": ("x", "x"),
                "F": (("0", "0"),) * 2,
                "G": (("1",),) * 2,
                "H0": (("1", "0"),),
            },
            InputError,
            "state names repeat: x",
        ),
        ({"states": ("x",), "H0": (("1",),)}, InputError, "F is missing"),
        ({"states": ("x",), "F": (("0",),), "G": (("1",),), "H0": ()}, InputError, "H0 must be"),
        ({"D": (("K", "K"),)}, InputError, r"1 rows of \[2\] entries, expected 1 of 1"),
    ],
)
def test_a_structure_that_does_not_fit_together_is_refused(change, error, message):
    """Delays of signals that it lacks, names twice, matrices of another shape."""
    sound = {
        "name": "gain",
        "parameters": (Parameter("K", "1", 1.0),),
        "states": (),
        "inputs": ("lat",),
        "outputs": ("p",),
        "H0": ((),),
        "D": (("K",),),
    }
    with pytest.raises(error, match=message):
        Structure(**(sound | change))


def test_a_change_of_a_built_in_structure_is_seen():
    """Starts, bounds and matrices alter every user's numbers: CHANGELOG.md then says so.

    If this fails and the change is meant, write the new digest here and a line there.
    """
    text = json.dumps({name: one.to_dict() for name, one in sorted(built_in().items())})
    assert hashlib.sha256(text.encode()).hexdigest()[:16] == "448d750fee8a2c7b"


def test_a_parameters_size_is_its_scale_or_its_start_or_one():
    """The scale counts first, then the size of the start; a start of zero has none."""
    assert Parameter("k", "1", -4.0, scale=3.0).magnitude == 3.0
    assert Parameter("k", "1", -4.0).magnitude == 4.0
    assert Parameter("k", "1", 0.0).magnitude > 0.0
    for scale in (0.0, -1.0, np.inf):
        with pytest.raises(InputError, match="number above 0"):
            Parameter("k", "1", 1.0, scale=scale)


def test_only_signals_of_a_structure_are_renamed():
    """The message names what there is."""
    with pytest.raises(UnknownNameError, match="'ped'; available: col, w"):
        structures.heave.renamed({"ped": "PED"})


def test_a_structure_keeps_its_own_delays_and_constants():
    """A dictionary that it was made from may change later."""
    delays = dict(structures.heave.input_delays)
    mine = replace(structures.heave, input_delays=delays)
    delays.clear()
    assert mine.input_delays == structures.heave.input_delays
    with pytest.raises(TypeError):
        mine.constants["g"] = 1.0
