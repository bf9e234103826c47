"""Recover a vehicle's derivatives: sweep it, identify its base models, set them beside what flew.

For any vehicle with a folder of its own: nothing here knows the JR700's gyro or its paper.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from importlib.metadata import version
from os import PathLike

from helisim.base.errors import InputError
from helisim.sim import Recorder
from helisim.study.flights import flown_each_axis, fly_sweeps
from helisim.study.identification import comparison_table, identify_model
from helisim.study.models import HEAVE, ROLLPITCH_IN1, YAW_BASE, ModelSpec, Tolerance
from helisim.study.results import Results
from helisim.vehicle import Vehicle, load

_TIGHT = Tolerance(
    percent=3.0,
    reason="below 3.9 %, the least Cramér-Rao bound that Wu and Chen print for a derivative of a "
    "helicopter of this kind; where a vehicle's own bounds are known they are wider",
)
_LOOSE = Tolerance(
    percent=10.0,
    reason="couplings and delays: Wu and Chen's bounds run from 5.6 to 36 %",
)
_TOLERANCES = {
    **dict.fromkeys(
        ("N_r", "N_ped", "Z_w", "Z_col", "L_b", "M_a", "A_lon", "B_lat", "tau_f"), _TIGHT
    ),
    **dict.fromkeys(("A_b", "B_a", "A_lat", "B_lon"), _LOOSE),
    **dict.fromkeys(("tau_r_base", "tau_lat", "tau_lon", "tau_col"), _LOOSE),
}


def base_models(vehicle: Vehicle) -> tuple[ModelSpec, ...]:
    """Return the models of the base helicopter, each in the band that the vehicle states.

    A vehicle without `band.yaw_base_low`, `band.yaw_base_high` and so on has the JR700's.
    """
    return tuple(_adapted(model, vehicle.parameters) for model in (YAW_BASE, ROLLPITCH_IN1, HEAVE))


def _adapted(model: ModelSpec, own: Mapping[str, float]) -> ModelSpec:
    edges = (f"band.{model.name}_low", f"band.{model.name}_high")
    band = (own[edges[0]], own[edges[1]]) if edges[0] in own else model.band
    names = [parameter.name for parameter in model.structure.free]
    judged = {name: _TOLERANCES[name] for name in names if name in _TOLERANCES}
    return replace(model, band=band, tolerances=judged, paper_tolerances=judged, verified_by=())


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
