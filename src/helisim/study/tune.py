"""Tuning of the gyro to the published models seen from the sticks, and of autopilots."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from helisim.base.errors import ModelError
from helisim.base.units import DB_PER_NEPER
from helisim.design.exact import exact_loop
from helisim.design.plant import Plant
from helisim.handling import figures
from helisim.handling.spec import ATTITUDES
from helisim.ident import load_fit
from helisim.ident.evaluate import response
from helisim.logs.dataflash import is_dataflash
from helisim.sim import Recorder
from helisim.sitl.parameters import AutopilotParameters, parameters_for
from helisim.study.design_chain import identify_for_design
from helisim.study.experiment import Source
from helisim.study.log_tune import logged_plant
from helisim.study.models import ROLLPITCH_IN2, YAW_OVERALL, ModelSpec
from helisim.study.paper import published_of
from helisim.study.truth import exact_response, true_values
from helisim.vehicle import Parameters, Vehicle
from helisim.vehicle.parameters import solved
from helisim.vehicle.rate_command import tune_rate_command

_YAW = {"gyro.ped_latency": 0.02}
_CYCLIC = {
    "gyro.kp_lat": 0.05,
    "gyro.kp_lon": 0.1,
    "gyro.ki_lat": 1.2,
    "gyro.ki_lon": 1.2,
    "gyro.kd_lat": 0.003,
    "gyro.kd_lon": 0.01,
    "gyro.phase": 0.3,
    "gyro.p_per_lat": 6.5,
    "gyro.p_per_lon": -1.0,
    "gyro.q_per_lat": 0.25,
    "gyro.q_per_lon": 6.5,
    "recorder_latency.LAT": 0.01,
}

_INSTEAD = (
    "say what the gyro is to be tuned to in a section [tuning] of its parameters.toml: "
    "cyclic_bandwidth, yaw_bandwidth, peak_sensitivity"
)

LOOPS = ATTITUDES  # of the gyro
_STEPS, _DIFFERENCE = 30, 3e-3  # relative step of derivatives, above the noise of solved gains
# _REST: weight that holds what the targets leave free
# _WORST_PERCENT: largest miss; 3.9 % is the paper's smallest bound
_REST, _WORST_PERCENT = 0.02, 3.0
_PHASE_WEIGHT = np.sqrt(0.01745) * 180.0 / np.pi  # CIFER's, of a degree against 1 dB, in rad


@dataclass(frozen=True)
class Margins:
    """Least margins of a loop, dB and degrees, and its highest crossover, rad/s."""

    gain_db: float
    phase_deg: float
    crossover: float


def margins(vehicle: Vehicle, axis: str) -> Margins:
    """Return the margins of the gyro's loop at one of `LOOPS`, the other loops closed."""
    omega = np.geomspace(0.3, 0.999 * np.pi / vehicle.parameters["gyro.period"], 4000)
    found = figures.margins(exact_loop(vehicle, omega).broken(axis))
    if not found.crosses:
        raise ModelError(f"the {axis} loop has no crossover: its gain never falls through one")
    above = [size for at, size in found.gain if at > found.crossover]
    return Margins(
        min(above, default=np.inf), float(np.degrees(found.least_phase)), found.crossover
    )


def tune(
    vehicle: Vehicle, *, shape: int = 60, on_progress: Callable[[str], None] | None = None
) -> Parameters:
    """Return gyro settings and stick latencies that meet eq. (8) and Table 3's IN2 column.

    The exact response is fitted at `shape` frequencies, then identified parameters are met. It
    needs a calibrated airframe and the published yaw gains; a vehicle with `tuning.*` gets a rate
    command. Raises ModelError where nothing is published or asked for, or targets can't be met.
    """
    if any(name.startswith("tuning.") for name in vehicle.parameters):
        return tune_rate_command(vehicle)
    tables = published_of(vehicle)
    if not tables.tables:
        raise ModelError(f"nothing is published of {vehicle.name!r}: {_INSTEAD}")
    settings: dict[str, float] = {}
    for starts, model in ((_YAW, YAW_OVERALL), (_CYCLIC, ROLLPITCH_IN2)):
        target = {value.name: value.value for value in tables[model.name]}
        target = {name: value for name, value in target.items() if name in model.tolerances}
        settings |= _solve(vehicle, starts, model, target, shape, on_progress or (lambda _: None))
    source = "solved by helisim tune: eq. (8) and the IN2 column of Table 3"
    return solved(settings, vehicle.parameters, source)


