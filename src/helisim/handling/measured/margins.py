"""Margins, disturbance rejection and bandwidth of a closed loop, from flight records alone.

A signal that the control law doesn't know was injected: at a servo command, at an attitude or a
rate that is sensed, or by a stick. What follows it, each signal over what was injected, are
responses of the closed loop; broken loops are their quotients.
"""

import math
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import IdentificationError, InputError, UnknownNameError
from helisim.base.settings import Value
from helisim.handling.loop import BY_NAME, Axis, Curve, History, NoResponse, axis_of
from helisim.handling.measured.interval import UNITS, Asked, Interval, intervals
from helisim.ident import CrossControlWarning, RecordQualityWarning
from helisim.ident.frf import frequency_response
from helisim.ident.local_fit import flight_lines
from helisim.ident.scatter import LocalScatter
from helisim.records.record import IN1, IN2, FlightRecord, one_blas_thread

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Band = tuple[float, float] | Mapping[str, tuple[float, float]] | None

PLACES = ("actuators", "sensors")
"""Where loops are cut; besides, at one sensor, such as "p"."""
DRAWS = 400
"""How many draws there are: their standard deviation is known to 1 / sqrt(2 x 400), 3.5 %."""
_MOST_DRAWS = 20_000
_LATEST = 10.0
"""s; a record later than that is no record of the same moment."""
_FAINT = 1e-4
"""A signal that moves less than this share of the largest of its place is taken to be at rest."""
_SWEPT = 0.3
"""Sticks that move at least so fast, of the one that moves fastest, were swept too: what holds a
hover is slow."""
_HELD = 0.1
"""Sticks that move by more than this share of what was injected, near it, are told."""
_GAIN, _PHASE = 0.006, 0.002
"""By which a loop's gain, and its phase in rad, may differ in flight from those at trim: standard
deviations. A vehicle that drifts in light turbulence, hands off, isn't the one at trim: the JR700's
tail has 1 % less gain at 1.4 m/s, and 0.25 % less by the size of a proof's sweeps. No scatter shows
that."""
_KNOWN = 0.15
"""A point of a curve is of use where half of its draws are off by less than this share of it."""
_REACH = 0.25
"""Two biases are related if their frequencies differ by less than about this, as a fraction."""
_RIDGE = 1e-5
"""Added to a correlation matrix, whose weights are in single precision: no eigenvalue is below
zero then, and draws are rough by 0.3 % of their deviation."""
_POWER = 0.05
"""Of the largest power per octave near a frequency: where power is less, the band has ended."""
_NEAR = 1.4
"""How far away, as a ratio of frequencies, is near: a spectrum of any usual slope passes."""
_WIDTH = 0.1
"""Half width over which power is averaged, as a share of the frequency."""


@dataclass(frozen=True)
class Cut:
    """A place where something was injected into a loop.

    Attributes:
        axis: of control, such as "lat", or its word.
        at: "actuators": added to the servo command. "sensors": it turned the attitude that is
            sensed, its derivative added to the rate. Or one sensor, such as "p".
        injected: channel of what was added.
        total: channel of the sum of both, which goes on behind the cut. None: `returned` and what
            was injected, added up.
        returned: channel of what comes back, to which it was added. None: the difference.
        alone: at the actuators, whether the law moves this command by the axis's own attitude and
            rate alone. To turn that attitude is then to add there: what follows the cut is also the
            rejection of disturbances.

    Raises:
        InputError: neither `total` nor `returned` is given.
        UnknownNameError: no such axis or place.
    """

    axis: str
    at: str
    injected: str
    total: str | None = None
    returned: str | None = None
    alone: bool = False

    def __post_init__(self) -> None:
        one = axis_of(self.axis)
        object.__setattr__(self, "axis", one.name)
        places = (*PLACES, *([one.rate] if one.rate else []))
        if self.at not in places:
            raise InputError(f"a loop of {one.name} is cut at {' or '.join(places)}, not {self.at}")
        if self.total is None and self.returned is None:
            raise InputError(
                f"what follows {self.injected!r} is not said: name the channel of what comes back, "
                "or that of its sum with what was injected"
            )

    @property
    def outputs(self) -> tuple[str, ...]:
        """The channels that are measured over what was injected."""
        return tuple(name for name in (self.total, self.returned) if name is not None)


