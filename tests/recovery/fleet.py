"""Every aircraft of known truth by name, in its rig and with its sweeps.

The models and their sources are in `published`; how the first three fly is said here.
"""

from collections.abc import Callable

import numpy as np
import published
from closed_loop import Aircraft, Rig, Sweep, quadratic_gain, swept


def boeing_747() -> Aircraft:
    """Yaw damper and wing leveller, as the aircraft flies with; 400 s a sweep for 1 rad/s."""
    rig = Rig(
        *published.printed("boeing_747"),
        np.array([[0.0, -1.5, 0.0, 0.0], [0.0, 0.0, 1.0, 1.0]]),
        rate=50,
        keep=1,
        noise=dict.fromkeys(("r", "p", "phi"), 0.0005),
        gust={"beta": 0.001, "p": 0.0025},
        gust_cutoff=2.0,
    )
    return swept("boeing_747", rig, {"ped": 0.05, "lat": 0.1}, (0.1, 8.0), 400.0, 0.001)


def blade_360() -> Aircraft:
    """A hover hold with 40 ms of delay; cyclic sweeps up to the rotor's 78 rad/s."""
    structure, truth = published.blade_360(), published.BLADE_360
    weights = {"u": 0.02, "v": 0.02, "w": 0.1, "phi": 1.0, "theta": 1.0, "r": 0.05}
    rig = Rig(
        structure,
        truth,
        quadratic_gain(structure, truth, weights, 100.0),
        rate=500,
        keep=2,
        noise={**dict.fromkeys(("p", "q", "r"), 0.01), **dict.fromkeys(("u", "v", "w"), 0.02)},
        gust={"u": 0.15, "v": 0.15, "w": 0.15, "p": 0.5, "q": 0.5, "r": 0.25},
    )
    cyclic = {"band": (0.3, 110.0), "amplitude": 0.1}
    other = {"band": (0.3, 30.0), "amplitude": 0.05}
    sweeps = [
        Sweep(axis=axis, duration=90.0, off_axis=0.001, **kind)
        for axis, kind in zip(("lat", "lon", "ped", "col"), (cyclic, cyclic, other, other))
        for _ in range(2)
    ]
    return Aircraft("blade_360", rig, tuple(sweeps))


def lynx() -> Aircraft:
    """A hover hold by state feedback, 300 s a sweep for the phugoid's 0.6 rad/s."""
    structure, truth = published.lynx()
    weights = {"u": 0.01, "v": 0.01, "w": 0.05, "phi": 1.0, "theta": 1.0, "r": 1.0}
    rig = Rig(
        structure,
        truth,
        quadratic_gain(structure, truth, weights, 1.0),
        rate=100,
        keep=1,
        noise={**dict.fromkeys(("p", "q", "r"), 0.002), **dict.fromkeys(("u", "v", "w"), 0.05)},
        gust={"u": 0.05, "v": 0.05, "w": 0.05, "p": 0.015, "q": 0.01, "r": 0.01},
        gust_cutoff=3.0,
    )
    amplitudes = {"col": 0.3, "lon": 0.3, "lat": 0.3, "ped": 1.0}
    return swept("lynx", rig, amplitudes, (0.1, 20.0), 300.0, 0.006)


FLEET: dict[str, Callable[[], Aircraft]] = {
    "boeing_747": boeing_747,
    "blade_360": blade_360,
    "lynx": lynx,
    "f_16": published.f_16,
}
