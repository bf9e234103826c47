"""The Lynx's shapes and weight. What to run it with: see models/building.py."""

import sys
from pathlib import Path

import numpy as np
from scipy.interpolate import PchipInterpolator

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from building import View, build
from shapes import Shape, blade, plate, rounded, smooth_loop, tube

FOLDER = Path(__file__).resolve().parent
TOTAL_MASS_KG = 4313.7  # Padfield, see README.md
VIEW = View(lookat=(-2.0, 0.0, -0.15), distance=14.0, azimuth=-136, elevation=-9, height=3.2)

# Drawn by eye after photographs of the type: x, half width, roof, belly, power of the section.
CABIN = np.array(
    [
        [3.86, 0.02, -0.34, -0.38, 2.0],
        [3.78, 0.20, -0.20, -0.56, 2.1],
        [3.55, 0.42, -0.04, -0.76, 2.3],
        [3.10, 0.66, 0.16, -0.96, 2.5],
        [2.60, 0.80, 0.42, -1.06, 2.6],
        [2.10, 0.87, 0.62, -1.10, 2.8],
        [1.40, 0.90, 0.70, -1.11, 3.0],
        [0.40, 0.90, 0.71, -1.11, 3.2],
        [-0.80, 0.90, 0.70, -1.10, 3.2],
        [-1.70, 0.84, 0.66, -0.98, 3.0],
        [-2.50, 0.66, 0.58, -0.68, 2.6],
        [-3.20, 0.46, 0.52, -0.32, 2.3],
        [-4.60, 0.33, 0.48, -0.10, 2.1],
        [-6.20, 0.26, 0.46, 0.03, 2.0],
        [-7.00, 0.20, 0.46, 0.10, 2.0],
        [-7.20, 0.02, 0.32, 0.26, 2.0],
    ]
)
COWL = np.array(
    [
        [1.20, 0.04, 0.76, 0.70, 2.0],
        [1.00, 0.30, 0.88, 0.62, 2.2],
        [0.55, 0.46, 1.00, 0.60, 2.4],
        [0.10, 0.54, 1.04, 0.58, 2.6],
        [-0.50, 0.60, 1.02, 0.56, 2.8],
        [-1.30, 0.62, 0.98, 0.54, 2.8],
        [-2.00, 0.56, 0.90, 0.50, 2.6],
        [-2.60, 0.30, 0.72, 0.48, 2.2],
        [-3.00, 0.04, 0.56, 0.50, 2.0],
    ]
)


def hull(stations: np.ndarray, along: int, around: int) -> Shape:
    """A closed body from superelliptic sections, between the stations a smooth curve."""
    x = stations[0, 0] + (stations[-1, 0] - stations[0, 0]) * _closer_at_ends(along)
    width, roof, belly, power = PchipInterpolator(-stations[:, 0], stations[:, 1:])(-x).T
    angle = np.linspace(0.0, 2.0 * np.pi, around)
    y, z = np.sin(angle)[None], np.cos(angle)[None]
    y, z = (np.sign(v) * np.abs(v) ** (2.0 / power[:, None]) for v in (y, z))
    points = np.empty((along, around, 3))
    points[..., 0] = x[:, None]
    points[..., 1] = width[:, None] * y
    points[..., 2] = (0.5 * (roof + belly))[:, None] + (0.5 * (roof - belly))[:, None] * z
    return smooth_loop(np.concatenate([points[:1].mean(1, keepdims=True) + 0 * points[:1], points]))


def _closer_at_ends(count: int) -> np.ndarray:
    t = np.linspace(0.0, 1.0, count)
    return t - 0.1 * np.sin(2.0 * np.pi * t)


# The paint scheme as signed distances: a colour is where its field is positive.
def windscreen():
    """The glass of the cockpit, from the nose's top to the roof and round to the doors."""
    return (
        lambda p: p[:, 0] - 2.30,
        lambda p: p[:, 2] + 0.02 + 0.26 * (p[:, 0] - 2.3),
        lambda p: 3.52 - p[:, 0],
        lambda p: np.abs(p[:, 1]) - 0.035,
    )


