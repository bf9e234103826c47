"""Responses, slopes and time histories of structures with numbers, by closed forms and SciPy."""

import json
from dataclasses import replace

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import loadmat
from scipy.signal import StateSpace, freqresp

from helisim.base.errors import IdentificationError, InputError, UnknownNameError
from helisim.ident import Fit, Parameter, Structure, identify, reduce, structures, verify
from helisim.ident import evaluate as module
from helisim.ident.evaluate import (
    Sensitivity,
    delayed,
    matrices,
    response,
    response_and_slope,
    state_space,
)
from helisim.ident.result import descriptor
from helisim.records.record import FlightRecord, channel
from ident_data import of_model, slopes
from late import LATE

GRID = np.geomspace(0.5, 20.0, 15)
NAMES = list(structures.BUILT_IN)


def near_starts(structure, seed=None):
    """Return values about the starts, of a seed or at them."""
    random = np.random.default_rng(seed)
    return {
        one.name: (one.start or 0.3 * one.magnitude) * (random.uniform(0.5, 1.5) if seed else 1.0)
        for one in structure.parameters
    }


def lags(size=2, mass=("T", "T"), names=("T", "K")):
    return Structure(
        name="lags",
        parameters=tuple(Parameter(name, "1", 1.0) for name in names),
        states=("x", "y"),
        inputs=("u",),
        outputs=("y",),
        M=((mass[0], "0"), ("0", mass[1])),
        F=(("-1", "0"), ("1", "-1" if size == 2 else "-3")),
        G=(("K",), ("0",)),
    )


JORDAN = lags()
"""Two equal lags in a row: no two independent eigenvectors."""


@pytest.mark.parametrize("few", [0, 1e9])
def test_equal_lags_are_their_transfer_function(few, monkeypatch):
    """K / (T s + 1)^2 and its slopes by hand, where eigenvectors can't be used.

    With T = 0, M is singular and y = K u; by T, the slope of the lags is -2 K s.
    """
    monkeypatch.setattr(module, "_FEW", few)
    s, k = 1j * GRID, 2.0
    for t in (0.1, 0.0):
        found, slope = response_and_slope(JORDAN, {"T": t, "K": k}, GRID)
        np.testing.assert_allclose(found[0, 0], k / (t * s + 1) ** 2, rtol=1e-13)
        np.testing.assert_allclose(slope[0, 0, 0], -2 * k * s / (t * s + 1) ** 3, rtol=1e-13)
        np.testing.assert_allclose(slope[1, 0, 0], 1 / (t * s + 1) ** 2, rtol=1e-13)


@pytest.mark.parametrize("name", NAMES)
def test_eigenvectors_and_inverses_give_the_same(name, monkeypatch):
    """To the ten digits that are promised, slopes included."""
    structure = structures.named(name)
    monkeypatch.setattr(module, "_FEW", 0)
    ways = []
    for independent in (1e5, 0.0):
        monkeypatch.setattr(module, "_INDEPENDENT", independent)
        ways.append(response_and_slope(structure, near_starts(structure, 3), GRID))
    for one, other in zip(*ways):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-10 * np.max(np.abs(other)))


@pytest.mark.parametrize("name", NAMES)
def test_modes_serve_where_they_can(name, monkeypatch):
    """They are what makes large fits fast; inverses serve small ones, and those that have none."""
    monkeypatch.setattr(module, "_FEW", 0)
    structure, two = structures.named(name), lags(3, ("1", "1"), ("K",))

    def refused(*_):
        raise AssertionError("the slow way was taken")

    monkeypatch.setattr(module, "_by_inverse", refused)
    assert np.all(np.isfinite(response(structure, near_starts(structure, 4), GRID)))
    with pytest.raises(AssertionError, match="slow way"):
        response(JORDAN, {"T": 0.1, "K": 2.0}, GRID)
    monkeypatch.setattr(module, "_FEW", 2**2 * GRID.size)
    with pytest.raises(AssertionError, match="slow way"):
        response(two, {"K": 2.0}, GRID)
    monkeypatch.setattr(module, "_FEW", 2**2 * GRID.size - 1)
    assert np.all(np.isfinite(response(two, {"K": 2.0}, GRID)))