def _solve(
    vehicle: Vehicle,
    first: Mapping[str, float],
    model: ModelSpec,
    target: Mapping[str, float],
    shape: int,
    on_progress: Callable[[str], None],
) -> dict[str, float]:
    names, starts = list(first), np.array(list(first.values()))
    omega = np.geomspace(*model.band, shape)
    tied = {"A_b": -target["B_a"]} if "B_a" in target else {}
    wanted = response(model.structure, {**target, **tied}, omega)

    def setting(x: NDArray[np.float64]) -> dict[str, float]:
        return dict(zip(names, (starts * np.exp(x)).tolist()))  # keeps each one's sign

    def far(x: NDArray[np.float64]) -> NDArray[np.float64]:
        on_progress(model.name)
        tried = vehicle.with_settings(setting(x))
        found = exact_response(tried, model, Recorder.of(tried), omega).response
        ratio = np.asarray(np.log(found / wanted), dtype=np.complex128)
        errors = [DB_PER_NEPER * ratio.real.ravel(), _PHASE_WEIGHT * ratio.imag.ravel()]
        return np.concatenate(errors) / np.sqrt(found.size)

    def near(x: NDArray[np.float64]) -> NDArray[np.float64]:
        on_progress(model.name)
        tried = vehicle.with_settings(setting(x))
        found = true_values(tried, model, Recorder.of(tried))
        missed = [100.0 * (found[name] / target[name] - 1.0) for name in target]
        return np.array([*missed, *(_REST * (x - shaped))])

    shaped = least_squares(far, np.zeros(len(names)), max_nfev=_STEPS).x
    solved = least_squares(
        near, shaped, diff_step=np.full(len(shaped), _DIFFERENCE), max_nfev=_STEPS
    )
    worst = float(np.max(np.abs(near(solved.x)[: len(target)])))
    if not worst < _WORST_PERCENT:
        raise ModelError(
            f"tuning of {model.name} misses a parameter by {worst:.2g} %, wanted {_WORST_PERCENT} %"
        )
    return setting(solved.x)


def autopilot_parameters(
    vehicle: Vehicle | str,
    source: "Source | Plant | None" = None,
    *,
    seed: int = 1,
) -> AutopilotParameters:
    """Return ArduCopter-heli parameters that fly a vehicle, each with its derivation.

    Gains come from `source`: sweeps (see `identify_for_design`), an autopilot's log of SystemID
    sweeps, a model written by `helisim identify` (.json), or a `Plant`; None takes the exact
    linearisation. `seed` is the bench's. Raises StorageError, IdentificationError, or InputError
    where no axis can be tuned or a servo needs a pulse that ArduPilot doesn't send.
    """
    if source is None:
        return parameters_for(vehicle)
    own = isinstance(source, str | PathLike) and Path(source).is_file() and is_dataflash(source)
    plant = source if isinstance(source, Plant) else _plant(source, seed, own)
    told = ", ".join(fit.structure.name for fit in plant.fits)
    lifts = [abs(fit["Z_col"].value) for fit in plant.fits if "Z_col" in fit.parameters]
    return parameters_for(
        vehicle,
        plant,
        of_autopilot=own,
        late=0.0 if own else -0.5 * plant.period,
        lift=lifts[0] if lifts else None,
        made_from=f"models identified {'in its own log' if own else 'of its records'} ({told})",
    )


def _plant(source: Source, seed: int, own: bool) -> Plant:
    if own:
        return logged_plant([str(source)])[0]
    if isinstance(source, str | PathLike) and Path(source).suffix == ".json":
        return Plant((load_fit(source),))
    return identify_for_design(source, seed=seed)
