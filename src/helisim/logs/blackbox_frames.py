"""Decodes the frames of a Blackbox log, compiled when this module is imported: only to open a log.

Sources: Cleanflight, "Blackbox logging internals"; `blackbox_encoding.c` and `blackbox_fielddefs.h`
of Rotorflight 4.6.0 and Betaflight 2025.12 for what encodings, predictors and events mean.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numba.extending import register_jitable
from numpy.typing import NDArray

LETTERS = "IPSGHE"  # of frames; a table's number is its letter's place, and E has none
_INTRA, _INTER, _SLOW, _GPS, _HOME, EVENT = range(6)
ZERO, PREVIOUS, LINE, MEAN, MINTHROTTLE, MOTOR_0, INCREMENT, HOME, US_1500, VBATREF, LAST_TIME = (
    range(11)
)
MINMOTOR = 11
HOME_1 = 12  # as HOME, of the longitude
SIGNED, UNSIGNED, NEGATIVE_14 = 0, 1, 3
TAG8_8SVB, TAG2_3S32, TAG8_4S16, NULL, TAG2_3SVARIABLE = 6, 7, 8, 9, 10
ENCODINGS = {
    **{SIGNED: 1, UNSIGNED: 1, NEGATIVE_14: 1, TAG8_8SVB: 1, NULL: 1},
    **{TAG2_3S32: 3, TAG8_4S16: 4, TAG2_3SVARIABLE: 3},
}
"""Encoding -> how many fields it encodes together, or more."""
ADJUSTED, RESUMED, DISARMED, TEXT, ENDED = 13, 14, 15, 101, 255
_LONGEST = 10_000_000  # us from one frame to the next, beyond which its stamp isn't believed
_BROKEN = -1  # in place of where the next byte is
_END = np.frombuffer(b"End of log", np.uint8)

Numbers = NDArray[np.int64]


class Counts(NamedTuple):
    """How many frames and events are kept, and what isn't.

    `corrupt` are places where no whole frame is, `unfounded` frames without the one that they are
    based on, `unbelieved` those whose time or number jumps; `skipped` bytes belong to no frame, and
    `last` is behind the last byte that does.
    """

    main: int
    slow: int
    gps: int
    events: int
    corrupt: int
    unfounded: int
    unbelieved: int
    skipped: int
    last: int
    ended: int


_part = register_jitable(
    error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True, _nrt=False
)


@_part
def _unsigned(data: NDArray[np.uint8], at: int) -> tuple[int, int]:
    value = np.int64(0)
    for k in range(5):
        if at + k >= data.size:
            break
        byte = np.int64(data[at + k])
        value |= (byte & 127) << (7 * k)
        if byte < 128:
            return value & 0xFFFFFFFF, at + k + 1
    return np.int64(0), _BROKEN


@_part
def _signed(data: NDArray[np.uint8], at: int) -> tuple[int, int]:
    value, at = _unsigned(data, at)
    return (value >> 1) ^ -(value & 1), at


@_part
def _extended(value: int, bits: int) -> int:
    """Return the lowest bits of a number as a signed one."""
    half = np.int64(1) << (bits - 1)
    return ((value & ((np.int64(1) << bits) - 1)) ^ half) - half


@_part
def _bytes(data: NDArray[np.uint8], at: int, count: int, little: bool) -> int:
    """Return a number of so many bytes."""
    value = np.int64(0)
    for k in range(count):
        value = (value << 8) | np.int64(data[at + (count - 1 - k if little else k)])
    return value


@_part
def _three(data: NDArray[np.uint8], at: int, varied: bool, found: Numbers) -> int:
    """Read TAG2_3S32 or TAG2_3SVARIABLE."""
    tag = np.int64(data[at]) if at < data.size else np.int64(0)
    kind, count = tag >> 6, (tag >> 6) + 1
    if kind == 3:
        count = 4 + (tag & 3) + (tag >> 2 & 3) + (tag >> 4 & 3)
    if at + count > data.size:
        return _BROKEN
    if kind == 3:
        place = at + 1
        for k in range(3):
            size = (tag >> (2 * k) & 3) + 1
            found[k] = _extended(_bytes(data, place, size, True), 8 * size)
            place += size
        return place
    number = _bytes(data, at, count, False)
    first, second, third, a, b = 2, 2, 2, 4, 2
    if kind == 1:
        first, second, third, a, b = (5, 5, 4, 9, 4) if varied else (4, 4, 4, 8, 4)
    elif kind == 2:
        first, second, third, a, b = (8, 7, 7, 14, 7) if varied else (6, 6, 6, 16, 8)
    found[0] = _extended(number >> a, first)
    found[1] = _extended(number >> b, second)
    found[2] = _extended(number, third)
    return at + count


@_part
def _four(data: NDArray[np.uint8], at: int, found: Numbers) -> int:
    """Read TAG8_4S16: numbers of 0, 4, 8 or 16 bits one after the other, the highest first."""
    if at >= data.size:
        return _BROKEN
    tag, total = np.int64(data[at]), np.int64(0)
    for k in range(4):
        kind = tag >> (2 * k) & 3
        total += 4 << (kind - 1) if kind else 0
    if at + 1 + (total + 7) // 8 > data.size:
        return _BROKEN
    place = np.int64(0)
    for k in range(4):
        kind = tag >> (2 * k) & 3
        width = 4 << (kind - 1) if kind else 0
        value = np.int64(0)
        for n in range(place, place + width, 4):
            byte = np.int64(data[at + 1 + n // 8])
            value = (value << 4) | (byte & 15 if n % 8 else byte >> 4)
        found[k] = _extended(value, width) if width else 0
        place += width
    return at + 1 + (total + 7) // 8


@_part
def _eight(data: NDArray[np.uint8], at: int, count: int, found: Numbers) -> int:
    """Read TAG8_8SVB: numbers other than zero, as the tag's bits say; one alone has no tag."""
    if at >= data.size:
        return _BROKEN
    tag = np.int64(1) if count == 1 else np.int64(data[at])
    at += count > 1
    if tag >> count:
        return _BROKEN
    for k in range(count):
        found[k] = 0
        if tag >> k & 1 and at >= 0:
            found[k], at = _signed(data, at)
    return at


