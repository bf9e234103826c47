"""A search sees a hump of the sensitivity before the bandwidth jumps to it."""

from dataclasses import dataclass

import numpy as np
import pytest

from helisim.design.guarded import distance
from helisim.handling.criteria import DisturbanceRejection, Limit, StabilityMargins
from helisim.handling.curve import Curve


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
