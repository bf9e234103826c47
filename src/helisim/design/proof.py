"""Proves a control law in flight: specified, predicted, exact and flown, side by side."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.arrays import Real
from helisim.base.errors import DivergedError
from helisim.base.files import make_folder, write_json
from helisim.base.settings import Checked, setting
from helisim.design.exact import exact_loop, hands_off
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.criteria import AttitudeBandwidth, DisturbanceRejection, StabilityMargins
from helisim.handling.criterion import Criterion, Rating
from helisim.handling.loop import BY_NAME, Curve, Loop, NoResponse, axis_of
from helisim.handling.measured.interval import Interval, intervals
from helisim.handling.measured.margins import MeasuredLoop, margins
from helisim.handling.spec import ATTITUDES as AXES
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

OnFlight = Callable[[], None] | None

GRID = np.geomspace(0.2, 250.0, 450)  # rad/s, of the exact loops
DRAWS = 200  # draws of the measured loop
LINEAR = {  # largest deviation from trim in a sweep: commands, unitised; rad/s, rad; m/s
    **dict.fromkeys(IN1, 0.3),
    "ped": 0.07,
    **dict.fromkeys(RATES, 2.0),
    **dict.fromkeys(ATTITUDES, 0.12),
    **dict.fromkeys(("u", "v", "w"), 2.5),
}
TRIM_TIME = 5.0  # s of trimmed flight before a sweep, and again after
_EDGE, _SERVO = 0.15, 0.6  # s beside a sweep's ends; share of a servo's rate limit
_MOST = 0.5  # largest command or stick that is added, unitised
_SWEPT = np.geomspace(0.1, 700.0, 600)
_SAMPLES = 400.0  # 1/s, at which peaks are looked for
_STEADY = Pilot(remnant=0.0)
_STEP_BEFORE, _STEP_LASTS = 0.5, 3.5
_STEPPED = 0.25  # rad, the most that a step turns the vehicle while it is flown
_LARGEST_STEP, _ROUGH = 0.3, 60.0  # stick, unitised; s, of the flight that shows saturation
LIGHT = Weather(turbulence="light")
GUST = Gust(north=-6.0, east=6.0, start=2.0, rise=0.5, hold=1.0)
"""From ahead and the left, faster than the induced velocity of the hover."""


def _sines(axis: str, at: str, band: tuple[float, float], **shape: float) -> Multisine:
    times = {"period": 45.0, "duration": 100.0, "trim_time": TRIM_TIME}
    return Multisine(axis=axis, at=at, amplitude=1e-3, band=band, **times, **shape)


SWEEPS = {
    "actuators_lat+lon": _sines("lat+lon", "actuators", (2.0, 150.0), slope=3.0, corner=20.0),
    "actuators_ped": _sines("ped", "actuators", (2.0, 240.0), slope=1.5, corner=20.0),
    "sensors_lat+lon": _sines("phi+theta", "sensors", (2.0, 110.0), slope=6.0, corner=20.0),
    "sensors_ped": _sines("psi", "sensors", (2.0, 110.0), slope=5.0, corner=20.0),
    "sticks_lat+lon": _sines("lat+lon", "sticks", (2.0, 60.0), slope=-1.0),
    "sticks_ped": _sines("ped", "sticks", (2.0, 60.0)),
}
"""The sweeps of a proof, before they are sized: axes at once, each on its own lines."""
_SEED = 1  # of all flights
_AXIS = {name: one.name for one in BY_NAME.values() for name in (one.name, one.angle)}


def sweep(wave: Multisine, loop: ClosedLoop, vehicle: Vehicle) -> Multisine:
    """Return a multisine, of whole ticks, as large as stays linear by `loop`."""
    tick, trim_time = vehicle.parameters["gyro.period"], wave.trim_time
    period = max(1, round(wave.period / tick)) * tick
    duration = wave.periods * period + 2.0 * trim_time
    made = replace(wave, amplitude=1e-3, period=period, duration=duration)
    most = LINEAR | {"rate": _SERVO * vehicle.parameters["servo.rate_limit"]}
    share = 1.0 / np.sqrt(len(made.axes))
    time = np.arange(round(made.period * _SAMPLES)) / _SAMPLES + trim_time
    signals, swept = made.sticks(time) / 1e-3, replace(loop, frequency=_SWEPT)
    large = []
    for name in made.axes:
        peaks = _peaks(signals[:, PLACES[made.at].index(name)], swept.reached(made.at, _AXIS[name]))
        fits = min(most[name] / peak for name, peak in peaks.items() if name in most)
        large.append(float(min(share * fits, _MOST)))
    return replace(made, amplitude=tuple(large))


def _peaks(signal: Real, moved: dict[str, Curve]) -> dict[str, float]:
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
class ProofPlan(Checked):
    """Flights of a proof: of each sweep `repeats`, each in turbulence of its own; else InputError.

    The flight that shows saturation has this weather too; `recorder` None is the vehicle's own.
    """

    repeats: int = setting(4, above=0)
    weather: Weather = LIGHT
    recorder: Recorder | None = None


def fly_sweeps(
    vehicle: Vehicle, plan: ProofPlan, loop: ClosedLoop, on_flight: OnFlight = None
) -> dict[str, Sequence[FlightRecord]]:
    """Fly the `SWEEPS` of a vehicle's controller, or DivergedError that says in which flight."""
    base = replace(_base(plan), weather=plan.weather)
    flights = {
        name: replace(base, excitation=sweep(wave, loop, vehicle)) for name, wave in SWEEPS.items()
    }
    return {
        name: _flown(vehicle, name, one, on_flight, plan.repeats) for name, one in flights.items()
    }


