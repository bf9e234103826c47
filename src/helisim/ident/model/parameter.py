"""One parameter of a structure: its name, unit, start and bounds."""

import math
from dataclasses import dataclass

from helisim.base.errors import InputError
from helisim.ident.model.expression import FUNCTIONS

_DEFAULT_SCALE = 1.0


@dataclass(frozen=True)
class Parameter:
    """One parameter of a structure.

    Attributes:
        name: an identifier, such as "N_r".
        unit: SI unit.
        start: where the search begins: an order of magnitude is enough.
        bounds: (lowest, highest) value, or None.
        meaning: what it is.
        scale: its order of magnitude; needed where the start is 0, otherwise |start|.
        fixed: keep it at `start`.
        error: standard error of a fixed parameter, known from a bench; a fit carries it through to
            the errors of the free ones. 0: known exactly.
    """

    name: str
    unit: str
    start: float
    bounds: tuple[float, float] | None = None
    meaning: str = ""
    scale: float | None = None
    fixed: bool = False
    error: float = 0.0

    def __post_init__(self) -> None:
        if not self.name.isidentifier() or self.name in FUNCTIONS:
            raise InputError(f"parameter name {self.name!r} isn't an identifier, such as 'N_r'")
        if not math.isfinite(self.start):
            raise InputError(f"parameter {self.name!r} starts at {self.start}, expected a number")
        low, high = self.limits
        if not low < high or not low <= self.start <= high:
            raise InputError(
                f"parameter {self.name!r} has bounds {low} to {high} and starts at "
                f"{self.start}; expected lower < upper with the start between them (--bounds "
                "NAME=LO:HI, --start NAME=VALUE)"
            )
        if self.scale is not None and not (math.isfinite(self.scale) and self.scale > 0.0):
            raise InputError(f"parameter {self.name!r} has scale {self.scale}, expected > 0")
        if not (math.isfinite(self.error) and self.error >= 0.0):
            raise InputError(f"parameter {self.name!r} has error {self.error}, expected 0 or more")
        if self.error and not self.fixed:
            raise InputError(
                f"parameter {self.name!r} has error {self.error} but is free: a standard error is "
                "given for a fixed parameter, as from a bench; a free one's comes from the fit"
            )

    @property
    def limits(self) -> tuple[float, float]:
        """The bounds, infinite where there are none."""
        return (-math.inf, math.inf) if self.bounds is None else self.bounds

    @property
    def magnitude(self) -> float:
        """The order of magnitude."""
        return self.scale or abs(self.start) or _DEFAULT_SCALE
