"""Drawn shapes as triangle meshes: canopies, blades, plates, tubes, and their paint.

Used by the `build.py` of each vehicle. In the vehicle's axes (x forward, y left, z up) and metres,
except blades (radius along x, leading edge -y).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator


class Shape(NamedTuple):
    """A triangle mesh with its normals."""

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray

    def cut(self, field: Callable) -> list["Shape"]:
        """The parts where the field is positive and negative, cut along its zero line."""
        value = field(self.vertices)
        vertices, normals = list(self.vertices), list(self.normals)
        middles, sides = {}, ([], [])

        def middle(i, j):
            key = (min(i, j), max(i, j))
            if key not in middles:
                t = value[key[0]] / (value[key[0]] - value[key[1]])
                middles[key] = len(vertices)
                for points in (vertices, normals):
                    points.append((1 - t) * points[key[0]] + t * points[key[1]])
            return middles[key]

        for face in self.faces:
            above = value[face] > 0
            if above.all() or not above.any():
                sides[0 if above.all() else 1].append(tuple(face))
                continue
            lone = above.sum() == 1  # whether the corner that stands alone is above
            k = int(np.flatnonzero(above == lone)[0])
            i, j, m = face[k], face[(k + 1) % 3], face[(k + 2) % 3]
            a, b = middle(i, j), middle(i, m)
            sides[0 if lone else 1].append((i, a, b))
            sides[1 if lone else 0].extend([(a, j, m), (a, m, b)])
        return [Shape(np.array(vertices), np.array(s), np.array(normals)) for s in sides]

    def within(self, *fields: Callable) -> list["Shape"]:
        """The parts where all fields are positive, and the rest; their corners stay sharp."""
        inside, rest = self, []
        for field in fields:
            inside, outside = inside.cut(field)
            rest.append(outside)
        starts = np.cumsum([0, *(len(part.vertices) for part in rest)])
        faces = [part.faces.reshape(-1, 3) + start for part, start in zip(rest, starts)]
        vertices, _, normals = zip(*rest)
        return [inside, Shape(*map(np.concatenate, (vertices, faces, normals)))]

    def write(self, path: Path) -> None:
        """Write the mesh as a smooth Wavefront .obj, to 10 micrometres."""
        a, b, c = np.moveaxis(self.vertices[self.faces], 1, 0)
        faces = self.faces[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-12]
        used, index = np.unique(faces, return_inverse=True)
        lines = [f"# made by models/{path.parts[-3]}/build.py meshes"]
        lines += ["v {:.5f} {:.5f} {:.5f}".format(*v) for v in self.vertices[used]]
        lines += ["vn {:.3f} {:.3f} {:.3f}".format(*n) for n in self.normals[used]]
        lines += ["f " + " ".join(f"{k}//{k}" for k in f) for f in index.reshape(-1, 3) + 1]
        path.write_text("\n".join(lines) + "\n")


def smooth(vertices: np.ndarray, faces: np.ndarray) -> Shape:
    """A mesh with area-weighted normals, so that it shades as one when cut into regions."""
    corner = vertices[faces]
    face = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normals = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(normals, faces[:, k], face)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    unit = np.divide(normals, length, out=np.zeros_like(normals), where=length > 1e-15)
    return Shape(vertices, faces, unit)


def grid_faces(rows: int, columns: int) -> np.ndarray:
    """Two triangles a cell, in the order of the cells."""
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns - 1), indexing="ij")
    a = (i * columns + j).ravel()
    b, c, d = a + columns, a + columns + 1, a + 1
    return np.stack([np.stack([a, b, c], 1), np.stack([a, c, d], 1)], 1)


def outward(points: np.ndarray) -> np.ndarray:
    """Cells of a surface (station, arc, xyz), facing away from its axis."""
    cells, vertices = grid_faces(*points.shape[:2]), points.reshape(-1, 3)
    corner = vertices[cells.reshape(-1, 3)]
    face = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    away = corner.mean(axis=1) * [0.0, 1.0, 1.0]
    return cells if np.sum(face * away) > 0 else cells[..., ::-1]


@dataclass(frozen=True, eq=False)
class Canopy:
    """A shell, closed at the nose, that opens towards the rear, where the frame shows.

    Attributes:
        outline: (n, 5) distance from the nose (0) to the rear edge (1), half-width, roof, belly
            and height of the widest line, m.
        nose, rear: x of the two ends, m.
        power: of the superellipses that the sections are: 2 is round, less is creased.
        opening: share of the length ahead of the opening, and its half angle at the rear, rad.
        lean: how far the rear edge leans back at the roof and forward at the belly, m.
    """

    outline: np.ndarray
    nose: float
    rear: float
    power: float
    opening: tuple[float, float]
    lean: float

    def surface(self, stations: int, arc: int, inset: float = 0.0) -> np.ndarray:
        """Points (station, arc, xyz); inset draws the lining."""
        t = np.linspace(0.0, 1.0, stations)
        along = t**2  # fine at the round nose
        profile = PchipInterpolator(np.sqrt(self.outline[:, 0]), self.outline[:, 1:])
        width, roof, belly, waist = profile(t).T
        closed, angle = self.opening
        opening = np.pi - angle * np.clip((along - closed) / (1.0 - closed), 0.0, 1.0) ** 0.8
        angle = opening[:, None] * np.linspace(-1.0, 1.0, arc)
        y, z = np.sin(angle), np.cos(angle)
        y, z = (np.sign(v) * np.abs(v) ** (2 / self.power) for v in (y, z))
        height = np.where(z > 0, (roof - waist)[:, None], (waist - belly)[:, None])
        shrink = 1.0 - inset / 0.08
        points = np.empty((*angle.shape, 3))
        lean = self.lean * np.clip((along - 0.6) / 0.4, 0.0, 1.0)[:, None] ** 2
        points[..., 0] = (self.nose + (self.rear - self.nose) * along)[:, None]
        points[..., 0] -= lean * z
        points[..., 1] = width[:, None] * y * shrink
        points[..., 2] = waist[:, None] + height * z * shrink
        return points

    def shell(self, stations: int, arc: int) -> Shape:
        """The outside."""
        points = self.surface(stations, arc)
        return smooth(points.reshape(-1, 3), outward(points).reshape(-1, 3))

    def lining(self, stations: int, arc: int, *, inset: float) -> Shape:
        """The inside, as seen through the opening."""
        points = self.surface(stations, arc, inset)
        return smooth(points.reshape(-1, 3), outward(points).reshape(-1, 3)[:, ::-1])


def blade(
    radii: Sequence[float],
    chords: Sequence[float],
    thickness: float,
    regions: Mapping[str, tuple[float, float]],
) -> dict[str, Shape]:
    """A blade with a symmetric aerofoil, cut at given radii into regions."""
    s = np.linspace(0.0, 1.0, 17)
    x = 0.5 - 0.5 * np.cos(np.pi * s)
    naca = [0.0, -0.1260, -0.3516, 0.2843, -0.1036]  # four-digit section, closed trailing edge
    half = 5 * thickness * (0.2969 * np.sqrt(x) + np.polynomial.Polynomial(naca)(x))
    loop = np.concatenate([np.stack([x, half], 1)[::-1], np.stack([x, -half], 1)[1:]])
    edges = [r for pair in regions.values() for r in pair]
    stations = np.unique(np.concatenate([radii, edges]))
    chord = np.interp(stations, radii, chords)
    points = np.empty((len(stations), len(loop), 3))
    points[..., 0] = stations[:, None]
    points[..., 1] = chord[:, None] * (loop[:, 0] - 0.25)  # quarter chord on the feathering axis
    points[..., 2] = chord[:, None] * loop[:, 1]
    vertices = points.reshape(-1, 3)
    cells = outward(points)
    # Caps close the root and the tip.
    fan = np.arange(1, len(loop) - 1)
    root = np.stack([np.zeros_like(fan), fan, fan + 1], 1)
    tip = (root + (len(stations) - 1) * len(loop))[:, ::-1]
    corner = vertices[tip[0]]
    if np.cross(corner[1] - corner[0], corner[2] - corner[0])[0] < 0:
        root, tip = root[:, ::-1], tip[:, ::-1]
    whole = smooth(vertices, cells.reshape(-1, 3))
    middle = vertices[cells].mean(axis=(1, 2))[:, 0]
    parts = {}
    for region, (low, high) in regions.items():
        own = [cells[(middle > low) & (middle < high)].reshape(-1, 3)]
        own += [root] if low <= stations[0] else []
        own += [tip] if high >= stations[-1] else []
        parts[region] = whole._replace(faces=np.concatenate(own))
    return parts


def rounded(
    corners: Sequence[tuple[float, float]], cut: float, points: int = 5
) -> list[tuple[float, float]]:
    """A polygon whose corners are parabolas that begin and end at most a cut, m, from them."""
    out = []
    for k, corner in enumerate(np.array(corners)):
        edges = [np.subtract(corners[(k + step) % len(corners)], corner) for step in (-1, 1)]
        ends = [edge * min(cut / np.linalg.norm(edge), 0.45) for edge in edges]
        for s in np.linspace(0.0, 1.0, points):
            out.append(tuple(corner + (1.0 - s) ** 2 * ends[0] + s**2 * ends[1]))
    return out


def ears(points: np.ndarray, ring: Sequence[int]) -> np.ndarray:
    """Triangles of a simple polygon through points (n, 2), counter-clockwise, by ear clipping.

    Where a ring visits a point twice, two loops are joined there: a hole to what is around it.
    """

    def cross(o, a, b):
        return (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0])

    left, out = list(ring), []
    while len(left) > 3:
        for k in range(len(left)):
            i, j, m = left[k - 1], left[k], left[(k + 1) % len(left)]
            a, b, c = points[i], points[j], points[m]
            inside = any(
                min(cross(a, b, p), cross(b, c, p), cross(c, a, p)) >= 0
                for p in points[sorted({*left} - {i, j, m})]
            )
            if cross(a, b, c) > 0 and not inside:
                out.append((i, j, m))
                left.pop(k)
                break
        else:
            raise ValueError("the outline crosses itself, or a hole crosses it")
    return np.array([*out, tuple(left)])


def area(outline: np.ndarray) -> float:
    """Of a polygon (n, 2); positive if it runs counter-clockwise."""
    x, z = outline.T
    return 0.5 * float(np.sum(x * np.roll(z, -1) - np.roll(x, -1) * z))


def joined(points: np.ndarray, loops: Sequence[Sequence[int]]) -> list[int]:
    """One ring through an outline and the holes in it, each joined at its nearest point."""
    ring = list(loops[0])
    for hole in loops[1:]:
        gap = np.linalg.norm(points[ring][:, None] - points[list(hole)], axis=-1)
        i, j = np.unravel_index(gap.argmin(), gap.shape)
        ring[i:i] = [ring[i], *hole[j:], *hole[: j + 1]]
    return ring


def plate(
    outline: Sequence[tuple[float, float]],
    thickness: float,
    holes: Sequence[Sequence[tuple[float, float]]] = (),
) -> Shape:
    """A flat plate in the x-z plane, from outlines (any sense of rotation)."""
    outlines = [np.array(loop, float) for loop in (outline, *holes)]
    # the outline counter-clockwise, holes clockwise: the plate is to the left of every edge
    outlines = [
        loop if (area(loop) > 0) == (k == 0) else loop[::-1] for k, loop in enumerate(outlines)
    ]
    flat = np.concatenate(outlines)
    starts = np.cumsum([0, *(len(loop) for loop in outlines)])
    loops = [list(range(low, high)) for low, high in pairwise(starts)]
    tri = ears(flat, joined(flat, loops))
    vertices, faces, normals = [], [], []
    for side in (1, -1):
        start = len(vertices)
        vertices += [(p[0], side * thickness / 2, p[1]) for p in flat]
        normals += [(0, side, 0)] * len(flat)
        faces += [tuple(start + k for k in (t[::-1] if side > 0 else t)) for t in tri]
    for i, j in ((i, j) for loop in loops for i, j in zip(loop, loop[1:] + loop[:1])):
        a, b = flat[i], flat[j]
        normal = np.array([(b - a)[1], 0.0, -(b - a)[0]]) / np.linalg.norm(b - a)
        start = len(vertices)
        vertices += [(p[0], y, p[1]) for p in (a, b) for y in (-thickness / 2, thickness / 2)]
        normals += [tuple(normal)] * 4
        faces += [(start, start + 2, start + 1), (start + 1, start + 2, start + 3)]
    vertices, faces, normals = np.array(vertices), np.array(faces), np.array(normals, float)
    corner = vertices[faces]
    across = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    wrong = np.sum(across * normals[faces].mean(axis=1), axis=1) < 0
    faces[wrong] = faces[wrong][:, ::-1]
    return Shape(vertices, faces, normals)


def tube(
    knots: Sequence[Sequence[float]],
    up: tuple[float, float, float],
    *,
    along: int = 21,
    around: int = 14,
) -> Shape:
    """A smooth rod with round ends through knots.

    Args:
        knots: rows x, y, z of the axis and half-width, half-height of the elliptic section, m.
        up: the direction of the height, never along the axis.
        along: points from end to end.
        around: points of a section.
    """
    knots = np.array(knots, float)
    way = np.cumsum([0.0, *np.linalg.norm(np.diff(knots[:, :3], axis=0), axis=1)])
    s = np.linspace(0.0, way[-1], along)
    axis = CubicSpline(way, knots[:, :3])
    half = PchipInterpolator(way, knots[:, 3:])(s)
    tangent = axis(s, 1)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    side = np.cross(up, tangent)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    centre, over = axis(s), np.cross(tangent, side)
    # Each end is half an ellipsoid: rings that shrink as they go out, to a point.
    turn = np.linspace(0.0, 0.5 * np.pi, 6)[1:]
    shrink = np.concatenate([np.cos(turn)[::-1], np.ones(along), np.cos(turn)])[:, None, None]
    out = np.concatenate([-np.sin(turn)[::-1], np.zeros(along), np.sin(turn)])[:, None]
    ring = np.clip(np.arange(-len(turn), along + len(turn)), 0, along - 1)
    phi = np.linspace(0.0, 2.0 * np.pi, around)[:, None]
    centre = centre[ring] + out * half[ring].min(axis=1, keepdims=True) * tangent[ring]
    section = np.cos(phi) * (half[:, :1] * side)[ring][:, None]
    section = section + np.sin(phi) * (half[:, 1:] * over)[ring][:, None]
    points = centre[:, None] + shrink * section
    return smooth_loop(points)


def smooth_loop(points: np.ndarray) -> Shape:
    """A closed surface from rings (ring, around, xyz) whose last point is their first."""
    faces = grid_faces(*points.shape[:2]).reshape(-1, 3)
    row, column = np.divmod(faces, points.shape[1])
    faces = row * (points.shape[1] - 1) + column % (points.shape[1] - 1)
    return smooth(points[:, :-1].reshape(-1, 3), faces[:, ::-1])
