"""The chain from records to a law that flew: identify, design, prove.

Models for design are identified from records alone: sweeps of all axes, and servos that were on a
bench. The structures are those of `known`. On the records of `helisim reproduce`, five seeds, they
predict the JR700's loops with its own gyro, with twice its gains and with two attitude laws:
crossovers and disturbance rejection to 0.6 %, bandwidths to 0.7 %, phase margins to 0.6 degrees,
gain margins to 0.13 dB in roll and pitch and 0.2 dB in yaw, phase delays to 0.1 ms. The paper's own
structures, where a delay stands for the servos, miss a fast yaw loop's crossover by 5 %: at
80 rad/s they are 14 % too large.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

from helisim.base.errors import InputError, StorageError
from helisim.base.files import make_folder
from helisim.base.note import Command, Option
from helisim.base.value import Value
from helisim.design.design import DRAWN, MARGIN, MODELS, DesignResult, design
from helisim.design.laws import AttitudeCommand, Law, RateCommand
from helisim.design.plant import Plant
from helisim.design.problem import free_parameters
from helisim.design.proof import GRID, Proof, prove
from helisim.design.start import attitude_start, usual_specs
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.criteria import Criterion
from helisim.handling.loop import Loop
from helisim.handling.spec import ATTITUDES, Spec, write_specs
from helisim.records.channels import AXES
from helisim.study.design_chain import flown_vehicle, identify_for_design
from helisim.study.experiment import Flights, Source, sweeps_of
from helisim.vehicle import Vehicle

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
