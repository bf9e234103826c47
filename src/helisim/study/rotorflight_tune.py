"""Gains of a Rotorflight helicopter from Blackbox logs of ordinary flying: loops today, and better.

About a steady flight the law's response is linear in each gain, so a few responses tell those of
all gains. Settings and units: design.laws.rotorflight.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from helisim.base.arrays import Complex, Real
from helisim.base.errors import LogError
from helisim.base.linear import Linear
from helisim.base.note import Note
from helisim.base.settings import setting_names
from helisim.design.laws import rotorflight as of
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.figures import MOST_GAIN, margins
from helisim.handling.loop import Curve, axis_of
from helisim.handling.measured.interval import Interval
from helisim.handling.predicted import PredictedLoop
from helisim.ident import blocks
from helisim.logs.blackbox import Blackbox, open_blackbox, read_dump
from helisim.logs.read import read_log
from helisim.logs.source import file_digest
from helisim.look.speeds import droop, most_flown
from helisim.look.vibration import blackbox_vibration
from helisim.records.record import IN1, IN2, RATES, one_blas_thread
from helisim.sitl.gains import STANDARD, Gains, Required, holds, tuned_axes
from helisim.study.gusts import whites
from helisim.study.log_tune import (
    DRAWS,
    AxisTuning,
    Changed,
    LogTuning,
    retuned,
    searched,
    whole_plant,
)
from helisim.study.rotorflight_models import BAND, FLY, models_of

_AXES = {"lat": "roll", "lon": "pitch", "ped": "yaw"}
# A log is filled where it lost frames for a moment, s, else split; records are so long, s, at least
_READ: Any = {"repair": ("gaps", "resets"), "max_gap": 0.1, "min_duration": 10.0}
_HITS = 5  # places where a log was hit, from which as many more, unseen, bias models
_ENDS = (1.0, 1000.0)  # of a setting, between which its slope is taken
_HELD = np.geomspace(2.0, 150.0, 23)  # 1/s, of I over P
_TERMS = "pidfbo"  # in the header's order, which has O elsewhere
_LINES = {  # of the header, besides P, I and D
    **{
        f"{axis}BW": [(axis, f"{one}_cutoff") for one in ("gyro", "d", "b")]
        for axis in _AXES.values()
    },
    "yaw_stop_gain": [("yaw", "cw_stop_gain"), ("yaw", "ccw_stop_gain")],
    "hsi_gain": [("roll", "o"), ("pitch", "o")],
}
_WHYS = {
    "p": "rate held in gusts, until gain margin and noise end it",
    "i": "attitude held, until phase margin and peak end it",
    "d": "gives back phase that P and I take, and passes noise on",
    "f": "the command that holds the rate of the setpoint",
}


@dataclass(frozen=True, eq=False)
class Feedback:
    """Rotorflight's law by its gains, commands in rad of blade pitch; it is `Linear`.

    `gains` is axis -> setting -> value, which needn't be whole; others are those of `law`.
    """

    law: of.Rotorflight
    period: float
    gains: Mapping[str, Mapping[str, float]]
    inputs: tuple[str, ...] = (*RATES, *IN2)
    outputs: tuple[str, ...] = IN1

    def response(self, frequency: Real) -> Complex:
        """Return the response, (4, 7, n_freq), at frequencies, (n_freq,) rad/s."""
        omega = tuple(np.asarray(frequency, np.float64).tolist())
        found = np.array(_response(self.law, self.period, omega))
        for axis, settings in self.gains.items():
            today = getattr(self.law, axis)
            for name, value in settings.items():
                if by := value - getattr(today, name):
                    found += by * _slope(self.law, self.period, omega, axis, name)
        return found

    def felt(self, frequency: Real) -> Complex:
        """Return cyclic and pedals, 1 being full, over rates, (3, 3, n_freq), at rad/s."""
        full = np.reshape([of.CYCLIC_PITCH, of.CYCLIC_PITCH, of.TAIL_PITCH], (3, 1, 1))
        return self.response(frequency)[[IN1.index(one) for one in _AXES], : len(RATES)] / full


_linear = lru_cache(maxsize=64)(of.Rotorflight.linear)


@lru_cache(maxsize=64)
def _response(law: of.Rotorflight, period: float, omega: tuple[float, ...]) -> Complex:
    return _linear(law, period).response(np.array(omega))


@lru_cache(maxsize=64)
def _slope(
    law: of.Rotorflight, period: float, omega: tuple[float, ...], axis: str, name: str
) -> Complex:
    """Return the response's slope over a setting, in which it is linear."""
    low, high = (_response(law.replace({f"{axis}.{name}": one}), period, omega) for one in _ENDS)
    return (high - low) / (_ENDS[1] - _ENDS[0])


