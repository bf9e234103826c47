"""What lies under the points of a chart: the regions of levels, their names, their borders."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from helisim.handling.chart import Chart
from helisim.show.clipping import clipped_polygon, inside
from helisim.show.figure import Area, Ground, Mark, Scale

_GROUNDS: dict[int, Ground] = {1: "level1", 2: "level2", 3: "level3"}
_GRID = 60
"""Cells along each side of a chart, in which room for a word is looked for."""
_WIDE = 3.0
"""Half a word's width over half its height: it needs more room across."""
_ROOM = 1.5
"""Cells that a word needs above and below its middle."""
_PIECES = 120
"""Of each edge of a region, each with a level on either side."""
_BESIDE = 1e-4
"""Share of the frame: how far beside an edge that is looked."""


@dataclass(frozen=True)
class Drawn:
    """An axis as it is drawn.

    Attributes:
        figure: along it; "" for none.
        factor: of values for people over those in SI.
        low: where it starts, for people.
        high: where it ends.
        logarithmic: as of a `Scale`.
    """

    figure: str
    factor: float
    low: float
    high: float
    logarithmic: bool

    @property
    def ends(self) -> tuple[float, float]:
        """Lowest and highest value, as drawn."""
        return self.low, self.high

    @property
    def scale(self) -> Scale:
        """The same without ticks."""
        return Scale(self.low, self.high, (), (), self.logarithmic)

    def share(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return where values of the chart are along the axis, infinity too; (n_value,) each."""
        with np.errstate(divide="ignore"):
            shown = self.factor * np.asarray(values, dtype=np.float64)
            return self.scale.share(np.maximum(shown, 0.0) if self.logarithmic else shown)

    def at(self, share: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values as drawn at shares of the axis; (n_value,) each."""
        return self.scale.at(share)

    def shown(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return values as drawn, those beyond the axis at its end; (n_value,) each."""
        return self.at(np.clip(self.share(values), 0.0, 1.0))


def areas(
    chart: Chart, across: Drawn, up: Drawn, marks: Sequence[Mark] = (), *, low: float = 1.0
) -> tuple[Area, ...]:
    """Return the regions, the worse levels on top, each level named once where it has most room.

    Args:
        chart: of a criterion.
        across: its axis across as it is drawn.
        up: its axis up.
        marks: on the chart, that words leave free.
        low: share of the height, from below, that words of a strip are in.
    """
    polygons = _polygons(chart, across, up)
    found = [
        Area(_GROUNDS[level], across.at(corners[:, 0]), up.at(corners[:, 1]))
        for level, corners in polygons
    ]
    strip = chart.up is None
    taken = [across.scale.share(mark.x) + 1j * up.scale.share(mark.y) for mark in marks]
    places = _words(polygons, np.concatenate([np.zeros(0, dtype=complex), *taken]), strip)
    if strip:
        places = {level: (x, 0.5 * low) for level, (x, _) in places.items()}
    for level, (x, y) in places.items():
        place = (float(across.at(np.array(x))), float(up.at(np.array(y))))
        found.append(Area(_GROUNDS[level], np.zeros(0), np.zeros(0), f"Level {level}", place))
    return tuple(found)


def borders(chart: Chart, across: Drawn, up: Drawn) -> list[Mark]:
    """Return the edges of regions that have another level on their other side."""
    polygons = _polygons(chart, across, up)
    marks = []
    for _, corners in polygons:
        for a, b in zip(corners, np.roll(corners, -1, axis=0)):
            along = b - a
            length = float(np.hypot(*along))
            if length == 0.0:
                continue
            shares = np.linspace(0.0, 1.0, _PIECES + 1)
            centres = a + (0.5 * (shares[1:] + shares[:-1]))[:, None] * along
            beside = _BESIDE * np.array([-along[1], along[0]]) / length
            left, right = (_levels(polygons, centres + sign * beside) for sign in (1.0, -1.0))
            differs = (left != right) & (left > 0) & (right > 0)
            if differs.any():
                edge = a + shares[:, None] * along
                ends = np.flatnonzero(np.diff(np.r_[False, differs, False].astype(np.int8)))
                for start, stop in zip(ends[::2], ends[1::2]):
                    x, y = edge[[start, stop]].T
                    marks.append(Mark("line", "truth", across.at(x), up.at(y), width=0.7))
    return marks


def _polygons(chart: Chart, across: Drawn, up: Drawn) -> list[tuple[int, NDArray[np.float64]]]:
    """Return level and corners, (n_corner, 2) shares of the frame, of each region in sight."""
    found = []
    for region in sorted(chart.regions, key=lambda one: one.level):
        corners = np.stack([across.share(region.across), up.share(region.up)], axis=-1)
        corners = clipped_polygon(corners)
        if len(corners) > 2:
            found.append((region.level, corners))
    return found


def _levels(
    polygons: list[tuple[int, NDArray[np.float64]]], places: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Return the level of places, (n_place, 2); 0 outside of all regions."""
    found = np.zeros(len(places), dtype=np.int64)
    for level, corners in polygons:
        found[inside(corners, places)] = level
    return found


def _words(
    polygons: list[tuple[int, NDArray[np.float64]]], taken: NDArray[np.complex128], strip: bool
) -> dict[int, tuple[float, float]]:
    """Return where in each level a word has most room, as shares of the frame; where it has any.

    Places that are taken, (n_place,), are x + i y; on a strip they are above the words.
    """
    centres = (np.arange(_GRID) + 0.5) / _GRID
    places = np.stack(np.meshgrid(centres, centres), axis=-1).reshape(-1, 2)
    level = _levels(polygons, places).reshape(_GRID, _GRID)
    if not strip:
        there = np.floor(np.stack([taken.imag, taken.real]) * _GRID)
        row, column = there[:, np.isfinite(taken)].astype(np.int64).clip(0, _GRID - 1)
        level[row, column] = 0
    found = {}
    for one in np.unique(level[level > 0]):
        around = np.pad(level == one, 1)
        room = np.asarray(distance_transform_edt(around, sampling=(1.0, 1.0 / _WIDE)))[1:-1, 1:-1]
        row, column = np.unravel_index(int(np.argmax(room)), room.shape)
        if room[row, column] >= _ROOM:
            found[int(one)] = (float(centres[column]), float(centres[row]))
    return found
