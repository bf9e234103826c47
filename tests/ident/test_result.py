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
from helisim.ident import Fit, Parameter, identify, load_fit, structures
from helisim.ident.fitted import rounded
from ident_data import HEAVE, ROLLPITCH, YAW, fitted, of_model
from late import LATE

FREQUENCY = np.geomspace(1.0, 40.0, 90)


@pytest.fixture(scope="module")
def fit():
    structure = structures.rollpitch.with_fixed({"tau_lat": 0.0115})
    return fitted(structure, ROLLPITCH, FREQUENCY, noise=0.02)


@pytest.fixture(scope="module")
def unseen():
    """A fit with a parameter that the data do not see: its bounds are infinite."""
    heave = structures.heave
    parameters = (*heave.parameters, Parameter("Z_q", "1", 1.0))
    structure = replace(heave, parameters=parameters, F=(("Z_w + 0*Z_q",),))
    return fitted(structure, {**HEAVE, "Z_q": 1.0}, FREQUENCY, noise=0.02)


@pytest.fixture(scope="module")
def wobbly():
    return fitted(structures.yaw_base, YAW, noise=0.03, seed=1)


@pytest.fixture(scope="module")
def exact():
    return fitted(structures.heave, HEAVE)


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
    one.save(tmp_path / "fit.json")
    assert load_fit(tmp_path / "fit.json").to_dict() == plain


def test_what_is_not_seen_is_infinite_in_figures_and_none_in_json(unseen):
    """An unseen parameter has infinite bounds, which strict JSON can't hold."""
    assert math.isinf(unseen["Z_q"].cramer_rao)
    row = next(x for x in unseen.to_dict()["parameters"] if x["name"] == "Z_q")
    assert row["cramer_rao"] is None
    assert math.isinf(Fit.from_dict(unseen.to_dict())["Z_q"].cramer_rao)


def test_the_result_is_a_named_model_that_can_not_be_changed(fit):
    """A state space with names, its delays beside, and a response as it was measured."""
    assert fit.model.state_labels == ["p", "q", "a", "b"]
    assert fit.model.input_labels == ["lat", "lon"]
    assert fit.delays["lon"] == fit["tau_lon"].value
    again = fit.response(FREQUENCY)
    np.testing.assert_allclose(again.response, fit.data.response, rtol=0.1)
    with pytest.raises(ValueError, match="read-only"):
        fit.correlation[0, 0] = 2.0
    with pytest.raises(UnknownNameError, match="available: tau_f"):
        _ = fit["tau"]
    with pytest.raises(UnknownNameError):
        fit.support("none")


def test_provenance_says_from_what_and_with_what(fit):
    """Records, windows, band, method and program versions go with a fit."""
    provenance = fit.provenance
    assert provenance["method"] == "direct"
    assert provenance["band_rad_s"] == pytest.approx([1.0, 40.0])
    assert provenance["versions"]["numpy"] == np.__version__
    assert {"records", "windows_s", "reference", "conditioning"} <= set(provenance)
    old = {**fit.to_dict(), "provenance": {**provenance, "versions": {"helisim": "0.0.1"}}}
    assert Fit.from_dict(old).versions == {"helisim": "0.0.1"}


@pytest.mark.parametrize("key", ["structure", "parameters", "correlation", "costs", "data"])
def test_a_damaged_fit_is_refused(fit, key, tmp_path):
    """A missing or mistyped part ends in a message that names the file and the part."""
    plain = fit.to_dict()
    path = tmp_path / "fit.json"
    path.write_text(json.dumps({name: item for name, item in plain.items() if name != key}))
    with pytest.raises(InputError, match=rf"fit\.json: the fit lacks {key}"):
        load_fit(path)
    for wrong in (3, "3", None):
        with pytest.raises(InputError):
            Fit.from_dict({**plain, key: wrong})