@pytest.mark.filterwarnings("ignore:Badly conditioned filter")  # of scipy's polynomials
@pytest.mark.parametrize("few", [0, 1e9])
def test_a_state_space_of_scipy_has_the_same_response(few, monkeypatch):
    """An outside program's response of the rigid body with flapping."""
    monkeypatch.setattr(module, "_FEW", few)
    values = near_starts(structures.rollpitch)
    numbers = matrices(structures.rollpitch, values)
    a, b = (np.linalg.solve(numbers.M, x) for x in (numbers.F, numbers.G))
    found = response(structures.rollpitch, {**values, "tau_lat": 0.0, "tau_lon": 0.0}, GRID)
    for o, i in np.ndindex(2, 2):
        _, expected = freqresp(StateSpace(a, b[:, [i]], np.eye(4)[[o]], np.zeros((1, 1))), GRID)
        np.testing.assert_allclose(found[o, i], expected, rtol=1e-9)


@pytest.mark.parametrize("few", [0, 1e9])
def test_points_are_those_of_the_whole_response(few, monkeypatch):
    """In any order, any pair, any frequency twice; a scale multiplies each point's slopes."""
    monkeypatch.setattr(module, "_FEW", few)
    structure, values = structures.hover, near_starts(structures.hover)
    total, slope = response_and_slope(structure, values, GRID)
    random = np.random.default_rng(5)
    o, i, k = (random.integers(0, top, 50) for top in (4, 2, GRID.size))
    program = structure.program
    sample = Sensitivity(program, GRID[k], o, i).at(program.ordered(values))
    scale = random.normal(size=50) + 1j
    np.testing.assert_allclose(sample.response, total[o, i, k], rtol=1e-12)
    np.testing.assert_allclose(sample.slope(scale), scale * slope[:, o, i, k], rtol=1e-9, atol=1e-9)


def test_a_parameter_that_stands_nowhere_has_no_slope_and_one_without_a_value_is_named():
    """Zero, not what stood in the array before; with the names that there are."""
    idle = replace(JORDAN, parameters=(Parameter("idle", "1", 1.0), *JORDAN.parameters))
    _, slope = response_and_slope(idle, {"idle": 3.0, "T": 0.1, "K": 2.0}, GRID)
    np.testing.assert_array_equal(slope[0], np.zeros((1, 1, GRID.size)))
    with pytest.raises(UnknownNameError, match=r"unknown parameter 'K'.* available: T"):
        response(JORDAN, {"T": 0.1}, GRID)


@pytest.mark.parametrize("few", [0, 1e9])
def test_what_is_undefined_is_not_finite(few, monkeypatch):
    """A division by zero in F or in G, and a pencil that is singular at every frequency."""
    monkeypatch.setattr(module, "_FEW", few)
    for change, values in (
        ({"F": (("1/K", "0"), ("1", "-1"))}, {"T": 0.1, "K": 0.0}),
        ({"G": (("1/K",), ("0",))}, {"T": 0.1, "K": 0.0}),
        ({"F": (("0", "0"), ("0", "0"))}, {"T": 0.0, "K": 1.0}),
    ):
        assert not np.any(np.isfinite(response(replace(JORDAN, **change), values, GRID)))


TRUE = {"Z_w": -0.7, "Z_col": -40.0, "K": -0.6, "N": 3.0, "N_r": -2.0, "wait": 0.05, "more": 0.04}
WIDE = np.geomspace(0.4, 30.0, 40)
STEP = 0.01