def cuts_by_name(names: Sequence[str]) -> tuple[Cut, ...]:
    """Return the cuts that channels' names say, by helisim's own names of them."""
    found = []
    for axis in BY_NAME.values():
        for at, *signals in _signals(axis):
            injected, total, returned = (name if name in names else None for name in signals)
            if injected and (total or returned):
                found.append(Cut(axis.name, at, injected, total, returned))
    return tuple(found)


def _signals(axis: Axis) -> Iterator[tuple[str, str, str, str]]:
    """Yield where a loop of the axis may be cut, what is injected there, the sum, what returns."""
    name = axis.name
    yield "actuators", f"{name}_disturbance", f"{name}_sum", name
    yield "actuators", f"{name}_added", name, f"{name}_gyro"
    if axis.rate is not None:
        for at, sensed in (("sensors", axis.angle), (axis.rate, axis.rate)):
            yield at, f"{sensed}_disturbance", f"{sensed}_sum", ""


def _drives(record: FlightRecord, cuts: Sequence[Cut]) -> tuple[str, ...]:
    """Return which signals drive a record: what was injected, or else the sticks that move fastest.

    An attitude that is turned has its derivative in the rate, which is no signal of its own.
    """
    places: dict[str, list[str]] = {}
    for cut in cuts:
        places.setdefault(cut.at if cut.at in PLACES else "rates", []).append(cut.injected)
    drives = []
    for names in places.values():
        size = {name: float(np.std(record[name])) for name in names if name in record}
        least = _FAINT * max(size.values(), default=0.0)
        drives += [name for name, one in size.items() if one > least]
    sensed = [cut for cut in cuts if cut.at == "sensors" and cut.injected in drives]
    turned = {axis_of(cut.axis).rate for cut in sensed}
    of_rates = {cut.injected for cut in cuts if cut.at in turned}
    found = tuple(dict.fromkeys(name for name in drives if name not in of_rates))
    if found:
        return found
    size = {name: float(np.std(np.diff(record[name]))) for name in IN2 if name in record}
    most = max(size.values(), default=0.0)
    return tuple(name for name, one in size.items() if one > 0.0 and one >= _SWEPT * most)


def _groups(drives: Sequence[tuple[str, ...]]) -> list[tuple[tuple[str, ...], list[int]]]:
    """Return the driving signals, and numbers, of records that have such a signal in common."""
    found: list[tuple[dict[str, None], list[int]]] = []
    for number, names in enumerate(drives):
        if not names:
            continue
        joined = [one for one in found if any(name in one[0] for name in names)]
        merged = (dict.fromkeys(names), [number])
        for one in joined[::-1]:
            merged = ({**one[0], **merged[0]}, [*one[1], *merged[1]])
            found.remove(one)
        found.append(merged)
    return [(tuple(names), sorted(numbers)) for names, numbers in found]


def _latencies(records: Sequence[FlightRecord]) -> dict[str, float]:
    """Return channel -> s, by which it is recorded late, as simulations say of their recorder.

    What is added at an actuator is as late as the command that it is added to.
    """
    found: dict[str, float] = {}
    for record in records:
        recorder = record.provenance.get("recorder")
        late = recorder.get("latency") if isinstance(recorder, Mapping) else None
        for name, delay in late.items() if isinstance(late, Mapping) else ():
            if isinstance(delay, int | float):
                found[str(name)] = float(delay)
    for name in [name for name in found if name in IN1]:
        found |= {f"{name}_disturbance": found[name], f"{name}_sum": found[name]}
    return found


@dataclass(frozen=True, eq=False)
class Driven(Value):
    """What signals answer to one that was injected, everything else that was injected held.

    Attributes:
        drive: what was injected.
        outputs: the signals that answer.
        frequency: (n_freq,) rad/s.
        response: (n_out, n_freq).
        root: (n_out n_freq, n_out n_freq) a root R of the errors' covariance, R R*.
        flags: what is to be doubted.
    """

    drive: str
    outputs: tuple[str, ...]
    frequency: Array
    response: Complex
    root: Complex = field(repr=False)
    flags: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("frequency", "response", "root"):
            array = np.array(getattr(self, name))
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    def samples(self, count: int, seed: int) -> Complex:
        """Return responses as they may as well be, (count, n_out, n_freq), in pairs about this.

        Args:
            count: how many, even.
            seed: of the draws.
        """
        off = np.sqrt(0.5) * _pairs(count, self.root.shape[1], seed) @ self.root.T
        return self.response + off.reshape(count, *self.response.shape)


