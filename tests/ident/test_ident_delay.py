"""Delays: found wherever they are, from no start, and confirmed from different ones.

Truth is computed here from zeros and poles; scripts/proof/delay_study.py draws hundreds more.
"""

import sys

import numpy as np
import pytest

from helisim.ident import FrequencyResponse, Structure, identify, structures
from helisim.ident.cost import Cost, select
from helisim.ident.rational import delay_grid, rational_fits
from helisim.ident.search import Delays, Minimum, Start, agreed, beside
from script import SCRIPTS

sys.path.insert(0, str(SCRIPTS / "proof"))
from delay_study import study

FREQUENCY = np.geomspace(0.1, 10.0, 80)


def curve(num, den, tau, frequency=FREQUENCY):
    s = 1j * frequency
    return np.polyval(num, s) / np.polyval(den, s) * np.exp(-tau * s)


def measured(response, size=0.0, seed=0, frequency=FREQUENCY):
    wobble = np.random.default_rng(seed).normal(size=(2, *response.shape))
    noisy = response * (1.0 + size * (wobble[0] + 1j * wobble[1]))
    return FrequencyResponse.exact(frequency, noisy[None, None], inputs=["u"], outputs=["y"])


@pytest.mark.parametrize("tau", [-0.25, 0.0, 0.2, 0.5, 1.25])
def test_a_rational_fit_needs_no_start(tau):
    """Exact data of (2 s^2 - s + 5)/(s^3 + 3 s^2 + 4 s + 2): coefficients to 1e-6, any delay.

    1.25 s is two cycles of the band's top, 10 rad/s.
    """
    num, den = (2.0, -1.0, 5.0), (1.0, 3.0, 4.0, 2.0)
    fits = rational_fits(
        FREQUENCY,
        curve(num, den, tau),
        np.ones(FREQUENCY.size),
        zeros=2,
        poles=3,
        delays=delay_grid(FREQUENCY),
    )
    best = np.argmin(fits.errors)
    assert fits.delays[best] == pytest.approx(tau, abs=1e-6)
    np.testing.assert_allclose(fits.numerators[best], num[::-1], rtol=1e-6)
    np.testing.assert_allclose(fits.denominators[best], den[::-1], rtol=1e-6)


@pytest.mark.parametrize("given", [{"b1": 0.0}, {"a0": 0.0}, {"b1": 0.0, "a0": 0.0}, {"tau": 0.4}])
def test_what_is_given_of_a_transfer_function_stays(given):
    """With coefficients or the delay fixed, the rest is found without a start likewise."""
    truth = {"b1": 3.0, "b0": -2.0, "a1": 1.5, "a0": 4.0, "tau": 0.4} | given
    structure = structures.transfer_function(zeros=1, poles=2, input="u", output="y")
    num, den = (truth["b1"], truth["b0"]), (1.0, truth["a1"], truth["a0"])
    fit = identify(measured(curve(num, den, truth["tau"])), structure.with_fixed(given), searches=1)
    assert fit.values == pytest.approx(truth, rel=1e-6)


def test_the_grid_of_delays_follows_the_band_and_the_bounds():
    """Half a radian at the top apart, from a lead of 0.3 s to 0.5 s or two cycles of the top."""
    for top, last in ((40.0, 0.5), (10.0, 0.4 * np.pi), (2.0, 2.0 * np.pi)):
        grid = delay_grid(np.array([0.1, top]))
        assert (grid[0], grid[-1]) == pytest.approx((-0.3, last))
        assert np.max(np.diff(grid)) <= 0.5 / top * (1.0 + 1e-9)
    np.testing.assert_allclose(delay_grid(np.array([1.0, 10.0]), 0.0, 0.1), [0.0, 0.05, 0.1])


def test_a_delay_of_a_fifth_of_a_second_is_found_in_noise():
    """(0.4 s + 0.1)/(s^2 + 0.9 s + 2) e^(-0.2 s) in 10 % noise, whose errors the fit states."""
    structure = structures.transfer_function(zeros=1, poles=2, input="u", output="y")
    truth = {"b1": 0.4, "b0": 0.1, "a1": 0.9, "a0": 2.0, "tau": 0.2}
    fit = identify(measured(curve((0.4, 0.1), (1.0, 0.9, 2.0), 0.2), 0.1), structure)
    for name, value in truth.items():
        assert abs(fit[name].value - value) < 4.0 * fit[name].standard_error
    assert fit["tau"].standard_error < 0.02
    assert fit.searches_agreeing >= 2
    assert fit.excellent


@pytest.mark.parametrize(("case", "number"), [("1/2", 6), ("rollpitch", 2)])
def test_random_systems_are_found(case, number):
    """Some systems drawn from a seed of no other use, delays to 0.5 s."""
    assert study(case, 0.5, 77, number) == number