def collective(**change):
    """Heave acceleration, improper by the blades' coning, and yaw over collective."""
    late = {"unit": "s", "start": 0.02, "bounds": [-0.3, 0.3]}
    plain = {name: {"unit": "1", "start": 1.0} for name in ("Z_w", "Z_col", "K", "N", "N_r")}
    found = {
        "name": "collective",
        "parameters": {**plain, "wait": late, "more": {**late, "start": 0.0, "scale": 0.03}},
        "states": ["w", "r"],
        "inputs": ["col", "ped"],
        "outputs": ["az", "r"],
        "F": {"w": {"w": "Z_w"}, "r": {"r": "N_r"}},
        "G": {"w": {"col": "Z_col"}, "r": {"col": "N", "ped": "9"}},
        "H0": {"r": {"r": 1}},
        "H1": {"az": {"w": 1}},
        "D1": {"az": {"col": "K"}},
        "input_delays": {"col": "wait"},
        "delays": {"r/col": "more"},
    }
    found["parameters"]["Z_w"]["start"] = found["parameters"]["N_r"]["start"] = -1.0
    found["parameters"]["Z_col"]["start"] = -10.0
    found["parameters"]["K"] |= {"start": 0.0, "scale": 0.3}
    return Structure.from_dict({**found, **change})


SIDE = Structure.from_dict(
    {
        "name": "side",
        "parameters": {
            "Y_v": {"unit": "1/s", "start": -0.3},
            "Y_lat": {"unit": "m/s^2", "start": 3.0, "bounds": [0.0, 9.0]},
            "tau": {"unit": "s", "start": 0.04, "scale": 0.05},
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
"""With H1, D, delays on both sides and a tied parameter."""


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=10, deadline=None)
@given(seed=st.integers(1, 10**6))
def test_response_derivative_equals_finite_difference(name, seed):
    """Each built-in structure's analytic derivative is that of its response."""
    structure = structures.named(name)
    values = near_starts(structure, seed)
    total, slope = response_and_slope(structure, values, GRID)
    for found, numeric, one in zip(
        slope, slopes(structure, values, GRID, step=1e-5), structure.free
    ):
        # Central differences of 1e-5: truncation 1e-10, and rounding of 1e-13 of the response,
        # which the eigenvectors of slow modes leave, over the step 1e-8.
        scale = np.max(np.abs(total)) / min(one.magnitude, abs(values[one.name]))
        np.testing.assert_allclose(found, numeric, rtol=1e-5, atol=1e-7 * scale)


@pytest.mark.parametrize(
    ("structure", "values"),
    [(collective(), TRUE), (SIDE, SIDE.starts), (LATE, LATE.starts)],
    ids=lambda one: getattr(one, "name", ""),
)
def test_derivatives_through_every_matrix_and_delay_are_exact(structure, values):
    """M, H1, D, D1 and delays of either sign, of inputs, outputs and pairs."""
    _, slope = response_and_slope(structure, values, WIDE)
    # the square of the step, and rounding of 1e-16 over it
    np.testing.assert_allclose(slope, slopes(structure, values, WIDE), rtol=1e-6, atol=2e-6)


def test_delays_turn_the_phase_of_the_state_space():
    """exp(-j w tau) of the output times that of the input, and of the pair's own."""
    late = {**LATE.starts, "tau_in": 0.0, "tau_p": 0.0, "tau_q": 0.0}
    lag = np.array([[0.03 + 0.04, 0.03], [-0.02 + 0.04, -0.02]])
    expected = response(LATE, late, GRID) * np.exp(-1j * lag[:, :, None] * GRID)
    assert response(LATE, LATE.starts, GRID) == pytest.approx(expected, rel=1e-12)
    plain = state_space(SIDE, SIDE.starts)(1j * GRID, squeeze=False)
    lag = np.array([[0.04 - 0.02], [0.04]])
    found = response(SIDE, SIDE.starts, GRID)
    np.testing.assert_allclose(found, plain * np.exp(-1j * lag[:, :, None] * GRID), rtol=1e-10)
    s, k = 1j * WIDE, TRUE
    wait = np.exp(-k["wait"] * s)
    found = response(collective(), TRUE, WIDE)
    heave = (s * k["Z_col"] / (s - k["Z_w"]) + k["K"] * s) * wait
    yaw = k["N"] / (s - k["N_r"]) * wait * np.exp(-k["more"] * s)
    for own, by_hand in ((found[0, 0], heave), (found[1, 0], yaw), (found[1, 1], 9 / (s + 2.0))):
        np.testing.assert_allclose(own, by_hand, rtol=1e-13)


@pytest.fixture(scope="module")
def fit():
    responses = ("az/col", "r/col", "r/ped")
    return identify(of_model(collective(), TRUE, WIDE), collective(), responses=responses)


def test_a_fit_finds_delays_of_pairs_and_d1_and_survives_json(fit):
    """From an exact response every parameter; the file says which response waits how long."""
    assert fit.values == pytest.approx(TRUE, rel=1e-6)
    assert fit.delays == pytest.approx({"col": 0.05, "ped": 0, "az": 0, "r": 0, "r/col": 0.04})
    again = Fit.from_dict(json.loads(json.dumps(fit.to_dict())))
    assert again.structure == fit.structure
    np.testing.assert_array_equal(again.response(WIDE).response, fit.response(WIDE).response)


def test_they_survive_toml_and_other_names(tmp_path):
    """A table by response, moved with its signals; what has neither is written without them."""
    structure = collective()
    structure.to_toml(tmp_path / "mine.toml")
    assert Structure.from_toml(tmp_path / "mine.toml") == structure
    moved = structure.renamed({"r": "yaw", "col": "COL"})
    assert dict(moved.delays) == {"yaw/COL": "more"}
    plain = collective(D1={}, delays={})
    assert not {"D1", "delays"} & set(plain.to_dict())
    assert not plain.improper


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"delays": {"r/lat": "more"}}, UnknownNameError, "response with a delay.*az/col, az/ped"),
        ({"delays": {"r": "more"}}, UnknownNameError, "response with a delay"),
        ({"delays": {"r/col": "mor"}}, UnknownNameError, "'mor'; available"),
        ({"delays": {"r/col": []}}, InputError, r"delays.r/col must be text or a number"),
        ({"D1": {"az": {"lat": "K"}}}, UnknownNameError, "column of D1.az"),
        ({"D1": [["K"]]}, InputError, "D1 has 1 rows"),
    ],
)
def test_mistakes_in_them_are_named(change, error, message):
    """One line: what is wrong and what there is, in a file and in code."""
    with pytest.raises(error, match=message):
        collective(**change)
    with pytest.raises(UnknownNameError, match="response with a delay 'r/lat'"):
        replace(collective(), delays={"r/lat": "more"})


