"""Published linear models of aircraft other than the JR700, with their sources.

Every number was read in the source named beside it, not remembered, and is quoted as printed
there; what is converted says so. Each model is a structure as a user would write it, with the
truth beside it and starts that are the truth's order of magnitude and sign at most.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from closed_loop import Aircraft, Rig, swept

from helisim.ident import Structure
from helisim.study.paper import published

FOOT = 0.3048
"""m (exact)."""

# ---------------------------------------------------------------------------------------------
# Boeing 747, lateral motion in cruise.
# Source: MathWorks, Control System Toolbox, example "Yaw Damper Design for a 747 Jet Aircraft"
# (jetdemo.m, revision 1.23.4.6 of 2009/08/29): states sideslip, yaw rate, roll rate, bank angle;
# inputs rudder and aileron; radians. What aircraft data it rests on the example doesn't say.
# Checked: read number by number in that file; three independent public codes have the same
# state matrix. The example's figures follow from them, and a test says so: a Dutch roll near
# 1 rad/s, damping of about 0.45 with K = 2.85, and of about 0.305 with a washout of 0.2 rad/s
# and 2.34.
BOEING_747 = {
    "Y_beta": -0.0558, "Y_p": 0.0802, "N_beta": 0.598, "N_r": -0.115, "N_p": -0.0318,
    "L_beta": -3.05, "L_r": 0.388, "L_p": -0.4650, "N_rud": -0.475, "L_rud": 0.153,
    "N_ail": 0.00775, "L_ail": 0.143, "tau": 0.02,  # of the recording: the source has none
}  # fmt: skip
BOEING_747_KNOWN = {"Y_r": -0.9968, "Y_phi": 0.0415, "Y_rud": 0.00729, "tan_theta": 0.0805}
"""Kinematics of the trim, and the rudder's small side force: sideslip isn't measured, so its
scale and origin must come from somewhere."""

# ---------------------------------------------------------------------------------------------
# Blade 360, sub-scale flybarless helicopter at hover.
# Source: J. Walker and M. Tischler, "Identification and Control Design of a Sub-Scale
# Flybarless Helicopter", Vertical Flight Society 77th Annual Forum, 2021, as ArduPilot's
# simulator quotes it (libraries/SITL/SIM_Helicopter.cpp, frame blade360, commit 01756036).
# The numbers, and what was checked: helisim/reference/blade360.py. a and b are the tip path
# plane's tilts, tpp_angle.y and .x. The file writes g a and g b for X_a = -g and Y_b = g, and
# delays all servos by 40 ms.
# Open loop: 0.971 +- 0.770i is unstable.
BLADE_360 = {
    **{
        value.name: value.value
        for name in ("rollpitch_in1", "yaw_base", "heave", "others")
        for value in published("blade360")[name]
        if not value.name.startswith("tau_") or value.name == "tau_f"
    },
    "tau": published("blade360")["heave"]["tau_col"].value,
}

# ---------------------------------------------------------------------------------------------
# Westland Lynx at hover, eight states.
# Source: S. Skogestad and I. Postlethwaite, Multivariable Feedback Control, 2nd edition, Wiley
# 2005 (helicopter case study), as GNU Octave's control package quotes it (WestlandLynx.m,
# L. Reichlin, 2010): states theta, phi (rad), p, q, xi (yaw rate, rad/s), v_x, v_y, v_z (ft/s);
# inputs main collective, longitudinal cyclic, lateral cyclic, tail collective.
# Checked: read number by number there; an independent Scilab transcription has the same A and
# B. Open loop: 0.234 +- 0.551i is unstable.
LYNX_STATES = ("theta", "phi", "p", "q", "r", "u", "v", "w")
LYNX_INPUTS = ("col", "lon", "lat", "ped")
LYNX_A_FEET = (
    (0, 0, 0, 0.99857378005981, 0.05338427424431, 0, 0, 0),
    (0, 0, 1.0, -0.00318221934140, 0.05952465534210, 0, 0, 0),
    (0, 0, -11.57049560546880, -2.54463768005371,
     -0.06360262632370, 0.10678052902222, -0.09491866827011, 0.00710757449269),
    (0, 0, 0.43935656547546, -1.99818229675293,
     0, 0.01665188372135, 0.01846204698086, -0.00118747074157),
    (0, 0, -2.04089546203613, -0.45899915695190,
     -0.73502779006958, 0.01925575733185, -0.00459562242031, 0.00212036073208),
    (-32.10360717773440, 0, -0.50335502624512, 2.29785919189453,
     0, -0.02121581137180, -0.02116791903973, 0.01581159234047),
    (0.10216116905212, 32.05783081054690, -2.34721755981445, -0.50361156463623,
     0.83494758605957, 0.02122657001019, -0.03787973523140, 0.00035400385968),
    (-1.91097259521484, 1.71382904052734, -0.00400543212891, -0.05741119384766,
     0, 0.01398963481188, -0.00090675335377, -0.29051351547241),
)  # fmt: skip
LYNX_B_FEET = (
    (0, 0, 0, 0),
    (0, 0, 0, 0),
    (0.12433505058289, 0.08278584480286, -2.75247764587402, -0.01788876950741),
    (-0.03635892271996, 0.47509527206421, 0.01429074257612, 0),
    (0.30449151992798, 0.01495801657438, -0.49651837348938, -0.20674192905426),
    (0.28773546218872, -0.54450607299805, -0.01637935638428, 0),
    (-0.01907348632812, 0.01636743545532, -0.54453611373901, 0.23484230041504),
    (-4.82063293457031, -0.00038146972656, 0, 0),
)


DELAYS = ("tau", "tau_lat", "tau_lon", "tau_ped", "tau_col")
LAGS = ("tau_f", "tau_m", "tau_nu")
"""Delays and time constants by name: their bounds are what anyone knows of such."""


def rough(value: float) -> float:
    """Return a value's sign and nearest power of ten: a start that is no answer."""
    return math.copysign(10.0 ** round(math.log10(abs(value))), value)


