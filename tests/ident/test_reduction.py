"""Structure reduction: what is not there is dropped, what is needed stays, all is logged."""

import json
from dataclasses import replace

import numpy as np
import pytest

from helisim.base.errors import InputError, UnknownNameError
from helisim.ident import Parameter, reduce, structures
from ident_data import of_model

FREQUENCY = np.geomspace(1.0, 40.0, 90)
TRUE = {
    "tau_f": 0.045, "L_b": 540.0, "M_a": 315.0, "A_b": 0.0, "B_a": 0.53, "A_lat": 0.0,
    "A_lon": 0.37, "B_lat": 0.38, "B_lon": 0.0, "tau_lat": 0.0115, "tau_lon": 0.0,
}  # fmt: skip
ABSENT = {"A_b", "A_lat", "B_lon"}


def noisy(structure, values):
    """Return a response with noise; of one that is zero, and has no logarithm, noise alone."""
    frf = of_model(structure, values, FREQUENCY, noise=0.02)
    wobble = np.random.default_rng(0).normal(size=(2, *frf.response.shape))
    floor = 1e-3 * np.max(np.abs(frf.response)) * (wobble[0] + 1j * wobble[1])
    small = np.abs(frf.response) < 1e-9
    return replace(frf, response=np.where(small, floor, frf.response))


RATES = noisy(structures.rollpitch, TRUE)
THREE = {"responses": ("p/lat", "p/lon", "q/lon")}


@pytest.fixture(scope="module")
def searched():
    """What is said after each search."""
    return []


@pytest.fixture(scope="module")
def reduction(searched):
    return reduce(RATES, structures.rollpitch, **THREE, on_progress=searched.append)


def test_each_search_is_progress(reduction, searched):
    """At least one for the full structure, each parameter tried, and the final structure."""
    assert len(searched) >= 1 + len(reduction.steps) + 1
    assert set(searched) == {"rollpitch"}


def test_parameters_that_are_not_there_are_dropped(reduction):
    """On a plant without three couplings the reduction finds these and no others."""
    assert set(reduction.dropped) == ABSENT
    assert reduction.fit.cost < reduction.full.cost + 1.0
    for name, value in TRUE.items():
        one = reduction.fit[name]
        if name in ABSENT:
            assert one.fixed
            assert one.value == 0.0
        elif not name.startswith("tau_l"):
            assert one.value == pytest.approx(value, rel=0.03)


def test_accuracy_improves(reduction):
    """With fewer parameters the others are known better, never worse."""
    for one in reduction.fit.structure.free:
        assert reduction.fit[one.name].cramer_rao <= 1.05 * reduction.full[one.name].cramer_rao


def test_each_step_is_logged(reduction):
    """Steps chain from one cost to the next, name their reason, and print as they are."""
    cost = reduction.full.cost
    for step in reduction.steps:
        assert step.cost_before == cost
        limit = 10.0 if step.reason == "insensitivity" else 20.0
        assert step.percent > limit
        assert step.dropped == (step.cost_after <= reduction.full.cost + 1.0)
        assert str(step) in str(reduction)
        cost = step.cost_after if step.dropped else cost
    plain = json.loads(json.dumps(reduction.to_dict(), allow_nan=False))
    assert plain["dropped"] == list(reduction.dropped)


def test_delays_stay_unless_allowed(reduction):
    """A delay of zero is poorly known, stays, and goes when delays may be dropped."""
    assert "tau_lon" in reduction.protected
    assert not reduction.structure.parameter("tau_lon").fixed
    allowed = reduce(RATES, structures.rollpitch, **THREE, delays=True)
    assert "tau_lon" in allowed.dropped
    assert "tau_f" not in {step.parameter for step in allowed.steps}


def test_what_must_stay_stays():
    """A parameter in `keep` is not tried."""
    kept = reduce(RATES, structures.rollpitch, **THREE, keep=("A_b",))
    assert "A_b" not in {step.parameter for step in kept.steps}
    assert "A_b" in kept.protected


def test_a_poor_parameter_that_is_needed_comes_back():
    """One of two parameters that stand in for each other goes; the other, as needed, stays."""
    heave = structures.heave
    parameters = (*heave.parameters, Parameter("K", "1", 1.0))
    structure = replace(heave, parameters=parameters, G=(("Z_col + K",),))
    data = noisy(structures.heave, {"Z_w": -1.0, "Z_col": -10.0, "tau_col": 0.05})
    found = reduce(data, structure)
    assert len(found.dropped) == 1
    assert set(found.dropped) < {"K", "Z_col"}
    stays = ({"K", "Z_col"} - set(found.dropped)).pop()
    assert found.fit[stays].value == pytest.approx(-10.0, rel=0.02)
    strict = reduce(data, structure, rise=0.0, keep=("K", "Z_col"))
    assert strict.dropped == ()
    assert strict.fit is strict.full


def test_a_good_structure_is_left_alone():
    """Where every parameter is well known nothing is tried."""
    data = noisy(structures.heave, {"Z_w": -2.0, "Z_col": -10.0, "tau_col": 0.05})
    found = reduce(data, structures.heave)
    assert found.steps == ()
    assert found.fit is found.full


def test_wrong_arguments_are_refused():
    """An unknown parameter to keep and a negative rise are refused before any fit."""
    data = noisy(structures.heave, {"Z_w": -2.0, "Z_col": -10.0, "tau_col": 0.05})
    with pytest.raises(UnknownNameError, match="Z_w, Z_col, tau_col"):
        reduce(data, structures.heave, keep=("Z_q",))
    with pytest.raises(InputError, match="rise"):
        reduce(data, structures.heave, rise=-1.0)
