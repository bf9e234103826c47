"""Writes Blackbox logs from columns of whole numbers, as Rotorflight's and Betaflight's do.

Fields as in `blackbox.c` of Rotorflight 4.6.0; encodings as in the firmware's own description.
"""

from collections.abc import Iterable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from tabled import rows, section

ZERO, PREVIOUS, LINE, MEAN, MINTHROTTLE, MOTOR_0, INCREMENT, HOME, US_1500, VBATREF, LAST_TIME = (
    range(11)
)
MINMOTOR = 11
SIGNED_VB, UNSIGNED_VB, NEG_14BIT, TAG8_8SVB, TAG2_3S32, TAG8_4S16, NULL, TAG2_3SVARIABLE = (
    0, 1, 3, 6, 7, 8, 9, 10,
)  # fmt: skip
_SIZES = {TAG2_3S32: 3, TAG8_4S16: 4, TAG2_3SVARIABLE: 3}  # fields that are encoded together


class Field(NamedTuple):
    """How a field is written; `p_predictor` and `p_encoding` in P frames."""

    signed: int
    predictor: int
    encoding: int
    p_predictor: int = ZERO
    p_encoding: int = SIGNED_VB


def _each(count: int, *names: str) -> list[str]:
    return [f"{name}[{k}]" for name in names for k in range(count)]


def _like(names: Iterable[str], *of: int) -> dict[str, Field]:
    return dict.fromkeys(names, Field(*of))


_SIGNED, _UNSIGNED = (1, ZERO, SIGNED_VB), (0, ZERO, UNSIGNED_VB)
_BATTERY = (
    *("Ibat", "Vbec", "Vbus", "EscV", "EscI", "EscCap", "EscRPM", "EscThr", "EscPwm", "BecV"),
    *("BecI", "Esc2V", "Esc2I", "Esc2Cap", "Esc2RPM"),
)
_GOVERNOR = ("govP", "govI", "govD", "govF")
ROTORFLIGHT: dict[str, Field] = {
    one: field for each in rows(globals(), "ROTORFLIGHT") for one, field in each.items()
}
"""Main fields of Rotorflight 4.6.0, in their order."""
SLOW: dict[str, Field] = {
    **_like(("flightModeFlags", "stateFlags"), *_UNSIGNED),
    **_like(("failsafePhase", "rxSignalReceived", "rxFlightChannelsValid"), 0, ZERO, TAG2_3S32),
}
GPS_HOME = _like(_each(2, "GPS_home"), *_SIGNED)
GPS: dict[str, Field] = {
    "time": Field(0, LAST_TIME, UNSIGNED_VB),
    "GPS_numSat": Field(*_UNSIGNED),
    **_like(_each(2, "GPS_coord"), 1, HOME, SIGNED_VB),
    **_like(("GPS_altitude", "GPS_speed", "GPS_ground_course"), *_UNSIGNED),
}
_LINES = section(globals(), "HEADER").splitlines()
HEADER: dict[str, str] = dict(line.split(":", 1) for line in _LINES)
"""Parameters of a log of Rotorflight 4.6.0: 1 kHz PID loop, logged at 125 Hz."""
DUMP = Path(__file__).with_name("blackbox_dump.txt").read_text(encoding="utf-8")
"""What its command line prints of `dump`."""


@lru_cache(maxsize=1 << 16)
def unsigned(value: int) -> bytes:
    """Return a number of 32 bits, seven a byte, the lowest first."""
    value &= 0xFFFFFFFF
    found = bytearray()
    while value > 127:
        found.append(value & 127 | 128)
        value >>= 7
    return bytes([*found, value])


@lru_cache(maxsize=1 << 16)
def signed(value: int) -> bytes:
    """Return a signed number: 0, -1, 1, -2, ... as 0, 1, 2, 3, ..."""
    value = (value + 0x80000000) % 0x100000000 - 0x80000000
    return unsigned((value << 1) ^ (value >> 31))


