"""A specification: a criterion, and what it is in a design."""

from dataclasses import dataclass
from typing import Literal, get_args

from helisim.errors import InputError, UnknownNameError
from helisim.handling.criteria import Criterion

Kind = Literal["hard", "soft", "objective", "check"]
KINDS: tuple[Kind, ...] = get_args(Kind)


@dataclass(frozen=True)
class Spec:
    """A criterion that is asked for.

    Attributes:
        criterion: by which loops are rated.
        kind: "hard": Level 1 comes before all else, as of stability. "soft": Level 1 with a design
            margin. "objective": its distance to Level 1, summed with others', is made as large as
            the rest allows. "check": rated and shown, not asked for.
    """

    criterion: Criterion
    kind: Kind = "soft"

    def __post_init__(self) -> None:
        if not isinstance(self.criterion, Criterion):
            raise InputError(f"a specification is of a criterion, got {self.criterion!r:.60}")
        if self.kind not in KINDS:
            raise UnknownNameError("kind of specification", self.kind, KINDS)
