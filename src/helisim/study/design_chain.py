"""The chain from records to a law that flew: identify, design, prove."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from helisim.base.errors import InputError, StorageError
from helisim.base.files import make_folder
from helisim.base.note import Command, Option
from helisim.design.design import MARGIN, MODELS, SAMPLES, DesignResult, design
from helisim.design.laws import Law, RateCommand
from helisim.design.plant import Plant
from helisim.design.proof import GRID, Proof, prove
from helisim.design.start import attitude_start, usual_specs
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.loop import Loop, axis_of
from helisim.handling.spec import ATTITUDES, Spec, write_specs
from helisim.ident import (
    Fit,
    FrequencyResponse,
    Structure,
    blocks,
    identify,
    in_series,
    structures,
)
from helisim.ident.structures import with_inflow
from helisim.records.record import AXES
from helisim.study.comparison import frequency_response
from helisim.study.experiment import Flights, Source, servo_test, sweeps_of
from helisim.study.models import (
    HEAVE,
    HEAVE_SERVO,
    ROLLPITCH_IN1,
    ROLLPITCH_SERVO,
    YAW_BASE,
    YAW_BASE_SERVO,
    ModelSpec,
)
from helisim.vehicle import Vehicle, load
from helisim.vehicle.parameters import rig_names, vehicle_names
from helisim.vehicle.vehicle import standard_parameters

Servos = dict[str, tuple[float, float]]  # parameter -> value, standard error
_PERIOD = 0.002  # s, where records state none
_SERVOS = {
    "swash_omega": "servo.swash_frequency",
    "swash_zeta": "servo.swash_damping",
    "tail_omega": "servo.tail_frequency",
    "tail_zeta": "servo.tail_damping",
}  # given parameter -> the vehicle's that states it


@dataclass(frozen=True)
class _Model:
    """A model with the servos known, `plain` without them; `section` of the vehicle's [band]."""

    spec: ModelSpec
    plain: Structure
    section: str
    inflow: Structure | None = None


_RESIDUAL = 10.0  # residual over noise; the JR700 has 1, with Pitt-Peters inflow 465
_ACROSS = 2.0  # scale of the lower end of the bands of responses across axes

_SWASH = blocks.second_order("swash", omega=200.0, zeta=0.7)

_SPEEDS = structures.rollpitch_speeds.with_free("L_p", "M_q")

_MODELS = (
    _Model(YAW_BASE_SERVO, YAW_BASE.structure, "yaw_base"),
    _Model(
        replace(ROLLPITCH_SERVO, band=ROLLPITCH_IN1.band),
        _SPEEDS,
        "rollpitch_in1",
        in_series(
            with_inflow(_SPEEDS, "rollpitch_speeds_inflow"),
            inputs={"lat": _SWASH, "lon": _SWASH},
        ),
    ),
    _Model(HEAVE_SERVO, HEAVE.structure, "heave"),
)


