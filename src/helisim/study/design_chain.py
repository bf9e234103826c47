"""The chain from records to a law that flew: identify, design, prove.

Models for design are identified from records alone: sweeps of all axes, and servos that were on a
bench. The structures are those of `known`. On the records of `helisim reproduce`, five seeds, they
predict the JR700's loops with its own gyro, with twice its gains and with two attitude laws:
crossovers and disturbance rejection to 0.6 %, bandwidths to 0.7 %, phase margins to 0.6 degrees,
gain margins to 0.13 dB in roll and pitch and 0.2 dB in yaw, phase delays to 0.1 ms. The paper's own
structures, where a delay stands for the servos, miss a fast yaw loop's crossover by 5 %: at
80 rad/s they are 14 % too large.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from helisim.base.errors import InputError, StorageError
from helisim.base.files import make_folder
from helisim.base.note import Command, Option
from helisim.base.settings import Value
from helisim.design.design import DRAWN, MARGIN, MODELS, DesignResult, design
from helisim.design.laws import AttitudeCommand, Law, RateCommand
from helisim.design.plant import Plant
from helisim.design.problem import free_parameters
from helisim.design.proof import GRID, Proof, prove
from helisim.design.start import attitude_start, usual_specs
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.criteria import Criterion
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
from helisim.records.record import AXES, FlightRecord
from helisim.sim.rigs import Finding, RigTest
from helisim.study.comparison import frequency_response
from helisim.study.experiment import Flights, Source, servo_test, sweeps_of
from helisim.study.models import (
    HEAVE,
    HEAVE_SERVO,
    ROLLPITCH_IN1,
    ROLLPITCH_SERVO,
    SERVOS,
    YAW_BASE,
    YAW_BASE_SERVO,
    ModelSpec,
)
from helisim.vehicle import Vehicle, load
from helisim.vehicle.folder import rig_names, vehicle_names
from helisim.vehicle.vehicle import standard_parameters

Servos = Mapping[str, float | tuple[float, float]]

_BENCH = "bench"
_PERIOD = 0.002
"""s, of a gyro that a record doesn't tell of."""
_SERVOS = {
    "swash_omega": "servo.swash_frequency",
    "swash_zeta": "servo.swash_damping",
    "tail_omega": "servo.tail_frequency",
    "tail_zeta": "servo.tail_damping",
}
"""What the models are given -> the parameter of a vehicle that says it."""


@dataclass(frozen=True)
class _Model:
    """A model for design.

    Attributes:
        spec: with the servos in it.
        plain: its structure without.
        axes: whose sweeps it can't do without.
        section: of a vehicle's own band.
        across: by how much the band of responses across axes begins higher.
        inflow: the structure, servos in it, with the inflow as states: for what the other can't
            follow.
    """

    spec: ModelSpec
    plain: Structure
    axes: tuple[str, ...]
    section: str
    across: float = 1.0
    inflow: Structure | None = None


_MISFIT = 10.0
"""Times what noise leaves, from which on a structure can't follow: the JR700's leave 1, with
Pitt-Peters inflow 465; the structure with inflow then leaves 22, and phase margins that were 9
degrees off are 1 off."""

_SWASH = blocks.second_order("swash", omega=200.0, zeta=0.7)
"""What is known replaces the numbers."""

_MODELS = (
    _Model(YAW_BASE_SERVO, YAW_BASE.structure, ("ped",), "yaw_base"),
    _Model(
        replace(ROLLPITCH_SERVO, band=ROLLPITCH_IN1.band),
        structures.rollpitch_speeds,
        ("lat", "lon"),
        "rollpitch_in1",
        across=2.0,
        inflow=in_series(
            with_inflow(structures.rollpitch_speeds, "rollpitch_speeds_inflow"),
            inputs={"lat": _SWASH, "lon": _SWASH},
        ),
    ),
    _Model(HEAVE_SERVO, HEAVE.structure, ("col",), "heave"),
)
"""Roll and pitch from 3 rad/s, where p/lat and q/lon are 0.5 % off: flap-back, on which the slow
loops of an attitude law stand, is then known to a tenth. From 6 rad/s, as parameters are judged
from, it is up to 60 % off, and with it a phase margin at 4 rad/s by 2 degrees. Large slow motions
bend q/lat and p/lon by 3 to 5 % near 4 rad/s, so these are taken from 6."""