@pytest.mark.study
@pytest.mark.parametrize(
    ("case", "delay"),
    [("0/1", 0.5), ("1/2", 0.28), ("1/2", 1.2), ("2/4", 0.5), ("3/4", 0.5), ("rollpitch", 0.5)],
)
def test_sixty_random_systems_are_found(case, delay):
    """At least 59 of 60, for two seeds of no other use; 1.2 s are two cycles of the top."""
    for seed in (78, 79):
        assert study(case, delay, seed, 60) >= 59


def test_starts_at_the_same_delay_do_not_confirm_each_other():
    """Of three starts that end in one minimum, two at one delay, two count; one more elsewhere."""
    data = measured(curve((20.0,), (1.0, 0.7), 0.2))
    structure = structures.first_order_delay(input="u", output="y")
    points = select(data, structure, band=None, responses=None, count=20)
    delays = Delays(Cost(structure, points))
    end = np.array([20.0, 0.7, 0.2])

    def ended(cost, delay):
        return Minimum(end, cost, True, Start(end, np.array([delay])))

    alike = [ended(1.0, 0.2), ended(1.00001, 0.2), ended(1.0, 0.21), ended(2.0, 0.4)]
    assert agreed(alike, delays) == (alike[0], 1)
    assert agreed([*alike, ended(1.0, 0.1)], delays)[1] == 2
    alone = identify(data, structure, searches=1)
    assert alone.searches_agreeing == 1
    assert "different delays" in alone.remarks[0]
    assert identify(data, structure).searches_agreeing >= 2


def test_a_minimum_is_looked_past_on_both_sides():
    """Two radians of the band's top shorter and longer, gains solved, never beyond the bounds."""
    data = measured(curve((20.0,), (1.0, 0.7), 0.2))
    structure = structures.first_order_delay(input="u", output="y")
    cost = Cost(structure, select(data, structure, band=None, responses=None, count=20))
    x = np.array([20.0, 0.7, 0.15])
    shorter, longer = beside(cost, x)
    assert (shorter.delays[0], longer.delays[0]) == pytest.approx((-0.05, 0.35))
    for start in (shorter, longer):
        assert start.x[1:] == pytest.approx([0.7, start.delays[0]])
        moved = np.array([20.0, *start.x[1:]])
        assert np.sum(cost.relative(start.x) ** 2) < np.sum(cost.relative(moved) ** 2)
    near = beside(cost, np.array([20.0, 0.7, -0.25]))
    assert near[0].delays[0] == pytest.approx(-0.3)
    known = structure.with_fixed({"tau": 0.2})
    assert beside(Cost(known, cost.points), x[:2]) == []


def test_a_gain_with_a_delay_has_a_rational_fit_too():
    """No poles: K e^(-tau s), of either sign."""
    structure = structures.transfer_function(zeros=0, poles=0, input="u", output="y")
    fit = identify(measured(curve((-3.0,), (1.0,), 0.4)), structure)
    assert fit.values == pytest.approx({"b0": -3.0, "tau": 0.4}, rel=1e-6)


def test_each_delay_of_a_structure_is_scanned_whatever_the_signs():
    """Two outputs over one first-order lag, 0.05 and 0.45 s late, one of the other sign.

    The second gain starts at +1 and is -0.5: only a start of the other sign leads there.
    """
    late = {"unit": "s", "start": 0.0, "bounds": [-0.3, 5.0], "scale": 0.03}
    lag = Structure.from_dict(
        {
            "name": "lag",
            "parameters": {
                "T": {"unit": "s", "start": 1.0, "bounds": [0.01, 10.0]},
                "K": {"unit": "1", "start": 1.0},
                "K_2": {"unit": "1", "start": 1.0},
                "tau_1": late,
                "tau_2": late,
            },
            "states": ["x"],
            "inputs": ["u"],
            "outputs": ["y", "z"],
            "M": [["T"]],
            "F": [["-1"]],
            "G": [["K"]],
            "H0": [["1"], ["K_2"]],
            "output_delays": {"y": "tau_1", "z": "tau_2"},
        }
    )
    truth = {"T": 0.3, "K": 2.0, "K_2": -0.5, "tau_1": 0.05, "tau_2": 0.45}
    both = [curve((2.0,), (0.3, 1.0), 0.05), curve((-1.0,), (0.3, 1.0), 0.45)]
    data = FrequencyResponse.exact(
        FREQUENCY, np.array(both)[:, None], inputs=["u"], outputs=["y", "z"]
    )
    fit = identify(data, lag)
    assert fit.values == pytest.approx(truth, rel=1e-5)
    assert fit.searches_agreeing >= 2