def identify_for_design(
    source: Source,
    *,
    axes: Sequence[str] = AXES,
    vehicle: Vehicle | None = None,
    seed: int = 1,
) -> Plant:
    """Identify a plant for a control law from sweeps of its axes (docs/theory/plant.md).

    Servos are those of the vehicle's bench, else as vehicle or records state; else delays stand for
    them, and a fast yaw loop's crossover is missed by 5 %. Roll and pitch go together. Axes left
    out aren't conditioned on: pedals moved by the gyro take up to 3 % off q/lat. `seed` is the
    bench's. Raises StorageError, InputError where an axis wasn't swept, or IdentificationError.
    """
    flights = sweeps_of(source)
    chosen = _chosen(tuple(axis_of(axis).name for axis in axes), flights)
    records = [record for axis in AXES for record in flights.get(axis, ())]
    said = records[0].provenance
    own: Mapping[str, Any] = said.get("parameters") or {}
    late = said["recorder"].get("latency") or {} if "recorder" in said else None
    ticks: float = own.get("gyro.period", _PERIOD)
    test = servos_of(vehicle or flown_vehicle(said), seed) or _said(own)
    speed = own.get("main_rotor.speed")

    def filled(structure: Structure, spec: ModelSpec) -> Structure:
        assert test is not None
        values = {name: test[one.name][0] for name, one in spec.given.items()}
        errors = {name: test[one.name][1] for name, one in spec.given.items()}
        behind = {(late or {}).get(name, 0.0) for name in spec.outputs}
        if late is not None and len(behind) == 1:  # else an input's delay is not that of all
            for name, delay in spec.structure.input_delays.items():
                values[delay] = min(behind) - late.get(name, 0.0) + 0.5 * ticks
        return structure.with_fixed(values, errors)

    fits = []
    for model in chosen:
        response, bands = _responses(model, flights, own)
        known = model.plain if test is None else filled(model.spec.structure, model.spec)
        fit = identify(response, known, band=bands)
        if model.inflow is not None and test and speed and _excess(fit) >= _RESIDUAL:
            turn = {"turn": own.get("main_rotor.direction", 1.0) / speed}
            other = identify(
                response, filled(model.inflow, model.spec).with_fixed(turn), band=bands
            )
            fit = other if _excess(other) < 0.5 * _excess(fit) else fit
        fits.append(fit)
    pedal = {"PED": own["gyro.ped_latency"]} if "gyro.ped_latency" in own else {}
    phi, theta = (
        float(np.mean([np.mean(record[name]) for record in records if name in record] or [0.0]))
        for name in ("phi", "theta")
    )
    return Plant(tuple(fits), late or {}, ticks, own.get("gyro.latency", 0.0), (phi, theta), pedal)


def servos_of(vehicle: Vehicle | None, seed: int = 1) -> Servos | None:
    """Return a vehicle's servos, from its bench or else from its parameters."""
    if vehicle is None:
        return None
    if "bench" in rig_names(vehicle.folder):
        findings = servo_test(vehicle, seed=seed).findings
        return {one.name: (one.value, one.standard_error or 0.0) for one in findings}
    return _said(vehicle.parameters)


def _said(own: Mapping[str, Any]) -> Servos | None:
    return (
        {name: (float(own[key]), 0.0) for name, key in _SERVOS.items()}
        if set(_SERVOS.values()) <= set(own)
        else None
    )


def flown_vehicle(said: Mapping[str, Any]) -> Vehicle | None:
    """Return the shipped vehicle that a record's provenance names, or None."""
    name, own = said.get("vehicle"), said.get("parameters")
    if name not in vehicle_names() or not own:
        return None
    standard = standard_parameters(name)
    changed = {key: own[key] for key in standard if key in own and own[key] != standard[key]}
    return load(name, parameters=changed, timestep=said.get("timestep_s"), slung=said.get("slung"))


def _chosen(axes: tuple[str, ...], flights: Flights) -> tuple[_Model, ...]:
    chosen = tuple(model for model in _MODELS if set(model.spec.inputs) & set(axes))
    needed = [axis for axis in AXES if any(axis in model.spec.inputs for model in chosen)]
    missing = [axis for axis in needed if not flights.get(axis)]
    if missing:
        raise InputError(
            f"no sweep of {', '.join(missing)} to identify it from: there are sweeps of "
            f"{', '.join(flights) or 'none'}. Fly some, or leave the axis out",
            remedy=Command("fly", (), (Option("axis", missing[0]), Option("count", "5"))),
        )
    return chosen


def _responses(
    model: _Model, flights: Flights, own: Mapping[str, Any]
) -> tuple[FrequencyResponse, dict[str, tuple[float, float]]]:
    low, high = model.spec.band
    if f"band.{model.section}_low" in own:
        low, high = (own[f"band.{model.section}_{edge}"] for edge in ("low", "high"))
    flown = [record.provenance for axis in model.spec.inputs for record in flights[axis]]
    ends = [one["excitation"]["band"][1] for one in flown if one.get("excitation", {}).get("band")]
    high = min([high, *ends])
    lacking = [axis for axis in model.spec.sweeps if not flights.get(axis)]
    sticks = [axis.upper() for axis in lacking]
    spec = replace(
        model.spec,
        sweeps=tuple(axis for axis in model.spec.sweeps if axis not in lacking),
        conditioning=tuple(name for name in model.spec.conditioning if name not in lacking),
        reference=tuple(name for name in model.spec.reference if name not in sticks),
        band=(low, high),
    )
    bands = {
        f"{output}/{name}": (
            low if output in (axis_of(name).rate, axis_of(name).angle) else _ACROSS * low,
            high,
        )
        for output in spec.outputs
        for name in spec.inputs
    }
    return frequency_response(spec, flights), bands


