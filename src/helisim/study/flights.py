"""The experiment's flights: flown and the best kept, or read back from the folder of a run."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from helisim import ident
from helisim.base.errors import DivergedError, InputError
from helisim.records.channels import AXES
from helisim.records.provenance import one_blas_thread
from helisim.records.record import FlightRecord
from helisim.records.storage import read_record
from helisim.sim import Doublet, Flight, FlightPlan, Recorder, Sweep, fly_all
from helisim.sim.fly import write_flight
from helisim.study.exclusion import Exclusion
from helisim.study.models import MODELS
from helisim.study.results import read_results
from helisim.vehicle import Vehicle

_RESPONSE = {"lat": ("LAT", "p"), "lon": ("LON", "q"), "ped": ("PED", "r"), "col": ("COL", "w")}
"""Axis -> the stick and the motion by whose coherence a sweep is judged."""

RESULTS = "results.json"
FOLDER = "flights"

Flights = dict[str, list[FlightRecord]]
"""Kept records by axis."""


def flown_each_axis(flights: int) -> int:
    """Return how many sweeps of an axis are flown to keep `flights`."""
    return flights + max(1, round(0.2 * flights))


def flights_in_all(flights: int) -> int:
    """Return how many sweeps are flown to keep `flights` on each axis."""
    return flown_each_axis(flights) * len(AXES)


def fly_sweeps(
    vehicle: Vehicle,
    flights: int,
    seed: int,
    jobs: int | None,
    recorder: Recorder,
    folder: Path | None,
    on_progress: Callable[[str], None],
) -> tuple[Flights, tuple[Exclusion, ...]]:
    """Fly every axis, write every record, and keep the most coherent ones.

    Returns:
        The kept records by axis, and those that were left out.
    """
    kept: Flights = {}
    excluded: list[Exclusion] = []
    for number, axis in enumerate(AXES):
        names = [f"{axis}_{k + 1:02d}" for k in range(flown_each_axis(flights))]
        paths = [None if folder is None else folder / FOLDER / f"{name}.parquet" for name in names]
        plan = FlightPlan(excitation=Sweep(axis=axis), recorder=recorder)
        records: list[FlightRecord] = []
        scores: dict[int, float] = {}
        for k, (record, score) in enumerate(
            _fly_and_score(vehicle, plan, paths, seed * len(AXES) + number, jobs)
        ):
            records.append(record)
            if score is not None:
                scores[k] = score
            on_progress(axis)
        excluded += [
            Exclusion(flight=name, reason="terminated early", ended=record.ended)
            for name, record in zip(names, records)
            if record.ended
        ]
        if len(scores) < flights:
            raise DivergedError(
                f"{len(records) - len(scores)} of {len(records)} sweeps of {axis} were terminated "
                f"early, so fewer than {flights} are left; {excluded[-1].message}"
            )
        best = sorted(sorted(scores, key=scores.__getitem__)[-flights:])
        kept[axis] = [records[k] for k in best]
        least = min(scores[k] for k in best)
        excluded += [
            Exclusion(
                flight=names[k],
                reason="less coherent",
                coherence=scores[k],
                limit=least,
                kept=flights,
            )
            for k in scores
            if k not in best
        ]
    return kept, tuple(excluded)


def _fly_and_score(
    vehicle: Vehicle, plan: FlightPlan, paths: Sequence[Path | None], seed: int, jobs: int | None
) -> Iterator[tuple[FlightRecord, float | None]]:
    """Yield the record of a sweep for each path, where it is written, and its mean coherence."""

    def judged(k: int, flight: Flight) -> tuple[FlightRecord, float | None]:
        record, path = flight.record, paths[k]
        if path is not None:
            write_flight(flight, path)
        return record, None if record.ended else sweep_coherence(record, plan.name)

    with one_blas_thread():  # around all threads, or they would take it from each other
        yield from fly_all(vehicle, plan, range(len(paths)), judged, seed=seed, jobs=jobs)


def fly_doublets(
    vehicle: Vehicle, seed: int, recorder: Recorder, folder: Path | None
) -> dict[str, FlightRecord]:
    """Fly a doublet on each axis that a model is verified on; no fit sees them."""
    records = {}
    for axis in _verified_axes():
        plan = FlightPlan(excitation=Doublet(axis=axis), recorder=recorder)
        (flight,) = fly_all(vehicle, plan, [0], seed=seed * len(AXES))
        if folder is not None:
            write_flight(flight, folder / FOLDER / f"{axis}_doublet.parquet")
        if flight.record.ended:
            raise DivergedError(f"the doublet of {axis}: {flight.record.ended}; fly a smaller one")
        records[axis] = flight.record
    return records


def read_flights(
    vehicle: Vehicle, seed: int, folder: Path
) -> tuple[Flights, dict[str, FlightRecord], tuple[Exclusion, ...]]:
    """Read the flights of a run again.

    Args:
        vehicle: that must have flown them.
        seed: that they must have been flown with.
        folder: of the run.

    Returns:
        The kept sweeps by axis, the doublets by axis, and what was left out.

    Raises:
        StorageError: results or a record can't be read.
        InputError: another vehicle or seed flew.
    """
    results = read_results(folder / RESULTS)
    if results.seed != seed:
        raise InputError(f"{folder} was flown with seed {results.seed}, not {seed}")
    kept = read_kept_sweeps(folder, results.left_out)
    for axis in AXES:
        if axis not in kept:
            raise InputError(f"{folder / FOLDER} has no sweep of {axis}; fly them first")
    doublets = {
        axis: read_record(folder / FOLDER / f"{axis}_doublet.parquet") for axis in _verified_axes()
    }
    for record in (*doublets.values(), *(one for axis in AXES for one in kept[axis])):
        if record.provenance.get("parameters") != dict(vehicle.parameters):
            raise InputError(
                f"the flights in {folder} were flown by a vehicle with other parameters; "
                "fly them again"
            )
    return kept, doublets, results.excluded


def read_kept_sweeps(folder: Path, left_out: Collection[str]) -> Flights:
    """Read the sweeps of a run's folder but for those left out, of the axes that have some.

    Raises StorageError.
    """
    kept: Flights = {}
    for axis in AXES:
        for path in sorted((folder / FOLDER).glob(f"{axis}_[0-9]*.parquet")):
            if path.stem not in left_out:
                kept.setdefault(axis, []).append(read_record(path))
    return kept


def _verified_axes() -> tuple[str, ...]:
    return tuple(dict.fromkeys(axis for model in MODELS for axis in model.verified_by))


def sweep_coherence(record: FlightRecord, axis: str) -> float:
    """Return the mean coherence between the swept stick and its motion, one flight alone."""
    stick, motion = _RESPONSE[axis]
    w_min, w_max = record.provenance["excitation"]["band"]
    band = (max(1.0, w_min), 0.8 * w_max)
    frf = ident.frequency_response(record, inputs=stick, outputs=motion, band=band)
    return float(np.mean(frf.coherence))


def named_records(flights: Mapping[str, Sequence[FlightRecord]]) -> dict[str, FlightRecord]:
    """Return all kept records by a name such as "lat_01"."""
    return {
        f"{axis}_{k + 1:02d}": record for axis in AXES for k, record in enumerate(flights[axis])
    }