def fly_events(
    vehicle: Vehicle, plan: ProofPlan, loop: ClosedLoop, on_flight: OnFlight = None
) -> dict[str, FlightRecord]:
    """Fly a step of each stick, as "step_lat", and the "gust", in still air, or DivergedError."""
    base, flights = _base(plan), dict[str, FlightPlan]()
    for axis in AXES:
        step = StickStep(
            axis=axis,
            amplitude=step_size(loop, axis),
            trim_time=_STEP_BEFORE,
            duration=_STEP_BEFORE + _STEP_LASTS,
        )
        flights[f"step_{axis}"] = replace(base, excitation=step)
    computer = replace(plan.recorder or Recorder.of(vehicle), rotor=True)  # with what is true
    flights["gust"] = replace(base, weather=Weather(gust=GUST), recorder=computer)
    return {name: _flown(vehicle, name, one, on_flight)[0] for name, one in flights.items()}


def _base(plan: ProofPlan, duration: float = 10.0) -> FlightPlan:
    return FlightPlan(
        excitation=History.of([0.0, duration], [0.0, 0.0], axis="lat", source="nothing"),
        pilot=_STEADY,
        recorder=plan.recorder,
    )


def _flown(
    vehicle: Vehicle, name: str, one: FlightPlan, on_flight: OnFlight, count: int = 1
) -> Sequence[FlightRecord]:
    try:
        return fly(vehicle, one, count=count, seed=_SEED, on_flight=on_flight)
    except DivergedError as error:
        error.args = (f"the flight {name} of the proof: {error}",)
        raise


def stops(vehicle: Vehicle, plan: FlightPlan) -> dict[str, float]:
    """Return shares of the time at limits in a flight of a plan, at the simulation's own rate."""
    flight = next(simulate(vehicle, plan, seed=_SEED, jobs=1))
    share = {name: float(np.mean(there)) for name, there in at_limits(vehicle, flight)}
    return {name: one for name, one in share.items() if one > 0.0}


