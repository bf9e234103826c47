"""Fly plans and record them: what the flight computer writes of each flight, with provenance."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeVar

from helisim.base.errors import InputError
from helisim.records.provenance import made_by
from helisim.records.record import FlightRecord
from helisim.sim.envelope import terminated_early
from helisim.sim.faults import RecorderFault
from helisim.sim.injection import injection_digest
from helisim.sim.missions.reached import Reached
from helisim.sim.plain import to_plain
from helisim.sim.plan import Flyable, as_plan
from helisim.sim.recorder import Recorder, last_second
from helisim.sim.simulation import flight_numbers, generator, simulated
from helisim.sim.trajectory import Trajectory
from helisim.vehicle import ControllerLike, Vehicle

Result = TypeVar("Result")

_FEWEST_SAMPLES = 2
"""Beside the first, of the shortest record; the lever arm's derivative needs them."""


@dataclass(frozen=True, eq=False)
class Flight:
    """One flight as it was recorded.

    Attributes:
        record: of the flight computer, as far as the flight went.
        last_second: at the simulation's rate, of a flight that was terminated early; else None.
    """

    record: FlightRecord
    last_second: FlightRecord | None


def fly(
    vehicle: Vehicle,
    plan: Flyable,
    *,
    controller: ControllerLike | Literal["own"] = "own",
    count: int = 1,
    seed: int = 0,
    jobs: int | None = None,
    keep_ended: bool = False,
    on_flight: Callable[[], None] | None = None,
) -> list[FlightRecord]:
    """Fly a plan a number of times and record each flight.

    The result depends on the vehicle, the plan, the number and the seed, not on `jobs`. All
    records are in memory at the end; `fly_each` gives them one by one.

    Args:
        vehicle: that flies.
        plan: of the flights; a bare manoeuvre or mission, or a function of time in s that gives
            what is added to the four sticks, is a plan with all else default.
        controller: that flies in place of the vehicle's own: a law of (seen, state, settings), a
            `Controller`, a law as data such as `read_law` gives, or None: then the servos stay
            where they are trimmed, but for what the plan adds to their commands.
        count: number of flights.
        seed: of pilots, turbulence and sensors; flight k of a seed is always the same.
        jobs: threads; all processors if None.
        keep_ended: True returns flights that were terminated early as far as they went, marked:
            `FlightRecord.ended` says why, and the identification refuses them.
        on_flight: called after each flight, for progress.

    Returns:
        One record a flight.

    Raises:
        InputError: count, seed or jobs is out of range, or the plan can't be flown.
        TrimError: the vehicle can't hover in the wind.
        DivergedError: a flight left its envelope, or its controller failed, and such aren't to be
            kept; the error has its record, its last second and the controller's traceback.
    """
    numbers = flight_numbers(count)
    if not isinstance(controller, str):
        vehicle = vehicle.with_controller(controller)
    elif controller != "own":
        raise InputError(
            f"controller must be a law, a Controller, None or 'own', got {controller!r}"
        )
    records = []
    for record in fly_each(vehicle, plan, numbers, seed=seed, jobs=jobs, keep_ended=keep_ended):
        records.append(record)
        if on_flight is not None:
            on_flight()
    return records


def fly_each(
    vehicle: Vehicle,
    plan: Flyable,
    numbers: Sequence[int],
    *,
    seed: int = 0,
    jobs: int | None = None,
    keep_ended: bool = False,
) -> Iterator[FlightRecord]:
    """Fly the flights of these numbers and yield each record; the rest is as for `fly`.

    Flight k is the same whatever the other numbers, their order and `jobs`. Only as many
    flights as threads are in memory at a time.
    """

    def kept(flight: Flight) -> FlightRecord:
        if flight.last_second is not None and not keep_ended:
            end = flight.record.provenance["ended"]
            scripted = "mission" in flight.record.provenance
            error = terminated_early(end["at"], end["why"], end.get("traceback"), scripted=scripted)
            error.record, error.last_second = flight.record, flight.last_second
            raise error
        return flight.record

    return (kept(one) for one in fly_all(vehicle, plan, numbers, seed=seed, jobs=jobs))


def fly_all(
    vehicle: Vehicle,
    plan: Flyable,
    numbers: Sequence[int],
    *,
    seed: int = 0,
    jobs: int | None = None,
) -> Iterator[Flight]:
    """Yield each flight, those that were terminated early too, with their last second.

    Arguments and the other errors are those of `fly_each`.

    Raises:
        DivergedError: a flight was terminated before there was a record of it.
    """
    return flown(vehicle, plan, numbers, lambda _, flight: flight, seed=seed, jobs=jobs)


def flown(
    vehicle: Vehicle,
    plan: Flyable,
    numbers: Sequence[int],
    then: Callable[[int, Flight], Result],
    *,
    seed: int = 0,
    jobs: int | None = None,
) -> Iterator[Result]:
    """Yield what `then` makes of each flight's number and flight, in the thread that flew it.

    The other arguments and the errors are those of `fly_all`.
    """
    plan = as_plan(plan).on(vehicle)
    recorder = plan.recorder or Recorder.of(vehicle)

    def recorded(number: int, trajectory: Trajectory) -> Result:
        provenance = flight_provenance(vehicle, plan, seed=seed, number=number)
        end = trajectory.end
        if trajectory.script is not None:
            provenance["reached"] = Reached.of(vehicle, trajectory).to_dict()
        if end is not None:
            provenance["ended"] = end.to_dict()
            if trajectory.time[-1] * recorder.rate_hz < _FEWEST_SAMPLES:
                scripted = trajectory.script is not None
                raise terminated_early(end.at, end.why, end.traceback, scripted=scripted)
        record = recorder.record(trajectory, generator(seed, number, "sensors"), provenance)
        for n, fault in enumerate(plan.faults):
            if isinstance(fault, RecorderFault):
                record = fault.apply(record, generator(seed, number, f"fault {n}"))
        last = None if end is None else last_second(trajectory, provenance)
        return then(number, Flight(record, last))

    return simulated(vehicle, plan, numbers, recorded, seed=seed, jobs=jobs)


def flight_provenance(vehicle: Vehicle, plan: Flyable, *, seed: int, number: int) -> dict[str, Any]:
    """Return what a record says of its origin: enough to fly it again."""
    plan = as_plan(plan).on(vehicle)
    facts = plan.to_dict()
    facts["weather"]["dryden"] = to_plain(plan.weather.dryden)
    added = None if plan.excitation is None else injection_digest(plan.excitation, vehicle)
    if added is not None:
        facts["sticks_digest"] = added
    return made_by(
        "simulation",
        **vehicle.provenance,
        **facts,
        plan_digest=plan.digest,
        seed=seed,
        flight=number,
    )
