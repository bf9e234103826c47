"""Vibration in a log's gyros: spectra, tones by turns of the rotors, and notches against them.

Sources: Welch (1967) for spectra; ArduPilot, "Traditional Helicopter notch filter setup" and
libraries/Filter for notches, libraries/AP_InertialSensor/BatchSampler for batches (ISBH, ISBD).
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.ndimage import median_filter
from scipy.signal import csd, find_peaks, sosfilt, welch

from helisim.base.arrays import Complex, Real
from helisim.base.settings import Value, to_plain
from helisim.handling.arducopter import GYRO_RATE, NOTCHES, ArduCopterLaw, Notch
from helisim.logs.blackbox import Blackbox
from helisim.logs.dataflash import DataFlash, open_dataflash
from helisim.logs.source import file_digest
from helisim.look.sweeps import usual_step
from helisim.records.record import RATES

# Messages with gyros, best first: fields, factor to rad/s, and what makes them be logged behind the
# gyro's filters, a parameter's bit or True.
_MESSAGES = {
    "GYR": (("GyrX", "GyrY", "GyrZ"), 1.0, ("INS_RAW_LOG_OPT", 4)),
    "IMU": (("GyrX", "GyrY", "GyrZ"), 1.0, True),
    "RATE": (("R", "P", "Y"), np.pi / 180.0, True),
}
_GYROS = ("gyroRAW", "gyroADC")  # Blackbox's, before and behind the gyro's filters
_GYRO = 1  # ISBH's type of a gyro
_EVENTS, _LANDS = (28, 18), 3.0  # EV's numbers of lift-off and landing, and s before the latter
_SPEEDS = (("RPM", "RPM"), ("RPM", "rpm1"), ("ESC", "RPM"))  # messages and fields, 1/min
# Hz of samples and between a spectrum's lines, windows of it; Hz between lines of long logs.
_SLOWEST, _COARSEST, _FEWEST, _LINE = 150.0, 2.5, 4, 0.5
# dB of a peak over its floor, the median of a band of Hz; Hz below which the helicopter itself is.
_ABOVE, _BAND, _LOWEST = 10.0, 24.0, 8.0
_ROTORS, _RATIOS = (8.0, 70.0), (2.5, 12.0)  # Hz of main rotors, turns of tail rotors for one
_COMB, _HARMONICS = 4, 16  # multiples that find a rotor, and that a notch may have
_SLACK, _DRIFT = 0.006, 0.015  # shares of a frequency: of a multiple, and of a peak's half width
# _OSCILLATES: of full command: a rotor out of balance moves a JR700's by 0.026
# _FELT: of full command: half a microsecond of a servo's 500, which are whole ones
_OSCILLATES, _FELT = 0.2, 1e-3
# Of a notch: width over its centre, least width, Hz, and dB; over a rotor's speed, where it stays.
_WIDTH, _NARROWEST, _DEPTH, _UNDER = 0.35, 5.0, 40.0, 0.9
# _BREAK: s between samples of a Blackbox log, which ends a stretch
# _SETTLES: samples after which filters have settled
_BREAK, _SETTLES = 0.1, 200
SET = (
    "set INS_LOG_BAT_MASK 1 (batches at 1 kHz, ISBH and ISBD; restart then), or bit 19 (GYR at "
    "1 kHz) or 18 (IMU at the loop's rate) of LOG_BITMASK, and hover for a minute"
)


@dataclass(frozen=True)
class Peak:
    """A tone of `frequency`, Hz, about the axis that feels most, p, q or r.

    `above` is in dB over the floor beside it, `name` such as "2/rev of main", "" where it is no
    multiple of either rotor's speed. Amplitudes, rad/s, are as `logged`, `now` behind today's
    filters, and what would be `left`, None where nothing is proposed; `felt` is what today's law
    makes of it, 1 being full command.
    """

    frequency: float
    above: float
    axis: str
    name: str
    logged: float
    now: float
    left: float | None
    felt: float


@dataclass(frozen=True, eq=False)
class Vibration(Value):
    """Spectra of a log's gyros, (rad/s)^2/Hz, (3, 3, n_freq) of p, q, r at (n_freq,) Hz.

    They are as logged in messages `source`, `rate` samples a second, behind today's filters of the
    gyro, and what the proposed ones would leave. `rotor` is Hz, `tail` the turns of the tail
    rotor for one of it, NaN if unknown. `settings` are proposed parameters, none if no tone asks
    for them, and `notches` are those. `filters` are the gyro's today and as proposed, at `rotor`
    where they follow it: responses, (n_freq,), at rad/s; without the latter nothing is proposed.
    """

    source: str
    rate: float
    frequency: Real
    spectra: Real
    rotor: float
    tail: float
    peaks: tuple[Peak, ...]
    filters: tuple[Callable[[Real], Complex], ...] = field(repr=False)
    settings: Mapping[str, float] = field(default_factory=dict)
    notches: tuple[Notch, ...] = ()
    remarks: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON, without spectra; null for what is unknown."""
        numbers = {"rate": self.rate, "rotor": self.rotor, "tail": self.tail}
        return {
            "source": self.source,
            **{name: one if np.isfinite(one) else None for name, one in numbers.items()},
            "peaks": to_plain(self.peaks),
            "settings": dict(self.settings),
            "remarks": list(self.remarks),
        }

    def lag(self, frequency: float) -> tuple[float, ...]:
        """Return the lag of the gyro's filters at rad/s, deg: today's, and the proposed ones'."""
        return tuple(
            -float(np.angle(one(np.array([frequency]))[0], deg=True)) for one in self.filters
        )


