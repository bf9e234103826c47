"""Published linear models of aircraft other than the JR700, with their sources.

Every number was read in the source named beside it in published.toml, not remembered, and is quoted
as printed there; what is converted says so. Each model is a structure as a user would write it,
with the truth beside it and starts that are the truth's order of magnitude and sign at most.
"""

import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from closed_loop import Aircraft, Rig, swept

from helisim.ident import Structure
from helisim.study.paper import published

FOOT = 0.3048
"""m (exact)."""
PRINTED = tomllib.loads(Path(__file__).with_name("published.toml").read_text(encoding="utf-8"))

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


def printed(model: str) -> tuple[Structure, dict[str, float]]:
    """Return a lateral structure, "boeing_747" or "f_16", and its true parameters in SI."""
    table = PRINTED[model]
    truth, known = (
        {
            name: value / math.radians(1.0) if name in table.get("per_degree", ()) else value
            for name, value in table[kind].items()
        }
        for kind in ("truth", "known")
    )
    whole = {**table["structure"], "parameters": parameters(truth), "constants": known}
    return Structure.from_dict(whole), truth


def blade_360() -> Structure:
    """Return the Blade 360's structure of ten states, read from the TOML file beside this one."""
    return Structure.from_toml(Path(__file__).with_name("blade360.toml"))


def lynx() -> tuple[Structure, dict[str, float]]:
    """Return the Lynx's structure in SI and its true parameters.

    Free are the main derivatives of the six body axes; gravity, the attitudes' rows and the small
    cross terms are held at the published values.
    """
    table, truth, known = PRINTED["lynx"], dict[str, float](), dict[str, float]()
    feet = {name: 1.0 / FOOT if name in "uvw" else 1.0 for name in table["states"]}
    tables: dict[str, dict[str, Any]] = {"F": {}, "G": {}}
    axes = dict(zip(table["states"], "TPLMNXYZ"))
    for i, row in enumerate(table["states"]):
        for matrix, columns, values in (("F", "states", "a_feet"), ("G", "inputs", "b_feet")):
            for column, value in zip(table[columns], table[values][i]):
                if value:
                    free = column in table["free"].get(row, ())
                    name = f"{axes[row]}_{column}" if free else f"k_{row}_{column}"
                    known_or_free = truth if free else known
                    known_or_free[name] = value * feet.get(column, 1.0) / feet[row]
                    tables[matrix].setdefault(row, {})[column] = name
    truth["tau"] = 0.02  # of the recording: the source has none
    structure = Structure.from_dict(
        {
            "name": "lynx_hover",
            "parameters": parameters(truth),
            "constants": known,
            "states": table["states"],
            "inputs": table["inputs"],
            "outputs": ["p", "q", "r", "u", "v", "w"],
            **tables,
            "input_delays": dict.fromkeys(table["inputs"], "tau"),
        }
    )
    return structure, truth


def f_16() -> Aircraft:
    """Return the F-16 with roll and yaw dampers and a wing leveller, 100 s a sweep."""
    structure, truth = printed("f_16")
    gain = np.zeros((2, 6))
    gain[0, 1:3] = -0.05, -0.03
    gain[1, 3] = -0.3
    rig = Rig(
        structure,
        truth,
        gain,
        rate=100,
        keep=1,
        noise={"p": 0.002, "r": 0.001, "phi": 0.002},
        gust={"beta": 0.001, "p": 0.02},
        gust_cutoff=6.0,
    )
    return swept("f_16", rig, {"lat": 0.02, "ped": 0.03}, (0.2, 25.0), 100.0, 0.001)