def law_of_log(
    log: Blackbox, dump: Mapping[str, str] | None = None, collective: float = 0.0
) -> of.Rotorflight:
    """Return the law that flew by a log's header, for commands in rad of blade pitch.

    It has no filters of the gyro, as the log's gyro is behind them; O acts as at a mean
    `collective`, rad. What the header lacks beside gains is as in `dump`, as of `read_dump`, or the
    firmware's default; F and O of roll and pitch follow from the log's terms. Raises LogError for
    another firmware's log, where the header lacks P, I or D, and for a dump of other gains.
    """
    header, place = log.header, log.path.name
    if not log.firmware.startswith("Rotorflight") or "mixer[0]" not in log.columns:
        raise LogError(
            f"{place}: gains are told of Rotorflight 4.3 and later, whose log has mixer[0] to "
            f"mixer[3]; this one is of {log.firmware or 'an unknown firmware'}; its models are "
            "told by helisim identify"
        )

    axes: dict[str, dict[str, float]] = {}
    for k, axis in enumerate(_AXES.values()):
        gains = dict(zip(_TERMS, _numbers(log, f"{axis}PID", 3)))
        if axis != "yaw" and {f"axisF[{k}]", f"setpoint[{k}]"} <= log.columns.keys():
            (by,), *_ = np.linalg.lstsq(log.raw(f"setpoint[{k}]")[:, None], log.raw(f"axisF[{k}]"))
            gains = {
                "f": float(np.clip(np.rint(1e-3 * by / of.SCALES[axis]["f"]), 0, 1e3)),
                **gains,
                **({} if f"axisO[{k}]" in log.columns else {"o": 0.0}),  # logged above 0 alone
            }
        told = _dumped(axis, dump or {})
        if others := [name for name in gains.keys() & told.keys() if gains[name] != told[name]]:
            raise LogError(
                f"{place}: {axis}'s {', '.join(sorted(others))} is another in the dump of the "
                "command line than in the log's header or terms; give a dump of the settings that "
                "flew"
            )
        # a law without any I holds nothing, but has its loop
        axes[axis] = {"range": 1.0, **told, **gains, "i": max(gains["i"], 1e-6)}
    for line in _LINES.keys() & header.keys():
        for (axis, name), number in zip(_LINES[line], _numbers(log, line, 2)):
            axes[axis][name] = number
    return of.Rotorflight(
        roll=of.CyclicRotorflight(**axes["roll"]),
        pitch=of.CyclicRotorflight(**axes["pitch"]),
        yaw=of.YawRotorflight(**axes["yaw"]),
        collective=of.CollectiveRotorflight(range=1.0, centre=collective),
        gyro_lowpass=0.0,
    )


def _dumped(axis: str, dump: Mapping[str, str]) -> dict[str, float]:
    """Return an axis's gains and cutoffs that a dump of the command line has. Raises LogError."""
    found = {}
    for own in setting_names(of.YawRotorflight if axis == "yaw" else of.CyclicRotorflight):
        name = f"{axis}_{own}_gain" if own in _TERMS else f"{axis}_{own}"
        if name in dump and name.endswith(("_gain", "_cutoff")):
            if not dump[name].isdigit():
                raise LogError(f"the dump's {name} is {dump[name]!r}, expected a whole number")
            found[own] = float(dump[name])
    return found


def _numbers(log: Blackbox, name: str, count: int) -> list[float]:
    """Return the numbers of a line of the header. Raises LogError if there are fewer."""
    try:
        found = [float(one) for one in log.header[name].split(",")]
    except (KeyError, ValueError):
        found = []
    if len(found) < count or not np.all(np.isfinite(found)):
        raise LogError(
            f"{log.path.name}: the header's {name} is {log.header.get(name, 'missing')!r}, "
            f"expected {count} number(s)"
        )
    return found


def command_of(axis: str, name: str) -> float:
    """Return the command, rad, of one of a gain by 1 rad/s (P, F), 1 rad (I) or 1 rad/s^2 (D)."""
    return math.degrees(
        of.SCALES[axis][name] * (of.TAIL_PITCH if axis == "yaw" else of.CYCLIC_PITCH)
    )


