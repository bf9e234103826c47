"""A small run, made without flying: models fitted to the exact responses of the paper's tables."""

import json
from pathlib import Path

import numpy as np

from helisim import ident
from helisim.ident.evaluate import response
from helisim.ident.verification import Trace
from helisim.records.record import CHANNELS, POSITIONS, FlightRecord
from helisim.records.storage import write_record
from helisim.sim.rigs import Finding, RigTest
from helisim.study.comparison import ComparisonTable, ParameterRow
from helisim.study.paper import Change, Coefficient, GyroEffect, OverallCheck, published
from helisim.study.results import Exclusion, IdentifiedModel, Results, write_models

MODELS = {
    "heave": (ident.structures.heave, {"Z_w": -0.9403, "Z_col": -41.8503, "tau_col": 0.008}),
    "rollpitch_in1": (
        ident.structures.rollpitch,
        {value.name: value.value for value in published("jr700")["rollpitch_in1"]},
    ),
}

_K_P = {"value": 0.865123, "truth": 0.8646, "standard_error": 0.0021}
_TAU_F = {"paper_before": 0.04456, "paper_after": 0.0323, "before": 0.0441, "after": 0.0325}
_B1 = {"paper": 175.969, "parts": 176.5, "direct": 174.9}
GROUND = RigTest(
    rig="bench",
    findings=(
        Finding(name="k_p", unit="1", **_K_P, how="jump of the pedal over the step"),
        Finding(name="tau_r", unit="s", value=0.0405, how="late"),
        Finding(name="offset", unit="m", value=0.0003, truth=2.776e-17, standard_error=0.0005),
    ),
)
GYRO_EFFECT = GyroEffect(changes=(Change(name="tau_f", unit="s", **_TAU_F),))
_PHASE = {"phase_deg": 1.5, "phase_at_rad_s": 25.0, "band_rad_s": (0.6, 25.0)}
EQ_8 = OverallCheck(
    coefficients=(Coefficient(name="b1", unit="rad/s^2", **_B1),),
    gain_db=-0.1234,
    gain_at_rad_s=20.0,
    **_PHASE,
)


def make_model(name: str, *, verified: bool = False) -> IdentifiedModel:
    structure, values = MODELS[name]
    omega = np.geomspace(0.5, 30.0, 60)
    names = {"inputs": structure.inputs, "outputs": structure.outputs}
    exact = ident.FrequencyResponse.exact(omega, response(structure, values, omega), **names)
    found = {"fit": ident.identify(exact, structure), "exact": exact}
    if verified:
        found |= {"verification": make_verification(structure), "verified_on": ("doublet",)}
    return IdentifiedModel(name, **found, note="a note with < and &")


def make_verification(structure: ident.Structure) -> ident.Verification:
    time = np.arange(400) / 100.0
    n_out = len(structure.outputs)
    measured = np.sin(time)[:, None] * np.arange(1, n_out + 1)
    trace = Trace(
        time,
        np.cos(time)[:, None] * np.ones(len(structure.inputs)),
        measured,
        0.9 * measured,
        np.zeros(n_out),
        measured - measured.mean(axis=0),
    )
    by_output = dict(zip(structure.outputs, trace.tic.tolist()))
    return ident.Verification(
        inputs=structure.inputs,
        outputs=structure.outputs,
        units=("rad/s",) * n_out,
        traces=(trace,),
        j_rms=0.1234567,
        tic=0.0512345,
        j_rms_by_output=dict(zip(structure.outputs, trace.j_rms.tolist())),
        tic_by_output=by_output,
    )


def make_flight(names=tuple(CHANNELS), n: int = 300, **provenance) -> FlightRecord:
    time = np.arange(n) / 100.0
    phase = np.arange(len(names))
    values = 0.1 * np.sin(time[:, None] * (1.0 + phase) + phase)
    if "thrust" in names:
        values[:, names.index("thrust")] += 78.5
    for k, name in enumerate(POSITIONS):
        if name in names:
            values[:, names.index(name)] += (5.0, 6.0, -20.0)[k]
    return FlightRecord(time, values, tuple(CHANNELS[name] for name in names), provenance)


def _table(item: IdentifiedModel) -> ComparisonTable:
    printed, rows = published("jr700")[item.name], []
    for name, one in item.fit.parameters.items():
        kept = ("unit", "cr_percent", "insensitivity_percent", "support")
        judged = {key: getattr(one, key) for key in kept}
        judged |= {"tolerance_percent": 3.0, "tolerance_reason": "for the test", "name": name}
        paper, truth = getattr(printed.get(name), "value", None), MODELS[item.name][1][name]
        rows.append(ParameterRow(identified=one.value, truth=truth, paper=paper, **judged))
    found = {"cost": item.fit.cost, "band_rad_s": tuple(item.fit.band)}
    return ComparisonTable(name=item.name, input="IN1", parameters=tuple(rows), **found)


def write_run(folder: Path) -> Results:
    items = [make_model("heave"), make_model("rollpitch_in1", verified=True)]
    tables = tuple(_table(item) for item in items)
    flown = {"flights_kept_each_axis": 1, "flown_each_axis": 2, "timestep_s": 0.002}
    flown |= {"parameters": {}, "recorder": {"rate_hz": 100.0, "antialias_hz": 40.0}}
    coherent = {"coherence": 0.98765, "limit": 0.99, "kept": 1}
    results = Results(
        tables=tables,
        seed=7,
        versions={"helisim": "0.1.0", "mujoco": "4.0.0"},
        configuration=flown,
        excluded=(Exclusion(flight="lat_01", reason="less coherent", **coherent),),
        ground={"bench": GROUND},
        verification={items[1].name: items[1].verification.figures},
        gyro_effect=GYRO_EFFECT,
        eq_8=EQ_8,
    )
    (folder / "results.json").write_text(json.dumps(results.to_dict()))
    write_models(folder / "fits.json", items)
    (folder / "flights").mkdir()
    swept = {"kind": "Sweep", "axis": "lat", "duration": 3.0, "trim_time": 0.5}
    for name in ("lat_01", "lat_02", "col_01"):
        own = {"main_rotor.radius": 0.767, "airframe.mass": 8.01}
        record = make_flight(excitation=swept, parameters=own, flight=name)
        write_record(record, folder / "flights" / f"{name}.parquet")
    return results
