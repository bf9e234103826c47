"""The paper's experiment from end to end: fly, record, identify, compare."""

import json
from collections.abc import Callable, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim import ident
from helisim.channels import AXES
from helisim.comparison import ComparisonTable, ParameterRow, Results, paper_tolerance
from helisim.errata import errata
from helisim.errors import InputError
from helisim.experiment import MODELS, Model
from helisim.output.evidence import Evidence, write_evidence
from helisim.output.report import write_report
from helisim.record import FlightRecord
from helisim.reference import ReferenceTable, jr700
from helisim.sim import Doublet, Recorder, Sweep, fly
from helisim.storage import atomic_write, make_folder, write_record
from helisim.vehicle import Linearization, Vehicle, calibrate, load, read_parameters
from helisim.vehicle.assembly import model_folder
from helisim.vehicle.parameters import to_toml

_RESPONSE = {"lat": ("LAT", "p"), "lon": ("LON", "q"), "ped": ("PED", "r"), "col": ("COL", "w")}
"""Axis -> the stick and the motion by whose coherence a sweep is judged."""

_GYRO_GAINS = ("k_p", "k_I", "k_delta", "k_a")

_CALIBRATED_HEADER = """\
Written by `helisim calibrate --write`; not by hand.
Solved so that the linearised nonlinear model has the paper's derivatives."""

Flights = dict[str, list[FlightRecord]]


def reproduce(
    *,
    out: Path | None = None,
    flights: int = 10,
    seed: int = 1,
    jobs: int | None = None,
    parameters: Mapping[str, float] | None = None,
    timestep: float | None = None,
    rotor: bool = False,
    on_progress: Callable[[str], None] | None = None,
) -> tuple[Results, Flights]:
    """Fly sweeps on all four axes, keep the best, identify the models, set them beside truth.

    Args:
        out: folder for `results.json`, `flights/` and the report; nothing is written if None.
        flights: kept on each axis; some more are flown and the least coherent left out.
        seed: of pilots and sensors.
        jobs: threads; all processors if None.
        parameters: physical parameters that replace the calibrated ones, for another truth;
            the paper is then printed but not judged by.
        timestep: s, of the simulation; the model's own if None.
        rotor: True records the rotor's true tilt and loads too, to look at.
        on_progress: called with a word after each flight, each model and the report.

    Returns:
        The results, and the kept records by axis.

    Raises:
        InputError: a number is out of range.
        DivergedError: a flight left the validity of the model.
        StorageError: `out` can't be written.
    """
    if flights < 1:
        raise InputError(f"flights must be 1 or more, got {flights}")
    folder = _prepared_folder(out)
    vehicle = load("jr700", parameters=parameters, timestep=timestep)
    tell = on_progress or (lambda _: None)
    recorder = Recorder.of(vehicle, rotor=rotor)
    kept, excluded = fly_sweeps(vehicle, flights, seed, jobs, recorder, folder, tell)
    doublets = fly_doublets(vehicle, seed, recorder, folder)
    tables: dict[str, ComparisonTable] = {}
    evidence = []
    for model in MODELS:
        fit = identify_model(vehicle, model, kept, before=tables)
        tables[model.name] = compare(vehicle, model, fit, recorder, judge_paper=not parameters)
        exact = exact_response(vehicle, model, recorder, np.geomspace(*model.band, 200))
        unseen = {axis: doublets[axis] for axis in model.verified_by}
        verification = ident.verify(fit, list(unseen.values())) if unseen else None
        evidence.append(
            Evidence(
                model.name,
                fit,
                exact=exact,
                note=model.note,
                verification=verification,
                verified_on=tuple(f"{axis}_doublet" for axis in unseen),
            )
        )
        tell(model.name)
    results = Results(
        tables=tuple(tables.values()),
        seed=seed,
        versions={name: version(name) for name in ("helisim", "mujoco", "numpy", "scipy", "numba")},
        configuration={
            "flights_kept_each_axis": flights,
            "flown_each_axis": _flown(flights),
            "timestep_s": float(vehicle.model.opt.timestep),
            "parameters": dict(parameters or {}),
            "recorder": recorder.as_dict(),
        },
        excluded=excluded,
    )
    if folder is not None:
        with atomic_write(folder / "results.json") as path:
            path.write_text(json.dumps(results.to_dict(), indent=2, allow_nan=False) + "\n")
        write_evidence(folder / "fits.json", evidence)
        report(folder)
        tell("report")
    return results, kept


def report(folder: Path) -> Path:
    """Write a run's `report.html` and `figures/` from its other files; return the report's path.

    Raises:
        StorageError: a file can't be read or written.
        InputError: a file holds something else.
    """
    return write_report(folder, errata=errata())


