"""Margins and crossover of broken loops, against python-control."""

import control as ct
import numpy as np
import pytest

from helisim.base.errors import InputError
from helisim.handling.figures import margins
from helisim.handling.loop import GRID, Curve

S = ct.tf("s")
LOOPS = {
    "third order": 4.0 / (S * (S / 2.0 + 1.0) * (S / 20.0 + 1.0)),
    "integral, lead": 12.0 * (S + 2.0) * (S + 1.0) / (S**2 * (S / 30.0 + 1.0) ** 2),
    "resonance": 4.0 / S * 100.0 / (S**2 + 3.0 * S + 100.0),
    "unstable": 60.0 / (S * (S / 2.0 + 1.0) * (S / 20.0 + 1.0)),
}
INTERPOLATION = 2e-4
"""Straight lines of dB and of phase over log frequency between points 1.7 % apart; a resonance with
damping 0.15 is bent most, by 0.01 dB and 0.1 deg."""


def curve(loop, frequency=GRID):
    return Curve(frequency, loop(1j * frequency))


@pytest.mark.parametrize("name", LOOPS)
def test_all_crossings_are_those_of_python_control(name):
    gains, phases, _, turns, ones, _ = ct.stability_margins(LOOPS[name], returnall=True)
    inside = (turns > GRID[0]) & (turns < GRID[-1])
    found = margins(curve(LOOPS[name]))
    own = np.array(found.gain).reshape(-1, 2)
    order = np.argsort(turns[inside])
    np.testing.assert_allclose(own[:, 0], turns[inside][order], rtol=INTERPOLATION)
    expected = 20.0 * np.log10(gains[inside][order])
    np.testing.assert_allclose(own[:, 1], expected, atol=0.01)
    other = np.array(found.phase)
    order = np.argsort(ones)
    np.testing.assert_allclose(other[:, 0], ones[order], rtol=INTERPOLATION)
    wrapped = (phases[order] + 180.0) % 360.0 - 180.0
    np.testing.assert_allclose(np.degrees(other[:, 1]), wrapped, atol=0.1)


@pytest.mark.parametrize("name", LOOPS)
def test_the_sign_says_whether_the_closed_loop_is_stable(name):
    poles = ct.feedback(LOOPS[name], 1).poles()
    found = margins(curve(LOOPS[name]))
    assert found.stable == bool(np.all(poles.real < 0.0))
    assert (found.least_gain > 0.0) == found.stable
    assert (found.least_phase > 0.0) == found.stable


def test_a_curve_between_its_points_is_a_power_and_a_turn():
    """Straight lines of log size and of phase over log frequency: (s / 3)^-1.7, which is both."""
    found = Curve(GRID[::9], (1j * GRID[::9] / 3.0) ** -1.7)
    wanted = np.array([0.2, 0.33, 3.0, 47.0])
    np.testing.assert_allclose(found.at(wanted), (1j * wanted / 3.0) ** -1.7, rtol=1e-12)
    late = Curve(GRID, np.exp(-0.1j * GRID))
    np.testing.assert_allclose(late.phase, -0.1 * GRID, rtol=1e-12)
    for beyond in (0.19, 151.0):
        with pytest.raises(InputError, match=r"known from 0\.2 to 150 rad/s, not at"):
            late.at([1.0, beyond])


def test_what_is_no_curve_is_refused():
    one, two = np.array([1.0]), np.array([1.0, 2.0])
    for frequency, response in ((two, np.ones(3)), (two[None], two[None]), (one, one)):
        with pytest.raises(InputError, match="a curve has two points or more, as many responses"):
            Curve(frequency, response)
    for frequency in (two - 1.0, two[::-1], one[[0, 0]]):
        with pytest.raises(InputError, match="positive and increasing"):
            Curve(frequency, two)


@pytest.mark.parametrize("gain", [1e-3, 0.1, 0.5, 30.0, 1e4])
def test_a_crossover_beyond_the_band_is_continued(gain):
    """K/s has its crossover at K, inside of the band and outside."""
    found = margins(curve(gain / S))
    assert found.crossover == pytest.approx(gain, rel=1e-9)
    assert found.least_gain == 60.0  # dB, the most that is told
    # beyond the band's end a gain that falls below one may do so at the phase there; one that is
    # below leaves its share of a half turn
    wide = np.pi * (1.0 - 0.5 * gain / GRID[0]) if gain < GRID[0] else 0.5 * np.pi
    assert found.open_phase == pytest.approx(np.pi if gain == 30.0 or gain == 0.5 else wide)


def test_a_phase_margin_is_within_a_half_turn_to_either_side():
    """Between two points beside the positive axis, 0.3 deg from it at a gain of one."""
    found = margins(Curve([1.0, 2.0], [1.1 * np.exp(0.01j), np.exp(-0.02j) / 1.1]))
    assert found.phase == (pytest.approx((2.0**0.5, np.pi - 0.005)),)


@pytest.mark.parametrize("delay", [0.004, 0.008, 0.0104, 0.0106, 0.013])
def test_a_gain_margin_beyond_the_band_is_extended(delay):
    """K exp(-s T) / s has -180 deg at pi / (2 T), where its gain is 2 K T / pi."""
    loop = Curve(GRID, 20.0 * np.exp(-1j * GRID * delay) / (1j * GRID))
    expected = -20.0 * np.log10(20.0 * delay * 2.0 / np.pi)
    assert margins(loop).least_gain == pytest.approx(expected, abs=1e-3)


def test_a_gain_that_rises_is_not_extended():
    """Of 0.02 sqrt(s) exp(-s / 60) the phase is -180 deg beyond the band: the end's gain counts."""
    loop = Curve(GRID, 0.02 * np.sqrt(1j * GRID) * np.exp(-1j * GRID / 60.0))
    assert margins(loop).least_gain == pytest.approx(-loop.decibel[-1], rel=1e-9)
