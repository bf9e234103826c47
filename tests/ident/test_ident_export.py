"""A model as a descriptor, for MATLAB: what its matrices mean."""

import control
import numpy as np
import pytest

from helisim.ident.result import descriptor


def test_adescriptor_is_the_model_and_what_follows_its_inputs_rates():
    """C (s E - A)^-1 B + D is the model's response and s D1, at any s; states have names."""
    random = np.random.default_rng(8)
    shapes = {"A": (4, 4), "B": (4, 3), "C": (2, 4), "D": (2, 3)}
    model = control.StateSpace(
        *(random.normal(size=shape) for shape in shapes.values()),
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
    names = [str(name) for name in np.ravel(plain["StateName"])]
    assert names == ["w", "q", "r", "x", "col", "ped", "d(col)/dt", "d(ped)/dt"]
    proper = descriptor(model, np.zeros((2, 3)))
    assert "E" not in proper
    assert np.array_equal(proper["A"], model.A)
