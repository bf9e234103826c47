"""How values are shown, without knowing by whom.

A record, a response or a fit has `plot` and, for notebooks, `_repr_html_`. What draws stands floors
above them and imports them, never the other way round: `helisim` itself, which knows where all is,
has its address, and it is imported when something is shown.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

import helisim

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Axes
    from matplotlib.figure import Figure as Figure


def shower() -> Any:
    """Return the module that shows values."""
    return import_module(helisim.SHOWN_BY)


class Displayed:
    """Base of values that a notebook shows as a page instead of as text."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        """Return a piece of HTML, light and dark, that needs nothing but itself."""
        return shower().to_html(self)
