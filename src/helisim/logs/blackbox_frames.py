"""Decodes the frames of a Blackbox log, compiled where this module is imported: to open a log.

Sources: Cleanflight, "Blackbox logging internals"; `blackbox_encoding.c` and `blackbox_fielddefs.h`
of Rotorflight 4.6.0 and Betaflight 2025.12 for what encodings, predictors and events mean.
"""

from typing import Any

import numpy as np
from numba import njit
from numba.extending import register_jitable
from numpy.typing import NDArray

LETTERS = "IPSGHE"  # of frames; a table's number is its letter's place, and E has none
_INTRA, _INTER, _SLOW, _GPS, _HOME, EVENT = range(6)
ZERO, PREVIOUS, LINE, MEAN, MINTHROTTLE, MOTOR_0, INCREMENT, HOME, US_1500, VBATREF, LAST_TIME = (
    range(11)
)
MINMOTOR, HOME_1 = 11, 12  # the latter as HOME, of the longitude
_LAST, _FURTHER = np.array([[0, 1, 2] + [0] * 10, [0, 0, -1] + [0] * 10])
"""Predictor -> times the number before, and the one before that, which it adds."""
_SIGNED, _UNSIGNED, _NEGATIVE_14, _TAG8_8SVB, _TAG8_4S16, _NULL, _TAG2_3SVARIABLE = (
    0, 1, 3, 6, 8, 9, 10,
)  # fmt: skip
ENCODINGS = {0: 1, 1: 1, 3: 1, 6: 1, 7: 3, 8: 4, 9: 1, 10: 3}
"""Encoding -> how many fields it encodes together, or more."""
_PACKED = np.array(
    [
        [[(2, 2), (4, 2), (6, 2)], [(4, 4), (8, 4), (12, 4)], [(2, 6), (10, 6), (18, 6)]],
        [[(2, 2), (4, 2), (6, 2)], [(2, 5), (7, 5), (12, 4)], [(2, 8), (10, 7), (17, 7)]],
    ]
)
"""First bit and width of three fields, of TAG2_3S32 and TAG2_3SVARIABLE, by the tag's two bits."""
_WIDTHS = np.array([0, 4, 8, 16])  # bits of TAG8_4S16's fields
ADJUSTED, RESUMED, TEXT, ENDED = 13, 14, 101, 255
_NUMBERS = np.full(256, -1)  # event -> unsigned numbers in it
_NUMBERS[[0, RESUMED, 15, 30, 40, 50, 51, 52]] = 1, 2, 1, 2, 1, 1, 1, 1
_END = np.frombuffer(b"End of log", np.uint8)
_LONGEST = 10_000_000  # us from one frame to the next, beyond which its stamp isn't believed
_BROKEN = -1  # in place of where the next byte is

Bytes = NDArray[np.uint8]
Numbers = NDArray[np.int64]
_part: Any = register_jitable(
    error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True, _nrt=False
)


COUNTS = (
    *("main", "slow", "gps", "events", "corrupt", "unfounded", "unbelieved", "skipped", "last"),
    "ended",
)
"""What is counted: frames and events that are kept; places where no whole frame is; frames without
the one that they build on, and those whose time or number jumps; bytes of no frame; what is behind
the last frame; whether the log says that it ends."""
_CORRUPT, _UNFOUNDED, _UNBELIEVED, _SKIPPED = 4, 5, 6, 7  # places in it


@_part
def _extended(value: Any, bits: Any) -> Any:
    """Return the lowest bits of a number, of which there is one or more, as a signed one."""
    half = np.int64(1) << (bits - 1)
    return ((value & ((np.int64(1) << bits) - 1)) ^ half) - half


@_part
def _unsigned(data: Bytes, at: Any) -> Any:
    """Return a number of seven bits a byte, and where the next one is."""
    value = np.int64(0)
    for k in range(5):
        byte = np.int64(data[at + k])
        value |= (byte & 127) << (7 * k)
        if byte < 128:
            return value & 0xFFFFFFFF, at + k + 1
    return np.int64(0), np.int64(_BROKEN)


@_part
def _signed(data: Bytes, at: Any) -> Any:
    value, at = _unsigned(data, at)
    return (value >> 1) ^ -(value & 1), at


@_part
def _bits(data: Bytes, place: Any, width: Any) -> Any:
    """Return a signed number of so many bits, the highest first."""
    value = np.int64(0)
    for k in range(place, place + width):
        value = (value << 1) | (np.int64(data[k >> 3]) >> (7 - (k & 7)) & 1)
    return _extended(value, max(width, 1))


