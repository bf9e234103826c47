"""One fitted parameter: its value, its accuracy, and what supports it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.value import Value
from helisim.ident.fitting.verdicts import CRAMER_RAO_LIMIT, INSENSITIVITY_LIMIT, Support, support
from helisim.ident.model.structure import Parameter, Structure


@dataclass(frozen=True, eq=False)
class FittedParameter(Value):
    """One parameter's value and accuracy, in its unit.

    Attributes:
        definition: name, unit, start, bounds and meaning.
        value: what the fit found, or the fixed value.
        cramer_rao: CR, the spread to expect, with Tischler and Remple's factor 2.
        insensitivity: I, how far the value can move with little effect on the cost.
        standard_error: standard deviation to expect of the value: what noise, estimator and the
            errors of known parameters make of it; the given error of a fixed parameter.
        at_bound: the fit ended at a bound, so the value is the bound's, not the data's.
        degenerate: the model around it collapsed, so its accuracy says nothing.
    """

    definition: Parameter
    value: float
    cramer_rao: float
    insensitivity: float
    standard_error: float
    at_bound: bool
    degenerate: bool = False

    @property
    def name(self) -> str:
        """The parameter's name."""
        return self.definition.name

    @property
    def unit(self) -> str:
        """The parameter's unit."""
        return self.definition.unit

    @property
    def fixed(self) -> bool:
        """Whether the parameter was kept at a given value."""
        return self.definition.fixed

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval, 1.96 standard errors either way."""
        return (
            self.value - 1.96 * self.standard_error,
            self.value + 1.96 * self.standard_error,
        )

    @property
    def bound(self) -> float:
        """How far from the truth the value can be: CR, or 3 standard errors where they are more."""
        return max(self.cramer_rao, 3.0 * self.standard_error)

    @property
    def cr_percent(self) -> float:
        """The Cramér-Rao bound in percent of the value."""
        return _percent(self.cramer_rao, self.value)

    @property
    def insensitivity_percent(self) -> float:
        """The insensitivity in percent of the value."""
        return _percent(self.insensitivity, self.value)

    @property
    def poorly_identified(self) -> bool:
        """Whether CR or 2 standard errors exceed 20 %, or the insensitivity 10 %, of the value."""
        return not self.fixed and (
            self.degenerate
            or _percent(self._spread, self.value) > CRAMER_RAO_LIMIT
            or self.insensitivity_percent > INSENSITIVITY_LIMIT
        )

    @property
    def _spread(self) -> float:
        """What support is judged by: CR is twice a deviation too, of noise as J supposes it."""
        return max(self.cramer_rao, 2.0 * self.standard_error)

    @property
    def support(self) -> Support:
        """What the data say of it, in a word; `verdicts.SUPPORT` has the meanings."""
        return support(
            self.value,
            self._spread,
            self.insensitivity,
            fixed=self.fixed,
            at_bound=self.at_bound,
            degenerate=self.degenerate,
        )

    @classmethod
    def from_dict(cls, structure: Structure, data: Mapping[str, Any]) -> "FittedParameter":
        """Read what `to_dict` wrote. Raises KeyError, TypeError or InputError."""
        return cls(
            definition=structure.parameter(data["name"]),
            value=float(data["value"]),
            cramer_rao=_number_from_plain(data["cramer_rao"]),
            insensitivity=_number_from_plain(data["insensitivity"]),
            standard_error=_number_from_plain(data["standard_error"]),
            at_bound=bool(data["at_bound"]),
            degenerate=bool(data.get("degenerate", False)),
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; what isn't finite becomes None."""
        return {
            "name": self.name,
            "unit": self.unit,
            "value": self.value,
            "cramer_rao": _number_to_plain(self.cramer_rao),
            "insensitivity": _number_to_plain(self.insensitivity),
            "cr_percent": _number_to_plain(self.cr_percent),
            "insensitivity_percent": _number_to_plain(self.insensitivity_percent),
            "standard_error": _number_to_plain(self.standard_error),
            "fixed": self.fixed,
            "at_bound": self.at_bound,
            "degenerate": self.degenerate,
            "poorly_identified": self.poorly_identified,
            "support": self.support,
        }


def _number_to_plain(number: float) -> float | None:
    """Return a number for JSON: None where it isn't finite."""
    return float(number) if math.isfinite(number) else None


def _number_from_plain(number: float | None) -> float:
    """Return what `_number_to_plain` took: infinity where it wasn't finite."""
    return math.inf if number is None else float(number)


def matrix_to_plain(matrix: NDArray[np.float64]) -> list[list[float | None]]:
    """Return a matrix, (n_free, n_free), for JSON: None where it isn't finite."""
    return [[_number_to_plain(number) for number in row] for row in matrix.tolist()]


def matrix_from_plain(
    rows: Sequence[Sequence[float | None]] | None, size: int
) -> NDArray[np.float64] | None:
    """Return the (n_free, n_free) matrix that `matrix_to_plain` took, None if there is none."""
    if rows is None:
        return None
    numbers = [[_number_from_plain(number) for number in row] for row in rows]
    return np.array(numbers, dtype=np.float64).reshape(size, size)


def _percent(part: float, whole: float) -> float:
    if part == 0.0:
        return 0.0
    return 100.0 * part / abs(whole) if whole != 0.0 else math.inf
