"""The main rotor's wake at a place behind it, from the law of Biot and Savart."""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from helisim.physics.layout import WASH as COEFFICIENTS

_AZIMUTHS = (np.arange(180) + 0.5) * math.pi / 90.0
_SKEWS = np.linspace(0.0, math.pi, 91)
_SPREAD = np.array([-0.1, 0.0, 0.1])
"""Over how many radii about its place the wash of a tail is averaged, along x and z."""
_CORE = 0.05
"""Radius of the vortices' core over the rotor's: a place may lie on the wake's edge."""
_FAR = 100.0
"""Radii, beyond which no wake is felt."""
_DIGITS = 4
"""To which the coefficients are rounded, so that they are the same on every machine."""


def downwash(
    x: ArrayLike, z: ArrayLike, skew: ArrayLike, *, radius: ArrayLike = 1.0, core: float = 0.0
) -> NDArray[np.float64]:
    """Return the velocity down, over that at the disc's centre, in a rotor's wake.

    The wake of a uniformly loaded disc is a tube of vortex rings that drift off at the skew angle
    (Coleman, Feingold and Stempin, NACA ARR L5E10; Castles and De Leeuw, NACA TR 1184). Along
    the tube the integral is closed, around it a sum. An array, (n_place,), of
    each gives one.

    Args:
        x: ahead of the centre, over the rotor's radius.
        z: below the centre, likewise.
        skew: angle between the wake's axis and the disc's, rad: 0 in hover, near pi/2 at speed,
            more where the air passes the disc upwards.
        radius: of the tube, over the rotor's.
        core: of the vortices, likewise.
    """
    x, z, skew, radius = (np.asarray(one, dtype=float)[..., None] for one in (x, z, skew, radius))
    cosine = np.cos(_AZIMUTHS)
    ahead = x - radius * cosine
    distance = np.sqrt(ahead**2 + (radius * np.sin(_AZIMUTHS)) ** 2 + z**2 + core**2)
    around = (radius - x * cosine) / distance - np.sin(skew) * cosine
    along = distance + ahead * np.sin(skew) - z * np.cos(skew)
    return np.mean(radius * around / along, axis=-1)


@lru_cache(maxsize=64)
def wash_coefficients(x: float, z: float) -> tuple[float, ...]:
    """Return the `COEFFICIENTS` of the wash at a place, over the rotor's radius from its hub.

    The tube contracts as momentum theory has it: to 0.71 radii in hover, not at all at speed.
    Beside it the air of a hover rises at less than a tenth of what falls within: that is left out.

    Args:
        x: ahead of the hub.
        z: below it.
    """
    if not math.hypot(x, z) < _FAR:
        return (0.0,) * COEFFICIENTS
    cosine = np.cos(_SKEWS)
    down = np.maximum(cosine, 0.0)
    wash = _mean_wash(x, z, _SKEWS, (1.0 + 3.0 * down**2) ** -0.25)
    hover, descent = max(0.0, float(wash[0])), float(wash[-1])
    upright = np.where(cosine > 0.0, hover, descent) * cosine**2
    powers = cosine[:, None] ** np.arange(COEFFICIENTS - 2)
    basis = np.sin(_SKEWS)[:, None] ** 2 * powers
    fitted = np.linalg.lstsq(basis, wash - upright, rcond=None)[0]
    return tuple(round(float(one), _DIGITS) for one in (hover, descent, *fitted))


def _mean_wash(
    x: float, z: float, skew: NDArray[np.float64], radius: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the downwash about a place, (n_skew,)."""
    around = [
        downwash(x + dx, z + dz, skew, radius=radius, core=_CORE)
        for dx in _SPREAD
        for dz in _SPREAD
    ]
    return np.mean(around, axis=0)
