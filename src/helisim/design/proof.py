"""Proves a control law in flight: specified, predicted, exact and flown, side by side."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import DivergedError, InputError, ModelError, TrimError
from helisim.base.files import atomic_write
from helisim.base.settings import FrozenMap
from helisim.design.exact import exact_loop, exact_over, hands_off
from helisim.handling.chart import Border, Limit
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.criteria import AttitudeBandwidth, DisturbanceRejection, StabilityMargins
from helisim.handling.criterion import Criterion, Rating
from helisim.handling.loop import BY_NAME, Curve, Loop, NoResponse, axis_of
from helisim.handling.measured.interval import Interval, interval
from helisim.handling.measured.margins import MeasuredLoop, margins
from helisim.handling.spec import Spec
from helisim.records.record import ATTITUDES, IN1, RATES, FlightRecord
from helisim.records.storage import write_record
from helisim.sim import (
    FlightPlan,
    Gust,
    History,
    Multisine,
    Pilot,
    Recorder,
    Weather,
    fly,
    simulate,
)
from helisim.sim import Step as StickStep
from helisim.sim.excitation import PLACES
from helisim.sim.limits import at_limits
from helisim.vehicle import ControllerLike, Vehicle

Array = NDArray[np.float64]
OnFlight = Callable[[], None] | None

GRID = np.geomspace(0.2, 250.0, 450)
"""rad/s, of the exact loops: to where the fastest sweep ends."""
DRAWS = 200
"""Of the measured loop: an interval's half width is known to 5 %."""
LINEAR = {
    **dict.fromkeys(IN1, 0.3),
    "ped": 0.07,
    **dict.fromkeys(RATES, 2.0),
    **dict.fromkeys(ATTITUDES, 0.12),
    **dict.fromkeys(("u", "v", "w"), 2.5),
}
"""How far a channel may go from its trim in a sweep: commands stop at 0.5, unitised; rad/s, rad;
m/s, of a hover whose induced velocity is about 5 m/s."""
TRIM_TIME = 5.0
"""s of trimmed flight before a sweep, and again after."""
_EDGE = 0.15
"""s, over which the jump of a rate at the ends of a sweep shows in commands."""
_SERVO = 0.6
"""Of a servo's rate limit."""
_MOST = 0.5
"""Of a command or a stick that is added, unitised."""
_SWEPT = np.geomspace(0.1, 700.0, 600)
_SAMPLES = 400.0
"""A second, at which peaks are looked for."""
_STEADY = Pilot(remnant=0.0)
_STEP_BEFORE, _STEP_LASTS = 0.5, 3.5
_STEPPED = 0.25
"""rad, the most that a step turns the vehicle while it is flown."""
_LARGEST_STEP = 0.3
"""Of a stick, unitised."""
LIGHT = Weather(turbulence="light")
GUST = Gust(north=-6.0, east=6.0, start=2.0, rise=0.5, hold=1.0)
"""From ahead and the left at once, faster than the induced velocity of the hover."""


@dataclass(frozen=True, kw_only=True)
class SweepKind:
    """How something is swept.

    Attributes:
        place: "actuators", "sensors" (an attitude is turned) or "sticks".
        axes: that are swept at once, told apart by their own lines.
        band: rad/s.
        slope: of the power over frequency.
        corner: rad/s, below which it is flat.
    """

    place: str
    axes: tuple[str, ...]
    band: tuple[float, float]
    slope: float = 0.0
    corner: float = 0.0

    @property
    def moved(self) -> str:
        """What the excitation calls its axes: angles at the sensors."""
        angles = [axis_of(axis).angle for axis in self.axes]
        return "+".join(angles if self.place == "sensors" else self.axes)


