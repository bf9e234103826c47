"""Models for design from records alone: sweeps of all axes, and servos that were on a bench.

The structures are those of `known`. On the records of `helisim reproduce`, five seeds, they predict
the JR700's loops with its own gyro, with twice its gains and with two attitude laws: crossovers and
disturbance rejection to 0.6 %, bandwidths to 0.7 %, phase margins to 0.6 degrees, gain margins to
0.13 dB in roll and pitch and 0.2 dB in yaw, phase delays to 0.1 ms. The paper's own structures,
where a delay stands for the servos, miss a fast yaw loop's crossover by 5 %: at 80 rad/s they are
14 % too large.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from helisim.base.errors import InputError
from helisim.base.note import Command, Option
from helisim.design.plant import Plant
from helisim.handling.loop import axis_of
from helisim.ident import Fit, Structure, blocks, identify, in_series, structures
from helisim.ident.structures import with_inflow
from helisim.records.channels import AXES
from helisim.records.record import FlightRecord
from helisim.sim.rigs import Finding, RigTest
from helisim.study.comparison import frequency_response
from helisim.study.experiment import Flights, Source, servo_test, sweeps_of
from helisim.study.models import (
    HEAVE,
    HEAVE_SERVO,
    ROLLPITCH_IN1,
    ROLLPITCH_SERVO,
    SERVOS,
    YAW_BASE,
    YAW_BASE_SERVO,
    ModelSpec,
)
from helisim.vehicle import Vehicle, load
from helisim.vehicle.folder import rig_names, vehicle_names
from helisim.vehicle.vehicle import standard_parameters

Servos = Mapping[str, float | tuple[float, float]]

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
        section: of a vehicle's own band.
        across: by how much the band of responses across axes begins higher.
        inflow: the structure, servos in it, with the inflow as states: for what the other can't
            follow.
    """

    spec: ModelSpec
    plain: Structure
    axes: tuple[str, ...]
    section: str
    across: float = 1.0
    inflow: Structure | None = None


_MISFIT = 10.0
"""Times what noise leaves, from which on a structure can't follow: the JR700's leave 1, with
Pitt-Peters inflow 465; the structure with inflow then leaves 22, and phase margins that were 9
degrees off are 1 off."""

_SWASH = blocks.second_order("swash", omega=200.0, zeta=0.7)
"""What is known replaces the numbers."""

_MODELS = (
    _Model(YAW_BASE_SERVO, YAW_BASE.structure, ("ped",), "yaw_base"),
    _Model(
        replace(ROLLPITCH_SERVO, band=ROLLPITCH_IN1.band),
        structures.rollpitch_speeds,
        ("lat", "lon"),
        "rollpitch_in1",
        across=2.0,
        inflow=in_series(
            with_inflow(structures.rollpitch_speeds, "rollpitch_speeds_inflow"),
            inputs={"lat": _SWASH, "lon": _SWASH},
        ),
    ),
    _Model(HEAVE_SERVO, HEAVE.structure, ("col",), "heave"),
)
"""Roll and pitch from 3 rad/s, where p/lat and q/lon are 0.5 % off: flap-back, on which the slow
loops of an attitude law stand, is then known to a tenth. From 6 rad/s, as parameters are judged
from, it is up to 60 % off, and with it a phase margin at 4 rad/s by 2 degrees. Large slow motions
bend q/lat and p/lon by 3 to 5 % near 4 rad/s, so these are taken from 6."""


@dataclass(frozen=True)
class _Known:
    """What is known of an aircraft before it flies.

    Attributes:
        servos: their numbers; None if nothing is.
        late: by how much channels are recorded late, s; None if nothing is known.
        period: s, between the gyro's ticks.
        turn: s, 1 over the rotor's speed, negative for counter-clockwise; None if it isn't known.
    """

    servos: RigTest | None
    late: Mapping[str, float] | None
    period: float
    turn: float | None = None

    def within(self, model: _Model) -> Structure:
        """Return a model's structure with all that is known in it.

        Where servos and recorder are known, the delay is: it is the recorder's and half a period
        of held commands. Left free it would be known to 0.2 ms in yaw, which is 0.3 dB of a gain
        margin at 190 rad/s.
        """
        if self.servos is None:
            return model.plain
        return self._filled(model.spec.structure, model.spec)

    def with_inflow(self, model: _Model) -> Structure | None:
        """Return the structure with inflow, None where there is none or too little is known."""
        if model.inflow is None or self.servos is None or self.turn is None:
            return None
        return self._filled(model.inflow, model.spec).with_fixed({"turn": self.turn})

    def _filled(self, structure: Structure, spec: ModelSpec) -> Structure:
        if self.servos is None:
            return structure
        found = {name: self.servos[one.name] for name, one in spec.given.items()}
        return structure.with_fixed(
            {**{name: one.value for name, one in found.items()}, **self._delays(spec)},
            {name: one.standard_error or 0.0 for name, one in found.items()},
        )

    def _delays(self, spec: ModelSpec) -> dict[str, float]:
        if self.late is None:
            return {}
        late = [self.late.get(name, 0.0) for name in spec.outputs]
        if len(set(late)) > 1:  # a delay of an input is then none of all its responses
            return {}
        return {
            delay: late[0] - self.late.get(name, 0.0) + 0.5 * self.period
            for name, delay in spec.structure.input_delays.items()
        }


