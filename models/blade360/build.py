"""The Blade 360's shapes and weight. What to run it with: see models/building.py."""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from building import View, build
from shapes import Canopy, Shape, blade, plate, rounded, tube

FOLDER = Path(__file__).resolve().parent
TOTAL_MASS_KG = 0.95  # chosen, see README.md
VIEW = View(lookat=(-0.07, 0.0, -0.03), distance=0.90, azimuth=-136, elevation=-12, height=0.26)

# Drawn by eye after flybarless 360-class canopies: a long wedge, cut away behind the mast.
CANOPY = Canopy(
    outline=np.array(
        [
            # along, width,  roof,  belly, waist
            [0.00, 0.000, -0.027, -0.027, -0.027],
            [0.02, 0.009, -0.018, -0.034, -0.026],
            [0.08, 0.018, -0.008, -0.041, -0.025],
            [0.20, 0.0275, 0.006, -0.047, -0.022],
            [0.35, 0.0345, 0.024, -0.051, -0.017],
            [0.52, 0.0395, 0.041, -0.053, -0.011],
            [0.68, 0.0415, 0.052, -0.051, -0.004],
            [0.80, 0.0405, 0.056, -0.047, 0.001],
            [0.92, 0.0365, 0.055, -0.040, 0.006],
            [1.00, 0.0320, 0.051, -0.033, 0.010],
        ]
    ),
    nose=0.178,
    rear=-0.046,
    power=1.9,
    opening=(0.45, 1.65),
    lean=0.030,
)


# The paint scheme as signed distances: a colour is where its field is positive.
def mast_slot():
    """The slot in the roof through which mast and links rise; nothing is there."""
    return (
        lambda p: p[:, 2] - 0.02,
        lambda p: 0.017 - np.hypot(np.clip(p[:, 0], 0.0, None), p[:, 1]),
    )


def lower_hull(p):
    """Below a line that is level under the nose and climbs to the rear edge."""
    back = CANOPY.nose - p[:, 0]
    return -0.030 + 0.02 * back + 0.55 * np.clip(back - 0.07, 0.0, None) ** 1.5 - p[:, 2]


def visor():
    """The windscreen: over the nose from side to side, its ends swept back to points."""
    return (
        lambda p: p[:, 0] - 0.078 + 1.5 * np.abs(p[:, 1]),
        lambda p: 0.146 - 9.0 * p[:, 1] ** 2 - p[:, 0],
        lambda p: p[:, 2] - (-0.010 + 0.20 * (0.146 - p[:, 0])),
    )


def bar(start, width):
    """One of the bars across the side behind the windscreen, raked like its ends."""
    return (
        lambda p: 0.9 * p[:, 2] - p[:, 0] + start,
        lambda p: p[:, 0] - 0.9 * p[:, 2] - start + width,
        lambda p: 0.046 - p[:, 2],
    )


def canopy() -> dict[str, Shape]:
    """The painted shell and its lining."""
    _, shell = CANOPY.shell(53, 69).within(*mast_slot())
    _, lining = CANOPY.lining(27, 37, inset=0.0018).within(*mast_slot())
    lower, base = shell.cut(lower_hull)
    glass, base = base.within(*visor())
    broad, base = base.within(*bar(-0.012, 0.011))
    narrow, base = base.within(*bar(-0.028, 0.005))
    return {
        "canopy_lower": lower,
        "canopy_visor": glass,
        "canopy_bar_1": broad,
        "canopy_bar_2": narrow,
        "canopy_base": base,
        "canopy_lining": lining,
    }


