"""Poles and zeros of fits, and their errors."""

import json
import math
from dataclasses import replace

import control
import numpy as np
import pytest

from helisim.base.errors import IdentificationError
from helisim.ident import Fit, Parameter, Structure, identify, structures
from helisim.ident.evaluate import linear
from helisim.ident.modes import Mode, _with_errors, modes
from ident_data import ROLLPITCH, fitted, of_model

GRID = np.geomspace(0.5, 30.0, 40)
RANDOM = np.random.default_rng(7)


def values_of(structure):
    return {
        one.name: (one.start or 0.3 * one.magnitude) * RANDOM.uniform(0.6, 1.6)
        for one in structure.parameters
    }


def doubled(some):
    return [x for one in some for x in {one.value, one.value.conjugate()}]


def nearest(found, expected):
    return [min(abs(x - y) for y in found) for x in expected]


@pytest.mark.parametrize("name", list(structures.BUILT_IN))
def test_poles_and_zeros_are_python_controls(name):
    structure = structures.named(name)
    values = values_of(structure)
    found = modes(structure, values, structure.pairs)
    model = linear(structure, values).system
    poles, size = model.poles(), max(abs(model.poles()))
    assert len(doubled(found.poles)) == len(poles)
    # repeated integrators are known to the root of the rounding
    assert max(nearest(doubled(found.poles), poles)) < 1e-7 * size
    for o, output in enumerate(structure.outputs):
        for i, input_ in enumerate(structure.inputs):
            mine = doubled(found.zeros[f"{output}/{input_}"])
            zeros = control.zeros(model[o, i])
            zeros = zeros[np.abs(zeros) < 1e3 * size]  # those at infinity, rounded
            own = [z for z in zeros if min(abs(z - poles)) > 1e-5 * size]
            assert max(nearest(mine, own), default=0.0) < 1e-5 * size
            assert max(nearest(zeros, mine), default=0.0) < 1e-5 * size


TWO_AXES = Structure(
    name="two",
    parameters=(Parameter("L_p", "1/s", -1.0), Parameter("M_q", "1/s", -1.0)),
    states=("p", "q"),
    inputs=("lat", "lon"),
    outputs=("p", "q"),
    F=(("L_p", "0"), ("0", "M_q")),
    G=(("5", "0"), ("0", "3")),
)


def quartic():
    """K (s^2 + 2 0.3 4 s + 16) / [(s + 1) (s - 0.2) (s^2 + 2 0.1 9 s + 81)]."""
    top = np.array([2.0, 4.8, 32.0])
    bottom = np.polymul([1.0, 0.8, -0.2], [1.0, 1.8, 81.0])
    structure = structures.transfer_function(zeros=2, poles=4, input="u", output="y")
    values = dict(zip(("b2", "b1", "b0"), top)) | dict(zip(("a3", "a2", "a1", "a0"), bottom[1:]))
    return structure, {**values, "tau": 0.1}


def test_figures_of_a_mode_are_the_textbooks():
    found = modes(*quartic(), ["y/u"])
    slow, real, fast = found.poles
    assert slow.value == pytest.approx(0.2)
    assert slow.doubling == pytest.approx(math.log(2.0) / 0.2)
    assert real.time == pytest.approx(1.0)
    assert real.doubling is None
    assert (fast.frequency, fast.damping) == pytest.approx((9.0, 0.1))
    (zero,) = found.zeros["y/u"]
    assert (zero.frequency, zero.damping) == pytest.approx((4.0, 0.3))
    assert found.gains["y/u"] == pytest.approx(2.0)
    assert not found.stable
    assert "doubles in 3.47 s" in str(found)
    assert "zero y/u" in str(found)
    even = Mode(-3.0, 4.0, 0.1, 0.1)  # errors alike in all directions: along and across the radius
    assert (even.frequency_error, even.damping_error) == pytest.approx((0.1, 0.1 * 4.0 / 25.0))


