"""Whether records can be trusted: of whole flights, and of what sensors saw."""

import warnings
from collections.abc import Sequence

import numpy as np

from helisim.damage import spikes, still
from helisim.errors import IdentificationError
from helisim.record import FlightRecord


class DamagedRecordWarning(UserWarning):
    """A record has spikes, or stretches in which measured motion stands still."""


def check_whole(flights: Sequence[FlightRecord]) -> None:
    """Raise IdentificationError if a flight was over before its time: its end is no response."""
    ended = [(number, one.ended) for number, one in enumerate(flights, start=1) if one.ended]
    if ended:
        number, why = ended[0]
        more = f", and {len(ended) - 1} more such" if len(ended) > 1 else ""
        raise IdentificationError(
            f"record {number} is of a flight that was over before its time, because {why}{more}; "
            "leave it out, or use it as it is, with use_ended=True (--use-ended)"
        )


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
