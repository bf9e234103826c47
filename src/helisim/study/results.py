"""Results: what the paper prints, what flew, and what was identified, side by side."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

from helisim.errors import InputError, UnknownNameError
from helisim.ident.verify import VerificationFigures
from helisim.paper.eq8 import OverallCheck
from helisim.paper.gyro_effect import GyroEffect
from helisim.records.display import Displayed
from helisim.records.files import read_json
from helisim.records.value import FrozenMap
from helisim.sim.plain import INFINITE, from_plain
from helisim.sim.rigs import RigTest
from helisim.study.exclusion import Exclusion

Verdict = Literal["ok", "off truth", "off paper", "off both", "not judged"]


@dataclass(frozen=True, kw_only=True)
class ParameterRow:
    """One identified parameter beside its truth and the paper's number.

    Attributes:
        name: the parameter's name, as in the paper.
        unit: of `paper`, `truth` and `identified`.
        identified: estimated from the records alone.
        truth: from the exact linearisation of the model that flew; None where there is none.
        paper: the published value; None where there is none.
        cr_percent: Cramér-Rao bound of `identified`; None where it was not estimated.
        insensitivity_percent: insensitivity of `identified`; None where it was not estimated.
        tolerance_percent: the largest accepted distance from `truth`, percent of `truth`;
            None reports the parameter without judging it.
        tolerance_reason: why that tolerance.
        paper_tolerance_percent: the same for `paper`; None reports without judging, as it
            must where the truth is not the paper's.
        paper_tolerance_reason: why that tolerance.
    """

    name: str
    unit: str
    identified: float
    truth: float | None = None
    paper: float | None = None
    cr_percent: float | None = None
    insensitivity_percent: float | None = None
    tolerance_percent: float | None = None
    tolerance_reason: str = ""
    paper_tolerance_percent: float | None = None
    paper_tolerance_reason: str = ""

    def __post_init__(self) -> None:
        for what in ("identified", "truth", "paper"):
            value = getattr(self, what)
            if value is not None and not math.isfinite(value):
                raise InputError(f"{self.name}: {what} must be finite, got {value}")
        for what, against in (("tolerance", "truth"), ("paper_tolerance", "paper")):
            tolerance = getattr(self, f"{what}_percent")
            if tolerance is None:
                continue
            if getattr(self, against) is None:
                raise InputError(f"{self.name}: {what}_percent needs a value of {against}")
            if not tolerance > 0.0:
                raise InputError(f"{self.name}: {what}_percent must be positive, got {tolerance}")
            if not getattr(self, f"{what}_reason"):
                raise InputError(f"{self.name}: {what}_percent needs its reason")

    @property
    def error_percent(self) -> float | None:
        """Distance of `identified` from `truth`, percent of `truth`, with sign."""
        return _deviation_percent(self.identified, self.truth)

    @property
    def paper_error_percent(self) -> float | None:
        """Distance of `identified` from `paper`, percent of `paper`, with sign."""
        return _deviation_percent(self.identified, self.paper)

    @property
    def verdict(self) -> Verdict:
        """Which tolerances hold; "not judged" where there are none."""
        if self.tolerance_percent is None and self.paper_tolerance_percent is None:
            return "not judged"
        off_truth = _exceeds(self.error_percent, self.tolerance_percent)
        off_paper = _exceeds(self.paper_error_percent, self.paper_tolerance_percent)
        if off_truth and off_paper:
            return "off both"
        if off_truth:
            return "off truth"
        return "off paper" if off_paper else "ok"

    @property
    def misses(self) -> tuple[str, ...]:
        """One sentence for each tolerance that is missed, with the amount and the reason."""
        against_truth = self._miss(
            "truth", self.truth, self.error_percent, self.tolerance_percent, self.tolerance_reason
        )
        against_paper = self._miss(
            "paper",
            self.paper,
            self.paper_error_percent,
            self.paper_tolerance_percent,
            self.paper_tolerance_reason,
        )
        return tuple(miss for miss in (against_truth, against_paper) if miss)

    def _miss(
        self,
        what: str,
        target: float | None,
        error: float | None,
        tolerance: float | None,
        reason: str,
    ) -> str:
        if error is None or not _exceeds(error, tolerance):
            return ""
        return (
            f"{self.name} is {self.identified:.5g} {self.unit}, {abs(error):.3g} % from the "
            f"{what}'s {target:.5g}; the tolerance is {tolerance:.3g} % ({reason})"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data; an infinite bound is "inf", an absent one None."""
        return {
            "name": self.name,
            "unit": self.unit,
            "paper": self.paper,
            "truth": self.truth,
            "identified": self.identified,
            "cr_percent": _json_number(self.cr_percent),
            "insensitivity_percent": _json_number(self.insensitivity_percent),
            "tolerance_percent": self.tolerance_percent,
            "tolerance_reason": self.tolerance_reason,
            "paper_tolerance_percent": self.paper_tolerance_percent,
            "paper_tolerance_reason": self.paper_tolerance_reason,
            "verdict": self.verdict,
        }


