"""Gains of an ArduCopter-heli from its own flight log: its loops today, and better ones."""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from helisim.base.arrays import Real
from helisim.base.errors import IdentificationError, InputError, LogError
from helisim.base.linear import Linear
from helisim.base.settings import Value, to_plain
from helisim.design.plant import Plant
from helisim.handling.arducopter import WORDS, ArduCopterLaw
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.figures import margins
from helisim.handling.loop import Curve, axis_of
from helisim.handling.measured.interval import Interval, figures_of, intervals
from helisim.handling.measured.margins import MeasuredLoop
from helisim.handling.predicted import ATTITUDE_DRB, FlownPlant, PredictedLoop
from helisim.ident import Fit, identify, structures
from helisim.logs.dataflash import DataFlash, open_dataflash
from helisim.logs.source import file_digest
from helisim.look.loops import flown_law, flown_loops
from helisim.look.sticks import StickResponse, stick_response
from helisim.look.sweeps import own_sweeps
from helisim.look.systemid import Inferred, estimate_fits, followed_band, infer
from helisim.look.vibration import Vibration, vibration
from helisim.records.record import ATTITUDES, RATES, one_blas_thread
from helisim.sitl.gains import (
    BAND,
    HELD,
    STANDARD,
    Gains,
    NoGains,
    Required,
    holds,
    passed,
    search,
    tuned_axes,
)
from helisim.sitl.parameters import AutopilotParameters, Setting
from helisim.sitl.pilot import MODES
from helisim.study.gusts import errs, flown_moves, histories, whites

Paths = str | PathLike[str] | Iterable[str | PathLike[str]]

DRAWS = 200  # models that fit as well as the identified one, of which intervals are made
_SEARCHED = 40  # of them, that every tried gain must satisfy
_TRIES = 4  # searches, each with more margin where the last one's intervals had too little
_BEYOND = 1.1  # by which a search asks for more than its last one lacked, and besides
_MORE = (0.1, math.radians(0.5), 0.05)  # dB, rad, dB: more than rounded gains lose
_WORTH = 1.03  # ratio of what disturbances leave, below which today's gains stay
LOUDER = 1.49  # most noise of the command, of that of today's gains: rounding leaves it below 1.5
_LESS = 0.99  # most error in gusts, likewise: rounding leaves it below 1
_SLOPES = (6.0, 10.0)  # Hz, filters of D that are tried
# ArduPilot's yaw follows a root of errors that are larger than an acceleration over the square of
# ATC_ANG_YAW_P: half of ATC_ACCEL_Y_MAX, from 10 to 120 deg/s^2 (AC_AttitudeControl.h and .cpp,
# AC_ATTITUDE_ACCEL_Y_CONTROLLER_MAX_RADSS, update_ang_vel_target_from_att_error; AP_Math's
# sqrt_controller). Up to so many deg it is to be linear; cdeg/s^2 where that is unset or off
_LINEAR, _ACCEL_Y_MAX = 2.0, 27e3
_NARROW = 0.1  # of FF + P: of a rate that is asked for, the share that a wrong FF leaves
_STEPS = (
    "fly in a calm hover in STABILIZE 24 steps of each stick in turn, to one side and the other, "
    "of a quarter of its travel or more, 0.6 to 1.6 s long, with as long a rest after each"
)
_AS_GOOD = "today's gains are as good within the margins"
_UNKNOWN = (
    "its model is too uncertain: no gains keep the margins in 95 % of the models that fit as well"
)
_WHYS = {
    "ANG": "the rate that an error of attitude asks for, 1/s: more follows and rejects sooner, "
    "until phase margin and peak end it",
    "P": "full command by rad/s of rate error: more holds the rate in gusts, until gain margin and "
    "noise end it",
    "I": "half a radian a second of FF + P: takes out what stays",
    "D": "gives back phase that P takes, and passes noise on",
    "FF": "the command that holds 1 rad/s",
    "FLTD": "D's filter, Hz: the lower, the less noise, for which P and D may be more",
}
_NOTCH = {
    "ENABLE": "restart after this, and load the file again: without it the others are hidden",
    "MODE": "0: fixed, 2: follows RPM messages",
    "REF": "the rotor's speed over what RPM says; 0 with a fixed one",
    "FREQ": "Hz: turns of the main rotor, INS_HNTC2 of the tail's; least of them in mode 2",
    "BW": "Hz",
    "ATT": "dB",
    "HMNCS": "bits of the multiples whose tones move the servos: 1, 2, 4, 8 for 1 to 4",
    "OPTS": "single notches",
}
_FIELDS = {"P": "p", "I": "i", "D": "d", "FF": "ff", "FLTD": "slope_hz"}