SWEEPS = (
    SweepKind(place="actuators", axes=("lat", "lon"), band=(2.0, 150.0), slope=3.0, corner=20.0),
    SweepKind(place="actuators", axes=("ped",), band=(2.0, 240.0), slope=1.5, corner=20.0),
    SweepKind(place="sensors", axes=("lat", "lon"), band=(2.0, 110.0), slope=6.0, corner=20.0),
    SweepKind(place="sensors", axes=("ped",), band=(2.0, 110.0), slope=5.0, corner=20.0),
    SweepKind(place="sticks", axes=("lat", "lon"), band=(2.0, 60.0), slope=-1.0),
    SweepKind(place="sticks", axes=("ped",), band=(2.0, 60.0)),
)
"""The sweeps of a proof: loops cut at the actuators, attitudes disturbed, commands."""


def sweep(
    kind: SweepKind,
    loop: ClosedLoop,
    vehicle: Vehicle,
    *,
    period: float,
    periods: int = 1,
    trim_time: float = TRIM_TIME,
) -> Multisine:
    """Return the multisine of a sweep, as large as everything stays linear.

    Args:
        kind: of the sweep.
        loop: of the vehicle with its law, by which peaks are foreseen.
        vehicle: that flies.
        period: s, of the multisine.
        periods: how many are flown.
        trim_time: s, before and after.
    """
    tick = vehicle.parameters["gyro.period"]
    period = max(1, round(period / tick)) * tick
    made = Multisine(
        axis=kind.moved,
        at=kind.place,
        amplitude=1e-3,
        band=kind.band,
        period=period,
        duration=periods * period + 2.0 * trim_time,
        slope=kind.slope,
        corner=kind.corner,
        trim_time=trim_time,
    )
    most = LINEAR | {"rate": _SERVO * vehicle.parameters["servo.rate_limit"]}
    share = 1.0 / np.sqrt(len(kind.axes))
    time = np.arange(round(made.period * _SAMPLES)) / _SAMPLES + trim_time
    columns, swept = list(PLACES[kind.place]), replace(loop, frequency=_SWEPT)
    large = []
    for axis, one in zip(kind.axes, made.axes):
        unit = made.sticks(time)[:, columns.index(one)] / 1e-3
        peaks = _peaks(unit, swept.reached(kind.place, axis))
        fits = min(most[name] / peak for name, peak in peaks.items() if name in most)
        large.append(float(min(share * fits, _MOST)))
    return replace(made, amplitude=tuple(large))


def _peaks(signal: Array, moved: dict[str, Curve]) -> dict[str, float]:
    """Return the peaks of what a periodic signal (n_time,) moves, and of servos' rates."""
    lines = np.fft.rfft(signal)
    frequency = 2.0 * np.pi * np.fft.rfftfreq(signal.size, 1.0 / _SAMPLES)
    lines[np.abs(lines) < 1e-9 * np.abs(lines).max()] = 0.0
    there = np.flatnonzero(lines)

    def peak(response: NDArray[np.complex128]) -> float:
        spectrum = np.zeros_like(lines)
        spectrum[there] = lines[there] * response
        return float(np.abs(np.fft.irfft(spectrum, signal.size)).max())

    known = {name: curve.at(frequency[there]) for name, curve in moved.items()}
    turning = max(peak(1j * frequency[there] * known[name]) for name in IN1)
    return {**{name: peak(response) for name, response in known.items()}, "rate": turning}