@dataclass(frozen=True, kw_only=True)
class GivenValue:
    """A value that a fit was given.

    Attributes:
        name: of the parameter.
        unit: SI.
        value: in `unit`.
        source: the table or the ground test that it comes from.
    """

    name: str
    unit: str
    value: float
    source: str


@dataclass(frozen=True, kw_only=True)
class ComparisonTable:
    """The parameters of one identified model.

    Attributes:
        name: of the model, as in the reference tables.
        input: the signals that drive it: "IN1" or "IN2".
        cost: average cost of the fit, J.
        band_rad_s: lowest and highest frequency of the fit, rad/s.
        parameters: one row a parameter.
        given: what the fit was given.
    """

    name: str
    input: str
    cost: float
    band_rad_s: tuple[float, float]
    parameters: tuple[ParameterRow, ...]
    given: tuple[GivenValue, ...] = ()

    def __post_init__(self) -> None:
        low, high = (float(edge) for edge in self.band_rad_s)
        if not (math.isfinite(self.cost) and self.cost >= 0.0):
            raise InputError(f"{self.name}: cost must be finite and not negative, got {self.cost}")
        if not 0.0 < low < high < math.inf:
            raise InputError(f"{self.name}: the band must rise from above 0, got {low} to {high}")
        object.__setattr__(self, "band_rad_s", (low, high))
        object.__setattr__(self, "parameters", tuple(self.parameters))

    def __getitem__(self, name: str) -> ParameterRow:
        """Return the row of a parameter. Raises UnknownNameError."""
        for row in self.parameters:
            if row.name == name:
                return row
        names = [row.name for row in self.parameters]
        raise UnknownNameError(f"parameter of {self.name}", name, names)

    @property
    def identified(self) -> dict[str, float]:
        """Parameter -> identified value, SI."""
        return {row.name: row.identified for row in self.parameters}

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data."""
        return {
            "name": self.name,
            "input": self.input,
            "cost": self.cost,
            "band_rad_s": list(self.band_rad_s),
            "parameters": [row.to_dict() for row in self.parameters],
            "given": [asdict(one) for one in self.given],
        }


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
        return tuple(
            f"{table.name}: {miss}"
            for table in self.tables
            for row in table.parameters
            for miss in row.misses
        )

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


def _json_number(value: float | None) -> float | str | None:
    """Return a size as JSON can hold it; one that is not a number becomes None."""
    if value is None or math.isnan(value):
        return None
    return value if math.isfinite(value) else INFINITE


def _deviation_percent(value: float, target: float | None) -> float | None:
    if target is None:
        return None
    if target == 0.0:
        return 0.0 if value == 0.0 else math.copysign(math.inf, value)
    return 100.0 * (value - target) / abs(target)


def _exceeds(error: float | None, tolerance: float | None) -> bool:
    return error is not None and tolerance is not None and abs(error) > tolerance