def step_size(loop: ClosedLoop, axis: str) -> float:
    """Return the largest step of a stick that turns a vehicle no further than stays linear."""
    unit = loop.step(axis, size=1.0, duration=_STEP_LASTS).signals
    turned = max(float(np.abs(unit[angle]).max()) for angle in ATTITUDES)
    return min(_LARGEST_STEP, _STEPPED / turned) if turned > 0.0 else _LARGEST_STEP


@dataclass(frozen=True, eq=False)
class ComparedCriterion:
    """One specification's ratings, figures flown with 95 % intervals, and why a rating is None."""

    spec: Spec
    predicted: Rating | None
    exact: Rating | None
    flown: Rating | None
    intervals: Mapping[str, Interval]
    unknown: Mapping[str, str]

    @property
    def ratings(self) -> dict[str, Rating | None]:
        """The ratings by "predicted", "exact" and "flown"."""
        return {"predicted": self.predicted, "exact": self.exact, "flown": self.flown}

    @property
    def figures(self) -> dict[str, dict[str, float | None]]:
        """Figure -> value by "predicted", "exact" and "flown", None where there is no rating."""
        names = next((one.figures for one in self.ratings.values() if one), {})
        return {
            name: {who: one.figures[name] if one else None for who, one in self.ratings.items()}
            for name in names
        }

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; None for numbers that aren't finite."""
        criterion, ratings = self.spec.criterion, self.ratings
        figures = [
            {"name": name, "unit": criterion.units[name]}
            | (asdict(criterion.limits[name]) if name in criterion.limits else {})
            | _finite(values)
            | ({"flown": _finite(vars(self.intervals[name]))} if name in self.intervals else {})
            for name, values in self.figures.items()
        ]
        return {
            "criterion": criterion.name,
            "axis": criterion.axis,
            "at": getattr(criterion, "at", None),
            "kind": self.spec.kind,
            "level": {name: one.level if one else None for name, one in ratings.items()},
            "distance": {name: one.distance if one else None for name, one in ratings.items()},
            "figures": figures,
            "unknown": dict(self.unknown),
        }


def _finite(numbers: Mapping[str, float | None]) -> dict[str, Any]:
    return {
        name: one if one is not None and np.isfinite(one) else None for name, one in numbers.items()
    }


def with_usual(specs: Iterable[Spec | Criterion], axes: Sequence[str]) -> tuple[Spec, ...]:
    """Return specifications, and checks of axes' missing margins, rejection and bandwidth."""
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
) -> tuple[ComparedCriterion, ...]:
    """Return each specification's figures and ratings, of the loops that there are."""
    loops = {"predicted": predicted, "exact": exact, "flown": flown}
    table = []
    for spec in specs:
        criterion, unknown = spec.criterion, {}
        ratings: dict[str, Rating | None] = dict.fromkeys(loops)
        for name, loop in loops.items():
            try:
                ratings[name] = loop and criterion.rate(loop)
            except NoResponse as error:
                unknown[name] = str(error)
        measured: dict[str, Interval] = {}
        if ratings["flown"]:
            measured = intervals(flown, lambda one, by=criterion: by.rate(one).figures)
        table.append(ComparedCriterion(spec, **ratings, intervals=measured, unknown=unknown))
    return tuple(table)