def flights_in_all(flights: int) -> int:
    """Return how many sweeps are flown to keep `flights` on each axis."""
    return _flown(flights) * len(AXES)


def _flown(flights: int) -> int:
    return flights + max(1, round(0.2 * flights))


def _prepared_folder(out: Path | None) -> Path | None:
    if out is not None:
        make_folder(out / "flights")
    return out


def fly_sweeps(
    vehicle: Vehicle,
    flights: int,
    seed: int,
    jobs: int | None,
    recorder: Recorder,
    folder: Path | None,
    tell: Callable[[str], None],
) -> tuple[Flights, tuple[str, ...]]:
    """Fly every axis, write every record, and keep the most coherent ones.

    Returns:
        The kept records by axis, and one sentence for each that was left out.
    """
    kept: Flights = {}
    excluded: list[str] = []
    for number, axis in enumerate(AXES):
        records = fly(
            vehicle,
            Sweep(axis=axis),
            count=_flown(flights),
            seed=seed * len(AXES) + number,
            jobs=jobs,
            recorder=recorder,
            on_flight=lambda axis=axis: tell(axis),
        )
        names = [f"{axis}_{k + 1:02d}" for k in range(len(records))]
        if folder is not None:
            for name, record in zip(names, records):
                write_record(record, folder / "flights" / f"{name}.parquet")
        scores = [sweep_coherence(record, axis) for record in records]
        best = sorted(np.argsort(scores)[::-1][:flights])
        kept[axis] = [records[k] for k in best]
        excluded += [
            f"flight {names[k]}: its mean coherence of {scores[k]:.4f} is not among the best "
            f"{flights} (the least coherent kept has {min(scores[i] for i in best):.4f})"
            for k in range(len(records))
            if k not in best
        ]
    return kept, tuple(excluded)


def fly_doublets(
    vehicle: Vehicle, seed: int, recorder: Recorder, folder: Path | None
) -> dict[str, FlightRecord]:
    """Fly a doublet on each axis that a model is verified on; no fit sees them."""
    axes = dict.fromkeys(axis for model in MODELS for axis in model.verified_by)
    records = {}
    for axis in axes:
        (records[axis],) = fly(
            vehicle, Doublet(axis=axis), seed=seed * len(AXES), recorder=recorder
        )
        if folder is not None:
            write_record(records[axis], folder / "flights" / f"{axis}_doublet.parquet")
    return records


def sweep_coherence(record: FlightRecord, axis: str) -> float:
    """Return the mean coherence between the swept stick and its motion, one flight alone."""
    stick, motion = _RESPONSE[axis]
    sweep = Sweep(axis=axis)
    band = (max(1.0, sweep.omega[0]), 0.8 * sweep.omega[1])
    frf = ident.frequency_response(record, inputs=stick, outputs=motion, band=band)
    return float(np.mean(frf.coherence))


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
    vehicle: Vehicle,
    model: Model,
    flights: Flights,
    *,
    before: Mapping[str, ComparisonTable] | None = None,
) -> ident.Fit:
    """Identify one model from the records.

    Args:
        vehicle: whose gyro was set as known.
        model: to identify.
        flights: records by axis.
        before: tables by name, whose identified values the model takes as known.
    """
    known = {name: (before or {})[table][name].identified for name, table in model.known.items()}
    known |= {name: vehicle.parameters[setting] for name, setting in model.settings.items()}
    structure = model.structure.with_fixed(known) if known else model.structure
    estimated = frequency_response(model, flights)
    return ident.identify(estimated, structure, weighting=model.weighting)


