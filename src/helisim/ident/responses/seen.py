"""Which records a fit has seen, so that a verification can refuse them.

A record is known by a digest of its numbers, and a part of one by its flight and its time: a
simulated flight by what its provenance says was flown, a log by the digest of its file. So a
record that was cut, resampled or repaired by helisim is known still. One that has no provenance,
or was cut by another program, is known only whole.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from helisim.records.record import FlightRecord

_NOT_THE_FLIGHT = ("made_by", "versions", "ended", "log", "part")
"""Keys of a provenance that do not say which flight it is."""


class FlightSpan(NamedTuple):
    """The part of a flight that a record holds.

    Attributes:
        flight: digest of what says which flight it is.
        start: time of the first sample, s.
        stop: time of the last sample, s.
    """

    flight: str
    start: float
    stop: float


def record_digest(record: FlightRecord) -> str:
    """Return a short digest of a record's time and values."""
    digest = hashlib.blake2b(record.time.tobytes(), digest_size=12)
    digest.update(record.values.tobytes())
    return digest.hexdigest()


def flight_span(record: FlightRecord) -> FlightSpan | None:
    """Return which part of which flight a record is; None where its provenance does not say."""
    flown = {key: x for key, x in record.provenance.items() if key not in _NOT_THE_FLIGHT}
    log = record.provenance.get("log")
    if not flown and isinstance(log, Mapping):
        if any(one["kind"] == "reset" for one in log.get("findings", ())):
            return None  # its time begins anew, so it does not say which part this is
        flown = {"log": log.get("digest")}
    if not flown:
        return None
    text = json.dumps(flown, sort_keys=True).encode()
    flight = hashlib.blake2b(text, digest_size=12).hexdigest()
    return FlightSpan(flight, float(record.time[0]), float(record.time[-1]))


def share_seen(record: FlightRecord, spans: Sequence[FlightSpan]) -> float:
    """Return the share of a record's time that is in the given parts of flights, 0 to 1.

    Args:
        record: to look for.
        spans: of one fit; where two overlap, that time counts once.
    """
    own = flight_span(record)
    if own is None:
        return 0.0
    seen, reached = 0.0, own.start
    for span in sorted(spans):
        if span.flight == own.flight:
            start, stop = max(span.start, reached), min(span.stop, own.stop)
            seen += max(stop - start, 0.0)
            reached = max(reached, stop)
    return seen / (own.stop - own.start)
