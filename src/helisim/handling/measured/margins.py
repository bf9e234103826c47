"""Margins, disturbance rejection and bandwidth of a closed loop, from flight records alone."""

import math
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d
from scipy.sparse.csgraph import connected_components

from helisim.base.arrays import Complex, Real
from helisim.base.errors import IdentificationError, InputError, UnknownNameError, check_known
from helisim.base.settings import Checked, Limits, Value, check, convert, setting
from helisim.handling.loop import BY_NAME, PLACES, Curve, History, NoResponse, axis_of
from helisim.handling.measured.interval import (
    UNITS,
    Interval,
    curve_of,
    figures_of,
    intervals,
)
from helisim.ident import CrossControlWarning, RecordQualityWarning
from helisim.ident.evidence import held
from helisim.ident.frf import flights_of, frequency_response
from helisim.ident.local_fit import flight_lines
from helisim.ident.scatter import LocalScatter
from helisim.ident.scatter import alike as likeness
from helisim.records.record import IN1, IN2, FlightRecord, one_blas_thread

Band = tuple[float, float] | None

DRAWS = 400  # draws: their standard deviation is known to 3.5 %
_MOST_DRAWS = 20_000
_LATEST = 10.0  # s, the largest latency of a record
_FAINT = 1e-4  # share of the largest signal of its place: one that moves less is at rest
_SWEPT = 0.3  # share of the fastest stick's speed: sticks as fast were swept too
_NO_SUM = 0.5  # share of what was injected, by which it and what comes back may miss the total
_HELD = 0.1  # share of what was injected: sticks that move more are told
_GAIN, _PHASE = 0.006, 0.002
"""Standard deviations of a loop's gain, and its phase, rad, in flight from those at trim."""
_KNOWN = 0.15  # largest median error of a draw, as a share, at a point of use
_RIDGE = 1e-5  # added to a correlation matrix, whose weights are in single precision
_POWER = 0.05  # share of the largest power per octave near a frequency below which the band ends
_NEAR = 1.4  # ratio of frequencies that are near
_WIDTH = 0.1  # half width over which power is averaged, as a share of the frequency


@dataclass(frozen=True)
class Cut:
    """A place where something was injected into a loop, by channels.

    At "actuators" it was added to the servo command, at "sensors" to the attitude and its rate.
    `total`, behind the cut, is `returned` plus `injected`; both None raise InputError. `alone`: the
    law moves this command by the axis's own attitude and rate alone.
    """

    axis: str
    at: str = setting(choices=PLACES)
    injected: str = setting()
    total: str | None = None
    returned: str | None = None
    alone: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "axis", axis_of(self.axis).name)
        check(self, "cut")
        if not self.outputs:
            raise InputError(
                f"what follows {self.injected!r} is not said: name the channel of what comes back, "
                "or that of its sum with what was injected"
            )

    @property
    def outputs(self) -> tuple[str, ...]:
        """Channels that are measured over what was injected."""
        return tuple(name for name in (self.total, self.returned) if name is not None)


def cuts_by_name(names: Sequence[str]) -> tuple[Cut, ...]:
    """Return the cuts that channels' names say, by helisim's own names of them."""
    found = []
    for name, axis in BY_NAME.items():
        signals = [
            ("actuators", f"{name}_disturbance", f"{name}_sum", name),
            ("actuators", f"{name}_added", name, f"{name}_gyro"),
            ("sensors", f"{axis.angle}_disturbance", f"{axis.angle}_sum", ""),
        ]
        for at, *channels in signals:
            injected, total, returned = (one if one in names else None for one in channels)
            if injected and (total or returned):
                found.append(Cut(name, at, injected, total, returned))
    return tuple(found)