def compare(
    vehicle: Vehicle,
    model: Model,
    fit: ident.Fit,
    recorder: Recorder,
    *,
    judge_paper: bool = True,
) -> ComparisonTable:
    """Set an identified model beside the truth and the paper."""
    truth = true_values(vehicle, model, recorder)
    paper = jr700.table(model.name)
    found = [name for name in fit.values if name not in model.known]
    rows = [_row(fit, name, truth, paper, model, judge_paper) for name in found]
    return ComparisonTable(
        name=model.name,
        input=model.input,
        cost=fit.cost,
        band_rad_s=fit.band,
        parameters=tuple(rows),
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
    published = paper.get(name)
    tolerance = model.tolerances.get(name)
    limits: dict[str, Any] = {}
    if tolerance is not None:
        limits |= {
            "tolerance_percent": tolerance.percent,
            "tolerance_reason": tolerance.reason,
        }
        if judge_paper and published is not None:
            percent, reason = paper_tolerance(published.cr_percent)
            limits |= {"paper_tolerance_percent": percent, "paper_tolerance_reason": reason}
    return ParameterRow(
        name=name,
        unit=fitted.unit or (published.unit if published else ""),
        identified=fitted.value,
        truth=truth.get(name),
        paper=None if published is None else published.value,
        cr_percent=fitted.cr_percent,
        insensitivity_percent=fitted.insensitivity_percent,
        **limits,
    )


def true_values(vehicle: Vehicle, model: Model, recorder: Recorder) -> dict[str, float]:
    """Return the true parameters of a model from the exact linearisation of the vehicle.

    Delays are the servos' equivalent delay and the recorder's latencies. The overall yaw
    model has no parameters of its own in the vehicle: its truth is the structure fitted to
    the exact frequency response.
    """
    if model.settings:
        gains = {name: vehicle.parameters[f"gyro.{name.lower()}"] for name in _GYRO_GAINS}
        return {**gains, "tau_PED": vehicle.parameters["gyro.ped_latency"]}
    if model.input == "IN2":
        return _fitted_truth(vehicle, model, recorder)
    late = recorder.latency
    true = dict(vehicle.derivatives)
    for delay, axis, motion in (
        ("tau_r_base", "ped", "r"),
        ("tau_lat", "lat", "p"),
        ("tau_lon", "lon", "q"),
        ("tau_col", "col", "w"),
    ):
        true[delay] = vehicle.servo_delay(axis) + late.get(motion, 0.0) - late.get(axis, 0.0)
    return true


def _fitted_truth(vehicle: Vehicle, model: Model, recorder: Recorder) -> dict[str, float]:
    exact = exact_response(vehicle, model, recorder, np.geomspace(*model.band, 200))
    return dict(ident.identify(exact, model.structure, weighting=model.weighting).values)


def exact_response(
    vehicle: Vehicle, model: Model, recorder: Recorder, omega: NDArray[np.float64]
) -> ident.FrequencyResponse:
    """Return the exact response of a model's channels, recorder latencies included.

    It is what the estimate tends to. With a reference, that is the joint input-output method's:
    the sticks drive the closed loop, and outputs over inputs have the conditioning channels held.
    """
    if model.reference:
        linear, given = vehicle.linearize("IN2"), (*model.inputs, *model.conditioning)
        driven = _recorded(linear, given, model.reference, recorder, omega)
        answer = _recorded(linear, model.outputs, model.reference, recorder, omega)
        # H U = Y at each frequency, axes (outputs, inputs, frequencies)
        response = np.linalg.solve(driven.T, answer.T).T[:, : len(model.inputs)]
    else:
        linear = vehicle.linearize("IN2" if model.input == "IN2" else "IN1")
        late = np.array([recorder.latency.get(name, 0.0) for name in model.inputs])
        response = _recorded(linear, model.outputs, model.inputs, recorder, omega)
        response = response * np.exp(1j * late[None, :, None] * omega)
    return ident.FrequencyResponse.exact(
        omega, response, inputs=model.inputs, outputs=model.outputs
    )


def _recorded(
    linear: Linearization,
    outputs: tuple[str, ...],
    inputs: tuple[str, ...],
    recorder: Recorder,
    omega: NDArray[np.float64],
) -> NDArray[np.complex128]:
    """Return the response of outputs, as late as they are recorded, (n_out, n_in, n_freq)."""
    rows = [linear.system.output_labels.index(name) for name in outputs]
    columns = [linear.system.input_labels.index(name) for name in inputs]
    late = np.array([recorder.latency.get(name, 0.0) for name in outputs])
    response = linear.response(omega)[np.ix_(rows, columns)]
    return response * np.exp(-1j * late[:, None, None] * omega)


def named_records(flights: Flights) -> dict[str, FlightRecord]:
    """Return all kept records by a name such as "lat_01"."""
    return {
        f"{axis}_{k + 1:02d}": record for axis in AXES for k, record in enumerate(flights[axis])
    }


def calibrated_text(name: str) -> str:
    """Return a vehicle's `calibrated.toml`, solved from the paper's tables.

    Raises:
        ModelError: the tables can't be met.
    """
    tables = (jr700.YAW_BASE, jr700.ROLLPITCH_IN1, jr700.HEAVE)
    targets = {value.name: value.value for table in tables for value in table}
    folder = model_folder(name)
    given = read_parameters(folder / "parameters.toml", folder / "tuned.toml")
    return to_toml(calibrate(name, given, targets, "paper, Tables 2 to 4"), _CALIBRATED_HEADER)