def _excess(fit: Fit) -> float:
    return 0.0 if fit.residual is None else fit.residual.ratio or 0.0


RESULT, LAW, SPECS, PROOF = "design.json", "law.toml", "specs.toml", "proof"


@dataclass(frozen=True, eq=False)
class DesignRun:
    """A design from records of a vehicle with its own gyro; `proof` is None if it wasn't flown."""

    vehicle: Vehicle
    plant: Plant
    result: DesignResult
    proof: Proof | None

    @property
    def met(self) -> bool:
        """Whether every level is kept in all sampled models, and in flight if flown."""
        return not self.result.misses and not (self.proof and self.proof.misses)

    def loop(self, law: Law) -> Loop:
        """Return the loop of the identified model with a law."""
        return ClosedLoop(self.plant, law.linear(self.plant.period), GRID)


def run_design(
    source: Source,
    *,
    vehicle: Vehicle | None = None,
    law: Law | None = None,
    specs: Sequence[Spec] | None = None,
    margin: float = MARGIN,
    models: int = MODELS,
    samples: int = SAMPLES,
    seed: int = 1,
    proof: bool = True,
    on_step: Callable[[str], None] = lambda _: None,
) -> DesignRun:
    """Identify a vehicle from records, design a law for it, and fly the proof.

    Shipped vehicles are known by their records. `law` begins the search: None is attitude command
    with the identified model's inverse. `specs` None is `usual_specs` of the vehicle's own gyro.
    `margin` is a share of the distance between Levels 1 and 2. `models` are sampled by the fits'
    covariances to design with, `samples` anew to judge by; `seed` is of draws and flights.

    Raises StorageError, InputError, UnstableError where no parameters stabilise the loops,
    InfeasibleError where a specification can't be met, or DivergedError.
    """
    if isinstance(source, str | PathLike) and not Path(source).is_dir():
        raise StorageError(
            f"{source}: no such run; fly and identify first",
            remedy=Command("reproduce", (), (Option("out", str(source)),)),
        )
    flights = sweeps_of(source)
    vehicle = vehicle or flown_vehicle(next(iter(flights.values()))[0].provenance)
    if vehicle is None:
        raise InputError(
            "the records don't say of a shipped vehicle that it flew: give the vehicle, on which "
            "the law shall be proved; helisim.design needs none",
            remedy="vehicle",
        )
    axes = [one for one in AXES if one in ATTITUDES or flights.get(one)]  # heave has no loop
    plant = identify_for_design(flights, axes=axes, vehicle=vehicle, seed=seed)
    on_step("identified")
    before, own = RateCommand.of(vehicle), vehicle.parameters
    if specs is None:
        diameter, rate_limit = 2.0 * own["main_rotor.radius"], own["servo.rate_limit"]
        specs = usual_specs(
            plant, before, period=plant.period, diameter=diameter, rate_limit=rate_limit
        )
    bounds = None
    if law is None:
        law, bounds = attitude_start(plant, period=plant.period)
    result = design(
        plant,
        law,
        specs,
        before=before,
        bounds=bounds,
        only=tuple(bounds) if bounds else None,
        margin=margin,
        models=models,
        samples=samples,
        seed=seed,
        on_progress=on_step,
    )
    run = DesignRun(vehicle, plant, result, None)
    if not proof:
        return run
    flown = prove(
        vehicle,
        result.law.on(vehicle),
        specs,
        predicted=run.loop(result.law),
        on_flight=lambda: on_step("flight"),
    )
    return replace(run, proof=flown)


def write_design(run: DesignRun, out: str | Path) -> None:
    """Write result, law, specifications and records of the proof. Raises StorageError."""
    out = make_folder(out)
    run.result.write(out / RESULT)
    run.result.law.write(out / LAW)
    write_specs(run.result.specs, out / SPECS)
    if run.proof is not None:
        run.proof.write(out / PROOF)
