"""Published numbers with their sources: compared with, never fed to an identification."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from helisim.base.errors import UnknownNameError


@dataclass(frozen=True)
class ReferenceValue:
    """One published number.

    Attributes:
        name: the parameter's name in this project.
        value: in `unit`, as printed unless `source` says how it was derived.
        unit: SI, except for values kept as printed.
        cr_percent: published Cramér-Rao bound, percent of the value; None where none is printed.
        insensitivity_percent: published insensitivity, percent; None where none is printed.
        source: table or equation, and what is known to be wrong with it.
    """

    name: str
    value: float
    unit: str
    cr_percent: float | None = None
    insensitivity_percent: float | None = None
    source: str = ""


@dataclass(frozen=True)
class TrendClaim:
    """What the paper says in words about how parameters change from IN1 to IN2.

    Attributes:
        names: of the parameters; empty for all.
        said: the paper's words, shortened.
        ratio: of IN2 to IN1 that is to hold for each; None where the words are of a trend.
    """

    names: tuple[str, ...]
    said: str
    ratio: float | None = None


@dataclass(frozen=True)
class ReferenceTable:
    """The published numbers of one model, addressed by name.

    Attributes:
        name: the table's name in this project.
        input: the signals that drive the model: "IN1", "IN2", or "" where nothing is fitted.
        cost: published average cost of the fit; None where none is printed.
        values: in the order of the paper.
    """

    name: str
    input: str
    cost: float | None
    values: tuple[ReferenceValue, ...]

    def __getitem__(self, name: str) -> ReferenceValue:
        """Return the value of that name. Raises UnknownNameError."""
        for value in self.values:
            if value.name == name:
                return value
        raise UnknownNameError(f"parameter of {self.name}", name, self.names)

    def get(self, name: str) -> ReferenceValue | None:
        """Return the value of that name, or None."""
        return next((value for value in self.values if value.name == name), None)

    def __contains__(self, name: str) -> bool:
        return name in self.names

    def __iter__(self) -> Iterator[ReferenceValue]:
        return iter(self.values)

    @property
    def names(self) -> tuple[str, ...]:
        """The parameter names, in the order of the paper."""
        return tuple(value.name for value in self.values)


@dataclass(frozen=True)
class Published:
    """What is published of one vehicle.

    Attributes:
        tables: by name; models have the names of helisim's own.
        calibration: the tables that the physical parameters are solved from.
        source: what the calibration's tables are called in the provenance.
    """

    tables: Mapping[str, ReferenceTable]
    calibration: tuple[ReferenceTable, ...]
    source: str

    def table(self, name: str) -> ReferenceTable:
        """Return a table. Raises UnknownNameError; the message lists those that exist."""
        if name not in self.tables:
            raise UnknownNameError("reference table", name, self.tables)
        return self.tables[name]

    @property
    def targets(self) -> dict[str, float]:
        """The calibration's values by name, SI."""
        return {value.name: value.value for table in self.calibration for value in table}
