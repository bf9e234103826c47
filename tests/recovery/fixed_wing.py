"""A published fixed-wing model: an F-16 with its actuators.

Every number was read in the source named beside it and is quoted as printed there; what is
converted says so.
"""

import math

import numpy as np
from closed_loop import Aircraft, Rig, swept
from published import parameters

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