@dataclass(frozen=True, kw_only=True)
class ProofPlan:
    """How a proof is flown.

    Attributes:
        sweeps: what is swept.
        period: s, of each multisine.
        periods: how often each is repeated in a flight.
        repeats: flights of each sweep, each in turbulence of its own.
        weather: of the sweeps, and of the flight that shows whether anything is at its stops.
        recorder: the flight computer; the vehicle's own if None.
        rough: s, of that flight.
        gust: that is flown through.
        seed: of turbulence and sensors.
        jobs: threads; all processors if None.

    Raises:
        InputError: there is no sweep, or a number is not positive.
    """

    sweeps: tuple[SweepKind, ...] = SWEEPS
    period: float = 45.0
    periods: int = 2
    repeats: int = 4
    weather: Weather = LIGHT
    recorder: Recorder | None = None
    rough: float = 60.0
    gust: Gust = GUST
    seed: int = 1
    jobs: int | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "sweeps", tuple(self.sweeps))
        numbers = (self.period, self.periods, self.repeats, self.rough)
        if not self.sweeps or min(numbers) <= 0:
            raise InputError(
                "a proof needs sweeps, and period, periods, repeats and rough above 0; got "
                f"{len(self.sweeps)} sweeps and {', '.join(f'{one:g}' for one in numbers)}"
            )

    def __repr__(self) -> str:
        swept = ", ".join(f"{kind.place} {'+'.join(kind.axes)}" for kind in self.sweeps)
        return (
            f"ProofPlan({self.repeats} flights of {self.periods} x {self.period:g} s of: {swept})"
        )

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes that are swept, and stepped too."""
        return tuple(dict.fromkeys(axis for kind in self.sweeps for axis in kind.axes))


@dataclass(frozen=True)
class Stops:
    """What came to its limits in a flight through rough air.

    Attributes:
        share: of the time, by the name of each stick, command and servo that did.
        largest: of each command, from the middle of its travel, unitised; stops are at 0.5.
        duration: s, of the flight.
    """

    share: Mapping[str, float]
    largest: Mapping[str, float]
    duration: float

    def __post_init__(self) -> None:
        for name in ("share", "largest"):
            object.__setattr__(self, name, FrozenMap(getattr(self, name)))

    @property
    def free(self) -> bool:
        """Whether nothing was at its limits."""
        return not self.share


@dataclass(frozen=True, eq=False)
class ProofFlights:
    """The records of a proof.

    Attributes:
        sweeps: the flights of each sweep, by what was swept where, such as "actuators_lat+lon".
        bands: rad/s, of each sweep, by the same names.
        steps: a step of each stick, by axis.
        rough: a flight in the weather of the sweeps, nothing else moved.
        gust: through the gust.
        stops: what was at its limits in rough air.
    """

    sweeps: Mapping[str, tuple[FlightRecord, ...]]
    bands: Mapping[str, tuple[float, float]]
    steps: Mapping[str, FlightRecord]
    rough: FlightRecord
    gust: FlightRecord
    stops: Stops = field(repr=False)

    def by_name(self) -> dict[str, FlightRecord]:
        """Return every record by the name of its file."""
        found = {
            f"{name}_{number:04d}": record
            for name, records in self.sweeps.items()
            for number, record in enumerate(records, start=1)
        }
        found |= {f"step_{axis}": record for axis, record in self.steps.items()}
        return found | {"rough": self.rough, "gust": self.gust}


def fly_proof(
    vehicle: Vehicle, plan: ProofPlan, loop: ClosedLoop, on_flight: OnFlight = None
) -> ProofFlights:
    """Fly the proof of the controller that a vehicle has.

    Raises:
        DivergedError: the vehicle doesn't stay in its envelope; says in which flight.
    """
    base = FlightPlan(excitation=_nothing(plan.rough), pilot=_STEADY, recorder=plan.recorder)
    base = replace(base, weather=plan.weather)
    sweeps, bands = {}, {}
    for kind in plan.sweeps:
        name = f"{kind.place}_{'+'.join(kind.axes)}"
        wave = sweep(kind, loop, vehicle, period=plan.period, periods=plan.periods)
        moved = replace(base, excitation=wave)
        sweeps[name] = _flown(vehicle, name, moved, plan, on_flight, count=plan.repeats)
        bands[name] = kind.band
    events = fly_events(vehicle, plan, loop, on_flight)
    return ProofFlights(
        FrozenMap(sweeps),
        FrozenMap(bands),
        FrozenMap({axis: events[f"step_{axis}"] for axis in plan.axes}),
        _flown(vehicle, "rough", base, plan, on_flight)[0],
        events["gust"],
        stops(vehicle, base, seed=plan.seed),
    )


def fly_events(
    vehicle: Vehicle, plan: ProofPlan, loop: ClosedLoop, on_flight: OnFlight = None
) -> dict[str, FlightRecord]:
    """Fly a step of each stick, as "step_lat", and through the "gust", in still air.

    Raises:
        DivergedError: the vehicle doesn't stay in its envelope; says in which flight.
    """
    flight = FlightPlan(excitation=_nothing(10.0), pilot=_STEADY, recorder=plan.recorder)
    found = {}
    for axis in plan.axes:
        step = StickStep(
            axis=axis,
            amplitude=step_size(loop, axis),
            trim_time=_STEP_BEFORE,
            duration=_STEP_BEFORE + _STEP_LASTS,
        )
        name, moved = f"step_{axis}", replace(flight, excitation=step)
        found[name] = _flown(vehicle, name, moved, plan, on_flight)[0]
    computer = replace(plan.recorder or Recorder.of(vehicle), rotor=True)  # with what is true
    gust = replace(flight, weather=Weather(gust=plan.gust), recorder=computer)
    found["gust"] = _flown(vehicle, "gust", gust, replace(plan, jobs=1), on_flight)[0]
    return found


def _nothing(duration: float) -> History:
    """Return a manoeuvre that adds nothing."""
    return History.of([0.0, duration], [0.0, 0.0], axis="lat", source="nothing")


def _flown(
    vehicle: Vehicle,
    name: str,
    one: FlightPlan,
    plan: ProofPlan,
    on_flight: OnFlight,
    *,
    count: int = 1,
) -> tuple[FlightRecord, ...]:
    """Return the flights of a name, and say in an error which they are."""
    try:
        found = fly(vehicle, one, count=count, seed=plan.seed, jobs=plan.jobs, on_flight=on_flight)
    except DivergedError as error:
        error.args = (f"the flight {name} of the proof: {error}",)
        raise
    return tuple(found)


def stops(vehicle: Vehicle, plan: FlightPlan, *, seed: int = 1) -> Stops:
    """Return what comes to its limits in a flight of a plan, at the simulation's own rate."""
    flight = next(simulate(vehicle, plan, seed=seed, jobs=1))
    share = {name: float(np.mean(there)) for name, there in at_limits(vehicle, flight)}
    commands = [*flight.swashplate.unmix(*flight.servo_commands[:, :3].T)]
    commands.append(flight.servo_commands[:, 3])
    return Stops(
        {name: one for name, one in share.items() if one > 0.0},
        {name: float(np.abs(one).max()) for name, one in zip(IN1, commands)},
        float(flight.time[-1]),
    )


