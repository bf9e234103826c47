"""Tune the gyro: gains at which the vehicle, seen from the sticks, is what is published of it.

The yaw gyro's gains are Table 2's; the pedal's latency is
solved so that eq. (8) describes the loop. The cyclic gains are solved so that the response from
the sticks is that of Table 3's IN2 column. Both on the exact linear model of the vehicle. A
vehicle whose parameters ask for a rate command gets one instead.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from helisim.base.errors import InputError, ModelError
from helisim.base.units import DB_PER_NEPER
from helisim.design.plant import Plant
from helisim.ident import identify, load_fit, structures
from helisim.ident.evaluate import response
from helisim.logs.dataflash import is_dataflash
from helisim.look.systemid import estimate_fits, followed_band, infer
from helisim.sim import Recorder
from helisim.sitl.parameters import AutopilotParameters, parameters_for
from helisim.study.design_chain import identify_for_design
from helisim.study.experiment import Source
from helisim.study.models import ROLLPITCH_IN2, YAW_OVERALL, ModelSpec
from helisim.study.paper import published_of
from helisim.study.truth import exact_response, true_values
from helisim.vehicle import Parameters, PhysicalParameter, Vehicle
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
"""Setting -> where the search starts, SI."""

_INSTEAD = (
    "say what the gyro is to be tuned to in a section [tuning] of its parameters.toml: "
    "cyclic_bandwidth, yaw_bandwidth, peak_sensitivity"
)

LOOPS = ("lat", "lon", "ped")
"""Commands of the gyro; it does not act on the collective."""

EXTRA_DELAYS = (0.0, 0.005, 0.010)
"""s, beyond what is in the loops as shipped."""

_STEPS = 30
_DIFFERENCE = 3e-3
"""Relative step of the numerical derivatives, above the noise of the solved gains."""
_REST = 0.02
"""Weight that keeps what the targets leave free where the response put it."""
_WORST_PERCENT = 3.0
"""Eq. (8) has five numbers and the loop one setting; 3.9 % is the paper's smallest bound."""
_PHASE_WEIGHT = np.sqrt(0.01745) * 180.0 / np.pi
"""CIFER's weight of a degree against a decibel, for an error in radian."""


@dataclass(frozen=True)
class Margins:
    """How far a loop is from instability.

    Attributes:
        gain_db: least gain margin, dB.
        phase_deg: least phase margin, degree.
        crossover: highest frequency at which the loop's gain is one, rad/s.
    """

    gain_db: float
    phase_deg: float
    crossover: float


@dataclass(frozen=True)
class LoopMargins:
    """Margins of one loop with a given delay more.

    Attributes:
        axis: command at which the loop is cut.
        extra_delay: s, added there.
        margins: what is left.
    """

    axis: str
    extra_delay: float
    margins: Margins


def margins(vehicle: Vehicle, axis: str, *, extra_delay: float = 0.0) -> Margins:
    """Return the margins of the gyro's loop at one servo command, the other loops closed.

    Args:
        vehicle: with its gyro.
        axis: "lon", "lat" or "ped".
        extra_delay: s, added at that command.
    """
    loop = vehicle.loop(axis)
    omega = np.geomspace(0.3, 0.999 * np.pi / loop.dt, 4000)
    answer = -np.asarray(loop(np.exp(1j * omega * loop.dt), squeeze=True))
    phase = np.unwrap(np.angle(answer)) - omega * extra_delay
    decibel = DB_PER_NEPER * np.log(np.abs(answer))
    crossings = _crossings(decibel)
    if crossings.size == 0:
        raise ModelError(f"the {axis} loop has no crossover: its gain never passes one")
    turned = np.mod(phase + np.pi, 2.0 * np.pi)  # 0 at the critical phase
    critical = np.flatnonzero(np.abs(np.diff(np.floor((phase + np.pi) / (2.0 * np.pi)))) > 0.5)
    behind = [turned[k] if turned[k] <= np.pi else turned[k] - 2.0 * np.pi for k in crossings]
    falls = [-decibel[k] for k in critical if omega[k] > omega[crossings[-1]]]
    return Margins(
        gain_db=float(min(falls, default=np.inf)),
        phase_deg=float(np.degrees(min(behind, key=abs))),
        crossover=float(omega[crossings[-1]]),
    )