def _drives(record: FlightRecord, cuts: Sequence[Cut]) -> tuple[str, ...]:
    there = [cut for cut in cuts if cut.injected in record]
    sizes = [
        {cut.injected: float(np.std(record[cut.injected])) for cut in there if cut.at == place}
        for place in PLACES
    ]
    injected = [name for one in sizes for name in _large(one, _FAINT)]
    speeds = {name: float(np.std(np.diff(record[name]))) for name in IN2 if name in record}
    return tuple(injected or _large(speeds, _SWEPT))


def _large(sizes: Mapping[str, float], share: float) -> list[str]:
    most = max(sizes.values(), default=0.0)
    return [name for name, one in sizes.items() if one > 0.0 and one >= share * most]


def _groups(drives: Sequence[tuple[str, ...]]) -> list[tuple[tuple[str, ...], list[int]]]:
    names = list(dict.fromkeys(name for one in drives for name in one))
    moved = np.array([[name in one for name in names] for one in drives], dtype=np.int64)
    _, group = connected_components(moved @ moved.T)
    found = []
    for label in dict.fromkeys(group[moved.any(axis=1)].tolist()):
        numbers = np.flatnonzero(group == label).tolist()
        own = tuple(dict.fromkeys(name for number in numbers for name in drives[number]))
        found.append((own, numbers))
    return found


def _latencies(records: Sequence[FlightRecord]) -> dict[str, float]:
    found: dict[str, float] = {}
    for record in records:
        recorder = record.provenance.get("recorder")
        late = recorder.get("latency") if isinstance(recorder, Mapping) else None
        found |= late if isinstance(late, Mapping) else {}
    named = {one: name for name in IN1 for one in (f"{name}_disturbance", f"{name}_sum")}
    return found | {one: found[name] for one, name in named.items() if name in found}


@dataclass(frozen=True, eq=False)
class Driven(Checked, Value):
    """Responses, (n_out, n_freq), of outputs to one injected signal, all other injected ones held.

    At (n_freq,) rad/s; `root` is a root R of the errors' covariance R R*, (n_out n_freq,) squared.
    """

    drive: str
    outputs: tuple[str, ...]
    frequency: Real
    response: Complex
    root: Complex = field(repr=False)
    flags: tuple[str, ...] = ()

    def samples(self, count: int, seed: int) -> Complex:
        """Return draws of the response, (count, n_out, n_freq), in pairs about this one."""
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
    """Return a root R of one input's error covariance R R*, (n_out n_freq, n_out n_freq).

    Systematic errors count as random, alike for neighbours and outputs of equal `alike`, (n_out,).
    """
    n_out, n_freq = scatter.noise.shape[1], scatter.frequency.size
    last = max(int(np.max(one.first)) + one.value.shape[3] for one in scatter.weights)
    taken = np.zeros((n_out, n_freq, scatter.weights[0].value.shape[2], last), dtype=np.complex64)
    for position, one in enumerate(scatter.weights):
        share = scatter.share[one.part, :, place, position].T.astype(np.float32)
        value = np.einsum("op,pel->oel", share, one.value[:, place])
        for flight, first in enumerate(one.first):
            taken[:, position, flight, first : first + value.shape[2]] = value[:, flight]
    flat = taken.reshape(n_out * n_freq, -1)
    noise = scatter.noise_root().transpose(1, 0, 2).reshape(n_out * n_freq, -1)
    random = (flat @ flat.conj().T).astype(np.complex128) * (noise @ noise.conj().T)
    size = np.hypot(scatter.bias, scatter.spread)[:, place]
    near = likeness(scatter.frequency, np.zeros(n_freq, dtype=np.intp))
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
    edges = (1.0 - _WIDTH) * frequency, (1.0 + _WIDTH) * frequency
    summed, count = lines.summed(np.abs(lines.values) ** 2, *edges)
    octaves = frequency[:, None] * np.sum(summed / np.maximum(count, 1)[..., None], axis=1)
    begin, end = 0, frequency.size - 1
    for one in octaves.T:  # the band around the most power of each
        near = maximum_filter1d(one, 2 * reach + 1)
        weak, top = np.flatnonzero(one < _POWER * near), int(np.argmax(one))
        begin = max(begin, 1 + max(weak[weak < top], default=-1))
        end = min(end, min(weak[weak > top], default=one.size) - 1)
    if end - begin < 1:
        raise IdentificationError(
            f"{', '.join(drives)} have no band of power in common; excite them over one band"
        )
    return float(frequency[begin]), float(frequency[end])


