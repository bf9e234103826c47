"""Small recorded logs that come with helisim, so that a first look needs no flight.

`scripts/examples/make_examples.py` flew them: it says how, and makes the same bytes again.
"""

from dataclasses import dataclass
from pathlib import Path

from helisim.base.errors import StorageError, UnknownNameError
from helisim.base.files import atomic_write, make_folder, read_bytes
from helisim.base.settings import FrozenMap
from helisim.records.record import FlightRecord

FOLDER = Path(__file__).with_name("example_logs")

_MEANINGS = {
    "sweep_col": "collective sweep in the hover: heave",
    "sweep_lon": "longitudinal sweep: with sweep_lat roll and pitch",
    "sweep_lat": "lateral sweep",
    "sweep_ped": "pedal sweep: yaw",
    "doublet_lat": "lateral doublet, to verify roll and pitch",
    "doublet_ped": "pedal doublet, to verify yaw from 1.5 to 4 s",
    "logger": "lateral sweep by another logger: CSV in ms, percent and deg/s",
}


@dataclass(frozen=True)
class Example:
    """One recorded log.

    Attributes:
        name: such as "sweep_lat".
        meaning: what was flown, and what it is good for.
        path: of the file.
        map: of the TOML file that says which column is which channel; None for a helisim record.
    """

    name: str
    meaning: str
    path: Path
    map: Path | None = None

    def __repr__(self) -> str:
        return f"Example({self.name!r}: {self.meaning})"

    def open(self) -> FlightRecord:
        """Return the log as a record."""
        if self.map is None:
            from helisim.records.storage import read_record

            return read_record(self.path)
        from helisim.logs import Map, read_log

        return read_log(self.path, channels=Map.from_toml(self.map)).record


def examples() -> FrozenMap[str, Example]:
    """Return the recorded logs that come with helisim, by name.

    They are of the JR700 model in the hover, by a pilot, with the gyro on, each of 45 s or less.
    """
    return FrozenMap({name: _example(name, meaning) for name, meaning in _MEANINGS.items()})


def open_example(name: str) -> FlightRecord:
    """Return one of the recorded logs that come with helisim; `examples` lists them.

    Args:
        name: such as "sweep_lat".

    Raises:
        UnknownNameError: no such log; the message lists those that there are.
    """
    if name not in _MEANINGS:
        raise UnknownNameError("example", name, _MEANINGS)
    return _example(name, _MEANINGS[name]).open()


def copy_examples(folder: str | Path) -> list[Path]:
    """Copy the logs and their maps into a folder, which is made; return their paths there.

    Raises:
        StorageError: it can't be written, or holds another file of that name.
    """
    target = make_folder(folder)
    files = [path for one in examples().values() for path in (one.path, one.map) if path]
    contents = {target / path.name: read_bytes(path) for path in files}
    for path, content in contents.items():
        if path.exists() and (not path.is_file() or read_bytes(path) != content):
            raise StorageError(f"{path}: exists and is another file; give another folder")
    for path, content in contents.items():
        with atomic_write(path) as temporary:
            temporary.write_bytes(content)
    return list(contents)


def _example(name: str, meaning: str) -> Example:
    foreign = FOLDER / f"{name}.toml"
    if foreign.is_file():
        return Example(name, meaning, foreign.with_suffix(".csv"), foreign)
    return Example(name, meaning, FOLDER / f"{name}.parquet")
