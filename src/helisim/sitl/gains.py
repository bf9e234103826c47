"""ArduCopter's gains for a helicopter, from linear models: FF holds a rate, I is half of FF + P.

P, D and the attitude's gain reject disturbances up to the highest frequency, for little noise,
within the margins of every model. Beside gains that fly, FF may be any between theirs and that.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.arrays import Complex, Real
from helisim.base.errors import InputError
from helisim.base.linear import Linear, responses
from helisim.base.units import DB_PER_NEPER
from helisim.handling.arducopter import COMMANDS, ArduCopterLaw, Rates
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.figures import HALF_POWER
from helisim.handling.loop import BY_NAME, axis_of
from helisim.handling.predicted import LOWEST
from helisim.records.record import ATTITUDES, IN1, RATES

LOOP_RATE = 400.0  # Hz, SCHED_LOOP_RATE
GYRO_HZ = 40.0  # Hz, INS_GYRO_FILTER: twice ArduPilot's default
FILTER_HZ = 20.0  # Hz, FLTT and FLTD
INPUT_TIME = 0.2  # s, ATC_INPUT_TC
# s, from a tick to its pulses: the next frame's, and the tail's a tick later.
_LATE = {"lat": 0.25e-3, "lon": 0.25e-3, "ped": 0.25e-3 + 1.0 / LOOP_RATE}

# rad/s, at which the feed-forward is read: above the hover's slow modes, below the rotor's.
_HOLDS = 3.0
BAND = np.geomspace(LOWEST, 1250.0, 250)  # rad/s, to half of ArduPilot's 400 Hz
_TELLS = 10.0  # rad/s, at which 1 / |rate over command| is the unit of P
# In that unit; where a flapping mode follows at a few rad/s, gains near 0.05 are the best.
_P = np.concatenate([[0.0], np.geomspace(0.05, 1.0, 12), np.linspace(1.2, 3.0, 10)])
_D = np.array([0.0, 0.0075, 0.015, 0.03, 0.045, 0.06, 0.09])  # s, by P
HELD = np.linspace(1.0, 12.0, 23)  # 1/s, of the attitude, as far as ArduPilot's own range goes
_CLOSER = (0.3, 0.2, 0.12, 0.07, 0.04)
"""Standard deviations of the logarithm of random gains that are tried near the best, in turn."""
_NEAR, _CORNER = 300, 0.5  # Of those, how many; rad/s, of the integral
_SLOWEST = 2.0  # rad/s, below which no attitude is held
# Share of an octave of rejection that an octave of noise costs: on the JR700 half an octave more of
# noise buys a tenth to a fifth of an octave of rejection, and the next half octave next to nothing.
_NOISE = 0.25
_ALLOWED = 0.05  # The same where noise has a ceiling: below it little is gained by less
# Noise of the command, in the unit of P over the gyro's, that moves no servo much: less buys little
_QUIET = 0.1
# Most noise, likewise. Gains within the margins of the JR700, the Blade 360 and the Lynx need 0.05
# to 1.5 with a gyro filter of 20 Hz; beyond 2 a model is used far above where it was identified.
_LOUD = 2.0
_LEAST = 1e-12  # Noise, likewise: none at all
_FIRST = 3.0  # 1/s, of the attitude, with which loops are closed until their gains are found
_EACH = 32  # Gains that are tried at once with all models
_SOME = 37  # Gains of the grid of which one is taken to tell how stable a vehicle can be


class Required(NamedTuple):
    """Least gain margin, dB, and phase margin, rad; highest peak of |S|, dB, and most noise.

    Noise is the rms of the command over that of white noise of the gyro, of full command by rad/s.
    Worth the same are `rate` and `attitude`, DRB of disturbances of attitude and rate together and
    of attitude alone, rad/s, and 1 of the rms of target less attitude, at most `error`: by `moves`,
    (4, n_freq), powers at `BAND` of what acts as added commands, as gusts do, and of each target.
    `ahead` is an FF that may be taken in place of the one that holds a rate, or any between.
    Margins and peak are those from `lowest`, rad/s, on.
    """

    gain: float
    phase: float
    peak: float
    noise: float = np.inf
    rate: float = 1.0
    attitude: float = 1.0
    moves: Real = np.zeros((1 + len(COMMANDS), BAND.size))
    error: float = np.inf
    ahead: float = np.nan
    lowest: float = LOWEST


# SAE AS94900's 6 dB and 45 degrees; 5 dB of Tischler et al., AHS Forum 67, 2011. More is asked
# ahead of the first flight, whose vehicle may be another than the model's.
STANDARD = Required(6.0, float(np.radians(45.0)), 5.0)
AHEAD = Required(8.0, float(np.radians(50.0)), 3.0)


class NoGains(InputError):
    """No gains of an axis keep its margins."""

    def __init__(self, message: str, axis: str) -> None:
        super().__init__(message)
        self.axis = axis


class Gains(NamedTuple):
    """One axis's P, I, D and FF, of full command over SI units; attitude gain, 1/s; D's filter."""

    p: float
    i: float
    d: float
    ff: float
    angle: float
    slope_hz: float = FILTER_HZ


@dataclass(frozen=True, eq=False)
class Commanded:
    """A vehicle, from col, lon, lat, ped, as the autopilot's commands move it; it is `Linear`.

    `scale`, (4, 4), is `mixing.command_scale`'s; commands act `late` s later, `held` for a tick.
    """

    vehicle: Linear
    scale: Real
    late: float = 0.0
    held: bool = True

    @property
    def inputs(self) -> tuple[str, ...]:
        """The commands that the vehicle's model has, in the autopilot's unit."""
        return tuple(name for name in COMMANDS if name in self.vehicle.inputs)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Rates and attitudes."""
        return tuple(name for name in (*RATES, *ATTITUDES) if name in self.vehicle.outputs)

    def response(self, frequency: Real) -> Complex:
        """Return the response, (n_out, n_in, n_freq), at frequencies, (n_freq,) rad/s."""
        own = self.vehicle
        whole = own.response(frequency)[[own.outputs.index(name) for name in self.outputs]]
        by = [IN1.index(name) for name in own.inputs]
        to = [IN1.index(name) for name in self.inputs]
        moved = np.einsum("yuf,uc->ycf", whole, self.scale[np.ix_(by, to)])
        held = [0.5 / LOOP_RATE + _LATE[name] if self.held else 0.0 for name in self.inputs]
        return np.asarray(
            moved * np.exp(-1j * np.add(self.late, held)[:, None] * np.asarray(frequency))
        )