def identify_for_design(
    source: Source,
    *,
    axes: Sequence[str] = AXES,
    vehicle: Vehicle | None = None,
    servos: Servos | None = None,
    late: Mapping[str, float] | None = None,
    period: float | None = None,
    latency: float | None = None,
    stick_latency: Mapping[str, float] | None = None,
    seed: int = 1,
) -> Plant:
    """Identify what a control law of an aircraft has to do with, from sweeps of its axes.

    Args:
        source: a folder of `helisim reproduce`, or of sweeps; or sweeps, by axis or, where they
            say which they sweep, in a row.
        axes: that the law shall have; roll and pitch go together. What isn't swept besides isn't
            conditioned on: pedals that the gyro moves meanwhile take up to 3 % off q/lat.
        vehicle: that flew; a shipped one is known by its records.
        servos: "swash_omega" (rad/s), "swash_zeta", "tail_omega", "tail_zeta", each a value, or
            a value and its standard error. By default what the vehicle's bench finds; without a
            bench what vehicle or records say; where nothing does, delays stand for the servos.
        late: by how much a channel is recorded late, s; by default what the records say.
        period: s, between the gyro's ticks; by default what the records say.
        latency: s, from sensing rates to their use by the gyro; by default what the records say.
        stick_latency: by how much a stick reaches the gyro late, s, by name, such as "PED" (the
            bench test of `reproduce` finds it to 0.1 ms); by default what the records say.
        seed: of the bench test.

    Raises:
        StorageError: a file can't be read.
        InputError: an axis was not swept, or a servo's number is unknown.
        IdentificationError: a model can't be identified.
    """
    flights = sweeps_of(source)
    chosen = _chosen(tuple(axis_of(axis).name for axis in axes), flights)
    records = [record for axis in AXES for record in flights.get(axis, ())]
    said = records[0].provenance
    own: Mapping[str, Any] = said.get("parameters") or {}
    if late is None and "recorder" in said:
        late = said["recorder"].get("latency") or {}
    if stick_latency is None and "gyro.ped_latency" in own:
        stick_latency = {"PED": own["gyro.ped_latency"]}
    ticks: float = own.get("gyro.period", _PERIOD) if period is None else period
    if servos is None:
        test = servos_of(vehicle or flown_vehicle(said), seed) or _said(own)
    else:
        test = _given(servos)
    speed = own.get("main_rotor.speed")
    turn = own.get("main_rotor.direction", 1.0) / speed if speed else None

    def filled(structure: Structure, spec: ModelSpec) -> Structure:
        """Return a structure with all that is known in it.

        Where servos and recorder are known, the delay is: it is the recorder's and half a period
        of held commands. Left free it would be known to 0.2 ms in yaw, which is 0.3 dB of a gain
        margin at 190 rad/s.
        """
        assert test is not None
        found = {name: test[one.name] for name, one in spec.given.items()}
        values = {name: one.value for name, one in found.items()}
        behind = {(late or {}).get(name, 0.0) for name in spec.outputs}
        if late is not None and len(behind) == 1:  # else an input's delay is not that of all
            delays = spec.structure.input_delays.items()
            values |= {
                delay: min(behind) - late.get(name, 0.0) + 0.5 * ticks for name, delay in delays
            }
        errors = {name: one.standard_error or 0.0 for name, one in found.items()}
        return structure.with_fixed(values, errors)

    fits = []
    for model in chosen:
        response, bands = _responses(model, flights, own)
        known = model.plain if test is None else filled(model.spec.structure, model.spec)
        fit = identify(response, known, band=bands)
        if model.inflow is not None and test and turn is not None and _excess(fit) >= _MISFIT:
            richer = filled(model.inflow, model.spec).with_fixed({"turn": turn})
            other = identify(response, richer, band=bands)
            fit = other if _excess(other) < 0.5 * _excess(fit) else fit
        fits.append(fit)
    return Plant(
        tuple(fits),
        late=late or {},
        period=ticks,
        latency=own.get("gyro.latency", 0.0) if latency is None else latency,
        tilt=_tilt(records),
        stick_latency=stick_latency or {},
    )


def servos_of(vehicle: Vehicle | None, seed: int = 1) -> RigTest | None:
    """Return what is known of a vehicle's servos: by its bench, or else as it says itself."""
    if vehicle is None:
        return None
    if _BENCH in rig_names(vehicle.folder):
        return servo_test(vehicle, seed=seed)
    return _said(vehicle.parameters)


def _said(own: Mapping[str, Any]) -> RigTest | None:
    if not set(_SERVOS.values()) <= set(own):
        return None
    return _given({name: float(own[key]) for name, key in _SERVOS.items()})


