"""Polygons and lines as far as they lie in a frame, corners at infinity included."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]

_FAR = 1e4
"""Frames that a corner at infinity is away: far enough that no edge to it is seen to be slanted."""


def clipped_polygon(corners: Points) -> Points:
    """Return a polygon within the unit square, by the method of Sutherland and Hodgman.

    Args:
        corners: (n_corner, 2), infinity included.

    Returns:
        (m_corner, 2), none where all of it is outside.
    """
    kept = np.clip(corners, -_FAR, _FAR)
    for axis, bound, sign in ((0, 0.0, 1.0), (0, 1.0, -1.0), (1, 0.0, 1.0), (1, 1.0, -1.0)):
        kept = _half(kept, sign * (kept[:, axis] - bound))
    return kept


def clipped_line(points: Points) -> Points:
    """Return the pieces of a line within the unit square, with a NaN between two that lie apart.

    Args:
        points: (n_point, 2), infinity included.

    Returns:
        (m_point, 2).
    """
    points = np.clip(points, -_FAR, _FAR)
    pieces: list[Points] = []
    for start, end in pairwise(points):
        inside = _within(start, end)
        if inside is None:
            continue
        if pieces and not np.array_equal(pieces[-1][-1], inside[0]):
            pieces.append(np.full((1, 2), np.nan))
        pieces.append(inside)
    return np.concatenate(pieces) if pieces else np.zeros((0, 2))


def inside(polygon: Points, places: Points) -> NDArray[np.bool_]:
    """Return which places are in a polygon: a ray from them crosses its border oddly.

    Args:
        polygon: corners, (n_corner, 2).
        places: (n_place, 2).
    """
    crossed = np.zeros(len(places), dtype=np.int64)
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0)):
        if a[1] != b[1]:
            spans = (a[1] > places[:, 1]) != (b[1] > places[:, 1])
            slope = (b[0] - a[0]) / (b[1] - a[1])
            crossed += spans & (places[:, 0] < a[0] + (places[:, 1] - a[1]) * slope)
    return crossed % 2 == 1


def _half(corners: Points, depth: NDArray[np.float64]) -> Points:
    """Return the part of a polygon where a depth, (n_corner,), linear in place, isn't negative."""
    kept: list[Points] = []
    for k in range(len(corners)):
        before = k - 1
        if (depth[before] >= 0.0) != (depth[k] >= 0.0):
            share = depth[before] / (depth[before] - depth[k])
            kept.append(corners[before] + share * (corners[k] - corners[before]))
        if depth[k] >= 0.0:
            kept.append(corners[k])
    return np.array(kept).reshape(-1, 2)


def _within(start: Points, end: Points) -> Points | None:
    """Return both ends of a piece in the unit square, (2, 2), by Liang and Barsky; None outside."""
    low, high = 0.0, 1.0
    for origin, step in zip(start, end - start):
        if step == 0.0:
            if not 0.0 <= origin <= 1.0:
                return None
            continue
        first, last = sorted((-origin / step, (1.0 - origin) / step))
        low, high = max(low, first), min(high, last)
    if low >= high:
        return None
    ends = np.array([low, high])[:, None]
    exact = np.array([start, end])
    inside = start + ends * (end - start)
    return np.where(ends == np.array([[0.0], [1.0]]), exact, inside)