class Tuning(NamedTuple):
    """Gains of all axes, their loops, and the command for 1 rad/s of each axis."""

    gains: Mapping[str, Gains]
    loop: ClosedLoop
    holds: Mapping[str, float]


def law_of(gains: Mapping[str, Gains], lean: tuple[float, float]) -> ArduCopterLaw:
    """Return ArduCopter's law with some gains, none on other axes, and `settings`' filters."""
    full = {axis: gains.get(axis, Gains(0.0, 0.0, 0.0, 0.0, 0.0)) for axis in COMMANDS}
    filters = {"d_ff": 0.0, "target_hz": FILTER_HZ, "error_hz": 0.0}
    return ArduCopterLaw(
        {
            axis: Rates(
                *one[:4], **filters, slope_hz=one.slope_hz, most=1.0, least_leak=1.0, leaks=False
            )
            for axis, one in full.items()
        },
        {axis: one.angle for axis, one in full.items()},
        1.0 / LOOP_RATE,
        gyro_hz=GYRO_HZ,
        input_time=INPUT_TIME,
        lean=lean,
    )


def tune(
    vehicle: Linear,
    scale: Real,
    *,
    lean: tuple[float, float] = (0.0, 0.0),
    late: float = 0.0,
    held: bool = True,
) -> Tuning:
    """Return gains for a vehicle from col, lon, lat, ped to p, q, r, phi, theta, psi.

    `scale`, (4, 4), is `mixing.command_scale`'s, `lean` phi and theta of the hover, rad. Commands
    act `late` s later than by the model and the ticks; `held` adds their holding to the model.
    Raises NoGains, or InputError if no axis can be tuned.
    """
    plant = Commanded(vehicle, scale, late, held)
    if not set(ATTITUDES) <= set(plant.outputs):
        lean = (0.0, 0.0)  # a lean turns one attitude into another's rate
    law = partial(law_of, lean=lean)
    axes = tuned_axes(vehicle)
    found = search([plant], law, dict.fromkeys(axes, AHEAD))
    return Tuning(
        found, ClosedLoop(plant, law(found), BAND), {axis: holds(plant, axis) for axis in axes}
    )


