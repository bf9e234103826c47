"""Published fixed-wing models: an F-16 with its actuators, a Learjet identified from flight.

Every number was read in the source named beside it and is quoted as printed there; what is
converted says so.
"""

import math

import numpy as np
from closed_loop import Aircraft, Rig, swept
from published import FOOT, parameters

from helisim.ident import Structure

# ---------------------------------------------------------------------------------------------
# F-16, lateral motion, with the actuators of aileron and rudder.
# Source: B. Stevens, F. Lewis and E. Johnson, Aircraft Control and Simulation, 3rd edition,
# Wiley 2015, example 5.3-1 ("LQR design for F-16 lateral regulator"), as six public codes quote
# it: states sideslip, bank (rad), roll and yaw rate (rad/s), aileron and rudder (deg), servos of
# 20.2 rad/s. The book was not seen.
# Checked: four of the codes have every number alike, in Python, MATLAB and Scilab, each written
# for a purpose of its own; two print 8.5395 for 8.5396.
DEGREE = math.pi / 180.0
F_16 = {
    "L_beta": -30.6492,
    "L_p": -3.6784,
    "L_r": 0.6646,
    "L_lat": -0.7333 / DEGREE,  # per degree there, per rad here
    "L_ped": 0.1315 / DEGREE,
    "N_beta": 8.5396,
    "N_p": -0.0254,
    "N_r": -0.4764,
    "N_lat": -0.0319 / DEGREE,
    "N_ped": -0.0620 / DEGREE,
    "omega_s": 20.2,
    "tau": 0.02,  # of the recording: the source has none
}
F_16_KNOWN = {
    "Y_beta": -0.3220,
    "Y_phi": 0.0640,
    "Y_p": 0.0364,
    "Y_r": -0.9917,
    "tan_theta": 0.0037,
    "Y_lat": 0.0003 / DEGREE,
    "Y_ped": 0.0008 / DEGREE,
}
"""Trim and side force: sideslip isn't measured, so its scale must come from somewhere."""

# ---------------------------------------------------------------------------------------------
# Learjet 25 of Calspan, as identified from flight.
# Source: T. Berger, M. Tischler, S. Hagerott and others, "Development and Validation of a
# Flight-Identified Full-Envelope Business Jet Simulation Model Using a Stitching Architecture",
# AIAA Modeling and Simulation Technologies Conference, 2017, paper 1550, as a Python module
# (learjet_data.py, first of its two conditions) quotes it: ft, s, rad; surfaces in degrees; speed
# 525 ft/s ahead and 17 ft/s down, nose up by 2.378 degrees. The paper was not seen.
# Checked: a MATLAB script by E. Lew of 2021 quotes the same paper with the same lateral
# numbers; its longitudinal ones are of another condition, up to 2 % off but for the speed's.
LEARJET_FEET = {
    "X_u": -0.009725, "X_w": 0.08642, "Z_u": -0.1119, "Z_w": -1.432,
    "M_u": 0.0004093, "M_w": -0.02352, "M_q": -1.65,
    "X_lon": 0.07084, "Z_lon": -1.244, "M_lon": -0.1919,
    "Y_v": -0.1698, "Y_p": 0.8673, "L_v": -0.01918, "L_p": -2.278, "L_r": 0.8487,
    "N_v": 0.005268, "N_p": -0.2258, "N_r": -0.2719,
    "Y_lat": -0.0132, "Y_ped": 0.3073, "L_lat": -0.1623, "L_ped": 0.03301,
    "N_lat": -0.01127, "N_ped": -0.03732,
}  # fmt: skip
LEARJET_KNOWN = {
    "U_0": 525.0 * FOOT,
    "W_0": 17.0 * FOOT,
    "g_cos": 32.146 * FOOT * math.cos(2.378 * DEGREE),
    "g_sin": 32.146 * FOOT * math.sin(2.378 * DEGREE),
    "tan_theta": math.tan(2.378 * DEGREE),
}