def margin_table(vehicle: Vehicle) -> tuple[LoopMargins, ...]:
    """Return the margins of every loop of the gyro, as it is and with more delay."""
    return tuple(
        LoopMargins(axis, extra_delay, margins(vehicle, axis, extra_delay=extra_delay))
        for axis in LOOPS
        for extra_delay in EXTRA_DELAYS
    )


def _crossings(decibel: NDArray[np.float64]) -> NDArray[np.intp]:
    return np.flatnonzero(np.diff(np.sign(decibel)) != 0.0)


def tune(
    vehicle: Vehicle, *, shape: int = 60, on_progress: Callable[[str], None] | None = None
) -> Parameters:
    """Return the gyro's settings, and the stick latencies that go with them.

    A vehicle whose parameters ask for a rate command (`tuning.*`) gets one. For another, first
    the exact response from the sticks is brought near the published model over the band in
    which it is identified; then the identified parameters themselves are met.

    Args:
        vehicle: with the airframe calibrated, and the published yaw gains.
        shape: number of frequencies of the first stage.
        on_progress: called with a model's name each time the loop is tried with other settings.

    Raises:
        ModelError: nothing is published of the vehicle and it asks for nothing, or the targets
            can't be met.
    """
    if any(name.startswith("tuning.") for name in vehicle.parameters):
        return tune_rate_command(vehicle)
    tables = published_of(vehicle.folder, instead=_INSTEAD)
    settings: dict[str, float] = {}
    for starts, model in ((_YAW, YAW_OVERALL), (_CYCLIC, ROLLPITCH_IN2)):
        target = {value.name: value.value for value in tables[model.name]}
        target = {name: value for name, value in target.items() if name in model.tolerances}
        settings |= _solve(vehicle, starts, model, target, shape, on_progress or (lambda _: None))
    source = "solved by helisim tune: eq. (8) and the IN2 column of Table 3"
    entries = {
        name: PhysicalParameter(name, value, vehicle.parameters.entry(name).unit, source)
        for name, value in settings.items()
    }
    return Parameters(entries)


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
    gyro: bool = False,
    seed: int = 1,
) -> AutopilotParameters:
    """Return parameters with which ArduCopter-heli flies a vehicle, each with its derivation.

    Args:
        vehicle: or its name or folder: its servos, rotor and hover are what is set.
        source: what its gains come from: sweeps (see `identify_for_design`), an autopilot's log of
            SystemID's sweeps, one identified model as `helisim identify` writes it of other
            records (.json), or a `Plant`; None takes the vehicle's exact linearisation, as if it
            were known.
        gyro: whether the vehicle's own gyro stays in the tail, and is asked for a rate of yaw.
        seed: of the bench test that finds its servos.

    Raises:
        StorageError: a file can't be read.
        InputError: no axis can be tuned, or a servo needs a pulse that ArduPilot doesn't send.
        IdentificationError: a model can't be identified.
    """
    if source is None:
        return parameters_for(vehicle, gyro=gyro)
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
        gyro=gyro,
        made_from=f"models identified {'in its own log' if own else 'of its records'} ({told})",
    )


def _plant(source: Source, seed: int, own: bool) -> Plant:
    if own:
        return _logged(Path(str(source)))
    if isinstance(source, str | PathLike) and Path(source).suffix == ".json":
        return Plant((load_fit(source),))
    return identify_for_design(source, seed=seed)


def _logged(path: Path) -> Plant:
    """Return what an autopilot's log tells: commands are in its unit, held for its ticks."""
    found = infer([path])
    wanted = tuple(fit for fit in found.fits if not fit.structure.startswith("tf:"))
    if not wanted:
        raise InputError(
            f"{path}: no model of it can be used for gains; sweep roll and pitch both, or yaw"
        )
    names = {
        name
        for fit in wanted
        for name in (*fit.inputs, *fit.outputs, *fit.conditioning, *fit.reference)
    }
    records = [record for log in found.read(names) for record in log.records]
    fits = []
    for fit, estimate in zip(wanted, estimate_fits(records, wanted)):
        structure = structures.named(fit.structure)
        band = followed_band(estimate, structure, fit.band)
        fits.append(identify(estimate, structure, band=band))
    return Plant(tuple(fits))
