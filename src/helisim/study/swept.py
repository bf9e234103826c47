"""Sweeps by the axis that they sweep, from wherever they are."""

from collections.abc import Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path

from helisim.base.errors import InputError, StorageError
from helisim.handling.loop import axis_of
from helisim.records.record import FlightRecord
from helisim.records.storage import read_record
from helisim.study.flights import FOLDER, RESULTS, Flights, read_kept_sweeps
from helisim.study.results import read_results

Source = str | PathLike[str] | Mapping[str, Sequence[FlightRecord]] | Sequence[FlightRecord]
"""A folder of `helisim reproduce`, or of records; records by axis; or records that say theirs."""


def swept(source: Source) -> Flights:
    """Return records by the axis that they sweep.

    Records of something else than a sweep, and flights that ended early, are left out.

    Raises:
        StorageError: the folder or a record can't be read.
        InputError: an axis is unknown, or no record says that it is a sweep.
    """
    if isinstance(source, Mapping):
        return {axis_of(axis).name: list(records) for axis, records in source.items()}
    if isinstance(source, str | PathLike):
        return _in_folder(Path(source))
    return _sorted(source, "the records")


def _in_folder(folder: Path) -> Flights:
    if (folder / RESULTS).is_file():
        return read_kept_sweeps(folder, read_results(folder / RESULTS).left_out)
    paths = sorted({*folder.glob("*.parquet"), *(folder / FOLDER).glob("*.parquet")})
    if not paths:
        raise StorageError(
            f"{folder} has no flight records (*.parquet); give the folder that helisim reproduce "
            "--out or helisim fly --out wrote"
        )
    return _sorted(map(read_record, paths), str(folder))


def _sorted(records: Iterable[FlightRecord], where: str) -> Flights:
    found: Flights = {}
    for record in records:
        flown = record.provenance.get("excitation") or {}
        if flown.get("kind") == "Sweep" and not record.ended:
            found.setdefault(axis_of(flown["axis"]).name, []).append(record)
    if not found:
        raise InputError(
            f"none of {where} says which axis it sweeps; give them by axis, such as "
            '{"lat": [record, ...], "lon": [...]}'
        )
    return found
