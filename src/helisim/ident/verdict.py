"""Verdict on a fit: whether its numbers can be believed, and why not."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Literal

from helisim.base.note import Note

Word = Literal["sound", "doubtful", "wrong"]

_WRONG = frozenset({"degenerate", "columns", "sign", "unit", "flapping", "cost"})
_DOUBTFUL = frozenset(
    {"nonlinear", "records", "lost", "clock", "delay", "lag", "residual", "unstable"}
    | {"search", "mode", "bound", "starts", "feedback", "support"}
)


@dataclass(frozen=True)
class Verdict:
    """A fit's verdict, with the notes that made it so, the worst first.

    "wrong": a cause was found for which the numbers are not the vehicle's. "doubtful": they may be
    off by more than their errors say. "sound": no check found anything.
    """

    word: Word
    reasons: tuple[Note, ...] = ()

    @classmethod
    def of(cls, notes: Iterable[Note]) -> "Verdict":
        """Return the verdict that notes make."""
        told = tuple(notes)
        wrong, doubtful = (
            tuple(one for one in told if one.kind in kinds) for kinds in (_WRONG, _DOUBTFUL)
        )
        return cls("wrong" if wrong else "doubtful" if doubtful else "sound", wrong + doubtful)

    def __str__(self) -> str:
        return self.text()

    def text(self, say: Callable[[Note], str] = str) -> str:
        """Return the verdict in one line; `say` words a note."""
        more = f" (and {len(self.reasons) - 1} more)" if len(self.reasons) > 1 else ""
        why = f": {say(self.reasons[0])}{more}" if self.reasons else ""
        return f"verdict: {self.word}{why}"

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {
            "word": self.word,
            "reasons": [{"kind": one.kind, "text": one.text} for one in self.reasons],
        }
