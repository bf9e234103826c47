"""An identified model flies in ArduPilot's state-space simulation as it does here."""

import json

import numpy as np

from helisim.ident import structures
from helisim.ident.ardupilot import ArduPilotModel, numbers_of
from helisim.ident.evaluate import delayed, linear
from helisim.study.paper import published

SETTINGS = {"nominal_rpm": 2100.0, "coll_min": -2.0, "coll_max": 12.0, "coll_hover": 5.0}
BLADE = [
    (
        getattr(structures, name),
        {one.name: one.value for one in published("blade360")[table].values},
    )
    for name, table in (
        ("rollpitch", "rollpitch_in1"),
        ("yaw_base", "yaw_base"),
        ("heave", "heave"),
    )
]


def simulated(values: dict[str, float], commands: np.ndarray, step: float) -> np.ndarray:
    """p, q, r, w as SIM_StateSpace.cpp (commit 569e2a2) steps them, commands roll pitch coll yaw.

    First the rotor, from the rates before; then the accelerations; Euler. Commands wait in a
    buffer of delay / step samples. The attitude is kept: forces turn no velocity here.
    """
    get = {**dict.fromkeys(("Lu", "Lv", "Lp", "Mu", "Mv", "Mq", "Nv", "Nw", "Ncol"), 0.0), **values}
    lines = {
        key: int(min(100, max(1, int(get[f"time_delay_{key}"]))) * 0.001 / step)
        for key in ("rp", "ped", "col")
    }
    hover = (get["coll_hover"] - get["coll_min"]) / (get["coll_max"] - get["coll_min"])
    p = q = r = w = a = b = 0.0
    out = []
    for k in range(len(commands)):
        roll, pitch = commands[max(0, k - lines["rp"]), :2]
        coll = commands[max(0, k - lines["col"]), 2]
        yaw = commands[max(0, k - lines["ped"]), 3]
        out.append((p, q, r, w))
        inverse = 1.0 / get["tf"]
        b_dot = (
            -p
            - inverse * b
            + inverse * (get["Lfa1s"] * a + get["Lflt"] * roll + get["Lflg"] * pitch)
        )
        a_dot = (
            -q
            - inverse * a
            + inverse * (get["Mfb1s"] * b + get["Mflt"] * roll + get["Mflg"] * pitch)
        )
        a, b = a + step * a_dot, b + step * b_dot
        r_dot = get["Nr"] * r + get["Nped"] * yaw + get["Nw"] * w + get["Ncol"] * (coll - hover)
        w_dot = get["Zcol"] * (coll - hover) + get["Zw"] * w
        p, q = p + step * get["Lb1s"] * b, q + step * get["Ma1s"] * a
        r, w = r + step * r_dot, w + step * w_dot
    return np.array(out)


def test_simulating_the_file_as_ardupilot_does_gives_the_identified_motion(tmp_path):
    """Doublets through the file's numbers, stepped as its source does, against the fits' own."""
    full = dict.fromkeys(("col", "lon", "lat", "ped"), 1.0)
    numbers, _ = numbers_of(BLADE, full=full, late={})
    ArduPilotModel({**numbers, **SETTINGS}).write(tmp_path / "blade.json")
    values = {
        k: v for k, v in json.loads((tmp_path / "blade.json").read_text()).items() if k != "made_by"
    }
    errors = []
    for step in (1.0 / 2000.0, 1.0 / 8000.0):
        time = np.arange(0.0, 1.5, step)
        moved = 0.05 * ((time > 0.1) & (time < 0.4)) - 0.05 * ((time >= 0.4) & (time < 0.7))
        commands = np.column_stack([moved, 0.5 * moved, 0.5 + moved, moved])
        found = simulated(values, commands, step)
        ours = {"lat": moved, "lon": 0.5 * moved, "ped": moved, "col": moved}
        wanted = []
        for structure, own in BLADE:
            lags = np.full((len(structure.outputs), len(structure.inputs)), 0.040)
            driven = np.column_stack([ours[name] for name in structure.inputs])
            wanted.append(delayed(linear(structure, own), driven, step, lags))
        wanted = np.hstack(wanted)  # p, q, r, w
        errors.append(np.max(np.abs(found - wanted), axis=0) / np.max(np.abs(wanted), axis=0))
    # Euler's error, of first order: a quarter with a quarter of the step
    assert np.all(errors[1] < 0.01)
    assert np.all(errors[1] < 0.35 * errors[0])
