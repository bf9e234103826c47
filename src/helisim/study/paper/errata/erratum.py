"""One statement of the paper that its own numbers contradict, as a row of data."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

from helisim.study.paper import ReferenceTable


@dataclass(frozen=True, kw_only=True)
class _Texts:
    title: str
    where: str
    printed: str
    calculation: str
    computed: str
    conclusion: str


@dataclass(frozen=True, kw_only=True)
class Erratum(_Texts):
    """One statement of the paper that its own numbers contradict.

    Attributes:
        title: of the error.
        where: in the paper.
        printed: what stands there.
        calculation: the one line that shows it, with its numbers in place.
        computed: what comes out.
        conclusion: what to make of it, and what helisim does.
        confirmed: whether the calculation does contradict the print.
    """

    confirmed: bool

    def to_dict(self) -> dict[str, object]:
        """Return plain JSON data."""
        return asdict(self)


@dataclass(frozen=True, kw_only=True)
class Row(_Texts):
    """An erratum whose texts have places, such as {ratio:.3f}, for figures yet to be computed.

    Attributes:
        figures: returns its locals: what stands in the places, by name, and `confirmed`.
        title, where, printed, calculation, computed, conclusion: as of an `Erratum`.
    """

    figures: Callable[[], Mapping[str, Any]]

    def compute(self) -> Erratum:
        """Return the erratum with its figures in place."""
        found = self.figures()
        texts = {one.name: getattr(self, one.name).format(**found) for one in fields(_Texts)}
        return Erratum(**texts, confirmed=bool(found["confirmed"]))


def of(table: ReferenceTable, *names: str) -> list[float]:
    """Return values of a table by their names."""
    return [table[name].value for name in names]


def percent_change(after: float, before: float) -> float:
    """Return by how much a size has changed, percent."""
    return 100.0 * (abs(after) / abs(before) - 1.0)