def _bits(widths: Iterable[int], values: Iterable[int]) -> bytes:
    """Return numbers of so many bits each, the first highest, filled up with zeros to bytes."""
    total = length = 0
    for width, value in zip(widths, values):
        total, length = total << width | value & (1 << width) - 1, length + width
    return (total << -length % 8).to_bytes(-(-length // 8), "big")


def _within(values: Iterable[int], *widths: int) -> bool:
    return all(-(1 << width - 1) <= one < 1 << width - 1 for one, width in zip(values, widths))


def _bytes_of(values: list[int]) -> bytes:
    sizes = [next(k for k in range(4) if k == 3 or _within([one], 8 * k + 8)) for one in values]
    tag = 0xC0 | sizes[0] | sizes[1] << 2 | sizes[2] << 4
    numbers = ((one & 0xFFFFFFFF).to_bytes(4, "little")[: k + 1] for one, k in zip(values, sizes))
    return bytes([tag]) + b"".join(numbers)


def _tag2_3s32(values: list[int]) -> bytes:
    if _within(values, 2, 2, 2):
        return _bits((2, 2, 2, 2), (0, *values))
    if _within(values, 4, 4, 4):
        return _bits((4, 4, 4, 4), (4, *values))
    if _within(values, 6, 6, 6):
        return _bits((2, 6, 2, 6, 2, 6), (2, values[0], 0, values[1], 0, values[2]))
    return _bytes_of(values)


def _tag2_3svariable(values: list[int]) -> bytes:
    for tag, widths in enumerate(((2, 2, 2), (5, 5, 4), (8, 7, 7))):
        if _within(values, *widths):
            return _bits((2, *widths), (tag, *values))
    return _bytes_of(values)


def _tag8_4s16(values: list[int]) -> bytes:
    widths = [
        0 if one == 0 else 4 if _within([one], 4) else 8 if _within([one], 8) else 16
        for one in values
    ]
    if not _within(values, 16, 16, 16, 16):
        raise ValueError(f"{values} aren't all of 16 bits")
    tag = sum({0: 0, 4: 1, 8: 2, 16: 3}[width] << 2 * k for k, width in enumerate(widths))
    return bytes([tag]) + _bits(widths, values)


def _tag8_8svb(values: list[int]) -> bytes:
    if len(values) == 1:
        return signed(values[0])
    tag = sum((one != 0) << k for k, one in enumerate(values))
    return bytes([tag]) + b"".join(signed(one) for one in values if one)


_GROUPS = {
    TAG8_8SVB: _tag8_8svb,
    TAG2_3S32: _tag2_3s32,
    TAG8_4S16: _tag8_4s16,
    TAG2_3SVARIABLE: _tag2_3svariable,
}
_SINGLE = {
    SIGNED_VB: signed,
    UNSIGNED_VB: unsigned,
    NEG_14BIT: lambda value: unsigned(-value & 0x3FFF),
    NULL: lambda value: b"",
}


def _plan(encodings: list[int]) -> list[tuple[int, int, int]]:
    plan, k = [], 0
    while k < len(encodings):
        stop = k + _SIZES.get(encodings[k], 1)
        while (
            encodings[k] == TAG8_8SVB and encodings[stop : stop + 1] == [TAG8_8SVB] and stop < k + 8
        ):
            stop += 1
        if set(encodings[k:stop]) != {encodings[k]} or stop > len(encodings):
            raise ValueError(f"field {k}: fields of encoding {encodings[k]} aren't all there")
        plan.append((encodings[k], k, stop))
        k = stop
    return plan


def _written(plan: list[tuple[int, int, int]], values: list[int]) -> bytes:
    return b"".join(
        _GROUPS[code](values[k:stop]) if code in _GROUPS else _SINGLE[code](values[k])
        for code, k, stop in plan
    )


def frame(letter: str, fields: Mapping[str, Field], *values: int) -> bytes:
    """Return an S, G or H frame; its `values` are less what is predicted, but 0 for NULL."""
    return letter.encode() + _written(_plan([one.encoding for one in fields.values()]), [*values])


def event(kind: int, *numbers: int) -> bytes:
    return bytes([69, kind]) + (
        b"End of log\0" if kind == 255 else b"".join(map(unsigned, numbers))
    )


def adjusted(function: int, value: int) -> bytes:
    return bytes([69, 13, function]) + signed(value)


def encode(
    columns: Mapping[str, ArrayLike],
    header: Mapping[str, str] | None = None,
    *,
    fields: Mapping[str, Field] = ROTORFLIGHT,
    before: Mapping[int, bytes] | None = None,
    gps: bool = False,
    ended: bool = True,
) -> bytes:
    """Return a log of columns of whole numbers, (n_time,), named as the firmware does.

    `time`, us, is needed; `loopIteration` is by default the row times the P interval. A row that is
    more than a P interval later than the one before gets a "logging resumes" event, as where a
    pilot paused. `header` is in place of `HEADER`'s lines, or besides; None leaves a line out.
    `before` is row -> frames and events that come ahead of that row. Fields that are encoded
    together (axisP[0] to [2]) must all be there. Without `ended` the log was cut off.
    """
    lines = {name: text for name, text in {**HEADER, **(header or {})}.items() if text is not None}
    count = np.size(next(iter(columns.values())))
    given = {"loopIteration": int(lines["P interval"]) * np.arange(count), **columns}
    if unknown := [name for name in given if name not in fields]:
        raise ValueError(f"no fields of this firmware: {', '.join(unknown)}")
    used = {name: one for name, one in fields.items() if name in given}
    names, kinds = list(used), list(used.values())
    values = np.column_stack([np.asarray(given[name], np.int64) for name in names])
    rows = _main_rows(values, names, kinds, lines)
    tables = {"S": SLOW, **({"H": GPS_HOME, "G": GPS} if gps else {})}
    parts = [_head(used, tables, lines)]
    for k, written in enumerate(rows):
        parts += [(before or {}).get(k, b""), written]
    parts.append(event(255) if ended else b"")
    return b"".join(parts)


def _head(
    used: Mapping[str, Field], tables: Mapping[str, Mapping[str, Field]], lines: Mapping[str, str]
) -> bytes:
    found = ["Product:Blackbox flight data recorder by Nicholas Sherlock", "Data version:2"]
    for letter, table in {"I": used, **tables}.items():
        found.append(f"Field {letter} name:{','.join(table)}")
        for name in ("signed", "predictor", "encoding"):
            listed = ",".join(str(getattr(one, name)) for one in table.values())
            found.append(f"Field {letter} {name}:{listed}")
        for name in ("predictor", "encoding") if letter == "I" else ():
            listed = ",".join(str(getattr(one, f"p_{name}")) for one in table.values())
            found.append(f"Field P {name}:{listed}")
    found += [f"{name}:{text}" for name, text in lines.items()]
    return "".join(f"H {one}\n" for one in found).encode()


def _main_rows(
    values: np.ndarray, names: list[str], kinds: list[Field], lines: Mapping[str, str]
) -> Iterable[bytes]:
    """Yield I and P frames; after an I frame, it alone is what P frames predict from."""
    p_interval, i_interval = int(lines["P interval"]), int(lines["I interval"])
    iteration = values[:, names.index("loopIteration")]
    time = values[:, names.index("time")]
    resumes = np.diff(iteration, prepend=iteration[0] - p_interval) != p_interval
    intra = resumes | (iteration % i_interval == 0)
    intra[0] = True
    before = np.maximum(np.arange(len(values)) - 1, 0)
    last = values[before]
    further = values[np.where(intra[before], before, np.maximum(before - 1, 0))]
    motor = values[:, names.index("motor[0]")] if "motor[0]" in names else 0 * time
    predicted = {
        ZERO: 0 * values,
        PREVIOUS: last,
        LINE: 2 * last - further,
        MEAN: np.fix((last + further) / 2).astype(np.int64),
        MINTHROTTLE: 0 * values + int(lines.get("minthrottle", 0)),
        MOTOR_0: 0 * values + motor[:, None],
        INCREMENT: last + p_interval,
        US_1500: 0 * values + 1500,
        VBATREF: 0 * values + int(lines.get("vbatref", 0)),
        MINMOTOR: 0 * values + int(lines.get("motorOutput", "0").split(",")[0]),
    }
    kept = []
    for letter, p in ((b"I", ""), (b"P", "p_")):
        plan = _plan([getattr(one, f"{p}encoding") for one in kinds])
        of = [predicted[getattr(one, f"{p}predictor")][:, k] for k, one in enumerate(kinds)]
        kept.append((letter, plan, values - np.column_stack(of)))
    for k in range(len(values)):
        if resumes[k]:
            yield event(14, int(iteration[k]), int(time[k]))
        letter, plan, left = kept[0 if intra[k] else 1]
        yield letter + _written(plan, left[k].tolist())