@_part
def _frame(
    data: NDArray[np.uint8],
    at: int,
    fields: NDArray[np.int32],
    count: int,
    history: Numbers,
    known: Numbers,
    group: Numbers,
    found: Numbers,
) -> int:
    """Read a frame's fields, (3, n_field): signs, predictors and encodings.

    `history` are the numbers before, and before them, (2, n_field); `known` are what predictors
    other than these add; `group` is memory for (8,) numbers. Returns where the next frame is.
    """
    k = 0
    while k < count and at >= 0:
        code, size = fields[2, k], 1
        if code == SIGNED:
            group[0], at = _signed(data, at)
        elif code == UNSIGNED:
            group[0], at = _unsigned(data, at)
        elif code == NEGATIVE_14:
            value, at = _unsigned(data, at)
            group[0] = -_extended(value, 14)
        elif code == TAG8_4S16:
            size, at = 4, _four(data, at, group)
        elif code == TAG8_8SVB:
            while size < 8 and k + size < count and fields[2, k + size] == code:
                size += 1
            at = _eight(data, at, size, group)
        elif code == NULL:
            group[0] = 0
        else:
            size, at = 3, _three(data, at, code == TAG2_3SVARIABLE, group)
        for n in range(size):
            one, predictor = k + n, fields[1, k + n]
            value = group[n] + known[predictor]
            if predictor == PREVIOUS:
                value += history[0, one]
            elif predictor == LINE:
                value += 2 * history[0, one] - history[1, one]
            elif predictor == MEAN:  # rounded toward zero
                total = history[0, one] + history[1, one]
                value += (total + (total < 0)) >> 1
            elif predictor == MOTOR_0:
                value += found[known[-1]]
            found[one] = _extended(value, 32) if fields[0, one] else value & 0xFFFFFFFF
        k += size
    return at


@_part
def _event(data: NDArray[np.uint8], at: int, found: NDArray[np.float64]) -> int:
    """Read an event's kind and up to two numbers; return where the next frame is."""
    if at >= data.size:
        return _BROKEN
    kind, at = np.int64(data[at]), at + 1
    found[0], found[2], found[3] = kind, 0.0, 0.0
    if kind == ENDED:
        if at + _END.size > data.size:
            return _BROKEN
        for k in range(_END.size):
            if data[at + k] != _END[k]:
                return _BROKEN
        at += _END.size
        return at + (at < data.size and data[at] == 0)
    if kind == ADJUSTED:
        if at >= data.size:
            return _BROKEN
        found[2], at = np.int64(data[at]), at + 1
        if found[2] < 128:
            found[3], at = _signed(data, at)
            return at
        if at + 4 > data.size:
            return _BROKEN
        found[3] = _bytes(data, at, 4, True)  # of a float
        return at + 4
    if kind in (100, TEXT):
        if at >= data.size or at + 1 + np.int64(data[at]) > data.size:
            return _BROKEN
        found[2], found[3] = at + 1, np.int64(data[at])
        return at + 1 + np.int64(data[at])
    if kind not in (0, RESUMED, DISARMED, 30, 40, 50, 51, 52):
        return _BROKEN
    found[2], at = _unsigned(data, at)
    if kind in (RESUMED, 30) and at >= 0:
        found[3], at = _unsigned(data, at)
    return at


@_part
def _keep(found: Numbers, size: int, rows: NDArray[np.int32], row: int) -> None:
    """Keep a frame's numbers, their lowest 32 bits."""
    for k in range(size):
        rows[row, k] = _extended(found[k], 32)


