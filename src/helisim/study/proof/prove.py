"""Prove a control law in flight: specified, predicted, exact and flown, side by side."""

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from helisim.base.errors import ModelError, TrimError
from helisim.base.files import atomic_write
from helisim.base.value import FrozenMap
from helisim.handling.criteria import Criterion
from helisim.handling.loop import Loop
from helisim.handling.measured.margins import MeasuredLoop, margins
from helisim.handling.spec import Spec
from helisim.records.record import FlightRecord
from helisim.records.storage import write_record
from helisim.sim import Gust, Weather
from helisim.study.proof.air import exact_over
from helisim.study.proof.comparison import ComparedCriterion, compare, with_usual
from helisim.study.proof.deviation import Deviation, deviations
from helisim.study.proof.exact import ExactLoop, exact_loop
from helisim.study.proof.flights import ProofFlights, ProofPlan, fly_events, fly_proof
from helisim.study.proof.hands import hands_off
from helisim.study.proof.sweeps import TRIM_TIME
from helisim.vehicle import ControllerLike, Vehicle

GRID = np.geomspace(0.2, 250.0, 450)
"""rad/s, of the exact loops: to where the fastest sweep ends."""
_EDGE = 0.15
"""s, over which the jump of a rate at the ends of a sweep shows in commands."""
DRAWS = 200
"""Of the measured loop: an interval's half width is known to 5 %."""


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
    exact: ExactLoop
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
        stops = self.flights.stops
        return {
            "met": self.met,
            "table": [one.to_dict() for one in self.table],
            "stops": {
                "share": dict(stops.share),
                "largest": dict(stops.largest),
                "duration_s": stops.duration,
            },
            "gust": {
                name: {angle: asdict(one) for angle, one in angles.items()}
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
    on_flight: Callable[[], None] | None = None,
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
    flights = fly_proof(flies, plan, exact=exact, on_flight=on_flight)
    measured, remarks = measured_loop(flights, draws=draws)
    before = {} if law is None else fly_events(own, plan, exact_loop(own), on_flight)
    asked = with_usual(specs, plan.axes)
    met, doubts = _over_air(flies, plan.weather)
    table = compare(asked, predicted=predicted, exact=exact, flown=measured, met=met)
    remarks = (*remarks, *doubts)
    return Proof(table, flights, exact, measured, predicted, plan.gust, FrozenMap(before), remarks)


def _over_air(vehicle: Vehicle, weather: Weather) -> tuple[Loop | None, tuple[str, ...]]:
    """Return the exact loop over the air that was flown in, and why there is none.

    A small vehicle can't hover in every wind that it meets for a moment.
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
    """Return the loop that the sweeps of a proof show, and what is to be doubted of it.

    Args:
        flights: of the proof.
        draws: of the loop.
        seed: of the draws.
    """
    parts, remarks = [], []
    for name, records in flights.sweeps.items():
        inner = [_inside(record) for record in records]
        found = margins(inner, band=flights.bands[name], draws=draws, seed=seed)
        parts.append(found.loop)
        if name.startswith(("actuators", "sensors")):  # of the rest all cuts are missing
            remarks += [f"{name}: {one}" for one in found.remarks]
    driven = tuple(one for part in parts for one in part.driven)
    cuts = tuple(dict.fromkeys(cut for part in parts for cut in part.cuts))
    loop = MeasuredLoop(driven, cuts, parts[0].count, seed)
    return loop, tuple(dict.fromkeys(remarks))


def _inside(record: FlightRecord) -> FlightRecord:
    """Return the sweep of a record without its edges, where a derivative of it jumps."""
    edge = TRIM_TIME + _EDGE
    return record.slice(record.time[0] + edge, record.time[-1] - edge)