@dataclass(frozen=True)
class Changed:
    """One parameter of the autopilot: today's value, the candidate's, and why.

    `within` is half the 95 % interval of a value that the model gives by itself, else None.
    """

    name: str
    before: float
    after: float
    why: str
    within: float | None = None

    def __str__(self) -> str:
        error = "" if self.within is None else f"; now +- {self.within:.2g}"
        return f"{self.before:.4g} before{error}: {self.why}"


@dataclass(frozen=True, eq=False)
class AxisTuning(Value):
    """One axis: its loop's figures today, and with the candidate's gains.

    `flown` is whether today's are as flown, where the sweeps show them; `noise`, by how much the
    gyro's noise moves the command more than today, `gusts` the error in gusts likewise. Without a
    candidate, `tuned` and `changes` are empty and `why` says so.
    """

    axis: str
    flown: bool
    today: Mapping[str, Interval]
    noise: float = 1.0
    gusts: float = 1.0
    tuned: Mapping[str, Interval] = field(default_factory=dict)
    changes: tuple[Changed, ...] = ()
    why: str = ""
    loops: Mapping[str, Curve] = field(default_factory=dict, repr=False)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON, without the loops."""
        return to_plain(replace(self, loops={})) | {
            name: {figure: one.to_dict() for figure, one in getattr(self, name).items()}
            for name in ("today", "tuned")
        }


@dataclass(frozen=True, eq=False)
class LogTuning(Value):
    """What a flight log says of its loops, of better gains, by axis, and of vibration; remarks.

    The candidate's gains are for the gyro's notches that `vibration` proposes. `told` is what the
    log says of its sweeps, `modes` its flight modes: s after its first stamp, and name;
    `histories` are times, s likewise, and values, (n_time,) each, by name with unit; `fits` are the
    models, `form` is a line of the parameters' file.
    """

    logs: tuple[str, ...]
    vibration: Vibration | None
    axes: tuple[AxisTuning, ...] = ()
    remarks: tuple[str, ...] = ()
    told: str = field(default="", repr=False)
    modes: tuple[tuple[float, str], ...] = field(default=(), repr=False)
    histories: Mapping[str, tuple[Real, Real]] = field(default_factory=dict, repr=False)
    fits: tuple[Fit, ...] = field(default=(), repr=False)
    form: str = field(default="{} {}", repr=False)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        axes = [one.to_dict() for one in self.axes]
        return {"logs": list(self.logs), "axes": axes, "remarks": list(self.remarks)} | (
            {"vibration": self.vibration.to_dict()} if self.vibration else {}
        )

    @property
    def crossovers(self) -> dict[str, float]:
        """Today's crossovers by the axes' words, rad/s; a usual one where none is known."""
        found = {axis_of(one.axis).word: one.today["crossover"].value for one in self.axes}
        return {word: at for word, at in found.items() if math.isfinite(at)} or {"a loop": 20.0}

    @property
    def changes(self) -> tuple[Changed, ...]:
        """The parameters that change, of all axes."""
        return tuple(each for one in self.axes for each in one.changes)

    @property
    def parameters(self) -> AutopilotParameters:
        """The candidate's parameters, those that change, and the gyro's notches."""
        groups = {
            axis_of(one.axis).word: tuple(
                Setting(each.name, each.after, str(each)) for each in one.changes
            )
            for one in self.axes
            if one.changes
        }
        if self.vibration and (rows := self.vibration.settings):
            groups["notches of the gyro"] = tuple(
                Setting(name, value, _NOTCH[name.split("_")[-1]]) for name, value in rows.items()
            )
        return AutopilotParameters(
            f"gains{' and notches' if self.vibration and self.vibration.filters[1:] else ''} from "
            f"{', '.join(Path(one).name for one in self.logs)}",
            groups,
            form=self.form,
        )


@one_blas_thread()
def tune_log(
    logs: Paths,
    *,
    required: Required = STANDARD,
    seed: int = 1,
    rotor_hz: float | None = None,
    tail: float | None = None,
    on_step: Callable[[str], None] = lambda _: None,
) -> LogTuning:
    """Return an ArduCopter-heli's loops and better gains, from logs of its SystemID sweeps.

    A model is identified of each axis that was swept; today's gains and filters are the logs'. New
    gains reject disturbances and gusts as well as they can while the 95 % intervals of gain margin,
    phase margin and peak of |S| hold what is `required`; `seed` is of the models as likely,
    `rotor_hz` and `tail` are as of `look.vibration`. Logs without a sweep tell today's loops and
    the feed-forward, by what the pilot's sticks or AutoTune moved, or vibration alone, and a remark
    says why. Beside sweeps they are flights in gusts, by which errors in gusts are predicted.
    Raises StorageError, LogError, IdentificationError, or InputError where the parameters aren't in
    the log.
    """
    paths = [str(one) for one in ([logs] if isinstance(logs, str | PathLike) else logs)]
    on_step("vibration")
    heard = vibration(paths, rotor_hz=rotor_hz, tail=tail)
    try:
        swept = [one for one in paths if own_sweeps(Path(one))]
        if not swept:
            return _by_sticks(paths, heard, seed, on_step)
        on_step("models")
        plant, inferred = logged_plant(swept)
    except (LogError, InputError) as error:
        return LogTuning(tuple(paths), heard, remarks=(f"no gains: {error}",))
    start = inferred.used[0].start
    remarks = [f"{fit.structure.name}: {fit.verdict}" for fit in plant.fits if fit.verdict.reasons]
    remarks += [f"left out: {one}" for log in inferred.logs for one in log.sweeps if one.unused]
    if plant.still:
        remarks.append(
            f"no model tells {', '.join(plant.still)}: taken to be held; sweep roll, pitch and yaw "
            "(SID_AXIS 10 to 12), each once, for what the axes do to each other"
        )
    on_step("loops as flown")
    log = open_dataflash(Path(swept[0]), file_digest(Path(swept[0])))
    law = flown_law(log, start + log.begins)
    remarks += law.remarks
    axes = tuned_axes(plant)
    shown = _shown(swept, remarks)
    on_step("candidates")
    models = [plant, *plant.draws(DRAWS, seed=seed)]
    known = [one for one in axes if shown and one in {cut.axis for cut in shown.used}]
    plants = _put_right(models, law, shown, known) if shown else models
    today = PredictedLoop.of(plants, law, flew=law)
    own = log.parameters(at=start + log.begins)
    wrong = {
        name: f"the model's {fit.verdict}"
        for fit in plant.fits
        for name in fit.structure.inputs
        if fit.verdict.word == "wrong"
    }

    def with_gains(gains: Mapping[str, Gains]) -> ArduCopterLaw:
        new = {name: value for axis in gains for name, value in _named(axis, gains[axis]).items()}
        return replace(
            ArduCopterLaw.of({**own, **new}, lean=law.lean, steady=law.steady),
            notches=heard.notches,
        )

    before = {axis: today.figures(axis) for axis in axes}
    kept = PredictedLoop.of(plants, with_gains({}), flew=law) if heard.settings else today
    stays = {
        axis: kept.figures(axis) if heard.settings else before[axis]
        for axis in axes
        if axis not in wrong
    }
    gusty = [
        open_dataflash(one, file_digest(one)) for one in map(Path, paths) if str(one) not in swept
    ]
    moves = {
        axis: flown_moves(gusty, plants[0], law, axis, remarks)
        if gusty
        else whites(plants[0], law, axis)
        for axis in stays
    }
    most = math.sqrt(
        np.clip(0.005 * (own.get("ATC_ACCEL_Y_MAX") or _ACCEL_Y_MAX), 10.0, 120.0) / _LINEAR
    )
    gains, tuned, none = searched(
        *(plants, with_gains, law, stays, required, moves),
        slopes={axis: dict.fromkeys((law.rates[axis].slope_hz, *_SLOPES)) for axis in axes},
        ahead={axis: law.rates[axis].ff for axis in axes},
        held={"ped": HELD[max(law.angle["ped"], most) >= HELD]},
    )
    none |= wrong
    better = with_gains(gains)
    new, found = PredictedLoop.of(plants[:1], better), []
    for axis in axes:
        flown = axis in known
        flew = shown if shown and flown else ClosedLoop(plants[0], law)
        one = AxisTuning(
            *(axis, flown, before[axis]),
            why=none.get(axis, ""),
            loops={"flown" if flown else "today": flew.broken(axis)},
        )
        if axis in gains:
            remarks += _unseen(new, plants[0], axis)
            changes = _changed(axis, gains[axis], own, plants)
            one = retuned(one, plants[0], law, better, tuned[axis], changes, moves[axis])
        found.append(one)
    return LogTuning(
        *(tuple(paths), heard, tuple(found), tuple(dict.fromkeys(remarks))),
        *(str(inferred), _modes(log), histories(log), plant.fits),
    )


def _modes(log: DataFlash) -> tuple[tuple[float, str], ...]:
    if not log.has("MODE", "Mode"):
        return ()
    table, names = log.table("MODE"), {number: name for name, number in MODES.items()}
    return tuple(
        (at, names.get(one, f"mode {one}"))
        for at, one in zip((table.time - log.begins).tolist(), table["Mode"].astype(int).tolist())
    )


def logged_plant(logs: Sequence[str]) -> tuple[Plant, Inferred]:
    """Return the models that logs of SystemID sweeps tell, and what of them was taken.

    Raises StorageError, LogError, IdentificationError, or InputError if nothing is of use.
    """
    found = infer(logs)
    wanted = tuple(fit for fit in found.fits if not fit.structure.startswith("tf:"))
    if not wanted:
        raise InputError(
            f"{logs[0]}: no model of it can be used for gains; sweep roll and pitch both, or yaw"
        )
    names = {
        name
        for fit in wanted
        for name in (*fit.inputs, *fit.outputs, *fit.conditioning, *fit.reference)
    }
    records = [record for log in found.read(names) for record in log.records]
    fits = []
    for fit, estimate in zip(wanted, estimate_fits(records, wanted)):
        own = structures.named(fit.structure)
        fits.append(identify(estimate, own, band=followed_band(estimate, own, fit.band)))
    return whole_plant(fits), found


def whole_plant(fits: Sequence[Fit], **options: Any) -> Plant:
    """Return models with all rates and angles: those that none tells stand still."""
    known = Plant(tuple(fits)).outputs
    still = tuple(name for name in (*RATES, *ATTITUDES) if name not in known)
    return Plant(tuple(fits), still=still, **options)


def _by_sticks(
    paths: Sequence[str], heard: Vibration, seed: int, on_step: Callable[[str], None]
) -> LogTuning:
    """Return what flights without sweeps tell of the feed-forward and of today's loops."""
    on_step("responses")
    logs = [open_dataflash(one, file_digest(one)) for one in map(Path, paths)]
    found = stick_response(logs)
    on_step("loops as flown")
    law, own = flown_law(logs[0], found.start), logs[0].parameters(at=found.start)
    # the log's rates are behind the gyro's filter, which is in the law
    plant = replace(found, rates=found.rates / law.gyro(found.frequency))
    models = [plant, *plant.draws(DRAWS, seed=seed)]
    axes, remarks = (
        list[AxisTuning](),
        [
            *law.remarks,
            "P, I, D and the angle's gain stay: for those sweep by the mode SystemID, "
            "SID_AXIS 10 to 12",
        ],
    )
    for axis in tuned_axes(plant):
        figures = _coherent(models, law, axis)
        if not math.isfinite(figures["crossover"].value):
            seen = plant.seen(axis)
            where = f"from {seen[0]:.3g} to {seen[-1]:.3g} rad/s alone" if seen.size else "nowhere"
            remarks.append(
                f"the crossover of {axis_of(axis).word} isn't seen: its rate is coherent with the "
                f"commands {where}; {_STEPS}"
            )
        axes.append(_fed(AxisTuning(axis, True, figures), models, law, own))
    return LogTuning(
        *(tuple(paths), heard, tuple(axes), tuple(dict.fromkeys(remarks))),
        modes=_modes(logs[0]),
        histories=histories(logs[0]),
    )