def _pairs(count: int, size: int, seed: int) -> Complex:
    """Return complex normal numbers, (count, size), in pairs of opposite sign; 1 in each part."""
    normal = np.random.default_rng(seed).standard_normal((2, (count + 1) // 2, size))
    one = normal[0] + 1j * normal[1]
    return np.concatenate([one, -one])[:count]


def _estimate_driven(
    records: Sequence[FlightRecord],
    drives: Sequence[str],
    outputs: Sequence[str],
    band: tuple[float, float],
    late: Mapping[str, float],
    cuts: Sequence[Cut],
) -> list[Driven]:
    """Return what signals answer to each that was injected, the others' effect taken out.

    What was injected is outside the loop and known without error, so that no feedback biases it.
    Late records are put right; the two sides of a cut differ by what was injected, exactly.
    """
    found = frequency_response(records, inputs=drives, outputs=outputs, band=band)
    scatter, number = found.scatter, {name: place for place, name in enumerate(found.outputs)}
    assert isinstance(scatter, LocalScatter)  # of the default estimator
    for cut in cuts:
        if set(cut.outputs) <= set(found.outputs):
            number |= dict.fromkeys(cut.outputs, number[cut.outputs[0]])
    alike = np.array([number[name] for name in found.outputs], dtype=np.intp)
    driven = []
    for place, drive in enumerate(found.inputs):
        lag = np.array([late.get(name, 0.0) - late.get(drive, 0.0) for name in found.outputs])
        turn = np.exp(1j * np.outer(lag, found.frequency))
        response = found.response[:, place] * turn
        root = _error_root(scatter, place, alike) * turn.reshape(-1, 1)
        driven.append(Driven(drive, found.outputs, found.frequency, response, root, found.flags))
    return driven


def _error_root(scatter: LocalScatter, place: int, alike: NDArray[np.intp]) -> Complex:
    """Return a root R of the covariance R R* between all outputs and frequencies for one input.

    The estimate's random errors are linear in the disturbance's lines, and known with all their
    correlations: the lines that two points share, times their spectrum. What systematic error may
    be left has a size alone: it is taken as random too, the same for neighbours in frequency, as
    rough curves cross what smooth don't, and for outputs of equal numbers in `alike`, (n_out,).

    Returns:
        (n_out n_freq, n_out n_freq), outputs before frequencies.
    """
    n_out, n_freq = scatter.noise.shape[1], scatter.frequency.size
    last = max(int(np.max(one.first)) + one.value.shape[3] for one in scatter.weights)
    n_flight = scatter.weights[0].value.shape[2]
    taken = np.zeros((n_out, n_freq, n_flight, last), dtype=np.complex64)
    for position, one in enumerate(scatter.weights):
        share = scatter.share[one.part, :, place, position].T.astype(np.float32)
        value = np.einsum("op,pel->oel", share, one.value[:, place])
        for flight, first in enumerate(one.first):
            taken[:, position, flight, first : first + value.shape[2]] = value[:, flight]
    flat = taken.reshape(n_out * n_freq, -1)
    noise = scatter.noise_root().transpose(1, 0, 2).reshape(n_out * n_freq, -1)
    random = (flat @ flat.conj().T).astype(np.complex128) * (noise @ noise.conj().T)
    size, at = np.hypot(scatter.bias, scatter.spread)[:, place], np.log(scatter.frequency)
    near = np.exp(-0.5 * (np.subtract.outer(at, at) / _REACH) ** 2)
    same = np.equal.outer(alike, alike).astype(np.float64)
    covariance = random + np.outer(size.ravel(), size.ravel()) * np.kron(same, near)
    deviation = np.sqrt(np.maximum(np.real(np.diagonal(covariance)), 1e-300))[:, None]
    related = covariance / (deviation * deviation.T)
    np.fill_diagonal(related, 1.0 + _RIDGE)
    try:
        root = np.linalg.cholesky(related)
    except np.linalg.LinAlgError:
        value, vector = np.linalg.eigh(related)
        root = vector * np.sqrt(np.maximum(value, 0.0))
    return np.asarray(deviation * root, dtype=np.complex128)


def _excited_band(records: Sequence[FlightRecord], drives: Sequence[str]) -> tuple[float, float]:
    """Return the band in which all driving signals have power in some record, rad/s.

    Raises:
        IdentificationError: there is none.
    """
    durations = [one.duration for one in records]
    window = min(min(durations) / 2.0, sum(durations) / 5.0)  # the longest that the rules allow
    low = 1.0001 * 2.0 * np.pi / window
    high = 0.8 * np.pi / max(one.sample_time for one in records)
    if not high > 2.0 * low:
        raise IdentificationError(
            f"the records are too short: {min(durations):.4g} s at "
            f"{records[0].sample_time:.4g} s a sample"
        )
    frequency = np.geomspace(low, high, 200)
    reach = int(np.ceil(np.log(_NEAR) / np.log(frequency[1] / frequency[0])))
    lines = flight_lines(records, drives, float(frequency[-1]) * (1.0 + _WIDTH))
    first, count = lines.within((1.0 - _WIDTH) * frequency, (1.0 + _WIDTH) * frequency)
    power = np.abs(lines.values) ** 2
    total = np.concatenate([np.zeros_like(power[:, :1]), np.cumsum(power, axis=1)], axis=1)
    flight = np.arange(len(records))
    summed = total[flight, first + count] - total[flight, first]
    octaves = frequency[:, None] * np.sum(summed / np.maximum(count, 1)[..., None], axis=1)
    begin, end = 0, frequency.size - 1
    for one in octaves.T:  # the band around the most power of each
        near = np.array([one[max(k - reach, 0) : k + reach + 1].max() for k in range(one.size)])
        weak, top = np.flatnonzero(one < _POWER * near), int(np.argmax(one))
        begin = max(begin, 1 + max(weak[weak < top], default=-1))
        end = min(end, min(weak[weak > top], default=one.size) - 1)
    if end - begin < 1:
        raise IdentificationError(
            f"{', '.join(drives)} have no band of power in common; excite them over one band"
        )
    return float(frequency[begin]), float(frequency[end])


@dataclass(frozen=True, eq=False)
class MeasuredCurve(Value):
    """A curve, and samples of it by the errors of its measurement.

    Attributes:
        frequency: (n_freq,) rad/s, where it is known well enough.
        response: (n_freq,).
        samples: (n_draw, n_freq).
    """

    frequency: Array
    response: Complex
    samples: Complex

    @classmethod
    def of(
        cls, name: str, frequency: Array, response: Complex, samples: Complex
    ) -> "MeasuredCurve":
        """Return a curve over the longest band in which it is known.

        Args:
            name: of the curve, for messages.
            frequency: (n_freq,) rad/s.
            response: (n_freq,).
            samples: (n_draw, n_freq).

        Raises:
            NoResponse: it is known nowhere.
        """
        with np.errstate(all="ignore"):
            off = np.median(np.abs(samples / response - 1.0), axis=0)
        known = np.isfinite(response) & np.all(np.isfinite(samples), axis=0) & (off < _KNOWN)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]]).astype(np.int8)))
        starts, stops = edges[::2], edges[1::2]
        best = int(np.argmax(stops - starts)) if starts.size else 0
        if not starts.size or stops[best] - starts[best] < 2:
            raise NoResponse(
                f"{name} is lost in noise between {frequency[0]:.3g} and {frequency[-1]:.3g} "
                "rad/s: inject more, or fly longer"
            )
        seen = slice(int(starts[best]), int(stops[best]))
        return cls(frequency[seen], response[seen], samples[:, seen])

    def curve(self, draw: int | None = None) -> Curve:
        """Return the curve as estimated, or one of its draws."""
        return Curve(self.frequency, self.response if draw is None else self.samples[draw])


