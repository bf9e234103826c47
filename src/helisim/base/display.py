"""Display of values in notebooks."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

import helisim

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Axes
    from matplotlib.figure import Figure as Figure


def shower() -> Any:
    """Return the module that renders values."""
    return import_module(helisim.SHOWN_BY)


class Displayed:
    """Base of values that a notebook shows as a page."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        """Return self-contained HTML, light and dark."""
        return shower().to_html(self)