def test_an_improper_model_has_no_state_space_and_says_what_it_has(fit):
    """For python-control; the message names the ways that there are."""
    with pytest.raises(IdentificationError, match=r"improper.*proper_part"):
        _ = fit.model


def test_matlab_gets_an_improper_model_as_a_descriptor(fit, tmp_path):
    """C (s E - A)^-1 B + D with its delays is the model, computed from what the file holds."""
    fit.to_matlab(tmp_path / "model.mat")
    m = loadmat(tmp_path / "model.mat")
    s = 1j * WIDE[:, None, None]
    plain = m["C"] @ np.linalg.solve(s * m["E"] - m["A"], m["B"] + 0j * s) + m["D"]
    lag = m["OutputDelay"] + m["InputDelay"].T + m["IODelay"]
    expected = fit.response(WIDE).response.transpose(2, 0, 1)
    np.testing.assert_allclose(plain * np.exp(-s * lag), expected, rtol=1e-9, atol=1e-12)
    assert [str(cell[0][0]) for cell in m["StateName"]] == ["w", "r", "col", "d(col)/dt"]


def test_a_descriptor_is_the_model_and_what_follows_its_inputs_rates():
    """C (s E - A)^-1 B + D is the model's response and s D1, at any s; states have names."""
    random = np.random.default_rng(8)
    model = control.StateSpace(
        *(random.normal(size=shape) for shape in ((4, 4), (4, 3), (2, 4), (2, 3))),
        inputs=["col", "lon", "ped"],
        outputs=["az", "r"],
        states=["w", "q", "r", "x"],
    )
    by_rate = np.array([[0.3, 0.0, -0.2], [0.0, 0.0, 0.7]])
    plain = descriptor(model, by_rate)
    for s in (0.7j, 2.0 + 1.0j):
        pencil = s * plain["E"] - plain["A"]
        found = plain["C"] @ np.linalg.solve(pencil, plain["B"]) + plain["D"]
        assert found == pytest.approx(model(s) + s * by_rate, rel=1e-9)
    proper = descriptor(model, np.zeros((2, 3)))
    assert "E" not in proper
    assert np.array_equal(proper["A"], model.A)


