"""Blackbox logs of Betaflight, Rotorflight and their kin, of which a file may hold several.

Columns are named as the firmware does, such as `gyroADC[0]`; what isn't logged every time (`S` and
`G` frames) has clocks of its own. `axisSum[0]` and so on are added: the sum of a controller's
terms. The firmware's axes are forward, left and up; channels are forward, right and down.

Sources: Cleanflight, "Blackbox logging internals"; `blackbox.c` of Rotorflight 4.2 to 4.6 and of
Betaflight 4.2 to 2025.12.
"""

import math
import re
import struct
from collections.abc import Mapping, Sequence
from functools import cached_property, lru_cache
from itertools import pairwise
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, StorageError, check_known, item_of, shown
from helisim.base.files import first_bytes, read_bytes, read_text
from helisim.base.note import Option
from helisim.base.settings import FrozenMap
from helisim.logs.mapping import Column
from helisim.logs.report import LogFinding
from helisim.logs.source import Topics
from helisim.records.record import ACCELERATIONS, ATTITUDES, IN1, RATES

_START = b"H Product:Blackbox flight data recorder"
_SNIFFED = 1 << 16  # bytes of a file that show whether it is a Blackbox log
_EMPTY = re.compile(rb"(?<!\xff)\xff+\Z")  # of a memory that isn't full
_LINE = re.compile(rb"H (?:([^\n:]{1,200}):([^\n]{0,20000})|[ -~]{0,2000})\n")
_SLOWEST = 640_000  # largest interval from an I frame to the next, iterations
_BEYOND = 64  # bytes behind a file's that a frame which is cut off may reach
_NAMED = 8  # other logs of a file that are named, at most
_DUMP_BYTES = 1 << 22  # largest dump of the command line
_PROFILE = re.compile(r"(profile|rateprofile) (\d+)")
_SETTING = re.compile(r"set (\S+) = (.*)|(servo \d+|mixer input \S+) (.*)")

_CHANNELS: dict[str, Sequence[str]] = {
    **{"lat": ("mixer[0]", "axisSum[0]"), "lon": ("mixer[1]", "axisSum[1]")},
    **{"ped": ("mixer[2]", "axisSum[2]"), "col": ("mixer[3]", "setpoint[3]")},
    **{name: (f"setpoint[{k}]",) for k, name in enumerate(("LAT", "LON", "PED", "COL"))},
    **{
        name: [f"{one}[{k}]" for one in ("gyroADC", "gyroData", "gyroRAW", "gyroUnfilt")]
        for k, name in enumerate(RATES)
    },
    **{name: (f"attitude[{k}]",) for k, name in enumerate(ATTITUDES)},
    **{name: (f"accADC[{k}]", f"accSmooth[{k}]") for k, name in enumerate(ACCELERATIONS)},
    "rotor_speed": ("headspeed",),
}
"""Channel -> fields of Rotorflight, of which the first that is logged counts."""
_OTHERS: dict[str, dict[str, Sequence[str]]] = {
    "Rotorflight 4.2": {"col": ("rcCommand[4]",), "COL": ()},
    "Rotorflight": {},
    "INAV": dict.fromkeys(_CHANNELS, ()),  # whose axes were not looked at
    "": {
        **{"col": ("setpoint[3]",), "COL": ()},
        **{
            name: (f"setpoint[{k}]", f"rcCommand[{k}]")
            for k, name in enumerate(("LAT", "LON", "PED"))
        },
    },
}
"""Firmware -> fields that differ in it; without a mixer, a controller's sum is the command."""
_TURNED = ("lon", "ped", "LON", "PED", "q", "r", "theta", "ay", "az")
"""Channels against the firmware's axes: its pitch is nose down, its yaw left but of attitude."""
_SCALES: dict[str, tuple[float, str]] = {
    **{"rcCommand[3]": (1.0, "us"), "rcCommand": (2e-3, "1")},
    **{"setpoint[3]": (1e-3, "1"), "setpoint": (1.0, "deg/s"), "attitude": (0.1, "deg")},
    **{"BaroAlt": (1.0, "cm"), "altitude": (1.0, "cm"), "vario": (1.0, "cm/s")},
    **{"servo": (1.0, "us"), "headspeed": (1.0, "rpm"), "tailspeed": (1.0, "rpm")},
    **{"GPS_coord": (1e-7, "deg"), "GPS_speed": (1.0, "cm/s")},
    **{"GPS_ground_course": (0.1, "deg"), "axis": (1e-3, "1")},
}
_ROTORFLIGHT = _SCALES | {
    **{"rcCommand[3]": (2e-3, "1"), "rcCommand[4]": (1e-3, "1"), "motor": (1e-3, "1")},
    **dict.fromkeys(("Vbat", "Vbec", "Vbus", "EscV", "Esc2V"), (0.01, "V")),
    **dict.fromkeys(("Ibat", "EscI", "Esc2I"), (0.01, "A")),
    **dict.fromkeys(("govP", "govI", "govD", "govF", "govSum"), (1e-3, "1")),
    **dict.fromkeys(("govTarget", "govRequest"), (1.0, "rpm")),
    **dict.fromkeys(("mixer", "axis", "setpoint[3]"), (0.012, "deg")),  # 12 deg at 1000
    **dict.fromkeys(("mixer[2]", "axis[2]"), (0.024, "deg")),
}
_SCALES_OF = {
    "Rotorflight 4.2": _SCALES
    | {"rcCommand[3]": (1e-3, "1"), "rcCommand[4]": (2e-3, "1"), "axis": (2e-3, "1")},
    "Rotorflight": _ROTORFLIGHT,
    "": _SCALES,
}
"""Firmware -> field, all of its axes or one -> what a count is, and in which unit."""


