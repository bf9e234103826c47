"""Whether records hold samples that no sensor saw: an estimate from them is flagged."""

import warnings
from collections.abc import Sequence

import numpy as np

from helisim.damage import spikes, still
from helisim.record import FlightRecord


class DamagedRecordWarning(UserWarning):
    """A record has spikes, or stretches in which measured motion stands still."""


def damaged(flights: Sequence[FlightRecord], names: Sequence[str]) -> tuple[str, ...]:
    """Return what is wrong with the named channels, and warn of it.

    Args:
        flights: to look at.
        names: of the channels that are used.
    """
    flags = []
    for number, flight in enumerate(flights, start=1):
        for channel in flight.channels:
            if channel.name not in names:
                continue
            values = flight[channel.name]
            out = np.flatnonzero(spikes(values))
            if out.size:
                flags.append(
                    f"record {number}: {channel.name!r} has {out.size} samples that are spikes, "
                    f"the first at {flight.time[out[0]]:.6g} s; interpolate them, with "
                    "helisim.screen(record, repair='spikes') or --repair spikes"
                )
            stretches = still(values) if channel.kind == "OUT" else ()
            if stretches:
                flags.append(
                    f"record {number}: {channel.name!r} stands still, in {len(stretches)} "
                    f"places, first from {flight.time[stretches[0].first]:.6g} to "
                    f"{flight.time[stretches[0].last]:.6g} s; leave that out, with "
                    "helisim.screen(record, repair='frozen') or --repair frozen"
                )
    for flag in flags:
        warnings.warn(flag, DamagedRecordWarning, stacklevel=3)
    return tuple(flags)
