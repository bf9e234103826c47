"""Small recorded logs that come with helisim, made by `scripts/examples/make_examples.py`."""

from dataclasses import dataclass, field
from pathlib import Path

from helisim.base.errors import StorageError, check_known
from helisim.base.files import atomic_write, make_folder, read_bytes
from helisim.base.settings import FrozenMap
from helisim.records.record import FlightRecord

FOLDER = Path(__file__).with_name("example_logs")


@dataclass(frozen=True)
class Example:
    """A recorded log; `map` is a TOML file of its columns, None for a helisim record."""

    name: str
    meaning: str
    path: Path = field(repr=False)
    map: Path | None = field(default=None, repr=False)


_EXAMPLES = [
    *(
        Example(name, said, FOLDER / f"{name}.parquet")
        for name, said in (
            ("sweep_col", "collective sweep in the hover: heave"),
            ("sweep_lon", "longitudinal sweep: with sweep_lat roll and pitch"),
            ("sweep_lat", "lateral sweep"),
            ("sweep_ped", "pedal sweep: yaw"),
            ("doublet_lat", "lateral doublet, to verify roll and pitch"),
            ("doublet_ped", "pedal doublet, to verify yaw from 1.5 to 4 s"),
        )
    ),
    Example(
        "logger",
        "lateral sweep by another logger: CSV in ms, percent and deg/s",
        FOLDER / "logger.csv",
        FOLDER / "logger.toml",
    ),
]


def examples() -> FrozenMap[str, Example]:
    """Return the recorded logs by name: JR700 in the hover, with a pilot, gyro on, 45 s or less."""
    return FrozenMap({one.name: one for one in _EXAMPLES})


def open_example(name: str) -> FlightRecord:
    """Return a recorded log, such as "sweep_lat". Raises UnknownNameError."""
    from helisim.logs import Map, read_log

    known = examples()
    check_known("example", [name], known)
    map_ = known[name].map
    return read_log(known[name].path, channels=None if map_ is None else Map.from_toml(map_)).record


def copy_examples(folder: str | Path) -> list[Path]:
    """Copy the logs and their maps into a folder; return their paths there. Raises StorageError."""
    target = make_folder(folder)
    files = [path for one in _EXAMPLES for path in (one.path, one.map) if path]
    contents = {target / path.name: read_bytes(path) for path in files}
    for path, content in contents.items():
        if path.exists() and (not path.is_file() or read_bytes(path) != content):
            raise StorageError(f"{path}: exists and is another file; give another folder")
    for path, content in contents.items():
        with atomic_write(path) as temporary:
            temporary.write_bytes(content)
    return list(contents)
