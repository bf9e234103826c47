"""The paper's experiment from end to end: test on the ground, fly, record, identify, compare."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from importlib.metadata import version
from os import PathLike
from pathlib import Path

import numpy as np

from helisim import ident
from helisim.base.errors import DivergedError, InputError, StorageError
from helisim.base.files import make_folder, write_json
from helisim.base.settings import check, setting, to_plain
from helisim.handling.loop import axis_of
from helisim.ident import blocks
from helisim.records.record import AXES, SERVO_POSITIONS, FlightRecord, one_blas_thread, versions
from helisim.records.storage import read_record
from helisim.sim import Doublet, Flight, FlightPlan, Recorder, Sweep, fly_all
from helisim.sim.flight import thread_count, write_flight
from helisim.sim.rigs import Finding, RigTest, StickSweep, hold, run_rigs, sweep_stick
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
from helisim.vehicle.parameters import number_of

_RESPONSE = {"lat": ("LAT", "p"), "lon": ("LON", "q"), "ped": ("PED", "r"), "col": ("COL", "w")}
"""Axis -> the stick and the motion by whose coherence a sweep is judged."""
_VERIFIED = tuple(dict.fromkeys(axis for model in MODELS for axis in model.verified_by))
"""Axes whose doublets a model is verified on."""
_ENCODER = 0.001
"""Standard deviation of the encoder on a servo's horn, of its unitised travel."""
_TESTS = (("swash", "COL", "servo_front", 2.5), ("tail", "PED", "servo_tail", 1.0))
"""Whose numbers, the stick that is swept, the servo that is looked at, and how much more the stick
moves than the `StickSweep` says: the gyro makes several times as much of the pedal's."""

Flights = dict[str, list[FlightRecord]]
"""Kept records by axis."""
Source = str | PathLike[str] | Mapping[str, Sequence[FlightRecord]] | Sequence[FlightRecord]
"""A folder of `helisim reproduce`, or of records; records by axis; or records that say theirs."""


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """What `reproduce` was called with, as far as numbers depend on it: a run states them.

    Attributes:
        flights: kept on each axis.
        seed: of pilots and sensors.
        parameters: physical parameters that replaced the calibrated ones.
        timestep: s, of the simulation; the model's own if None.
        rotor: whether the rotor's true tilt and loads were recorded.
    """

    flights: int = setting(low=1)
    seed: int
    parameters: Mapping[str, float | str]
    timestep: float | None
    rotor: bool

    def __post_init__(self) -> None:
        check(self, "arguments")
        for name, value in self.parameters.items():
            number_of(name, value)


def flown_each_axis(flights: int) -> int:
    """Return how many sweeps of an axis are flown to keep `flights`."""
    return flights + max(1, round(0.2 * flights))


