import numpy as np
import pytest

import helisim as hs
from helisim.design.exact import MeanLoop, exact_loop, exact_over
from helisim.handling.loop import NoResponse

GRID = np.geomspace(1.0, 100.0, 20)
SAME = 1e-9
"""Rounding of some hundred products of numbers of order one, and of solving for a trim."""


def test_in_calm_air_it_is_the_exact_loop(jr700):
    """There is one air to meet."""
    found = exact_over(jr700, hs.Weather(), GRID).broken("ped")
    np.testing.assert_allclose(
        found.response, exact_loop(jr700, GRID).broken("ped").response, rtol=SAME
    )


def test_in_a_steady_wind_it_is_that_of_the_trim_there(jr700):
    """As of the vehicle that is trimmed in it, which isn't the hover's."""
    weather = hs.Weather(wind=4.0)
    found = exact_over(jr700, weather, GRID).command("lat").response
    there = exact_loop(weather.trimmed(jr700), GRID).command("lat").response
    np.testing.assert_allclose(found, there, rtol=SAME)
    still = exact_loop(jr700, GRID).command("lat").response
    assert np.max(np.abs(found / still - 1.0)) > 1e6 * SAME


def test_sensitivities_are_averaged_not_loops(jr700):
    """An estimate averages what reaches the actuator, in each half of a flight alike."""
    one = exact_loop(jr700, GRID)
    other = exact_loop(jr700.with_settings({"gyro.k_p": 1.5}), GRID)
    mean = MeanLoop(((0.5, one), (0.5, other))).broken("ped").response
    each = [1.0 / (1.0 + half.broken("ped").response) for half in (one, other)]
    np.testing.assert_allclose(1.0 / (1.0 + mean), np.mean(each, axis=0), rtol=SAME)
    loops = np.mean([half.broken("ped").response for half in (one, other)], axis=0)
    assert np.max(np.abs(mean / loops - 1.0)) > 0.001


def test_a_mean_has_no_poles(jr700):
    """Who asks is told so."""
    one = exact_loop(jr700, GRID)
    with pytest.raises(NoResponse, match="no poles"):
        _ = MeanLoop(((1.0, one),)).poles
