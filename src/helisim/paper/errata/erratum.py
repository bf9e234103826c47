"""One statement of the paper that its own numbers contradict."""

from dataclasses import asdict, dataclass

from helisim.paper import ReferenceTable


@dataclass(frozen=True, kw_only=True)
class Erratum:
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

    title: str
    where: str
    printed: str
    calculation: str
    computed: str
    conclusion: str
    confirmed: bool

    def to_dict(self) -> dict[str, object]:
        """Return plain JSON data."""
        return asdict(self)


def of(table: ReferenceTable, name: str) -> float:
    """Return a value of a table by its name."""
    return table[name].value


def percent_change(after: float, before: float) -> float:
    """Return by how much a size has changed, percent."""
    return 100.0 * (abs(after) / abs(before) - 1.0)
