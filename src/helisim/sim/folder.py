"""A folder of flights: filled one by one, kept when interrupted, and gone on with later."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from helisim.errors import InputError, RecordError, StorageError
from helisim.provenance import difference, plain
from helisim.sim.excitation import Excitation
from helisim.sim.fault_notation import Fault
from helisim.sim.fly import flight_numbers, flight_provenance, fly_each
from helisim.sim.instruments import Recorder
from helisim.sim.pilot import Pilot
from helisim.sim.weather import Weather
from helisim.storage import make_folder, read_record, write_record
from helisim.vehicle import Vehicle


@dataclass(frozen=True)
class Flown:
    """What a folder holds after its flights.

    Attributes:
        paths: one record a flight, in order.
        found: how many of them were there before, and were left as they are.
    """

    paths: tuple[Path, ...]
    found: int


def fly_to(
    folder: Path,
    vehicle: Vehicle,
    excitation: Excitation,
    *,
    count: int,
    seed: int = 0,
    pilot: Pilot | None = None,
    recorder: Recorder | None = None,
    weather: Weather | None = None,
    faults: Sequence[Fault] = (),
    jobs: int | None = None,
    on_flight: Callable[[], None] | None = None,
) -> Flown:
    """Fly as `fly` does and write each record as its flight ends.

    Flights that the folder already holds, whole and of the same provenance, aren't flown
    again; so a second call goes on where an interrupted one stopped. A damaged file is
    written anew. Memory doesn't grow with `count`.

    Args:
        folder: of records such as `lat_0001.parquet`; made if it doesn't exist.
        vehicle: that flies.
        excitation: sweep or doublet.
        count: number of flights that the folder shall hold.
        seed: of pilots and sensors.
        pilot: the default `Pilot` if None.
        recorder: the vehicle's own if None.
        weather: calm if None.
        faults: as for `fly`.
        jobs: threads; all processors if None.
        on_flight: called once for each flight that the folder holds, for progress.

    Raises:
        InputError: as for `fly`; or the folder holds a flight of another configuration.
        DivergedError: a flight left the validity of the model; those before it are kept.
        StorageError: the folder can't be made or written.
    """
    pilot, recorder = pilot or Pilot(), recorder or Recorder.of(vehicle)
    weather = weather or Weather()
    paths = [folder / f"{excitation.axis}_{k + 1:04d}.parquet" for k in flight_numbers(count)]
    missing = []
    for number, path in enumerate(paths):
        expected = flight_provenance(
            vehicle,
            excitation,
            number,
            seed=seed,
            pilot=pilot,
            recorder=recorder,
            weather=weather,
            faults=faults,
        )
        if not _holds(path, plain(expected)):
            missing.append(number)
        elif on_flight is not None:
            on_flight()
    records = fly_each(
        vehicle,
        excitation,
        missing,
        seed=seed,
        pilot=pilot,
        recorder=recorder,
        weather=weather,
        faults=faults,
        jobs=jobs,
    )
    make_folder(folder)
    for number, record in zip(missing, records):
        write_record(record, paths[number])
        if on_flight is not None:
            on_flight()
    return Flown(tuple(paths), count - len(missing))


def _holds(path: Path, expected: Mapping[str, Any]) -> bool:
    """Return whether a file holds the flight; False where it is missing or damaged."""
    if not path.exists():
        return False
    try:
        found = read_record(path).provenance
    except (StorageError, RecordError):
        return False
    change = difference(found, expected)
    if change:
        raise InputError(
            f"{path} holds a flight of another configuration: {change}; "
            "choose another folder, or remove the file"
        )
    return True
