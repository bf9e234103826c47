"""Checks of records before their use: flights that were terminated early, sensors' faults."""

import warnings
from collections.abc import Iterator, Sequence

import numpy as np

from helisim.base.errors import IdentificationError
from helisim.records.channels import Channel
from helisim.records.quality import at_stop, frozen_runs, spikes
from helisim.records.record import FlightRecord

_LONGEST_STOP = 1.0
"""s, for which an input may be at its stop in a record."""


class RecordQualityWarning(UserWarning):
    """A record has spikes, frozen runs, or inputs that stay at their stops."""


def refuse_truncated(flights: Sequence[FlightRecord]) -> None:
    """Raise IdentificationError if a flight was terminated early: its end is no response."""
    ended = [(number, one.ended) for number, one in enumerate(flights, start=1) if one.ended]
    if ended:
        number, why = ended[0]
        more = f", and {len(ended) - 1} more such" if len(ended) > 1 else ""
        raise IdentificationError(
            f"record {number} is of a flight that was terminated early, because {why}{more}; "
            "leave it out, or use it as it is, with use_ended=True (--use-ended)"
        )


def quality_flags(flights: Sequence[FlightRecord], names: Sequence[str]) -> tuple[str, ...]:
    """Return what is wrong with the named channels, and warn of it.

    Args:
        flights: to look at.
        names: of the channels that are used.
    """
    flags = [
        f"record {number}: {channel.name!r} {what}"
        for number, flight in enumerate(flights, start=1)
        for channel in flight.channels
        if channel.name in names
        for what in _faults(flight, channel)
    ]
    for flag in flags:
        warnings.warn(flag, RecordQualityWarning, stacklevel=3)
    return tuple(flags)


def _faults(flight: FlightRecord, channel: Channel) -> Iterator[str]:
    """Yield what is wrong with a channel of a record."""
    values, time = flight[channel.name], flight.time
    out = np.flatnonzero(spikes(values))
    if out.size:
        yield (
            f"has {out.size} samples that are spikes, the first at {time[out[0]]:.6g} s; "
            "interpolate them, with helisim.screen(record, repair='spikes') or --repair spikes"
        )
    runs = frozen_runs(values) if channel.kind == "OUT" else ()
    if runs:
        yield (
            f"is frozen, in {len(runs)} places, first from "
            f"{time[runs[0].first]:.6g} to {time[runs[0].last]:.6g} s; leave that out, "
            "with helisim.screen(record, repair='frozen') or --repair frozen"
        )
    stopped = np.flatnonzero(at_stop(values)) if channel.kind in ("IN1", "IN2") else np.array([])
    lost = stopped.size * flight.duration / (len(flight) - 1)
    if lost > _LONGEST_STOP:
        yield (
            f"is at its stop for {lost:.4g} s, first at {time[stopped[0]]:.6g} s: what the "
            "vehicle does then, or the servo, isn't linear; leave that out, with record.slice "
            "or --to"
        )
