"""Flights of the same event side by side: a view of each, and each signal of all in one plot."""

from collections.abc import Mapping, Sequence

import rerun as rr

from helisim.records.channels import ATTITUDES, IN1
from helisim.records.record import FlightRecord
from helisim.show.rerun.series import log_series

ROOT = "side_by_side"
"""Entity of the signals."""
_COMPARED = (*ATTITUDES, *IN1[1:])
"""What a disturbance moves, and the commands that reject it."""
_INKS = ((255, 152, 56), (72, 166, 255), (94, 210, 160), (190, 140, 230))


def compared(flights: Mapping[str, FlightRecord]) -> tuple[str, ...]:
    """Return the channels that all flights have, of those that are compared."""
    return tuple(name for name in _COMPARED if all(name in one for one in flights.values()))


def log_side_by_side(recording: rr.RecordingStream, flights: Mapping[str, FlightRecord]) -> None:
    """Log each compared signal below an entity of its own, one series a flight."""
    for channel in compared(flights):
        for k, (name, record) in enumerate(flights.items()):
            entity = f"{ROOT}/{channel}/{rr.escape_entity_path_part(name)}"
            label = f"{name} [{record.unit(channel)}]"
            ink = _INKS[k % len(_INKS)]
            log_series(recording, entity, record.time, record.select((channel,)), [label], [ink])


def titles(channels: Sequence[str]) -> dict[str, str]:
    """Return the entity of each channel, by what its plot is called."""
    return {_MEANINGS.get(name, name): f"{ROOT}/{name}" for name in channels}


_MEANINGS = {
    "phi": "roll angle",
    "theta": "pitch angle",
    "psi": "heading",
    "lon": "longitudinal command",
    "lat": "lateral command",
    "ped": "tail command",
}
