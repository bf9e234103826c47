"""Rejection of disturbances: how fast a loop brings an attitude back, and what it amplifies."""

from dataclasses import dataclass

import numpy as np

from helisim.handling.curve import Curve
from helisim.handling.figures.crossings import crossings, peak

HALF_POWER = -10.0 * np.log10(2.0)
"""dB, of 1 / sqrt 2."""


@dataclass(frozen=True)
class Rejection:
    """Rejection of a disturbance of attitude.

    Attributes:
        bandwidth: DRB, rad/s: the lowest frequency at which |S| rises through 1 / sqrt 2. Without
            one, where it would by a slope of 20 dB a decade from its nearest point.
        peak: DRP, dB: the highest |S|.
        peak_frequency: rad/s.
        seen: whether |S| rises through 1 / sqrt 2 within the band.
    """

    bandwidth: float
    peak: float
    peak_frequency: float
    seen: bool


def rejection(disturbance: Curve) -> Rejection:
    """Return disturbance rejection bandwidth and peak of a sensitivity S.

    Definitions: Berger, Ivler, Berrios, Tischler and Miller, "Disturbance Rejection Handling-
    Qualities Criteria for Rotorcraft", 72nd Annual Forum of the AHS, 2016; Blanken, Tischler,
    Lusardi and Ivler, "Aeronautical Design Standard - 33 (ADS-33) ... Past, Present, and Future",
    AHS Rotorcraft Handling Qualities Technical Meeting, 2014.

    Args:
        disturbance: the sensed angle over a disturbance of it.
    """
    size = disturbance.decibel
    own = disturbance.frequency
    highest, where = peak(own, size)
    found = crossings(own, size - HALF_POWER)
    rises = found.frequency[found.rising]
    if rises.size:
        bandwidth = float(rises[0])
    else:
        nearest = -1 if size[-1] <= HALF_POWER else int(np.argmin(size))
        bandwidth = float(own[nearest] * 10.0 ** ((HALF_POWER - size[nearest]) / 20.0))
    return Rejection(bandwidth, highest, where, bool(rises.size))