def _given(servos: Servos) -> RigTest:
    if set(servos) != set(_SERVOS):
        raise InputError(
            f"servos are given by {', '.join(_SERVOS)}; got {', '.join(servos) or 'nothing'}"
        )
    pairs = {name: one if isinstance(one, tuple) else (one, 0.0) for name, one in servos.items()}
    found = [
        Finding(name=name, unit="", value=value, standard_error=error, how="given")
        for name, (value, error) in pairs.items()
    ]
    return RigTest(rig=SERVOS, findings=tuple(found))


def flown_vehicle(said: Mapping[str, Any]) -> Vehicle | None:
    """Return the shipped vehicle that a record's provenance names, None if it is no such."""
    name, own = said.get("vehicle"), said.get("parameters")
    if name not in vehicle_names() or not own:
        return None
    standard = standard_parameters(name)
    changed = {key: own[key] for key in standard if key in own and own[key] != standard[key]}
    return load(name, parameters=changed, timestep=said.get("timestep_s"))


def _chosen(axes: tuple[str, ...], flights: Flights) -> tuple[_Model, ...]:
    """Return the models of some axes. Raises InputError where a sweep is missing."""
    chosen = tuple(model for model in _MODELS if set(model.axes) & set(axes))
    needed = [axis for axis in AXES if any(axis in model.axes for model in chosen)]
    missing = [axis for axis in needed if not flights.get(axis)]
    if missing:
        there = ", ".join(flights) or "none"
        left = [axis for model in _MODELS for axis in model.axes if set(model.axes) <= set(flights)]
        besides = f", or leave it out: axes={tuple(left)}" if left else ""
        raise InputError(
            f"no sweep of {', '.join(missing)} to identify it from: there are sweeps of {there}. "
            f"Fly some{besides}",
            remedy=Command("fly", (), (Option("axis", missing[0]), Option("count", "5"))),
        )
    return chosen


def _responses(
    model: _Model, flights: Flights, own: Mapping[str, Any]
) -> tuple[FrequencyResponse, dict[str, tuple[float, float]]]:
    """Return the responses that a model is identified of, and the band of each.

    The vehicle's own band, or the JR700's, as far as the sweeps go.
    """
    low, high = model.spec.band
    if f"band.{model.section}_low" in own:
        low, high = (own[f"band.{model.section}_{edge}"] for edge in ("low", "high"))
    flown = [record.provenance for axis in model.axes for record in flights[axis]]
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
            low if output in (axis_of(name).rate, axis_of(name).angle) else model.across * low,
            high,
        )
        for output in spec.outputs
        for name in spec.inputs
    }
    return frequency_response(spec, flights), bands


def _excess(fit: Fit) -> float:
    """Return how many times what noise would leave a fit leaves, 0 where it isn't known."""
    return 0.0 if fit.misfit is None else fit.misfit.ratio or 0.0


def _tilt(records: Sequence[FlightRecord]) -> tuple[float, float]:
    """Return the mean roll and pitch angle, 0 where they aren't recorded."""
    phi, theta = (
        float(np.mean([np.mean(record[name]) for record in records if name in record] or [0.0]))
        for name in ("phi", "theta")
    )
    return phi, theta


RESULT, LAW, SPECS, PROOF = "design.json", "law.toml", "specs.toml", "proof"
"""What a design leaves in its folder."""

OnStep = Callable[[str], None]


@dataclass(frozen=True, kw_only=True)
class DesignOptions:
    """How a design is made.

    Attributes:
        margin: design margin, of the distance between Levels 1 and 2.
        models: drawn by the fits' covariances to design with.
        drawn: drawn anew to judge by.
        seed: of the draws, and of the proof's flights.
        proof: whether the law is flown.
    """

    margin: float = MARGIN
    models: int = MODELS
    drawn: int = DRAWN
    seed: int = 1
    proof: bool = True


@dataclass(frozen=True, eq=False)
class DesignRun(Value):
    """What a chain found.

    Attributes:
        vehicle: whose records it began with, with its own gyro.
        plant: as it was identified.
        result: the design.
        proof: the law in flight; None if it wasn't flown.
    """

    vehicle: Vehicle
    plant: Plant
    result: DesignResult
    proof: Proof | None

    @property
    def met(self) -> bool:
        """Whether every level is kept: in all models drawn, and in flight if it flew."""
        return not self.result.misses and (self.proof is None or self.proof.met)

    def loop(self, law: Law) -> Loop:
        """Return the loop that the identified model and a law make."""
        return ClosedLoop(self.plant, law.linear(self.plant.period), GRID)


