"""The paper's experiment from end to end: test on the ground, fly, record, identify, compare."""

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from helisim.base.errors import InputError
from helisim.base.files import make_folder, write_json
from helisim.records.provenance import one_blas_thread, versions
from helisim.sim import Recorder
from helisim.sim.flight import thread_count
from helisim.sim.rigs import RigTest, run_rigs
from helisim.study.comparison import ComparisonTable
from helisim.study.flights import (
    FOLDER,
    RESULTS,
    flown_each_axis,
    fly_doublets,
    fly_sweeps,
    read_flights,
)
from helisim.study.identification import (
    comparison_table,
    frequency_response,
    identified_model,
    identify_model,
)
from helisim.study.identified import IdentifiedModel, write_models
from helisim.study.models import MODELS
from helisim.study.paper.eq8 import OverallCheck, check_overall
from helisim.study.paper.gyro_effect import GyroEffect, gyro_effect
from helisim.study.results import Results
from helisim.study.run import FITS, Run
from helisim.vehicle import load


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

    flights: int
    seed: int
    parameters: Mapping[str, float | str]
    timestep: float | None
    rotor: bool


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
    if flights < 1:
        raise InputError(f"flights must be 1 or more, got {flights}")
    if reuse and out is None:
        raise InputError("reuse needs the folder of the run whose flights are used again")
    threads = thread_count(jobs)
    if out is not None:
        make_folder(out / FOLDER)
    vehicle = load("jr700", parameters=parameters, timestep=timestep)
    on_progress = on_progress or (lambda _: None)
    recorder = Recorder.of(vehicle, rotor=rotor)
    with one_blas_thread():
        ground = {one.rig: one for one in run_rigs(vehicle, seed=seed, recorder=recorder)}
    recorder = replace(recorder, lever_arm=_lever_arm(ground["suspension"]))
    if reuse and out is not None:
        kept, doublets, excluded = read_flights(vehicle, seed, out)
    else:
        kept, excluded = fly_sweeps(vehicle, flights, seed, jobs, recorder, out, on_progress)
        doublets = fly_doublets(vehicle, seed, recorder, out)
    with one_blas_thread(), ThreadPoolExecutor(threads) as pool:
        estimated = list(pool.map(lambda model: frequency_response(model, kept), MODELS))
    tables: dict[str, ComparisonTable] = {}
    models: list[IdentifiedModel] = []
    for model, response in zip(MODELS, estimated):
        fit = identify_model(model, kept, before=tables, ground=ground, estimated=response)
        tables[model.name] = comparison_table(
            vehicle, model, fit, recorder, judge_paper=not parameters, ground=ground
        )
        models.append(identified_model(vehicle, model, fit, recorder, doublets))
        on_progress(model.name)
    results = Results(
        tables=tuple(tables.values()),
        seed=seed,
        versions=versions(),
        configuration={
            "arguments": asdict(
                Arguments(
                    flights=len(kept["lat"]),
                    seed=seed,
                    parameters=dict(parameters or {}),
                    timestep=timestep,
                    rotor=rotor,
                )
            ),
            "vehicle": vehicle.name,
            "model_digest": vehicle.digest,
            "flights_kept_each_axis": len(kept["lat"]),
            "flown_each_axis": flown_each_axis(len(kept["lat"])),
            "timestep_s": float(vehicle.model.opt.timestep),
            "parameters": dict(parameters or {}),
            "recorder": recorder.to_dict(),
        },
        excluded=excluded,
        ground=ground,
        verification={
            one.name: one.verification.figures for one in models if one.verification is not None
        },
        gyro_effect=_gyro_effect(tables),
        eq_8=_eq_8(tables),
    )
    if out is not None:
        write_json(results.to_dict(), out / RESULTS, indent=2)
        write_models(out / FITS, models)
    return Run(results, tuple(models), kept)


def _lever_arm(suspension: RigTest) -> tuple[float, float, float]:
    """Return the IMU's place from the centre of gravity as it was found, m."""
    x, y, z = (suspension[f"imu_{axis}"].value for axis in "xyz")
    return x, y, z


def _gyro_effect(tables: Mapping[str, ComparisonTable]) -> GyroEffect:
    before, after = (tables[name].identified for name in ("rollpitch_in1", "rollpitch_in2"))
    return gyro_effect(before, after)


def _eq_8(tables: Mapping[str, ComparisonTable]) -> OverallCheck:
    base, gyro, overall = (tables[name] for name in ("yaw_base", "yaw_gyro", "yaw_overall"))
    return check_overall(
        base.identified, gyro.identified, overall.identified, band_rad_s=overall.band_rad_s
    )