@dataclass(frozen=True, eq=False)
class MeasuredCurve(Curve):
    """A curve with its draws, (n_draw, n_freq)."""

    samples: Complex


def known_curve(name: str, frequency: Real, response: Complex, samples: Complex) -> MeasuredCurve:
    """Return the longest band, (n_freq,) each, in which a curve is known; or NoResponse."""
    with np.errstate(all="ignore"):
        off = np.median(np.abs(samples / response - 1.0), axis=0)
    known = np.isfinite(response) & np.all(np.isfinite(samples), axis=0) & (off < _KNOWN)
    edges = np.flatnonzero(np.diff(np.r_[0, known, 0])).reshape(-1, 2)
    start, stop = max(edges.tolist(), key=lambda ends: ends[1] - ends[0], default=(0, 0))
    if stop - start < 2:
        raise NoResponse(
            f"{name} is lost in noise between {frequency[0]:.3g} and {frequency[-1]:.3g} "
            "rad/s: inject more, or fly longer"
        )
    seen = slice(start, stop)
    return MeasuredCurve(frequency[seen], response[seen], samples[:, seen])


@dataclass(frozen=True, eq=False)
class MeasuredLoop(Value):
    """A `Loop` measured in flight, of `MeasuredCurve`; or the `draw` of it with that number."""

    driven: tuple[Driven, ...] = field(repr=False)
    cuts: tuple[Cut, ...]
    count: int = DRAWS
    seed: int = 1
    draw: int | None = None

    @property
    def axes(self) -> tuple[str, ...]:
        """Axes of which something was measured."""
        cut, moved = {one.axis for one in self.used}, {one.drive for one in self.driven}
        return tuple(name for name, one in BY_NAME.items() if name in cut or one.stick in moved)

    @property
    def used(self) -> list[Cut]:
        """Cuts at which something was injected."""
        return [cut for cut in self.cuts if cut.injected in {one.drive for one in self.driven}]

    @property
    def draws(self) -> "Iterator[MeasuredLoop]":
        """Loops as likely as this one, their errors correlated as measured."""
        for number in range(self.count):
            one = replace(self, draw=number)
            vars(one)["_known"] = self._known
            yield one

    @cached_property
    def _known(self) -> dict[Any, Any]:
        return {}

    def broken(self, axis: str, at: str = "actuators") -> Curve:
        """Return the loop L of one axis, all others closed."""
        return self._at_cut(self._cut(axis, at), "L")

    def disturbance(self, axis: str) -> Curve:
        """Return the sensed angle over a disturbance of it, or of a command that acts alone."""
        mine = [cut for cut in self.used if cut.axis == axis_of(axis).name]
        alone = [cut for cut in mine if cut.alone]
        turned = any(cut.at == "sensors" for cut in mine)
        return self._at_cut(alone[0] if alone and not turned else self._cut(axis, "sensors"), "S")

    def command(self, axis: str, output: str | None = None) -> Curve:
        """Return an output over the axis's stick."""
        one = axis_of(axis)
        return self._over(one.stick, output or one.angle)

    def turned(self, axis: str, by: str) -> Curve:
        """Return the axis's angle over what is added to a servo command."""
        return self._over(self._cut(by).injected, axis_of(axis).angle)

    def actuator(self, axis: str, by: str = "stick") -> Curve:
        """Return the axis's servo command over its stick or its disturbance."""
        one = axis_of(axis)
        moved = one.stick if by == "stick" else self._cut(axis, "sensors").injected
        return self._over(moved, one.name)

    @property
    def poles(self) -> Complex:
        """Raise NoResponse: poles don't follow from responses."""
        raise NoResponse("responses that were measured have no poles")

    def step(self, axis: str, *, size: float, duration: float) -> History:
        """Raise NoResponse: steps are flown."""
        raise NoResponse(f"no step of {axis} follows from responses that were measured; fly one")

    def _cut(self, axis: str, at: str = "actuators") -> Cut:
        name = axis_of(axis).name
        for cut in self.used:
            if (cut.axis, cut.at) == (name, at):
                return cut
        there = ", ".join(f"{cut.axis} at {cut.at}" for cut in self.used) or "no cut"
        raise NoResponse(f"nothing was injected into {name} at {at}; there is {there}")

    def _driven(self, drive: str) -> tuple[Driven, Complex]:
        names = [one.drive for one in self.driven]
        if drive not in names:
            there = ", ".join(names) or "nothing"
            raise NoResponse(f"{drive} was not moved on purpose in the records: {there} was")
        number = names.index(drive)
        found = self.driven[number]
        if drive not in self._known:
            self._known[drive] = found.samples(self.count, self.seed + 1000 * number)
        return found, self._known[drive]

    def _at_cut(self, cut: Cut, kind: str) -> Curve:
        def found() -> MeasuredCurve:
            driven, samples = self._driven(cut.injected)
            loop, loops = (_broken(cut, driven.outputs, one) for one in (driven.response, samples))
            changed = _pairs(self.count, 1, self.seed + self.cuts.index(cut) + 1_000_000)
            loops = loops * (1.0 + _GAIN * changed.real + 1j * _PHASE * changed.imag)
            if kind == "S":
                loop, loops = 1.0 / (1.0 + loop), 1.0 / (1.0 + loops)
            return known_curve(f"{kind} of {cut.axis} at {cut.at}", driven.frequency, loop, loops)

        return self._drawn((kind, cut.axis, cut.at), found)

    def _over(self, drive: str, wanted: str) -> Curve:
        def found() -> MeasuredCurve:
            driven, samples = self._driven(drive)
            rate = {one.angle: one.rate for one in BY_NAME.values()}.get(wanted)
            by_rate = rate in driven.outputs
            output = str(rate) if by_rate else wanted
            factor = 1.0 / (1j * driven.frequency) if by_rate else 1.0
            if output not in driven.outputs:
                there = ", ".join(driven.outputs)
                raise NoResponse(
                    f"{output} was not recorded while {drive} was moved; there are {there}"
                )
            row, name = driven.outputs.index(output), f"{output} over {drive}"
            one, each = driven.response[row] * factor, samples[:, row] * factor
            return known_curve(name, driven.frequency, one, each)

        return self._drawn((drive, wanted), found)

    def _drawn(self, key: tuple[str, ...], found: Callable[[], MeasuredCurve]) -> Curve:
        if key not in self._known:
            self._known[key] = found()
        curve = self._known[key]
        return curve if self.draw is None else Curve(curve.frequency, curve.samples[self.draw])


