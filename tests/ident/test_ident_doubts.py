"""Fits whose cost is excellent, and that are not to be believed: they say so, and what to try."""

from dataclasses import replace

import numpy as np

from helisim.ident import FrequencyResponse, Misfit, identify, structures

OMEGA = np.geomspace(1.0, 30.0, 60)
S = 1j * OMEGA


def fitted(response, zeros, poles):
    data = FrequencyResponse.exact(OMEGA, response[None, None], inputs=["lat"], outputs=["p"])
    return identify(
        data, structures.transfer_function(zeros=zeros, poles=poles, input="lat", output="p")
    )


FLAPPING = 5200.0 / (S**2 + 27.0 * S + 572.0) * np.exp(-0.012 * S)
DUTCH_ROLL = 13.5 * (S**2 + 0.5 * S + 2.2) / (S + 4.0) / (S**2 + 0.3 * S + 2.6)


def test_an_unstable_pole_that_stands_for_a_lag_is_told():
    """One pole takes the place of two, beyond the right edge, with ten times the delay."""
    wrong, right = fitted(FLAPPING, 0, 1), fitted(FLAPPING, 0, 2)
    assert wrong.excellent
    assert wrong.modes.poles[0].real > 10.0
    assert any("unstable pole" in one and "tf:0/2" in one for one in wrong.remarks)
    assert not any("unstable pole" in one for one in right.remarks)


def test_what_is_far_more_than_noise_is_told_with_the_order_that_follows():
    """A lightly damped mode that hardly costs: its order is named, from the data alone."""
    fit = fitted(DUTCH_ROLL * np.exp(-0.15 * S), 0, 1)
    known = replace(fit, misfit=Misfit(magnitude={"p/lat": 1.0}, phase={"p/lat": 5.0}, ratio=300.0))
    assert any("p/lat is off by 14 % rms" in one and "tf:2/3" in one for one in known.remarks)
    noisy = replace(known, misfit=replace(known.misfit, ratio=3.0))
    assert not any("off by" in one for one in noisy.remarks)


def test_a_slow_unstable_mode_is_the_vehicles_own():
    """A hover's phugoid is unstable, and no reason to doubt."""
    fit = fitted(90.0 * S / (S**2 - 0.8 * S + 4.0) * np.exp(-0.1 * S), 1, 2)
    assert fit.modes.poles[0].real > 0.3
    assert not any("unstable" in one for one in fit.remarks)