@one_blas_thread()
def tune_blackbox(
    logs: Sequence[str],
    *,
    dump: str | None = None,
    required: Required = STANDARD,
    seed: int = 1,
    on_step: Callable[[str], None] = lambda _: None,
) -> LogTuning:
    """Return a Rotorflight helicopter's loops and better gains, from Blackbox logs of its flights.

    Models from the mixer's commands to the gyro are identified by prediction, which feedback and
    gusts don't bias. Figures are those from 2 rad/s on: what is slower the pilot holds. Gains and
    filters are the header's, or those of `dump`, a file of `diff all` on the command line. Better
    gains are as of `tune_log`. Raises StorageError, LogError, RecordError where nothing lasts for
    10 s, IdentificationError or InputError.
    """
    names, paths = tuple(str(one) for one in logs), [Path(one) for one in logs]
    first = open_blackbox(paths[0], file_digest(paths[0]), None)
    told = None if dump is None else read_dump(dump)
    law, remarks = law_of_log(first, told), list[str]()
    period = 1e-6 * math.prod(
        _numbers(first, one, 1)[0]
        for one in ("looptime", *({"pid_process_denom"} & first.header.keys()))
    )
    if told is None and (
        lacks := [
            one
            for one in _LINES
            if one not in first.header and (one != "hsi_gain" or "axisO[0]" in first.columns)
        ]
    ):
        remarks.append(
            f"the header lacks {', '.join(lacks)}, as before Rotorflight 4.4: the firmware's "
            "defaults are taken; give a dump of the command line (diff all)"
        )
    if others := [
        one.name
        for one in paths[1:]  # one at a time: a log is large
        if law_of_log(open_blackbox(one, file_digest(one), None), told) != law
    ]:
        raise LogError(
            f"{', '.join(others)}: other gains or filters than in "
            f"{paths[0].name}: today's loops are of one law; tune each by itself"
        )
    read = [
        read_log(path, **_READ, resample_hz=1.0 / one.report.step[1])
        if any(part.uneven for part in one.report.parts)
        else one
        for path, one in zip(paths, (read_log(one, **_READ) for one in paths))
    ]
    col = np.concatenate([one["col"] for log in read for one in log.records])
    law = law_of_log(first, told, float(np.mean(col)))
    records, said = most_flown([one for log in read for one in log.records])
    remarks += [
        *(
            one.text.partition("; the repair ")[0]  # which is of other commands
            for log in read
            for one in log.report.findings
            if one.kind != "angle wraps"
        ),
        *said,
        *droop(records),
    ]
    today = Feedback(law, period, {})
    on_step("vibration")
    heard = blackbox_vibration(first, today.felt)
    remarks, heard = ([*remarks, heard], None) if isinstance(heard, str) else (remarks, heard)
    on_step("models")
    corner = _numbers(first, "acc_lpf_hz", 1)[0] / 100.0 if "acc_lpf_hz" in first.header else 10.0
    # a Bessel filter, 3 dB down at the corner, 10 Hz by default
    felt = blocks.second_order("acc", omega=1.2720 * math.tau * corner, zeta=math.sqrt(0.75))
    hit = [
        Note(
            "corruption",
            f"no whole frame is in {count} places of the log: where it is hit inside a frame, "
            "numbers are wrong that nobody sees; read it out of the memory anew",
        )
        for count in [
            sum(open_blackbox(one, file_digest(one), None).counts["corrupt"] for one in paths)
        ]
        if count > _HITS
    ]
    fits, wrong = models_of(
        records, remarks, {"az": felt} if corner else {}, "motor[1]" in first.columns, hit
    )
    if not (held := [fit for fit in fits if "col" not in fit.structure.inputs]):
        return LogTuning(names, heard, remarks=tuple(remarks), fits=tuple(fits))
    plant = whole_plant(held, period=period)
    plants = [plant, *plant.draws(DRAWS, seed=seed)]
    on_step("loops as flown")
    axes = tuned_axes(plant)
    stays = dict(zip(axes, map(PredictedLoop.of(plants, today, BAND[0]).figures, axes)))
    wrong = {
        axis: f"it crosses over at {at:.3g} rad/s, and the flight tells the model to {top:.3g}; "
        + FLY
        for fit in held
        for axis in fit.structure.inputs
        for at in [stays[axis]["crossover"].value]
        for top in [max(to for pair, (_, to) in fit.bands.items() if pair.endswith(f"/{axis}"))]
        if at > top
    } | wrong
    gusts = {axis: whites(plant, today, axis) for axis in axes}
    on_step("candidates")
    gains, tuned, none = searched(
        plants,
        lambda some: _with(law, period, some),
        today,
        {axis: one for axis, one in stays.items() if axis not in wrong},
        required._replace(lowest=BAND[0]),
        gusts,
        rounded=_whole,
        held=dict.fromkeys(axes, _HELD),
    )
    better, found = _with(law, period, gains), []
    for axis in axes:
        loop = ClosedLoop(plant, today).broken(axis)
        shown = _seen(stays[axis], loop, f"{axis_of(axis).word} today", remarks)
        if axis in wrong:
            shown = {
                name: Interval(figure.value, math.nan, math.nan) for name, figure in shown.items()
            }
        one = AxisTuning(
            axis, False, shown, why=(none | wrong).get(axis, ""), loops={"today": loop}
        )
        if axis in gains:
            changes = _changes(
                axis,
                gains[axis],
                law,
                plants,
                ahead=told is not None
                or (axis != "ped" and "axisF[0]" in first.columns)
                or len(_numbers(first, f"{_AXES[axis]}PID", 3)) > len("pid"),
            )
            shown = _seen(
                tuned[axis],
                ClosedLoop(plant, better).broken(axis),
                f"{axis_of(axis).word} with new gains",
                remarks,
            )
            one = retuned(one, plant, today, better, shown, changes, gusts[axis])
        found.append(one)
    return LogTuning(
        names,
        heard,
        tuple(found),
        tuple(dict.fromkeys(remarks)),
        fits=tuple(fits),
        form="set {} = {}",
    )


