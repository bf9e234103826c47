"""The JR700's shapes and weight. What to run it with: see models/building.py."""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from building import View, build
from shapes import Canopy, Shape, blade, plate

FOLDER = Path(__file__).resolve().parent
TOTAL_MASS_KG = 8.01  # paper, Table 1
VIEW = View(lookat=(-0.08, 0.0, -0.08), distance=2.0, azimuth=-142, elevation=-14, height=0.75)

# Drawn by eye after flybarless 700-class canopies.
CANOPY = Canopy(
    outline=np.array(
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
    ),
    nose=0.400,
    rear=-0.085,
    power=2.4,
    opening=(0.42, 1.15),
    lean=0.035,
)


# The paint scheme as signed distances: a colour is where its field is positive.
def below_stripe(p):
    """The lower hull, under a line that sweeps up to the rear."""
    return below_upper_edge(p) - 0.016


def below_upper_edge(p):
    """Stripe and lower hull."""
    back = CANOPY.nose - p[:, 0]
    return -0.026 + 0.13 * back + 0.35 * np.clip(back - 0.22, 0.0, None) ** 2 - p[:, 2]


def visor(p):
    """The windscreen: above a line falling to the nose, behind one arc and ahead of another."""
    x, y, z = p.T
    rear = x - (0.150 + 5.0 * y**2)
    front = 0.345 - 6.0 * y**2 - x
    sill = z - (0.008 + 0.09 * (0.345 - x))
    return np.minimum(np.minimum(rear, front), sill)


def canopy() -> dict[str, Shape]:
    """The painted shell and its lining."""
    hull, upper = CANOPY.shell(41, 57).cut(below_upper_edge)
    lower, stripe = hull.cut(below_stripe)
    glass, base = upper.cut(visor)
    return {
        "canopy_lower": lower,
        "canopy_stripe": stripe,
        "canopy_visor": glass,
        "canopy_base": base,
        "canopy_lining": CANOPY.lining(23, 37, inset=0.002),
    }


def shapes() -> dict[str, Shape]:
    """Every mesh of jr700.xml."""
    main = blade(
        [0.100, 0.110, 0.170, 0.745, 0.757, 0.764, 0.767],
        [0.034, 0.036, 0.065, 0.065, 0.061, 0.050, 0.030],
        0.12,
        {"inner": (0.100, 0.640), "band": (0.640, 0.700), "tip": (0.700, 0.767)},
    )
    tail = blade(
        [0.026, 0.032, 0.045, 0.128, 0.134, 0.137],
        [0.016, 0.018, 0.029, 0.029, 0.025, 0.014],
        0.12,
        {"inner": (0.026, 0.110), "tip": (0.110, 0.137)},
    )
    frame_side = plate(
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
    tail_fin = plate(
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
    return {
        **canopy(),
        **{f"blade_{region}": part for region, part in main.items()},
        **{f"tail_blade_{region}": part for region, part in tail.items()},
        "frame_side": frame_side,
        "tail_fin": tail_fin,
    }


if __name__ == "__main__":
    build(FOLDER, total_mass_kg=TOTAL_MASS_KG, shapes=shapes, view=VIEW)
