"""Gains of a Rotorflight helicopter from Blackbox logs of ordinary flying: loops today, and better.

About a steady flight the law's response is linear in each gain, so a few responses tell those of
all gains. Settings and units: design.laws.rotorflight.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from helisim.base.arrays import Complex, Real
from helisim.base.errors import IdentificationError, InputError, LogError
from helisim.base.linear import Linear
from helisim.base.note import Note
from helisim.base.settings import setting_names
from helisim.design.laws import rotorflight as of
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.figures import MOST_GAIN, margins
from helisim.handling.loop import Curve, axis_of
from helisim.handling.measured.interval import Interval
from helisim.handling.predicted import PredictedLoop
from helisim.ident import Fit, FrequencyResponse, Structure, blocks, identify, in_series, structures
from helisim.logs.blackbox import Blackbox, open_blackbox, read_dump
from helisim.logs.read import read_log
from helisim.logs.source import file_digest
from helisim.look.speeds import droop, most_flown
from helisim.look.systemid import InferredFit, estimate_fits, followed_band
from helisim.look.vibration import blackbox_vibration
from helisim.records.record import IN1, IN2, RATES, FlightRecord, one_blas_thread
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

_AXES = {"lat": "roll", "lon": "pitch", "ped": "yaw"}
_BAND = (2.0, 45.0)  # rad/s; below it speed changes matter, above it ordinary flying moves little
# rms of the relative difference between a flight's responses and the mean of those along it, as
# sticks move most in some of it, where airspeed does little (scripts/proof/rotorflight_study.py)
# From its lowest frequency to its highest, of an on-axis response: less tells no delay from damping
# s, of any delay: a servo's pulses come at most 560 times a second; less is a controller's inverse
_ELSEWHERE, _WIDE, _LATE = 0.015, 4.0, 0.0018
# The collective moves the nose, and by precompensation the pedals. Gusts hide how a speed flaps
# back: the JR700 has 0.002 and -0.005 rad s/m, the Blade 360 0.004 and -0.008. Last, the band's
# lower edge, rad/s: below yaw's, airspeed turns the nose into or off the wind, which changes by
# 10 to 60 % along a flight
_FITS = (
    (
        structures.rollpitch_round.with_fixed(
            {"A_u": 0.003, "A_v": 0.0}, {"A_u": 0.002, "A_v": 0.007}
        ),
        ("ped", "col"),
        _BAND[0],
    ),
    (structures.yaw_alone, ("lat", "lon", "col"), 4.0),
    (structures.heave_imu, ("lat", "lon", "ped"), _BAND[0]),
)
# A log is filled where it lost frames for a moment, s, else split; records are so long, s, at least
_READ: Any = {"repair": ("gaps", "resets"), "max_gap": 0.1, "min_duration": 10.0}
# A_b + B_a, of the usual rotor: taken for it where a flight tells it no better. Places where a log
# was hit, from which as many more, unseen, bias models
_ODD, _HITS = 0.15, 5
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
_FLY = (
    "fly for two minutes or more at one head speed in calm air with quick stops and reversals of "
    "each stick by itself, climbs and pitch pumps, too, and log setpoint, mixer, PID, gyro, "
    "attitude and accelerometer at 250 Hz or more"
)


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
    gains are as of `tune_log`. Raises StorageError, LogError, IdentificationError or InputError.
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
    fits, wrong = _models(
        records, remarks, {"az": felt} if corner else {}, "motor[1]" in first.columns, hit
    )
    if not (held := [fit for fit in fits if "col" not in fit.structure.inputs]):
        return LogTuning(names, heard, remarks=tuple(remarks), fits=tuple(fits))
    plant = whole_plant(held, period=period)
    plants = [plant, *plant.draws(DRAWS, seed=seed)]
    on_step("loops as flown")
    axes = tuned_axes(plant)
    stays = dict(zip(axes, map(PredictedLoop.of(plants, today, _BAND[0]).figures, axes)))
    wrong = {
        axis: f"it crosses over at {at:.3g} rad/s, and the flight tells the model to {top:.3g}; "
        + _FLY
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
        required._replace(lowest=_BAND[0]),
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


def _models(
    records: Sequence[FlightRecord],
    remarks: list[str],
    behind: Mapping[str, Structure],
    motor_tail: bool,
    doubts: Sequence[Note] = (),
) -> tuple[list[Fit], dict[str, str]]:
    """Return models that flights tell, and why an axis has no gains; extend the remarks.

    `behind` are filters through which channels are logged, `doubts` those that hold for all models.
    Errors hold what flights differ by.
    """
    fits, wrong = list[Fit](), dict[str, str]()

    def moving(*names: str) -> tuple[str, ...]:
        return tuple(
            name
            for name in names
            if any(name in record and np.ptp(record[name]) > 0.0 for record in records)
        )

    for own, others, low in _FITS if records else ():
        if motor_tail and "ped" in own.inputs:
            remarks.append("yaw: a motor drives the tail, whose throttle has no model here")
            continue
        words = " and ".join(axis_of(one).word for one in own.inputs)
        needed = (*(one.upper() for one in own.inputs), *own.outputs)
        if len(moving(*needed)) < len(needed):
            remarks.append(
                f"no model of {words}: a setpoint of it, or what answers "
                f"({', '.join(own.outputs)}), is not logged or never moves, and feedback alone "
                f"shows the controller's inverse; {_FLY}"
            )
            continue
        try:
            asked = InferredFit(
                own.name, own.inputs, own.outputs, moving(*others), ("none",), (low, _BAND[1]), ""
            )
            estimate = _elsewhere(
                estimate_fits(records, [asked], "predictor")[0],
                max(one.sample_time for one in records),
                doubts,
            )
            own = in_series(own, outputs={k: x for k, x in behind.items() if k in own.outputs})
            band = followed_band(estimate, own, asked.band)
            fit = identify(estimate, own, band=band)
            if "odd_cross" in own.names and not fit.parameters["odd_cross"].standard_error < _ODD:
                tied = own.with_fixed({"odd_cross": 0.0}, {"odd_cross": _ODD})
                fit = identify(estimate, tied, band=band)
            if blind := [
                *(
                    name
                    for name, one in fit.parameters.items()
                    if math.isinf(one.standard_error)
                    or (one.definition.unit == "s" and not one.fixed and one.value < _LATE)
                ),
                *(
                    f"{pair} beyond {low:.3g} to {high:.3g} rad/s"
                    for pair, (low, high) in fit.bands.items()
                    if high < _WIDE * low and pair in map("/".join, zip(own.outputs, own.inputs))
                ),
            ]:
                raise IdentificationError(f"the flight does not show {', '.join(blind)}")
        except (IdentificationError, InputError) as error:
            remarks.append(f"no model of {words}: {error}; {_FLY}")
            continue
        # lost frames are told by their numbers; whole counts lie on straight lines, too
        if any(reason.kind != "lost" for reason in fit.verdict.reasons):
            # figures of a doubtful model may be of motion as large as was flown, and not of all
            wrong |= dict.fromkeys(own.inputs, f"the model's {fit.verdict}; {_FLY}")
        fits.append(fit)
        remarks += [_lift(fit) for name in own.inputs if name == "col"]
    return fits, wrong


def _elsewhere(found: FrequencyResponse, step: float, doubts: Sequence[Note]) -> FrequencyResponse:
    """Return a response whose errors hold by how much, and how late, flights differ.

    They differ by more below twice the lowest frequency, where airspeed has time to act. What
    feedback shows in records biases no prediction by what the law itself saw, and firmware names
    its columns: a soft rotor may move the other axis more. Its commands went out as they are
    logged, each `step`, s: what they last, the last gap, is half of one.
    """
    assert found.scatter is not None
    whole = np.pad(found.response, ((0, 0), (0, len(found.conditioning)), (0, 0)))
    half, gap = 0.5j * step * found.frequency * whole, np.asarray(found.scatter.gap)
    share = _ELSEWHERE * np.hypot(1.0, (2.0 * found.frequency[0] / found.frequency) ** 2)
    gaps = *gap[:-1], np.where(np.abs(gap[-1]) > np.abs(half), half, gap[-1])
    return replace(
        found,
        scatter=replace(found.scatter, gap=np.stack([*gaps, share * whole, 1j * share * whole])),
        evidence=(
            *(one for one in found.evidence if one.kind not in ("feedback", "columns")),
            *doubts,
        ),
    )


def _lift(fit: Fit) -> str:
    """Return what a heave model says, with 95 % intervals."""
    by, late, damping = (
        f"{scale * one.value:.3g} ({min(ends):.3g} to {max(ends):.3g})"
        for name, scale in (("Z_col", -math.radians(1.0)), ("tau_col", 1e3), ("Z_w", -1.0))
        for one in [fit.parameters[name]]
        for ends in [[scale * end for end in one.interval]]
    )
    return (
        f"heave: a degree more of collective lifts it by {by} m/s^2, {late} ms late, and climbing "
        f"brakes it by {damping} of its speed a second; {fit.verdict}; no gain holds heave"
    )


def _seen(
    figures: Mapping[str, Interval], loop: Curve, whose: str, remarks: list[str]
) -> dict[str, Interval]:
    """Return figures; a gain margin beyond the models' band gets no bounds, and a remark."""
    nearest, size = min(
        (turn for turn in margins(loop).gain if turn[0] >= _BAND[0]),
        key=lambda turn: abs(turn[1]),
        default=(float(loop.frequency[-1]), MOST_GAIN),
    )
    if nearest <= _BAND[1]:
        return dict(figures)
    remarks.append(
        f"{whose}: the gain margin is about {abs(size):.0f} dB by the models alone, as it lies at "
        f"{nearest:.0f} rad/s, beyond the {_BAND[1]:g} rad/s to which flights tell them"
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