@_part
def _bytes(data: Bytes, at: Any, count: Any) -> Any:
    """Return a signed number of so many bytes, the lowest first."""
    value = np.int64(0)
    for k in range(count):
        value |= np.int64(data[at + k]) << (8 * k)
    return _extended(value, 8 * count)


@_part
def _group(data: Bytes, at: Any, code: Any, size: Any, found: Numbers) -> Any:
    """Read the numbers that an encoding has together, (8,); return where the next byte is."""
    tag = np.int64(data[at])
    if code == _TAG8_8SVB:
        tag = tag if size > 1 else np.int64(1)  # which one alone doesn't have
        at = at + (size > 1) if not tag >> size else np.int64(_BROKEN)
        for k in range(size):
            there = tag >> k & 1 and at >= 0
            found[k], at = _signed(data, at) if there else (np.int64(0), at)
        return at
    if code == _TAG8_4S16:
        first = 8 * at + 8
        for k in range(4):
            width = _WIDTHS[tag >> (2 * k) & 3]
            found[k] = _bits(data, first, width)
            first += width
        return (first + 7) // 8
    if tag >> 6 < 3:
        for k in range(3):
            place = _PACKED[int(code == _TAG2_3SVARIABLE), tag >> 6, k]
            found[k] = _bits(data, 8 * at + place[0], place[1])
        return at + (tag >> 6) + 1
    at += 1
    for k in range(3):
        size = (tag >> (2 * k) & 3) + 1
        found[k] = _bytes(data, at, size)
        at += size
    return at


@_part
def _frame(
    data: Bytes,
    at: Any,
    stop: Any,
    fields: NDArray[np.int32],
    count: Any,
    history: Numbers,
    known: Numbers,
    group: Numbers,
    found: Numbers,
) -> Any:
    """Read a frame's fields, (3, n_field): signs, predictors and encodings.

    `history` are the numbers before, and before them, (2, n_field); `known` are what predictors
    other than these add; `group` is memory for (8,) numbers. Returns where the next frame is.
    """
    k = 0
    while k < count and 0 <= at <= stop:
        code, size = fields[2, k], 1
        while code == _TAG8_8SVB and size < min(8, count - k) and fields[2, k + size] == code:
            size += 1
        if code == _NULL:
            group[0] = 0
        elif code == _SIGNED:
            group[0], at = _signed(data, at)
        elif code <= _NEGATIVE_14:
            value, at = _unsigned(data, at)
            group[0] = value if code == _UNSIGNED else -_extended(value, 14)
        else:
            at = _group(data, at, code, size, group)
            size = size if code == _TAG8_8SVB else 4 if code == _TAG8_4S16 else 3
        for one in range(k, k + size):
            predictor, last, further = fields[1, one], history[0, one], history[1, one]
            value = group[one - k] + known[predictor]
            value += _LAST[predictor] * last + _FURTHER[predictor] * further
            if predictor == MEAN:  # rounded toward zero
                value += (last + further + (last + further < 0)) >> 1
            elif predictor == MOTOR_0:
                value += found[known[-1]]
            found[one] = _extended(value, 32) if fields[0, one] else value & 0xFFFFFFFF
        k += size
    return at


@_part
def _kept(rows: NDArray[np.int16], row: Any, found: Numbers, size: Any) -> None:
    """Keep a frame's numbers in two halves, of which the higher is mostly never written."""
    for k in range(size):
        low = _extended(found[k], 16)
        rows[0, k, row] = low
        if found[k] != low:
            rows[1, k, row] = _extended((found[k] - low) >> 16, 16)


@_part
def _event(data: Bytes, at: Any, found: NDArray[np.float64]) -> Any:
    """Read an event's kind and up to two numbers; return where the next frame is."""
    kind, at = np.int64(data[at]), at + 1
    found[0], found[2], found[3] = kind, 0.0, 0.0
    if kind == ENDED:
        for k in range(_END.size):
            if data[at + k] != _END[k]:
                return np.int64(_BROKEN)
        return at + _END.size + (data[at + _END.size] == 0)
    if kind == ADJUSTED:
        found[2], at = np.int64(data[at]), at + 1
        # an integer, or the bits of a float
        found[3], at = _signed(data, at) if found[2] < 128 else (_bytes(data, at, 4), at + 4)
        return at
    if kind in (100, TEXT):
        found[2], found[3] = at + 1, np.int64(data[at])
        return at + 1 + np.int64(data[at])
    for k in range(_NUMBERS[kind]):
        if at >= 0:
            found[2 + k], at = _unsigned(data, at)
    return at if _NUMBERS[kind] > 0 else np.int64(_BROKEN)