@dataclass(frozen=True, eq=False)
class MeasuredLoop(Value):
    """A `Loop` measured in flight, or one of the draws of it that are as likely.

    Attributes:
        driven: responses to each signal that was injected, sticks too.
        cuts: where loops were cut.
        count: of draws.
        seed: of the draws.
        draw: which of the draws this is; None for the measurement itself.
    """

    driven: tuple[Driven, ...] = field(repr=False)
    cuts: tuple[Cut, ...]
    count: int = DRAWS
    seed: int = 1
    draw: int | None = None

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes of which something was measured."""
        by_stick = {axis.stick: name for name, axis in BY_NAME.items()}
        cut = {one.axis for one in self._used}
        swept = {by_stick[one.drive] for one in self.driven if one.drive in by_stick}
        return tuple(name for name in BY_NAME if name in cut | swept)

    @property
    def draws(self) -> "Iterator[MeasuredLoop]":
        """Loops as likely as this one, all errors belonging together as they were measured."""
        for number in range(self.count):
            one = replace(self, draw=number)
            vars(one)["_cache"] = self._cache
            yield one

    def measured(self, kind: str, axis: str, *args: str) -> MeasuredCurve:
        """Return a response with all of its draws.

        Args:
            kind: "broken", "disturbance", "command", "turned" or "actuator", as `Loop` has them.
            axis: of control.
            args: further arguments of these.

        Raises:
            NoResponse: it was not measured.
        """
        one = axis_of(axis)
        match kind:
            case "broken":
                return self._at_cut(self._cut(axis, *args), "L")
            case "disturbance":  # at the attitude, or where it acts alone
                alone = [cut for cut in self._used if cut.alone and cut.axis == one.name]
                turned = any((cut.axis, cut.at) == (one.name, "sensors") for cut in self._used)
                cut = alone[0] if alone and not turned else self._cut(axis, "sensors")
                return self._at_cut(cut, "S")
            case "command":
                return self._angle(one.stick, args[0] if args and args[0] else one.angle)
            case "turned":
                return self._angle(self._cut(args[0], "actuators").injected, one.angle)
        by_stick = args in ((), ("stick",))
        drive = one.stick if by_stick else self._cut(one.name, "sensors").injected
        return self._over(drive, one.name)

    def broken(self, axis: str, at: str = "actuators") -> Curve:
        """Return the loop L of one axis, all others closed; see `Loop`."""
        return self.measured("broken", axis, at).curve(self.draw)

    def disturbance(self, axis: str) -> Curve:
        """Return the sensed angle over a disturbance of it; see `Loop`."""
        return self.measured("disturbance", axis).curve(self.draw)

    def command(self, axis: str, output: str | None = None) -> Curve:
        """Return an output over the axis's stick; see `Loop`."""
        return self.measured("command", axis, output or "").curve(self.draw)

    def turned(self, axis: str, by: str) -> Curve:
        """Return the axis's angle over what is added to a servo command; see `Loop`."""
        return self.measured("turned", axis, by).curve(self.draw)

    def actuator(self, axis: str, by: str = "stick") -> Curve:
        """Return the axis's servo command over its stick or its disturbance; see `Loop`."""
        return self.measured("actuator", axis, by).curve(self.draw)

    @property
    def poles(self) -> Complex:
        """The poles: not known from responses alone."""
        raise NoResponse("responses that were measured have no poles")

    def step(self, axis: str, *, size: float, duration: float) -> History:
        """Not known: a step is flown."""
        raise NoResponse(f"no step of {axis} follows from responses that were measured; fly one")

    @cached_property
    def _cache(self) -> dict[Any, Any]:
        return {}

    @cached_property
    def _used(self) -> list[Cut]:
        """The cuts at which something was injected."""
        drives = [one.drive for one in self.driven]
        return [cut for cut in self.cuts if cut.injected in drives]

    def _cut(self, axis: str, at: str = "actuators") -> Cut:
        name = axis_of(axis).name
        for cut in self._used:
            if (cut.axis, cut.at) == (name, at):
                return cut
        there = ", ".join(f"{cut.axis} at {cut.at}" for cut in self._used) or "no cut"
        raise NoResponse(f"nothing was injected into {name} at {at}; there is {there}")

    def _driven(self, drive: str) -> tuple[Driven, Complex]:
        """Return the responses to what was injected, and their draws, (n_draw, n_out, n_freq)."""
        names = [one.drive for one in self.driven]
        if drive not in names:
            there = ", ".join(names) or "nothing"
            raise NoResponse(f"{drive} was not moved on purpose in the records: {there} was")
        found = self.driven[names.index(drive)]
        if drive not in self._cache:
            self._cache[drive] = found.samples(self.count, self.seed + 1000 * names.index(drive))
        return found, self._cache[drive]

    def _at_cut(self, cut: Cut, kind: str) -> MeasuredCurve:
        """Return L or S at a cut, from what goes on behind it and what comes back."""
        key = (kind, cut.axis, cut.at)
        if key not in self._cache:
            driven, samples = self._driven(cut.injected)
            loop, loops = (_broken(cut, driven.outputs, one) for one in (driven.response, samples))
            changed = _pairs(self.count, 1, self.seed + self.cuts.index(cut) + 1_000_000)
            loops = loops * (1.0 + _GAIN * changed.real + 1j * _PHASE * changed.imag)
            if kind == "S":
                loop, loops = 1.0 / (1.0 + loop), 1.0 / (1.0 + loops)
            name = f"{kind} of {cut.axis} at {cut.at}"
            self._cache[key] = MeasuredCurve.of(name, driven.frequency, loop, loops)
        return self._cache[key]

    def _angle(self, drive: str, wanted: str) -> MeasuredCurve:
        """Return an output over what was moved, an angle by its rate, which has less noise."""
        rate = {one.angle: one.rate for one in BY_NAME.values()}.get(wanted)
        if rate and rate in self._driven(drive)[0].outputs:
            return self._over(drive, rate, integrated=True)
        return self._over(drive, wanted)

    def _over(self, drive: str, output: str, *, integrated: bool = False) -> MeasuredCurve:
        driven, samples = self._driven(drive)
        if output not in driven.outputs:
            there = ", ".join(driven.outputs)
            raise NoResponse(
                f"{output} was not recorded while {drive} was moved; there are {there}"
            )
        key = (output, drive, integrated)
        if key not in self._cache:
            row, name = driven.outputs.index(output), f"{output} over {drive}"
            factor = 1.0 / (1j * driven.frequency) if integrated else 1.0
            one, each = driven.response[row] * factor, samples[:, row] * factor
            self._cache[key] = MeasuredCurve.of(name, driven.frequency, one, each)
        return self._cache[key]


