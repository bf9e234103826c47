"""Chooses from which frequency on a structure follows the data that it is fitted to."""

from typing import Any

from helisim.base.errors import HelisimError
from helisim.ident import FrequencyResponse, Structure, identify
from helisim.look.systemid.fits import Band

_FOLLOWS = 1.0
"""Average J at which a structure follows: a fiftieth of what is called excellent."""
_OF_LEAST = 1.3
"""Of the least average J of all lower edges, where noise keeps it larger than that."""
_STEP = 1.3
"""From one lower edge to the next."""
_OCTAVES = 3.0
"""That a band must still span."""


def followed_band(frf: FrequencyResponse, structure: Structure, band: Band, **search: Any) -> Band:
    """Return the widest band of those with the same upper edge that a structure follows.

    At low frequencies a helicopter's speeds come into play, which structures of rates alone don't
    have. The lower edge is raised until the average J is small, or as small as noise lets it be.

    Args:
        frf: the data.
        structure: to fit.
        band: rad/s.
        **search: options of `identify`.
    """
    low, high = band
    tried: list[tuple[float, float]] = []
    edge = low
    while not tried or high / edge >= 2.0**_OCTAVES:
        try:
            tried.append((edge, identify(frf, structure, band=(edge, high), **search).cost))
        except HelisimError:
            break
        if tried[-1][1] <= _FOLLOWS:
            break
        edge *= _STEP
    if not tried:
        return band
    least = max(_FOLLOWS, _OF_LEAST * min(cost for _, cost in tried))
    return next(edge for edge, cost in tried if cost <= least), high
