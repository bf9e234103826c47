"""Control laws of the process: a table of function pointers that the compiled callbacks read.

A vehicle's numbers name a law by its handle, and the process that knows it by a token, so a model
that comes from elsewhere, or outlives its law, is refused and calls nothing. What is called is

    void law(double *seen, double *state, double *settings, double *commands)

with `Seen` and one number more, 1 at a law's first tick and otherwise 0; it writes the commands of
its servos among front, left, right and tail. One that is not finite ends the law, and is kept here
with what the law saw.
"""

import os
import threading

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.physics.gyro import Seen
from helisim.physics.kernel import kernel
from helisim.physics.memory import address_of, doubles_at, longs_at

SEEN = len(Seen._fields)
"""How many numbers a law sees; behind them stands whether it starts."""
COMMANDS = 4
_ROWS = 1 << 20
_WIDTH = 8
_HANDLE, _FUNCTION, _SETTINGS, _STATES, _FAILED, _KEPT = range(6)
"""What a row holds: handle, addresses of law and settings, states, whether and where it failed.

Row 0 holds the token in place of a handle.
"""

_table = np.zeros((_ROWS, _WIDTH), dtype=np.int64)  # its memory is taken as it is used
_table[0, _HANDLE] = int.from_bytes(os.urandom(6), "little") | 1
_address = address_of("helisim_laws", _table.ctypes.data)
_lock = threading.Lock()
_free: list[int] = []
_used = [0, 1]
"""How many laws there were, and the first row that never had one."""


@intrinsic
def _call(typingctx, function, seen, state, settings, commands):
    """Call a law by its address."""
    del typingctx

    def codegen(context, builder, signature, args):
        del context, signature
        kind = ir.FunctionType(ir.VoidType(), [one.type for one in args[1:]])
        builder.call(builder.inttoptr(args[0], kind.as_pointer()), args[1:])

    return types.void(function, seen, state, settings, commands), codegen


@kernel()
def row_of(handle, token, states):
    """Return the address of a law's row; 0 for none, or one of another process, or other states."""
    table = _address()
    row = table + 8 * _WIDTH * (np.int64(handle) % _ROWS)
    known = token == longs_at(table)[_HANDLE] and row != table
    known = known and handle == longs_at(row)[_HANDLE]
    if known and states == longs_at(row)[_STATES]:
        return row
    return 0


@kernel()
def ask(row, seen, state, states, commands, first, last):
    """Ask a law for its commands; return whether they and its state are finite.

    Args:
        row: address of its row.
        seen: what it sees, and whether it starts, (19,).
        state: of the law, (n_state,), moved on to the next tick.
        states: n_state.
        commands: of the four servos, (4,), written.
        first: the first command that counts.
        last: the last.
    """
    about = longs_at(row)
    before = doubles_at(about[_KEPT] + 8 * (SEEN + 1 + COMMANDS))
    failed = about[_FAILED] != 0
    if not failed:
        for k in range(states):
            before[k] = state[k]
    for k in range(first, last + 1):
        commands[k] = np.nan
    _call(about[_FUNCTION], seen, state, doubles_at(about[_SETTINGS]), commands)
    total = 0.0
    for k in range(first, last + 1):
        total += abs(commands[k])
    for k in range(states):
        total += abs(state[k])
    if total < np.inf:
        return True
    if not failed:
        kept = doubles_at(about[_KEPT])
        for k in range(SEEN + 1):
            kept[k] = seen[k]
        for k in range(COMMANDS):
            kept[SEEN + 1 + k] = commands[k]
        about[_FAILED] = 1
    return False


class Row:
    """A law's place in the table, which is its own until `release`.

    It is taken for the address of a law, its settings, (n_settings,), and how many states it has.

    Attributes:
        handle: by which a vehicle's numbers name it.

    Raises:
        InputError: there are too many laws.
    """

    def __init__(self, function: int, settings: NDArray[np.float64], states: int) -> None:
        self._settings = np.ascontiguousarray(settings, dtype=np.float64)
        self._kept = np.zeros(SEEN + 1 + COMMANDS + states)
        with _lock:
            if not _free and _used[1] == _ROWS:
                raise InputError(
                    f"this process has {_ROWS} control laws; there is room for no more"
                )
            if not _free:
                _free.append(_used[1])
                _used[1] += 1
            self._index = _free.pop()
            _used[0] += 1
            self.handle = _used[0] * _ROWS + self._index
            row = _table[self._index]
            row[_FUNCTION], row[_SETTINGS] = function, self._settings.ctypes.data
            row[_STATES], row[_FAILED], row[_KEPT] = states, 0, self._kept.ctypes.data
            row[_HANDLE] = self.handle

    def failed(self) -> tuple[Seen, NDArray[np.float64], NDArray[np.float64]] | None:
        """Return what the law saw, its state before and its commands (4,) where it failed.

        The state is (n_state,). None if it didn't fail, or not since this was asked.
        """
        row = _table[self._index]
        if row[_HANDLE] != self.handle or not row[_FAILED]:
            return None
        numbers = self._kept.copy()
        row[_FAILED] = 0
        state = numbers[SEEN + 1 + COMMANDS :]
        return Seen(*numbers[:SEEN].tolist()), state, numbers[SEEN + 1 : SEEN + 1 + COMMANDS]

    def release(self) -> None:
        """Give the row back; whoever still names it is refused."""
        with _lock:
            if _table[self._index, _HANDLE] == self.handle:
                _table[self._index, _HANDLE] = 0
                _free.append(self._index)


def token() -> int:
    """Return the number by which a vehicle's numbers name this process."""
    return int(_table[0, _HANDLE])
