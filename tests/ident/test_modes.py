"""Poles and zeros of fits, and their errors."""

import json
import math
from dataclasses import replace

import control
import numpy as np
import pytest

from helisim.base.errors import IdentificationError, UnknownNameError
from helisim.ident import Fit, Parameter, Structure, identify, structures
from helisim.ident.evaluate import matrices, state_space
from helisim.ident.modes import Mode, modes, uncancelled
from ident_data import ROLLPITCH, fitted, of_model

GRID = np.geomspace(0.5, 30.0, 40)
RANDOM = np.random.default_rng(7)


def values_of(structure):
    return {
        one.name: (one.start or 0.3 * one.magnitude) * RANDOM.uniform(0.6, 1.6)
        for one in structure.parameters
    }


def doubled(some):
    """Return the roots of modes, both of a pair."""
    return [x for one in some for x in {one.value, one.value.conjugate()}]


def nearest(found, expected):
    """Return how far each expected root is from the nearest found one."""
    return [min(abs(x - y) for y in found) for x in expected]


@pytest.mark.parametrize("name", list(structures.BUILT_IN))
def test_poles_and_zeros_are_python_controls(name):
    """Every pole; every zero that its poles do not cancel, and no other."""
    structure = structures.named(name)
    values = values_of(structure)
    found = modes(structure, values, structure.delay_places("delays"))
    model = state_space(structure, values)
    poles, size = model.poles(), max(abs(model.poles()))
    assert len(doubled(found.poles)) == len(poles)
    # repeated integrators are known to the root of the rounding
    assert max(nearest(doubled(found.poles), poles)) < 1e-7 * size
    for o, output in enumerate(structure.outputs):
        for i, input_ in enumerate(structure.inputs):
            mine = doubled(found[f"{output}/{input_}"])
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
    """Frequency, damping, time constant, time to double, of a polynomial written in factors."""
    found = modes(*quartic(), ["y/u"])
    slow, real, fast = found.poles
    assert slow.value == pytest.approx(0.2)
    assert slow.doubling == pytest.approx(math.log(2.0) / 0.2)
    assert real.time == pytest.approx(1.0)
    assert real.doubling is None
    assert (fast.frequency, fast.damping) == pytest.approx((9.0, 0.1))
    (zero,) = found["y/u"]
    assert (zero.frequency, zero.damping) == pytest.approx((4.0, 0.3))
    assert found.gains["y/u"] == pytest.approx(2.0)
    assert not found.stable
    assert "doubles in 3.47 s" in str(found)
    assert "zero y/u" in str(found)
    with pytest.raises(UnknownNameError, match="available: y/u"):
        found["y/v"]


def test_an_improper_response_has_its_zeros():
    """By hand: s (K s + Z - K Z_w) / (s - Z_w): one at the origin, one from D1."""
    structure = Structure.from_dict(
        {
            **structures.heave.to_dict(),
            "outputs": ["az"],
            "H0": [["0"]],
            "H1": [["1"]],
            "D": [["0"]],
            "D1": [["-0.5"]],
        }
    )
    found = modes(structure, {"Z_w": -0.7, "Z_col": -40.0, "tau_col": 0.0}, ["az/col"])
    assert [one.value for one in found["az/col"]] == pytest.approx([0.0, -80.7])
    assert found.gains["az/col"] == -0.5


def test_a_mode_that_an_axis_lacks_is_none_of_its_zeros():
    """Two decoupled axes: p/lat is a gain over one lag, without the other axis' pole as a zero."""
    found = modes(TWO_AXES, {"L_p": -4.0, "M_q": -2.0}, TWO_AXES.delay_places("delays"))
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
        numbers = matrices(structure, {**values, **dict(zip(names, draw))})
        drawn.append(np.linalg.eigvals(np.linalg.solve(numbers.M, numbers.F)))
    poles = np.array([min(some, key=abs) for some in drawn])
    assert slow.frequency_error == pytest.approx(np.std(np.abs(poles)), rel=0.055)
    assert slow.damping_error == pytest.approx(np.std(poles.real / np.abs(poles)), rel=0.055)
    assert slow.time_error == pytest.approx(np.std(1.0 / poles.real), rel=0.055)
    assert slow.separate


def test_errors_of_zeros_are_finite_differences():
    """One parameter at a time, its error times the zero's difference over a small step."""
    structure = structures.hover
    values = values_of(structure)
    step = 1e-6
    for name in ("L_v", "M_u", "tau_f", "B_a", "A_lon", "Y_v"):
        found = modes(structure, values, ["p/lat"], names=[name], covariance=np.ones((1, 1)))
        up, down = (
            modes(structure, {**values, name: values[name] + sign * step}, ["p/lat"])["p/lat"]
            for sign in (1.0, -1.0)
        )
        for one, a, b in zip(found["p/lat"], up, down):
            slope = (a.value - b.value) / (2.0 * step)
            scale = 1e-5 + 1e-4 * abs(slope)
            assert one.real_error == pytest.approx(abs(slope.real), abs=scale)
            assert one.imag_error == pytest.approx(abs(slope.imag), abs=scale)


def close(a1):
    """Return the modes of s^2 + a1 s + 4 with an error of 0.1 on both coefficients."""
    structure = structures.transfer_function(zeros=0, poles=2, input="u", output="y")
    values = {"b0": 1.0, "a1": a1, "a0": 4.0, "tau": 0.0}
    return modes(structure, values, (), names=["a1", "a0"], covariance=0.01 * np.eye(2))


