"""The result of a design: the law, and how it stands by every specification."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from helisim.base.display import Displayed, shower
from helisim.base.files import write_json
from helisim.base.value import FrozenMap, Value
from helisim.design.laws.law import Law
from helisim.design.phases import Step
from helisim.design.tradeoff import TradeOff
from helisim.handling.criteria import Rating
from helisim.handling.spec import Spec

if TYPE_CHECKING:
    from helisim.base.display import Figure

FORMAT = "helisim design, version 1"


@dataclass(frozen=True)
class Judged:
    """One specification, and how laws stand by it.

    Attributes:
        spec: what is asked.
        before: of the law before; None where that one's loop is unstable or lacks a response.
        nominal: of the designed law, in the model that was identified.
        worst: of the designed law, in the worst of the models that may as well be the aircraft.
        share: of those models in which it keeps Level 1.
        cloud: of the designed law, in each of those models.
    """

    spec: Spec
    before: Rating | None
    nominal: Rating
    worst: Rating
    share: float
    cloud: tuple[Rating, ...] = field(default=(), repr=False)

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data."""
        return {
            "criterion": self.nominal.criterion.name,
            "axis": self.nominal.criterion.axis,
            "kind": self.spec.kind,
            "before": _plain(self.before),
            "nominal": _plain(self.nominal),
            "worst": _plain(self.worst),
            "share": self.share,
        }


@dataclass(frozen=True, eq=False)
class DesignResult(Value, Displayed):
    """A designed law with what it is worth.

    Attributes:
        before: the law that it is compared with: that of the start, if no other was given.
        law: the designed one.
        judged: each specification.
        margin: design margin that every specification keeps in the models designed with.
        share: of the models drawn in which every hard and soft specification keeps Level 1.
        drawn: how many models these are.
        trade_offs: disturbance rejection against phase margin, an axis each.
        history: laws on the way.
        provenance: of what, with which seed and versions.
    """

    before: Law
    law: Law
    judged: tuple[Judged, ...]
    margin: float
    share: float
    drawn: int
    trade_offs: tuple[TradeOff, ...] = ()
    history: tuple[Step, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("judged", "trade_offs", "history"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        object.__setattr__(self, "provenance", FrozenMap(self.provenance))

    def __repr__(self) -> str:
        return (
            f"DesignResult({len(self.judged)} specifications, Level 1 in "
            f"{100.0 * self.share:.3g} % of {self.drawn} models drawn, margin {self.margin:.3g})"
        )

    @property
    def specs(self) -> tuple[Spec, ...]:
        """What was asked for."""
        return tuple(one.spec for one in self.judged)

    @property
    def misses(self) -> tuple[str, ...]:
        """One sentence for each level that is missed, in the nominal or a drawn model."""
        asked = [one for one in self.judged if one.spec.kind in ("hard", "soft")]
        return tuple(
            f"{one.nominal.criterion.name} of {one.nominal.criterion.word}: Level 1 "
            f"in {100.0 * one.share:.3g} % of the models drawn"
            for one in asked
            if one.share < 1.0 or one.nominal.level > 1
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data: what `design.json` holds."""
        return {
            "format": FORMAT,
            "law": self.law.parameters(),
            "before": self.before.parameters(),
            "specifications": [one.to_dict() for one in self.judged],
            "margin": self.margin,
            "share_level_1": self.share,
            "drawn": self.drawn,
            "trade_offs": [one.to_dict() for one in self.trade_offs],
            "history": [_finite(asdict(one)) for one in self.history],
            "provenance": dict(self.provenance),
        }

    def write(self, path: str | Path) -> None:
        """Write it as JSON. Raises StorageError."""
        write_json(self.to_dict(), path, indent=1)

    def plot(self) -> "Figure":
        """Draw the charts of all criteria with their levels, before and after, and trade-offs."""
        return shower().plot_design(self)


def _plain(rating: Rating | None) -> dict[str, Any] | None:
    if rating is None:
        return None
    return {
        "figures": dict(rating.figures),
        "level": rating.level,
        "distance": rating.distance,
        "remark": rating.remark,
    }


def _finite(step: dict[str, Any]) -> dict[str, Any]:
    return {name: None if value == float("inf") else value for name, value in step.items()}
