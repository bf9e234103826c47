"""An identified model flies in ArduPilot's state-space simulation as it does here."""

import json
from collections import defaultdict

import numpy as np

from helisim.base.units import STANDARD_GRAVITY as G
from helisim.ident import structures
from helisim.ident.ardupilot import ArduPilotModel, numbers_of
from helisim.ident.evaluate import delayed, linear
from helisim.study.paper import published

SETTINGS = {"nominal_rpm": 2100.0, "coll_min": -2.0, "coll_max": 12.0, "coll_hover": 5.0}
FULL = dict.fromkeys(("col", "lon", "lat", "ped"), 1.0)
OF = {"rollpitch": "rollpitch_in1", "yaw_base": "yaw_base", "heave": "heave"}
BLADE = [
    (structures.named(name), {x.name: x.value for x in published("blade360")[table].values}, FULL)
    for name, table in OF.items()
]


def simulated(values, added, step, hold=False):
    """Motion and commands as SIM_StateSpace.cpp (commit 569e2a2) steps them, near the hover.

    First the rotor, from the rates before; then the accelerations; Euler. Commands roll pitch coll
    yaw wait in a buffer of delay / step samples. `hold` adds a pilot who keeps the attitude, or
    roll and pitch drift off as the vehicle is unstable. Columns: p q r w dw/dt roll pitch coll yaw.
    """
    get = defaultdict(float, values)
    late = {key: min(100, int(get[f"time_delay_{key}"])) for key in ("rp", "ped", "col")}
    lines = {key: int(delay * 0.001 / step) for key, delay in late.items()}
    hover = (get["coll_hover"] - get["coll_min"]) / (get["coll_max"] - get["coll_min"])
    lean = get["hover_lean"] * 0.01745
    u = v = w = p = q = r = theta = a = b = 0.0
    phi, commands, out = lean, np.array(added), []
    for k in range(len(commands)):
        if hold:
            commands[k, :2] -= 0.04 * p + 0.2 * (phi - lean), 0.08 * q + 0.2 * theta
        roll, pitch = commands[max(0, k - lines["rp"]), :2]
        coll = commands[max(0, k - lines["col"]), 2] - hover
        yaw = commands[max(0, k - lines["ped"]), 3]
        tilt_b = get["Lfa1s"] * a + get["Lflt"] * roll + get["Lflg"] * pitch - b
        tilt_a = get["Mfb1s"] * b + get["Mflt"] * roll + get["Mflg"] * pitch - a
        a, b = a + step * (tilt_a / get["tf"] - q), b + step * (tilt_b / get["tf"] - p)
        accelerations = (
            get["Xa1s"] * a + get["Xu"] * u + get["Xlon"] * pitch - G * theta,
            get["Yb1s"] * b + get["Yv"] * v + get["Yp"] * p + get["Ylat"] * roll + G * (phi - lean),
            get["Zcol"] * coll + get["Zw"] * w,
            get["Lb1s"] * b + get["Lu"] * u + get["Lv"] * v + get["Lp"] * p + get["Lq"] * q
            + get["Llat"] * roll + get["Llon"] * pitch,
            get["Ma1s"] * a + get["Mu"] * u + get["Mv"] * v + get["Mp"] * p + get["Mq"] * q
            + get["Mlat"] * roll + get["Mlon"] * pitch,
            get["Nr"] * r + get["Nv"] * v + get["Nw"] * w + get["Nped"] * yaw + get["Ncol"] * coll,
        )  # fmt: skip
        out.append((p, q, r, w, accelerations[2]))
        moved = zip((u, v, w, p, q, r, phi, theta), (*accelerations, p, q))
        u, v, w, p, q, r, phi, theta = (one + step * rate for one, rate in moved)
    return np.column_stack([out, commands])


def test_simulating_the_file_as_ardupilot_does_gives_the_identified_motion(tmp_path):
    numbers, _ = numbers_of(BLADE, late={})
    ArduPilotModel({**numbers, **SETTINGS}).write(tmp_path / "blade.json")
    values = json.loads((tmp_path / "blade.json").read_text())
    errors = []
    for step in (1.0 / 2000.0, 1.0 / 8000.0):
        time = np.arange(0.0, 1.5, step)
        moved = 0.05 * ((time > 0.1) & (time < 0.4)) - 0.05 * ((time >= 0.4) & (time < 0.7))
        commands = np.column_stack([moved, 0.5 * moved, 0.5 + moved, moved])
        found = simulated(values, commands, step)[:, :4]
        ours = {"lat": moved, "lon": 0.5 * moved, "ped": moved, "col": moved}
        wanted = []
        for structure, own, _ in BLADE:
            lags = np.full((len(structure.outputs), len(structure.inputs)), 0.040)
            driven = np.column_stack([ours[name] for name in structure.inputs])
            wanted.append(delayed(linear(structure, own), driven, step, lags))
        wanted = np.hstack(wanted)  # p, q, r, w
        errors.append(np.max(np.abs(found - wanted), axis=0) / np.max(np.abs(wanted), axis=0))
    # Euler's error, of first order: a quarter with a quarter of the step
    assert np.all(errors[1] < 0.01)
    assert np.all(errors[1] < 0.35 * errors[0])
