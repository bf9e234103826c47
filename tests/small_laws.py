"""Control laws that the tests fly."""

from dataclasses import replace

import numpy as np

from helisim.design.laws import AttitudeAxis, AttitudeCommand, Lead, StateSpaceLaw, YawAxis

HOLDS = AttitudeCommand(
    lat=AttitudeAxis(stick=0.6, frequency=6.0, k_angle=0.6, k_rate=0.05, k_integral=0.3),
    lon=AttitudeAxis(stick=0.6, frequency=6.0, k_angle=1.0, k_rate=0.1, k_integral=0.3),
    ped=YawAxis(stick=3.0, frequency=8.0, k_angle=1.0, k_rate=0.2, k_integral=0.5),
    phase=0.365,
)
"""Gains found by hand."""
LAT = {"stick": 0.6, "frequency": 6.0, "k_angle": 0.6, "k_rate": 0.05}
MORE = {"k_angle_cross": 0.02, "k_rate_cross": 0.01, "ff_acceleration": 0.001, "ff_rate": 0.01}
LEADS = (Lead(zero=20.0, pole=80.0), Lead(zero=60.0, pole=15.0))
FULL = replace(
    HOLDS,
    lat=replace(HOLDS.lat, **MORE, damping=0.7, filters=LEADS),
    lon=replace(HOLDS.lon, damping=1.4),
    ped=replace(HOLDS.ped, ff_rate=0.02, ff_acceleration=0.003),
)
"""With all that the law can do."""

INPUTS = ("p", "phi", "psi", "LAT", "COL")


def random_law(seed: int = 1, **changes) -> StateSpaceLaw:
    """A stable law of five states."""
    rng = np.random.default_rng(seed)
    a = rng.standard_normal((5, 5))
    a *= 0.9 / np.max(np.abs(np.linalg.eigvals(a)))
    shapes = {"b": (5, 5), "c": (4, 5), "d": (4, 5), "windup": (5, 4), "start": (5, 4)}
    matrices = {name: 0.1 * rng.standard_normal(shape) for name, shape in shapes.items()}
    return StateSpaceLaw(**{"period": 0.002, "inputs": INPUTS, "a": a, **matrices, **changes})
