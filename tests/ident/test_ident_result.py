"""Fits as data: stored without loss, printed with sense, refused when damaged."""

import copy
import dataclasses
import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.io import loadmat

from helisim.base.errors import InputError, StorageError, UnknownNameError
from helisim.ident import Fit, FrequencyResponse, Structure, identify, load_fit, structures
from helisim.ident.evaluate import response
from helisim.ident.fitted import rounded
from late import LATE

FREQUENCY = np.geomspace(1.0, 40.0, 90)
VALUES = {
    "tau_f": 0.045, "L_b": 540.0, "M_a": 315.0, "A_b": -0.35, "B_a": 0.53, "A_lat": 0.066,
    "A_lon": 0.37, "B_lat": 0.38, "B_lon": -0.061, "tau_lat": 0.0115, "tau_lon": -0.0083,
}  # fmt: skip


def noisy(structure, values, size=0.02):
    clean = response(structure, values, FREQUENCY)
    random = np.random.default_rng(0)
    wobble = random.standard_normal(clean.shape) + 1j * random.standard_normal(clean.shape)
    return FrequencyResponse.exact(
        FREQUENCY,
        clean * np.exp(size * wobble),
        inputs=structure.inputs,
        outputs=structure.outputs,
        output_units=("rad/s",) * len(structure.outputs),
    )


@pytest.fixture(scope="module")
def fit():
    structure = structures.rollpitch.with_fixed({"tau_lat": 0.0115})
    return identify(noisy(structure, VALUES), structure)


@pytest.fixture(scope="module")
def unseen():
    """A fit with a parameter that the data do not see: its bounds are infinite."""
    plain = structures.heave.to_dict()
    plain["parameters"]["Z_q"] = {"unit": "1", "start": 1.0}
    plain["F"] = [["Z_w + 0*Z_q"]]
    structure = Structure.from_dict(plain)
    values = {"Z_w": -1.0, "Z_col": -10.0, "tau_col": 0.01, "Z_q": 1.0}
    return identify(noisy(structure, values), structure)


@pytest.mark.parametrize("which", ["fit", "unseen"])
def test_a_fit_survives_json_without_loss(which, request, tmp_path):
    """What is read back is the same to the last bit, and gives the same model and table."""
    one = request.getfixturevalue(which)
    plain = one.to_dict()
    again = Fit.from_dict(json.loads(json.dumps(plain, allow_nan=False)))
    assert again.to_dict() == plain
    assert str(again) == str(one)
    assert again.values == one.values
    for name, parameter in one.parameters.items():
        assert dataclasses.asdict(again[name]) == dataclasses.asdict(parameter)
    np.testing.assert_array_equal(again.correlation, one.correlation)
    np.testing.assert_array_equal(again.data.response, one.data.response)
    np.testing.assert_array_equal(again.model.A, one.model.A)
    assert again.data.output_units == one.data.output_units
    one.save(tmp_path / "fit.json")
    assert load_fit(tmp_path / "fit.json").to_dict() == plain


def test_what_is_not_seen_is_infinite_in_figures_and_none_in_json(unseen):
    """An unseen parameter has infinite bounds, which strict JSON can't hold."""
    assert math.isinf(unseen["Z_q"].cramer_rao)
    row = next(x for x in unseen.to_dict()["parameters"] if x["name"] == "Z_q")
    assert row["cramer_rao"] is None
    assert math.isinf(Fit.from_dict(unseen.to_dict())["Z_q"].cramer_rao)


def test_provenance_says_from_what_and_with_what(fit):
    """Records, windows, band, method and program versions go with a fit."""
    provenance = fit.provenance
    assert provenance["method"] == "direct"
    assert provenance["band_rad_s"] == pytest.approx([1.0, 40.0])
    assert provenance["versions"]["numpy"] == np.__version__
    assert {"records", "windows_s", "reference", "conditioning"} <= set(provenance)
    old = {**fit.to_dict()}
    old["provenance"] = {**provenance, "versions": {"helisim": "0.0.1"}}
    assert Fit.from_dict(old).versions == {"helisim": "0.0.1"}


@pytest.mark.parametrize("key", ["structure", "parameters", "correlation", "costs", "data"])
def test_a_damaged_fit_is_refused(fit, key, tmp_path):
    """A missing or mistyped part ends in a message that names the file and the part."""
    lacking = {name: item for name, item in fit.to_dict().items() if name != key}
    path = tmp_path / "fit.json"
    path.write_text(json.dumps(lacking))
    with pytest.raises(InputError, match=rf"fit\.json: the fit lacks {key}"):
        load_fit(path)
    with pytest.raises(InputError):
        Fit.from_dict({**fit.to_dict(), key: 3})