def frame_side() -> Shape:
    """One of the two carbon plates that carry everything."""
    outline = [
        (-0.066, 0.013),
        (-0.066, -0.015),
        (-0.052, -0.018),
        (-0.038, -0.046),
        (0.052, -0.046),
        (0.116, -0.041),
        (0.123, -0.035),
        (0.120, -0.029),
        (0.062, -0.026),
        (0.050, 0.002),
        (0.028, 0.034),
        (0.014, 0.050),
        (-0.020, 0.050),
        (-0.028, 0.036),
        (-0.040, 0.015),
    ]
    holes = [
        [(-0.040, -0.012), (-0.028, -0.038), (-0.008, -0.038), (-0.014, -0.012)],
        [(-0.001, -0.038), (0.030, -0.038), (0.018, -0.014), (-0.007, -0.014)],
        [(0.038, -0.039), (0.054, -0.039), (0.050, -0.030), (0.034, -0.030)],
        [(0.063, -0.0385), (0.084, -0.0375), (0.081, -0.0310), (0.060, -0.0315)],
        [(0.091, -0.0375), (0.109, -0.0365), (0.106, -0.0315), (0.088, -0.0310)],
        [(-0.018, 0.012), (0.014, 0.012), (0.006, 0.040), (-0.012, 0.040)],
        [(0.021, 0.010), (0.038, 0.004), (0.018, 0.030), (0.014, 0.032)],
    ]
    return plate(rounded(outline, 0.003, 3), 0.0016, [rounded(hole, 0.003, 3) for hole in holes])


def tail_fin() -> Shape:
    """The vertical fin, of the 0.0020 m^2 of parameters.toml."""
    outline = [
        (-0.472, 0.010),
        (-0.472, -0.011),
        (-0.4885, -0.054),
        (-0.496, -0.064),
        (-0.503, -0.062),
        (-0.5025, -0.042),
        (-0.500, -0.011),
        (-0.500, 0.010),
        (-0.508, 0.040),
        (-0.505, 0.046),
        (-0.498, 0.043),
        (-0.484, 0.024),
    ]
    hole = [(-0.4845, -0.016), (-0.4935, -0.016), (-0.4965, -0.044), (-0.4940, -0.047)]
    return plate(rounded(outline, 0.005), 0.0016, [rounded(hole, 0.0025, 3)])


def landing_gear() -> dict[str, Shape]:
    """A strut bent from foot to foot, and the toe of a skid."""
    side = [(0.0, 0.022, -0.0465), (-0.001, 0.043, -0.053), (0.001, 0.0605, -0.068)]
    foot = (0.003, 0.0695, -0.0845)
    left = [(*side[0], 0.0042, 0.0026), (*side[1], 0.0040, 0.0026), (*side[2], 0.0036, 0.0024)]
    left.append((*foot, 0.0036, 0.0024))
    right = [(x, -y, *rest) for x, y, *rest in left[::-1]]
    toe = [(0.086, 0.0, 0.0), (0.099, 0.0, 0.0015), (0.109, 0.0, 0.008), (0.1145, 0.0, 0.018)]
    return {
        "strut": tube([*right, (0.0, 0.0, -0.0460, 0.0042, 0.0026), *left], (0.0, 0.3, 1.0)),
        "skid_toe": tube([(*p, 0.0030, 0.0030) for p in toe], (0.0, 1.0, 0.0)),
    }


def shapes() -> dict[str, Shape]:
    """Every mesh of blade360.xml."""
    main = blade(
        [0.050, 0.056, 0.088, 0.384, 0.396, 0.401, 0.403],
        [0.016, 0.018, 0.033, 0.033, 0.030, 0.024, 0.015],
        0.12,
        {"inner": (0.050, 0.318), "band": (0.318, 0.346), "tip": (0.346, 0.403)},
    )
    tail = blade(
        [0.018, 0.022, 0.032, 0.077, 0.081, 0.083],
        [0.011, 0.013, 0.022, 0.022, 0.019, 0.012],
        0.12,
        {"inner": (0.018, 0.066), "tip": (0.066, 0.083)},
    )
    grip = [(0.014, 0.0055, 0.0050), (0.028, 0.0070, 0.0060), (0.046, 0.0070, 0.0055)]
    grip.append((0.060, 0.0075, 0.0040))
    return {
        **canopy(),
        **landing_gear(),
        **{f"blade_{region}": part for region, part in main.items()},
        **{f"tail_blade_{region}": part for region, part in tail.items()},
        "grip": tube([(x, 0.0, 0.0, *half) for x, *half in grip], (0.0, 0.0, 1.0), along=9),
        "frame_side": frame_side(),
        "tail_fin": tail_fin(),
    }


if __name__ == "__main__":
    build(FOLDER, total_mass_kg=TOTAL_MASS_KG, shapes=shapes, view=VIEW)
