"""The paper's experiment from end to end: test on the ground, fly, record, identify, compare."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from helisim import ident
from helisim.before_after import before_and_after
from helisim.comparison import ComparisonTable, GivenValue, ParameterRow, Results
from helisim.errata import errata
from helisim.errors import InputError
from helisim.exact import exact_response, true_values
from helisim.experiment import MODELS, Given, Model
from helisim.flights import (
    FOLDER,
    Flights,
    flown_each_axis,
    fly_doublets,
    fly_sweeps,
    read_flights,
)
from helisim.output.evidence import Evidence, write_evidence
from helisim.output.report import write_report
from helisim.output.run import Run
from helisim.overall import check_overall
from helisim.provenance import versions
from helisim.record import FlightRecord
from helisim.reference import ReferenceTable, published
from helisim.sim import Recorder
from helisim.sim.rigs import RigTest, run_rigs
from helisim.storage import make_folder, write_json
from helisim.vehicle import Vehicle, calibrate, load, read_parameters
from helisim.vehicle.assembly import model_folder
from helisim.vehicle.parameters import to_toml

_CALIBRATED_HEADER = """\
Written by `helisim calibrate --write`; not by hand.
Solved so that the linearised nonlinear model has the published derivatives."""

GroundTests = Mapping[str, RigTest]
"""By rig."""


def reproduce(
    *,
    out: Path | None = None,
    flights: int = 10,
    seed: int = 1,
    jobs: int | None = None,
    parameters: Mapping[str, float] | None = None,
    timestep: float | None = None,
    rotor: bool = False,
    reuse: bool = False,
    with_report: bool = True,
    on_progress: Callable[[str], None] | None = None,
) -> tuple[Results, Flights]:
    """Test on the ground, fly sweeps on all four axes, identify the models, compare with truth.

    Args:
        out: folder for `results.json`, `flights/` and the report; nothing is written if None.
        flights: kept on each axis; some more are flown and the least coherent left out.
        seed: of pilots and sensors.
        jobs: threads; all processors if None.
        parameters: physical parameters that replace the calibrated ones, for another truth;
            the paper is then printed but not judged by.
        timestep: s, of the simulation; the model's own if None.
        rotor: True records the rotor's true tilt and loads too, to look at.
        reuse: True takes the flights that an earlier run left in `out`, and flies none.
        with_report: False leaves `report.html` and `figures/` out.
        on_progress: called with a word after each flight, each model and the report.

    Returns:
        The results, and the kept records by axis.

    Raises:
        InputError: a number is out of range, or the flights to reuse are another vehicle's.
        DivergedError: a flight left the validity of the model.
        StorageError: `out` can't be read or written.
    """
    if flights < 1:
        raise InputError(f"flights must be 1 or more, got {flights}")
    if reuse and out is None:
        raise InputError("reuse needs the folder of the run whose flights are used again")
    if out is not None:
        make_folder(out / FOLDER)
    vehicle = load("jr700", parameters=parameters, timestep=timestep)
    tell = on_progress or (lambda _: None)
    recorder = Recorder.of(vehicle, rotor=rotor)
    if reuse and out is not None:
        kept, doublets, excluded = read_flights(vehicle, seed, out)
    else:
        kept, excluded = fly_sweeps(vehicle, flights, seed, jobs, recorder, out, tell)
        doublets = fly_doublets(vehicle, seed, recorder, out)
    ground = {test.rig: test for test in run_rigs(vehicle, seed=seed, recorder=recorder)}
    tables: dict[str, ComparisonTable] = {}
    evidence = []
    for model in MODELS:
        fit = identify_model(model, kept, before=tables, ground=ground)
        tables[model.name] = compare(vehicle, model, fit, recorder, judge_paper=not parameters)
        evidence.append(_evidence(vehicle, model, fit, recorder, doublets))
        tell(model.name)
    results = Results(
        tables=tuple(tables.values()),
        seed=seed,
        versions=versions(),
        configuration={
            "arguments": {
                "flights": len(kept["lat"]),
                "seed": seed,
                "parameters": dict(parameters or {}),
                "timestep": timestep,
                "rotor": rotor,
            },
            "vehicle": vehicle.name,
            "model_digest": vehicle.digest,
            "flights_kept_each_axis": len(kept["lat"]),
            "flown_each_axis": flown_each_axis(len(kept["lat"])),
            "timestep_s": float(vehicle.model.opt.timestep),
            "parameters": dict(parameters or {}),
            "recorder": recorder.as_dict(),
        },
        excluded=excluded,
        further={
            "ground": ground,
            "verification": {
                item.name: item.verification for item in evidence if item.verification is not None
            },
            "before_after": before_and_after(tables["rollpitch_in1"], tables["rollpitch_in2"]),
            "eq_8": check_overall(tables["yaw_base"], tables["yaw_gyro"], tables["yaw_overall"]),
        },
    )
    if out is not None:
        write_json(results.to_dict(), out / "results.json", indent=2)
        write_evidence(out / "fits.json", evidence)
        if with_report:
            report(out)
            tell("report")
    return results, kept


def report(folder: Path, run: Run | None = None) -> Path:
    """Write a run's `report.html` and `figures/` from its other files; return the report's path.

    The files are read again unless the `run` in them is given.

    Raises:
        StorageError: a file can't be read or written.
        InputError: a file holds something else.
    """
    return write_report(folder, errata=errata(), run=run)


def frequency_response(model: Model, flights: Flights) -> ident.FrequencyResponse:
    """Return the frequency response of one model from the pooled records of its sweeps."""
    records = [record for axis in model.sweeps for record in flights[axis]]
    return ident.frequency_response(
        records,
        inputs=model.inputs,
        outputs=model.outputs,
        conditioning=model.conditioning or None,
        reference=model.reference or None,
        band=_usable_band(model.band, records),
    )


def _usable_band(band: tuple[float, float], records: list[FlightRecord]) -> tuple[float, float]:
    """Raise the lower edge to what few flights can resolve (window <= T_F / 5)."""
    longest_window = min(
        0.5 * min(record.duration for record in records),
        0.2 * sum(record.duration for record in records),
    )
    return max(band[0], 1.01 * 2.0 * np.pi / longest_window), band[1]


def identify_model(
    model: Model,
    flights: Flights,
    *,
    before: Mapping[str, ComparisonTable] | None = None,
    ground: GroundTests | None = None,
) -> ident.Fit:
    """Identify one model from the records.

    Args:
        model: to identify.
        flights: records by axis.
        before: tables by name, whose identified values the model is given.
        ground: tests by rig, whose findings the model is given.
    """
    given = {
        name: _given(source, before or {}, ground or {}) for name, source in model.given.items()
    }
    estimated = frequency_response(model, flights)
    return ident.identify(estimated, model.structure.with_fixed(given), weighting=model.weighting)


def _given(source: Given, before: Mapping[str, ComparisonTable], ground: GroundTests) -> float:
    if source.source in ground:
        return ground[source.source][source.name].value
    return before[source.source][source.name].identified


def compare(
    vehicle: Vehicle,
    model: Model,
    fit: ident.Fit,
    recorder: Recorder,
    *,
    judge_paper: bool = True,
) -> ComparisonTable:
    """Set an identified model beside the truth and the paper.

    What the fit was given is listed apart, and judged where the model has a tolerance for it.
    """
    truth = true_values(vehicle, model, recorder, like=fit.data)
    paper = published(vehicle.name).table(model.name)
    found = [name for name in fit.values if name not in model.given or name in model.tolerances]
    return ComparisonTable(
        name=model.name,
        input=model.input,
        cost=fit.cost,
        band_rad_s=fit.band,
        parameters=tuple(_row(fit, name, truth, paper, model, judge_paper) for name in found),
        given=tuple(
            GivenValue(name=name, unit=fit[name].unit, value=fit[name].value, source=one.source)
            for name, one in model.given.items()
        ),
    )


def _row(
    fit: ident.Fit,
    name: str,
    truth: Mapping[str, float],
    paper: ReferenceTable,
    model: Model,
    judge_paper: bool,
) -> ParameterRow:
    fitted = fit[name]
    printed = paper.get(name)
    tolerance = model.tolerances.get(name)
    limits: dict[str, Any] = {}
    if tolerance is not None:
        limits |= {
            "tolerance_percent": tolerance.percent,
            "tolerance_reason": tolerance.reason,
        }
        if judge_paper and printed is not None:
            bound = model.paper_tolerance(name, printed.cr_percent)
            limits |= {
                "paper_tolerance_percent": bound.percent,
                "paper_tolerance_reason": bound.reason,
            }
    given = name in model.given
    return ParameterRow(
        name=name,
        unit=fitted.unit or (printed.unit if printed else ""),
        identified=fitted.value,
        truth=truth.get(name),
        paper=None if printed is None else printed.value,
        cr_percent=None if given else fitted.cr_percent,
        insensitivity_percent=None if given else fitted.insensitivity_percent,
        **limits,
    )


def _evidence(
    vehicle: Vehicle,
    model: Model,
    fit: ident.Fit,
    recorder: Recorder,
    doublets: Mapping[str, FlightRecord],
) -> Evidence:
    unseen = {axis: doublets[axis] for axis in model.verified_by}
    return Evidence(
        model.name,
        fit,
        exact=exact_response(vehicle, model, recorder, np.geomspace(*model.band, 200)),
        note=model.note,
        verification=ident.verify(fit, list(unseen.values())) if unseen else None,
        verified_on=tuple(f"{axis}_doublet" for axis in unseen),
    )


def calibrated_text(name: str) -> str:
    """Return a vehicle's `calibrated.toml`, solved from what is published of it.

    Raises:
        UnknownNameError: no such vehicle, or nothing is published of it.
        ModelError: the published derivatives can't be met.
    """
    folder = model_folder(name)
    known = published(name)
    files = (folder / "parameters.toml", folder / "tuned.toml")
    given = read_parameters(*(path for path in files if path.is_file()))
    return to_toml(calibrate(name, given, known.targets, known.source), _CALIBRATED_HEADER)
