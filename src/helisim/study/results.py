"""A run of the experiment: results, the models behind them and the flights; its files.

The folder of a run has `results.json`, `fits.json`, so that a report can be made again from files
alone, and `flights/`.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, is_dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

from helisim import ident
from helisim.base.display import Displayed
from helisim.base.errors import InputError, StorageError, UnknownNameError
from helisim.base.files import read_json, write_json
from helisim.base.note import Command, Option
from helisim.base.settings import FrozenMap, Value, check, from_plain, placed, setting, to_plain
from helisim.ident.verification import VerificationFigures
from helisim.records.record import AXES, FlightRecord, made_by
from helisim.records.storage import read_record
from helisim.sim.rigs import RigTest
from helisim.study.comparison import ComparisonTable
from helisim.study.paper import GyroEffect, OverallCheck

RESULTS, FITS, FLIGHTS = "results.json", "fits.json", "flights"
"""Names in the folder of a run."""
_FORMAT = "helisim fits, version 1"


@dataclass(frozen=True, kw_only=True)
class Exclusion:
    """A flight that was left out of an identification, and why.

    Attributes:
        flight: its name, such as "lat_03".
        reason: whether it was terminated early, or kept behind more coherent ones.
        ended: of one that was terminated early: by what, and when.
        coherence: of one less coherent: mean of that between the swept stick and its motion.
        limit: of one less coherent: the coherence of the least coherent flight that was kept.
        kept: of one less coherent: how many were kept.
    """

    derived: ClassVar = ("message",)
    flight: str
    reason: Literal["terminated early", "less coherent"]
    ended: str = setting("", unsaid=True)
    coherence: float | None = setting(None, unsaid=True)
    limit: float | None = setting(None, unsaid=True)
    kept: int | None = setting(None, unsaid=True)

    def __post_init__(self) -> None:
        if self.reason == "less coherent" and None in (self.coherence, self.limit, self.kept):
            raise InputError(f"flight {self.flight}: less coherent needs coherence, limit and kept")

    @property
    def message(self) -> str:
        """What was left out and why, in a sentence."""
        if self.reason == "terminated early":
            return f"flight {self.flight}: was terminated early: {self.ended}"
        return (
            f"flight {self.flight}: its mean coherence of {self.coherence:.4f} is not among the "
            f"best {self.kept} (the least coherent kept has {self.limit:.4f})"
        )


@dataclass(frozen=True, kw_only=True)
class Results(Displayed):
    """Everything that one experiment found: what `results.json` holds.

    Attributes:
        tables: one a model.
        seed: of the flights.
        versions: name to version of what computed the numbers.
        configuration: JSON-like: the options that the run was made with.
        excluded: the flights that were left out.
        ground: rig -> what its test found.
        verification: model -> how well it predicts flights that no fit has seen.
        gyro_effect: roll-pitch before and after the gyro; None if not both were identified.
        eq_8: the overall yaw model from its parts; None if not all were identified.
    """

    tables: tuple[ComparisonTable, ...]
    seed: int
    versions: Mapping[str, str]
    configuration: Mapping[str, Any] = field(default_factory=dict)
    excluded: tuple[Exclusion, ...] = ()
    ground: Mapping[str, RigTest] = field(default_factory=dict)
    verification: Mapping[str, VerificationFigures] = field(default_factory=dict)
    gyro_effect: GyroEffect | None = None
    eq_8: OverallCheck | None = None

    def __post_init__(self) -> None:
        check(self)

    def __getitem__(self, name: str) -> ComparisonTable:
        """Return the table of a model. Raises UnknownNameError."""
        for table in self.tables:
            if table.name == name:
                return table
        raise UnknownNameError("table", name, [table.name for table in self.tables])

    def __repr__(self) -> str:
        models = ", ".join(table.name for table in self.tables)
        return f"Results({models}; seed {self.seed}, {len(self.misses)} tolerance(s) missed)"

    @property
    def misses(self) -> tuple[str, ...]:
        """One sentence for each tolerance that is missed; empty when all hold."""
        return tuple(miss for table in self.tables for miss in table.misses)

    @property
    def left_out(self) -> frozenset[str]:
        """Names of the flights that were left out."""
        return frozenset(one.flight for one in self.excluded)

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data: what `results.json` holds."""
        found = {
            "ground": self.ground,
            "verification": self.verification,
            "before_after": self.gyro_effect,
            "eq_8": self.eq_8,
        }
        return as_json(
            {
                "tables": self.tables,
                "seed": self.seed,
                "versions": self.versions,
                "configuration": self.configuration,
                "excluded": self.excluded,
                "misses": self.misses,
                **{name: one for name, one in found.items() if one},
            }
        )

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], where: str = "results") -> "Results":
        """Return the results that `to_dict` gave, of this version or another since 0.2.

        Args:
            data: what JSON gave.
            where: the data are, for messages.

        Raises:
            InputError: they are something else; the message says what is missing or wrong.
        """
        missing = [name for name in _NEEDED if name not in data]
        if missing:
            raise InputError(f"{where}: not the results of a run: it has no {', '.join(missing)}")
        with placed(f"{where}: not the results of a run"):
            given = {**data, "gyro_effect": data.get("before_after")}
            return from_plain(cls, given, "results", lenient=True)


