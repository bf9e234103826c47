"""Published numbers with their provenance: compared with, never fed to the identification."""

from helisim.base.errors import UnknownNameError
from helisim.study.paper import blade360, jr700, lynx
from helisim.study.paper.values import Published, ReferenceTable, ReferenceValue

__all__ = [
    "Published",
    "ReferenceTable",
    "ReferenceValue",
    "blade360",
    "jr700",
    "lynx",
    "published",
]

_BY_VEHICLE = {"blade360": blade360.PUBLISHED, "jr700": jr700.PUBLISHED, "lynx": lynx.PUBLISHED}


def published(vehicle: str) -> Published:
    """Return what is published of a vehicle.

    Raises:
        UnknownNameError: nothing is; the message lists the vehicles that have something.
    """
    if vehicle not in _BY_VEHICLE:
        raise UnknownNameError("vehicle with published numbers", vehicle, _BY_VEHICLE)
    return _BY_VEHICLE[vehicle]