def _broken(cut: Cut, outputs: tuple[str, ...], response: Complex) -> Complex:
    """Return L, (..., n_freq), from responses (..., n_out, n_freq) to what was injected."""
    side = {name: response[..., row, :] for row, name in enumerate(outputs)}
    for name in set(cut.outputs) - set(side):
        raise NoResponse(f"{name} was not recorded, or rested, while {cut.injected} was moved")
    if cut.returned is None:
        return 1.0 / side[str(cut.total)] - 1.0
    back = side[cut.returned]
    return -back / (1.0 + back if cut.total is None else side[cut.total])


@dataclass(frozen=True)
class MeasuredFigure:
    """A figure of a loop as flown, by name in `UNITS`; cut `at`, "stick" of answers to it."""

    name: str
    axis: str
    at: str
    unit: str
    interval: Interval

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; null for an end that the records don't bound."""
        said = {"figure": self.name, "axis": self.axis, "at": self.at, "unit": self.unit}
        return said | self.interval.to_dict()


@dataclass(frozen=True, eq=False)
class MeasuredMargins(Value):
    """Measured loop, its figures with 95 % intervals, and remarks on doubts and gaps."""

    loop: MeasuredLoop
    figures: tuple[MeasuredFigure, ...]
    remarks: tuple[str, ...]

    def __repr__(self) -> str:
        return f"MeasuredMargins({len(self.figures)} figures of {', '.join(self.loop.axes)})"

    def figure(self, name: str, axis: str, at: str | None = None) -> Interval:
        """Return one figure, such as ("phase_margin", "lat"). Raises UnknownNameError."""
        wanted = axis_of(axis).name
        for one in self.figures:
            if (one.name, one.axis) == (name, wanted) and at in (None, one.at):
                return one.interval
        have = [f"{one.name} {one.axis} {one.at}" for one in self.figures]
        raise UnknownNameError("figure", f"{name} {wanted} {at or ''}".strip(), have)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {"figures": [one.to_dict() for one in self.figures], "remarks": list(self.remarks)}


