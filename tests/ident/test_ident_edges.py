"""The identification at its edges: what is refused, and what its messages and tables state."""

import hashlib
import json
import math
import re

import numpy as np
import pytest

from helisim.errors import IdentificationError, InputError, UnknownNameError
from helisim.ident import (
    FrequencyResponse,
    Parameter,
    Structure,
    frequency_response,
    identify,
    structures,
)
from helisim.ident.composite import window_lengths
from helisim.ident.evaluate import response
from helisim.ident.verify import _theil, _tic
from helisim.records.channels import channel
from helisim.records.record import FlightRecord

GRID = np.geomspace(0.5, 20.0, 60)
HEAVE = {"Z_w": -0.8, "Z_col": -25.0, "tau_col": 0.03}


def noise(seed, names=("lat", "p"), *, samples=1500, step=0.02):
    random = np.random.default_rng(seed)
    values = random.normal(size=(samples, len(names)))
    values[:, -1] += 2.0 * values[:, 0]
    return FlightRecord(step * np.arange(samples), values, tuple(map(channel, names)))


@pytest.fixture(scope="module")
def fit():
    structure = structures.yaw_base
    values = {"N_r": -0.7, "N_ped": 50.0, "tau_r_base": 0.04}
    exact = response(structure, values, GRID)
    wobble = 1.0 + 0.03 * np.random.default_rng(1).normal(size=(*exact.shape, 2)) @ [1.0, 1j]
    data = FrequencyResponse.exact(
        GRID, exact * wobble, inputs=structure.inputs, outputs=structure.outputs
    )
    return identify(data, structure)


# Structures


def built_in():
    found = {name: getattr(structures, name) for name in dir(structures)}
    return {name: one for name, one in found.items() if isinstance(one, Structure)}


@pytest.mark.parametrize("bounds", [(2.0, 1.0), (1.0, 1.0), (1.5, 2.0), (0.0, 0.5)])
def test_bounds_that_hold_no_start_are_refused(bounds):
    """Reversed, equal, above and below the start."""
    with pytest.raises(InputError, match="expected lower < upper with the start between"):
        Parameter("K", "1", 1.0, bounds)


def test_a_bound_may_be_open_and_a_start_may_not():
    """None and infinity leave a side open; a start or a scale is a finite number."""
    plain = structures.heave.to_dict()
    name = next(iter(plain["parameters"]))

    def changed(**fields):
        copied = json.loads(json.dumps(plain))
        copied["parameters"][name].update(fields)
        return Structure.from_dict(copied)

    start = plain["parameters"][name]["start"]
    for pair, limits in (
        ([None, start + 1.0], (-math.inf, start + 1.0)),
        ([start - 1.0, None], (start - 1.0, math.inf)),
        ([-math.inf, math.inf], (-math.inf, math.inf)),
    ):
        assert changed(bounds=pair).parameter(name).limits == limits
    for field in ("start", "scale"):
        with pytest.raises(InputError, match=f"{field} is inf, expected a finite number"):
            changed(**{field: math.inf})
        with pytest.raises(InputError, match=f"{field} is nan, expected a number"):
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
    assert hashlib.sha256(text.encode()).hexdigest()[:16] == "ae7f0cd20e8dd43b"


# Messages


def test_a_window_that_does_not_fit_is_told_in_seconds():
    """Its length and the record's; and what it resolves, and where the band starts."""
    ask = {"inputs": ["lat"], "outputs": ["p"]}
    with pytest.raises(IdentificationError) as raised:
        frequency_response(noise(1), **ask, band=(1.0, 20.0), windows=[40.0])
    assert "a window of 40 s does not fit into a record of 30 s" in str(raised.value)
    with pytest.raises(InputError) as refused:
        frequency_response(noise(1), **ask, band=(0.5, 20.0), windows=[10.0])
    assert "from 0.6283 rad/s, but the band starts at 0.5 rad/s" in str(refused.value)


@pytest.mark.parametrize(
    ("durations", "band", "lengths"),
    [
        ([90.0, 90.0], (0.8, 45.0), np.linspace(36.0, 7.2, 5)),
        ([60.0, 80.0, 90.0], (1.0, 12.0), np.linspace(30.0, 20.0 * 2.0 * np.pi / 12.0, 5)),
        ([30.0], (1.1, 4.0), [6.0]),
        ([8.0 * np.pi] * 5, (0.5, 50.0), np.linspace(4.0 * np.pi, 0.8 * np.pi, 5)),
    ],
)
def test_window_lengths_follow_the_published_rules(durations, band, lengths):
    """At most half a record and a fifth of all, at least 20 periods of the highest frequency."""
    assert window_lengths(durations, band) == pytest.approx(tuple(lengths), rel=1e-12)


def test_records_too_short_for_the_band_are_told_with_their_figures():
    """What they last, the window that they allow, and the frequency that it resolves."""
    with pytest.raises(IdentificationError) as raised:
        window_lengths([30.0, 40.0], (0.4, 20.0))
    for message in (
        "lasts 30 s",
        "together 70 s",
        "windows of 14 s",
        "from 0.4488 rad/s",
        "at 0.4 ",
    ):
        assert message in str(raised.value)


@pytest.mark.parametrize(("count", "searches"), [(4, 1), (5, 0)])
def test_too_few_points_or_searches_are_refused(fit, count, searches):
    """At least five frequencies a response, and one search."""
    data = FrequencyResponse.exact(
        GRID, np.ones((1, 1, 60)), inputs=fit.structure.inputs, outputs=fit.structure.outputs
    )
    with pytest.raises(InputError, match="expected at least 5 and 1"):
        identify(data, fit.structure, frequencies_per_response=count, searches=searches)
    identify(data, fit.structure, frequencies_per_response=5, searches=1)


