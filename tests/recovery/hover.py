"""A hover model of twelve states and 38 parameters, flown in closed loop.

Rigid body, first-order flapping, rotor inflow in heave and a yaw-rate gyro: the equations of
Mettler's hover model with the inflow of a first-order lag. The numbers are a model
helicopter's orders of magnitude, chosen here: a test case, not an aircraft.
"""

import numpy as np
from closed_loop import Aircraft, Rig, swept
from published import parameters

from helisim.ident import Structure

TRUTH = {
    "X_u": -0.06,
    "Y_v": -0.14,
    "Y_p": 0.25,
    "Y_ped": 4.0,
    "Z_w": -0.75,
    "Z_col": -9.0,
    "C_col": -14.0,
    "tau_nu": 0.12,
    "L_u": -0.09,
    "L_v": -0.26,
    "L_w": -0.12,
    "L_b": 330.0,
    "L_col": 3.0,
    "L_ped": 6.0,
    "M_u": 0.11,
    "M_v": -0.07,
    "M_w": 0.09,
    "M_a": 165.0,
    "M_col": -2.0,
    "N_v": 0.45,
    "N_w": 0.2,
    "N_p": -0.9,
    "N_r": -1.6,
    "N_ped": 34.0,
    "N_col": -9.0,
    "K_r": 2.0,
    "K_rfb": -7.5,
    "tau_f": 0.12,
    "A_b": -0.2,
    "B_a": 0.3,
    "A_lat": 0.05,
    "A_lon": 0.32,
    "B_lat": 0.28,
    "B_lon": -0.07,
    "tau_lat": 0.04,
    "tau_lon": 0.04,
    "tau_ped": 0.03,
    "tau_col": 0.06,
}
"""SI; u, v, w in m/s, the controls in shares of their travel."""

_STATES = ("u", "v", "w", "p", "q", "r", "phi", "theta", "a", "b", "r_fb", "nu")
_INPUTS = ("lat", "lon", "ped", "col")


def structure() -> Structure:
    """Return the structure as a user would write it: starts are powers of ten with a sign."""
    return Structure.from_dict(
        {
            "name": "hover_12",
            "parameters": parameters(TRUTH),
            "constants": {"g": 9.80665},
            "states": list(_STATES),
            "inputs": list(_INPUTS),
            "outputs": ["u", "v", "w", "p", "q", "r", "ax", "ay", "az"],
            "M": {"a": {"a": "tau_f"}, "b": {"b": "tau_f"}, "nu": {"nu": "tau_nu"}},
            "F": {
                "u": {"u": "X_u", "theta": "-g", "a": "-g"},
                "v": {"v": "Y_v", "p": "Y_p", "phi": "g", "b": "g"},
                "w": {"w": "Z_w", "nu": 1},
                "p": {"u": "L_u", "v": "L_v", "w": "L_w", "b": "L_b"},
                "q": {"u": "M_u", "v": "M_v", "w": "M_w", "a": "M_a"},
                "r": {"v": "N_v", "w": "N_w", "p": "N_p", "r": "N_r", "r_fb": "-N_ped"},
                "phi": {"p": 1},
                "theta": {"q": 1},
                "a": {"q": "-tau_f", "a": -1, "b": "A_b"},
                "b": {"p": "-tau_f", "a": "B_a", "b": -1},
                "r_fb": {"r": "K_r", "r_fb": "K_rfb"},
                "nu": {"nu": -1},
            },
            "G": {
                "v": {"ped": "Y_ped"},
                "w": {"col": "Z_col"},
                "p": {"col": "L_col", "ped": "L_ped"},
                "q": {"col": "M_col"},
                "r": {"ped": "N_ped", "col": "N_col"},
                "a": {"lat": "A_lat", "lon": "A_lon"},
                "b": {"lat": "B_lat", "lon": "B_lon"},
                "nu": {"col": "C_col"},
            },
            "H0": {
                **{name: {name: 1} for name in ("u", "v", "w", "p", "q", "r")},
                "ax": {"theta": "g"},
                "ay": {"phi": "-g"},
            },
            "H1": {"ax": {"u": 1}, "ay": {"v": 1}, "az": {"w": 1}},
            "input_delays": {name: f"tau_{name}" for name in _INPUTS},
        }
    )


def hover() -> Aircraft:
    """Return the model under attitude feedback, two sweeps of 100 s an axis."""
    gain = np.zeros((len(_INPUTS), len(_STATES)))
    for axis, feedback in {
        "lat": {"phi": 0.25, "p": 0.03},
        "lon": {"theta": 0.35, "q": 0.06},
        "ped": {"r": 0.02},
        "col": {"w": -0.02},
    }.items():
        for state, value in feedback.items():
            gain[_INPUTS.index(axis), _STATES.index(state)] = value
    rig = Rig(
        structure(),
        TRUTH,
        gain,
        rate=200,
        keep=2,
        noise={
            **dict.fromkeys(("u", "v", "w"), 0.02),
            **dict.fromkeys(("p", "q", "r"), 0.005),
            **dict.fromkeys(("ax", "ay", "az"), 0.05),
        },
        gust={"u": 0.02, "v": 0.02, "w": 0.02, "p": 0.04, "q": 0.03, "r": 0.02},
    )
    amplitudes = {"lat": 0.06, "lon": 0.06, "ped": 0.1, "col": 0.06}
    return swept("hover", rig, amplitudes, (0.3, 30.0), 100.0, 0.003)
