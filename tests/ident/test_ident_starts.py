"""Where searches begin: scattered starts keep what is known, gains are those that act linearly."""

import numpy as np
import pytest

from helisim.ident import Parameter, Structure
from helisim.ident.modes import uncancelled
from helisim.ident.search import linear_parameters, scattered

STRUCTURE = Structure(
    name="servo, mode and improper gain",
    parameters=(
        Parameter("up", "1", 3.0),
        Parameter("down", "1", -2.0),
        Parameter("none", "1", 0.0, scale=5.0),
        Parameter("lag", "s", 0.1, bounds=(0.01, 1.0)),
        Parameter("direct", "1", 1.0),
        Parameter("coning", "s", 0.5),
    ),
    states=("x", "y"),
    inputs=("u",),
    outputs=("y", "a"),
    M=(("1", "0"), ("0", "lag")),
    F=(("down", "0"), ("none", "-1")),
    G=(("up",), ("0",)),
    H0=(("0", "1"), ("1", "0")),
    D=(("0",), ("direct",)),
    D1=(("0",), ("coning",)),
)


def drawn(flipped):
    random = np.random.default_rng(2)
    return np.array([scattered(STRUCTURE, random, flipped) for _ in range(400)])


def test_signs_are_kept_unless_they_are_flipped():
    """A start's sign is known, and its order of magnitude; of a zero only the scale is."""
    found = drawn(0.0)
    assert np.all(found[:, 0] > 0.0)
    assert np.all(found[:, 1] < 0.0)
    # the median of a factor that is symmetric in the logarithm is 1; 400 draws scatter by 6 %
    assert np.median(found[:, :2], axis=0) == pytest.approx([3.0, -2.0], rel=0.3)
    assert 0.3 < np.mean(found[:, 2] > 0.0) < 0.7
    assert np.std(found[:, 2]) == pytest.approx(5.0, rel=0.15)
    turned = drawn(1.0)
    assert np.all(turned[:, 0] < 0.0)
    assert np.all(turned[:, 1] > 0.0)
    assert np.all(turned[:, 3] > 0.0)  # what has bounds isn't turned over


def test_gains_are_the_parameters_of_inputs_alone():
    """Those of G, D and D1; one that stands in F or M too is none."""
    names = [STRUCTURE.free[k].name for k in linear_parameters(STRUCTURE)]
    assert names == ["up", "direct", "coning"]
    plain = STRUCTURE.to_dict()
    plain["F"] = [["down * up", "0"], ["none", "-1"]]
    names = [STRUCTURE.free[k].name for k in linear_parameters(Structure.from_dict(plain))]
    assert names == ["direct", "coning"]


def test_a_pole_cancels_one_zero_at_most():
    """A zero on a pole goes with it; a second one there stays, and so does one beside."""
    zeros = np.array([-1.0, -1.0, -3.0 + 1.0j, -3.0 - 1.0j, 1e-9])
    poles = np.array([-1.0, -3.0 + 1.0j, -3.0 - 1.0j, 0.0])
    kept = uncancelled(zeros, poles, 5.0)
    assert kept == pytest.approx([-1.0])
    # by the size of all poles: at the origin a small distance is none only beside larger ones
    assert uncancelled(np.array([1e-9]), np.array([0.0]), 0.0) == pytest.approx([1e-9])
