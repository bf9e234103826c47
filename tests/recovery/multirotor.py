"""A published quadrotor: AscTec's Hummingbird, twelve states, flown in closed loop.

Source: RotorS of ETH Zurich (F. Furrer, M. Burri, M. Achtelik and R. Siegwart, "RotorS, a
Modular Gazebo MAV Simulator Framework", Springer 2016), rotors_description/urdf/
hummingbird.xacro at commit 114bab19, which takes them from J. Wang and others, "Novel Dynamic
Inversion Architecture Design for Quadrocopter Control", and the forces in
rotors_gazebo_plugins/src/gazebo_motor_model.cpp at commit 0487c528: thrust k Omega^2, drag
-Omega lambda V across each rotor, a moment -Omega mu V, yaw by 0.016 m of the thrust (after P.
Martin and E. Salaun, "The True Role of Accelerometer Feedback in Quadrotor Control", ICRA 2010).
Read number by number there. The linear model at hover follows below; rotors are points of mass,
and their lag is that of speeding up.
"""

import math

import numpy as np
from closed_loop import Aircraft, Rig, swept
from published import parameters

from helisim.ident import Structure

GRAVITY = 9.80665
ROTOR_MASS = 0.009
MASS = 0.68 + 4.0 * ROTOR_MASS
"""kg"""
ARM = 0.17
ABOVE = 0.01
"""Of the rotors over the centre, m."""
INERTIA_ROLL = 0.007 + ROTOR_MASS * (2.0 * ARM**2 + 4.0 * ABOVE**2)
INERTIA_YAW = 0.012 + ROTOR_MASS * 4.0 * ARM**2
"""kg m^2; pitch is as roll."""
THRUST = 8.54858e-6
"""N s^2"""
YAW_ARM = 0.016
"""Torque over thrust, m."""
DRAG, ROLLING = 8.06428e-5, 1e-6
"""kg, and kg m, of a rotor by its speed and that of the air across it."""
LAG = 0.0125
"""s"""
HOVER_SPEED = math.sqrt(MASS * GRAVITY / (4.0 * THRUST))
"""rad/s"""

_ACROSS = 4.0 * HOVER_SPEED * DRAG
_ROLLED = 4.0 * HOVER_SPEED * ROLLING
HUMMINGBIRD = {
    "X_u": -_ACROSS / MASS,
    "Y_v": -_ACROSS / MASS,
    "L_u": -_ROLLED / INERTIA_ROLL,
    "L_v": -_ACROSS * ABOVE / INERTIA_ROLL,
    "M_u": _ACROSS * ABOVE / INERTIA_ROLL,
    "M_v": -_ROLLED / INERTIA_ROLL,
    "N_r": -_ACROSS * ARM**2 / INERTIA_YAW,
    "L_lat": 2.0 * ARM * 2.0 * THRUST * HOVER_SPEED**2 / INERTIA_ROLL,
    "M_lon": 2.0 * ARM * 2.0 * THRUST * HOVER_SPEED**2 / INERTIA_ROLL,
    "N_ped": 4.0 * YAW_ARM * 2.0 * THRUST * HOVER_SPEED**2 / INERTIA_YAW,
    "Z_col": -4.0 * 2.0 * THRUST * HOVER_SPEED**2 / MASS,
    "tau_m": LAG,
    "tau": 0.01,  # of the recording: the source has none
}
"""SI; inputs are shares of the hover's rotor speed: two rotors of an axis up and down, all four
up, or neighbours against each other."""


def hummingbird_structure() -> Structure:
    """Return rigid body and the lags of the four combinations of rotor speeds."""
    lags = {f"n_{axis}": axis for axis in ("lat", "lon", "ped", "col")}
    return Structure.from_dict(
        {
            "name": "hummingbird",
            "parameters": parameters(HUMMINGBIRD),
            "constants": {"g": GRAVITY},
            "states": ["u", "v", "w", "p", "q", "r", "phi", "theta", *lags],
            "inputs": list(lags.values()),
            "outputs": ["u", "v", "w", "p", "q", "r"],
            "M": {lag: {lag: "tau_m"} for lag in lags},
            "F": {
                "u": {"u": "X_u", "theta": "-g"},
                "v": {"v": "Y_v", "phi": "g"},
                "w": {"n_col": "Z_col"},
                "p": {"u": "L_u", "v": "L_v", "n_lat": "L_lat"},
                "q": {"u": "M_u", "v": "M_v", "n_lon": "M_lon"},
                "r": {"r": "N_r", "n_ped": "N_ped"},
                "phi": {"p": 1},
                "theta": {"q": 1},
                **{lag: {lag: -1} for lag in lags},
            },
            "G": {lag: {axis: 1} for lag, axis in lags.items()},
            "input_delays": dict.fromkeys(lags.values(), "tau"),
        }
    )


def hummingbird() -> Aircraft:
    """Return the quadrotor under attitude feedback, two sweeps of 60 s an axis."""
    structure = hummingbird_structure()
    gain = np.zeros((4, 12))
    for row, feedback in enumerate(
        ({"phi": 0.2, "p": 0.05}, {"theta": 0.2, "q": 0.05}, {"r": 0.08}, {"w": -0.05})
    ):
        for state, value in feedback.items():
            gain[row, structure.states.index(state)] = value
    rig = Rig(
        structure,
        HUMMINGBIRD,
        gain,
        rate=400,
        keep=2,
        noise={**dict.fromkeys(("u", "v", "w"), 0.02), **dict.fromkeys(("p", "q", "r"), 0.01)},
        gust={"u": 0.05, "v": 0.05, "w": 0.05, "p": 0.1, "q": 0.1, "r": 0.05},
    )
    amplitudes = {"lat": 0.05, "lon": 0.05, "ped": 0.1, "col": 0.05}
    return swept("hummingbird", rig, amplitudes, (0.4, 60.0), 60.0, 0.001)
