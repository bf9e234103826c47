"""Filters of a law's feedback: first and second order in s, sampled by Tustin's rule."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, ClassVar

from helisim.base.errors import InputError, UnknownNameError
from helisim.design.laws.law import check_number

Polynomial = tuple[float, float, float]
"""Of s: c0 + c1 s + c2 s^2."""


@dataclass(frozen=True)
class Filter:
    """A filter of unit gain at low frequency, but for a notch that has none but there.

    Attributes:
        kind: by which a file names it.
    """

    kind: ClassVar[str]

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            check_number(f"{name} of a {self.kind}", value, least="above 0")

    @property
    def ratio(self) -> tuple[Polynomial, Polynomial]:
        """Numerator and denominator in s."""
        raise NotImplementedError

    @property
    def kept(self) -> float:
        """Frequency that sampling keeps in its place, rad/s; 0 for the lowest."""
        return 0.0

    def coefficients(self, period: float) -> tuple[float, float, float, float, float]:
        """Return b0, b1, b2, a1, a2 of the filter sampled each period (s)."""
        half = 0.5 * self.kept * period
        if half >= 0.5 * math.pi:
            raise InputError(
                f"a {self.kind} at {self.kept:g} rad/s is beyond what ticks of {period:g} s show"
            )
        rate = self.kept / math.tan(half) if self.kept else 2.0 / period
        first = self.ratio[0][2] == self.ratio[1][2] == 0.0
        (b0, b1, b2), (a0, a1, a2) = (_tustin(one, rate, first) for one in self.ratio)
        return b0 / a0, b1 / a0, b2 / a0, a1 / a0, a2 / a0

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {"kind": self.kind, **asdict(self)}


def _tustin(polynomial: Polynomial, rate: float, first: bool) -> Polynomial:
    """Return a polynomial of s = rate (1 - 1/z) / (1 + 1/z) in powers of 1/z.

    Times (1 + 1/z), of second order times its square, which ratios don't see.
    """
    c0, c1, c2 = polynomial[0], polynomial[1] * rate, polynomial[2] * rate**2
    if first:
        return c0 + c1, c0 - c1, 0.0
    return c0 + c1 + c2, 2.0 * (c0 - c2), c0 - c1 + c2


@dataclass(frozen=True)
class Lead(Filter):
    """(1 + s/zero) / (1 + s/pole): a lead with the zero below the pole, else a lag.

    Attributes:
        zero: rad/s.
        pole: rad/s.
    """

    kind: ClassVar[str] = "lead"
    zero: float
    pole: float

    @property
    def ratio(self) -> tuple[Polynomial, Polynomial]:
        """Numerator and denominator in s."""
        return (1.0, 1.0 / self.zero, 0.0), (1.0, 1.0 / self.pole, 0.0)


@dataclass(frozen=True)
class Lowpass(Filter):
    """w^2 / (s^2 + 2 damping w s + w^2).

    Attributes:
        frequency: w, rad/s.
        damping: ratio.
    """

    kind: ClassVar[str] = "lowpass"
    frequency: float
    damping: float = math.sqrt(0.5)

    @property
    def ratio(self) -> tuple[Polynomial, Polynomial]:
        """Numerator and denominator in s."""
        w = self.frequency
        return (1.0, 0.0, 0.0), (1.0, 2.0 * self.damping / w, 1.0 / w**2)


@dataclass(frozen=True)
class Notch(Filter):
    """(s^2 + 2 depth damping w s + w^2) / (s^2 + 2 damping w s + w^2).

    Attributes:
        frequency: w, rad/s, where it lets through no more than `depth`.
        damping: ratio, half of its width.
        depth: gain that is left there.
    """

    kind: ClassVar[str] = "notch"
    frequency: float
    damping: float = 0.5
    depth: float = 0.1

    @property
    def ratio(self) -> tuple[Polynomial, Polynomial]:
        """Numerator and denominator in s."""
        w, wide = self.frequency, 2.0 * self.damping / self.frequency
        return (1.0, self.depth * wide, 1.0 / w**2), (1.0, wide, 1.0 / w**2)

    @property
    def kept(self) -> float:
        """Its own frequency."""
        return self.frequency


FILTERS: dict[str, type[Filter]] = {one.kind: one for one in (Lead, Lowpass, Notch)}


def filter_of(content: Any) -> Filter:
    """Return a filter of plain data.

    Raises:
        InputError: it is no table with a kind, or a number is missing, unknown or not above 0.
    """
    if not isinstance(content, Mapping) or "kind" not in content:
        raise InputError(
            f'a filter is a table such as {{ kind = "lead", zero = 20.0, pole = 80.0 }}, '
            f"got {content!r:.60}"
        )
    given = {name: value for name, value in content.items() if name != "kind"}
    if not isinstance(content["kind"], str) or content["kind"] not in FILTERS:
        raise UnknownNameError("kind of filter", content["kind"], FILTERS)
    chosen = FILTERS[content["kind"]]
    known = [one.name for one in fields(chosen)]
    for name in given:
        if name not in known:
            raise UnknownNameError(f"name in a {chosen.kind}", name, known)
    try:
        return chosen(**given)
    except TypeError:
        raise InputError(
            f"a {chosen.kind} needs {', '.join(known)}, got {', '.join(given)}"
        ) from None
