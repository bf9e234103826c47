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
from helisim.study.paper import Change, Coefficient, GyroEffect, OverallCheck, Statement, published
from helisim.study.results import Exclusion, IdentifiedModel, Results, write_models

MODELS = {
    "heave": (ident.structures.heave, {"Z_w": -0.9403, "Z_col": -41.8503, "tau_col": 0.008}),
    "rollpitch_in1": (
        ident.structures.rollpitch,
        {value.name: value.value for value in published("jr700")["rollpitch_in1"]},
    ),
}

GROUND = RigTest(
    rig="bench",
    findings=(
        Finding(
            name="k_p",
            unit="1",
            value=0.865123,
            truth=0.8646,
            standard_error=0.0021,
            how="jump of the pedal over the step",
        ),
        Finding(name="tau_r", unit="s", value=0.0405, how="late"),
        Finding(name="offset", unit="m", value=0.0003, truth=2.776e-17, standard_error=0.0005),
    ),
    notes=("one factor is a convention",),
)
GYRO_EFFECT = GyroEffect(
    changes=(
        Change(
            name="tau_f",
            unit="s",
            paper_before=0.04456,
            paper_after=0.0323,
            before=0.0441,
            after=0.0325,
        ),
    ),
    statements=(Statement(said="tau_f rises", paper="tau_f -27.5 %", identified="tau_f -26.3 %"),),
)
EQ_8 = OverallCheck(
    coefficients=(
        Coefficient(name="b1", unit="rad/s^2", paper=175.969, parts=176.5, direct=174.9),
    ),
    band_rad_s=(0.6, 25.0),
    gain_db=-0.1234,
    gain_at_rad_s=20.0,
    phase_deg=1.5,
    phase_at_rad_s=25.0,
)


def make_model(name: str, *, verified: bool = False) -> IdentifiedModel:
    """Return a model fitted to its exact response."""
    structure, values = MODELS[name]
    omega = np.geomspace(0.5, 30.0, 60)
    exact = ident.FrequencyResponse.exact(
        omega,
        response(structure, values, omega),
        inputs=structure.inputs,
        outputs=structure.outputs,
    )
    fit = ident.identify(exact, structure)
    return IdentifiedModel(
        name,
        fit,
        exact=exact,
        note="a note with < and &",
        verification=make_verification(structure) if verified else None,
        verified_on=("doublet",) if verified else (),
    )


def make_verification(structure: ident.Structure) -> ident.Verification:
    """Return a verification on one flight of 4 s."""
    time = np.arange(400) / 100.0
    n_out = len(structure.outputs)
    measured = np.sin(time)[:, None] * np.arange(1, n_out + 1)
    trace = Trace(
        time,
        np.cos(time)[:, None] * np.ones(len(structure.inputs)),
        measured,
        0.9 * measured,
        np.zeros(n_out),
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
    """Return a record of smooth motions near the hover at 20 m."""
    time = np.arange(n) / 100.0
    phase = np.arange(len(names))
    values = 0.1 * np.sin(time[:, None] * (1.0 + phase) + phase)
    if "thrust" in names:
        values[:, names.index("thrust")] += 78.5
    for k, name in enumerate(POSITIONS):
        if name in names:
            values[:, names.index(name)] += (5.0, 6.0, -20.0)[k]
    return FlightRecord(time, values, tuple(CHANNELS[name] for name in names), provenance)


def write_run(folder: Path) -> Results:
    """Write a run's files into a folder, and return its results."""
    items = [make_model("heave"), make_model("rollpitch_in1", verified=True)]
    tables = []
    for item in items:
        printed = published("jr700")[item.name]
        rows = []
        for name, one in item.fit.parameters.items():
            paper = printed.get(name)
            rows.append(
                ParameterRow(
                    name=name,
                    unit=one.unit,
                    identified=one.value,
                    truth=MODELS[item.name][1][name],
                    paper=None if paper is None else paper.value,
                    cr_percent=one.cr_percent,
                    insensitivity_percent=one.insensitivity_percent,
                    support=one.support,
                    tolerance_percent=3.0,
                    tolerance_reason="for the test",
                )
            )
        low, high = item.fit.band
        tables.append(
            ComparisonTable(
                name=item.name,
                input="IN1",
                cost=item.fit.cost,
                band_rad_s=(low, high),
                parameters=tuple(rows),
            )
        )
    results = Results(
        tables=tuple(tables),
        seed=7,
        versions={"helisim": "0.1.0", "mujoco": "4.0.0"},
        configuration={
            "flights_kept_each_axis": 1,
            "flown_each_axis": 2,
            "timestep_s": 0.002,
            "parameters": {},
            "recorder": {"rate_hz": 100.0, "antialias_hz": 40.0},
        },
        excluded=(
            Exclusion(
                flight="lat_01", reason="less coherent", coherence=0.98765, limit=0.99, kept=1
            ),
        ),
        ground={"bench": GROUND},
        verification={
            item.name: item.verification.figures for item in items if item.verification is not None
        },
        gyro_effect=GYRO_EFFECT,
        eq_8=EQ_8,
    )
    (folder / "results.json").write_text(json.dumps(results.to_dict()))
    write_models(folder / "fits.json", items)
    (folder / "flights").mkdir()
    flown = {"kind": "Sweep", "axis": "lat", "duration": 3.0, "trim_time": 0.5}
    for name in ("lat_01", "lat_02", "col_01"):
        record = make_flight(excitation=flown, parameters={"main_rotor.radius": 0.767}, flight=name)
        write_record(record, folder / "flights" / f"{name}.parquet")
    return results