def step_size(loop: ClosedLoop, axis: str) -> float:
    """Return the largest step of a stick that turns a vehicle no further than stays linear."""
    unit = loop.step(axis, size=1.0, duration=_STEP_LASTS).signals
    angles = [unit[one.angle] for one in BY_NAME.values() if one.rate is not None]
    turned = max(float(np.abs(angle).max()) for angle in angles)
    own = axis_of(axis)
    if own.rate is None:
        turned = max(turned, 0.1 * float(np.abs(unit[own.angle]).max()))
    return min(_LARGEST_STEP, _STEPPED / turned) if turned > 0.0 else _LARGEST_STEP


class Deviation(NamedTuple):
    """By how much an angle left where it was.

    Attributes:
        peak: rad.
        rms: rad, from the event on.
    """

    peak: float
    rms: float


def deviations(record: FlightRecord, start: float) -> Mapping[str, Deviation]:
    """Return the deviations of phi, theta and psi from their means before an event.

    Raises:
        InputError: the record doesn't hold the time before and behind it.
    """
    time = record.time - record.time[0]
    before, behind = time < start, time >= start
    if not (before.any() and behind.any()):
        raise InputError(
            f"an event at {start:g} s needs a record of before and after it; this one lasts "
            f"{time[-1]:g} s"
        )
    off = {name: record[name][behind] - np.mean(record[name][before]) for name in ATTITUDES}
    return {
        name: Deviation(float(np.abs(one).max()), float(np.sqrt(np.mean(one**2))))
        for name, one in off.items()
    }