@pytest.mark.parametrize(
    ("path", "wrong", "message"),
    [
        (["parameters", 0, "value"], "much", r"'tau_f'.value must be a number, got 'much'"),
        (["parameters", 0, "name"], "tau", "parameter of 'rollpitch' 'tau'"),
        (["parameters", 0, "at_bound"], 1, "at_bound must be true or false"),
        (["costs", "p/lat"], "9", r"costs.p/lat must be a number, got '9'"),
        (["correlation", 0], [1.0], "correlation must be 10 rows of 10 numbers"),
        (["misfit", "phase_deg"], {}, "misfit has other responses"),
        (["misfit", "ratio"], "high", "ratio must be a number"),
        (["bands_rad_s", "p/lat"], [1.0], r"bands_rad_s.p/lat must be a list of 2 numbers"),
        (["data", "colour"], [1.0], "colour"),
        (["format"], "else", "this isn't a fit.*'else'"),
    ],
)
def test_what_a_fit_holds_is_checked(fit, path, wrong, message):
    """Text for a number, a name that isn't there, a row too short."""
    plain = copy.deepcopy(fit.to_dict())
    inner = plain
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = wrong
    with pytest.raises(InputError, match=message):
        Fit.from_dict(plain)


@pytest.mark.parametrize(
    ("key", "message"),
    [
        ("costs", "response of the fit 'p/stick'"),
        ("bands_rad_s", "the fit's costs lack p/stick|bands_rad_s lack p/lat"),
        ("misfit", "the fit's misfit lack p/lat"),
    ],
)
def test_a_renamed_response_is_refused(fit, key, message):
    """By what lacks it, with what there is."""
    plain = copy.deepcopy(fit.to_dict())
    inside = plain[key]
    for table in [inside["magnitude_db"], inside["phase_deg"]] if key == "misfit" else [inside]:
        table["p/stick"] = table.pop("p/lat")
    with pytest.raises(InputError, match=message):
        Fit.from_dict(plain)


def test_what_is_no_fit_is_refused(tmp_path, fit):
    """Another JSON file, no JSON and no file are told apart."""
    path = tmp_path / "other.json"
    for text, error, message in (
        ('{"format": "else"}', InputError, r"other\.json: this isn't a fit.*'else'"),
        ("{", StorageError, r"other\.json"),
        ("[1]", StorageError, "list"),
    ):
        path.write_text(text)
        with pytest.raises(error, match=message):
            load_fit(path)
    with pytest.raises(StorageError, match=r"none\.json"):
        load_fit(tmp_path / "none.json")
    for write in (fit.save, fit.to_matlab):
        with pytest.raises(StorageError, match="can't write"):
            write(tmp_path / "missing" / "fit.json")


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
        # an error of a ten-millionth of the value or less isn't stated
        (1.23456789, 1e-8, ("1.234568", "")),
        (1.23456789, 1e-7, ("1.234568", "")),
        (1.23456789, 2e-7, ("1.23456789", "0.00000020")),
    ],
)
def test_values_are_rounded_by_their_errors(value, error, expected):
    """A value ends where its error does."""
    assert rounded(value, error) == expected


@given(value=st.floats(-1e9, 1e9), error=st.floats(1e-9, 1e9))
def test_rounding_moves_a_value_by_less_than_its_error(value, error):
    """Whatever the numbers, rounding costs at most a sixth of the error."""
    slack = max(error / 6.0, 1e-6 * abs(value))
    assert abs(float(rounded(value, error)[0]) - value) <= slack * (1.0 + 1e-9)