def parameters(truth: Mapping[str, float]) -> dict[str, Any]:
    """Return a table of parameters that start at powers of ten, delays at zero."""
    table: dict[str, Any] = {}
    for name, value in truth.items():
        table[name] = {"unit": "SI", "start": rough(value)}
        if name in DELAYS:
            table[name] = {"unit": "s", "start": 0.0, "bounds": [-0.3, 0.3], "scale": 0.03}
        if name in LAGS:
            table[name] |= {"unit": "s", "bounds": [1e-3, 1.0]}
    return table


def boeing_747() -> Structure:
    """Return the 747's lateral structure: yaw rate, roll rate, bank angle; side force known."""
    return Structure.from_dict(
        {
            "name": "boeing_747_lateral",
            "parameters": parameters(BOEING_747),
            "constants": BOEING_747_KNOWN,
            "states": ["beta", "r", "p", "phi"],
            "inputs": ["ped", "lat"],
            "outputs": ["r", "p", "phi"],
            "F": {
                "beta": {"beta": "Y_beta", "r": "Y_r", "p": "Y_p", "phi": "Y_phi"},
                "r": {"beta": "N_beta", "r": "N_r", "p": "N_p"},
                "p": {"beta": "L_beta", "r": "L_r", "p": "L_p"},
                "phi": {"r": "tan_theta", "p": 1},
            },
            "G": {
                "beta": {"ped": "Y_rud"},
                "r": {"ped": "N_rud", "lat": "N_ail"},
                "p": {"ped": "L_rud", "lat": "L_ail"},
            },
            "input_delays": {"ped": "tau", "lat": "tau"},
        }
    )


def blade_360() -> Structure:
    """Return the Blade 360's structure of ten states, read from the TOML file beside this one."""
    return Structure.from_toml(Path(__file__).with_name("blade360.toml"))


def lynx() -> tuple[Structure, dict[str, float]]:
    """Return the Lynx's structure in SI and its true parameters.

    Free are the main derivatives of the six body axes (`LYNX_FREE`); gravity, the attitudes'
    rows and the small cross terms are held at the published values.
    """
    truth: dict[str, float] = {}
    known: dict[str, float] = {}
    feet = {name: 1.0 / FOOT if name in "uvw" else 1.0 for name in LYNX_STATES}
    tables: dict[str, dict[str, Any]] = {"F": {}, "G": {}}
    for i, row in enumerate(LYNX_STATES):
        for matrix, columns, published_feet in (
            ("F", LYNX_STATES, LYNX_A_FEET),
            ("G", LYNX_INPUTS, LYNX_B_FEET),
        ):
            for column, value in zip(columns, published_feet[i]):
                if value:
                    free = (row, column) in LYNX_FREE
                    name = f"{_AXIS[row]}_{column}" if free else f"k_{row}_{column}"
                    known_or_free = truth if free else known
                    known_or_free[name] = value * feet.get(column, 1.0) / feet[row]
                    tables[matrix].setdefault(row, {})[column] = name
    truth["tau"] = 0.02  # of the recording: the source has none
    structure = Structure.from_dict(
        {
            "name": "lynx_hover",
            "parameters": parameters(truth),
            "constants": known,
            "states": list(LYNX_STATES),
            "inputs": list(LYNX_INPUTS),
            "outputs": ["p", "q", "r", "u", "v", "w"],
            **tables,
            "input_delays": dict.fromkeys(LYNX_INPUTS, "tau"),
        }
    )
    return structure, truth


