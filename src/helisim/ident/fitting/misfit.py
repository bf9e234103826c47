"""What a fitted structure leaves of the measured response beyond noise, apart from its errors.

A parameter's standard error says how far noise moves it. Where a structure can't follow the
response, what it leaves repeats in every record: more data narrow the errors, not this.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.units import DB_PER_NEPER
from helisim.base.value import FrozenMap, Value
from helisim.ident.fitting.cost import Cost

RATIO_LIMIT = 2.0
"""Residuals of more than this many times the noise's power are the structure's own."""


@dataclass(frozen=True, eq=False)
class Misfit(Value):
    """The rms of what a model leaves of each response once noise's part is taken out.

    Attributes:
        magnitude: dB, by response ("p/lat").
        phase: deg, by response.
        ratio: the residuals' power over what noise alone would leave (s^2, near 1 where the
            structure can follow the response); None where the noise is not known, and then
            magnitude and phase hold the noise too.
    """

    magnitude: Mapping[str, float]
    phase: Mapping[str, float]
    ratio: float | None

    def __post_init__(self) -> None:
        for name in ("magnitude", "phase"):
            object.__setattr__(self, name, FrozenMap(getattr(self, name)))

    def __str__(self) -> str:
        lines = [f"{name}: {self.words(name)}" for name in self.magnitude]
        return "\n".join([*lines, self.summary])

    @property
    def percent(self) -> dict[str, float]:
        """The rms of the relative error of each response, percent; magnitude and phase together."""
        return {
            name: 100.0 * math.hypot(self.magnitude[name] / DB_PER_NEPER, math.radians(phase))
            for name, phase in self.phase.items()
        }

    @property
    def summary(self) -> str:
        """What the ratio says, in a line."""
        if self.ratio is None:
            return "how much of the misfit is noise isn't known"
        verdict = (
            "; the structure itself can't follow, and no error of a parameter says by how much"
            if self.ratio > RATIO_LIMIT
            else ""
        )
        return f"what the model leaves is {self.ratio:.3g} times what noise would leave{verdict}"

    def words(self, name: str) -> str:
        """Return a response's misfit in words, such as "0.12 dB, 0.8 deg beyond noise"."""
        which = "noise included" if self.ratio is None else "beyond noise"
        return f"{self.magnitude[name]:.2g} dB, {self.phase[name]:.2g} deg {which}"

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON that `from_dict` reads back."""
        return {
            "magnitude_db": dict(self.magnitude),
            "phase_deg": dict(self.phase),
            "percent": self.percent,
            "ratio": self.ratio,
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Misfit":
        """Read what `to_dict` wrote. Raises KeyError, TypeError or ValueError."""
        return cls(
            magnitude={name: float(size) for name, size in data["magnitude_db"].items()},
            phase={name: float(size) for name, size in data["phase_deg"].items()},
            ratio=None if data["ratio"] is None else float(data["ratio"]),
        )


def misfit(
    cost: Cost, x: NDArray[np.float64], noise: NDArray[np.float64] | None, ratio: float | None
) -> Misfit:
    """Return what a fit that ended at x leaves beyond noise.

    Args:
        cost: the fit's cost.
        x: (n_free,) the free parameters.
        noise: (2 n_point,) variances of the relative errors, real then imaginary parts, that
            noise leaves after the fit; None where they are not known.
        ratio: the residuals' power over noise's.
    """
    z, _ = cost.ratio(x)
    with np.errstate(all="ignore"):
        squares = np.array([np.log(np.abs(z)) ** 2, np.angle(z) ** 2])
    if noise is not None:
        squares = squares - noise.reshape(2, -1)
    rms = [
        np.sqrt(np.maximum(squares[:, cost.points.pair == k].mean(axis=1), 0.0))
        for k in range(len(cost.points.pairs))
    ]
    return Misfit(
        magnitude={name: float(DB_PER_NEPER * one[0]) for name, one in zip(cost.points.pairs, rms)},
        phase={name: float(np.rad2deg(one[1])) for name, one in zip(cost.points.pairs, rms)},
        ratio=ratio,
    )
