"""Evidence in records that what is identified from them may be wrong, beyond any stated error.

Each check compares the records with themselves, and needs no model: a rate with its attitude, a
response with the powers of its signals (harmonics of a sweep), one half of the records with the
other, on-axis with off-axis responses, swept with quiet stretches, samples with straight lines.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate, permutations, product

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy import fft
from scipy.special import gammaincc

from helisim.base.arrays import Complex, Real
from helisim.base.note import Note
from helisim.ident.feedback import answered
from helisim.ident.local_fit import BandFit, Lines, fit_band, flight_lines, transform
from helisim.ident.response import USABLE_COHERENCE, FrequencyResponse
from helisim.records.quality import ANGLES, frozen_runs, slope_matrix, stretches
from helisim.records.record import IN1, IN2, RATES, Channel, FlightRecord

_HALF = 0.3  # half width of a band over its middle: a response is a parabola in its logarithm there
_APART = (1.0 + _HALF) / (1.0 - _HALF)  # from one band to the next
# _FREEDOM: spare lines that a band needs
# _SURE: standard deviations of a statistic by chance: none of a million
_FREEDOM, _SURE = 4.0, 6.0
# _ANSWERED: standard deviations of a sum of exponentials: one time in 5000, of 7 bands
# _MOST: times its variance that a squared answer counts at most: chance in 160 000
_ANSWERED, _MOST = 5.0, 12.0
_ERRORS, _SLOPE = 3.0, 0.01  # stated errors; error of a rate's slope that a good gyro has
_HALVES = 0.5  # of one, from which a slope is the other axis's, or of the other sign
_OWN_PART = 0.02  # of a cube's power that no input explains; a sine's third harmonic has a tenth
# Shares of a response: that its signals' size may change; by which one side's may differ from the
# mean of both; that may be wrong where it makes much: linear vehicles have 1 % of that at most
_BENT, _UNEVEN, _GROWS = 0.03, 0.04, 0.15
# Chance of what is told of powers; a play tried, of an input's rms; share of an output's power that
# an input makes, whose sides are looked at
_RARE, _PLAY, _MINOR = 3e-5, 0.14, 0.1
# relative error of a response from which what it leaves tells nothing; rms of a response's relative
# difference between records
_UNKNOWN, _DIFFERENT = 0.5, 0.05
# To compare two responses: of an input's power behind one, what is behind the other at least; times
# its variance a squared response
_DRIVEN, _LOUD = 0.1, 9.0
# Share of samples in which an output may be frozen; of an input's whole motion, within such a run
_STILL, _MOVES = 0.01, 0.2
# Of half a period, in which an input moves before an output, and rests while that moves; shares
# of their motion that are rest: controllers by rates move 0.01 to 0.15, or rest for 0 to 0.1 of it
_BRIEF, _Y_RESTS, _U_RESTS = (0.15, 0.5), 0.1, 0.03
_HELD, _REGULAR = 30, 0.97  # most samples that a slower logger holds; share of changes at its ticks
# Mean square of a control's steps, in its variance, from which they are designed: white values have
# 2, a sweep up to three values a period has 1
_JUMPS = 1.0
# Of a coarse stick's least steps, beyond which a change is more than one; of usual holds, beyond
# which a signal rests
_LEAPS, _RESTS = 1.5, 2.0
# Share of samples that may lie on straight lines; so many in a row, in all channels, were filled;
# of a column's smallest steps, what such lines go by; of the mean
# bend, what more than rounding bends
_FILLED, _STRAIGHT, _DIGITS, _BENDS = 0.005, 3, 10.0, 0.1
_PAIRS = tuple(
    (pair, axes) for pair, axes in ((("p", "q"), (cyclic[2], cyclic[1])) for cyclic in (IN1, IN2))
)


def evidence(
    flights: Sequence[FlightRecord], frf: FrequencyResponse, whole: FrequencyResponse
) -> tuple[Note, ...]:
    """Return what the records themselves say against a response, the gravest first.

    `whole` is the response to all active inputs, those of `frf` and its conditioning inputs.
    """
    inputs = (*frf.inputs, *frf.conditioning)
    with np.errstate(all="ignore"):
        lost = tuple(_filled(flights, (*inputs, *frf.outputs), float(frf.frequency[-1])))
        # straight lines in all channels at once look like noise that goes round a loop
        loop = () if lost else tuple(_feedback(flights, whole, inputs, len(frf.inputs)))
        fed = any(one.kind == "feedback" for one in loop)
        return (
            *_slopes(flights, frf),
            *_crossed(frf),
            *_frozen(flights, frf, inputs),
            *lost,
            *(loop if fed else ()),
            # noise in the inputs is in their cubes, too, and so are straight lines
            *(() if lost or fed else _nonlinear(flights, frf, inputs, frf)),
            *_halves(flights, frf, inputs),
            *(_driven(flights, frf) if frf.opposed else ()),
            *(() if fed else (*_drift(flights, frf, inputs, len(frf.inputs)), *loop)),
        )


def joint_evidence(
    flights: Sequence[FlightRecord],
    joint: FrequencyResponse,
    direct: FrequencyResponse,
    whole: FrequencyResponse,
) -> tuple[Note, ...]:
    """Return what the records say against a joint response, from what they say of a direct one.

    `whole` is the joint response to all active inputs.
    """
    fed = any(one.kind == "feedback" for one in direct.evidence)
    with np.errstate(all="ignore"):
        loop = tuple(_feedback(flights, whole, joint.reference, len(joint.reference)))
        return (
            *(one for one in direct.evidence if one.kind not in ("feedback", "drift", "varying")),
            *loop,
            # else it was looked at by the inputs
            *(_nonlinear(flights, joint, joint.reference) if fed and not loop else ()),
            *_drift(flights, joint, joint.reference, len(joint.reference)),
        )


def _feedback(
    flights: Sequence[FlightRecord], frf: FrequencyResponse, drive: Sequence[str], tested: int
) -> Iterator[Note]:
    """Yield the output whose disturbances come back in what drives, beyond chance."""
    parts = [
        (_in_band(one, drive, frf), _in_band(one, frf.outputs, frf) - made, made)
        for one in flights
        for made in [_filtered(one, frf.inputs, frf, frf.response)]
    ]
    band = float(frf.frequency[0]), float(frf.frequency[-1])
    frequency, numbers = answered(parts, [one.sample_time for one in flights], band, tested)
    worst, said, varying = _BENT, "", list[Note]()
    for o, output in enumerate(frf.outputs):
        coherence = frf.multiple_coherence[o] * (np.min(frf.random_error[o], axis=0) < _UNKNOWN)
        ok = np.interp(frequency, frf.frequency, coherence) >= USABLE_COHERENCE
        surprise, own, *_ = numbers[ok, :, o].T
        count = max(np.count_nonzero(ok), 1)
        # at most so much that no band speaks alone
        chance = float(np.sum(np.minimum(surprise, _MOST) - 1.0)) * math.sqrt(tested / count)
        bias = math.sqrt(float(np.sum(own)) / count)
        if chance > _ANSWERED and bias > worst:
            worst, said = bias, output
        grows = math.sqrt(max(float(np.median(numbers[:, 2, o])), 0.0)) if frequency.size else 0.0
        if grows > _GROWS and np.sum(numbers[:, 3, o]) > _SURE * math.sqrt(frequency.size):
            varying.append(
                Note(
                    "varying",
                    f"{output}: {100.0 * grows:.2g} % of what the response makes is wrong where it "
                    "makes much, and less elsewhere: the vehicle or an actuator changes in time, "
                    "or isn't linear",
                )
            )
    if said:
        yield Note(
            "feedback",
            f"feedback: what else moves {said}, as gusts do, comes back in "
            f"{' and '.join(drive[:tested])}, which biases the responses of {said} by up to "
            f"{100.0 * worst:.2g} % rms; "
            + (
                "who gives the reference answers gusts, too: fly hands off but for the sweep"
                if frf.reference
                else "prediction is free of that only if the law's own gyro is logged at its rate"
                if frf.estimator == "predictor"
                else "record the sticks as the reference of the joint estimate, or sweep larger"
            ),
        )
    elif not frf.reference and frf.estimator != "predictor":  # what goes round a loop grows, too
        yield from varying


def _slopes(flights: Sequence[FlightRecord], frf: FrequencyResponse) -> Iterator[Note]:
    """Yield what rates and the slopes of attitudes, integrated alike, say of each other."""
    have = [name for name in RATES if all({name, ANGLES[name]} <= {*one.names} for one in flights)]
    if not {*have} & {*frf.outputs}:
        return
    slopes, error, _ = slope_matrix(
        [(one, one.sample_time) for one in flights], have, (frf.frequency[0], frf.frequency[-1])
    )
    for order in permutations(range(len(have))):
        moved = [(k, n) for k, n in enumerate(order) if k != n]
        if moved and all(
            abs(slopes[k, n]) > _HALVES > abs(slopes[k, k]) and error[k, n] < 0.1 for k, n in moved
        ):
            said = ", ".join(f"{have[k]} is d({ANGLES[have[n]]})/dt" for k, n in moved)
            yield Note("columns", f"columns of rates or angles are swapped: {said}")
            return
    for k, name in enumerate(have):
        slope, off = slopes[k, k], abs(slopes[k, k] - 1.0)
        if name in frf.outputs and off > max(_SLOPE, _ERRORS * error[k, k]):
            kind = "sign" if slope < -_HALVES else "unit" if abs(math.log(slope)) > 1.0 else "clock"
            why = {
                "sign": "the sign of one of them is wrong",
                "unit": "the unit of one of them is wrong",
                "clock": "the clock runs wrong, samples are missing, or a scale is wrong",
            }[kind]
            yield Note(
                kind,
                f"{name} is {slope:.4g} +- {error[k, k]:.2g} times d({ANGLES[name]})/dt: {why}",
            )


def _crossed(frf: FrequencyResponse) -> Iterator[Note]:
    """Yield whether cyclic moves the other axis more than its own."""
    for outputs, inputs in _PAIRS:
        if {*outputs} <= {*frf.outputs} and {*inputs} <= {*frf.inputs}:
            size = np.where(frf.usable(), np.abs(frf.response), np.nan)
            own, other = (
                np.nanmedian(
                    [
                        np.log(size[frf.index(o, i)])
                        for o, i in zip(outputs, order)
                        if np.any(np.isfinite(size[frf.index(o, i)]))
                    ]
                    or [-np.inf]
                )
                for order in (inputs, inputs[::-1])
            )
            if other > own:
                yield Note(
                    "columns",
                    f"{inputs[0]} and {inputs[1]} move the other axis more than their own, "
                    f"{math.exp(other - own):.3g} times: columns of {' and '.join(outputs)}, or of "
                    f"{' and '.join(inputs)}, may be swapped",
                )


@dataclass(frozen=True, eq=False)
class _Bands:
    """Bands that do not overlap, with what a fit of the records left in each."""

    frequency: Real
    fit: BandFit

    @property
    def enough(self) -> NDArray[np.bool_]:
        return self.fit.fits & (self.fit.freedom >= _FREEDOM)

    @property
    def variance(self) -> Real:
        """E|dH|^2, (n_freq, n_response, n_drive)."""
        own = np.sum(np.abs(self.fit.weight) ** 2, axis=(2, 3))
        return np.real(np.diagonal(self.fit.residual, axis1=1, axis2=2))[:, :, None] * own[:, None]


def _bands(
    lines: Lines,
    drive: Sequence[str],
    response: Sequence[str],
    frf: FrequencyResponse,
    leading: int | None = None,
) -> _Bands:
    low, high = frf.frequency[0] / (1.0 - _HALF), frf.frequency[-1] / (1.0 + _HALF)
    count = max(int(math.log(max(high / low, 1.0)) / math.log(_APART)) + 1, 1)
    frequency = np.geomspace(low, max(high, low), count) if count > 1 else np.array([low])
    places = lines.places(drive), lines.places(response)
    return _Bands(
        frequency,
        fit_band(lines, *places, frequency, _HALF * frequency, transient=True, leading=leading),
    )


def _nonlinear(
    flights: Sequence[FlightRecord],
    frf: FrequencyResponse,
    inputs: Sequence[str],
    model: FrequencyResponse | None = None,
) -> Iterator[Note]:
    """Yield outputs in which cubes or sizes of signals explain what the inputs themselves don't.

    The cube's part that goes with the input is in the response; what is left of it has the
    response's error, so that its share follows: a sweep's cube has three times its frequency.
    Cubes are of the inputs, and of outputs as `model` makes them. Play is how far an input moves
    before anything follows it. Its size, |u|, shows where one side answers more than the other.
    """
    made, why = _with_powers(flights, frf, inputs, model)
    lines = flight_lines(made, made[0].names, float(frf.frequency[-1]))
    found: dict[str, list[tuple[float, str]]] = {output: [] for output in frf.outputs}
    n_out = len(frf.outputs)
    # with the outputs' poles: those of powers leave more of a light mode than any bend does
    bands = _bands(lines, inputs, (*frf.outputs, *why), frf, leading=n_out)
    left = bands.fit.residual
    power_of, drive = (
        _power(lines, lines.places(one), bands.frequency) for one in ((*frf.outputs, *why), inputs)
    )
    moved = np.nansum(  # of bands with fewer spare lines the gain is anything
        (np.abs(bands.fit.gain[:, :n_out]) ** 2 * drive[:, None])[bands.enough], axis=0
    )
    mainly = moved >= _MINOR * moved.max(axis=1, keepdims=True)  # (n_out, n_in)
    for (o, output), (c, name) in product(enumerate(frf.outputs), enumerate(why, start=n_out)):
        even = name.startswith("|")
        if even and not mainly[o, inputs.index(why[name])]:
            continue  # sides of what hardly moves it bias nothing
        power = np.maximum(np.real(left[:, o, o] * left[:, c, c]), 1e-300)
        coherence = np.abs(left[:, o, c]) ** 2 / power
        slope = left[:, o, c] / np.maximum(np.real(left[:, c, c]), 1e-300)
        part = slope[:, None] * (np.isin(inputs, why[name]) if even else bands.fit.gain[:, c])
        apart = np.real(left[:, c, c]) > _OWN_PART * power_of[:, c]
        whole, ok = bands.fit.gain[:, o], bands.enough & apart
        own = np.abs(whole) ** 2 > _LOUD * bands.variance[:, o]
        weight = np.where(ok[:, None] & own, 1.0 / np.maximum(np.abs(whole) ** 2, 1e-300), 0.0)
        count = np.count_nonzero(ok)
        # -ln of the chance of each band's, whose sum has a Gamma distribution by chance
        chance = -float(np.sum(((bands.fit.freedom - 1.0) * np.log1p(-coherence))[ok]))
        share = float(np.real(np.sum(weight * whole.conj() * part))) / max(
            np.count_nonzero(weight * np.abs(part)), 1
        )
        if count and gammaincc(count, chance) < _RARE and abs(share) > (_BENT, _UNEVEN)[even]:
            text = (
                f"the size of {why[name]} moves it, too: {why[name]} does "
                f"{200.0 * abs(share):.2g} % more to one side than to the other, and the model "
                "has the mean of both"
                if even
                else f"{why[name]} explains what no linear response does: a linkage or a servo "
                "follows it late on each way back"
                if name.endswith("_")
                else f"{why[name]} explains what no linear response does; {output} would be "
                f"{abs(share) / (1.0 + abs(share)) * 100.0:.2g} % "
                f"{'smaller' if share > 0.0 else 'larger'} by small inputs: a stop, a limit or "
                "friction"
            )
            found[output].append((chance, f"{output}: {text}"))
    yield from (Note("nonlinear", max(said)[1]) for said in found.values() if said)


def _power(lines: Lines, places: list[int], frequency: Real) -> Real:
    """Return the mean power of signals in each band, (n_freq, n_signal)."""
    edges = frequency * (1.0 - _HALF), frequency * (1.0 + _HALF)
    summed, count = lines.summed(np.abs(lines.values[:, :, places]) ** 2, *edges)
    return np.sum(summed, axis=1) / np.maximum(count.sum(axis=1), 1)[:, None]


def _with_powers(
    flights: Sequence[FlightRecord],
    frf: FrequencyResponse,
    inputs: Sequence[str],
    model: FrequencyResponse | None,
) -> tuple[list[FlightRecord], dict[str, str]]:
    """Return records with sizes and cubes of inputs, cubes of speeds and predicted outputs.

    What a conditioning input does besides, or its reference, is noise, and biases nothing.
    """
    made, why, active = [], {}, (*frf.inputs, *frf.conditioning)
    every = np.vstack([one.select((*inputs, *active)) for one in flights])
    alike = np.atleast_2d(np.nan_to_num(np.corrcoef(every, rowvar=False)))[: len(inputs)]
    mine = [
        name
        for name, row in zip(inputs, alike)
        if np.argmax(np.abs(row[len(inputs) :])) < len(frf.inputs)
    ]
    for one in flights:
        columns, cubed = {}, {}
        for name in mine:
            u = one[name] - one[name].mean()
            columns[f"|{name}|"], why[f"|{name}|"] = np.abs(u), name
            cubed[f"{name}^3"], why[f"{name}^3"] = u, f"the cube of {name}"
            cubed[f"{name}'^3"] = np.gradient(u, one.sample_time)
            why[f"{name}'^3"] = f"the cube of {name}'s speed"
            columns[f"{name}_"], why[f"{name}_"] = _in_play(u, _PLAY * u.std()), f"play in {name}"
        for name, y in zip(
            frf.outputs, _filtered(one, model.inputs, model, model.response).T if model else ()
        ):
            cubed[f"{name}^3"], why[f"{name}^3"] = y, f"the cube of {name}"
        columns |= {name: x * x * x for name, x in cubed.items()}  # x**3 takes fifty times as long
        signals = (*inputs, *frf.outputs)
        values = np.column_stack([one.select(signals), *columns.values()])
        channels = [one.channels[one.names.index(name)] for name in signals]
        channels += [Channel(name, "1", "OTHER", name) for name in columns]
        made.append(FlightRecord(one.time, values, tuple(channels)))
    return made, why


def _in_play(u: Real, play: float) -> Real:
    """Return the part of a control, (n_time,), that moves within a backlash of +-play.

    From turn to turn it moves as the control does, or stays at an end.
    """
    turns = np.flatnonzero(np.diff(np.sign(np.diff(u)), prepend=np.nan))
    at = accumulate(  # in Python numbers, faster than NumPy's
        np.diff(u[turns]).tolist(), lambda at, by: min(max(at + by, -play), play), initial=0.0
    )
    return np.clip(u + np.repeat([*at] - u[turns], np.diff(turns, append=u.size)), -play, play)


def _in_band(one: FlightRecord, names: Sequence[str], frf: FrequencyResponse) -> Real:
    """Return signals' part in the response's band, (n_time, n_name)."""
    return _filtered(one, names, frf, np.eye(len(names))[:, :, None] * np.ones(frf.frequency.size))


def _filtered(
    one: FlightRecord, names: Sequence[str], frf: FrequencyResponse, response: Complex | Real
) -> Real:
    """Return what a response, (n, n_name, n_freq), makes of signals in its band, (n_time, n)."""
    omega = 2.0 * np.pi * fft.rfftfreq(len(one) - 1, one.sample_time)
    inside = (omega >= frf.frequency[0]) & (omega <= frf.frequency[-1])
    driven = transform(one.select(names))
    lines = np.zeros((omega.size, len(response)), dtype=np.complex128)
    for o, i in np.ndindex(response.shape[:2]):
        gain = np.interp(omega[inside], frf.frequency, response[o, i])
        lines[inside, o] += gain * driven[inside, i]
    return np.pad(fft.irfft(lines, n=len(one) - 1, axis=0), ((0, 1), (0, 0)), mode="wrap")


def _halves(
    flights: Sequence[FlightRecord], frf: FrequencyResponse, inputs: Sequence[str]
) -> Iterator[Note]:
    """Yield responses that differ between one half of the records and the other."""
    power = np.array([np.var(one.select(inputs), axis=0) for one in flights])
    mainly = np.argmax(power / np.maximum(power.max(axis=0), 1e-300), axis=1)
    each = [
        [one for one, main in zip(flights, mainly) if main == axis] for axis in range(len(inputs))
    ]
    first = [one for of in each for one in of[: (len(of) + 1) // 2]]
    last = [one for of in each for one in of[(len(of) + 1) // 2 :] or of]
    if len(flights) > len({*mainly.tolist()}):
        for name, percent in _differing(
            first, last, frf, inputs, len(frf.inputs), fewest=1, coherent=0.0
        ):
            yield Note(
                "records",
                f"{name} differs by {percent:.0f} % rms between one half of the records and the "
                "other, beyond noise: other conditions, sizes or vehicles; identify them apart",
            )


def _drift(
    flights: Sequence[FlightRecord], frf: FrequencyResponse, drive: Sequence[str], tested: int
) -> Iterator[Note]:
    """Yield responses to a drive that differ between the records' first halves and their second.

    Within a loop in gusts a half without a sweep shows the controller's inverse: there the drive is
    the reference.
    """
    middle = [(one, float(np.mean(one.time))) for one in flights]
    first = [one.slice(one.time[0], at) for one, at in middle]
    last = [one.slice(at, one.time[-1]) for one, at in middle]
    for name, percent in _differing(
        first, last, frf, drive, tested, fewest=2, coherent=USABLE_COHERENCE
    ):
        yield Note(
            "drift",
            f"{name} differs by {percent:.0f} % rms between the first half of each record and the "
            "second, beyond noise: the vehicle or its flight changed; identify a part of it",
        )


def _differing(
    first: Sequence[FlightRecord],
    second: Sequence[FlightRecord],
    frf: FrequencyResponse,
    drive: Sequence[str],
    tested: int,
    *,
    fewest: int,
    coherent: float,
) -> Iterator[tuple[str, float]]:
    """Yield responses to the first signals of a drive that differ, and by how many percent.

    They are compared in bands in which both are known and all are so coherent, `fewest` at least.
    """
    names, highest = (*drive, *frf.outputs), float(frf.frequency[-1])
    lines = [flight_lines(side, names, highest) for side in (first, second)]
    one, other = (_bands(side, drive, frf.outputs, frf) for side in lines)
    power = np.array([_power(side, side.places(drive), one.frequency) for side in lines])
    driven = power.min(axis=0) > _DRIVEN * power.max(axis=0)  # in both
    variance, mean = one.variance + other.variance, 0.5 * (one.fit.gain + other.fit.gain)
    loud = np.abs(mean) ** 2 > _LOUD * variance
    ok = (one.enough & other.enough)[:, None, None] & driven[:, None] & loud
    gap = np.abs(one.fit.gain - other.fit.gain) ** 2
    for o, output in enumerate(frf.outputs):
        coherence = np.interp(one.frequency, frf.frequency, frf.multiple_coherence[o])
        for i, name in enumerate(drive[:tested]):
            at = ok[:, o, i] & (coherence >= coherent)
            if (count := np.count_nonzero(at)) < fewest:
                continue
            chance = float(np.sum(gap[at, o, i] / variance[at, o, i])) - count
            relative = math.sqrt(np.mean(gap[at, o, i] / np.abs(mean[at, o, i]) ** 2))
            if chance > _SURE * math.sqrt(2.0 * count) and relative > _DIFFERENT:
                yield f"{output}/{name}", 100.0 * relative


def _driven(flights: Sequence[FlightRecord], frf: FrequencyResponse) -> Iterator[Note]:
    """Yield an input that moves while an output rests, and rests while it moves.

    No controller of that output does both: one of the attitude moves too slowly, one with a
    derivative term never rests. Shares are of each signal's whole motion.
    """
    half = math.pi / math.sqrt(frf.frequency[0] * frf.frequency[-1])  # of the band's middle
    for one, name, output in product(flights, frf.inputs, frf.outputs):
        u, y = (one[each] / max(np.ptp(one[each]), 1e-300) for each in (name, output))
        few, more = (max(round(share * half / one.sample_time), 2) for share in _BRIEF)
        if len(one) < max(2 * few, more):
            continue
        mean = sliding_window_view(u, few).mean(axis=1)
        moves = np.abs(mean[few:] - mean[:-few])[
            np.ptp(sliding_window_view(y, 2 * few), axis=1) < _Y_RESTS
        ]
        rests = np.ptp(sliding_window_view(u, more), axis=1) < _U_RESTS
        swings = np.ptp(sliding_window_view(y, more), axis=1)[rests]
        if min(moves.max(initial=0.0), swings.max(initial=0.0)) > _MOVES:
            yield Note("driven", f"{name} is moved by hand or a script, not by {output} alone")
            return


def _filled(flights: Sequence[FlightRecord], names: Sequence[str], top: float) -> Iterator[Note]:
    """Yield the share of samples that were filled by straight lines, and columns that were.

    Lines between every k-th sample, T s apart, leave sinc^2(omega T / 2) of a motion, some
    1 - (omega T)^2 / 12, which is taken for the vehicle's unless all columns have lost as much.
    """
    lost, step, total = 0, flights[0].sample_time, sum(map(len, flights))
    for one in flights:
        values = one.select(names)
        size = np.maximum(np.ptp(values, axis=0), 1e-300)
        bend, steps = np.abs(np.diff(values, 2, axis=0)), np.abs(np.diff(values, axis=0)[1:])
        # by more than rounding's steps: whole counts lie on lines, too
        least = _DIGITS * np.min(steps, axis=0, where=steps > 1e-9 * size, initial=np.inf)
        lines = bend <= np.minimum(1e-9 * size, 1e-3 * steps + 1e-12 * size)
        lost += sum(
            int(last - first)
            for first, last in stretches(np.all(lines, axis=1) & np.any(steps > least, axis=1))
            if last - first >= _STRAIGHT
        )
    if lost > _FILLED * total:
        yield Note(
            "lost",
            f"{100.0 * lost / total:.2g} % of the samples lie on straight lines "
            "in all channels: they were lost and filled, and nothing between them is known",
        )
    every = {name: max(_between_bends(one[name]) for one in flights) for name in names}
    yield from (
        Note(
            "lost",
            f"{name} is straight between every {k} samples: it was logged slower and filled by "
            f"lines, which lack {100.0 * min((top * k * step) ** 2 / 12.0, 1.0):.2g} % of it at "
            "the band's end: leave out what was filled, or end the band lower",
        )
        for name, k in every.items()
        if k > min(every.values()) and (top * k * step) ** 2 > 12.0 * _BENT
    )


def _between_bends(values: Real) -> int:
    """Return the samples from bend to bend of a column, (n_time,); 1 if it bends anywhere.

    What stands still for half of the time was held, if anything.
    """
    bend = np.abs(np.diff(values, 2))
    return _ticks(bend > _BENDS * np.mean(bend)) if np.median(np.abs(np.diff(values))) else 1


def _ticks(happens: NDArray[np.bool_]) -> int:
    """Return the most samples a tick that hold nearly all that happens, (n,); 1 of few, or none."""
    at = np.flatnonzero(happens)
    least = _REGULAR * max(at.size, _HELD)
    slowest = min(_HELD, int(happens.size / least) + 1)  # no more ticks than samples
    return max(
        (k for k in range(2, slowest) if np.bincount(at % k, minlength=k).max() > least), default=1
    )


def _frozen(
    flights: Sequence[FlightRecord], frf: FrequencyResponse, inputs: Sequence[str]
) -> Iterator[Note]:
    """Yield outputs that stand still while inputs move, and signals that are held for samples."""
    total, step = sum(map(len, flights)), flights[0].sample_time
    for output in frf.outputs:
        still = sum(
            run.last - run.first
            for one in flights
            for run in frozen_runs(one[output])
            for moves in [np.ptp(one.select(inputs)[run.first : run.last], axis=0)]
            if np.any(moves > _MOVES * np.ptp(one.select(inputs), axis=0))
        )
        if still > _STILL * total:
            yield Note(
                "frozen",
                f"{output} stands still for {100.0 * still / total:.2g} % of the samples while "
                "inputs move, frozen or at its sensor's end: leave that out",
            )
    for name in (*inputs, *frf.outputs):
        mine = name in inputs
        if (every := held(flights, name, control=mine)) > 1:
            late = f"{500.0 * (every - 1) * step:.3g} ms"
            why = (
                f"if it moved between and was logged slower, delays are {late} longer: the errors "
                "hold that"
                if mine
                else f"it was logged slower, and is {late} late on average, which its delays have"
            )
            yield Note(
                "held" if mine else "delay", f"{name} changes once in {every} samples only: {why}"
            )


def held(flights: Sequence[FlightRecord], name: str, *, control: bool) -> int:
    """Return for how many samples a signal's values last, 1 if they are its own.

    Uneven holds are told by values that never come again, which are no converter's steps; those of
    a control by its leaps, of more than a step of a coarse stick. 0: a control that stands before
    and after each change, or jumps as far as it moves at all, by design.
    """
    columns = [one[name] for one in flights]
    moves = [np.diff(one) for one in columns]
    every = max(_ticks(one != 0.0) for one in moves)
    size = np.hstack([np.abs(one[one != 0.0][1:]) for one in moves])
    runs = np.hstack([np.diff(np.flatnonzero(one)) for one in moves])
    ticks = runs[size > _LEAPS * np.min(size, initial=np.inf)] if control else runs
    if ticks.size > _HELD:
        ticks = ticks[ticks <= _RESTS * np.median(ticks)]
        usual = round(float(ticks @ ticks / np.sum(ticks)))  # of the one that a sample lies in
        new = np.unique(np.hstack(columns)).size > _REGULAR * runs.size
        every = (
            max(every, usual)
            if new or (control and usual <= _HELD)
            else 0  # what a control holds longer is a design
            if control
            else every
        )
    steps = max(
        np.mean(np.diff(one[:: every or 1]) ** 2) / (np.var(one) + 1e-300) for one in columns
    )
    return 0 if control and (steps > _JUMPS or (every == 1 < np.min(runs, initial=2))) else every


def left_of(flights: Sequence[FlightRecord], name: str, omega: Real) -> Complex:
    """Return what is left of a motion, (n_freq,) at rad/s, of which an input held samples.

    A jump at its sample comes half a step after the line that leads to it.
    """
    ages = range(held(flights, name, control=True)) or [-0.5]
    return np.mean(np.exp(-1j * np.outer(ages, flights[0].sample_time * omega)), axis=0)
