"""Fits as data: stored without loss, printed with sense, refused when damaged."""

import copy
import dataclasses
import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.io import loadmat

from helisim.errors import InputError, StorageError, UnknownNameError
from helisim.ident import Fit, FrequencyResponse, Structure, identify, load_fit, structures
from helisim.ident.evaluate import response
from helisim.ident.export import rounded

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
    with pytest.raises(InputError, match=rf"fit\.json: the fit lacks '{key}'"):
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


def test_a_verdict_names_the_parameters_it_is_correlated_with():
    """Two gains in series can stand in for each other, and the table says so."""
    plain = structures.heave.to_dict()
    plain["parameters"]["K"] = {"unit": "1", "start": 1.0}
    plain["G"] = [["Z_col + 0.9*K"]]
    structure = Structure.from_dict(plain)
    fit = identify(
        noisy(structures.heave, {"Z_w": -1.0, "Z_col": -10.0, "tau_col": 0.0}), structure
    )
    assert "poor" in fit.verdict("K")
    free = identify(noisy(structures.rollpitch, VALUES, 0.001), structures.rollpitch, searches=2)
    for first, second, _ in free.correlated:
        assert second in free.verdict(first)
        assert first in free.verdict(second)
    with pytest.raises(UnknownNameError):
        fit.verdict("none")


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
