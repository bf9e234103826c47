"""Margins, crossover, disk and Nichols distance of broken loops, against python-control."""

import control as ct
import numpy as np
import pytest

from helisim.handling.figures import approach, disk_margin, hexagon, margins, slope_order
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
    """Margins at every crossing, of gain and of phase, and the frequencies where they are."""
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


@pytest.mark.parametrize("skew", [0.0, 1.0, -1.0])
@pytest.mark.parametrize("name", ["third order", "integral, lead"])
def test_the_disk_is_that_of_python_control(name, skew):
    """A finer grid there; a parabola through three points here is 1.3e-5 off."""
    dense = np.geomspace(GRID[0], GRID[-1], 4000)
    alpha, gain, phase = ct.disk_margins(LOOPS[name], dense, skew=skew)
    found = disk_margin(curve(LOOPS[name]), skew=skew)
    assert found.alpha == pytest.approx(float(alpha), rel=2e-5)
    if skew == 0.0:
        assert found.gain == pytest.approx(float(gain), rel=2e-5)
        assert np.degrees(found.phase) == pytest.approx(float(phase), rel=2e-5)


def test_a_slope_is_the_order_of_an_integrator():
    for order in (1, 2):
        assert slope_order(curve(5.0 / S**order), 5.0) == pytest.approx(order, rel=1e-9)


@pytest.mark.parametrize("gain", [1e-3, 0.1, 0.5, 30.0, 1e4])
def test_a_crossover_beyond_the_band_is_continued(gain):
    """K/s has its crossover at K, inside of the band and outside."""
    assert margins(curve(gain / S)).crossover == pytest.approx(gain, rel=1e-9)


@pytest.mark.parametrize("delay", [0.004, 0.008, 0.0104, 0.0106, 0.013])
def test_a_gain_margin_beyond_the_band_is_extended(delay):
    """K exp(-s T) / s has -180 deg at pi / (2 T), where its gain is 2 K T / pi."""
    loop = Curve(GRID, 20.0 * np.exp(-1j * GRID * delay) / (1j * GRID))
    expected = -20.0 * np.log10(20.0 * delay * 2.0 / np.pi)
    assert margins(loop).least_gain == pytest.approx(expected, abs=1e-3)


def test_the_nichols_distance_is_the_zone_that_the_loop_touches():
    """A loop of constant phase passes a hexagon at its upright side, whatever its gain."""
    turned = Curve(GRID, (5.0 / GRID) * np.exp(-1j * np.radians(150.0)))
    found = approach(turned, hexagon(6.0, np.radians(45.0)))
    assert found.size == pytest.approx(30.0 / 45.0, rel=1e-9)
    assert found.frequency == pytest.approx(5.0, rel=0.5)


def test_margins_are_continuous_where_the_loop_becomes_unstable():
    """The least margin goes through zero, with its sign."""
    loop = LOOPS["third order"]
    gains = np.geomspace(0.5, 20.0, 400)
    found = [margins(Curve(GRID, gain * loop(1j * GRID))) for gain in gains]
    for values, step in (
        ([one.least_gain for one in found], 20.0 * np.log10(gains[1] / gains[0])),
        ([np.degrees(one.least_phase) for one in found], 1.0),
    ):
        assert min(values) < 0.0 < max(values)
        assert np.max(np.abs(np.diff(values))) < 1.1 * step


def test_the_crossover_is_the_highest_of_several():
    """An integral with a mode that rises over one again: the gain falls through one twice."""
    found = margins(curve(0.5 / S * (S**2 + S + 4.0) / (S**2 / 25.0 + 0.008 * S + 1.0) / 2.0))
    falls = [where for where, _ in found.phase]
    assert len(falls) == 3
    assert found.crossover == falls[-1] > 5.0 > falls[0]


@pytest.mark.parametrize(
    ("x", "y", "size"), [(0.0, 6.0, 1.0), (0.5, 3.0, 1.0), (0.5, 0.0, 1.0), (0.25, 4.5, 1.0)]
)
def test_a_hexagon_has_its_corners_where_they_are_said(x, y, size):
    """Tips at its gain, upright sides half as high, straight between; the same on all sides."""
    gauge = hexagon(6.0, 0.5)
    for a, b in ((1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)):
        assert gauge(a * x, b * y) == pytest.approx(size)
    assert hexagon(6.0, 0.5, corner=1.0)(0.5, 6.0) == pytest.approx(1.0)
    assert hexagon(6.0, 0.5, corner=0.0)(0.25, 3.0) == pytest.approx(1.0)


def test_between_points_without_a_response_there_is_none():
    """A logarithm of nothing is no warning: the middle of 0 and 0 is 0."""
    nothing = Curve([1.0, 2.0], [0.0, 0.0])
    assert abs(nothing.at(1.5)[0]) < 1e-300