@dataclass(frozen=True)
class ComparedFigure:
    """One figure of one criterion, four times over.

    Attributes:
        name: of the figure.
        unit: SI, or dB.
        limit: where its levels end; None if the criterion has no border of it alone.
        predicted: by the identified model; None where that doesn't know it.
        exact: of the sampled linearisation.
        flown: measured in flight, with its 95 % interval.
        met: exact, but over the air that was flown in, whose slow gusts move the point that is
            linearised about: what the flown figure tends to. None in calm air.
    """

    name: str
    unit: str
    limit: Limit | Border | None
    predicted: float | None
    exact: float | None
    flown: Interval | None
    met: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; what is not finite is None."""

        def finite(value: float | None) -> float | None:
            return None if value is None or not np.isfinite(value) else float(value)

        limit = self.limit if isinstance(self.limit, Limit) else None
        flown = self.flown and {name: finite(one) for name, one in asdict(self.flown).items()}
        return {
            "name": self.name,
            "unit": self.unit,
            "level1": limit and limit.level1,
            "level2": limit and limit.level2,
            "predicted": finite(self.predicted),
            "exact": finite(self.exact),
            "exact_over_air": finite(self.met),
            "flown": flown,
        }


@dataclass(frozen=True, eq=False)
class ComparedCriterion:
    """One criterion: its figures, and the ratings of who knows what it asks for.

    Attributes:
        spec: what is asked, and what it is in a design.
        figures: each of them.
        predicted: rating of the identified model's loop; None where that doesn't know it.
        exact: rating of the sampled linearisation.
        flown: rating of the loop as measured.
        distance: flown, from the border of Level 1, with its 95 % interval.
        unknown: why, of "predicted", "exact" and "flown", there is no rating.
    """

    spec: Spec
    figures: tuple[ComparedFigure, ...]
    predicted: Rating | None
    exact: Rating | None
    flown: Rating | None
    distance: Interval | None
    unknown: Mapping[str, str]

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        ratings = {"predicted": self.predicted, "exact": self.exact, "flown": self.flown}
        return {
            "criterion": self.spec.criterion.name,
            "axis": self.spec.criterion.axis,
            "at": getattr(self.spec.criterion, "at", None),
            "kind": self.spec.kind,
            "level": {name: one.level if one else None for name, one in ratings.items()},
            "distance": {name: one.distance if one else None for name, one in ratings.items()},
            "figures": [one.to_dict() for one in self.figures],
            "unknown": dict(self.unknown),
        }


def with_usual(specs: Iterable[Spec | Criterion], axes: Sequence[str]) -> tuple[Spec, ...]:
    """Return specifications, and margins, rejection and bandwidth of axes without, to check."""
    found = [one if isinstance(one, Spec) else Spec(one, "check") for one in specs]
    there = {(type(one.criterion), one.criterion.axis) for one in found}
    for kind in (StabilityMargins, DisturbanceRejection, AttitudeBandwidth):
        missing = [axis for axis in axes if (kind, axis_of(axis).name) not in there]
        found += [Spec(kind(axis=axis), "check") for axis in missing]
    return tuple(found)


def compare(
    specs: Iterable[Spec],
    *,
    predicted: Loop | None,
    exact: Loop | None,
    flown: MeasuredLoop | None,
    met: Loop | None = None,
) -> tuple[ComparedCriterion, ...]:
    """Return each specification's figures and ratings, of the loops that there are.

    Args:
        specs: what is asked.
        predicted: loop of the identified model.
        exact: the sampled linearisation's.
        flown: measured.
        met: exact, over the air that was flown in.
    """
    loops = {"predicted": predicted, "exact": exact, "flown": flown, "met": met}
    table = []
    for spec in specs:
        criterion, unknown = spec.criterion, {}
        ratings: dict[str, Rating] = {}
        for name, loop in loops.items():
            try:
                if loop is not None:
                    ratings[name] = criterion.rate(loop)
            except NoResponse as error:
                if name != "met":  # a mean has neither poles nor steps
                    unknown[name] = str(error)
        measured: dict[str, Interval] = {}
        if flown is not None and "flown" in ratings:
            measured = _intervals(criterion, flown, ratings["flown"])
        names = dict.fromkeys(name for one in ratings.values() for name in one.figures)
        figures = []
        for name in names:
            told = {who: one.figures.get(name) for who, one in ratings.items()}
            told = {who: told.get(who) for who in ("predicted", "exact", "met")}
            unit, limit = criterion.units[name], criterion.limits.get(name)
            figures.append(ComparedFigure(name, unit, limit, flown=measured.get(name), **told))
        rated = {who: ratings.get(who) for who in ("predicted", "exact", "flown")}
        distance = measured.get("distance")
        table.append(
            ComparedCriterion(spec, tuple(figures), **rated, distance=distance, unknown=unknown)
        )
    return tuple(table)


def _intervals(criterion: Criterion, loop: MeasuredLoop, rating: Rating) -> dict[str, Interval]:
    """Return the figures that were measured, and the distance, with their intervals.

    Draws that don't know what the criterion asks for don't count.
    """
    nominal = {**rating.figures, "distance": rating.distance}
    samples: list[dict[str, float]] = []
    for one in loop.draws:
        try:
            found = criterion.rate(one)
        except NoResponse:
            continue
        samples.append({**found.figures, "distance": found.distance})
    return {
        name: interval(float(value), np.array([one.get(name, np.nan) for one in samples], float))
        for name, value in nominal.items()
        if samples
    }


@dataclass(frozen=True, eq=False)
class Proof:
    """A control law as it was proved.

    Attributes:
        table: each specification, predicted, exact and flown.
        flights: the records.
        exact: the loop of the sampled linearisation.
        measured: the loop that the records show.
        predicted: that of the identified model, if it was given.
        gust: that was flown through.
        before: steps and gust flown with the vehicle's own controller, as `flights.by_name` calls
            them; empty if that is what was proved.
        remarks: what the records can't say, and what is to be doubted.
    """

    table: tuple[ComparedCriterion, ...]
    flights: ProofFlights
    exact: ClosedLoop
    measured: MeasuredLoop
    predicted: Loop | None
    gust: Gust
    before: Mapping[str, FlightRecord]
    remarks: tuple[str, ...]

    def __repr__(self) -> str:
        count = len(self.flights.by_name())
        return f"Proof({len(self.table)} specifications, {count} flights)"

    @property
    def met(self) -> bool:
        """Whether every hard and soft specification is met as flown, or else exactly."""
        return not self.misses

    @property
    def misses(self) -> tuple[str, ...]:
        """One sentence for each hard or soft specification that isn't met, as `met` says."""
        asked = [one for one in self.table if one.spec.kind in ("hard", "soft")]
        rated = [(one.spec.criterion, one.flown, one.exact) for one in asked]
        return tuple(
            f"{criterion.name} of {criterion.word}: "
            + (f"Level {known.level} {how}" if known else "known neither exactly nor from flight")
            for criterion, flown, exact in rated
            for known, how in [(flown, "in flight") if flown else (exact, "exactly")]
            if known is None or known.level > 1
        )

    @property
    def gust_deviations(self) -> dict[str, Mapping[str, Deviation]]:
        """How far the gust turned the vehicle, by angle: "before" and with the "law"."""
        records = {"before": self.before.get("gust"), "law": self.flights.gust}
        return {
            name: deviations(record, self.gust.start)
            for name, record in records.items()
            if record is not None
        }

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        stopped = self.flights.stops
        return {
            "met": self.met,
            "table": [one.to_dict() for one in self.table],
            "stops": {
                "share": dict(stopped.share),
                "largest": dict(stopped.largest),
                "duration_s": stopped.duration,
            },
            "gust": {
                name: {angle: one._asdict() for angle, one in angles.items()}
                for name, angles in self.gust_deviations.items()
            },
            "remarks": list(self.remarks),
        }

    def write(self, folder: str | PathLike[str]) -> None:
        """Write the records and `proof.json` into a folder, which is made. Raises StorageError."""
        out = Path(folder)
        out.mkdir(parents=True, exist_ok=True)
        before = {f"before_{name}": record for name, record in self.before.items()}
        for name, record in {**self.flights.by_name(), **before}.items():
            write_record(record, out / f"{name}.parquet")
        with atomic_write(out / "proof.json") as temporary:
            temporary.write_text(json.dumps(self.to_dict(), indent=1), encoding="utf-8")