def _broken(cut: Cut, outputs: tuple[str, ...], response: Complex) -> Complex:
    """Return L, (..., n_freq), from responses (..., n_out, n_freq) to what was injected."""
    side = {name: response[..., row, :] for row, name in enumerate(outputs)}
    if cut.returned is None:
        return 1.0 / side[str(cut.total)] - 1.0
    back = side[cut.returned]
    return -back / (1.0 + back if cut.total is None else side[cut.total])


@dataclass(frozen=True)
class MeasuredFigure:
    """One figure of a loop as flown.

    Attributes:
        name: "crossover", "phase_margin", "gain_margin", "DRB", "DRP", "bandwidth", "phase_delay".
        axis: of control.
        at: where the loop was cut; "stick" of answers to it.
        unit: of value and interval.
        interval: value, and the ends of its 95 % interval.
    """

    name: str
    axis: str
    at: str
    unit: str
    interval: Interval

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; null for an end that the records don't bound."""
        ends = {"low": self.interval.low, "high": self.interval.high}
        return {
            "figure": self.name,
            "axis": self.axis,
            "at": self.at,
            "unit": self.unit,
            "value": self.interval.value,
            **{name: end if math.isfinite(end) else None for name, end in ends.items()},
        }


@dataclass(frozen=True, eq=False)
class MeasuredMargins(Value):
    """What flight records say of a closed loop.

    Attributes:
        loop: its responses with their draws, of which any criterion can be asked.
        figures: with 95 % intervals.
        remarks: what the records can't say, and what is to be doubted.
    """

    loop: MeasuredLoop
    figures: tuple[MeasuredFigure, ...]
    remarks: tuple[str, ...]

    def __repr__(self) -> str:
        return f"MeasuredMargins({len(self.figures)} figures of {', '.join(self.loop.axes)})"

    def figure(self, name: str, axis: str, at: str | None = None) -> Interval:
        """Return one figure, such as ("phase_margin", "lat", "actuators"), with its interval.

        Raises:
            UnknownNameError: the records don't have it.
        """
        wanted = axis_of(axis).name
        for one in self.figures:
            if (one.name, one.axis) == (name, wanted) and at in (None, one.at):
                return one.interval
        have = [f"{one.name} {one.axis} {one.at}" for one in self.figures]
        raise UnknownNameError("figure", f"{name} {wanted} {at or ''}".strip(), have)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        figures = [one.to_dict() for one in self.figures]
        return {"figures": figures, "remarks": list(self.remarks)}


