"""Models for design from records alone: sweeps of all axes, and servos that were on a bench.

The structures are those of `known`: on the records of `helisim reproduce` they predict crossover,
margins, disturbance rejection and bandwidth of the JR700's loops to a third of 2 %, 1.5 degrees,
0.3 dB and 3 %. The paper's own, where a delay stands for the servos, miss a fast yaw loop's
crossover by 5 %: at 80 rad/s they are 14 % too large.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from helisim.design.plant import Plant
from helisim.errors import InputError
from helisim.handling.axis import axis_of
from helisim.ident import Fit, Structure, structures
from helisim.records.channels import AXES
from helisim.records.record import FlightRecord
from helisim.sim.rigs import Finding, RigTest
from helisim.study.flights import Flights
from helisim.study.identification import identify_model
from helisim.study.known import HEAVE_SERVO, ROLLPITCH_SERVO, SERVOS, YAW_BASE_SERVO
from helisim.study.models import HEAVE, YAW_BASE, ModelSpec
from helisim.study.servos import servo_test
from helisim.study.swept import Source, swept
from helisim.vehicle import Vehicle, load
from helisim.vehicle.folder import rig_names, vehicle_names
from helisim.vehicle.load import standard_parameters

Known = Mapping[str, float | tuple[float, float]]

_BENCH = "bench"
_PERIOD = 0.002
"""s, of a gyro that a record doesn't tell of."""
_SERVOS = {
    "swash_omega": "servo.swash_frequency",
    "swash_zeta": "servo.swash_damping",
    "tail_omega": "servo.tail_frequency",
    "tail_zeta": "servo.tail_damping",
}
"""What the models are given -> the parameter of a vehicle that says it."""


@dataclass(frozen=True)
class _Model:
    """A model for design.

    Attributes:
        spec: with the servos in it.
        plain: its structure without.
        axes: whose sweeps it can't do without.
        band: the section of a vehicle's own band, and how many times its lower edge.
    """

    spec: ModelSpec
    plain: Structure
    axes: tuple[str, ...]
    band: tuple[str, float]


_MODELS = (
    _Model(YAW_BASE_SERVO, YAW_BASE.structure, ("ped",), ("yaw_base", 1.0)),
    _Model(ROLLPITCH_SERVO, structures.rollpitch_speeds, ("lat", "lon"), ("rollpitch_in1", 2.0)),
    _Model(HEAVE_SERVO, HEAVE.structure, ("col",), ("heave", 1.0)),
)


def identify_for_design(
    source: Source,
    *,
    axes: Sequence[str] = AXES,
    vehicle: Vehicle | None = None,
    servos: Known | None = None,
    late: Mapping[str, float] | None = None,
    period: float | None = None,
    latency: float | None = None,
    seed: int = 1,
) -> Plant:
    """Identify what a control law of an aircraft has to do with, from sweeps of its axes.

    Args:
        source: a folder of `helisim reproduce`, or of sweeps; or sweeps, by axis or, where they
            say which they sweep, in a row.
        axes: that the law shall have; roll and pitch go together. What isn't swept besides isn't
            conditioned on: pedals that the gyro moves meanwhile take up to 3 % off q/lat.
        vehicle: that flew; a shipped one is known by its records.
        servos: "swash_omega" (rad/s), "swash_zeta", "tail_omega", "tail_zeta", each a value, or
            a value and its standard error. By default what the vehicle's bench finds, or says
            where it has none; without a vehicle delays stand for the servos.
        late: by how much a channel is recorded late, s; by default what the records say.
        period: s, between the gyro's ticks; by default what the records say.
        latency: s, from sensing rates to their use by the gyro; by default what the records say.
        seed: of the bench test.

    Raises:
        StorageError: a file can't be read.
        InputError: an axis was not swept, or a servo's number is unknown.
        IdentificationError: a model can't be identified.
    """
    flights = swept(source)
    chosen = _chosen(tuple(axis_of(axis).name for axis in axes), flights)
    records = [record for axis in AXES for record in flights.get(axis, ())]
    said = records[0].provenance
    own: Mapping[str, Any] = said.get("parameters") or {}
    vehicle = vehicle or (_flown(said) if servos is None else None)
    test = servos_of(vehicle, seed) if servos is None else _given(servos)
    recorder = said.get("recorder") or {}
    return Plant(
        tuple(_identified(model, flights, test, own) for model in chosen),
        late=(recorder.get("latency") or {}) if late is None else late,
        period=own.get("gyro.period", _PERIOD) if period is None else period,
        latency=own.get("gyro.latency", 0.0) if latency is None else latency,
        tilt=_tilt(records),
    )


