"""Tables that sum up one value: a record, a response, a plan, a vehicle."""

from __future__ import annotations

from math import degrees
from typing import TYPE_CHECKING, Any

import numpy as np

from helisim.ident import USABLE_COHERENCE, FrequencyResponse
from helisim.records.record import FlightRecord
from helisim.show.table import Column, Table, number, words

if TYPE_CHECKING:
    from helisim.sim import FlightPlan
    from helisim.vehicle import Linearization, Vehicle

_SPREAD = ".3g"


def channels(record: FlightRecord) -> Table:
    """Return the channels of a record with what they did."""
    return Table(
        "Channels",
        (
            *(Column(name, left=True) for name in ("channel", "unit", "kind")),
            *(Column(name) for name in ("mean", "std", "smallest", "largest")),
            Column("meaning", left=True),
        ),
        tuple(
            (
                words(one.name, "name"),
                words(one.unit, "unit"),
                words(one.kind, "unit"),
                *(
                    number(float(found), _SPREAD, unit=one.unit)
                    for found in (
                        np.mean(values),
                        np.std(values),
                        np.min(values),
                        np.max(values),
                    )
                ),
                words(one.meaning, "long text"),
            )
            for one, values in zip(record.channels, record.values.T)
        ),
    )


def pairs(found: FrequencyResponse) -> Table:
    """Return each pair of a response with its usable band and how well it is known there."""
    rows = []
    for o, output in enumerate(found.outputs):
        for i, input_ in enumerate(found.inputs):
            good = found.usable()[o, i]
            band = found.frequency[good]
            low, high = (float(band[0]), float(band[-1])) if band.size else (None, None)
            coherence, error = (
                float(np.median(values[o, i][good])) if band.size else None
                for values in (found.coherence, found.random_error)
            )
            rows.append(
                (
                    words(f"{output}/{input_}", "name"),
                    number(low, _SPREAD, unit="rad/s"),
                    number(high, _SPREAD, unit="rad/s"),
                    number(float(np.mean(good)) * 100.0, ".0f", unit="%"),
                    number(coherence, ".3f"),
                    number(None if error is None else 100.0 * error, ".2g", unit="% of"),
                )
            )
    return Table(
        f"Where the coherence is {USABLE_COHERENCE:g} or more",
        (
            Column("response", left=True),
            Column("from", unit="rad/s"),
            Column("to", unit="rad/s"),
            Column("usable", unit="%"),
            Column("coherence", label="median coherence"),
            Column("error", unit="%", label="median random error"),
        ),
        tuple(rows),
    )


def plan(shown: FlightPlan) -> Table:
    """Return the parts of a flight plan, each with the settings that aren't its defaults."""
    return Table(
        "Flight plan",
        (Column("part", left=True), Column("settings", left=True)),
        tuple((words(name, "name"), words(text, "long text")) for name, text in shown.in_words()),
    )


def vehicle(shown: Vehicle) -> Table:
    """Return the steady flight that a vehicle is in: attitude, controls, power."""
    trim = shown.trim
    facts: list[tuple[str, str, float, str]] = [
        ("mass", "kg", float(np.sum(shown.model.body_mass)), ".4g"),
        ("shaft power", "W", shown.power, ".4g"),
        ("speed", "m/s", trim.speed, ".4g"),
        ("height", "m", trim.height, ".4g"),
        *((name, "deg", degrees(getattr(trim, name)), ".3f") for name in ("phi", "theta")),
        *((name, "1", getattr(trim, name), ".4f") for name in ("col", "lon", "lat", "ped")),
        *((f"tilt {name}", "deg", degrees(getattr(trim, name)), ".3f") for name in ("a", "b")),
        ("time step", "s", float(shown.model.opt.timestep), ".4g"),
    ]
    return Table(
        "In trim",
        (Column("quantity", left=True), Column("unit", left=True), Column("value")),
        tuple(
            (words(name, "name"), words(unit, "unit"), number(value, form, unit=unit))
            for name, unit, value, form in facts
        ),
    )


def parameters(shown: Vehicle) -> Table:
    """Return every parameter of a vehicle with its source."""
    entries = [shown.parameters.entry(name) for name in shown.parameters]
    return Table(
        "Parameters",
        (
            *(Column("parameter", left=True), Column("unit", left=True)),
            *(Column("value"), Column("source", left=True)),
        ),
        tuple(
            (
                words(one.name, "name"),
                words(one.unit, "unit"),
                number(one.value, ".6g"),
                words(one.source, "long text"),
            )
            for one in entries
        ),
    )


def modes(shown: Linearization) -> Table:
    """Return the poles of a linear model, slowest first."""
    system: Any = shown.system
    poles = np.asarray(system.poles())
    if system.dt:
        poles = np.log(poles[np.abs(poles) > 0.0]) / system.dt
    found = sorted((p for p in poles if p.imag >= 0.0), key=abs)
    return Table(
        "Modes",
        (
            *(Column("real", unit="1/s"), Column("imaginary", unit="rad/s")),
            *(Column("frequency", unit="rad/s"), Column("damping ratio")),
        ),
        tuple(
            (
                number(float(pole.real), ".4g", unit="1/s"),
                number(float(pole.imag), ".4g", unit="rad/s"),
                number(float(abs(pole)), ".4g", unit="rad/s"),
                number(float(-pole.real / abs(pole)) if abs(pole) else None, ".3f"),
            )
            for pole in found
        ),
    )