def test_a_mode_that_an_axis_lacks_is_none_of_its_zeros():
    found = modes(TWO_AXES, {"L_p": -4.0, "M_q": -2.0}, TWO_AXES.pairs)
    assert [one.value for one in found.poles] == [-2.0, -4.0]
    assert all(not zeros for zeros in found.zeros.values())
    assert dict(found.gains) == {"p/lat": 5.0, "p/lon": 0.0, "q/lat": 0.0, "q/lon": 3.0}


def test_errors_are_those_of_drawn_parameters():
    """1 % and correlated: 4000 draws know a scatter to 1.1 %, so 4 of these; bends add 1 %."""
    structure, values = structures.rollpitch, ROLLPITCH
    names = ["tau_f", "L_b", "M_a", "A_b", "B_a"]
    size = np.array([0.01 * abs(values[name]) for name in names])
    covariance = (np.full((5, 5), 0.5) + 0.5 * np.eye(5)) * np.outer(size, size)
    slow = modes(structure, values, (), names=names, covariance=covariance).poles[0]
    drawn = []
    for draw in RANDOM.multivariate_normal([values[n] for n in names], covariance, size=4000):
        numbers = structure.matrices({**values, **dict(zip(names, draw))})
        drawn.append(np.linalg.eigvals(np.linalg.solve(numbers["M"], numbers["F"])))
    poles = np.array([min(some, key=abs) for some in drawn])
    assert slow.frequency_error == pytest.approx(np.std(np.abs(poles)), rel=0.055)
    assert slow.damping_error == pytest.approx(np.std(poles.real / np.abs(poles)), rel=0.055)
    assert slow.time_error == pytest.approx(np.std(1.0 / poles.real), rel=0.055)
    assert slow.separate


def test_errors_of_zeros_are_finite_differences():
    structure = structures.hover
    values = values_of(structure)
    step = 1e-6
    for name in ("L_v", "M_u", "tau_f", "B_a", "A_lon", "Y_v"):
        found = modes(structure, values, ["p/lat"], names=[name], covariance=np.ones((1, 1)))
        up, down = (
            modes(structure, {**values, name: values[name] + sign * step}, ["p/lat"]).zeros["p/lat"]
            for sign in (1.0, -1.0)
        )
        for one, a, b in zip(found.zeros["p/lat"], up, down):
            slope = (a.value - b.value) / (2.0 * step)
            scale = 1e-5 + 1e-4 * abs(slope)
            assert one.real_error == pytest.approx(abs(slope.real), abs=scale)
            assert one.imag_error == pytest.approx(abs(slope.imag), abs=scale)


@pytest.mark.parametrize("name", ["p/lat", "p/lon", "q/lat", "q/lon"])
def test_zeros_at_the_origin_are_exact(name):
    """Where no speed moves the fuselage, rates over cyclic have s^2, whatever the derivatives."""
    free = values_of(structures.rollpitch_speeds)
    still = {one: free.pop(one) * 0.0 for one in ("X_u", "Y_v", "L_v", "M_u", "L_p", "M_q")}
    known = {"names": [*free], "covariance": np.diag(np.square([*free.values()]))}
    found = modes(structures.rollpitch_speeds, free | still, [name], **known).zeros[name]
    errors = [one.frequency_error for one in found if one.frequency < 1e-9]
    assert errors == [0.0, 0.0]
    assert all(one.separate for one in found if one.frequency < 1e-9)
    with np.errstate(over="raise"):  # a repeated root has no slope, or, rounded, a huge one
        steep = np.full((1, 1, 1), 1e200 + 0j)
        one = _with_errors(Mode(-1.0, 0.0), 0, np.array([-1.0 + 0j]), steep, np.eye(1), np.ones(1))
    assert math.isinf(one.real_error)


def close(a1):
    """Return the modes of s^2 + a1 s + 4 with an error of 0.1 on both coefficients."""
    structure = structures.transfer_function(zeros=0, poles=2, input="u", output="y")
    values = {"b0": 1.0, "a1": a1, "a0": 4.0, "tau": 0.0}
    return modes(structure, values, (), names=["a1", "a0"], covariance=0.01 * np.eye(2))