class Event(NamedTuple):
    """An event: its time, s since power-on, kind and numbers; 13 is a setting changed in flight."""

    time: float
    kind: int
    numbers: tuple[float, float]
    text: str = ""


def is_blackbox(path: str | PathLike[str]) -> bool:
    """Return whether a file has a Blackbox log in its first 64 KiB. Raises StorageError."""
    return _START in first_bytes(path, _SNIFFED)


class Blackbox:
    """A log of a file; `log["gyroADC[0]"]` is a column in the unit that `units` says, if one.

    `log` is its number from 1, by default the largest's; `sizes` are all logs' bytes, `header` its
    parameters, `events` are in their order. `counts` says what is kept, and what isn't: places that
    are "corrupt", "unfounded" frames without the one that they build on, "unbelieved" ones whose
    time or number jumps, "skipped" bytes. Raises StorageError if it can't be read, InputError if
    there is no such log.
    """

    def __init__(self, path: str | PathLike[str], log: int | None = None) -> None:
        self.path = Path(path)
        data = read_bytes(path) + bytes(_BEYOND)
        starts = [one.start() for one in re.finditer(re.escape(_START), data)]
        if not starts:
            raise StorageError(f"{path}: no Blackbox log in its {len(data) - _BEYOND} bytes")
        edges = [*starts, len(data) - _BEYOND]
        self.sizes = tuple(stop - start for start, stop in pairwise(edges))
        if log is not None and not 1 <= log <= len(starts):
            raise InputError(f"{path}: has logs 1 to {len(starts)}, and {log} was asked for")
        self.number = log or 1 + int(np.argmax(self.sizes))
        self._place = f"{path}, log {self.number}" if len(starts) > 1 else str(path)
        lines, at = _header(data, starts[self.number - 1], edges[self.number])
        self.header = FrozenMap(lines)
        self._decode(data, at, edges[self.number])

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """Return a column, (n_time,). Raises UnknownNameError."""
        check_known("field", [name], self.columns)
        if name.startswith("axisSum"):
            limit = self._limits[name == "axisSum[2]"] or np.inf
            terms = [self.raw(one) for one in self._terms(name[-3:]) if one in self._at]
            return np.asarray(np.clip(sum(terms), -limit, limit) * self._scale(name)[0], np.float64)
        return self.raw(name) * self._scale(name)[0]

    def raw(self, name: str) -> NDArray[np.float64]:
        """Return a field's counts as logged, (n_time,). Raises UnknownNameError."""
        clock, k = item_of(self._at, name, "field")
        low, high = self._values[clock][:, k].astype(np.int32)
        values = low + (high << 16)
        return (values if self._signed[clock][k] else values.view(np.uint32)).astype(np.float64)

    def time(self, clock: str = "main") -> NDArray[np.float64]:
        """Return times of "main", "slow" or "gps" frames, (n_time,) s since power-on."""
        return np.asarray(1e-6 * item_of(self._times, clock, "clock"), np.float64)

    @cached_property
    def columns(self) -> FrozenMap[str, str]:
        """Column -> clock: the fields but times, and sums of terms."""
        sums = (f"axisSum[{k}]" for k in range(3) if {*self._terms(f"[{k}]")} & self._at.keys())
        named = {name: clock for name, (clock, _) in self._at.items() if name != "time"}
        return FrozenMap(named | dict.fromkeys(sums, "main"))

    @property
    def units(self) -> FrozenMap[str, str]:
        """Column -> unit, where it is known."""
        return FrozenMap(
            {name: unit for name in self.columns for _, unit in [self._scale(name)] if unit}
        )

    @property
    def firmware(self) -> str:
        """Name and version of what wrote the log, such as "Rotorflight 4.6.0"; may be empty."""
        return shown(" ".join(self.header.get("Firmware revision", "").split()[:2]))

    @cached_property
    def channels(self) -> FrozenMap[str, Column]:
        """Channel -> column: commands of mixer or controller, what they aim at, and motion."""
        own = _CHANNELS | self._of_firmware(_OTHERS)
        own |= {"ped": ("axisSum[2]",)} if self._motor_tail else {}
        first = ((name, [x for x in fields if x in self.columns]) for name, fields in own.items())
        return FrozenMap({c: Column(x[0], sign=-1 if c in _TURNED else 1) for c, x in first if x})

    @cached_property
    def source(self) -> Topics:
        """The log as a source of columns, with its faults."""
        found = Topics(
            self.path,
            "Blackbox",
            self.columns,
            self.__getitem__,
            lambda clock: self._times[clock].astype(np.float64),
            float(self._times["main"][0]),
            self.units,
            self._findings(),
            self.channels,
        )
        found.full = {  # the firmware's mixer says 1000 at full pitch of the blades
            name: math.radians(1e3 * scale)
            for name in IN1
            if name in self.channels
            for scale, unit in [self._scale(self.channels[name].column)]
            if unit == "deg"
        }
        return found

    @property
    def _motor_tail(self) -> bool:
        """Whether a motor drives the tail, so that the mixer's yaw is its throttle."""
        return self._of_firmware(_SCALES_OF) is _ROTORFLIGHT and "motor[1]" in self._at

    def _terms(self, axis: str) -> list[str]:
        return [f"axis{letter}{axis}" for letter in "PIDFBOS"]

    def _scale(self, name: str) -> tuple[float, str]:
        """Return what a count of a column is, and in which unit; "" if none is known."""
        bare, _, axis = name.rstrip("]").partition("[")
        if bare.startswith("gyro"):
            bits = re.fullmatch(r"0x([0-9a-f]{8})", self.header.get("gyro_scale", ""))
            scale = struct.unpack(">f", bytes.fromhex(bits[1]))[0] if bits else 0.0
            return (scale, "deg/s") if 1e-4 < scale < 1e4 else (1.0, "")
        if bare in ("accADC", "accSmooth"):
            return 1.0 / self._gravity, "g"
        bare = "axis" if bare.startswith("axis") else bare
        if self._motor_tail and (bare, axis) in (("axis", "2"), ("mixer", "2")):
            return 1e-3, "1"
        scales = self._of_firmware(_SCALES_OF)
        return scales.get(f"{bare}[{axis}]") or scales.get(bare) or (1.0, "")

    def _of_firmware(self, table: Mapping[str, Any]) -> Any:
        return next(one for name, one in table.items() if self.firmware.startswith(name))

    def _decode(self, data: bytes, start: int, stop: int) -> None:
        tables, sizes, names, known, every = _tables(self.header, self._place)
        self._share = every[1] / every[2]  # of iterations that is logged
        self._limits = [
            _integer(self.header, f"pidsum_limit{of}", 0, self._place) for of in ("", "_yaw")
        ]
        self._gravity = _integer(self.header, "acc_1G", 1, self._place) or 1
        # here, because importing it compiles
        from helisim.logs.blackbox_frames import COUNTS, EVENT, LETTERS, TEXT, decode

        stop = next((one.start() for one in _EMPTY.finditer(data, start, stop)), stop)
        letters = np.full(256, -1, np.int64)
        letters[[*LETTERS.encode()]] = [*(k if n else -1 for k, n in enumerate(sizes)), EVENT]
        most = [sum(data.count(k, start, stop) for k in one) for one in (b"IP", b"S", b"G", b"E")]
        rows = tuple(np.zeros((2, sizes[k], n), np.int16) for n, k in zip(most, (0, 2, 3)))
        times = tuple(np.empty(n, np.int64) for n in most[:3])
        events, counts = np.empty((most[-1] + 1, 4)), np.zeros(10, np.int64)
        places = [
            *(names["I"].index(one) for one in ("loopIteration", "time")),
            names["G"].index("time") if "time" in names["G"] else -1,
        ]
        arrays = (np.array(one, np.int64) for one in (sizes, known, every, places))
        behind = np.frombuffer(data, np.uint8)[start:]
        decode(behind, stop - start, letters, tables, *arrays, rows, times, events, counts)
        self.counts = FrozenMap(dict(zip(COUNTS, counts.tolist())))
        if not self.counts["main"]:
            raise StorageError(f"{self._place}: a header, and no frame in {stop - start} bytes")
        clocks = {"main": "I", "slow": "S", "gps": "G"}
        self._values = {k: one[..., : self.counts[k]] for k, one in zip(clocks, rows)}
        self._times = {k: one[: self.counts[k]] for k, one in zip(clocks, times) if self.counts[k]}
        np.maximum(times[1], times[0][0], out=times[1])  # of S frames ahead of all
        self._signed = {k: tables[LETTERS.index(one), 0] for k, one in clocks.items()}
        self._at = {
            name: (clock, k) for clock in self._times for k, name in enumerate(names[clocks[clock]])
        }
        self.events = tuple(
            Event(
                1e-6 * time,
                int(kind),
                (x, y),
                shown(data[start + int(x) : start + int(x + y)].decode(errors="replace"))
                if kind == TEXT
                else "",
            )
            for kind, time, x, y in events[: self.counts["events"]].tolist()
        )
        self._cut = 0 if self.counts["ended"] else stop - start - self.counts["last"]

    def _findings(self) -> list[LogFinding]:
        from helisim.logs.blackbox_frames import ADJUSTED, RESUMED

        number, own = self.raw("loopIteration"), self.counts
        gaps = np.rint(self._share * np.diff(number)) - 1.0
        gaps[np.isin(number[1:], [x.numbers[0] for x in self.events if x.kind == RESUMED])] = 0.0
        lost, places = int(np.sum(gaps[gaps > 0.0])), np.count_nonzero(gaps > 0.0)
        others = [k for k in np.argsort(self.sizes)[::-1].tolist() if k + 1 != self.number]
        listed = ", ".join(f"{k + 1} ({self.sizes[k]} bytes)" for k in others[:_NAMED])
        listed += f" and {len(others) - _NAMED} more" * (len(others) > _NAMED)
        damage = (
            (
                own["corrupt"],
                f"{own['corrupt']} places ({own['skipped']} bytes) where no whole frame is",
            ),
            (own["unfounded"], f"{own['unfounded']} frames without the one that they build on"),
            (own["unbelieved"], f"{own['unbelieved']} frames whose time or number jumps"),
            (lost, f"{lost} frames missing between others, in {places} places"),
        )
        later = [one.kind for one in self.events if one.time > self.time()[0]]
        changed, paused = (later.count(one) for one in (ADJUSTED, RESUMED))
        found = (
            (
                "logs",
                f"log {self.number} of {len(self.sizes)} is read; the others are {listed}",
                len(others),
                [Option("log", str(one + 1)) for one in others[:1]],
            ),
            (
                "corruption",
                f"{self._place}: besides {own['main']} whole frames "
                + ", ".join(text for count, text in damage if count),
                sum(count for count, _ in damage),
                (),
            ),
            (
                "cut off",
                f"{self._place}: its last {self._cut} bytes are no whole frame",
                self._cut,
                (),
            ),
            (
                "no end",
                f"{self._place}: no event ends it: its last frames may be lost, as where the power "
                "went first",
                int(not own["ended"] and not self._cut),
                (),
            ),
            (
                "adjusted",
                f"{changed} settings were changed in flight; the header has the first ones",
                changed,
                (),
            ),
            ("paused", f"logging paused {paused} times", paused, ()),
        )
        return [LogFinding(kind, text, tuple(helps), n) for kind, text, n, helps in found if n]