def flights_in_all(flights: int) -> int:
    """Return how many sweeps are flown to keep `flights` on each axis."""
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
    reuse: bool = False,
    on_progress: Callable[[str], None] | None = None,
) -> Run:
    """Test on the ground, fly sweeps on all four axes, identify the models, compare with truth.

    Args:
        out: folder for `results.json`, `fits.json` and `flights/`; nothing is written if None.
        flights: kept on each axis; some more are flown and the least coherent left out.
        seed: of pilots and sensors.
        jobs: threads; all processors if None.
        parameters: physical parameters that replace the calibrated ones, for another truth;
            the paper is then printed but not judged by.
        timestep: s, of the simulation; the model's own if None.
        rotor: True records the rotor's true tilt and loads too, to look at.
        reuse: True takes the flights that an earlier run left in `out`, and flies none.
        on_progress: called with a word after each flight and each model.

    Returns:
        The results, the identified models and the kept flights; `read_run` reads the same back.

    Raises:
        InputError: a number is out of range, or the flights to reuse are another vehicle's.
        DivergedError: a flight left the validity of the model.
        StorageError: `out` can't be read or written.
    """
    if reuse and out is None:
        raise InputError("reuse needs the folder of the run whose flights are used again")
    arguments = Arguments(
        flights=flights, seed=seed, parameters=parameters or {}, timestep=timestep, rotor=rotor
    )
    threads = thread_count(jobs)
    if out is not None:
        make_folder(out / FLIGHTS)
    vehicle = load("jr700", parameters=parameters, timestep=timestep)
    on_progress = on_progress or (lambda _: None)
    recorder = Recorder.of(vehicle, rotor=rotor)
    with one_blas_thread():
        ground = {one.rig: one for one in run_rigs(vehicle, seed=seed, recorder=recorder)}
    x, y, z = (ground["suspension"][f"imu_{axis}"].value for axis in "xyz")
    recorder = replace(recorder, lever_arm=(x, y, z))
    if reuse and out is not None:
        kept, doublets, excluded = _read_flights(vehicle, seed, out)
    else:
        kept, excluded = fly_sweeps(vehicle, flights, seed, jobs, recorder, out, on_progress)
        doublets = _fly_doublets(vehicle, seed, recorder, out)
    with one_blas_thread(), ThreadPoolExecutor(threads) as pool:
        estimated = list(pool.map(lambda model: frequency_response(model, kept), MODELS))
    tables: dict[str, ComparisonTable] = {}
    models: list[IdentifiedModel] = []
    for model, response in zip(MODELS, estimated):
        fit = identify_model(model, kept, before=tables, ground=ground, estimated=response)
        tables[model.name] = comparison_table(
            vehicle, model, fit, recorder, judge_paper=not parameters, ground=ground
        )
        unseen = {axis: doublets[axis] for axis in model.verified_by}
        found = IdentifiedModel(
            model.name,
            fit,
            exact=exact_response(vehicle, model, recorder, np.geomspace(*model.band, 200)),
            note=model.note,
            verification=ident.verify(fit, list(unseen.values())) if unseen else None,
            verified_on=tuple(f"{axis}_doublet" for axis in unseen),
        )
        models.append(found)
        on_progress(model.name)
    identified = {name: table.identified for name, table in tables.items()}
    yaw = (identified[name] for name in ("yaw_base", "yaw_gyro", "yaw_overall"))
    count = len(kept["lat"])
    results = Results(
        tables=tuple(tables.values()),
        seed=seed,
        versions=versions(),
        configuration={
            "arguments": to_plain(replace(arguments, flights=count)),
            "vehicle": vehicle.name,
            "model_digest": vehicle.digest,
            "flights_kept_each_axis": count,
            "flown_each_axis": flown_each_axis(count),
            "timestep_s": float(vehicle.model.opt.timestep),
            "parameters": dict(parameters or {}),
            "recorder": recorder.to_dict(),
        },
        excluded=excluded,
        ground=ground,
        verification={
            one.name: one.verification.figures for one in models if one.verification is not None
        },
        gyro_effect=gyro_effect(identified["rollpitch_in1"], identified["rollpitch_in2"]),
        eq_8=check_overall(*yaw, band_rad_s=tables["yaw_overall"].band_rad_s),
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
    on_progress: Callable[[str], None] | None = None,
) -> Results:
    """Fly sweeps on all four axes, identify yaw, roll-pitch and heave, compare with the truth.

    For any vehicle with a folder of its own: nothing here knows the JR700's gyro or its paper.
    What is published of a shipped vehicle stands beside, and is judged by unless `parameters`
    change the truth.

    Args:
        vehicle: name of a shipped one, or path of a folder.
        flights: kept on each axis; some more are flown and the least coherent left out.
        seed: of pilots and sensors.
        jobs: threads; all processors if None.
        parameters: physical parameters that replace the calibrated ones.
        on_progress: called with a word after each flight and each model.

    Raises:
        UnknownNameError: no such vehicle or parameter.
        InputError: a number is out of range.
        DivergedError: a flight left the validity of the model.
    """
    if flights < 1:
        raise InputError(f"flights must be 1 or more, got {flights}")
    on_progress = on_progress or (lambda _: None)
    flying = load(vehicle, parameters=parameters)
    recorder = Recorder.of(flying)
    kept, excluded = fly_sweeps(flying, flights, seed, jobs, recorder, None, on_progress)
    tables = []
    for model in base_models(flying):
        fit = identify_model(model, kept)
        tables.append(comparison_table(flying, model, fit, recorder, judge_paper=not parameters))
        on_progress(model.name)
    return Results(
        tables=tuple(tables),
        seed=seed,
        versions={one: version(one) for one in ("helisim", "mujoco", "numpy", "scipy", "numba")},
        configuration={
            "vehicle": flying.name,
            "flights_kept_each_axis": flights,
            "flown_each_axis": flown_each_axis(flights),
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
) -> tuple[Flights, tuple[Exclusion, ...]]:
    """Fly every axis, write every record, and keep the most coherent ones.

    Returns:
        The kept records by axis, and those that were left out.

    Raises:
        DivergedError: too few sweeps of an axis went on to their end.
    """
    kept: Flights = {}
    excluded: list[Exclusion] = []
    for number, axis in enumerate(AXES):
        names = [f"{axis}_{k + 1:02d}" for k in range(flown_each_axis(flights))]
        paths = [folder and folder / FLIGHTS / f"{name}.parquet" for name in names]
        plan = FlightPlan(excitation=Sweep(axis=axis), recorder=recorder)
        records: list[FlightRecord] = []
        scores: dict[int, float] = {}
        found = _fly_and_score(vehicle, plan, paths, seed * len(AXES) + number, jobs)
        for k, (record, score) in enumerate(found):
            records.append(record)
            if score is not None:
                scores[k] = score
            on_progress(axis)
        excluded += [
            Exclusion(flight=name, reason="terminated early", ended=record.ended)
            for name, record in zip(names, records)
            if record.ended
        ]
        if len(scores) < flights:
            raise DivergedError(
                f"{len(records) - len(scores)} of {len(records)} sweeps of {axis} were terminated "
                f"early, so fewer than {flights} are left; {excluded[-1].message}"
            )
        best = sorted(sorted(scores, key=scores.__getitem__)[-flights:])
        kept[axis] = [records[k] for k in best]
        shared = {"limit": min(scores[k] for k in best), "kept": flights}
        excluded += [
            Exclusion(flight=names[k], reason="less coherent", coherence=scores[k], **shared)
            for k in scores
            if k not in best
        ]
    return kept, tuple(excluded)


def _fly_and_score(
    vehicle: Vehicle, plan: FlightPlan, paths: Sequence[Path | None], seed: int, jobs: int | None
) -> Iterator[tuple[FlightRecord, float | None]]:
    """Yield the record of a sweep for each path, where it is written, and its mean coherence."""

    def judged(k: int, flight: Flight) -> tuple[FlightRecord, float | None]:
        record, path = flight.record, paths[k]
        if path is not None:
            write_flight(flight, path)
        return record, None if record.ended else sweep_coherence(record, plan.name)

    with one_blas_thread():  # around all threads, or they would take it from each other
        yield from fly_all(vehicle, plan, range(len(paths)), judged, seed=seed, jobs=jobs)


def sweep_coherence(record: FlightRecord, axis: str) -> float:
    """Return the mean coherence between the swept stick and its motion, one flight alone."""
    stick, motion = _RESPONSE[axis]
    w_min, w_max = record.provenance["excitation"]["band"]
    band = (max(1.0, w_min), 0.8 * w_max)
    frf = ident.frequency_response(record, inputs=stick, outputs=motion, band=band)
    return float(np.mean(frf.coherence))


def _fly_doublets(
    vehicle: Vehicle, seed: int, recorder: Recorder, folder: Path | None
) -> dict[str, FlightRecord]:
    """Fly a doublet on each axis that a model is verified on; no fit sees them."""
    records = {}
    for axis in _VERIFIED:
        plan = FlightPlan(excitation=Doublet(axis=axis), recorder=recorder)
        (flight,) = fly_all(vehicle, plan, [0], seed=seed * len(AXES))
        if folder is not None:
            write_flight(flight, folder / FLIGHTS / f"{axis}_doublet.parquet")
        if flight.record.ended:
            raise DivergedError(f"the doublet of {axis}: {flight.record.ended}; fly a smaller one")
        records[axis] = flight.record
    return records


def _read_flights(
    vehicle: Vehicle, seed: int, folder: Path
) -> tuple[Flights, dict[str, FlightRecord], tuple[Exclusion, ...]]:
    """Read a run's kept sweeps and doublets by axis again, and what was left out.

    Raises:
        StorageError: results or a record can't be read.
        InputError: another vehicle or seed flew.
    """
    results = read_results(folder / RESULTS)
    if results.seed != seed:
        raise InputError(f"{folder} was flown with seed {results.seed}, not {seed}")
    kept = read_kept_sweeps(folder, results.left_out)
    for axis in AXES:
        if axis not in kept:
            raise InputError(f"{folder / FLIGHTS} has no sweep of {axis}; fly them first")
    doublets = {
        axis: read_record(folder / FLIGHTS / f"{axis}_doublet.parquet") for axis in _VERIFIED
    }
    for record in (*doublets.values(), *(one for axis in AXES for one in kept[axis])):
        if record.provenance.get("parameters") != dict(vehicle.parameters):
            raise InputError(
                f"the flights in {folder} were flown by a vehicle with other parameters; "
                "fly them again"
            )
    return kept, doublets, results.excluded


def named_records(flights: Mapping[str, Sequence[FlightRecord]]) -> dict[str, FlightRecord]:
    """Return all kept records by a name such as "lat_01"."""
    return {
        f"{axis}_{k + 1:02d}": record for axis in AXES for k, record in enumerate(flights[axis])
    }


def sweeps_of(source: Source) -> Flights:
    """Return records by the axis that they sweep.

    Records of something else than a sweep, and flights that ended early, are left out.

    Raises:
        StorageError: the folder or a record can't be read.
        InputError: an axis is unknown, or no record says that it is a sweep.
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
    sweep: StickSweep | None = None,
    seed: int = 1,
    recorder: Recorder | None = None,
) -> RigTest:
    """Find natural frequency and damping of the swashplate's and of the tail's servos.

    On the bench, rotor off. The three servos of the swashplate are of one kind; the front one is
    looked at. An encoder reads its position beside the command that the flight computer records.

    Args:
        vehicle: to test.
        sweep: the default `StickSweep` if None.
        seed: of the sensors.
        recorder: the vehicle's own if None.

    Raises:
        IdentificationError: position does not follow command.
    """
    recorder = recorder or Recorder.of(vehicle)
    encoders = dict.fromkeys(SERVO_POSITIONS, _ENCODER)
    reading = replace(recorder, rotor=True, noise={**recorder.noise, **encoders})
    sweep = sweep or StickSweep()
    held = hold(vehicle, "bench")
    findings: list[Finding] = []
    for which, stick, servo, more in _TESTS:
        larger = replace(sweep, amplitude=more * sweep.amplitude)
        record = sweep_stick(held, larger, stick, seed=seed, recorder=reading)
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