@pytest.mark.parametrize(("a1", "separate"), [(8.0, True), (4.05, False), (3.98, False), (1, True)])
def test_a_pair_that_could_merge_is_marked(a1, separate):
    """Near critical damping 0.1 of a coefficient takes a real pair to a complex one."""
    for one in close(a1).poles:
        assert one.separate == separate
        assert ("could merge" in str(close(a1))) != separate


def test_modes_that_cross_without_meeting_are_not_marked():
    """Two axes that nothing couples may have the same pole, each with its own error."""
    values = {"L_p": -2.001, "M_q": -2.0}
    covariance = np.diag([0.04, 0.09])
    found = modes(TWO_AXES, values, (), names=["L_p", "M_q"], covariance=covariance)
    assert [one.real_error for one in found.poles] == pytest.approx([0.3, 0.2])
    assert all(one.separate for one in found.poles)


def test_what_the_data_do_not_see_leaves_its_modes_unknown():
    """An infinite variance reaches the modes that the parameter moves, and no other."""
    structure = structures.transfer_function(zeros=1, poles=1, input="u", output="y")
    values = {"b1": 2.0, "b0": 6.0, "a0": 5.0, "tau": 0.0}
    names = ["b1", "b0", "a0"]
    covariance = np.diag([np.inf, 0.01, 0.04])
    found = modes(structure, values, ["y/u"], names=names, covariance=covariance)
    assert found.poles[0].real_error == pytest.approx(0.2)
    assert math.isinf(found["y/u"][0].real_error)
    plain = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert plain["zeros"]["y/u"][0]["real_error"] is None


@pytest.fixture(scope="module")
def fit():
    structure = structures.transfer_function(zeros=0, poles=2, input="lat", output="p")
    values = {"b0": 30.0, "a1": 3.0, "a0": 25.0, "tau": 0.05}
    return fitted(structure, values, GRID, noise=0.02, seed=1)


def test_a_fit_says_its_modes_everywhere(fit):
    """In Python, in words, in JSON, and in a page; a fit that is read back has the same."""
    (pole,) = fit.modes.poles
    assert pole.frequency == pytest.approx(5.0, abs=4 * pole.frequency_error)
    assert pole.damping == pytest.approx(0.3, abs=4 * pole.damping_error)
    assert 0.0 < pole.damping_error < 0.05
    assert f"{pole.frequency:.4g}" in str(fit)
    data = json.loads(json.dumps(fit.to_dict(), allow_nan=False))
    assert data["modes"]["poles"][0]["frequency_rad_s"] == pole.frequency
    assert Fit.from_dict(data).modes == fit.modes
    assert "<table" in fit.modes._repr_html_()
    del data["covariance"], data["carried"]
    assert math.isnan(Fit.from_dict(data).modes.poles[0].real_error)


def test_a_model_without_inertia_in_a_state_has_none(fit):
    """M singular: the text and the file go without, and Python says why."""
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


def test_a_model_that_is_undefined_has_none():
    """A division by zero in any entry."""
    data = structures.heave.to_dict() | {"G": [["1/Z_col"]]}
    with pytest.raises(IdentificationError, match="undefined"):
        modes(Structure.from_dict(data), {"Z_w": -1.0, "Z_col": 0.0, "tau_col": 0.0}, ())


def test_the_error_of_a_known_servo_is_in_the_modes():
    """Of the servo's own pole all of it; of the plant's what the fit made of it."""
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


def test_a_mode_at_zero_is_an_integrator():
    """No damping, no time constant, and nothing that isn't a number in JSON."""
    one = Mode(0.0, 0.0, 0.1, 0.0)
    assert one.frequency_error == pytest.approx(0.1)
    assert math.isnan(one.damping)
    assert one.doubling is None
    plain = one.to_dict()
    assert plain["damping"] is None
    assert plain["time_s"] is None


@pytest.mark.slow
def test_stated_errors_are_the_scatter_over_noise(fit):
    """Sixty fits of the same model in other noise: 9 % of a scatter, so 30 % is three of it."""
    values = {"b0": 30.0, "a1": 3.0, "a0": 25.0, "tau": 0.05}
    found, stated = [], []
    options = {"frequencies_per_response": 40, "searches": 1, "noise": 0.02}
    for seed in range(60):
        pole = fitted(fit.structure, values, GRID, seed=seed, **options).modes.poles[0]
        found.append((pole.frequency, pole.damping))
        stated.append((pole.frequency_error, pole.damping_error))
    assert np.mean(stated, axis=0) == pytest.approx(np.std(found, axis=0), rel=0.3)


def test_a_pole_cancels_one_zero_at_most():
    """A zero on a pole goes with it; a second one there stays, and so does one beside."""
    zeros = np.array([-1.0, -1.0, -3.0 + 1.0j, -3.0 - 1.0j, 1e-9])
    poles = np.array([-1.0, -3.0 + 1.0j, -3.0 - 1.0j, 0.0])
    assert uncancelled(zeros, poles, 5.0) == pytest.approx([-1.0])
    # by the size of all poles: at the origin a small distance is none only beside larger ones
    assert uncancelled(np.array([1e-9]), np.array([0.0]), 0.0) == pytest.approx([1e-9])
