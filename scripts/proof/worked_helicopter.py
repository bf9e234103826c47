"""Prouty's worked helicopter, 20,000 lb, flown: trim, derivatives and roots in hover and at 115 kn.

worked_helicopter.toml has his inputs, what he prints, and explanations of differences above 15 %.
To try one, the model flies with parameters switched, rows are weighted as it says, or roots are
those of his derivatives. The book is a calculation, and contradicts itself in places.

    python scripts/proof/worked_helicopter.py
"""

import copy
import re
import shutil
from collections import namedtuple
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import common
import mujoco
import numpy as np
from common import CLOSE, KNOT, PUSH, small, weighed, within

import helisim as hs
from helisim.base.files import read_toml
from helisim.physics.layout import PARAM
from helisim.vehicle import Vehicle, load
from helisim.vehicle.calibrate import flapping_of
from helisim.vehicle.trim import addresses, place

TABLE = read_toml(Path(__file__).with_suffix(".toml"))
PRINTED, TRIED = TABLE["printed"], TABLE["tried"]
OWN = {f"{part}.{key}": v for part, some in TABLE["vehicle"].items() for key, v in some.items()}
POUND, FOOT, HORSEPOWER, GRAVITY = 4.4482216, 0.3048, 745.69987, 9.81
KNOTS = {"hover": 0.0, "60 kn": 60.0, "115 kn": 115.0}
MASS = TABLE["weight"] * POUND / GRAVITY
CONTROLS = {  # stick, and parameter of the radians of a unit of it, with its sign
    "theta_0": ("col", "main_rotor.pitch_range", 1.0),
    "A_1": ("lat", "geometry.cyclic_range", 1.0),
    "B_1": ("lon", "geometry.cyclic_range", -1.0),
    "theta_0T": ("ped", "tail_rotor.pitch_range", -1.0),
}
AXES = dict(zip("XYZLMN", "uvwpqr"))
FEET = PUSH | dict.fromkeys("uvw", 1.0 / FOOT)


Flight = namedtuple("Flight", "figures linear scales")
"""Figures by name in his units, and the linear model; scales: of its slopes to his."""


@cache
def flights(changes: tuple[tuple[str, float], ...] = ()) -> dict[str, Flight]:
    own = {"airframe.mass": MASS, **OWN, **dict(changes)}
    own |= flapping_of(own).to_parameters()
    with TemporaryDirectory() as at:
        folder = shutil.copytree(hs.model_folder("lynx"), Path(at) / "example")
        path = folder / "lynx.xml"  # of which one body is left, with all the mass
        text = re.sub(r' mass="[1-9]\d*"| *<inertial pos="0 0 0".*', "", path.read_text())
        body = f'<inertial pos="0 0 0" mass="{MASS}" full'
        path.write_text(re.sub('<inertial pos=".*" full', body, text))
        vehicle = load(folder, parameters=own)
    found = {}
    for name, knots in KNOTS.items():
        vehicle = vehicle.trimmed(speed=knots * KNOT)  # each from the one before
        figures, linear, scales = derived(vehicle)
        figures |= trim_of(vehicle) | roots(linear.a, linear.states)
        found[name] = Flight(figures, linear, scales)
    return found


def pushed(vehicle: Vehicle, **changes: float) -> tuple[Any, Any]:
    """Return the force, lb, in MuJoCo's axes with other numbers of the force laws; and the data."""
    model = copy.copy(vehicle.model)
    for name, value in changes.items():
        model.actuator_user[addresses(model).rotor, getattr(PARAM, name)] = value
    data = mujoco.MjData(model)
    place(model, data, vehicle.trim)
    with hs.installed():
        mujoco.mj_forward(model, data)
    return MASS / POUND * data.qacc[:3], data


def trim_of(vehicle: Vehicle) -> dict[str, float]:
    own, trim, (_, data) = vehicle.parameters, vehicle.trim, pushed(vehicle)
    thrust, torque, _, tail, _ = data.sensor("rotor").data
    pitch = own["main_rotor.pitch_trim"] + own["main_rotor.pitch_range"] * trim.col
    return {
        **{"theta": trim.theta, "phi": trim.phi, "a_1s": trim.a, "b_1s": trim.b},
        **{"T_M": thrust / POUND, "Q_M": torque / POUND / FOOT, "T_T": tail / POUND},
        "theta_0": pitch - 0.75 * own["main_rotor.twist"],
        "B_1 + a_1s": trim.a - own["geometry.cyclic_range"] * trim.lon,
        "alpha_TPP": trim.theta + trim.a,
        "L_H": -float(pushed(vehicle, tailplane_area=0.0)[0][2]),
        "L_V": float(pushed(vehicle, fin_area=0.0)[0][1]),
        "main_hp": vehicle.main_power / HORSEPOWER,
    }