def _coherent(
    models: Sequence[StickResponse], law: ArduCopterLaw, axis: str
) -> dict[str, Interval]:
    """Return crossover, margins and delay of the loop, NaN where the rate isn't coherent.

    The delay is that of the crossover model, an integrator and a delay (D. T. McRuer and H. R. Jex,
    IEEE Transactions on Human Factors in Electronics 8, 1967).
    """

    def figures(one: ClosedLoop) -> dict[str, float]:
        cut = figures_of(one, kind="broken", axis=axis)
        lag = np.radians(90.0 - cut["phase_margin"])
        return {**cut, "loop_delay": float(lag / cut["crossover"])}

    seen = models[0].seen(axis)
    if seen.size < 2:
        return {"crossover": Interval(math.nan, math.nan, math.nan)}
    draws = tuple(ClosedLoop(one, law, seen) for one in models[1:])
    return intervals(PredictedLoop(models[0], law, seen, draws=draws), figures)


def _fed(
    one: AxisTuning, models: Sequence[StickResponse], law: ArduCopterLaw, own: Mapping[str, float]
) -> AxisTuning:
    """Return an axis with its feed-forward, changed where the flight tells another well enough."""
    name, gains = f"ATC_RAT_{WORDS[one.axis]}_FF", law.rates[one.axis]
    value, *others = (holds(plant, one.axis) for plant in models)
    within = 1.96 * float(np.std(others))
    most = _NARROW * (max(value, 0.0) + gains.p)
    fed = Interval(value, value - within, value + within)
    one = replace(
        one,
        today={"set_FF": Interval(gains.ff, gains.ff, gains.ff), "flown_FF": fed, **one.today},
    )
    if not within <= most:
        return replace(
            one,
            why=f"FF is known to +- {within:.2g}, expected +- {most:.2g} or less; {_STEPS}",
        )
    if fed.low <= gains.ff <= fed.high:
        return replace(one, why="today's FF is as right as this flight tells")
    new = float(f"{max(value, 0.0):.4g}")
    return replace(one, changes=(Changed(name, own[name], new, _WHYS["FF"], within),))