def prove(
    vehicle: Vehicle,
    law: ControllerLike | None = None,
    specs: Iterable[Spec | Criterion] = (),
    *,
    predicted: Loop | None = None,
    plan: ProofPlan | None = None,
    draws: int = DRAWS,
    on_flight: OnFlight = None,
) -> Proof:
    """Fly a control law on the nonlinear vehicle, and hold what is measured against the rest.

    Loops are cut at the actuators, attitudes are disturbed, sticks are swept and stepped, in light
    turbulence unless told otherwise, the pilot's hands off; margins, rejection and bandwidth
    follow from the records alone. They stand beside what was asked, what the identified model
    predicted, and what the exact sampled linearisation says. Margins, rejection and bandwidth of
    each axis are told whether they are asked for or not.

    Args:
        vehicle: that flies.
        law: of control; the vehicle's own controller if None.
        specs: what is asked.
        predicted: loop of the identified model with the law.
        plan: how the proof is flown.
        draws: of the measured loop, for the intervals.
        on_flight: called after each flight.

    Raises:
        DivergedError: the vehicle doesn't stay in its envelope; says in which flight.
        ModelError: the law can't hold the hover.
    """
    plan = plan or ProofPlan()
    own = hands_off(vehicle)
    flies = own if law is None else own.with_controller(law)
    exact = exact_loop(flies, GRID)
    flights = fly_proof(flies, plan, exact, on_flight)
    measured, remarks = measured_loop(flights, draws=draws)
    before = {} if law is None else fly_events(own, plan, exact_loop(own), on_flight)
    met, missing = over_air(flies, plan.weather)
    asked = with_usual(specs, plan.axes)
    table = compare(asked, predicted=predicted, exact=exact, flown=measured, met=met)
    remarks = (*remarks, *missing)
    return Proof(table, flights, exact, measured, predicted, plan.gust, FrozenMap(before), remarks)


