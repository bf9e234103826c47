"""Flight records on disk: Parquet, and CSV for people and spreadsheets.

Both carry the unit, kind and meaning of each channel and the provenance of the record,
and give back exactly the doubles that were written. No pickle. Every file that helisim
writes goes through `atomic_write`.
"""

from pathlib import Path

from helisim.base.errors import RecordError
from helisim.base.files import SUFFIXES, atomic_write, check_suffix
from helisim.records.header import TIME
from helisim.records.record import FlightRecord
from helisim.records.text import read_csv, write_csv


def write_record(record: FlightRecord, path: str | Path) -> Path:
    """Write a record as Parquet or CSV, by the suffix of `path`; return the path.

    The file appears complete or not at all.

    Raises:
        StorageError: unknown suffix, or the file can't be written.
        RecordError: a channel is called `time`, which is the name of the time column.
    """
    path = Path(path)
    suffix = check_suffix(path, SUFFIXES)
    if TIME.name in record:
        raise RecordError("a channel can't be called 'time', the time column's name: rename it")
    with atomic_write(path) as temporary:
        if suffix == ".csv":
            write_csv(record, temporary)
        else:
            from helisim.records.parquet import write_parquet  # pyarrow is slow to import

            write_parquet(record, temporary)
    return path


def read_record(path: str | Path) -> FlightRecord:
    """Read a record that `write_record` wrote.

    Raises:
        StorageError: unknown suffix, missing file, or a file that is truncated, corrupt, too
            large or not a flight record.
        RecordError: the numbers don't make a record, for example NaN or a time that falls.
    """
    path = Path(path)
    if check_suffix(path, SUFFIXES) == ".csv":
        contents = read_csv(path)
    else:
        from helisim.records.parquet import read_parquet  # pyarrow is slow to import

        contents = read_parquet(path)
    try:
        return FlightRecord(
            contents.columns[:, 0], contents.columns[:, 1:], contents.channels, contents.provenance
        )
    except RecordError as error:
        raise RecordError(f"{path}: {error}") from None