def tuned_axes(plant: Linear) -> list[str]:
    """Return the axes whose command and own attitude a model has. Raises InputError for none."""
    axes = [one for one in COMMANDS if one in plant.inputs and BY_NAME[one].angle in plant.outputs]
    if not axes:
        raise InputError(
            f"no axis can be tuned: the model goes from {', '.join(plant.inputs)} to "
            f"{', '.join(plant.outputs)}; a gain needs a command and its own rate, as lat and p"
        )
    return axes


def holds(plant: Linear, axis: str) -> float:
    """Return the command in phase with a rate of 1 rad/s, in a slow swing."""
    return float((1.0 / _own(plant, axis, np.array([_HOLDS])))[0].real)


def _own(plant: Linear, axis: str, frequency: Real) -> Complex:
    return responses(plant, frequency, [axis_of(axis).rate or ""], [axis])[0, 0]


class _Known(NamedTuple):
    """A `Linear` by its responses at `BAND`, computed once."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    responses: Complex

    @classmethod
    def of(cls, system: Linear) -> "_Known":
        return cls(system.inputs, system.outputs, system.response(BAND))

    def response(self, _: Real) -> Complex:
        return self.responses


def search(
    plants: Sequence[Linear],
    law: Callable[[Mapping[str, Gains]], Linear],
    required: Mapping[str, Required],
    held: Mapping[str, Real] | None = None,
    slopes: Mapping[str, Iterable[float]] | None = None,
) -> dict[str, Gains]:
    """Return the gains of each axis that reject most within what is required of every plant.

    The first plant is the likeliest, by which gains are ranked; `law` is that of gains by axis.
    By axis `held` are gains of the attitude that are tried, 1/s, without any `HELD`, and `slopes`
    filters of D, Hz, today's first; without any it is `FILTER_HZ`. Raises NoGains.
    """
    known = [_Known.of(one) for one in plants]
    ahead = {
        axis: np.unique(
            [of(max(0.0, holds(plants[0], axis)), one.ahead) for of in (np.fmin, np.fmax)]
        )
        for axis, one in required.items()
    }
    tried = {axis: tuple((slopes or {}).get(axis, (FILTER_HZ,))) for axis in required}
    found = {
        axis: Gains(0.0, _CORNER * ff[-1], 0.0, ff[-1], _FIRST, tried[axis][0])
        for axis, ff in ahead.items()
    }
    rows = {axis: _rows(law, axis, one) for axis, one in tried.items()}
    for closer in (None, *_CLOSER):
        for axis, needed in required.items():
            found[axis] = _best(
                *(known, law, rows[axis], axis, found, closer, needed),
                *((held or {}).get(axis, HELD), tried[axis], ahead[axis]),
            )
    return found


def _rows(
    law: Callable[[Mapping[str, Gains]], Linear], axis: str, slopes: Sequence[float]
) -> Complex:
    """Return what an axis's command has of all that is sensed, (n_term, 2, n_sensed, n_freq).

    It is for a unit of P, I, FF, and D by each filter, without and with the attitude's gain.
    """
    without = Gains(0.0, 0.0, 0.0, 0.0, 0.0)
    terms = [without._replace(**{name: 1.0}) for name in ("p", "i", "ff")]
    terms += [without._replace(d=1.0, slope_hz=hertz) for hertz in slopes]
    found = [[_Known.of(law({axis: one._replace(angle=by)})) for by in (0.0, 1.0)] for one in terms]
    return np.array([[each.responses[each.outputs.index(axis)] for each in two] for two in found])


def _best(
    plants: Sequence[_Known],
    law: Callable[[Mapping[str, Gains]], Linear],
    rows: Complex,
    axis: str,
    now: Mapping[str, Gains],
    closer: float | None,
    required: Required,
    held: Real,
    slopes: tuple[float, ...],
    ahead: Real,
) -> Gains:
    """Return the best gains of one axis of a grid, or of random ones as near as `closer` to now."""
    p, _, d, ff, angle, slope = now[axis]
    without = now[axis]._replace(p=0.0, i=0.0, d=0.0, ff=0.0, angle=0.0)
    others = _Known.of(law({**now, axis: without}))
    unit = 1.0 / float(np.interp(_TELLS, BAND, np.abs(_own(plants[0], axis, BAND))))
    apart = 2 if len(slopes) > 1 else 1  # about as many gains with several filters
    tried = np.meshgrid(_P[::apart] * unit, _D, held[::apart], slopes, ahead)
    grid = np.reshape(tried, (len(tried), -1))
    grid[1] *= grid[0]

    def gains_of(tried: Real) -> Real:
        p, d, angle, slope, ff = tried
        return np.array([p, _CORNER * (ff + p), d, ff, angle, slope])

    cuts = [
        _Cut.of(plant, others, rows, axis, gains_of(grid[:, ::_SOME]), slopes, required.lowest)
        for plant in plants
    ]
    angles = {name: one.angle for name, one in now.items() if name != axis}
    moved = np.abs(strays(ClosedLoop(plants[0], others, BAND), axis, angles)) ** 2
    powers = np.sum(required.moves * moved, axis=0), required.moves[1 + COMMANDS.index(axis)]
    random = np.random.default_rng(1)
    by = np.exp((closer or 0.0) * random.standard_normal((3, _NEAR)))
    hertz = np.where(random.random(_NEAR) < 0.5, slope, random.choice(slopes, _NEAR))
    fed = ff * np.exp((closer or 0.0) * random.standard_normal(_NEAR))
    near = np.vstack([np.array([[p], [d], [angle]]) * by, hertz, fed.clip(ahead[0], ahead[-1])])
    near[:, 0] = p, d, angle, slope, ff  # as now: no round makes it worse
    near[2] = np.minimum(near[2], held[-1])
    for tried in (grid,) if closer is None else (near, grid):
        gains = gains_of(tried)
        best = _first(cuts, gains, unit, required, powers)
        if best is not None:
            return Gains(*gains[:, best].tolist())
    raise NoGains(
        f"{axis_of(axis).word} has no gains with margins of {required.gain:g} dB and "
        f"{np.degrees(required.phase):.0f} degrees: its model answers too late, or with "
        "another sign than the autopilot's command has",
        axis,
    )


def strays(loop: ClosedLoop, axis: str, angles: Mapping[str, float]) -> Complex:
    """Return an attitude by an added command, and what it misses of targets, (4, n_freq).

    Loops are at `BAND`. Targets are of the law's `COMMANDS`; with gains `angles` of the attitudes,
    1/s, theirs and their rates are asked for.
    """
    moved = {
        other: (other == axis)
        + loop.reached("attitude", other)[axis_of(axis).angle].response
        * (1.0 + 1j * BAND / (gain or np.inf))
        for other, gain in angles.items()
        if other in loop.axes
    }
    missed = (moved.get(one, np.zeros(BAND.size)) for one in COMMANDS)
    return np.array([loop.turned(axis, axis).response, *missed], np.complex128)


def _first(
    cuts: "Sequence[_Cut]",
    gains: Real,
    unit: float,
    required: Required,
    moved: tuple[Real, Real],
) -> int | None:
    """Return which of the gains, (6, n_gains), are the best that will do, None if none will.

    `moved` are powers, (n_freq,) each: of the attitude with its axis open, and of its target.
    Those that err less than is required come first.
    """
    likely = cuts[0].closed(gains)
    most = min(_LOUD, required.noise / unit)
    clear = np.flatnonzero(likely.keeps(required) & (likely.noise(unit) < most))
    worth, errs = likely.worth(unit, required, moved), likely.error(moved) > required.error
    order = clear[np.lexsort([-worth[clear], errs[clear]])]
    for start in range(0, order.size, _EACH):
        left = order[start : start + _EACH]
        for cut in cuts[1:]:
            left = left[cut.closed(gains[:, left]).keeps(required)]
        if left.size:
            return int(left[0])
    return None


class _Closed(NamedTuple):
    """Loops of many gains, (n_gains, n_freq) each: L, its part by the rate, command over noise.

    `aimed` is the attitude over its target with this axis open, (n_gains, n_freq).
    `beside` is another loop of the same vehicle, (n_freq,), and `least` how many more poles than
    its grow with the stablest gains that are known.
    """

    loop: Complex
    by_rate: Complex
    noisy: Complex
    aimed: Complex
    beside: Complex
    least: float = 0.0

    def growing(self, lowest: float = LOWEST) -> Real:
        """Return how many more poles grow than those of the loop `beside`, (n_gains,).

        By Nyquist's criterion: both have the same open loop's poles, so the turns of
        (1 + L) / (1 + L beside) about 0 count those of the closed loop alone; from `lowest`, rad/s,
        on, those that are faster.
        """
        ratio = ((1.0 + self.loop) / (1.0 + self.beside))[:, lowest <= BAND]
        turned = np.sum(np.angle(ratio[:, 1:] / ratio[:, :-1]), axis=1)
        return -np.round((turned + np.angle(ratio[:, 0]) - np.angle(ratio[:, -1])) / np.pi)

    def noise(self, unit: float) -> Real:
        """Return the rms of the command over that of white noise of the gyro, by a unit of P."""
        return np.asarray(passed(self.noisy / (1.0 + self.loop) / unit))

    def error(self, moved: tuple[Real, Real]) -> Real:
        """Return the rms of target less attitude, (n_gains,), by `moved` of `_first`."""
        left = 1.0 / (1.0 + self.loop)
        return np.sqrt(
            np.abs(left) ** 2 @ moved[0] + np.abs(1.0 - self.aimed * left) ** 2 @ moved[1]
        )

    def worth(self, unit: float, required: Required, moved: tuple[Real, Real]) -> Real:
        """Return the rejection of disturbances less what noise costs, (n_gains,), by a unit of P.

        Disturbances are of attitude and rate together, of attitude alone, and what moves it from
        its target: DRB says how fast they may be, and not how strong faster ones are.
        """
        left = 1.0 / (1.0 + self.loop)
        by_rate = (1.0 + self.by_rate) * left
        error = np.linalg.norm(
            [
                required.rate / _rejected(left),
                required.attitude / _rejected(by_rate),
                self.error(moved),
            ],
            axis=0,
        )
        price = _ALLOWED if required.noise < np.inf else _NOISE
        return -np.log(error) - price * np.log(_QUIET + self.noise(unit))

    def keeps(self, required: Required) -> NDArray[np.bool_]:
        """Return which loops are stable with the margins, (n_gains,), as far as gains can be.

        At the last crossover a loop lags by less than 180 degrees: a wrong sign is none.
        """
        loop = self.loop
        above = np.abs(loop) > 1.0
        last = BAND.size - 1 - np.argmax(above[:, ::-1], axis=1)
        size = DB_PER_NEPER * np.log(np.maximum(np.abs(loop), _LEAST))
        behind = np.angle(-loop)
        turn = np.diff(behind, axis=1)
        passes = (np.abs(turn) < np.pi) & (behind[:, 1:] * behind[:, :-1] <= 0.0)
        at = size[:, :-1] - behind[:, :-1] * np.divide(
            np.diff(size, axis=1), turn, out=np.zeros_like(turn), where=turn != 0.0
        )
        ones = size[:, 1:] * size[:, :-1] <= 0.0
        shares = -size[:, :-1] / np.where(ones, np.diff(size, axis=1), 1.0)
        short = turn - 2.0 * np.pi * np.round(turn / (2.0 * np.pi))
        lag = np.abs(behind[:, :-1] + shares * short)
        near = (passes & (np.abs(at) < required.gain)) | (ones & (lag < required.phase))
        told = required.lowest <= BAND
        return (
            (self.growing(required.lowest) <= self.least)
            & np.any(above[:, BAND >= _SLOWEST], axis=1)
            & (loop[np.arange(len(loop)), last].imag < 0.0)
            & ~np.any(near[:, told[:-1]], axis=1)
            & (-DB_PER_NEPER * np.log(np.abs(1.0 + loop[:, told]).min(axis=1)) < required.peak)
        )


def passed(response: Complex) -> Any:
    """Return the rms of what responses, (..., n_freq) at `BAND`, make of white noise, over its."""
    width = np.gradient(BAND)
    return np.sqrt(np.sum(np.abs(response) ** 2 * width, axis=-1) / np.sum(width))


def _rejected(left: Complex) -> Real:
    """Return the frequency at which |S| first rises through 1 / sqrt 2, (n_gains,) rad/s."""
    size = DB_PER_NEPER * np.log(np.abs(left)) - HALF_POWER
    rises = (size[:, :-1] <= 0.0) & (size[:, 1:] > 0.0)
    rows, first = np.arange(len(size)), np.argmax(rises, axis=1)
    low, high = size[rows, first], size[rows, first + 1]
    share = np.where(rises[rows, first], -low / np.where(high > low, high - low, 1.0), 0.0)
    return BAND[first] * (BAND[1] / BAND[0]) ** share


class _Cut(NamedTuple):
    """One axis's loop by each unit of P, I, FF and of D by filters `slopes`, (n_term, n_freq) each.

    It is by rate and by angle; `beside` and `least` are as of `_Closed`.
    """

    by_rate: Complex
    by_angle: Complex
    noisy: Complex  # The command over the gyro's noise
    slopes: tuple[float, ...]
    beside: Complex
    least: float = 0.0

    @classmethod
    def of(
        cls,
        plant: _Known,
        others: _Known,
        rows: Complex,
        axis: str,
        some: Real,
        slopes: tuple[float, ...],
        lowest: float,
    ) -> "_Cut":
        """Return it by a law without this axis, and what the command has of all that is sensed.

        `rows` are as of `_rows`. The stablest of `some` gains, (6, n_gains), tell which are stable
        from `lowest`, rad/s, on.
        """
        moved = ClosedLoop(plant, others, BAND).reached("actuators", axis)
        seen = [name for name in others.inputs if name in plant.outputs]
        by_rate, both = np.einsum(
            "tasf,sf->atf",
            rows[:, :, [others.inputs.index(name) for name in seen]],
            -np.array([moved[name].response for name in seen]),
        )
        found = cls(
            by_rate,
            both - by_rate,
            noisy=rows[:, 0, others.inputs.index(axis_of(axis).rate or "")],
            slopes=slopes,
            beside=np.zeros(BAND.size, complex),
        )
        found = found._replace(beside=found.closed(some[:, :1]).loop[0])
        return found._replace(least=float(found.closed(some).growing(lowest).min()))

    def closed(self, gains: Real) -> _Closed:
        """Return the loops of gains, (6, n_gains)."""
        p, i, d, ff, angle, slope = gains
        terms = np.array([p, i, ff, *(d * (slope == one) for one in self.slopes)]).T
        angle = angle[:, None]
        by_rate = terms @ self.by_rate
        by_angle = terms @ self.by_angle
        return _Closed(
            by_rate + angle * by_angle,
            *(by_rate, terms @ self.noisy, (angle + 1j * BAND) * by_angle),
            *(self.beside, self.least),
        )