@one_blas_thread()
def margins(
    records: FlightRecord | Sequence[FlightRecord],
    *,
    cuts: Cut | Iterable[Cut] | None = None,
    axes: str | Iterable[str] | None = None,
    at: str | None = None,
    band: Band = None,
    late: Mapping[str, float] | None = None,
    draws: int = DRAWS,
    seed: int = 1,
) -> MeasuredMargins:
    """Measure a closed loop from flight records: margins, DRB, DRP, bandwidth, with intervals.

    A signal injected at a servo command gives the broken loop there; at a sensed attitude, the same
    and DRB and DRP; swept sticks give bandwidth and phase delay. Records with an injected signal in
    common are estimated together.

    `cuts` are by default by channels' names: `lat_disturbance` was added, `lat_sum` is the sum;
    only of `axes` and `at` "actuators" or "sensors" if given. `band`, rad/s, is by default where
    the injected has power; `late`, channel -> s, as a simulation's records say.

    Raises InputError of an argument, IdentificationError if nothing was injected or swept.
    """
    flights = flights_of(records)
    convert(int, draws, "draws", Limits(low=2, high=_MOST_DRAWS))
    recorded = list(dict.fromkeys(name for flight in flights for name in flight.names))
    check_known("channel that is late", late or {}, recorded)
    convert(Mapping[str, float], late or {}, "late", Limits("s", above=-_LATEST, below=_LATEST))
    check_known("place of a cut", () if at is None else [at], PLACES)
    wanted = (axes,) if isinstance(axes, str) else BY_NAME if axes is None else axes
    names = tuple(axis_of(one).name for one in wanted)
    known = cuts_by_name(recorded)
    if cuts is not None:
        known = (cuts,) if isinstance(cuts, Cut) else tuple(cuts)
        check_known(
            "channel", (name for cut in known for name in (cut.injected, *cut.outputs)), recorded
        )
    chosen = [cut for cut in known if cut.axis in names and at in (None, cut.at)]
    delays = _latencies(flights) | dict(late or {})
    driven: list[Driven] = []
    remarks: list[str] = []
    for drives, numbers in _groups([_drives(flight, known) for flight in flights]):
        try:
            found, said = _estimate([flights[k] for k in numbers], drives, known, band, delays)
        except IdentificationError as error:
            remarks.append(str(error))
            continue
        driven += found
        remarks += said
    if not driven:
        raise IdentificationError(
            "; ".join(remarks)
            or "nothing was injected and no stick moves: no response of a loop can be measured; "
            "name what was injected and what came back, or fly with an excitation"
        )
    loop = MeasuredLoop(tuple(driven), tuple(chosen), draws + draws % 2, seed)
    figures, missing = _figures(loop, names if at is None else ())
    return MeasuredMargins(loop, figures, tuple(dict.fromkeys((*missing, *remarks))))


