"""The paper's experiment from end to end: test on the ground, fly, record, identify, compare."""

from collections.abc import Callable, Mapping
from pathlib import Path

from helisim.errors import InputError
from helisim.paper.eq8 import check_overall
from helisim.paper.gyro_effect import before_and_after
from helisim.records.files import make_folder, write_json
from helisim.records.provenance import versions
from helisim.sim import Recorder
from helisim.sim.rigs import run_rigs
from helisim.study.flights import (
    FOLDER,
    Flights,
    flown_each_axis,
    fly_doublets,
    fly_sweeps,
    read_flights,
)
from helisim.study.identification import compare, evidence_of, identify_model
from helisim.study.identified import write_evidence
from helisim.study.models import MODELS
from helisim.study.results import ComparisonTable, Results
from helisim.vehicle import load


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
    on_progress: Callable[[str], None] | None = None,
) -> tuple[Results, Flights]:
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
        evidence.append(evidence_of(vehicle, model, fit, recorder, doublets))
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
            "recorder": recorder.to_dict(),
        },
        excluded=excluded,
        further={
            "ground": ground,
            "verification": {
                item.name: item.verification for item in evidence if item.verification is not None
            },
            "before_after": before_and_after(
                tables["rollpitch_in1"].identified, tables["rollpitch_in2"].identified
            ),
            "eq_8": check_overall(
                tables["yaw_base"].identified,
                tables["yaw_gyro"].identified,
                tables["yaw_overall"].identified,
                band_rad_s=tables["yaw_overall"].band_rad_s,
            ),
        },
    )
    if out is not None:
        write_json(results.to_dict(), out / "results.json", indent=2)
        write_evidence(out / "fits.json", evidence)
    return results, kept