def _seen(
    figures: Mapping[str, Interval], loop: Curve, whose: str, remarks: list[str]
) -> dict[str, Interval]:
    """Return figures; a gain margin beyond the models' band gets no bounds, and a remark."""
    nearest, size = min(
        (turn for turn in margins(loop).gain if turn[0] >= BAND[0]),
        key=lambda turn: abs(turn[1]),
        default=(float(loop.frequency[-1]), MOST_GAIN),
    )
    if nearest <= BAND[1]:
        return dict(figures)
    remarks.append(
        f"{whose}: the gain margin is about {abs(size):.0f} dB by the models alone, as it lies at "
        f"{nearest:.0f} rad/s, beyond the {BAND[1]:g} rad/s to which flights tell them"
    )
    return {**figures, "gain_margin": Interval(abs(size), math.nan, math.nan)}


def _settings(axis: str, gains: Gains) -> dict[str, float]:
    """Return P, I and D in the command line's units, not rounded."""
    return {
        term: one / command_of(_AXES[axis], term)
        for term, one in zip("pid", (gains.p, gains.angle * gains.p, gains.d))
    }


def _with(law: of.Rotorflight, period: float, gains: Mapping[str, Gains]) -> Feedback:
    return Feedback(law, period, {_AXES[axis]: _settings(axis, one) for axis, one in gains.items()})


def _whole(axis: str, gains: Gains) -> Gains:
    """Return gains as whole settings give them."""
    p, i, d = (
        command_of(_AXES[axis], term) * round(max(one, term != "d"))
        for term, one in _settings(axis, gains).items()
    )
    return Gains(p, 0.0, d, gains.ff, i / p)


def _changes(
    axis: str, gains: Gains, law: of.Rotorflight, plants: Sequence[Linear], *, ahead: bool
) -> tuple[Changed, ...]:
    """Return the settings that change.

    F does where the header has it (`ahead`) and the flight tells another by more than its error.
    """
    today, unit = getattr(law, _AXES[axis]), command_of(_AXES[axis], "f")
    settings = {term: round(one) for term, one in _settings(axis, gains).items()}
    fed, *others = (holds(plant, axis) / unit for plant in plants)
    error = 1.96 * float(np.std(others))
    if ahead and 0.0 < fed < 1000.0 and abs(fed - today.f) > error:
        settings["f"] = round(fed)
    return tuple(
        Changed(
            f"{_AXES[axis]}_{term}_gain",
            float(round(getattr(today, term))),
            float(value),
            _WHYS[term],
            error if term == "f" else None,
        )
        for term, value in settings.items()
        if value != round(getattr(today, term))
    )
