"""Fields of messages as a log stores them: binary messages, or lines of text."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from helisim.base.errors import StorageError
from helisim.logs.dataflash.layout import Field, Layout
from helisim.logs.dataflash.scan import WINDOW, Places, Read


class Part(NamedTuple):
    """Messages of one layout.

    Attributes:
        layout: that they have.
        places: (n_message,) where they begin in the file, increasing.
    """

    layout: Layout
    places: Places


Wanted = Sequence[tuple[Part, Sequence[Field]]]
"""Fields of each of several parts."""


class Store(Protocol):
    """What holds a log's messages."""

    def raw(self, wanted: Wanted) -> list[list[NDArray]]:
        """Return the fields of each part, each (n_message,) or (n_message, n_number)."""
        ...


class BinaryStore:
    """Messages in a binary file, of which a few megabytes are in memory at a time."""

    def __init__(self, read: Read) -> None:
        self._read = read

    def raw(self, wanted: Wanted) -> list[list[NDArray]]:
        """Return the fields of each part, in one pass through the file. Raises StorageError."""
        found = [[_empty(one, part.places.size) for one in fields] for part, fields in wanted]
        for pieces, data in self._windows([part for part, _ in wanted]):
            for (which, at), (_, fields), columns in zip(pieces, wanted, found):
                for field, values in zip(fields, columns):
                    stored = sliding_window_view(data, field.size)[at + field.offset]
                    values[which] = stored.view(field.kind)
        return [
            [values if one.count > 1 else values[:, 0] for one, values in zip(fields, columns)]
            for (_, fields), columns in zip(wanted, found)
        ]

    def _windows(
        self, parts: Sequence[Part]
    ) -> Iterator[tuple[list[tuple[slice, NDArray[np.int64]]], NDArray[np.uint8]]]:
        """Yield which messages of each part are in a piece of the file, where in it, and it."""
        done = [0] * len(parts)
        while True:
            ahead = [int(one.places[k]) for one, k in zip(parts, done) if k < one.places.size]
            if not ahead:
                return
            start = min(ahead)
            stop = [
                int(np.searchsorted(one.places, one.places.dtype.type(start + WINDOW)))
                for one in parts
            ]
            end = max(
                int(one.places[k - 1]) + one.layout.length for one, k in zip(parts, stop) if k
            )
            pieces = [
                (slice(a, b), one.places[a:b].astype(np.int64) - start)
                for one, a, b in zip(parts, done, stop)
            ]
            yield pieces, self._read(start, end)
            done = stop


def _empty(field: Field, count: int) -> NDArray:
    return np.empty((count, field.count), field.kind)


def file_reader(path: Path) -> Read:
    """Return a function that reads a file piece by piece, as long as it stays what it is now.

    It raises StorageError.
    """
    known = _version(path)

    def read(start: int, stop: int) -> NDArray[np.uint8]:
        try:
            with path.open("rb", buffering=0) as file:
                found = np.fromfile(file, np.uint8, stop - start, offset=start)
        except OSError as error:
            raise StorageError(f"{path}: can't read it: {error.strerror}") from None
        if found.size != stop - start or _version(path) != known:
            raise StorageError(f"{path}: was written to while it was read; read it again")
        return found

    return read


def _version(path: Path) -> tuple[int, ...]:
    try:
        state = path.stat()
    except OSError as error:
        raise StorageError(f"{path}: can't read it: {error.strerror}") from None
    return state.st_ino, state.st_size, state.st_mtime_ns