def test_what_is_no_fit_is_refused(tmp_path, fit):
    """Another JSON file, no JSON and no file are told apart."""
    path = tmp_path / "other.json"
    path.write_text('{"format": "else"}')
    with pytest.raises(InputError, match=r"other\.json: this isn't a fit.*'else'"):
        load_fit(path)
    path.write_text("{")
    with pytest.raises(StorageError, match=r"other\.json"):
        load_fit(path)
    path.write_text("[1]")
    with pytest.raises(StorageError, match="list"):
        load_fit(path)
    with pytest.raises(StorageError, match=r"none\.json"):
        load_fit(tmp_path / "none.json")
    data = copy.deepcopy(fit.to_dict())
    data["data"]["colour"] = [1.0]
    with pytest.raises(InputError, match="colour"):
        Fit.from_dict(data)
    with pytest.raises(StorageError, match="can't write"):
        fit.save(tmp_path / "missing" / "fit.json")


def test_support_names_the_parameters_it_is_correlated_with():
    """Two gains in series can stand in for each other, and the table says so."""
    plain = structures.heave.to_dict()
    plain["parameters"]["K"] = {"unit": "1", "start": 1.0}
    plain["G"] = [["Z_col + 0.9*K"]]
    structure = Structure.from_dict(plain)
    fit = identify(
        noisy(structures.heave, {"Z_w": -1.0, "Z_col": -10.0, "tau_col": 0.0}), structure
    )
    assert fit.support("K").startswith("degenerate")  # only K Z_col is seen
    free = identify(noisy(structures.rollpitch, VALUES, 0.001), structures.rollpitch, searches=2)
    for first, second, _ in free.correlated:
        assert second in free.support(first)
        assert first in free.support(second)
    with pytest.raises(UnknownNameError):
        fit.support("none")


@pytest.mark.parametrize(
    ("value", "error", "expected"),
    [
        # The first three digits of the error decide (Particle Data Group, Review, section 5.3).
        (0.827, 0.119, ("0.83", "0.12")),
        (0.827, 0.367, ("0.8", "0.4")),
        (0.827, 0.963, ("0.8", "1.0")),
        (539.512, 3.54, ("539.5", "3.5")),
        (539.512, 35.6, ("540", "40")),
        (539.512, 9.996, ("540", "10")),
        (-0.0083, 0.00021, ("-0.00830", "0.00021")),
        (5115.2, 1234.0, ("5100", "1200")),
        (2.0, 0.0, ("2", "")),
        (2.0, math.inf, ("2", r"\infty")),
    ],
)
def test_values_are_rounded_by_their_errors(value, error, expected):
    """A value ends where its error does."""
    assert rounded(value, error) == expected


@given(value=st.floats(-1e9, 1e9), error=st.floats(1e-9, 1e9))
def test_rounding_moves_a_value_by_less_than_its_error(value, error):
    """Whatever the numbers, rounding costs at most a sixth of the error."""
    text, _ = rounded(value, error)
    slack = max(error / 6.0, 1e-6 * abs(value))
    assert abs(float(text) - value) <= slack * (1.0 + 1e-9)


def test_the_latex_table_has_a_row_a_parameter(fit):
    """Every parameter has a row; names and units are escaped; braces and rows are closed."""
    table = fit.to_latex(caption="Roll and pitch", label="tab:rollpitch")
    assert table.count(r"\pm") == len(fit.structure.free)
    assert r"$\tau_{\mathrm{f}}$" in table
    assert r"$A_{\mathrm{lat}}$" in table
    assert "1/s$^2$" in table
    assert "fixed" in table
    assert table.count("{") == table.count("}")
    assert r"\begin{tabular}" in table
    assert r"\label{tab:rollpitch}" in table


def test_matlab_reads_the_same_model(fit, tmp_path):
    """The MAT file holds the state space, delays as columns and names as cell arrays."""
    fit.to_matlab(tmp_path / "model.mat")
    data = loadmat(tmp_path / "model.mat")
    for matrix in "ABCD":
        np.testing.assert_array_equal(data[matrix], getattr(fit.model, matrix))
    assert data["InputDelay"].shape == (2, 1)
    assert data["InputDelay"][1, 0] == fit["tau_lon"].value
    assert [str(cell[0][0]) for cell in data["InputName"]] == ["lat", "lon"]
    assert [str(cell[0][0]) for cell in data["ParameterName"]] == list(fit.structure.names)
    assert data["ParameterValue"][1, 0] == fit["L_b"].value
    with pytest.raises(StorageError, match="can't write"):
        fit.to_matlab(tmp_path / "missing" / "model.mat")


GRID = np.geomspace(0.5, 20.0, 40)


@pytest.fixture(scope="module")
def loose():
    exact = response(LATE, {p.name: p.start for p in LATE.parameters}, GRID)
    data = FrequencyResponse.exact(GRID, exact, inputs=LATE.inputs, outputs=LATE.outputs)
    return identify(data, LATE)


def test_the_latex_table_marks_what_is_poorly_identified_or_at_its_bound(loose):
    """A star for either, and the figures of each parameter; one of these five is poor."""
    rows = [line for line in loose.to_latex().splitlines() if line.count("&") == 4][1:]
    assert len(rows) == len(LATE.parameters)
    stars = 0
    for row, parameter in zip(rows, LATE.parameters):
        one = loose[parameter.name]
        assert ("^*" in row) == (one.poorly_identified or one.at_bound)
        assert f" & {one.cr_percent:.1f} & {one.insensitivity_percent:.1f} " in row
        stars += "^*" in row
    assert 0 < stars < len(rows)


