"""Polygons of levels for the standard charts."""

import numpy as np
from numpy.typing import NDArray

from helisim.handling.chart import Chart, ChartAxis, ChartLine, Level, Region
from helisim.handling.criteria.limit import Border, Limit

FAR = np.inf
Real = NDArray[np.float64]


def strip(title: str, axis: ChartAxis, limit: Limit, source: str) -> Chart:
    """Return the chart of one figure."""
    one, two, far = limit.level1, limit.level2, FAR if limit.more_is_better else -FAR
    regions = (_bar(1, one, far), _bar(2, two, one), _bar(3, -far, two))
    return Chart(title, axis, None, regions, source=source)


def everywhere(level: Level) -> Region:
    """Return the whole chart; another region on it holds where it is worse."""
    return _box(level, -FAR, FAR, -FAR, FAR)


def _bar(level: Level, low: float, high: float) -> Region:
    return Region(level, np.array([low, high, high, low]), np.array([0.0, 0.0, 1.0, 1.0]))


def corner(title: str, across: ChartAxis, up: ChartAxis, x: Limit, y: Limit, source: str) -> Chart:
    """Return the chart of two figures with a limit each: both must be met."""
    xs, ys = _ends(x), _ends(y)
    regions = (
        _box(1, xs[2], xs[3], ys[2], ys[3]),
        _box(2, xs[1], xs[2], ys[1], ys[3]),
        _box(2, xs[2], xs[3], ys[1], ys[2]),
        _box(3, xs[0], xs[1], ys[0], ys[3]),
        _box(3, xs[1], xs[3], ys[0], ys[1]),
    )
    return Chart(title, across, up, regions, source=source)


def _ends(limit: Limit) -> tuple[float, float, float, float]:
    """Return worst, border of Level 2, border of Level 1, best."""
    far = FAR if limit.more_is_better else -FAR
    return -far, limit.level2, limit.level1, far


def _box(level: Level, x0: float, x1: float, y0: float, y1: float) -> Region:
    return Region(level, np.array([x0, x1, x1, x0]), np.array([y0, y0, y1, y1]))


def above(title: str, across: ChartAxis, up: ChartAxis, border: Border, source: str) -> Chart:
    """Return the chart of a figure, up, that is limited along another, across."""
    (x1, y1), (x2, y2) = border.line(1), border.line(2)
    regions = (
        _between(1, x1, y1, FAR),
        Region(2, np.concatenate([x2, x1[::-1]]), np.concatenate([y2, y1[::-1]])),
        _between(3, x2, y2, -FAR),
    )
    lines = (ChartLine(x1, y1), ChartLine(x2, y2))
    return Chart(title, across, up, regions, lines, source)


def _between(level: Level, x: Real, y: Real, far: float) -> Region:
    """Return what lies between a line and infinity, up or down."""
    across = np.concatenate([x, [x[-1], x[0]]])
    return Region(level, across, np.concatenate([y, [far, far]]))