def learjet(axes: str) -> dict[str, float]:
    """Return the Learjet's derivatives of some axes, such as "XZM", in SI but for degrees."""
    metric = {}
    for name, value in LEARJET_FEET.items():
        force, _, cause = name.partition("_")
        value *= FOOT if force in "XYZ" else 1.0
        value /= FOOT if cause in "uvw" else 1.0
        metric[name] = value
    return {name: value for name, value in metric.items() if name[0] in axes} | {"tau": 0.02}


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


def learjet_lateral_structure() -> Structure:
    """Return the Learjet's lateral structure: side velocity, rates and side acceleration."""
    return Structure.from_dict(
        {
            "name": "learjet_lateral",
            "parameters": parameters(learjet("YLN")),
            "constants": LEARJET_KNOWN,
            "states": ["v", "p", "r", "phi"],
            "inputs": ["lat", "ped"],
            "outputs": ["v", "p", "r", "ay"],
            "F": {
                "v": {"v": "Y_v", "p": "Y_p + W_0", "r": "-U_0", "phi": "g_cos"},
                "p": {"v": "L_v", "p": "L_p", "r": "L_r"},
                "r": {"v": "N_v", "p": "N_p", "r": "N_r"},
                "phi": {"p": 1, "r": "tan_theta"},
            },
            "G": {
                "v": {"lat": "Y_lat", "ped": "Y_ped"},
                "p": {"lat": "L_lat", "ped": "L_ped"},
                "r": {"lat": "N_lat", "ped": "N_ped"},
            },
            "H0": {
                **{name: {name: 1} for name in ("v", "p", "r")},
                "ay": {"p": "-W_0", "r": "U_0", "phi": "-g_cos"},
            },
            "H1": {"ay": {"v": 1}},
            "input_delays": {"lat": "tau", "ped": "tau"},
        }
    )


def learjet_longitudinal_structure() -> Structure:
    """Return the Learjet's longitudinal structure: speeds, pitch rate and angle, one surface."""
    return Structure.from_dict(
        {
            "name": "learjet_longitudinal",
            "parameters": parameters(learjet("XZM")),
            "constants": LEARJET_KNOWN,
            "states": ["u", "w", "q", "theta"],
            "inputs": ["lon"],
            "outputs": ["u", "w", "q", "theta"],
            "F": {
                "u": {"u": "X_u", "w": "X_w", "q": "-W_0", "theta": "-g_cos"},
                "w": {"u": "Z_u", "w": "Z_w", "q": "U_0", "theta": "-g_sin"},
                "q": {"u": "M_u", "w": "M_w", "q": "M_q"},
                "theta": {"q": 1},
            },
            "G": {"u": {"lon": "X_lon"}, "w": {"lon": "Z_lon"}, "q": {"lon": "M_lon"}},
            "input_delays": {"lon": "tau"},
        }
    )


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


def learjet_lateral() -> Aircraft:
    """Return the Learjet as its pilot flies it, without feedback: 150 s a sweep."""
    structure = learjet_lateral_structure()
    rig = Rig(
        structure,
        learjet("YLN"),
        np.zeros((2, 4)),
        rate=100,
        keep=2,
        noise={"v": 0.1, "p": 0.001, "r": 0.0005, "ay": 0.03},
        gust={"v": 0.03, "p": 0.003, "r": 0.0005},
        gust_cutoff=3.0,
    )
    return swept("learjet_lat", rig, {"lat": 1.0, "ped": 1.0}, (0.15, 12.0), 150.0, 0.02)


def learjet_longitudinal() -> Aircraft:
    """Return the Learjet's pitch axis without feedback: 300 s a sweep for its phugoid."""
    structure = learjet_longitudinal_structure()
    rig = Rig(
        structure,
        learjet("XZM"),
        np.zeros((1, 4)),
        rate=100,
        keep=2,
        noise={"u": 0.1, "w": 0.1, "q": 0.0005, "theta": 0.0005},
        gust={"u": 0.01, "w": 0.03, "q": 0.001},
        gust_cutoff=3.0,
    )
    return swept("learjet_lon", rig, {"lon": 0.5}, (0.04, 12.0), 300.0, 0.0)
