"""Before and after the gyro: Table 3's two columns, and what the paper says of them.

IN1 drives the base helicopter, IN2 the helicopter with its gyro; the same structure is fitted to
both (Wu and Chen, section 3.2). What is said is set beside what the numbers are, the paper's own
and the identified ones.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from helisim.study.paper import jr700
from helisim.study.paper.values import TrendClaim

_NO_TREND = "tau_l"
"""Delays are left out: a recorder's latencies are in them."""


@dataclass(frozen=True, kw_only=True)
class Change:
    """One parameter before and after the gyro.

    Attributes:
        name: of the parameter.
        unit: of all four values.
        paper_before: Table 3, IN1.
        paper_after: Table 3, IN2.
        before: identified from IN1.
        after: identified from IN2.
    """

    name: str
    unit: str
    paper_before: float
    paper_after: float
    before: float
    after: float

    @property
    def paper_ratio(self) -> float:
        """The paper's IN2 over IN1."""
        return self.paper_after / self.paper_before

    @property
    def ratio(self) -> float:
        """The identified IN2 over IN1."""
        return self.after / self.before

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data."""
        return {**asdict(self), "paper_ratio": self.paper_ratio, "ratio": self.ratio}


@dataclass(frozen=True, kw_only=True)
class Statement:
    """What the paper says, and what is so.

    Attributes:
        said: by the paper.
        paper: what its own table says.
        identified: what was identified from the records.
    """

    said: str
    paper: str
    identified: str


@dataclass(frozen=True, kw_only=True)
class GyroEffect:
    """What the gyro does to the roll-pitch model.

    Attributes:
        changes: one a parameter that both columns have.
        statements: one for each thing that the paper says of them.
    """

    changes: tuple[Change, ...]
    statements: tuple[Statement, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data."""
        return {
            "changes": [change.to_dict() for change in self.changes],
            "statements": [asdict(statement) for statement in self.statements],
        }


def gyro_effect(before: Mapping[str, float], after: Mapping[str, float]) -> GyroEffect:
    """Compare the roll-pitch model from IN1 with the one from IN2.

    Args:
        before: parameter -> value identified from IN1, SI.
        after: parameter -> value identified from IN2, SI.
    """
    first, second = jr700.ROLLPITCH_IN1, jr700.ROLLPITCH_IN2
    names = [
        name
        for name in first.names
        if not name.startswith(_NO_TREND) and name in before and name in after
    ]
    changes = {
        name: Change(
            name=name,
            unit=first[name].unit,
            paper_before=first[name].value,
            paper_after=second[name].value,
            before=before[name],
            after=after[name],
        )
        for name in names
    }
    return GyroEffect(
        changes=tuple(changes.values()),
        statements=tuple(_statement(claim, changes) for claim in jr700.TREND_CLAIMS),
    )


def _statement(claim: TrendClaim, changes: Mapping[str, Change]) -> Statement:
    meant = [changes[name] for name in claim.names or changes]
    if claim.ratio is not None:
        return Statement(
            said=claim.said,
            paper=_ratios(claim.ratio, {one.name: one.paper_ratio for one in meant}),
            identified=_ratios(claim.ratio, {one.name: one.ratio for one in meant}),
        )
    return Statement(
        said=claim.said,
        paper=_trends({one.name: one.paper_ratio for one in meant}),
        identified=_trends({one.name: one.ratio for one in meant}),
    )


def _ratios(claimed: float, ratios: Mapping[str, float]) -> str:
    return ", ".join(
        f"{name} {ratio:.3f}, {_percent(ratio / claimed)} from {claimed:g}"
        for name, ratio in ratios.items()
    )


def _trends(ratios: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {_percent(abs(ratio))}" for name, ratio in ratios.items())


def _percent(ratio: float) -> str:
    return f"{100.0 * (ratio - 1.0):+.1f} %"