@one_blas_thread()
def margins(
    records: FlightRecord | Sequence[FlightRecord],
    *,
    cuts: Cut | Iterable[Cut] | None = None,
    axes: str | Iterable[str] | None = None,
    at: str | Iterable[str] | None = None,
    band: Band = None,
    late: Mapping[str, float] | None = None,
    draws: int = DRAWS,
    seed: int = 1,
) -> MeasuredMargins:
    """Measure a closed loop from flight records: margins, DRB, DRP, bandwidth, with intervals.

    Of what was injected at a servo command follow the broken loop there, its crossover, phase and
    gain margin; at a sensed attitude, the same there and the rejection of disturbances, DRB and
    DRP; of sticks that were swept, bandwidth and phase delay. Several axes may be excited at once.

    Args:
        records: flights; those that have an injected signal in common are estimated together.
        cuts: where something was injected. By default what channels' names say: `lat_disturbance`
            was added, `lat_sum` is what came of it.
        axes: of these only.
        at: "actuators", "sensors" or one sensor such as "p": of these only.
        band: rad/s, or channel that was injected -> its band; by default, and of a channel that
            is not there, where what was injected has power.
        late: channel -> s, by which its record is late; by default as a simulation's records say.
        draws: of the loop, for the intervals.
        seed: of the draws.

    Raises:
        InputError: an argument is out of range, or a channel does not exist.
        IdentificationError: nothing was injected or swept, or records are too short.
    """
    flights = (records,) if isinstance(records, FlightRecord) else tuple(records)
    if not flights:
        raise InputError("no records were given; expected at least one FlightRecord")
    if not 2 <= draws <= _MOST_DRAWS:
        raise InputError(f"draws is {draws}, expected 2 to {_MOST_DRAWS}")
    recorded = sorted({name for flight in flights for name in flight.names})
    for name, delay in (late or {}).items():
        if name not in recorded:
            raise UnknownNameError("channel that is late", name, recorded)
        if not abs(delay) < _LATEST:
            raise InputError(f"{name} is late by {delay} s, expected less than {_LATEST:g} s")
    known, wanted = _cuts(flights, cuts), [axes] if isinstance(axes, str) else axes
    names = tuple(BY_NAME if wanted is None else (axis_of(one).name for one in wanted))
    places = None if at is None else {at} if isinstance(at, str) else set(at)
    there = (*PLACES, *(axis.rate for axis in BY_NAME.values() if axis.rate))
    for place in sorted(places or ()):
        if place not in there:
            raise UnknownNameError("place of a cut", place, there)
    chosen = [cut for cut in known if cut.axis in names and (places is None or cut.at in places)]
    delays = _latencies(flights) | dict(late or {})
    driven: list[Driven] = []
    remarks: list[str] = []
    failed: list[IdentificationError] = []
    for drives, numbers in _groups([_drives(flight, known) for flight in flights]):
        part = [flights[number] for number in numbers]
        try:
            found, said = _estimate(part, drives, known, band, delays)
        except IdentificationError as error:
            failed.append(error)
            continue
        driven += found
        remarks += said
    if failed and not driven:
        raise failed[0]
    if not driven:
        raise IdentificationError(
            "nothing was injected and no stick moves: no response of a loop can be measured; name "
            "what was injected and what came back, or fly with an excitation"
        )
    remarks += [str(error) for error in failed]
    loop = MeasuredLoop(tuple(driven), tuple(chosen), draws + draws % 2, seed)
    figures, missing = _figures(loop, names if at is None else ())
    return MeasuredMargins(loop, figures, tuple(dict.fromkeys((*missing, *remarks))))