def test_the_latex_table_has_a_row_a_parameter(fit):
    """Every parameter has a row; names and units are escaped; a star marks what is poor.

    Braces and rows are closed; of LATE's five parameters some are poor, some are not.
    """
    table = fit.to_latex(caption="Roll and pitch", label="tab:rollpitch")
    assert table.count(r"\pm") == len(fit.structure.free)
    for piece in (
        *(r"$\tau_{\mathrm{f}}$", r"$A_{\mathrm{lat}}$", "1/s$^2$", "fixed"),
        *(r"\begin{tabular}", r"\label{tab:rollpitch}"),
    ):
        assert piece in table
    assert table.count("{") == table.count("}")
    loose = fitted(LATE, LATE.starts, np.geomspace(0.5, 20.0, 40))
    rows = [line for line in loose.to_latex().splitlines() if line.count("&") == 4][1:]
    assert len(rows) == len(LATE.parameters)
    for row, one in zip(rows, loose.parameters.values()):
        assert ("^*" in row) == (one.poorly_identified or one.at_bound)
        assert f" & {one.cr_percent:.1f} & {one.insensitivity_percent:.1f} " in row
    assert 0 < sum("^*" in row for row in rows) < len(rows)


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


def test_the_table_states_each_response_its_band_and_the_support(wobbly):
    """A line a parameter, a line a response, and the average with its word."""
    lines = str(wobbly).splitlines()
    (pair,) = wobbly.costs
    low, high = wobbly.bands[pair]
    message = f"J {pair} = {wobbly.costs[pair]:.4g} from {low:.3g} to {high:.3g} rad/s"
    assert f"{message}; {wobbly.misfit.words(pair)}" in lines
    for cost, word in ((49.0, "excellent"), (99.0, "acceptable"), (101.0, "too high")):
        judged = replace(wobbly, costs={pair: cost})
        assert f"average J = {cost:.4g}: {word}" in str(judged).splitlines()
    for name, one in wobbly.parameters.items():
        (line,) = (text for text in lines if text.startswith(name + " "))
        assert re.search(rf"{one.cr_percent:.2f} .* {one.insensitivity_percent:.2f} ", line)


def test_support_names_whom_a_parameter_is_correlated_with(wobbly):
    """Pairs once each, in both directions, and nobody where none exceeds nine tenths."""
    names = [parameter.name for parameter in wobbly.structure.free]
    assert replace(wobbly, correlation=np.eye(3)).correlated == ()
    tied = np.eye(3)
    tied[0, 1] = tied[1, 0] = -0.95
    together = replace(wobbly, correlation=tied)
    assert together.correlated == ((names[0], names[1], -0.95),)
    for one, other in (names[:2], names[1::-1]):
        assert together.support(one) == f"{wobbly[one].support}, correlated with {other}"
    assert together.support(names[2]) == wobbly[names[2]].support
    heave = structures.heave
    parameters = (*heave.parameters, Parameter("K", "1", 1.0))
    structure = replace(heave, parameters=parameters, G=(("Z_col + 0.9*K",),))
    seen = identify(of_model(heave, HEAVE, noise=0.02), structure)
    assert seen.support("K").startswith("degenerate")  # only K Z_col is seen


def test_a_fit_is_in_order_only_if_nothing_is_amiss(exact):
    """One complaint is enough: each of the four alone takes the verdict away."""
    assert exact.ok
    name, sound = next(iter(exact.parameters.items()))
    vague = replace(sound, cramer_rao=abs(sound.value), insensitivity=abs(sound.value))
    for change in (
        {"converged": False},
        {"costs": dict.fromkeys(exact.costs, 1e4)},
        {"parameters": {**exact.parameters, name: replace(sound, at_bound=True)}},
        {"parameters": {**exact.parameters, name: vague}},
    ):
        assert not replace(exact, **change).ok


def test_percent_is_of_the_values_size_and_endless_of_nothing(exact):
    """A bound of 0.5 is 50 % of -1, infinitely much of 0, and none of either if it is 0."""
    one = replace(exact["Z_w"], cramer_rao=0.5, insensitivity=0.25)
    assert replace(one, value=-1.0).cr_percent == 50.0
    assert replace(one, value=-1.0).insensitivity_percent == 25.0
    assert replace(one, value=0.0).cr_percent == np.inf
    assert replace(one, value=0.0, cramer_rao=0.0).cr_percent == 0.0
