"""What is published of a vehicle that is flown: of a shipped one only, whatever a folder's name."""

from pathlib import Path

from helisim.base.errors import ModelError
from helisim.study.paper import Published, ReferenceTable, published
from helisim.vehicle import Vehicle
from helisim.vehicle.folder import is_shipped


def published_of(folder: Path, *, instead: str) -> Published:
    """Return what is published of the vehicle in a folder.

    Args:
        folder: of the vehicle.
        instead: what the folder can have in place of it, for the message.

    Raises:
        ModelError: nothing is published; the message says what to do instead.
    """
    if not is_shipped(folder):
        raise ModelError(f"nothing is published of {folder.name!r}: {instead}")
    return published(folder.name)


def paper_table(vehicle: Vehicle, model: str) -> ReferenceTable:
    """Return the published table of a model, without values where nothing is published."""
    if is_shipped(vehicle.folder) and model in published(vehicle.name).tables:
        return published(vehicle.name).tables[model]
    return ReferenceTable(model, input="", cost=None, values=())