def cockpit_door():
    """The side window of the cockpit's door."""
    return (
        lambda p: 2.20 - p[:, 0],
        lambda p: p[:, 0] - 1.55,
        lambda p: p[:, 2] + 0.10,
        lambda p: 0.50 - p[:, 2],
    )


def cabin_window():
    """The large window of the sliding door."""
    return (
        lambda p: 0.95 - p[:, 0],
        lambda p: p[:, 0] + 0.35,
        lambda p: p[:, 2] + 0.05,
        lambda p: 0.48 - p[:, 2],
    )


def fuselage() -> dict[str, Shape]:
    """The painted body and the engines' cowling."""
    body = hull(CABIN, 66, 65)
    glass, body = body.within(*windscreen())
    door, body = body.within(*cockpit_door())
    window, body = body.within(*cabin_window())
    dark, body = body.cut(lambda p: -0.62 + 0.10 * np.sin(1.1 * p[:, 0]) - p[:, 2])
    band, body = body.cut(lambda p: 0.10 - np.abs(p[:, 0] + 5.4 + 0.5 * p[:, 2]))
    return {
        "body_base": body,
        "body_lower": dark,
        "body_band": band,
        "windscreen": glass,
        "door_window": door,
        "cabin_window": window,
        "cowl": hull(COWL, 30, 41),
    }


def fin() -> Shape:
    """The swept tail pylon, of the 1.107 m^2 of parameters.toml above the boom."""
    outline = [
        (-6.55, 0.30),
        (-7.15, 0.55),
        (-7.45, 1.25),
        (-7.98, 1.25),
        (-7.88, 0.60),
        (-7.62, 0.05),
        (-7.15, 0.02),
    ]
    return plate(rounded(outline, 0.10), 0.14)


def tailplane() -> Shape:
    """The half tailplane on the right of the pylon's top, drawn upright; the MJCF lays it down."""
    outline = [(-7.30, 0.0), (-7.42, 1.75), (-7.98, 1.75), (-8.05, 0.0)]
    return plate(rounded(outline, 0.08, 4), 0.07)


def gear() -> dict[str, Shape]:
    """A strut bent from skid to skid, and a skid with its toe."""
    half = [(0.0, 0.0, -1.10), (0.0, 0.60, -1.14), (0.0, 0.92, -1.38), (0.0, 1.01, -1.62)]
    left = [(*p, 0.05, 0.04) for p in half]
    right = [(x, -y, *rest) for x, y, *rest in left[:0:-1]]
    toe = [(1.95, 0.0, 0.0), (2.25, 0.0, 0.02), (2.50, 0.0, 0.12), (2.66, 0.0, 0.30)]
    return {
        "strut": tube([*right, *left], (1.0, 0.0, 0.0)),
        "skid_toe": tube([(*p, 0.05, 0.05) for p in toe], (0.0, 1.0, 0.0)),
    }


def shapes() -> dict[str, Shape]:
    """Every mesh of lynx.xml."""
    main = blade(
        [1.05, 1.20, 1.55, 6.15, 6.32, 6.39, 6.40],
        [0.20, 0.24, 0.391, 0.391, 0.36, 0.30, 0.25],
        0.12,
        {"inner": (1.05, 5.70), "tip": (5.70, 6.40)},
    )
    tail = blade(
        [0.22, 0.27, 0.36, 1.06, 1.095, 1.106],
        [0.09, 0.11, 0.18, 0.18, 0.16, 0.12],
        0.12,
        {"inner": (0.22, 0.86), "tip": (0.86, 1.106)},
    )
    arm = [(0.16, 0.10, 0.05), (0.50, 0.08, 0.05), (0.85, 0.075, 0.06), (1.12, 0.11, 0.05)]
    return {
        **fuselage(),
        **gear(),
        **{f"blade_{region}": part for region, part in main.items()},
        **{f"tail_blade_{region}": part for region, part in tail.items()},
        "arm": tube([(x, 0.0, 0.0, *half) for x, *half in arm], (0.0, 0.0, 1.0), along=9),
        "fin": fin(),
        "tailplane": tailplane(),
    }


if __name__ == "__main__":
    build(FOLDER, total_mass_kg=TOTAL_MASS_KG, shapes=shapes, view=VIEW)
