"""Structures are data: expressions, files, what is refused, what is built in."""

import json
import math
from pathlib import Path

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import butter
from test_fit import HOVER, HOVER_SLOPES, INFLOW  # noqa: F401  (rows name them)

from helisim.base.errors import InputError, UnknownNameError
from helisim.ident import Parameter, Structure, identify, structures
from helisim.ident.evaluate import linear, response
from helisim.ident.expression import FUNCTIONS, Entry, Expression, Program, value_at
from helisim.ident.structures import transfer_function
from helisim.study.rotorflight_models import _ODD
from helisim.vehicle import load
from ident_data import of_model
from tabled import rows, tabled

FREQUENCY = np.geomspace(0.7, 30.0, 7)


def evaluated(text, values):
    names = sorted(Expression(text).names)
    program = Program(names, names, {"F": (1, 1)}, [Entry("F", 0, 0, Expression(text))], {})
    at = program.ordered(values)
    slopes = {names[one.place]: value_at(one.slope, at.tolist()) for one in program.dependences}
    return program.fill(at)["F"].item(), slopes


@tabled("text", "value", "slope")
def test_expressions_give_value_and_exact_derivative(text, value, slope):
    got, gradient = evaluated(text, {"tau": 2.0, "a": 5.0})
    assert got == pytest.approx(value, rel=1e-15, nan_ok=True)
    assert gradient == pytest.approx(slope, rel=1e-15, nan_ok=True)


terms = st.recursive(
    st.sampled_from(["a", "b", "c", "2", "0.5", "-1.5"]),
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from("+-*/"), inner).map(lambda x: f"({x[0]}) {x[1]} ({x[2]})"),
        inner.map(lambda x: f"sqrt(({x})**2 + 1)"),
        inner.map(lambda x: f"sin({x})*exp(-({x})**2)"),
        inner.map(lambda x: f"-({x})**3 + cos({x})*log(1 + ({x})**2)"),
    ),
    max_leaves=5,
).filter(lambda text: len(text) <= 200)


@settings(max_examples=60, deadline=None)
@given(text=terms, at=st.tuples(*[st.floats(0.4, 2.5)] * 3))
def test_expressions_are_pythons_and_their_derivatives_its_differences(text, at):
    names = dict(zip("abc", at))
    value, gradient = evaluated(text, names)
    own = {name: getattr(np, name) for name in FUNCTIONS} | {"__builtins__": {}}

    def pythons(**changed):
        numbers = {k: np.complex128(x) for k, x in (names | changed).items()}
        return complex(eval(text, own, numbers))

    try:
        expected = pythons()
    except ZeroDivisionError:
        expected = complex(np.nan)
    if not np.isfinite(expected) or abs(expected) > 1e8:
        return
    assert value == pytest.approx(expected.real, rel=1e-12, abs=1e-12)
    for name in gradient:
        slope = pythons(**{name: names[name] + 1e-30j}).imag / 1e-30
        if np.isfinite(slope) and abs(slope) < 1e8:
            assert gradient[name] == pytest.approx(slope, rel=1e-9, abs=1e-9)


@tabled("text")
def test_only_arithmetic_is_read(text):
    with pytest.raises(InputError):
        Expression(text)
    assert Expression("11" + "+a" * 99).names == {"a"}


GOOD = Path(__file__).with_name("side.toml").read_text(encoding="utf-8")


def write(tmp_path, text):
    path = tmp_path / "side.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_structure_of_ones_own_is_read_and_identified(tmp_path):
    structure = Structure.from_toml(write(tmp_path, GOOD))
    assert structure.parameter("Y_lat") == Parameter("Y_lat", "m/s^2", 2.0, (0.0, 9.0))
    assert structure.parameter("Y_v").meaning == "side damping"
    assert structure.M == (("1", "0"), ("0", "2*tau + 1"))
    assert structure.F == (("Y_v", "-g"), ("-Y_v/4", "-1"))
    assert structure.H1 == (("1", "0"), ("0", "0"))
    assert dict(structure.output_delays) == {"ay": "-0.01"}
    true = {"Y_v": -0.35, "Y_lat": 3.1, "tau": 0.03}
    frf = of_model(structure, true, np.geomspace(0.2, 30.0, 60))
    fit = identify(frf, structure)
    # the data are exact: what is left is the search's tolerance, 1e-10 of the cost
    assert fit.values == pytest.approx(true, rel=1e-5)
    assert fit.delays == pytest.approx({"lat": true["tau"], "ay": -0.01, "v": 0.0}, rel=1e-5)
    bounded = structure.with_bounds({"Y_lat": (0.0, 2.5)})
    assert identify(frf, bounded).at_bound == ("Y_lat",)


