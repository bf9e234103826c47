"""Centre of gravity from plumb lines: a body at rest hangs with it below the point it hangs by.

Reads records and nothing else: the log of a real suspension does as well.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from helisim.base.errors import InputError, RecordError
from helisim.records.record import FlightRecord

REST = 10.0
"""s at the end of a hanging, in which the attitude is averaged."""
_BLOCK = 0.25
"""s: a quarter of the pendulum's period, so that a swing shows in the scatter of the means."""
_STANDARD_ERROR = 1e-3
"""rad: greatest standard error of the mean attitude. At two points a foot from the centre of
gravity it is worth 0.6 mm."""
_DRIFT = 4e-3
"""rad between the halves of the rest: two standard errors of each, added."""


@dataclass(frozen=True, eq=False)
class PlumbLine:
    """The vertical through a suspension point, in airframe axes (FRD).

    Attributes:
        point: (3,) m, where the airframe was held.
        down: (3,) unit vector.
        error: rad, standard error of its direction, each way across.
    """

    point: NDArray[np.float64]
    down: NDArray[np.float64]
    error: float = 0.0

    def __post_init__(self) -> None:
        for name in ("point", "down"):
            array = np.array(getattr(self, name), dtype=np.float64)
            if array.shape != (3,) or not np.all(np.isfinite(array)):
                raise InputError(f"{name} must be three finite numbers, got {array}")
            array.flags.writeable = False
            object.__setattr__(self, name, array)


def plumb_line(record: FlightRecord, point: ArrayLike, *, rest: float = REST) -> PlumbLine:
    """Return the plumb line that the attitude at the end of a record gives.

    Args:
        record: of one hanging, with phi and theta.
        point: (3,) m, airframe axes (FRD), where it hung by.
        rest: s at the end of the record, in which it hung at rest.

    Raises:
        RecordError: it did not hang at rest.
    """
    at_rest = record.slice(record.time[-1] - rest, record.time[-1])
    angles = at_rest.select(("phi", "theta"))
    blocks = np.array_split(angles, max(4, round(at_rest.duration / _BLOCK)))
    means = np.array([block.mean(axis=0) for block in blocks])
    half = len(means) // 2
    drift = np.abs(means[:half].mean(axis=0) - means[half:].mean(axis=0))
    spread = means.std(axis=0, ddof=1) / np.sqrt(len(means))
    if np.any(spread > _STANDARD_ERROR) or np.any(drift > _DRIFT):
        raise RecordError(
            f"the helicopter still moves: in the last {rest:g} s the standard error of phi and "
            f"theta is {spread[0]:.2g} and {spread[1]:.2g} rad (allowed {_STANDARD_ERROR:g}), "
            f"their drift {drift[0]:.2g} and {drift[1]:.2g} rad (allowed {_DRIFT:g}); record "
            "for longer"
        )
    phi, theta = angles.mean(axis=0)
    down = [-np.sin(theta), np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta)]
    return PlumbLine(np.array(point), np.array(down), float(np.max(spread)))


def centre_of_gravity(lines: Sequence[PlumbLine]) -> NDArray[np.float64]:
    """Return the point nearest to all plumb lines, (3,) m, airframe axes (FRD).

    Raises:
        InputError: fewer than two lines, or all of them are parallel.
    """
    if len(lines) < 2:
        raise InputError(f"two plumb lines or more meet in a point, got {len(lines)}")
    across = [np.eye(3) - np.outer(line.down, line.down) for line in lines]
    total = np.sum(across, axis=0)
    if np.linalg.cond(total) > 1e4:
        raise InputError("the plumb lines are parallel; hang the helicopter from another point")
    return np.linalg.solve(
        total, np.sum([a @ line.point for a, line in zip(across, lines)], axis=0)
    )
