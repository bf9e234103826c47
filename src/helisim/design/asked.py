"""What a design asks of a specification."""

from typing import Protocol

from helisim.handling.criteria import Criterion


class Spec(Protocol):
    """A criterion, and what it is in a design."""

    @property
    def criterion(self) -> Criterion:
        """What is rated."""
        ...

    @property
    def kind(self) -> str:
        """Either "hard", "soft", "objective" or "check"."""
        ...