@pytest.mark.parametrize(("a1", "separate"), [(8.0, True), (4.05, False), (3.98, False), (1, True)])
def test_a_pair_that_could_merge_is_marked(a1, separate):
    for one in close(a1).poles:
        assert one.separate == separate
        assert ("could merge" in str(close(a1))) != separate


def test_what_the_data_do_not_see_leaves_its_modes_unknown():
    structure = structures.transfer_function(zeros=1, poles=1, input="u", output="y")
    values = {"b1": 2.0, "b0": 6.0, "a0": 5.0, "tau": 0.0}
    names = ["b1", "b0", "a0"]
    covariance = np.diag([np.inf, 0.01, 0.04])
    found = modes(structure, values, ["y/u"], names=names, covariance=covariance)
    assert found.poles[0].real_error == pytest.approx(0.2)
    assert math.isinf(found.zeros["y/u"][0].real_error)
    plain = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert plain["zeros"]["y/u"][0]["real_error"] is None


@pytest.fixture(scope="module")
def fit():
    structure = structures.transfer_function(zeros=0, poles=2, input="lat", output="p")
    values = {"b0": 30.0, "a1": 3.0, "a0": 25.0, "tau": 0.05}
    return fitted(structure, values, GRID, noise=0.02, seed=1)


def test_a_fit_says_its_modes_everywhere(fit):
    (pole,) = fit.modes.poles
    assert pole.frequency == pytest.approx(5.0, abs=4 * pole.frequency_error)
    assert pole.damping == pytest.approx(0.3, abs=4 * pole.damping_error)
    assert 0.0 < pole.damping_error < 0.05
    assert f"{pole.frequency:.4g}" in str(fit)
    data = json.loads(json.dumps(fit.to_dict(), allow_nan=False))
    assert data["modes"]["poles"][0]["frequency_rad_s"] == pole.frequency
    assert Fit.from_dict(data).modes == fit.modes
    del data["covariance"], data["carried"]
    assert math.isnan(Fit.from_dict(data).modes.poles[0].real_error)


def test_a_model_without_inertia_in_a_state_has_none(fit):
    lag = Structure(
        name="lag",
        parameters=(Parameter("T", "s", 0.0, fixed=True), Parameter("K", "1", 2.0)),
        states=("p",),
        inputs=("lat",),
        outputs=("p",),
        M=(("T",),),
        F=(("-1",),),
        G=(("K",),),
    )
    none = replace(fit, structure=lag, parameters=identify(fit.data, lag).parameters)
    with pytest.raises(IdentificationError, match="singular"):
        _ = none.modes
    assert none.to_dict()["modes"] is None
    assert "pole" not in str(none)


def test_the_error_of_a_known_servo_is_in_the_modes():
    plain = structures.transfer_function(zeros=0, poles=1, input="lat", output="p", delay=None)
    data = plain.to_dict()
    data["parameters"]["T"] = {"unit": "s", "start": 0.1, "fixed": True, "error": 0.002}
    data |= {"states": ["p", "d"], "outputs": ["p"], "M": {"d": {"d": "T"}}}
    data |= {"F": [["-a0", "b0"], [0, -1]], "G": [[0], [1]], "H0": [[1, 0]], "H1": [[0, 0]]}
    structure = Structure.from_dict({**data, "D": [[0]]})
    truth = {"b0": 30.0, "a0": 4.0, "T": 0.1}
    frf = of_model(structure, truth, GRID)
    plant, servo = identify(frf, structure).modes.poles
    assert servo.time_error == pytest.approx(0.002, rel=1e-6)
    wrong = identify(frf, structure.with_fixed({"T": 0.1001})).modes.poles[0]
    # a step of a twentieth of the error: the response of J's own minimum is linear to some 5 %
    assert plant.real_error == pytest.approx(20 * abs(wrong.real + 4.0), rel=0.05)