def smooth(time):
    """Return an input that starts and ends at rest, and its rate."""
    x = np.clip((time - 1.0) / 4.0, 0.0, 1.0)
    return (x * (1 - x)) ** 4 * 256, 1024 * (x * (1 - x)) ** 3 * (1 - 2 * x) / 4.0


def motion(time):
    """Return az and r of TRUE in `smooth` collective, integrated by hand at a fine step."""
    fine = np.arange(0.0, time[-1] + 1e-9, STEP / 20)

    def first_order(pole, u):
        """Return x of dx/dt = pole x + u by the trapezium rule, 4e-7 of the result off."""
        h, x = STEP / 20, np.zeros(fine.size)
        for k in range(1, fine.size):
            x[k] = ((1 + pole * h / 2) * x[k - 1] + h / 2 * (u[k] + u[k - 1])) / (1 - pole * h / 2)
        return x

    u, rate = smooth(fine - TRUE["wait"])
    w = first_order(TRUE["Z_w"], TRUE["Z_col"] * u)
    az = TRUE["Z_w"] * w + TRUE["Z_col"] * u + TRUE["K"] * rate
    later = smooth(fine - TRUE["wait"] - TRUE["more"])[0]
    return np.stack([az, first_order(TRUE["N_r"], TRUE["N"] * later)], axis=1)[::20]


def test_time_histories_have_them(fit):
    """A record made by hand is predicted: by 1e-4, what the samples' corners leave of the input."""
    time = np.arange(0.0, 8.0, STEP)
    u = smooth(time)[0]
    columns = np.column_stack([u, 0.0 * u, motion(time)])
    record = FlightRecord(time, columns, tuple(map(channel, ("col", "ped", "az", "r"))))
    assert verify(fit, record).tic < 1e-4


@pytest.mark.parametrize("lag", [0.03, 0.0344, -0.0271])
def test_an_inputs_rate_is_of_second_order_in_the_step(lag):
    """Half the step leaves a quarter of the error, whatever part of a sample the delay is."""
    error = []
    model = replace(collective(), H0=(("0", "0"),) * 2, H1=(("0", "0"),) * 2, D1=((0, 0),) * 2)
    for step in (0.02, 0.01):
        time = np.arange(0.0, 8.0, step)
        u = np.column_stack([smooth(time)[0], 0.0 * time])
        d1 = np.array([[1.0, 0.0], [0.0, 0.0]])
        got = delayed(state_space(model, TRUE), u, step, np.full((2, 2), lag), d1)[:, 0]
        error.append(np.max(np.abs(got - smooth(time - lag)[1])))
    assert error[1] < 0.35 * error[0]
    assert error[1] < 1e-3


def test_a_responses_delay_is_not_dropped_unless_delays_may_be():
    """As an input's; K, which the exact response has none of, goes."""
    none = of_model(collective(), {**TRUE, "K": 0.0, "more": 0.0}, WIDE)
    smaller = reduce(none, collective(), responses=("az/col", "r/col", "r/ped"), searches=2)
    assert smaller.dropped == ("K",)
    assert smaller.protected == ("more",)
