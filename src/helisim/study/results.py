"""Results of an experiment: its comparisons, what else it found, and what it was made of."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from helisim.base.display import Displayed
from helisim.base.errors import InputError, UnknownNameError
from helisim.base.files import read_json
from helisim.base.settings import from_plain
from helisim.base.value import FrozenMap
from helisim.ident.verification import VerificationFigures
from helisim.sim.rigs import RigTest
from helisim.study.comparison import ComparisonTable
from helisim.study.exclusion import Exclusion
from helisim.study.paper.eq8 import OverallCheck
from helisim.study.paper.gyro_effect import GyroEffect


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
        object.__setattr__(self, "tables", tuple(self.tables))
        object.__setattr__(self, "excluded", tuple(self.excluded))
        for what in ("versions", "configuration", "ground", "verification"):
            object.__setattr__(self, what, FrozenMap(getattr(self, what)))

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
        found: dict[str, Any] = {
            "ground": {rig: test.to_dict() for rig, test in self.ground.items()},
            "verification": {model: one.to_dict() for model, one in self.verification.items()},
            "before_after": self.gyro_effect and self.gyro_effect.to_dict(),
            "eq_8": self.eq_8 and self.eq_8.to_dict(),
        }
        return {
            "tables": [table.to_dict() for table in self.tables],
            "seed": self.seed,
            "versions": dict(self.versions),
            "configuration": dict(self.configuration),
            "excluded": [one.to_dict() for one in self.excluded],
            "misses": list(self.misses),
            **{name: one for name, one in found.items() if one},
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], where: str = "results") -> "Results":
        """Return the results that `to_dict` gave, of this version or an earlier one.

        Args:
            data: what JSON gave.
            where: the data are, for messages.

        Raises InputError.
        """
        missing = [name for name in _NEEDED if name not in data]
        if missing:
            raise InputError(f"{where}: not the results of a run: it has no {', '.join(missing)}")
        given = {**data, "gyro_effect": data.get("before_after")}
        excluded = data.get("excluded")
        try:
            if isinstance(excluded, list):
                given["excluded"] = [_exclusion(one) for one in excluded]
            return from_plain(cls, given, "results", lenient=True)
        except InputError as error:
            raise InputError(f"{where}: not the results of a run: {error}") from None


_NEEDED = ("tables", "seed", "versions", "configuration")


def _exclusion(data: Any) -> Any:
    """Return the keys of an exclusion, which earlier versions wrote as a sentence."""
    return Exclusion.from_sentence(data).to_dict() if isinstance(data, str) else data


def read_results(path: str | Path) -> Results:
    """Read `results.json`, written by this version or an earlier one.

    Raises:
        StorageError: the file can't be read.
        InputError: it holds something else.
    """
    return Results.from_dict(read_json(path), str(path))