def run_design(
    source: Source,
    *,
    vehicle: Vehicle | None = None,
    law: Law | None = None,
    specs: Sequence[Spec] | None = None,
    options: DesignOptions | None = None,
    on_step: OnStep | None = None,
) -> DesignRun:
    """Identify a vehicle from records, design a law for it, and fly the proof.

    Args:
        source: the folder of a run of `helisim reproduce`, or of sweeps; sweeps by axis, or such
            as say which axis they sweep.
        vehicle: that flew them, and flies the proof; a shipped one is known by its records.
        law: of the structure that is wanted, where the search starts; by default attitude command
            with the inverse of the identified model.
        specs: what is asked; by default `usual_specs`, measured on the vehicle's own gyro.
        options: how.
        on_step: called with a word after each step.

    Raises:
        StorageError: there is no such run.
        InputError: the records are of no known vehicle, or the law or a specification is unfit.
        UnstableError: no values of the law's parameters make the loops stable.
        InfeasibleError: a specification can't be met.
        DivergedError: the law doesn't stay in the air.
    """
    chosen, tell = options or DesignOptions(), on_step or (lambda _: None)
    flights = _flights(source)
    vehicle = vehicle or vehicle_of(flights)
    axes = [one for one in AXES if one in ATTITUDES or flights.get(one)]  # heave has no loop
    plant = identify_for_design(flights, axes=axes, vehicle=vehicle, seed=chosen.seed)
    tell("identified")
    before = RateCommand.of(vehicle)
    asked = tuple(specs) if specs is not None else _usual(plant, before, vehicle)
    start, bounds = _start(law, plant)
    result = design(
        plant,
        start,
        asked,
        before=before,
        bounds=bounds,
        only=tuple(bounds) or None,
        margin=chosen.margin,
        models=chosen.models,
        drawn=chosen.drawn,
        seed=chosen.seed,
        on_progress=tell,
    )
    run = DesignRun(vehicle, plant, result, None)
    if not chosen.proof:
        return run
    proof = prove(
        vehicle,
        result.law.on(vehicle),
        asked,
        predicted=run.loop(result.law),
        on_flight=lambda: tell("flight"),
    )
    return replace(run, proof=proof)


def vehicle_of(flights: Flights) -> Vehicle:
    """Return the shipped vehicle that flew records, by what they say.

    Raises:
        InputError: they are of no shipped vehicle.
    """
    record = next(record for records in flights.values() for record in records)
    found = flown_vehicle(record.provenance)
    if found is None:
        raise InputError(
            "the records don't say of a shipped vehicle that it flew: give the vehicle, on which "
            "the law shall be proved; helisim.design needs none",
            remedy="vehicle",
        )
    return found


def _flights(source: Source) -> Flights:
    if isinstance(source, str | PathLike) and not Path(source).is_dir():
        raise StorageError(
            f"{source}: no such run; fly and identify first",
            remedy=Command("reproduce", (), (Option("out", str(source)),)),
        )
    return sweeps_of(source)


def write_design(run: DesignRun, out: str | Path) -> None:
    """Write a design into a folder: result, law, specifications, and the proof's records.

    Raises:
        StorageError: the folder can't be written.
    """
    out = make_folder(out)
    run.result.write(out / RESULT)
    run.result.law.write(out / LAW)
    write_specs(run.result.specs, out / SPECS)
    if run.proof is not None:
        run.proof.write(out / PROOF)


def flown_figures(proof: Proof) -> dict[tuple[Criterion, str], float]:
    """Return what was measured in flight by (criterion, figure)."""
    return {
        (row.spec.criterion, one.name): one.flown.value
        for row in proof.table
        for one in row.figures
        if one.flown is not None
    }


def _usual(plant: Plant, before: Law, vehicle: Vehicle) -> tuple[Spec, ...]:
    own = vehicle.parameters
    return usual_specs(
        plant,
        before,
        period=plant.period,
        diameter=2.0 * own["main_rotor.radius"],
        rate_limit=own["servo.rate_limit"],
    )


def _start(law: Law | None, plant: Plant) -> tuple[Law, dict[str, tuple[float, float]]]:
    """Return where the search starts, and ranges of what is moved; of a law given, all usual."""
    usual = attitude_start(plant, period=plant.period)
    if law is None:
        return usual.law, dict(usual.bounds)
    if not isinstance(law, AttitudeCommand):
        return law, {}
    own = law.parameters()
    moved = {
        one.name: (min(one.low, own[one.name]), max(one.high, own[one.name]))
        for one in free_parameters(own, {k: v for k, v in usual.bounds.items() if k in own})
        if one.name in usual.bounds
    }
    return law, moved
