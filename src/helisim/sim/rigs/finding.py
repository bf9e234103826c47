"""The findings of a ground test: numbers with their standard errors, beside the truth."""

from dataclasses import dataclass
from typing import Any

from helisim.base.errors import UnknownNameError


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One number that a ground test found.

    Attributes:
        name: of the quantity.
        unit: SI.
        value: from the record.
        truth: what the vehicle and its recorder carry; None where there is none.
        standard_error: of `value`; None where it is not estimated.
        how: the method, in one line.
    """

    name: str
    unit: str
    value: float
    truth: float | None = None
    standard_error: float | None = None
    how: str = ""

    @property
    def error(self) -> float | None:
        """Value minus truth, in the unit."""
        return None if self.truth is None else self.value - self.truth

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data."""
        return {
            "name": self.name,
            "unit": self.unit,
            "value": self.value,
            "truth": self.truth,
            "error": self.error,
            "standard_error": self.standard_error,
            "how": self.how,
        }


@dataclass(frozen=True, kw_only=True)
class RigTest:
    """What the test in one rig found.

    Attributes:
        rig: its name.
        findings: in the order in which they are found.
        notes: what else there is to know.
    """

    rig: str
    findings: tuple[Finding, ...]
    notes: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> Finding:
        """Return the finding of that name. Raises UnknownNameError."""
        for finding in self.findings:
            if finding.name == name:
                return finding
        raise UnknownNameError(f"finding of the {self.rig}", name, [f.name for f in self.findings])

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data."""
        return {
            "rig": self.rig,
            "findings": [finding.to_dict() for finding in self.findings],
            "notes": list(self.notes),
        }