def identify_for_design(
    source: Source,
    *,
    axes: Sequence[str] = AXES,
    vehicle: Vehicle | None = None,
    servos: Servos | None = None,
    late: Mapping[str, float] | None = None,
    period: float | None = None,
    latency: float | None = None,
    stick_latency: Mapping[str, float] | None = None,
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
            a value and its standard error. By default what the vehicle's bench finds; without a
            bench what vehicle or records say; where nothing does, delays stand for the servos.
        late: by how much a channel is recorded late, s; by default what the records say.
        period: s, between the gyro's ticks; by default what the records say.
        latency: s, from sensing rates to their use by the gyro; by default what the records say.
        stick_latency: by how much a stick reaches the gyro late, s, by name, such as "PED" (the
            bench test of `reproduce` finds it to 0.1 ms); by default what the records say.
        seed: of the bench test.

    Raises:
        StorageError: a file can't be read.
        InputError: an axis was not swept, or a servo's number is unknown.
        IdentificationError: a model can't be identified.
    """
    flights = sweeps_of(source)
    chosen = _chosen(tuple(axis_of(axis).name for axis in axes), flights)
    records = [record for axis in AXES for record in flights.get(axis, ())]
    said = records[0].provenance
    own: Mapping[str, Any] = said.get("parameters") or {}
    if late is None and "recorder" in said:
        late = said["recorder"].get("latency") or {}
    if stick_latency is None and "gyro.ped_latency" in own:
        stick_latency = {"PED": own["gyro.ped_latency"]}
    ticks: float = own.get("gyro.period", _PERIOD) if period is None else period
    if servos is None:
        test = servos_of(vehicle or flown_vehicle(said), seed) or _said(own)
    else:
        test = _given(servos)
    speed = own.get("main_rotor.speed")
    turn = own.get("main_rotor.direction", 1.0) / speed if speed else None
    known = _Known(test, late, ticks, turn)
    return Plant(
        tuple(_identified(model, flights, known, own) for model in chosen),
        late=late or {},
        period=ticks,
        latency=own.get("gyro.latency", 0.0) if latency is None else latency,
        tilt=_tilt(records),
        stick_latency=stick_latency or {},
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
    return _said(vehicle.parameters)


def _said(own: Mapping[str, Any]) -> RigTest | None:
    if not set(_SERVOS.values()) <= set(own):
        return None
    return _given({name: float(own[key]) for name, key in _SERVOS.items()})


def _given(servos: Servos) -> RigTest:
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


def flown_vehicle(said: Mapping[str, Any]) -> Vehicle | None:
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
            f"Fly some{besides}",
            remedy=Command("fly", (), (Option("axis", missing[0]), Option("count", "5"))),
        )
    return chosen


def _identified(model: _Model, flights: Flights, known: _Known, own: Mapping[str, Any]) -> Fit:
    lacking = [axis for axis in model.spec.sweeps if not flights.get(axis)]
    sticks = [axis.upper() for axis in lacking]
    spec = replace(
        model.spec,
        sweeps=tuple(axis for axis in model.spec.sweeps if axis not in lacking),
        conditioning=tuple(name for name in model.spec.conditioning if name not in lacking),
        reference=tuple(name for name in model.spec.reference if name not in sticks),
        band=_band(model, flights, own),
    )
    response = frequency_response(spec, flights)
    low, high = spec.band
    bands = {
        f"{output}/{name}": (low if output in _own(name) else model.across * low, high)
        for output in spec.outputs
        for name in spec.inputs
    }
    fit = identify(response, known.within(model), band=bands)
    richer = known.with_inflow(model)
    if richer is None or _left(fit) < _MISFIT:
        return fit
    other = identify(response, richer, band=bands)
    return other if _left(other) < 0.5 * _left(fit) else fit


def _left(fit: Fit) -> float:
    """Return how many times what noise would leave a fit leaves, 0 where it isn't known."""
    return 0.0 if fit.misfit is None else fit.misfit.ratio or 0.0


def _own(command: str) -> tuple[str | None, ...]:
    axis = axis_of(command)
    return axis.rate, axis.angle


def _band(model: _Model, flights: Flights, own: Mapping[str, Any]) -> tuple[float, float]:
    """Return the vehicle's own band, or the JR700's, as far as the sweeps go."""
    low, high = model.spec.band
    if f"band.{model.section}_low" in own:
        low, high = (own[f"band.{model.section}_{edge}"] for edge in ("low", "high"))
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
