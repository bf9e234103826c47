"""A flight that was left out of an identification, and why."""

import re
from dataclasses import asdict, dataclass
from typing import Any, Literal

from helisim.base.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Exclusion:
    """A flight that was left out, and why.

    Attributes:
        flight: its name, such as "lat_03".
        reason: whether it was terminated early, or kept behind more coherent ones.
        ended: of one that was terminated early: by what, and when.
        coherence: of one less coherent: mean of that between the swept stick and its motion.
        limit: of one less coherent: the coherence of the least coherent flight that was kept.
        kept: of one less coherent: how many were kept.
    """

    flight: str
    reason: Literal["terminated early", "less coherent"]
    ended: str = ""
    coherence: float | None = None
    limit: float | None = None
    kept: int | None = None

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

    @classmethod
    def from_sentence(cls, text: str) -> "Exclusion":
        """Return what a sentence says, as results held one before they held values.

        Its coherences have the four decimals that were written. Raises InputError.
        """
        if found := _TERMINATED.fullmatch(text):
            return cls(flight=found[1], reason="terminated early", ended=found[2])
        if found := _LESS_COHERENT.fullmatch(text):
            return cls(
                flight=found[1],
                reason="less coherent",
                coherence=float(found[2]),
                kept=int(found[3]),
                limit=float(found[4]),
            )
        raise InputError(f"no sentence of a flight that was left out: {text!r:.80}")

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data, without what the reason doesn't have."""
        known = {name: value for name, value in asdict(self).items() if value not in (None, "")}
        return {**known, "message": self.message}


_TERMINATED = re.compile(
    r"flight (\S+): was (?:over before its time|terminated early): (.*)", re.DOTALL
)
_LESS_COHERENT = re.compile(
    r"flight (\S+): its mean coherence of (\d\.\d{4}) is not among the best (\d+) "
    r"\(the least coherent kept has (\d\.\d{4})\)"
)
"""The sentences that results held before they held values."""