def over_air(vehicle: Vehicle, weather: Weather) -> tuple[Loop | None, tuple[str, ...]]:
    """Return the exact loop over the air that was flown in, and why there is none.

    A small vehicle can't hover in every wind that it meets for a moment; in calm air none is asked.
    """
    if weather.low_wind <= 0.0:
        return None, ()
    try:
        return exact_over(vehicle, weather, GRID), ()
    except (TrimError, ModelError) as error:
        return None, (f"no exact figures over the air that was met, of calm air alone: {error}",)


def measured_loop(
    flights: ProofFlights, *, draws: int = DRAWS, seed: int = 1
) -> tuple[MeasuredLoop, tuple[str, ...]]:
    """Return the loop that the sweeps of a proof show, and what is to be doubted of it."""
    parts, remarks, edge = [], [], TRIM_TIME + _EDGE  # at the edges a sweep's derivative jumps
    for name, records in flights.sweeps.items():
        inner = [one.slice(one.time[0] + edge, one.time[-1] - edge) for one in records]
        found = margins(inner, band=flights.bands[name], draws=draws, seed=seed)
        parts.append(found.loop)
        if name.startswith(("actuators", "sensors")):  # of the rest all cuts are missing
            remarks += [f"{name}: {one}" for one in found.remarks]
    driven = tuple(one for part in parts for one in part.driven)
    cuts = tuple(dict.fromkeys(cut for part in parts for cut in part.cuts))
    return MeasuredLoop(driven, cuts, parts[0].count, seed), tuple(dict.fromkeys(remarks))