def _shown(paths: Sequence[str], remarks: list[str]) -> MeasuredLoop | None:
    """Return the loops that sweeps of the mixer cut, None if none did, and extend the remarks."""
    try:
        return flown_loops(paths).margins(draws=DRAWS).loop
    except (LogError, IdentificationError) as error:
        remarks.append(f"no loop is known as flown, so models alone tell the figures: {error}")
        return None


def _put_right(
    models: Sequence[Plant], law: ArduCopterLaw, shown: MeasuredLoop, axes: Sequence[str]
) -> list[FlownPlant]:
    """Return models with the loops as flown, each with one of those as likely as measured."""
    plants = []
    for model, one in zip(models, (shown, *shown.draws)):
        ratios = {
            axis: Curve(
                curve.frequency,
                curve.response / ClosedLoop(model, law, curve.frequency).broken(axis).response,
            )
            for axis in axes
            for curve in [one.broken(axis)]
        }
        plants.append(FlownPlant(model, ratios))
    return plants


def noise_of(plant: Linear, law: Linear, axis: str) -> float:
    """Return the rms of an axis's command over that of white noise of its gyro."""
    return float(passed(ClosedLoop(plant, law, BAND).reached("rate", axis)[axis].response))


def retuned(
    one: AxisTuning,
    plant: Linear,
    today: Linear,
    better: Linear,
    figures: Mapping[str, Interval],
    changes: tuple[Changed, ...],
    moves: Real,
) -> AxisTuning:
    """Return an axis with better gains: its changes, figures, noise, gusts and predicted loop."""
    return replace(
        one,
        noise=noise_of(plant, better, one.axis) / noise_of(plant, today, one.axis),
        gusts=float(np.sqrt(errs(plant, better, one.axis, moves).sum())),
        tuned=figures,
        changes=changes,
        loops={**one.loops, "predicted": ClosedLoop(plant, better).broken(one.axis)},
    )