@lru_cache(maxsize=1)
def open_blackbox(path: Path, digest: str, log: int | None) -> Blackbox:
    """Return a log, the last one from a cache by its digest."""
    return Blackbox(path, log)


def read_dump(path: str | PathLike[str]) -> FrozenMap[str, str]:
    """Return the settings in a dump of the command line, `diff all` or `dump all`: name -> text.

    Of several profiles these are the last selected one's, which is in use. Names are those that are
    set, `servo 1` and so on, and `mixer input SR` and so on. Raises StorageError.
    """
    place, chosen = "", dict[str, str]()
    found: dict[str, dict[str, str]] = {"": {}}
    for line in map(str.strip, read_text(path, limit=_DUMP_BYTES).splitlines()):
        if match := _PROFILE.fullmatch(line):
            chosen[match[1]] = place = line
        elif match := _SETTING.fullmatch(line):
            name, value = (match[1], match[2]) if match[1] else (match[3], match[4])
            found.setdefault(place if match[1] else "", {})[shown(name)] = shown(value, 500)
    settings = found[""] | {
        name: value for one in chosen.values() for name, value in found.get(one, {}).items()
    }
    if not settings:
        raise StorageError(f"{path}: no setting in it, such as 'set roll_p_gain = 50'")
    return FrozenMap(settings)


