"""Control laws of helisim itself: compiled once for all their settings, and kept on disk."""

import hashlib
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from numba import cfunc, types

from helisim.physics.gyro import Seen
from helisim.physics.native import fingerprint

_POINTER = types.CPointer(types.float64)
_SIGNATURE = types.void(_POINTER, _POINTER, _POINTER, _POINTER)


@dataclass(frozen=True)
class KnownLaw:
    """A law of all servos whose functions are kernels at the top of modules.

    Attributes:
        function: of (seen, state, settings); returns front, left, right and tail.
        reset: called likewise where the law starts; it returns nothing.
    """

    function: Callable[..., Any]
    reset: Callable[..., Any]

    def __call__(self, seen: Seen, state: Any, settings: Any) -> Any:
        """Return the commands; the state, (n_state,), moves on. In Python."""
        return self.function(seen, state, settings)

    @property
    def native(self) -> Any:
        """The law as a numba.cfunc, which doesn't look at its indices."""
        return _native(self.function, self.reset)


@cache
def _native(function: Any, reset: Any) -> Any:
    """Return a law compiled, by the code on disk where that is of the same sources."""
    digest = hashlib.sha256(str(fingerprint()).encode())
    for one in (function, reset):
        digest.update(Path(inspect.getfile(one)).read_bytes())
    mark = int.from_bytes(digest.digest()[:7], "little")
    try:
        return _compile(function, reset, mark, cached=True)
    except RuntimeError as error:
        if "cache" not in str(error):
            raise
        return _compile(function, reset, mark, cached=False)


def _compile(function: Any, reset: Any, mark: int, *, cached: bool) -> Any:
    @cfunc(_SIGNATURE, cache=cached)
    def native(at, state, settings, commands):
        seen = Seen(
            at[0],
            at[1],
            at[2],
            at[3],
            at[4],
            at[5],
            at[6],
            at[7],
            at[8],
            at[9],
            at[10],
            at[11],
            at[12],
            at[13],
            at[14],
            at[15],
            at[16],
            at[17],
        )
        if at[18] != 0.0 and mark != 0:
            reset(seen, state, settings)
        commands[0], commands[1], commands[2], commands[3] = function(seen, state, settings)

    return native
