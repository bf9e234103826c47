"""Accuracy where numbers are at their limits: what only rounding sees, and units far apart."""

import math
from dataclasses import replace

import numpy as np
import pytest

from helisim.ident import Parameter, Structure, identify, structures
from ident_data import data

FREQUENCY = np.geomspace(0.5, 20.0, 60)
WOBBLE = np.random.default_rng(0).standard_normal((2, 60)).T @ [1.0, 1.0j]
LAG = structures.transfer_function(zeros=0, poles=1, input="lat", output="p")


def measured():
    """3 e^(-0.1 s) / (s + 2) with 1 % of noise."""
    s = 1j * FREQUENCY
    known = 3.0 / (s + 2.0) * np.exp(-0.1 * s + 0.01 * WOBBLE)
    return data(known, FREQUENCY, inputs=["lat"], outputs=["p"])


def test_what_only_rounding_sees_has_no_bounds():
    """An output in which M_col cancels but for rounding: no value of it is told from another."""
    structure = Structure(
        name="cancelling",
        parameters=(
            Parameter("Z_w", "1/s", -0.6),
            Parameter("Z_col", "m/s^2", -40.0),
            Parameter("M_col", "1/s^2", 1.1),
        ),
        states=("w", "q", "three_q"),
        inputs=("col",),
        outputs=("w",),
        F=(("Z_w", "0", "0"), ("0", "-2.1", "0"), ("0", "0", "-2.1")),
        G=(("Z_col",), ("M_col",), ("3*M_col",)),
        H0=(("1", "1", "-1/3"),),
    )
    known = -40.0 / (1j * FREQUENCY + 0.6) * np.exp(0.01 * WOBBLE)
    fit = identify(data(known, FREQUENCY, inputs=["col"], outputs=["w"]), structure)
    assert math.isinf(fit["M_col"].cramer_rao)
    assert math.isinf(fit["M_col"].standard_error)
    assert fit["M_col"].support == "not seen"
    assert fit["Z_w"].support == fit["Z_col"].support == "good"


def test_units_of_parameters_do_not_change_their_relative_accuracy():
    """Eighteen decades between two of them: what a known delay's error makes of both stays."""
    other = replace(
        LAG,
        parameters=tuple(
            replace(one, start=one.start * {"b0": 1e9, "a0": 1e-9}.get(one.name, 1.0))
            for one in LAG.parameters
        ),
        F=(("-1e9*a0",),),
        G=(("1e-9*b0",),),
    )
    frf = measured()
    known = {"tau": 0.1}, {"tau": 0.01}
    one, two = (identify(frf, a.with_fixed(*known)) for a in (LAG, other))
    for name in ("b0", "a0"):
        expected = one[name].standard_error / one[name].value
        # to how far two searches of the same minimum end apart
        assert two[name].standard_error / two[name].value == pytest.approx(expected, rel=1e-4)
