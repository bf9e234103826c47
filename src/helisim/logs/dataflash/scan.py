"""Finds the messages of a binary DataFlash log, also between bytes that are none.

A message is two marks, its type's number, and as many bytes as the type's FMT message says; nothing
in it says that it is whole. One that no other follows is left out where another begins inside of
it that one does follow: then some of its bytes were lost.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.logs.dataflash.layout import FMT_LENGTH, FMT_NUMBER, HEADER, Layout, layout

MARKS = b"\xa3\x95"
WINDOW = 4 << 20
"""Bytes that are in memory at a time: the log itself never is."""

Read = Callable[[int, int], NDArray[np.uint8]]
"""Returns the bytes of a file from a place to another, (n_byte,)."""
Places = NDArray[np.signedinteger]
"""Bytes from the file's start, of 32 bits where they are enough: a log has millions."""


class Definition(NamedTuple):
    """An FMT message, and its place."""

    place: int
    layout: Layout


class Scan(NamedTuple):
    """Where the messages of a log are.

    Attributes:
        places: (n_message,) of their first bytes, increasing.
        kinds: (n_message,) which of the definitions a message has.
        definitions: of the log, in its order; a type that is defined anew is another one.
        used: bytes of all messages.
    """

    places: Places
    kinds: NDArray[np.int16]
    definitions: tuple[Definition, ...]
    used: int


def scan(read: Read, size: int) -> Scan:
    """Find the messages of a binary log of `size` bytes."""
    places, numbers = _marks(read, size)
    defined = _definitions(read, size, places[numbers == FMT_NUMBER])
    while True:
        kinds = _kinds(places, numbers, defined)
        lengths = np.array([*(one.layout.length for one in defined), 0], np.int16)
        whole = _whole(places, lengths[kinds], size)
        believed = set(places[whole & (numbers == FMT_NUMBER)].tolist()) | {-1}
        kept = [one for one in defined if one.place in believed]
        if len(kept) == len(defined):
            used = int(np.sum(lengths[kinds[whole]], dtype=np.int64))
            return Scan(places[whole], kinds[whole], tuple(defined), used)
        defined = kept


def _marks(read: Read, size: int) -> tuple[Places, NDArray[np.uint8]]:
    """Return where messages may begin, (n,), and the numbers of their types, (n,)."""
    dtype = np.int32 if size < np.iinfo(np.int32).max - WINDOW else np.int64
    places, numbers = [np.empty(0, dtype)], [np.empty(0, np.uint8)]
    for start in range(0, size - HEADER + 1, WINDOW):
        data = read(start, min(size, start + WINDOW + HEADER - 1))
        found = np.flatnonzero(data[: 1 - HEADER] == MARKS[0])
        found = found[data[found + 1] == MARKS[1]]
        places.append((found + start).astype(dtype))
        numbers.append(data[found + 2])
    return np.concatenate(places), np.concatenate(numbers)


def _definitions(read: Read, size: int, places: Places) -> list[Definition]:
    """Return what the log's FMT messages say, each where it differs from the one before."""
    first = layout(FMT_NUMBER, FMT_LENGTH, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
    assert first is not None
    defined, latest = [Definition(-1, first)], {FMT_NUMBER: first}
    for place in places[places <= size - FMT_LENGTH].tolist():
        data = read(place, place + FMT_LENGTH).tobytes()
        found = layout(data[3], data[4], data[5:9], data[9:25], data[25:89])
        if found is None or latest.get(found.number) == found or found.number == FMT_NUMBER:
            continue
        latest[found.number] = found
        defined.append(Definition(place, found))
    return defined


def _kinds(
    places: Places, numbers: NDArray[np.uint8], defined: list[Definition]
) -> NDArray[np.int16]:
    """Return the definition of each message, (n,), -1 where there is none.

    A type's first definition counts for messages before it too: the log's head may be lost.
    """
    of_number: dict[int, list[int]] = {}
    for k, one in enumerate(defined):
        of_number.setdefault(one.layout.number, []).append(k)
    first = np.full(256, -1, np.int16)
    for number, ones in of_number.items():
        first[number] = ones[0]
    kinds = first[numbers]
    for number, ones in of_number.items():
        if len(ones) > 1:
            these = np.flatnonzero(numbers == number)
            starts = np.array([defined[k].place for k in ones[1:]], places.dtype)
            latest = np.searchsorted(starts, places[these], side="right")
            kinds[these] = np.array(ones, np.int16)[latest]
    return kinds


def _whole(places: Places, lengths: NDArray[np.int16], size: int) -> NDArray[np.bool_]:
    """Return which marks begin a message, (n,).

    Args:
        places: (n,) of the marks.
        lengths: (n,) bytes of the message that would begin there, 0 if its type isn't known.
        size: of the file, bytes.
    """
    found = np.zeros(places.size, dtype=bool)
    ends = places + lengths
    possible = (lengths > 0) & (ends <= size)
    plain = possible.copy()  # another follows at once
    plain[:-1] &= ends[:-1] == places[1:]
    plain[-1:] = False
    breaks = np.flatnonzero(~plain)
    beyond = dict(zip(breaks.tolist(), np.searchsorted(places, ends[breaks]).tolist()))

    def followed(k: int) -> bool:
        if plain[k]:
            return True
        end, n = int(ends[k]), beyond[k]
        return bool(possible[k]) and (end == size or (n < places.size and int(places[n]) == end))

    k = 0
    for last in breaks.tolist():
        if last < k:
            continue
        found[k:last] = True
        k = last + 1
        if not possible[last]:
            continue
        inside = () if followed(last) else range(last + 1, beyond[last])
        better = next((n for n in inside if followed(n)), None)
        found[last] = better is None
        k = beyond[last] if better is None else better
    return found
