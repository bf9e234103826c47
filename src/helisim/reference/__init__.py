"""The paper's tables with their provenance: compared with, never fed to the identification."""

from helisim.reference import jr700
from helisim.reference.values import ReferenceTable, ReferenceValue

__all__ = ["ReferenceTable", "ReferenceValue", "jr700"]