@_part
def _ahead(iteration: Any, every: Numbers) -> Any:
    """Return the next iteration that is logged."""
    if every[1] == 1:
        begun = iteration % every[0]
        return iteration - begun + min((begun // every[2] + 1) * every[2], every[0])
    iteration += 1
    while (iteration % every[0] + every[1] - 1) % every[2] >= every[1]:
        iteration += 1
    return iteration


def _decode(
    data: Bytes,
    stop: int,
    letters: Numbers,
    tables: NDArray[np.int32],
    sizes: Numbers,
    known: Numbers,
    every: Numbers,
    places: Numbers,
    rows: tuple[NDArray[np.int16], NDArray[np.int16], NDArray[np.int16]],
    times: tuple[Numbers, Numbers, Numbers],
    events: NDArray[np.float64],
    counts: Numbers,
) -> None:
    """Decode frames into main, slow and GPS `rows`, their `times` in us, `events` and `counts`.

    `rows` are (2, n_field, n_time), 0 before: 16 bits with a sign, and what is 2^16 times as much.
    Frames end at `stop`, and 64 more bytes may be read. `letters`, (256,), is byte -> table, or -1;
    `tables` are (5, 3, n_field): signs, predictors and encodings of main frames, whole and by
    differences, slow, GPS and home ones, of whose fields there are `sizes`; `known`, (14,), is
    predictor -> number, the last the place of motor[0]; `every` is (3,): iterations from an I frame
    to the next, and how many of how many are logged; `places` are those of loopIteration, time and
    GPS's time. An event is a kind, the last time, us, and two numbers.
    """
    history, group = np.zeros((2, tables.shape[2]), np.int64), np.zeros(8, np.int64)
    found = np.zeros(tables.shape[2], np.int64)
    at, last, ended = np.int64(0), np.int64(0), False
    valid, homed, begun, whole = False, False, False, True
    time, iteration = np.int64(0), np.int64(0)  # of the last frame that is believed
    doubted_time, doubted_iteration = np.int64(-1), np.int64(-1)  # of an I frame that isn't yet
    while at < stop and not ended:
        kind, behind, event = letters[data[at]], np.int64(_BROKEN), counts[3]
        if kind == EVENT:
            behind = _event(data, at + 1, events[event])
            ended = 0 <= behind <= stop and events[event, 0] == ENDED
        elif kind >= 0:
            known[INCREMENT] = _ahead(iteration, every)
            fields, size = tables[kind], sizes[kind]
            behind = _frame(data, at + 1, stop, fields, size, history, known, group, found)
        if not (0 <= behind <= stop and (behind == stop or ended or letters[data[behind]] >= 0)):
            counts[_CORRUPT] += whole
            whole = valid = False
            at += 1
            continue
        counts[_SKIPPED] += at - last
        last, at, whole = behind, behind, True
        if kind == EVENT:
            if events[event, 0] == RESUMED:
                iteration = np.int64(events[event, 2])
                time += _extended(np.int64(events[event, 3]) - time, 32)
                valid, doubted_time = False, np.int64(-1)
            events[event, 1] = time
            counts[3] += 1
        elif kind == _HOME:
            homed, known[HOME], known[HOME_1] = True, found[0], found[1]
        elif kind == _SLOW or (kind == _GPS and homed and begun):
            of, row = kind - 1, counts[kind - 1]
            _kept(rows[of], row, found, sizes[kind])
            later = found[places[2]] - time if kind == _GPS and places[2] >= 0 else np.int64(0)
            times[of][row] = time + _extended(later, 32)
            counts[of] += 1
        elif kind == _GPS or (kind == _INTER and not valid):
            counts[_UNFOUNDED] += 1
        else:
            stamp, number, row = found[places[1]], found[places[0]], counts[0]
            step = _extended(stamp - time, 32)
            valid = not begun or (0 <= step < _LONGEST and number >= iteration)
            if kind == _INTRA and not valid:  # two in a row that agree are believed
                later = _extended(stamp - doubted_time, 32)
                valid = doubted_time >= 0 and 0 < later < _LONGEST and number > doubted_iteration
                doubted_time, doubted_iteration = stamp, number
            if not valid:
                counts[_UNBELIEVED] += 1
                continue
            time = time + step if begun else stamp
            iteration, begun, doubted_time = number, True, np.int64(-1)
            known[LAST_TIME] = time & 0xFFFFFFFF
            for k in range(sizes[_INTRA]):
                history[1, k] = history[0, k] if kind == _INTER else found[k]
                history[0, k] = found[k]
            _kept(rows[0], row, found, sizes[_INTRA])
            times[0][row] = time
            counts[0] += 1
    counts[8], counts[9] = last, ended


try:
    decode = njit(_decode, cache=True, error_model="numpy")
except RuntimeError:  # no place for a cache
    decode = njit(_decode, error_model="numpy")