@dataclass(frozen=True, eq=False)
class Proof:
    """A control law as proved: ratings, records and loops.

    `sweeps` are records by `SWEEPS`' names; `events`, and with the vehicle's own controller
    `before`, "step_lat", ..., "gust"; `stops` shares of the time at limits in rough air.
    """

    table: tuple[ComparedCriterion, ...]
    sweeps: Mapping[str, Sequence[FlightRecord]]
    events: Mapping[str, FlightRecord]
    before: Mapping[str, FlightRecord]
    stops: Mapping[str, float]
    exact: ClosedLoop
    measured: MeasuredLoop
    predicted: Loop | None
    remarks: tuple[str, ...]

    def __repr__(self) -> str:
        count = len(self.events) + sum(map(len, self.sweeps.values()))
        return f"Proof({len(self.table)} specifications, {count} flights)"

    @property
    def misses(self) -> tuple[str, ...]:
        """One sentence for each hard or soft specification not met as flown, or else exactly."""
        asked = [one for one in self.table if one.spec.kind in ("hard", "soft")]
        rated = [(one.spec.criterion, one.flown, one.exact) for one in asked]
        return tuple(
            f"{criterion.name} of {criterion.word}: "
            + (f"Level {known.level} {how}" if known else "known neither exactly nor from flight")
            for criterion, flown, exact in rated
            for known, how in [(flown, "in flight") if flown else (exact, "exactly")]
            if known is None or known.level > 1
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {
            "met": not self.misses,
            "table": [one.to_dict() for one in self.table],
            "stops": dict(self.stops),
            "remarks": list(self.remarks),
        }

    def write(self, folder: str | PathLike[str]) -> None:
        """Write the records and `proof.json` into a folder, which is made. Raises StorageError."""
        out = make_folder(Path(folder))
        records = {
            f"{name}_{number:04d}": record
            for name, some in self.sweeps.items()
            for number, record in enumerate(some, start=1)
        }
        records |= self.events
        records |= {f"before_{name}": record for name, record in self.before.items()}
        for name, record in records.items():
            write_record(record, out / f"{name}.parquet")
        write_json(self.to_dict(), out / "proof.json", indent=1)


def prove(
    vehicle: Vehicle,
    law: ControllerLike | None = None,
    specs: Iterable[Spec | Criterion] = (),
    *,
    predicted: Loop | None = None,
    plan: ProofPlan | None = None,
    on_flight: OnFlight = None,
) -> Proof:
    """Fly a control law on the nonlinear vehicle, and compare with specified, predicted and exact.

    Actuators, attitudes and sticks are swept, sticks stepped, hands off; by default in light
    turbulence, by the vehicle's own controller. Specifications that are criteria alone are checks.
    Margins, rejection and bandwidth of each axis are always among the results. `predicted` is the
    identified model's loop with the law.

    Raises DivergedError that says in which flight, ModelError if the law can't hold the hover.
    """
    plan = plan or ProofPlan()
    own = hands_off(vehicle)
    flies = own if law is None else own.with_controller(law)
    exact = exact_loop(flies, GRID)
    sweeps = fly_sweeps(flies, plan, exact, on_flight)
    events = fly_events(flies, plan, exact, on_flight)
    rough = stops(flies, replace(_base(plan, _ROUGH), weather=plan.weather))
    measured, remarks = measured_loop(sweeps)
    before = {} if law is None else fly_events(own, plan, exact_loop(own), on_flight)
    table = compare(with_usual(specs, AXES), predicted=predicted, exact=exact, flown=measured)
    return Proof(table, sweeps, events, before, rough, exact, measured, predicted, remarks)


def measured_loop(
    sweeps: Mapping[str, Sequence[FlightRecord]],
) -> tuple[MeasuredLoop, tuple[str, ...]]:
    """Return the loop that the sweeps of a proof show, and remarks on what to doubt."""
    parts, remarks, edge = [], [], TRIM_TIME + _EDGE  # at the edges a sweep's derivative jumps
    for name, records in sweeps.items():
        inner = [one.slice(one.time[0] + edge, one.time[-1] - edge) for one in records]
        band: Any = SWEEPS[name].band
        found = margins(inner, band=band, draws=DRAWS)
        parts.append(found.loop)
        if SWEEPS[name].at != "sticks":  # of these all cuts are missing
            remarks += [f"{name}: {one}" for one in found.remarks]
    driven = tuple(one for part in parts for one in part.driven)
    cuts = tuple(dict.fromkeys(cut for part in parts for cut in part.cuts))
    return MeasuredLoop(driven, cuts, DRAWS), tuple(dict.fromkeys(remarks))