@_part
def _ahead(iteration: int, every: Numbers) -> int:
    """Return the next iteration that is logged."""
    if every[1] == 1:
        begun = iteration % every[0]
        return iteration - begun + min((begun // every[2] + 1) * every[2], every[0])
    iteration += 1
    while (iteration % every[0] + every[1] - 1) % every[2] >= every[1]:
        iteration += 1
    return iteration


def _decode(
    data: NDArray[np.uint8],
    letters: Numbers,
    tables: NDArray[np.int32],
    sizes: Numbers,
    known: Numbers,
    every: Numbers,
    places: Numbers,
    rows: tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]],
    times: tuple[Numbers, Numbers, Numbers],
    events: NDArray[np.float64],
    counts: Numbers,
) -> None:
    """Decode frames into main, slow and GPS `rows`, their `times` in us, `events` and `counts`.

    `letters`, (256,), is byte -> table, or -1; `tables` are (5, 3, n_field): signs, predictors and
    encodings of main frames, whole and by differences, slow, GPS and home ones, of whose fields
    there are `sizes`; `known`, (14,), is predictor -> number, the last the place of motor[0];
    `every` is (3,): iterations from an I frame to the next, and how many of how many are logged;
    `places` are those of loopIteration, time and GPS's time. An event is a kind, the last time, us,
    and two numbers.
    """
    width = tables.shape[2]
    history, found = np.zeros((2, width), np.int64), np.zeros(width, np.int64)
    group = np.zeros(8, np.int64)
    at, last, main, slow, gps, event = 0, 0, 0, 0, 0, 0
    corrupt, unfounded, unbelieved, skipped, ended = 0, 0, 0, 0, 0
    valid, homed, begun, whole = False, False, False, True
    time, iteration = np.int64(0), np.int64(0)  # of the last frame that is believed
    doubted_time, doubted_iteration = np.int64(-1), np.int64(-1)  # of an I frame that isn't yet
    while at < data.size and not ended:
        kind, behind = letters[data[at]], np.int64(_BROKEN)
        if kind == EVENT:
            behind = _event(data, at + 1, events[event])
            ended = int(behind >= 0 and events[event, 0] == ENDED)
        elif kind >= 0:
            known[INCREMENT] = _ahead(iteration, every)
            behind = _frame(data, at + 1, tables[kind], sizes[kind], history, known, group, found)
        if behind < 0 or (behind < data.size and letters[data[behind]] < 0 and not ended):
            corrupt += whole
            whole = valid = False
            at += 1
            continue
        whole, skipped = True, skipped + at - last
        last = at = behind
        if kind == EVENT:
            if events[event, 0] == RESUMED:
                iteration = np.int64(events[event, 2])
                time += _extended(np.int64(events[event, 3]) - time, 32)
                valid, doubted_time = False, np.int64(-1)
            events[event, 1] = time
            event += 1
        elif kind == _SLOW:
            _keep(found, sizes[kind], rows[1], slow)
            times[1][slow] = time
            slow += 1
        elif kind == _HOME:
            homed, known[HOME], known[HOME_1] = True, found[0], found[1]
        elif kind == _GPS and homed and begun:
            _keep(found, sizes[kind], rows[2], gps)
            times[2][gps] = time
            if places[2] >= 0:
                times[2][gps] += _extended(found[places[2]] - time, 32)
            gps += 1
        elif kind == _GPS or (kind == _INTER and not valid):
            unfounded += 1
        else:
            stamp, number = found[places[1]], found[places[0]]
            step = _extended(stamp - time, 32)
            valid = not begun or (0 <= step < _LONGEST and number >= iteration)
            if kind == _INTRA and not valid:  # two in a row that agree are believed
                later = _extended(stamp - doubted_time, 32)
                valid = doubted_time >= 0 and 0 < later < _LONGEST and number > doubted_iteration
                doubted_time, doubted_iteration = stamp, number
            if not valid:
                unbelieved += 1
                continue
            time = time + step if begun else stamp
            iteration, begun, doubted_time = number, True, np.int64(-1)
            known[LAST_TIME] = time & 0xFFFFFFFF
            for k in range(sizes[_INTRA]):
                history[1, k] = history[0, k] if kind == _INTER else found[k]
                history[0, k] = found[k]
            _keep(found, sizes[_INTRA], rows[0], main)
            times[0][main] = time
            main += 1
    counts[0], counts[1], counts[2], counts[3], counts[4] = main, slow, gps, event, corrupt
    counts[5], counts[6], counts[7], counts[8], counts[9] = (
        unfounded, unbelieved, skipped, last, ended
    )  # fmt: skip


try:
    decode = njit(_decode, cache=True, error_model="numpy")
except RuntimeError:  # no place for a cache
    decode = njit(_decode, error_model="numpy")