_AXIS = {"theta": "T", "phi": "P", "p": "L", "q": "M", "r": "N", "u": "X", "v": "Y", "w": "Z"}

LYNX_FREE = frozenset(
    [
        *[("p", x) for x in ("p", "q", "u", "v", "col", "lon", "lat")],
        *[("q", x) for x in ("p", "q", "u", "v", "col", "lon")],
        *[("r", x) for x in ("p", "r", "col", "lat", "ped")],
        *[("u", x) for x in ("u", "lon")],
        *[("v", x) for x in ("v", "lat", "ped")],
        *[("w", x) for x in ("w", "col")],
    ]
)
"""The derivatives that are identified; the others are held at the published values."""


# ---------------------------------------------------------------------------------------------
# F-16, lateral motion, with the actuators of aileron and rudder.
# Source: B. Stevens, F. Lewis and E. Johnson, Aircraft Control and Simulation, 3rd edition,
# Wiley 2015, example 5.3-1 ("LQR design for F-16 lateral regulator"), as six public codes quote
# it: states sideslip, bank (rad), roll and yaw rate (rad/s), aileron and rudder (deg), servos of
# 20.2 rad/s. The book was not seen.
# Checked: four of the codes have every number alike, in Python, MATLAB and Scilab, each written
# for a purpose of its own; two print 8.5395 for 8.5396.
DEGREE = math.pi / 180.0
F_16 = {  # controls per degree there, per rad here
    "L_beta": -30.6492, "L_p": -3.6784, "L_r": 0.6646,
    "L_lat": -0.7333 / DEGREE, "L_ped": 0.1315 / DEGREE,
    "N_beta": 8.5396, "N_p": -0.0254, "N_r": -0.4764,
    "N_lat": -0.0319 / DEGREE, "N_ped": -0.0620 / DEGREE,
    "omega_s": 20.2, "tau": 0.02,  # of the recording: the source has none
}  # fmt: skip
F_16_KNOWN = {
    "Y_beta": -0.3220, "Y_phi": 0.0640, "Y_p": 0.0364, "Y_r": -0.9917, "tan_theta": 0.0037,
    "Y_lat": 0.0003 / DEGREE, "Y_ped": 0.0008 / DEGREE,
}  # fmt: skip
"""Trim and side force: sideslip isn't measured, so its scale must come from somewhere."""


def f_16_structure() -> Structure:
    """Return the F-16's lateral structure: roll and yaw rate and bank angle are measured."""
    return Structure.from_dict(
        {
            "name": "f_16_lateral",
            "parameters": parameters(F_16),
            "constants": F_16_KNOWN,
            "states": ["beta", "phi", "p", "r", "aileron", "rudder"],
            "inputs": ["lat", "ped"],
            "outputs": ["p", "r", "phi"],
            "F": {
                "beta": {
                    "beta": "Y_beta", "phi": "Y_phi", "p": "Y_p", "r": "Y_r",
                    "aileron": "Y_lat", "rudder": "Y_ped",
                },
                "phi": {"p": 1, "r": "tan_theta"},
                "p": {"beta": "L_beta", "p": "L_p", "r": "L_r",
                      "aileron": "L_lat", "rudder": "L_ped"},
                "r": {"beta": "N_beta", "p": "N_p", "r": "N_r",
                      "aileron": "N_lat", "rudder": "N_ped"},
                "aileron": {"aileron": "-omega_s"},
                "rudder": {"rudder": "-omega_s"},
            },
            "G": {"aileron": {"lat": "omega_s"}, "rudder": {"ped": "omega_s"}},
            "input_delays": {"lat": "tau", "ped": "tau"},
        }
    )  # fmt: skip


def f_16() -> Aircraft:
    """Return the F-16 with roll and yaw dampers and a wing leveller, 100 s a sweep."""
    structure = f_16_structure()
    gain = np.zeros((2, 6))
    gain[0, 1:3] = -0.05, -0.03
    gain[1, 3] = -0.3
    rig = Rig(
        structure,
        F_16,
        gain,
        rate=100,
        keep=1,
        noise={"p": 0.002, "r": 0.001, "phi": 0.002},
        gust={"beta": 0.001, "p": 0.02},
        gust_cutoff=6.0,
    )
    return swept("f_16", rig, {"lat": 0.02, "ped": 0.03}, (0.2, 25.0), 100.0, 0.001)
