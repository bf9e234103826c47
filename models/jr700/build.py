"""Rebuild what in this folder is computed, and print what it adds up to.

Run it as `python models/jr700/build.py` with one of

- `parts`: print mass, position and inertia part by part, and the totals;
- `close`: rewrite the fuselage's inertial element in jr700.xml, so that the totals are those of
  parameters.toml and calibrated.toml;
- `meshes`: write the drawn shapes to assets/;
- `picture`: render jr700.png (headless: MUJOCO_GL=egl or osmesa).
"""

import sys
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
from scipy.interpolate import PchipInterpolator

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from balance import Balance

FOLDER = Path(__file__).resolve().parent
ASSETS = FOLDER / "assets"

TOTAL_MASS_KG = 8.01  # paper, Table 1


def balance():
    """What models/balance.py does for this vehicle."""
    return Balance(FOLDER, total_mass_kg=TOTAL_MASS_KG)


# Shapes. All in the vehicle's axes and metres, except blades (radius along x, leading edge -y).

# Canopy outline against the distance from the nose (0) to the rear edge (1): half-width, roof,
# belly, and the height of the widest line. Drawn by eye after flybarless 700-class canopies.
CANOPY_NOSE_M, CANOPY_REAR_M = 0.400, -0.085
CANOPY = np.array(
    [
        # along, width,  roof,  belly, waist
        [0.00, 0.000, -0.040, -0.040, -0.040],
        [0.03, 0.026, -0.016, -0.062, -0.039],
        [0.10, 0.047, 0.006, -0.080, -0.036],
        [0.25, 0.072, 0.044, -0.098, -0.028],
        [0.45, 0.091, 0.104, -0.104, -0.012],
        [0.62, 0.096, 0.150, -0.098, 0.000],
        [0.75, 0.093, 0.168, -0.085, 0.010],
        [0.90, 0.080, 0.168, -0.065, 0.020],
        [1.00, 0.066, 0.158, -0.050, 0.028],
    ]
)
CANOPY_CELLS, LINING_CELLS = (41, 57), (23, 37)  # points along, around


def canopy_surface(stations, arc, inset=0.0):
    """Points (station, arc, xyz) of the canopy; inset draws the lining."""
    t = np.linspace(0.0, 1.0, stations)
    along = t**2  # fine at the round nose
    width, roof, belly, waist = PchipInterpolator(np.sqrt(CANOPY[:, 0]), CANOPY[:, 1:])(t).T
    # The shell is closed at the nose and opens towards the rear, where the frame shows.
    opening = np.pi - 1.15 * np.clip((along - 0.42) / 0.58, 0.0, 1.0) ** 0.8
    angle = opening[:, None] * np.linspace(-1.0, 1.0, arc)
    y, z = np.sin(angle), np.cos(angle)
    y, z = (np.sign(v) * np.abs(v) ** (2 / 2.4) for v in (y, z))
    height = np.where(z > 0, (roof - waist)[:, None], (waist - belly)[:, None])
    shrink = 1.0 - inset / 0.08
    points = np.empty((*angle.shape, 3))
    # The rear edge leans back at the roof.
    lean = 0.035 * np.clip((along - 0.6) / 0.4, 0.0, 1.0)[:, None] ** 2
    points[..., 0] = (CANOPY_NOSE_M + (CANOPY_REAR_M - CANOPY_NOSE_M) * along)[:, None]
    points[..., 0] -= lean * z
    points[..., 1] = width[:, None] * y * shrink
    points[..., 2] = waist[:, None] + height * z * shrink
    return points


# The paint scheme as signed distances: a colour is where its field is positive.
def below_stripe(p):
    """The lower hull, under a line that sweeps up to the rear."""
    return below_upper_edge(p) - 0.016


def below_upper_edge(p):
    """Stripe and lower hull."""
    back = CANOPY_NOSE_M - p[:, 0]
    return -0.026 + 0.13 * back + 0.35 * np.clip(back - 0.22, 0.0, None) ** 2 - p[:, 2]


def visor(p):
    """The windscreen: above a line falling to the nose, behind one arc and ahead of another."""
    x, y, z = p.T
    rear = x - (0.150 + 5.0 * y**2)
    front = 0.345 - 6.0 * y**2 - x
    sill = z - (0.008 + 0.09 * (0.345 - x))
    return np.minimum(np.minimum(rear, front), sill)