def servos_of(vehicle: Vehicle | None, seed: int = 1) -> RigTest | None:
    """Return what is known of a vehicle's servos: by its bench, or else as it says itself.

    Args:
        vehicle: None is of nobody's records, of which nothing is known.
        seed: of the bench test.
    """
    if vehicle is None:
        return None
    if _BENCH in rig_names(vehicle.folder):
        return servo_test(vehicle, seed=seed)
    return _given({name: vehicle.parameters[key] for name, key in _SERVOS.items()})


def _given(servos: Known) -> RigTest:
    if set(servos) != set(_SERVOS):
        raise InputError(
            f"servos are given by {', '.join(_SERVOS)}; got {', '.join(servos) or 'nothing'}"
        )
    pairs = {name: one if isinstance(one, tuple) else (one, 0.0) for name, one in servos.items()}
    found = [
        Finding(name=name, unit="", value=value, standard_error=error, how="given")
        for name, (value, error) in pairs.items()
    ]
    return RigTest(rig=SERVOS, findings=tuple(found))


def _flown(said: Mapping[str, Any]) -> Vehicle | None:
    """Return the shipped vehicle that a record's provenance names, None if it is no such."""
    name, own = said.get("vehicle"), said.get("parameters")
    if name not in vehicle_names() or not own:
        return None
    standard = standard_parameters(name)
    changed = {key: own[key] for key in standard if key in own and own[key] != standard[key]}
    return load(name, parameters=changed, timestep=said.get("timestep_s"))


def _chosen(axes: tuple[str, ...], flights: Flights) -> tuple[_Model, ...]:
    """Return the models of some axes. Raises InputError where a sweep is missing."""
    chosen = tuple(model for model in _MODELS if set(model.axes) & set(axes))
    needed = [axis for axis in AXES if any(axis in model.axes for model in chosen)]
    missing = [axis for axis in needed if not flights.get(axis)]
    if missing:
        there = ", ".join(flights) or "none"
        left = [axis for model in _MODELS for axis in model.axes if set(model.axes) <= set(flights)]
        besides = f", or leave it out: axes={tuple(left)}" if left else ""
        raise InputError(
            f"no sweep of {', '.join(missing)} to identify it from: there are sweeps of {there}. "
            f"Fly some, such as helisim fly --axis {missing[0]} --count 5{besides}"
        )
    return chosen


def _identified(
    model: _Model, flights: Flights, servos: RigTest | None, own: Mapping[str, Any]
) -> Fit:
    spec = replace(
        model.spec,
        sweeps=tuple(axis for axis in model.spec.sweeps if flights.get(axis)),
        conditioning=tuple(
            name for name in model.spec.conditioning if name not in AXES or flights.get(name)
        ),
        band=_band(model, flights, own),
    )
    if servos is None:
        spec = replace(spec, structure=model.plain, given={}, servos_known=False)
    return identify_model(spec, flights, ground={} if servos is None else {SERVOS: servos})


def _band(model: _Model, flights: Flights, own: Mapping[str, Any]) -> tuple[float, float]:
    """Return the vehicle's own band, or the JR700's, as far as the sweeps go."""
    section, times = model.band
    low, high = model.spec.band
    if f"band.{section}_low" in own:
        low, high = times * own[f"band.{section}_low"], own[f"band.{section}_high"]
    swept_to = [
        record.provenance["excitation"]["band"][1]
        for axis in model.axes
        for record in flights[axis]
        if record.provenance.get("excitation", {}).get("band")
    ]
    return low, min([high, *swept_to])


def _tilt(records: Sequence[FlightRecord]) -> tuple[float, float]:
    """Return the mean roll and pitch angle, 0 where they aren't recorded."""
    phi, theta = (
        float(np.mean([np.mean(record[name]) for record in records if name in record] or [0.0]))
        for name in ("phi", "theta")
    )
    return phi, theta
