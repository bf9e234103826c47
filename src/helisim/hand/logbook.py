"""Where the records of an afternoon's flying go: one file each, none ever written over."""

from pathlib import Path

from helisim.base.errors import StorageError
from helisim.base.files import check_destination
from helisim.records.record import FlightRecord
from helisim.records.storage import write_record


class Logbook:
    """Writes records to FILE, then to FILE_2, FILE_3 and so on.

    Attributes:
        written: paths of the records that were written, in order.
        kept: records that could not be written, and are still in memory.
    """

    def __init__(self, path: str | Path) -> None:
        """Raise StorageError if nothing could be written there."""
        self.path = Path(path)
        check_destination(self.next_path)
        self.written: list[Path] = []
        self.kept: list[FlightRecord] = []

    @property
    def next_path(self) -> Path:
        """The first path of the series where nothing is yet."""
        path, number = self.path, 1
        while path.exists():
            number += 1
            path = self.path.with_stem(f"{self.path.stem}_{number}")
        return path

    def write(self, record: FlightRecord) -> Path:
        """Write a record, after those that are kept; return where it is.

        Raises:
            StorageError: it can't be written, and is kept.
        """
        self.kept.append(record)
        self.flush()
        return self.written[-1]

    def flush(self) -> None:
        """Write what is kept. Raises StorageError."""
        while self.kept:
            path = self.next_path
            try:
                write_record(self.kept[0], path)
            except StorageError as error:
                lost = f"{len(self.kept)} record{'s' if len(self.kept) > 1 else ''}"
                raise StorageError(f"{error}; {lost} not written yet") from None
            self.written.append(path)
            del self.kept[0]
