"""A search sees a hump of the sensitivity, or a dip of the gain, before a figure jumps to it."""

from dataclasses import dataclass

import numpy as np
import pytest

from helisim.design.problem import distance
from helisim.handling.criteria import Crossover, DisturbanceRejection, Limit, StabilityMargins
from helisim.handling.loop import Curve


@dataclass
class Humped:
    """|S| rises by 20 dB a decade through -3.01 dB at 20 rad/s; a hump at 5 rad/s, dB."""

    hump: float

    def disturbance(self, axis):
        frequency = np.geomspace(0.3, 120.0, 400)
        size = -3.0103 + 20.0 * np.log10(frequency / 20.0)
        size += (self.hump - size) * np.exp(-((np.log(frequency / 5.0) / 0.2) ** 2))
        return Curve(frequency, 10.0 ** (size / 20.0))

    def broken(self, axis, at="actuators"):
        return Curve(np.array([1.0, 10.0]), np.array([2.0, 0.1 - 0.1j]))


@pytest.mark.parametrize("hump", [-9.0, -5.0, -3.1])
def test_a_hump_counts_by_its_height(hump):
    """Continuously: one unit in 15 dB, though the bandwidth itself is 20 rad/s."""
    asked = DisturbanceRejection(axis="lat", bandwidth=Limit(12.9, 9.9))
    loop = Humped(hump)
    assert asked.rate(loop).figures["drb"] == pytest.approx(20.0, rel=1e-3)
    # 2 %: the hump's top lies between points of the grid, and a little beside 5 rad/s
    expected = min(asked.rate(loop).distance, (-3.0103 - hump) / 15.0)
    assert distance(asked, loop) == pytest.approx(expected, abs=0.02)


def test_a_hump_beyond_costs_no_more_than_it_jumps():
    asked = DisturbanceRejection(axis="lat", bandwidth=Limit(12.9, 9.9))
    assert distance(asked, Humped(-2.9)) == asked.rate(Humped(-2.9)).distance < -1.0


def test_other_criteria_are_as_they_are():
    asked = StabilityMargins(axis="lat")
    assert distance(asked, Humped(-5.0)) == asked.rate(Humped(-5.0)).distance


@dataclass
class Dipped:
    """A gain that falls to -3 dB at 5 rad/s, and bulges to another, dB, at 30 rad/s."""

    bulge: float

    def broken(self, axis, at="actuators"):
        frequency = np.geomspace(0.3, 120.0, 400)
        corners = np.log([0.3, 5.0, 30.0, 120.0])
        size = np.interp(np.log(frequency), corners, [12.0, -3.0, self.bulge, self.bulge - 20.0])
        return Curve(frequency, 10.0 ** (size / 20.0) * np.exp(-2.0j))


@pytest.mark.parametrize("bulge", [-4.0, -1.5, -0.5])
def test_a_dip_of_the_gain_counts_by_its_depth(bulge):
    """One unit in 15 dB, where the crossover itself stays at 3.2 rad/s, whatever the bulge."""
    asked = Crossover(axis="lat", frequency=Limit(30.0, 29.0))
    loop = Dipped(bulge)
    assert asked.rate(loop).figures["crossover"] < 4.0
    # 0.01: the bulge's top lies between points of the grid
    assert distance(asked, loop) == pytest.approx(bulge / 15.0, abs=0.01)


def test_a_crossover_that_is_met_or_asked_to_be_slow_is_as_it_is():
    met, slow = Limit(30.0, 20.0), Limit(2.0, 4.0)
    for limit, loop in ((met, Dipped(3.0)), (slow, Dipped(-4.0))):
        asked = Crossover(axis="lat", frequency=limit)
        assert distance(asked, loop) == asked.rate(loop).distance