def _header(data: bytes, at: int, stop: int) -> tuple[dict[str, str], int]:
    """Return the parameters of a log, and where its frames begin."""
    lines: dict[str, str] = {}
    while (match := _LINE.match(data, at, stop)) is not None:
        name, text = (
            shown((one or b"").decode(errors="replace"), 20_000) for one in match.groups()
        )
        lines[name], at = text, match.end()
    return lines, at


def _integers(lines: Mapping[str, str], name: str, where: str) -> list[int]:
    """Return the whole numbers of a line of the header, [] without it. Raises StorageError."""
    found = [one.strip() for one in lines.get(name, "").split(",")]
    if not all(re.fullmatch(r"-?[0-9]{1,9}|", one) for one in found):
        raise StorageError(
            f"{where}: the header's {name!r} is {shown(lines[name])!r}, expected whole numbers "
            "with commas"
        )
    return [int(one) for one in found if one]


def _integer(lines: Mapping[str, str], name: str, default: int, where: str) -> int:
    return (_integers(lines, name, where) or [default])[0]


def _tables(
    lines: Mapping[str, str], where: str
) -> tuple[NDArray[np.int32], list[int], dict[str, list[str]], list[int], list[int]]:
    """Return `tables`, `sizes`, names, `known` and `every` as `decode` wants them.

    Raises StorageError if they can't be.
    """
    from helisim.logs import blackbox_frames as of

    listed = {one: lines.get(f"Field {one} name", "").split(",") for one in "ISGH"}
    names = {letter: [one for one in found if one] for letter, found in listed.items()}
    if not {"loopIteration", "time"} <= {*names["I"]}:
        raise StorageError(
            f"{where}: the header names no fields of frames; it is cut off or damaged"
        )
    sizes = [len(names["I" if letter == "P" else letter]) for letter in of.LETTERS[:-1]]
    fields = np.zeros((len(sizes), 3, max(sizes)), np.int32)
    for k, (letter, size) in enumerate(zip(of.LETTERS, sizes)):
        for n, kind in enumerate(("signed", "predictor", "encoding")):
            name = f"Field {'I' if (letter, n) == ('P', 0) else letter} {kind}"
            numbers = _integers(lines, name, where)
            unknown = {*numbers} - {*((0, 1), range(of.MINMOTOR + 1), of.ENCODINGS)[n]}
            if len(numbers) != size or unknown:
                raise StorageError(
                    f"{where}: the header's {name!r} of {size} fields: "
                    + (
                        f"{kind} {min(unknown)} isn't known"
                        if unknown
                        else f"{len(numbers)} numbers"
                    )
                )
            fields[k, n, :size] = numbers
        pairs = fields[k, 1, :-1] == of.HOME
        fields[k, 1, 1:][pairs & (fields[k, 1, 1:] == of.HOME)] = of.HOME_1
        at = 0
        while at < size:
            at += of.ENCODINGS[int(fields[k, 2, at])]
        if at > size or (of.MOTOR_0 in fields[k, 1] and "motor[0]" not in names["I"]):
            raise StorageError(f"{where}: the header's {letter} frames lack fields of a group")
    least = _integer(lines, "minthrottle", 1150, where)
    added = {
        of.US_1500: 1500,
        of.VBATREF: _integer(lines, "vbatref", 4095, where),
        of.MINTHROTTLE: least,
        of.MINMOTOR: _integer(lines, "motorOutput", least, where),
    }
    motor = [*names["I"], "motor[0]"].index("motor[0]")
    known = [*(added.get(k, 0) for k in range(of.HOME_1 + 1)), motor]
    every = _integer(lines, "I interval", 32, where)
    rate = re.fullmatch(r"(?:(\d{1,4})/)?(\d{1,4})", lines.get("P interval", "1"))
    some, all_ = (int(rate[1] or 1), int(rate[2]) or every) if rate else (0, 0)
    if not (0 < some <= all_ and 0 < every <= _SLOWEST):
        raise StorageError(
            f"{where}: the header's intervals of I and P frames can't be: {every} and "
            f"{shown(lines.get('P interval', ''))!r}"
        )
    return fields, sizes, names, known, [every, some, all_]