def _unseen(loop: ClosedLoop, plant: Linear, axis: str) -> list[str]:
    """Return a remark if the gain margin lies beyond the frequencies at which the loop flew."""
    nearest, _ = min(
        margins(loop.broken(axis)).gain, key=lambda turn: abs(turn[1]), default=(0.0, 0.0)
    )
    seen = plant.ratios[axis].frequency[-1] if isinstance(plant, FlownPlant) else np.inf
    said = (
        f"the gain margin of {axis_of(axis).word} lies at {nearest:.0f} rad/s, beyond "
        f"{seen:.0f} rad/s, where the sweeps end: let them go on to a higher frequency "
        "(SID_F_STOP_HZ) to know it"
    )
    return [said] if nearest > seen else []


def _named(axis: str, gains: Gains) -> dict[str, float]:
    word = WORDS[axis]
    return {f"ATC_ANG_{word}_P": gains.angle} | {
        f"ATC_RAT_{word}_{name}": getattr(gains, of) for name, of in _FIELDS.items()
    }


def searched(
    plants: Sequence[Linear],
    law: Callable[[Mapping[str, Gains]], Any],
    today: Linear,
    stays: Mapping[str, Mapping[str, Interval]],
    required: Required,
    moves: Mapping[str, Real],
    *,
    ahead: Mapping[str, float] | None = None,
    rounded: Callable[[str, Gains], Gains] = lambda _, one: Gains(
        *(float(f"{x:.4g}") for x in one)
    ),
    held: Mapping[str, Real] | None = None,
    slopes: Mapping[str, Iterable[float]] | None = None,
) -> tuple[dict[str, Gains], dict[str, dict[str, Interval]], dict[str, str]]:
    """Return gains by axis, their figures, and why other axes have none.

    All figures are of the returned gains together, axes without keeping today's, whose figures
    `stays` are. Their intervals hold what is required, they pass at most half more noise than the
    law of `today`, and they leave less of disturbances and of `moves`, by which today's err by 1,
    in shares of what today's leave; where today's margins hold, the error is no larger. FF is
    that which holds a rate, or between it and `ahead`, today's.
    Gains are `rounded` as the autopilot takes them; `held` and `slopes` as of `search`.
    """
    none: dict[str, str] = {}
    tries = Counter[str]()
    asked = {
        axis: required._replace(
            noise=LOUDER * noise_of(plants[0], today, axis) or np.inf,
            rate=one["DRB"].value,
            attitude=one.get(ATTITUDE_DRB, one["DRB"]).value,
            moves=moves[axis],
            error=np.inf if any(lacks(one, required)) else _LESS,
            ahead=(ahead or {}).get(axis, np.nan),
        )
        for axis, one in stays.items()
    }
    while asked:
        try:
            gains = search(plants[: _SEARCHED + 1], law, asked, held, slopes)
        except NoGains as error:
            none[error.axis] = str(error)
            with suppress(NoGains):  # of the likeliest model there are some
                search(plants[:1], law, {error.axis: asked.pop(error.axis)}, held, slopes)
                none[error.axis] = _UNKNOWN
            continue
        gains = {axis: rounded(axis, one) for axis, one in gains.items()}
        loop = PredictedLoop.of(plants, law(gains), required.lowest, today)
        tuned = {axis: loop.figures(axis) for axis in gains}
        short = {axis: by for axis in gains if any(by := lacks(tuned[axis], required))}
        left = {
            axis: math.sqrt(errs(plants[0], law(gains), axis, moves[axis]).sum()) for axis in gains
        }
        dull = [
            axis
            for axis in gains
            if axis not in short
            and not any(lacks(stays[axis], required))
            and (
                _error(stays[axis], asked[axis], 1.0)
                < _WORTH * _error(tuned[axis], asked[axis], left[axis])
                or left[axis] > 1.0
            )
        ]
        if not short and not dull:
            return gains, tuned, none
        for axis, by in short.items():
            tries[axis] += 1
            one, lacking = asked[axis], np.array(by)
            gain, phase, peak = np.where(lacking > 0.0, _BEYOND * lacking + _MORE, 0.0).tolist()
            asked[axis] = one._replace(
                gain=one.gain + gain, phase=one.phase + phase, peak=one.peak - peak
            )
        none |= dict.fromkeys(dull, _AS_GOOD) | {
            axis: _UNKNOWN for axis in short if tries[axis] == _TRIES
        }
        asked = {axis: one for axis, one in asked.items() if axis not in none}
    return {}, {}, none


