"""A folder of flights: filled one by one, kept when interrupted, and gone on with later."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from helisim.base.errors import InputError, RecordError, StorageError
from helisim.base.files import make_folder
from helisim.base.value import FrozenMap
from helisim.records.provenance import difference, plain
from helisim.records.record import FlightRecord
from helisim.records.storage import read_record, write_record
from helisim.sim.fly import Flight, flight_provenance, fly_all
from helisim.sim.plan import Flyable, as_plan
from helisim.sim.simulation import flight_numbers
from helisim.vehicle import Vehicle

LAST_SECONDS = "last_second"
"""Folder beside records, of the last seconds of those flights that were terminated early."""
_OUTCOMES = ("ended", "reached")
"""What a record says of how its flight went."""


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

    Returns:
        The path of the last second.

    Raises:
        StorageError: a file can't be written.
    """
    beside = None
    if (
        flight.last_second is not None
    ):  # first, so that a record that says that it ended isn't without
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
    origin = {key: value for key, value in found.provenance.items() if key not in _OUTCOMES}
    change = difference(origin, expected)
    if "excitation" in origin and "plan_digest" not in origin:
        change = "an earlier version of helisim flew it, and stated no plan_digest"
    if change:
        raise InputError(
            f"{path} holds a flight of another configuration: {change}; "
            "choose another folder, or remove the file"
        )
    return found
