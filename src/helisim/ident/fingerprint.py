"""Fingerprints of records, by which a verification knows what a fit has seen.

A record's samples are hashed in runs, and of every stretch of runs the least hash is kept, so
that any part of the record that is cut out later, from wherever, keeps the same marks
(winnowing: Schleimer, Wilkerson and Aiken, 2003). A part is known if its samples are unchanged:
resampled or filtered ones are other numbers.
"""

import hashlib
from collections.abc import Collection, Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from helisim.records.record import FlightRecord

RUN = 16
"""Samples of a run; so many noisy ones don't repeat by chance."""

STRETCH = 256
"""Runs of which one is kept: a part of RUN + STRETCH - 1 samples has a mark for certain."""

_CHANGES = RUN // 2
"""A run in which fewer samples change is no mark: a channel at rest is like any other."""

_MULTIPLIER = np.uint64(0x9E3779B97F4A7C15)
_MIXERS = (np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB))
"""The golden ratio, and splitmix64's constants (Steele, Lea and Flood, 2014)."""

_NONE = np.uint64(0xFFFFFFFFFFFFFFFF)


def fingerprint(record: FlightRecord) -> str:
    """Return a short digest of a record's time and values."""
    digest = hashlib.blake2b(record.time.tobytes(), digest_size=12)
    digest.update(record.values.tobytes())
    return digest.hexdigest()


def marks(records: Sequence[FlightRecord], channels: Sequence[str]) -> tuple[str, ...]:
    """Return the marks of some channels of all records, in order, each once."""
    found = {mark for record in records for name in channels for mark in _marks(record[name])}
    return tuple(f"{mark:016x}" for mark in sorted(found))


def share_known(record: FlightRecord, channels: Sequence[str], known: Collection[str]) -> float:
    """Return the share of a record's marks that are among the known ones, 0 to 1."""
    own = set(marks([record], channels))
    return len(own & set(known)) / len(own) if own else 0.0


def _marks(values: NDArray[np.float64]) -> set[int]:
    if values.size < RUN:
        return set()
    bits = (values + 0.0).view(np.uint64)  # + 0.0: there is one zero
    hashes = np.zeros(bits.size - RUN + 1, dtype=np.uint64)
    for k in range(RUN):
        hashes = hashes * _MULTIPLIER + bits[k : k + hashes.size]
    for mixer, shift in zip((*_MIXERS, np.uint64(1)), (30, 27, 31)):
        hashes = (hashes ^ (hashes >> np.uint64(shift))) * mixer
    changes = np.concatenate([[0], np.cumsum(np.diff(bits) != 0)])
    hashes[changes[RUN - 1 :] - changes[: hashes.size] < _CHANGES] = _NONE
    stretches = sliding_window_view(hashes, min(STRETCH, hashes.size))
    return set(np.unique(np.min(stretches, axis=1)).tolist()) - {int(_NONE)}