def _error(figures: Mapping[str, Interval], required: Required, error: float) -> float:
    """Return what disturbances leave: of both kinds, by DRB worth the same, and of moves."""
    worth = {"DRB": required.rate, ATTITUDE_DRB: required.attitude}
    return math.hypot(
        error, *(one / figures[name].value for name, one in worth.items() if name in figures)
    )


def lacks(figures: Mapping[str, Interval], required: Required) -> tuple[float, ...]:
    """Return by how much the worst ends of gain margin, phase margin and peak miss the required."""
    gain, phase, peak = (figures[name] for name in ("gain_margin", "phase_margin", "DRP"))
    short = (
        required.gain - gain.low,
        required.phase - np.radians(phase.low),
        peak.high - required.peak,
    )
    return tuple(max(0.0, float(one)) for one in short)


def _changed(
    axis: str, gains: Gains, own: Mapping[str, float], plants: Sequence[Linear]
) -> tuple[Changed, ...]:
    """Return the parameters of an axis's new gains beside the log's own."""
    holding = [holds(plant, axis) for plant in plants]
    told = f", {holding[0]:.4g} +- {1.96 * np.std(holding[1:]):.2g}, or between it and today's"
    found = []
    for name, value in _named(axis, gains).items():
        short = "ANG" if "_ANG_" in name else name.split("_")[-1]
        # without D its filter stays
        if value != float(f"{own[name]:.4g}") and (gains.d or short != "FLTD"):
            found.append(Changed(name, own[name], value, _WHYS[short] + told * (short == "FF")))
    return tuple(found)
