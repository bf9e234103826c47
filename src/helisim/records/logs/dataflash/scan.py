"""Finds the messages of a DataFlash log, also between bytes that are none.

A message is two marks, its type's number, and as many bytes as the type's FMT message says; nothing
in it says that it is whole. One that no other follows is left out where another begins inside of
it that one does follow: then some of its bytes were lost.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.errors import StorageError
from helisim.records.logs.dataflash.layout import FMT_LENGTH, FMT_NUMBER, HEADER, Layout, layout

MARKS = b"\xa3\x95"
_WINDOW = 4 << 20
"""Bytes that are in memory at a time: the log itself never is."""

Read = Callable[[int, int], NDArray[np.uint8]]
"""Returns the bytes of a file from a place to another, (n_byte,)."""


class Definition(NamedTuple):
    """An FMT message, and its place."""

    place: int
    layout: Layout


class Scan(NamedTuple):
    """Where the messages of a log are.

    Attributes:
        places: (n_message,) bytes from the file's start, increasing.
        kinds: (n_message,) which of the definitions a message has.
        definitions: of the log, in its order; a type that is defined anew is another one.
        used: bytes of all messages.
    """

    places: NDArray[np.int64]
    kinds: NDArray[np.uint16]
    definitions: tuple[Definition, ...]
    used: int


def windows(
    read: Read, places: NDArray[np.int64], length: int
) -> Iterator[tuple[slice, NDArray[np.int64], NDArray[np.uint8]]]:
    """Return messages of one length piece by piece: which, where in the piece, and its bytes.

    Args:
        read: the file.
        places: (n_message,) where they begin, increasing.
        length: of each, bytes.
    """
    first = 0
    while first < places.size:
        start = int(places[first])
        last = int(np.searchsorted(places, start + _WINDOW, side="left"))
        yield (
            slice(first, last),
            places[first:last] - start,
            read(start, int(places[last - 1]) + length),
        )
        first = last


def file_reader(path: Path, size: int) -> Read:
    """Return a function that reads a file piece by piece. It raises StorageError."""

    def read(start: int, stop: int) -> NDArray[np.uint8]:
        try:
            with path.open("rb", buffering=0) as file:
                found = np.fromfile(file, np.uint8, stop - start, offset=start)
        except OSError as error:
            raise StorageError(f"{path}: can't read it: {error.strerror}") from None
        if found.size != stop - start:
            raise StorageError(f"{path}: was {size} bytes long, and became shorter while it's read")
        return found

    return read


def scan(read: Read, size: int) -> Scan:
    """Find the messages of a binary log of `size` bytes."""
    places, numbers = _marks(read, size)
    defined = _definitions(read, size, places[numbers == FMT_NUMBER])
    while True:
        kinds, lengths = _kinds(places, numbers, defined)
        whole = _whole(places, np.where(lengths > 0, lengths, 0), size)
        believed = set(places[whole & (numbers == FMT_NUMBER)].tolist()) | {-1}
        kept = [one for one in defined if one.place in believed]
        if len(kept) == len(defined):
            used = int(np.sum(lengths[whole]))
            return Scan(places[whole], kinds[whole].astype(np.uint16), tuple(defined), used)
        defined = kept


def _marks(read: Read, size: int) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
    """Return where messages may begin, (n,), and the numbers of their types, (n,)."""
    places, numbers = [], []
    for start in range(0, size - HEADER + 1, _WINDOW):
        data = read(start, min(size, start + _WINDOW + HEADER - 1))
        found = np.flatnonzero(data[: 1 - HEADER] == MARKS[0])
        found = found[data[found + 1] == MARKS[1]]
        places.append(found + start)
        numbers.append(data[found + 2])
    if not places:
        return np.empty(0, np.int64), np.empty(0, np.uint8)
    return np.concatenate(places), np.concatenate(numbers)


def _definitions(read: Read, size: int, places: NDArray[np.int64]) -> list[Definition]:
    """Return what the log's FMT messages say, each where it differs from the one before."""
    first = layout(FMT_NUMBER, FMT_LENGTH, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
    assert first is not None
    defined, latest = [Definition(-1, first)], {FMT_NUMBER: first}
    for place in places[places + FMT_LENGTH <= size].tolist():
        data = read(place, place + FMT_LENGTH).tobytes()
        found = layout(data[3], data[4], data[5:9], data[9:25], data[25:89])
        if found is None or latest.get(found.number) == found or found.number == FMT_NUMBER:
            continue
        latest[found.number] = found
        defined.append(Definition(place, found))
    return defined


def _kinds(
    places: NDArray[np.int64], numbers: NDArray[np.uint8], defined: list[Definition]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the definition of each message, (n,), -1 where there is none, and its length, (n,).

    A type's first definition counts for messages before it too: the log's head may be lost.
    """
    of_number: dict[int, list[int]] = {}
    for k, one in enumerate(defined):
        of_number.setdefault(one.layout.number, []).append(k)
    first = np.full(256, -1)
    for number, ones in of_number.items():
        first[number] = ones[0]
    kinds = first[numbers]
    for number, ones in of_number.items():
        if len(ones) > 1:
            these = np.flatnonzero(numbers == number)
            starts = [defined[k].place for k in ones[1:]]
            kinds[these] = np.array(ones)[np.searchsorted(starts, places[these], side="right")]
    lengths = np.array([*(one.layout.length for one in defined), 0])
    return kinds, lengths[kinds]


def _whole(places: NDArray[np.int64], lengths: NDArray[np.int64], size: int) -> NDArray[np.bool_]:
    """Return which marks begin a message, (n,).

    Args:
        places: (n,) of the marks.
        lengths: (n,) bytes of the message that would begin there, 0 if its type isn't known.
        size: of the file, bytes.
    """
    found = np.zeros(places.size, dtype=bool)
    ends = places + lengths
    possible = (lengths > 0) & (ends <= size)
    after = np.append(places[1:], size)
    plain = possible & (ends == after)
    breaks = np.append(np.flatnonzero(~plain), places.size)
    following = {}  # of the few that the next mark doesn't follow
    for k, place in zip(breaks[:-1].tolist(), np.searchsorted(places, ends[breaks[:-1]]).tolist()):
        following[k] = place

    def followed(k: int) -> bool:
        if plain[k]:
            return True
        end, n = int(ends[k]), following[k]
        return bool(possible[k]) and (end == size or (n < places.size and int(places[n]) == end))

    k, stop = 0, iter(breaks.tolist())
    last = next(stop)
    while k < places.size:
        while last < k:
            last = next(stop)
        found[k:last] = True
        if last == places.size:
            break
        if not possible[last]:
            k = last + 1
            continue
        beyond = following[last]
        inside = () if followed(last) else range(last + 1, beyond)
        better = next((n for n in inside if followed(n)), None)
        found[last] = better is None
        k = beyond if better is None else better
    return found
