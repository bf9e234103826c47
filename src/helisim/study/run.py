"""A run: results, the models behind them, the flights; as it was made or read from its folder."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from helisim.base.display import Displayed
from helisim.base.errors import StorageError
from helisim.base.settings import from_plain
from helisim.base.value import FrozenMap, Value
from helisim.records.record import FlightRecord
from helisim.study.flights import FOLDER, RESULTS, read_kept_sweeps
from helisim.study.identified import IdentifiedModel, read_models
from helisim.study.results import Results, read_results

FITS = "fits.json"
FLIGHTS = FOLDER


@dataclass(frozen=True, kw_only=True)
class Rates:
    """How fast a recorder samples.

    Attributes:
        rate_hz: Hz.
        antialias_hz: Hz, edge of the filter before the samples.
    """

    rate_hz: float
    antialias_hz: float


@dataclass(frozen=True, kw_only=True)
class Configuration:
    """What a report says of how a run was made; its results state more.

    Attributes:
        flights_kept_each_axis: sweeps that were identified from.
        flown_each_axis: sweeps that were flown.
        timestep_s: of the simulation, s.
        parameters: physical parameters that replaced the calibrated ones.
        recorder: its rates.
    """

    flights_kept_each_axis: int
    flown_each_axis: int
    timestep_s: float
    parameters: Mapping[str, float]
    recorder: Rates


@dataclass(frozen=True, eq=False)
class Run(Value, Displayed):
    """One run of the experiment: all that its report shows.

    Attributes:
        results: what was found.
        models: the fits behind the tables of the results, and what they are judged by.
        flights: axis -> the sweeps that were kept.
    """

    results: Results
    models: tuple[IdentifiedModel, ...] = ()
    flights: Mapping[str, Sequence[FlightRecord]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        flights = {axis: tuple(records) for axis, records in self.flights.items()}
        object.__setattr__(self, "flights", FrozenMap(flights))
        object.__setattr__(self, "models", tuple(self.models))

    def __repr__(self) -> str:
        count = sum(map(len, self.flights.values()))
        return f"Run({self.results!r}, {len(self.models)} models, {count} flights)"

    @property
    def configuration(self) -> Configuration:
        """How the run was made. Raises InputError: the results don't say it."""
        stated = self.results.configuration
        return from_plain(Configuration, stated, "configuration of the run", lenient=True)

    @property
    def sweeps(self) -> dict[str, FlightRecord]:
        """Axis -> the first of its kept sweeps."""
        return {axis: records[0] for axis, records in self.flights.items()}


def read_run(folder: str | Path) -> Run:
    """Read a run from the folder that `helisim reproduce` wrote.

    Raises:
        StorageError: the folder has no readable results.
        InputError: a file holds something else.
    """
    folder = Path(folder)
    if not (folder / RESULTS).is_file():
        raise StorageError(
            f"{folder} has no {RESULTS}; give the folder that helisim reproduce --out wrote"
        )
    results = read_results(folder / RESULTS)
    models = read_models(folder / FITS) if (folder / FITS).is_file() else ()
    return Run(results, models, read_kept_sweeps(folder, results.left_out))
