"""The paper's experiment: ground tests, flights, identification, comparison with truth."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from importlib.metadata import version
from os import PathLike
from pathlib import Path

import numpy as np

from helisim import ident
from helisim.base.errors import DivergedError, InputError, StorageError
from helisim.base.files import make_folder, write_json
from helisim.base.settings import Limits, convert
from helisim.handling.loop import axis_of
from helisim.ident import blocks
from helisim.ident.frf import grid
from helisim.ident.local import Local
from helisim.records.record import AXES, SERVO_POSITIONS, FlightRecord, one_blas_thread, versions
from helisim.records.storage import read_record, write_record
from helisim.sim import Doublet, FlightPlan, Recorder, Sweep, fly_each
from helisim.sim.flight import thread_count
from helisim.sim.rigs import SWEPT, Finding, RigTest, drive, hold, run_rigs, stick_sweep
from helisim.study.comparison import (
    ComparisonTable,
    comparison_table,
    frequency_response,
    identify_model,
)
from helisim.study.models import MODELS, base_models
from helisim.study.paper import check_overall, gyro_effect
from helisim.study.results import (
    FITS,
    FLIGHTS,
    RESULTS,
    Exclusion,
    IdentifiedModel,
    Results,
    Run,
    read_kept_sweeps,
    read_results,
    write_models,
)
from helisim.study.truth import exact_response
from helisim.vehicle import Vehicle, load

_VERIFIED = tuple(dict.fromkeys(axis for model in MODELS for axis in model.verified_by))
_ENCODER = 0.001  # standard deviation of a servo's encoder, unitised
_TESTS = (("swash", "COL", "servo_front", 2.5), ("tail", "PED", "servo_tail", 1.0))
"""Prefix of findings, stick, servo, and factor on the amplitude of the sweep."""

Flights = dict[str, list[FlightRecord]]  # kept, by axis
Source = str | PathLike[str] | Mapping[str, Sequence[FlightRecord]] | Sequence[FlightRecord]


def flown_each_axis(flights: int) -> int:
    """Return the number of sweeps flown on an axis to keep `flights`. Raises InputError."""
    convert(int, flights, "flights", Limits(low=1))
    return flights + max(1, round(0.2 * flights))


def flights_in_all(flights: int) -> int:
    """Return the number of sweeps flown to keep `flights` on each axis. Raises InputError."""
    return flown_each_axis(flights) * len(AXES)


def reproduce(
    *,
    out: Path | None = None,
    flights: int = 10,
    seed: int = 1,
    jobs: int | None = None,
    parameters: Mapping[str, float | str] | None = None,
    timestep: float | None = None,
    rotor: bool = False,
    on_progress: Callable[[str], None] = lambda _: None,
    on_table: Callable[[ComparisonTable], object] = lambda _: None,
) -> Run:
    """Run the paper's experiment on the JR700 and return what its folder holds.

    Nothing is written if `out` is None. `flights` are kept on each axis; some more are flown and
    the least coherent left out. `jobs` None takes all processors. `parameters` replace calibrated
    ones; the paper is then printed but not judged by. `timestep` is in s, the model's own if None;
    `rotor` records the rotor's true tilt and loads too. `on_progress` gets a word after each flight
    and model, `on_table` each table, as soon as the sweeps of its model are flown.

    Raises InputError, StorageError, or DivergedError where a flight left the model's validity.
    """
    flown = flown_each_axis(flights)
    arguments = {
        "flights": flights,
        "seed": seed,
        "parameters": dict(parameters or {}),
        "timestep": timestep,
        "rotor": rotor,
    }
    threads = thread_count(jobs)  # refused before anything is made
    vehicle = load("jr700", parameters=parameters, timestep=timestep)
    if out is not None:
        make_folder(out / FLIGHTS)
    recorder = Recorder.of(vehicle, rotor=rotor)
    with one_blas_thread():
        ground = {one.rig: one for one in run_rigs(vehicle, seed=seed, recorder=recorder)}
    x, y, z = (ground["suspension"][f"imu_{axis}"].value for axis in "xyz")
    recorder = replace(recorder, lever_arm=(x, y, z))
    doublets = _fly_doublets(vehicle, seed, recorder, out)
    tables: dict[str, ComparisonTable] = {}
    models: list[IdentifiedModel] = []

    def identify(flown: Flights) -> None:
        ready = [one for one in MODELS if one.name not in tables and {*one.sweeps} <= {*flown}]
        with one_blas_thread(), ThreadPoolExecutor(threads) as pool:
            estimated = [*pool.map(partial(frequency_response, flights=flown), ready)]
        for model, response in zip(ready, estimated):
            fit = identify_model(model, flown, before=tables, ground=ground, estimated=response)
            tables[model.name] = comparison_table(
                vehicle, model, fit, recorder, judge_paper=not parameters, ground=ground
            )
            unseen = {axis: doublets[axis] for axis in model.verified_by}
            models.append(
                IdentifiedModel(
                    model.name,
                    fit,
                    exact=exact_response(vehicle, model, recorder, np.geomspace(*model.band, 200)),
                    note=model.note,
                    verification=ident.verify(fit, list(unseen.values())) if unseen else None,
                    verified_on=tuple(f"{axis}_doublet" for axis in unseen),
                )
            )
            on_progress(model.name)
            on_table(tables[model.name])

    kept, excluded = fly_sweeps(
        vehicle, flights, seed, jobs, recorder, out, on_progress, on_axis=identify
    )
    identified = {name: table.identified for name, table in tables.items()}
    results = Results(
        tables=tuple(tables.values()),
        seed=seed,
        versions=versions(),
        configuration={
            "arguments": arguments,
            "vehicle": vehicle.name,
            "model_digest": vehicle.digest,
            "flights_kept_each_axis": flights,
            "flown_each_axis": flown,
            "timestep_s": float(vehicle.model.opt.timestep),
            "parameters": arguments["parameters"],
            "recorder": recorder.to_dict(),
        },
        excluded=excluded,
        ground=ground,
        verification={
            one.name: one.verification.figures for one in models if one.verification is not None
        },
        gyro_effect=gyro_effect(identified["rollpitch_in1"], identified["rollpitch_in2"]),
        eq_8=check_overall(
            *(identified[name] for name in ("yaw_base", "yaw_gyro", "yaw_overall")),
            band_rad_s=tables["yaw_overall"].band_rad_s,
        ),
    )
    if out is not None:
        write_json(results.to_dict(), out / RESULTS, indent=2)
        write_models(out / FITS, models)
    return Run(results, tuple(models), kept)


def recover(
    vehicle: str | PathLike[str],
    *,
    flights: int = 3,
    seed: int = 1,
    jobs: int | None = None,
    parameters: Mapping[str, float | str] | None = None,
    on_progress: Callable[[str], None] = lambda _: None,
) -> Results:
    """Identify yaw, roll-pitch and heave of any vehicle from its sweeps; compare with the truth.

    Arguments are as of `reproduce`. Published values of a shipped vehicle are judged by, unless
    `parameters` change the truth. Raises UnknownNameError, InputError, or DivergedError where a
    flight left the model's validity.
    """
    flown = flown_each_axis(flights)
    flying = load(vehicle, parameters=parameters)
    recorder = Recorder.of(flying)
    kept, excluded = fly_sweeps(flying, flights, seed, jobs, recorder, None, on_progress)
    tables = []
    for model in base_models(flying):
        tables.append(
            comparison_table(
                flying, model, identify_model(model, kept), recorder, judge_paper=not parameters
            )
        )
        on_progress(model.name)
    return Results(
        tables=tuple(tables),
        seed=seed,
        versions={one: version(one) for one in ("helisim", "mujoco", "numpy", "scipy", "numba")},
        configuration={
            "vehicle": flying.name,
            "flights_kept_each_axis": flights,
            "flown_each_axis": flown,
            "parameters": dict(parameters or {}),
        },
        excluded=excluded,
    )


def fly_sweeps(
    vehicle: Vehicle,
    flights: int,
    seed: int,
    jobs: int | None,
    recorder: Recorder,
    folder: Path | None,
    on_progress: Callable[[str], None],
    on_axis: Callable[[Flights], object] = lambda _: None,
) -> tuple[Flights, tuple[Exclusion, ...]]:
    """Fly and record every axis; return the most coherent, and the others. Raises DivergedError.

    `on_axis` gets those kept so far, from the pedal's on.
    """
    kept: Flights = {}
    excluded: list[Exclusion] = []
    for number, axis in reversed([*enumerate(AXES)]):
        names = [f"{axis}_{k + 1:02d}" for k in range(flown_each_axis(flights))]
        plan = FlightPlan(excitation=Sweep(axis=axis), recorder=recorder)

        def judged(k: int, record: FlightRecord, axis: str = axis) -> tuple[FlightRecord, float]:
            if folder is not None:
                write_record(record, folder / FLIGHTS / f"{axis}_{k + 1:02d}.parquet")
            return record, math.nan if record.ended else sweep_coherence(record, axis)

        flown: list[tuple[FlightRecord, float]] = []
        ways = {"seed": seed * len(AXES) + number, "jobs": jobs, "keep_ended": True}
        with one_blas_thread():  # around all threads, or they would take it from each other
            for one in fly_each(vehicle, plan, range(len(names)), judged, **ways):
                flown.append(one)
                on_progress(axis)
        scores = {k: score for k, (record, score) in enumerate(flown) if not record.ended}
        left = [
            Exclusion(flight=name, reason="terminated early", ended=record.ended)
            for name, (record, _) in zip(names, flown)
            if record.ended
        ]
        if len(scores) < flights:
            raise DivergedError(
                f"{len(flown) - len(scores)} of {len(flown)} sweeps of {axis} were terminated "
                f"early, so fewer than {flights} are left; {left[-1].message}"
            )
        best = sorted(sorted(scores, key=scores.__getitem__)[-flights:])
        kept[axis] = [flown[k][0] for k in best]
        shared = {"limit": min(scores[k] for k in best), "kept": flights}
        left += [
            Exclusion(flight=names[k], reason="less coherent", coherence=scores[k], **shared)
            for k in scores
            if k not in best
        ]
        excluded[:0] = left
        on_axis(kept)
    return {axis: kept[axis] for axis in AXES}, tuple(excluded)


def sweep_coherence(record: FlightRecord, axis: str) -> float:
    """Return the mean coherence between the swept stick and its motion in one flight."""
    swept = axis_of(axis)
    w_min, w_max = record.provenance["excitation"]["band"]
    band, motion = (max(1.0, w_min), 0.8 * w_max), swept.rate or swept.angle
    local = Local([record], (swept.stick, motion), grid(band))
    return float(np.mean(local.estimate([swept.stick], [motion]).coherence))


def _fly_doublets(
    vehicle: Vehicle, seed: int, recorder: Recorder, folder: Path | None
) -> dict[str, FlightRecord]:
    records = {}
    for axis in _VERIFIED:
        plan = FlightPlan(excitation=Doublet(axis=axis), recorder=recorder)
        (record,) = fly_each(vehicle, plan, [0], seed=seed * len(AXES), keep_ended=True)
        if folder is not None:
            write_record(record, folder / FLIGHTS / f"{axis}_doublet.parquet")
        if record.ended:
            raise DivergedError(f"the doublet of {axis}: {record.ended}; fly a smaller one")
        records[axis] = record
    return records


def sweeps_of(source: Source) -> Flights:
    """Return sweeps by axis, without other records and flights that ended early.

    Raises StorageError, or InputError where an axis is unknown or nothing states a sweep.
    """
    if isinstance(source, Mapping):
        return {axis_of(axis).name: list(records) for axis, records in source.items()}
    if not isinstance(source, str | PathLike):
        return _by_axis(source, "the records")
    folder = Path(source)
    if (folder / RESULTS).is_file():
        return read_kept_sweeps(folder, read_results(folder / RESULTS).left_out)
    paths = sorted({*folder.glob("*.parquet"), *(folder / FLIGHTS).glob("*.parquet")})
    if not paths:
        raise StorageError(
            f"{folder} has no flight records (*.parquet); give a folder that helisim reproduce or "
            "helisim fly wrote"
        )
    return _by_axis(map(read_record, paths), str(folder))


def _by_axis(records: Iterable[FlightRecord], where: str) -> Flights:
    found: Flights = {}
    for record in records:
        excitation = record.provenance.get("excitation") or {}
        if excitation.get("kind") == "Sweep" and not record.ended:
            found.setdefault(axis_of(excitation["axis"]).name, []).append(record)
    if not found:
        raise InputError(
            f"none of {where} says which axis it sweeps; give them by axis, such as "
            '{"lat": [record, ...], "lon": [...]}'
        )
    return found


def servo_test(
    vehicle: Vehicle,
    *,
    seed: int = 1,
    recorder: Recorder | None = None,
) -> RigTest:
    """Find frequency and damping of the swashplate's and the tail's servos on the bench, rotor off.

    The front servo stands for the swashplate's. Raises IdentificationError: it doesn't follow.
    """
    recorder = recorder or Recorder.of(vehicle)
    reading = replace(
        recorder, rotor=True, noise={**recorder.noise, **dict.fromkeys(SERVO_POSITIONS, _ENCODER)}
    )
    held = hold(vehicle, "bench")
    findings: list[Finding] = []
    for which, stick, servo, more in _TESTS:
        sweep = partial(stick_sweep, amplitude=more * 0.018)
        record = drive(held, stick, sweep, duration=SWEPT, seed=seed, recorder=reading)
        position = f"{servo}_position"
        found = ident.frequency_response(record, inputs=servo, outputs=position, band=(10.0, 190.0))
        known = blocks.second_order("servo")
        delayed = ident.in_series(known, inputs={"u": blocks.delay("late")}).renamed(
            {"u": servo, "y": position}, name=servo
        )
        fit = ident.identify(found, delayed)
        findings += [
            Finding(
                name=f"{which}_{name}",
                unit=fit[f"servo_{name}"].unit,
                value=fit[f"servo_{name}"].value,
                truth=vehicle.parameters[f"servo.{which}_{long}"],
                standard_error=fit[f"servo_{name}"].standard_error,
                how=f"position over command of {servo}, to {fit.band[1]:.0f} rad/s",
            )
            for name, long in (("omega", "frequency"), ("zeta", "damping"))
        ]
    return RigTest(rig="servos", findings=tuple(findings))
