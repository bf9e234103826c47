"""What compiled callbacks note of a model, in memory of the process, to be said in Python later.

Nothing can be raised inside a callback: MuJoCo called it. So it leaves a note, the first of each
kind, with names copied out of mjModel, which may be gone when somebody reads it.
"""

import ctypes
from dataclasses import dataclass

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from helisim.physics.kernel import kernel
from helisim.physics.memory import address_of, bytes_at, doubles_at, ints, long, longs_at

REFUSED, FOREIGN, OVERWRITTEN = range(3)
"""Kinds of note: a vehicle that can't fly as it is, actuators of others, overwritten commands."""

_FREE, _WRITING, _WRITTEN = range(3)
_NAME = 64
"""Bytes kept of a name, its end among them."""
_STATE, _CODE, _FOUND, _WANTED, _MODEL, _ELEMENT = 0, 8, 16, 24, 32, 32 + _NAME
_NOTE = _ELEMENT + _NAME
_NOTES = 3 * _NOTE
_KNOWN = 256
"""Models that are remembered as met or examined, by a number of their own."""
_GOLDEN = 0x9E3779B1
"""Odd, 2^32 over the golden mean (Knuth's multiplicative hash)."""
_SLOTS, _SLOT = 256, 128
"""Vehicles in flight of which something is kept from tick to tick, and the bytes of each."""
_FIRST_SLOT = _NOTES + 8 * _KNOWN

_memory = globals().get("_memory") or (ctypes.c_int64 * ((_FIRST_SLOT + _SLOTS * _SLOT) // 8))()
"""A module that is loaded again finds the notes of the code that is running."""
_address = address_of("helisim_notes", ctypes.addressof(_memory))


@intrinsic
def _claimed(typingctx, state):
    """Return whether the number was `_FREE` and is `_WRITING` now, for one thread only."""
    del typingctx

    def codegen(context, builder, signature, args):
        del context, signature
        free, writing = (ir.Constant(ir.IntType(64), one) for one in (_FREE, _WRITING))
        swapped = builder.cmpxchg(args[0], free, writing, "seq_cst", "seq_cst")
        return builder.extract_value(swapped, 1)

    return types.boolean(state), codegen


@kernel()
def note(kind, code, m, offsets, names, element, found, wanted):
    """Leave a note, unless there is one of its kind.

    Args:
        kind: one of the kinds above.
        code: what is said about it.
        m: address of mjModel.
        offsets: of its fields.
        names: offset of the field that holds where names of such elements start.
        element: number of the element in mjModel, negative for none.
        found: a number that is there.
        wanted: the number that should be.
    """
    here = _address() + kind * _NOTE
    if not _claimed(longs_at(here + _STATE)):
        return
    longs_at(here + _CODE)[0] = code
    doubles_at(here + _FOUND)[0] = found
    doubles_at(here + _WANTED)[0] = wanted
    _copy_name(here + _MODEL, m, offsets, 0)
    bytes_at(here + _ELEMENT)[0] = 0
    if element >= 0:
        _copy_name(here + _ELEMENT, m, offsets, ints(m, names)[element])
    longs_at(here + _STATE)[0] = _WRITTEN


@kernel()
def _copy_name(there, m, offsets, start):
    source, target = bytes_at(long(m, offsets.names) + start), bytes_at(there)
    for k in range(_NAME - 1):
        target[k] = source[k]
        if source[k] == 0:
            return
    target[_NAME - 1] = 0


@kernel()
def is_due(number, time, step):
    """Return whether a model is to be examined now: once in a block, when it is flown.

    MuJoCo takes a step from time 0 when it compiles a model. That is no flight yet, so a model is
    due when it starts for the second time, or goes on.

    Args:
        number: of the model, odd.
        time: s.
        step: length of a step, s.
    """
    place = longs_at(_address() + _NOTES + 8 * _spread(number >> 1))
    if place[0] == number:
        return False
    if time <= step:
        met = number - 1
        if place[0] != met:
            place[0] = met
            return False
        if time > 0.0:
            return False
    place[0] = number
    return True


@kernel()
def slot(number):
    """Return the address of the 128 bytes that things of this number share."""
    return _address() + _FIRST_SLOT + _SLOT * _spread(number)


@kernel()
def _spread(number):
    """Return 0 to 255, by all digits of a number: addresses of two threads end alike."""
    return (((number ^ (number >> 31)) & 0x7FFFFFFF) * _GOLDEN >> 24) & 0xFF


@dataclass(frozen=True)
class Note:
    """A note that a callback left.

    Attributes:
        kind: one of the kinds above.
        code: what is said about it.
        model: its name.
        element: name of the element, "" if it has none or there is none.
        found: a number that is there.
        wanted: the number that should be.
    """

    kind: int
    code: int
    model: str
    element: str
    found: float
    wanted: float


def taken() -> list[Note]:
    """Return the notes that were left, and forget them."""
    notes = []
    for kind in range(_NOTES // _NOTE):
        here = ctypes.addressof(_memory) + kind * _NOTE
        state = ctypes.c_int64.from_address(here + _STATE)
        if state.value != _WRITTEN:
            continue
        found, wanted = ((ctypes.c_double).from_address(here + at) for at in (_FOUND, _WANTED))
        notes.append(
            Note(
                kind,
                ctypes.c_int64.from_address(here + _CODE).value,
                _text(here + _MODEL),
                _text(here + _ELEMENT),
                found.value,
                wanted.value,
            )
        )
        state.value = _FREE
    return notes


def forget_models() -> None:
    """Let every model be new again."""
    ctypes.memset(ctypes.addressof(_memory) + _NOTES, 0, 8 * _KNOWN)


def _text(address: int) -> str:
    return ctypes.string_at(address).decode("utf-8", "replace")
