"""Fits as data: stored without loss, printed with sense, refused when damaged."""

import copy
import dataclasses
import json
import re
from dataclasses import replace

import numpy as np
import pytest

from helisim.base.errors import InputError, StorageError, UnknownNameError
from helisim.ident import Fit, Parameter, identify, load_fit, structures
from ident_data import HEAVE, ROLLPITCH, YAW, fitted, of_model
from tabled import tabled

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


@tabled("path", "wrong", "message")
def test_what_a_fit_holds_is_checked(fit, path, wrong, message):
    """Text for a number, a name that isn't there, a row too short."""
    plain = copy.deepcopy(fit.to_dict())
    inner = plain
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = wrong
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
    with pytest.raises(StorageError, match="can't write"):
        fit.save(tmp_path / "missing" / "fit.json")


def test_the_table_states_each_response_its_band_and_the_support(wobbly):
    """A line a parameter, a line a response, and the average with its word."""
    lines = str(wobbly).splitlines()
    (pair,) = wobbly.costs
    low, high = wobbly.bands[pair]
    message = f"J {pair} = {wobbly.costs[pair]:.4g} from {low:.3g} to {high:.3g} rad/s"
    left = f"{wobbly.misfit.magnitude[pair]:.2g} dB, {wobbly.misfit.phase[pair]:.2g} deg"
    assert f"{message}; {left} noise included" in lines
    known = replace(wobbly.misfit, ratio=2.0)
    assert f"{message}; {left} beyond noise" in str(replace(wobbly, misfit=known)).splitlines()
    for single, word in ((200.0, "acceptable"), (200.1, "too high")):
        assert replace(wobbly, costs={pair: 0.0, "a": 0.0, "b": single}).judged == word
    for cost, word in ((50.0, "excellent"), (100.0, "acceptable"), (100.1, "too high")):
        judged = replace(wobbly, costs={pair: cost})
        assert f"average J = {cost:.4g}: {word}, as costs go" in str(judged).splitlines()
    for name, one in wobbly.parameters.items():
        (line,) = (text for text in lines if text.startswith(name + " "))
        assert re.search(rf"{one.cr_percent:.2f} .* {one.insensitivity_percent:.2f} ", line)


def test_only_responses_that_cost_more_than_50_are_explained(fit):
    """Of a fit that isn't acceptable; here by their coherence."""
    doubted = replace(fit.data, coherence=np.full_like(fit.data.coherence, 0.7))
    for high, told in (({"p/lat": 300.0, "q/lon": 50.0}, ["p/lat"]), ({"p/lat": 200.0}, [])):
        found = replace(fit, data=doubted, costs=dict.fromkeys(fit.costs, 10.0) | high)
        assert [one.text.partition(":")[0] for one in found.shapes] == told


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
