"""The flights of a proof: sweeps, steps, rough air and a gust, hands off, the law in the step."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from helisim.base.errors import DivergedError, InputError
from helisim.base.value import FrozenMap
from helisim.handling.loop import BY_NAME, axis_of
from helisim.records.record import FlightRecord
from helisim.sim import (
    FlightPlan,
    Gust,
    History,
    Pilot,
    Recorder,
    Step,
    Weather,
    fly,
    simulate,
)
from helisim.sim.envelope import at_limits
from helisim.study.proof.exact import ExactLoop, exact_loop
from helisim.study.proof.sweeps import SWEEPS, SweepKind, sweep
from helisim.vehicle import Vehicle

LIGHT = Weather(turbulence="light")
GUST = Gust(north=-6.0, east=6.0, start=2.0, rise=0.5, hold=1.0)
"""From ahead and the left at once, faster than the induced velocity of the hover."""

_STEADY = Pilot(remnant=0.0)
_STEP_BEFORE, _STEP_LASTS = 0.5, 3.5
_STEPPED = 0.25
"""rad, the most that a step turns the vehicle while it is flown."""
_LARGEST_STEP = 0.3
"""Of a stick, unitised."""


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
    vehicle: Vehicle,
    plan: ProofPlan | None = None,
    *,
    exact: ExactLoop | None = None,
    on_flight: Callable[[], None] | None = None,
) -> ProofFlights:
    """Fly the proof of the controller that a vehicle has.

    Args:
        vehicle: with its controller and a pilot who leaves the sticks alone; see `hands_off`.
        plan: how; by default four flights of each sweep in light turbulence.
        exact: loop of the vehicle, by which amplitudes are chosen; None: `exact_loop`.
        on_flight: called after each flight.

    Raises:
        DivergedError: the vehicle doesn't stay in its envelope; says in which flight.
    """
    plan = plan or ProofPlan()
    loop = exact or exact_loop(vehicle)
    base = _plan(plan)
    sweeps, bands = {}, {}
    for kind in plan.sweeps:
        wave = sweep(kind, loop, vehicle, period=plan.period, periods=plan.periods)
        name = f"{kind.place}_{'+'.join(kind.axes)}"
        rough = replace(base, excitation=wave, weather=plan.weather)
        sweeps[name] = _flown(vehicle, name, rough, plan, on_flight, count=plan.repeats)
        bands[name] = kind.band
    events = fly_events(vehicle, plan, loop, on_flight)
    rough = replace(base, weather=plan.weather)
    return ProofFlights(
        FrozenMap(sweeps),
        FrozenMap(bands),
        FrozenMap({axis: events[f"step_{axis}"] for axis in plan.axes}),
        _flown(vehicle, "rough", rough, plan, on_flight)[0],
        events["gust"],
        stops(vehicle, rough, seed=plan.seed),
    )


def fly_events(
    vehicle: Vehicle,
    plan: ProofPlan,
    loop: ExactLoop,
    on_flight: Callable[[], None] | None = None,
) -> dict[str, FlightRecord]:
    """Fly a step of each stick, as "step_lat", and through the "gust", in still air.

    Args:
        vehicle: with its controller and a pilot who leaves the sticks alone.
        plan: of the proof.
        loop: of the vehicle, by which steps are as large as they stay linear.
        on_flight: called after each flight.

    Raises:
        DivergedError: the vehicle doesn't stay in its envelope; says in which flight.
    """
    found = {}
    for axis in plan.axes:
        step = Step(
            axis=axis,
            amplitude=step_size(loop, axis),
            trim_time=_STEP_BEFORE,
            duration=_STEP_BEFORE + _STEP_LASTS,
        )
        name = f"step_{axis}"
        one = replace(_plan(plan), excitation=step)
        found[name] = _flown(vehicle, name, one, plan, on_flight)[0]
    recorder, seed = plan.recorder, plan.seed
    found["gust"] = gust_encounter(vehicle, plan.gust, recorder=recorder, seed=seed)
    if on_flight is not None:
        on_flight()
    return found


def _plan(plan: ProofPlan) -> FlightPlan:
    return FlightPlan(excitation=_nothing(plan.rough), pilot=_STEADY, recorder=plan.recorder)


def _flown(
    vehicle: Vehicle,
    name: str,
    one: FlightPlan,
    plan: ProofPlan,
    on_flight: Callable[[], None] | None,
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


def gust_encounter(
    vehicle: Vehicle,
    gust: Gust = GUST,
    *,
    duration: float = 10.0,
    recorder: Recorder | None = None,
    seed: int = 1,
) -> FlightRecord:
    """Fly through a gust in still air, nothing else moved, and record it with what is true.

    Args:
        vehicle: with its controller.
        gust: the same for whatever is compared.
        duration: s.
        recorder: the flight computer; the vehicle's own if None.
        seed: of the sensors.

    Raises:
        DivergedError: the vehicle doesn't stay in its envelope.
    """
    computer = replace(recorder or Recorder.of(vehicle), rotor=True)
    plan = FlightPlan(
        excitation=_nothing(duration),
        pilot=_STEADY,
        weather=Weather(gust=gust),
        recorder=computer,
    )
    return fly(vehicle, plan, seed=seed, jobs=1)[0]


def stops(vehicle: Vehicle, plan: FlightPlan, *, seed: int = 1) -> Stops:
    """Return what comes to its limits in a flight of a plan, at the simulation's own rate.

    Args:
        vehicle: with its controller.
        plan: of the flight.
        seed: of turbulence.
    """
    flight = next(simulate(vehicle, plan, seed=seed, jobs=1))
    share = {name: float(np.mean(there)) for name, there in at_limits(vehicle, flight)}
    col, lon, lat = flight.swashplate.unmix(*flight.servo_commands[:, :3].T)
    commands = {"col": col, "lon": lon, "lat": lat, "ped": flight.servo_commands[:, 3]}
    return Stops(
        {name: one for name, one in share.items() if one > 0.0},
        {name: float(np.abs(one).max()) for name, one in commands.items()},
        float(flight.time[-1]),
    )


def step_size(loop: ExactLoop, axis: str) -> float:
    """Return the largest step of a stick that turns a vehicle no further than stays linear."""
    unit = loop.step(axis, size=1.0, duration=_STEP_LASTS).signals
    angles = [unit[one.angle] for one in BY_NAME.values() if one.rate is not None]
    turned = max(float(np.abs(angle).max()) for angle in angles)
    own = axis_of(axis)
    if own.rate is None:
        turned = max(turned, 0.1 * float(np.abs(unit[own.angle]).max()))
    return min(_LARGEST_STEP, _STEPPED / turned) if turned > 0.0 else _LARGEST_STEP


def _nothing(duration: float) -> History:
    """Return a manoeuvre that adds nothing."""
    return History.of([0.0, duration], [0.0, 0.0], axis="lat", source="nothing")