def _cuts(flights: Sequence[FlightRecord], cuts: Cut | Iterable[Cut] | None) -> tuple[Cut, ...]:
    if cuts is None:
        names = dict.fromkeys(name for flight in flights for name in flight.names)
        return cuts_by_name(tuple(names))
    given = (cuts,) if isinstance(cuts, Cut) else tuple(cuts)
    for cut in given:
        names = (cut.injected, *cut.outputs)
        cutting = [flight for flight in flights if any(name in flight for name in names)]
        for flight in cutting or flights:
            for name in names:
                flight.unit(name)
    return given


def _estimate(
    part: Sequence[FlightRecord],
    drives: tuple[str, ...],
    cuts: Sequence[Cut],
    band: Band,
    late: Mapping[str, float],
) -> tuple[list[Driven], list[str]]:
    """Return the responses to what was injected in some records, and what is to be doubted."""
    common = [name for name in part[0].names if all(name in one for one in part)]
    axes, injected = BY_NAME.values(), [cut for cut in cuts if cut.injected in drives]
    if all(name in IN2 for name in drives):  # rates, angles without one, the swept axes' commands
        injected = []
        wanted = [axis.rate if axis.rate and axis.rate in common else axis.angle for axis in axes]
        wanted += [axis.name for axis in axes if axis.stick in drives]
    else:
        wanted = [name for cut in injected for name in cut.outputs]
        wanted += [cut.axis for cut in injected if cut.at == "sensors"]
    outputs = [
        name
        for name in dict.fromkeys(wanted)
        if name in common and name not in drives and any(np.ptp(one[name]) > 0.0 for one in part)
    ]
    if not outputs:
        raise IdentificationError(
            f"nothing that was recorded answers to {', '.join(drives)}: expected "
            f"{', '.join(dict.fromkeys(filter(None, wanted)))}"
        )
    if isinstance(band, Mapping):  # that all driving signals have in common
        said = [band[name] for name in drives if name in band]
        band = (max(low for low, _ in said), min(high for _, high in said)) if said else None
    with warnings.catch_warnings():
        for category in (CrossControlWarning, RecordQualityWarning):  # they are among the flags
            warnings.simplefilter("ignore", category)
        band = band or _excited_band(part, drives)
        found = _estimate_driven(part, drives, outputs, band, late, cuts)
    # what was injected is known as it is: a multisine's peaks are no spikes
    remarks = [one for one in found[0].flags if not any(repr(name) in one for name in drives)]
    at_actuators = [name for name in drives if name.removesuffix("_disturbance") in IN1]
    if injected and at_actuators:
        least = min(max(float(np.std(one[name])) for one in part) for name in at_actuators)
        held = [
            name
            for name in IN2
            if name != "COL"
            and all(name in one for one in part)
            and max(float(np.std(one[name])) for one in part) > _HELD * least
        ]
        if held:
            remarks.append(
                f"{', '.join(held)} moved while {', '.join(at_actuators)} did: what a pilot "
                "answers is part of the loop that was measured; for the law's alone keep hands off"
            )
    return found, remarks