NO_STATES = transfer_function(zeros=0, poles=0, input="lat", output="p")
SHAPES = [NO_STATES, structures.heave.with_fixed({"Z_w": -1.0}, {"Z_w": 0.1})]
SHAPES += structures.BUILT_IN.values()


@pytest.mark.parametrize("structure", SHAPES, ids=lambda one: one.name)
def test_a_structure_survives_its_file_and_json(structure, tmp_path):
    text = structure.to_toml(tmp_path / "one.toml")
    again = Structure.from_toml(tmp_path / "one.toml")
    assert again == structure == Structure.from_dict(json.loads(json.dumps(structure.to_dict())))
    assert again.to_toml() == text


@tabled("old", "new", "error", "message")
def test_mistakes_name_the_file_and_the_entry(tmp_path, old, new, error, message):
    assert GOOD.count(old) >= 1
    path = write(tmp_path, GOOD.replace(old, new, 1))
    with pytest.raises(error, match=message) as raised:
        Structure.from_toml(path)
    assert str(raised.value).startswith(f"{path}: ")


HEAVE = structures.heave.to_dict()
HELD = {key: one for key, one in HEAVE.items() if key != "H1"}
KNOWN = {"name": "K", "unit": "1", "start": 1.0}


@tabled("make", "given", "change", "error", "message")
def test_what_does_not_fit_together_is_refused(make, given, change, error, message):
    with pytest.raises(error, match=message):
        make(given | change)


def test_a_bound_may_be_open():
    for pair in (["-inf", 0.0], [-2.0, "inf"], [-math.inf, math.inf]):
        plain = {**HEAVE["parameters"]["Z_w"], "bounds": pair}
        read = Structure.from_dict({**HEAVE, "parameters": HEAVE["parameters"] | {"Z_w": plain}})
        assert read.parameter("Z_w").limits == tuple(map(float, pair))
    assert Parameter("k", "1", -4.0, scale=3.0).magnitude == 3.0
    assert Parameter("k", "1", -4.0).magnitude == 4.0
    assert Parameter("k", "1", 0.0).magnitude > 0.0


def test_structures_move_to_other_channels():
    sticks = structures.rollpitch.renamed({"lat": "LAT", "lon": "LON"}, name="rollpitch_in2")
    assert (sticks.name, sticks.inputs) == ("rollpitch_in2", ("LAT", "LON"))
    assert set(sticks.input_delays) == {"LAT", "LON"}
    assert sticks.renamed({"p": "P"}).name == "rollpitch_in2"
    for call, message in rows(globals(), "test_structures_move_to_other_channels"):
        with pytest.raises(UnknownNameError, match=message):
            call()


@tabled("change", "further")
def test_responses_of_a_chain_run_one_way(change, further):
    chain = Structure(
        name="chain",
        parameters=(Parameter("a", "1", 0.0, fixed=True),),
        states=("x1", "x2"),
        inputs=("u1", "u2"),
        outputs=("x1", "x2"),
        **{"F": (("-1", "0"), ("a", "-1")), "G": (("1", "0"), ("0", "1"))} | change,
    )
    expected = {"x1/u1", "x2/u1", "x2/u2"} | {one for one in further if one[0] != "-"}
    assert chain.connected == expected - {one[1:] for one in further if one[0] == "-"}


def test_paths_are_those_of_a_response_that_is_not_zero():
    rng = np.random.default_rng(0)
    s = 1j * np.array([0.7, 3.1])
    for _ in range(40):
        F, G_ = rng.normal(size=(4, 4)), rng.normal(size=(4, 2))
        M = np.eye(4) + rng.normal(size=(4, 4)) * (rng.random((4, 4)) < 0.1)
        F[rng.random((4, 4)) < 0.7] = 0.0
        G_[rng.random((4, 2)) < 0.6] = 0.0
        names = ("x0", "x1", "x2", "x3")
        structure = Structure(
            "sparse", (), names, ("u0", "u1"), names, M=M.tolist(), F=F.tolist(), G=G_.tolist()
        )
        outside = np.abs([np.linalg.solve(M * x - F, G_) for x in s]).max(axis=0)
        for (o, i), size in np.ndenumerate(outside):
            # what elimination leaves of a zero, of numbers of order one to a hundred
            assert f"x{o}/u{i}" in structure.connected or size < 1e-12


def test_starts_are_orders_of_magnitude():
    """Never an answer; of yaw_overall well-damped poles at 10 rad/s."""
    for structure in structures.BUILT_IN.values():
        for one in structure.parameters:
            assert float(f"{one.start:.1g}") == one.start or structure.name == "yaw_overall"
            assert f"{abs(one.start):e}"[0] in "13457" if one.start else one.scale