def grid_faces(rows, columns):
    """Two triangles a cell, in the order of the cells."""
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns - 1), indexing="ij")
    a = (i * columns + j).ravel()
    b, c, d = a + columns, a + columns + 1, a + 1
    return np.stack([np.stack([a, b, c], 1), np.stack([a, c, d], 1)], 1)


class Shape(NamedTuple):
    """A triangle mesh with its normals."""

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray

    def cut(self, field):
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


def vertex_normals(vertices, faces):
    """Area-weighted, so that a shape cut into regions shades as one."""
    corner = vertices[faces]
    face = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normals = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(normals, faces[:, k], face)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.divide(normals, length, out=np.zeros_like(normals), where=length > 1e-15)


def write_obj(name, vertices, faces, normals):
    """Write one smooth mesh."""
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    faces = faces[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-12]
    used, index = np.unique(faces, return_inverse=True)
    lines = ["# made by models/jr700/build.py meshes"]
    lines += ["v {:.5f} {:.5f} {:.5f}".format(*v) for v in vertices[used]]
    lines += ["vn {:.3f} {:.3f} {:.3f}".format(*n) for n in normals[used]]
    lines += ["f " + " ".join(f"{k}//{k}" for k in f) for f in index.reshape(-1, 3) + 1]
    (ASSETS / f"{name}.obj").write_text("\n".join(lines) + "\n")


def canopy():
    """Write the painted shell and its lining."""
    outer = canopy_surface(*CANOPY_CELLS)
    vertices, cells = outer.reshape(-1, 3), outward(outer)
    normals = vertex_normals(vertices, cells.reshape(-1, 3))
    shape = Shape(vertices, cells.reshape(-1, 3), normals)
    hull, upper = shape.cut(below_upper_edge)
    hull, stripe = hull.cut(below_stripe)
    glass, base = upper.cut(visor)
    for colour, part in {"lower": hull, "stripe": stripe, "visor": glass, "base": base}.items():
        write_obj(f"canopy_{colour}", part.vertices, part.faces, part.normals)
    lining = canopy_surface(*LINING_CELLS, inset=0.002)
    inward = outward(lining).reshape(-1, 3)[:, ::-1]
    vertices = lining.reshape(-1, 3)
    write_obj("canopy_lining", vertices, inward, vertex_normals(vertices, inward))


def outward(points):
    """Cells of a surface (station, arc, xyz), facing away from its axis."""
    cells, vertices = grid_faces(*points.shape[:2]), points.reshape(-1, 3)
    corner = vertices[cells.reshape(-1, 3)]
    face = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    away = corner.mean(axis=1) * [0.0, 1.0, 1.0]
    return cells if np.sum(face * away) > 0 else cells[..., ::-1]


def blade(name, radii, chords, thickness, regions):
    """Write a blade with a symmetric aerofoil, cut at given radii into regions."""
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
    normals = vertex_normals(vertices, cells.reshape(-1, 3))
    middle = vertices[cells].mean(axis=(1, 2))[:, 0]
    for region, (low, high) in regions.items():
        own = [cells[(middle > low) & (middle < high)].reshape(-1, 3)]
        own += [root] if low <= stations[0] else []
        own += [tip] if high >= stations[-1] else []
        write_obj(f"{name}_{region}", vertices, np.concatenate(own), normals)


def ears(outline):
    """Triangles of a simple polygon, by ear clipping."""

    def cross(o, a, b):
        return (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0])

    left, out = list(range(len(outline))), []
    while len(left) > 3:
        for k in range(len(left)):
            i, j, m = left[k - 1], left[k], left[(k + 1) % len(left)]
            a, b, c = outline[i], outline[j], outline[m]
            inside = any(
                min(cross(a, b, p), cross(b, c, p), cross(c, a, p)) >= 0
                for n, p in enumerate(outline)
                if n in left and n not in (i, j, m)
            )
            if cross(a, b, c) > 0 and not inside:
                out.append((i, j, m))
                left.pop(k)
                break
        else:
            raise ValueError("the outline crosses itself or runs clockwise")
    return np.array([*out, tuple(left)])