class _Gyros(NamedTuple):
    """Even samples without gaps, each (n_sample, 3) in rad/s."""

    name: str
    rate: float
    parts: list[Real]
    filtered: bool = False

    @property
    def window(self) -> int:
        longest = max(map(len, self.parts), default=1)
        return 2 ** int(np.log2(max(1.0, min(longest, 1.5 * self.rate / _LINE))))

    @property
    def enough(self) -> bool:
        windows = sum(len(one) // self.window for one in self.parts)
        return windows >= _FEWEST and _SLOWEST <= self.rate <= _COARSEST * self.window

    def spectra(self, law: ArduCopterLaw | None = None) -> tuple[Real, Real]:
        """Return Hz, (n_freq,), and spectra, (3, n_freq), behind a law's filters."""
        size = self.window
        parts = [one for one in self.parts if len(one) >= size]
        if law is not None:
            parts = [sosfilt(law.gyro_sections, one, axis=0)[_SETTLES:] for one in parts]
        found = [
            welch(one, self.rate, nperseg=min(size, len(one)), nfft=size, axis=0) for one in parts
        ]
        mean = np.average([one for _, one in found], axis=0, weights=[len(one) for one in parts])
        return found[0][0], mean.T

    def behind(self, law: ArduCopterLaw, today: ArduCopterLaw) -> Real:
        """Return spectra behind a law's filters of the gyro; today's are in what is logged."""
        if not self.filtered and abs(self.rate / GYRO_RATE - 1.0) < _SLACK:
            return self.spectra(law)[1]
        frequency, logged = self.spectra()
        then, before = (np.abs(one.gyro(2.0 * np.pi * frequency)) for one in (law, today))
        return logged * (then / (before if self.filtered else 1.0)) ** 2


def vibration(
    logs: str | PathLike[str] | Iterable[str | PathLike[str]],
    *,
    rotor_hz: float | None = None,
    tail: float | None = None,
) -> Vibration:
    """Return the vibration in logs of an ArduCopter-heli, and notches of its gyro against it.

    Of several logs the first counts whose messages are fast enough; of it what was flown between
    lift-off and landing. `rotor_hz` is the main rotor's speed, `tail` the turns of the tail rotor
    for one of it; RPM messages and the tones tell them otherwise. Notches are for multiples of
    either's speed that move the servos behind today's filters. Raises StorageError, or InputError
    where the log lacks the autopilot's parameters.
    """
    paths = [logs] if isinstance(logs, str | PathLike) else list(logs)
    opened = (open_dataflash(Path(path), file_digest(Path(path))) for path in paths)
    found = ((log, gyros) for log in opened for gyros in _sources(log) if gyros.enough)
    if first := next(found, None):
        return _found(*first, rotor_hz, tail)
    log = open_dataflash(Path(paths[0]), file_digest(Path(paths[0])))
    law = ArduCopterLaw.of(log.parameters(), source=log.named)
    slow = f"too little of its gyros is logged {_SLOWEST:g} times a second or faster: {SET}"
    nan, spectra, both = float("nan"), np.zeros((3, 3, 0)), (law.gyro, law.gyro)
    return Vibration("", nan, spectra[0, 0], spectra, nan, nan, (), both, remarks=(slow,))


def _found(log: DataFlash, gyros: _Gyros, rotor_hz: float | None, tail: float | None) -> Vibration:
    today = ArduCopterLaw.of(log.parameters(), source=log.named)
    frequency, logged = gyros.spectra()
    line, tones = float(frequency[1]), _tones(frequency, logged)
    message, speed = _sensed(log)
    follows = speed if message == "RPM" else 0.0
    rotor = rotor_hz or _comb(tones, line) or follows or float("nan")
    tail = tail or _tail(tones, rotor, line)
    turns = [_turns(at, rotor, tail, gyros.rate, line) for at in tones]
    # what today's law makes of each tone: commands of an axis if all rates come at once
    gains = np.abs(today.ticked.response(2.0 * np.pi * np.array([*tones])))[:, : len(RATES)]

    def felt(law: ArduCopterLaw) -> Real:
        sizes = _amplitudes(frequency, gyros.behind(law, today), tones)
        return np.einsum("cik,ki->kc", gains, sizes).max(axis=1)

    then, settings, moved = today, dict[str, float](), felt(today)
    loudest = float(moved.max(initial=0.0))
    if loudest < _OSCILLATES and any(n and size >= _FELT for (_, n), size in zip(turns, moved)):
        plain = felt(replace(today, notches=()))  # of notches that are there, too
        asked = [one for one, size in zip(turns, plain) if size >= _FELT]
        settings, notches = _notches(asked, {"main": rotor, "tail": tail * rotor}, follows)
        then = replace(today, notches=notches)
    spectra = np.array([logged, gyros.behind(today, today), gyros.behind(then, today)])
    peaks = _peaks(frequency, spectra, tones, turns, moved)
    said = {
        f"{message} says {speed:.4g} Hz, {speed / rotor:.4g} times the main rotor's": message,
        "no message tells the rotor's speed; it is what most tones are multiples of": (
            rotor == rotor and not (message or rotor_hz)
        ),
        f"a tone moves the servos by {100.0 * loudest:.0f} % of full travel: a loop oscillates, "
        "which no notch mends; lower its P, D and angle gain": loudest >= _OSCILLATES,
        f"{gyros.name} is logged behind the gyro's filters, and what is above {0.5 * gyros.rate:g} "
        f"Hz appears below it: to see all, {SET}": gyros.filtered,
    }
    return Vibration(
        *(gyros.name, gyros.rate, frequency, spectra, rotor, tail, peaks, (today.gyro, then.gyro)),
        settings,
        then.notches,
        tuple(text for text, holds in said.items() if holds),
    )


def blackbox_vibration(log: Blackbox, felt: Callable[[Real], Complex]) -> Vibration | str:
    """Return the vibration that a Blackbox log shows, or a text that says why it shows none.

    The log has the gyro before and behind its filters. What counts is the longest stretch without
    a break and with the rotor at speed. `felt` returns the response of commands, 1 being full, to
    rates, (n_command, 3, n_freq) at rad/s. No notch is proposed.
    """
    before, behind = ([f"{name}[{k}]" for k in range(3)] for name in _GYROS)
    time, names = log.time(), ("headspeed", "tailspeed")
    if missing := {*before, *behind} - {*log.columns}:
        return f"vibration isn't told without {', '.join(sorted(missing))} in the log"
    speed, tail = (log[one] / 60.0 if one in log.columns else 0.0 * time for one in names)
    at = np.flatnonzero(speed >= _UNDER * np.median(speed[speed >= 0.5 * np.max(speed)]))
    here = max(np.split(at, np.flatnonzero(np.diff(time[at]) > _BREAK) + 1), key=len)
    step = usual_step(time[here], [(-np.inf, np.inf)])[0]
    if not step:
        return "vibration isn't told: the log is too short"
    columns = [np.radians(log[one])[here] for one in (*before, *behind)]
    even = _even(time[here], step, columns)
    pair = even[:, :3], even[:, 3:]
    raw, now = (_Gyros(source, 1.0 / step, [one]) for source, one in zip(_GYROS, pair))
    if not raw.enough:
        return f"vibration isn't told: the gyro is logged {raw.rate:.0f} times a second"
    frequency, logged = raw.spectra()
    line, tones = float(frequency[1]), _tones(frequency, logged)
    rotor = float(np.median(speed[here])) or _comb(tones, line) or math.nan
    turned = float(np.median(tail[here])) / rotor or _tail(tones, rotor, line)
    turns = [_turns(at, rotor, turned, raw.rate, line) for at in tones]
    spectra = np.array([logged, now.spectra()[1]])
    sizes = _amplitudes(frequency, spectra[1], tones)
    moved = np.einsum("cik,ki->kc", np.abs(felt(2.0 * np.pi * np.array([*tones]))), sizes)
    both = csd(pair[0], pair[1], raw.rate, nperseg=raw.window, axis=0)[1].sum(axis=1)
    ratio = both / logged.sum(axis=0)

    def filters(at: Real) -> Complex:
        return np.interp(at, 2.0 * np.pi * frequency, ratio)

    peaks = _peaks(frequency, spectra, tones, turns, moved.max(axis=1))
    return Vibration(raw.name, raw.rate, frequency, spectra, rotor, turned, peaks, (filters,))


def _tones(frequency: Real, logged: Real) -> dict[float, float]:
    """Return tones, Hz -> dB over the floor, of spectra, (3, n_freq)."""
    line, level = float(frequency[1]), 10.0 * np.log10(np.maximum(logged, 1e-30))
    above = level - median_filter(level, size=(1, round(_BAND / line)), mode="nearest")
    highest = np.where(frequency < _LOWEST, 0.0, above.max(axis=0))
    near = [slice(k - 2, k + 3) for k in find_peaks(highest, _ABOVE, distance=3)[0].tolist()]
    return {
        float(np.average(frequency[one], weights=logged[:, one].sum(axis=0))): max(highest[one])
        for one in near
    }


def _peaks(
    frequency: Real,
    spectra: Real,
    tones: Mapping[float, float],
    turns: Iterable[tuple[str, int]],
    moved: Real,
) -> tuple[Peak, ...]:
    """Return tones in spectra as logged, behind today's filters and, if there, proposed ones."""
    sizes = [_amplitudes(frequency, one, tones) for one in spectra]
    largest = [one.max(axis=1).tolist() for one in sizes]
    columns = (
        [*tones],
        [float(one) for one in tones.values()],
        [RATES[k] for k in sizes[0].argmax(axis=1)],
        [f"{n}/rev of {which}" if n else "" for which, n in turns],
        *largest,
        *[[None] * len(tones)] * (3 - len(largest)),
        moved.tolist(),
    )
    return tuple(Peak(*row) for row in zip(*columns))


def _sources(log: DataFlash) -> Iterator[_Gyros]:
    """Yield what a log has of its gyros in flight, best first."""
    own, events = log.parameters(), log.table("EV") if log.has("EV", "Id") else None
    lifted, landed = (
        [] if events is None else events.time[np.asarray(events["Id"]) == one] for one in _EVENTS
    )
    start = min(lifted, default=-np.inf)
    stop = max((one for one in landed if one > start), default=np.inf) - _LANDS
    if "ISBH" in log and "ISBD" in log:
        heads = log.table("ISBH", log.instances("ISBH")[0])
        numbers = log.table("ISBD")["N"]
        rows = np.stack([log.arrays("ISBD", one) for one in "xyz"], axis=-1)
        here = (np.asarray(heads["type"]) == _GYRO) & (heads.time > start) & (heads.time < stop)
        number, scale, rate = (np.asarray(heads[one])[here] for one in ("N", "mul", "smp_rate"))
        parts = [rows[numbers == n].reshape(-1, 3) / by for n, by in zip(number, scale)]
        yield _Gyros(
            "ISBD", float(max(rate, default=0.0)), parts, _is_set(own, ("INS_LOG_BAT_OPT", 2))
        )
    for name in (one for one in _MESSAGES if log.has(one, *_MESSAGES[one][0])):
        fields, factor, behind = _MESSAGES[name]
        table = log.table(name, log.instances(name)[0])
        here = (table.time > start) & (table.time < stop)
        step = usual_step(table.time, [(start, stop)])[0]
        if step:
            columns = [np.asarray(table[one], np.float64)[here] for one in fields]
            part = factor * _even(table.time[here], step, columns)
            yield _Gyros(name, 1.0 / step, [part], behind is True or _is_set(own, behind))


def _even(time: Real, step: float, columns: Iterable[Real]) -> Real:
    """Return columns, (n_time,) each, at even steps, (n, n_column); gaps are bridged."""
    gone = np.rint(np.diff(time, prepend=time[0]) / step)
    ticks, first = np.unique(np.cumsum(gone), return_index=True)
    even = np.arange(ticks[-1] + 1.0)
    return np.column_stack([np.interp(even, ticks, one[first]) for one in columns])


def _is_set(own: Mapping[str, float], bit: tuple[str, int]) -> bool:
    return bool(int(own.get(bit[0], 0.0)) & bit[1])


def _sensed(log: DataFlash) -> tuple[str, float]:
    """Return the message that tells a rotor's speed, and its Hz; "" and 0 if none is live."""
    for name, column in _SPEEDS:
        if log.has(name, column):
            speed = np.asarray(log.table(name, log.instances(name)[0])[column], np.float64)
            if np.ptp(speed) > 0.0:  # one that stays the same is of no sensor
                return name, float(np.median(speed[speed > 0.5 * np.max(speed)])) / 60.0
    return "", 0.0


def _amplitudes(frequency: Real, spectra: Real, tones: Iterable[float]) -> Real:
    """Return tones' amplitudes about each axis, (n_tone, 3) rad/s, with the noise beside them."""
    wide = [np.abs(frequency - at) <= max(3.0 * frequency[1], _DRIFT * at) for at in tones]
    sums = [spectra[:, near].sum(axis=1) for near in wide]
    return np.sqrt(2.0 * frequency[1] * np.reshape(sums, (-1, len(RATES))))


def _multiple(at: float, base: float, line: float, most: int) -> int:
    """Return which multiple of a base a frequency is, 0 if of none or where that is unknown."""
    n = round(at / base) if base == base else 0
    return n if 0 < n <= most and abs(at - n * base) <= max(1.5 * line, _SLACK * at) else 0


def _comb(tones: Mapping[float, float], line: float) -> float | None:
    """Return what most tones, Hz -> dB, are the first multiples of, Hz; None without two."""

    def matched(one: float) -> dict[int, float]:
        return {n: at for at in tones if (n := _multiple(at, one, line, _COMB))}

    low, high = _ROTORS
    tried = [at / n for at in tones for n in range(1, _COMB + 1) if low <= at / n <= high]
    worth = {one: round(sum(tones[at] for at in matched(one).values())) for one in tried}
    found = matched(max(tried, key=lambda one: (worth[one], one))) if tried else {}
    return (
        None
        if len(found) < 2
        else sum(n * at for n, at in found.items()) / sum(n * n for n in found)
    )


def _tail(tones: Mapping[float, float], rotor: float, line: float) -> float:
    """Return the turns of the tail rotor for one of the main one's by the tones, NaN if unknown."""
    low, high = _RATIOS
    rest = {
        at: (any(_multiple(one, at, line, 2) == 2 for one in tones), above)
        for at, above in tones.items()
        if low <= at / rotor <= high and not _multiple(at, rotor, line, _HARMONICS)
    }
    return max(rest, key=lambda at: rest[at]) / rotor if rest else float("nan")


def _turns(at: float, rotor: float, tail: float, rate: float, line: float) -> tuple[str, int]:
    """Return what turns so, "" if unknown, and which multiple of its speed it is."""
    for seen, word in ((at, ""), (rate - at, f", if {rate - at:.4g} Hz appears there")):
        for name, base, most in (("main", rotor, _HARMONICS), ("tail", tail * rotor, _COMB)):
            if n := _multiple(seen, base, line, most):
                return name + word, n
    return "", 0


def _notches(
    asked: list[tuple[str, int]], bases: Mapping[str, float], follows: float
) -> tuple[dict[str, float], tuple[Notch, ...]]:
    """Return parameters of notches for multiples of the rotors' speeds, and static ones alike.

    `bases` are those speeds, Hz, and `follows` the one that RPM messages say, 0 without.
    """
    settings: dict[str, float] = {}
    notches = []
    for name, (which, base) in zip(NOTCHES, bases.items()):
        bits = sum(1 << n - 1 for turns, n in asked if turns == which)
        words = {"ENABLE": 0.0}
        if bits:
            used = Notch(round(base, 1), max(_NARROWEST, round(_WIDTH * base)), _DEPTH, bits)
            notches.append(used)
            under, over = (_UNDER, base / follows) if follows else (1.0, 0.0)
            words = {
                "ENABLE": 1.0, "MODE": 2.0 * (follows > 0.0), "REF": round(over, 4),
                "FREQ": round(under * used.centre, 1), "BW": round(under * used.bandwidth, 1),
                "ATT": used.attenuation, "HMNCS": float(used.harmonics), "OPTS": 0.0,
            }  # fmt: skip
        settings |= {f"{name}_{word}": value for word, value in words.items()}
    return settings, tuple(notches)