@pytest.mark.parametrize("windows", [[], [0.0], [-1.0], [math.inf], [math.nan]])
def test_windows_are_positive_lengths(windows):
    """Anything else is in the message."""
    with pytest.raises(InputError, match="expected positive lengths in s"):
        frequency_response(
            noise(1), inputs=["lat"], outputs=["p"], band=(1.0, 20.0), windows=windows
        )


def test_too_few_references_are_counted():
    """As many references as inputs and conditioning inputs together."""
    record = noise(1, ("LAT", "lat", "lon", "p"))
    with pytest.raises(InputError, match=r"1 reference\(s\) for 2 active inputs"):
        frequency_response(
            record,
            inputs=["lat"],
            conditioning=["lon"],
            outputs=["p"],
            reference=["LAT"],
            band=(1.0, 20.0),
        )


def test_incoherence_is_told_with_its_figures():
    """The best coherence of each response, where it was looked for, and the grid's ends."""
    still = FrequencyResponse.exact(GRID, np.ones((1, 1, 60)), inputs=["col"], outputs=["w"])
    dull = FrequencyResponse(**{**vars_of(still), "coherence": np.full((1, 1, 60), 0.34)})
    with pytest.raises(IdentificationError) as raised:
        identify(dull, structures.heave, band=(1.0, 10.0))
    inside = int(np.sum((GRID >= 1.0) & (GRID <= 10.0)))
    assert f"at most 0.34 at {inside} frequencies" in str(raised.value)
    assert "(frequency response: 0.5 to 20 rad/s)" in str(raised.value)


def vars_of(value):
    return {name: getattr(value, name) for name in value.__dataclass_fields__}


@pytest.mark.parametrize("band", [(2.0, 2.0), (3.0, 2.0), (-1.0, 2.0), (math.nan, 2.0)])
def test_a_band_has_a_lower_and_an_upper_edge(fit, band):
    """Equal or reversed edges, and what is no frequency."""
    data = FrequencyResponse.exact(
        GRID, np.ones((1, 1, 60)), inputs=fit.structure.inputs, outputs=fit.structure.outputs
    )
    with pytest.raises(InputError, match="expected 0 <= lower < upper"):
        identify(data, fit.structure, band=band)


# Tables


def test_the_table_states_each_response_its_band_and_the_verdict(fit):
    """A line a parameter, a line a response, and the average with its word."""
    lines = str(fit).splitlines()
    (pair,) = fit.costs
    low, high = fit.bands[pair]
    message = f"J {pair} = {fit.costs[pair]:.4g} from {low:.3g} to {high:.3g} rad/s"
    assert message in lines
    word = "excellent" if fit.cost <= 50.0 else "acceptable" if fit.cost <= 100.0 else "too high"
    assert f"average J = {fit.cost:.4g}: {word}" in lines
    for name in ("N_r", "N_ped", "tau_r_base"):
        (line,) = (one for one in lines if one.startswith(name + " "))
        assert re.search(
            rf"{fit[name].cr_percent:.2f} .* {fit[name].insensitivity_percent:.2f} ", line
        )
    for number, (a, b, size) in enumerate(fit.correlated):
        assert a != b
        assert abs(size) > 0.9
        assert f"correlated with {b}" in fit.verdict(a) or number


def test_a_fit_of_known_error_states_who_is_correlated_with_whom(fit):
    """Pairs once each, as in the matrix of correlations."""
    names = [parameter.name for parameter in fit.structure.free]
    expected = {
        (a, b): fit.correlation[i, j]
        for i, a in enumerate(names)
        for j, b in enumerate(names)
        if i < j and abs(fit.correlation[i, j]) > 0.9
    }
    assert {(a, b): size for a, b, size in fit.correlated} == expected


# Verification


def test_what_does_not_move_has_no_theil_coefficient():
    """Zero over zero is zero, by output and in all; a still output leaves the others alone."""
    still, moving = np.zeros((5, 2)), np.array([[0.0, 1.0], [0.0, -1.0]])
    assert list(_theil(still, still)) == [0.0, 0.0]
    assert _tic(still, still) == 0.0
    assert list(_theil(moving, -moving)) == [0.0, 1.0]
    # of two outputs of which one stands still, the mean squares are halved on both sides
    assert _tic(moving, -moving) == pytest.approx(1.0)


# Files


@pytest.mark.parametrize(
    ("field", "item", "message"),
    [
        ("frequency", [3.0, 2.0, 1.0], "frequenc"),
        ("frequency", "low", "can't read the frequency response"),
        ("response", {"real": [1.0]}, "can't read the frequency response"),
        ("surprise", 1.0, "unknown field"),
    ],
)
def test_a_damaged_frequency_response_is_refused(field, item, message):
    """Fields of another kind, of another shape, or of another version."""
    data = FrequencyResponse.exact(
        np.array([1.0, 2.0, 3.0]), np.ones((1, 1, 3)), inputs=["lat"], outputs=["p"]
    )
    plain = json.loads(json.dumps(data.to_dict()))
    assert FrequencyResponse.from_dict(plain).frequency.tolist() == [1.0, 2.0, 3.0]
    with pytest.raises(InputError, match=message):
        FrequencyResponse.from_dict({**plain, field: item})