@pytest.mark.parametrize("name", ["jr700", "blade360"])
def test_a_round_rotor_is_every_rotor_but_for_what_is_odd(name):
    """What the models' exact linearisations have is within two of the errors that are taken."""
    d = load(name).derivatives
    odd = {
        "odd_cross": d["A_b"] + d["B_a"],
        "odd_gain": d["A_lon"] / d["B_lat"] - 1.0,
        "odd_phase": (d["A_lat"] + d["B_lon"]) / d["B_lat"],
        "odd_delay": 3e-4,
    }
    free, tied = structures.rollpitch_speeds, structures.rollpitch_round
    known = {one: d.get(one, 0.0) for one in free.names} | {"tau_lat": 0.02, "tau_lon": 0.0203}
    omega = np.geomspace(2.0, 45.0, 9)
    same = response(tied, {one: (known | odd)[one] for one in tied.names}, omega)
    np.testing.assert_allclose(same, response(free, known, omega), rtol=1e-9)
    errors = {one.name: one.error for one in tied.parameters} | {"odd_cross": _ODD}
    assert all(abs(value) < 2.0 * errors[one] for one, value in odd.items())


@pytest.mark.parametrize("order", [2, 3])
def test_transfer_functions_start_from_well_damped_poles_with_their_units(order):
    """Butterworth's first and second order, and a binomial of higher order, all at 5 rad/s."""
    made = transfer_function(zeros=0, poles=order, input="lat", output="p", frequency=5.0)
    expected = np.poly([-5.0] * order)
    if order <= 2:
        expected = np.real(butter(order, 5.0, analog=True)[1])
    for power in range(order):
        parameter, missing = made.parameter(f"a{power}"), order - power
        assert parameter.start == pytest.approx(expected[missing], rel=1e-12)
        assert parameter.unit == ("1/s" if missing == 1 else f"1/s^{missing}")
    model = control.tf([1.0], [1.0, *expected[1:]])
    got = response(made, made.starts, FREQUENCY)[0, 0]
    assert got == pytest.approx(model(1j * FREQUENCY), rel=1e-9)


def test_transfer_functions_are_their_polynomials():
    structure = transfer_function(zeros=3, poles=3, input="ped", output="r")
    values = {"b3": 0.5, "b2": 1.0, "b1": -2.0, "b0": 4.0, "a2": 3.0, "a1": 7.0, "a0": 9.0}
    s = 1j * FREQUENCY
    ratio = np.polyval([0.5, 1.0, -2.0, 4.0], s) / np.polyval([1.0, 3.0, 7.0, 9.0], s)
    got = response(structure, {**values, "tau": 0.1}, FREQUENCY)[0, 0]
    np.testing.assert_allclose(got, ratio * np.exp(-0.1 * s), rtol=1e-12)
    second = transfer_function(zeros=1, poles=2, input="ped", output="r")
    assert second.names == ("b1", "b0", "a1", "a0", "tau")


WIDE = np.geomspace(0.3, 60.0, 160)


@tabled("small", "large", "values")
def test_a_larger_structure_is_the_smaller_one_without_what_it_adds(small, large, values):
    values = values | {"tau_1": 1e-9, "turn": 0.0, "torque": 0.0}
    free, plain = structures.named(large), structures.named(small)
    if "tau_1" in free.names:
        free = free.with_bounds({"tau_1": None})
    whole = response(free, {name: values[name] for name in free.names}, WIDE)
    expected = response(plain, {name: values[name] for name in plain.names}, WIDE)
    # a lag of 1e-9 s at 60 rad/s
    np.testing.assert_allclose(whole[: len(expected)], expected, rtol=1e-6)


def test_heave_is_chen_and_hindsons_without_coning():
    """NASA TM 88327, Table 1, rows of inflow and heave, blades that don't flap.

    v' = -75 pi Omega / 32 (v + a s / 16) C_0 v + 75 pi Omega / 64 (v + a s / 8) C_0 w + ..., with
    C_0 = 0.639 for Carpenter and Fridovich's mass of air: their M11 = 128 / (75 pi) / C_0.
    """
    speed, mean, loading, weighed = 24.085, 0.0485, 5.73 * 0.067, 0.639  # a CH-47's rotor
    rows = 75.0 * np.pi * speed * weighed
    a11, a12 = -rows / 32.0 * (mean + loading / 16.0), rows / 64.0 * (mean + loading / 8.0)
    deficiency = 1.0 / (1.0 + loading / (16.0 * mean))
    values = {**INFLOW, "C": deficiency, "tau_0": -1.0 / a11}
    a = linear(structures.heave_inflow, values).a
    assert (a[1, 1], a[1, 0]) == pytest.approx((a11, a12))
    assert a[0, 0] == -a[0, 1]