FINE = np.geomspace(0.5, 20.0, 60)


@pytest.fixture(scope="module")
def wobbly():
    structure = structures.yaw_base
    values = {"N_r": -0.7, "N_ped": 50.0, "tau_r_base": 0.04}
    exact = response(structure, values, FINE)
    wobble = 1.0 + 0.03 * np.random.default_rng(1).normal(size=(*exact.shape, 2)) @ [1.0, 1j]
    data = FrequencyResponse.exact(
        FINE, exact * wobble, inputs=structure.inputs, outputs=structure.outputs
    )
    return identify(data, structure)


def test_the_table_states_each_response_its_band_and_the_support(wobbly):
    """A line a parameter, a line a response, and the average with its word."""
    lines = str(wobbly).splitlines()
    (pair,) = wobbly.costs
    low, high = wobbly.bands[pair]
    message = f"J {pair} = {wobbly.costs[pair]:.4g} from {low:.3g} to {high:.3g} rad/s"
    assert f"{message}; {wobbly.misfit.words(pair)}" in lines
    word = (
        "excellent" if wobbly.cost <= 50.0 else "acceptable" if wobbly.cost <= 100.0 else "too high"
    )
    assert f"average J = {wobbly.cost:.4g}: {word}" in lines
    for name in ("N_r", "N_ped", "tau_r_base"):
        (line,) = (one for one in lines if one.startswith(name + " "))
        assert re.search(
            rf"{wobbly[name].cr_percent:.2f} .* {wobbly[name].insensitivity_percent:.2f} ",
            line,
        )
    for number, (a, b, size) in enumerate(wobbly.correlated):
        assert a != b
        assert abs(size) > 0.9
        assert f"correlated with {b}" in wobbly.support(a) or number


def test_a_fit_of_known_error_states_who_is_correlated_with_whom(wobbly):
    """Pairs once each, as in the matrix of correlations."""
    names = [parameter.name for parameter in wobbly.structure.free]
    expected = {
        (a, b): wobbly.correlation[i, j]
        for i, a in enumerate(names)
        for j, b in enumerate(names)
        if i < j and abs(wobbly.correlation[i, j]) > 0.9
    }
    assert {(a, b): size for a, b, size in wobbly.correlated} == expected


TRUE = {"Z_w": -0.8, "Z_col": -25.0, "tau_col": 0.03}


def fitted(structure=structures.heave):
    exact = response(structures.heave, TRUE, GRID)
    data = FrequencyResponse.exact(GRID, exact, inputs=structure.inputs, outputs=structure.outputs)
    return identify(data, structure)


@pytest.fixture(scope="module")
def exact():
    return fitted()


def test_a_fit_is_in_order_only_if_nothing_is_amiss(exact):
    """One complaint is enough: each of the four alone takes the verdict away."""
    assert exact.ok
    name, sound = next(iter(exact.parameters.items()))
    others = {key: one for key, one in exact.parameters.items() if key != name}
    assert not replace(exact, converged=False).ok
    assert not replace(exact, costs=dict.fromkeys(exact.costs, 1e4)).ok
    assert not replace(exact, parameters={name: replace(sound, at_bound=True), **others}).ok
    vague = replace(sound, cramer_rao=abs(sound.value), insensitivity=abs(sound.value))
    assert not replace(exact, parameters={name: vague, **others}).ok


def test_percent_is_of_the_values_size_and_endless_of_nothing(exact):
    """A bound of 0.5 is 50 % of -1, infinitely much of 0, and none of either if it is 0."""
    one = replace(exact["Z_w"], cramer_rao=0.5, insensitivity=0.25)
    assert replace(one, value=-1.0).cr_percent == 50.0
    assert replace(one, value=-1.0).insensitivity_percent == 25.0
    assert replace(one, value=0.0).cr_percent == np.inf
    assert replace(one, value=0.0, cramer_rao=0.0).cr_percent == 0.0


def test_support_names_whom_a_parameter_is_correlated_with(exact):
    """In both directions, and nobody where no correlation exceeds nine tenths."""
    names = [parameter.name for parameter in exact.structure.free]
    apart = replace(exact, correlation=np.eye(len(names)))
    assert all("correlated" not in apart.support(name) for name in names)
    tied = np.eye(len(names))
    tied[0, 1] = tied[1, 0] = -0.95
    together = replace(exact, correlation=tied)
    for one, other in (names[:2], names[1::-1]):
        assert together.support(one) == f"{apart.support(one)}, correlated with {other}"


def test_a_value_of_negligible_error_has_seven_digits():
    """An error of a ten-millionth of the value or less isn't stated."""
    assert rounded(1.23456789, 1e-8) == ("1.234568", "")
    assert rounded(1.23456789, 1e-7) == ("1.234568", "")
    assert rounded(1.23456789, 2e-7)[1] != ""