_NEEDED = ("tables", "seed", "versions", "configuration")


def as_json(value: Any) -> Any:
    """Return value objects as plain data, with the properties that their classes call derived."""
    if hasattr(value, "to_dict"):
        return value.to_dict()
    if is_dataclass(value):
        said = {name: as_json(getattr(value, name)) for name in to_plain(value)}
        return said | {name: getattr(value, name) for name in getattr(value, "derived", ())}
    if isinstance(value, Mapping):
        return {str(key): as_json(one) for key, one in value.items()}
    if isinstance(value, tuple | list):
        return [as_json(one) for one in value]
    return to_plain(value)


def read_results(path: str | Path) -> Results:
    """Read `results.json`, written by this version or another since 0.2.

    Raises:
        StorageError: the file can't be read.
        InputError: it holds something else.
    """
    return Results.from_dict(read_json(path), str(path))


@dataclass(frozen=True, eq=False)
class IdentifiedModel(Value):
    """One identified model with what it can be judged by.

    Attributes:
        name: of the model; the table of results of the same name holds its numbers.
        fit: the model, and the frequency response that it was fitted to.
        exact: the response of the vehicle that flew, without error; None for a real one.
        note: why this band and these channels.
        verification: how well it predicts flights that no fit has seen; None if none was flown.
        verified_on: names of those flights, in the order of the verification's traces.
    """

    name: str
    fit: ident.Fit
    exact: ident.FrequencyResponse | None = None
    note: str = ""
    verification: ident.Verification | None = None
    verified_on: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check(self)

    def __repr__(self) -> str:
        checked = "" if self.verification is None else f", {self.verification!r}"
        return f"IdentifiedModel({self.name!r}, {self.fit!r}{checked})"

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data."""
        checked, told = self.verification, None
        if checked is not None:
            approach = checked.approach and checked.approach.to_dict()
            told = {**to_plain(checked), "approach": approach}
            del told["inputs"]  # the structure's
        return {
            "name": self.name,
            "note": self.note,
            "fit": self.fit.to_dict(),
            "exact": self.exact and self.exact.to_dict(),
            "verification": told,
            "verified_on": list(self.verified_on),
        }

    @classmethod
    def from_dict(cls, data: Any, place: str = "model") -> "IdentifiedModel":
        """Return the model that `to_dict` gave. Raises InputError."""
        if not isinstance(data, Mapping) or "fit" not in data:
            raise InputError(f"{place} must be a table with a fit, got {data!r:.60}")
        try:
            fit = ident.Fit.from_dict(data["fit"])
            exact = data.get("exact")
            exact = exact and ident.FrequencyResponse.from_dict(exact)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise InputError(f"{place}: its fit can't be read: {error}") from None
        told = data.get("verification")
        if isinstance(told, Mapping):
            told = {**told, "inputs": list(fit.structure.inputs)}
        given = {**data, "fit": fit, "exact": exact, "verification": told}
        return from_plain(cls, given, place, lenient=True)


def write_models(path: str | Path, items: Sequence[IdentifiedModel]) -> Path:
    """Write models as JSON and return the path. Raises StorageError."""
    models = [item.to_dict() for item in items]
    write_json({"format": _FORMAT, "provenance": made_by("fits"), "models": models}, path)
    return Path(path)


def read_models(path: str | Path) -> tuple[IdentifiedModel, ...]:
    """Read what `write_models` wrote.

    Raises:
        StorageError: the file can't be read.
        InputError: it holds something else.
    """
    data = read_json(path)
    if data.get("format") != _FORMAT:
        raise InputError(f"{path}: its format is {data.get('format')!r:.60}, expected {_FORMAT!r}")
    models = data.get("models")
    if not isinstance(models, list):
        raise InputError(f"{path}: models must be a list, got {models!r:.60}")
    with placed(f"{path}: can't read a model"):
        return tuple(IdentifiedModel.from_dict(one, f"models[{k}]") for k, one in enumerate(models))


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
    parameters: Mapping[str, float | str]
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
            f"{folder} has no {RESULTS}; give a folder that helisim reproduce wrote",
            remedy=Command("reproduce", (), (Option("out", str(folder)),)),
        )
    results = read_results(folder / RESULTS)
    models = read_models(folder / FITS) if (folder / FITS).is_file() else ()
    return Run(results, models, read_kept_sweeps(folder, results.left_out))


def read_kept_sweeps(folder: Path, left_out: Collection[str]) -> dict[str, list[FlightRecord]]:
    """Read the sweeps of a run's folder but for those left out, of the axes that have some.

    Raises StorageError.
    """
    kept: dict[str, list[FlightRecord]] = {}
    for axis in AXES:
        for path in sorted((folder / FLIGHTS).glob(f"{axis}_[0-9]*.parquet")):
            if path.stem not in left_out:
                kept.setdefault(axis, []).append(read_record(path))
    return kept