def _figures(
    loop: MeasuredLoop, swept: Sequence[str]
) -> tuple[tuple[MeasuredFigure, ...], list[str]]:
    """Return all figures that the loop has, those of sticks of some axes, and which it lacks."""
    found: list[MeasuredFigure] = []
    missing: list[str] = []
    beyond: dict[tuple[str, str, str], list[str]] = {}
    drives = {one.drive for one in loop.driven}
    asked: list[Asked] = []
    for cut in loop.cuts:
        if cut.injected in drives:
            asked.append(Asked("broken", cut.axis, cut.at))
            if cut.at == "sensors" or (cut.alone and cut.at == "actuators"):
                asked.append(Asked("disturbance", cut.axis, cut.at))
    if not asked:
        missing.append(
            "no loop was cut: nothing that the control law doesn't know was injected, so margins, "
            "DRB and DRP can't be had; inject at an actuator or a sensor, and record it"
        )
    sticks = [name for name in swept if BY_NAME[name].stick in drives and name != "col"]
    for one in (*asked, *(Asked("command", name, "stick") for name in sticks)):
        try:
            each = intervals(loop, one)
        except NoResponse as error:
            missing.append(str(error))
            continue
        own = one.curve(loop).frequency
        for name, value in each.items():
            if math.isfinite(value.value):
                found.append(MeasuredFigure(name, one.axis, one.at, UNITS[name], value))
            else:
                key = name.replace("_", " "), one.at, f"{own[0]:.3g} to {own[-1]:.3g} rad/s"
                beyond.setdefault(key, []).append(one.axis)
    missing += [
        f"{name} of {', '.join(on)} at {at} isn't within {band}, where the response is known"
        for (name, at, band), on in beyond.items()
    ]
    return tuple(found), missing