def derived(vehicle: Vehicle) -> Flight:
    own, linear = vehicle.parameters, vehicle.linearize("IN1").rigid_body()
    ahead, down = vehicle.trim.motion.u, vehicle.trim.motion.w
    kinematics = {"X_q": -down, "Z_q": ahead, "Y_p": down, "Y_r": -ahead}
    found, scales = {}, {}
    inertia = dict.fromkeys("XYZ", MASS)
    inertia |= {a: own[f"airframe.i{i}"] / FOOT for a, i in zip("LMN", ("xx", "yy", "zz"))}
    for axis, rate in AXES.items():
        for cause in (*"uvwpqr", *CONTROLS):
            state, name, sign = CONTROLS.get(cause, (cause, "", 1.0))
            per = sign * own[name] if name else 1.0 / FOOT if cause in "uvw" else 1.0
            one = f"{axis}_{cause}"
            scales[one] = inertia[axis] / POUND / per
            found[one] = scales[one] * (linear.derivative(rate, state) - kinematics.get(one, 0.0))
    return Flight(found, linear, scales)


def roots(a: Any, states: tuple[str, ...]) -> dict[str, float]:
    def of(*some: str) -> Any:
        kept = [states.index(one) for one in some]
        return np.sort_complex(np.linalg.eigvals(a[np.ix_(kept, kept)]))

    pitch, heave, *_, phugoid = of("u", "w", "q", "theta")
    (roll, *_, lateral), every = of("v", "p", "phi"), of(*states)
    periods = [2.0 * np.pi / one.imag if one.imag else np.inf for one in (phugoid, lateral)]
    return {
        **{"root, pitch": pitch.real, "root, heave": heave.real, "root, roll": roll.real},
        **{"root, yaw": of("r")[0].real, "phugoid, growth": phugoid.real},
        **{"phugoid, s": periods[0], "lateral, s": periods[1], "frequency 4": every[3].imag},
        **{f"root {k}": one.real for k, one in enumerate(every, 1)},
    }


def tried(one: dict[str, Any], flight: str, name: str) -> float:
    """Return what an explanation makes of a row."""
    figures, linear, scales = flights(tuple(one.get("switch", {}).items()))[flight]
    if "prints" not in one:
        return weighed(one["rows"][name], figures)
    a, states = linear.a.copy(), linear.states
    for row in (row for row in PRINTED[flight] if row in scales and row[2:] in states):
        at = states.index(AXES[row[0]]), states.index(row[2:])
        a[at] += (PRINTED[flight][row] - figures[row]) / scales[row]
    return roots(a, states)[name]


def verdict(flight: str, name: str) -> str:
    """Return "" for a row within 15 %, "." for a small difference, a letter, or "?"."""
    printed, least = PRINTED[flight][name], small(name, PRINTED[flight], FEET)
    found = flights()[flight].figures[name]
    if within(found, printed, least):
        return "" if within(found, printed, 0.0) else "."
    for one in (one for one in TRIED if one["flight"] == flight and name in one["rows"]):
        if within(tried(one, flight, name), printed, least):
            return one["letter"]
    return "?"


def main() -> None:
    for flight, printed in PRINTED.items():
        rows = []
        for name, value in printed.items():
            found = flights()[flight].figures[name]
            off = 100.0 * found / value - 100.0
            rows.append((name, value, found, off, f" {verdict(flight, name)}"))
        common.table(f"{flight}:<18|printed:12.5g|model:12.5g|off, %:9.0f|:<2", rows)
        print()
    print(f"Without a sign: within {100.0 * CLOSE:.0f} %; . small; ? unexplained.")
    print("L_v, M_theta_0T and lateral of the hover have the signs of his own equations.")
    common.legend({one["letter"]: one["words"] for one in TRIED if "words" in one})


if __name__ == "__main__":
    common.run(main)
