"""Fly plans and record them, into memory or into a folder."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from helisim.base.errors import InputError, RecordError, StorageError
from helisim.base.files import make_folder
from helisim.base.settings import to_plain
from helisim.base.value import FrozenMap
from helisim.records.provenance import difference, made_by, plain
from helisim.records.record import FlightRecord
from helisim.records.storage import read_record, write_record
from helisim.sim.excitation import injection_digest
from helisim.sim.faults import RecorderFault
from helisim.sim.flight import flight_numbers, generator, simulated
from helisim.sim.missions.mission import Reached
from helisim.sim.plan import Flyable, as_plan
from helisim.sim.recorder import Recorder, last_second
from helisim.sim.trajectory import End, Trajectory
from helisim.vehicle import ControllerLike, Vehicle

LAST_SECONDS = "last_second"
"""Folder beside records, of the last seconds of those flights that were terminated early."""
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

    def record(flight: Flight) -> FlightRecord:
        if flight.last_second is not None and not keep_ended:
            said = flight.record.provenance
            error = End(**{"traceback": None, **said["ended"]}).error(scripted="mission" in said)
            error.record, error.last_second = flight.record, flight.last_second
            raise error
        return flight.record

    return (record(one) for one in fly_all(vehicle, plan, numbers, seed=seed, jobs=jobs))


def fly_all(
    vehicle: Vehicle,
    plan: Flyable,
    numbers: Sequence[int],
    then: Callable[[int, Flight], Any] = lambda _, flight: flight,
    *,
    seed: int = 0,
    jobs: int | None = None,
) -> Iterator[Any]:
    """Yield each flight, those that were terminated early too, with their last second.

    What is yielded is what `then` makes of number and flight, in the thread that flew it. The
    other arguments and errors are those of `fly_each`.

    Raises:
        DivergedError: a flight was terminated before there was a record of it.
    """
    plan = as_plan(plan).on(vehicle)
    recorder = plan.recorder or Recorder.of(vehicle)

    def recorded(number: int, trajectory: Trajectory) -> Any:
        provenance = flight_provenance(vehicle, plan, seed=seed, number=number)
        end, last = trajectory.end, None
        if trajectory.script is not None:
            provenance["reached"] = to_plain(Reached.of(vehicle, trajectory))
        if end is not None:
            provenance["ended"] = end.to_dict()
            if trajectory.time[-1] * recorder.rate_hz < _FEWEST_SAMPLES:
                raise end.error(scripted=trajectory.script is not None)
            last = last_second(trajectory, provenance)
        record = recorder.record(trajectory, generator(seed, number, "sensors"), provenance)
        for n, fault in enumerate(plan.faults):
            if isinstance(fault, RecorderFault):
                record = fault.apply(record, generator(seed, number, f"fault {n}"))
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
    facts |= {"plan_digest": plan.digest, "seed": seed, "flight": number}
    return made_by("simulation", **vehicle.provenance, **facts)


@dataclass(frozen=True)
class Flown:
    """What a folder holds after its flights.

    Attributes:
        paths: one record a flight, in order.
        found: how many of them were there before, and were left as they are.
        ended: why those were terminated early that were; a folder `last_second` holds that of
            each, at the simulation's rate.
    """

    paths: tuple[Path, ...]
    found: int
    ended: Mapping[Path, str]


def fly_to(
    folder: Path,
    vehicle: Vehicle,
    plan: Flyable,
    *,
    count: int = 1,
    seed: int = 0,
    jobs: int | None = None,
    on_flight: Callable[[], None] | None = None,
) -> Flown:
    """Fly a plan as `fly` does and write each record as its flight ends.

    Flights that the folder already holds, whole and of the same provenance, aren't flown
    again; so a second call goes on where an interrupted one stopped. A damaged file is
    written anew. A flight that is terminated early is kept as far as it went, marked, and the
    others go on. Memory doesn't grow with `count`.

    Args:
        folder: of records such as `lat_0001.parquet`; made if it doesn't exist.
        vehicle: that flies.
        plan: of the flights; a bare manoeuvre, or a function of time in s that gives what is
            added to the four sticks, is a plan with all else default.
        count: number of flights that the folder shall hold.
        seed: of pilots, turbulence and sensors.
        jobs: threads; all processors if None.
        on_flight: called once for each flight that the folder holds, for progress.

    Raises:
        InputError: as for `fly`; or the folder holds a flight of another configuration.
        DivergedError: a flight is terminated before there is a record of it; those before it
            are kept.
        StorageError: the folder can't be made or written.
    """
    plan = as_plan(plan).on(vehicle)
    paths = [folder / f"{plan.name}_{k + 1:04d}.parquet" for k in flight_numbers(count)]
    ended: dict[Path, str] = {}
    missing = []

    def kept(path: Path, record: FlightRecord) -> None:
        if record.ended:
            ended[path] = record.ended
        if on_flight is not None:
            on_flight()

    for number, path in enumerate(paths):
        expected = flight_provenance(vehicle, plan, seed=seed, number=number)
        found = _found(path, plain(expected))
        if found is None:
            missing.append(number)
        else:
            kept(path, found)
    flights = fly_all(vehicle, plan, missing, seed=seed, jobs=jobs)
    make_folder(folder)
    for number, flight in zip(missing, flights):
        write_flight(flight, paths[number])
        kept(paths[number], flight.record)
    return Flown(tuple(paths), count - len(missing), FrozenMap(dict(sorted(ended.items()))))


def write_flight(flight: Flight, path: Path) -> Path | None:
    """Write a flight, and its last second, if there is one, into a folder beside it.

    Returns the path of the last second. Raises StorageError.
    """
    beside = None
    if flight.last_second is not None:  # first: a record that says that it ended has it
        beside = make_folder(path.parent / LAST_SECONDS) / f"{path.stem}.parquet"
        write_record(flight.last_second, beside)
    write_record(flight.record, path)
    return beside


def _found(path: Path, expected: Mapping[str, Any]) -> FlightRecord | None:
    """Return the flight that a file holds; None where it is missing or damaged."""
    if not path.exists():
        return None
    try:
        found = read_record(path)
    except (StorageError, RecordError):
        return None
    origin = {k: v for k, v in found.provenance.items() if k not in ("ended", "reached")}
    change = difference(origin, expected)
    if "excitation" in origin and "plan_digest" not in origin:
        change = "an earlier version of helisim flew it, and stated no plan_digest"
    if change:
        raise InputError(
            f"{path} holds a flight of another configuration: {change}; "
            "choose another folder, or remove the file"
        )
    return found