def plate(name, outline, thickness):
    """Write a flat plate in the x-z plane, from its outline (any sense of rotation)."""
    outline = np.array(outline, float)
    x, z = outline.T
    if np.sum(x * np.roll(z, -1) - np.roll(x, -1) * z) < 0:
        outline = outline[::-1]
    tri, n = ears(outline), len(outline)
    vertices, faces, normals = [], [], []
    for side in (1, -1):
        start = len(vertices)
        vertices += [(p[0], side * thickness / 2, p[1]) for p in outline]
        normals += [(0, side, 0)] * n
        faces += [tuple(start + k for k in (t[::-1] if side > 0 else t)) for t in tri]
    for k in range(n):
        a, b = outline[k], outline[(k + 1) % n]
        normal = np.array([(b - a)[1], 0.0, -(b - a)[0]]) / np.linalg.norm(b - a)
        start = len(vertices)
        vertices += [(p[0], y, p[1]) for p in (a, b) for y in (-thickness / 2, thickness / 2)]
        normals += [tuple(normal)] * 4
        faces += [(start, start + 2, start + 1), (start + 1, start + 2, start + 3)]
    vertices, faces, normals = np.array(vertices), np.array(faces), np.array(normals, float)
    corner = vertices[faces]
    wrong = (
        np.sum(
            np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
            * normals[faces].mean(axis=1),
            axis=1,
        )
        < 0
    )
    faces[wrong] = faces[wrong][:, ::-1]
    write_obj(name, vertices, faces, normals)


def meshes():
    """Write every mesh of jr700.xml."""
    ASSETS.mkdir(exist_ok=True)
    canopy()
    blade(
        "blade",
        [0.100, 0.110, 0.170, 0.745, 0.757, 0.764, 0.767],
        [0.034, 0.036, 0.065, 0.065, 0.061, 0.050, 0.030],
        0.12,
        {"inner": (0.100, 0.640), "band": (0.640, 0.700), "tip": (0.700, 0.767)},
    )
    blade(
        "tail_blade",
        [0.026, 0.032, 0.045, 0.128, 0.134, 0.137],
        [0.016, 0.018, 0.029, 0.029, 0.025, 0.014],
        0.12,
        {"inner": (0.026, 0.110), "tip": (0.110, 0.137)},
    )
    plate(
        "frame_side",
        [
            (-0.150, 0.028),
            (-0.150, -0.028),
            (-0.105, -0.034),
            (-0.075, -0.092),
            (0.175, -0.092),
            (0.235, -0.062),
            (0.235, -0.044),
            (0.165, -0.030),
            (0.110, 0.010),
            (0.078, 0.060),
            (0.070, 0.128),
            (-0.060, 0.128),
            (-0.072, 0.060),
            (-0.105, 0.034),
        ],
        0.003,
    )
    plate(
        "tail_fin",
        [
            (-0.868, 0.020),
            (-0.868, -0.020),
            (-0.905, -0.168),
            (-0.917, -0.176),
            (-0.928, -0.172),
            (-0.927, -0.080),
            (-0.932, -0.020),
            (-0.932, 0.018),
            (-0.927, 0.066),
            (-0.920, 0.072),
            (-0.912, 0.067),
        ],
        0.003,
    )


def render(model, lookat, distance, azimuth, elevation, size=(900, 1600), height=0.8):
    """One picture of the vehicle hovering low."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("hover").id)
    data.qpos[2] = height
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.lookat[:] = np.add(lookat, data.qpos[:3])
    camera.distance, camera.azimuth, camera.elevation = distance, azimuth, elevation
    with mujoco.Renderer(model, *size) as renderer:
        renderer.update_scene(data, camera)
        return renderer.render()


def picture():
    """Render jr700.png."""
    import matplotlib.image

    model = mujoco.MjModel.from_xml_path(str(FOLDER / "scene.xml"))
    pixels = render(model, (-0.08, 0.0, 0.0), 1.95, -142, -14)
    matplotlib.image.imsave(FOLDER / "jr700.png", pixels)


if __name__ == "__main__":
    jobs = {
        "parts": balance().print_parts,
        "close": balance().close,
        "meshes": meshes,
        "picture": picture,
    }
    if len(sys.argv) != 2 or sys.argv[1] not in jobs:
        sys.exit(__doc__)
    jobs[sys.argv[1]]()
