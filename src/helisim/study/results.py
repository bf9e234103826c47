"""A run of the experiment and its files: `results.json`, `fits.json` and `flights/`."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, is_dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

from helisim import ident
from helisim.base.display import Displayed
from helisim.base.errors import InputError, StorageError, named
from helisim.base.files import read_json, write_json
from helisim.base.note import Command, Option
from helisim.base.settings import (
    Checked,
    Value,
    convert,
    from_plain,
    placed,
    setting,
    setting_names,
    to_plain,
)
from helisim.ident.verification import VerificationFigures
from helisim.records.record import AXES, FlightRecord, made_by
from helisim.records.storage import read_record
from helisim.sim.rigs import RigTest
from helisim.study.comparison import ComparisonTable
from helisim.study.paper import GyroEffect, OverallCheck

RESULTS, FITS, FLIGHTS = "results.json", "fits.json", "flights"
_FORMAT = "helisim fits, version 1"


@dataclass(frozen=True, kw_only=True)
class Exclusion:
    """A flight left out: `ended` early, or of a coherence below the least kept one's, `limit`."""

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
        """Flight and reason in a sentence."""
        if self.reason == "terminated early":
            return f"flight {self.flight}: was terminated early: {self.ended}"
        return (
            f"flight {self.flight}: its mean coherence of {self.coherence:.4f} is not among the "
            f"best {self.kept} (the least coherent kept has {self.limit:.4f})"
        )


@dataclass(frozen=True, kw_only=True)
class Results(Checked, Displayed):
    """Findings of one experiment, the content of `results.json`.

    `ground` is by rig, `verification` by model: figures of its prediction of unseen flights.
    `gyro_effect`, on roll-pitch, and `eq_8`, the overall yaw model from its parts, are None if not
    all were identified.
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

    def __getitem__(self, name: str) -> ComparisonTable:
        """Return the table of a model. Raises UnknownNameError."""
        return named(self.tables, name, "table")

    def __repr__(self) -> str:
        return f"Results({len(self.tables)} models, {len(self.misses)} tolerance(s) missed)"

    @property
    def misses(self) -> tuple[str, ...]:
        """A sentence for each missed tolerance."""
        return tuple(miss for table in self.tables for miss in table.misses)

    @property
    def left_out(self) -> frozenset[str]:
        """Names of the excluded flights."""
        return frozenset(one.flight for one in self.excluded)

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data, as `results.json` holds it."""
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

        Raises InputError.
        """
        with placed(f"{where}: not the results of a run"):
            given = {**data, "gyro_effect": data.get("before_after")}
            return from_plain(cls, given, "results", lenient=True)


def as_json(value: Any) -> Any:
    """Return value objects as plain data, with derived properties."""
    if hasattr(value, "to_dict"):
        return value.to_dict()
    if is_dataclass(value):
        names = (*to_plain(value), *getattr(value, "derived", ()))
        return {name: as_json(getattr(value, name)) for name in names}
    if isinstance(value, Mapping):
        return {str(key): as_json(one) for key, one in value.items()}
    return [as_json(one) for one in value] if isinstance(value, tuple | list) else to_plain(value)


def read_results(path: str | Path) -> Results:
    """Read `results.json` of this version or another since 0.2. Raises StorageError, InputError."""
    return Results.from_dict(read_json(path), str(path))


_FILED = [name for name in setting_names(ident.Verification) if name != "inputs"]
"""Fields of a verification in a file; its inputs are the structure's."""


@dataclass(frozen=True, eq=False)
class IdentifiedModel(Checked, Value):
    """One identified model with its exact response and verification.

    `exact` is without error, None for a real vehicle; `verification` predicts flights that the fit
    has not seen, None if none was flown, in the order of their names, `verified_on`.
    """

    name: str
    fit: ident.Fit
    exact: ident.FrequencyResponse | None = None
    note: str = ""
    verification: ident.Verification | None = None
    verified_on: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data."""
        found = self.verification
        return {
            "name": self.name,
            "note": self.note,
            "fit": self.fit.to_dict(),
            "exact": as_json(self.exact),
            "verification": (found and {name: as_json(getattr(found, name)) for name in _FILED}),
            "verified_on": list(self.verified_on),
        }

    @classmethod
    def from_dict(cls, data: Any, place: str = "model") -> "IdentifiedModel":
        """Return the model that `to_dict` gave. Raises InputError."""
        if not isinstance(data, Mapping) or "fit" not in data:
            raise InputError(f"{place} must be a table with a fit, got {data!r:.60}")
        fit = ident.Fit.from_dict(data["fit"])
        told = data.get("verification")
        if isinstance(told, Mapping):
            told = {**told, "inputs": list(fit.structure.inputs)}
        return from_plain(cls, {**data, "fit": fit, "verification": told}, place, lenient=True)


def write_models(path: str | Path, items: Sequence[IdentifiedModel]) -> Path:
    """Write models as JSON and return the path. Raises StorageError."""
    models = [item.to_dict() for item in items]
    write_json({"format": _FORMAT, "provenance": made_by("fits"), "models": models}, path)
    return Path(path)


def read_models(path: str | Path) -> tuple[IdentifiedModel, ...]:
    """Read the file of `write_models`. Raises StorageError, InputError."""
    data = read_json(path)
    if data.get("format") != _FORMAT:
        raise InputError(f"{path}: its format is {data.get('format')!r:.60}, expected {_FORMAT!r}")
    models = convert(list, data.get("models"), f"{path}: models")
    with placed(f"{path}: can't read a model"):
        return tuple(IdentifiedModel.from_dict(one, f"models[{k}]") for k, one in enumerate(models))


@dataclass(frozen=True, eq=False)
class Run(Checked, Value, Displayed):
    """Results, fits behind their tables, and kept sweeps by axis."""

    results: Results
    models: tuple[IdentifiedModel, ...] = ()
    flights: Mapping[str, Sequence[FlightRecord]] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"Run({self.results!r}, {len(self.models)} models)"

    @property
    def sweeps(self) -> dict[str, FlightRecord]:
        """The first kept sweep of each axis."""
        return {axis: records[0] for axis, records in self.flights.items()}


def read_run(folder: str | Path) -> Run:
    """Read a run from the folder of `helisim reproduce`. Raises StorageError, InputError."""
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
    """Read the sweeps of a run's folder without those left out, by axis. Raises StorageError."""
    found = {axis: sorted((folder / FLIGHTS).glob(f"{axis}_[0-9]*.parquet")) for axis in AXES}
    kept = {axis: [p for p in paths if p.stem not in left_out] for axis, paths in found.items()}
    return {axis: list(map(read_record, paths)) for axis, paths in kept.items() if paths}
