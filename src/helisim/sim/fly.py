"""Fly: pilot, gyro, servos and rotor in native steps, and the recorder behind them."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from helisim.errors import DivergedError
from helisim.records.provenance import made_by
from helisim.records.record import FlightRecord
from helisim.sim.ending import last_second
from helisim.sim.envelope import Watch, told
from helisim.sim.excitation import Excitation
from helisim.sim.fault_notation import Fault, check_faults, to_dict
from helisim.sim.pilot import Pilot
from helisim.sim.recorder import Recorder
from helisim.sim.recorder_faults import RecorderFault
from helisim.sim.simulation import flight_numbers, generator, simulated
from helisim.sim.trajectory import Truth
from helisim.sim.weather import Weather
from helisim.vehicle import Vehicle

_FEWEST_SAMPLES = 2
"""Beside the first, of the shortest record; the lever arm's derivative needs them."""


def fly(
    vehicle: Vehicle,
    excitation: Excitation,
    *,
    count: int = 1,
    seed: int = 0,
    pilot: Pilot | None = None,
    recorder: Recorder | None = None,
    weather: Weather | None = None,
    faults: Sequence[Fault] = (),
    watch: Watch | None = None,
    keep_ended: bool = False,
    jobs: int | None = None,
    on_flight: Callable[[], None] | None = None,
) -> list[FlightRecord]:
    """Fly the same manoeuvre a number of times and record each flight.

    The result depends on the vehicle, the arguments and the seed, not on `jobs`. All records
    are in memory at the end; `fly_each` gives them one by one.

    Args:
        vehicle: that flies.
        excitation: sweep or doublet.
        count: number of flights.
        seed: of pilots and sensors; flight k of a seed is always the same.
        pilot: the default `Pilot` if None.
        recorder: the vehicle's own if None.
        weather: calm if None; each flight has its own turbulence.
        faults: of servos, gyro and recorder, in each flight; a recorder's, in this order.
        watch: limits beyond which a flight is over; the default `Watch` if None.
        keep_ended: True returns flights that were over before their time as far as they went,
            marked: `FlightRecord.ended` says why, and the identification refuses them.
        jobs: threads; all processors if None.
        on_flight: called after each flight, for progress.

    Returns:
        One record a flight.

    Raises:
        InputError: count, seed or jobs is out of range, or a fault can't be in this flight.
        TrimError: the vehicle can't hover in the wind.
        DivergedError: a flight left the validity of the model, and such aren't to be kept; the
            error has its record and its last second.
    """
    records = []
    for record in fly_each(
        vehicle,
        excitation,
        flight_numbers(count),
        seed=seed,
        pilot=pilot,
        recorder=recorder,
        weather=weather,
        faults=faults,
        watch=watch,
        keep_ended=keep_ended,
        jobs=jobs,
    ):
        records.append(record)
        if on_flight is not None:
            on_flight()
    return records


def fly_each(
    vehicle: Vehicle,
    excitation: Excitation,
    numbers: Sequence[int],
    *,
    seed: int = 0,
    pilot: Pilot | None = None,
    recorder: Recorder | None = None,
    weather: Weather | None = None,
    faults: Sequence[Fault] = (),
    watch: Watch | None = None,
    keep_ended: bool = False,
    jobs: int | None = None,
) -> Iterator[FlightRecord]:
    """Fly the flights of these numbers and yield each record; the rest is as for `fly`.

    Flight k is the same whatever the other numbers, their order and `jobs`. Only as many
    flights as threads are in memory at a time.
    """
    flights = fly_watched(
        vehicle,
        excitation,
        numbers,
        seed=seed,
        pilot=pilot,
        recorder=recorder,
        weather=weather,
        faults=faults,
        watch=watch,
        jobs=jobs,
    )

    def kept(record: FlightRecord, last: FlightRecord | None) -> FlightRecord:
        if last is not None and not keep_ended:
            raise _diverged(record, last)
        return record

    return (kept(*flight) for flight in flights)


def fly_watched(
    vehicle: Vehicle,
    excitation: Excitation,
    numbers: Sequence[int],
    *,
    seed: int = 0,
    pilot: Pilot | None = None,
    recorder: Recorder | None = None,
    weather: Weather | None = None,
    faults: Sequence[Fault] = (),
    watch: Watch | None = None,
    jobs: int | None = None,
) -> Iterator[tuple[FlightRecord, FlightRecord | None]]:
    """Yield each flight's record, and its last second if it was over before its time.

    Arguments and the other errors are those of `fly_each`.

    Raises:
        DivergedError: a flight was over before there was a record of it.
    """
    pilot, recorder = pilot or Pilot(), recorder or Recorder.of(vehicle)
    weather, watch = weather or Weather(), watch or Watch()

    def recorded(number: int, truth: Truth) -> tuple[FlightRecord, FlightRecord | None]:
        provenance = flight_provenance(
            vehicle,
            excitation,
            number,
            seed=seed,
            pilot=pilot,
            recorder=recorder,
            weather=weather,
            faults=faults,
            watch=watch,
        )
        if truth.end is not None:
            provenance["ended"] = truth.end.as_dict()
            if truth.time[-1] * recorder.rate_hz < _FEWEST_SAMPLES:
                raise DivergedError(told(truth.end.at, truth.end.why))
        record = recorder.record(truth, generator(seed, number, "sensors"), provenance)
        for n, fault in enumerate(faults):
            if isinstance(fault, RecorderFault):
                record = fault.spoil(record, generator(seed, number, f"fault {n}"))
        return record, None if truth.end is None else last_second(truth, provenance)

    return simulated(
        vehicle,
        excitation,
        numbers,
        seed=seed,
        pilot=pilot,
        weather=weather,
        faults=check_faults(faults, excitation.duration),
        watch=watch,
        then=recorded,
        jobs=jobs,
    )


def _diverged(record: FlightRecord, last: FlightRecord) -> DivergedError:
    """Return the error of a flight that isn't to be kept."""
    end = record.provenance["ended"]
    error = DivergedError(told(end["at"], end["why"]))
    error.record, error.last_second = record, last
    return error


def flight_provenance(
    vehicle: Vehicle,
    excitation: Excitation,
    number: int,
    *,
    seed: int,
    pilot: Pilot,
    recorder: Recorder,
    weather: Weather,
    faults: Sequence[Fault] = (),
    watch: Watch,
) -> dict[str, Any]:
    """Return what a record says of its origin: enough to fly it again."""
    excitation = excitation.on(vehicle.parameters)
    plain = {key: getattr(excitation, key) for key in excitation.__dataclass_fields__}
    return made_by(
        "simulation",
        **vehicle.provenance,
        excitation={"kind": type(excitation).__name__, **plain},
        pilot={key: getattr(pilot, key) for key in pilot.__dataclass_fields__},
        recorder=recorder.as_dict(),
        weather=weather.as_dict(),
        faults=[to_dict(fault) for fault in faults],
        watch=watch.as_dict(),
        seed=seed,
        flight=number,
    )
