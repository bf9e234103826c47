"""Which responses a structure has at all, and what becomes of one that it lacks."""

import numpy as np
import pytest

from helisim.base.errors import InputError
from helisim.ident import FrequencyResponse, Parameter, Structure, identify
from helisim.ident.evaluate import response

FREQUENCY = np.geomspace(0.5, 20.0, 40)
APART = Structure(
    name="apart",
    parameters=(
        Parameter("L_p", "1/s", -2.0),
        Parameter("L_lat", "1/s^2", 10.0),
        Parameter("Z_w", "1/s", -1.0),
        Parameter("Z_col", "m/s^2", -30.0),
    ),
    states=("p", "w"),
    inputs=("lat", "col"),
    outputs=("p", "w"),
    F=(("L_p", "0"), ("0", "Z_w")),
    G=(("L_lat", "0"), ("0", "Z_col")),
)


def test_responses_of_a_chain_run_one_way():
    """x2 follows x1, not the other way; a mass matrix couples both; D reaches on its own."""

    def structure(**matrices):
        return Structure(
            name="chain",
            parameters=(Parameter("a", "1", 0.0, fixed=True),),
            states=("x1", "x2"),
            inputs=("u1", "u2"),
            outputs=("x1", "x2"),
            **{"F": (("-1", "0"), ("a", "-1")), "G": (("1", "0"), ("0", "1"))} | matrices,
        )

    chain = {"x1/u1", "x2/u1", "x2/u2"}
    both = chain | {"x1/u2"}
    assert structure().connected == chain
    assert structure(F=(("-1", "0"), ("0", "-1"))).connected == {"x1/u1", "x2/u2"}
    assert structure(M=(("1", "a"), ("0", "1"))).connected == both
    assert structure(F=(("-1", "1"), ("a", "-1")), M=(("1", "0"), ("0", "0"))).connected == both
    assert structure(D=(("0", "1"), ("0", "0"))).connected == both
    assert structure(D1=(("0", "1"), ("0", "0"))).connected == both


def test_paths_are_those_of_a_response_that_is_not_zero():
    """Random sparse structures with mass matrices: numbers where there is a path, else zeros."""
    rng = np.random.default_rng(0)
    s = 1j * np.array([0.7, 3.1])
    for _ in range(40):
        F, G = rng.normal(size=(4, 4)), rng.normal(size=(4, 2))
        M = np.eye(4) + rng.normal(size=(4, 4)) * (rng.random((4, 4)) < 0.1)
        F[rng.random((4, 4)) < 0.7] = 0.0
        G[rng.random((4, 2)) < 0.6] = 0.0
        rows = [tuple(tuple(map(str, row)) for row in matrix.tolist()) for matrix in (M, F, G)]
        names = ("x0", "x1", "x2", "x3")
        structure = Structure(
            "sparse", (), names, ("u0", "u1"), names, M=rows[0], F=rows[1], G=rows[2]
        )
        outside = [np.linalg.solve(M * x - F, G) for x in s]
        paths = structure.connected
        for o, i in np.argwhere(np.abs(outside).max(axis=0) > 1e-12):
            assert f"x{o}/u{i}" in paths
        for name in {f"x{o}/u{i}" for o in range(4) for i in range(2)} - paths:
            o, i = int(name[1]), int(name[-1])
            # what elimination leaves of a zero, of numbers of order one to a hundred
            assert np.abs(outside)[:, o, i].max() < 1e-12


def test_a_response_that_the_structure_lacks_is_left_out_and_told():
    """Chance makes p/col coherent; the others are found as if it weren't there."""
    truth = {"L_p": -3.0, "L_lat": 20.0, "Z_w": -0.6, "Z_col": -40.0}
    measured = response(APART, truth, FREQUENCY)
    measured[0, 1] = 0.01
    frf = FrequencyResponse.exact(FREQUENCY, measured, inputs=("lat", "col"), outputs=("p", "w"))
    fit = identify(frf, APART)
    # to rounding, as everything that is fitted is exact
    assert fit.values == pytest.approx(truth, rel=1e-6)
    assert set(fit.costs) == {"p/lat", "w/col"}
    assert set(fit.dropped) == {"p/col", "w/lat"}
    assert [line for line in fit.remarks if "zero in the structure: p/col;" in line]
    assert not [line for line in fit.remarks if "lack of coherence" in line]
    with pytest.raises(InputError, match=r"p/col is zero in 'apart'.*from col to p"):
        identify(frf, APART, responses=("p/lat", "p/col"))