def _estimate(
    part: Sequence[FlightRecord],
    drives: tuple[str, ...],
    cuts: Sequence[Cut],
    band: Band,
    late: Mapping[str, float],
) -> tuple[list[Driven], list[str]]:
    common = [name for name in part[0].names if all(name in one for one in part)]
    axes, injected = BY_NAME.values(), [cut for cut in cuts if cut.injected in drives]
    if set(drives) <= set(IN2):  # rates, angles without one, the swept axes' commands
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
            f"{', '.join(dict.fromkeys(wanted))}"
        )
    with warnings.catch_warnings():
        for category in (CrossControlWarning, RecordQualityWarning):  # they are among the flags
            warnings.simplefilter("ignore", category)
        band = band or _excited_band(part, drives)
        found = _estimate_driven(part, drives, outputs, band, late, cuts)
    # what was injected is known as it is: a multisine's peaks are no spikes
    known = (*drives, *(name.replace("_disturbance", "_sum") for name in drives))
    remarks = [one for one in found[0].flags if not any(repr(name) in one for name in known)]
    size = {
        name: max(float(np.std(one[name])) for one in part)
        for name in (*drives, "LON", "LAT", "PED")
        if name in common
    }
    at_actuators = [name for name in drives if name.removesuffix("_disturbance") in IN1]
    least = min((size[name] for name in at_actuators), default=math.inf)
    flown = [name for name in size if name in IN2 and size[name] > _HELD * least]
    remarks += [
        *(
            f"{total} isn't {back} plus {cut.injected}: a sign, a unit, a name or a clock is "
            "wrong, and so are the figures"
            for cut in injected
            for total, back in [(cut.total, cut.returned)]
            if total and back
            for one in part
            if {cut.injected, total, back} <= {*one.names}
            and np.std(one[total] - one[back] - one[cut.injected])
            > _NO_SUM * np.std(one[cut.injected])
        ),
        *(
            f"{name} jumps from sample to sample, and when in between isn't known: phases can be "
            f"{np.degrees(0.5 * band[1] * part[0].sample_time * max(every, 1)):.2g} deg off at "
            f"{band[1]:.3g} rad/s, and in proportion below"
            for name in drives
            for every in [held(part, name, control=True)]
            if every != 1
        ),
        *(
            f"{', '.join(flown)} moved while {', '.join(at_actuators)} did: what a pilot "
            "answers is part of the loop that was measured; for the law's alone keep hands off"
            for _ in flown[:1]
        ),
    ]
    return found, remarks


def _figures(
    loop: MeasuredLoop, swept: Sequence[str]
) -> tuple[tuple[MeasuredFigure, ...], list[str]]:
    found: list[MeasuredFigure] = []
    missing: list[str] = []
    asked = [
        (kind, cut.axis, cut.at)
        for cut in loop.used
        for kind in ("broken", "disturbance")
        if kind == "broken" or cut.at == "sensors" or cut.alone
    ]
    if not asked:
        missing.append(
            "no loop was cut: nothing that the control law doesn't know was injected, so margins, "
            "DRB and DRP can't be had; inject at an actuator or a sensor, and record it"
        )
    drives = {one.drive for one in loop.driven}
    sticks = [name for name in swept if BY_NAME[name].stick in drives and name != "col"]
    for kind, axis, at in (*asked, *(("command", name, "stick") for name in sticks)):
        try:
            each = intervals(loop, partial(figures_of, kind=kind, axis=axis, at=at))
            own = curve_of(loop, kind, axis, at).frequency
        except NoResponse as error:
            missing.append(str(error))
            continue
        for name, value in each.items():
            if math.isfinite(value.value):
                found.append(MeasuredFigure(name, axis, at, UNITS[name], value))
            else:
                missing.append(
                    f"{name.replace('_', ' ')} of {axis} at {at} isn't within {own[0]:.3g} to "
                    f"{own[-1]:.3g} rad/s, where the response is known"
                )
    return tuple(found), missing
